//! The EXR layers of a walk against truth: rays made here in f64 from the camera path's definition, hits by exact
//! predicates.

use crate::common;
use brickwalk::metrics::{Channel, load};
use brickwalk::reference::{Truth, TruthRay};
use brickwalk::session::open_scene;
use glam::DVec3;

const WIDTH: usize = 64;
const HEIGHT: usize = 40;
const NO_ID: u32 = u32::MAX;
/// 2^-24.
const U: f64 = 1.0 / 16_777_216.0;

fn floats<'a>(channels: &'a std::collections::BTreeMap<String, Channel>, name: &str) -> &'a [f32] {
    match &channels[name] {
        Channel::Float(values) => values,
        Channel::Integer(_) => panic!("{name} holds floats"),
    }
}

/// Normal of the plane of a triangle.
fn normal(vertices: [[f64; 3]; 3]) -> DVec3 {
    let [a, b, c] = vertices.map(DVec3::from_array);
    (b - a).cross(c - a).normalize()
}

#[test]
fn layers_hold_what_the_rays_of_the_path_meet() {
    let folder = common::folder();
    let scene = common::city(folder.path(), "100K", "1K");
    let (position, target) = (DVec3::new(3.0, 9.0, 2.0), DVec3::new(40.0, 4.0, 25.0));
    let path = folder.path().join("path.json");
    let keyframe = serde_json::json!({ "time": 0.0, "position": position.to_array(), "target": target.to_array() });
    let json = serde_json::json!({ "fov_y_degrees": 70, "up": [0, 1, 0], "keyframes": [keyframe] });
    std::fs::write(&path, json.to_string()).expect("a path");
    let out = folder.path().join("out");
    let options = format!("--frames 1 --size {WIDTH}x{HEIGHT} --tile 16 --cache 30% --aov --path {}", path.display());
    common::walk(&scene, &out, &options);
    let channels = load(out.join("frames/0000.exr")).expect("an EXR").channels;
    let Channel::Integer(ids) = &channels["triangle.id"] else { panic!("triangle.id is an integer") };
    let depth = floats(&channels, "depth.Z");
    let normals = ["normal.X", "normal.Y", "normal.Z"].map(|name| floats(&channels, name));

    let truth = Truth::load(&open_scene(&scene).expect("the scene")).expect("truth");
    let forward = (target - position).normalize();
    let right = forward.cross(DVec3::Y).normalize();
    let up = right.cross(forward);
    let tangent = 35f64.to_radians().tan();
    let (mut hits, mut misses, mut different, mut shifted) = (0, 0, 0, 0);
    for pixel in 0..WIDTH * HEIGHT {
        let (x, y) = ((pixel % WIDTH) as f64 + 0.5, (pixel / WIDTH) as f64 + 0.5);
        let half = [WIDTH as f64 / 2.0, HEIGHT as f64 / 2.0];
        let across = (x - half[0]) / half[1] * tangent * right;
        let direction = (forward + across - (y - half[1]) / half[1] * tangent * up).normalize();
        let ray = TruthRay::new(position.to_array(), direction.to_array(), 0.0, f64::INFINITY);
        let met = truth.closest(&ray);
        // Negative control: the layers of a neighbour.
        shifted += usize::from(ids[(pixel + 1) % ids.len()] != met.as_ref().map_or(NO_ID, |hit| hit.id));
        let Some(hit) = met else {
            misses += usize::from(ids[pixel] == NO_ID && depth[pixel] == f32::INFINITY);
            different += usize::from(ids[pixel] != NO_ID);
            continue;
        };
        if ids[pixel] != hit.id {
            different += 1;
            continue;
        }
        hits += 1;
        let n = normal(truth.vertices(hit.id).expect("a triangle"));
        let cosine = n.dot(direction).abs();
        // A component of the device's direction b + x dx + y dy is off by at most 13 u of its length, three of them by
        // 23 u; vertices and origin by 3 u of their distance from the reference point, which is within the scene's size
        // here.
        let bound = (23.0 * hit.t + 6.0 * 600.0) * U / cosine + U * hit.t;
        let error = (f64::from(depth[pixel]) - hit.t).abs();
        assert!(error <= bound, "pixel {pixel}: depth {} is not {} within {bound:e}", depth[pixel], hit.t);
        let found = DVec3::from_array([0, 1, 2].map(|k| f64::from(normals[k][pixel])));
        assert!((found.length() - 1.0).abs() < 4.0 * U, "pixel {pixel}: a unit normal, not {found}");
        assert!(found.dot(direction) <= 0.0, "pixel {pixel}: a normal toward the camera");
        assert!(found.cross(n).length() < 1e-3, "pixel {pixel}: normal {found} is not {n}");
    }
    println!("{hits} hits, {misses} misses, {different} different");
    assert!(hits > WIDTH * HEIGHT / 2 && misses > 20, "the view shows city and sky");
    // f32 rays pass edges on the other side: some of the distant pixels, whose triangles are smaller than the rays'
    // error.
    assert!(different * 100 <= WIDTH * HEIGHT, "{different} pixels show another triangle");
    assert!(shifted * 2 > WIDTH * HEIGHT, "control: neighbours differ in {shifted} pixels only");
}
