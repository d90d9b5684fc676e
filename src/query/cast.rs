//! What rays meet first, or whether they meet anything: each from brick to brick, the nearest first.

use super::aim::Aim;
use super::aims::Aims;
use super::hits::normal;
use super::packet::{ALL, MANY, Packet};
use super::room::{Inner, Room};
use super::rounds::{Bricks, Seek, State};
use super::space::Placed;
use super::{Queries, Rays, Watch};
use crate::kernels::layout::NONE;
use crate::kernels::opacity;
use crate::kernels::simd::isa::Isa;
use crate::math::crossing::Crossing;
use crate::math::sampling::pcg;
use crate::output::npy::{Hit, Ray};
use anyhow::Result;
use glam::DVec3;
use rayon::prelude::*;

/// Rays that look for what they meet.
struct Casting<'a> {
    queries: &'a Queries,
    rays: Rays<'a>,
    /// Whether anything will do.
    any: bool,
    /// Whether rays pass through what materials cut out or let shine through.
    passes: bool,
}

/// What a ray has met.
#[derive(Clone, Copy)]
struct Found {
    t: f64,
    id: u32,
    leaf: u32,
    triangle: u32,
    /// Of the vertices as they are stored.
    weights: [f32; 3],
    normal: [f32; 3],
}

const NOTHING: Found =
    Found { t: f64::INFINITY, id: NONE, leaf: NONE, triangle: 0, weights: [0.0; 3], normal: [0.0; 3] };

/// A number in [0, 1) of a ray and a triangle.
fn drawn(ray: &Ray, id: u32) -> f32 {
    let words = ray.origin.iter().chain(&ray.direction).flat_map(|x| [x.to_bits() as u32, (x.to_bits() >> 32) as u32]);
    let bits = words.fold(pcg(id), |bits, word| pcg(bits ^ word));
    (bits >> 8) as f32 / (1u32 << 24) as f32
}

/// Rays that are set up.
struct Ready {
    aims: Aims<MANY>,
    /// The number of the first.
    first: usize,
}

impl Seek for Casting<'_> {
    type Ready = Ready;

    type Found = Found;

    #[inline(always)]
    fn ready<I: Isa>(&self, _: I, first: usize) -> Ready {
        Ready { aims: Aims::new(self.queries.top(), &self.rays.columns(first)), first }
    }

    #[inline(always)]
    fn go<I: Isa>(
        &self,
        isa: I,
        (ready, i): (&Ready, usize),
        found: &mut Found,
        bricks: &Bricks,
        room: &mut Room,
    ) -> Option<u32> {
        let (top, resident) = (self.queries.top(), self.queries.scene.resident());
        let (number, aim) = (ready.first + i, ready.aims.get(i));
        if aim.come == 0 {
            return None;
        }
        // The nearest brick that is away, and where it is entered.
        let mut next = (f64::INFINITY, NONE);
        let Room { top: open, inner, .. } = room;
        aim.leaves(
            isa,
            top,
            open,
            #[inline(always)]
            |leaf, from| {
                let its = resident.leaves[leaf as usize].brick;
                match bricks.get(its) {
                    State::AtHand(geometry) => {
                        let brick = Placed::new(resident, leaf, geometry);
                        self.go_through(isa, (number, &aim), (leaf, &brick), from, found, inner);
                    }
                    State::Away if from < next.0 => next = (from, its),
                    _ => (),
                }
                self.end(&aim, 0, found)
            },
        );
        let matters = next.1 != NONE && aim.may_enter(next.0, self.end(&aim, 0, found));
        matters.then_some(next.1)
    }

    #[inline(always)]
    fn go_together<I: Isa>(
        &self,
        isa: I,
        Ready { aims, first }: &Ready,
        found: &mut [Found; MANY],
        bricks: &Bricks,
        room: &mut Room,
    ) -> u32 {
        let (top, resident) = (self.queries.top(), self.queries.scene.resident());
        let Some(packet) = Packet::new(top, aims) else { return ALL };
        let (mut alone, t) = (0, self.ends(aims, found));
        let Room { joint, inner, .. } = room;
        packet.leaves(
            isa,
            top,
            joint,
            t,
            #[inline(always)]
            |leaf, from, who| {
                match bricks.get(resident.leaves[leaf as usize].brick) {
                    State::AtHand(geometry) => {
                        let brick = Placed::new(resident, leaf, geometry);
                        let t = self.ends(aims, found);
                        let went = packet.triangles(
                            isa,
                            &brick,
                            (from, who),
                            &mut inner.joint,
                            t,
                            #[inline(always)]
                            |triangle, vertices, i| {
                                let found = &mut found[i];
                                // Who needs no more has nothing before its end.
                                if !self.is_met(found) {
                                    let met = aims.meet(i, vertices);
                                    self.note(met, first + i, (leaf, &brick), (triangle, vertices), found);
                                }
                                self.end(aims, i, found)
                            },
                        );
                        let mut left = if went { 0 } else { who };
                        while left != 0 {
                            let i = left.trailing_zeros() as usize;
                            left &= left - 1;
                            self.go_through(isa, (first + i, &aims.get(i)), (leaf, &brick), from, &mut found[i], inner);
                        }
                    }
                    State::Away => alone |= who,
                    State::Done => (),
                }
                self.ends(aims, found)
            },
        );
        alone
    }
}

impl Casting<'_> {
    /// Whether a ray needs no more.
    #[inline(always)]
    fn is_met(&self, found: &Found) -> bool {
        self.any && found.id != NONE
    }

    /// Up to where a ray may still meet what matters.
    #[inline(always)]
    fn end<const N: usize>(&self, aims: &Aims<N>, i: usize, found: &Found) -> f64 {
        if self.is_met(found) { f64::NEG_INFINITY } else { found.t.min(aims.t_max[i]) }
    }

    /// The same of rays that go together.
    #[inline(always)]
    fn ends(&self, aims: &Aims<MANY>, found: &[Found; MANY]) -> [f64; MANY] {
        let mut ends = [0.0; MANY];
        for i in 0..MANY {
            ends[i] = self.end(aims, i, &found[i]);
        }
        ends
    }

    /// Notes what the ray of a number has met, if it has: a triangle.
    #[inline(always)]
    fn note(
        &self,
        met: Option<Crossing>,
        number: usize,
        (leaf, brick): (u32, &Placed),
        (triangle, vertices): (u32, [DVec3; 3]),
        found: &mut Found,
    ) {
        let Some(Crossing { t, weights, .. }) = met else { return };
        // Of what is as near, the lowest id.
        if t < found.t || t == found.t && brick.id(triangle) < found.id {
            let (id, weights) = (brick.id(triangle), weights.map(|weight| weight as f32));
            if !self.passes(number, brick, triangle, id, weights) {
                *found = Found { t, id, leaf, triangle, weights, normal: normal(vertices) };
            }
        }
    }

    /// Has the ray of a number meet what there is in a brick.
    #[inline(always)]
    fn go_through<I: Isa>(
        &self,
        isa: I,
        (number, aim): (usize, &Aim),
        (leaf, brick): (u32, &Placed),
        from: f64,
        found: &mut Found,
        room: &mut Inner,
    ) {
        let limit = found.t.min(aim.t_max[0]);
        aim.triangles(
            isa,
            brick,
            (from, limit),
            room,
            #[inline(always)]
            |triangle| {
                let vertices = brick.vertices(triangle);
                self.note(aim.meet(0, vertices), number, (leaf, brick), (triangle, vertices), found);
                (!self.is_met(found)).then_some(found.t.min(aim.t_max[0]))
            },
        );
    }

    #[inline(always)]
    fn passes(&self, number: usize, brick: &Placed, triangle: u32, id: u32, weights: [f32; 3]) -> bool {
        let opacity = &brick.geometry.view.opacity;
        let draw = || drawn(&self.rays.get(number), id);
        self.passes && !opacity.of.is_empty() && opacity.passes(triangle, weights, false, draw)
    }
}

impl Queries {
    /// What each ray meets first, at a `t` of its interval, which is closed; of what is as near, to the last bit, the
    /// triangle with the lowest id. Rays pass through what alpha masks cut out, and at random through what blends.
    ///
    /// # Errors
    /// A ray that is none, by its number; a damaged brick; what `watch` says.
    pub fn cast<'a>(&self, rays: impl Into<Rays<'a>>, watch: &mut Watch) -> Result<Vec<Hit>> {
        let rays = rays.into();
        self.check_rays(rays)?;
        if let Some(flat) = self.flat(rays.len(), watch)? {
            return self.cast_flat(flat, rays, watch);
        }
        let found = self.find(rays, (false, true), watch)?;
        let of = |found: &Found| (found.leaf, found.triangle);
        let rotations = self.rotations(&found, of)?;
        let hit = |(found, rotation): (&Found, u8)| {
            let weight = |vertex: usize| found.weights[(vertex + 3 - usize::from(rotation)) % 3];
            Hit { t: found.t, triangle: found.id, u: weight(1), v: weight(2), normal: found.normal }
        };
        Ok(self.threads.install(|| found.par_iter().zip(rotations).map(hit).collect()))
    }

    /// Whether each ray meets anything that it does not pass through, as of [`Queries::cast`].
    ///
    /// # Errors
    /// As of [`Queries::cast`].
    pub fn any<'a>(&self, rays: impl Into<Rays<'a>>, watch: &mut Watch) -> Result<Vec<bool>> {
        self.meets_any(rays.into(), true, watch)
    }

    /// Whether each ray meets anything; with `passes` anything that it does not pass through.
    pub(super) fn meets_any(&self, rays: Rays, passes: bool, watch: &mut Watch) -> Result<Vec<bool>> {
        self.check_rays(rays)?;
        if let Some(flat) = self.flat(rays.len(), watch)? {
            return self.cast_flat(flat, rays, watch);
        }
        let found = self.find(rays, (true, passes), watch)?;
        Ok(self.threads.install(|| found.par_iter().map(|found| found.id != NONE).collect()))
    }

    fn find(&self, rays: Rays, (any, passes): (bool, bool), watch: &mut Watch) -> Result<Vec<Found>> {
        let has_opacity = passes && opacity::is_needed(self.scene.resident());
        let opacity = if has_opacity { opacity::table(&self.scene)? } else { Vec::new() };
        let casting = Casting { queries: self, rays, any, passes };
        self.seek(&casting, rays.len(), || NOTHING, &opacity, watch)
    }
}
