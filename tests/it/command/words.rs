//! What commands say of themselves: help, how much is said, completions, man pages.

use crate::common::{brickwalk, city, folder, records, succeed};
use std::path::Path;
use std::process::Output;

fn texts(output: &Output) -> [String; 2] {
    [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text).into_owned())
}

/// Words of a walk of a small picture.
fn walk<'a>(scene: &'a Path, out: &'a Path, more: &'a [&'a str]) -> Vec<&'a str> {
    let [scene, out] = [scene, out].map(|path| path.to_str().expect("UTF-8"));
    let fixed = ["walk", scene, "-o", out, "--frames", "2", "--size", "32x18", "--adapter", "cpu"];
    fixed.into_iter().chain(more.iter().copied()).collect()
}

#[test]
fn quiet_says_errors_and_results_alone() {
    let folder = folder();
    let scene = city(folder.path(), "10K", "4K");
    let out = folder.path().join("out");
    let name = scene.to_str().expect("UTF-8");
    // An option that does nothing is a warning otherwise.
    let idle = ["--roma-k", "8"];
    let [said, warned] = texts(&brickwalk(walk(&scene, &out, &idle)));
    assert!(said.contains("report.html: report") && said.contains("frames: 2 frames"), "{said}");
    assert!(warned.contains("warning"), "{warned}");
    let [said, warned] = texts(&brickwalk(walk(&scene, &out, &[&idle[..], &["-q"]].concat())));
    assert_eq!((said.as_str(), warned.as_str()), ("", ""));
    assert!(out.join("report.html").exists());
    assert_eq!(succeed(["-q", "verify", name]), "");
    assert!(succeed(["verify", name]).contains(": OK: "));
    // Results are what a command is for, and errors are always said.
    assert!(succeed(["info", name, "--quiet", "--json"]).contains("\"format\""));
    let records = succeed(walk(&scene, &out, &["-q", "--json"]));
    assert!(!records.is_empty() && records.lines().all(|line| line.starts_with('{')), "{records}");
    let [said, error] = texts(&brickwalk(["verify", "-q", "none.bricks"]));
    assert!(said.is_empty() && error.starts_with("brickwalk: none.bricks"), "{error}");
    assert_eq!(brickwalk(["verify", name, "-q", "-v"]).status.code(), Some(2));
}

#[test]
fn verbose_says_what_is_decided() {
    let folder = folder();
    let scene = city(folder.path(), "10K", "4K");
    let out = folder.path().join("out");
    let [_, usual] = texts(&brickwalk(walk(&scene, &out, &[])));
    assert_eq!(usual, "");
    let [_, told] = texts(&brickwalk(walk(&scene, &out, &["-v"])));
    for part in ["adapter: ", "asked for", "cache: ", "schedule: auto", "kernels: ", "frame 0: ", "primary ", " by chc"]
    {
        assert!(told.contains(part), "{part}: {told}");
    }
    assert!(told.lines().all(|line| line.starts_with("brickwalk: ")), "{told}");
    // Records name the schedule, too.
    let records = records(&out);
    let mut schedules = records.iter().map(|record| record["schedule"].as_str().expect("a schedule"));
    assert!(schedules.all(|names| names.split('+').all(|name| ["chc", "demand", "plain"].contains(&name))));
}

#[test]
fn completions_and_man_pages_know_every_command() {
    let commands = ["walk", "convert", "scene", "info", "verify", "repair", "trace", "replay", "compare", "adapters"];
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = succeed(["completions", shell]);
        for word in commands.into_iter().chain(["checkpoints", "brick-triangles"]) {
            assert!(script.contains(word), "{shell}: {word}");
        }
    }
    let folder = folder();
    let pages = folder.path().join("man");
    succeed(["man", pages.to_str().expect("UTF-8")]);
    for command in commands {
        let page = std::fs::read_to_string(pages.join(format!("brickwalk-{command}.1"))).expect("a page");
        assert!(page.contains(".SH OPTIONS") && page.contains(".TH"), "{command}");
    }
    // Options of experts have their place there.
    let walk = std::fs::read_to_string(pages.join("brickwalk-walk.1")).expect("a page");
    assert!(walk.contains("query\\-threshold") && walk.contains("Samples per pixel"));
    assert!(pages.join("brickwalk.1").exists() && !pages.join("brickwalk-help.1").exists());
    assert_eq!(brickwalk(["completions", "tcsh"]).status.code(), Some(2));
}

/// Every option is in the long help of its command or in that of all options, with a sentence, and one screen is enough
/// for what most walks need.
#[test]
fn help_has_every_option_under_a_heading() {
    let short = succeed(["walk", "-h"]);
    assert!(short.lines().count() <= 50, "{} lines", short.lines().count());
    for heading in ["Camera:", "Light:", "Quality:", "Cache:", "Methods:"] {
        assert!(short.contains(heading), "{heading}");
    }
    let convert = succeed(["convert", "--help"]);
    for heading in ["Inputs:", "Bricks:", "Conversion:", "Meshes:", "Textures:"] {
        assert!(convert.contains(heading), "{heading}");
    }
    let (long, all) = (succeed(["walk", "--help"]), succeed(["walk", "--help-all"]));
    assert!(!long.contains("--query-threshold") && all.contains("--query-threshold"));
    assert!(!succeed(["bench", "chc", "--help"]).contains("--skip"));
    assert!(succeed(["bench", "chc", "--help-all"]).contains("--skip"));
}
