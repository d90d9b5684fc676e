//! Collects the boxes of an object's triangles, and refuses or drops what has no place in a brick.

use super::error::BuildError;
use super::lattice::COORDINATE_LIMIT;
use super::objects::{ObjectPlan, Part};
use super::partition::{Bounds, Item};
use rayon::prelude::*;

/// Triangles of one task.
const TASK_TRIANGLES: u32 = 1 << 14;

/// The triangles of an object that may be stored.
#[derive(Debug, Default)]
pub(super) struct Gathered {
    /// Their boxes in object space; the index is the slot. In order of slots.
    pub items: Vec<Item>,
    /// Triangles with two equal vertices.
    pub zero_area: u32,
    /// Triangles with a vertex that is not finite.
    pub non_finite: u32,
}

/// Collects the triangles of `object`. The first bad vertex in order of slots is the error.
pub(super) fn gather(object: &ObjectPlan, drop_non_finite: bool) -> Result<Gathered, BuildError> {
    let tasks: Vec<(&Part, u32)> = object
        .parts
        .iter()
        .flat_map(|part| (0..part.triangles).step_by(TASK_TRIANGLES as usize).map(move |first| (part, first)))
        .collect();
    let results: Vec<Result<Gathered, BuildError>> =
        tasks.par_iter().map(|&(part, first)| gather_range(part, first, drop_non_finite)).collect();
    let mut all = Gathered { items: Vec::with_capacity(object.slots as usize), ..Gathered::default() };
    for result in results {
        let part = result?;
        all.items.extend(part.items);
        all.zero_area += part.zero_area;
        all.non_finite += part.non_finite;
    }
    Ok(all)
}

fn gather_range(part: &Part, first: u32, drop_non_finite: bool) -> Result<Gathered, BuildError> {
    let end = part.triangles.min(first + TASK_TRIANGLES);
    let mut out = Gathered { items: Vec::with_capacity((end - first) as usize), ..Gathered::default() };
    for triangle in first..end {
        let vertices = part.vertices(triangle);
        let corners = vertices.map(|vertex| part.position(vertex));
        // NaN fails the comparison too.
        let is_small = |p: &[f64; 3]| p.iter().all(|x| x.abs() <= COORDINATE_LIMIT);
        if let Some(corner) = corners.iter().position(|corner| !is_small(corner)) {
            let position = part.primitive.positions[vertices[corner] as usize];
            let finite_matrix = part.baking.is_none_or(|baking| baking.matrix.is_finite());
            let (mesh, primitive, vertex) = (part.mesh.name.clone(), part.primitive_index, vertices[corner]);
            if position.iter().all(|x| x.is_finite()) && finite_matrix {
                let (position, limit) = (corners[corner], COORDINATE_LIMIT);
                return Err(BuildError::OutOfRange { mesh, primitive, vertex, position, limit });
            }
            if !drop_non_finite {
                return Err(BuildError::NonFinite { mesh, primitive, vertex, position });
            }
            out.non_finite += 1;
            continue;
        }
        let [a, b, c] = corners;
        if a == b || b == c || c == a {
            out.zero_area += 1;
            continue;
        }
        let mut bounds = Bounds::EMPTY;
        corners.iter().for_each(|&corner| bounds.extend(corner, corner));
        out.items.push(Item { min: bounds.min, max: bounds.max, index: part.first_slot + triangle });
    }
    Ok(out)
}
