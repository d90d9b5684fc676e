//! What every imported file promises, and what is built of it.

use super::{Files, Verdict, bricks_file};
use crate::kind::Fault;
use crate::random::Random;
use brickwalk_convert::build::{BuildSettings, build, build_source};
use brickwalk_convert::import::{ImportSettings, Imported, Input, Up, import, load_all};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::SourceScene;
use std::path::{Component, Path};

/// Most triangles for a byte of the input, but of inputs with compressed geometry.
pub const TRIANGLES_A_BYTE: u64 = 64;

/// What is imported is built in so many of 100 cases: that takes ten times as long.
const BUILT: usize = 6;

/// Most triangles of what is built.
const MOST_BUILT: u64 = 4096;

/// Imports the files, judges the scene, and builds some.
///
/// # Errors
/// The scene breaks a promise.
pub fn read(random: &mut Random, files: &Files, folder: &Path, a_byte: u64) -> Result<Verdict, Fault> {
    // Files of the same names lie beside the model's folder, which may be read or not.
    let own = folder.join("model");
    let path = files.write(&own)?;
    if random.chance(20) {
        files.write(folder)?;
    }
    let within = random.chance(20).then(|| folder.to_owned());
    let root = within.clone().unwrap_or(own);
    let movable = if random.chance(10) { vec!["a*".to_owned()] } else { Vec::new() };
    let settings = ImportSettings { scratch: Some(folder.into()), movable, ..ImportSettings::default() };
    let up = random.pick([None, None, Some(Up::Y), Some(Up::Z)]);
    let input = Input { up, within, ..Input::from(path) };
    if random.chance(5) {
        another_scene(random, &input, &settings)?;
    }
    let opened = match import(&[input], &settings, &Progress::hidden()) {
        Ok(opened) => opened,
        Err(error) => return Ok(Verdict::Refused(error.to_string())),
    };
    stays_within(&opened, &root)?;
    let scene = match load_all(&opened) {
        Ok(scene) => scene,
        Err(error) => return Ok(Verdict::Refused(error.to_string())),
    };
    judge(&scene, files.length(), a_byte)?;
    let triangles: u64 = scene.placements.iter().map(|p| scene.meshes[p.mesh as usize].triangle_count()).sum();
    if triangles <= MOST_BUILT && random.chance(BUILT) {
        return built(random, &opened, scene, folder, files.name());
    }
    Ok(Verdict::Read)
}

/// Whether nothing was looked for outside `root`.
fn stays_within(opened: &Imported, root: &Path) -> Result<(), Fault> {
    let is_within = |path: &Path| {
        path.strip_prefix(root).is_ok_and(|below| below.components().all(|part| matches!(part, Component::Normal(_))))
    };
    match opened.files().iter().find(|file| !is_within(&file.path)) {
        Some(file) => Err(Fault::new("a reference leads out of the folder", file.path.display().to_string())),
        None => Ok(()),
    }
}

/// Asks for a scene that is there or not: which, a refusal says in one line.
fn another_scene(random: &mut Random, input: &Input, settings: &ImportSettings) -> Result<(), Fault> {
    let scene = random.pick(["0", "1", "first", "", "999999999999999999999"]).to_owned();
    let input = Input { scene: Some(scene), ..input.clone() };
    match import(&[input], settings, &Progress::hidden()) {
        Err(error) if error.to_string().contains('\n') => {
            Err(Fault::new("a refusal is not one line", error.to_string()))
        }
        _ => Ok(()),
    }
}

/// Whether a scene that was imported of so many bytes may be indexed freely.
fn judge(scene: &SourceScene, bytes: u64, a_byte: u64) -> Result<(), Fault> {
    let wrong = |what: &str| Fault::new("an imported scene breaks a promise", what);
    let triangles: u64 = scene.meshes.iter().map(|mesh| mesh.triangle_count()).sum();
    if triangles > a_byte.saturating_mul(bytes) {
        return Err(wrong(&format!("{triangles} triangles of {bytes} bytes")));
    }
    if scene.placements.len() as u64 > a_byte.saturating_mul(bytes) {
        return Err(wrong(&format!("{} placements of {bytes} bytes", scene.placements.len())));
    }
    for primitive in scene.meshes.iter().flat_map(|mesh| &mesh.primitives) {
        let (vertices, corners) = (primitive.positions.len(), primitive.indices.len());
        let is_of_vertices = |length: Option<usize>| length.is_none_or(|length| length == vertices);
        let is_sound = primitive.indices.iter().all(|&index| (index as usize) < vertices)
            && corners.is_multiple_of(3)
            && is_of_vertices(primitive.normals.as_ref().map(Vec::len))
            && is_of_vertices(primitive.uvs.as_ref().map(Vec::len))
            && is_of_vertices(primitive.uvs1.as_ref().map(Vec::len))
            && is_of_vertices(primitive.colors.as_ref().map(Vec::len))
            && primitive.tangents.as_ref().is_none_or(|tangents| tangents.len() == corners)
            && (primitive.material as usize) < scene.materials.len();
        if !is_sound {
            return Err(wrong("a primitive's lists do not fit together"));
        }
    }
    if !scene.placements.iter().all(|placement| (placement.mesh as usize) < scene.meshes.len()) {
        return Err(wrong("a placement is of no mesh"));
    }
    if !scene.textures.iter().all(|t| t.rgba.len() as u64 == 4 * u64::from(t.width) * u64::from(t.height)) {
        return Err(wrong("a texture has another number of texels than its size says"));
    }
    let is_line = |line: &String| !line.contains('\n') && line.chars().count() < 2000;
    if !scene.warnings.iter().all(is_line) {
        return Err(wrong(&format!("a warning is not one line: {:?}", scene.warnings)));
    }
    Ok(())
}

/// Builds a scene file of what was imported, as it was opened or loaded, and reads all of that.
fn built(
    random: &mut Random,
    opened: &Imported,
    scene: SourceScene,
    folder: &Path,
    name: &str,
) -> Result<Verdict, Fault> {
    let output = folder.join("built.bricks");
    let settings = BuildSettings {
        brick_triangles: random.pick([4, 64, 16384]),
        threads: Some(1),
        drop_non_finite: random.chance(50),
        instance_min_triangles: random.pick([1, 1000]),
        lod: random.chance(30),
        ..BuildSettings::default()
    };
    let progress = Progress::hidden();
    let made = match random.chance(50) {
        true => build_source(opened, &settings, &output, &progress),
        false => build(scene, &settings, &output, &progress),
    };
    if let Err(error) = made {
        // What cannot be built names a place in the scene; the command names the file.
        return Ok(Verdict::Refused(format!("{name}: {error}")));
    }
    let bytes = std::fs::read(&output);
    let bytes = bytes.map_err(|error| Fault::new("what was built cannot be read", error.to_string()))?;
    if !bricks_file::exercise::exercise(&bytes).0 {
        return Err(Fault::new("what was built does not open", format!("{} bytes", bytes.len())));
    }
    Ok(Verdict::Read)
}
