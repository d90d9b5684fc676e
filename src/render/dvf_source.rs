//! The triangles of a region, in groups that lie together: what fields of visibility strew points on.

use super::triangles::{self, Triangles, placed};
use crate::kernel::frame::Frame;
use crate::kernel::layout::DvfTriangle;
use bricks::{Leaf, Resident, SceneFile, TOP_LEAF};
use glam::DVec3;
use std::collections::BTreeSet;

/// Most triangles of a group, but for those of one brick: 12 MiB.
const GROUP_TRIANGLES: u64 = 1 << 18;

/// A part of the world.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// Least coordinates, world units.
    pub min: DVec3,
    /// Greatest coordinates.
    pub max: DVec3,
    /// The bricks whose triangles count; `None`: all.
    pub bricks: Option<BTreeSet<u32>>,
}

impl Region {
    /// All of a scene.
    pub fn scene(resident: &Resident) -> Self {
        let [min, max] = [resident.manifest.min, resident.manifest.max].map(DVec3::from_array);
        Self { min, max, bricks: None }
    }

    /// Whether a box meets it.
    fn meets(&self, min: DVec3, max: DVec3) -> bool {
        max.cmpge(self.min).all() && min.cmple(self.max).all()
    }
}

/// Leaves whose triangles are handled together.
#[derive(Clone, Debug, Default)]
pub struct Group {
    leaves: Vec<Leaf>,
    /// About the middle, world units.
    pub middle: DVec3,
    /// Triangles of the bricks.
    pub triangles: u64,
}

impl Group {
    /// How many bricks are read for it.
    pub fn bricks(&self) -> u64 {
        self.leaves.len() as u64
    }
}

/// The bits of 21 of a number, three apart.
fn spread(x: u64) -> u64 {
    (0..21).map(|bit| (x >> bit & 1) << (3 * bit)).sum()
}

/// The groups of a region, along a curve that fills space (Morton 1966), so that what follows each other lies near each other.
pub fn groups(resident: &Resident, region: &Region) -> Vec<Group> {
    let step = f64::from(resident.objects.first().map_or(0, |world| world.step_log2)).exp2();
    let corner = |p: &[i64; 3]| DVec3::from_array(p.map(|x| x as f64 * step));
    let bounds = [resident.manifest.min, resident.manifest.max].map(DVec3::from_array);
    let extent = (bounds[1] - bounds[0]).max(DVec3::splat(f64::MIN_POSITIVE));
    let mut found: Vec<(u64, u32, DVec3)> = Vec::new();
    for node in resident.top2.iter().filter(|node| node.right == TOP_LEAF) {
        let (min, max) = (corner(&node.min), corner(&node.max));
        let leaf = &resident.leaves[node.left as usize];
        if region.meets(min, max) && region.bricks.as_ref().is_none_or(|bricks| bricks.contains(&leaf.brick)) {
            let middle = 0.5 * (min + max);
            let place = ((middle - bounds[0]) / extent).clamp(DVec3::ZERO, DVec3::ONE) * f64::from((1 << 21) - 1);
            let [x, y, z] = place.to_array().map(|x| spread(x as u64));
            found.push((x | y << 1 | z << 2, node.left, middle));
        }
    }
    found.sort_unstable_by_key(|(place, leaf, _)| (*place, *leaf));
    let mut groups: Vec<Group> = Vec::new();
    for (_, leaf, middle) in found {
        let leaf = resident.leaves[leaf as usize];
        let triangles = u64::from(resident.bricks[leaf.brick as usize].triangle_count);
        if groups.last().is_none_or(|group| group.triangles + triangles > GROUP_TRIANGLES) {
            groups.push(Group { middle, ..Group::default() });
        }
        if let Some(group) = groups.last_mut() {
            group.leaves.push(leaf);
            group.triangles += triangles;
        }
    }
    groups
}

/// The triangles of a group that meet the region, in `frame`.
///
/// # Errors
/// A brick that cannot be read.
pub fn triangles(
    file: &SceneFile,
    group: &Group,
    region: &Region,
    frame: &Frame,
) -> Result<Vec<DvfTriangle>, bricks::Error> {
    let resident = file.resident();
    let mut out = Vec::new();
    for leaf in &group.leaves {
        let instance = &resident.instances[leaf.instance as usize];
        let object = &resident.objects[instance.object as usize];
        let Triangles { corners, local_ids } = triangles::triangles(file, object, leaf.brick)?;
        for (corners, id) in corners.iter().zip(&local_ids) {
            let [a, b, c] = placed(instance, corners);
            if region.meets(a.min(b).min(c), a.max(b).max(c)) {
                let [a, b, c] = [a, b, c].map(|p| frame.point(p));
                out.push(DvfTriangle { a, id: instance.base + id, b, flags: instance.flags, c, padding: 0 });
            }
        }
    }
    Ok(out)
}
