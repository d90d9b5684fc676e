//! The triangles of a region, in groups that lie together: what fields of visibility strew points on.

use crate::frame::triangles;
use crate::frame::triangles::{Triangles, placed};
use crate::kernels::frame::Frame;
use crate::kernels::layout::DvfTriangle;
use crate::scene::placement::world_box;
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
#[derive(Clone, Debug)]
pub struct Group {
    /// With their boxes, world units.
    leaves: Vec<(Leaf, [DVec3; 2])>,
    /// That its triangles are placed in: near its first leaf.
    pub frame: Frame,
    /// Triangles of the bricks.
    pub triangles: u64,
}

impl Group {
    /// How many bricks are read for it.
    pub fn bricks(&self) -> u64 {
        self.leaves.len() as u64
    }

    /// The boxes of its leaves, world units, and how many triangles their bricks hold.
    pub fn boxes(&self, resident: &Resident) -> impl Iterator<Item = ([DVec3; 2], u64)> {
        let triangles = |leaf: &Leaf| u64::from(resident.bricks[leaf.brick as usize].triangle_count);
        self.leaves.iter().map(move |(leaf, bounds)| (*bounds, triangles(leaf)))
    }

    /// The group of those of its leaves of which `counts`, given their boxes, is true; its frame stays.
    pub fn only(&self, resident: &Resident, counts: impl Fn(&Leaf, [DVec3; 2]) -> bool) -> Self {
        let leaves: Vec<_> = self.leaves.iter().filter(|(leaf, bounds)| counts(leaf, *bounds)).copied().collect();
        let count = |(leaf, _): &(Leaf, _)| u64::from(resident.bricks[leaf.brick as usize].triangle_count);
        Self { triangles: leaves.iter().map(count).sum(), leaves, frame: self.frame }
    }
}

/// The bits of 21 of a number, three apart.
fn spread(x: u64) -> u64 {
    (0..21).map(|bit| (x >> bit & 1) << (3 * bit)).sum()
}

/// The groups of a region, along a curve that fills space (Morton 1966), so that what follows each other lies near each
/// other.
pub fn groups(resident: &Resident, region: &Region) -> Vec<Group> {
    groups_of(resident, region, &|_| true)
}

/// The groups of a region of a scene in which the instances `displaced`, ascending, stand elsewhere than in `still`:
/// what rests is grouped and placed as it is there, so that its points are the same bits; what has moved has groups of
/// its own.
pub fn groups_of_moved(still: &[Group], now: &Resident, region: &Region, displaced: &[u32]) -> Vec<Group> {
    let has_moved = |leaf: &Leaf| displaced.binary_search(&leaf.instance).is_ok();
    let rests = |group: &Group| group.only(now, |leaf, _| !has_moved(leaf));
    let mut groups: Vec<Group> = still.iter().map(rests).filter(|group| !group.leaves.is_empty()).collect();
    groups.extend(groups_of(now, region, &has_moved));
    groups
}

/// The groups of those leaves of a region of which `counts` is true.
fn groups_of(resident: &Resident, region: &Region, counts: &dyn Fn(&Leaf) -> bool) -> Vec<Group> {
    let bounds = [resident.manifest.min, resident.manifest.max].map(DVec3::from_array);
    let extent = (bounds[1] - bounds[0]).max(DVec3::splat(f64::MIN_POSITIVE));
    let mut found: Vec<(u64, u32, [DVec3; 2])> = Vec::new();
    for node in resident.top2.iter().filter(|node| node.right == TOP_LEAF) {
        let [min, max] = world_box(resident, [node.min, node.max]);
        let leaf = &resident.leaves[node.left as usize];
        let is_of_region = region.bricks.as_ref().is_none_or(|bricks| bricks.contains(&leaf.brick));
        if is_of_region && region.meets(min, max) && counts(leaf) {
            let middle = 0.5 * (min + max);
            let place = ((middle - bounds[0]) / extent).clamp(DVec3::ZERO, DVec3::ONE) * f64::from((1 << 21) - 1);
            let [x, y, z] = place.to_array().map(|x| spread(x as u64));
            found.push((x | y << 1 | z << 2, node.left, [min, max]));
        }
    }
    found.sort_unstable_by_key(|(place, leaf, _)| (*place, *leaf));
    let mut groups: Vec<Group> = Vec::new();
    for (_, leaf, bounds) in found {
        let leaf = resident.leaves[leaf as usize];
        let triangles = u64::from(resident.bricks[leaf.brick as usize].triangle_count);
        if groups.last().is_none_or(|group| group.triangles + triangles > GROUP_TRIANGLES) {
            let frame = Frame::near(resident, 0.5 * (bounds[0] + bounds[1]));
            groups.push(Group { leaves: Vec::new(), frame, triangles: 0 });
        }
        if let Some(group) = groups.last_mut() {
            group.leaves.push((leaf, bounds));
            group.triangles += triangles;
        }
    }
    groups
}

/// The triangles of a group that meet the region and of whose boxes `counts` is true, in the group's frame.
///
/// # Errors
/// A brick that cannot be read.
pub fn triangles(
    file: &SceneFile,
    group: &Group,
    region: &Region,
    counts: &dyn Fn([DVec3; 2]) -> bool,
) -> Result<Vec<DvfTriangle>, bricks::Error> {
    let resident = file.resident();
    let mut out = Vec::new();
    for (leaf, _) in &group.leaves {
        let instance = &resident.instances[leaf.instance as usize];
        let Triangles { corners, local_ids } = triangles::triangles(file, leaf.brick)?;
        for (corners, id) in corners.iter().zip(&local_ids) {
            let [a, b, c] = placed(instance, corners);
            let bounds = [a.min(b).min(c), a.max(b).max(c)];
            if region.meets(bounds[0], bounds[1]) && counts(bounds) {
                let [a, b, c] = [a, b, c].map(|p| group.frame.point(p));
                out.push(DvfTriangle { a, id: instance.base + id, b, flags: instance.flags, c, padding: 0 });
            }
        }
    }
    Ok(out)
}
