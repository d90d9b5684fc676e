//! The node hierarchy (glTF 2.0, section 3.5): checked to be a forest, then walked depth first.

use super::accessor::{Accessor, Shape};
use super::document::Document;
use super::file::{File, Problem, item};
use super::lights;
use super::names::{display_name, label};
use crate::import::affine::{Affine, from_columns, from_parts, multiply};
use crate::import::error::{ImportError, one_line};
use crate::import::warnings::Warnings;
use crate::pattern::names;
use bricks::PunctualLight;
use gltf::json::accessor::{ComponentType as Component, Type};
use std::io;
use std::rc::Rc;

/// A node with a mesh, placed in the world.
pub(super) struct Use {
    /// The node.
    pub node: usize,
    /// The mesh, in range.
    pub mesh: usize,
    /// world_from_node.
    pub world: Affine,
    /// The nodes above that were asked for.
    above: Above,
    /// EXT_mesh_gpu_instancing: transformations between node and mesh; `None`: one placement.
    pub instances: Option<Instances>,
}

/// The innermost of the nodes above a node that were asked for.
type Above = Option<Rc<Ancestor>>;

/// A node that was asked for, and those above it.
struct Ancestor {
    name: String,
    above: Above,
    /// How many there are, this one counted.
    depth: u32,
}

/// Most nodes above a mesh of which it keeps the names, the outermost.
const MOST_ABOVE: u32 = 16;

impl Use {
    /// Names of the nodes above that were asked for, the outermost first.
    pub fn names_above(&self) -> Vec<String> {
        let mut names = Vec::new();
        let mut next = &self.above;
        while let Some(ancestor) = next {
            names.push(ancestor.name.clone());
            next = &ancestor.above;
        }
        names.reverse();
        names
    }
}

/// Accessors of instance transformations, all of the same count.
pub(super) struct Instances {
    /// Number of instances.
    pub count: u64,
    translation: Option<Accessor>,
    rotation: Option<Accessor>,
    scale: Option<Accessor>,
}

impl Instances {
    /// node_from_mesh of instances `first` to `end`.
    pub fn matrices(&self, first: u64, end: u64) -> io::Result<Vec<Result<Affine, &'static str>>> {
        let wanted: Vec<u64> = (first..end).collect();
        let get = |accessor: &Option<Accessor>| accessor.as_ref().map(|a| a.gather::<3>(&wanted)).transpose();
        let translations = get(&self.translation)?;
        let rotations = self.rotation.as_ref().map(|a| a.gather::<4>(&wanted)).transpose()?;
        let scales = get(&self.scale)?;
        let at = |values: &Option<Vec<[f64; 3]>>, i: usize| values.as_ref().map(|values| values[i]);
        let matrix = |i| from_parts(at(&translations, i), rotations.as_ref().map(|r| r[i]), at(&scales, i));
        Ok((0..wanted.len()).map(matrix).collect())
    }
}

/// "node 3 \"door\"".
pub(super) fn node_place(document: &Document, node: usize) -> String {
    label("node", node, document.nodes.get(node).and_then(|n| n.name.as_deref()))
}

/// What nodes place.
#[derive(Default)]
pub(super) struct Placed {
    /// Meshes.
    pub uses: Vec<Use>,
    /// Lights.
    pub lights: Vec<PunctualLight>,
}

/// Every use of a mesh and of a light in the scene that is asked for (else the default scene, else scene 0, else all
/// root nodes), depth first; `placing` takes the scene to the world. Uses know which nodes above them `movable` names.
pub(super) fn uses(
    file: &File,
    (asked, movable): (Option<&str>, &[String]),
    placing: &Affine,
    warnings: &mut Warnings,
) -> Result<Placed, ImportError> {
    let document = &file.document;
    let parents = parents(file)?;
    check_acyclic(file, &parents)?;
    let roots = roots(file, asked, &parents)?;

    let Placed { mut uses, mut lights } = Placed::default();
    let mut visited = 0;
    let mut stack: Vec<(usize, Affine, Above)> = roots.iter().rev().map(|&root| (root, *placing, None)).collect();
    while let Some((index, parent, above)) = stack.pop() {
        visited += 1;
        let node = &document.nodes[index];
        let fault = |problem| file.fault(node_place(document, index), problem);
        let local = match &node.matrix {
            Some(matrix) => from_columns(matrix),
            None => from_parts(node.translation, node.rotation, node.scale),
        };
        let world = multiply(&parent, &local.map_err(|what| fault(Problem::new(what)))?);
        if !world.iter().all(|c| c.is_finite()) {
            return Err(fault(Problem::new("its transformation is too large")));
        }
        if let Some(mesh) = node.mesh {
            if node.skin.is_some() {
                warnings.add("skinning ignored; rest pose used", || node_place(document, index));
            }
            let instances = instances(file, index).map_err(fault)?;
            // In range: `parents` checked it.
            uses.push(Use { node: index, mesh: mesh.value(), world, above: above.clone(), instances });
        }
        if let Some(light) = &node.extensions.light {
            lights.extend(lights::place(document, light, &world, warnings, &|| node_place(document, index)));
        }
        let depth = above.as_ref().map_or(0, |ancestor| ancestor.depth);
        let above = match movable.is_empty() || depth == MOST_ABOVE || node.children.is_empty() {
            true => above,
            false => {
                let name = display_name(index, node.name.as_deref());
                let is_asked = movable.iter().any(|pattern| names(pattern, &name));
                if is_asked { Some(Rc::new(Ancestor { name, above, depth: depth + 1 })) } else { above }
            }
        };
        // In range: `parents` checked them.
        stack.extend(node.children.iter().rev().map(|&child| (child.value(), world, above.clone())));
    }
    let left_out = document.nodes.len() - visited;
    if left_out > 0 && document.nodes.iter().any(|node| node.mesh.is_some()) {
        warnings.add(format!("nodes outside the default scene skipped: {left_out}"), String::new);
    }
    if uses.is_empty() && !document.meshes.is_empty() {
        warnings.add("no node of the scene has a mesh", String::new);
    }
    Ok(Placed { uses, lights })
}

/// The parent of every node; also checks every index that nodes hold.
fn parents(file: &File) -> Result<Vec<Option<usize>>, ImportError> {
    let document = &file.document;
    let mut parents: Vec<Option<usize>> = vec![None; document.nodes.len()];
    for (index, node) in document.nodes.iter().enumerate() {
        let fault = |problem| file.fault(node_place(document, index), problem);
        if let Some(mesh) = node.mesh {
            item(&document.meshes, mesh, "mesh").map_err(fault)?;
        }
        for &child in &node.children {
            item(&document.nodes, child, "node").map_err(fault)?;
            let parent = &mut parents[child.value()];
            if let Some(other) = *parent {
                let what = format!("node {child} is its child, but is already a child of node {other}");
                return Err(fault(Problem { what, remedy: "give every node one parent" }));
            }
            *parent = Some(index);
        }
    }
    Ok(parents)
}

/// With one parent each, nodes form trees and cycles. A node from which walking up never ends is in or below a cycle.
fn check_acyclic(file: &File, parents: &[Option<usize>]) -> Result<(), ImportError> {
    // 0: unknown; n > 0: reached first by the walk that began at node n - 1.
    let mut walk = vec![0usize; parents.len()];
    for start in 0..parents.len() {
        let mut node = start;
        while walk[node] == 0 {
            walk[node] = start + 1;
            match parents[node] {
                Some(parent) => node = parent,
                None => break,
            }
        }
        // The walk ended at a node of its own that has a parent: it went round.
        if walk[node] == start + 1 && parents[node].is_some() {
            let what = "is its own ancestor".to_owned();
            let problem = Problem { what, remedy: "make the node hierarchy a tree" };
            return Err(file.fault(node_place(&file.document, node), problem));
        }
    }
    Ok(())
}

/// The nodes at which the walk begins, each once.
fn roots(file: &File, asked: Option<&str>, parents: &[Option<usize>]) -> Result<Vec<usize>, ImportError> {
    let document = &file.document;
    let place = |index: usize| label("scene", index, document.scenes[index].name.as_deref());
    for (index, scene) in document.scenes.iter().enumerate() {
        for &node in &scene.nodes {
            item(&document.nodes, node, "node").map_err(|problem| file.fault(place(index), problem))?;
        }
    }
    let chosen = match (asked, &document.scene) {
        (Some(asked), _) => find_scene(document, asked).map_err(|problem| file.fault("scenes".into(), problem))?,
        (None, Some(scene)) => {
            item(&document.scenes, **scene, "scene").map_err(|problem| file.fault("default scene".into(), problem))?;
            scene.value()
        }
        (None, None) if document.scenes.is_empty() => {
            return Ok((0..parents.len()).filter(|&node| parents[node].is_none()).collect());
        }
        (None, None) => 0,
    };
    let mut listed = vec![false; parents.len()];
    let mut roots = Vec::with_capacity(document.scenes[chosen].nodes.len());
    for &node in &document.scenes[chosen].nodes {
        let node = node.value();
        let problem = match parents[node] {
            Some(parent) => format!("lists node {node}, which is a child of node {parent}"),
            None if listed[node] => format!("lists node {node} twice"),
            None => {
                listed[node] = true;
                roots.push(node);
                continue;
            }
        };
        let problem = Problem { what: problem, remedy: "list every root node once and no other" };
        return Err(file.fault(place(chosen), problem));
    }
    Ok(roots)
}

/// The scene named `asked`, else the one of that number.
fn find_scene(document: &Document, asked: &str) -> Result<usize, Problem> {
    let named = document.scenes.iter().position(|scene| scene.name.as_deref() == Some(asked));
    let numbered = || asked.parse().ok().filter(|&number: &usize| number < document.scenes.len());
    named.or_else(numbered).ok_or_else(|| {
        let scenes = document.scenes.iter().enumerate().take(16);
        let known: Vec<_> = scenes.map(|(i, scene)| label("scene", i, scene.name.as_deref())).collect();
        let known = if known.is_empty() { "none".into() } else { known.join(", ") };
        let what = format!("none is \"{}\"; there are: {known}", one_line(asked));
        Problem { what, remedy: "give --scene the name or the number of one of them" }
    })
}

/// The accessors of EXT_mesh_gpu_instancing, if the node has it.
fn instances(file: &File, node: usize) -> Result<Option<Instances>, Problem> {
    const VECTOR: Shape = Shape { kinds: &[Type::Vec3], components: &[Component::F32], always_normalized: false };
    const ROTATION: Shape = Shape {
        kinds: &[Type::Vec4],
        components: &[Component::F32, Component::I8, Component::I16],
        always_normalized: true,
    };
    let Some(extension) = &file.document.nodes[node].extensions.instancing else { return Ok(None) };
    let get = |name: &str, shape: &Shape| {
        extension.attributes.get(name).map(|&index| Accessor::resolve(file, index, shape)).transpose()
    };
    let translation = get("TRANSLATION", &VECTOR)?;
    let rotation = get("ROTATION", &ROTATION)?;
    let scale = get("SCALE", &VECTOR)?;
    let counts = [&translation, &rotation, &scale].map(|accessor| accessor.as_ref().map(|a| a.count));
    let Some(count) = counts.into_iter().flatten().next() else { return Ok(None) };
    if counts.into_iter().flatten().any(|other| other != count) {
        return Err(Problem::new("its instance attributes differ in count"));
    }
    Ok(Some(Instances { count, translation, rotation, scale }))
}
