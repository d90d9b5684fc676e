//! Occupancy of triangles that are at hand: what maps of bricks are measured against, and the paper's own form.

use super::Bom;
use super::region::Region;
use std::array::from_fn;

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
    let side = map.side();
    for triangle in triangles {
        let local = triangle.map(|p| from_fn(|k| p[k] / side - map.first[k] as f64));
        match how {
            Voxelisation::Conservative => {
                // Dividing is exact, subtracting rounds to half a unit in the last place.
                let far = triangle.as_flattened().iter().fold(0.0f64, |far, x| far.max(x.abs())) / side;
                let tolerance = 8.0 * f64::EPSILON * (far + f64::from(map.cells()));
                touched(map, &local, tolerance);
            }
            Voxelisation::Raster { jitter } => {
                let moved = local.map(|p: [f64; 3]| from_fn(|k| p[k] + jitter[k]));
                (0..3).for_each(|axis| rasterised(map, &moved, axis));
            }
        }
    }
}

/// The cells of the map between two corners, in cells from its first.
fn cells_between(map: &Bom, lo: [f64; 3], hi: [f64; 3]) -> Option<Region> {
    let last = f64::from(map.cells()) - 1.0;
    let (lo, hi) = (lo.map(|x| x.floor().max(0.0)), hi.map(|x| x.floor().min(last)));
    let region = || Region { lo: lo.map(|x| x as u32), hi: hi.map(|x| x as u32 + 1) };
    (0..3).all(|k| lo[k] <= hi[k]).then(region)
}

fn bounds(triangle: &[[f64; 3]; 3]) -> [[f64; 3]; 2] {
    let fold = |with: fn(f64, f64) -> f64| from_fn(|k| triangle.iter().map(|p| p[k]).reduce(with).unwrap_or(0.0));
    [fold(f64::min), fold(f64::max)]
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    from_fn(|k| a[k] - b[k])
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Marks every cell that a triangle touches, and those less than `tolerance` from it. A triangle and a box are apart
/// only if they are along one of thirteen axes (Akenine-Möller 2001).
pub(crate) fn touched(map: &mut Bom, triangle: &[[f64; 3]; 3], tolerance: f64) {
    let [lo, hi] = bounds(triangle);
    let Some(region) = cells_between(map, lo.map(|x| x - tolerance), hi.map(|x| x + tolerance)) else { return };
    let [a, b, c] = *triangle;
    let edges = [sub(b, a), sub(c, b), sub(a, c)];
    let normal = cross(edges[0], edges[1]);
    // An axis, what the triangle covers along it, widened by half of a cell and by what rounding makes of products.
    let span = |axis: [f64; 3]| {
        let along = triangle.map(|p| dot(axis, p));
        let length = axis.iter().map(|x| x.abs()).sum::<f64>();
        let size = triangle.as_flattened().iter().fold(0.0f64, |size, x| size.max(x.abs())) + f64::from(map.cells());
        let wide = length * (0.5 + tolerance + 8.0 * f64::EPSILON * size);
        let fold = |with: fn(f64, f64) -> f64| with(with(along[0], along[1]), along[2]);
        (axis, fold(f64::min) - wide, fold(f64::max) + wide)
    };
    let unit = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut axes = vec![span(normal)];
    axes.extend(edges.iter().flat_map(|&edge| unit.map(|axis| span(cross(axis, edge)))));
    for y in region.lo[1]..region.hi[1] {
        for x in region.lo[0]..region.hi[0] {
            for z in region.lo[2]..region.hi[2] {
                let middle = [x, y, z].map(|x| f64::from(x) + 0.5);
                if axes.iter().all(|&(axis, lo, hi)| (lo..=hi).contains(&dot(axis, middle))) {
                    map.occupy([x, y, z]);
                }
            }
        }
    }
}

/// Marks the cell where a triangle passes the middle of each column along `axis`.
fn rasterised(map: &mut Bom, triangle: &[[f64; 3]; 3], axis: usize) {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let [lo, hi] = bounds(triangle);
    let Some(region) = cells_between(map, lo, hi) else { return };
    let side = |from: [f64; 3], to: [f64; 3], at: [f64; 2]| {
        (to[u] - from[u]) * (at[1] - from[v]) - (to[v] - from[v]) * (at[0] - from[u])
    };
    let [a, b, c] = *triangle;
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
