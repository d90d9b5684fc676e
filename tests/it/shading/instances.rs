//! Instances and copies baked into the world shade alike, whatever their matrix: normals and tangents of vertices are
//! unit vectors in the world before they are interpolated, as rasterisers have them of glTF.

use crate::common;
use bricks::{MATERIAL_DOUBLE_SIDED, Material};
use brickwalk::metrics::{Image, PIXELS_PER_DEGREE, flip_ldr};
use brickwalk::scene::Camera;
use brickwalk::schedule::Pass;
use brickwalk::session::opened::{Opened, open_scene};
use brickwalk::session::renderer::renderer;
use brickwalk_convert::build::{BuildSettings, TextureEncoding, build};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{Mesh, Placement, Primitive, SourceScene, SourceTexture};
use glam::{DMat3, DVec3};

const SIDE: u32 = 96;

/// Eight triangles about the origin, with normals from it and tangents around the axis.
fn ball() -> Primitive {
    let corners = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z];
    let indices: Vec<u32> = (0..8u32)
        .flat_map(|octant| {
            let [x, y, z] = [0, 1, 2].map(|k| k + 3 * (octant >> k & 1));
            if octant.count_ones() % 2 == 0 { [x, y, z] } else { [x, z, y] }
        })
        .collect();
    // Neither along an axis, nor where a normal is.
    let tangent = |n: DVec3| n.cross(DVec3::new(0.3, -0.5, 0.81)).as_vec3().extend(1.0).to_array();
    Primitive {
        positions: corners.map(|p| p.to_array()).to_vec(),
        normals: Some(corners.map(|n| n.as_vec3().to_array()).to_vec()),
        uvs: Some(corners.map(|p| [p.x as f32, p.y as f32]).to_vec()),
        tangents: Some(indices.iter().map(|&i| tangent(corners[i as usize])).collect()),
        indices,
        ..Primitive::default()
    }
}

/// What a picture of the ball shows, of the first of its two places.
struct Shown {
    radiance: Vec<[f32; 3]>,
    /// Interpolated, or turned by the texture; zero on a miss.
    normals: Vec<DVec3>,
    /// Mesh-local triangle and weights of its second and third vertex; `None` on a miss.
    hits: Vec<Option<(u32, f64, f64)>>,
}

fn shown(linear: DMat3, bumpy: bool, is_instance: bool) -> Shown {
    let rows = linear.transpose();
    let place = |x: f64| {
        let [a, b, c] = [rows.x_axis, rows.y_axis, rows.z_axis].map(|row| row.to_array());
        [a[0], a[1], a[2], x, b[0], b[1], b[2], 0.0, c[0], c[1], c[2], 0.0]
    };
    let placed = |x| Placement { name: "p".into(), world_from_mesh: place(x), ..Placement::default() };
    let material = Material {
        flags: MATERIAL_DOUBLE_SIDED,
        normal_texture: if bumpy { 0 } else { bricks::NONE },
        ..Material::DIFFUSE
    };
    let texture = SourceTexture {
        name: "tilt".into(),
        width: 1,
        height: 1,
        rgba: vec![200, 150, 210, 255],
        ..SourceTexture::default()
    };
    let source = SourceScene {
        meshes: vec![Mesh { name: "ball".into(), primitives: vec![ball()] }],
        placements: vec![placed(0.0), placed(50.0)],
        materials: vec![material],
        textures: vec![texture],
        sources: vec![bricks::Source { name: "t".into(), bytes: 0, hash: "2d06800538d394c2".into() }],
        ..SourceScene::default()
    };
    let folder = common::folder();
    let path = folder.path().join("scene.bricks");
    let build_settings = BuildSettings {
        instance_min_triangles: if is_instance { 1 } else { 1000 },
        textures: TextureEncoding::Raw,
        ..BuildSettings::default()
    };
    let summary = build(source, &build_settings, &path, &Progress::hidden()).expect("a scene");
    assert_eq!(summary.instances, if is_instance { 2 } else { 0 });
    let options = "--adapter cpu --cache 100% --frames 1 --effects primary --sky-intensity 0.2 --sun 0.5,0.6,0.62";
    let settings = common::settings(&format!("--size {SIDE}x{SIDE} {options}"));
    let opened = Opened::open(open_scene(&path).expect("the scene"), &path, &settings).expect("a session");
    let mut renderer = renderer(opened, &path, &settings).expect("lamps");
    let camera =
        Camera { position: DVec3::new(2.0, 3.0, 16.0), target: DVec3::ZERO, up: DVec3::Y, fov_y: 36f64.to_radians() };
    let radiance = renderer.frame(0, &camera).expect("a frame").pixels.radiance;
    let gbuffer = renderer.executor.read_gbuffer().expect("a G-buffer");
    let hits = renderer.executor.read_hits(Pass::Primary).expect("hits");
    let weights = |k: usize| gbuffer[k].weights.map(f64::from);
    Shown {
        radiance,
        normals: gbuffer.iter().map(|g| DVec3::from_array(g.normal.map(f64::from))).collect(),
        hits: (0..hits.len())
            .map(|k| (hits[k].id < 16).then(|| (hits[k].id % 8, weights(k)[0], weights(k)[1])))
            .collect(),
    }
}

/// The greatest angle between two directions of the same pixel, degrees, where both pictures see the same triangle.
fn apart(a: &Shown, b: impl Fn(usize) -> Option<DVec3>) -> f64 {
    let angle = |k: usize| b(k).map(|n| a.normals[k].angle_between(n).to_degrees());
    let angles: Vec<f64> = (0..a.normals.len()).filter(|&k| a.hits[k].is_some()).filter_map(angle).collect();
    assert!(angles.len() > 500, "{} pixels", angles.len());
    angles.into_iter().fold(0.0, f64::max)
}

#[test]
fn stretched_instances_shade_as_copies_that_were_baked() {
    let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.7);
    let linear = turn * DMat3::from_diagonal(DVec3::new(1.0, 2.0, 5.0));
    let image = |s: &Shown| Image::from_fn(SIDE as usize, SIDE as usize, |x, y| s.radiance[y * SIDE as usize + x]);
    for bumpy in [false, true] {
        let [instance, baked] = [true, false].map(|is_instance| shown(linear, bumpy, is_instance));
        let both = |k: usize| {
            let same = matches!((instance.hits[k], baked.hits[k]), (Some(a), Some(b)) if a.0 == b.0);
            same.then_some(baked.normals[k])
        };
        // Sixteen bits a component, stretched by five.
        let angle = apart(&instance, both);
        assert!(angle < 0.05, "{angle} degrees, bumpy: {bumpy}");
        let flip = flip_ldr(&image(&instance), &image(&baked), PIXELS_PER_DEGREE).expect("one size").mean();
        assert!(flip < 1e-4, "FLIP {flip}, bumpy: {bumpy}");
    }
    // Of the ball itself the rule is known; control: interpolating first would show.
    let instance = shown(linear, false, true);
    let inverse = linear.inverse().transpose();
    let primitive = ball();
    let corners = primitive.normals.as_ref().expect("normals");
    let by = |k: usize, first: fn(DMat3, DVec3) -> DVec3, last: fn(DMat3, DVec3) -> DVec3| {
        let (triangle, v, w) = instance.hits[k]?;
        let corner = |i: usize| {
            let n = corners[primitive.indices[3 * triangle as usize + i] as usize].map(f64::from);
            first(inverse, DVec3::from_array(n))
        };
        Some(last(inverse, (1.0 - v - w) * corner(0) + v * corner(1) + w * corner(2)).normalize())
    };
    let angle = apart(&instance, |k| by(k, |m, n| (m * n).normalize(), |_, n| n));
    assert!(angle < 0.05, "{angle} degrees from the rule");
    let control = apart(&instance, |k| by(k, |_, n| n, |m, n| m * n));
    assert!(control > 5.0, "interpolating in the object must show: {control} degrees");
}
