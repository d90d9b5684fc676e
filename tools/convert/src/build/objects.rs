//! Decides what becomes an object of its own and what is baked into the world, and numbers the triangles.

use super::error::BuildError;
use super::matrix::Affine;
use super::settings::BuildSettings;
use crate::source::{IDENTITY, Mesh, Placement, Primitive, SourceScene};
use bricks::Provenance;

/// Ratio of scales above which a matrix is not inverted: error bounds of rays in the object's space grow with it.
const LARGEST_SCALE_RATIO: f64 = (1u64 << 20) as f64;

/// How a part is brought into its object.
#[derive(Clone, Copy, Debug)]
pub(super) struct Baking {
    /// Object from mesh.
    pub matrix: Affine,
    /// What maps normals.
    pub normals: [f64; 9],
    /// Whether the winding of the geometry is reversed by the matrix.
    pub mirrored: bool,
}

/// A primitive within an object. Its triangles have consecutive slots (numbers within the object's input) and ids.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part<'a> {
    /// The mesh, for messages.
    pub mesh: &'a Mesh,
    /// Index of the primitive in the mesh.
    pub primitive_index: u32,
    /// The primitive.
    pub primitive: &'a Primitive,
    /// How it is brought into the object; `None`: as it is.
    pub baking: Option<Baking>,
    /// Slot of its first triangle.
    pub first_slot: u32,
    /// Id of its first triangle: mesh-local, in the world object global.
    pub first_id: u32,
    /// Number of triangles.
    pub triangles: u32,
}

impl Part<'_> {
    /// A position in object space.
    pub fn position(&self, vertex: u32) -> [f64; 3] {
        let position = self.primitive.positions[vertex as usize];
        self.baking.map_or(position, |baking| baking.matrix.point(position))
    }

    /// The vertices of a triangle of the part, in source order.
    pub fn vertices(&self, triangle: u32) -> [u32; 3] {
        let at = triangle as usize * 3;
        [self.primitive.indices[at], self.primitive.indices[at + 1], self.primitive.indices[at + 2]]
    }
}

/// An object to be built.
#[derive(Debug)]
pub(super) struct ObjectPlan<'a> {
    /// "the scene" or the mesh, for messages.
    pub name: String,
    /// Its primitives, by first slot.
    pub parts: Vec<Part<'a>>,
    /// Number of slots.
    pub slots: u32,
    /// Ids of one instance.
    pub triangle_ids: u32,
}

impl<'a> ObjectPlan<'a> {
    /// The part that a slot belongs to.
    pub fn part_of(&self, slot: u32) -> usize {
        self.parts.partition_point(|part| part.first_slot <= slot) - 1
    }

    fn push(&mut self, mesh: &'a Mesh, baking: Option<Baking>, mut first_id: u32) {
        for (primitive_index, primitive) in (0u32..).zip(&mesh.primitives) {
            // The sum over all placements was checked to fit.
            let triangles = (primitive.indices.len() / 3) as u32;
            if triangles > 0 {
                let first_slot = self.slots;
                self.parts.push(Part { mesh, primitive_index, primitive, baking, first_slot, first_id, triangles });
                self.slots += triangles;
                first_id += triangles;
            }
        }
    }
}

/// An instance of an object other than the world.
#[derive(Clone, Copy, Debug)]
pub(super) struct InstancePlan<'a> {
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
pub(super) struct Plan<'a> {
    /// The world, then meshes in their order in the source.
    pub objects: Vec<ObjectPlan<'a>>,
    /// In order of placements, without the world.
    pub instances: Vec<InstancePlan<'a>>,
    /// Triangles with every placement multiplied out.
    pub triangle_ids: u64,
    /// Where ids come from.
    pub provenance: Vec<Provenance>,
}

/// Plans objects and instances; `scene` must have passed [`check`].
pub(super) fn plan<'a>(scene: &'a SourceScene, settings: &BuildSettings) -> Result<Plan<'a>, BuildError> {
    let counts: Vec<u64> = scene.meshes.iter().map(Mesh::triangle_count).collect();
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
    let instanced = choose_instanced(scene, &counts, &invertible, settings);
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
        object.push(mesh, None, 0);
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
        let baking = (placement.world_from_mesh != IDENTITY).then(|| Baking {
            matrix,
            normals: matrix.normal_matrix(),
            mirrored: matrix.determinant() < 0.0,
        });
        objects[0].push(mesh, baking, base);
    }
    Ok(Plan { objects, instances, triangle_ids, provenance })
}

/// Whether rays can be taken into the space of the placed mesh.
fn is_invertible(placement: &Placement) -> bool {
    let matrix = Affine(placement.world_from_mesh);
    let determinant = matrix.determinant();
    matrix.is_finite() && determinant.is_normal() && matrix.scale_ratio() <= LARGEST_SCALE_RATIO
}

/// Which meshes are stored once and placed by instances: those with enough triangles that are placed twice or more, and
/// smaller ones once the budget for copies of them is spent.
fn choose_instanced(scene: &SourceScene, counts: &[u64], invertible: &[bool], settings: &BuildSettings) -> Vec<bool> {
    let mut uses = vec![0u64; scene.meshes.len()];
    for (placement, invertible) in scene.placements.iter().zip(invertible) {
        uses[placement.mesh as usize] += u64::from(*invertible);
    }
    let mut budget = settings.bake_budget_triangles;
    uses.iter()
        .zip(counts)
        .map(|(&uses, &count)| {
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

fn trace_ids(provenance: &mut Vec<Provenance>, placement: &Placement, mesh: &Mesh, mut first_id: u32) {
    for (primitive, source) in (0u32..).zip(&mesh.primitives) {
        let count = (source.indices.len() / 3) as u32;
        if count > 0 {
            let (node, mesh) = (placement.name.clone(), mesh.name.clone());
            provenance.push(Provenance { first_id, count, source: placement.source, node, mesh, primitive });
            first_id += count;
        }
    }
}

/// Checks that everything that is referred to exists.
pub(super) fn check(scene: &SourceScene) -> Result<(), BuildError> {
    let rule = |ok: bool, what: String, found: usize, expected: String| {
        if ok { Ok(()) } else { Err(BuildError::Inconsistent { what, found: found.to_string(), expected }) }
    };
    for mesh in &scene.meshes {
        for (index, primitive) in mesh.primitives.iter().enumerate() {
            let what = |of: &str| format!("mesh \"{}\", primitive {index}: {of}", mesh.name);
            let vertices = primitive.positions.len();
            let lengths = [
                ("normals", primitive.normals.as_ref().map(Vec::len)),
                ("texture coordinates", primitive.uvs.as_ref().map(Vec::len)),
                ("colours", primitive.colors.as_ref().map(Vec::len)),
            ];
            for (of, length) in lengths {
                let length = length.unwrap_or(vertices);
                rule(length == vertices, what(of), length, format!("{vertices}, one a vertex"))?;
            }
            let indices = primitive.indices.len();
            rule(indices % 3 == 0, what("indices"), indices, "three a triangle".to_owned())?;
            let largest = primitive.indices.iter().max().map_or(0, |&index| index as usize);
            rule(indices == 0 || largest < vertices, what("index"), largest, format!("less than {vertices}"))?;
            let (material, materials) = (primitive.material as usize, scene.materials.len());
            rule(indices == 0 || material < materials, what("material"), material, format!("less than {materials}"))?;
        }
    }
    for placement in &scene.placements {
        let (mesh, meshes) = (placement.mesh as usize, scene.meshes.len());
        rule(mesh < meshes, format!("node \"{}\": mesh", placement.name), mesh, format!("less than {meshes}"))?;
        let (source, sources) = (placement.source as usize, scene.sources.len());
        rule(source < sources, format!("node \"{}\": source", placement.name), source, format!("less than {sources}"))?;
    }
    for (index, material) in scene.materials.iter().enumerate() {
        let (texture, textures) = (material.base_color_texture, scene.textures.len());
        let known = texture == bricks::NONE || (texture as usize) < textures;
        rule(known, format!("material {index}: texture"), texture as usize, format!("less than {textures}"))?;
    }
    Ok(())
}
