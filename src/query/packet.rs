//! Rays that go much the same way, eight at a time: all of them ask a box at once, and a triangle whether they miss it.
//! What they meet is decided ray by ray, as it is of one alone.
//!
//! Such rays enter much the same boxes. A box in eight lanes costs about as much as one node by a ray alone, but what a
//! walk waits for most, memory and branches that turn out otherwise, is there once for eight.

use super::aims::{Aims, Locals, Told};
use super::flat::Flat;
use super::room::Joint;
use super::space::{Geometry, Placed};
use super::top::Top;
use super::walk::{Branch, Open, elements};
use crate::kernels::simd::isa::Isa;
use crate::kernels::simd::wide::{Wide, three};
use glam::DVec3;
use std::ops::Range;

/// Rays that go together.
pub(super) const MANY: usize = 8;

/// All of them, a bit each.
pub(super) const ALL: u32 = (1 << MANY) - 1;

/// By how much the components of their directions differ at most, of the greatest.
const TURNED: f64 = 1.0 / 32.0;

/// How far apart they begin at most, of the scene's extent.
const APART: f64 = 1.0 / 64.0;

/// So many rays at least go through a brick together.
const LEAST: u32 = 3;

/// Rays on their way together.
pub(super) struct Packet<'a> {
    aims: &'a Aims<MANY>,
    /// Of all directions.
    is_negative: [bool; 3],
}

impl<'a> Packet<'a> {
    /// `None`: the rays do not go much the same way, or not all of them come near the scene.
    #[inline(always)]
    pub(super) fn new(top: &Top, aims: &'a Aims<MANY>) -> Option<Self> {
        if aims.come != ALL {
            return None;
        }
        let (origin, direction) = (&aims.lines.origin, &aims.lines.direction);
        let longest = three!(k => direction[k][0].abs()).into_iter().fold(0.0, f64::max);
        let (turned, apart) = (TURNED * longest, APART * f64::from(top.extent) * top.frame.unit);
        let is_negative = three!(k => aims.inverse[k][0].is_sign_negative());
        let mut are_alike = true;
        for k in 0..3 {
            for i in 0..MANY {
                are_alike &= (direction[k][i] - direction[k][0]).abs() <= turned;
                are_alike &= (origin[k][i] - origin[k][0]).abs() <= apart;
                are_alike &= aims.inverse[k][i].is_sign_negative() == is_negative[k];
            }
        }
        are_alike.then_some(Self { aims, is_negative })
    }

    /// No less than distances along the rays of what is met at `t`, in a frame.
    #[inline(always)]
    fn limits(&self, told: &Told, t: &[f64; MANY]) -> [f32; MANY] {
        let mut limits = [0.0; MANY];
        for i in 0..MANY {
            limits[i] = told.above(self.aims.limit(i, t[i]));
        }
        limits
    }

    /// Calls `visit` for the leaves of the top level that rays may enter up to `t`, with where at the earliest, and
    /// which rays; and up to what it returns. As [`Aim::leaves`].
    #[inline(always)]
    pub(super) fn leaves<I: Isa>(
        &self,
        isa: I,
        top: &Top,
        open: &mut Vec<Joint>,
        t: [f64; MANY],
        mut visit: impl FnMut(u32, f64, u32) -> [f64; MANY],
    ) {
        let unit = top.frame.unit;
        let locals = self.aims.locals((top.frame.origin, top.extent), top.per_unit, (0.0, top.step));
        let limits = self.limits(&locals.told, &t);
        self.walk(
            isa,
            (top.nodes.as_slice(), &locals),
            ALL,
            limits,
            open,
            #[inline(always)]
            |leaf, near, who| self.limits(&locals.told, &visit(leaf.start, f64::from(near) * unit, who)),
        );
    }

    /// Calls `visit` for triangles of a brick, their vertices, and the rays of `who` that may meet them up to `t`, and
    /// to what `visit` returns. As [`Aim::triangles`]. False: nothing was done, for the rays are to go alone.
    #[inline(always)]
    pub(super) fn triangles<I: Isa>(
        &self,
        isa: I,
        brick: &Placed,
        (from, who): (f64, u32),
        open: &mut Vec<Joint>,
        t: [f64; MANY],
        visit: impl FnMut(u32, [DVec3; 3], usize) -> f64,
    ) -> bool {
        let is_known = (0..MANY).fold(
            true,
            #[inline(always)]
            |all, i| all & self.aims.is_known(i, brick, from),
        );
        if who.count_ones() < LEAST || brick.matrix.is_some() || !is_known {
            return false;
        }
        let &Geometry { origin, per_unit, step, extent, .. } = brick.geometry;
        let locals = self.aims.locals((origin, extent), per_unit, (from, step));
        let nodes = brick.geometry.view.nodes;
        let tree = (nodes, &locals, |triangle| brick.vertices(triangle));
        self.through(isa, tree, who, open, t, visit);
        true
    }

    /// The same for all rays, of the whole scene.
    #[inline(always)]
    pub(super) fn triangles_of_all<I: Isa>(
        &self,
        isa: I,
        (top, flat): (&Top, &Flat),
        open: &mut Vec<Joint>,
        t: [f64; MANY],
        visit: impl FnMut(u32, [DVec3; 3], usize) -> f64,
    ) {
        let locals = flat.locals(top, self.aims);
        let tree = (flat.nodes.as_slice(), &locals, |triangle| flat.vertices(triangle));
        self.through(isa, tree, ALL, open, t, visit);
    }

    /// Calls `visit` for triangles of a tree, whose `vertices` are told, as of [`Packet::triangles`].
    #[inline(always)]
    fn through<I: Isa>(
        &self,
        isa: I,
        (nodes, locals, vertices): (&[impl Branch], &Locals<MANY>, impl Fn(u32) -> [DVec3; 3]),
        who: u32,
        open: &mut Vec<Joint>,
        mut t: [f64; MANY],
        mut visit: impl FnMut(u32, [DVec3; 3], usize) -> f64,
    ) {
        let mut limits = self.limits(&locals.told, &t);
        self.walk(
            isa,
            (nodes, locals),
            who,
            limits,
            open,
            #[inline(always)]
            |triangles, _, who| {
                for triangle in triangles {
                    let vertices = vertices(triangle);
                    let mut left = who & !self.aims.lines.surely_miss(vertices);
                    while left != 0 {
                        let ray = left.trailing_zeros() as usize;
                        left &= left - 1;
                        let now = visit(triangle, vertices, ray);
                        if now != t[ray] {
                            t[ray] = now;
                            limits[ray] = locals.told.above(self.aims.limit(ray, now));
                        }
                    }
                }
                limits
            },
        );
    }

    /// As [`super::walk::walk`], for the rays of `who`: `visit` is told which of them may meet a leaf, and returns the
    /// limits of all.
    #[inline(always)]
    fn walk<I: Isa>(
        &self,
        isa: I,
        (nodes, locals): (&[impl Branch], &Locals<MANY>),
        who: u32,
        mut limits: [f32; MANY],
        open: &mut Vec<Joint>,
        mut visit: impl FnMut(Range<u32>, f32, u32) -> [f32; MANY],
    ) {
        open.clear();
        let mut nearest = (!nodes.is_empty()).then_some((Open::new(0.0, 0), who));
        let mut limit = greatest(&limits);
        while let Some((next, who)) = nearest.take().or_else(
            #[inline(always)]
            || open.pop(),
        ) {
            if next.near() > limit {
                continue;
            }
            if let Some(all) = elements(next) {
                limits = visit(all, next.near(), who);
                limit = greatest(&limits);
                continue;
            }
            let node = &nodes[next.number() as usize];
            let (mut left, near, by) = self.ask(isa, locals, node, (&limits, who));
            while left != 0 {
                let slot = left.trailing_zeros();
                left &= left - 1;
                let Some(number) = node.child(slot) else { continue };
                let own = (Open::new(least(&near[slot as usize]), number), by[slot as usize]);
                nearest = Some(nearest.map_or(
                    own,
                    #[inline(always)]
                    |before| {
                        open.push(before.max(own));
                        before.min(own)
                    },
                ));
            }
        }
    }

    /// Which children of a node rays of `who` may enter up to their limits, a bit each; how near each is to each ray at
    /// least, and to whom it may matter.
    #[inline(always)]
    fn ask<I: Isa>(
        &self,
        isa: I,
        locals: &Locals<MANY>,
        node: &impl Branch,
        (limits, who): (&[f32; MANY], u32),
    ) -> (u32, [[f32; MANY]; 8], [u32; 8]) {
        let (mut nears, mut ends) = ([isa.load_eight(&locals.t_min); 8], [isa.load_eight(limits); 8]);
        for k in 0..3 {
            let inverse = isa.load_eight(&self.aims.inverse[k]);
            let (step, origin) = node.grid(k);
            let (scale, origin) = (isa.eight(step) * inverse, isa.eight(origin));
            let ahead = (origin - isa.load_eight(&locals.ahead[k])) * inverse;
            let behind = (origin - isa.load_eight(&locals.behind[k])) * inverse;
            let (mut begins, mut stops) = ([0.0; 8], [0.0; 8]);
            node.bounds(isa, k, self.is_negative[k]).store(&mut begins);
            node.bounds(isa, k, !self.is_negative[k]).store(&mut stops);
            for slot in 0..8 {
                nears[slot] = nears[slot].most(isa.eight(begins[slot]) * scale + ahead);
                ends[slot] = ends[slot].least(isa.eight(stops[slot]) * scale + behind);
            }
        }
        let (mut mask, mut near, mut by) = (0, [[0.0; MANY]; 8], [0; 8]);
        for slot in 0..8 {
            by[slot] = nears[slot].less_equal(ends[slot]) & who;
            mask |= u32::from(by[slot] != 0) << slot;
            nears[slot].store(&mut near[slot]);
        }
        (mask, near, by)
    }
}

/// The least of all, by halves.
#[inline(always)]
fn least(x: &[f32; MANY]) -> f32 {
    let of = |a: f32, b: f32| if a < b { a } else { b };
    of(of(of(x[0], x[4]), of(x[2], x[6])), of(of(x[1], x[5]), of(x[3], x[7])))
}

/// The greatest of all, likewise.
#[inline(always)]
fn greatest(x: &[f32; MANY]) -> f32 {
    let of = |a: f32, b: f32| if a > b { a } else { b };
    of(of(of(x[0], x[4]), of(x[2], x[6])), of(of(x[1], x[5]), of(x[3], x[7])))
}
