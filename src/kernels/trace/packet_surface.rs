//! What the rays of a packet have hit: [`super::leaf::BrickRay::write_hit`] lane by lane, with the same operations in
//! the same order. Hits on instances, and lanes whose numbers leave the range in which an f32 operation is what the
//! kernel carries out in integers, are written alone.

use super::packet::{Column, Packet, RAYS, Words};
use super::packet_fill::Written;
use super::packet_walk::PacketScratch;
use super::walk_brick::write_found;
use crate::kernels::bound::Bound;
use crate::kernels::layout::{Hit, INSTANCE_IDENTITY, NONE, PARAM_ANY_HIT, Surface};
use crate::kernels::simd::isa::{Isa, MOST, inside};
use crate::kernels::simd::wide::{Wide, three};
use crate::math::exact::{LEAST_COORDINATE, LEAST_SHEAR, OFFSET_ULPS, THIRD};

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

/// What follows from triangles alone, one a lane: those that the rays of a packet have hit.
pub struct Facts {
    /// How many.
    count: usize,
    /// Vertices a, b, c by axes, in the frame.
    corners: [[Column; 3]; 3],
    /// Unit vectors across them, to either side.
    normal: [Column; 3],
    /// Twice the areas.
    area: Column,
    /// Lengths of the edges bc, ca, ab.
    lengths: [Column; 3],
    /// Which rays have hit each.
    rays: [u64; RAYS],
    /// Which of them each ray has hit.
    of: Words,
}

impl Facts {
    /// Of no triangles.
    pub fn empty() -> Self {
        let none = [Column::ZERO; 3];
        Self {
            count: 0,
            corners: [none; 3],
            normal: none,
            area: Column::ZERO,
            lengths: none,
            rays: [0; RAYS],
            of: Words([0; RAYS]),
        }
    }

    /// Of what the rays of a packet have hit. Returns those whose facts are right; none of those on instances.
    #[inline(always)]
    fn gather<I: Isa>(&mut self, isa: I, bound: &Bound, packet: &Packet) -> u64 {
        let (found, lanes) = (&packet.found, I::Wide::LANES);
        let mut left = 0;
        for v in 0..packet.vectors::<I>() {
            let none = found.leaf.get(isa, v).same_bits(isa.splat_bits(NONE));
            left |= u64::from(!none & (u32::MAX >> (32 - lanes))) << (v * lanes);
        }
        left &= packet.all();
        (self.count, self.of) = (0, Words([0; RAYS]));
        let mut right = 0;
        while left != 0 {
            let i = left.trailing_zeros() as usize % RAYS;
            let (number, triangle) = (found.leaf.0[i], found.triangle.0[i]);
            let mut same = 0;
            for v in i / lanes..packet.vectors::<I>() {
                let (leaves, triangles) = (found.leaf.get(isa, v), found.triangle.get(isa, v));
                let both = leaves.same_bits(isa.splat_bits(number)) & triangles.same_bits(isa.splat_bits(triangle));
                same |= u64::from(both) << (v * lanes);
            }
            same &= left;
            left &= !same;
            let leaf = &bound.scene.leaves[number as usize];
            if bound.scene.instances[leaf.instance as usize].flags & INSTANCE_IDENTITY == 0 {
                continue;
            }
            let brick = &bound.bricks[leaf.brick as usize];
            let vertices = brick.vertices(triangle, leaf.offset_high, leaf.offset_low);
            let at = self.count % RAYS;
            for (columns, vertex) in self.corners.iter_mut().zip(vertices) {
                for (column, x) in columns.iter_mut().zip(vertex) {
                    column.0[at] = x;
                }
            }
            let number = isa.splat_bits(at as u32);
            for v in i / lanes..packet.vectors::<I>() {
                self.of.replace(isa, v, (same >> (v * lanes)) as u32, number);
            }
            self.rays[at] = same;
            self.count += 1;
            right |= same;
        }
        for v in 0..self.count.div_ceil(lanes) {
            let used = lanes.min(self.count - v * lanes);
            let mut wrong = !self.follow(isa, v) & (u32::MAX >> (32 - used));
            while wrong != 0 {
                right &= !self.rays[(v * lanes + wrong.trailing_zeros() as usize) % RAYS];
                wrong &= wrong - 1;
            }
        }
        right
    }

    /// Has facts of a vector of triangles follow from their vertices. Returns the lanes that are right.
    #[inline(always)]
    fn follow<I: Isa>(&mut self, isa: I, v: usize) -> u32 {
        let [a, b, c] = three!(i => three!(k => self.corners[i][k].get(isa, v)));
        let (ab, bc, ca) = (three!(k => b[k] - a[k]), three!(k => c[k] - b[k]), three!(k => a[k] - c[k]));
        let (s0, right0) = diffprod(isa, ab[2], ca[1], ab[1], ca[2]);
        let (s1, right1) = diffprod(isa, ab[0], ca[2], ab[2], ca[0]);
        let (s2, right2) = diffprod(isa, ab[1], ca[0], ab[0], ca[1]);
        let mut right = right0 & right1 & right2;
        let s = [s0, s1, s2];
        // Powers of two from the exponent of the largest component.
        let largest = s[0].abs().most(s[1].abs().most(s[2].abs()));
        right &= inside(isa, largest);
        let scale = largest & isa.splat(f32::INFINITY);
        let inverse = isa.splat(1.0) / scale;
        let (zero, least) = (isa.splat(0.0), isa.splat(LEAST_SHEAR));
        let s = three!(k => s[k] * inverse);
        let s = three!(k => zero.or_else(s[k].abs().less(least), s[k]));
        let (size, right_size) = length(isa, s);
        right &= right_size;
        let n = three!(k => divide(isa, s[k], size));
        right &= n[0].1 & n[1].1 & n[2].1;
        let lengths = [length(isa, bc), length(isa, ca), length(isa, ab)];
        right &= lengths[0].1 & lengths[1].1 & lengths[2].1;
        for k in 0..3 {
            self.normal[k].set(v, n[k].0);
            self.lengths[k].set(v, lengths[k].0);
        }
        self.area.set(v, size * scale);
        right
    }
}

/// Where the rays of a vector have hit, as rows.
struct Points {
    /// As of [`Hit`].
    hits: [[f32; 4]; MOST],
    /// As of [`Surface`]: point and leaf, normal and triangle,
    surfaces: [[[f32; 4]; MOST]; 2],
    /// and twice the areas of triangles.
    areas: [f32; MOST],
}

/// [`crate::math::exact::surface_point`] of a vector of rays, [`crate::math::exact::offset_origin`] of it, and the
/// barycentrics. Returns the lanes that are right where their triangles' facts are.
#[inline(always)]
fn points<I: Isa>(isa: I, packet: &Packet, facts: &Facts, number: usize, out: &mut Points) -> u32 {
    let of = &facts.of.0[number * I::Wide::LANES..];
    let d = three!(k => packet.direction[k].get(isa, number));
    let [a, b, c] = three!(i => three!(k => isa.pick(&facts.corners[i][k].0, of)));
    let n = three!(k => isa.pick(&facts.normal[k].0, of));
    let (zero, area) = (isa.splat(0.0), isa.pick(&facts.area.0, of));
    let away = zero.less(dot(n, d));
    let n = three!(k => (n[k] ^ isa.splat(-0.0)).or_else(away, n[k]));
    let down = three!(k => n[k].less(zero) | (n[k].less_equal(zero) & zero.less_equal(n[k]) & zero.less(d[k])));

    let found = &packet.found;
    let det = found.det.get(isa, number);
    let edges = three!(k => divide(isa, found.edges[k].get(isa, number), det));
    let mut right = edges[0].1 & edges[1].1 & edges[2].1;
    let mut weights = three!(k => edges[k].0.abs());
    let reach = three!(k => dot(weights, [a[k].abs(), b[k].abs(), c[k].abs()]));
    let margin = isa.splat(4.0 * OFFSET_ULPS) * (reach[0] + reach[1] + reach[2]);
    let inset = three!(k => divide(isa, margin * isa.pick(&facts.lengths[k].0, of), area));
    right &= inset[0].1 & inset[1].1 & inset[2].1;
    weights = three!(k => weights[k].most(inset[k].0.least(isa.splat(THIRD))));
    let total = weights[0] + weights[1] + weights[2];
    let parts = three!(k => divide(isa, weights[k], total));
    right &= parts[0].1 & parts[1].1 & parts[2].1;
    weights = three!(k => parts[k].0);
    let near = three!(k => dot(weights, [a[k].abs(), b[k].abs(), c[k].abs()]));
    let delta = isa.splat(OFFSET_ULPS) * dot(three!(k => n[k].abs()), near);
    let p = three!(k => dot(weights, [a[k], b[k], c[k]]));
    let [x, y, z] = three!(k => offset(isa, p[k], delta * n[k], down[k]));
    let (t, id) = (packet.t.get(isa, number), found.id.get(isa, number));
    isa.rows([t, id, edges[1].0, edges[2].0], &mut out.hits);
    isa.rows([x, y, z, found.leaf.get(isa, number)], &mut out.surfaces[0]);
    isa.rows([n[0], n[1], n[2], found.triangle.get(isa, number)], &mut out.surfaces[1]);
    area.store(&mut out.areas);
    right
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

impl PacketScratch {
    /// Writes what ray i has found to the i-th of the places.
    #[inline(always)]
    pub fn write<I: Isa>(&mut self, isa: I, bound: &Bound, to: &mut Written) {
        let Written { hits, surfaces, places } = to;
        let packet = &self.packet;
        let has_found = |i: usize| packet.found.leaf.0[i % RAYS] != NONE;
        if bound.has(PARAM_ANY_HIT) {
            for i in (0..packet.count).filter(|&i| has_found(i)) {
                let place = places[i] as usize;
                packet.best(i).write_occluder(&mut hits[place], &mut surfaces[place]);
            }
            return;
        }
        let right = self.facts.gather(isa, bound, packet);
        let none = [[0.0; 4]; MOST];
        let mut points_of = Points { hits: none, surfaces: [none; 2], areas: [0.0; MOST] };
        for v in 0..packet.vectors::<I>() {
            let first = v * I::Wide::LANES;
            let mut together = (right >> first) as u32 & (u32::MAX >> (32 - I::Wide::LANES));
            if together != 0 {
                together &= points(isa, packet, &self.facts, v, &mut points_of);
            }
            for i in (first..packet.count.min(first + I::Wide::LANES)).filter(|&i| has_found(i)) {
                let (hit, surface) = (&mut hits[places[i] as usize], &mut surfaces[places[i] as usize]);
                if together >> (i - first) & 1 != 0 {
                    points_of.write(i - first, hit, surface);
                    bound.start_off(surface);
                } else {
                    write_found(bound, &packet.ray(i), &packet.best(i), hit, surface);
                }
            }
        }
    }
}

impl Points {
    /// Writes a lane: all but what was known of the ray before.
    #[inline(always)]
    fn write(&self, lane: usize, hit: &mut Hit, surface: &mut Surface) {
        let lane = lane % MOST;
        *hit = bytemuck::cast(self.hits[lane]);
        let [point, normal, rest]: &mut [[f32; 4]; 3] = bytemuck::cast_mut(surface);
        (*point, *normal, rest[0]) = (self.surfaces[0][lane], self.surfaces[1][lane], self.areas[lane]);
    }
}
