//! A model over a corner: three walls of 33 x 33 vertices, 256 rays each (figures 5 to 7 of the paper).

use crate::math::sampling::{cosine_hemisphere, hammersley, random2};
use crate::secondary::displacement::{Ball, Chord, FieldView};
use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

/// Vertices of a wall on each axis.
pub const VERTICES: u32 = 33;
/// Rays of a vertex.
pub const RAYS: u32 = 256;

/// A ray of a vertex.
#[derive(Clone, Copy, Debug)]
pub struct CornerRay {
    /// Where it starts.
    pub origin: DVec3,
    /// A unit vector.
    pub direction: DVec3,
}

/// The rays of all vertices of a corner whose walls are `side` long and `away` from the middle of the model's sphere,
/// both in radii of it: those of a vertex one after another, distributed by the cosine.
pub fn rays(ball: &Ball, side: f64, away: f64) -> Vec<CornerRay> {
    let vertices = 3 * VERTICES * VERTICES;
    let of_vertex = |vertex: u32| {
        let (wall, at) = (vertex / (VERTICES * VERTICES), vertex % (VERTICES * VERTICES));
        let along = |x: u32| side * f64::from(x) / f64::from(VERTICES - 1);
        let place = [0.0, along(at % VERTICES), along(at / VERTICES)];
        let turned = |v: [f64; 3]| DVec3::from_array(std::array::from_fn(|k| v[(k + wall as usize) % 3]));
        let frame = DMat3::from_cols(turned([0.0, 1.0, 0.0]), turned([0.0, 0.0, 1.0]), turned([1.0, 0.0, 0.0]));
        let origin = ball.center + ball.radius * (turned(place) - away);
        let moved = random2(vertex, 0, 7);
        (0..RAYS).map(move |ray| {
            let point = hammersley(ray, RAYS);
            let square = std::array::from_fn(|k| (point[k] + moved[k]).fract());
            let local = cosine_hemisphere(square).map(f64::from);
            CornerRay { origin, direction: (frame * DVec3::from_array(local)).normalize() }
        })
    };
    (0..vertices).flat_map(of_vertex).collect()
}

/// Distances at which rays meet something by a field, in radii of its sphere, infinite where they meet nothing; `exact`
/// are those of rays that it does not know.
pub fn by_field(field: &FieldView, ball: &Ball, rays: &[CornerRay], exact: &[f32], look: u32) -> Vec<f32> {
    let one = |(ray, &exact): (&CornerRay, &f32)| {
        let origin: Vec3 = ((ray.origin - ball.center) / ball.radius).as_vec3();
        let chord = Chord::of(origin.to_array(), ray.direction.as_vec3().to_array());
        let Some(chord) = chord.filter(|chord| chord.at + chord.half > 0.0) else { return f32::INFINITY };
        let share = field.share(&chord, look);
        if share < 0.0 {
            return f32::INFINITY;
        }
        // From inside of the sphere what is met behind says nothing.
        let distance = chord.distance(share);
        if distance <= 0.0 { exact } else { distance }
    };
    rays.par_iter().zip(exact).map(one).collect()
}

/// Grey levels of vertices, 0 to 255: the mean over their rays of the distance at which they meet something, of
/// `reach` at most, as a share of that; without a reach of those that go free.
pub fn levels(distances: &[f32], reach: f32) -> Vec<f64> {
    let light = |&distance: &f32| {
        if reach.is_finite() {
            f64::from((distance / reach).min(1.0))
        } else {
            f64::from(u8::from(distance.is_infinite()))
        }
    };
    let mean = |rays: &[f32]| rays.iter().map(light).sum::<f64>() / rays.len() as f64;
    distances.chunks(RAYS as usize).map(|rays| 255.0 * mean(rays)).collect()
}

/// The root of the mean square of differences, and their mean.
pub fn rms(one: &[f64], other: &[f64]) -> (f64, f64) {
    let count = one.len().max(1) as f64;
    let all = || one.iter().zip(other).map(|(a, b)| a - b);
    (f64::sqrt(all().map(|d| d * d).sum::<f64>() / count), all().sum::<f64>() / count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::counters::Counters;
    use crate::kernels::frame::Frame;
    use crate::kernels::layout;
    use crate::secondary::displacement::{Bench, Job, Shape, Subject, bake::bake, code_of};
    use crate::session::Settings;
    use crate::session::opened::{Opened, open_scene};
    use crate::session::trace::{for_rays, trace_device};
    use crate::settings::Adapter;
    use brickwalk_convert::build::{BuildSettings, build_source};
    use brickwalk_convert::import::{ImportSettings, import};
    use brickwalk_convert::progress::Progress;
    use std::path::PathBuf;

    #[test]
    #[ignore]
    fn experiment() {
        let scenes = PathBuf::from(std::env::var("BRICKWALK_SCENES").unwrap());
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("bunny.bricks");
        let progress = Progress::hidden();
        let source = import(&[scenes.join("scans/bunny.ply").into()], &ImportSettings::default(), &progress).unwrap();
        build_source(&source, &BuildSettings::default(), &file, &progress).unwrap();
        let settings = for_rays(&Settings { adapter: Adapter::Cpu, ..Settings::exact() });
        let scene = open_scene(&file).unwrap();
        let mut opened = Opened::open(scene.clone(), &file, &settings).unwrap();
        let subject = Subject { object: 0, brick: None };
        let ball = subject.ball(&scene).unwrap();
        eprintln!("{ball:?} {} bricks", scene.resident().bricks.len());
        for (side, away) in [(4.0, 1.25), (3.0, 1.0), (2.0, 1.0)] {
            eprintln!("side {side} away {away}");
            let all = rays(&ball, side, away);
            let mut exact = Vec::new();
            let start = std::time::Instant::now();
            {
                let mut traced = opened.traced();
                let frame = Frame::near(scene.resident(), ball.center);
                for chunk in all.chunks(traced.most) {
                    let rays: Vec<layout::Ray> = chunk
                        .iter()
                        .map(|ray| layout::Ray {
                            origin: frame.point(ray.origin),
                            t_min: 0.0,
                            direction: ray.direction.as_vec3().to_array(),
                            t_max: layout::T_INFINITE,
                        })
                        .collect();
                    let hits = trace_device(&mut traced, &frame, &rays, false, &mut Counters::default()).unwrap();
                    exact.extend(hits.iter().take(chunk.len()).map(|hit| {
                        if hit.id == layout::NONE {
                            f32::INFINITY
                        } else {
                            (f64::from(hit.t) * frame.unit / ball.radius) as f32
                        }
                    }));
                }
            }
            eprintln!(
                "exact {:.3} s; free {:.3}",
                start.elapsed().as_secs_f64(),
                exact.iter().filter(|x| x.is_infinite()).count() as f64 / exact.len() as f64
            );
            for rings in [8, 16, 32] {
                for directions in [32, 128] {
                    let shape = Shape { rings, directions };
                    let start = std::time::Instant::now();
                    let mut codes = vec![0u32; shape.samples().div_ceil(4) as usize];
                    let mut bench = Bench {
                        scene: &scene,
                        executor: &mut *opened.executor,
                        cache: &mut opened.cache,
                        most: opened.extent.rays(),
                        tile: 1024,
                    };
                    bake(&mut bench, &[Job { subject, ball, shape }], None, &mut |_, first, shares| {
                        for (i, &share) in (first..).zip(shares) {
                            codes[(i / 4) as usize] |=
                                u32::from(code_of((share >= 0.0).then_some(share))) << (8 * (i % 4));
                        }
                        true
                    })
                    .unwrap();
                    let baked = start.elapsed().as_secs_f64();
                    let table = shape.table();
                    let field = FieldView { shape, table: &table, codes: &codes, bits: 8, mean: 0.5 };
                    let mut line = format!("{rings} {directions} bake {baked:.2} s:");
                    for look in [0, 8, 11, 27] {
                        let found = by_field(&field, &ball, &all, &exact, look);
                        line += &format!(" | {look}:");
                        for reach in [1.0, 1.5, 2.0, 3.0, 6.0, f32::INFINITY] {
                            let (rms, mean) = rms(&levels(&found, reach), &levels(&exact, reach));
                            line += &format!(" {rms:.3}/{mean:+.2}");
                        }
                    }
                    eprintln!("{line}");
                }
            }
        }
    }
}
