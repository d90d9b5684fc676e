//! What every file of the shared scenes shows on its default path, and that mirrored nodes show their front.

use crate::common::{folder, settings, shared_scenes, succeed, walk};
use brickwalk::Session;
use brickwalk::metrics::{Channel, load};
use brickwalk::scene::Camera;
use glam::{DMat4, DVec3};
use std::path::{Path, PathBuf};

const WIDTH: usize = 48;
const HEIGHT: usize = 30;
const NO_ID: u32 = u32::MAX;

/// Folders of which every file is shown.
const FOLDERS: [&str; 5] = ["stress", "teapots_instanced", "sponza_draco", "scans", "city_buildings"];

/// Files that no reader of glTF 2.0 takes.
const REFUSED: [&str; 2] = ["Compatibility_04.gltf", "Compatibility_05.gltf"];

/// Files that have a test of their own, with large textures.
const MIRRORED: &str = "stress/asset-generator/Node_NegativeScale";

/// The middle frame of three on a default path.
struct Picture {
    camera: Camera,
    bounds: [DVec3; 2],
    /// Triangles that are stored, and triangle ids of all instances: dropped triangles keep theirs.
    triangles: u64,
    all_ids: u64,
    ids: Vec<u32>,
    depth: Vec<f32>,
    normals: [Vec<f32>; 3],
    radiance: [Vec<f32>; 3],
}

impl Picture {
    fn of(input: &Path, folder: &Path) -> Picture {
        let scene = folder.join("scene.bricks");
        succeed(["convert".as_ref(), input.as_os_str(), "-o".as_ref(), scene.as_os_str()]);
        let info = succeed(["info".as_ref(), scene.as_os_str(), "--json".as_ref()]);
        let info: serde_json::Value = serde_json::from_str(&info).expect("JSON");
        let corner = |name: &str| std::array::from_fn(|k| info[name][k].as_f64().expect("a coordinate"));
        let (min, max) = (corner("bounds_min"), corner("bounds_max"));
        let output = folder.join("out");
        walk(&scene, &output, &format!("--frames 3 --size {WIDTH}x{HEIGHT} --aov --cache 100% --schedule plain"));
        let mut channels = load(output.join("frames/0001.exr")).expect("an EXR").channels;
        let mut floats = |name: &str| match channels.remove(name) {
            Some(Channel::Float(values)) => values,
            other => panic!("{name}: {other:?}"),
        };
        let depth = floats("depth.Z");
        let normals = ["normal.X", "normal.Y", "normal.Z"].map(&mut floats);
        let radiance = ["R", "G", "B"].map(floats);
        let Some(Channel::Integer(ids)) = channels.remove("triangle.id") else { panic!("ids are integers") };
        let session = Session::open(&scene, &settings(&format!("--adapter cpu --size {WIDTH}x{HEIGHT}")));
        Picture {
            camera: session.expect("a session").path().frame(1, 3),
            bounds: [min, max].map(DVec3::from_array),
            triangles: info["triangles_stored"].as_u64().expect("a count"),
            all_ids: info["triangle_ids"].as_u64().expect("a count"),
            ids,
            depth,
            normals,
            radiance,
        }
    }

    /// The pixels that show a triangle, with the unit directions of their rays.
    fn hits(&self) -> impl Iterator<Item = (usize, DVec3)> + '_ {
        let basis = self.camera.ray_basis(WIDTH as u32, HEIGHT as u32);
        (0..WIDTH * HEIGHT).filter(|&pixel| self.ids[pixel] != NO_ID).map(move |pixel| {
            let (x, y) = ((pixel % WIDTH) as f64 + 0.5, (pixel / WIDTH) as f64 + 0.5);
            (pixel, basis.direction(x, y).normalize())
        })
    }

    /// What is not as it should be.
    fn problem(&self) -> Option<String> {
        let hits = self.hits().count();
        let pixels = WIDTH * HEIGHT;
        if self.triangles == 0 {
            return (hits > 0).then(|| format!("{hits} hits without a triangle"));
        }
        // The default path leaves an object a fiftieth of the picture at the very least.
        if hits * 50 < pixels {
            return Some(format!("{hits} of {pixels} pixels show something"));
        }
        let [min, max] = self.bounds;
        // Depth and direction are f32, the vertices lie half a step beyond the source's bounds at most: both are below
        // a thousandth of what is seen.
        let slack = 1e-3 * ((max - min).length() + (self.camera.position - 0.5 * (min + max)).length());
        for (pixel, direction) in self.hits() {
            let [n, radiance] = [&self.normals, &self.radiance].map(|c| c.each_ref().map(|c| f64::from(c[pixel])));
            let [n, radiance] = [n, radiance].map(DVec3::from_array);
            let point = self.camera.position + f64::from(self.depth[pixel]) * direction;
            if !point.cmpge(min - slack).all() || !point.cmple(max + slack).all() {
                return Some(format!("pixel {pixel} lies at {point}, outside {min} to {max}"));
            }
            if (n.length() - 1.0).abs() > 1e-5 || n.dot(direction) > 1e-6 {
                return Some(format!("pixel {pixel} has the normal {n} toward {direction}"));
            }
            if !radiance.is_finite() || radiance.min_element() < 0.0 {
                return Some(format!("pixel {pixel} has the radiance {radiance}"));
            }
            if u64::from(self.ids[pixel]) >= self.all_ids {
                return Some(format!("pixel {pixel} shows triangle {} of {}", self.ids[pixel], self.all_ids));
            }
        }
        let infinite = self.depth.iter().filter(|depth| depth.is_infinite()).count();
        (infinite != pixels - hits)
            .then(|| format!("{infinite} pixels without a depth, {} without a hit", pixels - hits))
    }
}

/// Scene files in and below `folder`, sorted.
fn scene_files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
        let path = entry.expect("an entry").path();
        let known = ["gltf", "glb", "obj", "ply", "stl"];
        if path.is_dir() {
            found.extend(scene_files(&path));
        } else if path.extension().is_some_and(|e| known.iter().any(|known| e == *known)) {
            found.push(path);
        }
    }
    found.sort();
    found
}

#[test]
fn every_file_shows_what_it_holds() {
    let Some(scenes) = shared_scenes() else { return };
    let folder = folder();
    let (mut shown, mut empty) = (0, 0);
    for input in FOLDERS.iter().flat_map(|folder| scene_files(&scenes.join(folder))) {
        let is_mirrored = input.parent().is_some_and(|folder| folder.ends_with(MIRRORED));
        if is_mirrored || REFUSED.iter().any(|refused| input.ends_with(refused)) {
            continue;
        }
        let mut picture = Picture::of(&input, folder.path());
        assert_eq!(picture.problem(), None, "{}", input.display());
        if picture.triangles == 0 {
            empty += 1;
            continue;
        }
        shown += 1;
        // Negative controls: elsewhere, from within, and nothing.
        let whole = picture.bounds;
        picture.bounds = whole.map(|corner| corner + 2.0 * (whole[1] - whole[0]).max(DVec3::splat(1.0)));
        assert!(picture.problem().is_some_and(|problem| problem.contains("outside")), "{}", input.display());
        picture.bounds = whole;
        picture.normals.iter_mut().flatten().for_each(|x| *x = -*x);
        assert!(picture.problem().is_some_and(|problem| problem.contains("normal")), "{}", input.display());
        picture.ids.fill(NO_ID);
        assert!(picture.problem().is_some_and(|problem| problem.starts_with("0 of")), "{}", input.display());
    }
    println!("{shown} files shown, {empty} without triangles");
    assert_eq!((shown, empty), (45, 8), "points and lines show nothing, everything else does");
}

/// Vertices of all triangles of a small glTF file with one buffer and no strides, read here: in the world, in their
/// order, by node, with the determinant of the node's matrix.
fn triangles(path: &Path) -> Vec<([DVec3; 3], f64)> {
    let json: serde_json::Value =
        serde_json::from_slice(&std::fs::read(path).expect("the file")).expect("a glTF file of the asset generator");
    let number = |value: &serde_json::Value| value.as_u64().unwrap_or(0) as usize;
    let uri = json["buffers"][0]["uri"].as_str().expect("a URI");
    let bytes = std::fs::read(path.with_file_name(uri)).expect("the buffer");
    let word = |accessor: usize, at: usize| {
        let view = &json["bufferViews"][number(&json["accessors"][accessor]["bufferView"])];
        let at = number(&view["byteOffset"]) + 4 * at;
        <[u8; 4]>::try_from(&bytes[at..at + 4]).expect("4 bytes")
    };
    let list = |value: &serde_json::Value| -> Option<Vec<f64>> {
        Some(value.as_array()?.iter().map(|x| x.as_f64().expect("a number")).collect())
    };
    let mut found = Vec::new();
    let mut world = DMat4::IDENTITY;
    // Node 1 is the child of node 0.
    for node in json["nodes"].as_array().expect("nodes") {
        let own = match list(&node["matrix"]) {
            Some(columns) => DMat4::from_cols_slice(&columns),
            None => {
                let vector = |name: &str, default| list(&node[name]).map_or(default, |v| DVec3::from_slice(&v));
                DMat4::from_translation(vector("translation", DVec3::ZERO))
                    * DMat4::from_scale(vector("scale", DVec3::ONE))
            }
        };
        world *= own;
        let primitive = &json["meshes"][number(&node["mesh"])]["primitives"][0];
        let (positions, indices) = (number(&primitive["attributes"]["POSITION"]), number(&primitive["indices"]));
        let corner = |at: usize| {
            let vertex = u32::from_le_bytes(word(indices, at)) as usize;
            let x = std::array::from_fn(|k| f64::from(f32::from_le_bytes(word(positions, 3 * vertex + k))));
            world.transform_point3(DVec3::from_array(x))
        };
        let count = number(&json["accessors"][indices]["count"]) / 3;
        found.extend((0..count).map(|t| ([0, 1, 2].map(|k| corner(3 * t + k)), world.determinant())));
    }
    found
}

/// The side from which a triangle of a node is seen: counter-clockwise in the mesh, so that a negative determinant
/// reverses it (glTF 2.0, section 3.7.4).
fn front([a, b, c]: [DVec3; 3], determinant: f64) -> DVec3 {
    (b - a).cross(c - a).normalize() * determinant.signum()
}

#[test]
fn mirrored_nodes_show_their_front() {
    let Some(scenes) = shared_scenes() else { return };
    let folder = folder();
    let mut reversed = 0;
    for file in 0..13 {
        let input = scenes.join(MIRRORED).join(format!("Node_NegativeScale_{file:02}.gltf"));
        let source = triangles(&input);
        assert_eq!(source.len(), 54);
        let picture = Picture::of(&input, folder.path());
        assert_eq!(picture.problem(), None, "{file}");
        let mut mirrored = 0;
        for (pixel, direction) in picture.hits() {
            let (corners, determinant) = source[picture.ids[pixel] as usize];
            let front = front(corners, determinant);
            // The depth is that of the source's own plane: f32 depths below 64, vertices half a step of 2^-16 off, seen
            // at no less than a twentieth of a right angle.
            let depth = (corners[0] - picture.camera.position).dot(front) / direction.dot(front);
            if direction.dot(front).abs() > 0.08 {
                let found = f64::from(picture.depth[pixel]);
                assert!((found - depth).abs() < 1e-3, "{file}: pixel {pixel} is {found} away, not {depth}");
            }
            assert!(
                front.dot(direction) < 0.0,
                "{file}: pixel {pixel} shows triangle {} from behind",
                picture.ids[pixel]
            );
            let normal = DVec3::from_array(picture.normals.each_ref().map(|c| f64::from(c[pixel])));
            assert!(normal.dot(front) > 0.999, "{file}: pixel {pixel} has the normal {normal}, not {front}");
            mirrored += usize::from(determinant < 0.0);
            // Negative control: the winding in the world as it comes, which a mirror reverses.
            let as_it_comes = front * determinant.signum();
            reversed += usize::from(as_it_comes.dot(direction) > 0.0);
        }
        let is_mirrored = source.iter().any(|(_, determinant)| *determinant < 0.0);
        assert_eq!(mirrored > 20, is_mirrored, "{file}: {mirrored} pixels of mirrored nodes");
    }
    assert!(reversed > 200, "control: {reversed} pixels would be seen from behind");
}
