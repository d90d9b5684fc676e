//! What rays meet first, or whether they meet anything: each from brick to brick, the nearest first.

use super::aim::Aim;
use super::hits::normal;
use super::packet::{MANY, Packet};
use super::room::{Inner, Room};
use super::rounds::{Bricks, Seek, State};
use super::space::Placed;
use super::{Queries, Watch};
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

impl Seek for Casting<'_> {
    type Item = Ray;

    type Found = Found;

    #[inline(always)]
    fn go<I: Isa>(&self, isa: I, ray: &Ray, found: &mut Found, bricks: &Bricks, room: &mut Room) -> Option<u32> {
        let (top, resident) = (self.queries.top(), self.queries.scene.resident());
        let aim = Aim::new(top, ray)?;
        // The nearest brick that is away, and where it is entered.
        let mut next = (f64::INFINITY, NONE);
        let Room { top: open, inner, .. } = room;
        aim.leaves(
            isa,
            top,
            open,
            #[inline(always)]
            |leaf, from| {
                let number = resident.leaves[leaf as usize].brick;
                match bricks.get(number) {
                    State::AtHand(geometry) => {
                        let brick = Placed::new(resident, leaf, geometry);
                        self.go_through(isa, (ray, &aim), (leaf, &brick), from, found, inner);
                    }
                    State::Away if from < next.0 => next = (from, number),
                    _ => (),
                }
                self.end(&aim, found)
            },
        );
        let matters = next.1 != NONE && aim.may_enter(next.0, self.end(&aim, found));
        matters.then_some(next.1)
    }

    #[inline(always)]
    fn go_together<I: Isa>(
        &self,
        isa: I,
        rays: &[Ray; MANY],
        mut found: [&mut Found; MANY],
        bricks: &Bricks,
        room: &mut Room,
    ) -> u32 {
        let (top, resident) = (self.queries.top(), self.queries.scene.resident());
        let Some(packet) = Packet::new(top, rays) else { return u32::MAX };
        let (mut alone, t) = (0, self.ends(&packet, &found));
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
                        let t = self.ends(&packet, &found);
                        let went = packet.triangles(
                            isa,
                            &brick,
                            (from, who),
                            &mut inner.joint,
                            t,
                            #[inline(always)]
                            |triangle, vertices, i| {
                                let (aim, found) = (&packet.aims[i], &mut *found[i]);
                                // Who needs no more has nothing before its end.
                                if !self.is_met(found) {
                                    self.meet((&rays[i], aim), (leaf, &brick), (triangle, vertices), found);
                                }
                                self.end(aim, found)
                            },
                        );
                        let mut left = if went { 0 } else { who };
                        while left != 0 {
                            let i = left.trailing_zeros() as usize;
                            left &= left - 1;
                            self.go_through(isa, (&rays[i], &packet.aims[i]), (leaf, &brick), from, found[i], inner);
                        }
                    }
                    State::Away => alone |= who,
                    State::Done => (),
                }
                self.ends(&packet, &found)
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
    fn end(&self, aim: &Aim, found: &Found) -> f64 {
        if self.is_met(found) { f64::NEG_INFINITY } else { found.t.min(aim.t_max) }
    }

    /// The same of rays that go together.
    #[inline(always)]
    fn ends(&self, packet: &Packet, found: &[&mut Found; MANY]) -> [f64; MANY] {
        let mut ends = [0.0; MANY];
        for i in 0..MANY {
            ends[i] = self.end(&packet.aims[i], found[i]);
        }
        ends
    }

    /// Has a ray meet a triangle.
    #[inline(always)]
    fn meet(
        &self,
        (ray, aim): (&Ray, &Aim),
        (leaf, brick): (u32, &Placed),
        (triangle, vertices): (u32, [DVec3; 3]),
        found: &mut Found,
    ) {
        if let Some(Crossing { t, weights, .. }) = aim.meet(vertices) {
            let (id, weights) = (brick.id(triangle), weights.map(|weight| weight as f32));
            // Of what is as near, the lowest id.
            if (t, id) < (found.t, found.id) && !self.passes(ray, brick, triangle, id, weights) {
                *found = Found { t, id, leaf, triangle, weights, normal: normal(vertices) };
            }
        }
    }

    /// Has a ray meet what there is in a brick.
    #[inline(always)]
    fn go_through<I: Isa>(
        &self,
        isa: I,
        (ray, aim): (&Ray, &Aim),
        (leaf, brick): (u32, &Placed),
        from: f64,
        found: &mut Found,
        room: &mut Inner,
    ) {
        let limit = found.t.min(aim.t_max);
        aim.triangles(
            isa,
            brick,
            (from, limit),
            room,
            #[inline(always)]
            |triangle| {
                self.meet((ray, aim), (leaf, brick), (triangle, brick.vertices(triangle)), found);
                (!self.is_met(found)).then_some(found.t.min(aim.t_max))
            },
        );
    }

    #[inline(always)]
    fn passes(&self, ray: &Ray, brick: &Placed, triangle: u32, id: u32, weights: [f32; 3]) -> bool {
        let opacity = &brick.geometry.view.opacity;
        self.passes && !opacity.of.is_empty() && opacity.passes(triangle, weights, false, || drawn(ray, id))
    }
}

impl Queries {
    /// What each ray meets first, at a `t` of its interval, which is closed; of what is as near, to the last bit, the
    /// triangle with the lowest id. Rays pass through what alpha masks cut out, and at random through what blends.
    ///
    /// # Errors
    /// A ray that is none, by its number; a damaged brick; what `watch` says.
    pub fn cast(&self, rays: &[Ray], watch: &mut Watch) -> Result<Vec<Hit>> {
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
    pub fn any(&self, rays: &[Ray], watch: &mut Watch) -> Result<Vec<bool>> {
        self.meets_any(rays, true, watch)
    }

    /// Whether each ray meets anything; with `passes` anything that it does not pass through.
    pub(super) fn meets_any(&self, rays: &[Ray], passes: bool, watch: &mut Watch) -> Result<Vec<bool>> {
        let found = self.find(rays, (true, passes), watch)?;
        Ok(self.threads.install(|| found.par_iter().map(|found| found.id != NONE).collect()))
    }

    fn find(&self, rays: &[Ray], (any, passes): (bool, bool), watch: &mut Watch) -> Result<Vec<Found>> {
        self.check_rays(rays)?;
        let has_opacity = passes && opacity::is_needed(self.scene.resident());
        let opacity = if has_opacity { opacity::table(&self.scene)? } else { Vec::new() };
        self.seek(&Casting { queries: self, any, passes }, rays, || NOTHING, &opacity, watch)
    }
}
