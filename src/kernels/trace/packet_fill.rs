//! How rays come into the columns of a packet: by vectors, whole squares of them or single ones.

use super::packet::{Packet, RAYS};
use crate::kernels::layout::{Hit, NONE, Ray, Surface};
use crate::kernels::simd::isa::{Isa, MOST};
use crate::kernels::simd::wide::Wide;

/// Where four neighbours of a square of 8 x 8 rays begin, in rows of `width`: squares of 4 x 4 one after the other.
#[inline(always)]
pub fn four_of_square(number: usize, width: usize) -> usize {
    let (quarter, row) = (number / 4, number % 4);
    (quarter / 2 * 4 + row) * width + quarter % 2 * 4
}

/// All rays of a band, and what is known of them.
#[derive(Clone, Copy)]
pub struct Known<'a> {
    /// Rays.
    pub rays: &'a [Ray],
    /// Their hits.
    pub hits: &'a [Hit],
    /// Their surfaces.
    pub surfaces: &'a [Surface],
}

/// Where what the rays of a packet have found is written.
pub struct Written<'a> {
    /// Hits of a band.
    pub hits: &'a mut [Hit],
    /// Their surfaces.
    pub surfaces: &'a mut [Surface],
    /// Where those of each ray of the packet lie in both.
    pub places: &'a [u32],
}

/// What is seen of rays as a packet takes them, a bit each.
#[derive(Clone, Copy, Default)]
pub struct Taken {
    /// Those that are traced: [`crate::kernels::rays::is_traced`].
    pub traced: u64,
    /// Those that are pending.
    pub pending: u64,
    /// Those that have hit nothing so far.
    pub unhit: u64,
    /// Those whose directions are negative, by axes.
    pub negative: [u64; 3],
}

impl Taken {
    /// Of `rays` alone.
    #[inline(always)]
    fn within(self, rays: u64) -> Self {
        let [x, y, z] = self.negative;
        Self {
            traced: self.traced & rays,
            pending: self.pending & rays,
            unhit: self.unhit & rays,
            negative: [x & rays, y & rays, z & rays],
        }
    }

    /// The octant of `rays`, if they are of one.
    #[inline(always)]
    pub fn octant(&self, rays: u64) -> Option<u32> {
        let mut octant = 0;
        for k in 0..3 {
            match self.negative[k] & rays {
                0 => {}
                negative if negative == rays => octant |= 4 >> k,
                _ => return None,
            }
        }
        Some(octant)
    }
}

/// Where a vector's rays lie, and what is known of them: origins with least parameters, directions with greatest ones,
/// hits, and the ends of surfaces.
struct Rows<'a> {
    origins: [&'a [f32; 4]; MOST],
    directions: [&'a [f32; 4]; MOST],
    hits: [&'a [f32; 4]; MOST],
    surfaces: [&'a [f32; 4]; MOST],
}

impl<'a> Rows<'a> {
    #[inline(always)]
    fn new() -> Self {
        let none = [&[0.0; 4]; MOST];
        Self { origins: none, directions: none, hits: none, surfaces: none }
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, ray: &'a Ray, hit: &'a Hit, surface: &'a Surface) {
        let [origin, direction]: &[[f32; 4]; 2] = bytemuck::cast_ref(ray);
        let [_, _, rest]: &[[f32; 4]; 3] = bytemuck::cast_ref(surface);
        (self.origins[lane], self.directions[lane]) = (origin, direction);
        (self.hits[lane], self.surfaces[lane]) = (bytemuck::cast_ref(hit), rest);
    }
}

impl Packet {
    /// Takes the rays at `places`, 1 to 64, and what is known of them. Lanes without a ray of their own repeat the
    /// first, and no mask has them. [`Packet::seal`] completes the packet.
    #[inline(always)]
    pub fn fill<I: Isa>(&mut self, isa: I, places: &[u32], of: Known) -> Taken {
        let mut taken = Taken::default();
        self.count = places.len().min(RAYS);
        for v in 0..self.vectors::<I>() {
            let first = v * I::Wide::LANES;
            let mut rows = Rows::new();
            for i in 0..I::Wide::LANES {
                let at = places[if first + i < places.len() { first + i } else { 0 }] as usize;
                rows.set(i, &of.rays[at], &of.hits[at], &of.surfaces[at]);
            }
            self.take(isa, v, &rows, &mut taken);
        }
        taken.within(self.all())
    }

    /// [`Packet::fill`] with a square of 8 x 8 rays from number `at` on, in rows of `width`: squares of 4 x 4 one after
    /// the other.
    #[inline(always)]
    pub fn fill_square<I: Isa>(&mut self, isa: I, (at, width): (usize, usize), of: Known) -> Taken {
        let mut taken = Taken::default();
        self.count = RAYS;
        for v in 0..self.vectors::<I>() {
            let mut rows = Rows::new();
            for four in 0..I::Wide::LANES / 4 {
                let number = v * I::Wide::LANES / 4 + four;
                let first = at + four_of_square(number, width);
                let (rays, hits, surfaces) =
                    (&of.rays[first..first + 4], &of.hits[first..first + 4], &of.surfaces[first..first + 4]);
                for i in 0..4 {
                    rows.set(4 * four + i, &rays[i], &hits[i], &surfaces[i]);
                }
            }
            self.take(isa, v, &rows, &mut taken);
        }
        taken
    }

    /// Takes the rays of vector `v`.
    #[inline(always)]
    fn take<I: Isa>(&mut self, isa: I, v: usize, rows: &Rows, taken: &mut Taken) {
        let [x, y, z, t_min] = isa.columns(&rows.origins);
        let [dx, dy, dz, t_max] = isa.columns(&rows.directions);
        let [t, id, ..] = isa.columns(&rows.hits);
        let [_, source, pending, _] = isa.columns(&rows.surfaces);
        let (origin, direction) = ([x, y, z], [dx, dy, dz]);
        let (none, one, sign) = (isa.splat_bits(NONE), isa.splat_bits(1), isa.splat(-0.0));
        let shift = v * I::Wide::LANES;
        for k in 0..3 {
            self.origin[k].set(v, origin[k]);
            self.direction[k].set(v, direction[k]);
            taken.negative[k] |= u64::from((direction[k] & sign).same_bits(sign)) << shift;
        }
        taken.traced |= u64::from(t_min.less_equal(t_max) & t_min.less_equal(t)) << shift;
        taken.pending |= u64::from((pending & one).same_bits(one)) << shift;
        taken.unhit |= u64::from(id.same_bits(none)) << shift;
        self.t_min.set(v, t_min.most(isa.splat(0.0)));
        self.t.set(v, t);
        self.found.id.set(v, id);
        self.found.source.set(v, source);
        self.found.leaf.set(v, none);
        self.pending.set(v, pending);
    }
}
