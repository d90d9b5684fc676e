//! The tables: every number is recomputed from the cells, and each ratio that the paper has, too, stands beside the
//! paper's.

use super::cells::{Measured, Metric, Metric::Device, Pass, WALL};
use super::paper::{self, PaperScene, ROTATIONS, THRESHOLDS};
use super::plan::{Case, FRONTS, PLAIN, PLAIN_BVH2, SECONDARY, Stage, Variant, apart, paper_cache, target_cache};
use crate::lab::bench::results::{Column, table};
use crate::lab::bench::scenes::{SceneId, View};
use brickwalk_report::{Section, Table, Value};

/// All tables that have a row.
pub fn all(measured: &Measured) -> Vec<Section> {
    let of = |stage| measured.passes().filter(move |pass| pass.case.stage == stage);
    let tables = [
        ("Table 2: in core", table("table2", TABLE2, of(Stage::Table2), &table2())),
        ("Table 3: out of core", table("table3", TABLE3, of(Stage::Table3), &table3())),
        ("Table 4: aggressive culling", table("table4", TABLE4, of(Stage::Table4), &table4())),
        ("Table 5: random turns", table("table5", TABLE5, of(Stage::Table5), &table5())),
        ("Sizes of tiles", table("figure5", FIGURE5, of(Stage::Figure5), &figure5())),
        ("Moved against needed", table("targets", TARGETS, of(Stage::Targets), &targets())),
        ("Cost of scene size", scale(measured)),
    ];
    let section =
        |(title, table): (&str, Table)| Section { title: title.into(), tables: vec![table], ..Section::default() };
    tables.into_iter().filter(|(_, table)| !table.rows.is_empty()).map(section).collect()
}

fn scene(pass: &Pass) -> Value {
    pass.case.scene.name().into()
}

fn cache(pass: &Pass) -> Value {
    format!("{} %", pass.case.cache).into()
}

fn path(pass: &Pass) -> Value {
    pass.case.view.name().into()
}

fn rays(pass: &Pass) -> Value {
    pass.effect.name().into()
}

fn schedule(pass: &Pass) -> Value {
    pass.case.variant.to_string().into()
}

fn wall(pass: &Pass) -> Value {
    Value::number(pass.median(WALL))
}

fn device(pass: &Pass) -> Value {
    Value::number(pass.median(Device))
}

fn field(pass: &Pass, name: &'static str) -> Value {
    Value::number(pass.median(Metric::Field(name)))
}

fn megabytes(pass: &Pass, name: &'static str) -> Option<f64> {
    pass.median(Metric::Field(name)).map(|bytes| bytes * MEGA)
}

const MEGA: f64 = 1e-6;

fn with(case: &Case, variant: Variant) -> Case {
    Case { variant, ..*case }
}

/// How much faster than by a baseline.
fn over(pass: &Pass, baseline: Variant, metric: Metric) -> Value {
    let baseline = with(pass.case, baseline);
    Value::ratio(pass.under(&baseline, metric).filter(|_| baseline != *pass.case))
}

/// What the paper has of a scene.
fn of_paper<T>(pass: &Pass, value: impl Fn(PaperScene) -> Option<T>) -> Option<T> {
    paper::scene(pass.case.scene).and_then(value)
}

const TABLE2: &str = "In core. Medians of milliseconds per frame and pass: wall time, as in the paper, and device time \
                      of the three phases. A speed-up above 1 is faster. The paper's is over a binary tree traversed \
                      from its root: compare it with ours over plain-bvh2.";

fn table2<'a>() -> [Column<Pass<'a>>; 11] {
    /// The paper's numbers do not concern the baselines.
    fn is_ours(pass: &Pass) -> bool {
        ![PLAIN, PLAIN_BVH2].contains(&pass.case.variant)
    }
    [
        ("scene", scene),
        ("path", path),
        ("rays", rays),
        ("schedule", schedule),
        ("wall ms", wall),
        ("device ms", device),
        ("speed-up over plain, wall", |pass| over(pass, PLAIN, WALL)),
        ("speed-up over plain-bvh2, wall", |pass| over(pass, PLAIN_BVH2, WALL)),
        ("paper", |pass| {
            let speed_up = of_paper(pass, |scene| paper::at(&scene.speed_up?, pass.case.view, pass.effect));
            Value::ratio(speed_up.filter(|_| is_ours(pass)))
        }),
        ("speed-up over plain, device", |pass| over(pass, PLAIN, Device)),
        ("speed-up over plain-bvh2, device", |pass| over(pass, PLAIN_BVH2, Device)),
    ]
}

const TABLE3: &str = "Out of core, with the paper's share of the cache. Per frame, without the first frames. Far ÷ \
                      near is a ratio of wall times. The paper's MB include attributes.";

fn table3<'a>() -> [Column<Pass<'a>>; 16] {
    fn traffic(pass: &Pass, which: usize) -> Value {
        Value::number(of_paper(pass, |scene| paper::at(&scene.traffic?[which], pass.case.view, pass.effect)))
    }
    fn far(pass: &Pass, ratio: impl Fn() -> Option<f64>) -> Value {
        Value::ratio((pass.case.view == View::Far).then(ratio).flatten())
    }
    [
        ("scene", scene),
        ("cache", cache),
        ("path", path),
        ("rays", rays),
        ("schedule", schedule),
        ("wall ms", wall),
        ("far ÷ near", |pass| far(pass, || pass.over(&Case { view: View::Near, ..*pass.case }, WALL))),
        ("paper: far ÷ near", |pass| {
            let ms = |view| of_paper(pass, |scene| paper::at(&scene.ms, view, pass.effect));
            far(pass, || Some(ms(View::Far)? / ms(View::Near)?))
        }),
        ("Mray/s", |pass| {
            let rays = pass.median(Metric::Field("rays_traced")).zip(pass.median(WALL));
            Value::number(rays.map(|(rays, ms)| rays / ms * 1e-3))
        }),
        ("paper: Mray/s", |pass| traffic(pass, 0)),
        ("queries", |pass| field(pass, "queries")),
        ("paper: queries", |pass| traffic(pass, 1)),
        ("MB moved", |pass| {
            let all = ["bytes_bvh", "bytes_geometry", "bytes_attributes"].map(|name| pass.median(Metric::Field(name)));
            Value::Number(all.into_iter().flatten().sum::<f64>() * MEGA)
        }),
        ("paper: MB moved", |pass| traffic(pass, 2)),
        ("of which BVH", |pass| Value::number(megabytes(pass, "bytes_bvh"))),
        ("of which triangles", |pass| Value::number(megabytes(pass, "bytes_geometry"))),
    ]
}

const TABLE4: &str = "Aggressive culling of diffuse rays out of core: bricks that at most so many rays of a tile of \
                      200 x 200 pixels could see are skipped. A speed-up above 1 is faster. Errors are in levels of \
                      255 against threshold 0, over five frames that begin with an empty cache; the paper states a \
                      mean of 9.04 for 20 pixels in one picture.";

fn table4<'a>() -> [Column<Pass<'a>>; 8] {
    [
        ("scene", scene),
        ("path", path),
        ("threshold", |pass| pass.case.variant.threshold.to_string().into()),
        ("wall ms", wall),
        ("speed-up over threshold 0", |pass| {
            let exact = with(pass.case, Variant { threshold: 0, ..pass.case.variant });
            Value::ratio(pass.under(&exact, WALL))
        }),
        ("paper", |pass| {
            let at = THRESHOLDS.iter().position(|&threshold| threshold == pass.case.variant.threshold);
            let ms = of_paper(pass, |scene| Some(scene.aggressive_ms?[pass.case.view as usize]));
            Value::ratio(ms.zip(at).map(|(ms, at)| ms[0] / ms[at]))
        }),
        ("mean absolute error", |pass| Value::number(pass.error().map(|error| error.mean))),
        ("mean of the worst tile", |pass| Value::number(pass.error().map(|error| error.worst_tile))),
    ]
}

const TABLE5: &str = "Random turn of a pixel's rays about the normal, up to so many degrees; in core, near. Slowdowns \
    are over no turn; above 1 is slower.";

fn table5<'a>() -> [Column<Pass<'a>>; 9] {
    fn slower(pass: &Pass, metric: Metric) -> Value {
        Value::ratio(pass.over(&with(pass.case, Variant { rotation: 0, ..pass.case.variant }), metric))
    }
    [
        ("scene", scene),
        ("rays", rays),
        ("schedule", schedule),
        ("turn", |pass| format!("{}°", pass.case.variant.rotation).into()),
        ("wall ms", wall),
        ("device ms", device),
        ("slowdown, wall", |pass| slower(pass, WALL)),
        ("slowdown, device", |pass| slower(pass, Device)),
        ("paper", |pass| {
            let at = ROTATIONS.iter().position(|&rotation| rotation == pass.case.variant.rotation);
            let rays = SECONDARY.iter().position(|&effect| effect == pass.effect);
            let ms = of_paper(pass, |scene| Some(scene.rotation_ms?[rays?]));
            Value::ratio(ms.zip(at).map(|(ms, at)| ms[at] / ms[0]))
        }),
    ]
}

const FIGURE5: &str = "Primary rays in core by tile size. The paper found tiles of 200 pixels best on its hardware.";

fn figure5<'a>() -> [Column<Pass<'a>>; 7] {
    [
        ("scene", scene),
        ("path", path),
        ("tile", |pass| pass.case.tile.to_string().into()),
        ("wall ms", wall),
        ("device ms", device),
        ("queries", |pass| field(pass, "queries")),
        ("pairs of tile and brick", |pass| field(pass, "pairs_intersected")),
    ]
}

const TARGETS: &str = "BVH and triangles, near. Cold: moved ÷ needed in the first frame, which begins with an empty \
                       cache. Steady: moved ÷ missing in all others. 1 is optimal.";

fn targets<'a>() -> [Column<Pass<'a>>; 8] {
    /// Of the first frame, or of the others.
    fn moved(pass: &Pass, part: usize) -> f64 {
        pass.first_and_rest("bytes_bvh")[part] + pass.first_and_rest("bytes_geometry")[part]
    }
    fn over_missing(pass: &Pass, part: usize) -> Value {
        let missing = pass.first_and_rest("bytes_needed_missing")[part];
        Value::ratio((missing > 0.0).then(|| moved(pass, part) / missing))
    }
    [
        ("scene", scene),
        ("cache", cache),
        ("rays", rays),
        ("schedule", schedule),
        ("cold: MB moved", |pass| Value::Number(moved(pass, 0) * MEGA)),
        ("cold: moved ÷ needed", |pass| over_missing(pass, 0)),
        ("steady: MB moved", |pass| Value::Number(moved(pass, 1) * MEGA)),
        ("steady: moved ÷ missing", |pass| over_missing(pass, 1)),
    ]
}

const SCALE: &str = "Time of the larger scene ÷ time of the smaller one, not interleaved. Both in core, or out of core \
                     ÷ in core, as in the paper.";

/// What the size of a scene costs: ratios between scenes, which no walks interleave.
fn scale(measured: &Measured) -> Table {
    let mut pairs: Vec<(Pass, Case)> = Vec::new();
    for small in measured.passes().filter(|pass| pass.case.stage == Stage::Table2) {
        let large = match small.case.scene {
            SceneId::City => SceneId::CityLarge,
            SceneId::Pipes => SceneId::Pipes16,
            _ => continue,
        };
        let alone = apart().find(|effects| effects.contains(&small.effect)).unwrap_or_default();
        for (stage, cache, effects) in [
            (Stage::Scale, 100, small.case.effects),
            (Stage::Table3, paper_cache(large), alone),
            (Stage::Targets, target_cache(large), alone),
        ] {
            let variant = Variant { needed: stage == Stage::Targets, ..small.case.variant };
            let other = Case { stage, scene: large, cache, effects, variant, ..*small.case };
            if measured.cases.contains(&other) && small.under(&other, WALL).is_some() {
                pairs.push((small, other));
            }
        }
    }
    let columns: [Column<(Pass, Case)>; 8] = [
        ("larger", |(_, large)| format!("{}, cache {} %", large.scene, large.cache).into()),
        ("smaller", |(small, _)| format!("{}, cache 100 %", small.case.scene).into()),
        ("path", |(small, _)| path(small)),
        ("rays", |(small, _)| rays(small)),
        ("schedule", |(small, _)| schedule(small)),
        ("wall", |(small, large)| Value::ratio(small.under(large, WALL))),
        ("device", |(small, large)| Value::ratio(small.under(large, Device))),
        ("paper, wall", |(small, large)| {
            let ms = |scene| paper::at(&paper::scene(scene)?.ms, small.case.view, small.effect);
            let is_paper = large.stage == Stage::Table3 && small.case.variant == FRONTS;
            Value::ratio(ms(large.scene).zip(ms(small.case.scene)).map(|(a, b)| a / b).filter(|_| is_paper))
        }),
    ];
    table("scale", SCALE, pairs, &columns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::bench::published::{heads, published};

    #[test]
    fn pages_leave_out_no_column() {
        let all = [
            ("table2", heads(&table2())),
            ("table3", heads(&table3())),
            ("table4", heads(&table4())),
            ("table5", heads(&table5())),
            ("figure5", heads(&figure5())),
            ("targets", heads(&targets())),
        ];
        let found = published("chc", &all);
        assert!(["table2", "table3"].iter().all(|name| found.contains(*name)), "{found:?}");
    }
}
