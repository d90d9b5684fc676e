//! Collects the boxes of triangles, and refuses or drops what has no place in a brick.

use super::partition::{Bounds, Item};
use crate::build::error::BuildError;
use crate::build::input::objects::{Piece, Placed};
use crate::build::input::parts::Reader;
use crate::build::triangles::lattice::COORDINATE_LIMIT;
use crate::progress::Progress;

/// What a run of triangles holds.
#[derive(Clone, Debug)]
pub(crate) struct Gathered {
    /// Bounds of those that may be stored.
    pub bounds: Bounds,
    /// Bounds of twice their centroids.
    pub centroids: Bounds,
    /// How many may be stored.
    pub stored: u64,
    /// Triangles with two equal vertices.
    pub zero_area: u32,
    /// Triangles with a vertex that is not finite.
    pub non_finite: u32,
    /// Which materials are used, a bit each.
    pub materials: Vec<u64>,
}

impl Gathered {
    /// Of nothing; `materials` of them exist.
    pub fn nothing(materials: usize) -> Self {
        Self {
            bounds: Bounds::EMPTY,
            centroids: Bounds::EMPTY,
            stored: 0,
            zero_area: 0,
            non_finite: 0,
            materials: vec![0; materials.div_ceil(64)],
        }
    }

    /// Of both.
    pub fn add(&mut self, other: &Self) {
        self.bounds = self.bounds.union(other.bounds);
        self.centroids = self.centroids.union(other.centroids);
        self.stored += other.stored;
        self.zero_area += other.zero_area;
        self.non_finite += other.non_finite;
        self.materials.iter_mut().zip(&other.materials).for_each(|(own, other)| *own |= other);
    }
}

/// Collects the boxes of a run of triangles, in order of slots; the index of an item is its slot. The first bad vertex
/// is the error.
pub(crate) fn gather(
    reader: &Reader,
    run: &[Piece],
    drop_non_finite: bool,
    progress: &Progress,
) -> Result<(Vec<Item>, Gathered), BuildError> {
    progress.check()?;
    let count = run.iter().map(|piece| piece.end - piece.first).sum::<u32>();
    let mut items = Vec::with_capacity(count as usize);
    let mut all = Gathered::nothing(reader.outline().materials.len());
    for piece in run {
        let primitive = reader.get(piece)?;
        let placed = Placed { part: piece.part, primitive: &primitive };
        all.materials[primitive.material as usize / 64] |= 1 << (primitive.material % 64);
        for triangle in piece.first..piece.end {
            let vertices = placed.vertices(triangle);
            let corners = vertices.map(|vertex| placed.position(vertex));
            // NaN fails the comparison too.
            let is_small = |p: &[f64; 3]| p.iter().all(|x| x.abs() <= COORDINATE_LIMIT);
            if let Some(corner) = corners.iter().position(|corner| !is_small(corner)) {
                refuse(reader, &placed, vertices[corner], corners[corner], drop_non_finite)?;
                all.non_finite += 1;
                continue;
            }
            let [a, b, c] = corners;
            if a == b || b == c || c == a {
                all.zero_area += 1;
                continue;
            }
            let mut bounds = Bounds::EMPTY;
            corners.iter().for_each(|&corner| bounds.extend(corner, corner));
            let item = Item { min: bounds.min, max: bounds.max, index: piece.part.first_slot + triangle };
            all.bounds.extend(item.min, item.max);
            let centroid = item.centroids2();
            all.centroids.extend(centroid, centroid);
            items.push(item);
        }
    }
    all.stored = items.len() as u64;
    progress.advance(u64::from(count));
    Ok((items, all))
}

/// The error of a vertex too far out, if it is one: what is not finite may be dropped.
fn refuse(
    reader: &Reader,
    placed: &Placed,
    vertex: u32,
    corner: [f64; 3],
    drop_non_finite: bool,
) -> Result<(), BuildError> {
    let position = placed.primitive.positions[vertex as usize];
    let finite_matrix = placed.part.baking.is_none_or(|baking| baking.matrix.is_finite());
    let outline = &reader.outline().meshes[placed.part.mesh as usize];
    let (mesh, primitive) = (outline.name.clone(), outline.parts[placed.part.part as usize].primitive);
    let is_finite = position.iter().all(|x| x.is_finite()) && finite_matrix;
    if drop_non_finite && !is_finite {
        return Ok(());
    }
    let (file, vertex) = reader.origin(placed.part, vertex);
    let defect = if is_finite {
        BuildError::OutOfRange { mesh, primitive, vertex, position: corner, limit: COORDINATE_LIMIT }
    } else {
        BuildError::NonFinite { mesh, primitive, vertex, position }
    };
    Err(match file {
        Some(file) => BuildError::InFile { file, defect: Box::new(defect) },
        None => defect,
    })
}
