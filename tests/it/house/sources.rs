//! Reads the sources of a crate: which file uses what of which other.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use syn::visit::Visit;

/// Arrows between files: who uses, whom.
pub type Arrows = BTreeMap<String, BTreeSet<String>>;

/// The files below a folder whose names end like this, sorted, by their paths from there; build outputs left out.
pub fn files(root: &Path, ending: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut open = vec![PathBuf::new()];
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(root.join(&folder)).expect("a folder").map(|entry| entry.expect("an entry")) {
            let name = entry.file_name().into_string().expect("a name in UTF-8");
            let path = folder.join(&name);
            if entry.file_type().expect("a type").is_dir() {
                if name != "target" && !name.starts_with('.') {
                    open.push(path);
                }
            } else if name.ends_with(ending) {
                found.push(path.to_str().expect("a path in UTF-8").replace('\\', "/"));
            }
        }
    }
    found.sort();
    found
}

/// The module that a file is, from the root of its crate.
fn module(file: &str) -> Vec<String> {
    let mut names: Vec<String> = file.trim_end_matches(".rs").split('/').map(str::to_owned).collect();
    if matches!(names.last().map(String::as_str), Some("mod" | "lib")) {
        names.pop();
    }
    names
}

/// What a file names: whole paths, and whether they are handed on by `pub use`.
#[derive(Default)]
struct Named {
    paths: Vec<(Vec<String>, bool)>,
}

fn is_for_tests(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| match &attribute.meta {
        syn::Meta::List(list) => list.path.is_ident("cfg") && list.tokens.to_string() == "test",
        _ => false,
    })
}

fn flatten(tree: &syn::UseTree, before: &[String], is_public: bool, paths: &mut Vec<(Vec<String>, bool)>) {
    let with = |name: &syn::Ident| [before, &[name.to_string()]].concat();
    match tree {
        syn::UseTree::Path(path) => flatten(&path.tree, &with(&path.ident), is_public, paths),
        syn::UseTree::Name(name) if name.ident == "self" => paths.push((before.to_vec(), is_public)),
        syn::UseTree::Name(name) => paths.push((with(&name.ident), is_public)),
        syn::UseTree::Rename(name) => paths.push((with(&name.ident), is_public)),
        syn::UseTree::Glob(_) => paths.push((before.to_vec(), is_public)),
        syn::UseTree::Group(group) => group.items.iter().for_each(|tree| flatten(tree, before, is_public, paths)),
    }
}

impl<'a> Visit<'a> for Named {
    fn visit_item(&mut self, item: &'a syn::Item) {
        let attributes = match item {
            syn::Item::Mod(module) => &module.attrs,
            syn::Item::Use(of) => &of.attrs,
            syn::Item::Fn(function) => &function.attrs,
            _ => &Vec::new(),
        };
        if !is_for_tests(attributes) {
            syn::visit::visit_item(self, item);
        }
    }

    fn visit_item_use(&mut self, item: &'a syn::ItemUse) {
        flatten(&item.tree, &[], !matches!(item.vis, syn::Visibility::Inherited), &mut self.paths);
    }

    /// `pub(super)` uses nothing.
    fn visit_vis_restricted(&mut self, _: &'a syn::VisRestricted) {}

    fn visit_path(&mut self, path: &'a syn::Path) {
        let names: Vec<String> = path.segments.iter().map(|segment| segment.ident.to_string()).collect();
        if matches!(names[0].as_str(), "crate" | "super") {
            self.paths.push((names, false));
        }
        syn::visit::visit_path(self, path);
    }
}

/// The arrows between the files of a crate, tests left out. `sources`: each file's path below the crate's root, and its
/// text. What a module only hands on (`pub use`) is no arrow; whoever takes it has one to where it is.
pub fn arrows(sources: &BTreeMap<String, String>) -> Arrows {
    let files: BTreeMap<Vec<String>, &str> = sources.keys().map(|file| (module(file), file.as_str())).collect();
    let mut named = Vec::new();
    let mut handed_on: BTreeMap<Vec<String>, Vec<String>> = BTreeMap::new();
    for (file, text) in sources {
        let own = module(file);
        let mut found = Named::default();
        found.visit_file(&syn::parse_file(text).unwrap_or_else(|error| panic!("{file}: {error}")));
        for (path, is_public) in found.paths {
            let Some(whole) = whole(&own, &path, &files) else { continue };
            let is_face = is_public && whole.starts_with(&own);
            if let (true, Some(name)) = (is_public, whole.last()) {
                handed_on.insert([&own[..], std::slice::from_ref(name)].concat(), whole.clone());
            }
            if !is_face {
                named.push((file, whole));
            }
        }
    }
    let mut arrows = Arrows::new();
    for (file, whole) in named {
        let target = file_of(whole, &files, &handed_on);
        if let Some(target) = target.filter(|target| target != file && *target != "lib.rs") {
            arrows.entry(file.clone()).or_default().insert(target.to_owned());
        }
    }
    arrows
}

/// A path from the root of the crate; `None` if it leads out of it.
fn whole(own: &[String], path: &[String], files: &BTreeMap<Vec<String>, &str>) -> Option<Vec<String>> {
    let up = path.iter().take_while(|name| *name == "super").count();
    match path[0].as_str() {
        "crate" => Some(path[1..].to_vec()),
        "self" => Some([own, &path[1..]].concat()),
        _ if up > 0 => Some([&own[..own.len().checked_sub(up)?], &path[up..]].concat()),
        first => {
            let child = [own, &[first.to_owned()]].concat();
            files.contains_key(&child).then(|| [own, path].concat())
        }
    }
}

/// The file in which what a path names is defined.
fn file_of<'a>(
    mut whole: Vec<String>,
    files: &BTreeMap<Vec<String>, &'a str>,
    handed_on: &BTreeMap<Vec<String>, Vec<String>>,
) -> Option<&'a str> {
    for _ in 0..8 {
        let depth = (0..=whole.len()).rev().find(|&depth| files.contains_key(&whole[..depth]))?;
        match whole.get(..=depth).and_then(|name| handed_on.get(name)) {
            Some(there) if *there != whole => whole = [there, &whole[depth + 1..]].concat(),
            _ => return files.get(&whole[..depth]).copied(),
        }
    }
    None
}

/// Sets of files each of which reaches every other.
pub fn circles(arrows: &Arrows) -> Vec<BTreeSet<String>> {
    let reached = |from: &str| {
        let mut seen = BTreeSet::new();
        let mut open = vec![from.to_owned()];
        while let Some(file) = open.pop() {
            for next in arrows.get(&file).into_iter().flatten() {
                if seen.insert(next.clone()) {
                    open.push(next.clone());
                }
            }
        }
        seen
    };
    let all: BTreeMap<&String, BTreeSet<String>> = arrows.keys().map(|file| (file, reached(file))).collect();
    let mut circles = BTreeSet::new();
    for (file, own) in &all {
        if own.contains(*file) {
            circles.insert(
                own.iter().filter(|other| all.get(other).is_some_and(|all| all.contains(*file))).cloned().collect(),
            );
        }
    }
    circles.into_iter().collect()
}
