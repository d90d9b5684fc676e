//! The probe's scene file is what the converter makes of the scene below. `BRICKWALK_REGENERATE_PROBE=1` writes it
//! anew.

use crate::kernels::layout::{BRICK_INDEX32, BRICK_WIDE};
use crate::math::random::Rng;
use bricks::SceneFile;
use brickwalk_convert::build::{BuildSettings, LatticeStep, build};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{IDENTITY, Mesh, Placement, Primitive, SourceScene};

impl Rng {
    /// A number in -1..1, a multiple of 2^-20.
    fn coordinate(&mut self) -> f64 {
        (self.bits() >> 43) as f64 / f64::from(1 << 20) - 1.0
    }

    fn point(&mut self, size: f64) -> [f64; 3] {
        [0; 3].map(|_| self.coordinate() * size)
    }
}

fn mesh(name: &str, positions: Vec<[f64; 3]>, indices: Vec<u32>) -> Mesh {
    Mesh { name: name.into(), primitives: vec![Primitive { positions, indices, ..Primitive::default() }] }
}

/// A quad in the plane where axis `k` is `at`: two triangles over `low..high` of the other axes, cut along either
/// diagonal.
fn quad(corners: &mut Vec<[f64; 3]>, k: usize, at: f64, low: [f64; 2], high: [f64; 2], other: bool) {
    let point = |x: f64, y: f64| {
        let mut p = [at; 3];
        (p[(k + 1) % 3], p[(k + 2) % 3]) = (x, y);
        p
    };
    let p = [point(low[0], low[1]), point(high[0], low[1]), point(high[0], high[1]), point(low[0], high[1])];
    let cut = if other { [0, 1, 3, 1, 2, 3] } else { [0, 1, 2, 0, 2, 3] };
    corners.extend(cut.map(|i| p[i]));
}

/// Tiles on three planes across the axes, some of them twice and cut both ways; slivers; a soup; a ground so large that
/// its brick is wide, in the plane of the tiles.
fn world() -> Mesh {
    let mut rng = Rng(3);
    let mut corners = Vec::new();
    for k in 0..3 {
        for i in 0..9 {
            let low = [f64::from(i % 3) - 1.5, f64::from(i / 3) - 1.5];
            let at = [-2.0, 0.0, -1.75][k];
            quad(&mut corners, k, at, low, low.map(|x| x + 1.0), false);
            if i % 3 == 1 {
                quad(&mut corners, k, at, low, low.map(|x| x + 1.0), i == 4);
            }
        }
    }
    for _ in 0..30 {
        let (p, along) = (rng.point(1.5), rng.point(1.0));
        let across = rng.point(0.002);
        corners.extend([p, [0, 1, 2].map(|k| p[k] + along[k]), [0, 1, 2].map(|k| p[k] + 0.4 * along[k] + across[k])]);
    }
    for _ in 0..50 {
        let p = rng.point(2.0);
        let (a, b) = (rng.point(0.5), rng.point(0.5));
        corners.extend([p, [0, 1, 2].map(|k| p[k] + a[k]), [0, 1, 2].map(|k| p[k] + b[k])]);
    }
    quad(&mut corners, 1, 0.0, [-60.0, -70.0], [50.0, 65.0], false);
    let indices = (0..corners.len() as u32).collect();
    mesh("world", corners, indices)
}

/// An octahedron divided twice, its vertices moved in and out: closed, 128 triangles with shared vertices.
fn ball() -> Mesh {
    let mut rng = Rng(4);
    let mut points: Vec<[f64; 3]> =
        vec![[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]];
    let mut faces: Vec<[u32; 3]> =
        vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    for _ in 0..2 {
        let mut middle = |a: u32, b: u32| {
            let (p, q) = (points[a as usize], points[b as usize]);
            let sum = [0, 1, 2].map(|k| p[k] + q[k]);
            let length = sum.iter().map(|x| x * x).sum::<f64>().sqrt();
            let point = sum.map(|x| x / length);
            let known = points.iter().position(|&p| p == point);
            known.unwrap_or_else(|| {
                points.push(point);
                points.len() - 1
            }) as u32
        };
        let divide = |&[a, b, c]: &[u32; 3]| {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        faces = faces.iter().flat_map(divide).collect();
    }
    let bumpy = points.iter().map(|p| {
        let radius = 1.0 + 0.1 * rng.coordinate();
        p.map(|x| x * radius)
    });
    mesh("ball", bumpy.collect(), faces.into_iter().flatten().collect())
}

fn source() -> SourceScene {
    let place = |name: &str, mesh, world_from_mesh| Placement {
        name: name.into(),
        mesh,
        source: 0,
        world_from_mesh,
        ..Placement::default()
    };
    let material =
        bricks::Material { base_color: [1.0; 4], base_color_texture: bricks::NONE, ..bricks::Material::DIFFUSE };
    SourceScene {
        meshes: vec![world(), ball()],
        placements: vec![
            // Turned about y by atan(4/3) and scaled; mirrored in x, uneven; moved; turned about x and into the first.
            place("turned", 1, [0.75, 0.0, 1.0, 0.75, 0.0, 1.25, 0.0, 0.5, -1.0, 0.0, 0.75, -0.25]),
            place("world", 0, IDENTITY),
            place("mirrored", 1, [-0.5, 0.0, 0.0, -1.0, 0.0, 0.8, 0.1, 0.25, 0.2, 0.0, 0.7, 1.0]),
            place("moved", 1, [1.0, 0.0, 0.0, -0.5, 0.0, 1.0, 0.0, -0.75, 0.0, 0.0, 1.0, 0.5]),
            place("overlapping", 1, [0.9, 0.0, 0.0, 1.0, 0.0, 0.28, -0.96, 0.75, 0.0, 0.96, 0.28, -0.5]),
        ],
        materials: vec![material],
        sources: vec![bricks::Source { name: "probe".into(), bytes: 0, hash: "2d06800538d394c2".into() }],
        ..SourceScene::default()
    }
}

#[test]
fn the_scene_is_what_the_converter_makes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.bricks");
    let settings = BuildSettings {
        brick_triangles: 64,
        instance_min_triangles: 1,
        // Pipelines traverse; they never read a proxy.
        proxies: false,
        // Fine enough for the ground to lie beyond 2^24 steps.
        lattice: Some(LatticeStep::Log2(-20)),
        ..BuildSettings::default()
    };
    build(source(), &settings, &path, &Progress::hidden()).unwrap();
    let made = std::fs::read(&path).unwrap();
    let committed = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src/gpu/probe/scene.bricks");
    if std::env::var_os("BRICKWALK_REGENERATE_PROBE").is_some() {
        std::fs::write(&committed, &made).unwrap();
    }
    let found = std::fs::read(&committed).unwrap();
    assert!(found == made, "the converter's bytes are not those of {}", committed.display());
    let file = SceneFile::open(&committed).unwrap();
    assert!(file.verify(&mut |_, _| {}).unwrap().is_ok());
    let resident = file.resident();
    println!("{} bytes, {} bricks, {} leaves", made.len(), resident.bricks.len(), resident.leaves.len());
    assert!(made.len() <= 64 << 10, "{} bytes", made.len());
    assert!(resident.top8.len() > 1 && resident.instances.len() == 5);
    assert!(resident.instances.iter().any(|i| i.flags & bricks::INSTANCE_MIRRORED != 0));
    let wide = resident.bricks.iter().filter(|b| b.flags & BRICK_WIDE != 0).count();
    assert!((1..resident.bricks.len()).contains(&wide), "{wide} wide bricks");
    // A brick of more than 65,536 vertices would not fit.
    assert!(resident.bricks.iter().all(|b| b.flags & BRICK_INDEX32 == 0));
    assert!(resident.bricks.iter().any(|b| b.node_count > 8), "bricks are deeper than two nodes");
}
