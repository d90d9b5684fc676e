//! Multi-queries (CHC+RT §5.1, after CHC++): invisible pairs of one tile that will probably stay invisible are asked
//! for in one query; when it fails, each is asked for by itself.

use super::PairQuery;

/// The value of a batch is greatest at 11 nodes at most, whatever their ages.
const MOST_NODES: usize = PairQuery::MOST_NODES;

/// Probability that a pair which has been invisible for `frames` frames stays so.
fn keeps(frames: u32) -> f64 {
    0.99 - 0.7 * (-f64::from(frames)).exp()
}

/// What a query over `nodes` nodes is worth that holds with probability `holds`: queries saved over the expected number
/// of queries, one and, where it fails, one a node.
fn value(nodes: usize, holds: f64) -> f64 {
    let nodes = nodes as f64;
    nodes / (1.0 + (1.0 - holds) * nodes)
}

/// Cuts pairs of one tile, the longest invisible first, into batches of the greatest value, each taken greedily from
/// the front; `frames` says for how many frames each has been invisible. Returns the sizes of the batches.
pub fn batches(frames: &[u32]) -> Vec<usize> {
    let mut sizes = Vec::new();
    let mut rest = frames;
    while !rest.is_empty() {
        let (mut size, mut holds, mut best) = (0, 1.0, 0.0);
        for &frames in rest.iter().take(MOST_NODES) {
            holds *= keeps(frames.max(1));
            let next = value(size + 1, holds);
            if next <= best {
                break;
            }
            (size, best) = (size + 1, next);
        }
        sizes.push(size);
        rest = &rest[size..];
    }
    sizes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sizes that follow from the formula, worked out apart.
    #[test]
    fn batches_grow_with_the_frames_that_pairs_have_been_invisible() {
        for (frames, size) in (1..=7).zip([3, 4, 5, 7, 9, 10, 10]) {
            assert_eq!(batches(&[frames; 40])[0], size, "after {frames} frames");
        }
        assert_eq!(batches(&[u32::MAX; 40])[0], 11);
    }

    #[test]
    fn every_pair_is_in_one_batch() {
        let frames: Vec<u32> = (0..100).rev().map(|i| i / 9).collect();
        let sizes = batches(&frames);
        assert_eq!(sizes.iter().sum::<usize>(), frames.len());
        assert!(sizes.iter().all(|&size| (1..=MOST_NODES).contains(&size)));
        assert!(batches(&[]).is_empty());
    }

    /// A young pair does not join old ones whose query it would probably make fail.
    #[test]
    fn the_young_are_apart_from_the_old() {
        assert_eq!(batches(&[20, 20, 20, 20, 1, 1]), [4, 2]);
    }
}
