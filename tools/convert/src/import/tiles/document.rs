//! The parts of a tileset's JSON that importing reads (OGC 22-025r4, section 7; 18-053r2 for version 1.0).

use crate::import::error::{ImportError, one_line};
use serde::Deserialize;

/// Extensions that are applied, or leave geometry alone.
const KNOWN: [&str; 5] = [
    "3DTILES_content_gltf",
    "3DTILES_multiple_contents",
    "3DTILES_implicit_tiling",
    "3DTILES_metadata",
    "3DTILES_draco_point_compression",
];

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Tileset {
    pub asset: Asset,
    pub root: Tile,
    #[serde(default)]
    extensions_required: Vec<String>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Asset {
    version: String,
    /// Of the time before 1.0, when it was taken out.
    pub gltf_up_axis: Option<String>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Tile {
    /// Column-major; boxed because few tiles have one.
    pub transform: Option<Box<[f64; 16]>>,
    /// Inherited where it is absent.
    pub refine: Option<String>,
    content: Option<Content>,
    #[serde(default)]
    contents: Vec<Content>,
    #[serde(default)]
    pub children: Vec<Tile>,
    implicit_tiling: Option<Box<Implicit>>,
    #[serde(default)]
    extensions: TileExtensions,
}

#[derive(Debug, Default, Deserialize)]
struct TileExtensions {
    #[serde(rename = "3DTILES_implicit_tiling")]
    implicit: Option<Box<Implicit>>,
    #[serde(rename = "3DTILES_multiple_contents")]
    multiple: Option<Multiple>,
}

/// How the tiles below one are given by templates (section 7.6).
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Implicit {
    pub subdivision_scheme: String,
    pub subtree_levels: u32,
    available_levels: Option<u32>,
    /// In drafts of 3DTILES_implicit_tiling: the last level rather than their number.
    maximum_level: Option<u32>,
    pub subtrees: Content,
}

impl Implicit {
    /// Levels of tiles, the first counted.
    pub fn levels(&self) -> Option<u32> {
        self.available_levels.or_else(|| self.maximum_level?.checked_add(1))
    }
}

/// 3DTILES_multiple_contents, whose list had another name in drafts.
#[derive(Debug, Deserialize)]
struct Multiple {
    #[serde(default, alias = "content")]
    contents: Vec<Content>,
}

/// A file that a tile shows; `url` is the name before version 1.0.
#[derive(Debug, Deserialize)]
pub(super) struct Content {
    #[serde(alias = "url")]
    uri: String,
}

impl Content {
    /// The URI.
    pub fn uri(&self) -> &str {
        &self.uri
    }
}

impl Tile {
    /// Every content.
    pub fn contents(&self) -> impl Iterator<Item = &Content> {
        let multiple = self.extensions.multiple.iter().flat_map(|multiple| &multiple.contents);
        self.content.iter().chain(&self.contents).chain(multiple)
    }

    /// What gives its descendants, if they are not listed.
    pub fn implicit(&self) -> Option<&Implicit> {
        self.implicit_tiling.as_deref().or(self.extensions.implicit.as_deref())
    }
}

/// Parses the JSON of the tileset `file` and checks its version and what it requires.
pub(super) fn parse(file: &str, text: &[u8]) -> Result<Tileset, ImportError> {
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    let tileset: Tileset = serde_json::from_slice(text).map_err(|e| ImportError::Content {
        file: file.to_owned(),
        place: "tileset".into(),
        problem: format!("not a readable 3D Tiles tileset: {}", one_line(&e.to_string())),
        remedy: "give a tileset.json of 3D Tiles 1.0 or 1.1, or another scene file",
    })?;
    if !matches!(tileset.asset.version.as_str(), "0.0" | "1.0" | "1.1") {
        return Err(ImportError::Content {
            file: file.to_owned(),
            place: "asset".into(),
            problem: format!("version \"{}\" of 3D Tiles is not read", one_line(&tileset.asset.version)),
            remedy: "export it as version 1.0 or 1.1",
        });
    }
    let unknown: Vec<_> = tileset.extensions_required.iter().filter(|name| !KNOWN.contains(&name.as_str())).collect();
    if let Some(name) = unknown.first() {
        return Err(ImportError::Extensions { file: file.to_owned(), extensions: one_line(name) });
    }
    Ok(tileset)
}
