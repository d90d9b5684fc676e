//! The paper's figures 5, 7 and 8 from the cells.

use super::cells::{Measured, Metric};
use super::plan::{CHC, Case, Effect, FRONTS, IN_CORE, SceneId, Stage, Variant, View};
use brickwalk_report::{Graph, GraphShape, Line, Unit};

/// Frames after each other: figure 7, in core.
pub fn frame_times(cases: &[Case], measured: &Measured) -> Vec<Graph> {
    let mut graphs = Vec::new();
    for scene in [SceneId::Pipes, SceneId::City] {
        for effect in [Effect::Ao, Effect::Primary] {
            let own = |variant: &Variant| {
                cases.iter().find(|case| {
                    let place = (case.stage, case.scene, case.view);
                    place == (Stage::Table2, scene, View::Near) && case.variant == *variant
                })
            };
            let line = |variant: &Variant| -> Option<Line> {
                Some((variant.to_string(), measured.frames(own(variant)?, effect, Metric::Wall)))
            };
            graphs.push(Graph {
                title: format!("Figure 7: {} rays, {}, near", effect.name(), scene.name()),
                reading: "Wall time of the pass, frame by frame, the median of the walks. In the paper CHC+RT stays below a traversal \
                          from the root, the more so where much is hidden."
                    .into(),
                shape: GraphShape::Lines {
                    across: "frame",
                    unit: Unit::Milliseconds,
                    lines: IN_CORE.iter().filter_map(line).collect(),
                },
            });
        }
    }
    graphs
}

/// Time a phase: figure 8.
pub fn phases(cases: &[Case], measured: &Measured) -> Vec<Graph> {
    let parts = [
        ("phase 1: known to be visible", Metric::Field("ms_phase1")),
        ("phase 2: queries", Metric::Field("ms_phase2")),
        ("phase 3: newly visible", Metric::Field("ms_phase3")),
        ("loading", Metric::Field("ms_stream")),
    ];
    let graph = |variant: Variant, effect: Effect| {
        let own = cases.iter().filter(|case| {
            matches!(case.stage, Stage::Table2 | Stage::Table3)
                && case.variant == variant
                && case.effects.contains(&effect)
        });
        let bar = |case: &Case| {
            let lengths: Option<Vec<f64>> =
                parts.iter().map(|&(_, metric)| measured.median(case, effect, metric)).collect();
            Some((format!("{}, {}, cache {} %", case.scene.name(), case.view.name(), case.cache), lengths?))
        };
        Graph {
            title: format!("Figure 8: {} rays by {variant}", effect.name()),
            reading: "Device time of each phase and wall time of loading, ms a frame. In the paper phase 1 dominates in core, and the \
                      share of phase 3 grows out of core."
                .into(),
            shape: GraphShape::Bars {
                unit: Unit::Milliseconds,
                parts: parts.iter().map(|part| part.0.to_string()).collect(),
                bars: own.filter_map(bar).collect(),
            },
        }
    };
    let effects = Effect::ALL.into_iter();
    effects.flat_map(|effect| [CHC, FRONTS].map(|variant| graph(variant, effect))).collect()
}

/// Figure 5: bricks that a tile meets along the walk, and time and queries by the size of tiles.
pub fn tiles(cases: &[Case], measured: &Measured, pixels: (u32, u32)) -> Vec<Graph> {
    let views = [View::Near, View::Far];
    let tiles = |edge: u32| f64::from(pixels.0.div_ceil(edge) * pixels.1.div_ceil(edge));
    let along = |view: View| -> Option<Line> {
        let case = cases.iter().find(|case| {
            (case.stage, case.scene, case.view) == (Stage::Table2, SceneId::City, view) && case.variant == CHC
        })?;
        let pairs = measured.frames(case, Effect::Primary, Metric::Field("pairs_intersected"));
        Some((view.name().into(), pairs.into_iter().map(|(frame, n)| (frame, n / tiles(case.tile))).collect()))
    };
    let by_size = |metric: Metric| -> Vec<Line> {
        let line = |&view: &View| {
            let own = cases.iter().filter(|case| case.stage == Stage::Figure5 && case.view == view);
            let point = |case: &Case| Some((f64::from(case.tile), measured.median(case, Effect::Primary, metric)?));
            (view.name().to_string(), own.filter_map(point).collect())
        };
        views.iter().map(line).collect()
    };
    vec![
        Graph {
            title: "Figure 5: bricks a tile".into(),
            reading: "Bricks that are intersected with a tile's primary rays, the mean of all tiles, city. The paper shows up to 24 \
                      subtrees a batch, more of them the farther away."
                .into(),
            shape: GraphShape::Lines {
                across: "frame",
                unit: Unit::Count,
                lines: views.into_iter().filter_map(along).collect(),
            },
        },
        Graph {
            title: "Time by the size of tiles".into(),
            reading: "Wall time of primary rays in core, city, chc.".into(),
            shape: GraphShape::Lines {
                across: "pixels of a tile's edge",
                unit: Unit::Milliseconds,
                lines: by_size(Metric::Wall),
            },
        },
        Graph {
            title: "Queries by the size of tiles".into(),
            reading: "Pairs of tile and node that were asked, a frame.".into(),
            shape: GraphShape::Lines {
                across: "pixels of a tile's edge",
                unit: Unit::Count,
                lines: by_size(Metric::Field("queries")),
            },
        },
    ]
}
