use super::*;
use crate::gpu::probe;
use crate::kernels::bound::{Counters, Demand, Scene};
use crate::kernels::frame::Frame;
use crate::kernels::lamps::LampTables;
use crate::kernels::layout::{self, Params, Ray};
use crate::kernels::rays::start_hit;
use crate::kernels::simd::isa::Best;
use crate::kernels::trace::levels::is_pending;
use crate::kernels::trace::node::{framed_ray, node_hits};

/// What rays ask of bricks: how many rays ask for each, the least distance, and how many enter it before any other.
/// Which rays are pending, and the counter.
#[derive(PartialEq)]
struct Asked {
    bricks: Vec<[u32; 2]>,
    next: Vec<u32>,
    pending: Vec<bool>,
    asks: u32,
}

struct Stage {
    scene: Scene,
    rays: Vec<Ray>,
    /// Bricks in the wanted state.
    wanted: Vec<bool>,
    /// Rays that ended before, and how far others reach.
    ended: Vec<bool>,
    flags: u32,
}

impl Stage {
    fn params(&self) -> Params {
        let width = 64;
        Params {
            width,
            height: self.rays.len() as u32 / width,
            tile: 64,
            tiles_x: 1,
            flags: self.flags,
            top_count: self.scene.top2.len() as u32,
            instance_pad: self.scene.instance_pad,
            select_mask: 1,
            select_want: 1,
            ..Params::default()
        }
    }

    fn set(&self) -> RaySet {
        let mut set = RaySet::new(self.rays.len());
        set.rays = self.rays.clone();
        for (i, ray) in self.rays.iter().enumerate() {
            (set.hits[i], set.surfaces[i]) = start_hit(ray.t_max, NONE);
            if self.ended[i] {
                set.hits[i].id = 7;
            }
            // Some ask for nothing any more.
            set_pending(&mut set.surfaces[i], i % 7 != 3);
        }
        set
    }

    /// By the kernel, `times` over.
    fn together(&self, isa: Best, times: usize) -> Asked {
        let (params, counters) = (self.params(), Counters::default());
        let demand: Vec<Demand> = self.wanted.iter().map(|_| Demand::default()).collect();
        let slot = |&wanted: &bool| layout::Slot { state: wanted.into(), ..layout::Slot::default() };
        let slots: Vec<layout::Slot> = self.wanted.iter().map(slot).collect();
        let bound = Bound {
            params: &params,
            block: &[0; 16],
            scene: &self.scene,
            bricks: &[],
            slots: &slots,
            demand: &demand,
            counters: &counters,
            lamps: &LampTables::default(),
            count: false,
            isa,
        };
        let mut set = self.set();
        (0..times).for_each(|_| query_all(&bound, &mut set, Work::All, &PairCounts::default()));
        let asks = counters.get()[COUNTER_PAIRS_VISIBLE as usize];
        let told: Vec<layout::Demand> = demand.iter().map(Demand::get).collect();
        Asked {
            bricks: told.iter().map(|brick| [brick.rays, brick.nearest]).collect(),
            next: told.iter().map(|brick| brick.next).collect(),
            pending: set.surfaces.iter().map(is_pending).collect(),
            asks,
        }
    }

    /// By looking at every brick's root for every ray. Also how many rays enter each brick before or with any other.
    fn one_by_one(&self) -> (Asked, Vec<u32>) {
        let none = vec![0; self.wanted.len()];
        let (mut bricks, mut next, mut with) = (vec![[0, u32::MAX]; none.len()], none.clone(), none);
        let (mut pending, mut asks) = (vec![false; self.rays.len()], 0);
        let before = self.set();
        for (i, ray) in self.rays.iter().enumerate() {
            let is_over = self.flags & PARAM_ANY_HIT != 0 && self.ended[i];
            if !is_pending(&before.surfaces[i]) || is_over || ray.t_min > ray.t_max {
                continue;
            }
            let world = framed_ray(ray.origin, ray.direction, ray.t_min);
            let mut r = BrickRay::outside(&world);
            let mut entries = Vec::new();
            for (leaf, of) in (0..).zip(&self.scene.leaves) {
                let brick = of.brick as usize;
                r.enter_leaf(&self.scene, &world, leaf);
                let root = &self.scene.roots[brick];
                let boxes = node_hits(&r.ray, root, r.offset_high, r.offset_low, 0.0, before.hits[i].t);
                let (entered, near) = entered_children(&boxes, root);
                if !self.wanted[brick] || entered == 0 {
                    continue;
                }
                asks += 1;
                bricks[brick][0] += 1;
                bricks[brick][1] = bricks[brick][1].min(entry_bits(near));
                entries.push((near, brick));
            }
            entries.sort_by(|a, b| a.0.total_cmp(&b.0));
            pending[i] = !entries.is_empty();
            let first: Vec<usize> = entries.iter().filter(|e| e.0 == entries[0].0).map(|e| e.1).collect();
            first.iter().for_each(|&brick| with[brick] += 1);
            if let [only] = first[..] {
                next[only] += 1;
            }
        }
        (Asked { bricks, next, pending, asks }, with)
    }
}

#[test]
fn rays_that_ask_together_ask_for_what_each_does_alone() {
    let file = probe::scene().unwrap();
    let frame = Frame::near(file.resident(), glam::DVec3::ZERO);
    let mut scene = Scene::new(file.resident());
    scene.rebase(file.resident(), frame);
    let mut rays = probe::adverse_rays(&file, &frame).unwrap();
    rays.truncate(rays.len() / 64 * 64);
    // Some end soon, and some are not traced.
    for (i, ray) in rays.iter_mut().enumerate() {
        let shorter = |t: f32| (t / 4.0).min(4.0 / frame.unit as f32);
        ray.t_max = if i % 3 == 0 { shorter(ray.t_max) } else { ray.t_max };
        ray.t_max = if i % 11 == 5 { -1.0 } else { ray.t_max };
    }
    let wanted: Vec<bool> = (0..file.resident().bricks.len()).map(|brick| brick % 4 != 1).collect();
    let ended = (0..rays.len()).map(|i| i % 5 == 2).collect();
    let mut stage = Stage { scene, rays, wanted, ended, flags: 0 };
    for any_hit in [0, PARAM_ANY_HIT] {
        stage.flags = any_hit;
        let (alone, with) = stage.one_by_one();
        let asking = alone.pending.iter().filter(|pending| **pending).count();
        assert!(asking > 200 && alone.asks as usize > asking + 100, "{asking} rays ask {} times", alone.asks);
        assert!(alone.next.iter().sum::<u32>() > 200, "most enter one before all others");
        for isa in Best::all() {
            let context = format!("flags {any_hit}, {}", isa.describe().0);
            stage.flags = any_hit;
            let all = stage.together(isa, 1);
            assert_eq!((&all.bricks, all.asks), (&alone.bricks, alone.asks), "{context}");
            // Up to the first that it enters each ray asks for no more, and for the same first.
            stage.flags = any_hit | PARAM_NEXT;
            let up_to_next = stage.together(isa, 1);
            assert!(up_to_next.asks < all.asks, "{context}: asks {} times", up_to_next.asks);
            assert!(up_to_next.bricks.iter().zip(&all.bricks).all(|(some, all)| some[0] <= all[0]), "{context}");
            for asked in [&all, &up_to_next] {
                assert!(asked.pending == alone.pending, "{context}: who is pending");
                assert_eq!(asked.next.iter().sum::<u32>() as usize, asking, "{context}");
                for (brick, next) in asked.next.iter().enumerate() {
                    assert!((alone.next[brick]..=with[brick]).contains(next), "{context}: {next} enter {brick} next");
                }
            }
            // Those that are pending ask again, and no others.
            stage.flags = any_hit;
            let twice = stage.together(isa, 2);
            assert!(twice.asks == 2 * all.asks && twice.pending == all.pending, "{context}: asked twice");
            // Control: with other bricks missing they ask for something else.
            let others = (0..stage.wanted.len()).map(|brick| brick % 4 != 2).collect();
            let wanted = std::mem::replace(&mut stage.wanted, others);
            assert!(stage.together(isa, 1).bricks != alone.bricks, "{context}: other bricks");
            stage.wanted = wanted;
        }
    }
}
