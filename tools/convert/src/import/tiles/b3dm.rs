//! Batched 3D models (OGC 18-053r2, section 8.1): a header, two tables, a glTF file.

use super::batched::{self, Triple};
use crate::import::bytes::{Bytes, Reader};
use serde::Deserialize;

const HEADER_WORDS: u64 = 7;

/// What is read of the feature table.
#[derive(Deserialize)]
#[serde(rename_all = "UPPERCASE")]
struct Features {
    rtc_center: Option<Triple>,
}

/// The glTF file within `bytes`, and the point of the tile that its coordinates are relative to, Z up.
pub(super) fn open(bytes: &Bytes, reader: &Reader) -> Result<(Bytes, [f64; 3]), String> {
    let file = batched::open::<Features>(bytes, reader, HEADER_WORDS)?;
    let center = file.features.and_then(|features| features.rtc_center);
    let center = center.map_or(Ok([0.0; 3]), |center| center.read(&file.binary, "RTC_CENTER"))?;
    Ok((file.body, center))
}
