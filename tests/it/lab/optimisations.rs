//! The optimisations of CHC+RT: each acts and is counted, none nor any of their combinations changes a hit; the fronts
//! partition rays and bricks after every frame; a cut of the camera is a cold start.

use crate::common;
use brickwalk::counters::Record;
use brickwalk::frame::{Effects, FrameOutput, Pixels, Renderer, Schedule};
use brickwalk::kernels::layout::{Hit, NONE};
use brickwalk::scene::path::CameraPath;
use brickwalk::schedule::fronts::Fronts;
use brickwalk::schedule::{Optimisation, Optimisations, PartOf, Pass};
use brickwalk::session::opened::{Opened, open_scene};
use brickwalk::session::renderer::renderer;
use std::path::Path;

/// Every effect, with few rays.
const OPTIONS: &str = "--aov --effects shadow,ao,diffuse,glossy --ao-rays 2 --ao-length 4 --diffuse-rays 2 \
                       --rect-light -2,6,-2,4,0,0,0,0,4 --rotation full";

/// A renderer of a scene with all effects, as `walk` makes it.
fn open(scene: &Path, options: &str) -> Renderer {
    let settings = common::settings(&format!("{OPTIONS} {options}"));
    let file = open_scene(scene).expect("the scene");
    renderer(Opened::open(file, scene, &settings).expect("a session"), scene, &settings).expect("lamps")
}

/// The least cache of a scene, bytes, from the error that asks for it.
fn least_cache(scene: &Path) -> u64 {
    let settings = common::settings("--cache 1K");
    let refused = Opened::open(open_scene(scene).expect("the scene"), scene, &settings).err();
    let message = format!("{:#}", refused.expect("a cache of 1K is too small"));
    let needed = message.split("two largest bricks need ").nth(1).and_then(|rest| rest.split(' ').next());
    needed.and_then(|bytes| bytes.parse().ok()).expect("the message names what is needed")
}

/// Random numbers of a seed.
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 33) as usize % n
    }
}

/// What must not differ between two frames: every bit of the pixels, to which all passes add, and of the primary hits.
#[derive(PartialEq)]
struct Seen {
    pixels: Vec<u32>,
    primary: Vec<u32>,
}

fn seen(renderer: &mut Renderer, pixels: &Pixels) -> Seen {
    let Pixels { radiance, depth, normal, id, albedo, .. } = pixels;
    let vectors = radiance.iter().chain(normal).chain(albedo).flatten();
    let bits: Vec<u32> = vectors.chain(depth).map(|x| x.to_bits()).chain(id.iter().copied()).collect();
    let hits: Vec<Hit> = renderer.executor.read_hits(Pass::Primary).expect("hits");
    let words = |hit: &Hit| [hit.t.to_bits(), hit.id, hit.u.to_bits(), hit.v.to_bits()];
    Seen { pixels: bits, primary: hits.iter().flat_map(words).collect() }
}

fn total(records: &[Record], field: impl Fn(&Record) -> u64) -> u64 {
    records.iter().map(field).sum()
}

/// What is traced: everything, or a part.
fn effect_sets(all: Effects) -> [Effects; 3] {
    let none = Effects { shadow: false, occlusion: None, diffuse: None, glossy: false, ..all };
    [
        Effects { shadow: true, ..none },
        Effects { occlusion: all.occlusion, ..none },
        Effects { shadow: true, diffuse: all.diffuse, glossy: true, ..none },
    ]
}

#[test]
fn no_combination_changes_a_hit() {
    const FRAMES: u32 = 4;
    const SIZE: &str = "--size 72x48";
    let seed = 0x9E37_79B9_7F4A_7C15;
    println!("seed {seed:#x}");
    let mut random = Random(seed);
    let folder = common::folder();
    let scene = common::polished_city(folder.path(), 40_000, 1000);
    let path = CameraPath::read(&scene.with_extension("near.json")).expect("a path");
    let mut plain = open(&scene, &format!("{SIZE} --schedule plain --cache 100%"));
    let sets = effect_sets(plain.settings.effects);
    let mut truth = Vec::new();
    for effects in sets {
        plain.settings.effects = effects;
        for k in 0..FRAMES {
            let output = plain.frame(k, &path.frame(k, FRAMES)).expect("a frame");
            truth.push(seen(&mut plain, &output.pixels));
        }
    }
    drop(plain);
    assert!(truth[0].primary.chunks(4).any(|hit| hit[1] != NONE), "something is hit");
    let least = least_cache(&scene);
    for (cache, tile) in [(format!("{least}"), 16), ("10%".into(), 32), ("30%".into(), 64), ("100%".into(), 16)] {
        let mut renderer = open(&scene, &format!("{SIZE} --cache {cache} --tile {tile}"));
        for _ in 0..12 {
            let mut on = Optimisations::default();
            Optimisation::ALL.iter().for_each(|&which| on.set(which, random.below(2) == 0));
            renderer.settings.tracing.optimisations = on;
            renderer.settings.schedule = if random.below(3) == 0 { Schedule::Demand } else { Schedule::Chc };
            match random.below(4) {
                0 => renderer.fronts = None,
                1 => renderer.fronts = Some(Fronts::default()),
                _ => {} // as before, with what the frames before left
            }
            let set = random.below(sets.len());
            renderer.settings.effects = sets[set];
            let k = random.below(FRAMES as usize) as u32;
            let output = renderer.frame(k, &path.frame(k, FRAMES)).expect("a frame");
            let what = format!(
                "cache {cache}, tile {tile}, effects {set}, frame {k}, {:?}, fronts {}, {on:?}",
                renderer.settings.schedule,
                renderer.fronts.is_some()
            );
            assert!(seen(&mut renderer, &output.pixels) == truth[set * FRAMES as usize + k as usize], "{what}");
        }
    }
    // Negative control: bricks that few rays of a tile see are left out, and that must be noticed.
    let mut aggressive = open(&scene, &format!("{SIZE} --schedule chc --cache 10% --query-threshold 8000"));
    aggressive.settings.effects = sets[0];
    let output = aggressive.frame(0, &path.frame(0, FRAMES)).expect("a frame");
    assert!(seen(&mut aggressive, &output.pixels) != truth[0], "hits that are left out must be noticed");
}

/// The field that counts an optimisation.
fn counter(which: Optimisation) -> fn(&Record) -> u64 {
    match which {
        Optimisation::NearestFirst => |r| r.bricks_nearest_first,
        Optimisation::Requery => |r| r.bricks_no_longer_wanted,
        Optimisation::ResidentFirst => |r| r.bricks_resident_first,
        Optimisation::RootWalk => |r| r.tiles_from_root,
        Optimisation::FrontToBack => |r| r.pairs_front_to_back,
        Optimisation::ByTile => |r| r.tile_batches,
        Optimisation::MultiQueries => |r| r.multi_queries,
        Optimisation::TighterBounds => |r| r.queries_tightened,
        Optimisation::LazyRequery => |r| r.requeries_deferred,
        Optimisation::PullUp => |r| r.pulled_up,
    }
}

#[test]
fn every_optimisation_acts_and_is_counted() {
    const FRAMES: u32 = 8;
    let folder = common::folder();
    let scene = common::city(folder.path(), "40K", "1K");
    let path = CameraPath::read(&scene.with_extension("near.json")).expect("a path");
    let mut renderer = open(&scene, "--size 96x64 --tile 16 --cache 10% --schedule chc");
    renderer.settings.effects = effect_sets(renderer.settings.effects)[0];
    for &which in Optimisation::ALL {
        let mut counts = [0, 0];
        for on in [true, false] {
            renderer.fronts = (which.part_of() == PartOf::Fronts).then(Fronts::default);
            renderer.settings.tracing.optimisations = Optimisations::default();
            renderer.settings.tracing.optimisations.set(which, on);
            for k in 0..FRAMES {
                let output = renderer.frame(k, &path.frame(k, FRAMES)).expect("a frame");
                counts[usize::from(on)] += total(&output.records, counter(which));
                let of = |field: fn(&Record) -> u64| total(&output.records, field);
                assert!(of(|r| r.multi_queries_failed) <= of(|r| r.multi_queries));
                assert!(of(|r| r.tile_batch_leaves) >= 2 * of(|r| r.tile_batches));
            }
        }
        println!("{}: {counts:?}", which.name());
        assert!(counts[1] > 0, "{} does nothing here", which.name());
        assert_eq!(counts[0], 0, "{} is counted although it is off", which.name());
    }
}

#[test]
fn fronts_partition_rays_and_bricks_after_every_frame() {
    let folder = common::folder();
    let city = common::city(folder.path(), "30K", "1K");
    let instanced = folder.path().join("instanced.bricks");
    let words = ["scene", "city", "--instanced", "--triangles", "60K", "--brick-triangles", "1K", "-o"];
    common::succeed(words.iter().map(std::ffi::OsStr::new).chain([instanced.as_os_str()]));
    assert!(!open_scene(&instanced).expect("the scene").resident().instances.is_empty());
    for scene in [city, instanced] {
        let [near, far] =
            ["near.json", "far.json"].map(|name| CameraPath::read(&scene.with_extension(name)).expect("a path"));
        let mut renderer = open(&scene, "--size 56x40 --tile 8 --cache 20% --schedule chc --fronts on");
        let mut pulled_up = 0;
        for k in 0..8 {
            // A walk, a cut, and back.
            let camera = if (4..6).contains(&k) { far.frame(k, 8) } else { near.frame(k, 8) };
            let output = renderer.frame(k, &camera).expect("a frame");
            pulled_up += total(&output.records, |r| r.pulled_up);
            let fronts = renderer.fronts.as_ref().expect("fronts");
            assert!(fronts.states() >= 8, "{} visibility states", fronts.states());
            assert_eq!(fronts.partition_defect(renderer.scene.resident()), None, "{}, frame {k}", scene.display());
        }
        assert!(pulled_up > 0, "pairs were collapsed on the way");
    }
}

/// Renders `frames` of `path`, then those after a cut to another, in one renderer; and the latter in a fresh one.
/// Returns both, and the last frame before the cut.
fn cut(scene: &Path, options: &str) -> (Vec<FrameOutput>, Vec<FrameOutput>, FrameOutput) {
    const BEFORE: u32 = 5;
    const AFTER: u32 = 3;
    let [near, far] =
        ["near.json", "far.json"].map(|name| CameraPath::read(&scene.with_extension(name)).expect("a path"));
    let mut walking = open(scene, options);
    let mut before = None;
    for k in 0..BEFORE {
        before = Some(walking.frame(k, &near.frame(k, BEFORE)).expect("a frame"));
    }
    let mut fresh = open(scene, options);
    let after = |renderer: &mut Renderer| {
        (BEFORE..BEFORE + AFTER)
            .map(|k| renderer.frame(k, &far.frame(k, BEFORE + AFTER)).expect("a frame"))
            .collect::<Vec<_>>()
    };
    (after(&mut walking), after(&mut fresh), before.expect("a frame before the cut"))
}

#[test]
fn a_cut_is_a_cold_start() {
    let folder = common::folder();
    let scene = common::polished_city(folder.path(), 40_000, 1000);
    for (fronts, cache) in [("off", "20%"), ("on", "20%"), ("on", "100%")] {
        let options = format!("--size 72x48 --tile 16 --schedule chc --cache {cache} --fronts {fronts}");
        let (after, cold, before) = cut(&scene, &options);
        for (k, (after, cold)) in after.iter().zip(&cold).enumerate() {
            assert!(after.pixels == cold.pixels, "fronts {fronts}, cache {cache}: frame {k} after the cut differs");
        }
        assert!(after[0].pixels != before.pixels, "the cut shows");
        let (mut all, mut all_cold) = (0, 0);
        for (was, (now, cold)) in before.records.iter().zip(after[0].records.iter().zip(&cold[0].records)) {
            assert_eq!((was.pass, now.pass), (now.pass, cold.pass));
            println!(
                "fronts {fronts}, cache {cache}, {}: {} queries, cold {}",
                now.pass,
                now.queries(),
                cold.queries()
            );
            // Beyond what a cold start asks, each stale invisible pair is asked for once (in a multi-query that fails
            // one and a half times at most), each stale visible one once, and, while its brick is missing, before every
            // batch. Which bricks are resident changes what a batch holds, so no closed bound: 1.32 is the most that
            // was measured.
            assert!(
                2 * now.queries() <= 3 * cold.queries(),
                "{}: {} queries, cold {}",
                now.pass,
                now.queries(),
                cold.queries()
            );
            (all, all_cold) = (all + now.queries(), all_cold + cold.queries());
        }
        // 1.05 at most was measured.
        assert!(
            5 * all <= 6 * all_cold,
            "fronts {fronts}, cache {cache}: {all} queries after the cut, cold {all_cold}"
        );
    }
}
