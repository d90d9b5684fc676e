//! 3D Tiles 1.0 and 1.1 (OGC 22-025r4): a tree of tiles as placed models, the finest wherever tiles are refined by
//! replacement.
//!
//! Tilesets are right-handed with Z up, in metres. What glTF has as Y up is turned so before a tile's transformation
//! (section 6.7.1.6.2), which is composed in f64 down the tree: models far from the origin, such as Earth-centred ones,
//! keep their detail.

mod b3dm;
mod batched;
mod document;
mod i3dm;
mod implicit;
mod subtree;

use super::affine::{Affine, from_columns, multiply};
use super::bytes::{Bytes, Spool};
use super::error::{EXPORT_AGAIN, ImportError, one_line, show};
use super::opened::{self, TriangleBudget};
use super::reach::Reach;
use super::{gltf, uri};
use crate::source::IDENTITY;
use bricks::planted::{self, Defect};
use document::{Tile, Tileset};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use subtree::Subtree;

/// Most tiles that are walked and instances that they place, external tilesets multiplied out.
const MAX_TILES: u64 = 1 << 22;

/// Deepest nesting of external tilesets.
const MAX_DEPTH: usize = 32;

/// Largest file of tiles: a tileset, a subtree or a buffer of one.
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
    /// The tilesets and subtrees that were read.
    pub sources: Vec<bricks::Source>,
    /// How often tiles show a model at the very place where it is shown already. Such copies are left out.
    pub copies: u64,
}

/// A file of a model, and how its glTF file is turned.
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
    /// The tileset's path below the root of what the first one reaches.
    below: PathBuf,
    parsed: Arc<Parsed>,
    axis: Axis,
    replaces: bool,
    world_from_parent: Affine,
}

/// A walk through the tiles.
struct Walk<'a> {
    reach: Reach,
    spool: &'a Arc<Spool>,
    tilesets: BTreeMap<PathBuf, Arc<Parsed>>,
    subtrees: BTreeMap<PathBuf, Arc<Subtree>>,
    /// What was read of files of tiles.
    files: BTreeMap<PathBuf, Bytes>,
    /// Tilesets that are being walked, outermost first.
    open: Vec<PathBuf>,
    tiles: u64,
    /// The number of each model, or that within an instanced one, and its places there.
    numbers: BTreeMap<Key, (usize, Arc<[Affine]>)>,
    models: Vec<Model>,
    sources: Vec<bricks::Source>,
}

/// A model that a tile shows: its number and where.
type Shown = (usize, Affine);

/// Reads the tileset at `path` and what it refers to, up to the models, as far as `within` lets references lead
/// ([`Reach::of`]).
pub(super) fn open(path: &Path, within: Option<&Path>, spool: &Arc<Spool>) -> Result<Opened, ImportError> {
    let reach = Reach::of(path, within)?;
    let below = reach.own(path.file_name().unwrap_or_default());
    let mut walk = Walk {
        reach,
        spool,
        tilesets: BTreeMap::new(),
        subtrees: BTreeMap::new(),
        files: BTreeMap::new(),
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
    let mut copies = 0;
    for model in &mut walk.models {
        let (mut places, before) = (BTreeSet::new(), model.placements.len());
        // Adding 0 takes the sign off a zero.
        model.placements.retain(|place| places.insert(place.map(|c| (c + 0.0).to_bits())));
        copies += (before - model.placements.len()) as u64;
    }
    Ok(Opened { models: walk.models, sources: walk.sources, copies })
}

impl Walk<'_> {
    /// The tileset at `below`, read once.
    fn tileset(&mut self, below: &Path) -> Result<Arc<Parsed>, ImportError> {
        if let Some(parsed) = self.tilesets.get(below) {
            return Ok(parsed.clone());
        }
        let label = show(&self.reach.path(below));
        let text = self.source(below)?.read();
        let text = text.map_err(|reason| ImportError::Read { file: label.clone(), reason })?;
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
        let parsed = Arc::new(Parsed { label, tileset, axis });
        self.tilesets.insert(below.to_owned(), parsed.clone());
        Ok(parsed)
    }

    /// What the tileset of `place` shows.
    fn external(&mut self, place: &Place) -> Result<Vec<Shown>, ImportError> {
        let fault = |what: &str| fault(&place.parsed.label, "tileset".into(), what.to_owned());
        if self.open.contains(&place.below) && !planted::is(Defect::TilesetCircle) {
            return Err(fault("refers to itself, directly or through others"));
        }
        if self.open.len() == MAX_DEPTH && !planted::is(Defect::TilesetCircle) {
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
        self.count(1, label)?;
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
        if let Some(implicit) = tile.implicit() {
            return self.implicit(tile, implicit, &place);
        }
        let (mut shown, mut below) = (Vec::new(), Vec::new());
        for content in tile.contents() {
            match self.content(content.uri(), &place)? {
                Shows::Model(model, places) => self.show(model, &places, &place, &mut shown)?,
                Shows::Tiles(tiles) => below.extend(tiles),
            }
        }
        for child in &tile.children {
            below.extend(self.tile(child, &place)?);
        }
        Ok(shows(shown, below, replaces))
    }

    /// Counts tiles and instances of the tileset `label`.
    fn count(&mut self, more: u64, label: &str) -> Result<(), ImportError> {
        self.tiles += more;
        if self.tiles > MAX_TILES {
            let what = format!("there are more than {MAX_TILES} tiles and instances; convert it in parts");
            return Err(fault(label, "tileset".into(), what));
        }
        Ok(())
    }

    /// Adds a model in the tile at `place`, at `places` of the tile, to what is shown.
    fn show(
        &mut self,
        model: usize,
        places: &[Affine],
        place: &Place,
        shown: &mut Vec<Shown>,
    ) -> Result<(), ImportError> {
        self.count(places.len() as u64 - places.len().min(1) as u64, &place.parsed.label)?;
        shown.extend(places.iter().map(|in_tile| (model, multiply(&place.world_from_parent, in_tile))));
        Ok(())
    }

    /// What a content is: a model, or the tiles of an external tileset.
    fn content(&mut self, text: &str, place: &Place) -> Result<Shows, ImportError> {
        let label = &place.parsed.label;
        let refuse = |what: &str| fault(label, format!("content \"{}\"", one_line(text)), what.to_owned());
        let from = place.below.parent().unwrap_or(Path::new(""));
        let below = match uri::resolve(from, text).map_err(refuse)? {
            uri::Target::File(below) => below,
            uri::Target::Data(_) => return Err(refuse("data URIs are not read here")),
        };
        let key = (below, place.axis);
        if let Some((model, places)) = self.numbers.get(&key) {
            return Ok(Shows::Model(*model, places.clone()));
        }
        let (below, axis) = key;
        let path = self.reach.path(&below);
        let unreadable = |reason: String| ImportError::Read { file: show(&path), reason };
        let bytes = self.reach.file(&below, self.spool).map_err(unreadable)?;
        let reader = bytes.open().map_err(|e| unreadable(e.to_string()))?;
        let mut magic = [0; 4];
        let read = reader.read_at(0, &mut magic[..bytes.len().min(4) as usize]);
        read.map_err(|e| unreadable(e.to_string()))?;
        let is_gltf = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gltf"));
        let of_file = |what: String| fault(&show(&path), String::from_utf8_lossy(&magic).into_owned(), what);
        let (gltf, center) = match &magic {
            b"b3dm" => b3dm::open(&bytes, &reader).map_err(of_file)?,
            b"i3dm" => {
                let (model, places) = i3dm::open(&bytes, &reader, MAX_TILES).map_err(of_file)?;
                let number = match model {
                    i3dm::Model::Within(gltf) => self.model(path, [bytes, gltf], axis.z_from_up()),
                    i3dm::Model::At(uri) => self.gltf_at(&uri, &below, axis).map_err(of_file)?,
                };
                let places: Arc<[Affine]> = places.into();
                self.numbers.insert((below, axis), (number, places.clone()));
                return Ok(Shows::Model(number, places));
            }
            b"pnts" => return Err(refuse("point clouds (pnts) are not read")),
            b"cmpt" => return Err(refuse("composite tiles (cmpt) are not read")),
            b"subt" => return Err(refuse("it is a subtree, which implicitTiling must name")),
            b"vctr" | b"geom" => return Err(refuse("vector tiles are not read")),
            b"glTF" => (bytes.clone(), [0.0; 3]),
            _ if is_gltf => (bytes.clone(), [0.0; 3]),
            _ if starts_json(&magic) => {
                let parsed = self.tileset(&below)?;
                let place = Place { below, axis: parsed.axis.unwrap_or(axis), parsed, ..place.clone() };
                return self.external(&place).map(Shows::Tiles);
            }
            _ => return Err(refuse("it is neither glTF, b3dm, i3dm nor a tileset")),
        };
        let mut tile_from_model = axis.z_from_up();
        for (row, center) in center.into_iter().enumerate() {
            tile_from_model[4 * row + 3] = center;
        }
        let number = self.model(path, [bytes, gltf], tile_from_model);
        let places: Arc<[Affine]> = [IDENTITY].into();
        self.numbers.insert((below, axis), (number, places.clone()));
        Ok(Shows::Model(number, places))
    }

    /// The number of a new model.
    fn model(&mut self, path: PathBuf, bytes: [Bytes; 2], tile_from_model: Affine) -> usize {
        self.models.push(Model { path, bytes, tile_from_model, placements: Vec::new() });
        self.models.len() - 1
    }

    /// The number of the glTF file that the instanced model at `below` names.
    fn gltf_at(&mut self, uri: &str, below: &Path, axis: Axis) -> Result<usize, String> {
        let named = |what: &str| format!("its glTF file \"{}\": {what}", one_line(uri));
        let from = below.parent().unwrap_or(Path::new(""));
        let uri::Target::File(gltf) = uri::resolve(from, uri).map_err(named)? else {
            return Err(named("data URIs are not read here"));
        };
        let key = (gltf, axis);
        if let Some((model, _)) = self.numbers.get(&key) {
            return Ok(*model);
        }
        let path = self.reach.path(&key.0);
        let bytes = self.reach.file(&key.0, self.spool).map_err(|what| named(&what))?;
        let number = self.model(path, [bytes.clone(), bytes], axis.z_from_up());
        self.numbers.insert(key, (number, [IDENTITY].into()));
        Ok(number)
    }
}

/// What a content is.
enum Shows {
    /// The number of a model, and its places in the tile.
    Model(usize, Arc<[Affine]>),
    Tiles(Vec<Shown>),
}

/// What is shown of a tile's own models and of those `below` it. What replaces nothing leaves the coarse model in view.
fn shows(mut shown: Vec<Shown>, mut below: Vec<Shown>, replaces: bool) -> Vec<Shown> {
    if replaces && !below.is_empty() {
        return below;
    }
    shown.append(&mut below);
    shown
}

/// Whether JSON may begin so.
fn starts_json(start: &[u8; 4]) -> bool {
    let start = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start);
    start.trim_ascii_start().first().is_none_or(|&c| c == b'{')
}

/// Opens a model: its placements are those in its tile, Z up.
pub(super) fn open_model(
    model: &Model,
    (within, movable): (Option<&Path>, &[String]),
    spool: &Arc<Spool>,
    budget: &mut TriangleBudget,
) -> Result<opened::Opened, ImportError> {
    let file = (model.path.as_path(), within);
    gltf::open_piece(file, model.bytes.each_ref(), (None, movable), &model.tile_from_model, spool, budget)
}

fn fault(file: &str, place: String, problem: String) -> ImportError {
    ImportError::Content { file: file.to_owned(), place, problem, remedy: EXPORT_AGAIN }
}
