//! The way of a ray or a point through a tree of boxes, about the nearest first: the wide top level, or a brick.
//!
//! Boxes are asked in f32, in frames in which these are small ([`Asks`]). What lies in leaves is the caller's, in f64.

use crate::kernels::simd::isa::Isa;
use crate::kernels::trace::node::inner_before;
use bricks::Node;
use std::ops::Range;

/// What a number holds: a leaf's first element, and in two bits how many follow it. Else it is that of a node.
const LEAF: u32 = 1 << 31;

/// What is left to be visited: in the high word how near it is at least, which is no negative number, so that it is
/// compared by its bits; in the low one what it is.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Open(u64);

impl Open {
    #[inline(always)]
    pub(super) fn new(near: f32, number: u32) -> Self {
        // The sum makes a zero of either sign positive.
        Self(u64::from((near + 0.0).to_bits()) << 32 | u64::from(number))
    }

    #[inline(always)]
    pub(super) fn near(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }

    #[inline(always)]
    pub(super) fn number(self) -> u32 {
        self.0 as u32
    }
}

/// The elements of what is a leaf.
#[inline(always)]
pub(super) fn elements(open: Open) -> Option<Range<u32>> {
    let number = open.number();
    let first = (number & !LEAF) >> 2;
    (number & LEAF != 0).then_some(first..first + (number & 3) + 1)
}

/// The number of what `number` names in a tree that is part of another: its nodes come after `nodes` of that, its
/// elements after `elements`.
#[inline(always)]
pub(super) fn moved(number: u32, nodes: u32, elements: u32) -> u32 {
    number + if number & LEAF != 0 { elements << 2 } else { nodes }
}

/// A node of up to eight children.
pub(super) trait Branch {
    /// The number of what it has in a slot, if there is something. Implementations are always inlined.
    fn child(&self, slot: u32) -> Option<u32>;

    /// Step and origin of the grid of its bounds on an axis. Implementations are always inlined.
    fn grid(&self, axis: usize) -> (f32, f32);

    /// The lower bounds of its children on an axis, or the upper ones, in steps. Implementations are always inlined.
    fn bounds<I: Isa>(&self, isa: I, axis: usize, is_upper: bool) -> I::Eight;
}

impl Branch for Node {
    #[inline(always)]
    fn child(&self, slot: u32) -> Option<u32> {
        let what = u32::from(self.meta[slot as usize]);
        if u32::from(self.inner_mask) >> slot & 1 != 0 {
            Some(self.child_base + inner_before(u32::from(self.inner_mask), slot))
        } else if what != 0 {
            Some(LEAF | (self.triangle_base + (what & 31)) << 2 | ((what >> 5).count_ones() - 1))
        } else {
            None
        }
    }

    #[inline(always)]
    fn grid(&self, axis: usize) -> (f32, f32) {
        (f32::from_bits(u32::from(self.exponent[axis]) << 23), self.origin[axis])
    }

    #[inline(always)]
    fn bounds<I: Isa>(&self, isa: I, axis: usize, is_upper: bool) -> I::Eight {
        isa.numbers(if is_upper { &self.hi[axis] } else { &self.lo[axis] })
    }
}

/// No less than the magnitude of any coordinate of a tree's boxes: its root's grid, and a step beside it, holds all.
pub(super) fn extent(nodes: &[Node]) -> f32 {
    nodes.first().map_or(0.0, |root| {
        let of = |k: usize| {
            let step = f32::from_bits(u32::from(root.exponent[k]) << 23);
            (root.origin[k] - step).abs().max((root.origin[k] + 256.0 * step).abs())
        };
        of(0).max(of(1)).max(of(2))
    })
}

/// What asks the boxes of a node's children.
pub(super) trait Asks<B: Branch> {
    /// Which children may matter, a bit each, and how near each is at least, no negative number: those no farther than
    /// `limit`. Implementations are always inlined.
    fn ask<I: Isa>(&self, isa: I, node: &B, limit: f32) -> (u32, [f32; 8]);
}

/// Calls `visit` for the leaves of a tree that `asks` may meet, with the elements of each and how near they are at
/// least; up to `limit`, and to what `visit` returns, until it returns none. `open` is room to work in.
///
/// Of a node's children the nearest is the next. The others wait in any order: most are too far by then, and sorting
/// them costs more than it saves.
#[inline(always)]
pub(super) fn walk<I: Isa, B: Branch>(
    isa: I,
    nodes: &[B],
    asks: &impl Asks<B>,
    mut limit: f32,
    open: &mut Vec<Open>,
    mut visit: impl FnMut(Range<u32>, f32) -> Option<f32>,
) {
    open.clear();
    if nodes.is_empty() {
        return;
    }
    let mut nearest = Some(Open::new(0.0, 0));
    while let Some(next) = nearest.take().or_else(
        #[inline(always)]
        || open.pop(),
    ) {
        if next.near() > limit {
            continue;
        }
        if let Some(all) = elements(next) {
            match visit(all, next.near()) {
                Some(now) => limit = now,
                None => return,
            }
            continue;
        }
        nearest = nearest_child(isa, &nodes[next.number() as usize], asks, limit, open);
    }
}

/// The nearest of the children of a node that `asks` may meet up to `limit`, if there is one; `open` gets the others.
#[inline(always)]
pub(super) fn nearest_child<I: Isa, B: Branch>(
    isa: I,
    node: &B,
    asks: &impl Asks<B>,
    limit: f32,
    open: &mut Vec<Open>,
) -> Option<Open> {
    let (mut left, near) = asks.ask(isa, node, limit);
    let mut nearest: Option<Open> = None;
    while left != 0 {
        let slot = left.trailing_zeros();
        left &= left - 1;
        let Some(number) = node.child(slot) else { continue };
        let own = Open::new(near[slot as usize], number);
        nearest = Some(nearest.map_or(
            own,
            #[inline(always)]
            |before| {
                open.push(before.max(own));
                before.min(own)
            },
        ));
    }
    nearest
}
