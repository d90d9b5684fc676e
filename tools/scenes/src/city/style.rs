//! Styles of buildings: what their walls are made of and how their facades are divided.

use crate::material::{Mat, Tint, WHITE, shade};
use crate::rng::Rng;

/// How the storeys above the ground floor look.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FacadeKind {
    /// Single windows in a wall.
    Punched,
    /// Large windows of many panes between piers.
    Loft,
    /// Bands of windows between bands of wall.
    Ribbon,
    /// Glass all over, divided by fins and floors.
    Curtain,
}

/// What the ground floor toward a street is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ground {
    /// Shop windows, signs, awnings.
    Shops,
    /// Windows and a door.
    Dwelling,
    /// A glazed lobby.
    Lobby,
}

/// What closes a building above.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RoofKind {
    /// Flat, with a parapet.
    Flat,
    /// A steep storey under a flat top, with dormers.
    Mansard,
    /// Two slopes.
    Gable,
}

/// A style. Lengths in metres.
#[derive(Clone, Debug)]
pub struct Style {
    /// Material of the walls.
    pub wall: Mat,
    /// Their tint.
    pub wall_tint: Tint,
    /// Material of ledges, sills and surrounds.
    pub trim: Mat,
    /// Its tint.
    pub trim_tint: Tint,
    /// Tint of window frames.
    pub frame_tint: Tint,
    /// Glass.
    pub glass: Mat,
    /// Upper storeys.
    pub kind: FacadeKind,
    /// Ground floor.
    pub ground: Ground,
    /// Roof.
    pub roof: RoofKind,
    /// Material of sloped roofs.
    pub roof_mat: Mat,
    /// Width of a bay.
    pub bay: f64,
    /// Width of a window.
    pub window_width: f64,
    /// From the floor to the sill.
    pub sill: f64,
    /// From the window's head to the ceiling.
    pub head: f64,
    /// How deep windows lie in the wall.
    pub recess: f64,
    /// Panes of a window, across and up.
    pub panes: [u32; 2],
    /// Height of a storey.
    pub floor: f64,
    /// Height of the ground floor.
    pub ground_floor: f64,
    /// A ledge at every floor, not at the first alone.
    pub ledges: bool,
    /// How far the cornice protrudes, 0 for none.
    pub cornice: f64,
    /// Frames of stone around windows.
    pub surrounds: bool,
    /// Shutters beside windows.
    pub shutters: Option<Tint>,
    /// Probability that a column of bays has balconies.
    pub balconies: f64,
    /// Balconies with parapets instead of railings.
    pub solid_balconies: bool,
}

/// Tints of plaster.
const PASTELS: [Tint; 10] = [
    [1.0, 0.97, 0.92],
    [1.0, 0.90, 0.68],
    [0.98, 0.80, 0.58],
    [0.93, 0.72, 0.60],
    [0.84, 0.88, 0.80],
    [0.80, 0.86, 0.93],
    [0.88, 0.87, 0.86],
    [0.96, 0.86, 0.78],
    [0.74, 0.72, 0.70],
    [0.95, 0.66, 0.48],
];
/// Tints of brick.
const BRICKS: [Tint; 6] =
    [[1.0, 1.0, 1.0], [0.85, 0.75, 0.72], [0.70, 0.66, 0.66], [1.0, 0.86, 0.72], [0.95, 1.0, 1.0], [0.62, 0.52, 0.52]];
/// Tints of window frames and doors.
pub const FRAMES: [Tint; 6] = [
    [0.95, 0.95, 0.93],
    [0.85, 0.82, 0.75],
    [0.06, 0.06, 0.065],
    [0.10, 0.16, 0.12],
    [0.25, 0.13, 0.08],
    [0.30, 0.33, 0.36],
];
/// Tints of shutters.
const SHUTTERS: [Tint; 4] = [[0.16, 0.30, 0.22], [0.20, 0.28, 0.42], [0.42, 0.20, 0.14], [0.55, 0.53, 0.48]];

impl Style {
    /// A random style for a row of houses; `density` as in [`super::layout::Cell`].
    pub fn row(rng: &mut Rng, density: f64) -> Self {
        match rng.unit() {
            x if x < 0.30 => Self::brick(rng),
            x if x < 0.62 => Self::plaster(rng),
            x if x < 0.74 => Self::stone(rng),
            x if x < 0.84 => Self::loft(rng),
            x if x < 0.84 + 0.10 * density => Self::curtain(rng),
            _ => Self::modern(rng),
        }
    }

    /// Brick with stone trim.
    pub fn brick(rng: &mut Rng) -> Self {
        let tan = rng.chance(0.3);
        Self {
            wall: if tan { Mat::TanBrick } else { Mat::Brick },
            wall_tint: shade(rng.pick(&BRICKS), rng.range(0.85, 1.0)),
            trim: Mat::Stone,
            trim_tint: shade(WHITE, rng.range(0.75, 1.0)),
            frame_tint: rng.pick(&FRAMES),
            glass: Mat::Glass,
            kind: FacadeKind::Punched,
            ground: if rng.chance(0.6) { Ground::Shops } else { Ground::Dwelling },
            roof: RoofKind::Flat,
            roof_mat: Mat::Slate,
            bay: rng.range(2.6, 3.4),
            window_width: rng.range(1.05, 1.35),
            sill: rng.range(0.75, 0.95),
            head: rng.range(0.4, 0.55),
            recess: 0.18,
            panes: rng.pick(&[[1, 2], [2, 2], [1, 2]]),
            floor: rng.range(3.1, 3.5),
            ground_floor: rng.range(3.9, 4.5),
            ledges: rng.chance(0.3),
            cornice: rng.range(0.35, 0.6),
            surrounds: rng.chance(0.4),
            shutters: None,
            balconies: 0.0,
            solid_balconies: false,
        }
    }

    /// Plaster in a light colour, often with balconies, shutters and a steep roof.
    pub fn plaster(rng: &mut Rng) -> Self {
        let shutters = rng.chance(0.3).then(|| rng.pick(&SHUTTERS));
        Self {
            wall: Mat::Plaster,
            wall_tint: shade(rng.pick(&PASTELS), rng.range(0.82, 1.0)),
            trim: Mat::Plaster,
            trim_tint: shade(WHITE, rng.range(0.85, 1.0)),
            frame_tint: rng.pick(&FRAMES[..2]),
            kind: FacadeKind::Punched,
            ground: if rng.chance(0.5) { Ground::Shops } else { Ground::Dwelling },
            roof: if rng.chance(0.55) { RoofKind::Mansard } else { rng.pick(&[RoofKind::Gable, RoofKind::Flat]) },
            roof_mat: rng.pick(&[Mat::Slate, Mat::Tile, Mat::Tile]),
            bay: rng.range(2.7, 3.5),
            window_width: rng.range(1.0, 1.25),
            sill: if rng.chance(0.3) { 0.25 } else { rng.range(0.7, 0.9) },
            recess: 0.22,
            panes: [2, 2],
            ledges: rng.chance(0.25),
            cornice: rng.range(0.3, 0.5),
            surrounds: shutters.is_none() && rng.chance(0.7),
            shutters,
            balconies: if rng.chance(0.6) { 0.4 } else { 0.0 },
            ..Self::brick(rng)
        }
    }

    /// Limestone with strong ledges.
    pub fn stone(rng: &mut Rng) -> Self {
        Self {
            wall: Mat::Stone,
            wall_tint: shade([1.0, 0.97, 0.92], rng.range(0.8, 1.0)),
            trim: Mat::Stone,
            ground: rng.pick(&[Ground::Shops, Ground::Lobby]),
            roof: rng.pick(&[RoofKind::Mansard, RoofKind::Flat]),
            window_width: rng.range(1.15, 1.5),
            recess: 0.28,
            panes: [2, 2],
            ledges: true,
            cornice: rng.range(0.5, 0.75),
            surrounds: true,
            balconies: if rng.chance(0.4) { 0.3 } else { 0.0 },
            ..Self::brick(rng)
        }
    }

    /// A converted factory.
    pub fn loft(rng: &mut Rng) -> Self {
        Self {
            frame_tint: rng.pick(&FRAMES[2..4]),
            kind: FacadeKind::Loft,
            bay: rng.range(3.4, 4.4),
            sill: 0.8,
            head: 0.5,
            recess: 0.25,
            panes: [4, 3],
            floor: rng.range(3.6, 4.1),
            ledges: rng.chance(0.5),
            surrounds: false,
            ..Self::brick(rng)
        }
    }

    /// Concrete or plain plaster, bands or large windows, balconies with parapets.
    pub fn modern(rng: &mut Rng) -> Self {
        let concrete = rng.chance(0.5);
        let ribbon = rng.chance(0.45);
        Self {
            wall: if concrete { Mat::Concrete } else { Mat::Plaster },
            wall_tint: if concrete { shade(WHITE, rng.range(0.75, 1.0)) } else { shade(rng.pick(&PASTELS), 0.95) },
            trim: Mat::Concrete,
            frame_tint: rng.pick(&FRAMES[2..]),
            kind: if ribbon { FacadeKind::Ribbon } else { FacadeKind::Punched },
            ground: rng.pick(&[Ground::Shops, Ground::Lobby, Ground::Dwelling]),
            bay: if ribbon { rng.range(1.4, 1.9) } else { rng.range(3.0, 3.8) },
            window_width: rng.range(1.7, 2.3),
            sill: if ribbon { 0.95 } else { rng.range(0.3, 0.9) },
            head: 0.4,
            recess: 0.15,
            panes: [2, 1],
            floor: rng.range(2.95, 3.3),
            ledges: rng.chance(0.3),
            cornice: 0.0,
            surrounds: false,
            balconies: if ribbon { 0.0 } else { 0.5 },
            solid_balconies: rng.chance(0.5),
            ..Self::brick(rng)
        }
    }

    /// Glass all over.
    pub fn curtain(rng: &mut Rng) -> Self {
        Self {
            wall: Mat::Metal,
            wall_tint: shade(rng.pick(&[WHITE, [0.45, 0.47, 0.5], [0.75, 0.72, 0.66]]), 0.9),
            trim: Mat::Metal,
            trim_tint: shade(WHITE, rng.range(0.4, 1.0)),
            frame_tint: rng.pick(&[[0.08, 0.085, 0.09], [0.6, 0.61, 0.62], [0.3, 0.31, 0.33]]),
            glass: rng.pick(&[Mat::TowerGlass, Mat::TowerGlass, Mat::Glass]),
            kind: FacadeKind::Curtain,
            ground: Ground::Lobby,
            bay: rng.range(1.7, 2.4),
            sill: 0.7,
            head: 0.3,
            recess: 0.06,
            floor: rng.range(3.5, 3.9),
            ground_floor: rng.range(4.6, 5.6),
            ledges: false,
            cornice: 0.0,
            ..Self::brick(rng)
        }
    }

    /// A tower: glass, bands or a grid of stone.
    pub fn tower(rng: &mut Rng) -> Self {
        let base = match rng.int(0, 3) {
            0 | 1 => Self::curtain(rng),
            2 => Self { kind: FacadeKind::Ribbon, bay: rng.range(1.8, 2.4), ..Self::modern(rng) },
            _ => Self { kind: FacadeKind::Ribbon, bay: rng.range(2.0, 2.6), sill: 1.2, ..Self::stone(rng) },
        };
        Self { ground: Ground::Lobby, roof: RoofKind::Flat, ground_floor: 5.2, shutters: None, ..base }
    }

    /// A detached house.
    pub fn house(rng: &mut Rng) -> Self {
        let base = if rng.chance(0.6) { Self::plaster(rng) } else { Self::brick(rng) };
        Self {
            ground: Ground::Dwelling,
            roof: RoofKind::Gable,
            roof_mat: rng.pick(&[Mat::Tile, Mat::Tile, Mat::Slate]),
            floor: 2.8,
            ground_floor: 3.0,
            balconies: 0.0,
            cornice: 0.0,
            ledges: false,
            ..base
        }
    }
}
