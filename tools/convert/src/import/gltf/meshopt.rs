//! EXT_meshopt_compression and KHR_meshopt_compression: buffer views compressed by the codecs of meshoptimizer, decoded
//! into the spool one by one.

use super::document::Meshopt;
use super::file::{File, Problem};
use crate::import::error::{EXPORT_AGAIN, ImportError};
use bricks::planted::{self, Defect};
use meshopt::ffi;
use std::collections::HashMap;
use std::ffi::c_void;

/// Most bytes that a byte of a view decodes to: version 1 of the vertex codec spends two bits on 256 equal bytes.
const MAX_RATIO: u64 = 1024;

/// Most bytes that a byte of the file decodes to over all views. Other data than such constants takes at least two bits
/// for 16 bytes.
const MAX_TOTAL_RATIO: u64 = 64;

/// Small files may decode to as much at any rate.
const FREE_BYTES: u64 = 16 << 20;

/// Decodes every compressed buffer view of `file`.
pub(super) fn decode_views(file: &mut File) -> Result<(), ImportError> {
    let mut total = 0u64;
    // Views of the same data are decoded once.
    let mut known = HashMap::new();
    for index in 0..file.document.buffer_views.len() {
        let Some(json) = file.document.buffer_views[index].compression() else { continue };
        let key = (json.buffer, json.byte_offset, json.byte_length, json.byte_stride, json.count);
        let key = (key, json.mode.clone(), json.filter.clone());
        let bytes = match known.get(&key) {
            Some(bytes) => Clone::clone(bytes),
            None => {
                let decoded = decode(file, json, &mut total).map_err(|problem| {
                    let what = format!("meshopt compression: {}", problem.what);
                    file.fault(format!("buffer view {index}"), Problem { what, ..problem })
                })?;
                let bytes = file.spool.add(&decoded).map_err(|what| {
                    file.fault(format!("buffer view {index}"), Problem { what, remedy: "make room there" })
                })?;
                known.insert(key, bytes.clone());
                bytes
            }
        };
        file.decoded_views.insert(index, bytes);
    }
    Ok(())
}

/// Decodes one view; `total` counts the bytes of all.
fn decode(file: &File, json: &Meshopt, total: &mut u64) -> Result<Vec<u8>, Problem> {
    let encoded = file.piece(json.buffer, json.byte_offset, json.byte_length)?;
    let (count, stride) = (json.count, json.byte_stride);
    let filter = json.filter.as_deref().unwrap_or("NONE");
    let is_sound = match json.mode.as_str() {
        "ATTRIBUTES" => {
            stride.is_multiple_of(4)
                && (4..=256).contains(&stride)
                && match filter {
                    "NONE" | "EXPONENTIAL" => true,
                    "OCTAHEDRAL" | "COLOR" => stride == 4 || stride == 8,
                    "QUATERNION" => stride == 8,
                    _ => false,
                }
        }
        "TRIANGLES" => (stride == 2 || stride == 4) && count.is_multiple_of(3) && filter == "NONE",
        "INDICES" => (stride == 2 || stride == 4) && filter == "NONE",
        _ => false,
    };
    if !is_sound {
        let what = "its mode, filter, stride and count are not ones that the extension allows";
        return Err(Problem::new(what));
    }
    let fits = |length: &u64| length / MAX_RATIO <= encoded.len() || planted::is(Defect::MeshoptCount);
    let length = count.checked_mul(stride).filter(fits);
    *total = total.saturating_add(length.unwrap_or(u64::MAX));
    let is_free = *total <= FREE_BYTES || planted::is(Defect::MeshoptCount);
    let length = length.filter(|_| is_free || *total / MAX_TOTAL_RATIO <= file.input_bytes);
    let too_many = || Problem::new(format!("states {count} elements, more than {} bytes can hold", encoded.len()));
    let length = usize::try_from(length.ok_or_else(too_many)?).map_err(|_| too_many())?;
    let encoded = encoded.read().map_err(|what| Problem { what, remedy: EXPORT_AGAIN })?;
    let mut decoded = Vec::new();
    if !bricks::ending::reserve(&mut decoded, length) {
        return Err(too_many());
    }
    decoded.resize(length, 0u8);
    let (count, stride) = (count as usize, stride as usize);
    let out = decoded.as_mut_ptr().cast::<c_void>();
    let decode = match json.mode.as_str() {
        "ATTRIBUTES" => ffi::meshopt_decodeVertexBuffer,
        "TRIANGLES" => ffi::meshopt_decodeIndexBuffer,
        _ => ffi::meshopt_decodeIndexSequence,
    };
    // SAFETY: `out` has count * stride writable bytes; `encoded` has the stated length, within which the decoders stay
    // whatever it holds; their requirements on stride and count were checked above.
    let status = unsafe { decode(out, count, stride, encoded.as_ptr(), encoded.len()) };
    if status != 0 {
        return Err(Problem::new("its data is damaged"));
    }
    let filter = match filter {
        "OCTAHEDRAL" => ffi::meshopt_decodeFilterOct,
        "QUATERNION" => ffi::meshopt_decodeFilterQuat,
        "EXPONENTIAL" => ffi::meshopt_decodeFilterExp,
        "COLOR" => ffi::meshopt_decodeFilterColor,
        _ => return Ok(decoded),
    };
    // SAFETY: the buffer has count * stride bytes, and the stride is one that the filter takes, checked above.
    unsafe { filter(out, count, stride) };
    Ok(decoded)
}
