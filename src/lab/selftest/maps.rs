//! Occupancy maps, distances to their cells, and mappings of the square and the sphere (cases 39, 40, 44 to 46, 56,
//! 57).

use super::case::Checks;
use super::lab::{Lab, mesh, settings};
use crate::math::octahedral::{octahedral_decode, octahedral_encode};
use crate::math::sampling::{concentric_disc, cosine_hemisphere, hammersley};
use crate::reference::Truth;
use crate::secondary::df::{DistanceField, LEVELS, Tracing, distance_f16};
use crate::secondary::occupancy::Bom;
use anyhow::Result;
use bricks::OCCUPANCY_LEVELS;
use brickwalk_convert::source::SourceScene;
use glam::DVec3;
use half::f16;

/// A sheet of 12 x 12 squares of side 1/8: its corner, and what one square more in either direction adds.
fn sheet(corner: DVec3, [u, v]: [DVec3; 2]) -> SourceScene {
    let n = 12u32;
    let at = |i: u32, j: u32| (corner + f64::from(i) * u + f64::from(j) * v).to_array();
    let positions = (0..=n).flat_map(|i| (0..=n).map(move |j| at(i, j))).collect();
    let indices = (0..n)
        .flat_map(|i| (0..n).map(move |j| i * (n + 1) + j))
        .flat_map(|p| [p, p + 1, p + n + 2, p, p + n + 2, p + n + 1])
        .collect();
    mesh("sheet", positions, indices)
}

/// No points of sheets lie in cells that are empty in every brick's map. The points have weights of eighths,
/// the lattice is 2⁻²⁰ and cells are powers of two, so that everything is exact in f64.
fn no_holes(lab: &mut Lab, checks: &mut Checks, what: &str, sheets: Vec<SourceScene>) -> Result<()> {
    let (mut empty, mut of) = (0, 0);
    for sheet in sheets {
        let file = lab.build(sheet, &settings(40, -20))?.file;
        let truth = Truth::load(&file)?;
        let resident = file.resident();
        let maps: Vec<_> =
            (0..resident.bricks.len() as u32).map(|brick| file.occupancy(brick)).collect::<Result<_, _>>()?;
        let is_occupied = |p: DVec3| {
            resident.occupancy.iter().zip(&maps).any(|(record, map)| {
                let side = f64::from(record.cell_log2).exp2();
                let cell: [i64; 3] = std::array::from_fn(|k| (p[k] / side).floor() as i64 - record.origin[k]);
                let holds = cell.iter().all(|x| (0..64).contains(x));
                holds && (0..OCCUPANCY_LEVELS).all(|level| map.is_occupied(level, cell.map(|x| x as u32 >> level)))
            })
        };
        for [a, b, c] in truth.ids().filter_map(|id| truth.vertices(id)).map(|t| t.map(DVec3::from)) {
            for (i, j) in (0..=8).flat_map(|i| (0..=8 - i).map(move |j| (f64::from(i), f64::from(j)))) {
                of += 1;
                empty += u64::from(!is_occupied((i * a + j * b + (8.0 - i - j) * c) / 8.0));
            }
        }
    }
    checks.none(what, empty, of);
    Ok(())
}

/// Case 39: planes on the borders of cells, and one step of the lattice beside them.
pub fn on_borders(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let step = 1.0 / 1_048_576.0;
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let mut sheets = Vec::new();
    for k in 0..3 {
        for aside in [-1.0, 0.0, 1.0] {
            let corner = axes[k] * (0.5 + aside * step);
            sheets.push(sheet(corner, [axes[(k + 1) % 3] / 8.0, axes[(k + 2) % 3] / 8.0]));
        }
    }
    no_holes(lab, checks, "points of planes at x, y, z = 1/2, and a step of 2^-20 beside, in empty cells", sheets)
}

/// Case 40: planes along one axis of the raster, and along none.
pub fn along_axes(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let step = 1.0 / 1_048_576.0;
    let mut sheets = Vec::new();
    for slope in [0.0, step, 1.0 / 64.0, 0.125] {
        for k in 0..3 {
            let (mut u, mut v) = (DVec3::ZERO, DVec3::ZERO);
            (u[k], u[(k + 1) % 3]) = (0.125, slope);
            (v[(k + 2) % 3], v[(k + 1) % 3]) = (0.125, slope / 2.0);
            sheets.push(sheet(DVec3::splat(0.25), [u, v]));
        }
    }
    no_holes(lab, checks, "points of planes along axes and nearly so in empty cells", sheets)
}

/// Case 44: the concentric map at its centre, on diagonals, on the border.
pub fn concentric(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let mut rng = lab.random(&[44]);
    checks.holds("the centre goes to the centre", concentric_disc([0.5, 0.5]) == [0.0, 0.0]);
    let (mut radius, mut diagonal, mut border) = (0.0f64, 0.0f64, 0.0f64);
    for i in 0..20_000 {
        let x = if i < 4 { [0.0, 1.0, 0.25, 0.75][i] } else { rng.unit() as f32 };
        let y = rng.unit() as f32;
        let length = |p: [f32; 2]| f64::from(p[0]).hypot(f64::from(p[1]));
        // The square's rings are the disc's circles.
        let ring = |x: f32, y: f32| f64::from((2.0 * x - 1.0).abs().max((2.0 * y - 1.0).abs()));
        radius = radius.max((length(concentric_disc([x, y])) - ring(x, y)).abs());
        for p in [[x, x], [x, 1.0 - x]] {
            let [a, b] = concentric_disc(p);
            diagonal = diagonal.max(f64::from((a.abs() - b.abs()).abs()));
        }
        for p in [[0.0, x], [1.0, x], [x, 0.0], [x, 1.0]] {
            border = border.max((length(concentric_disc(p)) - 1.0).abs());
        }
    }
    // 2x - 1, the quotient, the angle, sine and cosine and the product: 8 roundings of 2^-24.
    let bound = 8.0 * 2f64.powi(-24);
    checks.at_most("radius against the square's ring", radius, bound);
    checks.at_most("border against the unit circle", border, bound);
    checks.at_most("diagonals against |x| = |y|", diagonal, 2.0 * bound);
    Ok(())
}

/// Case 45: octahedral directions at seams and zeros.
pub fn octahedral(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let mut rng = lab.random(&[45]);
    let mut worst = 0.0f64;
    let mut count = 0u64;
    let mut take = |n: DVec3| {
        let n = n.normalize();
        let back = glam::Vec3::from(octahedral_decode(octahedral_encode(n.as_vec3().to_array()))).as_dvec3();
        let angle = n.cross(back).length().atan2(n.dot(back));
        worst = if angle.is_nan() { f64::NAN } else { worst.max(angle) };
        count += 1;
    };
    for (x, y, z) in (-2..=2).flat_map(|x| (-2..=2).flat_map(move |y| (-2..=2).map(move |z| (x, y, z)))) {
        let signed = |x: i32| if x == -2 { -0.0 } else { f64::from(x) };
        let n = DVec3::new(signed(x), signed(y), signed(z));
        if n != DVec3::ZERO {
            take(n);
        }
    }
    for i in 0..50_000 {
        let mut n = rng.direction();
        // On the equator, on the planes between faces, and beside them.
        match i % 4 {
            0 => n.z = [0.0, -0.0, 1e-7, -1e-7][i / 4 % 4],
            1 => n.x = [0.0, -0.0, 1e-7, -1e-7][i / 4 % 4],
            2 => n.y = [0.0, -0.0, 1e-30, -1e-30][i / 4 % 4],
            _ => {}
        }
        take(n);
    }
    // Codes of 16 bits form a triangular lattice of step 2^0.5 / 32767 on a face, of which every point is within 3^-0.5
    // steps, and the middle of a face is 3^-0.5 from the centre; the code's own rounding adds less than a hundredth.
    checks.at_most("there and back, radians", worst, 1.01 * 2f64.sqrt() / 32767.0);
    checks.at_least("directions", count, 50_000);
    let zero = octahedral_decode(octahedral_encode([0.0; 3]));
    checks.holds("no direction gives one", zero.iter().all(|x| x.is_finite()));
    Ok(())
}

/// Case 46: the ends of the unit interval.
pub fn hammersley_ends(_: &mut Lab, checks: &mut Checks) -> Result<()> {
    let (mut outside, mut below, mut points) = (0, 0, 0);
    for count in [1u32, 2, 3, 1000, 1 << 24, u32::MAX] {
        for index in [0, 1, count / 2, count - 1] {
            let p = hammersley(index, count);
            outside += u64::from(!p.iter().all(|x| (0.0..1.0).contains(x)));
            let [x, y, z] = cosine_hemisphere(p);
            below += u64::from(z.is_nan() || z < 0.0 || !x.is_finite() || !y.is_finite());
            points += 1;
        }
    }
    let ends = [0.0, 1.0, 0.5, 1.0f32.next_down(), f32::MIN_POSITIVE];
    for (x, y) in ends.into_iter().flat_map(|x| ends.map(|y| (x, y))) {
        let [a, b, z] = cosine_hemisphere([x, y]);
        below += u64::from(z.is_nan() || z < 0.0 || !a.is_finite() || !b.is_finite());
        points += 1;
    }
    checks.none("points outside of [0, 1)", outside, points);
    checks.none("heights that are negative or no number", below, points);
    Ok(())
}

/// Case 56: distances between the middles of cells, as f16.
pub fn distances(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    // All that there are in the largest map.
    let (mut above, mut loose, mut of) = (0, 0, 0);
    for squared in 0..=3 * 255u32.pow(2) {
        let root = distance_f16(squared);
        let [low, next] = [root, f16::from_bits(root.to_bits() + 1)].map(|x| x.to_f64() * x.to_f64());
        above += u64::from(low > f64::from(squared));
        loose += u64::from(next <= f64::from(squared));
        of += 1;
    }
    checks.none("roots above what they stand for", above, of);
    checks.none("roots below the largest f16 that is not above", loose, of);
    let mut rng = lab.random(&[56]);
    let mut map = Bom::new(32, 3, [-16; 3]);
    let seeds: Vec<[u32; 3]> = (0..40).map(|_| [(); 3].map(|()| rng.int(0, 31) as u32)).collect();
    seeds.iter().for_each(|&seed| map.occupy(seed));
    let field = DistanceField::new(&map);
    let (mut longest, mut short) = (0.0f64, 0);
    for (index, distance) in (0..32u32.pow(3)).zip(field.level(0)) {
        let cell = [index / 1024, index / 32 % 32, index % 32];
        let apart = |seed: &[u32; 3]| (0..3).map(|k| cell[k].abs_diff(seed[k]).pow(2)).sum::<u32>();
        let exact = seeds.iter().map(apart).min().unwrap_or(u32::MAX);
        short += u64::from(*distance < distance_f16(exact));
        longest = longest.max(distance.to_f64() - f64::from(exact).sqrt());
    }
    checks.none("flooded distances that are too short", short, 32u64.pow(3));
    // No bound is known; the largest of many maps was 1.3.
    checks.at_most("flooded distance beyond the exact one, cells", longest, 2.0);
    Ok(())
}

/// Case 57: the field of a map without occupied cells, and of one with a single one.
pub fn no_seed(_: &mut Lab, checks: &mut Checks) -> Result<()> {
    let mut map = Bom::new(64, -2, [0; 3]);
    let middle = 7.625;
    let traced = |field: &DistanceField| {
        let origin = [-1.0, middle, middle];
        field.trace(&Tracing::default(), origin, [1.0, 0.0, 0.0], 0.0, f64::INFINITY)
    };
    let empty = DistanceField::new(&map);
    let finite: usize = (0..LEVELS).map(|level| empty.level(level).iter().filter(|d| d.is_finite()).count()).sum();
    checks.equal("distances that are finite", finite, 0);
    checks.holds("between them as well", empty.distance(0, [3.25, 9.5, 11.0]) == f32::INFINITY);
    let result = traced(&empty);
    checks.holds("a ray hits nothing, and ends", result.t.is_none() && !result.is_capped);
    map.occupy([40, 30, 30]);
    let t = traced(&DistanceField::new(&map)).t.unwrap_or(f64::NAN);
    // From the least distance that hits to the middle of the cell, which is at 10.125.
    checks.at_most("hit of a single cell, cells from its middle", (t - 11.125).abs() * 4.0, 1.0);
    Ok(())
}
