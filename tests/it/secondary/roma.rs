//! `walk --secondary roma` and `--secondary df`, the baseline: pictures against closed forms, what it loads and
//! records, that it is the same again and again.

use crate::common::{self, city, converted, folder, frames, sheet, sum, walk_on_threads};
use brickwalk::frame::{FrameOutput, Renderer};
use brickwalk::kernels::layout::NONE;
use brickwalk::reference::Truth;
use brickwalk::scene::Camera;
use brickwalk::schedule::{Pass, Step};
use brickwalk::secondary::occupancy::{Settings, assemble};
use brickwalk::secondary::roma::RomaPart;
use brickwalk::secondary::roma::answer::Roma;
use brickwalk::secondary::roma::handover::Trust;
use brickwalk::session::open_scene;
use glam::DVec3;
use serde_json::Value;
use std::path::{Path, PathBuf};

const SIZE: usize = 48;

/// A floor of 8 m by 8 m and, 2 m high, a wall along its middle, all in squares of 1/4 m; bricks of 64 triangles have
/// resident cells of 1/8 m.
fn scene(folder: &Path, wall: bool) -> PathBuf {
    let (mut text, mut count) = (String::new(), 0);
    sheet(&mut text, &mut count, DVec3::new(-4.0, 0.0, -4.0), [DVec3::X * 8.0, DVec3::Z * 8.0], [32, 32]);
    if wall {
        sheet(&mut text, &mut count, DVec3::new(-4.0, 0.0, 0.0), [DVec3::X * 8.0, DVec3::Y * HEIGHT], [32, 8]);
    }
    converted(folder, &text, "--brick-triangles 64")
}

const HEIGHT: f64 = 2.0;

fn renderer(scene: &Path, options: &str) -> Renderer {
    let own = format!("--size {SIZE}x{SIZE} --tile 16 --cache 100% --schedule plain --aov --sun-intensity 0");
    common::renderer(scene, &format!("{own} --ao-length 100 --ao-rays 16 --rotation full {options}"))
}

/// Above the floor, looking down on the part of it before the wall.
fn eye() -> Camera {
    Camera {
        position: DVec3::new(0.0, 3.5, 1.7),
        target: DVec3::new(0.0, 0.0, 1.7),
        up: -DVec3::Z,
        fov_y: 52f64.to_radians(),
    }
}

/// Distance from the wall of the point of the floor that a pixel shows.
fn before_wall(pixel: usize) -> f64 {
    let row = (pixel / SIZE) as f64 + 0.5;
    1.7 + (row / SIZE as f64 - 0.5) * 2.0 * 3.5 * 26f64.to_radians().tan()
}

/// Occlusion, 0 to 1, of the pixels that show the floor, by their distance from the wall: unoccluded light by the
/// picture without.
fn openness(folder: &Path, wall: bool, options: &str) -> Vec<(f64, f64)> {
    let scene = scene(folder, wall);
    let bare = renderer(&scene, "--effects primary").frame(0, &eye()).expect("a frame");
    let output = renderer(&scene, &format!("--effects ao {options}")).frame(0, &eye()).expect("a frame");
    assert!(output.pixels.radiance.iter().flatten().all(|x| x.is_finite()));
    let of = |i: usize| f64::from(output.pixels.radiance[i][1]) / f64::from(bare.pixels.radiance[i][1]);
    let floor = (0..SIZE * SIZE).filter(|&i| output.pixels.normal[i][1] > 0.9);
    floor.map(|i| (before_wall(i), of(i))).collect()
}

/// What a point `d` before the middle of a wall of height `h` and width 8 sees of the sky: the form factors of the
/// halves of the wall (Howell, "A Catalog of Radiation Heat Transfer Configuration Factors", B-4).
fn truth(d: f64, h: f64) -> f64 {
    let half = 4.0;
    let (x, y) = (h / half, d / half);
    let r = (x * x + y * y).sqrt();
    1.0 - 2.0 / std::f64::consts::TAU * ((1.0 / y).atan() - y / r * (1.0 / r).atan())
}

/// Metres before the wall at which pixels are looked at.
const BEFORE: [f64; 5] = [0.6, 1.0, 1.5, 2.0, 3.0];

/// What pixels `d` before the wall see on the average.
fn mean(pixels: &[(f64, f64)], d: f64) -> f64 {
    let near: Vec<f64> = pixels.iter().filter(|p| (p.0 - d).abs() < 0.1).map(|p| p.1).collect();
    assert!(near.len() > 40, "{} pixels at {d}", near.len());
    near.iter().sum::<f64>() / near.len() as f64
}

#[test]
fn occlusion_before_a_wall_is_that_of_the_closed_form_but_for_cells() {
    let folder = folder();
    let cell = 1.0 / 8.0;
    let exact = openness(folder.path(), true, "--spp 2");
    let roma = openness(folder.path(), true, "--secondary roma --spp 4");
    let unsnapped = openness(folder.path(), true, "--secondary roma --spp 4 --roma-unsnapped all --roma-steps 64");
    for d in BEFORE {
        let expected = truth(d, HEIGHT);
        let [exact, roma, unsnapped] = [&exact, &roma, &unsnapped].map(|pixels| mean(pixels, d));
        println!(
            "{d} m before the wall: closed form {expected:.4}, exact {exact:.4}, roma {roma:.4}, unsnapped \
             {unsnapped:.4}"
        );
        assert!((exact - expected).abs() < 0.02, "{exact} instead of {expected}");
        // Cells mark what is up to one of theirs aside, maps see them up to one of their own, 1.75 as long, aside, and
        // rays start 1.25 of these above the floor, which hides as much of the wall.
        let darkest = truth(d - 2.75 * cell, HEIGHT + 2.75 * cell);
        let brightest = truth(d + 1.75 * cell, HEIGHT - (1.25 + 1.0) * 1.75 * cell);
        for found in [roma, unsnapped] {
            assert!(found > darkest - 0.02 && found < brightest + 0.02, "{found} is not in {darkest} to {brightest}");
        }
    }
    // Control: it is the wall that is seen.
    assert!(mean(&roma, 0.6) < 0.85 && mean(&roma, 3.0) > mean(&roma, 0.6) + 0.1);
}

/// Half the width of a courtyard, and the height of its walls, metres.
const COURTYARD: [f64; 2] = [8.0, 3.0];

/// What a point of a courtyard's floor, so far from the four walls of height `h`, sees of the sky: the form factors of
/// the four parts of the opening (Howell, B-3).
fn truth_in_courtyard(distances: [f64; 4], h: f64) -> f64 {
    let part = |x: f64, z: f64| {
        let (a, b) = (x / h, z / h);
        let term = |a: f64, b: f64| a / (1.0 + a * a).sqrt() * (b / (1.0 + a * a).sqrt()).atan();
        (term(a, b) + term(b, a)) / std::f64::consts::TAU
    };
    let [left, right, back, front] = distances;
    part(left, back) + part(left, front) + part(right, back) + part(right, front)
}

/// Rays near the horizon, which low walls meet, are few: in a stratum of 40 degrees an evenly drawn direction has them
/// twice as often as the cosine.
#[test]
fn low_walls_occlude_by_the_cosine() {
    let folder = folder();
    let (mut text, mut count) = (String::new(), 0);
    let [half, height] = COURTYARD;
    let up = DVec3::Y * height;
    sheet(&mut text, &mut count, DVec3::new(-half, 0.0, -half), [DVec3::Z, DVec3::X].map(|x| 2.0 * half * x), [64; 2]);
    for (x, z) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        let along = DVec3::new(-z - x, 0.0, x - z) * half;
        sheet(&mut text, &mut count, DVec3::new(x, 0.0, z) * half, [along, up], [64, 12]);
    }
    let scene = converted(folder.path(), &text, "--brick-triangles 64");
    let mut renderer = renderer(&scene, "--effects ao --secondary roma");
    let eye = Camera { position: DVec3::new(0.0, 9.0, 0.0), target: DVec3::ZERO, up: -DVec3::Z, fov_y: 0.7 };
    // All by the maps of the same samples.
    let ways = [(0, RomaPart::Cosine), (64, RomaPart::Whole), (0, RomaPart::Whole)];
    let mut free = [0u64; 3];
    let (mut asked, mut expected, mut pixels) = (0u64, [0.0; 3], 0);
    for seed in 0..96 {
        renderer.settings.seed = seed;
        let output = renderer.frame(0, &eye).expect("a frame");
        let maps = renderer.methods.get::<Roma>().expect("maps").maps().clone();
        let floor: Vec<usize> =
            (0..SIZE * SIZE).filter(|&i| output.pixels.normal[i][1] > 0.9 && output.pixels.depth[i] > 8.0).collect();
        assert_eq!(floor.len(), SIZE * SIZE, "nothing else is seen");
        for i in 0..16 {
            // Other directions in every sample, as those of a walk are.
            let pass = Pass::Occlusion(16 * seed + i);
            for (free, (steps, part)) in free.iter_mut().zip(ways) {
                let steps = [Step::Generate, maps.trace(steps, part)];
                let brickwalk::frame::Engine { executor, cache, .. } = &mut renderer.engine;
                executor.run(pass, &steps, &cache.states).expect("rays");
                let hits = renderer.executor.read_hits(pass).expect("hits");
                *free += floor.iter().filter(|&&i| hits[i].id == NONE).count() as u64;
            }
            asked += floor.len() as u64;
        }
    }
    let cell = 1.0 / 8.0;
    let edge = 2.0 * 9.0 * 0.35f64.tan() / SIZE as f64;
    for i in 0..SIZE * SIZE {
        let place = |i: usize| (i as f64 + 0.5 - SIZE as f64 / 2.0) * edge;
        let (x, z) = (place(i % SIZE), place(i / SIZE));
        let at = |nearer: f64, h: f64| truth_in_courtyard([x, -x, z, -z].map(|x| half + x - nearer), h);
        // The bounds of the wall above.
        let bounds = [(0.0, height), (2.75 * cell, height + 2.75 * cell), (-1.75 * cell, height - 2.25 * 1.75 * cell)];
        bounds.iter().zip(&mut expected).for_each(|(&(nearer, h), sum)| *sum += at(nearer, h));
        pixels += 1;
    }
    let [expected, darkest, brightest] = expected.map(|sum| sum / f64::from(pixels));
    let [drawn, unsnapped, nearest] = free.map(|free| free as f64 / asked as f64);
    println!(
        "closed form {expected:.4}, {darkest:.4} to {brightest:.4} with cells: drawn by the cosine {drawn:.4}, rays as \
         they are {unsnapped:.4}, the map of the ray's stratum {nearest:.4}"
    );
    assert!(drawn > darkest && drawn < brightest, "{drawn} is not in {darkest} to {brightest}");
    // Rays that keep their direction meet the same cells, but for those beside the one column that snapped ones look
    // at.
    let off = |free: f64| (1.0 - free) / (1.0 - unsnapped) - 1.0;
    assert!(off(drawn).abs() < 0.15, "{drawn} instead of {unsnapped}");
    // Control: the direction of the nearest map is not drawn by the cosine.
    assert!(off(nearest) > 0.2, "{nearest} instead of {unsnapped}");
}

/// Root mean square difference of what pixels see of the sky.
fn apart(a: &[(f64, f64)], b: &[(f64, f64)]) -> f64 {
    assert_eq!(a.len(), b.len());
    (a.iter().zip(b).map(|(a, b)| (a.1 - b.1) * (a.1 - b.1)).sum::<f64>() / a.len() as f64).sqrt()
}

/// Rays of ao of a frame that are traced.
fn rays_of_ao(scene: &Path, options: &str) -> u64 {
    let output = renderer(scene, &format!("--effects ao {options}")).frame(0, &eye()).expect("a frame");
    output.records.iter().filter(|r| r.pass == "ao").map(|r| r.rays_traced).sum()
}

#[test]
fn rays_that_maps_find_free_are_not_traced() {
    let folder = folder();
    let scene = scene(folder.path(), true);
    let of = |options: &str| openness(folder.path(), true, &format!("--spp 16 {options}"));
    let (exact, roma, auto) = (of(""), of("--secondary roma"), of("--secondary sift --auto-error off"));
    let (error_of_maps, error) = (apart(&roma, &exact), apart(&auto, &exact));
    println!("maps alone {error_of_maps:.4}, all in doubt traced {error:.4}");
    assert!(error < 0.5 * error_of_maps, "{error} is not half of {error_of_maps}");
    let [all, doubt] = ["", "--secondary sift --auto-error off"].map(|options| rays_of_ao(&scene, options));
    assert_eq!(all, (SIZE * SIZE * 16) as u64);
    let share = doubt as f64 / all as f64;
    println!("traced: {share:.3}");
    assert!(share > 0.1 && share < 0.8, "{share}");
}

#[test]
fn traced_rays_correct_what_maps_get_wrong() {
    let folder = folder();
    let scene = scene(folder.path(), true);
    let of = |options: &str| openness(folder.path(), true, &format!("--spp 64 {options}"));
    let exact = of("");
    let cells = "--roma-size 64";
    let mean = |pixels: &[(f64, f64)]| pixels.iter().map(|p| p.1).sum::<f64>() / pixels.len() as f64;
    let measured = |options: &str| {
        let found = of(options);
        ((mean(&found) - mean(&exact)).abs(), apart(&found, &exact))
    };
    let (bias_of_maps, error_of_maps) = measured(&format!("--secondary roma {cells}"));
    println!("maps alone: bias {bias_of_maps:.5}, error {error_of_maps:.4}");
    let mut before = 0.0;
    for one_in in [2, 4, 16] {
        let (bias, error) = measured(&format!("--secondary sift --auto-one-in {one_in} {cells}"));
        println!("one in {one_in}: bias {bias:.5}, error {error:.4}");
        // Control: maps alone are too dark or too bright.
        assert!(bias < 0.2 * bias_of_maps, "one in {one_in}");
        assert!(error < error_of_maps || one_in == 16, "one in {one_in}");
        // The fewer are traced the noisier.
        assert!(error > before, "one in {one_in}: {error}");
        before = error;
        let all = (SIZE * SIZE * 16) as f64;
        let traced = rays_of_ao(&scene, &format!("--secondary sift --auto-one-in {one_in} {cells}")) as f64;
        assert!((traced / all * f64::from(one_in) - 1.0).abs() < 0.05, "one in {one_in}: {traced} of {all}");
    }
}

#[test]
fn maps_answer_what_measured_errors_allow() {
    let folder = folder();
    let scene = scene(folder.path(), true);
    let walk = |options: &str| {
        let mut renderer = renderer(&scene, &format!("--effects ao --spp 4 {options}"));
        // What is measured in the first picture decides of the second.
        let pictures = [0, 1].map(|frame| renderer.frame(frame, &eye()).expect("a frame"));
        (pictures, renderer.methods.get::<Roma>().map(|roma| roma.handovers()[0]).unwrap_or_default())
    };
    let seen = |output: &FrameOutput| output.pixels.radiance.iter().map(|x| x[1] as f64).collect::<Vec<_>>();
    let ([_, exact], _) = walk("");
    let ([_, alone], _) = walk("--secondary roma --roma-unsnapped all --roma-steps 64 --roma-samples 4");
    let mut before = f64::INFINITY;
    for (percent, least_trust) in [(50.0, Trust::Beyond(0)), (2.0, Trust::Beyond(32)), (0.1, Trust::Nothing)] {
        let options = format!("--secondary sift --auto-error {percent}");
        let ([_, output], measured) = walk(&options);
        let trust = measured.trust((1e4 * percent) as u32);
        let wrong = measured.share_wrong(trust);
        let sum = |pixels: &[f64]| pixels.iter().sum::<f64>();
        let (all, found, of_maps) = (sum(&seen(&exact)), sum(&seen(&output)), sum(&seen(&alone)));
        println!(
            "{percent} %: trusted with {trust}, wrong {wrong:.4}, light {:.4}, of maps alone {:.4}",
            found / all - 1.0,
            of_maps / all - 1.0
        );
        assert!(wrong <= percent / 100.0);
        assert!(wrong <= before, "errors fall");
        before = wrong;
        let places = |trust| Trust::all().position(|other| other == trust);
        assert!(places(trust) <= places(least_trust), "{trust}");
        if trust == Trust::Nothing {
            assert!(output.pixels.radiance == exact.pixels.radiance, "all rays are traced");
        } else {
            assert!(output.pixels.radiance != exact.pixels.radiance, "control: maps answer some");
        }
        // What is answered wrongly makes as much darker or brighter at most.
        assert!((found / all - 1.0).abs() <= wrong + 0.02, "{found} of {all}");
    }
}

#[test]
fn rays_too_short_for_maps_are_traced() {
    let folder = folder();
    let scene = scene(folder.path(), true);
    // Cells of bricks are 1/32 m and 1/16 m wide.
    let frame = |length: f64, secondary: &str| {
        let mut renderer = renderer(&scene, &format!("--effects ao --secondary {secondary}"));
        renderer.settings.effects.occlusion.as_mut().expect("ao").length = length;
        let output = renderer.frame(0, &eye()).expect("a frame");
        let rays: u64 = output.records.iter().filter(|r| r.pass == "ao").map(|r| r.rays_traced).sum();
        (output.pixels.radiance, rays)
    };
    assert_eq!(frame(0.05, "sift"), frame(0.05, "exact"));
    assert!(frame(1.0, "sift").1 < frame(1.0, "exact").1, "control: of longer ones maps answer some");
}

#[test]
fn a_plane_hardly_occludes_itself() {
    let folder = folder();
    for options in
        ["--secondary roma", "--secondary roma --roma-unsnapped all", "--secondary roma --roma-size 32 --roma-k 8"]
    {
        let pixels = openness(folder.path(), false, &format!("{options} --spp 2"));
        assert_eq!(pixels.len(), SIZE * SIZE);
        let least = pixels.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
        let mean = pixels.iter().map(|p| p.1).sum::<f64>() / pixels.len() as f64;
        println!("{options}: mean {mean:.5}, least {least:.3}");
        // Maps turned and moved most unluckily see it from where rays start (`LIFT_CELLS`).
        assert!((0.995..1.0001).contains(&mean) && least > 0.75, "{options}: mean {mean}, least {least}");
    }
    // Control: a wall does.
    let pixels = openness(folder.path(), true, "--secondary roma");
    assert!(pixels.iter().map(|p| p.1).sum::<f64>() / (pixels.len() as f64) < 0.95);
}

const VIEW: &str = "--frames 2 --size 64x48 --tile 16 --effects shadow,ao --ao-rays 4 --ao-length 8";

fn walk_of(scene: &Path, output: &Path, options: &str, threads: &str) -> Vec<Value> {
    let path = scene.with_extension("near.json");
    walk_on_threads(scene, output, &format!("{VIEW} {options} --path {}", path.display()), threads)
}

#[test]
fn no_brick_is_loaded_for_its_rays() {
    let folder = folder();
    let scene = city(folder.path(), "40K", "1K");
    let of = |options: &str| {
        walk_of(&scene, &folder.path().join("out"), &format!("--adapter cpu --cache 30% {options}"), "2")
    };
    let (exact, roma) = (of("--secondary exact"), of("--secondary ao=roma,shadow=roma"));
    for pass in ["shadow", "ao"] {
        for field in ["bricks_loaded", "bricks_needed", "bytes_bvh", "bytes_geometry", "queries", "load_batches"] {
            assert_eq!(sum(&roma, pass, field), 0.0, "{pass} {field}");
        }
        // The same rays, answered otherwise; maps and rays have times of their own.
        assert_eq!(sum(&roma, pass, "rays"), sum(&exact, pass, "rays"));
        assert!(sum(&roma, pass, "ms_phase1") > 0.0 && sum(&roma, pass, "ms_phase3") > 0.0);
        assert_eq!(sum(&roma, pass, "ms_phase2"), 0.0);
    }
    assert_eq!(sum(&roma, "ao", "round_trips"), 2.0 * 4.0);
    assert_eq!(sum(&roma, "shadow", "round_trips"), 2.0);
    assert!(sum(&roma, "primary", "bricks_loaded") > 0.0);
    assert!(sum(&exact, "ao", "bricks_needed") > 0.0, "the control needs some");
}

#[test]
fn each_effect_has_a_method_of_its_own_and_the_sun_is_traced_unless_asked() {
    let folder = folder();
    let scene = city(folder.path(), "40K", "1K");
    let of = |secondary: &str| {
        let options = format!("--adapter cpu --cache 100% --df-size 64 --roma-size 64 --secondary {secondary}");
        let records = walk_of(&scene, &folder.path().join("out"), &options, "2");
        ["shadow", "ao"].map(|pass| ["rays_traced", "rays_answered"].map(|field| sum(&records, pass, field)))
    };
    let [[shadow, _], [ao, _]] = of("exact");
    assert!(shadow > 1000.0 && ao > 1000.0);
    for (secondary, is_answered) in [
        ("roma", [false, true]),
        ("df", [false, true]),
        ("shadow=roma", [true, false]),
        ("ao=df,shadow=roma", [true, true]),
        ("ao=roma,shadow=df", [true, true]),
        ("dvf", [false, false]),
    ] {
        let expected = [shadow, ao].map(|all| [all, 0.0]);
        let expected = [0, 1].map(|i| if is_answered[i] { [0.0, expected[i][0]] } else { expected[i] });
        assert_eq!(of(secondary), expected, "{secondary}");
    }
    let [[_, answered], [traced, freed]] = of("sift");
    assert!(answered == 0.0 && traced > 0.0 && freed > 0.0 && traced + freed == ao);
}

#[test]
fn it_is_the_same_whatever_the_threads_and_the_cache() {
    let folder = folder();
    let scene = city(folder.path(), "40K", "1K");
    let picture = |options: &str, threads: &str| {
        let output = folder.path().join("out");
        let method = if options.contains("--secondary") { "" } else { "--secondary ao=roma,shadow=roma" };
        let cells = if options.contains("--roma-size") { "" } else { "--roma-size 64" };
        walk_of(&scene, &output, &format!("--adapter cpu {method} {cells} {options}"), threads);
        let all = frames(&output);
        std::fs::remove_dir_all(&output).expect("a folder");
        all
    };
    let one = picture("--cache 100%", "1");
    assert_eq!(one.len(), 2);
    for (options, threads) in [("--cache 100%", "3"), ("--cache 20%", "2"), ("--cache 30% --schedule demand", "2")] {
        assert!(picture(options, threads) == one, "{options}, {threads} threads");
    }
    let hybrid = picture("--cache 100% --secondary ao=sift,shadow=sift", "1");
    assert!(hybrid != one && picture("--cache 20% --secondary ao=sift,shadow=sift --schedule demand", "3") == hybrid);
    let corrected = picture("--cache 100% --secondary ao=sift,shadow=sift --auto-one-in 3", "1");
    assert!(corrected != one && corrected != hybrid);
    assert!(picture("--cache 20% --secondary ao=sift,shadow=sift --auto-one-in 3 --schedule demand", "3") == corrected);
    for other in ["--seed 1", "--roma-k 8", "--roma-size 32", "--roma-samples 1", "--roma-unsnapped all"] {
        assert!(picture(&format!("--cache 100% {other}"), "2") != one, "{other} must show");
    }
}

/// Points of all triangles that lie in a level's cube and in an empty cell of it, of so many, and the share of cells
/// that are occupied.
fn unmarked(scene: &Path, camera: DVec3) -> (usize, usize, f64) {
    let file = open_scene(scene).expect("a scene");
    let truth = Truth::load(&file).expect("triangles");
    let (mut empty, mut of, mut occupied, mut cells) = (0, 0, 0u64, 0u64);
    let settings = Settings { cells: 64, ..Settings::default() };
    for bom in assemble(&file, &settings, camera).expect("occupancy").levels {
        let side = f64::from(bom.cell_log2).exp2();
        for [a, b, c] in truth.ids().filter_map(|id| truth.vertices(id)).map(|t| t.map(DVec3::from)) {
            for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.3, 0.3), (0.5, 0.5), (0.1, 0.6)] {
                let at = ((a + u * (b - a) + v * (c - a)) / side).floor();
                let cell = [0, 1, 2].map(|k| at[k] as i64 - bom.first[k]);
                if cell.iter().all(|x| (0..64).contains(x)) {
                    of += 1;
                    empty += usize::from(!bom.is_occupied(cell));
                }
            }
        }
        occupied += bom.words().iter().map(|word| u64::from(word.count_ones())).sum::<u64>();
        cells += 64 * 64 * 64;
    }
    (empty, of, occupied as f64 / cells as f64)
}

#[test]
fn what_is_resident_marks_all_that_is_there() {
    let folder = folder();
    for options in [&["--instanced"][..], &[]] {
        let scene = folder.path().join("city.bricks");
        let words = ["scene", "city", "--triangles", "40K", "--brick-triangles", "1K", "-o"].map(AsRef::as_ref);
        let options = options.iter().map(AsRef::as_ref);
        common::succeed(words.into_iter().chain([scene.as_os_str()]).chain(options));
        for camera in [DVec3::new(2.0, 1.7, 1.0), DVec3::new(-30.3, 9.0, 12.0), DVec3::new(400.0, 50.0, 0.0)] {
            let (empty, of, share) = unmarked(&scene, camera);
            assert!(empty == 0 && of > 10_000, "{empty} of {of}");
            assert!(share > 1e-4 && share < 0.5, "{share} of all cells");
        }
    }
}

#[test]
fn scenes_without_occupancy_are_refused() {
    let folder = folder();
    let scene = folder.path().join("bare.bricks");
    let words = ["scene", "city", "--triangles", "20K", "--no-proxies", "-o"].map(AsRef::as_ref);
    common::succeed(words.into_iter().chain([scene.as_os_str()]));
    let out = folder.path().join("out");
    let words = ["walk".as_ref(), scene.as_os_str(), "-o".as_ref(), out.as_os_str()];
    for secondary in ["roma", "df"] {
        let options =
            ["--secondary", secondary, "--adapter", "cpu", "--frames", "1", "--size", "32x24"].map(AsRef::as_ref);
        let output = common::brickwalk(words.into_iter().chain(options));
        assert_eq!(output.status.code(), Some(1));
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        let is_named = text.contains(&format!("--secondary {secondary}"));
        assert!(is_named && text.contains("bare.bricks") && text.contains("without --no-proxies"), "{text}");
    }
}

#[test]
fn occlusion_by_distance_fields_is_that_of_the_closed_form_but_for_cells() {
    let folder = folder();
    let cell = 1.0 / 8.0;
    let pixels = openness(folder.path(), true, "--secondary df --spp 4");
    let mean = |d: f64| {
        let near: Vec<f64> = pixels.iter().filter(|p| (p.0 - d).abs() < 0.1).map(|p| p.1).collect();
        assert!(near.len() > 40, "{} pixels at {d}", near.len());
        near.iter().sum::<f64>() / near.len() as f64
    };
    for d in [0.6, 1.0, 1.5, 2.0, 3.0] {
        let (expected, found) = (truth(d, HEIGHT), mean(d));
        println!("{d} m before the wall: closed form {expected:.4}, df {found:.4}");
        // The middle of a cell that is marked is at most one aside or above, and is hit from half of one away; rays
        // start 3/2 above the floor, which hides as much of the wall.
        let darkest = truth(d - 1.5 * cell, HEIGHT + 1.5 * cell);
        let brightest = truth(d, HEIGHT - 1.5 * cell);
        assert!(found > darkest - 0.02 && found < brightest + 0.02, "{found} is not in {darkest} to {brightest}");
    }
    // Control: it is the wall that is seen.
    assert!(mean(0.6) < 0.85 && mean(3.0) > mean(0.6) + 0.1);
}

#[test]
fn a_plane_hardly_occludes_itself_in_distance_fields() {
    let folder = folder();
    let mean = |options: &str| {
        let pixels = openness(folder.path(), false, &format!("--secondary df {options}"));
        assert_eq!(pixels.len(), SIZE * SIZE);
        pixels.iter().map(|p| p.1).sum::<f64>() / pixels.len() as f64
    };
    for options in ["", "--df-size 32", "--df-steps 16"] {
        let open = mean(options);
        println!("{options}: mean {open:.5}");
        assert!((0.999..1.0001).contains(&open), "{options}: mean {open}");
    }
    // Control: rays that start within cells are stopped there.
    assert!(mean("--df-lift 0.25") < 0.01);
}

#[test]
fn distance_fields_are_made_once_and_load_no_brick() {
    let folder = folder();
    let scene = city(folder.path(), "40K", "1K");
    let of = |options: &str| {
        walk_of(&scene, &folder.path().join("out"), &format!("--adapter cpu --cache 30% {options}"), "2")
    };
    let df = "--secondary ao=df,shadow=df --df-size 64";
    let (exact, field, few) = (of("--secondary exact"), of(df), of(&format!("{df} --df-steps 2")));
    for pass in ["shadow", "ao"] {
        for name in ["bricks_loaded", "bricks_needed", "bytes_bvh", "bytes_geometry", "queries", "load_batches"] {
            assert_eq!(sum(&field, pass, name), 0.0, "{pass} {name}");
        }
        assert_eq!(sum(&field, pass, "rays"), sum(&exact, pass, "rays"));
        assert!(sum(&field, pass, "ms_phase3") > 0.0);
        assert_eq!(sum(&field, pass, "ms_phase2"), 0.0);
        // Rays that may look up but twice hardly end by then.
        assert!(sum(&few, pass, "rays_capped") > sum(&field, pass, "rays_capped").max(100.0), "{pass}");
    }
    // What the first pass of a frame has made serves the others.
    assert!(sum(&field, "shadow", "ms_phase1") > 0.0);
    assert_eq!(sum(&field, "ao", "ms_phase1"), 0.0);
    assert_eq!(sum(&field, "ao", "round_trips"), 2.0 * 4.0);
    assert!(sum(&field, "primary", "bricks_loaded") > 0.0);
    assert!(sum(&exact, "ao", "bricks_needed") > 0.0, "the control needs some");
}

#[test]
fn distance_fields_are_the_same_whatever_the_threads_and_the_cache() {
    let folder = folder();
    let scene = city(folder.path(), "40K", "1K");
    let picture = |options: &str, threads: &str| {
        let output = folder.path().join("out");
        walk_of(&scene, &output, &format!("--adapter cpu --secondary ao=df,shadow=df {options}"), threads);
        let all = frames(&output);
        std::fs::remove_dir_all(&output).expect("a folder");
        all
    };
    let one = picture("--cache 100% --df-size 64", "1");
    assert_eq!(one.len(), 2);
    for (options, threads) in [("--cache 20%", "3"), ("--cache 30% --schedule demand", "2")] {
        assert!(picture(&format!("{options} --df-size 64"), threads) == one, "{options}, {threads} threads");
    }
    for other in ["--df-size 32", "--df-size 64 --df-steps 3", "--df-size 64 --df-lift 3", "--df-size 64 --df-hit 0.75"]
    {
        assert!(picture(&format!("--cache 100% {other}"), "2") != one, "{other} must show");
    }
}
