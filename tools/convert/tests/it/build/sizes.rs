//! What a triangle takes in the file.

use super::scenes::*;
use bricks::{AttributeLayout, Resident, SceneFile};
use brickwalk_convert::build::BuildSettings;
use brickwalk_convert::source::Primitive;

/// Most bytes of the file a triangle with a normal at each vertex, in meshes of at most [`SHARING`] vertices a
/// triangle.
const MOST_BYTES: f64 = 32.0;

/// Vertices a triangle of a mesh that is said to share its vertices, those on the edges of bricks counted in each.
const SHARING: f64 = 0.58;

/// A closed bumpy torus of `2 n m` triangles and half as many vertices, with smooth normals.
fn torus(n: u32, m: u32) -> Primitive {
    let mut random = Random(7);
    let mut primitive = Primitive { normals: Some(Vec::new()), ..Primitive::default() };
    for i in 0..n {
        for j in 0..m {
            let turn = |k: u32, n: u32| std::f64::consts::TAU * f64::from(k) / f64::from(n);
            let ((sin_a, cos_a), (sin_b, cos_b)) = (turn(i, n).sin_cos(), turn(j, m).sin_cos());
            let radius = 1.0 + 0.004 * random.next();
            let from_axis = 3.0 + radius * cos_b;
            primitive.positions.push([from_axis * cos_a, radius * sin_b, from_axis * sin_a]);
            // Of no unit length, and tilted by the bumps.
            let tilt = random.point(0.2);
            let normal = [cos_b * cos_a + tilt[0], sin_b + tilt[1], cos_b * sin_a + tilt[2]];
            primitive.normals.as_mut().unwrap().push(normal.map(|x| x as f32));
            let vertex = |i: u32, j: u32| i % n * m + j % m;
            let [a, b, c, d] = [vertex(i, j), vertex(i, j + 1), vertex(i + 1, j), vertex(i + 1, j + 1)];
            primitive.indices.extend([a, b, d, a, d, c]);
        }
    }
    primitive
}

/// Bytes of the file a triangle, proxies left out, and the same if attributes lay in it as they are loaded.
fn bytes_a_triangle(primitive: Primitive) -> (f64, f64) {
    let settings = BuildSettings { proxies: false, ..settings(16_384) };
    let file = built(&plain(vec![primitive]), &settings);
    let length = file.bytes().len() as u64;
    let scene = SceneFile::open(file.path()).unwrap();
    let Resident { bricks, .. } = scene.resident();
    let sum = |of: fn(&bricks::Brick) -> u64| bricks.iter().map(of).sum::<u64>();
    let triangles = sum(|brick| brick.triangle_count.into()) as f64;
    let sharing = sum(|brick| brick.vertex_count.into()) as f64 / triangles;
    assert!(triangles == 64_000.0 && sharing > 0.5 && sharing <= SHARING, "{sharing} vertices a triangle");
    let more = sum(|brick| AttributeLayout::of(brick).bytes) - sum(|brick| brick.attributes.bytes);
    (length as f64 / triangles, (length + more) as f64 / triangles)
}

#[test]
fn a_triangle_with_normals_takes_at_most_32_bytes() {
    let smooth = torus(200, 160);
    let (stored, loaded) = bytes_a_triangle(smooth.clone());
    assert!(stored <= MOST_BYTES && stored > 28.0, "{stored} bytes");
    assert!(loaded > MOST_BYTES, "the encoding is what keeps it small: {loaded} bytes without");

    // Negative control: texture coordinates without any repetition are 8 bytes a vertex more.
    let mut random = Random(8);
    let uvs = smooth.positions.iter().map(|_| [random.next() as f32, random.next() as f32]).collect();
    let (stored, _) = bytes_a_triangle(Primitive { uvs: Some(uvs), ..smooth.clone() });
    assert!(stored > MOST_BYTES, "{stored} bytes");

    // Without normals next to nothing is left of the attributes: the rotations, a quarter of a byte.
    let (stored, loaded) = bytes_a_triangle(Primitive { normals: None, ..smooth });
    assert!(stored < 26.5 && loaded > MOST_BYTES, "{stored} bytes, {loaded} loaded");
}
