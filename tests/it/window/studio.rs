//! The thread that renders for a window: what is seen in the end is what `walk` writes, wishes are answered soon, and
//! nothing that goes wrong ends it.

use crate::common::{adapters, folder, levelled_city as city, names, software, succeed};
use brickwalk::Settings;
use brickwalk::metrics::load;
use brickwalk::scene::Camera;
use brickwalk::settings::{Adapter, Group, ImageSize};
use brickwalk::view::studio::{Ask, Converter, News, Overlay, Pace, Purpose, Scene, Shown, Stage, Studio, Wish};
use std::io::Write;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Nothing here takes longer.
const MOST: Duration = Duration::from_secs(120);

/// Settings of these options, as the command takes them.
pub fn settings(options: &str) -> Settings {
    Settings::from_options(options).expect("options").for_windows()
}

/// A studio, and the scene that it has opened.
pub fn open(scene: &Path, settings: &Settings) -> (Studio, Scene) {
    let converter: Converter = Arc::new(|path, _| Ok(path.into()));
    let studio = Studio::start(settings, Pace::default(), converter, Arc::new(|| ())).expect("a thread");
    studio.ask(Ask::Open(scene.into()));
    let opened = until(&studio, |news| match news {
        News::Opened(scene) => Some(*scene),
        News::Failed(text) => panic!("{text}"),
        _ => None,
    });
    (studio, opened)
}

/// Waits for news.
pub fn until<T>(studio: &Studio, mut wanted: impl FnMut(News) -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        match studio.news() {
            Some(news) => {
                if let Some(found) = wanted(news) {
                    return found;
                }
            }
            None => std::thread::sleep(Duration::from_millis(1)),
        }
        assert!(start.elapsed() < MOST, "nothing came");
    }
}

/// The picture of a camera once it rests, and those before it.
pub fn rest(studio: &Studio, wish: &Wish) -> (Arc<Shown>, Vec<Arc<Shown>>) {
    studio.wish(wish.clone());
    let mut before = Vec::new();
    let last = until(studio, |news| match news {
        News::Shown(shown) if shown.stage == Stage::Done && shown.camera == wish.camera => Some(shown),
        News::Shown(shown) => {
            before.push(shown);
            None
        }
        News::Failed(text) => panic!("{text}"),
        _ => None,
    });
    (last, before)
}

/// The bytes of the picture that `walk` writes for a camera.
fn walked(scene: &Path, folder: &Path, settings: &Settings, camera: &Camera) -> Vec<[u8; 3]> {
    let path = folder.join("still.json");
    let keyframe = serde_json::json!({
        "time": 0.0, "position": camera.position.to_array(), "target": camera.target.to_array(),
    });
    let still = serde_json::json!({
        "fov_y_degrees": camera.fov_y.to_degrees(), "up": camera.up.to_array(), "keyframes": [keyframe],
    });
    std::fs::write(&path, still.to_string()).expect("a path");
    let output = folder.join("out");
    // Names of adapters have spaces in them.
    let adapter = settings.adapter.to_string();
    let still = Settings { path: Some(path), frames: 1, frame_budget: None, ..settings.clone() };
    let options = Settings { adapter: Adapter::Auto, ..still }.options();
    let words = ["walk".as_ref(), scene.as_os_str(), "-o".as_ref(), output.as_os_str()];
    let words = words.into_iter().chain(["--adapter".as_ref(), adapter.as_ref()]);
    succeed(words.into_iter().chain(options.split_whitespace().map(std::ffi::OsStr::new)));
    let picture = load(output.join("frames/0000.png")).expect("a picture").image;
    // Back to the bytes that it was decoded from.
    brickwalk::session::developed(&picture.rgb, 0.0, brickwalk::picture::tone_map::ToneMap::None)
}

/// What a material is, byte for byte.
fn bytes_of(material: &bricks::Material) -> &[u8] {
    bytemuck::bytes_of(material)
}

/// A wish without an overlay.
pub fn wish(camera: Camera, settings: &Settings) -> Wish {
    Wish { camera, settings: settings.clone(), overlay: Overlay::None }
}

#[test]
fn a_camera_at_rest_shows_what_walk_writes() {
    let folder = folder();
    let scene = city(folder.path());
    let path = scene.with_extension("near.json");
    let mut pictures = 0;
    for (number, adapter) in adapters().into_iter().enumerate() {
        for (options, is_quick) in [
            ("--size 160x90 --cache 40%", true),
            ("--size 96x54 --cache 15% --effects primary,shadow,diffuse,glossy --spp 2 --frame-budget 256K", false),
            ("--size 96x54 --denoise --spp 1 --exposure 0.5 --tone-map aces", false),
            ("--size 96x54 --lod 1 --spp 1", false),
        ] {
            if number > 0 && !is_quick {
                continue;
            }
            let mut asked = settings(options);
            asked.set("adapter", &adapter).expect("an adapter");
            asked.path = Some(path.clone());
            let (studio, opened) = open(&scene, &asked);
            assert!(opened.has_levels && opened.triangles > 50_000);
            let cameras = [0, 4, 9].map(|at| opened.way.frame(at, 10));
            // A camera that jumps shows something soon, wherever it is.
            for camera in &cameras[..2] {
                studio.wish(wish(*camera, &asked));
                let first = until(&studio, |news| match news {
                    News::Shown(shown) if shown.camera == *camera => Some(shown),
                    _ => None,
                });
                assert_eq!(first.stage, Stage::Moving);
            }
            let (last, before) = rest(&studio, &wish(cameras[2], &asked));
            let truth = walked(&scene, folder.path(), &asked, &cameras[2]);
            assert!(last.is_exact() && last.samples == asked.spp, "{options}");
            assert_eq!(last.pixels.len(), truth.len());
            assert!(last.pixels == truth, "{adapter}, {options}: another picture than that of walk");
            // The control: a picture on the way to it is another one.
            let moving = before.iter().find(|shown| shown.stage == Stage::Moving).expect("a picture in between");
            assert!(moving.pixels != truth || asked.spp == 1);
            pictures += 1;
        }
    }
    assert!(pictures >= 4);
}

#[test]
fn settings_change_while_a_scene_is_open() {
    let folder = folder();
    let scene = city(folder.path());
    let first = settings("--size 96x54 --spp 1 --adapter cpu --cache 50%");
    let (studio, opened) = open(&scene, &first);
    let camera = opened.way.frame(0, 1);
    let (plain, _) = rest(&studio, &wish(camera, &first));
    let mut seen = vec![plain.pixels.clone()];
    for options in [
        "--effects primary",
        "--effects primary,shadow,ao,diffuse,glossy",
        "--sun 1,0.3,0 --sun-angle 5",
        "--environment off --sky-intensity 2",
        "--spp 3 --exposure -1",
        "--tone-map reinhard",
        "--clip 0,4,0,0.1,1,0",
        "--size 64x40",
        // What a session is opened with: it is opened again.
        "--cache 20%",
        "--secondary roma",
        "--size 96x54",
    ] {
        let mut next = first.clone();
        next.set_options(options).expect("options");
        let (last, _) = rest(&studio, &wish(camera, &next));
        assert_eq!(last.size, (next.size.width, next.size.height));
        let truth = walked(&scene, folder.path(), &next, &camera);
        assert!(last.pixels == truth, "{options}: another picture than that of walk");
        let is_same = matches!(options, "--cache 20%" | "--size 96x54");
        assert_eq!(seen.contains(&last.pixels), is_same, "{options}: the control");
        seen.push(last.pixels.clone());
    }
}

#[test]
fn places_are_told_and_pictures_compared_and_saved() {
    let folder = folder();
    let scene = city(folder.path());
    let mut asked = settings("--size 96x54 --spp 1 --adapter cpu --cache 30%");
    let (studio, opened) = open(&scene, &asked);
    let camera = opened.way.frame(0, 1);
    let (last, _) = rest(&studio, &wish(camera, &asked));
    // In the middle of a pixel it is what that pixel shows.
    let seen = last.depth.iter().enumerate().filter(|(_, depth)| depth.is_finite()).map(|(pixel, _)| pixel);
    let pixel = seen.clone().nth(seen.count() / 2).expect("a surface");
    let (x, y) = (((pixel % 96) as f64 + 0.5) / 96.0, ((pixel / 96) as f64 + 0.5) / 54.0);
    studio.ask(Ask::What { x, y, purpose: Purpose::Tell });
    let found = until(&studio, |news| match news {
        News::Found(found, Purpose::Tell) => Some(found),
        _ => None,
    });
    let found = found.expect("a surface");
    let distance = last.distance(x, y).expect("a surface");
    assert!((found.distance / distance - 1.0).abs() < 1e-4, "{} and {distance}", found.distance);
    let id = found.triangle.to_string();
    let words = ["info".as_ref(), scene.as_os_str(), "--id".as_ref(), id.as_ref()];
    let told = succeed(words);
    let origin = found.origin.as_ref().expect("an origin");
    assert!(told.contains(&format!("node {}", origin.node)) && told.contains(&origin.mesh), "{told}");
    let (number, material) = found.material.expect("a material");
    let resident = brickwalk::session::open_scene(&scene).expect("the scene");
    let materials = &resident.resident().materials;
    assert_eq!(bytes_of(&material), bytes_of(&materials[number as usize]));
    assert!(found.of > 0 && found.lines().iter().any(|line| line.starts_with(&format!("material {number}:"))));
    // Its node is found by name, and holds the point.
    let node = found.node.clone().expect("a node");
    studio.ask(Ask::Find(node.name.to_uppercase()));
    let (nodes, count) = until(&studio, |news| match news {
        News::Nodes(nodes, count) => Some((nodes, count)),
        _ => None,
    });
    assert!(count >= nodes.len() && nodes.contains(&node), "{node:?} is not among {count}");
    studio.ask(Ask::Locate(node.clone()));
    let [min, max] = until(&studio, |news| match news {
        News::Located(own, bounds) if own == node => Some(bounds),
        _ => None,
    })
    .expect("triangles");
    assert!(found.point.cmpge(min - 1e-3).all() && found.point.cmple(max + 1e-3).all());
    // Above the horizon there is nothing.
    studio.ask(Ask::What { x: 0.5, y: 0.01, purpose: Purpose::Measure });
    assert!(until(&studio, |news| match news {
        News::Found(found, Purpose::Measure) => Some(found.is_none()),
        _ => None,
    }));
    let file = folder.path().join("shot.png");
    studio.ask(Ask::Save(file.clone()));
    until(&studio, |news| matches!(news, News::Saved(saved) if saved == file).then_some(()));
    let saved = load(&file).expect("a picture").image;
    let bytes = brickwalk::session::developed(&saved.rgb, 0.0, brickwalk::picture::tone_map::ToneMap::None);
    assert!(bytes == last.pixels);
    let compared = |studio: &Studio| {
        studio.ask(Ask::Compare);
        until(studio, |news| match news {
            News::Compared(comparison) => Some(comparison),
            News::Failed(text) => panic!("{text}"),
            _ => None,
        })
    };
    let comparison = compared(&studio);
    assert_eq!((comparison.flip, comparison.rmse), (0.0, 0.0));
    // The control: levels of detail at rest are not the same picture.
    asked.lod = 4.0;
    rest(&studio, &wish(camera, &asked));
    let comparison = compared(&studio);
    assert!(comparison.flip > 1e-3 && comparison.rmse > 0.0 && comparison.map.iter().any(|&pixel| pixel != [0; 3]));
}

#[test]
fn what_goes_wrong_is_told_and_survived() {
    let folder = folder();
    let scene = city(folder.path());
    let asked = settings("--size 96x54 --spp 1 --adapter cpu --cache 15% --host-cache 0");
    let (studio, opened) = open(&scene, &asked);
    let cameras = [0, 5, 9].map(|at| opened.way.frame(at, 10));
    let (first, _) = rest(&studio, &wish(cameras[0], &asked));
    let failure = |studio: &Studio| {
        until(studio, |news| match news {
            News::Failed(text) => Some(text),
            _ => None,
        })
    };
    // Another file that is none: what is open stays open.
    let other = folder.path().join("none.bricks");
    for (bytes, _) in [(None, "missing"), (Some(&b"no scene"[..]), "none")] {
        if let Some(bytes) = bytes {
            std::fs::write(&other, bytes).expect("a file");
        }
        studio.ask(Ask::Open(other.clone()));
        let text = failure(&studio);
        assert!(text.contains("none.bricks") && !text.contains('\n'), "{text}");
    }
    let (again, _) = rest(&studio, &wish(cameras[1], &asked));
    assert!(again.pixels != first.pixels);
    // The file is cut, and made whole again.
    let whole = std::fs::read(&scene).expect("the scene");
    std::fs::File::options().write(true).open(&scene).expect("the scene").set_len(9000).expect("a shorter file");
    let far = Camera { position: cameras[2].position, ..cameras[0] };
    studio.wish(wish(far, &asked));
    let text = failure(&studio);
    assert!(text.contains("city.bricks") && !text.contains('\n'), "{text}");
    let mut file = std::fs::File::options().write(true).open(&scene).expect("the scene");
    file.write_all(&whole).expect("the scene");
    drop(file);
    let (back, _) = rest(&studio, &wish(cameras[0], &asked));
    assert!(back.pixels == first.pixels);
    // The file is removed: what is open does not need its name.
    std::fs::remove_file(&scene).expect("the scene");
    let (removed, _) = rest(&studio, &wish(cameras[1], &asked));
    assert!(removed.pixels == again.pixels);
    // A picture that cannot be written.
    let nowhere = folder.path().join("no/such/folder/shot.png");
    studio.ask(Ask::Save(nowhere));
    assert!(failure(&studio).contains("shot.png"));
    assert!(!names(folder.path()).iter().any(|name| name.contains("shot")));
    // Bad settings for an environment.
    let mut bad = asked.clone();
    bad.set_options("--environment no.hdr").expect("options");
    studio.wish(wish(cameras[0], &bad));
    assert!(failure(&studio).contains("no.hdr"));
    let (still, _) = rest(&studio, &wish(cameras[0], &asked));
    assert!(still.pixels == first.pixels);
}

#[test]
fn a_first_view_fits_the_pictures() {
    let folder = folder();
    let scene = city(folder.path());
    let asked = settings("--size 160x90 --spp 1 --adapter cpu");
    // Whether something is seen at the border of a picture.
    let touches = |shown: &Shown| {
        let (width, height) = (shown.size.0 as usize, shown.size.1 as usize);
        let is_border = |i: &usize| {
            let (x, y) = (i % width, i / width);
            x == 0 || y == 0 || x + 1 == width || y + 1 == height
        };
        (0..width * height).filter(is_border).any(|i| shown.depth[i].is_finite())
    };
    let mut cameras = Vec::new();
    for (width, height) in [(160, 90), (64, 112)] {
        let (studio, _) = open(&scene, &asked);
        let size = ImageSize { width, height };
        studio.ask(Ask::Size(size));
        studio.ask(Ask::Open(scene.clone()));
        let opened = until(&studio, |news| match news {
            News::Opened(scene) => Some(*scene),
            _ => None,
        });
        let own = Settings { size, ..asked.clone() };
        cameras.push(opened.way.frame(0, 1));
        let (last, _) = rest(&studio, &wish(cameras[cameras.len() - 1], &own));
        assert!(last.size == (width, height) && !touches(&last), "{width}x{height}");
        assert!(last.depth.iter().filter(|depth| depth.is_finite()).count() > last.depth.len() / 20);
        // The control: in a high picture the view of a wide one is cut.
        if cameras.len() == 2 {
            assert!(touches(&rest(&studio, &wish(cameras[0], &own)).0));
        }
    }
}

#[test]
fn a_window_that_is_dragged_larger_keeps_its_scene() {
    let folder = folder();
    let scene = city(folder.path());
    let mut asked = settings("--size 64x36 --spp 1 --adapter cpu --cache 30%");
    let (studio, opened) = open(&scene, &asked);
    let camera = opened.way.frame(0, 1);
    for (width, height) in [(1, 1), (333, 17), (640, 360), (5, 200)] {
        asked.size = ImageSize { width, height };
        let (last, _) = rest(&studio, &wish(camera, &asked));
        assert_eq!(last.size, (width, height));
        assert!(last.is_exact());
    }
}

#[test]
fn a_device_that_is_lost_comes_back() {
    let Some(adapter) = software() else { return };
    let folder = folder();
    let scene = city(folder.path());
    let mut asked = settings("--size 96x54 --spp 1 --cache 40%");
    asked.set("adapter", &adapter).expect("an adapter");
    let (studio, opened) = open(&scene, &asked);
    let cameras: Vec<Camera> = (0..2).map(|at| opened.way.frame(at, 3)).collect();
    let (first, _) = rest(&studio, &wish(cameras[0], &asked));
    studio.ask(Ask::LoseDevice);
    let text = until(&studio, |news| match news {
        News::Failed(text) => Some(text),
        _ => None,
    });
    assert!(!text.contains('\n') && !text.is_empty(), "{text}");
    until(&studio, |news| matches!(news, News::Told(text) if text.contains("open again")).then_some(()));
    // What was wished is shown again, and so is what is wished next.
    let again = until(&studio, |news| match news {
        News::Shown(shown) if shown.stage == Stage::Done => Some(shown),
        _ => None,
    });
    assert!(again.pixels == first.pixels);
    let (next, _) = rest(&studio, &wish(cameras[1], &asked));
    assert!(next.pixels != first.pixels && next.is_exact());
}
