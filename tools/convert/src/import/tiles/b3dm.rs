//! Batched 3D models (OGC 18-053r2, section 8.1): a header, two tables, a glTF file.

use crate::import::bytes::{Bytes, Reader};
use crate::import::error::one_line;
use serde::Deserialize;

const HEADER_BYTES: u64 = 28;

/// Largest feature table: it holds a number and a point.
const MAX_TABLE_BYTES: u64 = 1 << 20;

/// What is read of the feature table.
#[derive(Deserialize)]
#[serde(rename_all = "UPPERCASE")]
struct Features {
    rtc_center: Option<Center>,
}

/// A point in the JSON, or in the binary part, there as f32.
#[derive(Deserialize)]
#[serde(untagged)]
enum Center {
    Inline([f64; 3]),
    #[serde(rename_all = "camelCase")]
    Binary {
        byte_offset: u64,
    },
}

/// The glTF file within `bytes`, and the point of the tile that its coordinates are relative to, Z up. The table of
/// batches is passed over.
pub(super) fn open(bytes: &Bytes, reader: &Reader) -> Result<(Bytes, [f64; 3]), String> {
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
    let gltf = HEADER_BYTES + tables.iter().sum::<u64>();
    if length > bytes.len() {
        return Err(format!("its header states {length} bytes, the file has {}", bytes.len()));
    }
    if gltf >= length {
        return Err(format!("its tables of {tables:?} bytes leave no room for glTF in {length} bytes"));
    }
    // Within the file: checked above.
    let piece = |start: u64, end: u64| bytes.slice(start, end).ok_or("a table lies outside the file");
    let json_end = HEADER_BYTES + tables[0];
    let mut center = [0.0; 3];
    if tables[0] > 0 {
        if tables[0] > MAX_TABLE_BYTES {
            return Err(format!("a feature table of {} bytes is too large", tables[0]));
        }
        let text = piece(HEADER_BYTES, json_end)?.read()?;
        let unreadable =
            |e: serde_json::Error| format!("its feature table cannot be read: {}", one_line(&e.to_string()));
        // Padded with spaces, by some writers with zeros.
        let text = text.trim_ascii_end();
        let text = &text[..text.iter().rposition(|&c| c != 0).map_or(0, |last| last + 1)];
        let features: Features = match text {
            [] => Features { rtc_center: None },
            text => serde_json::from_slice(text).map_err(unreadable)?,
        };
        match features.rtc_center {
            None => {}
            Some(Center::Inline(point)) => center = point,
            Some(Center::Binary { byte_offset }) => {
                let end = byte_offset.checked_add(12).filter(|&end| end <= tables[1]);
                let end = end.ok_or("its RTC_CENTER lies outside the feature table")?;
                let point = piece(json_end + byte_offset, json_end + end)?.read()?;
                for (value, bytes) in center.iter_mut().zip(point.as_chunks::<4>().0) {
                    *value = f64::from(f32::from_le_bytes(*bytes));
                }
            }
        }
    }
    if !center.iter().all(|c| c.is_finite()) {
        return Err("its RTC_CENTER is not finite".into());
    }
    Ok((piece(gltf, length)?, center))
}
