//! What benches write that keep their measurements in rows: one JSON file, a CSV a table, Markdown and an offline page,
//! all of the same tables.

use super::rows::Rows;
use crate::output::atomic;
use anyhow::Result;
use brickwalk_report::{Section, Sheet, write_sheet};
use serde_json::{Value, json};
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
    /// What it was measured with, beside adapter and commit.
    pub facts: Vec<(&'static str, String)>,
    /// Tables and plots.
    pub sections: Vec<Section>,
    /// What has been measured.
    pub rows: &'a Rows,
    /// Measurements that were asked for.
    pub planned: usize,
}

impl Results<'_> {
    /// Writes them into a folder; returns what to print.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub fn write(mut self, folder: &Path) -> Result<String> {
        let (header, done) = (self.rows.header(), self.rows.all().len());
        let tables = || self.sections.iter().flat_map(|section| &section.tables);
        let json = json!({
            "format": header.format,
            "version": env!("CARGO_PKG_VERSION"),
            "commit": header.commit,
            "adapter": header.adapter,
            "settings": header.settings,
            "measured": done,
            "tables": tables().collect::<Vec<_>>(),
            "rows": self.rows.all(),
        });
        let file = |extension: &str| folder.join(format!("{}.{extension}", self.name));
        atomic::write(&file("json"), (serde_json::to_string_pretty(&json)? + "\n").as_bytes())?;
        for table in tables() {
            atomic::write(&folder.join(format!("{}.csv", table.name)), table.to_csv().as_bytes())?;
        }
        let facts = [adapter(&header.adapter), vec![("Commit", header.commit.clone())], self.facts].concat();
        let facts: Vec<(String, String)> = facts.into_iter().map(|(name, value)| (name.to_string(), value)).collect();
        let mut text = format!("# {}\n\n{}\n\n", self.title, self.reading);
        // Writing to a string does not fail.
        for (name, value) in &facts {
            let _ = writeln!(text, "- {name}: {value}");
        }
        for section in &self.sections {
            let _ = write!(text, "\n## {}\n", section.title);
            for table in &section.tables {
                if !["", self.reading].contains(&table.caption.as_str()) {
                    let _ = writeln!(text, "\n{}", table.caption);
                }
                let _ = write!(text, "\n{}", table.to_markdown());
            }
        }
        atomic::write(&file("md"), text.as_bytes())?;
        if let Some(first) = self.sections.first_mut() {
            first.reading = self.reading.into();
        }
        let is_part = done < self.planned;
        let rest = if is_part { format!("; {} were asked for", self.planned) } else { String::new() };
        let verdicts = vec![(format!("{done} measurements{rest}"), is_part)];
        let kicker = format!("brickwalk · bench {}", self.name);
        write_sheet(folder, &Sheet { kicker, title: self.title.into(), verdicts, facts, sections: self.sections })?;
        Ok(text)
    }
}

/// What rendered, and its driver where it has one.
fn adapter(adapter: &Value) -> Vec<(&'static str, String)> {
    let text = |name: &str| adapter[name].as_str().unwrap_or("unknown").to_string();
    let driver = format!("{} {}", text("driver"), text("driver_info"));
    vec![("Adapter", format!("{} ({})", text("name"), text("backend"))), ("Driver", driver.trim().to_string())]
}
