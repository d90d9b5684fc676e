//! Vertex clustering: vertices within a cell of a grid become one of them, triangles that lose a corner vanish.
//!
//! Rossignac and Borrel 1993, with the representative of least quadric error (Lindstrom 2000, "Out-of-core
//! simplification of large polygonal models"). Cells lie on the lattice of the object, so that neighbouring levels of
//! one cell size agree on which vertices come together. What would be lost stays as strands and specks.

use super::merge::{Merged, Source};
use super::strands::{self, Collapsed};
use super::vector::{Vec3, area_vector, cross, dot, length, square, sub};
use crate::build::triangles::attributes::is_degenerate;
use crate::build::triangles::intern::Interner;
use bricks::NONE;

/// Cells of a grid per axis at most, as a power of two: three numbers of cells fit a word.
const GRID_BITS: u32 = 20;

/// Grids tried at most.
const MOST_TRIALS: usize = 12;

/// Share of the triangles asked for that is enough.
const ENOUGH: f64 = 0.9;

/// By which power of the size of cells the number of triangles falls at first.
const SLOPE: f64 = -1.4;

/// A triangle of a level.
#[derive(Clone, Copy, Debug)]
pub(super) struct Output {
    /// The source triangle whose id it takes.
    pub source: u32,
    /// What it stands for: the sources of this group.
    pub group: u32,
    /// Cells that its corners belong to.
    pub cells: [u32; 3],
    /// Its corners, as positions.
    pub corners: [u32; 3],
}

/// Vertices by cells, and the triangles that are left.
#[derive(Debug)]
pub(super) struct Clusters {
    /// Side of a cell, steps.
    pub size: f64,
    /// The cell of each position of the sources.
    pub cell_of: Vec<u32>,
    /// The position that stands for each cell.
    pub kept: Vec<u32>,
    /// What is left, ascending by id.
    pub outputs: Vec<Output>,
    /// The group of each source triangle that outputs stand for, or [`NONE`].
    pub group_of: Vec<u32>,
    /// For each group how far the corners of its outputs are from positions of the sources: 0 but for strands and
    /// specks.
    pub spread: Vec<f64>,
}

/// Cells of one size.
pub(super) struct Grid {
    /// Side of a cell, steps.
    pub size: i64,
    /// The cell of each position.
    pub cell_of: Vec<u32>,
    /// Where each of them is, as three numbers.
    pub places: Vec<u64>,
}

impl Grid {
    fn of(positions: &[[i64; 3]], least: [i64; 3], size: i64) -> Self {
        let scale = size as f64;
        // Exact: coordinates have 46 bits at most, so a quotient below a whole number is not rounded to it.
        let cell = |x: i64| {
            let quotient = x as f64 / scale;
            let whole = quotient as i64;
            whole - i64::from(whole as f64 > quotient)
        };
        let first = least.map(cell);
        let mut numbers = Interner::with_capacity(positions.len() / 4);
        let number = |p: &[i64; 3]| {
            let [x, y, z]: [u64; 3] = std::array::from_fn(|k| (cell(p[k]) - first[k]) as u64);
            numbers.intern(x << (2 * (GRID_BITS + 1)) | y << (GRID_BITS + 1) | z).0
        };
        let cell_of = positions.iter().map(number).collect();
        Self { size, cell_of, places: numbers.values().to_vec() }
    }

    /// Whether two cells touch.
    pub fn are_neighbours(&self, cells: [u32; 2]) -> bool {
        let [a, b] = cells.map(|cell| self.places[cell as usize]);
        let number = |place: u64, k: u32| place >> (k * (GRID_BITS + 1)) & ((1 << (GRID_BITS + 1)) - 1);
        (0..3).all(|k| number(a, k).abs_diff(number(b, k)) <= 1)
    }

    /// Cells of the corners of a triangle.
    pub fn cells(&self, triangle: &Source) -> [u32; 3] {
        triangle.corners.map(|corner| self.cell_of[corner as usize])
    }
}

/// Triangles by the cells of their corners.
struct Groups {
    /// The group of each triangle, or [`NONE`] of one that collapses.
    of_triangle: Vec<u32>,
    /// Cells of each group, ascending. Groups are in the order of their first triangles.
    cells: Vec<[u32; 3]>,
}

impl Groups {
    fn of(triangles: &[Source], grid: &Grid) -> Self {
        let mut distinct = Interner::with_capacity(triangles.len() / 4);
        let group = |triangle| key(grid.cells(triangle)).map_or(NONE, |key| distinct.intern(key).0);
        let of_triangle = triangles.iter().map(group).collect();
        Self { of_triangle, cells: distinct.into_values() }
    }
}

/// What a grid makes of the triangles.
struct Trial {
    grid: Grid,
    groups: Groups,
    collapsed: Collapsed,
}

impl Trial {
    fn of(merged: &Merged, least: [i64; 3], size: i64) -> Self {
        let grid = Grid::of(&merged.positions, least, size);
        let groups = Groups::of(&merged.triangles, &grid);
        let collapsed = Collapsed::of(&merged.triangles, &grid, &groups.cells);
        Self { grid, groups, collapsed }
    }

    /// How many outputs there would be.
    fn count(&self) -> usize {
        self.groups.cells.len() + self.collapsed.outputs()
    }
}

/// The same for all triangles of these cells; `None` if two of them are one.
fn key(mut cells: [u32; 3]) -> Option<[u32; 3]> {
    cells.sort_unstable();
    (cells[0] < cells[1] && cells[1] < cells[2]).then_some(cells)
}

/// The finest grid found that leaves at most `target` triangles, and what it makes of them.
fn search(merged: &Merged, area: f64, target: usize) -> Trial {
    let [least, most] = merged.bounds();
    let extent = (0..3).map(|k| most[k] - least[k]).max().unwrap_or(0);
    let at = |size: i64| Trial::of(merged, least, size);
    // Too fine, and coarse enough: at most two cells an axis.
    let (mut fine, mut coarse) = ((extent >> GRID_BITS).max(1), extent + 1);
    if merged.triangles.len() <= target {
        return at(fine);
    }
    let mut best: Option<Trial> = None;
    let mut before: Option<(f64, f64)> = None;
    // As if all were one plane: a triangle has half the area of a cell.
    let mut size = (2.0 * area / target as f64).sqrt();
    for _ in 0..MOST_TRIALS {
        let whole = (size as i64).clamp(fine + 1, (coarse - 1).max(fine + 1));
        let trial = at(whole);
        let count = trial.count();
        let is_enough = count as f64 >= ENOUGH * target as f64;
        if count <= target {
            coarse = whole;
            best = Some(trial);
        } else {
            fine = whole;
        }
        let is_close = (coarse - fine) as f64 <= 0.03 * coarse as f64 || coarse - fine <= 1;
        if best.is_some() && (is_enough && count <= target || is_close) {
            break;
        }
        let (low, high) = (fine as f64, coarse as f64);
        let wanted = (0.5 * (1.0 + ENOUGH) * target as f64).ln();
        let at = ((whole as f64).ln(), (count.max(1) as f64).ln());
        // Counts fall with a power of the size: at first one between those of planes and of what is strewn.
        let slope = before.map_or(SLOPE, |before| (at.1 - before.1) / (at.0 - before.0));
        let slope = if slope.is_finite() { slope.clamp(4.0 * SLOPE, 0.25 * SLOPE) } else { SLOPE };
        size = (at.0 + (wanted - at.1) / slope).exp();
        before = Some(at);
        // Steps of that rule as long as they stay inside, else halving on a scale of ratios.
        if size <= low * 1.01 || size >= high * 0.99 {
            size = (low * high).sqrt();
        }
    }
    best.unwrap_or_else(|| at(extent + 1))
}

/// The sum of squared distances to planes, weighted by areas, relative to a point.
#[derive(Clone, Copy, Default)]
struct Quadric {
    /// xx, yy, zz, xy, xz, yz.
    second: [f64; 6],
    first: Vec3,
}

impl Quadric {
    /// Adds the plane of unit normal `n` at distance `d` from the point.
    fn add(&mut self, n: Vec3, d: f64, weight: f64) {
        let [x, y, z] = n;
        for (sum, term) in self.second.iter_mut().zip([x * x, y * y, z * z, x * y, x * z, y * z]) {
            *sum += weight * term;
        }
        for (sum, term) in self.first.iter_mut().zip(n) {
            *sum += weight * d * term;
        }
    }

    /// What it is at `p`, but for a constant.
    fn at(&self, p: Vec3) -> f64 {
        let [xx, yy, zz, xy, xz, yz] = self.second;
        let [x, y, z] = p;
        xx * x * x + yy * y * y + zz * z * z + 2.0 * (xy * x * y + xz * x * z + yz * y * z) - 2.0 * dot(self.first, p)
    }
}

/// Clusters `merged` so that at most `target` triangles are left, and at least one. `points` are its positions relative
/// to some point. Positions that outputs need beside those of the sources are added to both.
pub(super) fn cluster(merged: &mut Merged, points: &mut Vec<Vec3>, target: usize) -> Clusters {
    let triangle = |source: &Source| source.corners.map(|corner| points[corner as usize]);
    let vectors: Vec<Vec3> = merged.triangles.iter().map(|source| area_vector(triangle(source))).collect();
    let area = 0.5 * vectors.iter().map(|&vector| length(vector)).sum::<f64>();
    let Trial { grid, groups, collapsed } = search(merged, area, target);
    let borders = borders(merged);
    let kept = representatives(merged, points, (&vectors, &borders), &grid);
    let outputs = outputs(merged, &grid, &groups, &kept);
    let (group_of, spread) = (groups.of_triangle, vec![0.0; groups.cells.len()]);
    let mut clusters = Clusters { size: grid.size as f64, cell_of: Vec::new(), kept, outputs, group_of, spread };
    strands::add(merged, points, (&vectors, &borders), (&grid, &collapsed), &mut clusters);
    clusters.cell_of = grid.cell_of;
    clusters.outputs.retain(|output| !is_degenerate(&output.corners.map(|corner| merged.positions[corner as usize])));
    if clusters.outputs.is_empty() {
        clusters = each_alone(merged, clusters.size);
    }
    clusters.outputs.sort_unstable_by_key(|output| merged.triangles[output.source as usize].id);
    if clusters.outputs.len() > target {
        clusters.keep_largest(points, target);
    }
    clusters.forget_groups();
    clusters
}

/// A triangle and an edge that it alone has.
pub(super) type Border = (usize, [u32; 2]);

/// The edges that one triangle alone has, each with that triangle: where a level must go on to reach its neighbours.
fn borders(merged: &Merged) -> Vec<Border> {
    let mut distinct = Interner::with_capacity(2 * merged.triangles.len());
    let mut of_edge: Vec<(u32, u32, [u32; 2])> = Vec::with_capacity(2 * merged.triangles.len());
    for (number, source) in (0u32..).zip(&merged.triangles) {
        let [a, b, c] = source.corners;
        for edge in [[a, b], [b, c], [c, a]] {
            let [low, high] = [edge[0].min(edge[1]), edge[0].max(edge[1])];
            let (index, is_new) = distinct.intern(u64::from(low) << 32 | u64::from(high));
            if is_new {
                of_edge.push((1, number, edge));
            } else {
                of_edge[index as usize].0 += 1;
            }
        }
    }
    let alone = of_edge.into_iter().filter(|(count, ..)| *count == 1);
    alone.map(|(_, triangle, edge)| (triangle as usize, edge)).collect()
}

/// For each cell the vertex of least quadric error, of equal ones that of least position. A cell on a border keeps one
/// of the border, and planes upright on it count, too: otherwise levels draw back from each other, and rays see
/// through.
fn representatives(
    merged: &Merged,
    points: &[Vec3],
    (vectors, borders): (&[Vec3], &[Border]),
    grid: &Grid,
) -> Vec<u32> {
    // Relative to the first vertex of each cell, so that little is lost where cells are far from the origin.
    let mut first = vec![NONE; grid.places.len()];
    for (position, &cell) in (0u32..).zip(&grid.cell_of) {
        if first[cell as usize] == NONE {
            first[cell as usize] = position;
        }
    }
    let mut quadrics = vec![Quadric::default(); grid.places.len()];
    for (source, &vector) in merged.triangles.iter().zip(vectors) {
        let doubled = length(vector);
        if doubled == 0.0 {
            continue;
        }
        let n = vector.map(|x| x / doubled);
        let on = points[source.corners[0] as usize];
        for corner in source.corners {
            let cell = grid.cell_of[corner as usize] as usize;
            quadrics[cell].add(n, dot(n, sub(on, points[first[cell] as usize])), doubled);
        }
    }
    let mut is_border = vec![false; points.len()];
    let mut has_border = vec![false; grid.places.len()];
    for &(triangle, edge) in borders {
        let [a, b] = edge.map(|end| points[end as usize]);
        let along = sub(b, a);
        let upright = cross(along, vectors[triangle]);
        let size = length(upright);
        for end in edge {
            let cell = grid.cell_of[end as usize] as usize;
            (is_border[end as usize], has_border[cell]) = (true, true);
            if size > 0.0 {
                let n = upright.map(|x| x / size);
                quadrics[cell].add(n, dot(n, sub(a, points[first[cell] as usize])), square(along));
            }
        }
    }
    let mut best: Vec<(f64, u32)> = vec![(f64::INFINITY, NONE); grid.places.len()];
    for (position, (&cell, &point)) in (0u32..).zip(grid.cell_of.iter().zip(points)) {
        let cell = cell as usize;
        if has_border[cell] && !is_border[position as usize] {
            continue;
        }
        let error = quadrics[cell].at(sub(point, points[first[cell] as usize]));
        let (least, of) = best[cell];
        let is_less = |other: u32| merged.positions[position as usize] < merged.positions[other as usize];
        if of == NONE || error < least || error == least && is_less(of) {
            best[cell] = (error, position);
        }
    }
    best.into_iter().map(|(_, position)| position).collect()
}

/// The triangles that are left, one for each group: that of least id.
fn outputs(merged: &Merged, grid: &Grid, groups: &Groups, kept: &[u32]) -> Vec<Output> {
    let mut outputs: Vec<Output> = Vec::with_capacity(groups.cells.len());
    for ((source, triangle), &group) in (0u32..).zip(&merged.triangles).zip(&groups.of_triangle) {
        if group == NONE {
            continue;
        }
        let before = outputs.get(group as usize);
        if before.is_some_and(|before| merged.triangles[before.source as usize].id <= triangle.id) {
            continue;
        }
        let cells = grid.cells(triangle);
        let output = Output { source, group, cells, corners: cells.map(|cell| kept[cell as usize]) };
        match outputs.get_mut(group as usize) {
            Some(before) => *before = output,
            None => outputs.push(output),
        }
    }
    outputs
}

/// Every vertex in a cell of its own: all triangles that have an area.
fn each_alone(merged: &Merged, size: f64) -> Clusters {
    let all: Vec<u32> = (0..merged.positions.len() as u32).collect();
    let grid = Grid { size: 1, cell_of: all.clone(), places: vec![0; all.len()] };
    let groups = Groups::of(&merged.triangles, &grid);
    let mut outputs = outputs(merged, &grid, &groups, &all);
    outputs.retain(|output| !is_degenerate(&output.corners.map(|corner| merged.positions[corner as usize])));
    let (group_of, spread) = (groups.of_triangle, vec![0.0; groups.cells.len()]);
    Clusters { size, cell_of: all.clone(), kept: all, outputs, group_of, spread }
}

impl Clusters {
    /// Keeps the `target` triangles of largest area.
    fn keep_largest(&mut self, points: &[Vec3], target: usize) {
        let area = |output: &Output| square(area_vector(output.corners.map(|corner| points[corner as usize])));
        let areas: Vec<f64> = self.outputs.iter().map(area).collect();
        let mut order: Vec<u32> = (0..self.outputs.len() as u32).collect();
        order.sort_unstable_by(|&a, &b| areas[b as usize].total_cmp(&areas[a as usize]).then(a.cmp(&b)));
        order.truncate(target);
        order.sort_unstable();
        self.keep(&order);
    }

    /// Keeps these outputs, ascending.
    pub fn keep(&mut self, outputs: &[u32]) {
        self.outputs = outputs.iter().map(|&output| self.outputs[output as usize]).collect();
        self.forget_groups();
    }

    /// Takes sources out of groups that no output stands for.
    fn forget_groups(&mut self) {
        let mut is_used = vec![false; self.spread.len()];
        self.outputs.iter().for_each(|output| is_used[output.group as usize] = true);
        for group in self.group_of.iter_mut().filter(|group| **group != NONE) {
            if !is_used[*group as usize] {
                *group = NONE;
            }
        }
    }

    /// Whether a group is of strands or specks.
    pub fn is_thin(&self, group: u32) -> bool {
        self.spread[group as usize] > 0.0
    }
}

/// The outputs that touch each cell.
pub(super) struct Touching {
    starts: Vec<u32>,
    outputs: Vec<u32>,
}

impl Touching {
    /// Of all outputs.
    pub fn of(clusters: &Clusters) -> Self {
        let mut starts = vec![0u32; clusters.kept.len() + 1];
        for cell in clusters.outputs.iter().flat_map(|output| output.cells) {
            starts[cell as usize + 1] += 1;
        }
        for cell in 1..starts.len() {
            starts[cell] += starts[cell - 1];
        }
        let mut ends = starts.clone();
        let mut outputs = vec![0; clusters.outputs.len() * 3];
        for (number, output) in (0u32..).zip(&clusters.outputs) {
            for cell in output.cells {
                outputs[ends[cell as usize] as usize] = number;
                ends[cell as usize] += 1;
            }
        }
        Self { starts, outputs }
    }

    /// Those of a cell.
    pub fn outputs(&self, cell: u32) -> &[u32] {
        &self.outputs[self.starts[cell as usize] as usize..self.starts[cell as usize + 1] as usize]
    }
}
