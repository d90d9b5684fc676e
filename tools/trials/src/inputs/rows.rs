//! Files of measurements, from which studies and benchmarks go on.

use super::{Files, Format, Verdict, refused};
use crate::kind::Fault;
use crate::mutate::Harm;
use crate::random::Random;
use brickwalk::lab::bench::store::{Header, Row, Rows};
use serde_json::{Value, json};
use std::path::Path;

/// Keys of lines.
const NAMES: &[&str] = &["format", "settings", "adapter", "commit", "key", "values", "name", "a", "b"];

/// Files of measurements.
pub struct RowFiles;

impl Format for RowFiles {
    const NAME: &'static str = "inputs/rows";
    const ABOUT: &'static str = "rows.jsonl: what is read goes on, and keeps every measurement";
    const IS_LINE: bool = false;

    fn make(&self, random: &mut Random, harm: Harm) -> Files {
        let mut lines = vec![json!({"format": 3, "settings": {"spp": 4}, "adapter": {"name": "cpu"}, "commit": "c"})];
        lines.extend((0..random.below(6)).map(|at| json!({"key": format!("k{at}"), "values": {"a": at, "b": 0.5}})));
        let at = random.below(lines.len());
        harm.json(random, &mut lines[at], NAMES, 60);
        let mut text =
            lines.iter().map(Value::to_string).fold(String::new(), |all, line| all + &line + "\n").into_bytes();
        harm.bytes(random, &mut text, 50);
        Files::one("rows.jsonl", text)
    }

    fn read(&self, _: &mut Random, files: &Files, folder: &Path) -> Result<Verdict, Fault> {
        let path = files.write(folder)?;
        let adapter = json!({"name": "cpu"});
        let header = Header { format: 3, settings: json!({"spp": 4}), adapter, commit: "c".into() };
        let mut rows = match Rows::open(path.clone(), header.clone(), true) {
            Ok(rows) => rows,
            Err(error) => return refused(&error),
        };
        let before = rows.all().to_vec();
        let fresh = Row { key: "fresh".into(), values: [("a".to_owned(), 1.0)].into() };
        let went_on = rows.push(fresh.clone()).and_then(|()| Rows::open(path, header, true));
        let expected =
            if before.iter().any(|row| row.key == "fresh") { before } else { [before, vec![fresh]].concat() };
        match went_on {
            Ok(rows) if rows.all() == expected => Ok(Verdict::Read),
            Ok(rows) => Err(Fault::new("measurements are lost", format!("{:?}", rows.all()))),
            Err(error) => Err(Fault::new("measurements cannot go on", format!("{error:#}"))),
        }
    }
}
