//! The window itself, on a display without a screen: real keys and clicks, and what a person does without a display.

use crate::common::{adapters, city, folder, has_program, names, skip, wait};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

/// A process that ends with the test.
struct Ends(Child);

impl Drop for Ends {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A display without a screen, and its name; `None`, and the test is skipped, without the programs for it.
fn display() -> Option<(Ends, String)> {
    if !["Xvfb", "xdotool"].into_iter().all(has_program) {
        skip("Xvfb and xdotool are not installed");
        return None;
    }
    let mut server = Command::new("Xvfb")
        // Else it starts anew whenever its last client leaves, and one that comes then is turned away.
        .args(["-displayfd", "1", "-screen", "0", "1000x700x24", "-nolisten", "tcp", "-noreset"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("Xvfb starts");
    let mut number = String::new();
    BufReader::new(server.stdout.take().expect("its output")).read_line(&mut number).expect("a number");
    Some((Ends(server), format!(":{}", number.trim())))
}

/// Sends keys and clicks.
struct Hand<'a> {
    display: &'a str,
}

impl Hand<'_> {
    fn run(&self, words: &str) -> Output {
        let output = Command::new("xdotool").env("DISPLAY", self.display).args(words.split(' ')).output();
        let output = output.expect("xdotool starts");
        // Events are handled before the next ones come.
        std::thread::sleep(Duration::from_millis(60));
        output
    }

    /// The window of `child` with this title, once it is there.
    fn window(&self, title: &str, child: &mut Child) -> String {
        wait("a window", || {
            if let Some(status) = child.try_wait().expect("a status") {
                let said = child.stderr.take().map(std::io::read_to_string);
                panic!("no window: {status}, {said:?}");
            }
            let output = Command::new("xdotool")
                .env("DISPLAY", self.display)
                .args(["search", "--name", title])
                .output()
                .expect("xdotool starts");
            let found = String::from_utf8_lossy(&output.stdout).lines().last().map(str::to_owned);
            found.filter(|id| !id.is_empty())
        })
    }
}

/// The pixels of a picture that is whole.
fn picture(folder: &Path, name: &str) -> Vec<[f32; 3]> {
    wait(name, || {
        let is_there = names(folder).contains(&name.to_owned());
        is_there.then(|| brickwalk::metrics::load(folder.join(name)).ok()).flatten().map(|loaded| loaded.image.rgb)
    })
}

#[test]
fn a_person_flies_clicks_and_quits() {
    let Some((_server, display)) = display() else { return };
    let hand = Hand { display: &display };
    let folder = folder();
    let scene = city(folder.path(), "60K", "500");
    for adapter in adapters() {
        // Software Vulkan draws the window as well where it renders; else the processor does.
        let presents = if adapter == "cpu" { "soft" } else { "gpu" };
        let output = folder.path().join(presents);
        std::fs::create_dir(&output).expect("a folder");
        let child = Command::new(env!("CARGO_BIN_EXE_brickwalk"))
            .arg("view")
            .arg(&scene)
            .args(["--size", "700x440", "--spp", "1", "--adapter", &adapter, "-o"])
            .arg(&output)
            .env("DISPLAY", &display)
            .env("BRICKWALK_CONFIG_DIR", output.join("config"))
            .env("BRICKWALK_PRESENT", presents)
            .stderr(Stdio::piped())
            .spawn()
            .expect("the command starts");
        let mut child = Ends(child);
        let id = hand.window("^brickwalk: city", &mut child.0);
        hand.run(&format!("windowfocus {id}"));
        hand.run(&format!("mousemove --window {id} 500 200"));
        // The first picture, from where the scene is opened.
        hand.run("key p");
        let first = picture(&output, "city-60K-500.png");
        // Forward, and another picture.
        hand.run("keydown w");
        // Long enough that a loaded machine shows a picture of the way.
        std::thread::sleep(Duration::from_millis(1500));
        hand.run("keyup w");
        hand.run("key p");
        let second = picture(&output, "city-60K-500-2.png");
        assert!(first != second, "{adapter}: flying does not change the picture");
        // Looking around, by dragging.
        hand.run("mousedown 1");
        hand.run("mousemove_relative 60 10");
        hand.run("mousemove_relative 60 10");
        hand.run("mouseup 1");
        hand.run("key p");
        let third = picture(&output, "city-60K-500-3.png");
        // On a slow device what is on the screen may still be the picture before.
        hand.run("key p");
        let fourth = picture(&output, "city-60K-500-4.png");
        assert!(second != third || third != fourth, "{adapter}: looking around does not change the picture");
        // Every overlay, then none.
        for number in 5..12 {
            hand.run("key o");
            hand.run("key p");
            picture(&output, &format!("city-60K-500-{number}.png"));
        }
        hand.run("click 1");
        hand.run("key k");
        hand.run("key F1");
        hand.run("key Escape");
        hand.run("key ctrl+q");
        let status = wait("the end", || child.0.try_wait().expect("a status"));
        assert!(status.success(), "{adapter}: {status}");
        // What was opened is remembered.
        let remembered = std::fs::read_to_string(output.join("config/window.json")).expect("a file");
        assert!(remembered.contains("city-60K-500.bricks"), "{remembered}");
    }
}

#[test]
fn without_a_display_a_line_says_what_to_do() {
    let folder = folder();
    let scene = city(folder.path(), "10K", "500");
    let output = Command::new(env!("CARGO_BIN_EXE_brickwalk"))
        .arg("view")
        .arg(&scene)
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .env_remove("WAYLAND_SOCKET")
        .output()
        .expect("the command starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(said.contains("no display") && said.contains("brickwalk walk"), "{said}");
}
