use super::intersect_all::intersect_all;
use super::run::Work;
use crate::gpu::probe;
use crate::kernels::bound::{Bound, Counters, Demand, Scene};
use crate::kernels::flat::FlatBrick;
use crate::kernels::frame::Frame;
use crate::kernels::lamps::LampTables;
use crate::kernels::layout::{COUNTER_NODES, COUNTER_TRIANGLES, Hit, NONE, PARAM_ANY_HIT, Params, Ray, Slot, Surface};
use crate::kernels::payloads::BrickView;
use crate::kernels::rays::{RaySet, start_hit};
use crate::kernels::simd::isa::{Best, Scalar};
use crate::kernels::tiles::PairCounts;
use bricks::{Brick, Payload, SceneFile};
use std::sync::atomic::Ordering;

/// What rays have found, and counted; bricks that they used.
type Found = (Vec<[u32; 4]>, Vec<[u32; 12]>, [u64; 2], Vec<u32>);

struct Stage {
    file: SceneFile,
    scene: Scene,
    payloads: Vec<Vec<u32>>,
    /// Of the bricks that are not wide.
    flats: Vec<Option<FlatBrick>>,
}

impl Stage {
    fn new() -> (Self, Frame) {
        let file = probe::scene().unwrap();
        let frame = Frame::near(file.resident(), glam::DVec3::ZERO);
        let mut scene = Scene::new(file.resident());
        scene.rebase(file.resident(), frame);
        let payload = |brick: u32| {
            let payload = Payload::Geometry(brick);
            let mut words = vec![0u32; file.span(payload).bytes as usize / 4];
            file.copy(payload, bytemuck::cast_slice_mut(&mut words)).unwrap();
            words
        };
        let records = &file.resident().bricks;
        let payloads: Vec<Vec<u32>> = (0..records.len() as u32).map(payload).collect();
        let flat = |(record, words): (&Brick, &Vec<u32>)| {
            BrickView::new(record, bytemuck::cast_slice(words), &[]).flattened(record.triangle_count)
        };
        let flats = records.iter().zip(&payloads).map(flat).collect();
        (Self { file, scene, payloads, flats }, frame)
    }

    /// Of `rays` in rows of `width`, in bricks as they are or flat.
    fn trace(&self, isa: Best, rays: &[Ray], (width, is_flat): (u32, bool), flags: u32) -> Found {
        let records = &self.file.resident().bricks;
        let views: Vec<BrickView> = records
            .iter()
            .zip(&self.payloads)
            .zip(&self.flats)
            .map(|((b, words), flat)| {
                BrickView::new(b, bytemuck::cast_slice(words), &[]).with_flat(flat.as_ref().filter(|_| is_flat))
            })
            .collect();
        let params = Params {
            width,
            height: rays.len() as u32 / width,
            tile: 64,
            tiles_x: width.div_ceil(64),
            flags,
            top_count: self.scene.top2.len() as u32,
            instance_pad: self.scene.instance_pad,
            ..Params::default()
        };
        let demand: Vec<Demand> = views.iter().map(|_| Demand::default()).collect();
        let (slots, counters) = (vec![Slot::default(); views.len()], Counters::default());
        let (params, scene) = (&params, &self.scene);
        let bound = Bound {
            params,
            block: &[0; 16],
            scene,
            bricks: &views,
            slots: &slots,
            demand: &demand,
            counters: &counters,
            lamps: &LampTables::default(),
            count: true,
            isa,
        };
        let mut set = RaySet::new(rays.len());
        set.rays = rays.to_vec();
        for (i, ray) in rays.iter().enumerate() {
            // Some start from a triangle, which they do not meet.
            (set.hits[i], set.surfaces[i]) = start_hit(ray.t_max, if i % 5 == 0 { i as u32 % 64 } else { NONE });
        }
        intersect_all::<false>(&bound, &mut set, Work::All, &PairCounts::default());
        let counted = counters.get();
        let bits = |hit: &Hit| bytemuck::cast(*hit);
        let surface = |surface: &Surface| bytemuck::cast(*surface);
        (
            set.hits.iter().map(bits).collect(),
            set.surfaces.iter().map(surface).collect(),
            [COUNTER_NODES, COUNTER_TRIANGLES].map(|counter| u64::from(counted[counter as usize])),
            demand.iter().map(|brick| brick.rays.load(Ordering::Relaxed)).collect(),
        )
    }

    /// Each by itself. A source is told by the ray's number.
    fn trace_alone(&self, rays: &[Ray], flags: u32) -> Found {
        let mut all = Found::default();
        all.3 = vec![0; self.payloads.len()];
        for i in 0..rays.len() {
            // The others of its row are not traced.
            let untraced = Ray { t_min: 1.0, t_max: 0.0, direction: [1.0, 0.0, 0.0], ..Ray::default() };
            let mut row = vec![untraced; i % 320 + 1];
            row[i % 320] = rays[i];
            let width = (row.len() as u32, false);
            let (hits, surfaces, counted, used) = self.trace(Best::Scalar(Scalar), &row, width, flags);
            all.0.push(hits[i % 320]);
            all.1.push(surfaces[i % 320]);
            (0..2).for_each(|k| all.2[k] += counted[k]);
            all.3.iter_mut().zip(used).for_each(|(all, used)| *all |= used);
        }
        all
    }
}

/// Rays of a camera in the middle, some of which differ in the octant.
fn camera_rays(unit: f64) -> Vec<Ray> {
    let ray = |i: usize| {
        let (x, y) = ((i % 64) as f32 / 32.0 - 0.97, (i / 64) as f32 / 16.0 - 0.9);
        let origin = [0.1, 0.2, 2.5].map(|x: f64| (x / unit) as f32);
        Ray { origin, t_min: 0.0, direction: [x, y, -1.0], t_max: crate::kernels::layout::T_INFINITE }
    };
    (0..2048).map(ray).collect()
}

#[test]
fn rays_that_go_together_find_and_count_what_each_does_alone() {
    let (stage, frame) = Stage::new();
    let adverse = probe::adverse_rays(&stage.file, &frame).unwrap();
    for (name, rays) in [("adverse", adverse), ("camera", camera_rays(frame.unit))] {
        for flags in [0, PARAM_ANY_HIT] {
            let alone = stage.trace_alone(&rays, flags);
            let hits = alone.0.iter().filter(|hit| hit[1] != NONE).count();
            assert!(hits > 200, "{name}: only {hits} hits");
            for isa in Best::all() {
                let together = stage.trace(isa, &rays, (64, false), flags);
                let context = format!("{name} rays, flags {flags}, {}", isa.describe().0);
                for (i, ray) in rays.iter().enumerate() {
                    assert_eq!(together.0[i], alone.0[i], "{context}: hit of ray {i}: {ray:?}");
                    assert_eq!(together.1[i], alone.1[i], "{context}: surface of ray {i}: {ray:?}");
                }
                assert_eq!((together.2, &together.3), (alone.2, &alone.3), "{context}: counters and uses");
                // Control: other rays find something else.
                let mut others = rays.clone();
                others.iter_mut().for_each(|ray| ray.origin[0] += 0.01 * ray.direction[0].abs().max(1.0));
                assert!(stage.trace(isa, &others, (64, false), flags) != alone, "{context}");
                // In flat bricks visits are others, and not all counted.
                let flat = stage.trace(isa, &rays, (64, true), flags);
                for (i, ray) in rays.iter().enumerate() {
                    assert_eq!(flat.0[i], alone.0[i], "{context}, flat: hit of ray {i}: {ray:?}");
                    assert_eq!(flat.1[i], alone.1[i], "{context}, flat: surface of ray {i}: {ray:?}");
                }
                assert_eq!(flat.3, alone.3, "{context}, flat: uses");
                assert!(flat.2 < alone.2, "{context}: bricks were flat");
                assert!(stage.trace(isa, &others, (64, true), flags).0 != alone.0, "{context}, flat");
            }
        }
    }
}
