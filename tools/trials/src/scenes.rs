//! Small scenes that follow from a number, and what is rendered of them.

use crate::kind::Fault;
use crate::random::Random;
use anyhow::{Context, Result};
use bricks::SceneFile;
use brickwalk::Settings;
use brickwalk::frame::{Pixels, Renderer};
use brickwalk::scene::framing::path_from_bounds;
use brickwalk::session::opened::Opened;
use brickwalk::session::renderer::renderer;
use brickwalk::settings::{Adapter, Group};
use brickwalk_convert::build::{BuildSettings, LatticeStep, TextureEncoding, build};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{SourceScene, SourceTexture};
use brickwalk_scenes::{SoupKind, Stiff, rotated_instances, soup, stiff};
use std::path::Path;
use std::sync::Arc;

/// A source, and the step of the lattice that it needs, where it needs one.
pub struct Source {
    /// The source.
    pub scene: SourceScene,
    /// The step.
    pub lattice: Option<LatticeStep>,
}

/// A source of at most some thousand triangles: soups, instances, and what is stiff; a quarter of them with holes.
pub fn source(random: &mut Random) -> Source {
    let (most, seed) = (random.pick([12, 100, 1500]), random.word() >> 32);
    let count = random.within(1, most);
    let (mut scene, lattice) = match random.below(8) {
        0..=3 => {
            let kind = random.pick([SoupKind::Uniform, SoupKind::Clustered, SoupKind::Slivers]);
            (soup(kind, count as u32, seed), None)
        }
        4 => (rotated_instances(seed), None),
        _ => {
            let kind = random.pick(Stiff::ALL);
            (stiff(kind, kind.size_of(count as u64), seed), kind.lattice_log2())
        }
    };
    if random.chance(25) {
        cut_out(random, &mut scene);
    }
    Source { scene, lattice: lattice.map(LatticeStep::Log2) }
}

/// Gives every triangle holes, by an alpha that varies over it.
fn cut_out(random: &mut Random, scene: &mut SourceScene) {
    let mut coordinate = || (3.0 * random.share() - 1.0) as f32;
    for primitive in scene.meshes.iter_mut().flat_map(|mesh| &mut mesh.primitives) {
        primitive.uvs = Some(primitive.positions.iter().map(|_| [coordinate(), coordinate()]).collect());
    }
    for material in &mut scene.materials {
        material.base_color_texture = 0;
        material.alpha_cutoff = 0.5;
        material.flags |= bricks::MATERIAL_MASK;
    }
    let rgba = (0..13 * 8).flat_map(|_| [90, 120, 50, random.word() as u8]).collect();
    let wrap = bricks::WRAP_REPEAT | bricks::WRAP_MIRROR << 16;
    scene.textures = vec![SourceTexture { name: "cloth".into(), width: 13, height: 8, wrap, rgba }];
}

/// Settings that a source is converted with.
pub fn settings(random: &mut Random, source: &Source) -> BuildSettings {
    BuildSettings {
        brick_triangles: random.pick([4, 32, 256, 4096]),
        threads: Some(1),
        lattice: source.lattice,
        instance_min_triangles: random.pick([1, 64, 4096]),
        textures: random.pick([TextureEncoding::Bc7, TextureEncoding::Raw]),
        fast: random.chance(20),
        ..BuildSettings::default()
    }
}

/// Converts a source to `file`.
///
/// # Errors
/// It could not be: a finding.
pub fn convert(source: SourceScene, settings: &BuildSettings, file: &Path) -> Result<(), Fault> {
    let built = build(source, settings, file, &Progress::hidden());
    built.map(|_| ()).map_err(|error| Fault::new("a sound source is refused", format!("{error:#}")))
}

/// Everything but the schedule that a picture of a small scene is made with.
pub fn view(random: &mut Random) -> String {
    let size = random.pick(["24x16", "33x17", "48x32"]);
    let effects = random.pick(["shadow", "shadow,ao", "shadow,diffuse", "ao,glossy", "shadow,ao,diffuse,glossy"]);
    let light = random.pick(["", "--environment sky", "--rect-light 0,60,0,9,0,0,0,0,9", "--rotation full"]);
    let (samples, seed) = (random.pick([1, 1, 2]), random.below(1000));
    format!("--size {size} --aov --effects {effects} --spp {samples} --seed {seed} --ao-rays 2 {light}")
}

/// A schedule: what changes no picture.
pub fn schedule(random: &mut Random) -> String {
    let schedule = random.pick(["plain", "demand", "chc", "chc", "chc", "auto", "plain-bvh2"]);
    let plain = schedule.starts_with("plain");
    let cache = if plain { "100%" } else { random.pick(["1%", "20%", "60%", "100%"]) };
    let mut words = format!("--schedule {schedule} --cache {cache}");
    let mut add = |word: &str| {
        words.push(' ');
        words.push_str(word);
    };
    if !plain {
        add(random.pick(["", "--evict lru", "--evict round-robin"]));
        add(random.pick(["", "--host-cache 0", "--host-cache 1M"]));
    }
    if schedule == "chc" {
        add(random.pick(["", "--fronts on", "--fronts off"]));
    }
    add(random.pick(["", "--tile 8", "--tile 16"]));
    add(random.pick(["", "--workers 1", "--workers 3"]));
    words
}

/// Opens a scene on the processor; `options` are those of `walk`.
///
/// # Errors
/// It cannot be.
pub fn open(file: Arc<SceneFile>, name: &Path, options: &str) -> Result<Renderer> {
    let mut settings = Settings { adapter: Adapter::Cpu, ..Settings::exact() };
    settings.set_options(options).with_context(|| options.to_owned())?;
    let opened = Opened::open(file, name, &settings)?;
    renderer(opened, name, &settings)
}

/// Frames of the path around a scene.
///
/// # Errors
/// They cannot be rendered.
pub fn frames(renderer: &mut Renderer, count: u32) -> Result<Vec<Pixels>> {
    (0..count).map(|number| frame(renderer, number, count)).collect()
}

/// A frame of the path around a scene.
///
/// # Errors
/// It cannot be rendered.
pub fn frame(renderer: &mut Renderer, number: u32, count: u32) -> Result<Pixels> {
    let manifest = &renderer.scene.resident().manifest;
    let path = path_from_bounds(manifest.min, manifest.max);
    Ok(renderer.frame(number, &path.frame(number, count))?.pixels)
}

/// What pixels are compared by: every bit.
pub fn bits(pixels: &Pixels) -> Vec<u32> {
    let three = [&pixels.radiance, &pixels.normal, &pixels.albedo].into_iter().flatten().flatten();
    let one = three.chain(&pixels.depth).map(|value| value.to_bits());
    one.chain(pixels.id.iter().copied()).collect()
}
