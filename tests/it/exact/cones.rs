//! Cones of levels of detail that each ray has for itself: their widths, and what they select, found in f64.

use super::levels::{Asked, Met, Tree, levelled};
use crate::common::{self, folder, walk};
use bricks::SceneFile;
use brickwalk::kernels::Lod;
use brickwalk::kernels::frame::Frame;
use brickwalk::kernels::layout::{self, GBuffer, Hit, NONE, Surface};
use brickwalk::output::npy;
use brickwalk::reference::Tally;
use brickwalk::scene::path::CameraPath;
use brickwalk::schedule::Pass;
use brickwalk::session::Opened;
use brickwalk::session::renderer::renderer;
use brickwalk::session::trace::{Traced, device_ray, for_rays, trace};
use brickwalk_convert::build::{BuildSettings, build};
use brickwalk_convert::progress::Progress;
use brickwalk_scenes::{Settings as SceneSettings, generate, write_paths};
use glam::DVec3;
use std::collections::HashMap;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Of the view, in pixels: so many that some reflected rays meet another level than a pixel's cone selects.
const SIZE: [u32; 2] = [72, 48];

/// A city of metals of several roughnesses, with levels, and the same without.
fn metal_cities(folder: &Path) -> [PathBuf; 2] {
    [true, false].map(|lod| {
        let scene = folder.join(format!("metal-{lod}.bricks"));
        let city = generate(&SceneSettings { triangles: 60_000, ..SceneSettings::default() }, &Progress::hidden());
        let city = city.expect("a count in range");
        let mut source = city.whole();
        for (i, material) in source.materials.iter_mut().enumerate() {
            (material.metallic, material.roughness) = (1.0, [0.02, 0.4, 0.8][i % 3]);
        }
        let settings = BuildSettings { brick_triangles: 500, lod, ..BuildSettings::default() };
        build(source, &settings, &scene, &Progress::hidden()).expect("a scene");
        write_paths(&city, &scene).expect("camera paths");
        scene
    })
}

/// A frame of a far view, and what its reflected rays met.
struct Seen {
    camera_rays: Vec<layout::Ray>,
    camera_hits: Vec<Hit>,
    gbuffer: Vec<GBuffer>,
    rays: Vec<layout::Ray>,
    hits: Vec<Hit>,
    surfaces: Vec<Surface>,
    frame: Frame,
    eye: DVec3,
    /// Angle of a pixel.
    pixel: f64,
}

impl Seen {
    fn of(scene: &Path, file: &Arc<SceneFile>, options: &str) -> Self {
        let path = CameraPath::read(&scene.with_extension("far.json")).expect("a path");
        let [width, height] = SIZE;
        let settings = common::settings(&format!("--size {width}x{height} --tile 16 --cache 40% {options}"));
        let opened = Opened::open(file.clone(), scene, &settings).expect("a session");
        let mut renderer = renderer(opened, scene, &settings).expect("lamps");
        let camera = path.frame(1, 3);
        renderer.frame(0, &camera).expect("a frame");
        let executor = &mut renderer.executor;
        let basis = camera.ray_basis(width, height);
        Self {
            camera_rays: executor.read_rays(Pass::Primary).expect("rays"),
            camera_hits: executor.read_hits(Pass::Primary).expect("hits"),
            gbuffer: executor.read_gbuffer().expect("attributes"),
            rays: executor.read_rays(Pass::Glossy).expect("rays"),
            hits: executor.read_hits(Pass::Glossy).expect("hits"),
            surfaces: executor.read_surfaces(Pass::Glossy).expect("surfaces"),
            frame: Frame::near(file.resident(), camera.position),
            eye: camera.position,
            pixel: basis.dy.length() / basis.direction(f64::from(width) / 2.0, f64::from(height) / 2.0).length(),
        }
    }

    /// The rays that are traced, by number.
    fn traced(&self) -> impl Iterator<Item = usize> {
        (0..self.rays.len()).filter(|&i| self.rays[i].t_min <= self.rays[i].t_max)
    }

    /// Compares what each ray's cone spreads by, as it was noted, with `angle_square` of a ray's number, and what it
    /// met with what that selects. Returns in how many rays a pixel's angle for all selects something else.
    fn check(&self, scene: (&SceneFile, &Tree), tolerance: f64, angle_square: impl Fn(usize) -> f64) -> u64 {
        let (file, tree) = scene;
        let square = |angle: f64| (tolerance * angle).powi(2);
        let most = PI / 100.0;
        let own = |i: usize| tolerance.powi(2) * angle_square(i).min(most);
        for i in self.traced() {
            let noted = f64::from(f32::from_bits(self.surfaces[i].pending >> 1));
            assert!((noted / own(i) - 1.0).abs() < 2e-3, "ray {i}: {noted:e} instead of {:e}", own(i));
        }
        let wider = self.traced().filter(|&i| own(i) > 2.0 * square(self.pixel)).count();
        let of_eye = square(self.pixel);
        let (frame, eye) = (self.frame, self.eye);
        let mut asked = Asked { tree, file, frame, eye, of_eye, truths: HashMap::new() };
        let met = Met { rays: &self.rays, hits: &self.hits, from: Some(&self.camera_hits), closest: true };
        let mut tally = Tally::default();
        let [unsure, levels] = asked.judge(&met, |i| own(i).max(of_eye), &mut tally);
        let traced = self.traced().count();
        println!("{tally}, {unsure} of {traced} not sure, {levels} of levels, {wider} wider than pixels");
        assert!(tally.mismatches == 0 && unsure * 4 < traced && levels > 100 && wider > 100, "{tally}, {unsure}");
        let mut control = Tally::default();
        asked.judge(&met, |_| of_eye, &mut control);
        println!("control: {control}");
        control.mismatches
    }
}

/// The density by which facets that are seen reflect `view` to `light` (Dupuy, Benyoub 2023): of Trowbridge and Reitz.
fn density(normal: DVec3, view: DVec3, light: DVec3, alpha: f64) -> f64 {
    let half = (view + light).normalize();
    let (cos_half, cos_view) = (normal.dot(half), normal.dot(view).max(1e-4));
    let square = alpha * alpha;
    let distribution = square / (PI * (square * cos_half.powi(2) + normal.cross(half).length_squared()).powi(2));
    0.5 * distribution / (cos_view + (square + (1.0 - square) * cos_view.powi(2)).sqrt())
}

fn vector(v: [f32; 3]) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}

#[test]
fn reflected_rays_are_as_wide_as_their_lobes_and_the_curvature_say() {
    let folder = folder();
    let [scene, _] = metal_cities(folder.path());
    let file = levelled(&scene);
    let tree = Tree::of(file.resident());
    for schedule in ["chc", "demand"] {
        let mut otherwise = 0;
        for tolerance in [0.25, 0.5, 1.0] {
            let options = format!("--lod {tolerance} --schedule {schedule} --effects glossy");
            let seen = Seen::of(&scene, &file, &options);
            // What normals that differ over the width of a pixel's cone at the hit add.
            let by_curvature = |i: usize| {
                let way = vector(seen.rays[i].origin) - vector(seen.camera_rays[i].origin);
                seen.pixel.powi(2) * way.length_squared() * f64::from(seen.gbuffer[i].curvature)
            };
            let curved = seen.traced().filter(|&i| by_curvature(i) > seen.pixel.powi(2)).count();
            assert!(curved > 0, "no ray is widened by curvature");
            let angle_square = |i: usize| {
                let (g, light) = (&seen.gbuffer[i], vector(seen.rays[i].direction).normalize());
                let alpha = f64::from(g.roughness).powi(2).max(0.001);
                let view = -vector(seen.camera_rays[i].direction).normalize();
                (0.01 / density(vector(g.normal), view, light, alpha)).min(alpha * alpha) + by_curvature(i)
            };
            let mirrors = seen.traced().filter(|&i| angle_square(i) < seen.pixel.powi(2)).count();
            assert!(mirrors > 20, "{mirrors} rays are narrower than pixels");
            otherwise += seen.check((&file, &tree), tolerance, angle_square);
        }
        assert!(otherwise > 10, "{schedule}: control, {otherwise} of all rays meet something else");
    }
}

#[test]
fn pictures_depend_on_no_more_than_cones() {
    let folder = folder();
    let [scene, without] = metal_cities(folder.path());
    let path = scene.with_extension("far.json");
    let common = format!("--path {} --frames 2 --size 64x40 --effects shadow,glossy", path.display());
    let render = |scene: &Path, name: &str, options: &str| {
        let out = folder.path().join(name);
        walk(scene, &out, &format!("{common} {options}"));
        common::frames(&out)
    };
    for adapter in common::adapters() {
        let adapter = adapter.split_whitespace().next().expect("a name").to_owned();
        let with = |options: &str| {
            let name = format!("{adapter}-{}", options.replace([' ', '%'], ""));
            render(&scene, &name, &format!("--adapter {adapter} {options}"))
        };
        let first = with("--lod 1 --cache 100% --schedule chc --tile 16");
        for options in [
            "--lod 1 --cache 15% --schedule chc --tile 32",
            "--lod 1 --cache 15% --schedule demand --tile 16",
            "--lod 1 --cache 100% --schedule plain",
            "--lod 1 --cache 100% --schedule plain-bvh2",
            "--lod 1 --cache 20% --fronts on --tile 8",
            "--lod 1 --cache 20% --schedule chc --tile 8 --bands 3",
        ] {
            assert!(with(options) == first, "{adapter}: {options}");
        }
        assert!(with("--lod 2 --cache 100%") != first, "{adapter}: the tolerance changed nothing");
        let exact = render(&without, &format!("{adapter}-without"), &format!("--adapter {adapter} --cache 30%"));
        assert!(with("--lod 0 --cache 30%") == exact, "{adapter}: levels in the file changed an exact picture");
        assert!(first != exact, "{adapter}: levels changed nothing");
    }
}

#[test]
fn given_rays_widen_by_the_angle_they_are_given() {
    let folder = folder();
    let [scene, _] = metal_cities(folder.path());
    let file = levelled(&scene);
    let tree = Tree::of(file.resident());
    let (tolerance, angle) = (2.0, 0.004);
    let resident = file.resident();
    let manifest = &resident.manifest;
    let (min, max) = (DVec3::from(manifest.min), DVec3::from(manifest.max));
    // From above the scene and from within it.
    let given: Vec<npy::Ray> = (0..1500i32)
        .map(|i| {
            let part = |step: f64| (f64::from(i) * step).fract();
            // Many share an origin, and so what they take.
            let place = |step: f64| (f64::from(i % 25) * step).fract();
            let origin = min + (max - min) * DVec3::new(place(0.618), 0.6 + place(0.37), place(0.755));
            // Toward bricks, by lengths of a direction of all sizes.
            let [low, high] = tree.boxes[i as usize * 7 % resident.exact_bricks()];
            let target = low + (high - low) * DVec3::new(part(0.45), part(0.81), part(0.29));
            let direction = (target - origin) * (0.001 + part(0.57));
            npy::Ray {
                origin: origin.to_array(),
                direction: direction.to_array(),
                t_min: 0.0,
                t_max: if i % 9 == 0 { 2.0 } else { f64::INFINITY },
            }
        })
        .collect();
    for schedule in ["chc", "demand"] {
        let settings = for_rays(&common::settings(&format!("--lod {tolerance} --schedule {schedule} --cache 40%")));
        let mut opened = Opened::open(file.clone(), &scene, &settings).expect("a session");
        let lod = Lod { pixels: tolerance as f32, angle: angle as f32, given: true, ..Lod::default() };
        let mut trace_all = |lod: Lod, any: bool| {
            let mut traced = Traced { lod, ..opened.traced() };
            trace(&mut traced, &given, any, &mut |_| ()).expect("hits").0
        };
        let (closest, any) = (trace_all(lod, false), trace_all(lod, true));
        assert!(closest.iter().zip(&any).all(|(c, a)| (c.triangle == NONE) == (a.triangle == NONE)));
        let (frame, eye) = (Frame::near(resident, min), min);
        let mut asked = Asked { tree: &tree, file: &file, frame, eye, of_eye: 0.0, truths: HashMap::new() };
        let mut judge = |angle: f64, hits: &[npy::Hit]| {
            let (mut tally, mut counts) = (Tally::default(), [0; 2]);
            for (ray, hit) in given.iter().zip(hits) {
                let frame = Frame::near(resident, DVec3::from_array(ray.origin));
                let device = device_ray(ray, &frame);
                let t = if hit.t.is_finite() { (hit.t / device.t_scale) as f32 } else { f32::MAX };
                let found = Hit { t, id: hit.triangle, u: hit.u, v: hit.v };
                (asked.frame, asked.eye) = (frame, frame.origin);
                let met = Met { rays: &[device.ray], hits: &[found], from: None, closest: true };
                let own = asked.judge(&met, |_| (tolerance * angle).powi(2), &mut tally);
                counts = [counts[0] + own[0], counts[1] + own[1]];
            }
            (tally, counts)
        };
        let (tally, [unsure, levels]) = judge(angle, &closest);
        println!("{schedule}: {tally}, {unsure} not sure, {levels} of levels");
        assert!(tally.mismatches == 0 && unsure * 4 < given.len() && levels > 500, "{tally}, {unsure}, {levels}");
        // The controls: a quarter of the angle selects something else, and no tolerance what is exact.
        let (control, _) = judge(angle / 4.0, &closest);
        assert!(control.mismatches > 20, "{control}");
        let exact = trace_all(Lod::default(), false);
        let (tally, _) = judge(0.0, &exact);
        assert!(tally.mismatches == 0 && exact.iter().zip(&closest).any(|(e, c)| e.triangle != c.triangle), "{tally}");
    }
}
