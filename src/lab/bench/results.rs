//! What a bench writes: one JSON file, a CSV a table, Markdown and an offline page, all of the same tables.

use super::store::{Header, Rows};
use crate::output::atomic;
use anyhow::Result;
use brickwalk_report::{Graph, GraphShape, Line, Section, Sheet, Table, Unit, Value, write_sheet};
use serde_json::json;
use std::fmt::Write;
use std::path::Path;

/// The results of a bench.
pub struct Results<'a> {
    /// The bench, which the files are called after.
    pub name: &'static str,
    /// Their title.
    pub title: &'static str,
    /// How to read them.
    pub reading: &'static str,
    /// The settings of what has been measured.
    pub header: &'a Header,
    /// What it was measured with, beside adapter and commit.
    pub facts: Vec<(&'static str, String)>,
    /// What a reader must know first; true: a warning.
    pub verdicts: Vec<(String, bool)>,
    /// What the JSON file has beside settings and tables.
    pub json: serde_json::Value,
    /// Tables and plots.
    pub sections: Vec<Section>,
}

impl<'a> Results<'a> {
    /// Those of a bench whose measurements are `rows`; `planned` were asked for.
    pub fn of_rows(
        (name, title, reading): (&'static str, &'static str, &'static str),
        rows: &'a Rows,
        planned: usize,
        facts: Vec<(&'static str, String)>,
        sections: Vec<Section>,
    ) -> Self {
        let done = rows.all().len();
        let rest = if done < planned { format!("; {planned} were asked for") } else { String::new() };
        let verdicts = vec![(format!("{done} measurements{rest}"), done < planned)];
        let json = json!({ "measured": done, "rows": rows.all() });
        Self { name, title, reading, header: &rows.header, facts, verdicts, json, sections }
    }

    /// Writes them into a folder; returns the Markdown.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub fn write(mut self, folder: &Path) -> Result<String> {
        let Header { format, settings, adapter, commit } = self.header;
        let tables = || self.sections.iter().flat_map(|section| &section.tables);
        let mut json = json!({
            "format": format,
            "version": env!("CARGO_PKG_VERSION"),
            "commit": commit,
            "adapter": adapter,
            "settings": settings,
            "tables": tables().collect::<Vec<_>>(),
        });
        if let (Some(json), Some(own)) = (json.as_object_mut(), self.json.as_object_mut()) {
            json.append(own);
        }
        write_json(folder, self.name, &json)?;
        for table in tables() {
            atomic::write(&folder.join(format!("{}.csv", table.name)), table.to_csv().as_bytes())?;
        }
        let word = |name: &str| adapter[name].as_str().unwrap_or("unknown");
        let driver = format!("{} {}", word("driver"), word("driver_info"));
        let mut facts = vec![
            ("Adapter", format!("{} ({})", word("name"), word("backend"))),
            ("Driver", driver.trim().into()),
            ("Commit", commit.clone()),
        ];
        facts.append(&mut self.facts);
        let mut text = format!("# {}\n\n{}\n\n", self.title, self.reading);
        // Writing to a string does not fail.
        for (name, value) in &facts {
            let _ = writeln!(text, "- {name}: {value}");
        }
        for (warning, _) in self.verdicts.iter().filter(|(_, warns)| *warns) {
            let _ = writeln!(text, "- **{warning}**");
        }
        for section in self.sections.iter().filter(|section| !section.tables.is_empty()) {
            let _ = write!(text, "\n## {}\n", section.title);
            for table in &section.tables {
                if !["", self.reading].contains(&table.caption.as_str()) {
                    let _ = writeln!(text, "\n{}", table.caption);
                }
                let _ = write!(text, "\n{}", table.to_markdown());
            }
        }
        atomic::write(&folder.join(format!("{}.md", self.name)), text.as_bytes())?;
        if let Some(first) = self.sections.first_mut() {
            first.reading = self.reading.into();
        }
        let sheet = Sheet {
            kicker: format!("brickwalk · bench {}", self.name),
            title: self.title.into(),
            verdicts: self.verdicts,
            facts: facts.into_iter().map(|(name, value)| (name.into(), value)).collect(),
            sections: self.sections,
        };
        write_sheet(folder, &sheet)?;
        Ok(text)
    }
}

/// Writes the JSON file of a bench.
///
/// # Errors
/// The folder cannot be written.
pub fn write_json(folder: &Path, name: &str, json: &serde_json::Value) -> Result<()> {
    let text = serde_json::to_string_pretty(json)? + "\n";
    atomic::write(&folder.join(format!("{name}.json")), text.as_bytes())
}

/// A column of a table: its head, and its entry in a row.
pub type Column<R> = (&'static str, fn(&R) -> Value);

/// A table with an entry in every column of each of `rows`.
pub fn table<R>(name: &str, caption: &str, rows: impl IntoIterator<Item = R>, columns: &[Column<R>]) -> Table {
    let entries = |row: R| columns.iter().map(|(_, entry)| entry(&row)).collect();
    Table {
        name: name.into(),
        caption: caption.into(),
        columns: columns.iter().map(|(head, _)| (*head).to_string()).collect(),
        rows: rows.into_iter().map(entries).collect(),
    }
}

/// `value` times a hundred.
pub fn percent(value: Option<f64>) -> Value {
    Value::number(value.map(|value| 100.0 * value))
}

/// `a` over `b`, where both are above zero.
pub fn ratio(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    a.zip(b).filter(|(a, b)| *a > 0.0 && *b > 0.0).map(|(a, b)| a / b)
}

/// A plot of lines whose points may be in any order.
pub fn plot(title: String, reading: &str, across: &'static str, unit: Unit, mut lines: Vec<Line>) -> Graph {
    for (_, points) in &mut lines {
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    Graph { title, reading: reading.into(), shape: GraphShape::Lines { across, unit, is_log: false, lines } }
}

/// [`plot`] with logarithmic axes.
pub fn log_plot(title: String, reading: &str, across: &'static str, unit: Unit, lines: Vec<Line>) -> Graph {
    let mut graph = plot(title, reading, across, unit, lines);
    if let GraphShape::Lines { is_log, .. } = &mut graph.shape {
        *is_log = true;
    }
    graph
}
