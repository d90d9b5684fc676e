//! The crate obvhs as a peer: single rays through its binary and its compressed wide BVH.

use super::judge::Corners;
use super::{Column, Measured, Peer, processor_seconds};
use brickwalk::kernels::layout::Ray;
use glam::{UVec2, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::bvh2::{Bvh2, builder::build_bvh2_from_tris};
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::ray::RayHit;
use obvhs::rt_triangle::RtTriangle;
use obvhs::triangle::Triangle;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

const BUILD: BvhBuildParams = BvhBuildParams::slow_build();
/// Rays that a thread takes at once.
const BLOCK: usize = 4096;

/// A tree with its triangles in the order of its leaves.
struct Tree<B> {
    bvh: B,
    triangles: Vec<RtTriangle>,
}

/// Ends at the closest hit, or if `any` at the first found: the distance, infinite without one.
trait Walk {
    fn walk(&self, ray: obvhs::ray::Ray, any: bool) -> f32;
}

impl Walk for Tree<Bvh2> {
    #[inline(always)]
    fn walk(&self, ray: obvhs::ray::Ray, any: bool) -> f32 {
        if any {
            let is_missed = self.bvh.ray_traverse_miss(ray, |ray, i| self.triangles[i].intersect(ray));
            return if is_missed { f32::INFINITY } else { 0.0 };
        }
        let mut hit = RayHit::none();
        let is_hit = self.bvh.ray_traverse(ray, &mut hit, |ray, i| self.triangles[i].intersect(ray));
        if is_hit { hit.t } else { f32::INFINITY }
    }
}

impl Walk for Tree<CwBvh> {
    /// `CwBvh::ray_traverse` by its macro: a function that is not inlined would not have AVX2.
    #[inline(always)]
    fn walk(&self, mut ray: obvhs::ray::Ray, any: bool) -> f32 {
        let mut closest = f32::INFINITY;
        let mut state = self.bvh.new_traversal(ray.direction);
        let mut node;
        'walk: {
            obvhs::traverse!(self.bvh, node, state, node.intersect_ray(&ray, state.oct_inv4), {
                let t = self.triangles[state.primitive_id as usize].intersect(&ray);
                if t < ray.tmax {
                    if any {
                        closest = 0.0;
                        break 'walk;
                    }
                    closest = t;
                    ray.tmax = t;
                }
            });
        }
        closest
    }
}

#[inline(always)]
fn trace(tree: &impl Walk, rays: &[Ray], any: bool, distances: &mut [f32]) {
    for (ray, distance) in rays.iter().zip(distances) {
        *distance = f32::INFINITY;
        if ray.t_min <= ray.t_max {
            let [origin, direction] = [ray.origin, ray.direction].map(Vec3A::from);
            *distance = tree.walk(obvhs::ray::Ray::new(origin, direction, ray.t_min, ray.t_max), any);
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,fma,lzcnt,popcnt")]
fn trace_avx2(tree: &impl Walk, rays: &[Ray], any: bool, distances: &mut [f32]) {
    trace(tree, rays, any, distances);
}

fn trace_best(tree: &impl Walk, rays: &[Ray], any: bool, distances: &mut [f32]) {
    #[cfg(target_arch = "x86_64")]
    {
        let has_bits = is_x86_feature_detected!("bmi1") && is_x86_feature_detected!("bmi2");
        let counts = is_x86_feature_detected!("lzcnt") && is_x86_feature_detected!("popcnt");
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") && has_bits && counts {
            // SAFETY: all that the function asks for was detected.
            return unsafe { trace_avx2(tree, rays, any, distances) };
        }
    }
    trace(tree, rays, any, distances);
}

pub struct Trees {
    columns: Vec<Column>,
    sets: [Vec<Ray>; 3],
    binary: Tree<Bvh2>,
    wide: Tree<CwBvh>,
}

impl Trees {
    /// Of these triangles, for these rays.
    pub fn new(triangles: &[Corners], sets: [Vec<Ray>; 3]) -> Self {
        let triangles: Vec<Triangle> = triangles
            .iter()
            .map(|corners| {
                let [v0, v1, v2] = corners.map(Vec3A::from);
                Triangle { v0, v1, v2 }
            })
            .collect();
        let start = Instant::now();
        let bvh = build_bvh2_from_tris(&triangles, BUILD, &mut Duration::default());
        let in_order = |indices: &[u32]| indices.iter().map(|&i| RtTriangle::from(&triangles[i as usize])).collect();
        let binary = Tree { triangles: in_order(&bvh.primitive_indices), bvh };
        let bvh = build_cwbvh_from_tris(&triangles, BUILD, &mut Duration::default());
        let wide = Tree { triangles: in_order(&bvh.primitive_indices), bvh };
        eprintln!("obvhs: two trees in {:.1} s", start.elapsed().as_secs_f64());
        let modes = ["BVH2", "CWBVH"].map(String::from).to_vec();
        Self { columns: vec![Column { title: "obvhs 0.4".into(), modes }], sets, binary, wide }
    }
}

impl Peer for Trees {
    fn columns(&self) -> &[Column] {
        &self.columns
    }

    fn measure(&mut self, mode: usize, set: usize, threads: usize) -> Measured {
        let (rays, any) = (&self.sets[set], set == 1);
        let mut distances = vec![0.0; rays.len()];
        let (start, processor) = (Instant::now(), processor_seconds());
        let blocks = Mutex::new(rays.chunks(BLOCK).zip(distances.chunks_mut(BLOCK)));
        let work = || {
            loop {
                let block = blocks.lock().unwrap_or_else(PoisonError::into_inner).next();
                let Some((rays, distances)) = block else { break };
                match mode {
                    0 => trace_best(&self.binary, rays, any, distances),
                    _ => trace_best(&self.wide, rays, any, distances),
                }
            }
        };
        std::thread::scope(|scope| {
            for _ in 1..threads {
                scope.spawn(work);
            }
            work();
        });
        let (processor, wall) = (processor_seconds() - processor, start.elapsed().as_secs_f64());
        Measured { processor, wall, distances }
    }
}
