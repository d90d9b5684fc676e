//! Decides what becomes an object of its own and what is baked into the world, and numbers the triangles.

use super::matrix::Affine;
use crate::build::error::BuildError;
use crate::build::settings::BuildSettings;
use crate::pattern::names;
use crate::source::{IDENTITY, MeshOutline, Outline, Placement, Primitive};
use bricks::{MATERIAL_FURTHER, MATERIAL_MORE, Provenance};

/// Ratio of scales above which a matrix is not inverted: error bounds of rays in the object's space grow with it.
const LARGEST_SCALE_RATIO: f64 = (1u64 << 20) as f64;

/// Most names of nodes that a message lists.
const MOST_NAMES: usize = 16;

/// How a part is brought into its object.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Baking {
    /// Object from mesh.
    pub matrix: Affine,
    /// What maps normals.
    pub normals: [f64; 9],
}

/// A part of a mesh within an object. Its triangles have consecutive slots (numbers within the object's input) and ids.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part {
    /// Index of the mesh.
    pub mesh: u32,
    /// Index of the part in the mesh.
    pub part: u32,
    /// How it is brought into the object; `None`: as it is.
    pub baking: Option<Baking>,
    /// Slot of its first triangle.
    pub first_slot: u32,
    /// Id of its first triangle: mesh-local, in the world object global.
    pub first_id: u32,
    /// Number of triangles.
    pub triangles: u32,
}

/// A part with its geometry.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed<'a> {
    /// The part.
    pub part: &'a Part,
    /// Its geometry.
    pub primitive: &'a Primitive,
}

impl Placed<'_> {
    /// A position in object space.
    pub fn position(&self, vertex: u32) -> [f64; 3] {
        let position = self.primitive.positions[vertex as usize];
        self.part.baking.map_or(position, |baking| baking.matrix.point(position))
    }

    /// The vertices of a triangle of the part, in source order.
    pub fn vertices(&self, triangle: u32) -> [u32; 3] {
        let at = triangle as usize * 3;
        [self.primitive.indices[at], self.primitive.indices[at + 1], self.primitive.indices[at + 2]]
    }
}

/// Some triangles of a part.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Piece<'a> {
    /// The part.
    pub part: &'a Part,
    /// Its first triangle.
    pub first: u32,
    /// After its last triangle.
    pub end: u32,
}

/// An object to be built.
#[derive(Debug)]
pub(crate) struct ObjectPlan {
    /// "the scene" or the mesh, for messages.
    pub name: String,
    /// Its parts, by first slot.
    pub parts: Vec<Part>,
    /// Number of slots.
    pub slots: u32,
    /// Ids of one instance.
    pub triangle_ids: u32,
}

impl ObjectPlan {
    /// The part that a slot belongs to.
    pub fn part_of(&self, slot: u32) -> usize {
        self.parts.partition_point(|part| part.first_slot <= slot) - 1
    }

    /// All its triangles, in runs of at most `triangles`, in order of slots.
    pub fn runs(&self, triangles: u32) -> Vec<Vec<Piece<'_>>> {
        let mut runs = Vec::new();
        let (mut run, mut length) = (Vec::new(), 0);
        for part in &self.parts {
            for first in (0..part.triangles).step_by(triangles as usize) {
                let end = part.triangles.min(first.saturating_add(triangles));
                if length + (end - first) > triangles {
                    runs.push(std::mem::take(&mut run));
                    length = 0;
                }
                run.push(Piece { part, first, end });
                length += end - first;
            }
        }
        if !run.is_empty() {
            runs.push(run);
        }
        runs
    }

    fn push(&mut self, mesh: u32, outline: &MeshOutline, baking: Option<Baking>, mut first_id: u32) {
        for (part, &crate::source::PartOutline { triangles, .. }) in (0u32..).zip(&outline.parts) {
            if triangles > 0 {
                let first_slot = self.slots;
                self.parts.push(Part { mesh, part, baking, first_slot, first_id, triangles });
                // The sum over all placements was checked to fit.
                self.slots += triangles;
                first_id += triangles;
            }
        }
    }
}

/// An instance of an object other than the world.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InstancePlan<'a> {
    /// The object.
    pub object: u32,
    /// Global id of its triangle 0.
    pub base: u32,
    /// World from object.
    pub matrix: Affine,
    /// The placement, for messages.
    pub placement: &'a Placement,
}

/// What is to be built.
#[derive(Debug)]
pub(crate) struct Plan<'a> {
    /// The world, then meshes in their order in the source.
    pub objects: Vec<ObjectPlan>,
    /// In order of placements, without the world.
    pub instances: Vec<InstancePlan<'a>>,
    /// Triangles with every placement multiplied out.
    pub triangle_ids: u64,
    /// Where ids come from.
    pub provenance: Vec<Provenance>,
}

impl Plan<'_> {
    /// The instances that none of these names makes movable: their numbers, objects and matrices.
    pub fn resting(&self, movable: &[String]) -> Vec<(u32, u32, Affine)> {
        let is_movable = |placement: &Placement| movable.iter().any(|pattern| is_named(pattern, placement));
        let resting = (1u32..).zip(&self.instances).filter(|(_, instance)| !is_movable(instance.placement));
        resting.map(|(number, instance)| (number, instance.object, instance.matrix)).collect()
    }
}

/// Whether a pattern names a placement or a node above it.
fn is_named(pattern: &str, placement: &Placement) -> bool {
    names(pattern, &placement.name) || placement.under.iter().any(|name| names(pattern, name))
}

/// Plans objects and instances; `scene` must have passed [`check`].
pub(crate) fn plan<'a>(scene: &'a Outline, settings: &BuildSettings) -> Result<Plan<'a>, BuildError> {
    let counts: Vec<u64> = scene.meshes.iter().map(MeshOutline::triangle_count).collect();
    let mut bases = Vec::with_capacity(scene.placements.len());
    let mut triangle_ids = 0u64;
    for placement in &scene.placements {
        bases.push(triangle_ids);
        triangle_ids = triangle_ids.saturating_add(counts[placement.mesh as usize]);
    }
    if triangle_ids > bricks::MAX_TRIANGLE_IDS {
        return Err(BuildError::TooManyTriangles { found: triangle_ids });
    }

    let invertible: Vec<bool> = scene.placements.iter().map(is_invertible).collect();
    let movable = movable(scene, &invertible, settings)?;
    let instanced = choose_instanced(scene, &counts, &invertible, &movable, settings);
    let mut objects = vec![ObjectPlan {
        name: "the scene".to_owned(),
        parts: Vec::new(),
        slots: 0,
        triangle_ids: triangle_ids as u32,
    }];
    let mut object_of_mesh = vec![0u32; scene.meshes.len()];
    for (index, mesh) in scene.meshes.iter().enumerate().filter(|(index, _)| instanced[*index]) {
        object_of_mesh[index] = objects.len() as u32;
        let name = format!("mesh \"{}\"", mesh.name);
        let mut object = ObjectPlan { name, parts: Vec::new(), slots: 0, triangle_ids: counts[index] as u32 };
        object.push(index as u32, mesh, None, 0);
        objects.push(object);
    }

    let mut instances = Vec::new();
    let mut provenance = Vec::new();
    for ((placement, &base), &invertible) in scene.placements.iter().zip(&bases).zip(&invertible) {
        let mesh = &scene.meshes[placement.mesh as usize];
        if counts[placement.mesh as usize] == 0 {
            continue;
        }
        let base = base as u32;
        trace_ids(&mut provenance, placement, mesh, base);
        let matrix = Affine(placement.world_from_mesh);
        let object = object_of_mesh[placement.mesh as usize];
        if object != 0 && invertible {
            instances.push(InstancePlan { object, base, matrix, placement });
            continue;
        }
        let baking =
            (placement.world_from_mesh != IDENTITY).then(|| Baking { matrix, normals: matrix.normal_matrix() });
        objects[0].push(placement.mesh, mesh, baking, base);
    }
    Ok(Plan { objects, instances, triangle_ids, provenance })
}

/// Whether rays can be taken into the space of the placed mesh.
fn is_invertible(placement: &Placement) -> bool {
    let matrix = Affine(placement.world_from_mesh);
    let determinant = matrix.determinant();
    matrix.is_finite() && determinant.is_normal() && matrix.scale_ratio() <= LARGEST_SCALE_RATIO
}

/// Which meshes are to be movable.
///
/// # Errors
/// A name that nothing has; a placement that rays cannot be taken through.
fn movable(scene: &Outline, invertible: &[bool], settings: &BuildSettings) -> Result<Vec<bool>, BuildError> {
    let mut movable = vec![false; scene.meshes.len()];
    let mut is_met = vec![false; settings.movable.len()];
    if settings.movable.is_empty() {
        return Ok(movable);
    }
    for (placement, invertible) in scene.placements.iter().zip(invertible) {
        for (pattern, is_met) in settings.movable.iter().zip(&mut is_met) {
            if is_named(pattern, placement) {
                if !invertible {
                    return Err(BuildError::NotMovable { node: placement.name.clone() });
                }
                *is_met = true;
                movable[placement.mesh as usize] = true;
            }
        }
    }
    let Some(missing) = is_met.iter().position(|is_met| !is_met) else { return Ok(movable) };
    let mut known: Vec<&str> = scene.placements.iter().take(MOST_NAMES + 1).map(|one| one.name.as_str()).collect();
    if known.len() > MOST_NAMES {
        known[MOST_NAMES] = "…";
    }
    Err(BuildError::NothingMovable { pattern: settings.movable[missing].clone(), known: known.join(", ") })
}

/// Which meshes are stored once and placed by instances: those that are movable, those with enough triangles that are
/// placed twice or more, and smaller ones once the budget for copies of them is spent.
fn choose_instanced(
    scene: &Outline,
    counts: &[u64],
    invertible: &[bool],
    movable: &[bool],
    settings: &BuildSettings,
) -> Vec<bool> {
    let mut uses = vec![0u64; scene.meshes.len()];
    // A mirror turns triangles over. What depends on their front is told so by an instance.
    let mut is_lamp_turned = vec![false; scene.meshes.len()];
    for (placement, _) in scene.placements.iter().zip(invertible).filter(|(_, invertible)| **invertible) {
        let mesh = placement.mesh as usize;
        uses[mesh] += 1;
        is_lamp_turned[mesh] |=
            scene.meshes[mesh].shines_to_front && Affine(placement.world_from_mesh).determinant() < 0.0;
    }
    let mut budget = settings.bake_budget_triangles;
    uses.iter()
        .zip(counts)
        .zip(movable.iter().zip(&is_lamp_turned))
        .map(|((&uses, &count), (&is_movable, &is_lamp_turned))| {
            if (is_movable || is_lamp_turned) && count > 0 {
                return true;
            }
            if uses < 2 || count == 0 {
                return false;
            }
            if count >= u64::from(settings.instance_min_triangles) {
                return true;
            }
            // Saturation is beyond any budget.
            let copies = uses.saturating_mul(count);
            let left = budget.checked_sub(copies);
            budget = left.unwrap_or(budget);
            left.is_none()
        })
        .collect()
}

fn trace_ids(provenance: &mut Vec<Provenance>, placement: &Placement, mesh: &MeshOutline, mut first_id: u32) {
    for parts in mesh.parts.chunk_by(|a, b| a.primitive == b.primitive) {
        let count = parts.iter().map(|part| part.triangles).sum();
        if count > 0 {
            let (node, under) = (placement.name.clone(), placement.under.clone());
            let (mesh, primitive) = (mesh.name.clone(), parts[0].primitive);
            provenance.push(Provenance { first_id, count, source: placement.source, node, mesh, primitive, under });
            first_id += count;
        }
    }
}

/// An error unless `ok`.
pub(crate) fn rule(ok: bool, what: String, found: usize, expected: String) -> Result<(), BuildError> {
    if ok { Ok(()) } else { Err(BuildError::Inconsistent { what, found: found.to_string(), expected }) }
}

/// What [`check`] wants.
const FURTHER: &str = "further textures behind each material that says so, and nowhere else";

/// Checks that everything that is referred to exists.
pub(crate) fn check(scene: &Outline) -> Result<(), BuildError> {
    for placement in &scene.placements {
        let (mesh, meshes) = (placement.mesh as usize, scene.meshes.len());
        rule(mesh < meshes, format!("node \"{}\": mesh", placement.name), mesh, format!("less than {meshes}"))?;
        let (source, sources) = (placement.source as usize, scene.sources.len());
        rule(source < sources, format!("node \"{}\": source", placement.name), source, format!("less than {sources}"))?;
    }
    let mut has_more = false;
    for (index, material) in scene.materials.iter().enumerate() {
        let textures = scene.textures.len();
        let is_further = material.flags & MATERIAL_FURTHER != 0;
        let flags = material.flags as usize;
        rule(is_further == has_more, format!("material {index}: flags"), flags, FURTHER.to_owned())?;
        has_more = material.flags & MATERIAL_MORE != 0;
        for texture in material.textures() {
            let known = texture == bricks::NONE || (texture as usize) < textures;
            rule(known, format!("material {index}: texture"), texture as usize, format!("less than {textures}"))?;
        }
    }
    let count = scene.materials.len();
    rule(!has_more, "materials".into(), count, FURTHER.to_owned())
}
