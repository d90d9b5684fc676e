//! Scenes that are cut at a plane: rays meet what given rays with the same ends meet, nothing beyond the plane is met
//! by any ray, and neither cache nor device changes a byte.

use crate::common::{adapters, box_corners, city, folder, light_on_floor, settings, succeed};
use brickwalk::kernels::layout::NONE;
use brickwalk::session::{Ray, Session};
use brickwalk::settings::Group as _;
use glam::DVec3;
use std::path::Path;

/// Of the scene's size: what roundings of f32 leave of a crossing.
const SLACK: f64 = 1e-5;

#[test]
fn camera_rays_meet_what_given_rays_of_that_range_meet() {
    let folder = folder();
    let scene = city(folder.path(), "60K", "500");
    let near = scene.with_extension("near.json");
    let common = format!("--size 160x90 --spp 1 --effects primary --aov --path {} --frames 4", near.display());
    let (mut compared, mut cut, mut edges) = (0, 0, 0);
    for (point, normal) in [
        (DVec3::new(0.0, 6.0, 0.0), DVec3::Y),
        (DVec3::new(0.0, 3.0, 0.0), DVec3::new(0.2, -1.0, 0.1)),
        (DVec3::new(5.0, 0.0, 5.0), DVec3::new(1.0, 0.3, -0.7)),
    ] {
        let [[x, y, z], [u, v, w]] = [point, normal].map(|v| v.to_array());
        let normal = normal.normalize();
        let clip = format!("{common} --clip={x},{y},{z},{u},{v},{w}");
        let [mut clipped, mut whole] =
            [&clip, &common].map(|options| Session::open(&scene, &settings(options)).expect("a session"));
        for frame in 0..4 {
            let camera = whole.path().frame(frame, 4);
            let [shown, all] = [&mut clipped, &mut whole].map(|session| session.picture(&camera, &mut ()));
            let [shown, all] = [shown, all].map(|frame| frame.expect("a frame").expect("a frame").pixels);
            // The same rays, with ends in f64 where they cross the plane.
            let basis = camera.ray_basis(160, 90);
            let height = |p: DVec3| normal.dot(p - point);
            let ray = |pixel: usize| {
                let direction = basis.direction((pixel % 160) as f64 + 0.5, (pixel / 160) as f64 + 0.5);
                let crossing = -height(camera.position) / normal.dot(direction);
                let (mut t_min, mut t_max) = (0.0, f64::INFINITY);
                match normal.dot(direction) > 0.0 {
                    true => t_max = crossing.max(0.0),
                    false => t_min = crossing.max(0.0),
                }
                Ray { origin: camera.position.to_array(), direction: direction.to_array(), t_min, t_max }
            };
            let rays: Vec<Ray> = (0..160 * 90).map(ray).collect();
            let truth = whole.trace(&rays, false).expect("hits");
            let size = 400.0;
            for (pixel, (hit, ray)) in truth.iter().zip(&rays).enumerate() {
                let way = DVec3::from_array(ray.direction);
                if shown.id[pixel] != NONE {
                    let at = camera.position + way.normalize() * f64::from(shown.depth[pixel]);
                    assert!(height(at) < SLACK * size, "pixel {pixel}: {} beyond the plane", height(at));
                }
                // Where the ray crosses the plane within roundings of a hit either is right.
                let ends =
                    [hit.t, f64::from(shown.depth[pixel]) / way.length(), f64::from(all.depth[pixel]) / way.length()];
                let crossing = if ray.t_min > 0.0 { ray.t_min } else { ray.t_max };
                if ends.iter().any(|t| t.is_finite() && (t - crossing).abs() * way.length() < SLACK * size) {
                    continue;
                }
                if shown.id[pixel] != hit.triangle {
                    // Given rays are rounded in another way: at edges the neighbour is met, as far away.
                    let apart = (ends[0] - ends[1]).abs() * way.length();
                    assert!(apart < SLACK * size, "pixel {pixel} of frame {frame}, {normal}: {ends:?}");
                    edges += 1;
                }
                compared += 1;
                cut += u32::from(shown.id[pixel] != all.id[pixel]);
            }
        }
    }
    // Nearly all are compared, and the control: many are others than without the plane.
    assert!(compared > 165_000 && cut > 20_000 && edges < 200, "{compared} {cut} {edges}");
}

#[test]
fn light_comes_into_a_box_that_is_cut_open() {
    let folder = folder();
    // A closed box, 4 wide and 3 high; the camera in it looks down, the sun stands overhead. And its floor alone.
    let corners = box_corners();
    std::fs::write(folder.path().join("box.mtl"), "newmtl white\nKd 1 1 1\n").expect("materials");
    let floor = "f 1 5 6 2\n";
    let converted = |name: &str, faces: &str| {
        let [obj, scene] = ["obj", "bricks"].map(|ending| folder.path().join(format!("{name}.{ending}")));
        std::fs::write(&obj, format!("mtllib box.mtl\n{corners}usemtl white\n{faces}")).expect("a shape");
        succeed(["convert".as_ref(), obj.as_os_str(), "-o".as_ref(), scene.as_os_str()]);
        scene
    };
    let closed = converted("closed", &format!("{floor}f 1 2 4 3\nf 5 7 8 6\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"));
    let alone = converted("alone", floor);
    let mean = |scene: &Path, options: &str| light_on_floor(folder.path(), scene, options);
    assert_eq!(mean(&closed, ""), 0.0);
    let (open, truth) = (mean(&closed, "--clip 0,2.5,0,0,1,0"), mean(&alone, ""));
    assert!(truth > 0.1 && (open / truth - 1.0).abs() < 1e-6, "{open} and {truth}");
    // The control: cut on the other side the roof remains, and the floor is gone.
    assert_eq!(mean(&closed, "--clip 0,2.5,0,0,-1,0"), 0.0);
}

#[test]
fn neither_cache_nor_schedule_nor_device_changes_a_cut_picture() {
    let folder = folder();
    let scene = city(folder.path(), "60K", "500");
    let common = "--size 96x54 --spp 2 --effects primary,shadow,ao,diffuse,glossy --clip 0,5,0,0.2,1,0.1";
    let picture = |options: &str, adapter: &str| {
        let mut settings = settings(&format!("{common} {options}"));
        settings.set("adapter", adapter).expect("an adapter");
        settings.path = Some(scene.with_extension("near.json"));
        let mut session = Session::open(&scene, &settings).expect("a session");
        let camera = session.path().frame(1, 4);
        session.picture(&camera, &mut ()).expect("a frame").expect("a frame").pixels.radiance
    };
    for adapter in adapters() {
        let first = picture("--cache 100%", &adapter);
        for options in
            ["--cache 10%", "--schedule demand --cache 30%", "--schedule chc --tile 16 --cache 20%", "--bands 3"]
        {
            assert!(picture(options, &adapter) == first, "{adapter}: {options}");
        }
        assert!(picture("--clip 0,4,0,0.2,1,0.1", &adapter) != first, "the control: another plane");
    }
    let refused = settings("--clip 0,5,0,0,1,0 --secondary roma").check().expect_err("a conflict");
    assert!(refused.to_string().contains("--clip and --secondary"));
}
