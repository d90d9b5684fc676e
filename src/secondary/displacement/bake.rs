//! Traces the rays of fields.
//!
//! The rays of a field start on its sphere and are traced by the kernels that trace every other ray, but against the
//! bricks of its own object alone ([`listed`]). Fields share dispatches; tiles of rays belong to one field each.

use super::ball::Ball;
use super::shape::{Shape, frame};
use super::subject::{Subject, is_similarity};
use crate::counters::Counters;
use crate::kernels::frame::Frame;
use crate::kernels::layout::{Hit, NONE, Params, Ray, T_INFINITE};
use crate::kernels::{Directions, FrameExecutor, View};
use crate::scene::placement::affine;
use crate::schedule::cache::Cache;
use crate::schedule::{ExecutorError, Pass, Step, Tracer, Tracing, listed};
use bricks::{Resident, SceneFile, TOP_LEAF, TopNode2};
use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// What rays are traced with.
pub struct Bench<'a> {
    /// The scene.
    pub scene: &'a SceneFile,
    /// The executor.
    pub executor: &'a mut dyn FrameExecutor,
    /// The cache.
    pub cache: &'a mut Cache,
    /// Most rays of a dispatch.
    pub most: usize,
    /// Rays of a tile, which lie one after another.
    pub tile: usize,
}

/// Where rays start and go, beside the positions of a [`Shape`].
pub type Directions3 = dyn Fn(u32) -> DVec3 + Sync;

/// A field to be made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Job {
    /// Of what.
    pub subject: Subject,
    /// Its sphere.
    pub ball: Ball,
    /// Its samples.
    pub shape: Shape,
}

/// Makes fields: `take` gets of a job, by its number, from a sample on, the shares of chords at which rays meet
/// something, 0 to 1, or less where they meet nothing; the samples of a job in their order. It says whether to go on.
///
/// `direction`: of a shape, by its number, unit vectors whose z is along the inward normal, if not those of the shape.
///
/// # Errors
/// A brick that cannot be read, or the device's.
pub fn bake(
    bench: &mut Bench,
    jobs: &[Job],
    direction: Option<&Directions3>,
    take: &mut dyn FnMut(usize, u64, &[f32]) -> bool,
) -> Result<(), ExecutorError> {
    let placed: Vec<Placed> = jobs.iter().map(|job| Placed::new(bench.scene.resident(), job)).collect();
    let mut groups: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
    for (number, placed) in placed.iter().enumerate() {
        groups.entry(placed.frame.reference).or_default().push(number);
    }
    for members in groups.values() {
        let mut runs = Vec::new();
        for &number in members {
            let samples = jobs[number].shape.samples();
            let mut first = 0;
            while first < samples {
                // A dispatch is filled up, tile by tile.
                let used: usize = runs.iter().map(|run: &Run| run.tiles(bench.tile) * bench.tile).sum();
                let count = (samples - first).min((bench.most - used) as u64) as usize;
                if count == 0 {
                    if !trace(bench, jobs, &placed, &runs, direction, take)? {
                        return Ok(());
                    }
                    runs.clear();
                    continue;
                }
                runs.push(Run { job: number, first, count });
                first += count as u64;
            }
        }
        if !runs.is_empty() && !trace(bench, jobs, &placed, &runs, direction, take)? {
            return Ok(());
        }
    }
    Ok(())
}

/// Samples of a field that are traced at a time.
#[derive(Clone, Copy)]
struct Run {
    job: usize,
    first: u64,
    count: usize,
}

impl Run {
    fn tiles(&self, tile: usize) -> usize {
        self.count.div_ceil(tile)
    }
}

/// A subject in the scene.
struct Placed {
    frame: Frame,
    world_from_object: DAffine3,
    /// Leaf nodes of the binary top level that are its bricks, as of its first instance that is a similarity.
    nodes: Vec<u32>,
    /// Its bricks.
    bricks: Vec<u32>,
}

impl Placed {
    fn new(resident: &Resident, job: &Job) -> Self {
        let bricks = job.subject.bricks(resident);
        let is_of = |leaf: &bricks::Leaf| bricks.contains(&leaf.brick);
        // Distances of others are not those of the object.
        let is_even = |leaf: &bricks::Leaf| is_similarity(&resident.instances[leaf.instance as usize]);
        let instance = resident.leaves.iter().find(|leaf| is_of(leaf) && is_even(leaf)).map_or(0, |leaf| leaf.instance);
        let world_from_object = affine(&resident.instances[instance as usize].world_from_object);
        let center = world_from_object.transform_point3(job.ball.center);
        let own = |(number, node): (u32, &TopNode2)| {
            let leaf = (node.right == TOP_LEAF).then(|| &resident.leaves[node.left as usize])?;
            (leaf.instance == instance && is_of(leaf)).then_some((number, leaf.brick))
        };
        let (nodes, bricks) = (0..).zip(&resident.top2).filter_map(own).unzip();
        Self { frame: Frame::near(resident, center), world_from_object, nodes, bricks }
    }
}

/// Traces runs, which fill a dispatch at most; whether to go on.
fn trace(
    bench: &mut Bench,
    jobs: &[Job],
    placed: &[Placed],
    runs: &[Run],
    direction: Option<&Directions3>,
    take: &mut dyn FnMut(usize, u64, &[f32]) -> bool,
) -> Result<bool, ExecutorError> {
    let none = Ray { t_min: 1.0, t_max: 0.0, direction: [1.0, 0.0, 0.0], ..Ray::default() };
    let mut rays = Vec::new();
    let mut lists = Vec::new();
    let mut bricks = Vec::new();
    for run in runs {
        let placed = &placed[run.job];
        let ray = |at: usize| placed.ray(ray_of(&jobs[run.job], run.first + at as u64, direction).0);
        rays.par_extend((0..run.count).into_par_iter().map(ray));
        lists.extend((0..run.tiles(bench.tile)).map(|_| placed.nodes.clone()));
        rays.resize(lists.len() * bench.tile, none);
        bricks.extend(&placed.bricks);
    }
    lists.resize(bench.most / bench.tile, Vec::new());
    bricks.sort_unstable();
    bricks.dedup();
    let frame = placed[runs[0].job].frame;
    let (executor, cache) = (&mut *bench.executor, &mut *bench.cache);
    executor.begin_frame(&View { frame, params: Params::default(), directions: Directions::default(), rays: None });
    executor.set_rays(Pass::Primary, &rays);
    cache.begin_pass("displacement", 0);
    let stats = &mut Counters::default();
    let tracing = &Tracing::default();
    let mut tracer = Tracer::new(&mut *executor, cache, Pass::Primary, tracing, stats);
    listed::trace(&mut tracer, &[Step::StartHits], &lists, &bricks)?;
    let hits = executor.read_hits(Pass::Primary)?;
    let mut at = 0;
    for run in runs {
        let placed = &placed[run.job];
        let own = &hits[at..at + run.count];
        let share = |(at, hit): (usize, &Hit)| {
            let sample = run.first + at as u64;
            let chord = ray_of(&jobs[run.job], sample, direction).1;
            if hit.id == NONE { -1.0 } else { (placed.distance(hit.t) / chord).clamp(0.0, 1.0) as f32 }
        };
        let shares: Vec<f32> = own.par_iter().enumerate().map(share).collect();
        if !take(run.job, run.first, &shares) {
            return Ok(false);
        }
        at += run.tiles(bench.tile) * bench.tile;
    }
    Ok(true)
}

/// Origin and direction of a sample's ray, object units, and the length of its chord.
fn ray_of(job: &Job, sample: u64, direction: Option<&Directions3>) -> ([DVec3; 2], f64) {
    let squares = u64::from(job.shape.squares());
    let (position, square) = ((sample / squares) as u32, (sample % squares) as u32);
    let at = job.shape.position(position);
    let local = direction.map_or_else(|| job.shape.direction(square), |of| of(square));
    let [x, y, z] = frame(at);
    let way = x * local.x + y * local.y + z * local.z;
    ([job.ball.center + job.ball.radius * at, way], (2.0 * job.ball.radius * local.z).max(f64::MIN_POSITIVE))
}

impl Placed {
    /// A ray of the object as the device traces it, its direction a unit vector in the world.
    fn ray(&self, [origin, direction]: [DVec3; 2]) -> Ray {
        let way = self.world_from_object.transform_vector3(direction);
        Ray {
            origin: self.frame.point(self.world_from_object.transform_point3(origin)),
            t_min: 0.0,
            direction: way.normalize_or(DVec3::X).as_vec3().to_array(),
            t_max: T_INFINITE,
        }
    }

    /// A distance of the device in object units, of a similarity.
    fn distance(&self, t: f32) -> f64 {
        f64::from(t) * self.frame.unit / scale_of(&self.world_from_object.matrix3)
    }
}

/// By how much a similarity scales.
pub fn scale_of(linear: &DMat3) -> f64 {
    linear.determinant().abs().cbrt()
}
