//! Rays alone in the tree of the whole scene, some in turns: while the memory that one needs is on its way, others take
//! their steps.

use super::aims::{Aims, Locals, Told};
use super::flat::{Flat, FlatNode, FlatTriangle};
use super::given::Rays;
use super::hits::normal;
use super::packet::{ALL, MANY, Packet};
use super::room::Joint;
use super::rounds::{TASK, TOLD};
use super::top::Top;
use super::walk::{Asks, Branch, Open, elements, nearest_child};
use super::{Queries, Watch};
use crate::kernels::layout::NONE;
use crate::kernels::simd::isa::{Best, Isa, Work};
use crate::kernels::simd::wide::{Wide, three};
use crate::math::crossing::Crossing;
use crate::output::npy::Hit;
use anyhow::Result;
use glam::DVec3;
use rayon::prelude::*;
use std::ops::Range;

/// Rays that take turns: enough that memory is there when one's turn comes.
const TURNS: usize = 16;

/// Room for what a ray comes to later, at first.
const ROOM: usize = 32;

const NOTHING: Hit = Hit { t: f64::INFINITY, triangle: NONE, u: 0.0, v: 0.0, normal: [0.0; 3] };

/// Rays as they ask boxes of the tree. A plane at x across an axis is met at x * inverse and what is kept of it here.
struct Sights {
    /// For the bounds that are near.
    ahead: [[f32; MANY]; 3],
    /// For the others.
    behind: [[f32; MANY]; 3],
    /// Where their intervals begin.
    t_min: [f32; MANY],
    /// And where they end.
    limits: [f32; MANY],
}

impl Sights {
    #[inline(always)]
    fn new(aims: &Aims<MANY>, locals: &Locals<MANY>) -> Self {
        let mut sights =
            Self { ahead: [[0.0; MANY]; 3], behind: [[0.0; MANY]; 3], t_min: locals.t_min, limits: [0.0; MANY] };
        for k in 0..3 {
            for i in 0..MANY {
                sights.ahead[k][i] = -locals.ahead[k][i] * aims.inverse[k][i];
                sights.behind[k][i] = -locals.behind[k][i] * aims.inverse[k][i];
            }
        }
        for i in 0..MANY {
            sights.limits[i] = locals.told.above(aims.limit(i, aims.t_max[i]));
        }
        sights
    }
}

/// One of them.
struct Sight {
    inverse: [f32; 3],
    ahead: [f32; 3],
    behind: [f32; 3],
    t_min: f32,
    /// Whether the direction is negative, so that upper bounds are near, by axis.
    is_negative: [bool; 3],
}

impl Asks<FlatNode> for Sight {
    #[inline(always)]
    fn ask<I: Isa>(&self, isa: I, node: &FlatNode, limit: f32) -> (u32, [f32; 8]) {
        let (mut near, mut end) = (isa.eight(self.t_min), isa.eight(limit));
        for k in 0..3 {
            let (inverse, is_negative) = (isa.eight(self.inverse[k]), self.is_negative[k]);
            near = near.most(node.bounds(isa, k, is_negative) * inverse + isa.eight(self.ahead[k]));
            end = end.least(node.bounds(isa, k, !is_negative) * inverse + isa.eight(self.behind[k]));
        }
        let mut nears = [0.0; 8];
        near.store(&mut nears);
        (near.less_equal(end), nears)
    }
}

/// Rays that are set up.
struct Ready {
    /// The place of the first among those of the task.
    place: usize,
    aims: Aims<MANY>,
    sights: Sights,
    told: Told,
}

/// A ray that takes turns.
struct Turn {
    /// Which of those that are set up.
    number: usize,
    sight: Sight,
    /// Up to where it may still meet something, in the frame.
    limit: f32,
    /// What it comes to next,
    next: Open,
    /// and later.
    open: Vec<Open>,
}

impl Turn {
    /// A ray before its first step; `open` is room to work in.
    #[inline(always)]
    fn new(ready: &[Ready], number: usize, mut open: Vec<Open>) -> Self {
        let (Ready { aims, sights, .. }, i) = (&ready[number / MANY], number % MANY);
        open.clear();
        let inverse = three!(k => aims.inverse[k][i]);
        let sight = Sight {
            inverse,
            ahead: three!(k => sights.ahead[k][i]),
            behind: three!(k => sights.behind[k][i]),
            t_min: sights.t_min[i],
            is_negative: three!(k => inverse[k].is_sign_negative()),
        };
        Self { number, sight, limit: sights.limits[i], next: Open::new(0.0, 0), open }
    }

    /// A step: a node is asked, or `visit` is called with the triangles of a leaf and returns the limit from now on.
    /// Returns whether there is a next one, whose memory is on its way then.
    #[inline(always)]
    fn step<I: Isa>(&mut self, isa: I, flat: &Flat, visit: impl FnOnce(usize, Range<u32>) -> f32) -> bool {
        let mut nearest = None;
        if let Some(triangles) = elements(self.next) {
            self.limit = visit(self.number, triangles);
        } else {
            let node = &flat.nodes[self.next.number() as usize];
            nearest = nearest_child(isa, node, &self.sight, self.limit, &mut self.open);
        }
        while let Some(next) = nearest.or_else(
            #[inline(always)]
            || self.open.pop(),
        ) {
            if next.near() <= self.limit {
                self.next = next;
                flat.fetch(isa, next.number(), elements(next));
                return true;
            }
            nearest = None;
        }
        false
    }
}

/// Rays that are answered.
struct Task<'a> {
    top: &'a Top,
    flat: &'a Flat,
    rays: Rays<'a>,
    /// Whether anything will do: hits say then that there is one.
    any: bool,
    /// The number of the first.
    first: usize,
}

impl Task<'_> {
    /// Notes what a ray has met, if it has. Returns up to where it may still meet what matters.
    #[inline(always)]
    fn note(
        &self,
        (aims, i): (&Aims<MANY>, usize),
        (triangle, vertices): (&FlatTriangle, [DVec3; 3]),
        hit: &mut Hit,
    ) -> f64 {
        if let Some(Crossing { t, weights, .. }) = aims.meet(i, vertices)
            // Of what is as near, the lowest id.
            && (t < hit.t || t == hit.t && triangle.id < hit.triangle)
        {
            (hit.t, hit.triangle) = (t, triangle.id);
            if self.any {
                return f64::NEG_INFINITY;
            }
            let weight = |vertex: u32| weights[(vertex + 3 - triangle.rotation) as usize % 3] as f32;
            (hit.u, hit.v, hit.normal) = (weight(1), weight(2), normal(vertices));
        }
        hit.t.min(aims.t_max[i])
    }

    /// Has rays go together. False: they do not go much the same way.
    #[inline(always)]
    fn go_together<I: Isa>(&self, isa: I, aims: &Aims<MANY>, hits: &mut [Hit; MANY], open: &mut Vec<Joint>) -> bool {
        let &Self { top, flat, .. } = self;
        let Some(packet) = Packet::new(top, aims) else { return false };
        packet.triangles_of_all(
            isa,
            (top, flat),
            open,
            aims.t_max,
            #[inline(always)]
            |triangle, vertices, i| {
                // Who needs no more has nothing before its end.
                if self.any && hits[i].triangle != NONE {
                    return f64::NEG_INFINITY;
                }
                self.note((aims, i), (&flat.triangles[triangle as usize], vertices), &mut hits[i])
            },
        );
        true
    }

    /// Has rays take turns: of those that are set up the ones that `numbers` say.
    #[inline(always)]
    fn take_turns<I: Isa>(&self, isa: I, ready: &[Ready], numbers: &[u16], hits: &mut [Hit]) {
        let flat = self.flat;
        let mut coming = numbers.iter().map(|&number| usize::from(number));
        let first = coming.by_ref().take(TURNS);
        let mut turns: Vec<Turn> = first.map(|number| Turn::new(ready, number, Vec::with_capacity(ROOM))).collect();
        while !turns.is_empty() {
            let mut place = 0;
            while place < turns.len() {
                let turn = &mut turns[place];
                let goes_on = turn.step(
                    isa,
                    flat,
                    #[inline(always)]
                    |number, triangles| {
                        let (Ready { place, aims, told, .. }, i) = (&ready[number / MANY], number % MANY);
                        let mut end = aims.t_max[i];
                        for triangle in triangles {
                            let of = (&flat.triangles[triangle as usize], flat.vertices(triangle));
                            end = self.note((aims, i), of, &mut hits[place + i]);
                            if end == f64::NEG_INFINITY {
                                break;
                            }
                        }
                        told.above(aims.limit(i, end))
                    },
                );
                if goes_on {
                    place += 1;
                } else if let Some(number) = coming.next() {
                    *turn = Turn::new(ready, number, std::mem::take(&mut turn.open));
                    place += 1;
                } else {
                    turns.swap_remove(place);
                }
            }
        }
    }
}

impl Work for (Task<'_>, &mut [Hit]) {
    type Out = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let (task, hits) = self;
        let (mut ready, mut alone, mut joint) = (Vec::with_capacity(TASK / MANY), Vec::with_capacity(TASK), Vec::new());
        for (place, hits) in hits.chunks_mut(MANY).enumerate() {
            let aims = Aims::new(task.top, &task.rays.columns(task.first + place * MANY));
            if let Some(hits) = hits.as_mut_array()
                && task.go_together(isa, &aims, hits, &mut joint)
            {
                continue;
            }
            let mut left = aims.come & (ALL >> (MANY - hits.len()));
            while left != 0 {
                alone.push((ready.len() * MANY) as u16 + left.trailing_zeros() as u16);
                left &= left - 1;
            }
            let locals = task.flat.locals(task.top, &aims);
            ready.push(Ready { place: place * MANY, sights: Sights::new(&aims, &locals), told: locals.told, aims });
        }
        task.take_turns(isa, &ready, &alone, hits);
    }
}

/// What is kept of hits.
pub(super) trait Answer: Copy + Send + Sync {
    /// Of rays that meet nothing.
    const NOTHING: Self;

    /// Whether rays need not meet what is nearest: hits say then only that there is one.
    const IS_ANY: bool;

    /// Calls `find` with hits of nothing, and keeps what it makes of them.
    fn keep(answers: &mut [Self], find: impl FnOnce(&mut [Hit]));
}

impl Answer for Hit {
    const NOTHING: Self = NOTHING;

    const IS_ANY: bool = false;

    fn keep(answers: &mut [Self], find: impl FnOnce(&mut [Hit])) {
        find(answers);
    }
}

impl Answer for bool {
    const NOTHING: Self = false;

    const IS_ANY: bool = true;

    fn keep(answers: &mut [Self], find: impl FnOnce(&mut [Hit])) {
        let mut hits = [NOTHING; TASK];
        let hits = &mut hits[..answers.len()];
        find(hits);
        for (answer, hit) in answers.iter_mut().zip(hits) {
            *answer = hit.triangle != NONE;
        }
    }
}

impl Queries {
    /// What each ray meets, in the tree of the whole scene. Rays have been checked.
    ///
    /// # Errors
    /// What `watch` says.
    pub(super) fn cast_flat<T: Answer>(&self, flat: &Flat, rays: Rays, watch: &mut Watch) -> Result<Vec<T>> {
        let (top, isa, any) = (self.top(), Best::for_one(), T::IS_ANY);
        let mut found: Vec<T> = Vec::with_capacity(rays.len());
        while found.len() < rays.len() {
            let from = found.len();
            let task = |(place, answers): (usize, &mut [T])| {
                let first = from + place * TASK;
                T::keep(answers, |hits| isa.run((Task { top, flat, rays, any, first }, hits)));
            };
            found.resize(rays.len().min(from + TOLD), T::NOTHING);
            self.threads.install(|| found[from..].par_chunks_mut(TASK).enumerate().for_each(task));
            watch((found.len() - from) as u64)?;
        }
        Ok(found)
    }
}
