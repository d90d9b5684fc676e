//! What the paper has (Gaitatzes, Chrysanthou, Papaioannou 2008).

/// A row of figure 6: of 32², 64², 128² and 256² directions.
struct Row {
    positions: u32,
    /// Grey levels.
    rms: [f64; 4],
    /// Seconds of making samples.
    bake_s: [f64; 4],
    /// Seconds of light.
    light_s: [f64; 4],
}

const FIGURE6: [Row; 3] = [
    Row {
        positions: 290,
        rms: [2.8207, 2.4118, 2.3153, 2.2914],
        bake_s: [3.96, 14.60, 54.42, 213.75],
        light_s: [0.09462, 0.09584, 0.09809, 0.10159],
    },
    Row {
        positions: 1090,
        rms: [1.0653, 1.0318, 1.0294, 1.02871],
        bake_s: [14.06, 51.23, 193.25, 772.0],
        light_s: [0.09870, 0.10219, 0.10785, 0.11516],
    },
    Row {
        positions: 4226,
        rms: [0.6772, 0.6315, 0.6209, 0.6185],
        bake_s: [54.79, 204.27, 925.05, 3039.72],
        light_s: [0.10826, 0.11118, 0.11504, 0.12190],
    },
];

/// What figure 6 has of samples.
#[derive(Clone, Copy, Debug)]
pub struct Paper {
    /// RMS, grey levels.
    pub rms: f64,
    /// Seconds of making them.
    pub bake_s: f64,
    /// Milliseconds of 836,352 rays.
    pub query_ms: f64,
}

/// Of so many positions and directions on each axis.
pub fn figure6(positions: u32, directions: u32) -> Option<Paper> {
    let column = [32, 64, 128, 256].iter().position(|&n| n == directions)?;
    let row = FIGURE6.iter().find(|row| row.positions == positions)?;
    Some(Paper { rms: row.rms[column], bake_s: row.bake_s[column], query_ms: 1e3 * row.light_s[column] })
}

/// Figure 7: RMS of 1 bit, 4226 x 64².
pub const ONE_BIT: f64 = 4.4030;

/// Figure 8: models, their triangles, rays, seconds of casting them and by fields.
pub const FIGURE8: [(&str, f64, f64, f64, f64); 4] = [
    ("lemon tree", 26_300.0, 836_352.0, 196.20, 0.240),
    ("bunny", 39_000.0, 836_352.0, 331.10, 0.228),
    ("igea", 67_200.0, 836_352.0, 616.35, 0.204),
    ("several", 142_300.0, 26_444_800.0, 4286.8, 4.692),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_found_by_their_samples() {
        assert_eq!(figure6(1090, 128).map(|paper| (paper.rms, paper.bake_s)), Some((1.0294, 193.25)));
        assert!(figure6(1090, 48).is_none() && figure6(82, 32).is_none());
    }
}
