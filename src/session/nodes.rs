//! The nodes of a scene, by name.

use bricks::pattern::names;
use bricks::{Manifest, Provenance};
use std::ops::Range;

/// A node that has triangles.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneNode<'a> {
    /// Its name, or its index.
    pub name: &'a str,
    /// Name or index of its mesh.
    pub mesh: &'a str,
    /// Names of nodes above that can be moved, the outermost first.
    pub under: &'a [String],
    /// The global ids of its triangles.
    pub ids: Range<u32>,
}

impl SceneNode<'_> {
    /// Whether a pattern names it: its name, that of a node above it, or `#` and the global id of one of its triangles.
    pub fn is_named(&self, pattern: &str) -> bool {
        let id = pattern.strip_prefix('#').and_then(|id| id.parse().ok());
        id.is_some_and(|id| self.ids.contains(&id))
            || names(pattern, self.name)
            || self.under.iter().any(|name| names(pattern, name))
    }

    /// Whether its name or its mesh's has `text` in it, which is in small letters, or is named by it.
    fn is_found_by(&self, text: &str) -> bool {
        let has = |name: &str| name.to_lowercase().contains(text);
        has(self.name) || has(self.mesh) || self.is_named(text)
    }
}

/// The nodes that have triangles, in the order of these. Neighbours may have the same name.
pub fn nodes(manifest: &Manifest) -> impl Iterator<Item = SceneNode<'_>> {
    // A node has a mesh, and that its primitives in their order.
    let is_same = |a: &Provenance, b: &Provenance| {
        a.primitive < b.primitive && (a.source, &a.node, &a.mesh) == (b.source, &b.node, &b.mesh)
    };
    manifest.provenance.chunk_by(is_same).map(|ranges| {
        let (first, last) = (&ranges[0], &ranges[ranges.len() - 1]);
        let ids = first.first_id..last.first_id + last.count;
        SceneNode { name: &first.node, mesh: &first.mesh, under: &first.under, ids }
    })
}

/// A node, to be shown in lists.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Named {
    /// Its name, or its index.
    pub name: String,
    /// Name or index of its mesh.
    pub mesh: String,
    /// The global ids of its triangles.
    pub ids: Range<u32>,
    /// What names it, and no other, in [`crate::Settings::hide`].
    pub pattern: String,
}

impl Named {
    fn new(node: &SceneNode, manifest: &Manifest) -> Self {
        let is_plain = |c: char| !c.is_whitespace() && !",#*?".contains(c);
        let is_name = !node.name.is_empty() && node.name.chars().all(is_plain);
        let is_alone = is_name && nodes(manifest).filter(|other| other.is_named(node.name)).nth(1).is_none();
        let pattern = if is_alone { node.name.to_owned() } else { format!("#{}", node.ids.start) };
        Self { name: node.name.into(), mesh: node.mesh.into(), ids: node.ids.clone(), pattern }
    }

    /// The node that a triangle is of.
    pub fn of(manifest: &Manifest, id: u32) -> Option<Self> {
        nodes(manifest).find(|node| node.ids.contains(&id)).map(|node| Self::new(&node, manifest))
    }
}

/// The first nodes, at most so many, whose names or meshes' names have `text` in them, capitals or not, or that are
/// named as in [`crate::Settings::hide`]; and how many there are in all.
pub fn find(manifest: &Manifest, text: &str, most: usize) -> (Vec<Named>, usize) {
    let text = text.trim().to_lowercase();
    let found: Vec<SceneNode> = nodes(manifest).filter(|node| node.is_found_by(&text)).collect();
    (found.iter().take(most).map(|node| Named::new(node, manifest)).collect(), found.len())
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Nodes a, b, b and c, of 10 triangles each; c has two primitives, and a stands below an engine.
    pub fn manifest() -> Manifest {
        let range = |(first_id, count, node, primitive): (u32, u32, &str, u32)| Provenance {
            first_id,
            count,
            node: node.into(),
            mesh: format!("Mesh {node}"),
            primitive,
            under: if node == "a" { vec!["engine".into()] } else { Vec::new() },
            ..Provenance::default()
        };
        let ranges = [(0, 10, "a", 0), (10, 10, "b", 0), (20, 10, "b", 0), (30, 4, "c", 0), (34, 6, "c", 1)];
        Manifest { triangle_ids: 40, provenance: ranges.map(range).into(), ..Manifest::default() }
    }

    #[test]
    fn nodes_are_found_by_parts_of_their_names() {
        let manifest = manifest();
        let found = |text: &str| {
            let (nodes, count) = find(&manifest, text, 3);
            assert!(nodes.len() == count.min(3));
            nodes.into_iter().map(|node| node.pattern).collect::<Vec<_>>()
        };
        // What is not named by its name alone is named by an id.
        assert_eq!(found("B"), ["#10", "#20"]);
        assert_eq!(found("c"), ["c"]);
        assert_eq!(found("mesh"), ["a", "#10", "#20"]);
        assert_eq!(found("engine"), ["a"]);
        assert_eq!(found("#25"), ["#20"]);
        assert_eq!(found("d"), Vec::<String>::new());
        for (id, ids) in [(0, 0..10), (19, 10..20), (39, 30..40)] {
            assert_eq!(Named::of(&manifest, id).unwrap().ids, ids);
        }
        assert_eq!(Named::of(&manifest, 40), None);
    }
}
