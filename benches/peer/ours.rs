//! The processor's kernels as a peer, and the dump that other peers read.

use super::judge::Corners;
use super::{Column, Measured, OCCLUSION_LENGTH, Peer, START, processor_seconds};
use bricks::Payload;
use brickwalk::Settings;
use brickwalk::counters::Counters;
use brickwalk::kernels::frame::{Frame, Placement};
use brickwalk::kernels::layout::{Hit, NONE, Params, Ray, Surface, T_INFINITE};
use brickwalk::kernels::payloads::BrickView;
use brickwalk::kernels::trace::leaf::rows_point;
use brickwalk::kernels::{Directions, Extent, View};
use brickwalk::scene::path::CameraPath;
use brickwalk::schedule::{Lamp, Pass, Step};
use brickwalk::session::opened::{Opened, open_scene};
use brickwalk::settings::{Adapter, CacheSize, ImageSize, Schedule};
use brickwalk::stream::{Item, PayloadSource};
use glam::DVec3;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Instant;

const EXTENT: Extent = Extent { width: 1280, height: 720, tile: 64 };

/// SplitMix64 (Steele, Lea, Flood 2014), as a number in 0..1.
fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// The pixels in the order of the dump: squares of 8 x 8 by rows, each four squares of 4 x 4 by rows.
pub fn squares() -> Vec<usize> {
    let (width, height) = (EXTENT.width as usize, EXTENT.height as usize);
    let corners = (0..height).step_by(8).flat_map(|y| (0..width).step_by(8).map(move |x| (x, y)));
    let pixel = |(x, y): (usize, usize), k: usize| {
        let (quarter, row, column) = (k / 16, k / 4 % 4, k % 4);
        (y + quarter / 2 * 4 + row) * width + x + quarter % 2 * 4 + column
    };
    corners.flat_map(|corner| (0..64).map(move |k| pixel(corner, k))).collect()
}

/// The scene on the processor, and the rays.
pub struct Scene {
    session: Opened,
    frame: Frame,
    pub sets: [Vec<Ray>; 3],
}

impl Scene {
    /// With bricks that are flat, or as they lie in the file.
    pub fn new(path: &Path, is_flat: bool) -> Self {
        let scene = open_scene(path).expect("the scene");
        let settings = Settings {
            adapter: Adapter::Cpu,
            // This holds all, and nothing beside.
            cache: if is_flat { CacheSize::Percent(100.0) } else { CacheSize::Bytes(scene.sizes().sum()) },
            schedule: Schedule::Plain,
            size: ImageSize { width: EXTENT.width, height: EXTENT.height },
            tile: EXTENT.tile,
            ..Settings::exact()
        };
        let mut session = Opened::open(scene.clone(), path, &settings).expect("a session");
        let camera = CameraPath::read(&path.with_extension("near.json")).expect("its path").frame(0, 30);
        let frame = Frame::near(scene.resident(), camera.position);
        session.executor.begin_frame(&View {
            frame,
            params: Params::default(),
            directions: Directions::default(),
            rays: None,
        });
        let Opened { executor, cache, .. } = &mut session;
        let bricks: Vec<Item> = (0..cache.states.len() as u32).map(Item::geometry).collect();
        cache.load_all(&mut **executor, &bricks, 64, &mut Counters::default()).expect("room for all");
        let basis = camera.ray_basis(EXTENT.width, EXTENT.height);
        let origin = frame.point(camera.position);
        let ray = |i: usize| {
            let (x, y) = (i % EXTENT.width as usize, i / EXTENT.width as usize);
            let direction = basis.direction(x as f64 + 0.5, y as f64 + 0.5).as_vec3().to_array();
            Ray { origin, t_min: 0.0, direction, t_max: T_INFINITE }
        };
        let mut scene = Self { session, frame, sets: [(0..EXTENT.rays()).map(ray).collect(), Vec::new(), Vec::new()] };
        scene.trace(0, true);
        let executor = &mut *scene.session.executor;
        let hits = executor.read_hits(Pass::Primary).expect("hits");
        let surfaces = executor.read_surfaces(Pass::Primary).expect("surfaces");
        let mut state = 7;
        let [_, occlusion, diffuse] = &mut scene.sets;
        for (hit, surface) in hits.iter().zip(&surfaces) {
            let t_min = (START / frame.unit) as f32;
            occlusion.push(leaving(hit, surface, [t_min, (OCCLUSION_LENGTH / frame.unit) as f32], &mut state));
            diffuse.push(leaving(hit, surface, [t_min, T_INFINITE], &mut state));
        }
        // As after some frames: bricks that have been used are made flat once that has paid.
        scene.trace(2, true);
        let triangles: u64 = scene.session.scene.resident().bricks.iter().map(|b| u64::from(b.triangle_count)).sum();
        for _ in 0..=triangles / EXTENT.rays() as u64 {
            scene.trace(1, true);
        }
        scene
    }

    /// Traces a set; seconds of the processor, and by the clock. `from_root`: no lists.
    fn trace(&mut self, set: usize, from_root: bool) -> [f64; 2] {
        let pass = pass_of(set);
        let Opened { executor, cache, .. } = &mut self.session;
        // As `chc` bounds its lists for camera rays, and for others.
        executor.tuning().list_most = if set == 0 { 128 } else { 12 };
        executor.set_rays(pass, &self.sets[set]);
        executor.run(pass, &[Step::StartHits], &cache.states).expect("hits are started");
        let steps: &[Step] =
            if from_root { &[Step::IntersectAll] } else { &[Step::ShortLists, Step::IntersectResident] };
        let (start, processor) = (Instant::now(), processor_seconds());
        executor.run(pass, steps, &cache.states).expect("rays are traced");
        [processor_seconds() - processor, start.elapsed().as_secs_f64()]
    }

    fn measure(&mut self, set: usize, from_root: bool) -> Measured {
        let [processor, wall] = self.trace(set, from_root);
        let hits = self.session.executor.read_hits(pass_of(set)).expect("hits");
        let distance = |pixel: usize| match &hits[pixel] {
            hit if hit.id == NONE => f32::INFINITY,
            hit => {
                if set == 1 {
                    0.0
                } else {
                    hit.t
                }
            }
        };
        Measured { processor, wall, distances: squares().into_iter().map(distance).collect() }
    }

    /// Number of rays of a set, number of triangles, rays in the order of [`squares`], corners, all in device units of
    /// the frame. The number of triangles is returned.
    pub fn dump(&self, to: &Path) -> std::io::Result<u32> {
        let mut file = BufWriter::new(File::create(to)?);
        let scene = &self.session.scene;
        let placed = Placement::new(scene.resident(), &self.frame);
        let records = &scene.resident().bricks;
        let count: u32 = placed.leaves.iter().map(|leaf| records[leaf.brick as usize].triangle_count).sum();
        file.write_all(bytemuck::cast_slice(&[EXTENT.rays() as u32, count]))?;
        for rays in &self.sets {
            let rays: Vec<Ray> = squares().into_iter().map(|pixel| rays[pixel]).collect();
            file.write_all(bytemuck::cast_slice(&rays))?;
        }
        for leaf in &placed.leaves {
            let payload = Payload::Geometry(leaf.brick);
            let mut words = vec![0u32; scene.loaded_bytes(payload) as usize / 4];
            scene.copy(payload, bytemuck::cast_slice_mut(&mut words)).map_err(std::io::Error::other)?;
            let record = &records[leaf.brick as usize];
            // Only its vertices are asked for.
            let brick = BrickView::new(record, bytemuck::cast_slice(&words), &[]);
            let rows = &placed.instances[leaf.instance as usize].world_from_object;
            for triangle in 0..record.triangle_count {
                let corners = brick.vertices(triangle, leaf.offset_high, leaf.offset_low);
                file.write_all(bytemuck::cast_slice(&corners.map(|corner| rows_point(rows, corner))))?;
            }
        }
        file.flush()?;
        Ok(count)
    }
}

/// The triangles of a dump with these rays.
pub fn triangles(dump: &Path, sets: &[Vec<Ray>; 3]) -> Vec<Corners> {
    let bytes = std::fs::read(dump).expect("the dump");
    let corners = 2 * size_of::<u32>() + sets.iter().map(|rays| size_of_val(&rays[..])).sum::<usize>();
    bytemuck::pod_collect_to_vec(&bytes[corners..])
}

fn pass_of(set: usize) -> Pass {
    if set == 1 { Pass::Shadow(Lamp::Sun) } else { Pass::Primary }
}

/// A ray from a hit, distributed by the cosine about the normal; where there is no hit, one that is not traced.
fn leaving(hit: &Hit, surface: &Surface, [t_min, t_max]: [f32; 2], state: &mut u64) -> Ray {
    if hit.id == NONE {
        return Ray { origin: [0.0; 3], t_min: 1.0, direction: [1.0, 0.0, 0.0], t_max: 0.0 };
    }
    let normal = DVec3::from_array(surface.normal.map(f64::from));
    let (z, turn) = (1.0 - 2.0 * random(state), std::f64::consts::TAU * random(state));
    let across = (1.0 - z * z).sqrt();
    let direction = (normal + DVec3::new(across * turn.cos(), across * turn.sin(), z)).normalize_or(normal);
    Ray { origin: surface.point, t_min, direction: direction.as_vec3().to_array(), t_max }
}

/// A scene in a thread of its own, whose passes run in one thread or in all.
struct Worker {
    questions: Sender<(usize, usize)>,
    answers: Receiver<Measured>,
}

impl Worker {
    fn new(path: PathBuf, is_flat: bool, is_alone: bool) -> Self {
        let (questions, asked) = channel::<(usize, usize)>();
        let (answer, answers) = channel();
        std::thread::spawn(move || {
            let alone = || rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
            let _pool = is_alone.then(|| alone().expect("a pool of this thread"));
            let mut scene = Scene::new(&path, is_flat);
            for (mode, set) in asked {
                // Nobody listens after the last answer that is wanted.
                let _ = answer.send(scene.measure(set, mode == 0));
            }
        });
        Self { questions, answers }
    }
}

/// The processor's kernels.
pub struct Ours {
    columns: Vec<Column>,
    one: Worker,
    all: Worker,
}

impl Ours {
    /// With bricks that are flat, or as they lie in the file.
    pub fn new(path: &Path, is_flat: bool) -> Self {
        let modes = ["root", "lists"].map(String::from).to_vec();
        let title = if is_flat { "ours" } else { "ours, packed" };
        Self {
            columns: vec![Column { title: title.into(), modes }],
            one: Worker::new(path.into(), is_flat, true),
            all: Worker::new(path.into(), is_flat, false),
        }
    }
}

impl Peer for Ours {
    fn columns(&self) -> &[Column] {
        &self.columns
    }

    fn measure(&mut self, mode: usize, set: usize, threads: usize) -> Measured {
        let worker = if threads == 1 { &self.one } else { &self.all };
        worker.questions.send((mode, set)).expect("it listens");
        worker.answers.recv().expect("it answers")
    }
}
