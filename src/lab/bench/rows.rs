//! `rows.jsonl`: what has been measured, a line a measurement, and the line of settings before them.

use super::cells::{Header, Journal};
use anyhow::Result;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// A measurement.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Its name.
    pub key: String,
    /// Values by name.
    pub values: BTreeMap<String, f64>,
}

/// What has been measured so far.
pub struct Rows(Journal<Row>);

impl Rows {
    /// Opens the measurements of `folder`, or begins them.
    ///
    /// # Errors
    /// As those of [`Journal::open`].
    pub fn open(folder: &Path, header: Header) -> Result<Self> {
        Journal::open(folder.join("rows.jsonl"), header, false).map(Self)
    }

    /// The settings.
    pub fn header(&self) -> &Header {
        self.0.header()
    }

    /// All of them.
    pub fn all(&self) -> &[Row] {
        self.0.all()
    }

    /// Whether one is there.
    pub fn has(&self, key: &str) -> bool {
        self.all().iter().any(|row| row.key == key)
    }

    /// A value of one, if it is there.
    pub fn value(&self, key: &str, name: &str) -> Option<f64> {
        self.all().iter().find(|row| row.key == key)?.values.get(name).copied()
    }

    /// Appends one.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn push(&mut self, row: Row) -> Result<()> {
        self.0.push(row)
    }
}
