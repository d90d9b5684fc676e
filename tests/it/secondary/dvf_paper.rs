//! `--dvf-mode paper` against closed forms: a plane under an even sky, a plane beside a wall, a sky that spherical
//! harmonics of order 2 hold.

use crate::common::{self, converted, folder, sheet};
use brickwalk::frame::{Equirectangular, Renderer, environment};
use brickwalk::kernels::Lamps;
use brickwalk::scene::Camera;
use brickwalk::secondary::dvf::{Cells, DvfField, DvfSettings, DvfUse};
use brickwalk::secondary::dvf::{Dvf, DvfTracing, Region};
use glam::DVec3;
use std::path::Path;
use std::sync::Arc;

const PAPER: DvfUse = DvfUse { doubt: false, paper: true };
/// Pixels of a row and rows, of pictures of the floor.
const SIZE: [usize; 2] = [96, 8];
/// Of the wall.
const HEIGHT: f64 = 1.0;

/// A floor of squares in the plane y = 0 from x = 0 to 4, and, if there is one, a wall in the plane x = 0 that is so
/// high and, as good as, endless.
fn renderer(folder: &Path, has_wall: bool, options: &str) -> Renderer {
    let (mut text, mut count) = (String::new(), 0);
    let mut add = |corner, edges, squares| sheet(&mut text, &mut count, corner, edges, squares);
    add(DVec3::new(0.0, 0.0, -2.0), [DVec3::Z * 4.0, DVec3::X * 4.0], [16, 16]);
    if has_wall {
        add(DVec3::new(0.0, 0.0, 60.0), [DVec3::Z * -120.0, DVec3::Y * HEIGHT], [480, 4]);
    }
    let scene = converted(folder, &text, "");
    let size = format!("{}x{}", SIZE[0], SIZE[1]);
    common::renderer(
        &scene,
        &format!("--tile 8 --aov --sun-intensity 0 --size {size} --cache 100% --effects environment {options}"),
    )
}

fn shine(renderer: &mut Renderer, radiance: impl Fn([f64; 3]) -> [f64; 3]) {
    let image = Equirectangular::of(64, 32, radiance);
    renderer.light.lamps = Arc::new(Lamps::new(Some(environment(image, 1.0, 0.0).0), Vec::new(), 1.0));
}

fn made(renderer: &mut Renderer) -> DvfField {
    let settings = DvfSettings { points: 60_000, rays: 128, cells: Cells::Longest(16), ..DvfSettings::default() };
    let region = Region {
        min: DVec3::new(0.0, 0.0, -2.0),
        max: DVec3::new(4.0, HEIGHT, 2.0),
        ..Region::scene(renderer.scene.resident())
    };
    renderer.make_dvf(&settings, &region, DvfTracing::over(32), &mut |_, _| true).expect("a field").field
}

/// Of each column of pixels: x of what is seen of the floor, and what it shows over its base colour, the mean over the
/// column.
fn columns(renderer: &mut Renderer) -> Vec<[f64; 2]> {
    let camera = Camera {
        position: DVec3::new(2.0, 6.0, 0.0),
        target: DVec3::new(2.0, 0.0, 0.0),
        up: DVec3::NEG_Z,
        fov_y: 3f64.to_radians(),
    };
    let frame = renderer.frame(0, &camera).expect("a frame");
    let column = |x: usize| {
        let all: Vec<[f64; 2]> = (0..SIZE[1])
            .map(|y| y * SIZE[0] + x)
            .filter(|&i| frame.pixels.id[i] != u32::MAX)
            .map(|i| {
                let share = f64::from(frame.pixels.radiance[i][0]) / f64::from(frame.pixels.albedo[i][0]);
                let width = 2.0 * 6.0 * 1.5f64.to_radians().tan() * SIZE[0] as f64 / SIZE[1] as f64;
                [2.0 + ((x as f64 + 0.5) / SIZE[0] as f64 - 0.5) * width, share]
            })
            .collect();
        let sum = all.iter().fold([0.0; 2], |sum, one| [sum[0] + one[0], sum[1] + one[1]]);
        sum.map(|sum| sum / all.len().max(1) as f64)
    };
    (0..SIZE[0]).map(column).collect()
}

/// Spherical harmonics of order 2 hold what is even, and what grows along an axis; then a plane in the open needs no
/// ray: E / pi of a + b y is a + 2 b / 3.
#[test]
fn a_plane_in_the_open_has_its_irradiance_without_a_ray() {
    let folder = folder();
    let mut renderer = renderer(folder.path(), false, "--spp 4");
    let field = made(&mut renderer);
    for (a, b) in [(1.0, 0.0), (1.0, 0.75)] {
        shine(&mut renderer, |d| [a + b * d[1]; 3]);
        renderer.methods.set(Dvf::new(Arc::new(field.clone()), PAPER));
        let expected = a + 2.0 * b / 3.0;
        // The integral over 64 x 32 texels.
        let worst = columns(&mut renderer).iter().map(|[_, light]| (light - expected).abs()).fold(0.0, f64::max);
        assert!(worst < 0.004 * expected, "{worst} of {expected}");
    }
    // Control: a cone of 10 degrees around the zenith brings (1 - cos^2) = 0.03 of its radiance, which order 2 does not
    // hold.
    let (radiance, edge) = (100.0, 10f64.to_radians().cos());
    shine(&mut renderer, |d| [if d[1] > edge { radiance } else { 0.0 }; 3]);
    renderer.methods.set(Dvf::new(Arc::new(field), PAPER));
    let expected = radiance * (1.0 - edge * edge);
    let found = columns(&mut renderer)[SIZE[0] / 2][1];
    assert!((found - expected).abs() > 0.03 * expected, "{found}, without the error of order 2: {expected}");
}

/// An endless wall of height h takes (1 - d / (d^2 + h^2)^0.5) / 2 of the light of an even sky from a floor at distance
/// d.
#[test]
fn a_plane_beside_a_wall_has_the_light_of_the_rest_of_the_sky() {
    let folder = folder();
    let mut renderer = renderer(folder.path(), true, "--spp 64");
    let field = made(&mut renderer);
    shine(&mut renderer, |_| [1.0; 3]);
    let mut worst_of = |field: &DvfField| {
        renderer.methods.set(Dvf::new(Arc::new(field.clone()), PAPER));
        let error = |[d, light]: [f64; 2]| (light - 0.5 * (1.0 + d / d.hypot(HEIGHT))).abs();
        let all: Vec<[f64; 2]> = columns(&mut renderer).into_iter().filter(|[d, _]| *d > 0.02 && *d < 3.9).collect();
        (all.len(), all.into_iter().map(error).fold(0.0, f64::max))
    };
    let (columns, worst) = worst_of(&field);
    assert!(columns > 50, "{columns} columns");
    // 64 directions that are evenly spread miss an edge by a direction or two, turned by 8 angles of the tile: less
    // than two of 64.
    assert!(worst < 2.0 / 64.0, "{worst}");
    // Control: hits for misses.
    let mut flipped = field.clone();
    let words = field.shape.words();
    flipped.masks.chunks_exact_mut(words).for_each(|masks| masks.rotate_left(words / 2));
    flipped.finish(false);
    let (_, worst) = worst_of(&flipped);
    assert!(worst > 0.1, "{worst} by a field that is wrong");
}
