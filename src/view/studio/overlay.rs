//! What is painted over a picture: what the engine did for each pixel.

use super::boxes::Boxes;
use super::steps::Steps;
use crate::frame::{Answered, PixelState};
use crate::picture::heat;
use crate::scene::Camera;
use crate::settings::names;
use std::collections::HashSet;

names! {
    /// What is painted over the picture.
    Overlay {
        /// Nothing.
        None = "none",
        /// Which pixels are exact, bounded, unresolved.
        State = "state",
        /// The bricks that were hit, each in a colour of its own.
        Bricks = "bricks",
        /// Bricks that were hit: in the cache, or not.
        Residency = "residency",
        /// Bricks that a camera which was left behind shows, and others.
        Frozen = "frozen",
        /// Distances.
        Depth = "depth",
        /// Normals.
        Normals = "normals",
        /// The tiles that queries are made for.
        Tiles = "tiles",
        /// How many bricks the rays of each tile enter: its visible query pairs.
        Queries = "queries",
        /// The front of the tile in the middle, or of the camera that was left behind: boxes of nodes that its rays
        /// enter, and of those that none enters.
        Fronts = "fronts",
        /// How many nodes each pixel's ray visits, of the top level and of bricks in the cache.
        Steps = "steps",
        /// Who answered the secondary rays of each pixel: tracing, or a method.
        Methods = "methods",
    }
}

/// Weight of the overlay's colour.
const WEIGHT: f32 = 0.55;

/// What an overlay may show of a picture's pixels.
pub struct Pixels<'a> {
    /// Width and height in pixels, and the edge of a tile.
    pub size: (u32, u32),
    /// Edge of a tile in pixels.
    pub tile: u32,
    /// How exact they are; empty: all are.
    pub states: &'a [PixelState],
    /// Distances.
    pub depth: &'a [f32],
    /// Normals.
    pub normals: &'a [[f32; 3]],
    /// The bricks that were hit, and whether they are in the cache.
    pub bricks: &'a [Option<(u32, bool)>],
    /// The bricks of the camera that was left behind.
    pub frozen: &'a HashSet<u32>,
    /// The camera.
    pub camera: &'a Camera,
    /// What rays meet of the trees; `None`: not known.
    pub steps: Option<&'a Steps>,
    /// The front that [`Overlay::Fronts`] shows; `None`: none.
    pub front: Option<&'a Boxes>,
    /// Who answered secondary rays; empty: not known.
    pub answers: &'a [Answered],
}

/// Colours of rays that were traced, and of those that a method answered.
const METHODS: [[u8; 3]; 2] = [[70, 130, 230], [235, 170, 40]];

/// Colours of the states.
pub const STATES: [[u8; 3]; 3] = [[60, 170, 90], [235, 170, 40], [215, 60, 60]];

/// The greatest count, at least 1.
fn most_of(counts: &[u32]) -> f32 {
    counts.iter().copied().max().unwrap_or(0).max(1) as f32
}

/// A colour for a number, far from those of its neighbours.
pub fn color_of(number: u32) -> [u8; 3] {
    // The golden angle around the circle of hues, with two levels of light.
    let hue = (f64::from(number) * 0.618_033_988_75).fract() * 6.0;
    let light = if number.is_multiple_of(2) { 230.0 } else { 170.0 };
    let of = |offset: f64| {
        let x = (hue + offset) % 6.0;
        let share = (2.0 - (x - 3.0).abs()).clamp(0.0, 1.0);
        (light * (0.25 + 0.75 * (1.0 - share))) as u8
    };
    [of(0.0), of(2.0), of(4.0)]
}

impl Overlay {
    /// What its colours say of a picture.
    pub fn legend(self, pixels: &Pixels) -> String {
        let most = |of: fn(&Steps) -> &Vec<u32>| pixels.steps.and_then(|steps| of(steps).iter().max()).unwrap_or(&0);
        match self {
            Self::None | Self::Tiles => String::new(),
            Self::State => "green: exact, amber: bounded, red: unresolved".into(),
            Self::Bricks => "a colour for each brick".into(),
            Self::Residency => "green: in the cache, red: not any more".into(),
            Self::Frozen => "green: bricks of the camera that was left behind, red: others".into(),
            Self::Depth => "white: near, black: far".into(),
            Self::Normals => "red, green, blue: x, y, z".into(),
            Self::Queries => {
                format!("black: 0, white: {} bricks that rays of a tile enter", most(|steps| &steps.bricks))
            }
            Self::Fronts => pixels.front.map_or(String::new(), Boxes::legend),
            Self::Steps => {
                format!("black: 0, white: {} nodes, of the top level and of bricks", most(|steps| &steps.nodes))
            }
            Self::Methods => "blue: secondary rays were traced, amber: a method answered them".into(),
        }
    }

    /// Whether it shows bricks.
    pub fn shows_bricks(self) -> bool {
        matches!(self, Self::Bricks | Self::Residency | Self::Frozen)
    }

    /// Paints it over `picture`.
    pub fn paint(self, pixels: &Pixels, picture: &mut [[u8; 3]]) {
        if self == Self::None {
            return;
        }
        if let Some(front) = pixels.front.filter(|_| self == Self::Fronts) {
            front.paint(pixels.camera, pixels.size, pixels.depth, picture);
            return;
        }
        let counts: Option<&[u32]> = pixels.steps.map(|steps| match self {
            Self::Queries => &steps.bricks[..],
            _ => &steps.nodes[..],
        });
        let most = counts.map_or(1.0, most_of);
        let greatest = pixels.depth.iter().copied().filter(|depth| depth.is_finite()).fold(0.0, f32::max);
        for (index, shown) in picture.iter_mut().enumerate() {
            let own = match self {
                Self::None | Self::Fronts => None,
                Self::State => Some(STATES[pixels.states.get(index).copied().unwrap_or_default() as usize]),
                Self::Bricks => pixels.bricks.get(index).copied().flatten().map(|(brick, _)| color_of(brick)),
                Self::Residency => {
                    let hit = pixels.bricks.get(index).copied().flatten();
                    hit.map(|(_, is_resident)| STATES[if is_resident { 0 } else { 2 }])
                }
                Self::Frozen => {
                    let hit = pixels.bricks.get(index).copied().flatten();
                    hit.map(|(brick, _)| STATES[if pixels.frozen.contains(&brick) { 0 } else { 2 }])
                }
                Self::Depth => pixels.depth.get(index).filter(|depth| depth.is_finite()).map(|depth| {
                    // Near is light; equal ratios are equal steps.
                    let share = (1.0 + 1000.0 * depth / greatest.max(f32::MIN_POSITIVE)).log2() / 1001f32.log2();
                    [(255.0 * (1.0 - share)) as u8; 3]
                }),
                Self::Normals => {
                    pixels.normals.get(index).map(|normal| normal.map(|x| (127.5 + 127.5 * x.clamp(-1.0, 1.0)) as u8))
                }
                Self::Tiles => {
                    let (x, y) = (index as u32 % pixels.size.0, index as u32 / pixels.size.0);
                    let is_edge = x.is_multiple_of(pixels.tile) || y.is_multiple_of(pixels.tile);
                    is_edge.then_some([255; 3])
                }
                Self::Queries | Self::Steps => {
                    counts.and_then(|counts| counts.get(index)).map(|&count| heat(count as f32 / most))
                }
                Self::Methods => pixels.answers.get(index).and_then(|&Answered { traced, by_method }| {
                    let all = (traced + by_method) as f32;
                    let mix = |k: usize| {
                        let [traced_color, method_color] = METHODS.map(|color| f32::from(color[k]));
                        (traced_color * traced as f32 + method_color * by_method as f32) / all
                    };
                    (all > 0.0).then(|| std::array::from_fn(|k| mix(k) as u8))
                }),
            };
            let weight =
                if matches!(self, Self::Depth | Self::Normals | Self::Queries | Self::Steps) { 1.0 } else { WEIGHT };
            if let Some(own) = own {
                *shown = std::array::from_fn(|k| {
                    (f32::from(shown[k]) * (1.0 - weight) + f32::from(own[k]) * weight).round() as u8
                });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn each_overlay_shows_what_it_is_about() {
        let pixels = Pixels {
            size: (2, 2),
            tile: 2,
            states: &[PixelState::Exact, PixelState::Bounded, PixelState::Unresolved, PixelState::Exact],
            depth: &[1.0, 1.0, f32::INFINITY, 100.0],
            normals: &[[0.0, 1.0, 0.0]; 4],
            bricks: &[Some((3, true)), Some((3, true)), None, Some((4, false))],
            frozen: &HashSet::from([4]),
            camera: &Camera { position: DVec3::ZERO, target: DVec3::NEG_Z, up: DVec3::Y, fov_y: 1.0 },
            steps: Some(&Steps { nodes: vec![0, 5, 10, 10], bricks: vec![3, 3, 1, 1] }),
            front: Some(&Boxes { tile: Some(([0, 0], 1)), ..Boxes::default() }),
            answers: &[(1, 0), (0, 2), (0, 0), (1, 1)].map(|(traced, by_method)| Answered { traced, by_method }),
        };
        let shown = |overlay: Overlay| {
            let mut picture = vec![[100; 3]; 4];
            overlay.paint(&pixels, &mut picture);
            picture
        };
        assert_eq!(shown(Overlay::None), [[100; 3]; 4]);
        let states = shown(Overlay::State);
        assert!(states[0] == states[3] && states[0] != states[1] && states[1] != states[2]);
        let bricks = shown(Overlay::Bricks);
        assert!(bricks[0] == bricks[1] && bricks[2] == [100; 3] && bricks[3] != bricks[0]);
        let residency = shown(Overlay::Residency);
        assert!(residency[0] == residency[1] && residency[2] == [100; 3] && residency[3] != residency[0]);
        let frozen = shown(Overlay::Frozen);
        assert!(frozen[3] == residency[0] && frozen[0] == residency[3] && frozen[2] == [100; 3]);
        let depth = shown(Overlay::Depth);
        assert!(depth[0] == depth[1] && depth[0][0] > depth[3][0] && depth[2] == [100; 3]);
        assert_eq!(shown(Overlay::Normals)[0], [127, 255, 127]);
        let steps = shown(Overlay::Steps);
        assert!(steps[0] == [0; 3] && steps[2] == [255; 3] && steps[3] == steps[2] && steps[1] != steps[2]);
        assert!(Overlay::Steps.legend(&pixels).contains("white: 10 nodes"));
        let queries = shown(Overlay::Queries);
        assert!(queries[0] == [255; 3] && queries[0] == queries[1] && queries[2] == queries[3]);
        let fronts = shown(Overlay::Fronts);
        assert!(fronts[0] != [100; 3] && fronts[1..] == [[100; 3]; 3]);
        let methods = shown(Overlay::Methods);
        assert!(methods[0] != [100; 3] && methods[1] != methods[0] && methods[2] == [100; 3]);
        assert!(methods[3] != methods[0] && methods[3] != methods[1]);
        let tiles = shown(Overlay::Tiles);
        assert!(tiles[0] != [100; 3] && tiles[1] != [100; 3] && tiles[3] == [100; 3]);
    }

    #[test]
    fn neighbours_have_other_colours() {
        for number in 0..100u32 {
            let [a, b] = [number, number + 1].map(color_of);
            let apart: i32 = (0..3).map(|k| (i32::from(a[k]) - i32::from(b[k])).abs()).sum();
            assert!(apart > 60, "{number}: {a:?} {b:?}");
        }
    }
}
