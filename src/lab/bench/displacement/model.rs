//! Models over the corner: opened, their fields made, the corner's rays traced.

use super::corner::{self, CornerRay};
use crate::counters::Counters;
use crate::kernels::frame::Frame;
use crate::kernels::layout::{self, NONE, T_INFINITE};
use crate::lab::console::Console;
use crate::output::atomic;
use crate::secondary::displacement::bake::{Directions3, bake};
use crate::secondary::displacement::{Ball, Bench, Job, Shape, Subject};
use crate::session::Settings;
use crate::session::opened::{Opened, open_scene};
use crate::session::trace::{EXTENT, for_rays, trace_device};
use crate::settings::{Adapter, CacheSize};
use anyhow::{Context, Result, bail};
use bricks::SceneFile;
use brickwalk_convert::build::{BuildSettings, build, build_source};
use brickwalk_convert::import::{ImportSettings, import};
use brickwalk_convert::source::{Primitive, SourceScene};
use brickwalk_scenes::one_mesh;
use glam::DVec3;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// A bumpy sphere of 8 n² triangles, n of them along an edge of the octahedron that it is made from.
fn bumpy(n: u32) -> SourceScene {
    let mut surface = Primitive::default();
    for face in 0..8u32 {
        let sign = |axis: u32| if face >> axis & 1 == 0 { 1.0 } else { -1.0 };
        let first = surface.positions.len() as u32;
        // Row i has i + 1 vertices.
        let number = |i: u32, j: u32| first + i * (i + 1) / 2 + j;
        for i in 0..=n {
            for j in 0..=i {
                // The coordinates are whole and their sum is n, so that faces share the vertices of their edges.
                let at = DVec3::new(sign(0) * f64::from(n - i), sign(1) * f64::from(i - j), sign(2) * f64::from(j));
                surface.positions.push(bumped(at.normalize()).to_array());
            }
        }
        let is_mirrored = sign(0) * sign(1) * sign(2) < 0.0;
        let mut triangle = |a, b, c| surface.indices.extend(if is_mirrored { [a, c, b] } else { [a, b, c] });
        for i in 0..n {
            for j in 0..=i {
                triangle(number(i, j), number(i + 1, j), number(i + 1, j + 1));
                if j < i {
                    triangle(number(i, j), number(i + 1, j + 1), number(i, j + 1));
                }
            }
        }
    }
    one_mesh("bumpy", surface)
}

/// A point of the bumpy sphere: of two sizes of bumps, deep enough to hide behind each other.
fn bumped(way: DVec3) -> DVec3 {
    let waves = |k: f64, turn: f64| {
        (k * way.x + turn).sin() * (k * way.y + 2.0 * turn).sin() + (k * way.z + 3.0 * turn).sin() * (k * way.x).cos()
    };
    way * (1.0 + 0.22 * waves(4.0, 0.7) + 0.05 * waves(15.0, 1.9))
}

/// The model: the file `given`, converted if it is no scene, or a bumpy sphere; its name and its scene.
///
/// # Errors
/// It cannot be read, or the folder cannot be written.
pub fn place(given: Option<&Path>, triangles: u64, folder: &Path, console: Console) -> Result<(String, PathBuf)> {
    let Some(file) = given else { return made(triangles, folder, console) };
    let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    if file.extension().is_some_and(|extension| extension == "bricks") {
        return Ok((name, file.to_path_buf()));
    }
    atomic::create_folder(folder)?;
    let scene = folder.join(format!("{name}.bricks"));
    let progress = (console.job)();
    let scratch = Some(folder.to_path_buf());
    let source = import(&[file.into()], &ImportSettings { scratch, ..ImportSettings::default() }, &progress)?;
    // All of it is one object.
    let whole =
        BuildSettings { instance_min_triangles: u32::MAX, bake_budget_triangles: u64::MAX, ..BuildSettings::default() };
    build_source(&source, &whole, &scene, &progress).with_context(|| file.display().to_string())?;
    progress.finish();
    Ok((name, scene))
}

/// A bumpy sphere of about so many triangles, made if it is not there.
///
/// # Errors
/// The folder cannot be written.
pub fn made(triangles: u64, folder: &Path, console: Console) -> Result<(String, PathBuf)> {
    let n = ((triangles as f64 / 8.0).sqrt().round() as u32).max(1);
    let name = format!("bumpy-{}", 8 * u64::from(n) * u64::from(n));
    let scene = folder.join(format!("{name}.bricks"));
    if !scene.exists() {
        atomic::create_folder(folder)?;
        let progress = (console.job)();
        let build = build(bumpy(n), &BuildSettings::default(), &scene, &progress);
        build.with_context(|| scene.display().to_string())?;
        progress.finish();
    }
    Ok((name, scene))
}

/// A scene of one object.
///
/// # Errors
/// The scene cannot be read, or has several objects, or none.
pub fn open(file: &Path) -> Result<(Arc<SceneFile>, Subject)> {
    let scene = open_scene(file)?;
    let mut objects = (0..).zip(&scene.resident().objects).filter(|(_, object)| object.brick_count > 0);
    let (Some((object, _)), None) = (objects.next(), objects.next()) else {
        bail!("{}: a model is one object; give a file that is to be converted instead", file.display());
    };
    Ok((scene, Subject { object, brick: None }))
}

/// A model over the corner.
pub struct Model {
    /// Its scene.
    pub scene: Arc<SceneFile>,
    /// The sphere around it.
    pub ball: Ball,
    /// The rays of the corner.
    pub rays: Vec<CornerRay>,
    /// How far they go, in radii of the sphere, infinite where they meet nothing.
    pub exact: Vec<f32>,
    subject: Subject,
    opened: Opened,
    frame: Frame,
    /// `rays` as the device has them.
    given: Vec<layout::Ray>,
}

impl Model {
    /// Opens the scene of a model, with all of it resident, and traces so many rays of every vertex.
    ///
    /// # Errors
    /// The scene's, the device's.
    pub fn open(file: &Path, adapter: &Adapter, rays: u32) -> Result<Self> {
        let (scene, subject) = open(file)?;
        let cache = CacheSize::Percent(100.0);
        let settings = for_rays(&Settings { adapter: adapter.clone(), cache, ..Settings::exact() });
        let opened = Opened::open(scene.clone(), file, &settings)?;
        let ball = subject.ball(&scene)?;
        let frame = Frame::near(scene.resident(), ball.center);
        let rays = corner::rays(&ball, rays);
        let given = |ray: &CornerRay| layout::Ray {
            origin: frame.point(ray.origin),
            t_min: 0.0,
            direction: ray.way.to_array(),
            t_max: T_INFINITE,
        };
        let given = rays.iter().map(given).collect();
        let mut model = Self { scene, ball, rays, exact: Vec::new(), subject, opened, frame, given };
        let scale = frame.unit / ball.radius;
        let distance =
            |hit: &layout::Hit| if hit.id == NONE { f32::INFINITY } else { (f64::from(hit.t) * scale) as f32 };
        model.exact = model.trace(false)?.iter().map(distance).collect();
        Ok(model)
    }

    /// Triangles.
    pub fn triangles(&self) -> u64 {
        self.scene.resident().manifest.triangle_ids
    }

    /// Bricks.
    pub fn bricks(&self) -> usize {
        self.scene.resident().bricks.len()
    }

    /// What the corner's rays hit, or with `any` whether they hit something.
    ///
    /// # Errors
    /// The device's.
    pub fn trace(&mut self, any: bool) -> Result<Vec<layout::Hit>> {
        let mut traced = self.opened.traced();
        let mut all = Vec::with_capacity(self.given.len());
        for chunk in self.given.chunks(traced.most) {
            all.extend(trace_device(&mut traced, &self.frame, chunk, any, &mut Counters::default())?);
        }
        Ok(all)
    }

    /// Makes a field: `take` gets shares of chords from a number on, in their order. Returns the seconds.
    ///
    /// # Errors
    /// The device's; the run was to come to an end.
    pub fn bake(
        &mut self,
        shape: Shape,
        direction: Option<&Directions3>,
        console: Console,
        take: &mut dyn FnMut(u64, &[f32]),
    ) -> Result<f64> {
        let start = Instant::now();
        let mut bench = Bench {
            scene: &self.scene,
            executor: &mut *self.opened.executor,
            cache: &mut self.opened.cache,
            most: self.opened.extent.rays(),
            tile: (EXTENT.tile * EXTENT.tile) as usize,
        };
        let job = Job { subject: self.subject, ball: self.ball, shape };
        bake(&mut bench, &[job], direction, &mut |_, first, shares| {
            take(first, shares);
            !console.is_stopped()
        })?;
        console.go_on()?;
        Ok(start.elapsed().as_secs_f64())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    #[test]
    fn bumpy_spheres_are_closed_and_face_outward() {
        let scene = bumpy(5);
        let surface = &scene.meshes[0].primitives[0];
        assert_eq!(surface.indices.len(), 3 * 8 * 25);
        let at = |index: u32| DVec3::from_array(surface.positions[index as usize]);
        // Every edge has a triangle on each side, in opposite directions.
        let bits = |index: u32| (at(index) + 0.0).to_array().map(f64::to_bits);
        let mut edges: HashMap<_, i32> = HashMap::new();
        let mut volume = 0.0;
        for corners in surface.indices.chunks(3) {
            for k in 0..3 {
                let [a, b] = [corners[k], corners[(k + 1) % 3]].map(bits);
                *edges.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
            }
            volume += at(corners[0]).dot(at(corners[1]).cross(at(corners[2]))) / 6.0;
        }
        assert!(edges.values().all(|&sum| sum == 0));
        assert!(volume > 1.0, "{volume}");
    }
}
