//! Finding ways for pipes through a block that fills up: walks over a grid that turn at random and never meet.

use crate::rng::Rng;
use glam::DVec3;

/// Edge of a cell of the grid, metres.
pub const CELL: f64 = 0.4;
/// Cells from floor to floor.
pub const FLOOR: i32 = 15;

/// A cell.
pub type Cell = [i32; 3];

/// Which cells of a block are taken.
pub struct Grid {
    origin: DVec3,
    size: Cell,
    taken: Vec<bool>,
}

impl Grid {
    /// A free block with its least corner at `origin`.
    pub fn new(origin: DVec3, size: Cell) -> Self {
        Self { origin, size, taken: vec![false; size.iter().map(|n| *n as usize).product()] }
    }

    /// Number of cells along each axis.
    pub fn size(&self) -> Cell {
        self.size
    }

    /// Centre of a cell.
    pub fn center(&self, c: Cell) -> DVec3 {
        self.origin + (DVec3::from_array(c.map(f64::from)) + 0.5) * CELL
    }

    fn index(&self, c: Cell) -> Option<usize> {
        let inside = (0..3).all(|k| (0..self.size[k]).contains(&c[k]));
        inside.then(|| ((c[1] * self.size[2] + c[2]) * self.size[0] + c[0]) as usize)
    }

    fn is_free(&self, c: Cell) -> bool {
        self.index(c).is_some_and(|k| !self.taken[k])
    }

    /// Takes every cell that the box from `low` to `high` touches.
    pub fn take(&mut self, low: DVec3, high: DVec3) {
        let cell = |p: DVec3| ((p - self.origin) / CELL).floor().to_array().map(|x| x as i32);
        let (a, b) = (cell(low), cell(high));
        for y in a[1]..=b[1] {
            for z in a[2]..=b[2] {
                for x in a[0]..=b[0] {
                    if let Some(k) = self.index([x, y, z]) {
                        self.taken[k] = true;
                    }
                }
            }
        }
    }

    /// Whether all cells within `half` of `c` are free.
    pub fn room(&self, c: Cell, half: i32) -> bool {
        cube(half).all(|o| self.is_free(add(c, o)))
    }

    /// A way from `start` in the direction `axis`, `sign` for a pipe that takes `half` cells on each side: the corners
    /// of a line of at least two runs' length. Runs are at least `run` cells. What it takes, stays taken.
    pub fn route(
        &mut self,
        rng: &mut Rng,
        start: Cell,
        [axis, sign]: [i32; 2],
        half: i32,
        run: i32,
    ) -> Option<Vec<Cell>> {
        if !self.room(start, half) {
            return None;
        }
        let mut mine: Vec<usize> = Vec::new();
        let claim = |grid: &mut Self, c: Cell, mine: &mut Vec<usize>| {
            for o in cube(half) {
                if let Some(k) = grid.index(add(c, o)).filter(|k| !grid.taken[*k]) {
                    grid.taken[k] = true;
                    mine.push(k);
                }
            }
        };
        claim(self, start, &mut mine);
        let (mut at, mut axis, mut sign) = (start, axis as usize, sign);
        let mut corners = vec![start];
        let mut total = 0;
        let longest = rng.int(24, 90) as i32;
        while total < longest {
            let wish = rng.int(i64::from(run), i64::from(3 * run + 8)) as i32;
            let mut gone = 0;
            while gone < wish && self.ahead(at, axis, sign, half) {
                at[axis] += sign;
                gone += 1;
                claim(self, at, &mut mine);
            }
            total += gone;
            if gone > 0 {
                corners.push(at);
            }
            if gone < run {
                break;
            }
            // Another direction with room for a run, level ones more often.
            let mut choices: Vec<(usize, i32)> = Vec::new();
            for (other, weight) in [(0, 3), (1, 2), (2, 3)] {
                for s in [-1, 1] {
                    if other != axis && self.open(at, other, s, half, run) {
                        choices.extend(std::iter::repeat_n((other, s), weight));
                    }
                }
            }
            if choices.is_empty() {
                break;
            }
            (axis, sign) = rng.pick(&choices);
        }
        if total < 2 * run {
            mine.into_iter().for_each(|k| self.taken[k] = false);
            return None;
        }
        // A last run that is too short for its bend is cut.
        let last = corners.len() - 1;
        if last >= 2 && distance(corners[last], corners[last - 1]) < run {
            corners.pop();
        }
        Some(corners)
    }

    /// Whether a pipe at `c` can go one cell further. Beneath a floor and just above it, it goes only up and down.
    fn ahead(&self, c: Cell, axis: usize, sign: i32, half: i32) -> bool {
        if axis != 1
            && (c[1] - half..=c[1] + half).any(|y| y.rem_euclid(FLOOR) == FLOOR - 1 || y.rem_euclid(FLOOR) == 0)
        {
            return false;
        }
        cube(half).filter(|o| o[axis] == half * sign).all(|mut o| {
            o[axis] += sign;
            self.is_free(add(c, o))
        })
    }

    fn open(&self, mut c: Cell, axis: usize, sign: i32, half: i32, run: i32) -> bool {
        (0..run).all(|_| {
            let ok = self.ahead(c, axis, sign, half);
            c[axis] += sign;
            ok
        })
    }
}

fn add(a: Cell, b: Cell) -> Cell {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

fn distance(a: Cell, b: Cell) -> i32 {
    (0..3).map(|k| (a[k] - b[k]).abs()).sum()
}

/// The cells within `half` of the origin.
fn cube(half: i32) -> impl Iterator<Item = Cell> {
    let r = -half..=half;
    r.clone().flat_map(move |y| {
        let r = -half..=half;
        r.clone().flat_map(move |z| r.clone().map(move |x| [x, y, z]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn ways_keep_their_distance_and_their_runs() {
        let mut grid = Grid::new(DVec3::ZERO, [32, 30, 32]);
        grid.take(DVec3::new(4.0, 0.0, 4.0), DVec3::new(8.0, 9.0, 8.0));
        let mut rng = Rng::new(1, &[0]);
        let mut seen: HashSet<Cell> = HashSet::new();
        let mut count = 0;
        for k in 0..300 {
            let half = i32::from(k < 20);
            let run = 3 + 2 * half;
            let start = [0; 3].map(|_| rng.int(1, 28) as i32);
            let direction = [rng.int(0, 2) as i32, rng.pick(&[-1, 1])];
            let Some(way) = grid.route(&mut rng, start, direction, half, run) else { continue };
            count += 1;
            let mut own: HashSet<Cell> = HashSet::new();
            for w in way.windows(2) {
                let length = distance(w[0], w[1]);
                assert!(length >= run || way.len() == 2, "a run of {length} in {way:?}");
                let step: Cell = std::array::from_fn(|k| (w[1][k] - w[0][k]).signum());
                assert_eq!(step.iter().filter(|s| **s != 0).count(), 1, "{way:?}");
                for n in 0..=length {
                    let c: Cell = std::array::from_fn(|k| w[0][k] + n * step[k]);
                    assert!(
                        !(10..=20).contains(&c[0]) || !(10..=20).contains(&c[2]) || c[1] > 22,
                        "through what stands"
                    );
                    own.extend(cube(half).map(|o| add(c, o)));
                }
            }
            assert!(own.is_disjoint(&seen), "way {k} meets another");
            seen.extend(own);
        }
        assert!(count > 60, "{count} ways");
    }
}
