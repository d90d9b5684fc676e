//! The words of the command line.

use super::{Files, Format, Verdict};
use crate::kind::Fault;
use crate::mutate::Harm;
use crate::random::Random;
use brickwalk::cli::options::args::Cli;
use clap::Parser;
use std::path::Path;

/// Words of command lines.
const NAMES: &[&str] = &[
    "--size",
    "--cache",
    "--frames",
    "--spp",
    "--effects",
    "--secondary",
    "--sun",
    "--tone-map",
    "--seed",
    "--lod",
    "--schedule",
    "--hidden",
    "--memory",
    "--threads",
    "--lattice",
    "--brick-triangles",
    "--transform",
    "--scene-name",
    "--disk-cache",
    "--frame-budget",
    "--adapter",
    "-o",
    "-h",
    "-V",
    "--",
    "-v",
    "convert",
    "scene",
    "walk",
    "query",
    "trace",
    "99999999999G",
    "5%",
    "640x360",
    "0x0",
    "1,2,3",
    "primary,diffuse",
    "auto",
    "cpu",
    "finest",
    "-126",
    "roma=diffuse",
    "1e400",
    "nan",
    "city",
    "=",
    "4ms,2M",
    "a,1G",
    "",
];

/// Sound command lines.
const LINES: [&str; 8] = [
    "walk a.bricks -o out --size 64x36 --frames 3 --cache 20% --effects primary,diffuse --spp 4",
    "convert a.glb b.obj -o a.bricks --memory 64M --brick-triangles 4K --threads 2 --lattice -10",
    "scene city --triangles 10K --seed 3 -o a.bricks",
    "query cast a.bricks r.npy -o h.npy",
    "trace a.bricks --rays r.npy -o h.npy --schedule demand --cache 1G",
    "replay r.jsonl --cache 64M",
    "compare a.png b.png --json",
    "bake-displacement a.bricks --of objects --bits 1",
];

/// Command lines.
pub struct Words;

impl Format for Words {
    const NAME: &'static str = "inputs/words";
    const ABOUT: &'static str = "Words of the command line: parsed or refused";
    const NAMES_FILE: bool = false;

    fn make(&self, random: &mut Random, harm: Harm) -> Files {
        let mut line = random.pick(LINES).as_bytes().to_vec();
        harm.words(random, &mut line, NAMES, 95);
        harm.bytes(random, &mut line, 10);
        Files::one("words", line)
    }

    fn read(&self, _: &mut Random, files: &Files, _: &Path) -> Result<Verdict, Fault> {
        let line = String::from_utf8_lossy(files.bytes()).into_owned();
        match Cli::try_parse_from(std::iter::once("brickwalk").chain(line.split(' '))) {
            Ok(_) => Ok(Verdict::Read),
            // Usage has lines of its own: that something is said is all that counts.
            Err(error) if !error.to_string().trim().is_empty() => Ok(Verdict::Refused("usage".into())),
            Err(_) => Err(Fault::new("a refusal says nothing", line)),
        }
    }
}
