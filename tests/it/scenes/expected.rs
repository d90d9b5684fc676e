//! What converting does with every file of the shared scenes, good and bad: `expected.toml` says it and why.

use crate::common::{folder, shared_scenes, succeed};
use serde::Deserialize;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::{Duration, Instant};

/// Folders of which every file is listed.
const LISTED: [&str; 2] = ["bad", "stress"];

/// Folders of which every file must convert.
const SOUND: [&str; 4] = ["teapots_instanced", "sponza_draco", "scans", "city_buildings"];

/// Longest conversion of a file.
const LIMIT: Duration = Duration::from_secs(10);

/// Most address space of a conversion, in KiB: more than its memory.
const LIMIT_KIB: u64 = 1 << 20;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Expected {
    file: Vec<File>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    /// Below the folder of scenes.
    path: String,
    outcome: Outcome,
    /// Words of the warning or of the error.
    #[serde(default)]
    says: String,
    why: String,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
enum Outcome {
    Converts,
    Warns,
    Refused,
}

/// Runs `convert` within bounded address space where the system can bound it.
fn convert(scene: &Path, output: &Path) -> Output {
    let words = [scene.as_os_str(), "-o".as_ref(), output.as_os_str()];
    let command = env!("CARGO_BIN_EXE_brickwalk");
    let mut bounded = if cfg!(target_os = "linux") {
        let mut shell = Command::new("sh");
        shell.args(["-c", &format!("ulimit -v {LIMIT_KIB}; exec \"$0\" convert --threads 2 \"$@\""), command]);
        shell
    } else {
        let mut plain = Command::new(command);
        plain.arg("convert");
        plain
    };
    bounded.args(words).output().expect("the command starts")
}

/// Scene files in and below `folder`.
fn scene_files(folder: &Path, found: &mut BTreeSet<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            scene_files(&path, found);
        } else if path.extension().is_some_and(|e| ["gltf", "glb", "obj", "ply", "stl"].iter().any(|known| e == *known))
        {
            found.insert(path);
        }
    }
}

fn expected() -> Vec<File> {
    let expected: Expected = toml::from_str(include_str!("expected.toml")).expect("expected.toml");
    expected.file
}

/// What is wrong with how a file went; `None`: it went as expected.
fn judge(file: &File, output: &Output, left: bool) -> Option<String> {
    let said = String::from_utf8_lossy(&output.stderr);
    let warnings = said.lines().filter(|line| line.starts_with("brickwalk: warning: ")).count();
    let outcome = match output.status.code() {
        Some(0) if said.is_empty() => Outcome::Converts,
        Some(0) if warnings == said.lines().count() => Outcome::Warns,
        Some(1) if said.lines().count() == 1 && warnings == 0 && !left => Outcome::Refused,
        other => return Some(format!("exit {other:?}, output left: {left}: {said}")),
    };
    let is_told = outcome == Outcome::Converts || (!file.says.is_empty() && said.contains(&file.says));
    let names_file = outcome != Outcome::Refused || said.contains(&file.path);
    let is_defect = said.contains("internal error");
    (outcome != file.outcome || !is_told || !names_file || is_defect).then(|| format!("{outcome:?}: {said}"))
}

#[test]
fn every_file_goes_as_expected() {
    let Some(scenes) = shared_scenes() else { return };
    let folder = folder();
    let output = folder.path().join("out.bricks");
    let mut present = BTreeSet::new();
    LISTED.iter().for_each(|listed| scene_files(&scenes.join(listed), &mut present));
    let mut wrong = Vec::new();
    let (mut slowest, mut counts) = (Duration::ZERO, [0; 3]);
    for file in expected() {
        let path = scenes.join(&file.path);
        assert!(present.remove(&path), "{} is listed, but not there, or listed twice", file.path);
        assert!(file.why.len() > 5, "{} states no reason", file.path);
        let start = Instant::now();
        let result = convert(&path, &output);
        slowest = slowest.max(start.elapsed());
        assert!(start.elapsed() < LIMIT, "{} took {:?}", file.path, start.elapsed());
        if let Some(problem) = judge(&file, &result, output.exists()) {
            wrong.push(format!("{}: expected {:?} saying {:?}, but {problem}", file.path, file.outcome, file.says));
        }
        counts[file.outcome as usize] += 1;
        // A conversion that left nothing has not replaced the output of the one before.
        if output.exists() {
            succeed(["verify".as_ref(), output.as_os_str()]);
            std::fs::remove_file(&output).expect("the output");
        }
    }
    assert!(wrong.is_empty(), "{} files went otherwise:\n{}", wrong.len(), wrong.join("\n"));
    assert!(present.is_empty(), "files that expected.toml does not list: {present:?}");
    println!("{counts:?} convert, warn, are refused; the slowest took {slowest:?}");
    assert!(counts.iter().all(|&count| count > 10), "{counts:?}");
}

#[test]
fn the_judge_notices_what_differs() {
    let Some(scenes) = shared_scenes() else { return };
    let folder = folder();
    let output = folder.path().join("out.bricks");
    for file in expected().iter().filter(|file| file.path.starts_with("bad/assimp")) {
        let result = convert(&scenes.join(&file.path), &output);
        let other = match file.outcome {
            Outcome::Converts => Outcome::Warns,
            Outcome::Warns => Outcome::Refused,
            Outcome::Refused => Outcome::Converts,
        };
        let (path, why) = (file.path.clone(), file.why.clone());
        let misjudged = File { path, why, outcome: other, says: file.says.clone() };
        assert!(judge(&misjudged, &result, false).is_some(), "{}", file.path);
        if file.outcome != Outcome::Converts {
            let (path, why) = (file.path.clone(), file.why.clone());
            let misquoted = File { path, why, outcome: file.outcome, says: "other words".into() };
            assert!(judge(&misquoted, &result, false).is_some(), "{}", file.path);
        }
    }
}

#[test]
fn sound_files_convert_and_verify() {
    let Some(scenes) = shared_scenes() else { return };
    let folder = folder();
    let mut files = BTreeSet::new();
    SOUND.iter().for_each(|sound| scene_files(&scenes.join(sound), &mut files));
    assert_eq!(files.len(), 6, "{files:?}");
    for file in files {
        let output = folder.path().join("out.bricks");
        succeed(["convert".as_ref(), file.as_os_str(), "-o".as_ref(), output.as_os_str()]);
        succeed(["verify".as_ref(), output.as_os_str()]);
    }
}

/// Tiles far from the origin: each lands where it belongs, to the lattice's step.
#[test]
fn folders_of_tiles_with_large_coordinates() {
    let folder = folder();
    let tiles = folder.path().join("tiles/deep");
    std::fs::create_dir_all(&tiles).expect("a folder");
    // Earth-centred: millions of metres, as 3D Tiles have them.
    let origin = [4_194_304.0, 171_000.25, 4_780_000.5];
    for i in 0..4 {
        let [x, y, z] = origin;
        let x = x + 100.0 * f64::from(i);
        let json = format!(
            "{{\"asset\": {{\"version\": \"2.0\"}}, \"nodes\": [{{\"mesh\": 0, \"matrix\": [1,0,0,0, 0,1,0,0, 0,0,1,0, \
             {x},{y},{z},1]}}], \"meshes\": [{{\"primitives\": [{{\"attributes\": {{\"POSITION\": 0}}}}]}}], \
             \"accessors\": [{{\"bufferView\": 0, \"componentType\": 5126, \"type\": \"VEC3\", \"count\": 3}}], \
             \"bufferViews\": [{{\"buffer\": 0, \"byteLength\": 36}}], \"buffers\": [{{\"byteLength\": 36, \"uri\": \
             \"tile.bin\"}}]}}"
        );
        std::fs::write(tiles.join(format!("tile{i}.gltf")), json).expect("a tile");
    }
    let positions = [0.0f32, 0.0, 0.0, 50.0, 0.0, 0.0, 0.0, 50.0, 0.0];
    let bytes: Vec<u8> = positions.iter().flat_map(|x| x.to_le_bytes()).collect();
    std::fs::write(tiles.join("tile.bin"), bytes).expect("a buffer");
    let output = folder.path().join("tiles.bricks");
    let input = folder.path().join("tiles");
    // Back to the origin, so that the test sees what is left of the small coordinates.
    let back = format!("translate -{} -{} -{}", origin[0], origin[1], origin[2]);
    for (transform, [x, y, z]) in [(None, origin), (Some(back), [0.0; 3])] {
        let mut words = vec!["convert".into(), input.clone().into_os_string(), "-o".into(), output.clone().into()];
        words.extend(transform.into_iter().flat_map(|transform| ["--transform".into(), transform.into()]));
        succeed(words);
        let info: serde_json::Value =
            serde_json::from_str(&succeed(["info".as_ref(), output.as_os_str(), "--json".as_ref()])).expect("JSON");
        assert_eq!(info["triangles_stored"], 4);
        // The default lattice of a scene of 350 m is finer than a tenth of a millimetre.
        for (axis, (low, high)) in [(x, x + 350.0), (y, y + 50.0), (z, z)].into_iter().enumerate() {
            let near = |what: &str, expected: f64| {
                let found = info[what][axis].as_f64().expect("a number");
                assert!((found - expected).abs() < 1e-4, "{what} {axis}: {found}, not {expected}");
            };
            near("bounds_min", low);
            near("bounds_max", high);
        }
        succeed(["verify".as_ref(), output.as_os_str()]);
    }
}
