//! PLY in all three encodings.

use super::{Files, Format, Verdict, imported};
use crate::kind::Fault;
use crate::mutate::Harm;
use crate::random::Random;
use std::path::Path;

/// Words of PLY.
const NAMES: &[&str] = &[
    "ply",
    "format",
    "ascii",
    "binary_little_endian",
    "binary_big_endian",
    "1.0",
    "element",
    "vertex",
    "face",
    "property",
    "list",
    "char",
    "uchar",
    "short",
    "ushort",
    "int",
    "uint",
    "float",
    "double",
    "int8",
    "uint32",
    "float64",
    "x",
    "y",
    "z",
    "nx",
    "red",
    "green",
    "blue",
    "alpha",
    "s",
    "t",
    "vertex_indices",
    "vertex_index",
    "tristrips",
    "comment",
    "obj_info",
    "end_header",
    "TextureFile",
];

/// PLY.
pub struct Ply;

impl Format for Ply {
    const NAME: &'static str = "inputs/ply";
    const ABOUT: &'static str = "PLY in its three encodings: header words and rows";

    fn make(&self, random: &mut Random, harm: Harm) -> Files {
        let encoding = random.below(3);
        let (vertices, faces) = (random.within(3, 9), random.within(1, 6));
        let (has_colors, has_other) = (random.chance(50), random.chance(30));
        let name = ["ascii", "binary_little_endian", "binary_big_endian"][encoding];
        let mut header = format!("ply\nformat {name} 1.0\ncomment made here\n");
        if has_other {
            header += "element other 2\nproperty list uchar short what\n";
        }
        header += &format!("element vertex {vertices}\nproperty double x\nproperty float y\nproperty float z\n");
        if has_colors {
            header += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
        }
        header += &format!("element face {faces}\nproperty list uchar int vertex_indices\nend_header\n");
        let mut header = header.into_bytes();
        harm.words(random, &mut header, NAMES, 55);
        let mut body = Body { encoding, bytes: Vec::new() };
        if has_other {
            for items in [1, 2] {
                body.put(f64::from(items), 1);
                (0..items).for_each(|item| body.put(f64::from(item), 2));
                body.end();
            }
        }
        for at in 0..vertices {
            body.put(at as f64, 9);
            body.put((at * at % 5) as f64, 5);
            body.put((at * 3 % 7) as f64, 5);
            if has_colors {
                [255, 0, 188].iter().for_each(|color| body.put(f64::from(*color), 1));
            }
            body.end();
        }
        for _ in 0..faces {
            let corners = random.within(3, 5);
            body.put(corners as f64, 1);
            (0..corners).for_each(|_| body.put(random.below(vertices) as f64, 4));
            body.end();
        }
        let mut bytes = body.bytes;
        if encoding == 0 {
            harm.words(random, &mut bytes, NAMES, 40);
        }
        harm.bytes(random, &mut bytes, 45);
        let mut file = [header, bytes].concat();
        harm.bytes(random, &mut file, 15);
        Files::one("a.ply", file)
    }

    fn read(&self, random: &mut Random, files: &Files, folder: &Path) -> Result<Verdict, Fault> {
        imported::read(random, files, folder, imported::TRIANGLES_A_BYTE)
    }
}

/// Rows in one of the encodings.
struct Body {
    encoding: usize,
    bytes: Vec<u8>,
}

impl Body {
    /// A number: of 1, 2 or 4 bytes an integer, of 5 an f32, of 9 an f64.
    fn put(&mut self, number: f64, kind: usize) {
        let mut bytes = match kind {
            _ if self.encoding == 0 => format!("{number} ").into_bytes(),
            5 => (number as f32).to_le_bytes().to_vec(),
            9 => number.to_le_bytes().to_vec(),
            _ => (number as u32).to_le_bytes()[..kind].to_vec(),
        };
        if self.encoding == 2 {
            bytes.reverse();
        }
        self.bytes.extend(bytes);
    }

    fn end(&mut self) {
        if self.encoding == 0 {
            self.bytes.push(b'\n');
        }
    }
}
