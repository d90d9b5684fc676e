//! Room for walks: what is left to be visited.

use super::space::Child;
use crate::kernels::trace::walk_brick::Group;

/// Room for walks.
#[derive(Default)]
pub(super) struct Room {
    /// Of the top level, by distances along a ray.
    pub(super) top: Vec<(f32, u32)>,
    /// Of a brick, for rays.
    pub(super) groups: Vec<Group>,
    /// Of the top level, by squared distances.
    pub(super) near: Vec<(f64, u32)>,
    /// Of bricks, likewise.
    pub(super) open: Vec<(f64, Child)>,
    /// Numbers of nodes.
    pub(super) nodes: Vec<u32>,
}

/// Sorts what has been pushed, the nearest last, on top.
#[inline(always)]
pub(super) fn nearest_on_top<T: PartialOrd, C>(stack: &mut [(T, C)]) {
    for i in 1..stack.len() {
        let mut k = i;
        while k > 0 && stack[k - 1].0 < stack[k].0 {
            stack.swap(k - 1, k);
            k -= 1;
        }
    }
}
