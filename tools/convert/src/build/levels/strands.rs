//! Strands and specks: what collapses to edges and vertices, and would be lost.
//!
//! Pipes thinner than a cell become edges that belong to no triangle. They stay as strands: two narrow triangles along
//! the edge, upright on each other; between cells that touch one, whose taper is too small to be seen. What becomes a
//! vertex alone stays as a speck: one triangle. Both are as large as what they stand for looks on the mean: a closed
//! surface shows a quarter of its area, a sheet, seen from both sides, half of it (Cauchy). What is flat stays in its
//! plane.

use super::cluster::{Border, Clusters, Grid, Output};
use super::merge::{Merged, Source};
use super::vector::{Vec3, add_scaled, cross, length, sub};
use crate::build::triangles::intern::Interner;
use bricks::NONE;

/// Length of the mean normal from which on a piece is flat.
const FLAT: f64 = 0.95;

/// Distinct cells of a triangle.
enum Cells {
    Three,
    /// Ascending.
    Two([u32; 2]),
    One(u32),
}

impl Cells {
    fn of(mut cells: [u32; 3]) -> Self {
        cells.sort_unstable();
        let [a, b, c] = cells;
        match (a == b, b == c) {
            (false, false) => Self::Three,
            (true, true) => Self::One(a),
            _ => Self::Two([a, c]),
        }
    }
}

fn edge_key([low, high]: [u32; 2]) -> u64 {
    u64::from(low) << 32 | u64::from(high)
}

/// What collapses, on a grid.
pub(super) struct Collapsed {
    /// Edges that triangles become, as [`edge_key`].
    edges: Interner<u64>,
    /// The number of each among strands, or [`NONE`].
    strand_of: Vec<u32>,
    strands: u32,
    /// Strands between cells that do not touch.
    long: u32,
    /// The number of each cell among specks, or [`NONE`].
    speck_of: Vec<u32>,
    specks: u32,
}

impl Collapsed {
    /// Where triangles remain in all cells of `triples`.
    pub fn of(triangles: &[Source], grid: &Grid, triples: &[[u32; 3]]) -> Self {
        let mut edges = Interner::with_capacity(triangles.len() / 4);
        let mut has_point = vec![false; grid.places.len()];
        for triangle in triangles {
            match Cells::of(grid.cells(triangle)) {
                Cells::Three => {}
                Cells::Two(edge) => _ = edges.intern(edge_key(edge)),
                Cells::One(cell) => has_point[cell as usize] = true,
            }
        }
        let mut strand_of = vec![0; edges.values().len()];
        for &[a, b, c] in triples {
            for edge in [[a, b], [b, c], [a, c]] {
                has_point[edge[0] as usize] = false;
                has_point[edge[1] as usize] = false;
                if let Some(number) = edges.find(edge_key(edge)) {
                    strand_of[number as usize] = NONE;
                }
            }
        }
        let (mut strands, mut long) = (0, 0);
        for (strand, &key) in strand_of.iter_mut().zip(edges.values()).filter(|(strand, _)| **strand != NONE) {
            let cells = [(key >> 32) as u32, key as u32];
            cells.iter().for_each(|&cell| has_point[cell as usize] = false);
            long += u32::from(!grid.are_neighbours(cells));
            *strand = strands;
            strands += 1;
        }
        let mut specks = 0;
        let number = |has_point: bool| {
            specks += u32::from(has_point);
            if has_point { specks - 1 } else { NONE }
        };
        let speck_of = has_point.into_iter().map(number).collect();
        Self { edges, strand_of, strands, long, speck_of, specks }
    }

    /// Triangles of all strands and specks, at most.
    pub fn outputs(&self) -> usize {
        (self.strands + self.long + self.specks) as usize
    }

    /// The number of what a triangle becomes, strands first.
    fn piece(&self, cells: [u32; 3]) -> Option<u32> {
        let number = match Cells::of(cells) {
            Cells::Three => NONE,
            Cells::Two(edge) => self.edges.find(edge_key(edge)).map_or(NONE, |edge| self.strand_of[edge as usize]),
            Cells::One(cell) => match self.speck_of[cell as usize] {
                NONE => NONE,
                speck => self.strands + speck,
            },
        };
        (number != NONE).then_some(number)
    }
}

/// Sums over what a strand or speck stands for.
#[derive(Clone, Copy, Default)]
struct Piece {
    /// Its two cells, or twice the same.
    cells: [u32; 2],
    /// The two sources of least id; the second may be [`NONE`].
    sources: [u32; 2],
    doubled_area: f64,
    /// Twice the area vectors.
    vector: Vec3,
    triangles: u32,
    /// Edges that one triangle alone has.
    borders: u32,
}

impl Piece {
    /// Its area as a sheet over all of it.
    fn share(&self) -> f64 {
        if self.borders > self.triangles || self.normal().is_some() { 1.0 } else { 0.5 }
    }

    /// The unit normal, if it is flat.
    fn normal(&self) -> Option<Vec3> {
        let size = length(self.vector);
        (size > FLAT * self.doubled_area).then(|| self.vector.map(|x| x / size))
    }
}

/// Adds outputs for all that collapsed.
pub(super) fn add(
    merged: &mut Merged,
    points: &mut Vec<Vec3>,
    (vectors, borders): (&[Vec3], &[Border]),
    (grid, collapsed): (&Grid, &Collapsed),
    clusters: &mut Clusters,
) {
    let mut border_count = vec![0u32; merged.triangles.len()];
    borders.iter().for_each(|&(triangle, _)| border_count[triangle] += 1);
    let first = clusters.spread.len() as u32;
    let empty = Piece { sources: [NONE; 2], ..Piece::default() };
    let mut pieces = vec![empty; (collapsed.strands + collapsed.specks) as usize];
    for (number, triangle) in merged.triangles.iter().enumerate() {
        let cells = grid.cells(triangle);
        let Some(at) = collapsed.piece(cells) else { continue };
        clusters.group_of[number] = first + at;
        let piece = &mut pieces[at as usize];
        piece.cells = [cells[0].min(cells[1]).min(cells[2]), cells[0].max(cells[1]).max(cells[2])];
        piece.doubled_area += length(vectors[number]);
        piece.vector = add_scaled(piece.vector, 1.0, vectors[number]);
        piece.triangles += 1;
        piece.borders += border_count[number];
        let id = |source: u32| merged.triangles.get(source as usize).map_or(u64::MAX, |source| u64::from(source.id));
        let [least, second] = &mut piece.sources;
        if u64::from(triangle.id) < id(*least) {
            (*least, *second) = (number as u32, *least);
        } else if u64::from(triangle.id) < id(*second) {
            *second = number as u32;
        }
    }
    for (group, piece) in (first..).zip(&pieces) {
        let mut builder = Builder { merged, points, outputs: &mut clusters.outputs, group, piece };
        let kept = piece.cells.map(|cell| clusters.kept[cell as usize]);
        let spread = if kept[0] == kept[1] {
            builder.speck(kept[0], clusters.size)
        } else {
            builder.strand(kept, !grid.are_neighbours(piece.cells), clusters.size)
        };
        clusters.spread.push(spread);
    }
}

/// Makes the triangles of one piece.
struct Builder<'a> {
    merged: &'a mut Merged,
    points: &'a mut Vec<Vec3>,
    outputs: &'a mut Vec<Output>,
    group: u32,
    piece: &'a Piece,
}

impl Builder<'_> {
    /// A position beside one of the sources.
    fn beside(&mut self, position: u32, offset: [i64; 3]) -> u32 {
        let (from, point) = (self.merged.positions[position as usize], self.points[position as usize]);
        self.merged.positions.push(std::array::from_fn(|k| from[k] + offset[k]));
        self.points.push(std::array::from_fn(|k| point[k] + offset[k] as f64));
        self.points.len() as u32 - 1
    }

    fn push(&mut self, source: u32, cells: [u32; 3], corners: [u32; 3]) {
        self.outputs.push(Output { source, group: self.group, cells, corners });
    }

    /// Two triangles if it is long and has two sources, else one. Their edges hold both ends; returns how far corners
    /// are from these.
    fn strand(&mut self, [a, b]: [u32; 2], is_long: bool, cell: f64) -> f64 {
        let along = sub(self.points[b as usize], self.points[a as usize]);
        let size = length(along);
        let upright = self.piece.normal().map(|n| cross(along, n)).filter(|u| length(*u) > 0.1 * size);
        let [u, v] = upright.map_or_else(|| across(along), |u| [unit(u); 2]);
        let [first, second] = self.piece.sources;
        let is_pair = is_long && second != NONE;
        let triangles = if is_pair { 2.0 } else { 1.0 };
        // The area of each is half of its width times the length.
        let width = (self.piece.share() * self.piece.doubled_area / (triangles * size)).min(cell);
        let [u, v] = [u, v].map(|direction| direction.map(|x| (0.5 * width * x).round() as i64));
        let minus = |v: [i64; 3]| v.map(|x| -x);
        let [cell_a, cell_b] = self.piece.cells;
        let [a0, a1] = [self.beside(a, minus(u)), self.beside(a, u)];
        if !is_pair {
            self.push(first, [cell_a, cell_a, cell_b], [a0, a1, b]);
        } else {
            let [b0, b1] = [self.beside(b, minus(v)), self.beside(b, v)];
            self.push(first, [cell_a, cell_a, cell_b], [a0, a1, b0]);
            self.push(second, [cell_a, cell_b, cell_b], [a1, b1, b0]);
        }
        0.5 * width + 1.0
    }

    /// A triangle around a position.
    fn speck(&mut self, at: u32, cell: f64) -> f64 {
        let [cell_of, _] = self.piece.cells;
        // Of the area of a triangle of equal sides.
        let area = 0.5 * self.piece.share() * self.piece.doubled_area;
        let radius = (area * 4.0 / (3.0 * 3.0f64.sqrt())).sqrt().min(0.5 * cell);
        let [u, v] = across(self.piece.normal().unwrap_or([1.0; 3]));
        let corner = |(s, t): (f64, f64)| std::array::from_fn(|k| (radius * (s * u[k] + t * v[k])).round() as i64);
        let [a, b]: [[i64; 3]; 2] = [(1.0, 0.0), (-0.5, 0.75f64.sqrt())].map(corner);
        let corners = [a, b, std::array::from_fn(|k| -a[k] - b[k])].map(|offset| self.beside(at, offset));
        self.push(self.piece.sources[0], [cell_of; 3], corners);
        radius + 2.0
    }
}

/// Two unit vectors upright on `along` and on each other.
fn across(along: Vec3) -> [Vec3; 2] {
    let axis = (0..3).fold(0, |best, k| if along[k].abs() < along[best].abs() { k } else { best });
    let mut least = [0.0; 3];
    least[axis] = 1.0;
    let u = unit(cross(along, least));
    [u, unit(cross(along, u))]
}

fn unit(v: Vec3) -> Vec3 {
    let size = length(v);
    v.map(|x| x / size)
}
