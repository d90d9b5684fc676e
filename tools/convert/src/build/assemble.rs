//! The resident part: what the bricks, objects and instances add up to.

use super::cut::cuts::ObjectCut;
use super::error::BuildError;
use super::input::matrix::Affine;
use super::input::objects::Plan;
use super::levels;
use super::settings::{BuildSettings, BuildSummary};
use super::tree::binary::Box3;
use super::tree::top_level::{self, TopLevel, world_box};
use super::triangles::lattice::{Lattice, pow2};
use crate::source::Outline;
use bricks::{
    BRICK_WIDE, Brick, INSTANCE_IDENTITY, INSTANCE_MIRRORED, Instance, Leaf, Level, MATERIAL_BLEND, MATERIAL_FURTHER,
    MATERIAL_MASK, Manifest, Material, NONE, Node, Object, Resident,
};
use rayon::prelude::*;
use std::time::Duration;

/// The records of the objects; `bricks` are in their order.
pub(super) fn object_records(plan: &Plan, lattices: &[Lattice], bricks: &[Brick]) -> Vec<Object> {
    let mut first_brick = 0;
    (0u32..)
        .zip(plan.objects.iter().zip(lattices))
        .map(|(index, (object, lattice))| {
            let own = bricks[first_brick as usize..].iter().take_while(|brick| brick.object == index);
            let (brick_count, triangle_count) =
                own.fold((0, 0), |(bricks, triangles), brick| (bricks + 1, triangles + brick.triangle_count));
            let record = Object {
                step_log2: lattice.step_log2,
                unit_log2: lattice.unit_log2,
                first_brick,
                brick_count,
                triangle_ids: object.triangle_ids,
                triangle_count,
                _reserved: [0; 2],
            };
            first_brick += brick_count;
            record
        })
        .collect()
}

/// The records of the instances, the world's first.
pub(super) fn instance_records(plan: &Plan) -> Vec<Instance> {
    let world =
        Instance { object: 0, base: 0, flags: INSTANCE_IDENTITY, _reserved: 0, world_from_object: Instance::IDENTITY };
    let placed = plan.instances.iter().map(|instance| Instance {
        object: instance.object,
        base: instance.base,
        flags: if instance.matrix.determinant() < 0.0 { INSTANCE_MIRRORED } else { 0 },
        _reserved: 0,
        world_from_object: instance.matrix.0,
    });
    std::iter::once(world).chain(placed).collect()
}

/// The trees over the bricks of all instances.
pub(super) fn build_top(
    objects: &[Object],
    instances: &[Instance],
    lattices: &[Lattice],
    bricks: &[Brick],
) -> Result<TopLevel, BuildError> {
    let leaves = leaves(objects, instances, |_, _| ());
    top_level::build(&leaves, &leaf_boxes(&leaves, instances, lattices, |brick| &bricks[brick as usize]))
}

/// The trees over the bricks and levels of all instances.
pub(super) fn build_level_top(
    objects: &[Object],
    instances: &[Instance],
    lattices: &[Lattice],
    (bricks, records): (&[Brick], &[Level]),
) -> Result<TopLevel, BuildError> {
    let first = bricks.len() as u32;
    let mut of_object = vec![Vec::new(); objects.len()];
    for (index, level) in (first..).zip(records) {
        of_object[level.brick.object as usize].push(index);
    }
    let more = |instance: u32, leaves: &mut Vec<Leaf>| {
        let levels = &of_object[instances[instance as usize].object as usize];
        leaves.extend(levels.iter().map(|&brick| Leaf { instance, brick }));
    };
    let leaves = leaves(objects, instances, more);
    let brick = |index: u32| match index.checked_sub(first) {
        None => &bricks[index as usize],
        Some(level) => &records[level as usize].brick,
    };
    levels::build_top(&leaves, &leaf_boxes(&leaves, instances, lattices, brick), records, first)
}

/// A leaf for every brick of every instance; `more` adds others of an instance.
fn leaves(objects: &[Object], instances: &[Instance], more: impl Fn(u32, &mut Vec<Leaf>)) -> Vec<Leaf> {
    let mut leaves = Vec::new();
    for (index, instance) in (0u32..).zip(instances) {
        let object = &objects[instance.object as usize];
        let bricks = object.first_brick..object.first_brick + object.brick_count;
        leaves.extend(bricks.map(|brick| Leaf { instance: index, brick }));
        more(index, &mut leaves);
    }
    leaves
}

/// The boxes of leaves, steps of the world's lattice.
fn leaf_boxes<'a>(
    leaves: &[Leaf],
    instances: &[Instance],
    lattices: &[Lattice],
    brick: impl Fn(u32) -> &'a Brick + Sync,
) -> Vec<Box3> {
    let of_leaf = |leaf: &Leaf| {
        let (instance, brick) = (&instances[leaf.instance as usize], brick(leaf.brick));
        let own = Box3 { min: brick.min, max: brick.max };
        match leaf.instance {
            0 => own,
            _ => {
                let matrix = Affine(instance.world_from_object);
                world_box(own, &lattices[instance.object as usize], &matrix, &lattices[0])
            }
        }
    };
    leaves.par_iter().map(of_leaf).collect()
}

/// Triangles left out, instances multiplied out.
pub(super) struct Dropped {
    zero_area: u64,
    non_finite: u64,
}

impl Dropped {
    /// Counts them; `zero_area` are those dropped after rounding, by object.
    pub fn count(resident: &Resident, cuts: &[ObjectCut], zero_area: &[u32]) -> Self {
        let mut dropped = Self { zero_area: 0, non_finite: 0 };
        for instance in &resident.instances {
            let object = instance.object as usize;
            dropped.zero_area += u64::from(zero_area[object]) + u64::from(cuts[object].zero_area);
            dropped.non_finite += u64::from(cuts[object].non_finite);
        }
        dropped
    }

    /// Says so.
    pub fn warn(&self, warnings: &mut Vec<String>) {
        let triangles = |count| if count == 1 { "triangle" } else { "triangles" };
        if let count @ 1.. = self.zero_area {
            warnings.push(format!("{count} degenerate {} skipped", triangles(count)));
        }
        if let count @ 1.. = self.non_finite {
            warnings.push(format!("{count} {} with non-finite vertices skipped", triangles(count)));
        }
    }
}

/// What the scene has; a bit of `used_materials` for each material that is used.
pub(super) fn manifest(
    resident: &Resident,
    (scene, plan, settings): (&Outline, &Plan, &BuildSettings),
    used_materials: &[u64],
    dropped: &Dropped,
    warnings: Vec<String>,
) -> Manifest {
    let step = pow2(resident.objects[0].step_log2);
    let (min, max) = resident
        .top2
        .first()
        .map_or(([1.0; 3], [-1.0; 3]), |root| (root.min.map(|x| x as f64 * step), root.max.map(|x| x as f64 * step)));
    let is_used = |index: usize| used_materials[index / 64] >> (index % 64) & 1 != 0;
    let any = |test: &dyn Fn(&Material) -> bool| {
        // What is added for levels has nothing that the others do not have.
        resident.materials[..scene.materials.len()].iter().enumerate().any(|(index, material)| {
            // Further textures are used with the material before them.
            let behind = usize::from(material.flags & MATERIAL_FURTHER != 0);
            is_used(index.saturating_sub(behind)) && test(material)
        })
    };
    let instanced = resident.instances.iter().map(|instance| &resident.objects[instance.object as usize]);
    Manifest {
        generator: concat!("brickwalk ", env!("CARGO_PKG_VERSION")).to_owned(),
        sources: scene.sources.clone(),
        brick_triangles: settings.brick_triangles,
        triangle_ids: plan.triangle_ids,
        triangles_stored: resident.objects.iter().map(|object| u64::from(object.triangle_count)).sum(),
        triangles_instanced: instanced.map(|object| u64::from(object.triangle_count)).sum(),
        dropped_zero_area: dropped.zero_area,
        dropped_non_finite: dropped.non_finite,
        min,
        max,
        has_textures: any(&|material| material.textures().iter().any(|texture| *texture != NONE)),
        has_normal_maps: any(&|material| material.normal_texture != NONE),
        is_glossy: any(&Material::is_glossy),
        texture_names: Vec::new(),
        has_alpha_mask: any(&|material| material.flags & MATERIAL_MASK != 0),
        has_alpha_blend: any(&|material| material.flags & MATERIAL_BLEND != 0),
        has_emission: any(&|material| material.emission.iter().any(|x| *x > 0.0)),
        has_instances: resident.instances.len() > 1,
        has_animation: scene.has_animation,
        has_own_light: scene.has_own_light,
        has_wide_bricks: resident.bricks.iter().any(|brick| brick.flags & BRICK_WIDE != 0),
        has_proxies: !resident.occupancy.is_empty(),
        instance_scale_ratio: plan.instances.iter().fold(1.0, |most, instance| instance.matrix.scale_ratio().max(most)),
        warnings,
        movable: settings.movable.clone(),
        provenance: plan.provenance.clone(),
    }
}

/// What was built.
pub(super) fn summary(resident: &Resident, bytes_file: u64, phases: Vec<(&'static str, Duration)>) -> BuildSummary {
    let manifest = &resident.manifest;
    let nodes = resident.bricks.iter().map(|brick| u64::from(brick.node_count)).sum();
    BuildSummary {
        objects: resident.objects.len() as u64,
        instances: resident.instances.len() as u64 - 1,
        bricks: resident.bricks.len() as u64,
        wide_bricks: resident.bricks.iter().filter(|brick| brick.flags & BRICK_WIDE != 0).count() as u64,
        leaves: resident.leaves.len() as u64,
        triangle_ids: manifest.triangle_ids,
        triangles_stored: manifest.triangles_stored,
        triangles_instanced: manifest.triangles_instanced,
        dropped_zero_area: manifest.dropped_zero_area,
        dropped_non_finite: manifest.dropped_non_finite,
        world_step_log2: resident.objects[0].step_log2,
        nodes,
        bytes_nodes: nodes * size_of::<Node>() as u64,
        bytes_geometry: resident.bricks.iter().map(|brick| brick.geometry.bytes).sum(),
        bytes_attributes: resident.bricks.iter().map(|brick| brick.attributes.bytes).sum(),
        bytes_proxies: resident.bricks.iter().map(|brick| brick.proxies.bytes).sum::<u64>()
            + size_of_val(resident.occupancy.as_slice()) as u64,
        levels: resident.levels.len() as u64,
        level_triangles: resident.levels.iter().map(|level| u64::from(level.brick.triangle_count)).sum(),
        bytes_levels: resident
            .levels
            .iter()
            .map(|level| level.brick.geometry.bytes + level.brick.attributes.bytes)
            .sum(),
        level_bound: resident.levels.iter().map(|level| level.bound).fold(0.0, f64::max),
        bytes_textures: resident.texture_bytes(),
        bytes_file,
        warnings: manifest.warnings.clone(),
        phases,
    }
}
