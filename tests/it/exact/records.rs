//! What records claim, counted anew: a spy between the schedules and the executor sees every load and every submission,
//! keeps a cache of its own by the addresses written to, takes sizes from the scene file, and truth in f64 says which
//! bricks hold hits and which could be needed. A record that is off by one is noticed.

use crate::common;
use bricks::{AttributeLayout, GeometryLayout, INSTANCE_IDENTITY, Node, Payload, SceneFile, TOP_LEAF};
use brickwalk::counters::{Counters, Record};
use brickwalk::frame::{Renderer, camera_view};
use brickwalk::kernels::frame::Frame;
use brickwalk::kernels::layout::{NONE, Ray, T_INFINITE};
use brickwalk::reference::{Truth, TruthRay, Verdict, judge};
use brickwalk::scene::path::CameraPath;
use brickwalk::schedule::{
    self, BrickStates, Executor, ExecutorError, Load, Optimisations, PairQuery, Pass, Report, Step, Tracer, Tracing,
    attributes,
};
use brickwalk::session::opened::{Opened, open_scene};
use brickwalk::session::renderer::renderer;
use brickwalk::settings::Schedule;
use brickwalk::stream::{Item, Kind, Slot};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// Passes everything on and keeps what went through.
struct Spy<'a> {
    inner: &'a mut dyn Executor,
    batches: Vec<Vec<Load>>,
    submissions: Vec<(Vec<Step>, Report)>,
    ms_loading: f64,
}

impl Executor for Spy<'_> {
    fn load(&mut self, loads: &[Load]) -> Result<(), ExecutorError> {
        let start = Instant::now();
        self.inner.load(loads)?;
        self.ms_loading += start.elapsed().as_secs_f64() * 1e3;
        self.batches.push(loads.to_vec());
        Ok(())
    }

    fn set_lists(&mut self, lists: &[Vec<u32>]) -> Result<(), ExecutorError> {
        self.inner.set_lists(lists)
    }

    fn set_pairs(&mut self, queries: &[PairQuery], nodes: &[u32]) -> Result<(), ExecutorError> {
        self.inner.set_pairs(queries, nodes)
    }

    fn mark_leaves(&mut self, marks: &Arc<[bool]>) {
        self.inner.mark_leaves(marks);
    }

    fn run(&mut self, pass: Pass, steps: &[Step], bricks: &BrickStates) -> Result<Report, ExecutorError> {
        let report = self.inner.run(pass, steps, bricks)?;
        self.submissions.push((steps.to_vec(), report.clone()));
        Ok(report)
    }
}

/// Sizes as the scene file's counts imply them: nodes, all of the geometry, attributes.
fn sizes(scene: &SceneFile) -> Vec<[u64; 3]> {
    let of = |b: &bricks::Brick| {
        let nodes = u64::from(b.node_count) * size_of::<Node>() as u64;
        [nodes, GeometryLayout::of(b).bytes, AttributeLayout::of(b).bytes]
    };
    scene.resident().bricks.iter().map(of).collect()
}

/// What lies where, by what was written where.
#[derive(Default)]
struct Memory {
    lies: BTreeMap<Slot, (u64, Item)>,
}

impl Memory {
    /// Writes `bytes` and returns how many payloads that destroys.
    fn write(&mut self, load: &Load, bytes: u64) -> u64 {
        let Slot { page, offset } = load.slot;
        let (start, end) = (u64::from(offset), u64::from(offset) + bytes);
        let before = self.lies.len();
        self.lies.retain(|slot, (length, _)| {
            slot.page != page || u64::from(slot.offset) >= end || u64::from(slot.offset) + *length <= start
        });
        let destroyed = (before - self.lies.len()) as u64;
        self.lies.insert(load.slot, (bytes, load.item));
        destroyed
    }

    fn bytes(&self) -> u64 {
        self.lies.values().map(|(bytes, _)| bytes).sum()
    }
}

/// What a record has to say.
#[derive(Clone, Debug, Default, PartialEq)]
struct Counts {
    fields: BTreeMap<&'static str, u64>,
}

/// Counts anew what a pass did to `memory`.
fn recount(spy: &Spy, sizes: &[[u64; 3]], memory: &mut Memory, in_frame: &mut BTreeSet<Item>) -> Counts {
    let mut fields = BTreeMap::from([("bricks_resident_start", memory.lies.len() as u64)]);
    let mut seen = BTreeSet::new();
    for load in spy.batches.iter().flatten() {
        let number = load.item.number as usize;
        let mut add = |field, amount| *fields.entry(field).or_default() += amount;
        let bytes = match load.item.kind {
            Kind::Geometry => {
                let [nodes, geometry, _] = sizes[number];
                add("bytes_bvh", nodes);
                add("bytes_geometry", geometry - nodes);
                geometry
            }
            Kind::Attributes => {
                add("bytes_attributes", sizes[number][2]);
                sizes[number][2]
            }
            Kind::Tile => unreachable!("a scene without textures"),
        };
        add("bricks_loaded", 1);
        add("bricks_reloaded", u64::from(!seen.insert(load.item)));
        let again = !in_frame.insert(load.item);
        add("bricks_reloaded_frame", u64::from(again));
        add("bytes_reloaded_frame", if again { bytes } else { 0 });
        add("bricks_evicted", memory.write(load, bytes));
    }
    // The measurement of needs counts for nothing.
    let counted = || spy.submissions.iter().filter(|(steps, _)| !steps.contains(&Step::QueryNeeded)).map(|(_, r)| r);
    let sum = |of: fn(&Report) -> u64| counted().map(of).sum::<u64>();
    fields.insert("bricks_resident_end", memory.lies.len() as u64);
    fields.insert("cache_used_bytes", memory.bytes());
    fields.insert("load_batches", spy.batches.len() as u64);
    fields.insert("round_trips", counted().count() as u64);
    fields.insert("queries", sum(|r| r.counters.queries()));
    fields.insert("queries_visible", sum(|r| r.counters.queries_visible));
    fields.insert("queries_interval_culled", sum(|r| r.counters.queries_interval_culled));
    fields.insert("rays_traced", sum(|r| r.counters.rays_traced));
    fields.insert("rays", sum(|r| r.counters.rays_traced + r.counters.rays_answered));
    Counts { fields }
}

/// The first field in which a record differs from the counts.
fn difference(record: &Record, counts: &Counts) -> Option<String> {
    let record = serde_json::to_value(record).expect("a record");
    let mut differ = counts.fields.iter().filter(|(field, value)| record[**field] != **value);
    differ.next().map(|(field, value)| format!("{field}: {} recorded, {value} counted", record[*field]))
}

/// Which brick holds which triangle.
fn brick_of_triangle(scene: &SceneFile) -> BTreeMap<u32, u32> {
    let resident = scene.resident();
    assert!(resident.instances.iter().all(|i| i.flags & INSTANCE_IDENTITY != 0 && i.base == 0), "one world object");
    let mut holders = BTreeMap::new();
    for (index, brick) in (0..).zip(&resident.bricks) {
        let payload = Payload::Geometry(index);
        let mut bytes = vec![0; scene.loaded_bytes(payload) as usize];
        scene.copy(payload, &mut bytes).expect("geometry");
        let first = GeometryLayout::of(brick).ids as usize;
        for id in bytes[first..].chunks_exact(4).take(brick.triangle_count as usize) {
            holders.insert(u32::from_le_bytes(id.try_into().expect("four bytes")), index);
        }
    }
    holders
}

/// Whether a ray is in a box, widened by what f32 boxes are padded by at most, at or before `t`.
fn enters(ray: &TruthRay, min: [f64; 3], max: [f64; 3], t: f64) -> bool {
    let (mut near, mut far) = (ray.t_min, t * (1.0 + 1e-5) + 1e-6);
    for axis in 0..3 {
        // Boxes in bricks are rounded outward to steps of 2^-8 of the brick, and padded by a few ulps of the scene.
        let pad = 0.02 * (max[axis] - min[axis]) + 1e-3;
        let origin = ray.reference[axis] + ray.origin[axis];
        let (low, high) = (min[axis] - pad - origin, max[axis] + pad - origin);
        if ray.direction[axis] == 0.0 {
            if low > 0.0 || high < 0.0 {
                return false;
            }
            continue;
        }
        let (a, b) = (low / ray.direction[axis], high / ray.direction[axis]);
        near = near.max(a.min(b));
        far = far.min(a.max(b));
    }
    near <= far
}

/// Bricks that hold the true hits of the primary rays, and bricks that a ray comes near before its hit.
fn truly(renderer: &mut Renderer, truth: &Truth, frame: &Frame, holders: &BTreeMap<u32, u32>) -> [BTreeSet<u32>; 2] {
    let rays: Vec<Ray> = renderer.executor.read_rays(Pass::Primary).expect("rays");
    let hits = renderer.executor.read_hits(Pass::Primary).expect("hits");
    let resident = renderer.scene.resident();
    let step = f64::from(resident.objects[0].step_log2).exp2();
    let boxes: Vec<_> = (resident.top2.iter().filter(|node| node.right == TOP_LEAF))
        .map(|n| {
            (resident.leaves[n.left as usize].brick, n.min.map(|x| x as f64 * step), n.max.map(|x| x as f64 * step))
        })
        .collect();
    let (mut hit, mut near) = (BTreeSet::new(), BTreeSet::new());
    for (ray, found) in rays.iter().zip(&hits) {
        let t_max = if ray.t_max >= T_INFINITE { f32::INFINITY } else { ray.t_max };
        let ray = TruthRay::from_f32(frame.origin.to_array(), frame.unit, ray.origin, ray.direction, ray.t_min, t_max);
        let recorded = (found.id != NONE).then_some((found.id, f64::from(found.t)));
        let id = match judge(truth, &ray, recorded) {
            // Where f32 cannot tell, the kernel's triangle is as good.
            Verdict::Excused(_) => recorded.map(|(id, _)| id),
            Verdict::Equal => truth.closest(&ray).map(|hit| hit.id),
            Verdict::Mismatch(fault) => panic!("{fault:?}"),
        };
        let t = truth.closest(&ray).map_or(ray.t_max, |hit| hit.t);
        hit.extend(id.map(|id| holders[&id]));
        near.extend(boxes.iter().filter(|(_, min, max)| enters(&ray, *min, *max, t)).map(|one| one.0));
    }
    [hit, near]
}

fn open(scene: &Path, options: &str) -> Renderer {
    let settings = common::settings(&format!("--size 64x48 --tile 16 {options}"));
    let file = open_scene(scene).expect("the scene");
    renderer(Opened::open(file, scene, &settings).expect("a session"), scene, &settings).expect("lamps")
}

#[test]
fn records_are_what_a_spy_counts() {
    let folder = common::folder();
    let scene = common::city(folder.path(), "40K", "512");
    let file = open_scene(&scene).expect("the scene");
    let truth = Truth::load(&file).expect("truth");
    let (sizes, holders) = (sizes(&file), brick_of_triangle(&file));
    let path = CameraPath::read(&scene.with_extension("near.json")).expect("a path");
    let mut noticed = BTreeSet::new();
    for (options, schedule) in [
        ("--cache 10%", Schedule::Chc),
        ("--cache 10% --evict second-chance", Schedule::Demand),
        ("--cache 6% --evict lru", Schedule::Chc),
    ] {
        let mut renderer = open(&scene, options);
        let mut memory = Memory::default();
        for number in 0..3 {
            let camera = path.frame(number, 3);
            let resident = file.resident();
            let effects = renderer.settings.effects;
            let view = camera_view(resident, &camera, &renderer.light, &effects, renderer.size, 0, number);
            renderer.executor.begin_frame(&view);
            let mut in_frame = BTreeSet::new();
            // Two passes over the same rays: the second finds what is left of the first.
            for pass_of_frame in 0..2 {
                let tracing = Tracing { measure_needed: true, ..Tracing::default() };
                let (start, mut stats) = (Instant::now(), Counters::default());
                let cache = &mut renderer.engine.cache;
                let resident_start = cache.residency.resident().count() as u64;
                cache.begin_pass("primary", number);
                let inner = &mut *renderer.engine.executor;
                let mut spy = Spy { inner, batches: Vec::new(), submissions: Vec::new(), ms_loading: 0.0 };
                let (tracing, pass) = (&tracing, Pass::Primary);
                let mut tracer = Tracer::new(&mut spy, &mut *cache, pass, tracing, &mut stats);
                schedule::trace(&mut tracer, schedule, &[Step::Generate]).expect("a pass");
                attributes::resolve(&mut spy, cache, Pass::Primary, &mut stats).expect("attributes");
                stats.ms = start.elapsed().as_secs_f64() * 1e3;
                let mut record = Record::of(number, "primary", stats.clone());
                record.bricks_resident_start = resident_start;
                record.bricks_resident_end = cache.residency.resident().count() as u64;
                record.cache_used_bytes = cache.residency.used_bytes();

                let name = format!("{options}, {schedule:?}, frame {number}, pass {pass_of_frame}");
                let counts = recount(&spy, &sizes, &mut memory, &mut in_frame);
                assert_eq!(difference(&record, &counts), None, "{name}");
                let lies = memory.lies.iter().map(|(slot, one)| (one.1, *slot));
                assert!(lies.eq(cache.residency.resident()), "{name}: the cache is not what was written");
                // Phases are parts of the wall time, loading takes what the executor's loads take and no more than all.
                let phases = record.ms_phase1 + record.ms_phase2 + record.ms_phase3;
                assert!(phases <= record.ms && phases >= 0.0, "{name}: {phases} of {} ms", record.ms);
                assert!(spy.ms_loading <= record.ms_stream && record.ms_stream <= record.ms, "{name}: {record:?}");
                // Controls: every field that is off by one is noticed.
                for field in counts.fields.keys() {
                    let mut wrong = counts.clone();
                    *wrong.fields.get_mut(field).expect("a field") += 1;
                    assert!(difference(&record, &wrong).is_some_and(|text| text.starts_with(field)), "{field}");
                    noticed.insert(*field);
                }

                let frame = Frame::near(resident, camera.position);
                let [hit, near] = truly(&mut renderer, &truth, &frame, &holders);
                assert_eq!(record.bricks_hit.count(), hit.len() as u64, "{name}");
                let claimed: BTreeSet<u32> = stats.bricks_hit.distinct().into_iter().collect();
                assert_eq!(claimed, hit, "{name}: bricks that hold hits");
                let needed: BTreeSet<u32> = stats.bricks_needed.distinct().into_iter().collect();
                assert_eq!(record.bricks_needed.count(), needed.len() as u64, "{name}");
                assert!(hit.is_subset(&needed), "{name}: what holds hits is needed");
                assert!(needed.is_subset(&near), "{name}: {:?}", needed.difference(&near));
                let entered: BTreeSet<u32> = stats.bricks_entered.distinct().into_iter().collect();
                assert!(needed.is_subset(&entered) && entered.len() < sizes.len(), "{name}: what is needed is entered");
                let bytes: u64 = needed.iter().map(|&brick| sizes[brick as usize][1]).sum();
                assert_eq!(record.bytes_needed, bytes, "{name}");
                assert!(near.len() < sizes.len(), "{name}: the bound says nothing");
            }
        }
        assert!(memory.lies.len() > 2, "something is resident");
    }
    assert_eq!(noticed.len(), 18, "{noticed:?}");
}

#[test]
fn closest_hits_load_what_is_needed_and_nothing_else() {
    let folder = common::folder();
    let scene = common::city(folder.path(), "40K", "512");
    let path = CameraPath::read(&scene.with_extension("near.json")).expect("a path");
    let mut in_vain = BTreeMap::new();
    for (schedule, nearest_first) in
        [(Schedule::Chc, true), (Schedule::Demand, true), (Schedule::Chc, false), (Schedule::Demand, false)]
    {
        let mut renderer = open(&scene, "--cache 100%");
        for number in 0..3 {
            let effects = renderer.settings.effects;
            let camera = path.frame(4 * number, 9);
            let resident = renderer.scene.resident();
            let view = camera_view(resident, &camera, &renderer.light, &effects, renderer.size, 0, number);
            renderer.executor.begin_frame(&view);
            renderer.cache.begin_pass("primary", number);
            let optimisations = Optimisations { nearest_first, ..Optimisations::default() };
            let tracing = Tracing { measure_needed: true, optimisations };
            let mut stats = Counters::default();
            let inner = &mut *renderer.engine.executor;
            let mut spy = Spy { inner, batches: Vec::new(), submissions: Vec::new(), ms_loading: 0.0 };
            let cache = &mut renderer.engine.cache;
            let (tracing, pass) = (&tracing, Pass::Primary);
            let mut tracer = Tracer::new(&mut spy, cache, pass, tracing, &mut stats);
            schedule::trace(&mut tracer, schedule, &[Step::Generate]).expect("a pass");
            let needed: BTreeSet<u32> = stats.bricks_needed.distinct().into_iter().collect();
            let loaded = spy.batches.iter().flatten().map(|load| load.item.number);
            let vain = loaded.filter(|brick| !needed.contains(brick)).count();
            *in_vain.entry((schedule == Schedule::Chc, nearest_first)).or_insert(0) += vain;
            assert!(number > 0 || !spy.batches.is_empty(), "something is loaded");
        }
    }
    assert_eq!((in_vain[&(true, true)], in_vain[&(false, true)]), (0, 0), "{in_vain:?}");
    // Control: in another order some are.
    assert!(in_vain[&(true, false)] > 0 && in_vain[&(false, false)] > 0, "{in_vain:?}");
}

/// Passes of effects take turns: what those of one evict, those of another may have loaded.
#[test]
fn what_is_resident_when_an_effect_ends_is_no_balance_of_its_own() {
    let folder = common::folder();
    let scene = common::city(folder.path(), "40K", "512");
    let path = CameraPath::read(&scene.with_extension("near.json")).expect("a path");
    let mut renderer = open(&scene, "--cache 6% --effects shadow,diffuse --diffuse-rays 2 --rotation full");
    // Geometry and attributes of each.
    let payloads = 2 * renderer.scene.resident().bricks.len() as u64;
    let mut unbalanced = 0;
    for number in 0..3 {
        let records = renderer.frame(number, &path.frame(number, 3)).expect("a frame").records;
        let resident = renderer.cache.residency.resident().count() as u64;
        assert!(records.iter().any(|record| record.bricks_resident_end == resident), "one ended last");
        for record in &records {
            let n = [record.bricks_resident_start, record.bricks_loaded, record.bricks_evicted];
            assert!(record.bricks_resident_end <= payloads, "{}: {n:?}, {}", record.pass, record.bricks_resident_end);
            unbalanced += u64::from(n[0] + n[1] != n[2] + record.bricks_resident_end);
        }
    }
    assert!(unbalanced > 0, "control: some effect's own loads and evictions do not add up");
}
