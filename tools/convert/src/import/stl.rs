//! STL, binary and ASCII (3D Systems, StereoLithography Interface Specification, 1989).
//!
//! Triangles without shared vertices. The normals of facets are not read: they follow from the vertices, and many files
//! leave them zero.

use super::bytes::{Bytes, Spool, Stream};
use super::error::ImportError;
use super::opened::{Opened, Parts, TriangleBudget};
use super::plain::{self, fault, no_room, unreadable};
use super::table::{Table, TableWriter};
use super::text::Tokens;
use crate::source::{Primitive, SourceError, SourceTexture};
use std::path::Path;
use xxhash_rust::xxh3::Xxh3;

/// Header and number of triangles of a binary file.
const HEADER_BYTES: u64 = 84;

/// A binary triangle: normal, three vertices, two bytes of attributes.
const TRIANGLE_BYTES: u64 = 50;

/// An STL file, opened.
struct Stl {
    label: String,
    /// Nine numbers a triangle.
    triangles: Table,
    /// Bytes of a number: 4 or 8.
    width: usize,
}

/// Opens one .stl file.
pub(super) fn open(
    path: &Path,
    axes: &[f64; 12],
    spool: &Spool,
    budget: &mut TriangleBudget,
) -> Result<Opened, ImportError> {
    let mut start = plain::start(path, spool)?;
    let bytes = &start.bytes;
    let mut head = [0; HEADER_BYTES as usize];
    let n = bytes.len().min(HEADER_BYTES) as usize;
    let read = bytes.open().and_then(|reader| reader.read_at(0, &mut head[..n]));
    read.map_err(|e| unreadable(path, &e))?;

    let stated =
        (bytes.len() >= HEADER_BYTES).then(|| u64::from(u32::from_le_bytes([head[80], head[81], head[82], head[83]])));
    let held = bytes.len().saturating_sub(HEADER_BYTES) / TRIANGLE_BYTES;
    let fits = stated == Some(held) && HEADER_BYTES + held * TRIANGLE_BYTES == bytes.len();
    // Binary files may begin with "solid" as well; only their length tells.
    let is_ascii = !fits && head[..n].trim_ascii_start().starts_with(b"solid");
    let mut hash = Xxh3::new();
    let (triangles, width) = if is_ascii {
        (ascii(path, bytes, spool, &mut hash)?, 8)
    } else {
        bytes.hash(spool, &mut hash).map_err(|e| unreadable(path, &e))?;
        let stated = stated.ok_or_else(|| fault(path, "header", "the file is neither binary nor ASCII STL"))?;
        if stated > held {
            let problem = format!("states {stated} triangles, but the file can hold {held}");
            return Err(fault(path, "header", problem));
        }
        if !fits {
            start.warnings.add("bytes after the last triangle ignored", String::new);
        }
        // Vertices follow the normal. An empty table needs no bytes.
        let first = (HEADER_BYTES + 12).min(bytes.len());
        let rows = bytes.slice(first, bytes.len());
        let table = rows.and_then(|rows| Table::new(rows, stated, TRIANGLE_BYTES, 36));
        (table.ok_or_else(|| fault(path, "triangles", "the file is cut off"))?, 4)
    };
    if triangles.count() == 0 {
        return Err(fault(path, "triangles", "the file has none"));
    }
    let label = start.label.clone();
    budget.add(&label, 1, triangles.count())?;
    let mesh = plain::one_primitive(plain::stem(path), triangles.count());
    let outline = plain::outline(path, start, &hash, axes, vec![mesh], false);
    Ok(Opened { outline, parts: Box::new(Stl { label, triangles, width }) })
}

/// Runs through an ASCII file; its triangles go to the spool. What matters are the three vertices between `loop` and
/// `endloop`; other words are passed over.
fn ascii(path: &Path, bytes: &Bytes, spool: &Spool, hash: &mut Xxh3) -> Result<Table, ImportError> {
    let mut tokens = Tokens::new(bytes.stream(spool).map_err(|e| unreadable(path, &e))?);
    let mut table = TableWriter::new(spool, 72);
    let mut row = Vec::with_capacity(72);
    while let Some(token) = tokens.next().map_err(|e| unreadable(path, &e))? {
        let word = token.to_ascii_lowercase();
        match &word[..] {
            b"vertex" => {
                for _ in 0..3 {
                    let number = tokens.number().map_err(|e| unreadable(path, &e))?;
                    let number = number.map_err(|what| fault(path, tokens.place(), what))?;
                    row.extend_from_slice(&number.to_le_bytes());
                }
                if row.len() > 72 {
                    return Err(fault(path, tokens.place(), "a facet has more than three vertices"));
                }
            }
            b"endloop" => {
                if row.len() != 72 {
                    return Err(fault(path, tokens.place(), "a facet has fewer than three vertices"));
                }
                table.push(&row).map_err(|e| no_room(path, e))?;
                row.clear();
            }
            _ => {}
        }
    }
    if !row.is_empty() {
        return Err(fault(path, tokens.place(), "the file ends within a facet"));
    }
    *hash = Stream::finish(tokens.into_inner()).map_err(|e| unreadable(path, &e))?;
    table.finish().map_err(|e| no_room(path, e))
}

impl Parts for Stl {
    fn part(&self, _mesh: usize, part: usize) -> Result<Primitive, SourceError> {
        let (first, end) = plain::range(part, self.triangles.count());
        let mut positions = Vec::with_capacity(3 * (end - first) as usize);
        let read = self.triangles.run(first, end, |_, row| {
            let numbers = |at: usize| match self.width {
                4 => f64::from(f32::from_le_bytes([row[at], row[at + 1], row[at + 2], row[at + 3]])),
                _ => f64::from_le_bytes(std::array::from_fn(|i| row[at + i])),
            };
            positions.extend((0..3).map(|v| std::array::from_fn(|c| numbers((3 * v + c) * self.width))));
            true
        });
        read.map_err(|e| {
            SourceError(format!("{}: cannot be read: {e}; keep it in place while it is converted", self.label))
        })?;
        let indices = (0..positions.len() as u32).collect();
        Ok(Primitive { positions, indices, ..Primitive::default() })
    }

    fn label(&self) -> &str {
        &self.label
    }

    fn vertex(&self, _mesh: usize, part: usize, vertex: u32) -> Option<u64> {
        Some(3 * plain::range(part, self.triangles.count()).0 + u64::from(vertex))
    }

    fn texture(&self, _index: usize) -> Result<SourceTexture, SourceError> {
        Err(SourceError(format!("{}: it has no textures", self.label)))
    }

    fn repairs(&self) -> Vec<String> {
        Vec::new()
    }
}
