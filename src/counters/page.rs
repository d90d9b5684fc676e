//! The page on `records.jsonl`, written from the table.

use super::{COLUMNS, Column, Kind, Source};
use std::fmt::Write;

const HEAD: &str = "\
# Fields of `records.jsonl`

Generated from [the table of counters](../src/counters/table.rs). `BRICKWALK_WRITE=1 cargo test --lib counters` writes
this page anew.

A walk appends a line, a JSON object, for each frame and effect. `report.html` and the totals of `summary.json` are made
of these lines.

*Adds up as* says how values of several passes of an effect become one:

| kind | meaning |
| --- | --- |
| sum | they add up |
| most | the greatest |
| state | said once, when the effect ends; sums over frames mean nothing |
| distinct | a set of bricks; the field says how many are in it |
| names | a text; each name once |
| derived | follows from other fields |

Kernels count where *counted by* says device, else the host.

| field | unit | adds up as | counted by | meaning |
| --- | --- | --- | --- | --- |
| `frame` | | state | host | Frame, from 0. |
| `pass` | | state | host | The effect. |
";

/// `docs/records.md`.
pub fn page() -> String {
    let mut text = HEAD.to_string();
    for column in COLUMNS.iter().filter(|column| column.is_written) {
        let Column { name, unit, kind, source, .. } = column;
        let kind = match kind {
            Kind::Sum => "sum",
            Kind::Max => "most",
            Kind::State => "state",
            Kind::Distinct => "distinct",
            Kind::Names => "names",
            Kind::Derived => "derived",
        };
        let source = match source {
            Source::Host => "host",
            Source::Device => "device",
        };
        // Writing to a string does not fail.
        let _ = writeln!(text, "| `{name}` | {unit} | {kind} | {source} | {} |", column.description());
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn the_page_is_that_of_the_table() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/records.md");
        if std::env::var_os("BRICKWALK_WRITE").is_some() {
            std::fs::write(&path, page()).expect("docs/records.md can be written");
        }
        let committed = std::fs::read_to_string(&path).expect("docs/records.md");
        assert!(committed == page(), "docs/records.md is out of date: BRICKWALK_WRITE=1 cargo test --lib counters");
    }

    #[test]
    fn every_field_says_what_it_means() {
        for column in COLUMNS {
            let text = column.description();
            assert!(text.starts_with(char::is_uppercase) && text.ends_with('.'), "{}: {text}", column.name);
            assert!(!column.unit.is_empty() && !text.contains("  "), "{}: {text}", column.name);
        }
    }
}
