//! Queries beside brute force over all triangles.

use super::{MOST_BYTES, refused};
use crate::kind::{Fault, Kind, Limits, Outcome, Trial};
use crate::random::Random;
use crate::scenes;
use anyhow::Result;
use bricks::SceneFile;
use brickwalk::kernels::layout::NONE;
use brickwalk::math::crossing::crossing;
use brickwalk::output::npy::{Hit, Ray};
use brickwalk::query::{Closest, Queries};
use brickwalk::reference::{Truth, TruthRay};
use brickwalk::settings::CacheSize;
use glam::DVec3;
use std::sync::Arc;

/// Rays and points of a trial.
const MOST: usize = 24;

/// Queries.
pub struct Asked;

impl Kind for Asked {
    fn name(&self) -> &'static str {
        "differences/queries"
    }

    fn about(&self) -> &'static str {
        "Closest and all hits, occlusion and closest points beside brute force in f64"
    }

    fn limits(&self) -> Limits {
        Limits { seconds: 60.0, bytes: MOST_BYTES }
    }

    fn trial(&self, trial: &Trial) -> Result<Outcome, Fault> {
        let mut random = Random::new(self.name(), trial.seed);
        let mut source = scenes::source(&mut random);
        // Queries are about geometry: holes are not looked at.
        source.scene.textures.clear();
        for material in &mut source.scene.materials {
            *material = bricks::Material::DIFFUSE;
        }
        let settings = scenes::settings(&mut random, &source);
        let path = trial.folder.join("scene.bricks");
        scenes::convert(source.scene, &settings, &path)?;
        let file = Arc::new(SceneFile::open(&path).map_err(|error| refused(&error.into()))?);
        let truth = Truth::load(&file).map_err(|error| refused(&error.into()))?;
        let cache = CacheSize::Percent(random.pick([0.0, 20.0, 100.0]));
        let queries = Queries::new(file.clone(), cache, random.within(1, 3)).map_err(|error| refused(&error))?;
        let corners: Vec<[DVec3; 3]> =
            truth.ids().filter_map(|id| truth.vertices(id)).map(|of| of.map(DVec3::from_array)).collect();
        let rays: Vec<Ray> = (0..MOST).filter_map(|_| ray(&mut random, &file, &corners)).collect();
        let points: Vec<[f64; 3]> = (0..MOST).map(|_| point(&mut random, &file).to_array()).collect();
        // After many rays a scene that is kept becomes one tree.
        if random.chance(50) {
            let many: Vec<Ray> = rays.iter().cycle().take(MOST + corners.len()).copied().collect();
            queries.any(&many, &mut |_| Ok(())).map_err(|error| refused(&error))?;
        }
        check(&queries, &truth, &rays, &points)
    }
}

/// A point in or about the scene's box.
fn point(random: &mut Random, file: &SceneFile) -> DVec3 {
    let manifest = &file.resident().manifest;
    let (min, max) = (DVec3::from_array(manifest.min), DVec3::from_array(manifest.max));
    let spread = random.pick([1.0, 1.0, 3.0]);
    let mut share = || 0.5 + spread * (random.share() - 0.5);
    min + (max - min) * DVec3::new(share(), share(), share())
}

/// A ray to a point of the box, to a point of a triangle, to its edge or its corner.
fn ray(random: &mut Random, file: &SceneFile, corners: &[[DVec3; 3]]) -> Option<Ray> {
    let from = point(random, file);
    let to = match random.pick_from(corners) {
        Some([a, b, c]) if random.chance(70) => {
            let [u, v, w] = random.pick([[1.0, 1.0, 1.0], [2.0, 1.0, 0.0], [0.0, 0.0, 3.0], [0.5, 2.0, 0.5]]);
            (a * u + b * v + c * w) / 3.0
        }
        _ => point(random, file),
    };
    let (t_min, t_max) = random.pick([(0.0, f64::INFINITY), (0.25, 1.0), (0.0, 0.75), (-3.0, 4.0)]);
    let direction = (to - from).to_array();
    (direction != [0.0; 3]).then_some(Ray { origin: from.to_array(), direction, t_min, t_max })
}

/// All that a ray meets, the nearest first.
fn brute(truth: &Truth, ray: &Ray) -> Vec<(f64, u32)> {
    let line = TruthRay::new(ray.origin, ray.direction, 0.0, 0.0).line();
    let met = |id| Some((crossing(&line, truth.vertices(id)?)?.t, id));
    let within = |&(t, _): &(f64, u32)| t >= ray.t_min.max(0.0) && t <= ray.t_max;
    let mut all: Vec<(f64, u32)> = truth.ids().filter_map(met).filter(within).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    all
}

/// The distance of a triangle from a point, by the regions of its plane.
fn distance(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let segment = |a: DVec3, b: DVec3| {
        let (along, length) = (b - a, (b - a).length_squared());
        let t = if length > 0.0 { ((p - a).dot(along) / length).clamp(0.0, 1.0) } else { 0.0 };
        (a + along * t - p).length()
    };
    let edges = segment(a, b).min(segment(b, c)).min(segment(c, a));
    let normal = (b - a).cross(c - a);
    let inside = |a: DVec3, b: DVec3| (b - a).cross(p - a).dot(normal) >= 0.0;
    let is_above = normal.length_squared() > 0.0 && inside(a, b) && inside(b, c) && inside(c, a);
    if is_above { edges.min(((p - a).dot(normal) / normal.length()).abs()) } else { edges }
}

fn check(queries: &Queries, truth: &Truth, rays: &[Ray], points: &[[f64; 3]]) -> Result<Outcome, Fault> {
    let ask = || -> Result<_> {
        let none: &mut dyn FnMut(u64) -> Result<()> = &mut |_| Ok(());
        let cast = queries.cast(rays, none)?;
        let any = queries.any(rays, none)?;
        let list = queries.list_intersections(rays, none)?;
        let counts = queries.count_intersections(rays, none)?;
        Ok((cast, any, list, counts, queries.closest_points(points, none)?))
    };
    let (cast, any, list, counts, closest) = ask().map_err(|error| Fault::new("no answers", format!("{error:#}")))?;
    let met = |hit: &Hit| (hit.triangle != NONE).then_some((hit.t, hit.triangle));
    for (number, ray) in rays.iter().enumerate() {
        let right = brute(truth, ray);
        let wrong = |what: &str, own: String| Err(Fault::new(what, format!("{ray:?}: {own}, not {right:?}")));
        if met(&cast[number]) != right.first().copied() {
            return wrong("another closest hit", format!("{:?}", cast[number]));
        }
        if any[number] == right.is_empty() {
            return wrong("another occlusion", format!("{}", any[number]));
        }
        let own = &list.hits[list.starts[number] as usize..list.starts[number + 1] as usize];
        let own: Vec<(f64, u32)> = own.iter().filter_map(met).collect();
        if own != right {
            return wrong("other hits", format!("{own:?}"));
        }
        if counts[number] as usize != right.len() {
            return wrong("another count", format!("{}", counts[number]));
        }
    }
    for (point, found) in points.iter().zip(&closest) {
        check_point(truth, DVec3::from_array(*point), found)?;
    }
    Ok(Outcome::Passed)
}

fn check_point(truth: &Truth, point: DVec3, found: &Closest) -> Result<(), Fault> {
    let corners = |id| truth.vertices(id).map(|of| of.map(DVec3::from_array));
    let least = truth.ids().filter_map(corners).map(|of| distance(point, of)).fold(f64::INFINITY, f64::min);
    let own = corners(found.triangle).map_or(f64::INFINITY, |of| distance(point, of));
    // Distances of points far away are of differences of large numbers.
    let error = 1e-9 * (1.0 + point.abs().max_element());
    if least == found.distance || ((found.distance - least).abs() <= error && (own - least).abs() <= error) {
        return Ok(());
    }
    Err(Fault::new("another distance", format!("{point:?}: {found:?}, not {least}")))
}
