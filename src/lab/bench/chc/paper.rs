//! What Mattausch et al. 2015 (*CHC+RT: Coherent Hierarchical Culling for Ray Tracing*) measured, tables 2 to 5. An
//! NVIDIA Titan, 1920 x 1080, 20 secondary rays a pixel; milliseconds a frame. Their scenes stand beside ours that are
//! like them.

use crate::lab::bench::scenes::{SceneId, View};
use crate::settings::Effect;

/// What was traced.
pub const EFFECTS: &[Effect] = &[Effect::Primary, Effect::Ao, Effect::Diffuse];

/// Numbers near, then far; each of [`EFFECTS`].
pub type NearFar = [[f64; 3]; 2];

/// The number of a view and of rays.
pub fn at(table: &NearFar, view: View, effect: Effect) -> Option<f64> {
    let effect = EFFECTS.iter().position(|&own| own == effect)?;
    Some(table[view as usize][effect])
}

/// A scene of the paper.
#[derive(Clone, Copy, Debug)]
pub struct PaperScene {
    /// Its name there.
    pub name: &'static str,
    /// Table 2: milliseconds of a frame by CHC+RT.
    pub ms: NearFar,
    /// Table 2, in core: how many times faster than a traversal from the root CHC+RT is.
    pub speed_up: Option<NearFar>,
    /// Table 3, out of core: millions of rays a second, queries a frame, megabytes moved a frame.
    pub traffic: Option<[NearFar; 3]>,
    /// Table 4, out of core: milliseconds of a frame of diffuse rays at [`THRESHOLDS`], near and far.
    pub aggressive_ms: Option<[[f64; 4]; 2]>,
    /// Table 5, in core: milliseconds of a frame of AO and of diffuse rays at [`ROTATIONS`], near.
    pub rotation_ms: Option<[[f64; 4]; 2]>,
}

/// Thresholds of table 4, pixels of a tile of 200 x 200.
pub const THRESHOLDS: [u32; 4] = [0, 20, 100, 200];

/// Rotations of table 5, degrees.
pub const ROTATIONS: [u32; 4] = [0, 18, 36, 360];

/// The scene of the paper that `scene` stands for.
pub fn scene(scene: SceneId) -> Option<PaperScene> {
    let (traffic, aggressive_ms, speed_up, rotation_ms) = (None, None, None, None);
    Some(match scene {
        // 11.7M triangles, in core.
        SceneId::City => PaperScene {
            name: "City-10",
            ms: [[11.3, 153.0, 384.0], [23.4, 286.0, 655.0]],
            speed_up: Some([[1.61, 1.22, 1.28], [1.12, 0.97, 0.89]]),
            rotation_ms: Some([[136.0, 145.0, 156.0, 193.0], [228.0, 323.0, 384.0, 805.0]]),
            traffic,
            aggressive_ms,
        },
        // 12.8M triangles, in core.
        SceneId::Pipes => PaperScene {
            name: "Powerplant",
            ms: [[12.8, 173.0, 1700.0], [15.0, 154.0, 843.0]],
            speed_up: Some([[5.46, 4.46, 5.92], [5.50, 3.82, 3.23]]),
            rotation_ms: Some([[153.0, 167.0, 175.0, 190.0], [664.0, 1334.0, 1700.0, 4125.0]]),
            traffic,
            aggressive_ms,
        },
        // 139M triangles, 47 % in core.
        SceneId::CityLarge => PaperScene {
            name: "City-200",
            ms: [[25.9, 325.7, 2720.0], [87.8, 766.7, 2492.0]],
            traffic: Some([
                [[80.1, 127.0, 15.2], [23.6, 54.1, 16.6]],
                [[822.0, 13_600.0, 61_200.0], [2460.0, 42_900.0, 117_000.0]],
                [[0.0, 5.85, 383.0], [0.61, 0.11, 1.73]],
            ]),
            aggressive_ms: Some([[2720.0, 780.0, 738.0, 715.0], [2492.0, 2019.0, 1751.0, 1611.0]]),
            speed_up,
            rotation_ms,
        },
        // 205M triangles, 32 % in core.
        SceneId::Pipes16 => PaperScene {
            name: "Powerplant x 16",
            ms: [[18.7, 232.0, 1855.0], [270.0, 1559.0, 25975.0]],
            traffic: Some([
                [[111.0, 179.0, 22.4], [7.68, 26.6, 1.60]],
                [[793.0, 13_200.0, 32_300.0], [3630.0, 61_700.0, 312_000.0]],
                [[0.11, 0.03, 0.55], [170.0, 43.6, 2310.0]],
            ]),
            aggressive_ms: Some([[1855.0, 1682.0, 1553.0, 1489.0], [25975.0, 9651.0, 4727.0, 3578.0]]),
            speed_up,
            rotation_ms,
        },
        SceneId::Sponza => return None,
    })
}
