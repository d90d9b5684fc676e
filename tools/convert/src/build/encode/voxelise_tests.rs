//! Voxelisation against the separating-axis test in its textbook form on every cell, and against points of triangles.

use super::voxelise::voxelise;
use bricks::{OCCUPANCY_CELLS, OccupancyGrid, OccupancyMap};

type Corners = [[i64; 3]; 3];

/// SplitMix64 (Steele, Lea, Flood 2014).
struct Rng(u64);

impl Rng {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, bound: i64) -> i64 {
        (self.next() % bound as u64) as i64
    }

    /// In 0..1.
    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn point(&mut self, size: i64) -> [i64; 3] {
        [self.below(size), self.below(size), self.below(size)]
    }
}

/// Another seed each run, printed so that a failure can be repeated.
fn rng() -> Rng {
    let seed = std::time::UNIX_EPOCH.elapsed().map_or(0, |time| time.as_nanos() as u64);
    println!("seed {seed}");
    Rng(seed)
}

/// log2 of the lattice step.
const STEP_LOG2: i32 = -13;

fn has_area([p, q, r]: &Corners) -> bool {
    let e: [i128; 3] = std::array::from_fn(|k| (q[k] - p[k]).into());
    let f: [i128; 3] = std::array::from_fn(|k| (r[k] - p[k]).into());
    (0..3).any(|k| e[k] * f[(k + 1) % 3] != e[(k + 1) % 3] * f[k])
}

fn map(grid: &OccupancyGrid, triangles: &[Corners]) -> OccupancyMap {
    voxelise(STEP_LOG2, grid, triangles.iter().copied())
}

/// The separating-axis test of one triangle, by the projections of all corners to each of thirteen axes.
struct Axes {
    corners: [[i128; 3]; 3],
    /// Axes other than the box's own, with the least and greatest product of the triangle.
    others: Vec<([i128; 3], i128, i128)>,
    side: i128,
}

impl Axes {
    /// In units of the grid from its origin: lattice steps, or cells if these are smaller.
    fn new(grid: &OccupancyGrid, corners: &Corners) -> Self {
        let steps_log2 = grid.steps_log2(STEP_LOG2);
        let side = 1i128 << steps_log2.max(0);
        let units = 1i128 << (-steps_log2).max(0);
        let corners: [[i128; 3]; 3] = corners
            .map(|corner| std::array::from_fn(|k| i128::from(corner[k]) * units - i128::from(grid.origin[k]) * side));
        let edges: [[i128; 3]; 3] =
            std::array::from_fn(|i| std::array::from_fn(|k| corners[(i + 1) % 3][k] - corners[i][k]));
        let cross = |e: [i128; 3], f: [i128; 3]| -> [i128; 3] {
            std::array::from_fn(|k| e[(k + 1) % 3] * f[(k + 2) % 3] - e[(k + 2) % 3] * f[(k + 1) % 3])
        };
        let units = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
        let axes = edges.iter().flat_map(|&edge| units.map(|unit| cross(edge, unit)));
        let others = axes.chain([cross(edges[0], edges[1])]).map(|axis| {
            let own = corners.map(|p| dot(axis, p));
            (axis, own.into_iter().min().unwrap(), own.into_iter().max().unwrap())
        });
        Self { corners, others: others.collect(), side }
    }

    /// Whether the triangle touches the closed box of a cell.
    fn touches(&self, cell: [u32; 3]) -> bool {
        let start = cell.map(|x| i128::from(x) * self.side);
        let within = |k: usize| {
            let of = self.corners.map(|corner| corner[k]);
            of.iter().any(|x| *x >= start[k]) && of.iter().any(|x| *x <= start[k] + self.side)
        };
        let meets = |&(axis, least, most): &([i128; 3], i128, i128)| {
            let corner = |i: usize| std::array::from_fn(|k| start[k] + if i >> k & 1 != 0 { self.side } else { 0 });
            let boxed: [i128; 8] = std::array::from_fn(|i| dot(axis, corner(i)));
            boxed.iter().any(|x| *x >= least) && boxed.iter().any(|x| *x <= most)
        };
        (0..3).all(within) && self.others.iter().all(meets)
    }
}

fn dot(a: [i128; 3], b: [i128; 3]) -> i128 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

fn cells() -> impl Iterator<Item = [u32; 3]> {
    let n = OCCUPANCY_CELLS;
    (0..n).flat_map(move |x| (0..n).flat_map(move |y| (0..n).map(move |z| [x, y, z])))
}

/// The cells where a map and the test on every cell differ: (missed, set in vain).
fn differences(triangle: &Corners, grid: &OccupancyGrid, found: &OccupancyMap) -> (u32, u32) {
    let axes = Axes::new(grid, triangle);
    let (mut missed, mut vain) = (0, 0);
    for cell in cells() {
        let touched = axes.touches(cell);
        let set = found.is_occupied(0, cell);
        missed += u32::from(touched && !set);
        vain += u32::from(set && !touched);
    }
    (missed, vain)
}

fn check(triangle: Corners, grid: &OccupancyGrid) {
    if has_area(&triangle) {
        let found = map(grid, &[triangle]);
        assert_eq!(differences(&triangle, grid, &found), (0, 0), "{triangle:?} on {grid:?}");
    }
}

/// A grid of cells of 2^`steps_log2` steps that starts at `start`, multiples of the side, and holds 63 cells.
fn grid(steps_log2: i32, start: [i64; 3]) -> OccupancyGrid {
    let extent = if steps_log2 < 0 { (63 >> -steps_log2).max(1) } else { 63 << steps_log2 };
    let grid = OccupancyGrid::of(STEP_LOG2, start, start.map(|x| x + extent));
    assert_eq!(grid.steps_log2(STEP_LOG2), steps_log2);
    grid
}

#[test]
fn cells_are_exactly_those_touched() {
    let mut rng = rng();
    for round in 0..600 {
        let side_log2 = rng.below(18) as i32;
        let start = rng.point(1 << 40).map(|x| (x >> side_log2) << side_log2);
        let grid = grid(side_log2, start);
        let size = 63i64 << side_log2;
        let side = 1i64 << side_log2;
        let p = rng.point(size + 1);
        let near = |rng: &mut Rng, p: [i64; 3], reach: i64| -> [i64; 3] {
            std::array::from_fn(|k| (p[k] + rng.below(2 * reach + 1) - reach).clamp(0, size))
        };
        let other = rng.point(size + 1);
        let triangle = match round % 6 {
            // Of any size; of a few cells; of less than a cell.
            0 => [p, other, rng.point(size + 1)],
            1 => [p, near(&mut rng, p, 3 * side), near(&mut rng, p, 3 * side)],
            2 => [p, near(&mut rng, p, side), near(&mut rng, p, side)],
            // Slivers: two corners near each other; all three near a line.
            3 => [p, near(&mut rng, p, 1), other],
            4 => {
                let middle = std::array::from_fn(|k| (p[k] + other[k]) / 2);
                [p, other, near(&mut rng, middle, 1)]
            }
            // On borders of cells.
            _ => [p, other, rng.point(size + 1)].map(|p| p.map(|x| (x >> side_log2) << side_log2)),
        };
        check(triangle.map(|p| std::array::from_fn(|k| p[k] + start[k])), &grid);
    }
}

#[test]
fn planes_on_borders_and_a_step_beside_touch_the_cells_of_both_sides() {
    let mut rng = rng();
    let side_log2 = 5;
    let grid = grid(side_log2, [-(9 << 5), 3 << 5, 0]);
    for axis in 0..3 {
        for at in [0, 1, 2, 31, 32, 62, 63] {
            for off in [-1, 0, 1] {
                let x = (at << side_log2) + off;
                if !(0..=63 << side_log2).contains(&x) {
                    continue;
                }
                let triangle: Corners = std::array::from_fn(|_| {
                    let mut p = rng.point((63 << side_log2) + 1);
                    p[axis] = x;
                    std::array::from_fn(|k| p[k] + (grid.origin[k] << side_log2))
                });
                check(triangle, &grid);
                // Turned by a step about one corner.
                let mut turned = triangle;
                turned[2][axis] += if at == 63 { -1 } else { 1 };
                check(turned, &grid);
            }
        }
    }
}

#[test]
fn triangles_along_axes_are_exact() {
    let side = 1 << 4;
    let grid = grid(4, [0; 3]);
    // Legs along two axes, of lengths that end on borders and beside them.
    for (k, l) in [(0, 1), (1, 2), (2, 0)] {
        for (a, b) in [(side, side), (5 * side, 63 * side), (7 * side + 1, 9 * side - 1), (1, 63 * side)] {
            for corner in [[0; 3], [side, 2 * side, 0], [3, 5, 7]] {
                let corner: [i64; 3] = corner;
                let room = |k: usize| 63 * side - corner[k];
                let (mut p, mut q) = (corner, corner);
                p[k] += a.min(room(k));
                q[l] += b.min(room(l));
                check([corner, p, q], &grid);
                check([q, corner, p], &grid);
                check([q, p, corner], &grid);
            }
        }
    }
}

#[test]
fn tiny_and_wide_bricks_are_exact() {
    let mut rng = rng();
    // Cells of a 32nd of a step to half of one; of 2^21 to 2^33 steps, where numbers exceed 64 bits.
    for steps_log2 in [-5, -4, -2, -1, 20, 21, 27, 33] {
        let extent = if steps_log2 < 0 { (63 >> -steps_log2).max(1) } else { 63 << steps_log2 };
        let side = 1i64 << steps_log2.max(0);
        let start = [-(1 << 43), 5, -1].map(|x: i64| x / side * side);
        let grid = grid(steps_log2, start);
        for _ in 0..6 {
            let triangle: Corners = std::array::from_fn(|_| rng.point(extent + 1));
            check(triangle.map(|p| std::array::from_fn(|k| p[k] + start[k])), &grid);
        }
        let edge = [[0, 0, 0], [extent, extent, extent], [extent, extent - 1, extent]];
        check(edge.map(|p: [i64; 3]| std::array::from_fn(|k| p[k] + start[k])), &grid);
    }
}

/// Maps of other rules differ from the test on every cell: of half-open boxes, with holes, with a cell too many.
#[test]
fn other_rules_are_seen() {
    let grid = grid(3, [0; 3]);
    // On the border between cells 3 and 4.
    let triangle = [[32, 8, 8], [32, 400, 16], [32, 8, 300]];
    let whole = map(&grid, &[triangle]);
    let mut half_open = whole.finest();
    (0..4096).filter(|column| column % 64 == 3).for_each(|column| half_open[column] = 0);
    let (missed, vain) = differences(&triangle, &grid, &OccupancyMap::of_finest(&half_open));
    assert!(missed > 100 && vain == 0, "{missed} {vain}");

    // Every second of the cells.
    let slanted = [[16, 8, 8], [300, 400, 16], [100, 8, 300]];
    let mut thin = [0; 4096];
    let found = map(&grid, &[slanted]);
    for cell in cells().filter(|&cell| found.is_occupied(0, cell)).step_by(2) {
        thin[(cell[0] + 64 * cell[1]) as usize] |= 1 << cell[2];
    }
    assert!(differences(&slanted, &grid, &OccupancyMap::of_finest(&thin)).0 > 100);
    let mut more = found.finest();
    more[4095] |= 1;
    assert_eq!(differences(&slanted, &grid, &OccupancyMap::of_finest(&more)), (0, 1));
}

/// Points of triangles lie in occupied cells. A point in f64 is off by less than 2^-50 of the coordinates' 2^26 or so,
/// so one within 2^-20 of a border is left out.
#[test]
fn points_of_triangles_lie_in_occupied_cells() {
    let mut rng = rng();
    let (mut tested, mut half_open_misses) = (0, 0);
    for round in 0..400 {
        let side_log2 = [4, 9, 16][round % 3];
        let size = 63i64 << side_log2;
        let grid = grid(side_log2, [0; 3]);
        let mut triangle: Corners = std::array::from_fn(|_| rng.point(size + 1));
        if round % 2 == 0 {
            // In a plane between cells.
            let (axis, at) = (round / 2 % 3, (rng.below(62) + 1) << side_log2);
            triangle.iter_mut().for_each(|p| p[axis] = at);
        }
        if !has_area(&triangle) {
            continue;
        }
        let found = map(&grid, &[triangle]);
        for _ in 0..200 {
            let (s, t) = (rng.unit().sqrt(), rng.unit());
            let weights = [1.0 - s, s * (1.0 - t), s * t];
            let point: [f64; 3] = std::array::from_fn(|k| (0..3).map(|i| weights[i] * triangle[i][k] as f64).sum());
            let side = f64::from(1u32 << side_log2);
            let both = |x: f64, off: f64| ((x + off) / side).floor().clamp(0.0, 63.0) as u32;
            let sides = [-(2f64.powi(-20)), 2f64.powi(-20)];
            for corner in 0..8 {
                let cell = std::array::from_fn(|k| both(point[k], sides[corner >> k & 1]));
                // Where the signs matter the point is on a border as far as f64 tells: the cell need not be touched
                // unless the plane itself is the border.
                let matters = (0..3).any(|k| both(point[k], sides[0]) != both(point[k], sides[1]));
                let in_plane = (0..3).all(|k| {
                    both(point[k], sides[0]) == both(point[k], sides[1])
                        || triangle.iter().all(|p| p[k] == triangle[0][k])
                });
                if !matters || in_plane {
                    tested += 1;
                    assert!(found.is_occupied(0, cell), "{triangle:?} at {point:?}");
                    // The control: a map of half-open cells has nothing below a plane between two.
                    half_open_misses += u32::from(matters && corner == 0);
                }
            }
        }
    }
    assert!(tested > 100_000 && half_open_misses > 1000, "{tested} {half_open_misses}");
}

/// A plane across the whole grid as two triangles, through the middle, whose normal is longest along `axis`.
fn sheet(rng: &mut Rng, axis: usize, size: i64) -> [Corners; 2] {
    // Heights at three corners of the square across `axis`, such that the fourth is within the grid too.
    let heights: [i64; 3] = loop {
        let heights = [rng.below(size + 1), rng.below(size + 1), rng.below(size + 1)];
        if (0..=size).contains(&(heights[1] + heights[2] - heights[0])) {
            break heights;
        }
    };
    let point = |u: i64, v: i64, height: i64| {
        let mut p = [height; 3];
        (p[(axis + 1) % 3], p[(axis + 2) % 3]) = (u, v);
        p
    };
    let corners = [
        point(0, 0, heights[0]),
        point(size, 0, heights[1]),
        point(0, size, heights[2]),
        point(size, size, heights[1] + heights[2] - heights[0]),
    ];
    [[corners[0], corners[1], corners[2]], [corners[1], corners[3], corners[2]]]
}

/// Whether a walk through empty cells, from face to face, leads from the first layer along an axis to the 63rd.
fn leaks(occupied: &dyn Fn([u32; 3]) -> bool, axis: usize) -> bool {
    let n = 63;
    let index = |[x, y, z]: [u32; 3]| (x + n * (y + n * z)) as usize;
    let mut met = vec![false; (n * n * n) as usize];
    let mut stack: Vec<[u32; 3]> = Vec::new();
    for u in 0..n {
        for v in 0..n {
            let mut cell = [0; 3];
            (cell[(axis + 1) % 3], cell[(axis + 2) % 3]) = (u, v);
            stack.push(cell);
        }
    }
    while let Some(cell) = stack.pop() {
        if met[index(cell)] || occupied(cell) {
            continue;
        }
        met[index(cell)] = true;
        if cell[axis] == n - 1 {
            return true;
        }
        for k in 0..3 {
            for next in [cell[k].wrapping_sub(1), cell[k] + 1] {
                if next < n {
                    let mut cell = cell;
                    cell[k] = next;
                    stack.push(cell);
                }
            }
        }
    }
    false
}

#[test]
fn sheets_have_no_holes() {
    let mut rng = rng();
    let side_log2 = 6;
    let grid = grid(side_log2, [0; 3]);
    let mut centre_leaks = 0;
    for round in 0..24 {
        let axis = round % 3;
        // Away from the first and last layers, so that both ends are empty.
        let size = 63i64 << side_log2;
        let inner = |p: [i64; 3]| {
            let mut p = p;
            p[axis] = (p[axis] * 61 / 63).clamp(0, 61 << side_log2) + (1 << side_log2);
            p
        };
        let triangles = sheet(&mut rng, axis, size).map(|triangle| triangle.map(inner));
        let found = map(&grid, &triangles);
        assert!(!leaks(&|cell| found.is_occupied(0, cell), axis), "{triangles:?}");
        // A column along the axis is never open.
        let n = 63u32;
        for (u, v) in (0..n).flat_map(|u| (0..n).map(move |v| (u, v))) {
            let met = (0..n).any(|at| {
                let mut cell = [at; 3];
                (cell[(axis + 1) % 3], cell[(axis + 2) % 3]) = (u, v);
                found.is_occupied(0, cell)
            });
            assert!(met, "column {u}, {v} along {axis}: {triangles:?}");
        }
        // The control: cells whose centre is within a quarter of a cell of the plane leak somewhere.
        let [p, q, r] = triangles[0].map(|p| p.map(|x| x as f64 / f64::from(1 << side_log2)));
        let e: [f64; 3] = std::array::from_fn(|k| q[k] - p[k]);
        let f: [f64; 3] = std::array::from_fn(|k| r[k] - p[k]);
        let normal: [f64; 3] =
            std::array::from_fn(|k| e[(k + 1) % 3] * f[(k + 2) % 3] - e[(k + 2) % 3] * f[(k + 1) % 3]);
        let length = normal.iter().map(|x| x * x).sum::<f64>().sqrt();
        let near = |cell: [u32; 3]| {
            let distance = (0..3).map(|k| normal[k] * (f64::from(cell[k]) + 0.5 - p[k])).sum::<f64>() / length;
            distance.abs() < 0.25
        };
        centre_leaks += u32::from(leaks(&near, axis));
    }
    assert!(centre_leaks > 12, "{centre_leaks}");
}
