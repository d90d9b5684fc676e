//! 3D Tiles 1.0 and 1.1 (OGC 22-025r4): a tree of tiles as placed models, the finest wherever tiles are refined by
//! replacement.
//!
//! Tilesets are right-handed with Z up, in metres. What glTF has as Y up is turned so before a tile's transformation
//! (section 6.7.1.6.2), which is composed in f64 down the tree: models far from the origin, such as Earth-centred ones,
//! keep their detail.

mod b3dm;
mod document;

use super::affine::{Affine, from_columns, multiply};
use super::bytes::{Bytes, Spool};
use super::error::{EXPORT_AGAIN, ImportError, one_line, show};
use super::opened::{self, TriangleBudget};
use super::{gltf, uri};
use crate::source::IDENTITY;
use document::{Content, Tile, Tileset};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use xxhash_rust::xxh3::Xxh3;

/// Most tiles that are walked, external tilesets multiplied out.
const MAX_TILES: u64 = 1 << 22;

/// Deepest nesting of external tilesets.
const MAX_DEPTH: usize = 32;

/// Largest tileset file.
const MAX_BYTES: u64 = 1 << 30;

/// A model and where it stands.
pub(super) struct Model {
    /// The file.
    pub path: PathBuf,
    /// Its bytes, and those of the glTF file within it.
    bytes: [Bytes; 2],
    /// From its coordinates, Y up or as `axes` says, to those of its tile.
    tile_from_model: Affine,
    /// From each tile that shows it to the tileset, Z up.
    pub placements: Vec<Affine>,
}

/// What a tileset shows.
pub(super) struct Opened {
    /// Models in the order in which they are first met, depth first.
    pub models: Vec<Model>,
    /// The tilesets that were read.
    pub sources: Vec<bricks::Source>,
}

/// A model by its file and how its glTF file is turned.
type Key = (PathBuf, Axis);

/// The axis that points up in glTF files of a tileset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Axis {
    X,
    Y,
    Z,
}

impl Axis {
    /// What turns it to Z.
    fn z_from_up(self) -> Affine {
        match self {
            Axis::X => [0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
            Axis::Y => [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0],
            Axis::Z => IDENTITY,
        }
    }
}

/// A tileset that has been read.
struct Parsed {
    label: String,
    tileset: Tileset,
    axis: Option<Axis>,
}

/// Where a tile is met.
#[derive(Clone)]
struct Place {
    /// The tileset's path below the folder of the first one.
    below: PathBuf,
    parsed: Arc<Parsed>,
    axis: Axis,
    replaces: bool,
    world_from_parent: Affine,
}

/// A walk through the tiles.
struct Walk<'a> {
    folder: PathBuf,
    spool: &'a Arc<Spool>,
    tilesets: BTreeMap<PathBuf, Arc<Parsed>>,
    /// Tilesets that are being walked, outermost first.
    open: Vec<PathBuf>,
    tiles: u64,
    numbers: BTreeMap<Key, usize>,
    models: Vec<Model>,
    sources: Vec<bricks::Source>,
}

/// A model that a tile shows: its number and where.
type Shown = (usize, Affine);

/// Reads the tileset at `path` and what it refers to, up to the models.
pub(super) fn open(path: &Path, spool: &Arc<Spool>) -> Result<Opened, ImportError> {
    let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
    let below = PathBuf::from(path.file_name().unwrap_or_default());
    let mut walk = Walk {
        folder,
        spool,
        tilesets: BTreeMap::new(),
        open: Vec::new(),
        tiles: 0,
        numbers: BTreeMap::new(),
        models: Vec::new(),
        sources: Vec::new(),
    };
    let parsed = walk.tileset(&below)?;
    let axis = parsed.axis.unwrap_or(Axis::Y);
    let place = Place { below, parsed, axis, replaces: true, world_from_parent: IDENTITY };
    let shown = walk.external(&place)?;
    for (model, world_from_tile) in shown {
        walk.models[model].placements.push(world_from_tile);
    }
    // A coarse model that finer ones replace was opened, but is not shown.
    walk.models.retain(|model| !model.placements.is_empty());
    Ok(Opened { models: walk.models, sources: walk.sources })
}

impl Walk<'_> {
    /// The tileset at `below`, read once.
    fn tileset(&mut self, below: &Path) -> Result<Arc<Parsed>, ImportError> {
        if let Some(parsed) = self.tilesets.get(below) {
            return Ok(parsed.clone());
        }
        let path = self.folder.join(below);
        let label = show(&path);
        let unreadable = |reason: String| ImportError::Read { file: label.clone(), reason };
        let bytes = Bytes::of_file(&path).map_err(unreadable)?;
        if bytes.len() > MAX_BYTES {
            return Err(unreadable(format!("a tileset of {} bytes is too large", bytes.len())));
        }
        let mut hash = Xxh3::new();
        bytes.hash(self.spool, &mut hash).map_err(|e| unreadable(e.to_string()))?;
        let text = bytes.read().map_err(unreadable)?;
        let tileset = document::parse(&label, &text)?;
        let axis = match tileset.asset.gltf_up_axis.as_deref().map(str::to_ascii_uppercase).as_deref() {
            None => None,
            Some("X") => Some(Axis::X),
            Some("Y") => Some(Axis::Y),
            Some("Z") => Some(Axis::Z),
            Some(other) => {
                let what = format!("gltfUpAxis is \"{}\", not X, Y or Z", one_line(other));
                return Err(fault(&label, "asset".into(), what));
            }
        };
        let name = below.to_string_lossy().into_owned();
        self.sources.push(bricks::Source { name, bytes: bytes.len(), hash: format!("{:016x}", hash.digest()) });
        let parsed = Arc::new(Parsed { label, tileset, axis });
        self.tilesets.insert(below.to_owned(), parsed.clone());
        Ok(parsed)
    }

    /// What the tileset of `place` shows.
    fn external(&mut self, place: &Place) -> Result<Vec<Shown>, ImportError> {
        let fault = |what: &str| fault(&place.parsed.label, "tileset".into(), what.to_owned());
        if self.open.contains(&place.below) {
            return Err(fault("refers to itself, directly or through others"));
        }
        if self.open.len() == MAX_DEPTH {
            return Err(fault("external tilesets are nested too deeply"));
        }
        self.open.push(place.below.clone());
        let shown = self.tile(&place.parsed.tileset.root, place)?;
        self.open.pop();
        Ok(shown)
    }

    /// What `tile` and the tiles below it show.
    fn tile(&mut self, tile: &Tile, place: &Place) -> Result<Vec<Shown>, ImportError> {
        let label = &place.parsed.label;
        let number = self.tiles;
        let here = || format!("tile {number}");
        self.tiles += 1;
        if self.tiles > MAX_TILES {
            return Err(fault(label, here(), format!("there are more than {MAX_TILES} tiles; convert it in parts")));
        }
        if tile.is_implicit() {
            return Err(fault(label, here(), "implicit tiling is not read".into()));
        }
        let own = tile.transform.as_ref().map_or(Ok(IDENTITY), |transform| from_columns(transform));
        let own = own.map_err(|what| fault(label, here(), what.replace("its matrix", "its transform")))?;
        let world_from_tile = multiply(&place.world_from_parent, &own);
        let replaces = match tile.refine.as_deref().map(str::to_ascii_uppercase).as_deref() {
            None => place.replaces,
            Some("REPLACE") => true,
            Some("ADD") => false,
            Some(other) => {
                return Err(fault(label, here(), format!("refine is \"{}\", not ADD or REPLACE", one_line(other))));
            }
        };
        let place = Place { replaces, world_from_parent: world_from_tile, ..place.clone() };
        let (mut shown, mut below) = (Vec::new(), Vec::new());
        for content in tile.contents() {
            match self.content(content, &place)? {
                Shows::Model(model) => shown.push((model, world_from_tile)),
                Shows::Tiles(tiles) => below.extend(tiles),
            }
        }
        for child in &tile.children {
            below.extend(self.tile(child, &place)?);
        }
        // What replaces nothing leaves the coarse model in view.
        if !replaces || below.is_empty() {
            shown.append(&mut below);
            return Ok(shown);
        }
        Ok(below)
    }

    /// What a content is: a model, or the tiles of an external tileset.
    fn content(&mut self, content: &Content, place: &Place) -> Result<Shows, ImportError> {
        let label = &place.parsed.label;
        let text = content.uri();
        let refuse = |what: &str| fault(label, format!("content \"{}\"", one_line(text)), what.to_owned());
        let from = place.below.parent().unwrap_or(Path::new(""));
        let below = match uri::resolve_from(from, text).map_err(refuse)? {
            uri::Target::File(below) => below,
            uri::Target::Data(_) => return Err(refuse("data URIs are not read here")),
        };
        let key = (below, place.axis);
        if let Some(&model) = self.numbers.get(&key) {
            return Ok(Shows::Model(model));
        }
        let (below, axis) = key;
        let path = self.folder.join(&below);
        let unreadable = |reason: String| ImportError::Read { file: show(&path), reason };
        let bytes = Bytes::of_file(&path).map_err(unreadable)?;
        let reader = bytes.open().map_err(|e| unreadable(e.to_string()))?;
        let mut magic = [0; 4];
        let read = reader.read_at(0, &mut magic[..bytes.len().min(4) as usize]);
        read.map_err(|e| unreadable(e.to_string()))?;
        let is_gltf = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gltf"));
        let (gltf, center) = match &magic {
            b"b3dm" => b3dm::open(&bytes, &reader).map_err(|what| fault(&show(&path), "b3dm".into(), what))?,
            b"i3dm" => return Err(refuse("instanced models (i3dm) are not read")),
            b"pnts" => return Err(refuse("point clouds (pnts) are not read")),
            b"cmpt" => return Err(refuse("composite tiles (cmpt) are not read")),
            b"subt" => return Err(refuse("subtrees of implicit tiling are not read")),
            b"vctr" | b"geom" => return Err(refuse("vector tiles are not read")),
            b"glTF" => (bytes.clone(), [0.0; 3]),
            _ if is_gltf => (bytes.clone(), [0.0; 3]),
            _ if starts_json(&magic) => {
                let parsed = self.tileset(&below)?;
                let place = Place { below, axis: parsed.axis.unwrap_or(axis), parsed, ..place.clone() };
                return self.external(&place).map(Shows::Tiles);
            }
            _ => return Err(refuse("it is neither glTF, b3dm nor a tileset")),
        };
        let mut tile_from_model = axis.z_from_up();
        for (row, center) in center.into_iter().enumerate() {
            tile_from_model[4 * row + 3] = center;
        }
        self.models.push(Model { path, bytes: [bytes, gltf], tile_from_model, placements: Vec::new() });
        self.numbers.insert((below, axis), self.models.len() - 1);
        Ok(Shows::Model(self.models.len() - 1))
    }
}

/// What a content is.
enum Shows {
    Model(usize),
    Tiles(Vec<Shown>),
}

/// Whether JSON may begin so.
fn starts_json(start: &[u8; 4]) -> bool {
    let start = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start);
    start.trim_ascii_start().first().is_none_or(|&c| c == b'{')
}

/// Opens a model: its placements are those in its tile, Z up.
pub(super) fn open_model(
    model: &Model,
    movable: &[String],
    spool: &Arc<Spool>,
    budget: &mut TriangleBudget,
) -> Result<opened::Opened, ImportError> {
    gltf::open_within(&model.path, model.bytes.each_ref(), (None, movable), &model.tile_from_model, spool, budget)
}

fn fault(file: &str, place: String, problem: String) -> ImportError {
    ImportError::Content { file: file.to_owned(), place, problem, remedy: EXPORT_AGAIN }
}
