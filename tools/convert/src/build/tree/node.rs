//! Quantises the boxes of a wide node on the lattice, outward, in integers (docs/methods/exact.md, "Boxes").

#[cfg(test)]
use super::binary::Box3;
use super::wide::WideNode;
use crate::build::triangles::lattice::pow2;
use bricks::{Grid, Node, TopNode8};
#[cfg(test)]
use bricks::{NODE_WIDTH, ceil_shift};

/// Child boxes on the finest grids with steps of powers of two from `origin`, which is at most the node's least corner.
fn quantise(node: &WideNode, origin: [i64; 3]) -> Grid {
    Grid::over(
        &node.children.map(|child| child.map(|child| [child.bounds.min, child.bounds.max])),
        origin,
        node.bounds.max,
    )
}

/// The largest multiple of a power of two that is at most `x` and has a significand of 24 bits: an exact f32.
pub(super) fn floor_to_f32(x: i64) -> i64 {
    let bits = 64 - x.unsigned_abs().leading_zeros();
    let shift = bits.saturating_sub(24);
    // The floor of a negative number may take one more bit, which is then a power of two.
    x >> shift << shift
}

/// A node of a brick. Its boxes are relative to the brick's origin, in lattice steps of `2^step_unit_log2` device
/// units.
pub(crate) fn encode(node: &WideNode, step_unit_log2: i32) -> Node {
    let origin = node.bounds.min.map(floor_to_f32);
    let grid = quantise(node, origin);
    let (meta, inner_mask) = node.meta();
    // In f64 first: both factors and the product are exact in either type.
    let scale = pow2(step_unit_log2);
    Node {
        origin: origin.map(|x| (x as f64 * scale) as f32),
        // Within 1..=254: at most 2^47 steps of 2^-64 to 2^32 device units.
        exponent: grid.exponent.map(|exponent| (i32::from(exponent) + step_unit_log2 + 127) as u8),
        inner_mask,
        child_base: node.child_base,
        triangle_base: node.item_base,
        meta,
        lo: grid.lo,
        hi: grid.hi,
    }
}

/// A node of the top level. Its boxes are in steps of the world's lattice.
pub(super) fn encode_top(node: &WideNode) -> TopNode8 {
    let grid = quantise(node, node.bounds.min);
    let (meta, inner_mask) = node.meta();
    TopNode8 {
        origin: node.bounds.min,
        exponent: grid.exponent,
        inner_mask,
        child_base: node.child_base,
        leaf_base: node.item_base,
        meta,
        lo: grid.lo,
        hi: grid.hi,
        _reserved: 0,
    }
}

/// The box of a child of a node of a brick in lattice steps, as a kernel sees it; exact.
#[cfg(test)]
fn child_box(node: &Node, slot: usize, step_unit_log2: i32) -> Box3 {
    let corner = |grid: &[[u8; NODE_WIDTH]; 3]| {
        std::array::from_fn(|k| {
            let origin = (f64::from(node.origin[k]) * pow2(-step_unit_log2)) as i64;
            origin + (i64::from(grid[k][slot]) << (i32::from(node.exponent[k]) - 127 - step_unit_log2))
        })
    };
    Box3 { min: corner(&node.lo), max: corner(&node.hi) }
}

#[cfg(test)]
mod tests {
    use super::super::wide::WideChild;
    use super::*;
    use proptest::prelude::*;

    fn node(boxes: &[Box3]) -> WideNode {
        let bounds = boxes.iter().skip(1).fold(boxes[0], |all, b| all.union(b));
        let mut children = [None; NODE_WIDTH];
        for (child, &bounds) in children.iter_mut().zip(boxes) {
            *child = Some(WideChild { bounds, count: 1 });
        }
        WideNode { bounds, children, child_base: 0, item_base: 0 }
    }

    fn boxes(reach: i64) -> impl Strategy<Value = Vec<Box3>> {
        let point = prop::array::uniform3(-reach..=reach);
        prop::collection::vec((point.clone(), point).prop_map(|(a, b)| Box3::of(&[a, b])), 1..=8)
    }

    proptest! {
        #[test]
        fn boxes_contain_what_they_quantise(
            boxes in (0u32..46).prop_flat_map(|bits| boxes((1 << bits) - 1)),
            step_unit_log2 in -30..=10i32,
        ) {
            let encoded = encode(&node(&boxes), step_unit_log2);
            for (slot, b) in boxes.iter().enumerate() {
                let outer = child_box(&encoded, slot, step_unit_log2);
                prop_assert_eq!(outer.union(b), outer);
                for k in 0..3 {
                    // Tight to one grid step, where the node's origin is on the lattice point itself.
                    let grid = 1i64 << (i32::from(encoded.exponent[k]) - 127 - step_unit_log2);
                    prop_assert!(b.min[k] - outer.min[k] < grid && outer.max[k] - b.max[k] < grid);
                }
            }
            for slot in boxes.len()..8 {
                prop_assert!((0..3).all(|k| encoded.lo[k][slot] > encoded.hi[k][slot]));
            }
        }

        #[test]
        fn grids_are_the_finest(extent in 0i64..1 << 44) {
            let exponent = quantise(&node(&[Box3 { min: [5; 3], max: [5 + extent; 3] }]), [5; 3]).exponent[0];
            prop_assert!(ceil_shift(extent, exponent) <= 255);
            prop_assert!(exponent == 0 || ceil_shift(extent, exponent - 1) > 255);
        }

        #[test]
        fn floors_are_exact_and_close(x in -(1i64 << 47)..1 << 47) {
            let y = floor_to_f32(x);
            prop_assert!(y <= x && (x - y) * (1 << 23) <= x.abs());
            prop_assert_eq!(y as f32 as i64, y);
        }
    }

    #[test]
    fn small_coordinates_are_kept() {
        for x in [0, 1, -1, (1 << 24) - 1, -(1 << 24), 1 << 24] {
            assert_eq!(floor_to_f32(x), x);
        }
        assert_eq!(floor_to_f32((1 << 24) + 1), 1 << 24);
        assert_eq!(floor_to_f32(-(1 << 24) - 1), -(1 << 24) - 2);
    }
}
