//! The text of an OBJ file into tables.

use crate::import::bytes::{Spool, Stream};
use crate::import::error::{ImportError, one_line, show};
use crate::import::opened::TriangleBudget;
use crate::import::plain::{self, fault, no_room, unreadable};
use crate::import::table::{Table, TableWriter};
use crate::import::text::{Lines, number};
use crate::import::warnings::Warnings;
use bricks::NONE;
use std::collections::HashMap;
use std::io::BufReader;
use std::path::Path;

/// Most files of materials; further ones are passed over.
const MAX_LIBRARIES: usize = 64;

/// What an OBJ file holds.
pub(super) struct Parsed {
    /// Three f64 a row.
    pub positions: Table,
    /// Linear RGBA of each position, f32.
    pub colors: Option<Table>,
    /// Two f32 a row, v downwards.
    pub uvs: Table,
    /// Three f32 a row.
    pub normals: Table,
    /// Position, texture coordinates and normal of three corners a row, u32; positions are in range.
    pub triangles: Table,
    /// Runs of triangles, none empty.
    pub runs: Vec<Run>,
    /// Names of objects; the first is that of faces before any.
    pub objects: Vec<String>,
    /// Names of materials in order of first use; empty for faces before any.
    pub materials: Vec<String>,
    /// Files of materials, as written.
    pub libraries: Vec<String>,
}

/// A run of triangles of one object and one material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Run {
    /// The first triangle.
    pub first: u64,
    pub object: u32,
    pub material: u32,
    pub has_uvs: bool,
    pub has_normals: bool,
}

/// The largest positive index so far that was not there yet when it was used, and its line.
#[derive(Default)]
struct Ahead {
    index: u64,
    line: u64,
}

struct Parser<'a> {
    path: &'a Path,
    spool: &'a Spool,
    positions: TableWriter<'a>,
    colors: Option<TableWriter<'a>>,
    uvs: TableWriter<'a>,
    normals: TableWriter<'a>,
    triangles: TableWriter<'a>,
    runs: Vec<Run>,
    objects: Vec<String>,
    materials: Vec<String>,
    numbers: HashMap<String, u32>,
    libraries: Vec<String>,
    material: Option<u32>,
    ahead: Ahead,
}

/// Runs through `stream`; also gives back what is left of it.
pub(super) fn parse(
    path: &Path,
    stream: BufReader<Stream>,
    spool: &Spool,
    warnings: &mut Warnings,
    budget: &mut TriangleBudget,
) -> Result<(Parsed, BufReader<Stream>), ImportError> {
    let mut lines = Lines::new(stream);
    let mut parser = Parser {
        path,
        spool,
        positions: TableWriter::new(spool, 24),
        colors: None,
        uvs: TableWriter::new(spool, 8),
        normals: TableWriter::new(spool, 12),
        triangles: TableWriter::new(spool, 36),
        runs: Vec::new(),
        objects: vec![String::new()],
        materials: Vec::new(),
        numbers: HashMap::new(),
        libraries: Vec::new(),
        material: None,
        ahead: Ahead::default(),
    };
    let label = show(path);
    loop {
        let number = lines.count() + 1;
        let Some(line) = lines.next().map_err(|e| unreadable(path, &e))? else { break };
        let before = parser.triangles.count();
        parser.line(line, number, warnings).map_err(|stop| match stop {
            Stop::Bad(what) => fault(path, format!("line {number}"), what),
            Stop::Spool(what) => no_room(path, what),
        })?;
        budget.add(&label, 1, parser.triangles.count() - before)?;
    }
    Ok((parser.finish()?, lines.into_inner()))
}

/// Why a line ends the run.
enum Stop {
    /// It is bad.
    Bad(String),
    /// What it says cannot be kept.
    Spool(String),
}

impl Parser<'_> {
    fn line(&mut self, line: &[u8], number: u64, warnings: &mut Warnings) -> Result<(), Stop> {
        let line = line.split(|&c| c == b'#').next().unwrap_or_default().trim_ascii();
        let end = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
        let (keyword, rest) = line.split_at(end);
        let text = || String::from_utf8_lossy(rest.trim_ascii()).into_owned();
        match keyword {
            b"v" => self.vertex(rest)?,
            b"vt" => {
                let [u, v, ..] = numbers::<3>(rest, 1)?.0;
                // Rows of images run downwards.
                let uv = [u as f32, 1.0 - v as f32];
                self.uvs.push(bytemuck::cast_slice(&uv)).map_err(Stop::Spool)?;
            }
            b"vn" => {
                let normal = numbers::<3>(rest, 3)?.0.map(|c| c as f32);
                self.normals.push(bytemuck::cast_slice(&normal)).map_err(Stop::Spool)?;
            }
            b"f" | b"fo" => self.face(rest, number, warnings)?,
            b"o" | b"g" => self.objects.push(one_line(&text())),
            b"usemtl" => {
                let name = text();
                let next = self.materials.len() as u32;
                let material = *self.numbers.entry(name).or_insert_with_key(|name| {
                    self.materials.push(name.clone());
                    next
                });
                self.material = Some(material);
            }
            b"mtllib" => {
                let library = text();
                if !self.libraries.contains(&library) && self.libraries.len() < MAX_LIBRARIES {
                    self.libraries.push(library);
                }
            }
            b"p" | b"l" => warnings.add("points and lines skipped", || format!("line {number}")),
            b"curv" | b"curv2" | b"surf" => {
                warnings.add("curves and surfaces skipped", || format!("line {number}"));
            }
            // Comments, smoothing groups, what only those who wrote it know.
            _ => {}
        }
        Ok(())
    }

    fn vertex(&mut self, rest: &[u8]) -> Result<(), Stop> {
        let (values, count) = numbers::<7>(rest, 3)?;
        let position = [values[0], values[1], values[2]];
        // x y z r g b, as many programs write; x y z w has no use for polygons.
        if count >= 6 && self.colors.is_none() {
            let mut colors = TableWriter::new(self.spool, 16);
            for _ in 0..self.positions.count() {
                colors.push(bytemuck::cast_slice(&[1.0f32; 4])).map_err(Stop::Spool)?;
            }
            self.colors = Some(colors);
        }
        if let Some(colors) = &mut self.colors {
            let color = if count >= 6 { [values[3], values[4], values[5]].map(plain::linear) } else { [1.0; 3] };
            let [r, g, b] = color;
            colors.push(bytemuck::cast_slice(&[r, g, b, 1.0])).map_err(Stop::Spool)?;
        }
        self.positions.push(bytemuck::cast_slice(&position)).map_err(Stop::Spool)
    }

    fn face(&mut self, rest: &[u8], number: u64, warnings: &mut Warnings) -> Result<(), Stop> {
        let counts = [self.positions.count(), self.uvs.count(), self.normals.count()];
        // The first corner, the one before, and how many there were.
        let (mut first, mut previous, mut corners) = ([NONE; 3], [NONE; 3], 0u64);
        for word in rest.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()) {
            let mut corner = [NONE; 3];
            for (i, text) in word.split(|&c| c == b'/').enumerate() {
                if i >= 3 || (i == 0 && text.is_empty()) {
                    return Err(Stop::Bad(format!("\"{}\" is no corner", one_line(&String::from_utf8_lossy(word)))));
                }
                if text.is_empty() {
                    continue;
                }
                corner[i] = index(text, counts[i]).map_err(Stop::Bad)?;
            }
            let ahead = u64::from(corner[0]) + 1;
            if ahead > counts[0] && ahead > self.ahead.index {
                self.ahead = Ahead { index: ahead, line: number };
            }
            match corners {
                0 => first = corner,
                1 => {}
                _ => self.triangle([first, previous, corner])?,
            }
            (previous, corners) = (corner, corners + 1);
        }
        if corners < 3 {
            warnings.add("faces with fewer than three vertices skipped", || format!("line {number}"));
        }
        Ok(())
    }

    fn triangle(&mut self, corners: [[u32; 3]; 3]) -> Result<(), Stop> {
        let object = self.objects.len() as u32 - 1;
        let material = match self.material {
            Some(material) => material,
            None => {
                // An unnamed material for faces before the first `usemtl`.
                let material = self.materials.len() as u32;
                self.materials.push(String::new());
                self.material = Some(material);
                material
            }
        };
        let has = |i: usize| corners.iter().all(|corner| corner[i] != NONE);
        let run = Run { first: self.triangles.count(), object, material, has_uvs: has(1), has_normals: has(2) };
        if self.runs.last().is_none_or(|last| Run { first: run.first, ..*last } != run) {
            self.runs.push(run);
        }
        self.triangles.push(bytemuck::cast_slice(corners.as_flattened())).map_err(Stop::Spool)
    }

    fn finish(self) -> Result<Parsed, ImportError> {
        let count = self.positions.count();
        if self.ahead.index > count {
            let what = format!("refers to vertex {}, but the file has {count}", self.ahead.index);
            return Err(fault(self.path, format!("line {}", self.ahead.line), what));
        }
        let Self { path, positions, colors, uvs, normals, triangles, runs, objects, materials, libraries, .. } = self;
        let parsed = || {
            Ok(Parsed {
                positions: positions.finish()?,
                colors: colors.map(TableWriter::finish).transpose()?,
                uvs: uvs.finish()?,
                normals: normals.finish()?,
                triangles: triangles.finish()?,
                runs,
                objects,
                materials,
                libraries,
            })
        };
        parsed().map_err(|what| no_room(path, what))
    }
}

/// At most `N` numbers, at least `least`, and how many there were.
fn numbers<const N: usize>(text: &[u8], least: usize) -> Result<([f64; N], usize), Stop> {
    let mut values = [0.0; N];
    let mut count = 0;
    for word in text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).take(N) {
        values[count] = number(word).map_err(Stop::Bad)?;
        count += 1;
    }
    if count < least {
        return Err(Stop::Bad(format!("has {count} numbers, but needs {least}")));
    }
    Ok((values, count))
}

/// An index of OBJ, from 1 or, negative, from the end of what was there so far, as one from 0.
fn index(text: &[u8], count: u64) -> Result<u32, String> {
    let value = std::str::from_utf8(text).ok().and_then(|text| text.parse::<i64>().ok());
    let zero_based = match value {
        Some(value) if value > 0 => Some(value as u64 - 1),
        Some(value) if value < 0 => count.checked_sub(value.unsigned_abs()),
        _ => None,
    };
    // `NONE` stands for no index.
    let index = zero_based.and_then(|index| u32::try_from(index).ok()).filter(|&index| index != NONE);
    index.ok_or_else(|| format!("\"{}\" is not an index of {count}", one_line(&String::from_utf8_lossy(text))))
}
