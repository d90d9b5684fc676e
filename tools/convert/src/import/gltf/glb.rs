//! The GLB container (glTF 2.0, section 4): a header and chunks, of which the first is JSON and the second may be BIN.

use std::io;
use std::ops::Range;

/// The first bytes of a GLB file.
pub(super) const MAGIC: &[u8; 4] = b"glTF";

const HEADER_BYTES: u64 = 12;
const CHUNK_HEADER_BYTES: u64 = 8;

/// Where the chunks lie.
#[derive(Debug, PartialEq)]
pub(super) struct Chunks {
    /// The JSON text.
    pub json: Range<u64>,
    /// The binary buffer, if any; padded by up to 3 bytes.
    pub bin: Option<Range<u64>>,
}

/// Finds the chunks of a GLB file of `held` bytes, of which `read` fills its second argument with those from the first
/// on; the error says what is wrong. Chunks behind the second are ignored, as are bytes behind the length that the
/// header states.
pub(super) fn chunks(held: u64, read: impl Fn(u64, &mut [u8]) -> io::Result<()>) -> Result<Chunks, String> {
    let word = |at: u64| {
        let mut bytes = [0; 4];
        read(at, &mut bytes).map_err(|_| "the GLB file ends within a header")?;
        Ok::<_, String>(u32::from_le_bytes(bytes))
    };
    let version = word(4)?;
    if version != 2 {
        return Err(format!("GLB version {version} is not 2"));
    }
    let length = u64::from(word(8)?);
    if length < HEADER_BYTES || length > held {
        return Err(format!("the GLB header states {length} bytes, the file has {held}"));
    }
    let chunk = |at: u64, kind: &[u8; 4]| -> Result<Option<Range<u64>>, String> {
        let start = at + CHUNK_HEADER_BYTES;
        if word(at + 4)? != u32::from_le_bytes(*kind) {
            return Ok(None);
        }
        let bytes = u64::from(word(at)?);
        match length.checked_sub(start) {
            Some(left) if bytes <= left => Ok(Some(start..start + bytes)),
            _ => Err(format!("a GLB chunk of {bytes} bytes does not fit the {length} bytes of the file")),
        }
    };
    let json = chunk(HEADER_BYTES, b"JSON")?.ok_or("the first GLB chunk is not JSON")?;
    let next = json.end;
    // Less than a chunk header is padding.
    let bin = if length - next >= CHUNK_HEADER_BYTES { chunk(next, b"BIN\0")? } else { None };
    Ok(Chunks { json, bin })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chunks(file: &[u8]) -> Result<Chunks, String> {
        super::chunks(file.len() as u64, |at, out| {
            let bytes = file.get(at as usize..).and_then(|rest| rest.get(..out.len()));
            out.copy_from_slice(bytes.ok_or(io::ErrorKind::UnexpectedEof)?);
            Ok(())
        })
    }

    fn glb(json: &[u8], bin: Option<&[u8]>) -> Vec<u8> {
        let mut file =
            [&MAGIC[..], &2u32.to_le_bytes(), &[0; 4], &(json.len() as u32).to_le_bytes(), b"JSON", json].concat();
        if let Some(bin) = bin {
            file.extend_from_slice(&[&(bin.len() as u32).to_le_bytes()[..], b"BIN\0", bin].concat());
        }
        let length = file.len() as u32;
        file[8..12].copy_from_slice(&length.to_le_bytes());
        file
    }

    #[test]
    fn finds_chunks() {
        assert_eq!(chunks(&glb(b"{}  ", None)), Ok(Chunks { json: 20..24, bin: None }));
        assert_eq!(chunks(&glb(b"{}  ", Some(b"1234"))), Ok(Chunks { json: 20..24, bin: Some(32..36) }));
    }

    #[test]
    fn truncation_is_an_error_at_every_length() {
        let file = glb(b"{}  ", Some(b"1234"));
        for length in 0..file.len() {
            assert!(chunks(&file[..length]).is_err(), "{length}");
        }
        // With the header's length cut as well, only whole chunks remain readable.
        for length in 0..file.len() {
            let mut cut = file.clone();
            cut[8..12].copy_from_slice(&(length as u32).to_le_bytes());
            assert_eq!(chunks(&cut).is_ok(), (24..32).contains(&length), "{length}");
        }
    }

    #[test]
    fn huge_lengths_are_errors() {
        for at in [8, 12, 24] {
            let mut file = glb(b"{}  ", Some(b"1234"));
            file[at..at + 4].fill(0xff);
            assert!(chunks(&file).is_err(), "{at}");
        }
    }
}
