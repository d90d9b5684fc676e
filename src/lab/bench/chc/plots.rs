//! The paper's figures 5, 7 and 8 from the cells.

use super::cells::{Measured, Metric, Pass, WALL};
use super::paper::EFFECTS;
use super::plan::{CHC, FRONTS, IN_CORE, Stage, Variant};
use crate::lab::bench::results::plot;
use crate::lab::bench::scenes::{SceneId, View};
use crate::settings::Effect;
use brickwalk_report::{Graph, GraphShape, Line, Unit};

/// Frames after each other: figure 7, in core.
pub fn frame_times(measured: &Measured) -> Vec<Graph> {
    let graph = |scene: SceneId, effect: Effect| {
        let line =
            |variant: &Variant| (variant.to_string(), in_core(measured, scene, View::Near, effect, variant, WALL));
        let reading = "Wall time of the pass, frame by frame, the median of the walks. In the paper CHC+RT stays below \
                       a traversal from the root, the more so where much is hidden.";
        let title = format!("Figure 7: {effect} rays, {scene}, near");
        plot(title, reading, "frame", Unit::Milliseconds, IN_CORE.iter().map(line).collect())
    };
    let scenes = [SceneId::Pipes, SceneId::City].into_iter();
    scenes.flat_map(|scene| [Effect::Ao, Effect::Primary].map(|effect| graph(scene, effect))).collect()
}

/// A quantity of a pass of table 2, frame by frame.
fn in_core(
    measured: &Measured,
    scene: SceneId,
    view: View,
    effect: Effect,
    variant: &Variant,
    metric: Metric,
) -> Vec<(f64, f64)> {
    let of = |pass: &Pass| (pass.case.stage, pass.case.scene, pass.case.view, pass.effect);
    let found = measured
        .passes()
        .find(|pass| of(pass) == (Stage::Table2, scene, view, effect) && pass.case.variant == *variant);
    found.map_or_else(Vec::new, |pass| pass.by_frame(metric))
}

/// Time a phase: figure 8.
pub fn phases(measured: &Measured) -> Vec<Graph> {
    let parts = [
        ("phase 1: known to be visible", "ms_phase1"),
        ("phase 2: queries", "ms_phase2"),
        ("phase 3: newly visible", "ms_phase3"),
        ("loading", "ms_stream"),
    ];
    let graph = |variant: Variant, effect: Effect| {
        let is_own = |pass: &Pass| {
            let is_in = matches!(pass.case.stage, Stage::Table2 | Stage::Table3);
            is_in && pass.case.variant == variant && pass.effect == effect
        };
        let bar = |pass: Pass| {
            let lengths: Option<Vec<f64>> = parts.iter().map(|part| pass.median(Metric::Field(part.1))).collect();
            Some((format!("{}, {}, cache {} %", pass.case.scene, pass.case.view, pass.case.cache), lengths?))
        };
        Graph {
            title: format!("Figure 8: {effect} rays by {variant}"),
            reading: "Device time of each phase and wall time of loading, ms a frame. In the paper phase 1 dominates \
                      in core, and the share of phase 3 grows out of core."
                .into(),
            shape: GraphShape::Bars {
                unit: Unit::Milliseconds,
                parts: parts.iter().map(|part| part.0.to_string()).collect(),
                bars: measured.passes().filter(is_own).filter_map(bar).collect(),
            },
        }
    };
    EFFECTS.iter().flat_map(|&effect| [CHC, FRONTS].map(|variant| graph(variant, effect))).collect()
}

/// Figure 5: bricks that a tile meets along the walk, and time and queries by the size of tiles.
pub fn tiles(measured: &Measured, (width, height): (u32, u32), tile: u32) -> Vec<Graph> {
    let tiles = f64::from(width.div_ceil(tile) * height.div_ceil(tile));
    let along = |view: &View| {
        let pairs = Metric::Field("pairs_intersected");
        let pairs = in_core(measured, SceneId::City, *view, Effect::Primary, &CHC, pairs);
        (view.to_string(), pairs.into_iter().map(|(frame, n)| (frame, n / tiles)).collect())
    };
    let by_size = |metric: Metric| -> Vec<Line> {
        let line = |&view: &View| {
            let own = measured.passes().filter(|pass| pass.case.stage == Stage::Figure5 && pass.case.view == view);
            let point = |pass: Pass| Some((f64::from(pass.case.tile), pass.median(metric)?));
            (view.to_string(), own.filter_map(point).collect())
        };
        View::ALL.iter().map(line).collect()
    };
    let edge = "pixels of a tile's edge";
    let queries = Metric::Field("queries");
    vec![
        plot(
            "Figure 5: bricks a tile".into(),
            "Bricks that are intersected with a tile's primary rays, the mean of all tiles, city. The paper shows up \
             to 24 subtrees a batch, more of them the farther away.",
            "frame",
            Unit::Count,
            View::ALL.iter().map(along).collect(),
        ),
        plot(
            "Time by the size of tiles".into(),
            "Wall time of primary rays in core, city, chc.",
            edge,
            Unit::Milliseconds,
            by_size(WALL),
        ),
        plot(
            "Queries by the size of tiles".into(),
            "Pairs of tile and node that were asked, a frame.",
            edge,
            Unit::Count,
            by_size(queries),
        ),
    ]
}
