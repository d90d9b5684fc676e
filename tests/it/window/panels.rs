//! The panels: what a person finds there by its label, presses, and what comes of it. No display is needed: what is
//! drawn goes through the window's own rasteriser.

use crate::common::{folder, levelled_city as city, names, succeed};
use brickwalk::Settings;
use brickwalk::picture::exposure::Exposure;
use brickwalk::session::Session;
use brickwalk::settings::Environment;
use brickwalk::view::studio::{Converter, Overlay, Pace, Stage};
use brickwalk::view::viewer::{Mode, Viewer};
use brickwalk::view::window::desk::{Asked, Desk};
use brickwalk::view::window::present::{Content, draw};
use brickwalk::view::window::raster::{Canvas, Painter};
use brickwalk::view::window::recent::Recent;
use brickwalk_convert::build::{BuildSettings, build_source};
use brickwalk_convert::import::{ImportSettings, Input, import};
use egui::{Key, Modifiers, PointerButton, Pos2, Vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Nothing here takes longer.
const MOST: Duration = Duration::from_secs(60);

struct Window {
    desk: Desk,
    asked: Asked,
}

/// Pixels of a window: room for all of the panel, and for a narrow picture beside it.
const SIZE: [usize; 2] = [400, 1500];

/// A window over a scene.
fn window(scene: &Path, options: &str, folder: &Path) -> Harness<'static, Window> {
    opened(scene, options, folder, Arc::new(|path, _| Ok(path.into())))
}

/// The same, where models are converted so.
fn opened(scene: &Path, options: &str, folder: &Path, converter: Converter) -> Harness<'static, Window> {
    let settings = Settings::from_options(&format!("--adapter cpu {options}")).expect("options").for_windows();
    let mut viewer = Viewer::new(&settings, Pace::default(), converter, Arc::new(|| ())).expect("a viewer");
    viewer.open(scene);
    let desk = Desk::new(viewer, Recent::default(), folder.into());
    let show = |ui: &mut egui::Ui, window: &mut Window| {
        let asked = window.desk.show(ui, 0.02);
        window.asked.quit |= asked.quit;
        window.asked.full_screen |= asked.full_screen;
    };
    let state = Window { desk, asked: Asked::default() };
    Harness::builder()
        .with_size(SIZE.map(|x| x as f32))
        .with_max_steps(4)
        .with_step_dt(1.0 / 60.0)
        .build_ui_state(show, state)
}

/// Draws frames until something holds.
fn until(harness: &mut Harness<Window>, what: &str, holds: impl Fn(&Viewer) -> bool) {
    let start = Instant::now();
    while !holds(&harness.state().desk.viewer) {
        harness.step();
        std::thread::sleep(Duration::from_millis(2));
        assert!(start.elapsed() < MOST, "{what}: {:?}", harness.state().desk.viewer.messages);
    }
}

fn is_done(viewer: &Viewer) -> bool {
    let of_wish = |shown: &brickwalk::view::studio::Shown| {
        shown.stage == Stage::Done
            && Some(shown.camera) == viewer.camera()
            && shown.size == (viewer.settings.size.width, viewer.settings.size.height)
    };
    viewer.shown.as_deref().is_some_and(of_wish)
}

fn press(harness: &mut Harness<Window>, label: &str) {
    harness.get_by_label(label).click();
    harness.run_steps(3);
}

fn type_key(harness: &mut Harness<Window>, key: Key) {
    harness.key_press(key);
    harness.run_steps(2);
}

/// Presses and lets go in the picture, `count` times within a double click's time.
fn click(harness: &mut Harness<Window>, at: Pos2, count: usize) {
    for _ in 0..count {
        harness.hover_at(at);
        for pressed in [true, false] {
            let (pos, button, modifiers) = (at, PointerButton::Primary, Modifiers::NONE);
            harness.event(egui::Event::PointerButton { pos, button, pressed, modifiers });
            harness.step();
        }
    }
}

/// The window as it is drawn.
fn drawn(harness: &Harness<Window>, painter: &mut Painter) -> Vec<u32> {
    let [width, height] = SIZE;
    let mut output = harness.output().clone();
    let panels = harness.ctx.tessellate(std::mem::take(&mut output.shapes), 1.0);
    let mut pixels = vec![0; width * height];
    let mut canvas = Canvas { width, height, pixels: &mut pixels };
    let window = harness.state();
    let shown = window.desk.viewer.shown.clone();
    draw(
        painter,
        &mut canvas,
        Content {
            size: (width as u32, height as u32),
            picture: shown.as_deref().map(|shown| (shown, window.desk.picture)),
            panels: &panels,
            textures: &mut output.textures_delta,
            pixels_per_point: 1.0,
        },
    );
    pixels
}

#[test]
fn a_session_with_keys_and_clicks() {
    let folder = folder();
    let scene = city(folder.path());
    let mut harness = window(&scene, "--spp 1 --cache 40%", folder.path());
    let mut painter = Painter::default();
    painter.update(&mut harness.output().clone().textures_delta);
    until(&mut harness, "the first picture", is_done);
    let first = drawn(&harness, &mut painter);
    // Flying changes the picture, and home is where it began.
    let home = harness.state().desk.viewer.camera().expect("a camera");
    harness.key_down(Key::W);
    harness.run_steps(10);
    harness.key_up(Key::W);
    harness.step();
    let flown = harness.state().desk.viewer.camera().expect("a camera");
    assert!((flown.position - home.position).length() > 1.0);
    until(&mut harness, "a picture from there", is_done);
    assert!(drawn(&harness, &mut painter) != first);
    type_key(&mut harness, Key::Home);
    assert_eq!(harness.state().desk.viewer.camera(), Some(home));
    until(&mut harness, "the first picture again", is_done);
    // What is it? The middle of the picture is the city.
    let middle = harness.state().desk.picture.center();
    click(&mut harness, middle, 1);
    until(&mut harness, "an answer", |viewer| viewer.found.is_some());
    harness.run_steps(2);
    assert!(harness.query_by_label_contains("triangle id").is_some());
    // Its node is hidden, shown alone, shown again with all others, and gone to.
    let node = harness.state().desk.viewer.found.as_ref().and_then(|found| found.node.clone()).expect("a node");
    let whole = harness.state().desk.viewer.shown.clone().expect("a picture").pixels.clone();
    let mut seen = vec![whole.clone()];
    for key in [Key::H, Key::I] {
        type_key(&mut harness, key);
        until(&mut harness, "a picture of the others", |viewer| {
            is_done(viewer) && viewer.shown.as_ref().is_some_and(|shown| shown.pixels != seen[seen.len() - 1])
        });
        seen.push(harness.state().desk.viewer.shown.clone().expect("a picture").pixels.clone());
    }
    assert!(seen[1] != seen[2] && harness.state().desk.viewer.settings.only == [node.pattern.clone()]);
    type_key(&mut harness, Key::U);
    until(&mut harness, "the whole scene again", |viewer| {
        is_done(viewer) && viewer.shown.as_ref().is_some_and(|shown| shown.pixels == whole)
    });
    press(&mut harness, "Nodes");
    press(&mut harness, "Go to node");
    until(&mut harness, "a node", |viewer| viewer.located.is_some() && !viewer.is_moving_itself());
    assert!(harness.state().desk.viewer.camera() != Some(home));
    type_key(&mut harness, Key::Home);
    // From here to there.
    type_key(&mut harness, Key::M);
    assert_eq!(harness.state().desk.viewer.mode, Mode::Measure);
    for offset in [Vec2::ZERO, Vec2::new(14.0, 3.0)] {
        // Far enough apart in time not to be a double click.
        harness.run_steps(40);
        let count = harness.state().desk.viewer.measured.len();
        click(&mut harness, middle + offset, 1);
        until(&mut harness, "a point", |viewer| viewer.measured.len() == count + 1);
    }
    let [a, b] = harness.state().desk.viewer.measured[..] else { panic!("two points") };
    assert!((harness.state().desk.viewer.measure().expect("a distance") - (a - b).length()).abs() < 1e-9);
    harness.run_steps(2);
    assert!(harness.query_by_label_contains("measured:").is_some());
    type_key(&mut harness, Key::Escape);
    assert_eq!(harness.state().desk.viewer.mode, Mode::Tell);
    // Going there.
    harness.run_steps(40);
    click(&mut harness, middle, 2);
    until(&mut harness, "a flight", Viewer::is_moving_itself);
    until(&mut harness, "its end", |viewer| !viewer.is_moving_itself());
    let there = harness.state().desk.viewer.camera().expect("a camera");
    assert!((there.position - home.position).length() > 1.0);
    // A path of two keyframes, played and saved.
    type_key(&mut harness, Key::K);
    harness.key_down(Key::E);
    harness.run_steps(10);
    harness.key_up(Key::E);
    harness.step();
    type_key(&mut harness, Key::K);
    type_key(&mut harness, Key::Space);
    assert!(harness.state().desk.viewer.playing.is_some());
    until(&mut harness, "the end of the path", |viewer| viewer.playing.is_none());
    // A flight that is recorded has keyframes in time; keyframes by hand come back after it.
    let by_hand = harness.state().desk.viewer.keyframes.clone();
    type_key(&mut harness, Key::R);
    harness.key_down(Key::W);
    harness.run_steps(60);
    harness.key_up(Key::W);
    type_key(&mut harness, Key::R);
    let recorded = harness.state().desk.viewer.keyframes.clone();
    assert!(recorded.len() > 2 && recorded[0].time == 0.0 && recorded.is_sorted_by(|a, b| a.time < b.time));
    assert!(recorded[0].position != recorded[recorded.len() - 1].position);
    harness.state_mut().desk.viewer.keyframes = by_hand;
    press(&mut harness, "Path");
    press(&mut harness, "Save");
    let path = folder.path().join("city-path.json");
    assert!(names(folder.path()).contains(&"city-path.json".to_owned()));
    let read = brickwalk::scene::CameraPath::read(&path).expect("a path");
    assert_eq!(read.keyframes(), harness.state().desk.viewer.keyframes);
    // The command that it says renders it.
    let (_, command) = harness.state().desk.viewer.save_path(folder.path()).expect("a path");
    let words: Vec<&str> = command.split_whitespace().skip(1).collect();
    assert_eq!(words[0], "walk");
    succeed(words.into_iter().chain(["--frames", "1"]));
    // A screenshot.
    type_key(&mut harness, Key::P);
    until(&mut harness, "a screenshot", |_| names(folder.path()).contains(&"city.png".to_owned()));
    // The help, and the end.
    type_key(&mut harness, Key::F1);
    assert!(harness.query_by_label_contains("fly forward").is_some());
    type_key(&mut harness, Key::Escape);
    assert!(harness.query_by_label_contains("fly forward").is_none());
    assert_eq!(harness.state().asked, Asked::default());
    type_key(&mut harness, Key::F11);
    harness.key_press_modifiers(Modifiers::COMMAND, Key::Q);
    harness.run_steps(2);
    assert_eq!(harness.state().asked, Asked { quit: true, full_screen: true });
}

#[test]
fn every_control_changes_what_it_says() {
    let folder = folder();
    let scene = city(folder.path());
    let mut harness = window(&scene, "--spp 1 --cache 40%", folder.path());
    until(&mut harness, "the first picture", is_done);
    let settings = |harness: &Harness<Window>| harness.state().desk.viewer.settings.clone();
    for (label, of) in [
        ("shadows", (|s: &Settings| s.effects.shadow) as fn(&Settings) -> bool),
        ("occlusion", |s| s.effects.ao),
        ("diffuse bounce", |s| s.effects.diffuse),
        ("reflections", |s| s.effects.glossy),
        ("environment's shadows", |s| s.effects.environment),
        ("denoise", |s| s.denoise),
        ("cut open", |s| s.clip.is_some()),
        ("exposure by itself", |s| matches!(s.exposure, Exposure::Auto { .. })),
    ] {
        let before = of(&settings(&harness));
        press(&mut harness, label);
        assert_ne!(of(&settings(&harness)), before, "{label}");
        press(&mut harness, label);
        assert_eq!(of(&settings(&harness)), before, "{label}");
    }
    for &overlay in Overlay::ALL {
        press(&mut harness, overlay.name());
        assert_eq!(harness.state().desk.viewer.overlay, overlay);
        until(&mut harness, overlay.name(), is_done);
    }
    press(&mut harness, "none");
    press(&mut harness, "Light");
    let before = settings(&harness).sun;
    harness.get_by_role_and_label(egui::accesskit::Role::Slider, "sun, around").set_value_accesskit(100.0);
    harness.run_steps(3);
    assert_ne!(settings(&harness).sun, before);
    harness.state_mut().desk.viewer.settings.environment = Some(Environment::Sky);
    // The picture that comes of all this is that of a session with these settings.
    until(&mut harness, "a picture of it", is_done);
    press(&mut harness, "Compare with exact");
    until(&mut harness, "a comparison", |viewer| viewer.comparison.is_some());
    assert_eq!(harness.state().desk.viewer.comparison.as_ref().map(|c| c.flip), Some(0.0));
    type_key(&mut harness, Key::Escape);
    assert!(harness.state().desk.viewer.comparison.is_none());
    let asked = settings(&harness);
    let camera = harness.state().desk.viewer.camera().expect("a camera");
    let mut session = Session::open(&scene, &asked).expect("a session");
    let truth = session.frame(&camera).expect("a frame").picture();
    assert!(harness.state().desk.viewer.shown.as_ref().is_some_and(|shown| shown.pixels == truth));
}

#[test]
fn a_file_that_is_none_is_told() {
    let folder = folder();
    let missing = folder.path().join("missing.bricks");
    let mut harness = window(&missing, "", folder.path());
    until(&mut harness, "a message", |viewer| viewer.messages.iter().any(|message| message.is_failure));
    harness.run_steps(2);
    assert!(harness.query_by_label_contains("missing.bricks").is_some());
    // And what is typed is opened.
    let scene = city(folder.path());
    harness.get_by_role(egui::accesskit::Role::TextInput).focus();
    harness.step();
    harness.get_by_role(egui::accesskit::Role::TextInput).type_text(&scene.display().to_string());
    harness.run_steps(2);
    press(&mut harness, "Open");
    until(&mut harness, "the scene", |viewer| viewer.scene.is_some());
    until(&mut harness, "its picture", is_done);
}

/// A file that is dropped on the window.
#[derive(Debug)]
struct Dropped(PathBuf);

impl egui::DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        std::fs::read(&self.0).map_err(|error| error.to_string())
    }
}

#[test]
fn a_model_that_is_dropped_is_converted_and_shown() {
    let folder = folder();
    let scene = city(folder.path());
    let model = folder.path().join("other.glb");
    let words = ["scene", "city", "--triangles", "20K", "--seed", "7", "-o"];
    succeed(words.iter().map(std::ffi::OsStr::new).chain([model.as_os_str()]));
    let converter: Converter = Arc::new(|path, progress| {
        if path.extension().is_some_and(|ending| ending == "bricks") {
            return Ok(path.into());
        }
        let source = import(&[Input::from(path.to_path_buf())], &ImportSettings::default(), progress)?;
        let file = path.with_extension("bricks");
        build_source(&source, &BuildSettings::default(), &file, progress)?;
        Ok(file)
    });
    let mut harness = opened(&scene, "--spp 1 --cache 40%", folder.path(), converter);
    until(&mut harness, "the first picture", is_done);
    // What is no model is told, and what is shown stays.
    let none = folder.path().join("none.glb");
    std::fs::write(&none, "no model").expect("a file");
    for (path, is_model) in [(&none, false), (&model, true)] {
        harness.input_mut().dropped_files.push(Arc::new(Dropped(path.clone())));
        harness.step();
        if is_model {
            let name = model.clone();
            until(&mut harness, "the other scene", |viewer| {
                viewer.scene.as_ref().is_some_and(|scene| scene.path == name)
            });
        } else {
            until(&mut harness, "a message", |viewer| {
                viewer.messages.iter().any(|message| message.is_failure && message.text.contains("none.glb"))
            });
            assert!(harness.state().desk.viewer.scene.as_ref().is_some_and(|own| own.path == scene));
        }
    }
    until(&mut harness, "its picture", is_done);
    let viewer = &harness.state().desk.viewer;
    assert!(
        viewer.scene.as_ref().is_some_and(|scene| scene.file.ends_with("other.bricks") && scene.triangles < 40_000)
    );
}
