//! PLY, ASCII and binary of both orders (G. Turk, "The PLY Polygon File Format", 1994): vertices with normals, colours
//! and texture coordinates, faces of any number of vertices, triangulated as fans.
//!
//! The body is run through once; what is used of it goes to the spool.

mod body;
mod header;

use super::bytes::{Spool, Stream};
use super::error::ImportError;
use super::opened::{Opened, Parts, TriangleBudget};
use super::plain::{self, doubles, fault, floats, no_room, unreadable};
use super::repairs::Repairs;
use super::table::{Table, TableWriter};
use super::vertices::Vertices;
use super::warnings::Warnings;
use crate::source::{Primitive, SourceError, SourceTexture};
use body::{Body, Failure};
use header::{Element, Header, Scalar};
use std::path::Path;

/// A PLY file, opened.
struct Ply {
    label: String,
    vertices: Columns,
    /// Three vertices a row, each in range.
    triangles: Table,
    repairs: Repairs,
}

/// What is kept of vertices.
struct Columns {
    positions: Table,
    normals: Option<Table>,
    uvs: Option<Table>,
    colors: Option<Table>,
}

/// Opens one .ply file.
pub(super) fn open(
    path: &Path,
    axes: &[f64; 12],
    spool: &Spool,
    budget: &mut TriangleBudget,
) -> Result<Opened, ImportError> {
    let mut start = plain::start(path, spool)?;
    let label = start.label.clone();
    let mut stream = start.bytes.stream(spool).map_err(|e| unreadable(path, &e))?;
    let Header { encoding, elements } = header::read(&mut stream).map_err(|what| fault(path, "header", what))?;
    let vertex_count = elements.iter().find(|e| e.name == "vertex").map_or(0, |e| e.count);

    let mut body = Body::new(stream, encoding);
    let (mut vertices, mut triangles) = (None, None);
    for element in &elements {
        let failed = |failure, row| match failure {
            Failure::Input(what) => fault(path, format!("{} {row}", element.name), what),
            Failure::Spool(what) => no_room(path, what),
        };
        match element.name.as_str() {
            "vertex" => vertices = Some(read_vertices(&mut body, element, spool).map_err(|(row, f)| failed(f, row))?),
            "face" => {
                let read = read_faces(&mut body, element, vertex_count, spool, &mut start.warnings, budget, &label);
                triangles = Some(read.map_err(|error| match error {
                    FaceError::Row(row, failure) => failed(failure, row),
                    FaceError::Import(error) => error,
                })?);
            }
            _ => (0..element.passes())
                .try_for_each(|row| body.row(element, &mut |_, _, _| Ok(())).map_err(|failure| failed(failure, row)))?,
        }
    }
    let hash = Stream::finish(body.into_inner()).map_err(|e| unreadable(path, &e))?;
    let vertices = vertices.ok_or_else(|| fault(path, "header", "the file has no vertices"))?;
    let triangles = triangles.filter(|table| table.count() > 0).ok_or_else(|| ImportError::Content {
        file: label.clone(),
        place: "header".into(),
        problem: "the file has points, but no faces".into(),
        remedy: "give a mesh: point clouds are not read",
    })?;
    let mesh = plain::one_primitive(plain::stem(path), triangles.count());
    let outline = plain::outline(path, start, &hash, axes, vec![mesh], vertices.colors.is_some());
    let repairs = Repairs::new(label.clone());
    Ok(Opened { outline, parts: Box::new(Ply { label, vertices, triangles, repairs }) })
}

/// Where a value of a vertex goes: the column and its component.
#[derive(Clone, Copy)]
enum Column {
    Position(usize),
    Normal(usize),
    Uv(usize),
    Color(usize),
}

/// The columns of vertices with the names of their properties.
const COLUMNS: [(Column, &[&str]); 12] = [
    (Column::Position(0), &["x"]),
    (Column::Position(1), &["y"]),
    (Column::Position(2), &["z"]),
    (Column::Normal(0), &["nx"]),
    (Column::Normal(1), &["ny"]),
    (Column::Normal(2), &["nz"]),
    (Column::Uv(0), &["s", "u", "texture_u"]),
    (Column::Uv(1), &["t", "v", "texture_v"]),
    (Column::Color(0), &["red", "diffuse_red", "r"]),
    (Column::Color(1), &["green", "diffuse_green", "g"]),
    (Column::Color(2), &["blue", "diffuse_blue", "b"]),
    (Column::Color(3), &["alpha", "diffuse_alpha", "a"]),
];

/// Reads the rows of vertices; the error comes with its row.
fn read_vertices(body: &mut Body, element: &Element, spool: &Spool) -> Result<Columns, (u64, Failure)> {
    let mut targets = vec![None; element.properties.len()];
    let mut found = [false; COLUMNS.len()];
    for (i, (column, names)) in COLUMNS.into_iter().enumerate() {
        if let Some(property) = element.find(names).filter(|&p| element.properties[p].list.is_none()) {
            targets[property] = Some(column);
            found[i] = true;
        }
    }
    if found[..3].contains(&false) {
        return Err((0, Failure::Input("the properties x, y, z are not all there".into())));
    }
    let column = |present: bool, row: usize| present.then(|| TableWriter::new(spool, row));
    let mut positions = TableWriter::new(spool, 24);
    let mut normals = column(found[3..6] == [true; 3], 12);
    let mut uvs = column(found[6..8] == [true; 2], 8);
    let mut colors = column(found[8..11] == [true; 3], 16);
    for row in 0..element.count {
        let (mut position, mut normal, mut uv) = ([0.0f64; 3], [0.0f32; 3], [0.0f32; 2]);
        let mut color = [1.0f32; 4];
        body.row(element, &mut |property, _, value| {
            match targets[property] {
                Some(Column::Position(c)) => position[c] = value,
                Some(Column::Normal(c)) => normal[c] = value as f32,
                Some(Column::Uv(c)) => uv[c] = value as f32,
                Some(Column::Color(3)) => {
                    let alpha = value / element.properties[property].scalar.one();
                    color[3] = if alpha.is_nan() { 1.0 } else { alpha.clamp(0.0, 1.0) as f32 };
                }
                Some(Column::Color(c)) => color[c] = plain::linear(value / element.properties[property].scalar.one()),
                None => {}
            }
            Ok(())
        })
        .map_err(|failure| (row, failure))?;
        // Rows of images and textures run downwards.
        uv[1] = 1.0 - uv[1];
        let mut push = || {
            positions.push(bytemuck::cast_slice(&position))?;
            normals.as_mut().map_or(Ok(()), |table| table.push(bytemuck::cast_slice(&normal)))?;
            uvs.as_mut().map_or(Ok(()), |table| table.push(bytemuck::cast_slice(&uv)))?;
            colors.as_mut().map_or(Ok(()), |table| table.push(bytemuck::cast_slice(&color)))
        };
        push().map_err(|what| (row, Failure::Spool(what)))?;
    }
    let finish = |table: Option<TableWriter>| table.map(TableWriter::finish).transpose();
    let columns = || {
        Ok(Columns {
            positions: positions.finish()?,
            normals: finish(normals)?,
            uvs: finish(uvs)?,
            colors: finish(colors)?,
        })
    };
    columns().map_err(|what| (element.count, Failure::Spool(what)))
}

/// Why faces could not be read.
enum FaceError {
    /// A row is bad.
    Row(u64, Failure),
    /// There are too many.
    Import(ImportError),
}

/// Reads the rows of faces as triangles of indices below `vertices`.
fn read_faces(
    body: &mut Body,
    element: &Element,
    vertices: u64,
    spool: &Spool,
    warnings: &mut Warnings,
    budget: &mut TriangleBudget,
    label: &str,
) -> Result<Table, FaceError> {
    let list = element.find(&["vertex_indices", "vertex_index"]);
    let list = list
        .filter(|&p| element.properties[p].list.is_some())
        .ok_or_else(|| FaceError::Row(0, Failure::Input("the property list vertex_indices is not there".into())))?;
    if matches!(element.properties[list].scalar, Scalar::F32 | Scalar::F64) {
        return Err(FaceError::Row(0, Failure::Input("vertex indices are not integers".into())));
    }
    let mut triangles = TableWriter::new(spool, 12);
    for row in 0..element.count {
        // The first vertex, the one before, and how many there were.
        let (mut first, mut previous, mut corners) = (0, 0, 0u64);
        let before = triangles.count();
        let read = body.row(element, &mut |property, _, value| {
            if property != list {
                return Ok(());
            }
            // Exact: integers of at most 32 bits.
            if value < 0.0 || value >= vertices as f64 {
                let what = format!("refers to vertex {value}, but there are {vertices}");
                return Err(Failure::Input(what));
            }
            let vertex = value as u32;
            match corners {
                0 => first = vertex,
                1 => {}
                _ => triangles.push(bytemuck::cast_slice(&[first, previous, vertex])).map_err(Failure::Spool)?,
            }
            (previous, corners) = (vertex, corners + 1);
            Ok(())
        });
        read.map_err(|failure| FaceError::Row(row, failure))?;
        if corners < 3 {
            warnings.add("faces with fewer than three vertices skipped", || format!("face {row}"));
        }
        budget.add(label, 1, triangles.count() - before).map_err(FaceError::Import)?;
    }
    let count = triangles.count();
    triangles.finish().map_err(|what| FaceError::Row(count, Failure::Spool(what)))
}

impl Ply {
    /// The vertices of a part.
    fn vertices_of(&self, part: usize) -> std::io::Result<Vertices> {
        let (first, end) = plain::range(part, self.triangles.count());
        let mut corners = Vec::with_capacity(3 * (end - first) as usize);
        self.triangles.run(first, end, |_, row| {
            let corner = |c: &[u8; 4]| u64::from(u32::from_le_bytes(*c));
            corners.extend(row.as_chunks::<4>().0.iter().map(corner));
            true
        })?;
        Ok(Vertices::of(corners))
    }
}

impl Parts for Ply {
    fn part(&self, mesh: usize, part: usize) -> Result<Primitive, SourceError> {
        let read = || {
            let Vertices { used, indices } = self.vertices_of(part)?;
            let vertices = &self.vertices;
            Ok::<_, std::io::Error>(Primitive {
                material: 0,
                positions: doubles::<3>(&vertices.positions, &used)?,
                normals: vertices.normals.as_ref().map(|table| floats::<3>(table, &used)).transpose()?,
                uvs: vertices.uvs.as_ref().map(|table| floats::<2>(table, &used)).transpose()?,
                colors: vertices.colors.as_ref().map(|table| floats::<4>(table, &used)).transpose()?,
                indices,
                ..Primitive::default()
            })
        };
        let mut primitive = read().map_err(|e| SourceError(format!("{}: cannot be read again: {e}", self.label)))?;
        plain::repair(&mut primitive, |what| self.repairs.add(what, (mesh, 0), || "vertices".into()));
        Ok(primitive)
    }

    fn label(&self) -> &str {
        &self.label
    }

    fn vertex(&self, _mesh: usize, part: usize, vertex: u32) -> Option<u64> {
        self.vertices_of(part).ok()?.used.get(vertex as usize).copied()
    }

    fn texture(&self, _index: usize) -> Result<SourceTexture, SourceError> {
        Err(SourceError(format!("{}: it has no textures", self.label)))
    }

    fn repairs(&self) -> Vec<String> {
        self.repairs.lines()
    }
}
