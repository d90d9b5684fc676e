//! Makes one level of its children.

use super::cluster::cluster;
use super::flat::Flattened;
use super::measure::measure;
use super::merge::merge;
use super::surface::Surface;
use crate::build::encode::brick::{self, BrickContext, EncodedBrick};
use crate::build::error::BuildError;
use bricks::{Brick, Written};

/// Share of the triangles of its children that a level has.
const SHARE: usize = 4;

/// Triangles that a level may always have.
const LEAST_TARGET: usize = 64;

/// A level that is not written yet. Lengths are in steps of the object's lattice.
pub(super) struct Simplified {
    /// The brick.
    pub encoded: EncodedBrick,
    /// The error that selection goes by, of the step from the children.
    pub error: f64,
    /// The bound of the distance from the children.
    pub bound: f64,
    /// The largest difference of colours from the children.
    pub color: f64,
}

/// Makes the level over `children` with at most `brick_triangles` triangles.
pub(super) fn simplify(
    written: &Written,
    children: &[&Brick],
    (context, flattened): (&BrickContext, &Flattened),
    brick_triangles: u32,
) -> Result<Simplified, BuildError> {
    let merged = merge(written, children, &context.lattice)?;
    let [origin, _] = merged.bounds();
    let points = merged.relative(origin);
    let target = merged.triangles.len().div_ceil(SHARE).max(LEAST_TARGET).min(brick_triangles as usize);
    let clusters = cluster(&merged, &points, target);
    let surface = Surface::collect(&merged, &points, &clusters, flattened);
    let (triangles, shown) = surface.triangles(&merged, &clusters, flattened);
    let measured = measure(&merged, &points, &clusters, &surface, &shown);
    let count = triangles.len();
    let encoded = brick::encode(context, triangles.into_iter(), count);
    Ok(Simplified { encoded, error: measured.error, bound: measured.bound, color: measured.color })
}
