//! Which ranges are fetched for spans: neighbours are joined where hardly anything lies between them.

use std::ops::Range;

/// Gaps take no more than this share of the bytes that are needed.
const GAP_SHARE: f64 = 0.03;
/// Longest gap that is fetched rather than left out, bytes: less than what a link carries in the time that a request
/// takes.
const MOST_GAP: u64 = 64 << 10;
/// A range that is as long as this is not joined with more: several connections carry more than one.
const LONG_RANGE: u64 = 8 << 20;

/// The ranges that cover `spans`, which ascend and do not overlap. Each span lies in one range.
pub(super) fn ranges(spans: &[Range<u64>]) -> Vec<Range<u64>> {
    let needed: u64 = spans.iter().map(|span| span.end - span.start).sum();
    let mut gaps: Vec<(u64, usize)> = spans
        .windows(2)
        .enumerate()
        .filter_map(|(at, pair)| match pair {
            [one, next] => Some((next.start.saturating_sub(one.end), at + 1)),
            _ => None,
        })
        .collect();
    gaps.sort_unstable();
    // The smallest gaps first: they save a request each, whatever their length.
    let mut left = (needed as f64 * GAP_SHARE) as u64;
    let mut is_joined = vec![false; spans.len()];
    for (gap, at) in gaps {
        if gap > left.min(MOST_GAP) {
            break;
        }
        left -= gap;
        if let Some(joined) = is_joined.get_mut(at) {
            *joined = true;
        }
    }
    let mut ranges: Vec<Range<u64>> = Vec::new();
    for (span, joined) in spans.iter().zip(is_joined) {
        match ranges.last_mut() {
            Some(last) if joined && last.end - last.start < LONG_RANGE => last.end = span.end,
            _ => ranges.push(span.clone()),
        }
    }
    ranges
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn neighbours_are_joined_and_distant_spans_are_not() {
        let kib = |start: u64, end: u64| (start << 10)..(end << 10);
        assert_eq!(ranges(&[]), []);
        assert_eq!(ranges(&[kib(4, 200), kib(200, 400), kib(404, 600)]), [kib(4, 600)]);
        assert_eq!(ranges(&[kib(4, 200), kib(300, 400)]), [kib(4, 200), kib(300, 400)]);
        // The smallest gaps are taken while they are a small share.
        let spans = [kib(0, 60), kib(65, 125), kib(126, 186)];
        assert_eq!(ranges(&spans), [kib(0, 60), kib(65, 186)]);
        // Long ranges go over several connections.
        assert_eq!(ranges(&[kib(0, 9000), kib(9000, 9100)]).len(), 2);
    }

    proptest! {
        #[test]
        fn ranges_cover_spans_and_little_else(parts in prop::collection::vec((0u64..200_000, 1u64..900_000), 0..80)) {
            let mut at = 0;
            let spans: Vec<_> = parts.iter().map(|&(gap, bytes)| {
                let start = at + gap;
                at = start + bytes;
                start..at
            }).collect();
            let all = ranges(&spans);
            for span in &spans {
                let holds = |range: &&Range<u64>| range.start <= span.start && span.end <= range.end;
                prop_assert_eq!(all.iter().filter(holds).count(), 1);
            }
            let bytes = |all: &[Range<u64>]| all.iter().map(|range| range.end - range.start).sum::<u64>();
            prop_assert!(bytes(&all) as f64 <= 1.05 * bytes(&spans) as f64);
        }
    }
}
