//! What Mattausch et al. 2015 (*CHC+RT: Coherent Hierarchical Culling for Ray Tracing*) measured, tables 2 to 5. An
//! NVIDIA Titan, 1920 x 1080, 20 secondary rays a pixel; milliseconds a frame. Their scenes stand beside ours that are
//! like them.

use super::plan::{Effect, View};

/// A scene of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PaperScene {
    /// 11.7M triangles, in core.
    City10,
    /// 12.8M triangles, in core.
    Powerplant,
    /// 139M triangles, 47 % in core.
    City200,
    /// 205M triangles, 32 % in core.
    Powerplant16,
}

impl PaperScene {
    /// Its name in the paper.
    pub fn name(self) -> &'static str {
        match self {
            Self::City10 => "City-10",
            Self::Powerplant => "Powerplant",
            Self::City200 => "City-200",
            Self::Powerplant16 => "Powerplant x 16",
        }
    }
}

/// Numbers near, then far; each of primary, AO and diffuse rays.
type NearFar = [[f64; 3]; 2];

fn of(table: &NearFar, view: View, effect: Effect) -> f64 {
    table[view as usize][effect as usize]
}

/// Table 2: milliseconds of a frame by CHC+RT.
pub fn ms(scene: PaperScene, view: View, effect: Effect) -> f64 {
    let table = match scene {
        PaperScene::City10 => [[11.3, 153.0, 384.0], [23.4, 286.0, 655.0]],
        PaperScene::Powerplant => [[12.8, 173.0, 1700.0], [15.0, 154.0, 843.0]],
        PaperScene::City200 => [[25.9, 325.7, 2720.0], [87.8, 766.7, 2492.0]],
        PaperScene::Powerplant16 => [[18.7, 232.0, 1855.0], [270.0, 1559.0, 25975.0]],
    };
    of(&table, view, effect)
}

/// Table 2: how many times faster than a traversal from the root CHC+RT is, where the scene fits.
pub fn speed_up(scene: PaperScene, view: View, effect: Effect) -> Option<f64> {
    let table = match scene {
        PaperScene::City10 => [[1.61, 1.22, 1.28], [1.12, 0.97, 0.89]],
        PaperScene::Powerplant => [[5.46, 4.46, 5.92], [5.50, 3.82, 3.23]],
        PaperScene::City200 | PaperScene::Powerplant16 => return None,
    };
    Some(of(&table, view, effect))
}

/// A row of table 3, out of core.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Traffic {
    /// Millions of rays a second.
    pub mrays_per_s: f64,
    /// Queries a frame.
    pub queries: f64,
    /// Megabytes moved a frame.
    pub megabytes: f64,
}

/// Table 3.
pub fn traffic(scene: PaperScene, view: View, effect: Effect) -> Option<Traffic> {
    let (mrays, queries, megabytes): (NearFar, NearFar, NearFar) = match scene {
        PaperScene::City200 => (
            [[80.1, 127.0, 15.2], [23.6, 54.1, 16.6]],
            [[822.0, 13_600.0, 61_200.0], [2460.0, 42_900.0, 117_000.0]],
            [[0.0, 5.85, 383.0], [0.61, 0.11, 1.73]],
        ),
        PaperScene::Powerplant16 => (
            [[111.0, 179.0, 22.4], [7.68, 26.6, 1.60]],
            [[793.0, 13_200.0, 32_300.0], [3630.0, 61_700.0, 312_000.0]],
            [[0.11, 0.03, 0.55], [170.0, 43.6, 2310.0]],
        ),
        PaperScene::City10 | PaperScene::Powerplant => return None,
    };
    let at = |table: &NearFar| of(table, view, effect);
    Some(Traffic { mrays_per_s: at(&mrays), queries: at(&queries), megabytes: at(&megabytes) })
}

/// Thresholds of table 4, pixels of a tile of 200 x 200.
pub const THRESHOLDS: [u32; 4] = [0, 20, 100, 200];

/// Table 4: milliseconds of a frame of diffuse rays at [`THRESHOLDS`].
pub fn aggressive_ms(scene: PaperScene, view: View) -> Option<[f64; 4]> {
    match (scene, view) {
        (PaperScene::City200, View::Near) => Some([2720.0, 780.0, 738.0, 715.0]),
        (PaperScene::City200, View::Far) => Some([2492.0, 2019.0, 1751.0, 1611.0]),
        (PaperScene::Powerplant16, View::Near) => Some([1855.0, 1682.0, 1553.0, 1489.0]),
        (PaperScene::Powerplant16, View::Far) => Some([25975.0, 9651.0, 4727.0, 3578.0]),
        _ => None,
    }
}

/// Rotations of table 5, degrees.
pub const ROTATIONS: [u32; 4] = [0, 18, 36, 360];

/// Table 5: milliseconds of a frame at [`ROTATIONS`], near.
pub fn rotation_ms(scene: PaperScene, effect: Effect) -> Option<[f64; 4]> {
    match (scene, effect) {
        (PaperScene::City10, Effect::Ao) => Some([136.0, 145.0, 156.0, 193.0]),
        (PaperScene::Powerplant, Effect::Ao) => Some([153.0, 167.0, 175.0, 190.0]),
        (PaperScene::City10, Effect::Diffuse) => Some([228.0, 323.0, 384.0, 805.0]),
        (PaperScene::Powerplant, Effect::Diffuse) => Some([664.0, 1334.0, 1700.0, 4125.0]),
        _ => None,
    }
}
