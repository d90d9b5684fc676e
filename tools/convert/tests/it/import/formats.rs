//! OBJ, PLY and STL: what is read, and what is refused.

use super::writer::*;
use crate::skip::shared_scenes;
use brickwalk_convert::import::{Input, Up};
use brickwalk_convert::source::{IDENTITY, SourceScene};

/// The corners of all triangles, in their order.
fn corners(scene: &SourceScene) -> Vec<[f64; 3]> {
    let primitives = scene.meshes.iter().flat_map(|mesh| &mesh.primitives);
    primitives.flat_map(|p| p.indices.iter().map(|&i| p.positions[i as usize])).collect()
}

fn read(name: &str, bytes: &[u8]) -> SourceScene {
    import_bytes(name, bytes).unwrap_or_else(|e| panic!("{e}"))
}

/// The error of importing, which must be one line that names the file and what to do.
fn error(name: &str, bytes: &[u8]) -> String {
    let text = import_bytes(name, bytes).expect_err("it should be refused");
    assert!(!text.contains('\n') && text.len() < 1000 && text.contains(name) && text.contains("; "), "{text}");
    text
}

const SQUARE: [[f64; 3]; 6] =
    [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];

#[test]
fn obj_polygons_become_fans() {
    let text = "v 0 0 0\nv 1 0 0\r\nv 1 1 0 # corner\nv 0 1 0\nf 1 2 \\\n 3 4\nf -4 -3 -2\nf 1//\nl 1 2\n";
    let scene = read("a.obj", text.as_bytes());
    assert_eq!(corners(&scene)[..6], SQUARE);
    assert_eq!(corners(&scene)[6..], SQUARE[..3]);
    assert_eq!((scene.meshes.len(), scene.meshes[0].name.as_str()), (1, "a"));
    assert_eq!(scene.placements[0].world_from_mesh, IDENTITY);
    assert!(scene.meshes[0].primitives[0].normals.is_none() && scene.meshes[0].primitives[0].uvs.is_none());
    assert_eq!(scene.warnings.len(), 2, "a face of one vertex and a line: {:?}", scene.warnings);
}

#[test]
fn obj_objects_materials_and_attributes() {
    let folder = tempfile::tempdir().unwrap();
    let library = "newmtl red\nKd 1 0 0\nPr 0.25\nPm 0.5\nnewmtl glass\nKd 0.5\nd 0.25\n\
        map_Kd -clamp on tex\\a b.png\nmap_Bump b.png\n";
    write(folder.path(), "my materials.mtl", library.as_bytes());
    std::fs::create_dir(folder.path().join("tex")).unwrap();
    write(folder.path(), "tex/a b.png", &png(1, 1, &[1, 2, 3, 4]));
    let text = "mtllib my materials.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.25 0.25\nvt 1 0\nvn 0 0 1\n\
        f 1 2 3\no first\nusemtl glass\nf 1/1/1 2/2/1 3/1/1\nusemtl red\nf 1//1 2//1 3//1\no empty\ng second\n\
        f 1/1 2/2 3/2\nusemtl none\nf 3 2 1\n";
    let path = write(folder.path(), "test.obj", text.as_bytes());
    let scene = import_one(&path).unwrap();
    let names: Vec<_> = scene.meshes.iter().map(|mesh| (mesh.name.as_str(), mesh.primitives.len())).collect();
    assert_eq!(names, [("test", 1), ("first", 2), ("second", 2)]);
    assert_eq!(scene.placements.len(), 3);
    let [glass, red] = [&scene.meshes[1].primitives[0], &scene.meshes[1].primitives[1]];
    assert_eq!(glass.uvs.as_ref().unwrap()[0], [0.25, 0.75], "rows of images run downwards");
    assert_eq!(glass.normals.as_ref().unwrap()[2], [0.0, 0.0, 1.0]);
    assert!(red.uvs.is_none() && red.normals.is_some());
    let material = |primitive: &brickwalk_convert::source::Primitive| scene.materials[primitive.material as usize];
    assert_eq!(material(glass).base_color, [0.5, 0.5, 0.5, 0.25]);
    assert_eq!(material(glass).flags & bricks::MATERIAL_BLEND, bricks::MATERIAL_BLEND);
    assert_eq!(
        (material(red).base_color, material(red).roughness, material(red).metallic),
        ([1.0, 0.0, 0.0, 1.0], 0.25, 0.5)
    );
    assert_eq!(scene.textures.len(), 1);
    assert_eq!(scene.textures[material(glass).base_color_texture as usize].rgba, [1, 2, 3, 4]);
    assert_eq!(scene.textures[0].wrap, bricks::WRAP_CLAMP | bricks::WRAP_CLAMP << 16);
    assert_eq!(scene.warnings.len(), 2, "another map, an unknown material: {:?}", scene.warnings);
    // Without its materials it is still a scene.
    std::fs::remove_file(folder.path().join("my materials.mtl")).unwrap();
    let scene = import_one(&path).unwrap();
    assert_eq!(corners(&scene).len(), 15);
    assert!(scene.warnings[0].contains("my materials.mtl"), "{:?}", scene.warnings);
}

#[test]
fn obj_colours_of_vertices() {
    let scene = read("a.obj", b"v 0 0 0\nv 1 0 0 1 0 0.5\nv 0 1 0 0 0 0\nf 1 2 3");
    let colors = scene.meshes[0].primitives[0].colors.as_ref().unwrap();
    assert_eq!((colors[0], colors[2]), ([1.0; 4], [0.0, 0.0, 0.0, 1.0]));
    // sRGB 0.5 in linear light.
    assert!((colors[1][2] - 0.214041).abs() < 1e-6, "{:?}", colors[1]);
}

#[test]
fn obj_defects() {
    for (text, expected) in [
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "line 4: refers to vertex 4, but the file has 3"),
        ("v 0 0 0\nf 0 1 1", "line 2: \"0\" is not an index"),
        ("v 0 0 0\nf -2 1 1", "line 2"),
        ("v 0 0 0\nf 1/1/1/1 1 1", "is no corner"),
        ("v 0 0 0\nf 4294967296 1 1", "is not an index"),
        ("v 0 0 0\nf 4294967295 1 1", "refers to vertex 4294967295"),
        ("v 0 0\n", "line 1: has 2 numbers, but needs 3"),
        ("v 0 0 x\n", "\"x\" is not a number"),
        ("v 0 0 0\n", "faces: the file has none"),
        ("", "faces: the file has none"),
    ] {
        assert!(error("a.obj", text.as_bytes()).contains(expected), "{text}");
    }
    // What is missing of the looks is not.
    let scene = read("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/9/9 2/9/9 3/9/9");
    assert_eq!(scene.meshes[0].primitives[0].uvs.as_ref().unwrap()[0], [0.0; 2]);
    // Vertices may come behind the faces.
    assert_eq!(corners(&read("a.obj", b"f 1 2 3\nv 0 0 0\nv 1 0 0\nv 1 1 0")), SQUARE[..3]);
}

/// The square as PLY: colours, an element and a list that nobody knows, a quad, a triangle.
pub fn ply(encoding: &str) -> Vec<u8> {
    let header = format!(
        "ply\nformat {encoding} 1.0\ncomment made by hand\nelement other 2\nproperty list uchar short what\n\
         element vertex 4\nproperty double x\nproperty float y\nproperty float z\nproperty uchar red\n\
         property uchar green\nproperty uchar blue\nproperty float nx\nproperty float ny\n\
         property float nz\nelement nothing 4294967295\n\
         element face 2\nproperty uchar flag\nproperty list uchar int vertex_indices\nend_header\n"
    );
    let mut bytes = header.into_bytes();
    let vertices = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    if encoding == "ascii" {
        let mut text = "1 7 2 8 9\n".to_owned();
        for [x, y] in vertices {
            text += &format!("{x} {y} 0 255 0 188 0 0 1\n");
        }
        bytes.extend_from_slice((text + "0 4 0 1 2 3\n9 3 0 2 3\n").as_bytes());
        return bytes;
    }
    let is_big = encoding == "binary_big_endian";
    let mut put = |number: &[u8]| {
        let mut number = number.to_vec();
        if is_big {
            number.reverse();
        }
        bytes.extend(number);
    };
    for list in [&[7i16][..], &[8, 9]] {
        put(&[list.len() as u8]);
        list.iter().for_each(|value| put(&value.to_le_bytes()));
    }
    for [x, y] in vertices {
        put(&f64::to_le_bytes(x));
        put(&f32::to_le_bytes(y as f32));
        put(&0f32.to_le_bytes());
        [255u8, 0, 188].iter().for_each(|c| put(&[*c]));
        [0f32, 0.0, 1.0].iter().for_each(|c| put(&c.to_le_bytes()));
    }
    for face in [&[0i32, 1, 2, 3][..], &[0, 2, 3]] {
        put(&[9]);
        put(&[face.len() as u8]);
        face.iter().for_each(|vertex| put(&vertex.to_le_bytes()));
    }
    bytes
}

#[test]
fn ply_in_every_encoding() {
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        let scene = read("a.ply", &ply(encoding));
        assert_eq!(corners(&scene)[..6], SQUARE, "{encoding}");
        assert_eq!(corners(&scene)[6..], SQUARE[3..]);
        let primitive = &scene.meshes[0].primitives[0];
        assert_eq!(primitive.normals.as_ref().unwrap()[..], [[0.0, 0.0, 1.0]; 4]);
        let [r, g, b, a] = primitive.colors.as_ref().unwrap()[0];
        assert_eq!((r, g, a), (1.0, 0.0, 1.0));
        assert!((b - 0.5029).abs() < 1e-4, "sRGB 188 is half of the light: {b}");
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    }
}

#[test]
fn ply_defects() {
    let whole = String::from_utf8(ply("ascii")).unwrap();
    let without_colors = whole.replace("property uchar red", "property uchar other");
    assert!(read("a.ply", without_colors.as_bytes()).meshes[0].primitives[0].colors.is_none());
    for (from, to, expected) in [
        ("ply\n", "plx\n", "does not begin with"),
        ("format ascii 1.0", "format utf8 1.0", "unknown format \"utf8\""),
        ("format ascii 1.0\n", "", "states no format"),
        ("element vertex 4", "element vertex -4", "not a count"),
        ("element vertex 4", "element vertex 99999999999", "face 0: the file ends here"),
        ("property float y", "property half y", "unknown type \"half\""),
        ("property float y", "property float q", "x, y, z are not all there"),
        ("property list uchar int", "property list uchar float", "not integers"),
        ("vertex_indices", "vertices", "vertex_indices is not there"),
        ("end_header", "end", "does not end"),
        ("4 0 1 2 3", "4 0 1 2 4", "face 0: refers to vertex 4, but there are 4"),
        ("4 0 1 2 3", "4 0 1 2 -1", "face 0: refers to vertex -1"),
        ("4 0 1 2 3", "4 0 1 2 x", "\"x\" is not a number"),
        ("4 0 1 2 3", "-4 0 1 2 3", "not a number of items"),
        ("4 0 1 2 3\n9 3 0 2 3\n", "2 0 1\n9 0\n", "no faces"),
        ("9 3 0 2 3\n", "", "face 1: the file ends"),
    ] {
        assert!(whole.contains(from), "{from}");
        let error = error("a.ply", whole.replacen(from, to, 1).as_bytes());
        assert!(error.contains(expected) || (to.contains("999") && error.contains("vertex ")), "{to}: {error}");
    }
    // Counts that the bytes cannot hold.
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 4294967295\nproperty float x\nproperty float y\n\
        property float z\nelement face 4294967295\nproperty list uint int vertex_indices\nend_header\n";
    assert!(error("a.ply", header.as_bytes()).contains("vertex 0: the file ends here"));
    let points = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
        end_header\n1 2 3\n";
    assert!(error("a.ply", points.as_bytes()).contains("point clouds are not read"));
}

/// The square as binary STL.
pub fn stl() -> Vec<u8> {
    let mut bytes = b"solid but binary".to_vec();
    bytes.resize(80, b' ');
    bytes.extend(2u32.to_le_bytes());
    for triangle in SQUARE.chunks(3) {
        bytes.extend([0; 12]);
        triangle.iter().flatten().for_each(|c| bytes.extend((*c as f32).to_le_bytes()));
        bytes.extend([0xff; 2]);
    }
    bytes
}

#[test]
fn stl_binary_and_ascii() {
    assert_eq!(corners(&read("a.stl", &stl())), SQUARE);
    let longer = [&stl()[..], b"more"].concat();
    let not_solid = [b"binary", &longer[6..]].concat();
    let scene = read("a.STL", &not_solid);
    assert_eq!((corners(&scene).len(), scene.warnings.len()), (6, 1));
    let mut text = "solid square\n".to_owned();
    for triangle in SQUARE.chunks(3) {
        text += "facet normal 0 0 0\n outer loop\n";
        for [x, y, z] in triangle {
            text += &format!("  vertex {x:e} {y} {z}\n");
        }
        text += " endloop\nendfacet\n";
    }
    text += "endsolid square\n";
    assert_eq!(corners(&read("a.stl", text.as_bytes())), SQUARE);
    for (from, to, expected) in [
        ("vertex 0e0 1 0\n", "", "line 13: a facet has fewer than three"),
        ("endloop", "", "more than three vertices"),
        ("0e0 1 0", "0e0 one 0", "\"one\" is not a number"),
        ("endloop\nendfacet\nendsolid square\n", "", "ends within a facet"),
    ] {
        assert!(text.contains(from), "{from}");
        let error = error("a.stl", text.replacen(from, to, 1).as_bytes());
        assert!(error.contains(expected), "{from}: {error}");
    }
}

#[test]
fn stl_defects() {
    let mut bytes = stl();
    bytes[..6].copy_from_slice(b"binary");
    for length in [0, 1, 83] {
        assert!(error("a.stl", &bytes[..length]).contains("neither binary nor ASCII"), "{length}");
    }
    assert!(error("a.stl", &bytes[..150]).contains("states 2 triangles, but the file can hold 1"));
    bytes[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(error("a.stl", &bytes).contains("states 4294967295 triangles, but the file can hold 2"));
    bytes[80..84].fill(0);
    assert!(error("a.stl", &bytes).contains("the file has none"));
    assert!(error("a.stl", b"solid empty\nendsolid empty\n").contains("the file has none"));
}

#[test]
fn axes_units_and_transforms() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), "a.stl", &stl());
    let mut input = Input::from(path);
    (input.up, input.metres) = (Some(Up::Z), 0.5);
    input.transform = [1.0, 0.0, 0.0, 10.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let world = |input: &Input, p: [f64; 3]| {
        let m = import_all(std::slice::from_ref(input)).unwrap().placements[0].world_from_mesh;
        let row = |r: usize| m[4 * r] * p[0] + m[4 * r + 1] * p[1] + m[4 * r + 2] * p[2] + m[4 * r + 3];
        [row(0), row(1), row(2)]
    };
    // Z becomes Y, so that the frame stays right-handed Y becomes -Z; then metres; then the placement in metres.
    assert_eq!(world(&input, [1.0, 2.0, 4.0]), [10.5, 2.0, -1.0]);
    input.up = Some(Up::Y);
    assert_eq!(world(&input, [1.0, 2.0, 4.0]), [10.5, 1.0, 2.0]);
    // glTF has axes and units of its own.
    input.path = write(folder.path(), "a.glb", &Writer::triangle().glb());
    assert_eq!(world(&input, [1.0, 2.0, 4.0]), [11.0, 2.0, 4.0]);
    input.transform[3] = f64::MAX;
    input.transform[0] = f64::MAX;
    let mut file = Writer::triangle();
    file.root["nodes"][0]["scale"] = serde_json::json!([2, 2, 2]);
    input.path = write(folder.path(), "b.glb", &file.glb());
    assert!(import_all(&[input]).unwrap_err().contains("b.glb: transform: takes node 0 beyond the range"));
}

#[test]
fn large_files_are_read_in_parts() {
    use brickwalk_convert::import::{ImportSettings, import};
    use brickwalk_convert::progress::Progress;
    use brickwalk_convert::source::{PART_TRIANGLES, Source};
    // A strip of squares along x, more than a part of triangles, in every format.
    let columns = PART_TRIANGLES as usize / 2 + 1000;
    let vertex = |i: usize| [(i / 2) as f32, (i % 2) as f32, 0.0];
    let vertices = 2 * (columns + 1);
    let triangles: Vec<[u32; 3]> = (0..2 * columns as u32).map(|i| [i, i + 1 + i % 2, i + 2 - i % 2]).collect();
    let expected: Vec<[f64; 3]> = triangles.iter().flatten().map(|&i| vertex(i as usize).map(f64::from)).collect();
    let positions: Vec<f32> = (0..vertices).flat_map(vertex).collect();

    let mut strip = Writer::new();
    let accessor = strip.floats("VEC3", &positions);
    let mesh = strip.mesh(serde_json::json!({"attributes": {"POSITION": accessor}, "mode": 5}));
    strip.node(serde_json::json!({"mesh": mesh}));
    let mut indexed = Writer::new();
    let accessor = indexed.floats("VEC3", &positions);
    let list: Vec<u8> = triangles.iter().flatten().flat_map(|i| i.to_le_bytes()).collect();
    let indices = indexed.accessor(&list, U32, "SCALAR", 3 * triangles.len());
    let mesh = indexed.mesh(serde_json::json!({"attributes": {"POSITION": accessor}, "indices": indices}));
    indexed.node(serde_json::json!({"mesh": mesh}));
    let mut obj = String::new();
    let mut ply = format!(
        "ply\nformat ascii 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        triangles.len()
    );
    for [x, y, z] in (0..vertices).map(vertex) {
        obj += &format!("v {x} {y} {z}\n");
        ply += &format!("{x} {y} {z}\n");
    }
    for [a, b, c] in &triangles {
        obj += &format!("f {} {} {}\n", a + 1, b + 1, c + 1);
        ply += &format!("3 {a} {b} {c}\n");
    }
    let mut stl = vec![0; 80];
    stl.extend((triangles.len() as u32).to_le_bytes());
    for corners in expected.chunks(3) {
        stl.extend([0; 12]);
        corners.iter().flatten().for_each(|c| stl.extend((*c as f32).to_le_bytes()));
        stl.extend([0; 2]);
    }
    let folder = tempfile::tempdir().unwrap();
    let files = [
        ("strip.glb", strip.glb()),
        ("list.glb", indexed.glb()),
        ("a.obj", obj.into_bytes()),
        ("a.ply", ply.into_bytes()),
        ("a.stl", stl),
    ];
    for (name, bytes) in files {
        let path = write(folder.path(), name, &bytes);
        let source = import(&[path.into()], &ImportSettings::default(), &Progress::hidden()).unwrap();
        let parts: Vec<u32> = source.outline().meshes[0].parts.iter().map(|part| part.triangles).collect();
        assert_eq!(parts, [PART_TRIANGLES, triangles.len() as u32 - PART_TRIANGLES], "{name}");
        let mut read = Vec::new();
        for part in 0..parts.len() {
            let part = source.part(0, part).unwrap();
            assert!(part.positions.len() <= part.indices.len());
            read.extend(part.indices.iter().map(|&i| part.positions[i as usize]));
        }
        assert!(read == expected, "{name}");
    }
}

#[test]
fn scans() {
    let Some(folder) = shared_scenes() else { return };
    for (file, expected) in [
        ("scans/bunny.ply", 69_451),
        ("scans/lucy.ply", 99_970),
        ("scans/lionstatue/lionstatue.obj", 63_338),
        ("city_buildings/buildings.obj", 400_020),
    ] {
        let scene = import_one(&folder.join(file)).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(scene.meshes.iter().map(|m| m.triangle_count()).sum::<u64>(), expected, "{file}");
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    }
}

/// The first difference of the corners of all triangles, in their order.
///
/// The plain Sponza holds what another program decoded from the compressed one: integers times a step, plus the least
/// coordinate, in f32. Coordinates are below 2^12, so an f32 is 2^-12 at most from the next; two roundings of each
/// program make 2^-10, a hundredth of a step of the quantisation (4000 / 2^14).
fn sponza_difference(plain: &SourceScene, compressed: &SourceScene) -> Option<String> {
    let primitives = |scene: &SourceScene| scene.meshes.iter().map(|mesh| mesh.primitives.len()).sum::<usize>();
    if primitives(plain) != 103 || primitives(compressed) != 103 {
        return Some("primitives".into());
    }
    let pairs =
        plain.meshes.iter().flat_map(|m| &m.primitives).zip(compressed.meshes.iter().flat_map(|m| &m.primitives));
    pairs.enumerate().find_map(|(i, (a, b))| {
        if a.indices.len() != b.indices.len() {
            return Some(format!("triangles of primitive {i}"));
        }
        a.indices.iter().zip(&b.indices).enumerate().find_map(|(corner, (&x, &y))| {
            let (x, y) = (x as usize, y as usize);
            let positions = a.positions[x].iter().zip(b.positions[y]).all(|(x, y)| (x - y).abs() <= 2f64.powi(-10));
            let normals = near(a.normals.as_ref().map(|n| &n[x]), b.normals.as_ref().map(|n| &n[y]), 1e-6);
            let uvs = near(a.uvs.as_ref().map(|uv| &uv[x]), b.uvs.as_ref().map(|uv| &uv[y]), 1e-5);
            let same = [("position", positions), ("normal", normals), ("texture coordinates", uvs)];
            let what = same.iter().find(|(_, same)| !same)?.0;
            Some(format!("{what} of corner {corner} of primitive {i}: {:?} {:?}", a.positions[x], b.positions[y]))
        })
    })
}

/// Whether both are there and differ by no more than `tolerance`.
fn near<const N: usize>(a: Option<&[f32; N]>, b: Option<&[f32; N]>, tolerance: f32) -> bool {
    let (Some(a), Some(b)) = (a, b) else { return false };
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance)
}

#[test]
fn the_compressed_sponza_is_the_plain_one() {
    let Some(folder) = shared_scenes() else { return };
    let plain = import_one(&folder.join("sponza/Sponza.gltf")).unwrap();
    let mut compressed = import_one(&folder.join("sponza_draco/sponza_cd.glb")).unwrap();
    assert_eq!(sponza_difference(&plain, &compressed), None);
    let primitive = &mut compressed.meshes[0].primitives[7];
    let corner = primitive.indices[3] as usize;
    primitive.positions[corner][1] += 0.01;
    assert!(sponza_difference(&plain, &compressed).is_some_and(|text| text.starts_with("position")));
}
