//! Distances to triangles, and the nearest of many.

use super::vector::{Vec3, add_scaled, dot, square, sub};
use crate::build::tree::binary::{BinaryTree, Box3, LEAF};

/// The square of the distance of `p` from a triangle, which may have no area.
pub(super) fn distance2(p: Vec3, triangle: &[Vec3; 3]) -> f64 {
    closest(p, triangle).0
}

/// The same, with the weights of the corners at the nearest point. What it is the distance to is a point of the
/// triangle but for rounding, so it is never less than the true one by more than that.
#[inline]
pub(super) fn closest(p: Vec3, [a, b, c]: &[Vec3; 3]) -> (f64, Vec3) {
    let (ab, ac, ap) = (sub(*b, *a), sub(*c, *a), sub(p, *a));
    // Ericson 2005, "Real-Time Collision Detection", 5.1.5.
    let (d1, d2) = (dot(ab, ap), dot(ac, ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return (square(ap), [1.0, 0.0, 0.0]);
    }
    let bp = sub(p, *b);
    let (d3, d4) = (dot(ab, bp), dot(ac, bp));
    if d3 >= 0.0 && d4 <= d3 {
        return (square(bp), [0.0, 1.0, 0.0]);
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let v = share(d1, d1 - d3);
        return (square(add_scaled(ap, -v, ab)), [1.0 - v, v, 0.0]);
    }
    let cp = sub(p, *c);
    let (d5, d6) = (dot(ab, cp), dot(ac, cp));
    if d6 >= 0.0 && d5 <= d6 {
        return (square(cp), [0.0, 0.0, 1.0]);
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let w = share(d2, d2 - d6);
        return (square(add_scaled(ap, -w, ac)), [1.0 - w, 0.0, w]);
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let w = share(d4 - d3, (d4 - d3) + (d5 - d6));
        return (square(add_scaled(bp, -w, sub(*c, *b))), [0.0, 1.0 - w, w]);
    }
    let all = va + vb + vc;
    let (v, w) = (share(vb, all), share(vc, all));
    let w = w.min(1.0 - v);
    (square(add_scaled(add_scaled(ap, -v, ab), -w, ac)), [1.0 - v - w, v, w])
}

/// a / b within 0 to 1; 0 where there is no b.
fn share(a: f64, b: f64) -> f64 {
    if b > 0.0 { (a / b).clamp(0.0, 1.0) } else { 0.0 }
}

#[derive(Clone, Copy, Debug)]
struct Node {
    min: Vec3,
    max: Vec3,
    left: u32,
    right: u32,
}

impl Node {
    fn distance2(&self, p: Vec3) -> f64 {
        let beyond = |k: usize| (self.min[k] - p[k]).max(p[k] - self.max[k]).max(0.0);
        square([beyond(0), beyond(1), beyond(2)])
    }
}

/// A tree over triangles.
#[derive(Debug)]
pub(super) struct Nearest<'a> {
    triangles: &'a [[Vec3; 3]],
    nodes: Vec<Node>,
}

impl<'a> Nearest<'a> {
    /// Over at least one triangle; corners are whole numbers.
    pub fn over(triangles: &'a [[Vec3; 3]]) -> Self {
        let whole = |triangle: &[Vec3; 3]| Box3::of(&triangle.map(|p| p.map(|x| x as i64)));
        let boxes: Vec<Box3> = triangles.iter().map(whole).collect();
        let tree = BinaryTree::by_obvhs(&boxes, true);
        let nodes = tree.nodes.iter().map(|node| Node {
            min: node.bounds.min.map(|x| x as f64),
            max: node.bounds.max.map(|x| x as f64),
            left: node.left,
            right: node.right,
        });
        Self { triangles, nodes: nodes.collect() }
    }

    /// The nearest triangle to `p` with the square of its distance.
    pub fn of(&self, p: Vec3) -> (f64, u32) {
        let mut best = (f64::INFINITY, 0);
        let mut stack = Vec::with_capacity(64);
        stack.push((self.nodes[0].distance2(p), 0u32));
        while let Some((distance, index)) = stack.pop() {
            if distance >= best.0 {
                continue;
            }
            let node = &self.nodes[index as usize];
            if node.right == LEAF {
                let found = distance2(p, &self.triangles[node.left as usize]);
                if found < best.0 {
                    best = (found, node.left);
                }
                continue;
            }
            let [left, right] = [node.left, node.right].map(|child| (self.nodes[child as usize].distance2(p), child));
            let (near, far) = if left.0 <= right.0 { (left, right) } else { (right, left) };
            stack.extend([far, near]);
        }
        best
    }
}
