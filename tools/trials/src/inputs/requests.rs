//! Recorded requests, and their replay.

use super::{Files, Format, Verdict};
use crate::kind::Fault;
use crate::mutate::Harm;
use crate::random::Random;
use brickwalk::stream::{Replay, Trace, replay};
use serde_json::{Value, json};
use std::path::Path;

/// Keys and texts of traces.
const NAMES: &[&str] = &[
    "format",
    "policy",
    "round-robin",
    "second-chance",
    "lru",
    "budget_bytes",
    "page_bytes",
    "passes",
    "sizes",
    "tiles",
    "frame",
    "pass",
    "requests",
    "batches",
    "g0",
    "a0",
    "t0",
    "g4294967295",
    "t9",
    "x1",
    "g-1",
    "g",
    "primary",
];

/// Traces of requests.
pub struct Requests;

impl Format for Requests {
    const NAME: &'static str = "inputs/requests";
    const ABOUT: &'static str = "Recorded requests, and their replay against all caches";
    const IS_LINE: bool = false;
    const NAMES_FILE: bool = false;

    fn make(&self, random: &mut Random, harm: Harm) -> Files {
        let bricks = random.within(1, 6);
        let mut size = || 16 * random.within(1, 64);
        let sizes: Vec<[usize; 2]> = (0..bricks).map(|_| [size(), size()]).collect();
        let passes = random.within(0, 4);
        let policy = random.pick(["round-robin", "second-chance", "lru"]);
        let head = json!({"format": 4, "policy": policy, "budget_bytes": 65536, "page_bytes": 4096, "passes": passes,
            "sizes": sizes, "tiles": [16, 1024]});
        let mut lines = vec![head];
        for _ in 0..passes {
            let requests: Vec<String> = (0..random.below(12))
                .map(|_| match random.below(3) {
                    0 => format!("g{}", random.below(bricks)),
                    1 => format!("a{}", random.below(bricks)),
                    _ => format!("t{}", random.below(2)),
                })
                .collect();
            let mut batches: Vec<usize> = (0..random.below(4)).map(|_| random.below(requests.len() + 1)).collect();
            batches.sort_unstable();
            lines.push(json!({"frame": 0, "pass": "primary", "requests": requests, "batches": batches}));
        }
        let at = random.below(lines.len());
        harm.json(random, &mut lines[at], NAMES, 85);
        let lines: Vec<String> = lines.iter().map(Value::to_string).collect();
        let mut text = lines.join("\n").into_bytes();
        text.push(b'\n');
        harm.bytes(random, &mut text, 20);
        Files::one("requests.jsonl", text)
    }

    fn read(&self, _: &mut Random, files: &Files, _: &Path) -> Result<Verdict, Fault> {
        let trace = match Trace::read(files.bytes()) {
            Ok(trace) => trace,
            Err(error) => return Ok(Verdict::Refused(error.to_string())),
        };
        let mut distinct = None;
        for against in Replay::ALL {
            let result = match replay(&trace, trace.sizes.clone(), trace.budget_bytes, trace.page_bytes, against) {
                Ok(result) => result,
                Err(error) => return Ok(Verdict::Refused(error.to_string())),
            };
            if result.loads < result.distinct || result.hits + result.loads < result.requests {
                return Err(Fault::new("a replay does not count what it should", format!("{against:?}: {result:?}")));
            }
            if *distinct.get_or_insert(result.distinct_bytes) != result.distinct_bytes {
                return Err(Fault::new("replays disagree on what there is", format!("{against:?}: {result:?}")));
            }
        }
        Ok(Verdict::Read)
    }
}
