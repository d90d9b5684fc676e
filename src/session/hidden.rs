//! Nodes that are left out.

use super::nodes::{SceneNode, nodes};
use crate::session::Settings;
use anyhow::{Result, bail};
use bricks::Manifest;

/// Names that an error lists.
const MOST_NAMES: usize = 12;

/// The global ids, ascending, at which hiding begins and ends in turns; none where nothing is hidden.
///
/// # Errors
/// A pattern that names nothing, with what there is.
pub fn bounds(settings: &Settings, manifest: &Manifest) -> Result<Vec<u32>> {
    let Settings { hide, only, .. } = settings;
    if !settings.hides() {
        return Ok(Vec::new());
    }
    let all: Vec<SceneNode> = nodes(manifest).collect();
    for (option, patterns) in [("hide", hide), ("only", only)] {
        let is_met = |pattern: &&String| all.iter().any(|node| node.is_named(pattern));
        if let Some(pattern) = patterns.iter().find(|pattern| !is_met(pattern)) {
            bail!("--{option} {pattern}: no node has this name; there are {}", list(&all));
        }
    }
    let is_any = |patterns: &[String], node: &SceneNode| patterns.iter().any(|pattern| node.is_named(pattern));
    let mut bounds = Vec::new();
    for node in &all {
        let is_hidden = is_any(hide, node) || (!only.is_empty() && !is_any(only, node));
        // Hiding has begun where it is odd.
        if is_hidden != (bounds.len() % 2 == 1) {
            bounds.push(node.ids.start);
        }
    }
    Ok(bounds)
}

/// The first names of nodes, each once.
fn list(all: &[SceneNode]) -> String {
    let mut known: Vec<&str> = Vec::new();
    for node in all {
        if !known.contains(&node.name) {
            known.push(node.name);
        }
        if known.len() > MOST_NAMES {
            known[MOST_NAMES] = "…";
            break;
        }
    }
    known.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::nodes::tests::manifest;

    #[test]
    fn bounds_are_where_hiding_begins_and_ends() {
        let of = |options: &str| bounds(&Settings::from_options(options).unwrap(), &manifest());
        for (options, expected) in [
            ("", &[][..]),
            ("--hide a", &[0, 10]),
            ("--hide engine", &[0, 10]),
            ("--hide b", &[10, 30]),
            ("--hide #15", &[10, 20]),
            ("--hide c", &[30]),
            ("--hide a,c", &[0, 10, 30]),
            ("--hide *", &[0]),
            ("--only b", &[0, 10, 30]),
            ("--only #39", &[0, 30]),
            ("--only b,c --hide #12", &[0, 20]),
        ] {
            assert_eq!(of(options).unwrap(), expected, "{options}");
        }
        for options in ["--hide d", "--only #40", "--hide a,?x"] {
            let text = format!("{:#}", of(options).unwrap_err());
            assert!(text.contains("no node has this name; there are a, b, c"), "{text}");
        }
    }
}
