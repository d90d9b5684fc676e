//! Subtrees of implicit tilesets (OGC 22-025r4, section 7.6.6): which tiles, contents and further subtrees there are, a
//! bit each.

use crate::import::bytes::Bytes;
use crate::import::error::one_line;
use serde::Deserialize;

/// Magic, version, and the lengths of both chunks.
const HEADER_BYTES: u64 = 24;

/// Largest JSON.
const MAX_JSON_BYTES: u64 = 1 << 24;

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Document {
    #[serde(default)]
    buffers: Vec<Buffer>,
    #[serde(default)]
    buffer_views: Vec<View>,
    tile_availability: Availability,
    content_availability: Option<Availabilities>,
    child_subtree_availability: Availability,
    #[serde(default)]
    extensions: Extensions,
}

#[derive(Deserialize)]
struct Buffer {
    uri: Option<String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct View {
    buffer: usize,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
}

/// One bit for all, or bits in a view, which had another name in drafts.
#[derive(Deserialize)]
struct Availability {
    constant: Option<u8>,
    #[serde(alias = "bufferView")]
    bitstream: Option<usize>,
}

/// One for each content; in drafts one that is no list.
#[derive(Deserialize)]
#[serde(untagged)]
enum Availabilities {
    Several(Vec<Availability>),
    One(Availability),
}

#[derive(Default, Deserialize)]
struct Extensions {
    #[serde(rename = "3DTILES_multiple_contents")]
    multiple: Option<Multiple>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Multiple {
    content_availability: Vec<Availability>,
}

/// Bits, or one bit that stands for all.
#[derive(Debug)]
pub(super) enum Bits {
    Constant(bool),
    Stream(Vec<u8>),
}

impl Bits {
    /// The bit of this number, the lowest of a byte first.
    pub fn get(&self, index: u64) -> bool {
        match self {
            Self::Constant(bit) => *bit,
            Self::Stream(bytes) => bytes.get((index / 8) as usize).is_some_and(|byte| byte >> (index % 8) & 1 != 0),
        }
    }
}

/// A subtree that has been read.
#[derive(Debug)]
pub(super) struct Subtree {
    /// Of tiles, level by level, in Morton order within each.
    pub tiles: Bits,
    /// The same of each content.
    pub contents: Vec<Bits>,
    /// Of subtrees below the last level, in Morton order.
    pub children: Bits,
}

/// Reads the subtree in `bytes`, of `tiles` tiles with `children` below the last level; `buffer` gives the bytes of
/// another file by its URI.
pub(super) fn read(
    bytes: &Bytes,
    [tiles, children]: [u64; 2],
    buffer: &mut dyn FnMut(&str) -> Result<Bytes, String>,
) -> Result<Subtree, String> {
    let (json, binary) = chunks(bytes)?;
    if json.len() > MAX_JSON_BYTES {
        return Err(format!("its JSON of {} bytes is too large", json.len()));
    }
    let text = json.read()?;
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&text);
    let document: Document = serde_json::from_slice(text.trim_ascii_end())
        .map_err(|e| format!("its JSON cannot be read: {}", one_line(&e.to_string())))?;
    let mut bits = |availability: &Availability, count: u64, what: &str| {
        let view = match (availability.bitstream, availability.constant) {
            (Some(view), _) => view,
            (None, Some(constant @ (0 | 1))) => return Ok(Bits::Constant(constant == 1)),
            _ => return Err(format!("the availability of {what} is neither a bitstream nor a constant of 0 or 1")),
        };
        let view = document.buffer_views.get(view).ok_or_else(|| format!("{what}: there is no buffer view {view}"))?;
        let found = document.buffers.get(view.buffer);
        let found = found.ok_or_else(|| format!("{what}: there is no buffer {}", view.buffer))?;
        let bytes = match (&found.uri, &binary) {
            (Some(uri), _) => buffer(uri)?,
            (None, Some(binary)) => binary.clone(),
            (None, None) => return Err(format!("{what}: buffer {} has neither URI nor binary chunk", view.buffer)),
        };
        let end = view.byte_offset.checked_add(view.byte_length);
        let bytes = end.and_then(|end| bytes.slice(view.byte_offset, end));
        let bytes = bytes.ok_or_else(|| format!("{what}: its buffer view lies outside the buffer"))?;
        let needed = count.div_ceil(8);
        // What is behind them stands for nothing.
        let bytes = bytes.slice(0, needed);
        let bytes = bytes.ok_or_else(|| format!("{what}: {} bytes are too few for {count} bits", view.byte_length))?;
        Ok(Bits::Stream(bytes.read()?))
    };
    let multiple = document.extensions.multiple.as_ref().map(|multiple| &multiple.content_availability[..]);
    let contents = match (multiple, &document.content_availability) {
        (Some(several), _) => several,
        (None, Some(Availabilities::Several(several))) => several,
        (None, Some(Availabilities::One(one))) => std::slice::from_ref(one),
        (None, None) => &[],
    };
    Ok(Subtree {
        tiles: bits(&document.tile_availability, tiles, "tiles")?,
        contents: contents.iter().map(|one| bits(one, tiles, "contents")).collect::<Result<_, _>>()?,
        children: bits(&document.child_subtree_availability, children, "child subtrees")?,
    })
}

/// The JSON of a subtree, and its binary chunk if it is a binary file.
fn chunks(bytes: &Bytes) -> Result<(Bytes, Option<Bytes>), String> {
    let mut header = [0; HEADER_BYTES as usize];
    let head = header.len().min(bytes.len() as usize);
    bytes.open().and_then(|reader| reader.read_at(0, &mut header[..head])).map_err(|e| e.to_string())?;
    if !header.starts_with(b"subt") {
        return Ok((bytes.clone(), None));
    }
    let version = u32::from_le_bytes([header[4], header[5], header[6], header[7]]);
    if head < header.len() || version != 1 {
        return Err(format!("version {version} is not 1, or the file ends within its header"));
    }
    let length = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| header[at + i]));
    let json_end = HEADER_BYTES.checked_add(length(8));
    let end = json_end.and_then(|end| end.checked_add(length(16)));
    let chunks = json_end
        .zip(end)
        .and_then(|(json_end, end)| Some((bytes.slice(HEADER_BYTES, json_end)?, Some(bytes.slice(json_end, end)?))));
    chunks.ok_or_else(|| format!("its chunks of {} and {} bytes end outside of the file", length(8), length(16)))
}
