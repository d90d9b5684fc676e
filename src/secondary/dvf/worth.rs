//! Which cells of a field of visibility are worth being made anew, as far as numbers of triangles tell, before any is
//! read.

use super::mask::UNKNOWN;
use super::plan::Renewal;
use crate::kernels::layout::NONE;
use glam::DVec3;

/// Most triangles of bricks that are read for a frame: 48 MiB.
const MOST_TRIANGLES: u64 = 1 << 20;

/// What is counted in rays to the environment: to make anything anew at all, one ray of a cell, a triangle of a brick
/// that is read. Rays of a cell go everywhere and those of a pixel go in packets: as measured in larger scenes
/// (`docs/results/dvf.md`).
const BEGUN: f64 = 10_000.0;
pub(crate) const MADE: f64 = 4.0;
const READ: f64 = 0.25;

/// How often the budget is looked for among cells by what they are expected to take: those that take less make room for
/// more.
const LOOKED_FOR: f64 = 2.0;

/// A cell that may be made anew.
pub(crate) struct Candidate {
    pub cell: u32,
    /// Primary hits that lie in it.
    pub seen: u32,
    /// Directions that what moves concerns, as a mask has them.
    pub texels: Vec<u32>,
    /// Rays that this saves, if they are drawn evenly from all directions: as many as were answered when nothing had
    /// moved.
    pub saves: f64,
    /// Rays that it is expected to take.
    pub takes: f64,
}

impl Candidate {
    /// Share of all directions.
    pub fn share(&self) -> f64 {
        let texels: u32 = self.texels.iter().map(|word| word.count_ones()).sum();
        f64::from(texels) / (32 * self.texels.len()) as f64
    }
}

/// A box of a leaf, world units, and how many triangles its brick holds.
pub(crate) type LeafBox = ([DVec3; 2], u64);

/// What is worth being looked at.
pub(crate) struct Worth {
    /// Those of the candidates, in their order.
    pub candidates: Vec<Candidate>,
    /// How many rays could be traced while triangles are read for them, of the budget.
    pub read: u64,
}

impl Worth {
    /// Of candidates those that are expected to save more than they take, and of these, in their order, as many as save
    /// most beyond what is read for all together, within the budget.
    pub fn of(renewal: &Renewal, leaves: &[LeafBox], mut candidates: Vec<Candidate>) -> Self {
        estimate(renewal, leaves, &mut candidates);
        candidates.retain(|candidate| MADE * candidate.takes <= candidate.saves);
        let read_by = leaves_of(renewal, leaves, &candidates);
        let mut is_read = vec![false; leaves.len()];
        let (mut taken, mut best) = (Vec::new(), Self { candidates: Vec::new(), read: 0 });
        let (mut takes, mut saves, mut triangles, mut most) = (0.0, 0.0, 0, (0, BEGUN));
        for (candidate, read_by) in candidates.into_iter().zip(read_by) {
            let own: u64 = read_by.iter().filter(|&&leaf| !is_read[leaf]).map(|&leaf| leaves[leaf].1).sum();
            let left = renewal.rays as f64 - READ * (triangles + own) as f64;
            if triangles + own > MOST_TRIANGLES || takes + candidate.takes > LOOKED_FOR * left {
                continue;
            }
            read_by.iter().for_each(|&leaf| is_read[leaf] = true);
            (takes, saves, triangles) = (takes + candidate.takes, saves + candidate.saves, triangles + own);
            taken.push(candidate);
            let read = READ * triangles as f64;
            let wins = saves - MADE * takes - read;
            if wins > most.1 {
                (most, best.read) = ((taken.len(), wins), read.ceil() as u64);
            }
        }
        taken.truncate(most.0);
        Self { candidates: taken, ..best }
    }
}

/// Expects what candidates take: that points by area are as many in every known cell, and what raising their numbers to
/// whole ones adds to those of a leaf's triangles as many in every known cell of its box; in all of them where none is
/// known.
fn estimate(renewal: &Renewal, leaves: &[LeafBox], candidates: &mut [Candidate]) {
    let Renewal { kept, settings, .. } = renewal;
    let (shape, labels) = (kept.field.shape, &kept.field.labels);
    let triangles: u64 = leaves.iter().map(|(_, own)| own).sum();
    let raised = if settings.round { 0.0 } else { (1.0 - f64::from(settings.points) / triangles as f64).max(0.5) };
    let even = f64::from(settings.points) / kept.field.known_cells().max(1) as f64;
    let mut points = vec![even; labels.len()];
    for (bounds, own) in leaves {
        let is_known = |cell: &u32| labels[*cell as usize] != UNKNOWN;
        let known = shape.cells_of(*bounds).filter(is_known).count();
        let among = if known > 0 { known } else { shape.cells_of(*bounds).count() };
        for cell in shape.cells_of(*bounds).filter(|cell| known == 0 || is_known(cell)) {
            points[cell as usize] += raised * *own as f64 / among as f64;
        }
    }
    let rays = f64::from(settings.rays) * if settings.both { 2.0 } else { 1.0 };
    for candidate in candidates {
        candidate.takes = points[candidate.cell as usize] * rays * candidate.share();
    }
}

/// Of each candidate the leaves whose boxes meet its cell.
fn leaves_of(renewal: &Renewal, leaves: &[LeafBox], candidates: &[Candidate]) -> Vec<Vec<usize>> {
    let field = &renewal.kept.field;
    let mut rank = vec![NONE; field.labels.len()];
    (0..).zip(candidates).for_each(|(i, candidate)| rank[candidate.cell as usize] = i);
    let mut met = vec![Vec::new(); candidates.len()];
    for (leaf, (bounds, _)) in leaves.iter().enumerate() {
        let ranks = field.shape.cells_of(*bounds).map(|cell| rank[cell as usize]);
        ranks.filter(|&rank| rank != NONE).for_each(|rank| met[rank as usize].push(leaf));
    }
    met
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::secondary::dvf::{Areas, DvfField, DvfKept, DvfSettings, DvfTracing, Region, Shape, mask};
    use std::sync::Arc;

    const RAYS: u32 = 64;

    /// Of ten cells in a row, of all of which something is known, strewn with 10 points each by area and one more for
    /// every triangle or so.
    fn renewal(rays: u64) -> Renewal {
        let shape = Shape { corner: DVec3::ZERO, side: 1.0, size: [10, 1, 1], octahedral: 8 };
        let mut field = DvfField::unknown(shape);
        field.masks.fill(1);
        field.finish(false);
        let settings = DvfSettings { points: 100, rays: RAYS, octahedral: 8, ..DvfSettings::default() };
        Renewal {
            kept: Arc::new(DvfKept { field, areas: Areas { scale: 1.0, total: 1.0 } }),
            settings,
            region: Region { min: DVec3::ZERO, max: DVec3::ONE, bricks: None },
            tracing: DvfTracing::over(1),
            rays,
            frames: 1,
        }
    }

    /// A leaf within so many cells after the first.
    fn leaf(first: u32, cells: u32, triangles: u64) -> LeafBox {
        let (from, to) = (f64::from(first) + 0.2, f64::from(first + cells) - 0.2);
        ([DVec3::new(from, 0.1, 0.1), DVec3::new(to, 0.2, 0.2)], triangles)
    }

    /// In half of whose directions something is concerned.
    fn candidate(cell: u32, saves: f64) -> Candidate {
        let texels = vec![u32::MAX, 0];
        assert_eq!(texels.len(), mask::words(8));
        Candidate { cell, seen: 1, texels, saves, takes: 0.0 }
    }

    fn cells(worth: &Worth) -> Vec<u32> {
        worth.candidates.iter().map(|candidate| candidate.cell).collect()
    }

    #[test]
    fn what_cannot_pay_is_not_looked_at() {
        // A point a triangle: 9.99M of them, of 32 rays each in a cell's half of directions.
        let leaves = [leaf(0, 9, 9_000_000), leaf(9, 1, 1000)];
        let takes = 32.0 * 1010.0;
        let of = |saves: [f64; 2]| {
            Worth::of(&renewal(1 << 40), &leaves, vec![candidate(3, saves[0]), candidate(9, saves[1])])
        };
        let pays = MADE * takes + READ * 1000.0 + BEGUN;
        assert_eq!(cells(&of([10.0 * pays, 1.01 * pays])), [9]);
        assert_eq!(of([10.0 * pays, 1.01 * pays]).read, 250);
        assert!(cells(&of([10.0 * pays, 0.99 * pays])).is_empty());
        // Where it saves enough, but for what is held in memory, which no budget changes.
        assert!(cells(&of([1e12, 0.0])).is_empty());
    }

    #[test]
    fn what_is_read_is_shared_out_and_the_budget_holds() {
        // A brick over five cells, that one of them alone does not pay for.
        let leaves = [leaf(0, 5, 500_000), leaf(5, 1, 10)];
        let (takes, read) = (32.0 * (10.0 + 100_000.0), READ * 500_000.0);
        let saves = MADE * takes + 0.3 * read;
        let of = |count: u32, rays: u64, also: f64| {
            let others = (0..count).map(|cell| candidate(cell, saves));
            Worth::of(&renewal(rays), &leaves, others.chain([candidate(5, also)]).collect())
        };
        assert!(cells(&of(3, 1 << 40, 0.0)).is_empty());
        assert_eq!(cells(&of(5, 1 << 40, 0.0)), [0, 1, 2, 3, 4]);
        // A budget that these exceed leaves room for others; one that holds two of them, together with others, takes no
        // others that pay no more.
        let small = (0.9 * (takes / LOOKED_FOR + read)) as u64;
        assert_eq!(cells(&of(5, small, 1e6)), [5]);
        assert!(cells(&of(5, 0, 1e6)).is_empty());
        let one_more = (1.01 * (4.0 * takes / LOOKED_FOR + read)) as u64;
        assert_eq!(cells(&of(5, one_more, 0.0)), [0, 1, 2, 3]);
    }

    #[test]
    fn points_are_expected_where_something_is_known() {
        let of = |round: bool, both: bool, triangles: u64| {
            let mut renewal = renewal(1);
            (renewal.settings.round, renewal.settings.both) = (round, both);
            if let Some(kept) = Arc::get_mut(&mut renewal.kept) {
                kept.field.labels[1] = UNKNOWN;
            }
            let mut candidates = vec![candidate(0, 1.0), candidate(1, 1.0), candidate(2, 1.0)];
            estimate(&renewal, &[leaf(0, 3, triangles)], &mut candidates);
            candidates.iter().map(|candidate| candidate.takes / 32.0).collect::<Vec<_>>()
        };
        let even = 100.0 / 9.0;
        let is = |found: Vec<f64>, expected: [f64; 3]| {
            assert!(found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-9), "{found:?}");
        };
        // Few large triangles have half a point more each, many small ones one.
        is(of(false, false, 20), [even + 5.0, even, even + 5.0]);
        is(of(false, false, 200), [even + 50.0, even, even + 50.0]);
        assert!(of(false, false, 1_000_000)[0] > 499_900.0);
        is(of(true, false, 20), [even; 3]);
        is(of(true, true, 20), [2.0 * even; 3]);
    }
}
