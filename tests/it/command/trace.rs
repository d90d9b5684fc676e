//! `trace` as a user runs it: arrays of rays of several shapes and types, and what comes out.

use crate::common::{brickwalk, converted, folder, succeed};
use std::path::{Path, PathBuf};

/// Writes an array as NumPy does.
fn array(path: &Path, descr: &str, shape: &str, data: &[u8]) {
    let mut dict = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}");
    dict.extend(std::iter::repeat_n(' ', (64 - (11 + dict.len()) % 64) % 64));
    dict.push('\n');
    let length = (dict.len() as u16).to_le_bytes();
    std::fs::write(path, [b"\x93NUMPY\x01\x00", &length[..], dict.as_bytes(), data].concat()).expect("an array");
}

/// Header and data of an array. Python allows a comma after the last of a list, and some writers write one.
fn read(path: &Path) -> (String, Vec<u8>) {
    let bytes = std::fs::read(path).expect("an array");
    let data = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let header = String::from_utf8_lossy(&bytes[10..data]).replace(", ]", "]").replace(", )", ",)");
    (header, bytes[data..].to_vec())
}

/// A square in the plane z = 2, seen from above counter-clockwise.
const SQUARE: &str = "v 0 0 2\nv 4 0 2\nv 4 4 2\nv 0 4 2\nf 1 2 3\nf 1 3 4\n";

fn trace(folder: &Path, scene: &Path, options: &[&str]) -> (String, Vec<u8>) {
    let (rays, hits) = (folder.join("rays.npy"), folder.join("hits.npy"));
    let words = ["trace".into(), scene.into(), "--rays".into(), rays, "-o".into(), hits.clone()];
    succeed(words.into_iter().chain(options.iter().map(PathBuf::from)));
    read(&hits)
}

/// Six rays down at the square, the last beside it.
fn numbers(columns: usize) -> Vec<f64> {
    let ray = |i: usize| {
        let x = if i == 5 { 9.0 } else { 0.5 + 0.5 * i as f64 };
        [x, 0.25, 12.0, 0.0, 0.0, -2.0, 0.0, f64::INFINITY]
    };
    (0..6).flat_map(|i| ray(i)[..columns].to_vec()).collect()
}

#[test]
fn rays_may_have_any_shape_and_lack_intervals() {
    let folder = folder();
    let folder = folder.path();
    let scene = converted(folder, SQUARE, "");
    let rays = folder.join("rays.npy");
    let doubles = |columns| numbers(columns).iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let singles = |columns| numbers(columns).iter().flat_map(|x| (*x as f32).to_le_bytes()).collect::<Vec<u8>>();
    array(&rays, "<f8", "(6, 8)", &doubles(8));
    let (header, expected) = trace(folder, &scene, &[]);
    assert!(header.contains("[('t', '<f8'), ('triangle', '<u4'), ('u', '<f4'), ('v', '<f4')]"), "{header}");
    assert!(header.contains("'shape': (6,)"), "{header}");
    assert_eq!(expected.len(), 6 * 20);
    let hit = |i: usize| &expected[20 * i..][..20];
    assert_eq!(
        (hit(0)[..8].to_vec(), hit(5)[..8].to_vec()),
        (5f64.to_le_bytes().to_vec(), f64::INFINITY.to_le_bytes().to_vec())
    );
    assert_eq!((hit(0)[8], &hit(5)[8..12]), (0, &[255u8; 4][..]));
    // u and v weight vertices 1 and 2 of the file: (4, 0) and (4, 4).
    let weight = |i: usize, at: usize| f32::from_le_bytes(hit(i)[at..at + 4].try_into().expect("four"));
    assert_eq!((weight(0, 12), weight(0, 16)), (0.25 / 4.0, 0.25 / 4.0));
    for (descr, shape, data, shaped) in [
        ("<f8", "(6, 6)", doubles(6), "(6,)"),
        ("<f4", "(6, 8)", singles(8), "(6,)"),
        ("<f4", "(2, 3, 6)", singles(6), "(2, 3,)"),
        ("<f8", "(3, 1, 2, 8)", doubles(8), "(3, 1, 2,)"),
    ] {
        array(&rays, descr, shape, &data);
        let (header, found) = trace(folder, &scene, &[]);
        assert!(header.contains(&format!("'shape': {shaped}")), "{shape}: {header}");
        assert!(found == expected, "{descr} {shape}");
        let (header, any) = trace(folder, &scene, &["--any"]);
        assert!(header.contains("'|b1'") && header.contains(&format!("'shape': {shaped}")), "{shape}: {header}");
        assert_eq!(any, [1, 1, 1, 1, 1, 0]);
    }
    array(&rays, "<f8", "(8,)", &doubles(8)[..64]);
    let (header, found) = trace(folder, &scene, &[]);
    assert!(header.contains("'shape': ()") && found == expected[..20], "{header}");
}

#[test]
fn normals_are_a_field_of_their_own() {
    let folder = folder();
    let folder = folder.path();
    let scene = converted(folder, SQUARE, "");
    let rays = folder.join("rays.npy");
    array(&rays, "<f8", "(6, 6)", &numbers(6).iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>());
    let (_, plain) = trace(folder, &scene, &[]);
    let (header, found) = trace(folder, &scene, &["--normals"]);
    assert!(header.contains("('v', '<f4'), ('normal', '<f4', (3,))]"), "{header}");
    for (i, (row, plain)) in found.chunks_exact(32).zip(plain.chunks_exact(20)).enumerate() {
        assert_eq!(&row[..20], plain);
        let normal: Vec<f32> = row[20..].chunks(4).map(|x| f32::from_le_bytes(x.try_into().expect("four"))).collect();
        assert_eq!(normal, if i == 5 { [0.0, 0.0, 0.0] } else { [0.0, 0.0, 1.0] });
    }
    let words = ["trace".into(), scene, "--rays".into(), rays, "-o".into(), folder.join("x.npy")];
    let refused = brickwalk(words.into_iter().chain(["--any", "--normals"].map(PathBuf::from)));
    assert_eq!(refused.status.code(), Some(2), "normals of no hits are wrong usage");
}

/// A hilly plain of two triangles a square.
fn hills(side: usize) -> String {
    let mut text = String::new();
    for i in 0..side * side {
        let (x, y) = ((i % side) as f64, (i / side) as f64);
        text += &format!("v {x} {y} {}\n", 0.2 * (0.9 * x).sin() * (0.7 * y).cos() + 0.02 * (i * 37 % 11) as f64);
    }
    for i in (1..=side * (side - 1)).filter(|i| i % side != 0) {
        text += &format!("f {} {} {}\nf {} {} {}\n", i, i + 1, i + side, i + 1, i + side + 1, i + side);
    }
    text
}

#[test]
fn hits_of_levels_are_near_and_are_asked_for() {
    let folder = folder();
    let folder = folder.path();
    let scene = converted(folder, &hills(60), "--brick-triangles 100 --lod on");
    // Straight down, from high above.
    let ray = |i: u32| [1.0 + f64::from(i % 50) * 1.13, 1.0 + f64::from(i / 50) * 1.09, 70.0, 0.0, 0.0, -1.0];
    let rays: Vec<u8> = (0..2500).flat_map(ray).flat_map(f64::to_le_bytes).collect();
    array(&folder.join("rays.npy"), "<f8", "(2500, 6)", &rays);
    let trace = |options: &str| trace(folder, &scene, &options.split_whitespace().collect::<Vec<_>>()).1;
    let exact = trace("");
    assert!(trace("--lod 0") == exact && trace("--lod 0 --spread 0.5") == exact);
    let t = |row: &[u8]| f64::from_le_bytes(row[..8].try_into().expect("eight"));
    let far = |hits: &[u8]| {
        let apart = hits.chunks_exact(20).zip(exact.chunks_exact(20)).map(|(a, b)| (t(a) - t(b)).abs());
        let (met, missed): (Vec<f64>, Vec<f64>) = apart.partition(|apart| apart.is_finite());
        assert!(missed.len() < 25, "{} rays of 2500 pass through", missed.len());
        met.into_iter().fold(0.0, f64::max)
    };
    let id = |row: &[u8]| u32::from_le_bytes(row[8..12].try_into().expect("four"));
    let ids = |hits: &[u8]| hits.chunks_exact(20).all(|row| id(row) < 6962 || t(row).is_infinite());
    let (fine, coarse) = (trace("--lod 1 --spread 0.003"), trace("--lod 2 --spread 0.01"));
    assert!(fine != exact && coarse != fine);
    // A level's error is the distance of nearly all of it, not of all.
    let (of_fine, of_coarse) = (far(&fine), far(&coarse));
    assert!(of_fine > 0.0 && of_fine < 0.6 && of_fine <= of_coarse && of_coarse < 2.0, "{of_fine}, {of_coarse}");
    assert!(ids(&fine) && ids(&coarse), "triangles of the source");
    // The width goes by the tolerance times the angle, and neither by caches nor by schedules.
    assert!(trace("--lod 2 --spread 0.01 --cache 10%") == coarse);
    assert!(trace("--lod 2 --spread 0.01 --cache 10% --schedule demand --tile 8") == coarse);
    assert!(trace("--lod 4 --spread 0.005") == coarse);
    let any: Vec<u8> = coarse.chunks_exact(20).map(|row| u8::from(t(row).is_finite())).collect();
    assert!(trace("--lod 2 --spread 0.01 --any") == any);
}

#[test]
fn levels_that_nothing_asks_for_are_said() {
    let folder = folder();
    let folder = folder.path();
    let scene = converted(folder, SQUARE, "");
    let rays = folder.join("rays.npy");
    array(&rays, "<f8", "(6, 6)", &numbers(6).iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>());
    let run = |options: &str| {
        let words = ["trace".into(), scene.clone(), "--rays".into(), rays.clone(), "-o".into(), folder.join("x.npy")];
        let done = brickwalk(words.into_iter().chain(options.split_whitespace().map(PathBuf::from)));
        (done.status.code(), String::from_utf8_lossy(&done.stderr).into_owned())
    };
    let (code, said) = run("--lod 1");
    assert!(code == Some(2) && said.contains("--lod needs --spread RADIANS"), "{said}");
    let (code, said) = run("--lod 1 --spread 0.001");
    assert!(code == Some(0) && said.contains("the scene has no levels of detail"), "{said}");
    let (code, said) = run("--spread 0.001");
    assert!(code == Some(0) && said.contains("--spread has no effect"), "{said}");
    let (code, said) = run("--lod 1 --spread 2");
    assert!(code == Some(2) && said.contains("an angle in radians, above 0 and at most 1"), "{said}");
}

#[test]
fn help_says_what_u_and_v_weight() {
    let help = succeed(["trace", "--help"]).split_whitespace().collect::<Vec<_>>().join(" ");
    for says in [
        "u weights vertex 1 and v vertex 2",
        "order of the source file",
        "(N, 8) or (N, 6)",
        "--opaque",
        "--lod",
        "in radians, above 0",
    ] {
        assert!(help.contains(says), "{says}: {help}");
    }
}
