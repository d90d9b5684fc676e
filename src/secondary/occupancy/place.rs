//! Enters the map of a brick, as an instance places it, into a map of the world.

use super::Bom;
use super::region::{Region, set_bits};
use bricks::{INSTANCE_IDENTITY, Instance, OCCUPANCY_CELLS, Occupancy, OccupancyMap, RESIDENT_LEVEL};

/// Half the distance of 1 to the next f64.
const UNIT: f64 = f64::EPSILON / 2.0;

/// Largest whole number up to which f64 has all.
const WHOLE_LIMIT: f64 = (1u64 << 53) as f64;

/// A level of a brick's map.
#[derive(Clone, Copy)]
pub(crate) struct Cells<'a> {
    level: u32,
    bytes: &'a [u8],
}

impl<'a> Cells<'a> {
    /// The level that is resident.
    pub fn resident(record: &'a Occupancy) -> Self {
        Self { level: RESIDENT_LEVEL, bytes: &record.bits }
    }

    /// A level up to [`RESIDENT_LEVEL`] of a whole map.
    pub fn of(map: &'a OccupancyMap, level: u32) -> Self {
        Self { level, bytes: map.level(level) }
    }

    /// Cells on each axis: 64, 32 or 16.
    fn count(&self) -> u32 {
        OCCUPANCY_CELLS >> self.level
    }

    /// Bit z is cell (x, y, z).
    fn column(&self, x: u32, y: u32) -> u64 {
        let bytes = (self.count() / 8) as usize;
        let mut column = [0; 8];
        column[..bytes].copy_from_slice(&self.bytes[(x + self.count() * y) as usize * bytes..][..bytes]);
        u64::from_le_bytes(column)
    }
}

/// Where the cells of a brick lie in the world.
pub(crate) enum Place {
    /// On the world's lattice of cells.
    Aligned {
        /// log2 of the side of a cell of the finest level, world units.
        cell_log2: i32,
        /// Cell (0, 0, 0) of the finest level, in cells from the world's origin.
        origin: [i64; 3],
    },
    /// Turned, sheared, or scaled or moved by other than powers of two and whole cells.
    Turned {
        /// log2 of the side of a cube of a finest cell's volume, world units, rounded down.
        cell_log2: i32,
        /// world_from_object, row-major 3x4.
        matrix: [f64; 12],
        /// The side of a cell of the finest level, object units.
        side: f64,
        /// Cell (0, 0, 0) of the finest level, in cells from the object's origin.
        origin: [i64; 3],
    },
}

/// The exponent of a power of two.
fn power_of_two(x: f64) -> Option<i32> {
    let bits = x.to_bits();
    let is_power = x.is_normal() && x > 0.0 && bits << 12 == 0;
    is_power.then_some((bits >> 52) as i32 - 1023)
}

impl Place {
    /// Of a brick's record in an instance.
    pub fn of(instance: &Instance, record: &Occupancy) -> Self {
        if instance.flags & INSTANCE_IDENTITY != 0 {
            return Self::Aligned { cell_log2: record.cell_log2, origin: record.origin };
        }
        let m = &instance.world_from_object;
        let is_scale = [m[1], m[2], m[4], m[6], m[8], m[9]] == [0.0; 6] && m[0] == m[5] && m[0] == m[10];
        if let Some(scale_log2) = power_of_two(m[0]).filter(|_| is_scale) {
            let cell_log2 = record.cell_log2 + scale_log2;
            // By a power of two: exact, or infinite, or no longer whole.
            let by = [m[3], m[7], m[11]].map(|t| t / f64::from(cell_log2).exp2());
            if by.iter().all(|x| x.trunc() == *x && x.abs() < WHOLE_LIMIT)
                && [m[3], m[7], m[11]].map(|t| t == 0.0) == by.map(|x| x == 0.0)
            {
                return Self::Aligned { cell_log2, origin: std::array::from_fn(|k| record.origin[k] + by[k] as i64) };
            }
        }
        let side = f64::from(record.cell_log2).exp2();
        let world_side = side * instance.determinant().abs().cbrt();
        Self::Turned { cell_log2: world_side.log2().floor() as i32, matrix: *m, side, origin: record.origin }
    }

    /// log2 of the side of a cell of the finest level, world units; of a turned one about so.
    pub fn cell_log2(&self) -> i32 {
        match self {
            Self::Aligned { cell_log2, .. } | Self::Turned { cell_log2, .. } => *cell_log2,
        }
    }

    /// The level of a whole map to enter into cells of 2^`cell_log2`: on the lattice the finest, which makes no
    /// difference to be rounded; else cells half as large, for boxes around images of smaller ones fit little better.
    pub fn level(&self, cell_log2: i32) -> u32 {
        match self {
            Self::Aligned { .. } => 0,
            Self::Turned { cell_log2: own, .. } => (cell_log2 - 1 - own).clamp(0, RESIDENT_LEVEL as i32) as u32,
        }
    }

    /// Enters cells into a region of a map.
    pub fn enter(&self, map: &mut Bom, region: &Region, cells: &Cells<'_>) {
        match self {
            Self::Aligned { cell_log2, origin } => enter_aligned(map, region, cells, *cell_log2, origin),
            Self::Turned { matrix, side, origin, .. } => enter_turned(map, region, cells, matrix, *side, origin),
        }
    }
}

/// The cells of a map, from its first, that a cell of a source meets on one axis: its first and last.
struct Axis {
    /// log2 of the map's cells in the source's finest.
    shift: i32,
    level: u32,
    /// Of the source's finest cells, from the world's origin.
    origin: i64,
    first: i64,
}

impl Axis {
    fn place(&self, finest: i64) -> i64 {
        if self.shift >= 0 { finest >> self.shift.min(63) } else { finest << -self.shift }
    }

    fn lo(&self, cell: u32) -> i64 {
        self.place(self.origin + (i64::from(cell) << self.level)) - self.first
    }

    fn hi(&self, cell: u32) -> i64 {
        let end = self.origin + (i64::from(cell + 1) << self.level);
        let last = if self.shift >= 0 { self.place(end - 1) } else { self.place(end) - 1 };
        last - self.first
    }

    /// For each cell of the map from `lo` up to `hi` that meets any of `count` cells: it, and the first and last of
    /// them.
    fn meeting(&self, count: u32, lo: u32, hi: u32) -> Vec<(u32, u32, u32)> {
        let mut met: Vec<(u32, u32, u32)> = Vec::new();
        for cell in 0..count {
            let (from, to) = (self.lo(cell).max(i64::from(lo)), self.hi(cell).min(i64::from(hi) - 1));
            for at in from..=to {
                match met.last_mut() {
                    Some(last) if last.0 == at as u32 => last.2 = cell,
                    _ => met.push((at as u32, cell, cell)),
                }
            }
        }
        met
    }
}

/// Cells on a common lattice: each cell of the map is the OR of those that it meets, one axis after the other.
fn enter_aligned(map: &mut Bom, region: &Region, cells: &Cells<'_>, cell_log2: i32, origin: &[i64; 3]) {
    let shift = map.cell_log2 - cell_log2;
    let [x_axis, y_axis, z_axis]: [Axis; 3] =
        std::array::from_fn(|k| Axis { shift, level: cells.level, origin: origin[k], first: map.first[k] });
    let count = cells.count();
    let columns = x_axis.meeting(count, region.lo[0], region.hi[0]);
    let z_range = (i64::from(region.lo[2]), i64::from(region.hi[2]));
    let words = map.column_words() as usize;
    let mut rows = [0u64; OCCUPANCY_CELLS as usize];
    let mut rows_of = None;
    for (y, first_y, last_y) in y_axis.meeting(count, region.lo[1], region.hi[1]) {
        if rows_of != Some((first_y, last_y)) {
            rows_of = Some((first_y, last_y));
            for (x, row) in (0..count).zip(&mut rows) {
                *row = (first_y..=last_y).fold(0, |row, y| row | cells.column(x, y));
            }
        }
        let mut expanded_of = None;
        let mut expanded = [0u32; 8];
        for &(x, first_x, last_x) in &columns {
            let bits = rows[first_x as usize..=last_x as usize].iter().fold(0, |bits, row| bits | row);
            if bits == 0 {
                continue;
            }
            if expanded_of != Some(bits) {
                expanded_of = Some(bits);
                expanded = [0; 8];
                for (from, to) in runs(bits) {
                    let (lo, hi) = (z_axis.lo(from).max(z_range.0), (z_axis.hi(to) + 1).min(z_range.1));
                    if lo < hi {
                        set_bits(&mut expanded, lo as u32, hi as u32);
                    }
                }
            }
            for (word, bits) in map.column_mut(x, y).iter_mut().zip(&expanded[..words]) {
                *word |= bits;
            }
        }
    }
}

/// The runs of ones: the first and the last bit of each.
fn runs(mut bits: u64) -> impl Iterator<Item = (u32, u32)> {
    std::iter::from_fn(move || {
        let from = (bits != 0).then(|| bits.trailing_zeros())?;
        let ones = (bits >> from).trailing_ones();
        bits &= u64::MAX.checked_shl(from + ones).unwrap_or(0);
        Some((from, from + ones - 1))
    })
}

/// Cells under a matrix: for each the cells that the box around its image meets.
fn enter_turned(
    map: &mut Bom,
    region: &Region,
    cells: &Cells<'_>,
    matrix: &[f64; 12],
    finest_side: f64,
    origin: &[i64; 3],
) {
    let count = f64::from(cells.count());
    let side = finest_side * f64::from(cells.level).exp2();
    let per_world = 1.0 / map.side();
    // In cells of the map, from its first: the middle of the source's cell (0, 0, 0), what one more on an axis adds,
    // half of a box.
    let mut middle = [0.0; 3];
    let mut step = [[0.0; 3]; 3];
    let mut half = [0.0; 3];
    for k in 0..3 {
        let [row @ .., translation] = [matrix[4 * k], matrix[4 * k + 1], matrix[4 * k + 2], matrix[4 * k + 3]];
        let corner: [f64; 3] = origin.map(|x| x as f64 * finest_side);
        let mut world = translation;
        // Sum of magnitudes of all that is added up for any cell, world units.
        let mut size = translation.abs();
        for j in 0..3 {
            world += row[j] * corner[j];
            size += row[j].abs() * (corner[j].abs() + count * side);
            step[k][j] = row[j] * side * per_world;
            half[k] += 0.5 * step[k][j].abs();
        }
        let first = map.first[k] as f64;
        middle[k] = world * per_world - first + 0.5 * (step[k][0] + step[k][1] + step[k][2]);
        // A corner: rounded, multiplied, added up in three, less the first, and four more sums for a cell: 10 roundings
        // of terms that are no larger than this in all; as many for the bounds; what computes the point itself makes 4.
        half[k] += 32.0 * UNIT * (size * per_world + first.abs() + f64::from(map.cells()));
    }
    let (lo, hi) = (region.lo.map(f64::from), region.hi.map(|x| f64::from(x) - 1.0));
    for y in 0..cells.count() {
        for x in 0..cells.count() {
            for (from, to) in runs(cells.column(x, y)) {
                'cells: for z in from..=to {
                    let at = [x, y, z].map(f64::from);
                    let mut found = Region { lo: [0; 3], hi: [0; 3] };
                    for k in 0..3 {
                        let center = middle[k] + (step[k][0] * at[0] + step[k][1] * at[1] + step[k][2] * at[2]);
                        let first = (center - half[k]).floor().max(lo[k]);
                        let last = (center + half[k]).floor().min(hi[k]);
                        if first > last {
                            continue 'cells;
                        }
                        (found.lo[k], found.hi[k]) = (first as u32, last as u32 + 1);
                    }
                    map.fill(&found);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bricks::OccupancyGrid;
    use brickwalk_scenes::Rng;

    /// A brick's map with cells at random.
    fn random_map(rng: &mut Rng, count: u32) -> OccupancyMap {
        let mut columns = [0; 4096];
        (0..count).for_each(|_| columns[rng.int(0, 4095) as usize] |= 1 << rng.int(0, 63));
        OccupancyMap::of_finest(&columns)
    }

    fn cells_of(count: u32) -> impl Iterator<Item = [u32; 3]> {
        (0..count).flat_map(move |x| (0..count).flat_map(move |y| (0..count).map(move |z| [x, y, z])))
    }

    /// A region inside of a map of 64³ cells, or all of it.
    fn region(rng: &mut Rng) -> Region {
        let mut region = Region::whole(64);
        if rng.chance(0.7) {
            for k in 0..3 {
                region.lo[k] = rng.int(0, 40) as u32;
                region.hi[k] = rng.int(i64::from(region.lo[k]) + 1, 64) as u32;
            }
        }
        region
    }

    #[test]
    fn cells_on_the_lattice_are_those_that_overlap() {
        let mut rng = Rng::new(5, &[1]);
        let (mut set, mut kept_out) = (0, 0);
        for shift in -2..=7 {
            for level in 0..=RESIDENT_LEVEL {
                let (brick, region) = (random_map(&mut rng, 400), region(&mut rng));
                let origin = [(); 3].map(|()| rng.int(-300, 300));
                let start = |k: usize| if shift < 0 { origin[k] << -shift } else { origin[k] >> shift };
                let first = std::array::from_fn(|k| start(k) - rng.int(0, 30));
                let mut map = Bom::new(64, shift - 3, first);
                let place = Place::Aligned { cell_log2: -3, origin };
                place.enter(&mut map, &region, &Cells::of(&brick, level));
                // In units of an eighth of the finest cell, which divides all.
                let mut expected = Bom::new(64, shift - 3, first);
                for cell in cells_of(64 >> level).filter(|&cell| brick.is_occupied(level, cell)) {
                    let from = |k: usize| (origin[k] + (i64::from(cell[k]) << level)) << 3;
                    let side = 1i64 << (shift + 3);
                    let lo: [i64; 3] = std::array::from_fn(|k| from(k).div_euclid(side));
                    let hi: [i64; 3] = std::array::from_fn(|k| (from(k) + (8 << level) - 1).div_euclid(side) + 1);
                    if let Some(found) = Region::within(&expected, lo, hi) {
                        match found.and(&region) {
                            Some(found) => expected.fill(&found),
                            None => kept_out += 1,
                        }
                    }
                }
                assert_eq!(map, expected, "shift {shift}, level {level}");
                set += map.occupied();
            }
        }
        assert!(set > 10_000 && kept_out > 100, "{set} {kept_out}");
    }

    #[test]
    fn points_of_turned_cells_are_in_occupied_ones() {
        let mut rng = Rng::new(5, &[2]);
        let (mut points, mut elsewhere) = (0, 0);
        for far in [0.0, 1e3, 1e9] {
            for _ in 0..6 {
                let brick = random_map(&mut rng, 60);
                let grid = OccupancyGrid { cell_log2: -5, origin: [(); 3].map(|()| rng.int(-4000, 4000)) };
                let mut matrix = [0.0; 12];
                for k in 0..3 {
                    (0..3).for_each(|j| matrix[4 * k + j] = rng.range(-1.5, 1.5));
                    matrix[4 * k + 3] = rng.range(-far, far);
                }
                let instance = Instance { world_from_object: matrix, ..bytemuck::Zeroable::zeroed() };
                let record = brick.record(&grid);
                let place = Place::of(&instance, &record);
                assert!(matches!(place, Place::Turned { .. }));
                let at = |p: [f64; 3]| -> [f64; 3] {
                    std::array::from_fn(|k| (0..3).map(|j| matrix[4 * k + j] * p[j]).sum::<f64>() + matrix[4 * k + 3])
                };
                let side = 2f64.powi(-5);
                let middle = at(grid.origin.map(|x| (x + 32) as f64 * side));
                for cell_log2 in -4..0 {
                    let cell = 2f64.powi(cell_log2);
                    let mut map = Bom::new(64, cell_log2, middle.map(|x| (x / cell) as i64 - 32));
                    let level = place.level(cell_log2);
                    place.enter(&mut map, &Region::whole(64), &Cells::of(&brick, level));
                    for cell in cells_of(64).filter(|&cell| brick.is_occupied(0, cell)) {
                        let p = std::array::from_fn(|k| {
                            ((grid.origin[k] + i64::from(cell[k])) as f64
                                + [0.0, 1.0, rng.unit()][rng.int(0, 2) as usize])
                                * side
                        });
                        let found = map.cell_at(at(p));
                        if found.iter().all(|x| (0..64).contains(x)) {
                            points += 1;
                            assert!(map.is_occupied(found), "{p:?} at {found:?} of 2^{cell_log2}");
                            elsewhere += u32::from(!map.is_occupied([found[1], found[2], found[0]]));
                        }
                    }
                }
            }
        }
        assert!(points > 1500 && elsewhere * 2 > points, "{points} {elsewhere}");
    }
}
