//! Levels of detail: rays meet what their own cones select, found here in f64 from the file's words alone; pictures do
//! not depend on the cache, the schedule, tiles or bands; without a tolerance all is exact.

use crate::common::{self, adapters, folder, records, sum, walk};
use bricks::{Bounds, NONE, Resident, SceneFile};
use brickwalk::kernels::frame::Frame;
use brickwalk::kernels::layout::{Hit, Ray};
use brickwalk::reference::{Tally, Truth, TruthRay, judge, judge_any};
use brickwalk::scene::path::CameraPath;
use brickwalk::schedule::{Lamp, Pass};
use brickwalk::session::opened::{Opened, open_scene};
use brickwalk::session::renderer::renderer;
use glam::DVec3;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A city with levels, and the same without.
fn cities(folder: &Path) -> [PathBuf; 2] {
    ["on", "off"].map(|lod| {
        let scene = folder.join(format!("{lod}.bricks"));
        let words = format!("--triangles 60K --brick-triangles 500 --lod {lod}");
        let all = ["scene", "city", "-o"].iter().map(std::ffi::OsStr::new).chain([scene.as_os_str()]);
        common::succeed(all.chain(words.split(' ').map(std::ffi::OsStr::new)));
        scene
    })
}

/// The scene with its levels in use.
pub(super) fn levelled(scene: &Path) -> Arc<SceneFile> {
    let mut file = open_scene(scene).expect("the scene").duplicate();
    assert!(!file.resident().levels.is_empty(), "{} has no levels", scene.display());
    file.use_levels();
    Arc::new(file)
}

/// The tree of levels of a scene without instances, in world units: of each brick and level its box with all below it,
/// its error, and the level above.
pub(super) struct Tree {
    pub boxes: Vec<[DVec3; 2]>,
    errors: Vec<f64>,
    parents: Vec<Option<usize>>,
}

impl Tree {
    pub(super) fn of(resident: &Resident) -> Self {
        let exact = resident.exact_bricks();
        let step = f64::from(resident.objects[0].step_log2).exp2();
        let corner = |p: [i64; 3]| DVec3::from_array(p.map(|x| x as f64 * step));
        let bounds = |brick: &bricks::Brick| -> Bounds { [brick.min, brick.max] };
        let mut boxes: Vec<[DVec3; 2]> = resident.bricks.iter().map(|brick| bounds(brick).map(corner)).collect();
        let mut errors = vec![0.0; exact];
        errors.extend(resident.levels.iter().map(|level| level.error));
        let mut parents = vec![None; resident.bricks.len()];
        for (index, level) in resident.levels.iter().enumerate() {
            for child in level.children() {
                assert_eq!(child.instance, NONE);
                let child = child.brick as usize;
                parents[child] = Some(exact + index);
                let [low, high] = boxes[child];
                let own = &mut boxes[exact + index];
                *own = [own[0].min(low), own[1].max(high)];
            }
        }
        Self { boxes, errors, parents }
    }

    /// The bricks and levels that a ray takes; `None` where f64 and f32 may decide otherwise.
    fn cut(&self, origin: DVec3, square: f64, spread: f64) -> Option<Vec<u32>> {
        let mut is_sure = true;
        let mut suffices = |index: usize| {
            let [low, high] = self.boxes[index];
            let away = (low - origin).max(origin - high).max(DVec3::ZERO).length_squared();
            let (width, error) = (square + spread * away, self.errors[index].powi(2));
            is_sure &= error == 0.0 || (width / error - 1.0).abs() > 1e-4;
            error <= width
        };
        let takes = |&index: &usize| suffices(index) && !self.parents[index].is_some_and(&mut suffices);
        let mut takes = takes;
        let cut = (0..self.boxes.len()).filter(|index| takes(index)).map(|index| index as u32).collect();
        is_sure.then_some(cut)
    }
}

/// What rays of a pass have met.
pub(super) struct Met<'a> {
    pub rays: &'a [Ray],
    pub hits: &'a [Hit],
    /// Hits that they start from.
    pub from: Option<&'a [Hit]>,
    /// Whether it was asked what they meet, not only if anything.
    pub closest: bool,
}

/// What of rays is compared.
pub(super) struct Asked<'a> {
    pub tree: &'a Tree,
    pub file: &'a SceneFile,
    pub frame: Frame,
    pub eye: DVec3,
    /// Square of the tolerance times the angle of a pixel.
    pub of_eye: f64,
    pub truths: HashMap<Vec<u32>, Truth>,
}

impl Asked<'_> {
    /// Judges hits of rays with cones whose angle times the tolerance, squared, is `spread` of a ray's number; how many
    /// were left out because f32 may take another level, and how many took one.
    pub(super) fn judge(&mut self, met: &Met, spread: impl Fn(usize) -> f64, tally: &mut Tally) -> [usize; 2] {
        let (mut unsure, mut levels) = (0, 0);
        let all = met.rays.iter().zip(met.hits).enumerate();
        for (i, (ray, hit)) in all.filter(|(_, (ray, _))| ray.t_min <= ray.t_max) {
            let at = self.frame.origin + DVec3::from_array(ray.origin.map(f64::from)) * self.frame.unit;
            let Some(cut) = self.tree.cut(at, self.of_eye * (at - self.eye).length_squared(), spread(i)) else {
                unsure += 1;
                continue;
            };
            let exact = self.file.resident().exact_bricks() as u32;
            levels += usize::from(cut.iter().any(|&brick| brick >= exact));
            let file = self.file;
            let truth = self.truths.entry(cut).or_insert_with_key(|cut| Truth::load_cut(file, cut).expect("truth"));
            let (origin, unit) = (self.frame.origin.to_array(), self.frame.unit);
            let t_max = if ray.t_max > 3e38 { f32::INFINITY } else { ray.t_max };
            let asked = TruthRay::from_f32(origin, unit, ray.origin, ray.direction, ray.t_min, t_max);
            let asked = met.from.map_or(asked, |from| asked.excluding(from[i].id));
            tally.add(if met.closest {
                judge(truth, &asked, (hit.id != NONE).then_some((hit.id, f64::from(hit.t))))
            } else {
                judge_any(truth, &asked, hit.id != NONE)
            });
        }
        [unsure, levels]
    }
}

#[test]
fn rays_meet_what_their_cones_select() {
    let folder = folder();
    let [scene, _] = cities(folder.path());
    let file = levelled(&scene);
    let tree = Tree::of(file.resident());
    let path = CameraPath::read(&scene.with_extension("far.json")).expect("a path");
    let pixels = 3.0;
    for schedule in ["chc", "demand"] {
        let options =
            format!("--lod {pixels} --size 48x32 --tile 16 --schedule {schedule} --effects shadow --cache 40%");
        let settings = common::settings(&options);
        let opened = Opened::open(file.clone(), &scene, &settings).expect("a session");
        let mut renderer = renderer(opened, &scene, &settings).expect("lamps");
        let camera = path.frame(1, 3);
        renderer.frame(0, &camera).expect("a frame");
        let [primary, shadow] = [Pass::Primary, Pass::Shadow(Lamp::Sun)].map(|pass| {
            let rays = renderer.executor.read_rays(pass).expect("rays");
            (rays, renderer.executor.read_hits(pass).expect("hits"))
        });
        let basis = camera.ray_basis(48, 32);
        let pixel = basis.dy.length() / basis.direction(24.0, 16.0).length();
        let sun = 2.0 * (0.53f64.to_radians() / 2.0).tan();
        let mut asked = Asked {
            tree: &tree,
            file: &file,
            frame: Frame::near(file.resident(), camera.position),
            eye: camera.position,
            of_eye: (pixels * pixel).powi(2),
            truths: HashMap::new(),
        };
        let mut tally = Tally::default();
        let of_camera = Met { rays: &primary.0, hits: &primary.1, from: None, closest: true };
        let own = asked.of_eye;
        let [unsure, levels] = asked.judge(&of_camera, |_| own, &mut tally);
        println!("{schedule}, camera rays: {tally}, {unsure} not sure");
        let rays = primary.0.len();
        assert!(tally.mismatches == 0 && unsure * 4 < rays && levels * 2 > rays, "{tally}, {unsure}, {levels}");
        let mut tally = Tally::default();
        let of_sun = Met { rays: &shadow.0, hits: &shadow.1, from: Some(&primary.1), closest: false };
        let own = (pixels * pixel.max(sun)).powi(2);
        let [unsure, levels] = asked.judge(&of_sun, |_| own, &mut tally);
        println!("{schedule}, shadow rays: {tally}, {unsure} not sure, {} cuts", asked.truths.len());
        assert!(tally.mismatches == 0 && unsure * 4 < rays && levels > 100, "{tally}, {unsure}, {levels}");
        // The control: what a cone half as wide selects is something else.
        let mut control = Tally::default();
        asked.of_eye /= 4.0;
        let own = asked.of_eye;
        asked.judge(&of_camera, |_| own, &mut control);
        assert!(control.mismatches > 20, "{control}");
    }
}

#[test]
fn pictures_depend_on_the_cones_alone() {
    let folder = folder();
    let [scene, _] = cities(folder.path());
    let path = scene.with_extension("far.json");
    let common = format!("--path {} --frames 2 --size 64x40 --effects shadow,ao,diffuse --lod 2", path.display());
    let render = |name: &str, options: &str| {
        let out = folder.path().join(name);
        walk(&scene, &out, &format!("{common} {options}"));
        common::frames(&out)
    };
    for adapter in adapters() {
        let adapter = adapter.split_whitespace().next().expect("a name").to_owned();
        let with = |options: &str| {
            render(&format!("{adapter}-{}", options.replace([' ', '%'], "")), &format!("--adapter {adapter} {options}"))
        };
        let first = with("--cache 100% --schedule chc --tile 16");
        for options in [
            "--cache 15% --schedule chc --tile 16",
            "--cache 15% --schedule demand --tile 32",
            "--cache 100% --schedule plain",
            "--cache 100% --schedule plain-bvh2",
            "--cache 20% --fronts on --tile 8",
            "--cache 20% --schedule chc --tile 8 --bands 3",
        ] {
            assert!(with(options) == first, "{adapter}: {options}");
        }
        let blended = with("--lod-blend --cache 100% --schedule chc");
        assert!(blended != first, "{adapter}: blending changed nothing");
        assert!(
            with("--lod-blend --cache 15% --schedule demand") == blended,
            "{adapter}: blending depends on the cache"
        );
    }
}

#[test]
fn without_a_tolerance_levels_are_not_there() {
    let folder = folder();
    let [with, without] = cities(folder.path());
    let common = |scene: &Path| {
        format!(
            "--path {} --frames 2 --size 64x40 --tile 16 --effects shadow,ao --cache 30%",
            scene.with_extension("far.json").display()
        )
    };
    let render = |scene: &Path, name: &str, options: &str| {
        let out = folder.path().join(name);
        let said = walk(scene, &out, &format!("{} {options}", common(scene)));
        (common::frames(&out), records(&out), said)
    };
    let (exact, exact_records, _) = render(&without, "without", "");
    let (same, same_records, _) = render(&with, "zero", "--lod 0");
    assert!(exact == same, "levels in the file changed an exact picture");
    let bytes = |records: &[serde_json::Value]| sum(records, "primary", "bytes_geometry");
    assert_eq!(bytes(&exact_records), bytes(&same_records), "the cache is of bricks alone");
    let (coarse, coarse_records, _) = render(&with, "two", "--lod 2");
    assert!(coarse != exact && 2.0 * bytes(&coarse_records) < bytes(&exact_records));
    // A scene that has none is rendered exactly.
    let (none, ..) = render(&without, "none", "--lod 2");
    assert!(none == exact);
    // Corrected by every block the picture is the exact one, but for what rounding leaves.
    let (corrected, ..) = render(&with, "corrected", "--lod 2 --lod-correct 1");
    assert!(corrected != coarse);
}
