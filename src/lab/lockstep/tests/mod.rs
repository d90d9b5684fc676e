//! Every kernel against its twin: frames of all effects, by all schedules, with caches that hold everything and next to
//! nothing.

mod scenes;

use self::scenes::{textured, with_fields, with_levels};
use super::{Defect, Findings, Lockstep};
use crate::cpu::CpuExecutor;
use crate::frame::noise::LEAST;
use crate::frame::{
    Budgeted, Effects, Engine, Equirectangular, FrameBudget, Light, Moved, Occlusion, RenderSettings, Renderer,
    Schedule, emissive_triangles, environment,
};
use crate::gpu::device::Gpu;
use crate::gpu::executor::GpuExecutor;
use crate::gpu::kernels::Kernels;
use crate::gpu::probe;
use crate::gpu::wgsl::Pages;
use crate::kernels::frame::Frame;
use crate::kernels::lamps::{Emitter, Lamps, Shape};
use crate::kernels::layer_tables;
use crate::kernels::layout::{MET, NONE, Params, Ray};
use crate::kernels::table::KERNELS;
use crate::kernels::{Directions, Extent, FrameExecutor, Keep, Lod, Setup, View};
use crate::picture::denoise::Denoiser;
use crate::scene::{CameraPath, Keyframe};
use crate::schedule::auto::Auto;
use crate::schedule::cache::Cache;
use crate::schedule::fronts::Fronts;
use crate::schedule::{Executor, Lamp, Optimisation, Pass, Step, Tracing};
use crate::secondary::df::answer::Df;
use crate::secondary::df::maps::DfMaps;
use crate::secondary::df::{DistanceField, LEVELS, Options, kernels as df};
use crate::secondary::displacement;
use crate::secondary::dvf::{Cells, Dvf, DvfSettings, DvfTracing, DvfUse, Region, Renewal};
use crate::secondary::occupancy::{Bom, Cascades, Source};
use crate::secondary::roma::answer::Roma;
use crate::secondary::roma::maps::RomaMaps;
use crate::secondary::roma::{Grid, Role, RomaPart, RomaPass, RomaSettings, Sift};
use crate::secondary::rsm::RsmSettings;
use crate::secondary::{EffectMethods, FAMILIES, Method};
use crate::session::Settings;
use crate::session::renderer::methods;
use crate::stream::{HostCache, PayloadSource, Policy, Residency, ResidencyError, Workers};
use bricks::SceneFile;
use glam::DVec3;
use std::sync::{Arc, Mutex, OnceLock};

/// Of numbers that pass through sine, cosine and inverse square roots; the greatest difference that software Vulkan
/// shows is a fraction of it.
const BOUND: f32 = 1.0 / 65_536.0;

const EXTENT: Extent = Extent { width: 40, height: 28, tile: 16 };

/// A device and its kernels.
struct Device {
    gpu: Gpu,
    kernels: Arc<Kernels>,
    /// Those that hide triangles, once they are asked for. A device need not bind what these and a method bind.
    hiding: OnceLock<Arc<Kernels>>,
    /// Those of scenes without sheen, anisotropy and films.
    plain: OnceLock<Arc<Kernels>>,
}

impl Device {
    fn kernels(&self, hides: bool, layers: bool) -> Arc<Kernels> {
        let make = |pages| move || Arc::new(Kernels::new(&self.gpu, pages, true));
        let pages = self.kernels.pages;
        match (hides, layers) {
            (true, _) => self.hiding.get_or_init(make(Pages { hides: true, ..pages })).clone(),
            (false, true) => self.kernels.clone(),
            (false, false) => self.plain.get_or_init(make(Pages { layers: false, ..pages })).clone(),
        }
    }
}

/// A device, or the test is skipped.
fn device() -> Option<Device> {
    let Ok(gpu) = Gpu::open(None) else {
        crate::skip::skip("no adapter");
        return None;
    };
    let pages = Pages { cache: 1, texels: 1, opacity: true, gloss: true, layers: true, levels: true, hides: false };
    let kernels = Arc::new(Kernels::new(&gpu, pages, true));
    Some(Device { gpu, kernels, hiding: OnceLock::new(), plain: OnceLock::new() })
}

/// One way to render.
struct Variant {
    schedule: Schedule,
    /// Rows of a band, whole tiles, or all rows.
    rows: u32,
    everything_fits: bool,
    fronts: bool,
    threshold: u32,
    /// Leaves of the longest list that is intersected.
    list_most: u32,
    without: &'static [Optimisation],
    /// Columns that rays answered by occupancy maps pass, if they are; 0: they are snapped; what these do for them.
    roma: Option<(u32, Role)>,
    /// Bytes that a frame may load.
    budget: Option<u64>,
    /// The scene is cut at a plane through the middle of its bounds, with this normal.
    clip: Option<DVec3>,
    /// Every second run of so many triangles is hidden; 0: none.
    hides: u32,
    /// Secondary rays of one pixel in four alone.
    half_rate: bool,
    /// Look-ups of rays answered by distance fields, if they are.
    field: Option<u32>,
    /// A method as a session makes it.
    method: Method,
    /// How displacement fields answer, where they are the method.
    displacement: Option<displacement::Options>,
    /// How a field of visibility is made that answers rays to the environment, if one does.
    dvf: Option<DvfSettings>,
    /// What levels of detail are selected by, in a scene that has some.
    lod: Lod,
    /// Bounces.
    bounces: u32,
    /// Noise below which pixels take no more samples.
    noise: Option<f64>,
    /// The environment is about as bright everywhere, and the effects are others.
    even: Option<fn(Effects) -> Effects>,
    /// Frames of two samples are denoised, more than the averages over a few of them have.
    denoises: bool,
}

const VARIANT: Variant = Variant {
    schedule: Schedule::Chc,
    rows: EXTENT.height,
    everything_fits: false,
    fronts: false,
    threshold: 0,
    list_most: u32::MAX,
    without: &[],
    roma: None,
    budget: None,
    clip: None,
    hides: 0,
    half_rate: false,
    field: None,
    method: Method::Exact,
    displacement: None,
    dvf: None,
    lod: Lod { pixels: 0.0, blend: false, angle: 0.0, given: false },
    bounces: 1,
    noise: None,
    even: None,
    denoises: false,
};

fn effects() -> Effects {
    Effects {
        shadow: true,
        environment: true,
        occlusion: Some(Occlusion { rays: 1, length: 3.0 }),
        diffuse: Some(1),
        glossy: true,
        bounces: 1,
        // All of them would scatter directions in every frame.
        turn_degrees: 350.0,
    }
}

/// An environment, and emitters of every kind around `top`.
fn lamps(scene: &SceneFile, top: DVec3, is_even: bool) -> Lamps {
    let power = if is_even { 1.0 } else { 6.0 };
    let image = Equirectangular::of(24, 12, |[x, y, z]| [1.2 + x, 1.1 + y, 1.5 + x * z].map(|c| c.powf(power)));
    let rectangle = Shape::Parallelogram { corner: top, edges: [DVec3::X * 3.0, DVec3::Z * 3.0] };
    let down = DVec3::new(0.1, -1.0, 0.2).normalize();
    let shapes = [
        rectangle,
        Shape::Point { position: top, range: 0.0 },
        Shape::Point { position: top + DVec3::X, range: 9.0 },
        Shape::Spot { position: top, direction: down, range: 20.0, cone: [0.3, 0.9] },
        Shape::Distant { direction: down },
    ];
    let radiance = [4.0, 3.0, 2.0];
    let mut emitters: Vec<Emitter> = shapes.map(|shape| Emitter { shape, two_sided: false, radiance }).into();
    let surfaces = emissive_triangles(scene, 1 << 20).unwrap().unwrap().emitters(scene.resident());
    emitters.extend(surfaces.iter().enumerate().map(|(i, e)| Emitter { two_sided: i % 2 == 0, ..*e }));
    let (environment, _) = environment(image, 1.0, 40.0);
    assert_eq!(environment.is_even, is_even);
    Lamps::new(Some(environment), emitters, 10.0)
}

/// Small maps, of both numbers of directions.
fn roma((steps, role): (u32, Role)) -> RomaSettings {
    let pass = |k| RomaPass { grid: Grid { k, size: 32, samples: 4 }, steps, role };
    let diffuse = (!role.is_help()).then(|| RomaPass { role: Role::Answer, ..pass(4) });
    RomaSettings { occlusion: Some(pass(4)), shadow: Some(pass(8)), diffuse, rsm: RsmSettings { size: 48, lamps: 8 } }
}

/// Small fields.
fn field(steps: u32) -> Options {
    Options { size: 32, steps: Some(steps), lift: 1.75, hit: 0.75 }
}

/// A field of visibility of few points.
fn visibility(octahedral: u32) -> DvfSettings {
    DvfSettings { points: 200, rays: 6, cells: Cells::Longest(6), octahedral, ..DvfSettings::default() }
}

/// Both executors with pages of these sizes.
fn lockstep(
    device: &Device,
    scene: &Arc<SceneFile>,
    pages: &[u64],
    &Variant { rows: height, threshold, hides, .. }: &Variant,
    findings: &Arc<Mutex<Findings>>,
) -> Lockstep {
    let extent = Extent { height, ..EXTENT };
    let setup =
        Setup { extent, threshold, count: true, opaque: false, hides: hides > 0, flat_bytes: 0, keep: Keep::default() };
    let host = || HostCache::new(1 << 20);
    let on_gpu = GpuExecutor::with_kernels(
        device.gpu.clone(),
        device.kernels(hides > 0, layer_tables::is_needed(scene.resident())),
        scene.clone(),
        Workers::new(scene.clone(), host(), 1).unwrap(),
        pages,
        setup,
    );
    let on_cpu = CpuExecutor::new(scene.clone(), Workers::new(scene.clone(), host(), 1).unwrap(), setup);
    Lockstep::new(on_gpu.unwrap(), on_cpu.unwrap(), BOUND, findings.clone())
}

/// A flight over what is flat, or a quarter turn around it.
fn path(min: DVec3, max: DVec3) -> CameraPath {
    let (centre, size) = (min.midpoint(max), max - min);
    let views = if size.y < 0.25 * size.z {
        let above = size.y + 0.15 * size.x;
        let from = centre.with_y(min.y + above) - DVec3::new(0.5 * size.x, 0.0, 0.3 * size.z);
        let to = centre.with_y(min.y + 0.6 * above + 0.4 * size.y) - DVec3::new(0.15 * size.x, 0.0, 0.1 * size.z);
        vec![(from, centre), (to, centre + DVec3::X * 0.1 * size.x)]
    } else {
        let away = |k: u32| {
            let angle = (30.0 + 22.5 * f64::from(k)).to_radians();
            DVec3::new(angle.cos(), 0.0, angle.sin()) * 1.1 * size.length() + DVec3::Y * (size.y / 3.0)
        };
        (0..5).map(|k| (centre + away(k), centre)).collect()
    };
    let step = 10.0 / (views.len() - 1) as f64;
    let key = |(k, (position, target)): (usize, &(DVec3, DVec3))| Keyframe {
        time: k as f64 * step,
        position: position.to_array(),
        target: target.to_array(),
    };
    CameraPath::new(60.0, [0.0, 1.0, 0.0], views.iter().enumerate().map(key).collect(), "a path".as_ref()).unwrap()
}

/// Renders two frames in lockstep.
fn render(
    device: &Device,
    scene: &Arc<SceneFile>,
    variant: &Variant,
    defect: Option<Defect>,
    findings: &Arc<Mutex<Findings>>,
) {
    let sizes = scene.sizes();
    let page_bytes = device.gpu.page_bytes();
    let residency = |budget| Residency::new(&sizes, budget, page_bytes, Policy::RoundRobin);
    let least = match residency(16) {
        Err(ResidencyError::CacheTooSmall { needed, .. }) => needed,
        other => panic!("a cache of nothing must be refused: {other:?}"),
    };
    let budget = if variant.everything_fits { Residency::budget_for_all(&sizes, page_bytes) } else { least };
    let residency = residency(budget).unwrap();
    let pages: Vec<u64> = residency.page_sizes().collect();
    let mut executor = lockstep(device, scene, &pages, variant, findings);
    if let Some(defect) = defect {
        executor = executor.with_defect(defect);
    }
    executor.allow_bounces();
    if variant.hides > 0 {
        let bounds: Vec<u32> = (0..1000).map(|run| run * variant.hides).collect();
        executor.set_hidden(&bounds).unwrap();
    }
    executor.tuning().list_most = variant.list_most;
    if variant.schedule == Schedule::PlainBinary {
        executor.make_binary().unwrap();
    }
    let mut tracing = Tracing { measure_needed: true, ..Tracing::default() };
    variant.without.iter().for_each(|&which| tracing.optimisations.set(which, false));
    let mut light = Light::new(DVec3::new(0.4, 0.8, 0.45), 2.0, 1.0, 1.0);
    let manifest = &scene.resident().manifest;
    let top = DVec3::new(0.0, manifest.max[1] + 1.0, 0.0);
    light.lamps = Arc::new(lamps(scene, top, variant.even.is_some()));
    let engine = Engine {
        scene: scene.clone(),
        executor: Box::new(executor),
        cache: Cache::new(residency, sizes.clone(), Vec::new(), None),
        settings: RenderSettings {
            lod: variant.lod,
            correct_one_in: 0,
            only_chosen: false,
            budget: variant.budget.map(FrameBudget::Bytes),
            half_rate: variant.half_rate,
            clip: variant.clip.map(|normal| {
                let [min, max] = [manifest.min, manifest.max].map(DVec3::from_array);
                (0.5 * (min + max), normal.normalize())
            }),
            schedule: variant.schedule,
            effects: Effects { bounces: variant.bounces, ..variant.even.map_or_else(effects, |even| even(effects())) },
            samples: if variant.noise.is_some() { LEAST + 1 } else { 1 + u32::from(variant.denoises) },
            noise: variant.noise,
            seed: 3,
            tracing,
            guides: false,
            coverage: false,
            taa: false,
            aov: variant.half_rate,
        },
        light,
        size: (EXTENT.width, EXTENT.height),
        band_rows: variant.rows,
        only_rows: None,
        tile: EXTENT.tile,
        fronts: variant.fronts.then(Fronts::default),
        budgeted: variant.budget.map(|_| Budgeted::new(scene.resident(), variant.hides == 0)),
        auto: Auto::default(),
        captures: None,
        answers: None,
        moved: Moved::default(),
    };
    let mut usual = Settings { secondary: EffectMethods::every(variant.method), ..Settings::exact() };
    (usual.roma.size, usual.rsm.size, usual.df.size) = (32, 64, 32);
    usual.displacement = variant.displacement.clone().unwrap_or_default();
    let methods = methods(&usual, engine.scene.resident());
    let mut renderer = Renderer { engine, methods };
    if let Some(settings) = variant.roma.map(roma) {
        renderer.methods.set(Roma::new(settings, Source::default()));
    }
    if let Some(settings) = variant.field.map(field) {
        renderer.methods.set(Df::new(settings, EffectMethods::every(Method::Df), Source::default()));
    }
    let path = path(DVec3::from(manifest.min), DVec3::from(manifest.max));
    if let Some(settings) = &variant.dvf {
        let made = renderer
            .make_dvf(settings, &Region::scene(scene.resident()), DvfTracing::over(4), &mut |_, _| true)
            .unwrap();
        assert!(made.points > 0 && made.field.known_cells() > 0);
        assert_eq!(made.trials.is_empty(), settings.cells != Cells::Auto);
        // Rays wait, so that blocks are made again.
        assert_eq!(made.drains > 0, variant.schedule != Schedule::Plain);
        let how = DvfUse {
            doubt: settings.octahedral == 8,
            paper: settings.hammersley && settings.dilate && settings.octahedral == 16,
        };
        let renewal = Renewal {
            kept: Arc::new(made.kept),
            settings: *settings,
            region: Region::scene(scene.resident()),
            tracing: DvfTracing::over(4),
            rays: 2000,
            frames: u32::MAX,
        };
        renderer.methods.set(Dvf::new(Arc::new(made.field), how).renewed_by(renewal));
    }
    let mut denoiser = Denoiser::default();
    for frame in 0..if variant.denoises { 8 } else { 2 } {
        // The second frame scatters directions, and an instance has moved.
        renderer.settings.guides = frame == 1 || variant.denoises;
        if let Some(instance) = scene.resident().instances.get(1).filter(|_| frame == 1) {
            let mut matrix = instance.world_from_object;
            matrix[3] += 0.1 * (manifest.max[0] - manifest.min[0]);
            assert_eq!(renderer.place(scene, &[(1, matrix)]), Ok(vec![1]));
        }
        let camera = if variant.denoises { path.frame(frame, 100) } else { path.frame(4 * frame, 12) };
        let mut output = renderer.frame(frame, &camera).unwrap();
        if variant.denoises {
            let (guides, engine) = (output.guides.take().unwrap(), &mut renderer.engine);
            let radiance = &mut output.pixels.radiance;
            let lost = denoiser.frame_on(&mut *engine.executor, &engine.cache.states, guides, radiance);
            assert_eq!(lost.unwrap(), 0);
        }
        let renewed = output.records.iter().find(|record| record.pass == "dvf");
        if renderer.methods.get::<Dvf>().is_some_and(|dvf| dvf.moved_field().is_some()) {
            assert!(renewed.is_some_and(|record| record.cells_renewed > 0 && record.rays() > 0), "{renewed:?}");
        }
    }
}

#[test]
fn twins_agree_with_their_kernels() {
    use Optimisation::*;
    let variants = [
        Variant { schedule: Schedule::Plain, everything_fits: true, ..VARIANT },
        // The last rows of the last band lie below the picture.
        Variant { rows: 16, ..VARIANT },
        Variant { schedule: Schedule::PlainBinary, everything_fits: true, ..VARIANT },
        Variant { everything_fits: true, ..VARIANT },
        VARIANT,
        // Walks from the root, of some tiles and of all; pairs that a threshold culls.
        Variant { everything_fits: true, list_most: 0, ..VARIANT },
        Variant { list_most: 3, ..VARIANT },
        Variant { list_most: 3, threshold: 4, ..VARIANT },
        Variant { list_most: 0, threshold: 2, ..VARIANT },
        // Most bricks are missing, and coarser levels stand for most tiles.
        Variant { budget: Some(1), ..VARIANT },
        Variant { budget: Some(1 << 30), everything_fits: true, ..VARIANT },
        Variant { clip: Some(DVec3::new(0.3, 1.0, -0.2)), ..VARIANT },
        Variant { half_rate: true, ..VARIANT },
        Variant { bounces: 3, ..VARIANT },
        Variant { even: Some(|all| all), bounces: 2, ..VARIANT },
        Variant { even: Some(|all| Effects { glossy: false, turn_degrees: 360.0, ..all }), ..VARIANT },
        Variant { even: Some(|all| Effects { diffuse: None, ..all }), everything_fits: true, ..VARIANT },
        // Some blocks stop, and some go on.
        Variant { noise: Some(0.05), everything_fits: true, schedule: Schedule::Plain, ..VARIANT },
        Variant { noise: Some(0.1), everything_fits: true, ..VARIANT },
        Variant { denoises: true, everything_fits: true, schedule: Schedule::Plain, ..VARIANT },
        Variant { denoises: true, bounces: 2, ..VARIANT },
        Variant { bounces: 4, everything_fits: true, schedule: Schedule::Plain, ..VARIANT },
        Variant { half_rate: true, clip: Some(DVec3::Y), schedule: Schedule::Demand, ..VARIANT },
        Variant { hides: 7, ..VARIANT },
        Variant { hides: 1, schedule: Schedule::Demand, ..VARIANT },
        Variant { hides: 30, budget: Some(20_000), ..VARIANT },
        Variant { hides: 20, everything_fits: true, schedule: Schedule::Plain, ..VARIANT },
        Variant { clip: Some(DVec3::NEG_Y), schedule: Schedule::Demand, ..VARIANT },
        Variant { clip: Some(DVec3::X), everything_fits: true, schedule: Schedule::Plain, ..VARIANT },
        Variant { schedule: Schedule::Demand, ..VARIANT },
        Variant { schedule: Schedule::Demand, without: &[ResidentFirst, Requery], ..VARIANT },
        Variant { without: &[RootWalk, FrontToBack], ..VARIANT },
        Variant { without: &[RootWalk, ByTile, ResidentFirst, NearestFirst], ..VARIANT },
        Variant { without: &[RootWalk], ..VARIANT },
        // Maps drawn by the cosine; by the rays' own strata.
        Variant { roma: Some((0, Role::Answer)), ..VARIANT },
        Variant { roma: Some((3, Role::Answer)), ..VARIANT },
        Variant { roma: Some((64, Role::Sift { most_wrong: None })), ..VARIANT },
        Variant { roma: Some((3, Role::Sift { most_wrong: None })), schedule: Schedule::Demand, ..VARIANT },
        Variant { roma: Some((64, Role::Sift { most_wrong: Some(100_000) })), ..VARIANT },
        Variant { roma: Some((3, Role::Sift { most_wrong: Some(500_000) })), ..VARIANT },
        Variant { roma: Some((64, Role::Sift { most_wrong: Some(1000) })), ..VARIANT },
        Variant { roma: Some((0, Role::Correct(4))), ..VARIANT },
        Variant { roma: Some((3, Role::Correct(2))), schedule: Schedule::Demand, ..VARIANT },
        Variant { field: Some(64), ..VARIANT },
        Variant { field: Some(3), ..VARIANT },
        Variant { dvf: Some(visibility(8)), ..VARIANT },
        Variant { dvf: Some(visibility(16)), ..VARIANT },
        Variant { dvf: Some(DvfSettings { hammersley: false, both: true, round: true, ..visibility(16) }), ..VARIANT },
        Variant { dvf: Some(DvfSettings { dilate: false, cells: Cells::Auto, ..visibility(32) }), ..VARIANT },
        Variant { fronts: true, bounces: 2, ..VARIANT },
        Variant { fronts: true, threshold: 3, ..VARIANT },
        Variant { fronts: true, without: &[MultiQueries, TighterBounds], everything_fits: true, ..VARIANT },
    ];
    let asked = |against, interpolate, memory| Variant {
        method: Method::Displacement,
        displacement: Some(displacement::Options { against, interpolate, memory, near: 0.5 }),
        ..VARIANT
    };
    use displacement::{Against, Interpolation};
    let by_fields = [
        asked(Against::All, Interpolation::None, 1 << 30),
        asked(Against::Absent, Interpolation::Both, 1 << 30),
        Variant { schedule: Schedule::Demand, ..asked(Against::All, Interpolation::Positions, 40_000) },
        Variant { everything_fits: true, ..asked(Against::All, Interpolation::Directions, 1 << 30) },
    ];
    let selecting = |pixels, blend| Variant { lod: Lod { pixels, blend, ..Lod::default() }, ..VARIANT };
    let by_levels = [
        selecting(4.0, false),
        selecting(0.0, false),
        Variant { everything_fits: true, schedule: Schedule::Plain, ..selecting(2.0, true) },
        Variant { everything_fits: true, schedule: Schedule::PlainBinary, ..selecting(8.0, false) },
        Variant { schedule: Schedule::Demand, ..selecting(4.0, true) },
        Variant { list_most: 2, threshold: 2, ..selecting(4.0, false) },
        Variant { fronts: true, ..selecting(4.0, true) },
        Variant { method: Method::Sift, ..selecting(4.0, false) },
        // Levels stand in for what is missing.
        Variant { budget: Some(20_000), everything_fits: true, ..selecting(0.0, false) },
        Variant { budget: Some(40_000), ..selecting(2.0, false) },
    ];
    // Whatever methods there are, with few cells.
    let usual = Method::ALL.iter().map(|&method| Variant { method, ..VARIANT }).filter(|v| v.method != Method::Exact);
    let variants: Vec<Variant> = variants.into_iter().chain(usual).collect();
    let check =
        |scenes: &[(Arc<SceneFile>, &[Variant])]| {
            let device = device()?;
            let findings = Arc::new(Mutex::new(Findings::default()));
            for (scene, variants) in scenes {
                let has_occupancy = !scene.resident().occupancy.is_empty();
                for (i, variant) in variants.iter().enumerate().filter(|(_, v)| {
                    has_occupancy || (v.roma.is_none() && v.field.is_none() && v.method == Method::Exact)
                }) {
                    render(&device, scene, variant, None, &findings);
                    let found = findings.lock().unwrap();
                    assert_eq!(found.differences, Vec::<String>::new(), "variant {i} of {}", scene.path().display());
                }
            }
            Some(std::mem::take(&mut *findings.lock().unwrap()))
        };
    let mut found = Findings::default();
    // With devices of their own, these are rendered at the same time. Those of few variants share one: its kernels take
    // long to make.
    let groups = [
        vec![(Arc::new(probe::scene().unwrap()), &variants[..])],
        vec![(textured(false), &variants[..])],
        vec![
            (textured(true), &variants[2..12]),
            (with_fields(Arc::new(probe::scene().unwrap()), 8), &by_fields[..]),
            (with_fields(textured(false), 8), &by_fields[..2]),
            (with_fields(textured(false), 1), &by_fields[2..]),
            (with_levels(), &by_levels[..]),
        ],
    ];
    let each = std::thread::scope(|scope| {
        let threads = groups.each_ref().map(|scenes| scope.spawn(|| check(scenes)));
        threads.map(|thread| thread.join().unwrap())
    });
    for own in each {
        let Some(own) = own else { return };
        found.kernels.extend(own.kernels);
        own.compared.into_iter().for_each(|(what, count)| *found.compared.entry(what).or_default() += count);
        found.greatest = found.greatest.max(own.greatest);
    }
    println!("greatest difference {:e}; compared {:?}", found.greatest, found.compared);
    let families = FAMILIES.iter().flat_map(|family| family.kernels);
    let all = KERNELS.iter().chain(families).map(|kernel| kernel.name);
    let left: Vec<&str> = all.filter(|name| !found.kernels.contains(name) && *name != "start_hits").collect();
    assert_eq!(left, Vec::<&str>::new(), "kernels that did not run");
    assert!(found.compared.values().all(|&count| count > 100), "{:?}", found.compared);
    assert!(found.greatest > 0.0, "nothing was compared within the bound");
}

#[test]
fn a_twin_that_differs_is_noticed() {
    let Some(device) = device() else { return };
    let (opaque, plain, tiled) = (Arc::new(probe::scene().unwrap()), textured(false), textured(true));
    let levelled = with_levels();
    let cases = [
        (Defect::Rays, &plain, "hits"),
        (Defect::Seed, &opaque, "directions"),
        // What lets rays pass by chance is drawn anew.
        (Defect::Seed, &plain, "hits"),
        (Defect::Light, &plain, "radiance"),
        (Defect::Lookups, &tiled, "tiles"),
        (Defect::Maps, &plain, "columns"),
        (Defect::Fields, &plain, "distances"),
        (Defect::LampMaps, &plain, "radiance"),
        (Defect::Points, &plain, "rays of points"),
        (Defect::Cones, &levelled, "spreads"),
        (Defect::Guides, &opaque, "past"),
    ];
    for (defect, scene, what) in cases {
        let findings = Arc::new(Mutex::new(Findings::default()));
        let roma = matches!(defect, Defect::Maps | Defect::LampMaps).then_some((0, Role::Answer));
        let field = (defect == Defect::Fields).then_some(64);
        // Points of the set of Hammersley have no seed but for how their rays are turned.
        let dvf = (defect == Defect::Points).then(|| visibility(8));
        let lod = Lod { pixels: if defect == Defect::Cones { 4.0 } else { 0.0 }, ..Lod::default() };
        let denoises = defect == Defect::Guides;
        let variant =
            Variant { schedule: Schedule::Plain, everything_fits: true, roma, field, dvf, lod, denoises, ..VARIANT };
        render(&device, scene, &variant, Some(defect), &findings);
        let found = findings.lock().unwrap();
        assert!(found.differences.iter().any(|line| line.contains(what)), "{defect:?}: {:?}", found.differences);
    }
}

/// The distances of fields as the device keeps them.
fn words_of(fields: &[DistanceField]) -> Vec<u32> {
    let levels = fields.iter().flat_map(|field| (0..LEVELS).map(|level| field.level(level)));
    let pairs = levels.flat_map(|level| level.as_chunks::<2>().0);
    pairs.map(|[low, high]| u32::from(low.to_bits()) | u32::from(high.to_bits()) << 16).collect()
}

/// Two levels of base maps with every n-th cell or so occupied; of no n none.
fn base_maps(cells: u32, every: Option<u32>) -> Arc<Cascades> {
    let mut state = 0x2545_f491u32;
    let mut level = |cell_log2: i32, first: i64| {
        let mut map = Bom::new(cells, cell_log2, [first; 3]);
        let count = every.map_or(0, |every| cells.pow(3) / every);
        for _ in 0..count {
            let mut next = || {
                state ^= state << 13;
                state ^= state >> 17;
                state ^= state << 5;
                (state >> 8) % cells
            };
            map.occupy([next(), next(), next()]);
        }
        map
    };
    Arc::new(Cascades { levels: vec![level(0, 0), level(1, -i64::from(cells) / 4)] })
}

/// Rays from inside and outside of such maps, some along axes, of lengths of direction of their own.
fn rays(cells: u32) -> Vec<Ray> {
    let mut state = 77u32;
    let mut unit = || {
        state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    let ray = |number: u32| {
        let origin = [(); 3].map(|()| (unit() * 2.6 - 0.8) * cells as f32);
        let d = [(); 3].map(|()| unit() - 0.5);
        let direction = if number.is_multiple_of(16) { [0.0, -1.0, 0.0] } else { d };
        let t_max = if number.is_multiple_of(5) { 12.0 } else { f32::MAX };
        Ray { origin, t_min: 0.0, direction, t_max }
    };
    (0..EXTENT.width * EXTENT.height).map(ray).collect()
}

/// A unit of which is one of the world.
const FRAME: Frame = Frame { reference: [0; 3], unit: 1.0, origin: DVec3::ZERO };

/// A scene for rays that maps answer, the pages of a cache for all of it, and that cache.
fn given(device: &Device) -> (Arc<SceneFile>, Vec<u64>, Cache) {
    let scene = Arc::new(probe::scene().unwrap());
    let sizes = scene.sizes();
    let page_bytes = device.gpu.page_bytes();
    let budget = Residency::budget_for_all(&sizes, page_bytes);
    let residency = Residency::new(&sizes, budget, page_bytes, Policy::RoundRobin).unwrap();
    let pages = residency.page_sizes().collect();
    (scene, pages, Cache::new(residency, sizes.clone(), Vec::new(), None))
}

/// Where no map is of use, maps neither end rays nor answer any: all are left to be traced.
#[test]
fn rays_are_sifted_by_maps_alone() {
    let Some(device) = device() else { return };
    let (scene, pages, cache) = given(&device);
    let pass = Pass::Shadow(Lamp::Sun);
    let roma = RomaPass { grid: Grid { k: 4, size: 32, samples: 1 }, steps: 8, role: Role::Sift { most_wrong: None } };
    let boms = base_maps(32, None);
    for levels in [0, 2] {
        let findings = Arc::new(Mutex::new(Findings::default()));
        let mut executor = lockstep(&device, &scene, &pages, &VARIANT, &findings);
        executor.begin_frame(&View {
            frame: FRAME,
            params: Params::default(),
            directions: Directions::default(),
            rays: None,
        });
        let maps = RomaMaps::new(&boms, levels, &FRAME, roma, (0, 0));
        maps.give(&mut executor, &boms).unwrap();
        executor.set_rays(pass, &rays(32));
        let steps = [Step::StartHits, maps.rotate(), maps.trace(8, RomaPart::Sift(Sift::default()))];
        let answered = executor.run(pass, &steps, &cache.states).unwrap().counters.rays_answered;
        assert_eq!(answered > 0, levels > 0, "{answered} of nothing but free rays");
        assert_eq!(findings.lock().unwrap().differences, Vec::<String>::new());
    }
}

#[test]
fn distance_fields_of_all_sizes_are_those_of_their_twins() {
    let Some(device) = device() else { return };
    let (scene, pages, cache) = given(&device);
    let pass = Pass::Shadow(Lamp::Sun);
    for (cells, every) in [(32, None), (32, Some(32_768)), (32, Some(20)), (64, Some(50)), (96, Some(100))] {
        for defect in [None, Some(Defect::Fields)] {
            let findings = Arc::new(Mutex::new(Findings::default()));
            let mut executor = lockstep(&device, &scene, &pages, &VARIANT, &findings);
            if let Some(defect) = defect {
                executor = executor.with_defect(defect);
            }
            executor.begin_frame(&View {
                frame: FRAME,
                params: Params::default(),
                directions: Directions::default(),
                rays: None,
            });
            let maps = base_maps(cells, every);
            let own: Vec<DistanceField> = maps.levels.iter().map(DistanceField::new).collect();
            let fields = DfMaps::new(&maps, &FRAME, &field(64));
            fields.give(&mut executor).unwrap();
            executor.run(pass, &fields.make(), &cache.states).unwrap();
            let is_own = executor.words(&df::FAMILY, df::DISTANCES) == words_of(&own);
            assert_eq!(is_own, defect.is_none(), "{cells}, {every:?}");
            executor.set_rays(pass, &rays(cells));
            let mut hits = 0;
            for steps in [64, 16] {
                executor.run(pass, &[Step::StartHits, fields.trace(steps)], &cache.states).unwrap();
                let met = executor.read_hits(pass).unwrap();
                assert!(met.iter().all(|hit| hit.id == MET || hit.id == NONE));
                hits += met.iter().filter(|hit| hit.id == MET).count();
            }
            let found = findings.lock().unwrap();
            if defect.is_none() {
                println!("{cells}³, one in {every:?}: {hits} hits");
                assert_eq!(found.differences, Vec::<String>::new(), "{cells}, {every:?}");
                let is_dense = every.is_some_and(|every| every < 10_000);
                assert!(if is_dense { hits > 200 } else { every.is_some() || hits == 0 }, "{cells}, {every:?}: {hits}");
            } else {
                assert!(found.differences[0].contains("distances"), "{:?}", found.differences);
            }
        }
    }
}
