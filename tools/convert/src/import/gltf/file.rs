//! Opens a glTF file: its JSON, its buffers, what it requires.

use super::document::{Document, Index, VersionOnly};
use super::{glb, uri};
use crate::import::error::{EXPORT_AGAIN, ImportError, one_line, show};
use crate::import::warnings::Warnings;
use std::path::{Path, PathBuf};
use xxhash_rust::xxh3::Xxh3;

/// A glTF file in memory: the JSON parsed, every buffer loaded and as long as stated, nothing else checked.
pub(super) struct File {
    /// The path as messages show it.
    pub label: String,
    /// Folder of the file, to which URIs are relative.
    pub folder: PathBuf,
    /// The JSON.
    pub document: Document,
    /// Bytes of each buffer; `None` for a buffer that only an extension fills.
    pub buffers: Vec<Option<Vec<u8>>>,
    /// Length of the file and its buffers together: what bounds counts that no buffer view bounds.
    pub input_bytes: u64,
    /// Name, length and hash.
    pub source: bricks::Source,
}

/// Something wrong within a file, before it is known where it was found.
#[derive(Debug)]
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
    /// Reads the file and its buffers. Extensions that are ignored are noted in `warnings`.
    pub fn open(path: &Path, warnings: &mut Warnings) -> Result<Self, ImportError> {
        let label = show(path);
        let mut bytes = read(path).map_err(|reason| ImportError::Read { file: label.clone(), reason })?;
        let mut hash = Xxh3::new();
        hash.update(&bytes);
        let length = bytes.len() as u64;

        let is_glb = bytes.starts_with(glb::MAGIC);
        let syntax = |problem: String| {
            let remedy = "export the file again as glTF 2.0";
            ImportError::Syntax { file: label.clone(), problem, remedy }
        };
        let chunks = if is_glb {
            glb::chunks(&bytes).map_err(&syntax)?
        } else {
            glb::Chunks { json: 0..bytes.len(), bin: None }
        };
        let document = parse(&bytes[chunks.json]).map_err(&syntax)?;
        check_extensions(&label, &document, warnings)?;

        // What remains of the file's bytes is the binary chunk; moving it to the front spares a copy.
        let mut bin = chunks.bin.map(|range| {
            bytes.truncate(range.end);
            bytes.drain(..range.start);
            std::mem::take(&mut bytes)
        });
        drop(bytes);

        let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
        let mut buffers = Vec::with_capacity(document.buffers.len());
        for (index, buffer) in document.buffers.iter().enumerate() {
            let fault = |problem: String, remedy| {
                let place = format!("buffer {index}");
                ImportError::Content { file: label.clone(), place, problem, remedy }
            };
            let data = match &buffer.uri {
                Some(text) => match uri::resolve(text) {
                    Ok(uri::Target::Data(data)) => Some(data),
                    Ok(uri::Target::File(below)) => {
                        let data = read(&folder.join(&below)).map_err(|reason| {
                            let problem = format!("cannot read {}: {reason}", show(&below));
                            fault(problem, "put the file of the buffer beside the glTF file")
                        })?;
                        hash.update(&data);
                        Some(data)
                    }
                    Err(problem) => {
                        let problem = format!("{problem} ({})", one_line(text));
                        return Err(fault(
                            problem,
                            "put the buffer beside the glTF file and refer to it by a relative path",
                        ));
                    }
                },
                None if index == 0 => bin.take(),
                None => None,
            };
            buffers.push(match data {
                Some(mut data) => {
                    let stated = buffer.byte_length.0;
                    if (data.len() as u64) < stated {
                        let problem = format!("has {} bytes, but byteLength states {stated}", data.len());
                        return Err(fault(problem, EXPORT_AGAIN));
                    }
                    // In range: stated is at most the length.
                    data.truncate(stated as usize);
                    Some(data)
                }
                None => None,
            });
        }
        let input_bytes = length + buffers.iter().flatten().map(|b| b.len() as u64).sum::<u64>();
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let source = bricks::Source { name, bytes: length, hash: format!("{:016x}", hash.digest()) };
        Ok(Self { label, folder, document, buffers, input_bytes, source })
    }

    /// The error for `problem` at `place`.
    pub fn fault(&self, place: String, problem: Problem) -> ImportError {
        ImportError::Content { file: self.label.clone(), place, problem: problem.what, remedy: problem.remedy }
    }

    /// The bytes and the stride of a buffer view.
    pub fn view(&self, index: Index) -> Result<(&[u8], Option<u64>), Problem> {
        let view = item(&self.document.buffer_views, index, "buffer view")?;
        let buffer = item(&self.buffers, view.buffer, "buffer")?;
        let Some(data) = buffer else {
            return Err(if view.extensions.meshopt.is_some() {
                let what =
                    format!("buffer view {index} is compressed by EXT_meshopt_compression and has no plain copy");
                Problem { what, remedy: "export the file without EXT_meshopt_compression" }
            } else {
                Problem::new(format!("buffer {} of buffer view {index} has no data", view.buffer))
            });
        };
        let (offset, length) = (view.byte_offset.0, view.byte_length.0);
        let bytes = offset.checked_add(length).and_then(|end| slice(data, offset, end));
        let bytes = bytes.ok_or_else(|| {
            Problem::new(format!(
                "buffer view {index} ({length} bytes at {offset}) lies outside buffer {} of {} bytes",
                view.buffer,
                data.len()
            ))
        })?;
        Ok((bytes, view.byte_stride.map(|stride| stride.0)))
    }
}

/// `bytes[start..end]`, if within.
pub(super) fn slice(bytes: &[u8], start: u64, end: u64) -> Option<&[u8]> {
    bytes.get(usize::try_from(start).ok()?..usize::try_from(end).ok()?)
}

/// `list[index]`, or a problem that says how many there are.
pub(super) fn item<'a, T>(list: &'a [T], index: Index, kind: &str) -> Result<&'a T, Problem> {
    usize::try_from(index.0)
        .ok()
        .and_then(|i| list.get(i))
        .ok_or_else(|| Problem::new(format!("refers to {kind} {index}, but the file has {}", list.len())))
}

/// Reads a regular file whole; devices and pipes, which may never end, are refused.
pub(super) fn read(path: &Path) -> Result<Vec<u8>, String> {
    let metadata = std::fs::metadata(path).map_err(|e| e.to_string())?;
    if !metadata.is_file() {
        return Err("not a regular file".into());
    }
    std::fs::read(path).map_err(|e| e.to_string())
}

/// Parses the JSON and checks the version.
fn parse(json: &[u8]) -> Result<Document, String> {
    let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
    let document = serde_json::from_slice::<Document>(json);
    let version = match &document {
        Ok(document) => Some((document.asset.version.clone(), document.asset.min_version.clone())),
        // Another version has other types; then it is the version that must be told.
        Err(_) => {
            let asset = serde_json::from_slice::<VersionOnly>(json).ok().map(|only| only.asset);
            asset.map(|asset| (asset.version, asset.min_version))
        }
    };
    if let Some((version, min_version)) = version {
        let needed = min_version.as_deref().unwrap_or(&version);
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
    "EXT_mesh_gpu_instancing",
    "KHR_materials_emissive_strength",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
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
