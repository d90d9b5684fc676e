//! The processor's kernels against Embree: the same triangles and the same rays, dumped, in turns. `tools/peer.sh`
//! builds the other side (`benches/peer/embree.cpp`) and runs this.
//!
//! Camera rays of the first view of the near path; from every hit a ray 4 m long that any hit ends (AO), and one that
//! looks for the closest (diffuse), their directions distributed by the cosine and random by pixel. Everything is
//! resident. Rates are rays by processor time of all threads, the best of the repetitions: of ours with the walk from
//! the root (`plain`) and with tiles' lists (`chc`), of Embree with single rays and with packets of 4, 8 and 16.

mod common;

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
use brickwalk::stream::Item;
use glam::DVec3;
use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Stdio};

const EXTENT: Extent = Extent { width: 1280, height: 720, tile: 64 };
/// Metres.
const OCCLUSION_LENGTH: f64 = 4.0;
/// Metres from a hit to where rays from it begin: none meets its own surface, which Embree is not told to leave out.
const START: f64 = 1e-3;
const SETS: [&str; 3] = ["primary", "AO", "diffuse"];
const REPETITIONS: usize = 5;

/// Nanoseconds that all threads of this process have run for, as the kernel counts them.
fn processor_seconds() -> f64 {
    let tasks = std::fs::read_dir("/proc/self/task").expect("/proc: this runs on Linux");
    let of = |task: std::io::Result<std::fs::DirEntry>| {
        let text = std::fs::read_to_string(task.ok()?.path().join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse::<u64>().ok()
    };
    tasks.filter_map(of).sum::<u64>() as f64 / 1e9
}

/// SplitMix64 (Steele, Lea, Flood 2014), as a number in 0..1.
fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// A city of so many triangles, made once.
fn city(triangles: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("peer-{triangles}.bricks"));
    if !path.exists() {
        common::city(triangles, &path);
    }
    path
}

/// The scene on the processor, and the rays.
struct Ours {
    session: Opened,
    frame: Frame,
    sets: [Vec<Ray>; 3],
}

impl Ours {
    fn new(path: &Path) -> Self {
        let settings = Settings {
            adapter: Adapter::Cpu,
            cache: CacheSize::Percent(100.0),
            schedule: Schedule::Plain,
            size: ImageSize { width: EXTENT.width, height: EXTENT.height },
            tile: EXTENT.tile,
            ..Settings::exact()
        };
        let scene = open_scene(path).expect("the scene");
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
        let mut ours = Self { session, frame, sets: [(0..EXTENT.rays()).map(ray).collect(), Vec::new(), Vec::new()] };
        ours.seconds(0, true);
        let executor = &mut *ours.session.executor;
        let hits = executor.read_hits(Pass::Primary).expect("hits");
        let surfaces = executor.read_surfaces(Pass::Primary).expect("surfaces");
        let mut state = 7;
        let [_, occlusion, diffuse] = &mut ours.sets;
        for (hit, surface) in hits.iter().zip(&surfaces) {
            let t_min = (START / frame.unit) as f32;
            occlusion.push(leaving(hit, surface, [t_min, (OCCLUSION_LENGTH / frame.unit) as f32], &mut state));
            diffuse.push(leaving(hit, surface, [t_min, T_INFINITE], &mut state));
        }
        ours
    }

    /// Traces a set; processor seconds. `from_root`: no lists.
    fn seconds(&mut self, set: usize, from_root: bool) -> f64 {
        let pass = if set == 1 { Pass::Shadow(Lamp::Sun) } else { Pass::Primary };
        let Opened { executor, cache, .. } = &mut self.session;
        // As `chc` bounds its lists for camera rays, and for others.
        executor.tuning().list_most = if set == 0 { 128 } else { 12 };
        executor.set_rays(pass, &self.sets[set]);
        executor.run(pass, &[Step::StartHits], &cache.states).expect("hits are started");
        let steps: &[Step] =
            if from_root { &[Step::IntersectAll] } else { &[Step::ShortLists, Step::IntersectResident] };
        let start = processor_seconds();
        executor.run(pass, steps, &cache.states).expect("rays are traced");
        processor_seconds() - start
    }

    fn hits(&mut self, set: usize) -> usize {
        let pass = if set == 1 { Pass::Shadow(Lamp::Sun) } else { Pass::Primary };
        let hits = self.session.executor.read_hits(pass).expect("hits");
        hits.iter().filter(|hit| hit.id != NONE).count()
    }

    fn traced(&self, set: usize) -> usize {
        self.sets[set].iter().filter(|ray| ray.t_min <= ray.t_max).count()
    }

    /// Size, rays, number of triangles, corners, all in device units of the frame.
    fn dump(&self, to: &Path) -> std::io::Result<()> {
        let mut file = BufWriter::new(File::create(to)?);
        file.write_all(bytemuck::cast_slice(&[EXTENT.width, EXTENT.height]))?;
        let scene = &self.session.scene;
        let placed = Placement::new(scene.resident(), &self.frame);
        let records = &scene.resident().bricks;
        let count: u32 = placed.leaves.iter().map(|leaf| records[leaf.brick as usize].triangle_count).sum();
        file.write_all(&count.to_le_bytes())?;
        for rays in &self.sets {
            file.write_all(bytemuck::cast_slice(rays))?;
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
        file.flush()
    }
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

/// Embree in a process of its own.
struct Embree {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

impl Embree {
    fn new(program: &Path, dump: &Path) -> Self {
        let mut child = std::process::Command::new(program)
            .arg(dump)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program that tools/peer.sh builds");
        let (input, output) = (child.stdin.take().expect("piped"), child.stdout.take().expect("piped"));
        Self { child, input, output: BufReader::new(output) }
    }

    /// Processor seconds of its interfaces, and the number of hits.
    fn seconds(&mut self, robust: bool, set: usize) -> ([f64; 4], usize) {
        writeln!(self.input, "{} {set}", u8::from(robust)).expect("it listens");
        let mut line = String::new();
        self.output.read_line(&mut line).expect("it answers");
        let numbers: Vec<f64> = line.split_whitespace().map(|x| x.parse().expect("a number")).collect();
        let [one, four, eight, sixteen, hits] = numbers[..] else { panic!("five numbers, not {line:?}") };
        ([one, four, eight, sixteen], hits as usize)
    }

    fn finish(self) {
        let Self { mut child, input, .. } = self;
        drop(input);
        child.wait().expect("it ends");
    }
}

fn main() {
    let Some(program) = std::env::var_os("EMBREE_PEER").map(PathBuf::from) else {
        println!("peer: skipped, for EMBREE_PEER names no program; run tools/peer.sh");
        return;
    };
    let given: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    let cities = if given.is_empty() { vec!["1M".into(), "5M".into()] } else { given };
    println!("{}", brickwalk::cpu::device_info().driver_info);
    println!("| city | rays | ours, root / lists | Embree robust, 1 / 4 / 8 / 16 | without the flag | ours / robust |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for city_of in cities {
        let path = city(&city_of);
        let mut ours = Ours::new(&path);
        let dump = path.with_extension("dump");
        ours.dump(&dump).expect("a dump");
        let mut embree = Embree::new(&program, &dump);
        for (set, name) in SETS.iter().enumerate() {
            let (mut own, mut robust, mut fast) = ([f64::MAX; 2], [f64::MAX; 4], [f64::MAX; 4]);
            let mut hits = [0; 2];
            for _ in 0..REPETITIONS {
                own = [own[0].min(ours.seconds(set, true)), own[1].min(ours.seconds(set, false))];
                let (seconds, count) = embree.seconds(true, set);
                robust = std::array::from_fn(|i| robust[i].min(seconds[i]));
                let (seconds, _) = embree.seconds(false, set);
                fast = std::array::from_fn(|i| fast[i].min(seconds[i]));
                hits = [ours.hits(set), count];
            }
            // Both see the same: what differs are rays through edges, where Embree rounds.
            let apart = hits[0].abs_diff(hits[1]) as f64 / ours.traced(set) as f64;
            assert!(apart < 1e-4, "{name}: {hits:?} hits");
            let rate = |seconds: f64| ours.traced(set) as f64 / seconds / 1e6;
            let rates =
                |seconds: &[f64]| seconds.iter().map(|&s| format!("{:.2}", rate(s))).collect::<Vec<_>>().join(" / ");
            let least = |seconds: &[f64]| seconds.iter().copied().fold(f64::MAX, f64::min);
            let ratio = least(&robust) / least(&own);
            println!("| {city_of} | {name} | {} | {} | {} | {ratio:.2} |", rates(&own), rates(&robust), rates(&fast));
        }
        embree.finish();
        std::fs::remove_file(&dump).expect("its own file");
    }
}
