//! Frames with a budget: they load no more, pixels that are said to be exact show what they show with everything
//! resident, and while the camera rests all become exact.

use crate::common::{adapters, folder, json, levelled_city as city, records, settings, succeed, walk};
use brickwalk::counters::Record;
use brickwalk::frame::{PixelState, Pixels};
use brickwalk::scene::Camera;
use brickwalk::session::{Frame, Session};
use brickwalk::settings::Group as _;
use std::path::{Path, PathBuf};

/// What a pixel shows, bit for bit.
fn words(pixels: &Pixels, at: usize) -> [u32; 11] {
    let [r, g, b] = pixels.radiance[at];
    let [x, y, z] = pixels.normal[at];
    let [u, v, w] = pixels.albedo[at];
    let mut words = [r, g, b, x, y, z, u, v, w, pixels.depth[at], 0.0].map(f32::to_bits);
    words[10] = pixels.id[at];
    words
}

/// Bytes that a frame has loaded.
fn loaded(frame: &Frame) -> u64 {
    let bytes = |r: &Record| r.bytes_bvh + r.bytes_geometry + r.bytes_attributes + r.bytes_textures;
    frame.records.iter().map(bytes).sum()
}

/// What comes of frames of a camera that jumps twice and then rests.
#[derive(Default, Debug)]
struct Outcome {
    exact: usize,
    /// Of those that are not exact, how many show something else.
    others: usize,
    /// Pixels that are not exact, of the last frame.
    left: usize,
    unresolved: usize,
}

/// Renders `frames` frames in three places with options beside `common` on an adapter, each against that of a session
/// without a budget.
fn compare(scene: &Path, adapter: &str, [common, options]: [&str; 2], frames: usize, budget: u64) -> Outcome {
    let common = format!("{common} --aov --path {}", scene.with_extension("near.json").display());
    let open = |options: &str| {
        let mut settings = settings(&format!("{common} {options}"));
        settings.set("adapter", adapter).expect("an adapter");
        Session::open(scene, &settings).expect("a session")
    };
    let [mut bounded, mut whole] = [format!("{options} --frame-budget {budget}B"), String::new()].map(|o| open(&o));
    let cameras: Vec<Camera> = [0, 6, 11].iter().map(|&at| whole.path().frame(at, 12)).collect();
    let mut outcome = Outcome::default();
    for camera in cameras.iter().flat_map(|camera| std::iter::repeat_n(camera, frames)) {
        let [found, truth]: [Frame; 2] = [&mut bounded, &mut whole].map(|of| of.frame(camera).expect("a frame"));
        assert!(truth.pixels.state.is_empty(), "a frame without a budget has no states");
        assert!(loaded(&found) <= budget, "frame {} loads {} bytes", found.number, loaded(&found));
        outcome.left = 0;
        for (at, state) in found.pixels.state.iter().enumerate() {
            let is_same = words(&found.pixels, at) == words(&truth.pixels, at);
            if *state == PixelState::Exact {
                assert!(is_same, "{options}: pixel {at} of frame {} is said to be exact", found.number);
                outcome.exact += 1;
            } else {
                outcome.left += 1;
                outcome.others += usize::from(!is_same);
                outcome.unresolved += usize::from(*state == PixelState::Unresolved);
            }
        }
        let primary = found.records.iter().find(|record| record.pass == "primary").expect("a record");
        let exact = found.pixels.state.len() - outcome.left;
        assert_eq!(primary.pixels_exact, exact as u64);
        assert!(primary.pixels_bounded <= outcome.left as u64);
    }
    outcome
}

#[test]
fn pixels_that_are_said_to_be_exact_are() {
    let folder = folder();
    let scene = city(folder.path());
    let shadows = "--size 320x180 --effects primary,shadow --spp 1";
    let all = "--size 96x64 --effects primary,shadow,ao,diffuse,glossy --ao-rays 2 --diffuse-rays 2 --spp 2";
    let mut exact = 0;
    for (common, options, frames, has_room) in [
        (shadows, "--cache 100%", 9, true),
        (shadows, "--cache 20%", 4, false),
        (&format!("{shadows} --lod 1"), "--cache 50%", 5, false),
        (all, "--cache 100%", 40, true),
        (all, "--cache 30%", 8, false),
    ] {
        let outcome = compare(&scene, "cpu", [common, options], frames, 200_000);
        // Controls: what is not said to be exact differs indeed, and levels stand in for all of it.
        assert!(outcome.others > 1000, "{common} {options}: {outcome:?}");
        assert!(outcome.exact > 1000, "{common} {options}: {outcome:?}");
        if has_room {
            assert_eq!((outcome.left, outcome.unresolved), (0, 0), "{common} {options}: {outcome:?}");
        }
        exact += outcome.exact;
    }
    assert!(exact > 1_000_000, "{exact}");
}

#[test]
fn devices_know_which_pixels_are_exact_too() {
    let folder = folder();
    let scene = city(folder.path());
    for adapter in adapters().iter().filter(|adapter| *adapter != "cpu") {
        let common = "--size 72x40 --effects primary,shadow,ao --ao-rays 1 --spp 1";
        let outcome = compare(&scene, adapter, [common, "--cache 100%"], 12, 200_000);
        assert!(outcome.exact > 1000 && outcome.others > 100 && outcome.left == 0, "{outcome:?}");
    }
}

#[test]
fn where_not_all_fits_the_cut_comes_to_rest() {
    let folder = folder();
    let scene = city(folder.path());
    let options = "--size 96x64 --effects primary,shadow --spp 1 --cache 6% --frame-budget 200K --adapter cpu";
    let mut session = Session::open(&scene, &settings(options)).expect("a session");
    let camera = session.path().frame(0, 2);
    let frames: Vec<Frame> = (0..24).map(|_| session.frame(&camera).expect("a frame")).collect();
    let is_exact = |frame: &Frame| frame.pixels.state.iter().all(|&state| state == PixelState::Exact);
    assert!(loaded(&frames[0]) > 0 && !is_exact(&frames[23]), "the cache holds what the camera sees");
    assert_eq!(frames[20..].iter().map(loaded).collect::<Vec<_>>(), [0; 4]);
    let unresolved =
        |frame: &Frame| frame.pixels.state.iter().filter(|&&state| state == PixelState::Unresolved).count();
    assert_eq!(unresolved(&frames[23]), 0, "levels stand in");
}

/// A city without levels of detail.
fn bare(folder: &Path) -> PathBuf {
    let scene = folder.join("bare.bricks");
    let words = ["scene", "city", "--triangles", "20K", "--brick-triangles", "500", "-o"];
    succeed(words.iter().map(std::ffi::OsStr::new).chain([scene.as_os_str()]));
    scene
}

#[test]
fn a_scene_without_levels_says_what_is_missing() {
    let folder = folder();
    let scene = bare(folder.path());
    let lit = compare(&scene, "cpu", ["--size 96x64 --effects primary,shadow --spp 1", ""], 12, 100_000);
    assert!(lit.unresolved > 50 && lit.others > 500 && lit.left == 0, "{lit:?}");
    // Cells stand in for what camera rays miss, and nothing for what throws shadows.
    for adapter in adapters() {
        let seen = compare(&scene, &adapter, ["--size 96x64 --effects primary --spp 1", ""], 12, 100_000);
        assert!(seen.unresolved == 0 && seen.others > 500 && seen.left == 0, "{adapter}: {seen:?}");
    }
}

#[test]
fn cells_stand_in_before_what_they_stand_for() {
    let folder = folder();
    let scene = bare(folder.path());
    let options = |more: &str| {
        let path = scene.with_extension("near.json");
        settings(&format!("--size 96x64 --effects primary --spp 1 --aov --path {} {more}", path.display()))
    };
    let [mut bounded, mut whole] =
        ["--frame-budget 60000B", ""].map(|more| Session::open(&scene, &options(more)).expect("a session"));
    let camera = whole.path().frame(0, 12);
    let [found, truth] = [&mut bounded, &mut whole].map(|of| of.frame(&camera).expect("a frame").pixels);
    let (mut stand_ins, mut farther) = (0, 0);
    for (pixel, state) in found.state.iter().enumerate().filter(|(_, state)| **state == PixelState::Bounded) {
        let [shown, true_depth] = [&found, &truth].map(|of| of.depth[pixel]);
        assert!(shown <= true_depth * 1.0001, "pixel {pixel}, {state:?}: {shown} lies behind {true_depth}");
        stand_ins += usize::from(shown < true_depth);
        // The control: without cells the ray goes on to what is there, or to nothing.
        farther += usize::from(found.id[pixel] == brickwalk::kernels::layout::NONE && shown.is_finite());
    }
    assert!(stand_ins > 500 && farther > 300, "{stand_ins} cells, {farther} of them before nothing");
    assert!(found.state.iter().all(|&state| state != PixelState::Unresolved));
    // Cells are as bright as what was seen, not black and not white.
    let mean = |pixels: &Pixels| pixels.radiance.iter().map(|c| f64::from(c[1])).sum::<f64>() / 6144.0;
    let ratio = mean(&found) / mean(&truth);
    assert!((0.5..2.0).contains(&ratio), "{ratio}");
}

#[test]
fn half_rate_shows_less_noise_by_fewer_rays_and_says_what_is_exact_of_it() {
    let folder = folder();
    let scene = bare(folder.path());
    for adapter in adapters() {
        let effects = "primary,shadow,ao,diffuse --ao-rays 1 --diffuse-rays 1";
        let mut settings = settings(&format!("--size 96x64 --effects {effects} --aov --frame-budget 60000B"));
        settings.set("adapter", &adapter).expect("an adapter");
        settings.path = Some(scene.with_extension("near.json"));
        let mut session = Session::open(&scene, &settings).expect("a session");
        let camera = session.path().frame(0, 12);
        let picture = |session: &mut Session, half: bool| {
            session.set_half_rate(half);
            session.picture(&camera, &mut ()).expect("a frame").expect("a frame")
        };
        let is_exact = |frame: &Frame| frame.pixels.state.iter().all(|&state| state == PixelState::Exact);
        let frames: Vec<Frame> = (0..40).map(|_| picture(&mut session, true)).collect();
        let half = frames.iter().find(|frame| is_exact(frame)).expect("all exact");
        // What is said to be exact is what it is with everything resident; the control: other pixels are not.
        let (mut exact, mut others) = (0, 0);
        for frame in &frames {
            for (pixel, state) in frame.pixels.state.iter().enumerate() {
                let is_same = words(&frame.pixels, pixel) == words(&half.pixels, pixel);
                assert!(is_same || *state != PixelState::Exact, "{adapter}: pixel {pixel} is said to be exact");
                (exact, others) = (exact + usize::from(is_same), others + usize::from(!is_same));
            }
        }
        assert!(exact > 10_000 && others > 3000, "{adapter}: {exact} and {others}");
        let whole = (0..40).map(|_| picture(&mut session, false)).find(is_exact).expect("all exact");
        let rays = |frame: &Frame| {
            let secondary = frame.records.iter().filter(|record| record.pass != "primary");
            secondary.map(|record| record.rays_traced).sum::<u64>()
        };
        assert!(3 * rays(half) < rays(&whole), "{} and {} rays", rays(half), rays(&whole));
        settings.set("spp", "64").expect("samples");
        session.set(&settings).expect("settings");
        let truth = picture(&mut session, false);
        let error = |frame: &Frame| {
            let pairs = frame.pixels.radiance.iter().zip(&truth.pixels.radiance);
            pairs.map(|(a, b)| f64::from(a[1] - b[1]).abs()).sum::<f64>()
        };
        assert!(error(half) < error(&whole), "{adapter}: {} and {}", error(half), error(&whole));
        assert!(half.pixels.depth == whole.pixels.depth, "camera rays are those of all pixels");
    }
}

#[test]
fn walks_write_states_and_count_them() {
    let folder = folder();
    let scene = city(folder.path());
    let path = scene.with_extension("near.json");
    for budget in ["200K", "25ms"] {
        let output = folder.path().join(budget);
        let options = format!("--frames 3 --size 96x64 --aov --frame-budget {budget} --adapter cpu");
        walk(&scene, &output, &format!("{options} --path {}", path.display()));
        let loaded = brickwalk::metrics::load(output.join("frames/0000.exr")).expect("a picture");
        let brickwalk::metrics::Channel::Integer(states) = &loaded.channels["state.id"] else { panic!("no integers") };
        let of = |state| states.iter().filter(|own| **own == state).count() as u64;
        let records = records(&output);
        let first = records.iter().find(|record| record["pass"] == "primary").expect("a record");
        assert_eq!([&first["pixels_exact"], &first["pixels_bounded"]], [of(0), of(1)]);
        assert_eq!(of(0) + of(1) + of(2), 96 * 64);
        assert!(first["schedule"] == "cut", "{first}");
        let summary = json(&output.join("summary.json"));
        assert!(summary["settings"]["frame_budget"].is_string(), "{}", summary["settings"]);
    }
}
