//! What the rays of a packet have hit: [`super::leaf::BrickRay::write_hit`] lane by lane, with the same operations in
//! the same order. Hits on instances, and lanes whose numbers leave the range in which an f32 operation is what the
//! kernel carries out in integers, are written alone.

use super::brick::Best;
use super::packet::{Packet, RAYS};
use super::walk_brick::write_found;
use crate::kernels::bound::Bound;
use crate::kernels::layout::{Hit, INSTANCE_IDENTITY, NONE, PARAM_ANY_HIT, Surface};
use crate::kernels::simd::isa::{Isa, inside};
use crate::kernels::simd::wide::{Wide, three};
use crate::math::exact::{LEAST_COORDINATE, LEAST_SHEAR, OFFSET_ULPS, THIRD};

/// Most lanes of a vector.
const MOST: usize = 16;

/// A number a lane.
type Lane = [f32; MOST];

/// What is known of the hits of a vector: vertices a, b, c, by axis.
type Corners<W> = [[W; 3]; 3];

/// What follows from it.
#[derive(Default)]
struct Points {
    /// [`crate::math::exact::offset_origin`] of it.
    point: [Lane; 3],
    normal: [Lane; 3],
    area: Lane,
    /// Weights of vertices b and c.
    weights: [Lane; 2],
}

/// Quotients, and the lanes in which they are [`crate::math::exact::divide`]'s.
#[inline(always)]
fn divide<I: Isa>(isa: I, a: I::Wide, b: I::Wide) -> (I::Wide, u32) {
    let (quotient, zero) = (a / b, isa.splat(0.0));
    let is_zero = a.less_equal(zero) & zero.less_equal(a);
    (quotient, inside(isa, b) & (is_zero | (inside(isa, a) & inside(isa, quotient))))
}

#[inline(always)]
fn dot<W: Wide>(a: [W; 3], b: [W; 3]) -> W {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Lengths, and the lanes in which they are [`crate::math::exact::length_of`]'s.
#[inline(always)]
fn length<I: Isa>(isa: I, x: [I::Wide; 3]) -> (I::Wide, u32) {
    let square = dot(x, x);
    (square.sqrt(), inside(isa, square))
}

/// [`crate::math::exact::diffprod`] of each of the first lanes, and those in which it is that.
#[inline(always)]
fn diffprod<I: Isa>(isa: I, a: I::Wide, b: I::Wide, c: I::Wide, d: I::Wide) -> (I::Wide, u32) {
    let mut factors = [[0.0f32; MOST]; 4];
    a.store(&mut factors[0]);
    b.store(&mut factors[1]);
    c.store(&mut factors[2]);
    d.store(&mut factors[3]);
    let (mut differences, mut is_zero) = ([0.0f32; MOST], [0.0f32; MOST]);
    for i in 0..I::Wide::LANES {
        let p = f64::from(factors[0][i]) * f64::from(factors[1][i]);
        let q = f64::from(factors[2][i]) * f64::from(factors[3][i]);
        let sum = p - q;
        let back = sum - p;
        let error = (p - (sum - back)) - (q + back);
        // Rounded to odd: an even sum with an error moves toward what is exact.
        let is_away = (error != 0.0) & (sum.to_bits() & 1 == 0);
        let up = (error > 0.0) == (sum > 0.0);
        let step = if up { 1u64 } else { u64::MAX };
        let odd = f64::from_bits(sum.to_bits().wrapping_add(if is_away { step } else { 0 }));
        // Without the sign of a zero.
        differences[i] = odd as f32 + 0.0;
        is_zero[i] = if sum == 0.0 { 1.0 } else { 0.0 };
    }
    let (difference, zero) = (isa.load(&differences), isa.splat(0.0));
    let mut plain = inside(isa, difference) | zero.less(isa.load(&is_zero));
    plain &= inside(isa, a) | (a.less_equal(zero) & zero.less_equal(a));
    plain &= inside(isa, b) | (b.less_equal(zero) & zero.less_equal(b));
    plain &= inside(isa, c) | (c.less_equal(zero) & zero.less_equal(c));
    plain &= inside(isa, d) | (d.less_equal(zero) & zero.less_equal(d));
    (difference, plain)
}

/// [`crate::math::exact::surface_point`], and the barycentrics. Returns the lanes that are right.
#[inline(always)]
fn points<I: Isa>(isa: I, packet: &Packet, number: usize, [a, b, c]: Corners<I::Wide>, out: &mut Points) -> u32 {
    let d = three!(k => packet.direction[k].get(isa, number));
    let (ab, bc, ca) = (three!(k => b[k] - a[k]), three!(k => c[k] - b[k]), three!(k => a[k] - c[k]));
    let (s0, plain0) = diffprod(isa, ab[2], ca[1], ab[1], ca[2]);
    let (s1, plain1) = diffprod(isa, ab[0], ca[2], ab[2], ca[0]);
    let (s2, plain2) = diffprod(isa, ab[1], ca[0], ab[0], ca[1]);
    let mut plain = plain0 & plain1 & plain2;
    let s = [s0, s1, s2];
    // Powers of two from the exponent of the largest component.
    let largest = s[0].abs().most(s[1].abs().most(s[2].abs()));
    plain &= inside(isa, largest);
    let scale = largest & isa.splat(f32::INFINITY);
    let inverse = isa.splat(1.0) / scale;
    let (zero, least) = (isa.splat(0.0), isa.splat(LEAST_SHEAR));
    let s = three!(k => s[k] * inverse);
    let s = three!(k => zero.or_else(s[k].abs().less(least), s[k]));
    let (size, right) = length(isa, s);
    plain &= right;
    let n = three!(k => divide(isa, s[k], size));
    plain &= n[0].1 & n[1].1 & n[2].1;
    let n = three!(k => n[k].0);
    let away = zero.less(dot(n, d));
    let n = three!(k => (n[k] ^ isa.splat(-0.0)).or_else(away, n[k]));
    let down = three!(k => n[k].less(zero) | (n[k].less_equal(zero) & zero.less_equal(n[k]) & zero.less(d[k])));

    let det = packet.found.det.get(isa, number);
    let edges = three!(k => divide(isa, packet.found.edges[k].get(isa, number), det));
    plain &= edges[0].1 & edges[1].1 & edges[2].1;
    edges[1].0.store(&mut out.weights[0]);
    edges[2].0.store(&mut out.weights[1]);
    let mut weights = three!(k => edges[k].0.abs());
    let reach = three!(k => dot(weights, [a[k].abs(), b[k].abs(), c[k].abs()]));
    let margin = isa.splat(4.0 * OFFSET_ULPS) * (reach[0] + reach[1] + reach[2]);
    let area = size * scale;
    let lengths = [length(isa, bc), length(isa, ca), length(isa, ab)];
    let inset = three!(k => divide(isa, margin * lengths[k].0, area));
    plain &= lengths[0].1 & lengths[1].1 & lengths[2].1 & inset[0].1 & inset[1].1 & inset[2].1;
    weights = three!(k => weights[k].most(inset[k].0.least(isa.splat(THIRD))));
    let total = weights[0] + weights[1] + weights[2];
    let parts = three!(k => divide(isa, weights[k], total));
    plain &= parts[0].1 & parts[1].1 & parts[2].1;
    weights = three!(k => parts[k].0);
    let near = three!(k => dot(weights, [a[k].abs(), b[k].abs(), c[k].abs()]));
    let delta = isa.splat(OFFSET_ULPS) * dot(three!(k => n[k].abs()), near);
    let p = three!(k => dot(weights, [a[k], b[k], c[k]]));
    let moved = three!(k => offset(isa, p[k], delta * n[k], down[k]));
    for k in 0..3 {
        moved[k].store(&mut out.point[k]);
        n[k].store(&mut out.normal[k]);
    }
    area.store(&mut out.area);
    plain
}

/// [`crate::math::exact::offset_origin`] on an axis.
#[inline(always)]
fn offset<I: Isa>(isa: I, p: I::Wide, step: I::Wide, down: u32) -> I::Wide {
    let moved = p + step;
    let is_down = isa.splat(-0.0).or_else(down, isa.splat(0.0));
    // Away from zero where the point lies on the side to which it moves.
    let is_away = ((p ^ is_down) & isa.splat(-0.0)).same_bits(isa.splat(0.0));
    let next = p.add_bits(isa.splat_bits(1).or_else(is_away, isa.splat_bits(u32::MAX)));
    let tiny = p.abs().less(isa.splat(LEAST_COORDINATE));
    let least = (isa.splat(LEAST_COORDINATE) ^ is_down).or_else(tiny, next);
    moved.least(least).or_else(down, moved.most(least))
}

impl Packet {
    /// Writes what ray i has found to the i-th of `places`.
    #[inline(always)]
    pub fn write<I: Isa>(&self, isa: I, bound: &Bound, hits_of: &mut [Hit], surfaces: &mut [Surface], places: &[u32]) {
        if bound.has(PARAM_ANY_HIT) {
            for i in (0..self.count).filter(|&i| self.found.leaf.0[i % RAYS] != NONE) {
                let place = places[i] as usize;
                self.best(i).write_occluder(&mut hits_of[place], &mut surfaces[place]);
            }
            return;
        }
        let mut points_of = Points::default();
        for v in 0..self.vectors::<I>() {
            let first = v * I::Wide::LANES;
            let end = self.count.min(first + I::Wide::LANES);
            let (mut together, corners) = self.corners(isa, bound, v, end - first);
            if together != 0 {
                together &= points(isa, self, v, corners, &mut points_of);
            }
            for i in first..end {
                if self.found.leaf.0[i % RAYS] == NONE {
                    continue;
                }
                let (hit, surface) = (&mut hits_of[places[i] as usize], &mut surfaces[places[i] as usize]);
                if together >> (i - first) & 1 != 0 {
                    points_of.write(i - first, &self.best(i), hit, surface);
                    bound.start_off(surface);
                } else {
                    write_found(bound, &self.ray(i), &self.best(i), hit, surface);
                }
            }
        }
    }

    /// The vertices of what the first lanes of vector `v` have hit, and which lanes have; none where the hit lies on an
    /// instance. Neighbours often hit the same triangle, so each is looked up once.
    #[inline(always)]
    fn corners<I: Isa>(&self, isa: I, bound: &Bound, v: usize, lanes: usize) -> (u32, Corners<I::Wide>) {
        let (leaves, triangles) = (self.found.leaf.get(isa, v), self.found.triangle.get(isa, v));
        let mut corners = [[isa.splat(0.0); 3]; 3];
        let mut left = !leaves.same_bits(isa.splat_bits(NONE)) & (u32::MAX >> (32 - lanes));
        let mut found = 0;
        while left != 0 {
            let i = (v * I::Wide::LANES + left.trailing_zeros() as usize) % RAYS;
            let (number, triangle) = (self.found.leaf.0[i], self.found.triangle.0[i]);
            let same = leaves.same_bits(isa.splat_bits(number)) & triangles.same_bits(isa.splat_bits(triangle)) & left;
            left &= !same;
            let leaf = &bound.scene.leaves[number as usize];
            if bound.scene.instances[leaf.instance as usize].flags & INSTANCE_IDENTITY == 0 {
                continue;
            }
            found |= same;
            let brick = &bound.bricks[leaf.brick as usize];
            let vertices = brick.vertices(triangle, leaf.offset_high, leaf.offset_low);
            corners = three!(i => three!(k => isa.splat(vertices[i][k]).or_else(same, corners[i][k])));
        }
        (found, corners)
    }
}

impl Points {
    #[inline(always)]
    fn write(&self, lane: usize, best: &Best, hit: &mut Hit, surface: &mut Surface) {
        let lane = lane % MOST;
        let at = |from: &[Lane; 3]| [from[0][lane], from[1][lane], from[2][lane]];
        *hit = Hit { t: best.t, id: best.id, u: self.weights[0][lane], v: self.weights[1][lane] };
        *surface = Surface {
            point: at(&self.point),
            leaf: best.leaf,
            normal: at(&self.normal),
            triangle: best.triangle,
            area: self.area[lane],
            source: best.source,
            pending: surface.pending,
            emitter: surface.emitter,
        };
    }
}
