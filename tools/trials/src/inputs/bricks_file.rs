//! Scene files, with their checksums made right, so that what is behind them is reached.

use super::{Files, Format, Verdict};
use crate::kind::Fault;
use crate::mutate::{Harm, bytes};
use crate::random::Random;
use bricks::layout::Header;
use bricks::{Access, Error, SceneFile, VerifyReport, verify_file};
use brickwalk_convert::build::{BuildSettings, TextureEncoding, build};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{Primitive, SourceTexture};
use std::path::Path;
use std::sync::OnceLock;

/// What reads everything in a scene file and insists on the format: that of the reader's own tests.
#[path = "../../../../bricks/tests/it/exercise.rs"]
pub mod exercise;

/// Scene files that were kept: all sections are in one or another.
const GOLDEN: [&[u8]; 3] = [
    include_bytes!("../../../../bricks/tests/golden/version-4.bricks"),
    include_bytes!("../../../../bricks/tests/golden/version-4-levels.bricks"),
    include_bytes!("../../../../bricks/tests/golden/version-4-displacement.bricks"),
];

/// Scene files made here, far smaller than those that were kept; none where they cannot be made.
fn small() -> &'static [Vec<u8>] {
    static SMALL: OnceLock<Vec<Vec<u8>>> = OnceLock::new();
    SMALL.get_or_init(|| [false, true].into_iter().filter_map(made).collect())
}

fn made(is_rich: bool) -> Option<Vec<u8>> {
    let side = if is_rich { 9u32 } else { 3 };
    let place = |at: u32| [f64::from(at % side), f64::from(at * at % 5) / 8.0, f64::from(at / side)];
    let positions: Vec<[f64; 3]> = (0..side * side).map(place).collect();
    let squares = (0..side * (side - 1)).filter(|at| at % side + 1 < side);
    let square = |at: u32| [at, at + side, at + 1, at + 1, at + side, at + side + 1];
    let uvs = positions.iter().map(|place| [place[0] as f32 / 3.0, place[2] as f32 / 3.0]).collect();
    let floor =
        Primitive { uvs: Some(uvs), positions, indices: squares.flat_map(square).collect(), ..Primitive::default() };
    let mut scene = brickwalk_scenes::one_mesh("floor", floor);
    if is_rich {
        let rgba = (0..4 * 16 * 16u32).map(|at| (at * 7) as u8).collect();
        scene.textures.push(SourceTexture { name: "t".into(), width: 16, height: 16, wrap: 0, rgba });
        if let Some(material) = scene.materials.first_mut() {
            material.base_color_texture = 0;
            material.flags |= bricks::MATERIAL_MASK;
        }
    }
    let folder = tempfile::tempdir().ok()?;
    let file = folder.path().join("small.bricks");
    let settings = BuildSettings {
        brick_triangles: 32,
        threads: Some(1),
        lod: is_rich,
        proxies: is_rich,
        textures: if is_rich { TextureEncoding::Raw } else { TextureEncoding::Bc7 },
        ..BuildSettings::default()
    };
    build(scene, &settings, &file, &Progress::hidden()).ok()?;
    std::fs::read(&file).ok()
}

/// Scene files.
pub struct BricksFile;

/// Where the resident part begins; 0 of what is none.
fn resident(file: &[u8]) -> usize {
    let header: Option<Header> = file.get(..size_of::<Header>()).map(bytemuck::pod_read_unaligned);
    header.map_or(0, |header| header.directory_offset as usize).min(file.len())
}

/// However a file is opened, it opens or does not, and has as many problems.
fn by_path(files: &Files, folder: &Path) -> Result<(), Fault> {
    let path = files.write(folder)?;
    let opened = [
        SceneFile::from_bytes("fuzzed.bricks", files.bytes().to_vec()),
        SceneFile::open(&path),
        SceneFile::open_with(&path, Access::Map),
        SceneFile::open_with(&path, Access::Read),
    ];
    let checksums = opened.each_ref().map(|file| file.as_ref().ok().map(SceneFile::checksum));
    if checksums.iter().any(|checksum| *checksum != checksums[0]) {
        return Err(Fault::new("a file opens by one way and not by another", format!("{checksums:?}")));
    }
    let problems = |report: Result<VerifyReport, Error>| report.ok().map(|report| report.problems.len());
    let whole = problems(verify_file(&path, &mut |_, _| {}));
    for file in opened.iter().flatten() {
        if problems(file.verify(&mut |_, _| {})) != whole {
            return Err(Fault::new("a file has other problems by another way", format!("{whole:?}")));
        }
    }
    Ok(())
}

impl Format for BricksFile {
    const NAME: &'static str = "inputs/bricks";
    const ABOUT: &'static str =
        "Scene files of all sections, with checksums made right: opened, copied, followed, verified";

    fn make(&self, random: &mut Random, harm: Harm) -> Files {
        let is_golden = random.chance(15) || small().is_empty();
        let file = if is_golden {
            random.pick(GOLDEN).to_vec()
        } else {
            random.pick_from(small()).cloned().unwrap_or_default()
        };
        let mut file = file;
        if harm.does(random, 100) {
            for _ in 0..random.pick([1, 1, 1, 2, 3]) {
                let at = resident(&file);
                match random.below(10) {
                    // The resident part is smaller than the payloads and decides more.
                    0..=5 => {
                        let mut part = file.split_off(at);
                        let length = part.len();
                        bytes::change(random, &mut part);
                        // A change of length moves all that is behind; that is rarely looked into.
                        if !random.chance(10) {
                            part.resize(length, 0);
                        }
                        file.extend(part);
                    }
                    6 | 7 => {
                        let mut part = file[..at].to_vec();
                        bytes::change(random, &mut part);
                        part.resize(at, 0);
                        file.splice(..at, part);
                    }
                    8 => {
                        let mut part = file[..file.len().min(256)].to_vec();
                        bytes::change(random, &mut part);
                        part.resize(file.len().min(256), 0);
                        file.splice(..file.len().min(256), part);
                    }
                    _ => bytes::change(random, &mut file),
                }
            }
            if !random.chance(10) {
                exercise::seal(&mut file);
            }
        }
        Files::one("fuzzed.bricks", file)
    }

    fn read(&self, random: &mut Random, files: &Files, folder: &Path) -> Result<Verdict, Fault> {
        if random.chance(2) {
            by_path(files, folder)?;
        }
        // It insists by panics.
        match exercise::exercise(files.bytes()) {
            (true, _) => Ok(Verdict::Read),
            (false, _) => Ok(Verdict::Refused(format!("{}: refused", files.name()))),
        }
    }
}
