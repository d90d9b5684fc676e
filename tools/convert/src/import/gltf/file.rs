//! Opens a glTF file: its JSON, its buffers, what it requires.

use super::document::{BEYOND, Document, VersionOnly};
use super::glb;
use crate::import::bytes::{Bytes, Spool};
use crate::import::error::{EXPORT_AGAIN, ImportError, one_line, show};
use crate::import::reach::Reach;
use crate::import::uri;
use crate::import::warnings::Warnings;
use gltf::json::{self, Index};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use xxhash_rust::xxh3::Xxh3;

/// A glTF file: the JSON parsed, every buffer found and as long as stated, nothing else checked.
pub(super) struct File {
    /// The path as messages show it.
    pub label: String,
    /// The JSON.
    pub document: Document,
    /// Bytes of each buffer, or why there are none.
    pub buffers: Vec<Result<Bytes, Problem>>,
    /// Decoded bytes of the buffer views that are compressed by EXT_meshopt_compression and in use.
    pub decoded_views: BTreeMap<usize, Bytes>,
    /// Accessors whose sparse indices have been run through.
    pub checked_sparse: Vec<AtomicBool>,
    /// Where each image is, or why nowhere.
    pub images: Vec<Result<Bytes, String>>,
    /// Length of the file and its buffers together: what bounds counts that no buffer view bounds.
    pub input_bytes: u64,
    /// Name, length and hash.
    pub source: bricks::Source,
    /// Takes what has to be decoded.
    pub spool: Arc<Spool>,
}

/// Something wrong within a file, before it is known where it was found.
#[derive(Clone, Debug)]
pub(super) struct Problem {
    pub what: String,
    pub remedy: &'static str,
}

impl Problem {
    /// A defect that only exporting again can repair.
    pub fn new(what: impl Into<String>) -> Self {
        Self { what: what.into(), remedy: EXPORT_AGAIN }
    }
}

impl File {
    /// Opens the file and its buffers: `whole`, of which `bytes` are glTF. References lead as far as `within` lets
    /// them ([`Reach::of`]). Extensions that are ignored are noted in `warnings`.
    pub fn open(
        (path, within): (&Path, Option<&Path>),
        [whole, bytes]: [&Bytes; 2],
        spool: Arc<Spool>,
        warnings: &mut Warnings,
    ) -> Result<Self, ImportError> {
        let label = show(path);
        let unreadable = |reason: String| ImportError::Read { file: label.clone(), reason };
        let mut hash = Xxh3::new();
        whole.hash(&spool, &mut hash).map_err(|e| unreadable(e.to_string()))?;

        let syntax = |problem: String| {
            let remedy = "export the file again as glTF 2.0";
            ImportError::Syntax { file: label.clone(), problem, remedy }
        };
        let reader = bytes.open().map_err(|e| unreadable(e.to_string()))?;
        let mut magic = [0; 4];
        let is_glb = reader.read_at(0, &mut magic).is_ok() && &magic == glb::MAGIC;
        let chunks = if is_glb {
            glb::chunks(bytes.len(), |at, out| reader.read_at(at, out)).map_err(&syntax)?
        } else {
            glb::Chunks { json: 0..bytes.len(), bin: None }
        };
        let piece = |range: &std::ops::Range<u64>| bytes.slice(range.start, range.end);
        let json = piece(&chunks.json).ok_or_else(|| syntax("a chunk lies outside the file".into()))?;
        let mut document = parse(&json.read().map_err(unreadable)?).map_err(&syntax)?;
        check_extensions(&label, &document, warnings)?;

        let mut found = Found { reach: Reach::of(path, within)?, spool: &spool, files: BTreeMap::new() };
        let mut bin = chunks.bin.as_ref().and_then(piece);
        let mut buffers = Vec::with_capacity(document.buffers.len());
        let mut input_bytes = bytes.len();
        for (index, buffer) in document.buffers.iter_mut().enumerate() {
            let data = match buffer.json.uri.take() {
                Some(text) => found.get(&text).and_then(|(data, is_new)| {
                    if is_new {
                        input_bytes += data.len();
                        data.hash(&spool, &mut hash).map_err(|e| Missing::File(format!("cannot be read: {e}")))?;
                    }
                    Ok(data)
                }),
                None if index == 0 => bin.take().ok_or(Missing::Nothing),
                None => Err(Missing::Nothing),
            };
            let stated = buffer.more.byte_length;
            let whole = data.and_then(|data| {
                let held = data.len();
                data.slice(0, stated)
                    .ok_or_else(|| Missing::File(format!("has {held} bytes, but byteLength states {stated}")))
            });
            // Only an error for what needs the buffer. One without a URI may be there for extensions to fill.
            let is_told = !matches!(whole, Err(Missing::Nothing));
            let whole = whole.map_err(Missing::problem);
            if let (Err(problem), true) = (&whole, is_told) {
                warnings.add("the buffer cannot be used", || format!("buffer {index} ({})", problem.what));
            }
            buffers.push(whole);
        }
        let uris: Vec<_> = document.images.iter_mut().map(|image| image.0.as_mut().ok()?.json.uri.take()).collect();
        let located = uris.into_iter().map(|text| match text {
            Some(text) => found.get(&text).map(|(data, _)| Some(data)).map_err(|missing| missing.problem().what),
            None => Ok(None),
        });
        let located: Vec<_> = located.collect();
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let source = bricks::Source { name, bytes: whole.len(), hash: format!("{:016x}", hash.digest()) };
        let checked_sparse = document.accessors.iter().map(|_| AtomicBool::new(false)).collect();
        let decoded_views = BTreeMap::new();
        let images = Vec::new();
        let mut file =
            Self { label, document, buffers, decoded_views, checked_sparse, images, input_bytes, source, spool };
        file.images = located.into_iter().enumerate().map(|(i, image)| file.image(i, image?)).collect();
        Ok(file)
    }

    /// Where image `index` is, if not at its URI.
    fn image(&self, index: usize, at_uri: Option<Bytes>) -> Result<Bytes, String> {
        let json = self.document.images[index].0.as_ref().map_err(String::clone)?;
        match (at_uri, json.buffer_view) {
            (Some(bytes), _) => Ok(bytes),
            (None, Some(view)) => self.view(view).map(|(bytes, _)| bytes).map_err(|problem| problem.what),
            (None, None) => Err("it has neither a URI nor a buffer view".into()),
        }
    }

    /// The error for `problem` at `place`.
    pub fn fault(&self, place: String, problem: Problem) -> ImportError {
        ImportError::Content { file: self.label.clone(), place, problem: problem.what, remedy: problem.remedy }
    }

    /// The bytes and the stride of a buffer view.
    pub fn view(&self, index: Index<json::buffer::View>) -> Result<(Bytes, Option<u64>), Problem> {
        let view = item(&self.document.buffer_views, index, "buffer view")?;
        if let Some(compressed) = &view.compression() {
            // In range: `item` found it.
            let decoded = self.decoded_views.get(&(index.value()));
            let bytes = decoded.ok_or_else(|| Problem::new(format!("buffer view {index} could not be decoded")))?;
            return Ok((bytes.clone(), Some(compressed.byte_stride)));
        }
        let bytes = self.piece(view.buffer, view.byte_offset.unwrap_or_default().0, view.byte_length.0);
        let bytes = bytes.map_err(|problem| Problem::new(format!("buffer view {index}: {}", problem.what)))?;
        Ok((bytes, view.byte_stride.map(|stride| stride.0 as u64)))
    }

    /// `length` bytes at `offset` of a buffer.
    pub fn piece(&self, buffer: Index<json::Buffer>, offset: u64, length: u64) -> Result<Bytes, Problem> {
        let data = item(&self.buffers, buffer, "buffer")?;
        let named = |problem: &Problem| Problem { what: format!("buffer {buffer}: {}", problem.what), ..*problem };
        let data = data.as_ref().map_err(named)?;
        let bytes = offset.checked_add(length).and_then(|end| data.slice(offset, end));
        bytes.ok_or_else(|| {
            let held = data.len();
            Problem::new(format!("{length} bytes at {offset} lie outside buffer {buffer} of {held} bytes"))
        })
    }
}

/// The files that URIs lead to, each found once, and the data of data URIs, in the spool.
struct Found<'a> {
    reach: Reach,
    spool: &'a Spool,
    files: BTreeMap<PathBuf, Result<Bytes, String>>,
}

/// Why there are no bytes.
enum Missing {
    /// There is no URI.
    Nothing,
    /// The URI is not one that is followed.
    Uri(String),
    /// The file is not there, or not as stated.
    File(String),
    /// What was decoded cannot be kept.
    Spool(String),
}

impl Missing {
    fn problem(self) -> Problem {
        match self {
            Self::Nothing => Problem::new("has no data"),
            Self::Uri(what) => {
                Problem { what, remedy: "put it beside the glTF file and refer to it by a relative path" }
            }
            Self::File(what) => Problem { what, remedy: "put it beside the glTF file as it was exported" },
            Self::Spool(what) => Problem { what, remedy: "make room there" },
        }
    }
}

impl Found<'_> {
    /// The bytes that `text` leads to, and whether it is the first that does.
    fn get(&mut self, text: &str) -> Result<(Bytes, bool), Missing> {
        let refused = |problem| Missing::Uri(format!("{problem} ({})", one_line(text)));
        match self.reach.resolve(text).map_err(refused)? {
            uri::Target::Data(data) => Ok((self.spool.add(&data).map_err(Missing::Spool)?, true)),
            uri::Target::File(below) => {
                let mut is_new = false;
                let (reach, spool) = (&self.reach, self.spool);
                let found = self.files.entry(below).or_insert_with_key(|below| {
                    is_new = true;
                    let bytes = reach.file(below, spool);
                    bytes.map_err(|reason| format!("cannot read {}: {reason}", show(below)))
                });
                Ok((found.clone().map_err(Missing::File)?, is_new))
            }
        }
    }
}

/// `list[index]`, or a problem that says how many there are.
pub(super) fn item<'a, T, J>(list: &'a [T], index: Index<J>, kind: &str) -> Result<&'a T, Problem> {
    list.get(index.value()).ok_or_else(|| {
        let or_more = if index.value() >= BEYOND as usize { " or more" } else { "" };
        Problem::new(format!("refers to {kind} {index}{or_more}, but the file has {}", list.len()))
    })
}

/// Parses the JSON and checks the version.
fn parse(json: &[u8]) -> Result<Document, String> {
    let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
    let document = serde_json::from_slice::<Document>(json);
    let only;
    let asset = match &document {
        Ok(document) => Some(&document.asset),
        // Another version has other types; then it is the version that must be told.
        Err(_) => {
            only = serde_json::from_slice::<VersionOnly>(json).ok();
            only.as_ref().map(|only| &only.asset)
        }
    };
    if let Some(asset) = asset {
        let (version, min_version) = (&asset.version, &asset.min_version);
        let needed = min_version.as_ref().unwrap_or(version);
        let readable = match min_version.as_deref() {
            Some(min) => min == "2.0",
            None => version.split('.').next() == Some("2"),
        };
        if !readable {
            return Err(format!("it needs version {}, only 2.0 is read", one_line(needed)));
        }
    }
    document.map_err(|e| one_line(&e.to_string()))
}

/// Extensions that are applied.
const APPLIED: &[&str] = &[
    "CESIUM_RTC",
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_texture_basisu",
    "KHR_texture_transform",
];

/// Beginnings of the names of extensions that leave geometry alone, and may be ignored even when they are required.
const IGNORABLE: &[&str] = &[
    "ADOBE_materials_",
    "EXT_lights_",
    "EXT_materials_",
    "EXT_texture_",
    "KHR_animation_pointer",
    "KHR_audio",
    "KHR_lights_",
    "KHR_materials_",
    "KHR_texture_",
    "KHR_xmp",
    "MSFT_texture_",
];

/// Refuses required extensions without which geometry cannot be read; notes the ignored ones.
fn check_extensions(label: &str, document: &Document, warnings: &mut Warnings) -> Result<(), ImportError> {
    let is_applied = |name: &String| APPLIED.contains(&name.as_str());
    let is_ignorable = |name: &String| IGNORABLE.iter().any(|prefix| name.starts_with(prefix));
    let list = |names: Vec<&String>| {
        let mut shown: Vec<String> = Vec::new();
        for name in names.into_iter().map(|name| one_line(name)) {
            if !shown.contains(&name) {
                shown.push(name);
            }
            if shown.len() == 16 {
                shown.push("…".into());
                break;
            }
        }
        shown.join(", ")
    };
    let refused: Vec<_> = document.extensions_required.iter().filter(|n| !is_applied(n) && !is_ignorable(n)).collect();
    if !refused.is_empty() {
        return Err(ImportError::Extensions { file: label.to_owned(), extensions: list(refused) });
    }
    let names = document.extensions_used.iter().chain(&document.extensions_required);
    let ignored: Vec<_> = names.filter(|n| !is_applied(n)).collect();
    if !ignored.is_empty() {
        warnings.add(format!("extensions ignored: {}", list(ignored)), String::new);
    }
    Ok(())
}
