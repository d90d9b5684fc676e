//! Implicit tilesets (OGC 22-025r4, section 7.6): every tile splits into four or eight, bits of subtrees say which of
//! these there are, and templates name their files.

use super::document::{Implicit, Tile};
use super::subtree::{self, Subtree};
use super::{MAX_BYTES, Place, Shown, Shows, Walk, fault, shows};
use crate::import::bytes::Bytes;
use crate::import::error::{ImportError, one_line, show};
use crate::import::uri;
use std::path::Path;
use std::sync::Arc;

/// Most levels of tiles: their coordinates have as many bits.
const MAX_LEVELS: u32 = 48;

/// Most bits of a tile's place in its subtree.
const MAX_MORTON_BITS: u32 = 48;

/// A tile by its place in the tree.
#[derive(Clone, Copy, Debug)]
struct Cell {
    level: u32,
    at: [u64; 3],
}

impl Cell {
    /// The child whose bits are the lowest of each coordinate.
    fn child(self, bits: u64) -> Self {
        Self { level: self.level + 1, at: std::array::from_fn(|axis| self.at[axis] << 1 | bits >> axis & 1) }
    }

    /// A template with the place filled in.
    fn fill(self, template: &str) -> String {
        let [x, y, z] = self.at.map(|c| c.to_string());
        let level = self.level.to_string();
        template.replace("{level}", &level).replace("{x}", &x).replace("{y}", &y).replace("{z}", &z)
    }
}

/// An implicit tileset.
struct Grid<'a> {
    /// Axes that are halved: x and y, or all.
    axes: u32,
    levels: u32,
    subtree_levels: u32,
    subtrees: &'a str,
    contents: Vec<&'a str>,
    place: &'a Place,
}

impl Grid<'_> {
    /// Tiles of a subtree above its level of this number.
    fn before(&self, level: u32) -> u64 {
        (0..level).map(|level| 1u64 << (self.axes * level)).sum()
    }
}

/// A subtree with the tiles in it.
struct Inside<'a> {
    subtree: &'a Subtree,
    /// Level within the subtree.
    level: u32,
    /// Place in the level, in Morton order.
    morton: u64,
}

impl Walk<'_> {
    /// What the tiles show that `implicit` gives, the first of which is `tile`.
    pub(super) fn implicit(
        &mut self,
        tile: &Tile,
        implicit: &Implicit,
        place: &Place,
    ) -> Result<Vec<Shown>, ImportError> {
        let label = &place.parsed.label;
        let refuse = |what: String| fault(label, "implicit tiling".into(), what);
        let axes = match implicit.subdivision_scheme.as_str() {
            "QUADTREE" => 2,
            "OCTREE" => 3,
            other => {
                let what = format!("subdivisionScheme is \"{}\", not QUADTREE or OCTREE", one_line(other));
                return Err(refuse(what));
            }
        };
        if !tile.children.is_empty() {
            return Err(refuse("its tile lists children, too".into()));
        }
        let levels = implicit.levels().ok_or_else(|| refuse("availableLevels is missing".into()))?;
        if !(1..=MAX_LEVELS).contains(&levels) {
            return Err(refuse(format!("availableLevels is {levels}, not 1 to {MAX_LEVELS}")));
        }
        let subtree_levels = implicit.subtree_levels;
        if !(1..=MAX_MORTON_BITS / axes).contains(&subtree_levels) {
            let most = MAX_MORTON_BITS / axes;
            return Err(refuse(format!("subtreeLevels is {subtree_levels}, not 1 to {most}")));
        }
        let contents = tile.contents().map(|content| content.uri()).collect();
        let grid = Grid { axes, levels, subtree_levels, subtrees: implicit.subtrees.uri(), contents, place };
        self.subtree(&grid, Cell { level: 0, at: [0; 3] })
    }

    /// What the subtree of `cell` and those below it show.
    fn subtree(&mut self, grid: &Grid, cell: Cell) -> Result<Vec<Shown>, ImportError> {
        let subtree = self.read_subtree(grid, cell)?;
        // A subtree without its first tile has none.
        match subtree.tiles.get(0) {
            true => self.cell(grid, cell, &Inside { subtree: &subtree, level: 0, morton: 0 }),
            false => Ok(Vec::new()),
        }
    }

    /// What a tile that is there, and the tiles below it, show.
    fn cell(&mut self, grid: &Grid, cell: Cell, inside: &Inside) -> Result<Vec<Shown>, ImportError> {
        self.count(1, &grid.place.parsed.label)?;
        let Inside { subtree, level, morton } = *inside;
        let (mut shown, mut below) = (Vec::new(), Vec::new());
        let number = grid.before(level) + morton;
        for (template, available) in grid.contents.iter().zip(&subtree.contents) {
            if !available.get(number) {
                continue;
            }
            let uri = cell.fill(template);
            match self.content(&uri, grid.place)? {
                Shows::Model(model, places) => self.show(model, &places, grid.place, &mut shown)?,
                Shows::Tiles(_) => {
                    let place = format!("content \"{}\"", one_line(&uri));
                    return Err(fault(&grid.place.parsed.label, place, "an implicit tile shows a tileset".into()));
                }
            }
        }
        if cell.level + 1 < grid.levels {
            for bits in 0..1 << grid.axes {
                let morton = morton << grid.axes | bits;
                let child = cell.child(bits);
                if level + 1 == grid.subtree_levels {
                    if subtree.children.get(morton) {
                        below.extend(self.subtree(grid, child)?);
                    }
                } else if subtree.tiles.get(grid.before(level + 1) + morton) {
                    below.extend(self.cell(grid, child, &Inside { subtree, level: level + 1, morton })?);
                }
            }
        }
        Ok(shows(shown, below, grid.place.replaces))
    }

    /// The subtree of `cell`, read once.
    fn read_subtree(&mut self, grid: &Grid, cell: Cell) -> Result<Arc<Subtree>, ImportError> {
        let text = cell.fill(grid.subtrees);
        let place = format!("subtree \"{}\"", one_line(&text));
        let refuse = |what: &str| fault(&grid.place.parsed.label, place.clone(), what.to_owned());
        let from = grid.place.below.parent().unwrap_or(Path::new(""));
        let uri::Target::File(below) = uri::resolve(from, &text).map_err(refuse)? else {
            return Err(refuse("data URIs are not read here"));
        };
        if let Some(subtree) = self.subtrees.get(&below) {
            return Ok(subtree.clone());
        }
        let bytes = self.source(&below)?;
        let folder = below.parent().unwrap_or(Path::new("")).to_owned();
        let mut buffer = |uri: &str| self.buffer(&folder, uri);
        let counts = [grid.before(grid.subtree_levels), 1 << (grid.axes * grid.subtree_levels)];
        let subtree = subtree::read(&bytes, counts, &mut buffer);
        let path = self.reach.path(&below);
        let subtree = Arc::new(subtree.map_err(|what| fault(&show(&path), "subtree".into(), what))?);
        self.subtrees.insert(below, subtree.clone());
        Ok(subtree)
    }

    /// A buffer of a subtree in `folder`.
    fn buffer(&mut self, folder: &Path, uri: &str) -> Result<Bytes, String> {
        let named = |what: &str| format!("buffer \"{}\": {what}", one_line(uri));
        match uri::resolve(folder, uri).map_err(named)? {
            uri::Target::Data(bytes) => self.spool.add(&bytes),
            uri::Target::File(below) => self.source(&below).map_err(|error| error.to_string()),
        }
    }

    /// The bytes of a file beside the models, which is noted as read.
    pub(super) fn source(&mut self, below: &Path) -> Result<Bytes, ImportError> {
        if let Some(bytes) = self.files.get(below) {
            return Ok(bytes.clone());
        }
        let path = self.reach.path(below);
        let unreadable = |reason: String| ImportError::Read { file: show(&path), reason };
        let bytes = self.reach.file(below, self.spool).map_err(unreadable)?;
        if bytes.len() > MAX_BYTES {
            return Err(unreadable(format!("{} bytes are too many for a file of tiles", bytes.len())));
        }
        let mut hash = xxhash_rust::xxh3::Xxh3::new();
        bytes.hash(self.spool, &mut hash).map_err(|e| unreadable(e.to_string()))?;
        let name = self.reach.name(below);
        self.sources.push(bricks::Source { name, bytes: bytes.len(), hash: format!("{:016x}", hash.digest()) });
        self.files.insert(below.to_owned(), bytes.clone());
        Ok(bytes)
    }
}
