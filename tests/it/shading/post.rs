//! Denoising and temporal anti-aliasing, frame after frame, against pictures of many samples.

use crate::common;
use brickwalk::frame::{Equirectangular, FrameOutput, Guides, Light, Moved, Renderer, SampleNoise, Seen, environment};
use brickwalk::kernels::Lamps;
use brickwalk::metrics::{Image, PIXELS_PER_DEGREE, flip_ldr};
use brickwalk::picture::denoise::{Denoiser, Taa};
use brickwalk::scene::{Camera, Projection};
use glam::{DVec3, Vec3};
use std::path::{Path, PathBuf};
use std::sync::Arc;

const WIDTH: usize = 96;
const HEIGHT: usize = 54;
/// Samples a pixel of truth, each with four rays of diffuse light.
const TRUTH: u32 = 256;

/// A court of coloured walls, boxes and a colonnade: shadows, corners, narrow things in front of others.
fn court(folder: &Path) -> PathBuf {
    let mut vertices = String::new();
    let mut faces = String::new();
    let mut count = 0;
    let mut solid = |min: [f64; 3], max: [f64; 3], material: &str| {
        for corner in 0..8 {
            let at = |k: usize| if corner >> k & 1 == 1 { max[k] } else { min[k] };
            vertices += &format!("v {} {} {}\n", at(0), at(1), at(2));
        }
        faces += &format!("usemtl {material}\n");
        for [a, b, c, d] in [[1, 3, 4, 2], [5, 6, 8, 7], [1, 2, 6, 5], [3, 7, 8, 4], [1, 5, 7, 3], [2, 4, 8, 6]] {
            faces += &format!("f {} {} {} {}\n", count + a, count + b, count + c, count + d);
        }
        count += 8;
    };
    solid([-8.0, -0.5, -8.0], [8.0, 0.0, 8.0], "floor");
    solid([-8.0, 0.0, -8.5], [8.0, 5.0, -8.0], "red");
    solid([-8.5, 0.0, -8.0], [-8.0, 5.0, 8.0], "green");
    solid([-8.0, 5.0, -8.0], [2.0, 5.3, -2.0], "white");
    solid([-5.0, 0.0, -5.5], [-3.0, 1.2, -3.5], "white");
    solid([-1.5, 0.0, -6.0], [0.5, 2.5, -4.5], "blue");
    for k in 0..4 {
        let x = -7.0 + 2.6 * f64::from(k);
        solid([x, 0.0, -2.4], [x + 0.4, 5.0, -2.0], "white");
    }
    let materials = "newmtl floor\nKd 0.6 0.55 0.5\nnewmtl red\nKd 0.7 0.2 0.15\nnewmtl green\nKd 0.25 0.55 0.2\n\
                     newmtl white\nKd 0.8 0.8 0.8\nnewmtl blue\nKd 0.2 0.3 0.7\n";
    std::fs::write(folder.join("court.mtl"), materials).expect("materials");
    let input = folder.join("court.obj");
    std::fs::write(&input, format!("mtllib court.mtl\n{vertices}{faces}")).expect("a shape");
    let scene = folder.join("court.bricks");
    common::succeed(["convert".as_ref(), input.as_os_str(), "-o".as_ref(), scene.as_os_str()]);
    scene
}

/// Renders the court with the options of `walk`, with the sun's shadows and diffuse light.
fn renderer(scene: &Path, options: &str) -> Renderer {
    renderer_of(scene, &format!("--effects shadow,diffuse {options}"))
}

fn renderer_of(scene: &Path, options: &str) -> Renderer {
    let own = format!("--size {WIDTH}x{HEIGHT} --tile 32 --cache 100% --schedule plain");
    common::renderer(scene, &format!("{own} {options}"))
}

/// Frame `k` of a walk sideways, past the colonnade.
fn eye(k: u32) -> Camera {
    let x = -3.0 + 0.05 * f64::from(k);
    Camera {
        position: DVec3::new(x, 1.7, 4.0),
        target: DVec3::new(x - 0.8, 1.6, -4.0),
        up: DVec3::Y,
        fov_y: 55f64.to_radians(),
    }
}

fn sun(direction: DVec3) -> Light {
    Light::new(direction, 0.53, 2.4, 0.35)
}

fn image(radiance: &[[f32; 3]]) -> Image {
    Image::from_fn(WIDTH, HEIGHT, |x, y| radiance[y * WIDTH + x])
}

fn flip(radiance: &[[f32; 3]], truth: &[[f32; 3]]) -> f64 {
    flip_ldr(&image(radiance), &image(truth), PIXELS_PER_DEGREE).expect("one size").mean()
}

/// Mean absolute error over channels, per pixel.
fn errors(radiance: &[[f32; 3]], truth: &[[f32; 3]]) -> Vec<f64> {
    let of = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).map(|k| f64::from((a[k] - b[k]).abs())).sum::<f64>() / 3.0;
    radiance.iter().zip(truth).map(of).collect()
}

fn rmse(radiance: &[[f32; 3]], truth: &[[f32; 3]]) -> f64 {
    let squares = radiance.iter().zip(truth).flat_map(|(a, b)| (0..3).map(move |k| f64::from(a[k] - b[k]).powi(2)));
    (squares.sum::<f64>() / (3 * WIDTH * HEIGHT) as f64).sqrt()
}

fn mean(values: impl Iterator<Item = f64>) -> (f64, usize) {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), x| (sum + x, count + 1));
    (sum / count.max(1) as f64, count)
}

fn guides(output: &mut FrameOutput) -> Guides {
    output.guides.take().expect("guides were asked for")
}

/// What the rays through the centres of pixels show: the mean over frames of one sample with other random numbers.
fn truth_at_centres(renderer: &mut Renderer, camera: &Camera) -> Vec<[f32; 3]> {
    let mut sums = vec![[0.0f64; 3]; WIDTH * HEIGHT];
    for sample in 0..TRUTH {
        let radiance = renderer.frame(1_000_000 + sample, camera).expect("a frame").pixels.radiance;
        sums.iter_mut().zip(radiance).for_each(|(sum, c)| (0..3).for_each(|k| sum[k] += f64::from(c[k])));
    }
    sums.iter().map(|sum| sum.map(|x| (x / f64::from(TRUTH)) as f32)).collect()
}

/// Frame `k`, and what is left of its noise.
fn denoised(renderer: &mut Renderer, denoiser: &mut Denoiser, k: u32, camera: &Camera) -> (Guides, Vec<[f32; 3]>) {
    let mut output = renderer.frame(k, camera).expect("a frame");
    let guides = guides(&mut output);
    denoiser.frame(guides.clone(), &mut output.pixels.radiance);
    (guides, output.pixels.radiance)
}

const NOISY: &str = "--denoise --diffuse-rays 1";
const CENTRES: &str = "--denoise --diffuse-rays 4";

#[test]
fn a_walk_loses_most_of_its_noise() {
    let folder = common::folder();
    let scene = court(folder.path());
    let (mut noisy, mut centres) = (renderer(&scene, NOISY), renderer(&scene, CENTRES));
    let mut denoiser = Denoiser::default();
    let last = 12;
    for k in 0..=last {
        let input = noisy.frame(k, &eye(k)).expect("a frame").pixels.radiance;
        let (_, radiance) = denoised(&mut noisy, &mut denoiser, k, &eye(k));
        if k < last {
            continue;
        }
        let exact = truth_at_centres(&mut centres, &eye(k));
        let (flip_in, flip_out) = (flip(&input, &exact), flip(&radiance, &exact));
        let (rmse_in, rmse_out) = (rmse(&input, &exact), rmse(&radiance, &exact));
        println!("frame {k}: FLIP {flip_in:.4} to {flip_out:.4}, RMSE {rmse_in:.4} to {rmse_out:.4}");
        assert!(flip_in > 2.2 * flip_out, "FLIP {flip_in} becomes {flip_out}");
        assert!(rmse_in > 4.0 * rmse_out, "RMSE {rmse_in} becomes {rmse_out}");
    }
    let report = denoiser.report();
    println!("{report:?}");
    assert!(report.energy_lost_share < 0.005 && report.non_finite == 0, "{report:?}");
}

#[test]
fn what_is_newly_seen_is_soon_as_good_as_the_rest() {
    let folder = common::folder();
    let scene = court(folder.path());
    let (mut noisy, mut centres) = (renderer(&scene, NOISY), renderer(&scene, CENTRES));
    let mut denoiser = Denoiser::default();
    // Still, until the histories are long; then a step aside and still again.
    let (before, after) = (eye(0), eye(6));
    let mut new = Vec::new();
    let mut first = Vec::new();
    for k in 0..24 {
        denoised(&mut noisy, &mut denoiser, k, &before);
    }
    let mut end = Vec::new();
    for k in 24..34 {
        let (guides, radiance) = denoised(&mut noisy, &mut denoiser, k, &after);
        if k == 24 {
            let past = &denoiser.past(1);
            new =
                past.iter().zip(&guides.seen).map(|(past, seen)| seen.is_hit().then_some(past.length == 1.0)).collect();
            first = radiance.clone();
        }
        end = radiance;
    }
    let exact = truth_at_centres(&mut centres, &after);
    let over = |picture: &[[f32; 3]], which: bool| {
        mean(errors(picture, &exact).into_iter().zip(&new).filter(|(_, new)| **new == Some(which)).map(|(e, _)| e))
    };
    // What old pixels end at is the steady state: they have 34 frames.
    let ((steady, _), (found, count), (at_first, _)) = (over(&end, false), over(&end, true), over(&first, true));
    println!("{count} new pixels: error {at_first:.4} at first, {found:.4} by frame 10; steady {steady:.4}");
    assert!(count > 100, "only {count} pixels are newly seen");
    assert!(found <= 1.5 * steady, "{found} by frame 10, {steady} in the steady state");
}

#[test]
fn light_that_moves_leaves_no_trail() {
    let folder = common::folder();
    let scene = court(folder.path());
    let (mut noisy, mut centres) = (renderer(&scene, NOISY), renderer(&scene, CENTRES));
    let mut denoiser = Denoiser::default();
    let [one, other] = [DVec3::new(0.4, 0.8, 0.45), DVec3::new(-0.1, 0.8, 0.6)].map(sun);
    // The walk without the move is the steady state.
    let mut steady_denoiser = Denoiser::default();
    let (mut moved, mut steady) = (Vec::new(), Vec::new());
    for k in 0..34 {
        noisy.light = if k < 24 { one.clone() } else { other.clone() };
        (_, moved) = denoised(&mut noisy, &mut denoiser, k, &eye(0));
        noisy.light = other.clone();
        (_, steady) = denoised(&mut noisy, &mut steady_denoiser, k, &eye(0));
    }
    centres.light = other.clone();
    let exact = truth_at_centres(&mut centres, &eye(0));
    centres.light = one.clone();
    let old = truth_at_centres(&mut centres, &eye(0));
    let changed: Vec<bool> = errors(&old, &exact).iter().map(|e| *e > 0.02).collect();
    let over = |picture: &[[f32; 3]]| {
        mean(errors(picture, &exact).into_iter().zip(&changed).filter(|(_, changed)| **changed).map(|(e, _)| e))
    };
    let ((found, count), (steady, _), (lag, _)) = (over(&moved), over(&steady), over(&old));
    println!("{count} pixels changed by {lag:.4}: error {found:.4} by frame 10, {steady:.4} in the steady state");
    assert!(count > 200 && lag > 5.0 * steady, "the move shows: {count} pixels by {lag}");
    assert!(found <= 1.5 * steady, "{found} by frame 10, {steady} in the steady state");
}

#[test]
fn a_still_view_converges_and_a_cut_begins_anew() {
    let folder = common::folder();
    let scene = court(folder.path());
    let (mut noisy, mut centres) = (renderer(&scene, NOISY), renderer(&scene, CENTRES));
    let exact = truth_at_centres(&mut centres, &eye(0));
    let mut denoiser = Denoiser::default();
    let mut found = Vec::new();
    for k in 0..24 {
        let (_, radiance) = denoised(&mut noisy, &mut denoiser, k, &eye(0));
        found.push(rmse(&radiance, &exact));
    }
    println!("RMSE of a still view: {found:.4?}");
    assert!(found[23] < 0.8 * found[0], "{found:?}");
    // A cut to the roof, of which nothing was seen.
    let cut = Camera {
        position: DVec3::new(-3.0, 12.0, -5.0),
        target: DVec3::new(-3.0, 5.3, -5.0),
        up: DVec3::Y,
        fov_y: 0.5,
    };
    let (_, after) = denoised(&mut noisy, &mut denoiser, 24, &cut);
    let (_, fresh) = denoised(&mut noisy, &mut Denoiser::default(), 24, &cut);
    assert!(after == fresh, "histories survive a cut");
    // The control: without a cut they do not begin anew.
    let (_, going_on) = denoised(&mut noisy, &mut denoiser, 25, &cut);
    let (_, fresh) = denoised(&mut noisy, &mut Denoiser::default(), 25, &cut);
    assert!(going_on != fresh, "histories are not used");
}

/// A small warm sun in a sky that is blue on one side and green on the other: directions are drawn by luminance, so
/// that most samples that find light differ in colour alone.
fn coloured_sky() -> Lamps {
    let image = Equirectangular::of(128, 64, |d| match DVec3::from_array(d) {
        d if d.dot(DVec3::new(0.4, 0.8, 0.45).normalize()) > 0.999 => [600.0, 400.0, 200.0],
        d if d.x > 0.0 => [0.1, 0.3, 2.0],
        _ => [0.2, 0.7, 0.1],
    });
    Lamps::new(Some(environment(image, 1.0, 0.0).0), Vec::new(), 1.0)
}

#[test]
fn light_of_an_environment_loses_its_noise_and_its_wrong_colours() {
    let folder = common::folder();
    let scene = court(folder.path());
    let renderer = |rays: &str| {
        let options = "--effects shadow,environment,diffuse --sun-intensity 0 --denoise";
        let mut renderer = renderer_of(&scene, &format!("{options} {rays}"));
        renderer.light.lamps = Arc::new(coloured_sky());
        renderer
    };
    let (mut noisy, mut centres) = (renderer("--diffuse-rays 1"), renderer("--diffuse-rays 4"));
    let exact = truth_at_centres(&mut centres, &eye(0));
    let mut output = noisy.frame(0, &eye(0)).expect("a frame");
    let (guides, input) = (guides(&mut output), output.pixels.radiance);
    let filtered = |guides: &Guides| {
        let mut radiance = input.clone();
        Denoiser::default().frame(guides.clone(), &mut radiance);
        radiance
    };
    let radiance = filtered(&guides);
    // The control: taken as light of lamps, whose samples are alike, it keeps most of its noise.
    let all = input.iter().zip(&guides.around).map(|(a, b)| [0, 1, 2].map(|k| a[k] - b[k])).collect();
    let as_lamps = filtered(&Guides { direct: all, ..guides });
    let [before, after, control] = [&input, &radiance, &as_lamps].map(|picture| flip(picture, &exact));
    let [noise, left, kept] = [&input, &radiance, &as_lamps].map(|picture| rmse(picture, &exact));
    println!("FLIP {before:.4} to {after:.4}, as lamps {control:.4}; RMSE {noise:.4} to {left:.4}, as lamps {kept:.4}");
    assert!(before > 1.35 * after && noise > 4.0 * left, "FLIP {before} to {after}, RMSE {noise} to {left}");
    assert!(control > 1.1 * after && kept > 2.0 * left, "as lamps FLIP {control}, {after}; RMSE {kept}, {left}");
}

/// A frame of many samples needs little of what lies around, and its samples tell how little.
#[test]
fn samples_of_a_frame_tell_its_variance() {
    let folder = common::folder();
    let scene = court(folder.path());
    // Samples of occlusion are spread so evenly that 16 have little noise left.
    for (effects, samples) in [("ao", 8), ("shadow,diffuse", 16)] {
        let options = format!("--effects {effects} --ao-rays 1 --ao-length 2 --denoise --diffuse-rays 1");
        let options = format!("{options} --spp {samples}");
        let mut renderer = renderer_of(&scene, &options);
        let mut output = renderer.frame(0, &eye(0)).expect("a frame");
        let (guides, input) = (guides(&mut output), output.pixels.radiance);
        let frames: Vec<_> = (1..65).map(|k| renderer.frame(k, &eye(0)).expect("a frame").pixels.radiance).collect();
        let mean = |i: usize| [0, 1, 2].map(|k| frames.iter().map(|frame| frame[i][k]).sum::<f32>() / 64.0);
        let truth: Vec<[f32; 3]> = (0..WIDTH * HEIGHT).map(mean).collect();
        let filtered = |guides: &Guides| {
            let mut radiance = input.clone();
            Denoiser::default().frame(guides.clone(), &mut radiance);
            radiance
        };
        // The control: told that the frame has one sample a pixel.
        let untold = Guides { noise: vec![SampleNoise::default(); WIDTH * HEIGHT], ..guides.clone() };
        let pictures = [input.clone(), filtered(&guides), filtered(&untold)];
        let [noise, left, control] = pictures.each_ref().map(|picture| rmse(picture, &truth));
        let [before, after, blurred] = pictures.each_ref().map(|picture| flip(picture, &truth));
        println!(
            "{effects}: RMSE {noise:.4} to {left:.4}, untold {control:.4}; FLIP {before:.4} to {after:.4}, {blurred:.4}"
        );
        assert!(left < 0.8 * noise, "{effects}: RMSE {noise} to {left}");
        let told = control > 2.0 * left && blurred > 2.0 * after;
        assert!(told, "{effects}: RMSE {left}, untold {control}; FLIP {after}, untold {blurred}");
    }
}

/// Of pixels whose samples see several surfaces, or a surface and the sky, the filter changes the first one's light
/// alone.
#[test]
fn edges_stay_smooth() {
    let folder = common::folder();
    let scene = court(folder.path());
    // The filter takes noise out of few samples, and must not blur what many show.
    for (samples, most) in [(4, 0.8), (16, 1.2)] {
        let [noise, left, by_first] = errors_at_edges(&scene, samples);
        println!("{samples} samples: {noise:.4} to {left:.4}, {by_first:.4} by the first one");
        assert!(left < most * noise && by_first > 1.12 * left, "{samples}: {noise} {left} {by_first}");
    }
}

/// Root mean square errors at edges of a frame of so many samples: as it is, filtered, and, the control, filtered as if
/// all samples saw what the first one did.
fn errors_at_edges(scene: &Path, samples: u32) -> [f64; 3] {
    let (mut many, mut one) = (renderer(scene, &format!("{NOISY} --spp {samples}")), renderer(scene, NOISY));
    let camera = eye(0);
    let mut output = many.frame(0, &camera).expect("a frame");
    let (guides, input) = (guides(&mut output), output.pixels.radiance);
    let frames: Vec<_> =
        (1..1 + 256 / samples).map(|k| many.frame(k, &camera).expect("a frame").pixels.radiance).collect();
    let mean = |i: usize| [0, 1, 2].map(|k| frames.iter().map(|frame| frame[i][k]).sum::<f32>() / frames.len() as f32);
    let truth: Vec<[f32; 3]> = (0..WIDTH * HEIGHT).map(mean).collect();
    let is_edge = |i: usize| {
        let differs = |other: usize| guides.seen.get(other).is_some_and(|seen| !guides.seen[i].is_same_surface(seen));
        i % WIDTH + 1 < WIDTH && (differs(i + 1) || differs(i + WIDTH))
    };
    let edges: Vec<usize> = (0..WIDTH * HEIGHT).filter(|&i| is_edge(i)).collect();
    let filtered = |guides: &Guides| {
        let mut radiance = input.clone();
        Denoiser::default().frame(guides.clone(), &mut radiance);
        radiance
    };
    let first = one.frame(0, &camera).expect("a frame").guides.expect("guides");
    let sum = |i: usize| [0, 1, 2].map(|k| guides.direct[i][k] + guides.around[i][k] - first.around[i][k]);
    let taken = Guides { direct: (0..WIDTH * HEIGHT).map(sum).collect(), ..first };
    let at = |pixels: &[usize], radiance: &[[f32; 3]]| {
        let of = |picture: &[[f32; 3]]| pixels.iter().map(|&i| picture[i]).collect::<Vec<_>>();
        let (a, b) = (of(radiance), of(&truth));
        rmse(&a, &b) * ((WIDTH * HEIGHT) as f64 / a.len() as f64).sqrt()
    };
    let radiance = filtered(&guides);
    assert!(edges.len() > 200, "{} pixels of edges", edges.len());
    [&input, &radiance, &filtered(&taken)].map(|picture| at(&edges, picture))
}

/// A wall of grey light with some noise, and in it pixels far too bright, one in blue alone, whose luminance is no more
/// than chance.
#[test]
fn fireflies_of_any_colour_are_cut() {
    let camera = eye(0);
    let size = (WIDTH as u32, HEIGHT as u32);
    let projection = Projection::new(&camera, size);
    let basis = camera.ray_basis(size.0, size.1);
    let toward = (camera.position - camera.target).normalize();
    let seen = |i: usize| {
        let direction = basis.direction((i % WIDTH) as f64 + 0.5, (i / WIDTH) as f64 + 0.5);
        let point = camera.position - direction * (5.0 / direction.dot(toward));
        let normal = toward.as_vec3();
        let footprint = projection.footprint(point) as f32;
        Seen { point, plane: normal, normal, id: 1, footprint, albedo: [0.5; 3], polish: 0.0 }
    };
    let guides = Guides {
        size,
        projection,
        jitter: [0.5; 2],
        seen: (0..WIDTH * HEIGHT).map(seen).collect(),
        direct: vec![[0.0; 3]; WIDTH * HEIGHT],
        around: vec![[0.0; 3]; WIDTH * HEIGHT],
        noise: vec![SampleNoise::default(); WIDTH * HEIGHT],
        second: Vec::new(),
        moved: Moved::default(),
    };
    let grey = |i: usize| 0.2 + 0.1 * (i.wrapping_mul(2_654_435_761) % 1024) as f32 / 1024.0;
    let clean: Vec<[f32; 3]> = (0..WIDTH * HEIGHT).map(|i| [grey(i); 3]).collect();
    let filtered = |planted: &[(usize, [f32; 3])]| {
        let mut radiance = clean.clone();
        planted.iter().for_each(|&(at, color)| radiance[at] = color);
        let mut denoiser = Denoiser::default();
        denoiser.frame(guides.clone(), &mut radiance);
        (radiance, denoiser.report().fireflies)
    };
    let (expected, none) = filtered(&[]);
    let place = |x: usize, y: usize| y * WIDTH + x;
    let planted = [(place(20, 20), [900.0; 3]), (place(50, 30), [0.25, 0.25, 1.6])];
    let (found, cut) = filtered(&planted);
    assert_eq!((none, cut), (0, 2), "cut of the clean wall, and of two planted pixels");
    let off = |found: &[[f32; 3]], at: usize| {
        let of = |a: &[f32; 3], b: &[f32; 3]| Vec3::from_array(*a).distance(Vec3::from_array(*b));
        let around = (0..9).map(|k| at - WIDTH - 1 + k % 3 + k / 3 * WIDTH);
        around.map(|i| of(&found[i], &expected[i])).fold(0.0, f32::max)
    };
    for (at, _) in planted {
        assert!(off(&found, at) < 0.03, "{} of a firefly is left", off(&found, at));
    }
    // The control: two beside each other vouch for each other, and stay.
    let (found, _) = filtered(&[planted[0], (place(22, 20), [900.0; 3])]);
    assert!(off(&found, planted[0].0) > 1.0, "light that several find is kept");
}

#[test]
fn frames_average_to_smooth_edges() {
    let folder = common::folder();
    let scene = court(folder.path());
    // Without noise: primary rays alone.
    let options = "--effects primary --rotation 0";
    let words = |more: &str| renderer_of(&scene, &format!("{options} {more}"));
    let exact = words("--spp 256").frame(0, &eye(0)).expect("a frame").pixels.radiance;
    let aliased = words("").frame(0, &eye(0)).expect("a frame").pixels.radiance;
    let mut jittered = words("--taa");
    let mut taa = Taa::default();
    let mut radiance = Vec::new();
    for k in 0..32 {
        let mut output = jittered.frame(k, &eye(0)).expect("a frame");
        let guides = guides(&mut output);
        radiance = output.pixels.radiance;
        assert_eq!(taa.frame(&guides, &mut radiance), 0);
    }
    let (before, after) = (rmse(&aliased, &exact), rmse(&radiance, &exact));
    println!("RMSE of aliased edges {before:.4}, after 32 frames {after:.4}");
    assert!(2.0 * after < before, "{before} becomes {after}");
}

#[test]
fn without_denoising_nothing_changes() {
    let folder = common::folder();
    let scene = court(folder.path());
    let [plain, guided] = ["", NOISY].map(|options| {
        let mut renderer = renderer(&scene, options);
        // The one difference that guides make to rays, and there are none of ao or diffuse.
        renderer.settings.effects.diffuse = None;
        renderer.frame(3, &eye(3)).expect("a frame")
    });
    assert!(plain.guides.is_none() && guided.guides.is_some());
    assert_eq!(plain.pixels, guided.pixels, "reading guides changes no picture");
    let options = "--frames 2 --size 48x27 --cache 100% --effects shadow,diffuse --diffuse-rays 1 --adapter cpu";
    let [off, on, both, threads] = ["off", "on", "both", "threads"].map(|name| {
        let output = folder.path().join(name);
        let more = match name {
            "off" => "",
            "both" => "--denoise --taa",
            _ => "--denoise",
        };
        common::walk(&scene, &output, &format!("{options} {more}"));
        let summary = std::fs::read(output.join("summary.json")).expect("a summary");
        let summary: serde_json::Value = serde_json::from_slice(&summary).expect("JSON");
        assert_eq!(summary["denoise"].is_null(), name == "off");
        assert_eq!(summary["taa"], name == "both");
        if name != "off" {
            assert_eq!(summary["denoise"]["frames"], 2);
            assert!(summary["denoise"]["energy_lost"].as_f64().is_some_and(|lost| lost >= 0.0));
        }
        common::frames(&output)
    });
    assert!(off != on && on != both, "denoising and averaging show");
    assert!(on == threads, "two walks are one");
    let words = ["walk", "s.bricks", "-o", "o", "--taa", "--aov"];
    let refused = common::brickwalk(words);
    let text = String::from_utf8_lossy(&refused.stderr);
    assert!(refused.status.code() == Some(2) && text.contains("--taa") && text.contains("--aov"), "{text}");
}
