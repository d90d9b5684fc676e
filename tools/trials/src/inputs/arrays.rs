//! Files of arrays, which parts of walks are, with their checksum made right.

use super::{Files, Format, Verdict, refused};
use crate::kind::Fault;
use crate::mutate::Harm;
use crate::random::Random;
use bricks::pack::pack;
use brickwalk::output::arrays::Read;
use serde_json::{Value, json};
use std::path::Path;
use xxhash_rust::xxh3::xxh3_64;

/// Keys and texts of heads.
const NAMES: &[&str] = &["arrays", "name", "bytes", "packed", "radiance", "depth", "state", "key", "size"];

/// Files of arrays.
pub struct Arrays;

impl Format for Arrays {
    const NAME: &'static str = "inputs/parts";
    const ABOUT: &'static str = "Parts of walks: heads and packed arrays, with the checksum made right";

    fn make(&self, random: &mut Random, harm: Harm) -> Files {
        let mut blocks = Vec::new();
        let mut rows = Vec::new();
        for (name, width) in [("radiance", 12), ("depth", 4), ("state", 1)] {
            let count = random.below(200);
            let bytes: Vec<u8> =
                (0..count * width).map(|at| if at % 4 > 1 { 63 } else { random.word() as u8 }).collect();
            let mut block = if bytes.is_empty() { Vec::new() } else { pack(&bytes) };
            harm.bytes(random, &mut block, 20);
            let packed: Vec<usize> = if bytes.is_empty() { Vec::new() } else { vec![block.len()] };
            rows.push(json!({"name": name, "bytes": bytes.len(), "packed": packed}));
            blocks.extend(block);
        }
        let mut head = json!({"key": "k", "size": [4, 4], "arrays": rows});
        harm.json(random, &mut head, NAMES, 70);
        let head = head.to_string().into_bytes();
        let mut file = [b"BWARRAY1", &(head.len() as u64).to_le_bytes()[..], &head, &blocks].concat();
        harm.bytes(random, &mut file, 20);
        let checksum = if harm.does(random, 5) { 0 } else { xxh3_64(&file) };
        file.extend(checksum.to_le_bytes());
        Files::one("0000.part", file)
    }

    fn read(&self, random: &mut Random, files: &Files, folder: &Path) -> Result<Verdict, Fault> {
        let read = match Read::open(&files.write(folder)?) {
            Ok(read) => read,
            Err(error) => return refused(&error),
        };
        // Sizes are told by who reads, never by the file; a harmed file may say anything of them.
        let count = |width: u64| {
            let text = String::from_utf8_lossy(files.bytes()).into_owned();
            let start = text.find('{').unwrap_or(0);
            let mut values =
                serde_json::Deserializer::from_str(text.get(start..).unwrap_or_default()).into_iter::<Value>();
            let head = values.next().and_then(Result::ok).unwrap_or_default();
            let row = head["arrays"].as_array().and_then(|rows| {
                let name = if width == 12 {
                    "radiance"
                } else if width == 4 {
                    "depth"
                } else {
                    "state"
                };
                rows.iter().find(|row| row["name"] == name).cloned()
            });
            row.and_then(|row| row["bytes"].as_u64()).unwrap_or(0) / width
        };
        // Pictures have at most as many pixels.
        let most = 1 << 20;
        let depths = read.array::<f32>("depth", count(4).min(most) as usize).map(|values| values.len());
        let all = read.array::<[f32; 3]>("radiance", count(12).min(most) as usize).map(|values| values.len());
        let states = read.array::<u8>("state", random.below(300)).map(|values| values.len());
        match (depths, all, states) {
            (Err(error), ..) | (_, Err(error), _) => refused(&error),
            _ => Ok(Verdict::Read),
        }
    }
}
