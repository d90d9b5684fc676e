//! What batched and instanced models have in common (OGC 18-053r2, sections 8.1 and 8.2): a header, two tables, a body.

use crate::import::bytes::{Bytes, Reader};
use crate::import::error::one_line;
use serde::Deserialize;
use serde::de::DeserializeOwned;

/// Largest JSON of a feature table: it holds a few numbers, and where in the binary part arrays are.
const MAX_TABLE_BYTES: u64 = 1 << 20;

/// A file of a header, two tables and a body. The table of batches is passed over.
pub(super) struct Batched<F> {
    /// The JSON of the feature table; `None` if there is none.
    pub features: Option<F>,
    /// Its binary part.
    pub binary: Bytes,
    /// What is behind the tables.
    pub body: Bytes,
    /// The eighth word of the header, 0 if it has none.
    pub format: u64,
}

/// Opens a file with a header of so many words: 7, or 8.
pub(super) fn open<F: DeserializeOwned>(bytes: &Bytes, reader: &Reader, words: u64) -> Result<Batched<F>, String> {
    let word = |index: u64| {
        let mut bytes = [0; 4];
        reader.read_at(4 * index, &mut bytes).map_err(|_| "the file ends within its header")?;
        Ok::<_, String>(u64::from(u32::from_le_bytes(bytes)))
    };
    let version = word(1)?;
    if version != 1 {
        return Err(format!("version {version} is not 1"));
    }
    let length = word(2)?;
    let tables = [word(3)?, word(4)?, word(5)?, word(6)?];
    let format = if words > 7 { word(7)? } else { 0 };
    let header = 4 * words;
    let body = header + tables.iter().sum::<u64>();
    if length > bytes.len() {
        return Err(format!("its header states {length} bytes, the file has {}", bytes.len()));
    }
    if body >= length {
        return Err(format!("its tables of {tables:?} bytes leave no room for glTF in {length} bytes"));
    }
    // Within the file: checked above.
    let piece = |start: u64, end: u64| bytes.slice(start, end).ok_or("a table lies outside the file");
    let json_end = header + tables[0];
    if tables[0] > MAX_TABLE_BYTES {
        return Err(format!("a feature table of {} bytes is too large", tables[0]));
    }
    let text = piece(header, json_end)?.read()?;
    // Padded with spaces, by some writers with zeros.
    let text = text.trim_ascii_end();
    let text = &text[..text.iter().rposition(|&c| c != 0).map_or(0, |last| last + 1)];
    let unreadable = |e: serde_json::Error| format!("its feature table cannot be read: {}", one_line(&e.to_string()));
    let features = if text.is_empty() { None } else { Some(serde_json::from_slice(text).map_err(unreadable)?) };
    let binary = piece(json_end, json_end + tables[1])?;
    Ok(Batched { features, binary, body: piece(body, length)?, format })
}

/// Where in the binary part something is.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Place {
    byte_offset: u64,
}

impl Place {
    /// The `bytes` bytes of `name` there.
    pub fn read(self, binary: &Bytes, name: &str, bytes: u64) -> Result<Vec<u8>, String> {
        let end = self.byte_offset.checked_add(bytes);
        let piece = end.and_then(|end| binary.slice(self.byte_offset, end));
        piece.ok_or_else(|| format!("its {name} lies outside the feature table"))?.read()
    }
}

/// Three numbers in the JSON, or in the binary part, there as f32.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(untagged)]
pub(super) enum Triple {
    Inline([f64; 3]),
    Binary(Place),
}

impl Triple {
    /// The numbers of `name`; finite.
    pub fn read(self, binary: &Bytes, name: &str) -> Result<[f64; 3], String> {
        let values = match self {
            Self::Inline(values) => values,
            Self::Binary(place) => floats(&place.read(binary, name, 12)?)[0],
        };
        if values.iter().all(|c| c.is_finite()) { Ok(values) } else { Err(format!("its {name} is not finite")) }
    }
}

/// Numbers of f32, `N` at a time.
pub(super) fn floats<const N: usize>(bytes: &[u8]) -> Vec<[f64; N]> {
    let number = |bytes: &[u8; 4]| f64::from(f32::from_le_bytes(*bytes));
    bytes.as_chunks::<4>().0.chunks_exact(N).map(|n| std::array::from_fn(|k| number(&n[k]))).collect()
}
