//! NumPy files of rays, points and pairs.

use super::{Files, Format, Verdict, refused};
use crate::kind::Fault;
use crate::mutate::Harm;
use crate::random::Random;
use brickwalk::output::npy::{read_pairs, read_points, read_rays};
use std::path::Path;

/// Words of headers.
const NAMES: &[&str] = &[
    "'descr':",
    "'fortran_order':",
    "'shape':",
    "True",
    "False",
    "'<f8'",
    "'>f4'",
    "'<i8'",
    "'O'",
    "'|S5'",
    "[('a', '<f4')]",
    "(1, 8)",
    "(0, 6)",
    "(3,)",
    "()",
    "((((",
    "}",
    "{",
    "(18446744073709551615, 8)",
    "'",
];

/// NumPy files.
pub struct Npy;

impl Format for Npy {
    const NAME: &'static str = "inputs/npy";
    const ABOUT: &'static str = "NumPy files of rays, points and pairs: headers and numbers";

    fn make(&self, random: &mut Random, harm: Harm) -> Files {
        let (rows, columns) = (random.below(9), random.pick([3, 6, 8]));
        let kind = random.pick(["<f8", ">f8", "<f4", ">f4"]);
        let width = if kind.ends_with('8') { 8 } else { 4 };
        let shape = match random.chance(30) {
            true => format!("(1, {rows}, {columns})"),
            false => format!("({rows}, {columns})"),
        };
        let mut text = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}").into_bytes();
        harm.words(random, &mut text, NAMES, 50);
        harm.bytes(random, &mut text, 20);
        let (version, width_of_length) = if random.chance(70) { (1, 2) } else { (2, 4) };
        text.resize((8 + width_of_length + text.len() + 1).next_multiple_of(64) - 8 - width_of_length - 1, b' ');
        text.push(b'\n');
        let mut file =
            [b"\x93NUMPY", &[version, 0][..], &(text.len() as u32).to_le_bytes()[..width_of_length]].concat();
        file.extend(text);
        file.extend((0..rows * columns * width).map(|_| random.word() as u8));
        harm.bytes(random, &mut file, 40);
        let name = match columns {
            3 => "points.npy",
            6 => random.pick(["pairs.npy", "rays.npy"]),
            _ => "rays.npy",
        };
        Files::one(name, file)
    }

    fn read(&self, _: &mut Random, files: &Files, folder: &Path) -> Result<Verdict, Fault> {
        let path = files.write(folder)?;
        let read = match files.name() {
            "points.npy" => read_points(&path).map(|rows| (rows.rows.len(), rows.shape)),
            "pairs.npy" => read_pairs(&path).map(|rows| (rows.rows.len(), rows.shape)),
            _ => read_rays(&path).map(|rays| (rays.rays.len(), rays.shape)),
        };
        match read {
            Ok((count, shape)) if count as u64 == shape.iter().product::<u64>() => Ok(Verdict::Read),
            Ok((count, shape)) => {
                Err(Fault::new("rows are not as many as the shape says", format!("{count} {shape:?}")))
            }
            Err(error) => refused(&error),
        }
    }
}
