//! Checks of one wide node, the same for bricks and for the top level.

use crate::error::{Flaw, Part};
use crate::records::{NODE_WIDTH, Node, TopNode8};
use std::mem::offset_of;

/// One byte of each lane.
const ONES: u64 = 0x0101_0101_0101_0101;
/// `meta` of a node whose children are all inner: `0b001_00000 | (24 + i)` in lane `i`.
const INNER_META: u64 = 0x3f3e_3d3c_3b3a_3938;

/// What links a wide node to its children.
#[derive(Clone, Copy, Debug)]
pub(super) struct NodeView {
    /// `meta`, child 0 in the lowest byte.
    pub(super) meta: u64,
    pub(super) inner_mask: u8,
    pub(super) child_base: u32,
    pub(super) leaf_base: u32,
}

/// What is wrong with a node.
#[derive(Debug)]
pub(super) struct NodeFlaw {
    found: String,
    expected: String,
}

impl NodeFlaw {
    /// As a flaw in `part`, for the node called `name`.
    pub(super) fn of_node(self, part: Part, name: impl std::fmt::Display) -> Flaw {
        Flaw { part, found: format!("{name} with {}", self.found), expected: self.expected }
    }
}

impl NodeView {
    pub(super) fn of(node: &Node) -> Self {
        Self {
            meta: u64::from_le_bytes(node.meta),
            inner_mask: node.inner_mask,
            child_base: node.child_base,
            leaf_base: node.triangle_base,
        }
    }

    pub(super) fn of_top(node: &TopNode8) -> Self {
        Self {
            meta: u64::from_le_bytes(node.meta),
            inner_mask: node.inner_mask,
            child_base: node.child_base,
            leaf_base: node.leaf_base,
        }
    }

    /// The links of a [`Node`] in its bytes.
    #[inline]
    pub(super) fn of_bytes(node: &[u8; size_of::<Node>()]) -> Self {
        let word = |at: usize| u32::from_le_bytes([node[at], node[at + 1], node[at + 2], node[at + 3]]);
        let at = offset_of!(Node, meta);
        Self {
            meta: u64::from(word(at)) | u64::from(word(at + 4)) << 32,
            inner_mask: node[offset_of!(Node, inner_mask)],
            child_base: word(offset_of!(Node, child_base)),
            leaf_base: word(offset_of!(Node, triangle_base)),
        }
    }

    /// Whether the quantisation grid in the bytes of a [`Node`] is finite: its origin, and its exponents, which are
    /// those of normal numbers.
    #[inline]
    pub(super) fn has_finite_boxes(node: &[u8; size_of::<Node>()]) -> bool {
        let origin = &node[offset_of!(Node, origin)..][..12];
        let exponents = &node[offset_of!(Node, exponent)..][..3];
        // An exponent field of ones is that of an infinity or of what is no number.
        origin.as_chunks::<4>().0.iter().all(|x| u32::from_le_bytes(*x) >> 23 & 255 != 255)
            && exponents.iter().all(|exponent| (1..255).contains(exponent))
    }

    /// Number of inner children.
    #[inline]
    pub(super) fn inner_count(&self) -> u32 {
        self.inner_mask.count_ones()
    }

    /// Leaf children: their slot, first item relative to the whole, and number of items. For nodes that [`Self::check`]
    /// finds right.
    pub(super) fn leaves(self) -> impl Iterator<Item = (usize, u32, u32)> {
        self.meta
            .to_le_bytes()
            .into_iter()
            .enumerate()
            .filter(move |&(slot, meta)| meta != 0 && !self.is_inner(slot))
            .map(move |(slot, meta)| (slot, self.leaf_base + u32::from(meta & 31), (meta >> 5).count_ones()))
    }

    /// Whether the child in `slot` exists. For nodes that [`Self::check`] finds right.
    pub(super) fn has_child(&self, slot: usize) -> bool {
        self.meta >> (8 * slot) & 0xff != 0
    }

    fn is_inner(&self, slot: usize) -> bool {
        self.inner_mask >> slot & 1 != 0
    }

    /// Checks that every child is well-formed, inner children follow node `index` and are less than `node_count`, and
    /// items of leaf children are less than `item_count`.
    #[inline]
    pub(super) fn check(&self, index: u32, node_count: u32, item_count: u32, items: &str) -> Result<(), NodeFlaw> {
        let meta = self.meta;
        // Lane by lane, in the lowest bit of each byte: a child is inner if its low five bits are 24 or more.
        let inner = (meta >> 3) & (meta >> 4) & ONES;
        let inner_lanes = inner * 0xff;
        let inner_right = (meta ^ INNER_META) & inner_lanes == 0;
        // Gathers the lowest bit of byte i into bit i: the product's top byte sums bit i shifted to 56 + i.
        let mask_right = (inner.wrapping_mul(0x0102_0408_1020_4080) >> 56) as u8 == self.inner_mask;
        // The unary count of a leaf: bit 7 only with bit 6, bit 6 only with bit 5; without bit 5 the child is absent,
        // 0.
        let (one, two, three) = (meta >> 5 & ONES, meta >> 6 & ONES, meta >> 7 & ONES);
        let low = meta | meta >> 1 | meta >> 2 | meta >> 3 | meta >> 4;
        let unary_right = ((three & !two) | (two & !one) | (low & ONES & !one)) == 0;
        // No leaf reaches beyond 23 + 3 items of its base, so the exact ends matter only close to the end.
        let has_leaf = meta & !inner_lanes != 0;
        let items_right = !has_leaf
            || u64::from(self.leaf_base) + 26 <= u64::from(item_count)
            || self.leaf_end() <= u64::from(item_count);
        let children_right = self.inner_mask == 0
            || (self.child_base > index
                && u64::from(self.child_base) + u64::from(self.inner_count()) <= u64::from(node_count));
        if inner_right & mask_right & unary_right & items_right & children_right {
            return Ok(());
        }
        Err(self.describe(inner_right & mask_right & unary_right, items_right, index, node_count, item_count, items))
    }

    /// One past the greatest item of the leaf children.
    #[cold]
    fn leaf_end(&self) -> u64 {
        let metas = self.meta.to_le_bytes();
        let leaves = (0..NODE_WIDTH).filter(|&slot| metas[slot] != 0 && metas[slot] & 0b11000 != 0b11000);
        leaves.map(|slot| u64::from(metas[slot] & 31) + u64::from((metas[slot] >> 5).count_ones())).max().unwrap_or(0)
            + u64::from(self.leaf_base)
    }

    #[cold]
    fn describe(
        &self,
        meta_right: bool,
        items_right: bool,
        index: u32,
        node_count: u32,
        item_count: u32,
        items: &str,
    ) -> NodeFlaw {
        if !meta_right {
            NodeFlaw {
                found: format!("children {:02x?} and inner mask {:08b}", self.meta.to_le_bytes(), self.inner_mask),
                expected: "well-formed children".to_owned(),
            }
        } else if !items_right {
            NodeFlaw { found: format!("{items} up to {}", self.leaf_end()), expected: format!("at most {item_count}") }
        } else {
            NodeFlaw {
                found: format!("{} inner children from {}", self.inner_count(), self.child_base),
                expected: format!("children after node {index} and before {node_count}"),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// [`NodeView::check`], child by child as [`Node`] describes it.
    fn plain(view: &NodeView, index: u32, node_count: u32, item_count: u32) -> bool {
        let mut inner = 0u64;
        for (slot, meta) in view.meta.to_le_bytes().into_iter().enumerate() {
            let bit = view.inner_mask >> slot & 1 != 0;
            if bit {
                if meta != 0b001_00000 | (24 + slot as u8) {
                    return false;
                }
                inner += 1;
            } else if meta != 0 {
                let (count, first) = (meta >> 5, meta & 31);
                if ![1, 3, 7].contains(&count) || first >= 24 {
                    return false;
                }
                if u64::from(view.leaf_base) + u64::from(first) + u64::from(count.count_ones()) > u64::from(item_count)
                {
                    return false;
                }
            }
        }
        inner == 0 || (view.child_base > index && u64::from(view.child_base) + inner <= u64::from(node_count))
    }

    /// Children that are mostly right.
    fn child(slot: u8) -> impl Strategy<Value = u8> {
        prop_oneof![
            6 => Just(0x38 + slot),
            6 => (prop::sample::select(vec![1u8, 3, 7]), 0u8..24).prop_map(|(count, first)| count << 5 | first),
            3 => Just(0),
            1 => any::<u8>(),
        ]
    }

    fn view() -> impl Strategy<Value = NodeView> {
        let metas = (child(0), child(1), child(2), child(3), child(4), child(5), child(6), child(7));
        let bases = (prop_oneof![0u32..40, any::<u32>()], prop_oneof![0u32..40, any::<u32>()]);
        (metas, prop_oneof![9 => Just(0), 1 => any::<u8>()], bases).prop_map(|(m, spoil, (child_base, leaf_base))| {
            let metas = [m.0, m.1, m.2, m.3, m.4, m.5, m.6, m.7];
            let mask = (0..8).filter(|&slot| metas[slot] & 24 == 24).fold(0u8, |mask, slot| mask | 1 << slot);
            NodeView { meta: u64::from_le_bytes(metas), inner_mask: mask ^ spoil, child_base, leaf_base }
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]
        #[test]
        fn check_is_the_plain_check(view in view(), index in 0u32..40, nodes in 0u32..60, items in 0u32..60) {
            prop_assert_eq!(view.check(index, nodes, items, "triangles").is_ok(), plain(&view, index, nodes, items));
        }
    }

    #[test]
    fn generated_nodes_are_of_both_kinds() {
        use proptest::strategy::ValueTree;
        let mut runner = proptest::test_runner::TestRunner::deterministic();
        let right = (0..2000).filter(|_| {
            let view = view().new_tree(&mut runner).unwrap().current();
            plain(&view, 0, u32::MAX, u32::MAX)
        });
        let right = right.count();
        assert!((200..1800).contains(&right), "{right} of 2000 nodes are right");
    }

    #[test]
    fn all_single_metas() {
        for slot in 0..8 {
            for meta in 0..=255u8 {
                for inner_mask in [0, 1 << slot, 1 << (slot ^ 1)] {
                    let view =
                        NodeView { meta: u64::from(meta) << (8 * slot), inner_mask, child_base: 5, leaf_base: 9 };
                    for items in 9..40 {
                        let right = view.check(4, 6, items, "triangles").is_ok();
                        assert_eq!(right, plain(&view, 4, 6, items), "slot {slot} meta {meta:#x} mask {inner_mask}");
                    }
                }
            }
        }
    }
}
