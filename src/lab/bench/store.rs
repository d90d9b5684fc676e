//! What has been measured, a line each, and the line of settings before them: a file that grows while a bench runs and
//! is where a later start goes on.

use crate::kernels::DeviceInfo;
pub use crate::math::median::median;
use crate::output::atomic::JsonLines;
use crate::session::device::Device;
use crate::settings::Adapter;
use anyhow::{Context, Result, bail};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::{BTreeMap, HashSet};
use std::path::PathBuf;

/// The first line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Raised when a field changes its meaning.
    pub format: u32,
    /// Everything that decides what is measured.
    pub settings: Value,
    /// Name, driver and backend of the adapter.
    pub adapter: Value,
    /// Commit of the program.
    pub commit: String,
}

impl Header {
    /// Of this program on `adapter`.
    ///
    /// # Errors
    /// The device's.
    pub fn new(format: u32, adapter: &Adapter, settings: Value) -> Result<Self> {
        let adapter = device(&Device::open(adapter)?.info());
        Ok(Self { format, settings, adapter, commit: env!("BRICKWALK_COMMIT").into() })
    }

    /// The settings in which it differs from `wanted`, with its own values.
    fn difference(&self, wanted: &Self) -> String {
        let mut parts = Vec::new();
        for (name, value) in self.settings.as_object().into_iter().flatten() {
            let now = wanted.settings.get(name);
            if now != Some(value) {
                parts.push(format!("{name} {value} rather than {}", now.unwrap_or(&Value::Null)));
            }
        }
        if self.adapter != wanted.adapter {
            parts.push(format!("adapter {}", self.adapter["name"]));
        }
        if self.commit != wanted.commit {
            parts.push(format!("commit {}", self.commit));
        }
        if parts.is_empty() { "other settings".into() } else { parts.join(", ") }
    }
}

/// A device as results name it.
pub fn device(info: &DeviceInfo) -> Value {
    let DeviceInfo { name, driver, driver_info, backend, .. } = info;
    json!({ "name": name, "driver": driver, "driver_info": driver_info, "backend": backend })
}

/// A line.
pub trait Entry: Serialize + DeserializeOwned {
    /// What it is told from others by.
    fn key(&self) -> String;
}

/// Values by name.
pub type Values = BTreeMap<String, f64>;

/// A measurement of some values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Its name.
    pub key: String,
    /// The values.
    pub values: Values,
}

impl Entry for Row {
    fn key(&self) -> String {
        self.key.clone()
    }
}

/// A file of measurements.
pub struct Store<T> {
    /// Its first line.
    pub header: Header,
    entries: Vec<T>,
    keys: HashSet<String>,
    lines: JsonLines,
}

/// A file of rows.
pub type Rows = Store<Row>;

impl<T: Entry> Store<T> {
    /// Opens the measurements of `file`, or begins them.
    ///
    /// # Errors
    /// The file is none of measurements, or of others than `header` says; it cannot be read or written.
    pub fn open(file: PathBuf, header: Header, must_exist: bool) -> Result<Self> {
        let name = file.display();
        let text = match std::fs::read_to_string(&file) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound && !must_exist => String::new(),
            Err(error) => {
                return Err(error).with_context(|| format!("{name}: cannot read the measurements to go on with"));
            }
        };
        // A line without an end was being written when the process was killed.
        let whole = &text[..text.rfind('\n').map_or(0, |end| end + 1)];
        let mut text_lines = whole.lines();
        let mut entries: Vec<T> = Vec::new();
        let mut lines;
        if let Some(first) = text_lines.next() {
            let found = serde_json::from_str(first).ok().filter(|found: &Header| found.format == header.format);
            let found = found.with_context(|| {
                format!("{name}: line 1 holds no settings of this version; choose another folder with -o")
            })?;
            if found != header {
                let difference = found.difference(&header);
                bail!("{name}: measured with {difference}; choose another folder with -o, or the same settings");
            }
            for (number, line) in text_lines.enumerate() {
                let entry = serde_json::from_str(line)
                    .with_context(|| format!("{name}: line {}: no measurement; remove the line", number + 2))?;
                entries.push(entry);
            }
            lines = JsonLines::append(&file, whole.len() as u64)?;
        } else {
            lines = JsonLines::create(&file)?;
            lines.push(&header)?;
        }
        let keys = entries.iter().map(T::key).collect();
        Ok(Self { header, entries, keys, lines })
    }

    /// All measurements.
    pub fn all(&self) -> &[T] {
        &self.entries
    }

    /// Whether one is there.
    pub fn has(&self, key: &str) -> bool {
        self.keys.contains(key)
    }

    /// Appends one, if it is not there.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn push(&mut self, entry: T) -> Result<()> {
        if self.keys.insert(entry.key()) {
            self.lines.push(&entry)?;
            self.entries.push(entry);
        }
        Ok(())
    }
}

impl Rows {
    /// A value of a measurement, if it is there.
    pub fn value(&self, key: &str, name: &str) -> Option<f64> {
        self.all().iter().find(|row| row.key == key)?.values.get(name).copied()
    }
}
