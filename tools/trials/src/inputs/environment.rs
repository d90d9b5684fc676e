//! Environments: Radiance HDR and OpenEXR.

use super::pictures::{change_exr, exr};
use super::{Files, Format, Verdict, refused};
use crate::kind::Fault;
use crate::mutate::Harm;
use crate::random::Random;
use brickwalk::session::lighting;
use std::path::Path;

/// Words of HDR headers.
const NAMES: &[&str] = &[
    "#?RADIANCE",
    "#?RGBE",
    "FORMAT=32-bit_rle_rgbe",
    "FORMAT=32-bit_rle_xyze",
    "EXPOSURE=2",
    "GAMMA=1",
    "-Y",
    "+Y",
    "+X",
    "-X",
    "8000",
    "16000",
    "65536",
];

/// Environments.
pub struct Environment;

/// An HDR file, its rows plain or in runs.
fn hdr(random: &mut Random, harm: Harm) -> Vec<u8> {
    let (width, height) = (random.pick([1, 2, 8, 9, 16]), random.within(1, 4));
    let text = format!("#?RADIANCE\n# made here\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n");
    let text = match harm.does(random, 10) {
        true => {
            let [height, width] = [0; 2].map(|_: i32| random.pick([0, 1, 40, 4096, 8192, 16384, 1 << 20]));
            text.replace("-Y", &format!("-Y {height} +X {width}\n# "))
        }
        false => text,
    };
    let mut header = text.into_bytes();
    harm.words(random, &mut header, NAMES, 45);
    let mut rows = Vec::new();
    for _ in 0..height {
        if width < 8 || random.chance(40) {
            // The largest of the three has its first bit: what has not begins a run.
            rows.extend((0..4 * width).map(|at| match at % 4 {
                3 => 129,
                0 => random.word() as u8 | 0x80,
                _ => random.word() as u8 & 0x7f,
            }));
            continue;
        }
        rows.extend([2, 2, 0, width as u8]);
        for _ in 0..4 {
            if random.chance(50) {
                rows.extend([128 + width as u8, random.word() as u8]);
            } else {
                rows.push(width as u8);
                rows.extend((0..width).map(|_| random.word() as u8));
            }
        }
    }
    harm.bytes(random, &mut rows, 50);
    [header, rows].concat()
}

impl Format for Environment {
    const NAME: &'static str = "inputs/environment";
    const ABOUT: &'static str = "Radiance HDR and OpenEXR as environments: headers, runs, blocks";

    fn make(&self, random: &mut Random, harm: Harm) -> Files {
        if random.chance(60) {
            let mut file = hdr(random, harm);
            harm.bytes(random, &mut file, 15);
            return Files::one("a.hdr", file);
        }
        let mut file = exr(random);
        if harm.does(random, 50) {
            change_exr(harm, random, &mut file);
        }
        harm.bytes(random, &mut file, 40);
        Files::one("a.exr", file)
    }

    fn read(&self, _: &mut Random, files: &Files, folder: &Path) -> Result<Verdict, Fault> {
        match lighting::read(&files.write(folder)?) {
            Ok(image) if image.texels.len() as u64 == u64::from(image.width) * u64::from(image.height) => {
                Ok(Verdict::Read)
            }
            Ok(_) => Err(Fault::new("an environment has another number of texels than its size says", files.name())),
            Err(error) => refused(&error),
        }
    }
}
