//! Occupancy of triangles that are at hand: what maps of bricks are measured against, and the paper's own form.

use super::Bom;
use super::region::Region;
use glam::DVec3;

/// How triangles become cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Voxelisation {
    /// Every cell that a triangle touches (Schwarz and Seidel 2010), by thirteen axes, rounded outward.
    Conservative,
    /// The paper's (§6): rasterised along all three axes, one sample in the middle of each column, one cell where the
    /// triangle passes there. The scene is moved by `jitter` first, in cells, -1/2 to 1/2, another each frame (§4.3).
    Raster {
        /// Cells.
        jitter: [f64; 3],
    },
}

/// Enters triangles, corners in world units, into a map.
pub fn voxelise(map: &mut Bom, triangles: impl IntoIterator<Item = [[f64; 3]; 3]>, how: Voxelisation) {
    let (side, first) = (map.side(), DVec3::from(map.first.map(|x| x as f64)));
    for triangle in triangles {
        let local = triangle.map(|p| DVec3::from(p) / side - first);
        match how {
            Voxelisation::Conservative => {
                // Dividing is exact, subtracting rounds to half a unit in the last place.
                let far = triangle.as_flattened().iter().fold(0.0f64, |far, x| far.max(x.abs())) / side;
                let tolerance = 8.0 * f64::EPSILON * (far + f64::from(map.cells()));
                touched(map, local, tolerance);
            }
            Voxelisation::Raster { jitter } => {
                let moved = local.map(|p| p + DVec3::from(jitter));
                (0..3).for_each(|axis| rasterised(map, moved, axis));
            }
        }
    }
}

/// The cells of the map between two corners, in cells from its first.
fn cells_between(map: &Bom, lo: DVec3, hi: DVec3) -> Option<Region> {
    let last = DVec3::splat(f64::from(map.cells()) - 1.0);
    let (lo, hi) = (lo.floor().max(DVec3::ZERO), hi.floor().min(last));
    let region = || Region { lo: lo.as_uvec3().to_array(), hi: (hi.as_uvec3() + 1).to_array() };
    lo.cmple(hi).all().then(region)
}

fn bounds([a, b, c]: [DVec3; 3]) -> [DVec3; 2] {
    [a.min(b).min(c), a.max(b).max(c)]
}

/// Marks every cell that a triangle touches, and those less than `tolerance` from it. A triangle and a box are apart
/// only if they are along one of thirteen axes (Akenine-Möller 2001).
pub(crate) fn touched(map: &mut Bom, triangle: [DVec3; 3], tolerance: f64) {
    let [lo, hi] = bounds(triangle);
    let Some(region) = cells_between(map, lo - tolerance, hi + tolerance) else { return };
    let [a, b, c] = triangle;
    let edges = [b - a, c - b, a - c];
    let normal = edges[0].cross(edges[1]);
    // An axis, what the triangle covers along it, widened by half of a cell and by what rounding makes of products.
    let span = |axis: DVec3| {
        let along = triangle.map(|p| axis.dot(p));
        let length = axis.abs().element_sum();
        let size = a.abs().max(b.abs()).max(c.abs()).max_element() + f64::from(map.cells());
        let wide = length * (0.5 + tolerance + 8.0 * f64::EPSILON * size);
        let fold = |with: fn(f64, f64) -> f64| with(with(along[0], along[1]), along[2]);
        (axis, fold(f64::min) - wide, fold(f64::max) + wide)
    };
    let mut axes = vec![span(normal)];
    axes.extend(edges.iter().flat_map(|&edge| DVec3::AXES.map(|axis| span(axis.cross(edge)))));
    for y in region.lo[1]..region.hi[1] {
        for x in region.lo[0]..region.hi[0] {
            for z in region.lo[2]..region.hi[2] {
                let middle = DVec3::from([x, y, z].map(|x| f64::from(x) + 0.5));
                if axes.iter().all(|&(axis, lo, hi)| (lo..=hi).contains(&axis.dot(middle))) {
                    map.occupy([x, y, z]);
                }
            }
        }
    }
}

/// Marks the cell where a triangle passes the middle of each column along `axis`.
fn rasterised(map: &mut Bom, triangle: [DVec3; 3], axis: usize) {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let [lo, hi] = bounds(triangle);
    let Some(region) = cells_between(map, lo, hi) else { return };
    let side = |from: DVec3, to: DVec3, at: [f64; 2]| {
        (to[u] - from[u]) * (at[1] - from[v]) - (to[v] - from[v]) * (at[0] - from[u])
    };
    let [a, b, c] = triangle;
    let area = side(a, b, [c[u], c[v]]);
    if area == 0.0 {
        return;
    }
    for j in region.lo[v]..region.hi[v] {
        for i in region.lo[u]..region.hi[u] {
            let at = [f64::from(i) + 0.5, f64::from(j) + 0.5];
            let weights = [side(b, c, at) / area, side(c, a, at) / area, side(a, b, at) / area];
            if weights.iter().any(|weight| *weight < 0.0) {
                continue;
            }
            let depth = (weights[0] * a[axis] + weights[1] * b[axis] + weights[2] * c[axis]).floor();
            if (0.0..f64::from(map.cells())).contains(&depth) {
                let mut cell = [0; 3];
                (cell[axis], cell[u], cell[v]) = (depth as u32, i, j);
                map.occupy(cell);
            }
        }
    }
}
