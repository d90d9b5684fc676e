//! Cuts the objects into bricks, and chooses the lattices that follow from the cuts.

use super::gather::{self, Gathered};
use super::partition::{Bounds, cut_all};
use crate::build::error::BuildError;
use crate::build::input::objects::{ObjectPlan, Plan};
use crate::build::input::parts::Reader;
use crate::build::settings::BuildSettings;
use crate::build::triangles::lattice::{COORDINATE_LIMIT, Extents, Lattice};
use crate::progress::Progress;
use crate::source::MeshOutline;
use rayon::prelude::*;
use std::sync::{Mutex, PoisonError};

/// An object cut into the triangles of its bricks.
#[derive(Debug)]
pub(crate) struct ObjectCut {
    /// Slots by brick, ascending within each; empty where they lie on the disk.
    pub order: Vec<u32>,
    /// Number of triangles of each brick.
    pub bricks: Vec<u32>,
    /// What its lattice follows from.
    pub extents: Extents,
    /// Triangles with two equal vertices.
    pub zero_area: u32,
    /// Triangles with a vertex that is not finite.
    pub non_finite: u32,
}

/// The extents of an object of these bounds.
pub(crate) fn extents(object: &ObjectPlan, chunks: Vec<f64>, bounds: &Bounds) -> Extents {
    let Bounds { min, max } =
        if bounds.min[0] > bounds.max[0] { Bounds { min: [1.0; 3], max: [-1.0; 3] } } else { *bounds };
    Extents { name: object.name.clone(), chunks, min, max }
}

/// Cuts all objects in memory. Also returns which materials are used, a bit each.
pub(crate) fn in_memory(
    reader: &Reader,
    plan: &Plan,
    settings: &BuildSettings,
    progress: &Progress,
) -> Result<(Vec<ObjectCut>, Vec<u64>), BuildError> {
    progress.phase("partition", plan.objects.iter().map(|object| u64::from(object.slots)).sum());
    let cut = |object: &ObjectPlan| cut_object(reader, object, settings, progress);
    let cuts: Vec<Result<(ObjectCut, Gathered), BuildError>> = plan.objects.par_iter().map(cut).collect();
    let mut all = Gathered::nothing(reader.outline().materials.len());
    // The first error in order, whichever thread met one first.
    let cuts = cuts.into_iter().map(|cut| {
        cut.map(|(cut, gathered)| {
            all.add(&gathered);
            cut
        })
    });
    let cuts = cuts.collect::<Result<_, _>>()?;
    Ok((cuts, all.materials))
}

/// Cuts an object in memory.
pub(crate) fn cut_object(
    reader: &Reader,
    object: &ObjectPlan,
    settings: &BuildSettings,
    progress: &Progress,
) -> Result<(ObjectCut, Gathered), BuildError> {
    let runs = object.runs(reader.task_triangles());
    // Cuts do not depend on the order of the items.
    let items = Mutex::new(Vec::with_capacity(object.slots as usize));
    let gathered: Vec<Result<Gathered, BuildError>> = runs
        .par_iter()
        .map(|run| {
            let (found, gathered) = gather::gather(reader, run, settings.drop_non_finite, progress)?;
            items.lock().unwrap_or_else(PoisonError::into_inner).extend(found);
            Ok(gathered)
        })
        .collect();
    let mut all = Gathered::nothing(reader.outline().materials.len());
    for gathered in gathered {
        all.add(&gathered?);
    }
    let mut items = items.into_inner().unwrap_or_else(PoisonError::into_inner);
    let cuts = cut_all(&mut items, settings.brick_triangles as usize);
    let cut = ObjectCut {
        order: cuts.order,
        bricks: cuts.parts,
        extents: extents(object, cuts.extents, &all.bounds),
        zero_area: all.zero_area,
        non_finite: all.non_finite,
    };
    Ok((cut, all))
}

/// Chooses the lattice of each object. The world's must also hold every instance, and follows from the instances' sizes
/// where nothing is baked.
pub(crate) fn choose(
    plan: &Plan,
    meshes: &[MeshOutline],
    cuts: &[ObjectCut],
    settings: &BuildSettings,
    warnings: &mut Vec<String>,
) -> Result<Vec<Lattice>, BuildError> {
    let requested = settings.lattice;
    let mut lattices = Vec::with_capacity(cuts.len());
    for cut in &cuts[1..] {
        lattices.push(cut.extents.lattice(requested, warnings)?);
    }
    let mut world = cuts[0].extents.clone();
    let mut all = match world.min[0] > world.max[0] {
        true => Bounds::EMPTY,
        false => Bounds { min: world.min, max: world.max },
    };
    let is_baked = world.median().is_some();
    for instance in &plan.instances {
        let extents = &cuts[instance.object as usize].extents;
        if extents.min[0] > extents.max[0] {
            continue;
        }
        let lattice = &lattices[instance.object as usize - 1];
        let rounded = |corner: [f64; 3]| lattice.round(corner).map(|x| lattice.length(x));
        let (min, max) = instance.matrix.bounds(rounded(extents.min), rounded(extents.max));
        if !min.iter().chain(&max).all(|x| x.abs() <= COORDINATE_LIMIT) {
            let (node, limit) = (instance.placement.name.clone(), COORDINATE_LIMIT);
            let mesh = meshes[instance.placement.mesh as usize].name.clone();
            return Err(BuildError::InstanceOutOfRange { node, mesh, limit });
        }
        all.extend(min, max);
        if let Some(median) = extents.median().filter(|_| !is_baked) {
            world.chunks.push(median * instance.matrix.determinant().abs().cbrt());
        }
    }
    if all.min[0] <= all.max[0] {
        (world.min, world.max) = (all.min, all.max);
    }
    lattices.insert(0, world.lattice(requested, warnings)?);
    Ok(lattices)
}
