//! Makes one level of its children.

use super::cluster::{Touching, cluster};
use super::flat::Flattened;
use super::measure::measure;
use super::merge::{Child, merge};
use super::surface::Surface;
use crate::build::encode::brick::{self, BrickContext, EncodedBrick};
use crate::build::error::BuildError;
use bricks::Written;

/// Share of the triangles of its children that a level has.
const SHARE: usize = 4;

/// Triangles that a level may always have.
const LEAST_TARGET: usize = 64;

/// How far rounding to the world's lattice moves a point of an instance, steps: half a diagonal, and what is lost as it
/// is placed.
const PLACED_ROUNDING: f64 = 0.9;

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

/// Triangles at most of a level over so many.
pub(super) fn target(triangles: usize, brick_triangles: u32) -> usize {
    triangles.div_ceil(SHARE).max(LEAST_TARGET).min(brick_triangles as usize)
}

/// Makes the level over `children` with at most `brick_triangles` triangles.
pub(super) fn simplify(
    written: &Written,
    children: &[Child],
    (context, flattened): (&BrickContext, &Flattened),
    brick_triangles: u32,
) -> Result<Simplified, BuildError> {
    let mut merged = merge(written, children, &context.lattice)?;
    let [origin, _] = merged.bounds();
    let mut points = merged.relative(origin);
    let most = target(merged.triangles.len(), brick_triangles);
    let mut clusters = cluster(&mut merged, &mut points, most);
    let surface = Surface::collect(&merged, &points, &clusters, flattened);
    surface.drop_clear(&points, &mut clusters);
    let touching = Touching::of(&clusters);
    let (triangles, fitted) = surface.triangles(&merged, &points, (&clusters, &touching), flattened);
    let measured = measure(&merged, &points, (&clusters, &touching), &surface, &fitted);
    let count = triangles.len();
    let encoded = brick::encode(context, triangles.into_iter(), count);
    let rounding = if children.iter().any(|child| child.placed.is_some()) { PLACED_ROUNDING } else { 0.0 };
    Ok(Simplified { encoded, error: measured.error, bound: measured.bound + rounding, color: measured.color })
}
