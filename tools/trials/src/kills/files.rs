//! What is in a folder, and what is made there for commands to read.

use crate::kind::Fault;
use bricks::{Payload, SceneFile};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The files below a folder, by their names from there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Snapshot(BTreeMap<String, Vec<u8>>);

/// How the files of two runs are compared.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Comparison {
    /// Byte by byte.
    Bytes,
    /// Both are whole: they hold times.
    Whole,
    /// Neither counts.
    Not,
}

/// Of a file, by its name.
fn comparison(name: &str) -> Comparison {
    let (stem, extension) = name.rsplit_once('.').unwrap_or((name, ""));
    match extension {
        "json" if stem.ends_with(".near") || stem.ends_with(".far") => Comparison::Bytes,
        "json" | "jsonl" | "html" | "csv" | "md" => Comparison::Whole,
        // Which process made a part, and how long it took.
        "part" => Comparison::Whole,
        _ if name.starts_with(".config") => Comparison::Not,
        _ => Comparison::Bytes,
    }
}

fn failed(error: impl std::fmt::Display) -> Fault {
    Fault::new("a folder cannot be read", error.to_string())
}

impl Snapshot {
    /// Reads a folder.
    ///
    /// # Errors
    /// It cannot be read.
    pub fn read(folder: &Path) -> Result<Self, Fault> {
        let mut files = BTreeMap::new();
        let mut open = vec![PathBuf::new()];
        while let Some(below) = open.pop() {
            for entry in std::fs::read_dir(folder.join(&below)).map_err(failed)? {
                let entry = entry.map_err(failed)?;
                let name = below.join(entry.file_name());
                if entry.file_type().map_err(failed)?.is_dir() {
                    open.push(name);
                } else {
                    files.insert(name.to_string_lossy().into_owned(), std::fs::read(entry.path()).map_err(failed)?);
                }
            }
        }
        Ok(Self(files))
    }

    /// Writes it into a folder.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), Fault> {
        for (name, bytes) in &self.0 {
            let path = folder.join(name);
            std::fs::create_dir_all(path.parent().unwrap_or(folder)).map_err(failed)?;
            std::fs::write(&path, bytes).map_err(failed)?;
        }
        Ok(())
    }

    /// A file.
    pub fn get(&self, name: &str) -> Option<&[u8]> {
        self.0.get(name).map(Vec::as_slice)
    }

    /// The names of all.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(String::as_str)
    }

    /// Bytes of the largest file.
    pub fn largest(&self) -> u64 {
        self.0.values().map(Vec::len).max().unwrap_or(0) as u64
    }

    /// In what it differs from what it should be.
    pub fn difference(&self, expected: &Self) -> Option<String> {
        let counts = |name: &&str| comparison(name) != Comparison::Not;
        if let Some(name) = expected.names().filter(counts).find(|name| self.get(name).is_none()) {
            return Some(format!("{name} is not there"));
        }
        if let Some(name) = self.names().filter(counts).find(|name| expected.get(name).is_none()) {
            return Some(format!("{name} is left"));
        }
        for (name, bytes) in &expected.0 {
            let own = self.get(name).unwrap_or_default();
            if comparison(name) == Comparison::Bytes && own != bytes {
                let at = own.iter().zip(bytes).position(|(a, b)| a != b).unwrap_or(own.len().min(bytes.len()));
                return Some(format!("{name} differs at byte {at} of {} and {}", own.len(), bytes.len()));
            }
        }
        self.names().find_map(|name| broken(name, self.get(name).unwrap_or_default()))
    }

    /// A file that is not whole although it has its name; those that were there before aside.
    pub fn broken(&self, before: &Self) -> Option<String> {
        let fresh = self.0.iter().filter(|(name, bytes)| before.get(name) != Some(bytes));
        // Hidden names are those of what is not finished.
        let named = fresh.filter(|(name, _)| !name.split('/').any(|part| part.starts_with('.')));
        named.filter_map(|(name, bytes)| broken(name, bytes)).next()
    }
}

/// What is wrong with a file, by its name.
fn broken(name: &str, bytes: &[u8]) -> Option<String> {
    let is_json = |text: &[u8]| serde_json::from_slice::<serde_json::Value>(text).is_ok();
    let is_whole = match name.rsplit_once('.').map_or("", |(_, extension)| extension) {
        "json" => is_json(bytes),
        // The last line may be in the making.
        "jsonl" => {
            let whole = bytes.iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1);
            bytes[..whole].split(|&byte| byte == b'\n').all(|line| line.is_empty() || is_json(line))
        }
        "png" => image::load_from_memory(bytes).is_ok(),
        "html" => bytes.trim_ascii_end().ends_with(b"</html>"),
        _ => return None,
    };
    (!is_whole).then(|| format!("{name}: {} bytes", bytes.len()))
}

/// Writes rays, or points where the name says so, over the scenes that are generated.
///
/// # Errors
/// The file cannot be written.
pub fn numbers(path: &Path) -> Result<(), Fault> {
    let is_points = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("points"));
    let columns = if is_points { 3 } else { 6 };
    let rows = 4000u32;
    let mut header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({rows}, {columns}), }}").into_bytes();
    header.resize((10 + header.len() + 1).next_multiple_of(64) - 11, b' ');
    header.push(b'\n');
    let mut bytes = [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], &header].concat();
    for row in 0..rows {
        let (x, z) = (f64::from(row % 61) * 8.0 - 240.0, f64::from(row / 61) * 8.0 - 240.0);
        let all = [x, 60.0, z, 0.1, -1.0, 0.05];
        all[..columns].iter().for_each(|number| bytes.extend(number.to_le_bytes()));
    }
    std::fs::write(path, bytes).map_err(failed)
}

/// Flips a bit in some payloads of a scene file, so that there is something to repair.
///
/// # Errors
/// It is no scene file, or cannot be written.
pub fn damage(path: &Path) -> Result<(), Fault> {
    let mut bytes = std::fs::read(path).map_err(failed)?;
    {
        let scene = SceneFile::open(path).map_err(failed)?;
        for brick in (0..scene.resident().bricks.len() as u32).step_by(3) {
            for payload in [Payload::Geometry(brick), Payload::Attributes(brick)] {
                let span = scene.span(payload);
                if let Some(byte) = bytes.get_mut((span.offset + span.bytes / 2) as usize) {
                    *byte ^= 4;
                }
            }
        }
    }
    std::fs::write(path, bytes).map_err(failed)
}
