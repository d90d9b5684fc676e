//! What the integration tests share: the command as a user runs it, scenes made once, folders that vanish.

use bricks::pack::pack;
use bricks::{
    DISPLACEMENT_BY_CPU, DISPLACEMENT_DISTANCES, DISPLACEMENT_HITS, DisplacementField, Grid, Leaf, Level, NONE,
    Payload, SceneFile, Span, TOP_LEAF, TopNode2, TopNode8, Writer,
};
use brickwalk::Settings;
use brickwalk::frame::{Equirectangular, Renderer, environment};
use brickwalk::kernels::Lamps;
use brickwalk::session::opened::{Opened, open_scene};
use brickwalk::settings::{Adapter, Group};
use brickwalk_convert::build::{BuildSettings, build};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::SourceScene;
use brickwalk_scenes::{Settings as SceneSettings, generate, write_paths};
use glam::DVec3;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Arc;

pub use crate::skip::{shared_scenes, skip};

/// Runs `brickwalk` with the given words.
pub fn brickwalk<S: AsRef<std::ffi::OsStr>>(words: impl IntoIterator<Item = S>) -> Output {
    Command::new(env!("CARGO_BIN_EXE_brickwalk")).args(words).output().expect("the command starts")
}

/// Runs `brickwalk` and insists on success.
pub fn succeed<S: AsRef<std::ffi::OsStr>>(words: impl IntoIterator<Item = S>) -> String {
    let output = brickwalk(words);
    assert!(
        output.status.success(),
        "exit {:?}\n{}{}",
        output.status.code(),
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// A folder that is removed when the test ends.
pub fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

/// The name of a software adapter that can render; without one the test is skipped.
pub fn software() -> Option<String> {
    let listed: Value = serde_json::from_str(&succeed(["adapters", "--json"])).expect("JSON");
    let adapters = listed["adapters"].as_array().expect("a list");
    let found = adapters.iter().find(|a| a["kind"] == "software" && a["lacks"].is_null());
    if found.is_none() {
        skip("no software Vulkan");
    }
    found.map(|a| a["name"].as_str().expect("a name").to_string())
}

/// The processor, and software Vulkan where there is some.
pub fn adapters() -> Vec<String> {
    ["cpu".to_string()].into_iter().chain(software()).collect()
}

/// A generated city in `folder`.
pub fn city(folder: &Path, triangles: &str, brick_triangles: &str) -> PathBuf {
    let scene = folder.join(format!("city-{triangles}-{brick_triangles}.bricks"));
    let words = ["scene", "city", "--triangles", triangles, "--brick-triangles", brick_triangles, "-o"];
    succeed(words.iter().map(std::ffi::OsStr::new).chain([scene.as_os_str()]));
    scene
}

/// A generated city of small bricks with levels of detail in `folder`.
pub fn levelled_city(folder: &Path) -> PathBuf {
    let scene = folder.join("city.bricks");
    let words = ["scene", "city", "--triangles", "60K", "--brick-triangles", "500", "--lod", "on", "-o"];
    succeed(words.iter().map(std::ffi::OsStr::new).chain([scene.as_os_str()]));
    scene
}

/// Whether there is such a program.
pub fn has_program(name: &str) -> bool {
    let folders = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&folders).any(|folder| folder.join(name).is_file())
}

/// Waits until there is something, for a minute and a half at most.
pub fn wait<T>(what: &str, mut is: impl FnMut() -> Option<T>) -> T {
    let start = std::time::Instant::now();
    loop {
        if let Some(found) = is() {
            return found;
        }
        assert!(start.elapsed().as_secs() < 90, "{what} did not come");
        std::thread::sleep(std::time::Duration::from_millis(30));
    }
}

/// Adds displacement fields of any samples to a scene: of the first brick of the world, and of the whole world.
pub fn add_fields(path: &Path) {
    let scene = SceneFile::open(path).expect("the scene");
    let mut resident = scene.resident().clone();
    let reserved = Writer::reserve(path).expect("a temporary file");
    let mut writer = reserved.start_from(&scene, &mut |_| {}).expect("a copy of the payloads");
    let field = |brick, rings, bits| DisplacementField {
        object: 0,
        brick,
        rings,
        directions: 4,
        bits,
        executor: DISPLACEMENT_BY_CPU,
        center: [0.5; 3],
        radius: 9.0,
        mean: 0.25,
        span: Span::default(),
    };
    for field in [field(0, 8, DISPLACEMENT_HITS), field(NONE, 16, DISPLACEMENT_DISTANCES)] {
        let mut samples: Vec<u8> = (0..field.sample_bytes()).map(|at| (at * at / 7) as u8).collect();
        samples.resize(field.loaded_bytes() as usize, 0);
        let span = writer.write(&pack(&samples)).expect("room on the disk");
        resident.displacement.push(DisplacementField { span, ..field });
    }
    writer.finish(&resident).expect("a scene with fields");
}

/// Writes the scene anew with a level of detail that stands for the first bricks of the world by a copy of the first.
/// Its displacement fields are left out.
pub fn add_level(path: &Path) {
    let scene = SceneFile::open(path).expect("the scene");
    let mut resident = scene.resident().clone();
    let reserved = Writer::reserve(path).expect("a temporary file");
    let mut writer = reserved.start_from(&scene, &mut |_| {}).expect("a copy of the payloads");
    let (world, all) = (&resident.objects[0], resident.bricks.len() as u32);
    let first = world.first_brick;
    let mut brick = bricks::Brick { proxies: Span::default(), ..resident.bricks[first as usize] };
    for (payload, span) in
        [(Payload::Geometry(first), &mut brick.geometry), (Payload::Attributes(first), &mut brick.attributes)]
    {
        let mut bytes = vec![0; span.bytes as usize];
        scene.copy_stored(payload, &mut bytes).expect("a payload");
        *span = writer.write(&bytes).expect("room on the disk");
    }
    let child = |number| Leaf { instance: NONE, brick: if number < world.brick_count { first + number } else { NONE } };
    let children = [0, 1, 2, 3].map(child);
    resident.displacement.clear();
    resident.levels = vec![Level { brick, children, error: 0.5, bound: 2.0, color: 0.25, _reserved: 0 }];
    resident.level_leaves = resident.leaves.clone();
    resident.level_leaves.push(Leaf { instance: 0, brick: all });
    // Roots over those of the trees over bricks, and over the level.
    let leaf = resident.leaves.len() as u32;
    let (whole, shift) = (resident.top2[0], |child| child + 1);
    let level = TopNode2 { min: brick.min, max: brick.max, left: leaf, right: TOP_LEAF };
    resident.level_top2 = vec![TopNode2 { left: 1, right: resident.top2.len() as u32 + 1, ..whole }];
    resident.level_top2.extend(resident.top2.iter().map(|node| match node.right {
        TOP_LEAF => *node,
        _ => TopNode2 { left: shift(node.left), right: shift(node.right), ..*node },
    }));
    resident.level_top2.push(level);
    let mut children = [None; 8];
    (children[0], children[1]) = (Some([whole.min, whole.max]), Some([brick.min, brick.max]));
    let Grid { exponent, lo, hi } = Grid::over(&children, whole.min, whole.max);
    let meta = [0x38, 0x20, 0, 0, 0, 0, 0, 0];
    let root = TopNode8 {
        origin: whole.min,
        exponent,
        inner_mask: 1,
        child_base: 1,
        leaf_base: leaf,
        meta,
        lo,
        hi,
        _reserved: 0,
    };
    let below = resident.top8.iter().map(|node| TopNode8 { child_base: shift(node.child_base), ..*node });
    resident.level_top8 = std::iter::once(root).chain(below).collect();
    writer.finish(&resident).expect("a scene with a level");
}

/// A source with every surface half of smooth metal, so that rays of `--effects glossy` leave all of them.
pub fn polished(mut source: SourceScene) -> SourceScene {
    for material in &mut source.materials {
        (material.metallic, material.roughness) = (0.5, 0.1);
    }
    source
}

/// A generated city in `folder`, [`polished`].
pub fn polished_city(folder: &Path, triangles: u64, brick_triangles: u32) -> PathBuf {
    let scene = folder.join(format!("polished-{triangles}-{brick_triangles}.bricks"));
    let settings = SceneSettings { triangles, ..SceneSettings::default() };
    let city = generate(&settings, &Progress::hidden()).expect("a count in range");
    let settings = BuildSettings { brick_triangles, ..BuildSettings::default() };
    build(polished(city.whole()), &settings, &scene, &Progress::hidden()).expect("a scene");
    write_paths(&city, &scene).expect("camera paths");
    scene
}

/// The scene of an OBJ file, with options of `convert`.
pub fn converted(folder: &Path, shape: &str, options: &str) -> PathBuf {
    let (input, scene) = (folder.join("shape.obj"), folder.join("shape.bricks"));
    std::fs::write(&input, shape).expect("a shape");
    let words = ["convert".as_ref(), input.as_os_str(), "-o".as_ref(), scene.as_os_str()];
    succeed(words.into_iter().chain(options.split_whitespace().map(std::ffi::OsStr::new)));
    scene
}

/// Adds a sheet of squares to the text of an OBJ file of `count` vertices: its corner, its two edges, and how many
/// squares along them.
pub fn sheet(text: &mut String, count: &mut usize, corner: DVec3, edges: [DVec3; 2], squares: [usize; 2]) {
    for j in 0..=squares[1] {
        for i in 0..=squares[0] {
            let p = corner + edges[0] * (i as f64 / squares[0] as f64) + edges[1] * (j as f64 / squares[1] as f64);
            *text += &format!("v {} {} {}\n", p.x, p.y, p.z);
        }
    }
    let row = squares[0] + 1;
    for (i, j) in (0..squares[0]).flat_map(|i| (0..squares[1]).map(move |j| (i, j))) {
        let p = *count + 1 + i + j * row;
        *text += &format!("f {p} {} {}\nf {p} {} {}\n", p + 1, p + row + 1, p + row + 1, p + row);
    }
    *count += row * (squares[1] + 1);
}

/// Settings that options of the command line stand for, beside those of `--quality exact`; the adapter is that of the
/// environment unless they name one.
pub fn settings(options: &str) -> Settings {
    let mut settings = Settings::exact();
    if let Ok(adapter) = std::env::var("BRICKWALK_ADAPTER") {
        settings.set("adapter", &adapter).expect("an adapter");
    }
    settings.set_options(options).expect("options");
    settings
}

/// The renderer of a walk on the processor with these options.
pub fn renderer(scene: &Path, options: &str) -> Renderer {
    let settings = Settings { adapter: Adapter::Cpu, ..settings(options) };
    let opened = Opened::open(open_scene(scene).expect("a scene"), scene, &settings).expect("a session");
    brickwalk::session::renderer::renderer(opened, scene, &settings).expect("lamps")
}

/// One of these effects where an environment is the only light, and 1 everywhere.
pub fn evenly_lit(scene: &Path, effects: &str, options: &str) -> Renderer {
    let mut renderer = renderer(scene, &format!("--tile 16 --aov --sun-intensity 0 --effects {effects} {options}"));
    let even = Equirectangular::of(16, 8, |_| [1.0; 3]);
    renderer.light.lamps = Arc::new(Lamps::new(Some(environment(even, 1.0, 0.0).0), Vec::new(), 1.0));
    renderer
}

/// Walks with these options, beside scene, output and `--quality exact`.
pub fn walk(scene: &Path, output: &Path, options: &str) -> String {
    let exact = ["--quality".as_ref(), "exact".as_ref()];
    let words = ["walk".as_ref(), scene.as_os_str(), "-o".as_ref(), output.as_os_str()].into_iter().chain(exact);
    succeed(words.into_iter().chain(options.split_whitespace().map(std::ffi::OsStr::new)))
}

/// Walks as [`walk`] does, on so many threads, and gives the records.
pub fn walk_on_threads(scene: &Path, output: &Path, options: &str, threads: &str) -> Vec<Value> {
    let status = Command::new(env!("CARGO_BIN_EXE_brickwalk"))
        .env("RAYON_NUM_THREADS", threads)
        .args(["walk".as_ref(), scene.as_os_str(), "-o".as_ref(), output.as_os_str()])
        .args("--quality exact".split(' ').chain(options.split_whitespace()))
        .status();
    assert!(status.expect("the command starts").success(), "{options}");
    records(output)
}

/// The records of a walk.
pub fn records(output: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(output.join("records.jsonl")).expect("records");
    text.lines().map(|line| serde_json::from_str(line).expect("a record")).collect()
}

/// The sum of a field over the records of a pass.
pub fn sum(records: &[Value], pass: &str, field: &str) -> f64 {
    records.iter().filter(|r| r["pass"] == pass).map(|r| r[field].as_f64().expect("a number")).sum()
}

/// The JSON in a file.
pub fn json(file: &Path) -> Value {
    let bytes = std::fs::read(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    serde_json::from_slice(&bytes).expect("JSON")
}

/// The names of what is in a folder, sorted.
pub fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").file_name());
    let mut names: Vec<String> = entries.map(|name| name.to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// Waits until another process has made a file.
#[cfg(unix)]
pub fn wait_for(file: &Path) {
    use std::time::{Duration, Instant};
    let start = Instant::now();
    while !file.exists() {
        assert!(start.elapsed() < Duration::from_secs(120), "{} does not appear", file.display());
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Every frame of a walk, PNG and EXR, by name.
pub fn frames(output: &Path) -> Vec<(String, Vec<u8>)> {
    let mut files: Vec<_> = std::fs::read_dir(output.join("frames"))
        .expect("a folder of frames")
        .map(|entry| entry.expect("an entry").path())
        .map(|path| {
            (path.file_name().expect("a name").to_string_lossy().into_owned(), std::fs::read(&path).expect("a frame"))
        })
        .collect();
    files.sort();
    files
}

/// Corners of a box that is 4 wide and 3 high, on the ground, as vertices of an OBJ file.
pub fn box_corners() -> String {
    (0..8).map(|i| format!("v {} {} {}\n", (i & 1) * 4 - 2, (i >> 1 & 1) * 3, (i >> 2) * 4 - 2)).collect()
}

/// The mean radiance of the floor of such a box, seen from within, under a sun overhead that is all the light there is.
pub fn light_on_floor(folder: &Path, scene: &Path, options: &str) -> f64 {
    let path = folder.join("down.json");
    let down =
        r#"{"fov_y_degrees": 20, "up": [0,0,1], "keyframes": [{"time": 0, "position": [0,2,0], "target": [0,0,0]}]}"#;
    std::fs::write(&path, down).expect("a path");
    let light = "--effects primary,shadow --sun 0,1,0 --sun-angle 0 --sun-intensity 3 --sky-intensity 0 \
                 --environment off --size 32x32 --spp 1";
    let options = format!("{light} --path {} {options}", path.display());
    let mut session = brickwalk::Session::open(scene, &settings(&options)).expect("a session");
    let camera = session.path().frame(0, 1);
    let frame = session.picture(&camera, &mut ()).expect("a frame").expect("a frame");
    frame.pixels.radiance.iter().map(|c| f64::from(c[1])).sum::<f64>() / 1024.0
}
