//! The house that ARCHITECTURE.md draws is the one that stands: arrows, circles, folders, names of files.

use super::sources::{arrows, circles, files};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Most files in a folder.
const MOST_FILES: usize = 25;
/// Most columns of a comment.
const MOST_COLUMNS: usize = 120;
/// Crates, by the folders of their sources.
const CRATES: [&str; 8] = [
    "src",
    "bricks/src",
    "tools/bucket/src",
    "tools/convert/src",
    "tools/python/src",
    "tools/report/src",
    "tools/scenes/src",
    "tools/trials/src",
];

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn read(file: &Path) -> String {
    std::fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()))
}

/// The sources of a crate, without the files of tests.
fn sources(folder: &str) -> BTreeMap<String, String> {
    let root = root().join(folder);
    let is_test = |file: &String| file.ends_with("tests.rs") || file.split('/').any(|name| name == "tests");
    let all = files(&root, ".rs").into_iter().filter(|file| !is_test(file) && file != "main.rs");
    all.map(|file| (file.clone(), read(&root.join(file)))).collect()
}

/// The folders of `src/`, each after those that it knows, as the page has them.
fn order() -> Vec<String> {
    let page = read(&root().join("ARCHITECTURE.md"));
    let rows = page.lines().filter_map(|line| line.strip_prefix("| `src/")?.split_once("/`").map(|(name, _)| name));
    rows.map(str::to_owned).collect()
}

/// Arrows from a folder to a later one, and between executors.
fn upward(arrows: &super::sources::Arrows, order: &[String]) -> Vec<String> {
    let rank = |file: &str| order.iter().position(|folder| file.split_once('/').is_some_and(|(top, _)| top == folder));
    let mut found = Vec::new();
    for (from, all) in arrows {
        for to in all {
            let (Some(here), Some(there)) = (rank(from), rank(to)) else { continue };
            let are_executors = [here, there].iter().all(|&rank| matches!(order[rank].as_str(), "gpu" | "cpu"));
            if there > here || (are_executors && there != here) {
                found.push(format!("{from} -> {to}"));
            }
        }
    }
    found
}

#[test]
fn folders_know_those_before_them_alone() {
    let order = order();
    let sources = sources("src");
    let folders: BTreeSet<&str> = sources.keys().filter_map(|file| Some(file.split_once('/')?.0)).collect();
    let on_page: BTreeSet<&str> = order.iter().map(String::as_str).collect();
    assert_eq!(folders, on_page, "the table in ARCHITECTURE.md has every folder of src/");
    let arrows = arrows(&sources);
    assert!(arrows.values().map(BTreeSet::len).sum::<usize>() > 1000, "arrows are found");
    let found = upward(&arrows, &order);
    assert!(found.is_empty(), "arrows to folders that come later in ARCHITECTURE.md:\n{}", found.join("\n"));
    // The control: the other way round nearly all are wrong.
    let reversed: Vec<String> = order.into_iter().rev().collect();
    assert!(upward(&arrows, &reversed).len() > 500);
}

#[test]
fn no_circle_has_more_than_two_files() {
    for folder in CRATES {
        let found: Vec<_> = circles(&arrows(&sources(folder))).into_iter().filter(|circle| circle.len() > 2).collect();
        assert!(found.is_empty(), "{folder}: files that use each other in a circle: {found:#?}");
    }
}

#[test]
fn circles_are_found() {
    let text = |uses: &str| format!("{uses}\npub fn own() {{}}\n");
    let mut sources: BTreeMap<String, String> = [
        ("lib.rs", "pub mod a; pub mod b; pub mod c;".to_owned()),
        ("a.rs", text("use crate::b::Thing;")),
        ("b/mod.rs", text("mod inner; pub use inner::Thing;")),
        ("b/inner.rs", text("pub struct Thing; fn f() { crate::c::own(); }")),
        ("c.rs", text("#[cfg(test)] use super::a::own;")),
    ]
    .into_iter()
    .map(|(file, text)| (file.to_owned(), text))
    .collect();
    // `a` takes from the file that defines, not from the module that hands on; what tests use does not count.
    let free = arrows(&sources);
    assert_eq!(free["a.rs"], BTreeSet::from(["b/inner.rs".to_owned()]));
    assert!(circles(&free).is_empty() && !free.contains_key("c.rs"));
    sources.insert("c.rs".into(), text("use super::a::own as other;"));
    let three = ["a.rs", "b/inner.rs", "c.rs"].map(str::to_owned);
    assert_eq!(circles(&arrows(&sources)), [BTreeSet::from(three)]);
}

#[test]
fn folders_are_small() {
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for file in files(&root(), "") {
        let folder = file.rsplit_once('/').map_or("", |(folder, _)| folder).to_owned();
        // Measurements are dated pages, and grow.
        if !folder.starts_with("docs/results") {
            *counts.entry(folder).or_default() += 1;
        }
    }
    let large: Vec<_> = counts.into_iter().filter(|(_, count)| *count > MOST_FILES).collect();
    assert!(large.is_empty(), "folders of more than {MOST_FILES} files: {large:?}");
}

/// The comment of a line of code, roughly: strings that hold slashes are no comments.
fn comment(line: &str) -> Option<&str> {
    let text = line.trim_start();
    let at = if text.starts_with("//") { line.find("//") } else { line.find(" // ").filter(|_| !line.contains('"')) };
    at.map(|at| &line[at..])
}

#[test]
fn comments_keep_to_their_columns() {
    let mut long = Vec::new();
    for ending in [".rs", ".wgsl"] {
        for file in files(&root(), ending) {
            for (number, line) in read(&root().join(&file)).lines().enumerate() {
                if comment(line).is_some() && line.chars().count() > MOST_COLUMNS {
                    long.push(format!("{file}:{}", number + 1));
                }
            }
        }
    }
    assert!(long.is_empty(), "comments beyond column {MOST_COLUMNS}: {}", long.join(", "));
}

/// The files that a text names by a path from the root, or from `shaders/`.
fn named_files(text: &str) -> Vec<&str> {
    let is_part = |c: char| c.is_ascii_alphanumeric() || "/._-".contains(c);
    let words = text.split(|c: char| !is_part(c)).map(|word| word.trim_end_matches('.'));
    let endings = [".rs", ".wgsl", ".toml", ".sh", ".py"];
    let tops = ["src/", "shaders/", "bricks/", "tools/", "tests/", "examples/", "benches/"];
    let is_file =
        |word: &&str| endings.iter().any(|end| word.ends_with(end)) && tops.iter().any(|top| word.starts_with(top));
    // NAME and FAMILY stand for names.
    words.filter(is_file).filter(|word| !word.contains("NAME") && !word.contains("FAMILY")).collect()
}

#[test]
fn files_that_comments_and_pages_name_are_there() {
    let mut missing = Vec::new();
    for ending in [".rs", ".wgsl", ".md", ".py", ".sh"] {
        for file in files(&root(), ending) {
            // What pages of results and the changelog name was there then; this file names what is not.
            if file.starts_with("docs/results") || file == "CHANGELOG.md" || file.starts_with("tests/it/house") {
                continue;
            }
            let text = read(&root().join(&file));
            let is_code = ending == ".rs" || ending == ".wgsl";
            let lines = text.lines().filter_map(|line| if is_code { comment(line) } else { Some(line) });
            let is_missing = |name: &&str| {
                let crates = CRATES.map(|sources| sources.trim_end_matches("src").trim_end_matches('/'));
                !crates.iter().any(|place| root().join(place).join(name).exists())
            };
            missing.extend(lines.flat_map(named_files).filter(is_missing).map(|name| format!("{file} names {name}")));
        }
    }
    assert!(missing.is_empty(), "{}", missing.join("\n"));
    assert_eq!(named_files("as in `src/gone.rs`, (shaders/a.wgsl)."), ["src/gone.rs", "shaders/a.wgsl"]);
}

#[test]
fn what_is_unsafe_stands_in_the_page_on_security() {
    let page = read(&root().join("SECURITY.md"));
    let (_, table) = page.split_once("## `unsafe`").expect("a section on it");
    let rows = table.lines().skip_while(|line| !line.starts_with("| `")).take_while(|line| line.starts_with("| `"));
    let places: Vec<&str> = rows.flat_map(|row| row.split('|').nth(1).unwrap().split('`').skip(1).step_by(2)).collect();
    let words = ["unsafe {", "unsafe impl", "unsafe fn", "unsafe extern"];
    let is_unsafe = |line: &str| !line.trim_start().starts_with("//") && words.iter().any(|word| line.contains(word));
    let mut used = BTreeSet::new();
    for folder in CRATES {
        for file in files(&root().join(folder), ".rs") {
            let path = format!("{folder}/{file}");
            if !path.contains("tests") && read(&root().join(&path)).lines().any(is_unsafe) {
                let place = places.iter().find(|place| path.starts_with(**place));
                used.insert(*place.unwrap_or_else(|| panic!("{path} has `unsafe` and is not in SECURITY.md")));
            }
        }
    }
    assert_eq!(used, places.into_iter().collect(), "each place of the table has some");
}
