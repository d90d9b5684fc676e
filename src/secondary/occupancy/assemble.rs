//! The maps of a frame, brought together from those of bricks, anew or from those of the frame before.

use super::boxes::{boxes, region};
use super::maps::Maps;
use super::place::{Cells, Place};
use super::plan::{Settings, maps};
use super::region::Region;
use super::{Bom, Cascades};
use crate::scene::placement::world_box;
use bricks::{Occupancy, OccupancyMap, RESIDENT_LEVEL, Resident, SceneFile, TOP_LEAF, TopNode2};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

/// 64³ maps in hand at once, 10 MB, whatever the budget.
const BATCH: usize = 256;

/// Why maps cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum BomError {
    /// The scene has no occupancy maps.
    #[error("{path}: the scene has no occupancy maps; convert it again without --no-proxies")]
    NoProxies {
        /// The scene file.
        path: PathBuf,
    },
    /// Maps were to be made of triangles, which are too many to be held.
    #[error(
        "{path}: --bom raster holds all triangles of a scene, and it has {count}, more than {most}; use --bom bricks"
    )]
    TooManyTriangles {
        /// The scene file.
        path: PathBuf,
        /// Triangles.
        count: u64,
        /// Most that are held.
        most: u64,
    },
    /// A brick's map cannot be read.
    #[error(transparent)]
    Read(#[from] bricks::Error),
}

/// A brick to be brought into a level.
struct Job {
    leaf: u32,
    region: Region,
    /// All that it may touch of the level is one cell.
    is_one_cell: bool,
    /// 0: from the resident level; else one more than its place among the bricks whose maps are looked at.
    order: u32,
    /// A 64³ map is wanted.
    is_wanted: bool,
}

/// A map in the making.
struct Level {
    map: Bom,
    /// What of it is empty and to be filled.
    regions: Vec<Region>,
    jobs: Vec<Job>,
}

/// What of the scene a frame was made of, as far as it may change.
struct Placed {
    matrices: Vec<[f64; 12]>,
    /// Bounds of the leaves, steps of the world's lattice.
    boxes: Vec<[[i64; 3]; 2]>,
}

/// Makes the maps of one frame after the other.
pub struct Assembler {
    settings: Settings,
    maps: Maps,
    pub(super) cascades: Cascades,
    placed: Placed,
}

/// The maps of a scene around `camera`, world units.
///
/// # Errors
/// As of [`Assembler`].
pub fn assemble(file: &Arc<SceneFile>, settings: &Settings, camera: DVec3) -> Result<Cascades, BomError> {
    let mut assembler = Assembler::new(file.clone(), *settings)?;
    assembler.advance(file.resident(), camera)?;
    Ok(assembler.cascades)
}

/// log2 of the steps of the world's lattice in a cell of a level.
fn cell_steps_log2(resident: &Resident, map: &Bom) -> i32 {
    map.cell_log2 - resident.objects[0].step_log2
}

/// The cells of a level that bounds in steps of the world's lattice touch.
fn region_of(map: &Bom, steps_log2: i32, [min, max]: &[[i64; 3]; 2]) -> Option<Region> {
    // Within the scene's bounds cells are at most 2^48 from the origin.
    let cell = |x: i64| if steps_log2 >= 0 { x >> steps_log2.min(63) } else { x << -steps_log2 };
    Region::within(map, min.map(cell), max.map(|x| cell(x) + 1))
}

impl Assembler {
    /// For the maps of `file`.
    ///
    /// # Errors
    /// The scene has no occupancy maps.
    pub fn new(file: Arc<SceneFile>, settings: Settings) -> Result<Self, BomError> {
        let resident = file.resident();
        if resident.occupancy.len() != resident.exact_bricks() {
            return Err(BomError::NoProxies { path: file.path().to_owned() });
        }
        let maps = Maps::new(file, settings.budget_bytes);
        let placed = Placed { matrices: Vec::new(), boxes: Vec::new() };
        Ok(Self { settings, maps, cascades: Cascades::default(), placed })
    }

    /// The maps of the frame made last.
    pub fn cascades(&self) -> &Cascades {
        &self.cascades
    }

    /// Makes the maps around `camera`, world units, from the maps made last: what they have in common with the new ones
    /// is moved, and only the rest is filled, and what instances that moved leave and enter. They are the same bit for
    /// bit as maps made anew. `resident` is the file's, or that with instances moved: matrices, and the binary
    /// top-level tree with bounds that follow from them. Returns how many cells were filled.
    ///
    /// # Errors
    /// A damaged file.
    pub fn advance(&mut self, resident: &Resident, camera: DVec3) -> Result<u64, BomError> {
        let moved = self.note_moved(resident);
        let from = std::mem::take(&mut self.cascades.levels);
        let settings = &self.settings;
        let mut levels: Vec<Level> = maps(resident, settings, camera.to_array())
            .into_par_iter()
            .map(|map| {
                let before = from.iter().find(|old| old.cell_log2 == map.cell_log2);
                let mut level = Level::new(resident, map, before, moved.as_deref());
                level.collect(resident, settings);
                level
            })
            .collect();
        let order = self.order(resident, &mut levels, camera);
        levels.par_iter_mut().for_each(|level| level.enter(resident, 0, &[]));
        for (batch, bricks) in (0u32..).zip(order.chunks(BATCH)) {
            let maps = self.maps.get(bricks)?;
            levels.par_iter_mut().for_each(|level| level.enter(resident, 1 + batch * BATCH as u32, &maps));
        }
        let filled = levels.iter().flat_map(|level| &level.regions).map(Region::count).sum();
        self.cascades.levels.extend(levels.into_iter().map(|level| level.map));
        Ok(filled)
    }

    /// The bounds that moved instances had and have; `None`: other leaves than before.
    fn note_moved(&mut self, resident: &Resident) -> Option<Vec<[[i64; 3]; 2]>> {
        let before = &self.placed;
        let is_same = before.matrices.len() == resident.instances.len() && before.boxes.len() == resident.leaves.len();
        let has_moved = |index: usize| before.matrices[index] != resident.instances[index].world_from_object;
        if is_same && !(0..before.matrices.len()).any(has_moved) {
            return Some(Vec::new());
        }
        let mut boxes = vec![[[0; 3]; 2]; resident.leaves.len()];
        for node in resident.top2.iter().filter(|node| node.right == TOP_LEAF) {
            boxes[node.left as usize] = [node.min, node.max];
        }
        let moved = is_same.then(|| {
            let leaves = resident.leaves.iter().zip(before.boxes.iter().zip(&boxes));
            let of_moved = leaves.filter(|(leaf, _)| has_moved(leaf.instance as usize));
            of_moved.flat_map(|(_, (old, new))| [*old, *new]).collect()
        });
        let matrices = resident.instances.iter().map(|instance| instance.world_from_object).collect();
        self.placed = Placed { matrices, boxes };
        moved
    }

    /// Decides whose 64³ maps are looked at and numbers the jobs by it. The maps come farthest first, so that the
    /// nearest stay held.
    fn order(&self, resident: &Resident, levels: &mut [Level], camera: DVec3) -> Vec<u32> {
        let mut wanted: HashMap<u32, f64> = HashMap::new();
        for job in levels.iter().flat_map(|level| &level.jobs).filter(|job| job.is_wanted) {
            let [min, max] = world_box(resident, self.placed.boxes[job.leaf as usize]);
            let distance = camera.distance_squared(camera.max(min).min(max));
            let nearest = wanted.entry(resident.leaves[job.leaf as usize].brick).or_insert(f64::INFINITY);
            *nearest = nearest.min(distance);
        }
        let mut bricks: Vec<(f64, u32)> = wanted.into_iter().map(|(brick, distance)| (distance, brick)).collect();
        bricks.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let order: Vec<u32> = bricks.into_iter().rev().map(|(_, brick)| brick).collect();
        let place: HashMap<u32, u32> = order.iter().copied().zip(1..).collect();
        for level in levels {
            for job in &mut level.jobs {
                if job.is_wanted {
                    job.order = place[&resident.leaves[job.leaf as usize].brick];
                }
            }
            level.jobs.sort_unstable_by_key(|job| job.order);
        }
        order
    }
}

impl Level {
    /// A map with what is to be filled: what `before` lacks, if there is such a map, and the bounds of what moved.
    fn new(resident: &Resident, map: Bom, before: Option<&Bom>, moved: Option<&[[[i64; 3]; 2]]>) -> Self {
        let whole = Region::whole(map.cells());
        let (Some(before), Some(moved)) = (before, moved) else {
            return Self { map, regions: vec![whole], jobs: Vec::new() };
        };
        let (mut map, mut regions) = before.moved(map.first);
        let steps_log2 = cell_steps_log2(resident, &map);
        let mut left: Vec<Region> = moved.iter().filter_map(|bounds| region_of(&map, steps_log2, bounds)).collect();
        left.sort_unstable_by_key(|region| (region.lo, region.hi));
        left.dedup();
        if left.iter().chain(&regions).map(Region::count).sum::<u64>() >= whole.count() {
            map.clear(&whole);
            return Self { map, regions: vec![whole], jobs: Vec::new() };
        }
        left.iter().for_each(|region| map.clear(region));
        regions.append(&mut left);
        Self { map, regions, jobs: Vec::new() }
    }

    /// Finds the leaves in the regions.
    fn collect(&mut self, resident: &Resident, settings: &Settings) {
        if resident.top2.is_empty() {
            return;
        }
        let steps_log2 = cell_steps_log2(resident, &self.map);
        let mut stack = Vec::new();
        for region in &self.regions {
            stack.push(0);
            while let Some(index) = stack.pop() {
                let node: &TopNode2 = &resident.top2[index as usize];
                let Some(all) = region_of(&self.map, steps_log2, &[node.min, node.max]) else { continue };
                let Some(region) = region.and(&all) else { continue };
                if node.right != TOP_LEAF {
                    stack.extend([node.left, node.right]);
                    continue;
                }
                let leaf = &resident.leaves[node.left as usize];
                // Levels of detail have no maps; the bricks that they stand for do.
                if leaf.brick as usize >= resident.occupancy.len() {
                    continue;
                }
                let place = Place::of(&resident.instances[leaf.instance as usize], record(resident, leaf));
                // Cut off by the level's end it may be more than one.
                let is_inside = (0..3).all(|k| all.lo[k] > 0 && all.hi[k] < self.map.cells());
                let is_one_cell = is_inside && all.count() == 1;
                let wide_log2 = self.map.cell_log2 - (place.cell_log2() + RESIDENT_LEVEL as i32);
                let is_wanted = wide_log2 < settings.detail_log2 && !is_one_cell;
                self.jobs.push(Job { leaf: node.left, region, is_one_cell, order: 0, is_wanted });
            }
        }
    }

    /// Enters the bricks numbered from `first`: 0 those from resident levels, else as many as there are maps.
    fn enter(&mut self, resident: &Resident, first: u32, maps: &[Arc<OccupancyMap>]) {
        let from = self.jobs.partition_point(|job| job.order < first);
        let end = self.jobs.partition_point(|job| job.order < first + (maps.len() as u32).max(1));
        for job in &self.jobs[from..end] {
            if job.is_one_cell {
                self.map.occupy(job.region.lo);
                continue;
            }
            let leaf = &resident.leaves[job.leaf as usize];
            let record = record(resident, leaf);
            let place = Place::of(&resident.instances[leaf.instance as usize], record);
            let cells = match maps.get(job.order.wrapping_sub(first) as usize) {
                Some(map) => Cells::of(map, place.level(self.map.cell_log2)),
                None => Cells::resident(record),
            };
            let instance = &resident.instances[leaf.instance as usize];
            let object = &resident.objects[instance.object as usize];
            // Cells of a wide, flat brick reach far beside it; the boxes of its root's children do not.
            for of_child in boxes(object, &resident.bricks[leaf.brick as usize]) {
                if let Some(within) = region(&self.map, instance, of_child).and_then(|region| region.and(&job.region)) {
                    place.enter(&mut self.map, &within, &cells);
                }
            }
        }
    }
}

fn record<'a>(resident: &'a Resident, leaf: &bricks::Leaf) -> &'a Occupancy {
    &resident.occupancy[leaf.brick as usize]
}
