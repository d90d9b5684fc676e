//! The tables: every number is recomputed from the cells, and each ratio that the paper has, too, stands beside the
//! paper's.

use super::cells::{Measured, Metric};
use super::paper;
use super::paper::PaperScene;
use super::plan::{Case, Effect, FRONTS, PLAIN, PLAIN_BVH2, SceneId, Stage, Variant, View, paper_cache, target_cache};
use brickwalk_report::{Table, Value};

const MEGA: f64 = 1e-6;

/// All tables that have a row.
pub fn all(cases: &[Case], measured: &Measured) -> Vec<Table> {
    let tables = [
        table2(cases, measured),
        table3(cases, measured),
        table4(cases, measured),
        table5(cases, measured),
        figure5(cases, measured),
        targets(cases, measured),
        scale(cases, measured),
    ];
    tables.into_iter().filter(|table| !table.rows.is_empty()).collect()
}

fn table(name: &str, caption: &str, columns: &[&str]) -> Table {
    let columns = columns.iter().map(|column| (*column).to_string()).collect();
    Table { name: name.into(), caption: caption.into(), columns, rows: Vec::new() }
}

/// The cases of a stage with each of their passes, those that have been measured.
fn rows<'a>(
    cases: &'a [Case],
    stage: Stage,
    measured: &'a Measured,
) -> impl Iterator<Item = (&'a Case, Effect)> + use<'a> {
    let own = cases.iter().filter(move |case| case.stage == stage);
    let passes = own.flat_map(|case| case.passes().iter().map(move |&effect| (case, effect)));
    passes.filter(|(case, effect)| measured.median(case, *effect, Metric::Wall).is_some())
}

fn with(case: &Case, variant: Variant) -> Case {
    Case { variant, ..*case }
}

/// Whether the paper's numbers concern a variant: not those of the baselines.
fn is_ours(variant: &Variant) -> bool {
    ![PLAIN.schedule, PLAIN_BVH2.schedule].contains(&variant.schedule)
}

fn of_paper(case: &Case, value: impl Fn(PaperScene) -> Option<f64>) -> Option<f64> {
    case.scene.paper().filter(|_| is_ours(&case.variant)).and_then(value)
}

fn table2(cases: &[Case], measured: &Measured) -> Table {
    let mut table = table(
        "table2",
        "In core. Milliseconds a frame and pass, medians; wall time (as the paper's) and device time of the three phases. The \
         paper's speed-up is over a binary tree walked from its root: our column over plain-bvh2 is its like.",
        &[
            "scene",
            "path",
            "rays",
            "schedule",
            "wall ms",
            "device ms",
            "over plain, wall",
            "over plain, device",
            "over plain-bvh2, wall",
            "over plain-bvh2, device",
            "paper",
        ],
    );
    for (case, effect) in rows(cases, Stage::Table2, measured) {
        let over = |variant, metric| {
            let baseline = with(case, variant);
            Value::ratio(measured.ratio(&baseline, case, effect, metric).filter(|_| baseline != *case))
        };
        table.rows.push(vec![
            case.scene.name().into(),
            case.view.name().into(),
            effect.name().into(),
            case.variant.to_string().into(),
            Value::number(measured.median(case, effect, Metric::Wall)),
            Value::number(measured.median(case, effect, Metric::Device)),
            over(PLAIN, Metric::Wall),
            over(PLAIN, Metric::Device),
            over(PLAIN_BVH2, Metric::Wall),
            over(PLAIN_BVH2, Metric::Device),
            Value::ratio(of_paper(case, |scene| paper::speed_up(scene, case.view, effect))),
        ]);
    }
    table
}

fn table3(cases: &[Case], measured: &Measured) -> Table {
    let mut table = table(
        "table3",
        "Out of core, at the paper's share of the cache. Per frame, the first frames left out. Far ÷ near is the ratio of wall times; \
         a paper's MB has attributes in it.",
        &[
            "scene",
            "cache",
            "path",
            "rays",
            "schedule",
            "wall ms",
            "far ÷ near",
            "paper: far ÷ near",
            "Mray/s",
            "paper: Mray/s",
            "queries",
            "paper: queries",
            "MB moved",
            "of which BVH",
            "of which triangles",
            "paper: MB moved",
        ],
    );
    for (case, effect) in rows(cases, Stage::Table3, measured) {
        let field = |name| measured.median(case, effect, Metric::Field(name));
        let [bvh, triangles, attributes] = ["bytes_bvh", "bytes_geometry", "bytes_attributes"].map(field);
        let bytes = [bvh, triangles, attributes].into_iter().flatten().sum::<f64>();
        let ms = measured.median(case, effect, Metric::Wall);
        let mrays = field("rays_traced").zip(ms).map(|(rays, ms)| rays / ms * 1e-3);
        let near = Case { view: View::Near, ..*case };
        let far = (case.view == View::Far).then_some(case);
        let traffic = case.scene.paper().and_then(|scene| paper::traffic(scene, case.view, effect));
        let of_near = |scene| paper::ms(scene, View::Far, effect) / paper::ms(scene, View::Near, effect);
        table.rows.push(vec![
            case.scene.name().into(),
            format!("{} %", case.cache).into(),
            case.view.name().into(),
            effect.name().into(),
            case.variant.to_string().into(),
            Value::number(ms),
            Value::ratio(far.and_then(|far| measured.ratio(far, &near, effect, Metric::Wall))),
            Value::ratio(far.and_then(|far| far.scene.paper()).map(of_near)),
            Value::number(mrays),
            Value::number(traffic.map(|t| t.mrays_per_s)),
            Value::number(field("queries")),
            Value::number(traffic.map(|t| t.queries)),
            Value::Number(bytes * MEGA),
            Value::number(bvh.map(|bytes| bytes * MEGA)),
            Value::number(triangles.map(|bytes| bytes * MEGA)),
            Value::number(traffic.map(|t| t.megabytes)),
        ]);
    }
    table
}

fn table4(cases: &[Case], measured: &Measured) -> Table {
    let mut table = table(
        "table4",
        "Aggressive culling of diffuse rays out of core: bricks that at most so many rays of a tile could see (of one of 200 x 200 \
         pixels) are left out. Errors are of 255 levels, against threshold 0, over five frames that begin with an empty cache; the \
         paper states a mean of 9.04 for 20 pixels in one picture.",
        &[
            "scene",
            "path",
            "threshold",
            "wall ms",
            "over threshold 0",
            "paper",
            "mean absolute error",
            "that of the worst tile",
        ],
    );
    for (case, effect) in rows(cases, Stage::Table4, measured) {
        let exact = with(case, Variant { threshold: 0, ..case.variant });
        let at = paper::THRESHOLDS.iter().position(|&threshold| threshold == case.variant.threshold);
        let paper = case.scene.paper().and_then(|scene| paper::aggressive_ms(scene, case.view));
        let error = measured.error(case);
        table.rows.push(vec![
            case.scene.name().into(),
            case.view.name().into(),
            case.variant.threshold.to_string().into(),
            Value::number(measured.median(case, effect, Metric::Wall)),
            Value::ratio(measured.ratio(&exact, case, effect, Metric::Wall)),
            Value::ratio(paper.zip(at).map(|(ms, at)| ms[0] / ms[at])),
            Value::number(error.map(|error| error.mean)),
            Value::number(error.map(|error| error.worst_tile)),
        ]);
    }
    table
}

fn table5(cases: &[Case], measured: &Measured) -> Table {
    let mut table = table(
        "table5",
        "Random turn of a pixel's rays about the normal, at most so many degrees; in core, near. The ratio is to no turn.",
        &["scene", "rays", "schedule", "turn", "wall ms", "device ms", "slower, wall", "slower, device", "paper"],
    );
    for (case, effect) in rows(cases, Stage::Table5, measured) {
        let still = with(case, Variant { rotation: 0, ..case.variant });
        let at = paper::ROTATIONS.iter().position(|&rotation| rotation == case.variant.rotation);
        let paper = case.scene.paper().and_then(|scene| paper::rotation_ms(scene, effect));
        table.rows.push(vec![
            case.scene.name().into(),
            effect.name().into(),
            case.variant.to_string().into(),
            format!("{}°", case.variant.rotation).into(),
            Value::number(measured.median(case, effect, Metric::Wall)),
            Value::number(measured.median(case, effect, Metric::Device)),
            Value::ratio(measured.ratio(case, &still, effect, Metric::Wall)),
            Value::ratio(measured.ratio(case, &still, effect, Metric::Device)),
            Value::ratio(paper.zip(at).map(|(ms, at)| ms[at] / ms[0])),
        ]);
    }
    table
}

fn figure5(cases: &[Case], measured: &Measured) -> Table {
    let mut table = table(
        "figure5",
        "Primary rays in core by the size of tiles. The paper found tiles of 200 pixels best on its hardware.",
        &["scene", "path", "tile", "wall ms", "device ms", "queries", "pairs of tile and brick"],
    );
    for (case, effect) in rows(cases, Stage::Figure5, measured) {
        table.rows.push(vec![
            case.scene.name().into(),
            case.view.name().into(),
            case.tile.to_string().into(),
            Value::number(measured.median(case, effect, Metric::Wall)),
            Value::number(measured.median(case, effect, Metric::Device)),
            Value::number(measured.median(case, effect, Metric::Field("queries"))),
            Value::number(measured.median(case, effect, Metric::Field("pairs_intersected"))),
        ]);
    }
    table
}

fn targets(cases: &[Case], measured: &Measured) -> Table {
    let mut table = table(
        "targets",
        "BVH and triangles moved ÷ needed, near: of the first frame, which begins with an empty cache, and of the others, of what was \
         not resident. 1 is the least.",
        &[
            "scene",
            "cache",
            "rays",
            "schedule",
            "cold: MB moved",
            "cold: moved ÷ needed",
            "steady: MB moved",
            "steady: moved ÷ missing",
        ],
    );
    for (case, effect) in rows(cases, Stage::Targets, measured) {
        let sums = |field| measured.first_and_rest(case, effect, field).unwrap_or_default();
        let (bvh, triangles, missing) = (sums("bytes_bvh"), sums("bytes_geometry"), sums("bytes_needed_missing"));
        let (cold, steady) = (bvh.0 + triangles.0, bvh.1 + triangles.1);
        let over = |moved: f64, needed: f64| Value::ratio((needed > 0.0).then(|| moved / needed));
        table.rows.push(vec![
            case.scene.name().into(),
            format!("{} %", case.cache).into(),
            effect.name().into(),
            case.variant.to_string().into(),
            Value::Number(cold * MEGA),
            over(cold, missing.0),
            Value::Number(steady * MEGA),
            over(steady, missing.1),
        ]);
    }
    table
}

/// What the size of a scene costs: ratios between scenes, which no walks interleave.
fn scale(cases: &[Case], measured: &Measured) -> Table {
    let mut table = table(
        "scale",
        "What size costs: the larger scene ÷ the smaller, of walks that were not interleaved. In core on both sides, or out of \
         core ÷ in core, as in the paper.",
        &["larger", "smaller", "path", "rays", "schedule", "wall", "device", "paper, wall"],
    );
    let in_core = |case: &&Case| case.stage == Stage::Table2;
    for small in cases.iter().filter(in_core) {
        let large = match small.scene {
            SceneId::City => SceneId::CityLarge,
            SceneId::Pipes => SceneId::Pipes16,
            _ => continue,
        };
        let candidates =
            [(Stage::Scale, 100), (Stage::Table3, paper_cache(large)), (Stage::Targets, target_cache(large))];
        for &effect in small.passes() {
            for (stage, cache) in candidates {
                let effects = if stage == Stage::Scale { small.effects } else { single(effect) };
                let variant = Variant { needed: stage == Stage::Targets, ..small.variant };
                let other = Case { stage, scene: large, cache, effects, variant, ..*small };
                let wall = measured.ratio(&other, small, effect, Metric::Wall);
                if !cases.contains(&other) || wall.is_none() {
                    continue;
                }
                let paper = (stage == Stage::Table3 && small.variant == FRONTS).then_some(small.scene.paper());
                let paper = paper.flatten().zip(large.paper()).map(|(before, after)| {
                    paper::ms(after, small.view, effect) / paper::ms(before, small.view, effect)
                });
                table.rows.push(vec![
                    format!("{}, cache {cache} %", large.name()).into(),
                    format!("{}, cache 100 %", small.scene.name()).into(),
                    small.view.name().into(),
                    effect.name().into(),
                    small.variant.to_string().into(),
                    Value::ratio(wall),
                    Value::ratio(measured.ratio(&other, small, effect, Metric::Device)),
                    Value::ratio(paper),
                ]);
            }
        }
    }
    table
}

/// The list of one effect alone.
fn single(effect: Effect) -> &'static [Effect] {
    match effect {
        Effect::Primary => &[Effect::Primary],
        Effect::Ao => &[Effect::Ao],
        Effect::Diffuse => &[Effect::Diffuse],
    }
}
