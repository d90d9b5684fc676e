//! Samples against closed forms.

use super::field::{STEPS, code_of};
use super::make::{Making, Watch, add_fields, fitting};
use super::shape::{MOST_RINGS, frame, of_hemisphere, position_of, square_of, square_place};
use super::{Chord, FieldView, Shape};
use crate::kernels::layout::{DISPLACEMENT_AIMED, DISPLACEMENT_DIRECTIONS, DISPLACEMENT_POSITIONS};
use crate::session::trace::for_rays;
use crate::session::{Opened, Settings as Walk};
use crate::settings::Adapter;
use bricks::SceneFile;
use brickwalk_convert::build::{BuildSettings, build_source};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{InMemory, Primitive};
use brickwalk_scenes::{Rng, Settings, generate, one_mesh};
use glam::DVec3;
use std::sync::Arc;

fn unit(rng: &mut Rng) -> DVec3 {
    loop {
        let v = DVec3::from_array([(); 3].map(|()| rng.range(-1.0, 1.0)));
        if (0.01..1.0).contains(&v.length_squared()) {
            return v.normalize();
        }
    }
}

#[test]
fn every_sample_maps_to_itself() {
    for rings in 1..=MOST_RINGS {
        let shape = Shape { rings, directions: 2 };
        let others = Shape { rings: rings + 1, directions: 2 };
        let (mut moved, mut twins) = (0, 0);
        for number in 0..shape.positions() {
            let at = shape.position(number).as_vec3().to_array();
            let found = position_of(rings, at);
            // Both hemispheres have the equator; the upper one answers for it.
            let is_twin = at[2] == 0.0 && found + of_hemisphere(rings) == number;
            assert!(found == number || is_twin, "{rings} rings: {found} instead of {number}");
            twins += u32::from(is_twin);
            // Control: in another subdivision most have another number.
            moved += u32::from(position_of(others.rings, at) != number);
        }
        assert_eq!(twins, 4 * rings);
        assert!(2 * moved > shape.positions(), "{moved} of {}", shape.positions());
    }
    for directions in 2..=256 {
        let shape = Shape { rings: 1, directions };
        for number in 0..shape.squares() {
            let d = shape.direction(number);
            assert!((d.length() - 1.0).abs() < 1e-12 && d.z > 0.0);
            for length in [1.0, 0.3] {
                let place = square_place((length * d).as_vec3().to_array());
                assert_eq!(square_of(directions, place), number, "{directions} directions");
            }
        }
    }
    assert_eq!([8, 16, 32].map(|rings| Shape { rings, directions: 2 }.positions()), [290, 1090, 4226]);
}

/// The greatest angle between a position and a corner of its cell: half a ring on and back, half a point around.
fn cell_radius(shape: Shape, number: u32) -> f64 {
    let at = shape.position(number);
    let rings = f64::from(shape.rings);
    let ring = rings * (1.0 - at.z.abs()).max(0.0).sqrt();
    let around = at.y.atan2(at.x);
    let half = if ring < 0.5 { std::f64::consts::PI } else { std::f64::consts::FRAC_PI_4 / ring };
    let mut radius = 0.0f64;
    for ring in [(ring - 0.5).max(0.0), (ring + 0.5).min(rings)] {
        for turn in [-half, 0.0, half] {
            let down = (ring / rings).powi(2);
            let across = (down * (2.0 - down)).sqrt();
            let (angle, z) = (around + turn, (1.0 - down).copysign(at.z));
            let corner = DVec3::new(across * angle.cos(), across * angle.sin(), z);
            radius = radius.max(corner.angle_between(at));
        }
    }
    radius
}

#[test]
fn a_million_rays_find_positions_in_their_cells() {
    let mut rng = Rng::new(1, &[1]);
    for rings in [8, 16, 32] {
        let shape = Shape { rings, directions: 2 };
        let radii: Vec<f64> = (0..shape.positions()).map(|number| cell_radius(shape, number)).collect();
        let (mut beyond, mut of_next) = (0, 0);
        for _ in 0..340_000 {
            let at = unit(&mut rng);
            let found = position_of(rings, at.as_vec3().to_array());
            let away = |number: u32| shape.position(number).angle_between(at);
            beyond += u32::from(away(found) > radii[found as usize] + 1e-6);
            let next = (found + 1) % shape.positions();
            of_next += u32::from(away(next) > radii[next as usize] + 1e-6);
        }
        assert_eq!(beyond, 0, "{rings} rings");
        // Control: the position after it is not in most cases.
        assert!(of_next > 200_000, "{of_next}");
        // No cell is much larger than the mean.
        let mean = (4.0 / f64::from(shape.positions())).sqrt();
        assert!(radii.iter().all(|&radius| radius < 2.1 * mean), "{rings}: {mean}");
    }
}

#[test]
fn frames_are_orthonormal_and_inward() {
    let shape = Shape { rings: 16, directions: 2 };
    for number in 0..shape.positions() {
        let at = shape.position(number);
        let [x, y, z] = frame(at);
        let products = [x.dot(y), y.dot(z), z.dot(x), x.length() - 1.0, y.length() - 1.0, z.dot(at) + 1.0];
        assert!(products.iter().all(|product| product.abs() < 1e-12), "{number}: {products:?}");
    }
}

/// Share of the chord at which a ray through the unit sphere that passes the middle at `past` meets a sphere around it.
fn met_by_sphere(past: f64, radius: f64) -> Option<f64> {
    let inner = radius * radius - past * past;
    (inner > 0.0).then(|| 0.5 * (1.0 - inner.sqrt() / (1.0 - past * past).sqrt()))
}

#[test]
fn fields_of_a_sphere_are_near_its_closed_form() {
    const RADIUS: f64 = 0.6;
    let (both, mut rng) = (DISPLACEMENT_POSITIONS | DISPLACEMENT_DIRECTIONS, Rng::new(2, &[2]));
    let mut wrong_of = Vec::new();
    for directions in [16, 64] {
        let shape = Shape { rings: 8, directions };
        let table = shape.table();
        let share = |square: u32| {
            let d = shape.direction(square);
            met_by_sphere((1.0 - d.z * d.z).sqrt(), RADIUS).map(|share| share as f32)
        };
        let shares: Vec<Option<f32>> = (0..shape.squares()).map(share).collect();
        for bits in [8, 1] {
            let per_word = 32 / bits;
            let mut codes = vec![0u32; shape.samples().div_ceil(u64::from(per_word)) as usize];
            for sample in 0..shape.samples() as u32 {
                let share = shares[(sample % shape.squares()) as usize];
                let code = if bits == 1 { u32::from(share.is_some()) } else { code_of(share).into() };
                codes[(sample / per_word) as usize] |= code << (bits * (sample % per_word));
            }
            let field = FieldView { shape, table: &table, codes: &codes, bits, mean: 0.25 };
            for look in [DISPLACEMENT_AIMED, DISPLACEMENT_AIMED | both] {
                let (mut wrong, mut worst) = (0, 0.0f64);
                for _ in 0..20_000 {
                    let (from, to) = (3.0 * unit(&mut rng), 0.99 * unit(&mut rng));
                    let direction = (to - from).normalize();
                    let (from, way) = (from.as_vec3().to_array(), direction.as_vec3().to_array());
                    let Some(chord) = Chord::of(from, way) else { panic!("a ray into the sphere misses it") };
                    let past = DVec3::from_array(chord.middle.map(f64::from)).length();
                    let expected = met_by_sphere(past, RADIUS);
                    let found = field.share(&chord, look);
                    wrong += u32::from((found >= 0.0) != expected.is_some());
                    // Away from the silhouette, where distances are steep.
                    if let Some(expected) = expected.filter(|_| found >= 0.0 && past < 0.5 && bits == 8) {
                        worst = worst.max((f64::from(found) - expected).abs());
                    }
                }
                let bound = 2.0 / f64::from(directions) + 0.5 / f64::from(STEPS);
                assert!(worst < bound, "{directions} directions, look {look}: {worst}");
                wrong_of.push(f64::from(wrong) / 20_000.0);
            }
        }
    }
    // Four times as many directions: a quarter of the rays at the silhouette.
    let [coarse, fine] = [&wrong_of[..4], &wrong_of[4..]].map(|all| all.iter().sum::<f64>());
    assert!(wrong_of.iter().all(|&share| share < 0.04) && fine < 0.5 * coarse, "{wrong_of:?}");
}

/// Stops a run after so many rays.
struct Stops(u64);

impl Watch for Stops {
    fn phase(&mut self, _: &'static str, _: u64) {}

    fn advance(&mut self, units: u64) -> bool {
        self.0 = self.0.saturating_sub(units);
        self.0 > 0
    }
}

#[test]
fn a_stopped_run_goes_on_and_makes_the_same_file() {
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("city.bricks");
    let city = generate(&Settings { triangles: 12_000, ..Settings::default() }, &Progress::hidden()).unwrap();
    let settings = BuildSettings { brick_triangles: 500, ..BuildSettings::default() };
    build_source(&city, &settings, &source, &Progress::hidden()).unwrap();
    let scene = Arc::new(SceneFile::open(&source).unwrap());
    let walk = for_rays(&Walk { adapter: Adapter::Cpu, ..Walk::exact() });
    let mut opened = Opened::open(scene, &source, &walk).unwrap();
    let making = Making { objects: None, bricks: true, bits: 8 };
    let (at_once, in_parts) = (folder.path().join("once.bricks"), folder.path().join("parts.bricks"));
    let made = add_fields(&mut opened.bench(), &at_once, &making, 0, 1 << 30, &mut ()).unwrap();
    assert!(made.fields[1] > 10 && made.kept == 0, "{made:?}");
    let stopped = add_fields(&mut opened.bench(), &in_parts, &making, 0, 1 << 30, &mut Stops(1)).unwrap_err();
    assert!(stopped.to_string().contains("the same command goes on"), "{stopped}");
    assert!(!in_parts.exists());
    let kept = folder.path().join(".parts.bricks.fields");
    // Half of a field, as a killed run leaves it.
    let mut bytes = std::fs::read(&kept).unwrap();
    bytes.extend([7; 150]);
    std::fs::write(&kept, &bytes).unwrap();
    let on = add_fields(&mut opened.bench(), &in_parts, &making, 0, 1 << 30, &mut ()).unwrap();
    assert!(on.kept > 0 && on.rays < made.rays && on.fields == made.fields, "{on:?}");
    assert!(std::fs::read(&at_once).unwrap() == std::fs::read(&in_parts).unwrap());
    assert!(!kept.exists());
    // What others have left is of no use.
    std::fs::write(&kept, &bytes).unwrap();
    let other = Making { bits: 1, ..making };
    let again = add_fields(&mut opened.bench(), &in_parts, &other, 0, 1 << 30, &mut ()).unwrap();
    assert!(again.kept == 0 && again.fields[1] >= made.fields[1], "{again:?}");
    assert!(std::fs::read(&at_once).unwrap() != std::fs::read(&in_parts).unwrap());
}

/// The samples of the field of an object of random triangles that is placed by these matrices.
fn field_of_placed(places: [[f64; 12]; 2]) -> Vec<u8> {
    let mut rng = Rng::new(5, &[3]);
    let positions = (0..180).map(|_| [(); 3].map(|()| rng.range(-1.0, 1.0))).collect();
    let primitive = Primitive { positions, indices: (0..180).collect(), ..Primitive::default() };
    let mut source = one_mesh("thing", primitive);
    source.placements = vec![source.placements.remove(0); 2];
    source.placements.iter_mut().zip(places).for_each(|(placement, place)| placement.world_from_mesh = place);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("thing.bricks");
    let settings = BuildSettings { instance_min_triangles: 1, ..BuildSettings::default() };
    build_source(&InMemory::from(source), &settings, &path, &Progress::hidden()).unwrap();
    let walk = for_rays(&Walk { adapter: Adapter::Cpu, ..Walk::exact() });
    let mut opened = Opened::open(Arc::new(SceneFile::open(&path).unwrap()), &path, &walk).unwrap();
    let making = Making { objects: Some(Shape { rings: 8, directions: 16 }), bricks: true, bits: 8 };
    let made = add_fields(&mut opened.bench(), &path, &making, 0, 1 << 30, &mut ()).unwrap();
    assert_eq!(made.fields, [1, 0]);
    SceneFile::open(&path).unwrap().displacement(0).unwrap()
}

#[test]
fn an_uneven_instance_does_not_spoil_the_field_of_its_object() {
    let even = [0.0, -2.0, 0.0, 3.0, 2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, -4.0];
    let mirrored = [-2.0, 0.0, 0.0, 9.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0];
    let uneven = [3.0, 0.0, 0.0, 9.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.5, 1.0, 0.0];
    let alone = field_of_placed([even, even]);
    assert!(alone.iter().filter(|&&code| code != 255).count() > 10_000);
    for others in [[uneven, even], [mirrored, even], [uneven, mirrored]] {
        let beside = field_of_placed(others);
        // Rays are rounded elsewhere: at a silhouette, and by a code.
        let differs = |(a, b): (&u8, &u8)| a.abs_diff(*b) > 1;
        let count = alone.iter().zip(&beside).filter(|&pair| differs(pair)).count();
        assert!(count * 1000 < alone.len(), "{count} of {} differ", alone.len());
    }
}

#[test]
fn fields_of_bricks_take_what_there_is() {
    for bits in [8, 1] {
        let mut before = 0;
        for bytes in [500, 1000, 8192, 20_000, 100_000, 10_000_000] {
            let Some(shape) = fitting(bytes, bits) else { panic!("{bytes} bytes hold a field") };
            let own = shape.samples() * u64::from(bits) / 8;
            assert!(own <= bytes && own >= before, "{bytes}: {shape:?}");
            assert!(5 * own > 2 * bytes || shape.rings == MOST_RINGS, "{bytes}: {shape:?}");
            before = own;
        }
    }
    assert_eq!(fitting(100, 8), None);
}
