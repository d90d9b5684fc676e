//! A picture and a ray, from nothing: makes a small scene, renders a frame of it, traces a ray.
//!
//! ```text
//! cargo run --release --example minimal
//! ```

use anyhow::{Context, Result};
use brickwalk::Settings;
use brickwalk::scene::Camera;
use brickwalk::session::{Ray, Session};
use brickwalk::settings::{CacheSize, Effect, EffectList, ImageSize};
use brickwalk_convert::build::{BuildSettings, build};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::Primitive;
use brickwalk_scenes::one_mesh;
use glam::DVec3;
use std::path::Path;

fn main() -> Result<()> {
    let folder = std::env::temp_dir().join("brickwalk-minimal");
    std::fs::create_dir_all(&folder)?;

    // A scene is converted once into bricks, in one file.
    let file = folder.join("steps.bricks");
    convert(&file)?;

    // Everything that can be chosen has a default.
    let settings = Settings {
        size: ImageSize { width: 640, height: 360 },
        effects: EffectList::of(&[Effect::Shadow, Effect::Ao]),
        cache: CacheSize::Percent(100.0),
        spp: 4,
        ..Settings::default()
    };
    let mut session = Session::open(&file, &settings)?;

    // A picture.
    let camera = Camera {
        position: DVec3::new(4.0, 3.0, 6.0),
        target: DVec3::new(0.0, 0.8, 0.0),
        up: DVec3::Y,
        fov_y: 40f64.to_radians(),
    };
    let frame = session.frame(&camera)?;
    let picture = folder.join("steps.png");
    frame.write_png(&picture)?;
    println!("picture: {}", picture.display());
    for record in &frame.records {
        println!("  {}: {} rays in {:.1} ms", record.pass, record.rays(), record.ms);
    }

    // A ray, straight down onto the highest step.
    let down = Ray { origin: [0.0, 10.0, -1.5], direction: [0.0, -1.0, 0.0], t_min: 0.0, t_max: f64::INFINITY };
    let hits = session.trace(&[down], false)?;
    let hit = hits.first().context("one hit a ray")?;
    println!("ray: hits triangle {} at a distance of {}", hit.triangle, hit.t);
    Ok(())
}

/// Writes a floor with four steps on it.
fn convert(file: &Path) -> Result<()> {
    let mut steps = Primitive::default();
    add_box(&mut steps, [-4.0, -0.2, -4.0], [4.0, 0.0, 4.0]);
    for step in 0..4 {
        let (front, top) = (1.0 - f64::from(step), 0.4 * f64::from(step + 1));
        add_box(&mut steps, [-1.5, 0.0, front - 1.0], [1.5, top, front]);
    }
    build(one_mesh("steps", steps), &BuildSettings::default(), file, &Progress::hidden())?;
    Ok(())
}

/// Adds the twelve triangles of a box.
fn add_box(mesh: &mut Primitive, min: [f64; 3], max: [f64; 3]) {
    let first = mesh.positions.len() as u32;
    let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 0 { min[axis] } else { max[axis] });
    mesh.positions.extend((0..8).map(corner));
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    for [a, b, c, d] in faces {
        mesh.indices.extend([a, b, c, a, c, d].map(|corner| first + corner));
    }
}
