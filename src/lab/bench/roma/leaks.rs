//! How often columns of maps turned about pass through a single sheet without a set bit.

use crate::secondary::occupancy::{Bom, Voxelisation, voxelise};
use brickwalk_scenes::Rng;
use glam::DVec3;

/// Cells of the map, and texels of the turned one.
const CELLS: u32 = 64;

/// Columns that pass through a plane, of these those without a bit, of each number of samples a step: of a turned map
/// around the middle of `map` with a side of `wide` times its own.
fn columns<const N: usize>(
    map: &Bom,
    (normal, distance): (DVec3, f64),
    axes: [DVec3; 3],
    wide: f64,
    samples: [u32; N],
) -> (u64, [u64; N]) {
    let side = f64::from(CELLS) * wide;
    let at = |i: f64| i / f64::from(CELLS) * side - side / 2.0;
    let (mut crossing, mut leaks) = (0, [0; N]);
    for (i, j) in (0..CELLS).flat_map(|i| (0..CELLS).map(move |j| (f64::from(i), f64::from(j)))) {
        let across = axes[0] * at(i + 0.5) + axes[1] * at(j + 0.5);
        let met = across + axes[2] * ((distance - normal.dot(across)) / normal.dot(axes[2]));
        // Inside of the map by more than a step, so that the samples on both sides are in it.
        let is_inside = met.abs().max_element() < f64::from(CELLS) / 2.0 - 2.0;
        if !is_inside || met.dot(axes[2]).abs() > side / 2.0 - 2.0 {
            continue;
        }
        crossing += 1;
        for (leaks, samples) in leaks.iter_mut().zip(samples) {
            let steps = CELLS * samples;
            let is_set = (0..steps).any(|t| {
                let along = at((f64::from(t) + 0.5) / f64::from(samples));
                let p = across + axes[2] * along + DVec3::splat(f64::from(CELLS) / 2.0);
                map.is_occupied(p.to_array().map(|x| x.floor() as i64))
            });
            *leaks += u64::from(!is_set);
        }
    }
    (crossing, leaks)
}

/// How wide maps are, in sides of the base map: as wide, as its diagonal, and as the diagonal of one of twice as many
/// cells.
pub const WIDE: [f64; 3] = [1.0, 1.732_050_807_568_877_2, 3.464_101_615_137_754_4];

/// Look-ups a texel.
pub const SAMPLES: [u32; 3] = [1, 2, 4];

/// Random planes.
const PLANES: u32 = 60;

/// Shares of columns through random planes that leak, per cent: of maps of each of [`WIDE`], of each of [`SAMPLES`]; of
/// the paper's base maps, moved at random, or of conservative ones.
pub fn leaks(is_raster: bool) -> [[f64; 3]; 3] {
    let mut rng = Rng::new(11, &[1]);
    let mut sums = [(0, [0; 3]); 3];
    for _ in 0..PLANES {
        let (normal, distance) = (rng.direction(), rng.range(-8.0, 8.0));
        let [u, v] = [normal.any_orthonormal_vector(), normal.cross(normal.any_orthonormal_vector())];
        let corner = |a: f64, b: f64| {
            let far = f64::from(CELLS) * 2.0;
            (normal * distance + u * (a * far) + v * (b * far) + f64::from(CELLS) / 2.0).to_array()
        };
        let quad = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        let how = if is_raster {
            Voxelisation::Raster { jitter: [(); 3].map(|()| rng.range(-0.5, 0.5)) }
        } else {
            Voxelisation::Conservative
        };
        let mut map = Bom::new(CELLS, 0, [0; 3]);
        voxelise(&mut map, [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]], how);
        let along = rng.direction();
        let x = along.any_orthonormal_vector();
        let axes = [x, along.cross(x), along];
        for (sum, wide) in sums.iter_mut().zip(WIDE) {
            let (crossing, found) = columns(&map, (normal, distance), axes, wide, SAMPLES);
            sum.0 += crossing;
            sum.1.iter_mut().zip(found).for_each(|(sum, found)| *sum += found);
        }
    }
    sums.map(|(crossing, leaks)| leaks.map(|leaks| 100.0 * leaks as f64 / crossing as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Spec §2, "Single sheets leak".
    #[test]
    fn single_sheets_leak_as_often_as_measured_before() {
        let [raster, conservative] = [true, false].map(leaks);
        println!("columns through a plane without a bit, percent; of 1, 2 and 4 samples a step");
        for (name, [equal, widest, finer]) in [("raster", raster), ("conservative", conservative)] {
            println!(
                "{name:>12}: map as wide as the cells' {equal:.3?}, as its diagonal {widest:.3?}, as twice that \
                 {finer:.3?}"
            );
        }
        let is_near = |found: f64, before: f64| (before / 1.5..=before * 1.5).contains(&found);
        assert!(is_near(raster[0][0], 11.5) && is_near(raster[1][0], 35.0), "one sample");
        assert!(is_near(raster[0][2], 2.7) && is_near(raster[1][2], 6.3), "four samples");
        assert_eq!(conservative[0], [0.0; 3], "steps of a cell");
        assert!(is_near(conservative[1][0], 8.4), "steps of a cell's diagonal");
        assert!(conservative[1][1] <= 1.5, "half of them");
        // Of twice as many cells, twice as many look-ups.
        assert!(is_near(conservative[2][1], conservative[1][0]) && conservative[2][2] <= 1.5);
    }
}
