//! `query` as a user runs it: every kind on a cube whose answers are known, and what is refused.

use crate::common::{brickwalk, converted, folder, succeed};
use std::path::{Path, PathBuf};

/// A cube of edge 2 about the origin, seen from outside counter-clockwise.
const CUBE: &str = "v -1 -1 -1\nv 1 -1 -1\nv -1 1 -1\nv 1 1 -1\nv -1 -1 1\nv 1 -1 1\nv -1 1 1\nv 1 1 1\n\
    f 1 5 7 3\nf 2 4 8 6\nf 1 2 6 5\nf 3 7 8 4\nf 1 3 4 2\nf 5 6 8 7\n";

/// Writes an array of float64 as NumPy does.
fn array(path: &Path, shape: &str, numbers: &[f64]) {
    let mut dict = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}");
    dict.extend(std::iter::repeat_n(' ', (64 - (11 + dict.len()) % 64) % 64));
    dict.push('\n');
    let data: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
    let length = (dict.len() as u16).to_le_bytes();
    std::fs::write(path, [b"\x93NUMPY\x01\x00", &length[..], dict.as_bytes(), &data].concat()).expect("an array");
}

/// Header and data of the answers of `kind`.
fn ask(folder: &Path, kind: &str, scene: &Path, shape: &str, numbers: &[f64]) -> (String, Vec<u8>) {
    let (input, output) = (folder.join("in.npy"), folder.join("out.npy"));
    array(&input, shape, numbers);
    let words: [PathBuf; 6] = ["query".into(), kind.into(), scene.into(), input, "-o".into(), output.clone()];
    succeed(words);
    let bytes = std::fs::read(&output).expect("an array");
    let data = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    // Python allows a comma after the last of a list.
    let header = String::from_utf8_lossy(&bytes[10..data]).replace(", ]", "]").replace(", )", ")");
    (header, bytes[data..].to_vec())
}

fn f8(data: &[u8]) -> Vec<f64> {
    data.chunks_exact(8).map(|bytes| f64::from_le_bytes(bytes.try_into().expect("eight bytes"))).collect()
}

#[test]
fn every_kind_answers_about_a_cube() {
    let folder = folder();
    let folder = folder.path();
    let scene = converted(folder, CUBE, "");
    // Through, beside, from inside, and too short.
    let inf = f64::INFINITY;
    let rays = [
        [-5.0, 0.25, 0.5, 2.0, 0.0, 0.0, 0.0, inf],
        [-5.0, 3.0, 0.5, 2.0, 0.0, 0.0, 0.0, inf],
        [0.0, 0.25, 0.5, 2.0, 0.0, 0.0, 0.0, inf],
        [-5.0, 0.25, 0.5, 2.0, 0.0, 0.0, 0.0, 1.0],
    ]
    .concat();
    let rays = |kind| ask(folder, kind, &scene, "(2, 2, 8)", &rays);
    let (header, hits) = rays("cast");
    assert!(header.contains("'normal'") && header.contains("(2, 2)"), "{header}");
    let t: Vec<f64> = hits.chunks_exact(32).map(|hit| f8(&hit[..8])[0]).collect();
    assert_eq!(t, [2.0, inf, 0.5, inf]);
    let (header, any) = rays("any");
    assert!(header.contains("'|b1'"), "{header}");
    assert_eq!(any, [1, 0, 1, 0]);
    let (header, counts) = rays("count");
    assert!(header.contains("'<u4'") && header.contains("(2, 2)"), "{header}");
    assert_eq!(counts, [2u32, 0, 1, 0].map(u32::to_le_bytes).concat());
    let (header, all) = rays("all");
    assert!(
        header.contains("('ray', '<u8'), ('t', '<f8'), ('triangle', '<u4')") && header.contains("'shape': (3)"),
        "{header}"
    );
    let all: Vec<(u64, f64)> = all
        .chunks_exact(40)
        .map(|hit| (u64::from_le_bytes(hit[..8].try_into().expect("eight bytes")), f8(&hit[8..16])[0]))
        .collect();
    assert_eq!(all, [(0, 2.0), (0, 3.0), (2, 0.5)]);
    let points = [[3.0, 0.0, 0.25], [0.5, 0.0, 0.25], [0.0, -0.5, 0.0]].concat();
    let points = |kind| ask(folder, kind, &scene, "(3, 3)", &points);
    let (header, closest) = points("closest");
    assert!(header.contains("('point', '<f8', (3,)), ('distance', '<f8')"), "{header}");
    assert_eq!(f8(&closest[..32]), [1.0, 0.0, 0.25, 2.0]);
    assert_eq!(closest.len(), 3 * 56);
    assert_eq!(f8(&points("distance").1), [2.0, 0.5, 0.5]);
    assert_eq!(f8(&points("signed-distance").1), [2.0, -0.5, -0.5]);
    assert_eq!(points("occupancy").1, [0, 1, 1]);
    let pairs = [[-5.0, 0.25, 0.5, 5.0, 0.25, 0.5], [-5.0, 3.0, 0.5, 5.0, 3.0, 0.5]].concat();
    assert_eq!(ask(folder, "visibility", &scene, "(2, 6)", &pairs).1, [0, 1]);
}

#[test]
fn what_cannot_be_answered_is_said() {
    let folder = folder();
    let folder = folder.path();
    let open = CUBE.rsplit_once("f ").map(|(closed, _)| closed.to_owned()).expect("a face");
    let scene = converted(folder, &open, "");
    let (input, output) = (folder.join("in.npy"), folder.join("out.npy"));
    let refused = |kind: &str, shape: &str, numbers: &[f64], options: &[&str]| {
        array(&input, shape, numbers);
        let words: [PathBuf; 6] =
            ["query".into(), kind.into(), scene.clone(), input.clone(), "-o".into(), output.clone()];
        let run = brickwalk(words.into_iter().chain(options.iter().map(PathBuf::from)));
        assert!(!output.exists(), "nothing is written");
        (run.status.code(), String::from_utf8_lossy(&run.stderr).into_owned())
    };
    let (status, text) = refused("occupancy", "(1, 3)", &[0.0; 3], &[]);
    assert!(status == Some(1) && text.contains("is not closed"), "{text}");
    assert!(
        refused("distance", "(1, 4)", &[0.0; 4], &[]).1.contains("points are float64 or float32 of shape (..., 3)")
    );
    assert!(refused("distance", "(2, 3)", &[0.0, 0.0, 0.0, 0.0, f64::NAN, 0.0], &[]).1.contains("row 1"));
    assert!(refused("count", "(1, 6)", &[0.0; 6], &[]).1.contains("row 0: the direction has no length"));
    assert!(refused("visibility", "(2, 3)", &[0.0; 6], &[]).1.contains("pairs of points"));
    array(&input, "(1, 3)", &[0.0; 3]);
    let words: [PathBuf; 8] = [
        "query".into(),
        "occupancy".into(),
        scene.clone(),
        input.clone(),
        "-o".into(),
        output.clone(),
        "--allow-open".into(),
        "--json".into(),
    ];
    let report = succeed(words);
    assert!(report.contains("\"payloads_read\": 1"), "{report}");
}
