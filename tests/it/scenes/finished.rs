//! Pictures as they are without any option: models fill them, and what they show is neither dark nor burnt out.

use crate::common::{brickwalk, folder, shared_scenes, succeed};
use brickwalk::metrics::{Channel, load};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

const WIDTH: usize = 160;
const HEIGHT: usize = 90;

/// What a frame shows of a scene.
#[derive(Clone, Copy, Debug)]
struct Look {
    /// Its share of the width or of the height, whichever is larger.
    fill: f64,
    /// Mean sRGB value of all channels, 0 to 1.
    mean: f64,
    /// The share of its pixels of which a channel is full.
    clipped: f64,
}

fn look(frame: &Path) -> Look {
    let picture = image::open(frame).expect("a PNG").to_rgb8();
    let Some(Channel::Float(depth)) = load(frame.with_extension("exr")).expect("an EXR").channels.remove("depth.Z")
    else {
        panic!("no depth")
    };
    let hit: Vec<usize> = (0..WIDTH * HEIGHT).filter(|&i| depth[i].is_finite()).collect();
    assert!(!hit.is_empty(), "{} shows nothing", frame.display());
    let span = |place: &dyn Fn(usize) -> usize, of: usize| {
        let places = || hit.iter().map(|&i| place(i));
        let most = places().max().expect("a pixel") + 1;
        (most - places().min().expect("a pixel")) as f64 / of as f64
    };
    let channels: Vec<[u8; 3]> =
        hit.iter().map(|&i| picture.get_pixel((i % WIDTH) as u32, (i / WIDTH) as u32).0).collect();
    let sum: f64 = channels.iter().flatten().map(|&c| f64::from(c) / 255.0).sum();
    let full = channels.iter().filter(|pixel| pixel.iter().any(|&c| c >= 254)).count();
    Look {
        fill: span(&|i| i % WIDTH, WIDTH).max(span(&|i| i / WIDTH, HEIGHT)),
        mean: sum / (3 * hit.len()) as f64,
        clipped: full as f64 / hit.len() as f64,
    }
}

/// Walks and traces without options but those that make it small, and looks at the frames.
fn looks(scene: &Path) -> Vec<Look> {
    let (out, small) = (scene.with_extension("out"), format!("{WIDTH}x{HEIGHT}"));
    let words = ["walk".as_ref(), scene.as_os_str(), "-o".as_ref(), out.as_os_str()];
    let options = ["--frames", "3", "--aov", "--size", &small];
    succeed(words.into_iter().chain(options.map(OsStr::new)));
    let rays = scene.with_extension("rays.npy");
    let header = format!("{:<117}\n", "{'descr': '<f8', 'fortran_order': False, 'shape': (1, 8), }");
    let values = [0.1f64, 1e3, 0.1, 0.0, -1.0, 0.0, 0.0, f64::INFINITY];
    let bytes = [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes()].concat();
    let bytes = [bytes, values.iter().flat_map(|value| value.to_le_bytes()).collect()].concat();
    std::fs::write(&rays, bytes).expect("rays");
    let hits = scene.with_extension("hits.npy");
    let words = ["trace".as_ref(), scene.as_os_str(), "--rays".as_ref(), rays.as_os_str()];
    succeed(words.into_iter().chain(["-o".as_ref(), hits.as_os_str()]));
    (0..3).map(|frame| look(&out.join(format!("frames/{frame:04}.png")))).collect()
}

fn check(name: &str, scene: &Path, is_model: bool) {
    for (frame, look) in looks(scene).into_iter().enumerate() {
        assert!((0.2..=0.7).contains(&look.mean), "{name}, frame {frame}: {look:?}");
        assert!(look.clipped < 0.02, "{name}, frame {frame}: {look:?}");
        assert!(look.fill >= 0.4, "{name}, frame {frame}: {look:?}");
        assert!(!is_model || (0.4..=0.95).contains(&look.fill), "{name}, frame {frame}: {look:?}");
    }
}

#[test]
fn generated_scenes_look_finished() {
    let folder = folder();
    for (kind, triangles) in
        [("city", "30K"), ("pipes", "30K"), ("terrain", "50K"), ("stadium", "500K"), ("cornell", "30K")]
    {
        let scene = folder.path().join(format!("{kind}.bricks"));
        let words = ["scene", kind, "--triangles", triangles, "-o"].map(OsStr::new);
        succeed(words.into_iter().chain([scene.as_os_str()]));
        check(kind, &scene, false);
    }
}

/// Without a material a surface is grey; dark and bright ones, small and large ones, turned to the light and from it.
#[test]
fn models_look_finished() {
    let folder = folder();
    let shapes = [
        // A pyramid of a millimetre, a thin sheet of a kilometre, a pole.
        (
            "pyramid",
            "v 0 0 0\nv 1e-3 0 0\nv 1e-3 0 1e-3\nv 0 0 1e-3\nv 5e-4 1e-3 5e-4\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n",
        ),
        ("sheet", "v 0 0 0\nv 1e3 0 0\nv 1e3 0 1e3\nv 0 0 1e3\nf 1 4 3 2\n"),
        ("pole", "v 0 0 0\nv 1 0 0\nv 0 0 1\nv 0 50 0\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"),
    ];
    let looks = [("bare", ""), ("black", "Kd 0.02 0.02 0.02"), ("lamp", "Kd 0 0 0\nKe 9 9 9")];
    for (shape, text) in shapes {
        for (look, material) in looks {
            let name = format!("{shape}-{look}");
            let input = folder.path().join(&name).with_extension("obj");
            let material = format!("newmtl m\n{material}\n");
            std::fs::write(input.with_extension("mtl"), material).expect("a material");
            let head = if look == "bare" { String::new() } else { format!("mtllib {name}.mtl\nusemtl m\n") };
            std::fs::write(&input, head + text).expect("a shape");
            check(&name, &converted(&input, folder.path()), true);
        }
    }
}

#[test]
fn shared_models_look_finished() {
    let Some(scenes) = shared_scenes() else { return };
    let folder = folder();
    for (input, is_model) in [
        ("scans/bunny.ply", true),
        ("scans/lucy.ply", true),
        ("scans/lionstatue/lionstatue.obj", true),
        ("teapots_instanced/TeapotsGalore.gltf", true),
        ("stress/DracoCompressed/CesiumMilkTruck.gltf", true),
        // A room, seen from within.
        ("sponza/Sponza.gltf", false),
    ] {
        let scene = converted(&scenes.join(input), folder.path());
        check(input, &scene, is_model);
    }
}

fn converted(input: &Path, folder: &Path) -> PathBuf {
    let scene = folder.join(input.file_name().expect("a name")).with_extension("bricks");
    let output = brickwalk(["convert".as_ref(), input.as_os_str(), "-o".as_ref(), scene.as_os_str()]);
    assert!(output.status.success(), "{}: {}", input.display(), String::from_utf8_lossy(&output.stderr));
    scene
}
