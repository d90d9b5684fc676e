//! Rays of a set, with what is written of them.

use super::layout::{Hit, NONE, Ray, Surface};
use super::vector::dot;
use std::sync::atomic::AtomicU64;

/// Rays, hits and surfaces of one set, row by row.
#[derive(Default)]
pub struct RaySet {
    /// Rays.
    pub rays: Vec<Ray>,
    /// Hits.
    pub hits: Vec<Hit>,
    /// Surfaces.
    pub surfaces: Vec<Surface>,
    /// Which rays may be pending ([`super::trace::levels::is_pending`]): a word of each square of 8 x 8 rays, row by
    /// row, with a bit a ray ([`super::trace::run`]). Empty: any of them.
    pub waiting: Vec<AtomicU64>,
}

impl RaySet {
    /// For `rays` rays, none of which has an end.
    pub fn new(rays: usize) -> Self {
        Self {
            rays: vec![Ray::default(); rays],
            hits: vec![Hit::default(); rays],
            surfaces: vec![Surface::default(); rays],
            waiting: Vec::new(),
        }
    }

    /// For so many rays; those beyond are forgotten.
    pub fn resize(&mut self, rays: usize) {
        self.rays.resize(rays, Ray::default());
        self.hits.resize(rays, Hit::default());
        self.surfaces.resize(rays, Surface::default());
        self.waiting.clear();
    }

    /// How far a ray went to its hit, device units.
    pub fn way(&self, index: usize) -> f32 {
        let d = self.rays[index].direction;
        self.hits[index].t * dot(d, d).sqrt()
    }
}

/// A ray with its tile and what is written of it.
pub struct Slot<'a> {
    /// Number of its tile.
    pub tile: usize,
    /// The ray.
    pub ray: &'a Ray,
    /// Its hit.
    pub hit: &'a mut Hit,
    /// Its surface.
    pub surface: &'a mut Surface,
}

impl Slot<'_> {
    /// Whether the ray is traced.
    #[inline(always)]
    pub fn is_traced(&self) -> bool {
        is_traced(self.ray, self.hit)
    }
}

/// Whether a ray is traced: it has a range, and nothing has answered it before.
#[inline(always)]
pub fn is_traced(ray: &Ray, hit: &Hit) -> bool {
    ray.t_min <= ray.t_max && ray.t_min <= hit.t
}

/// Starts a ray's hit: nothing found within its range; triangle `source`, from which it starts, is not met (NONE: of
/// none).
pub fn start_hit(t_max: f32, source: u32) -> (Hit, Surface) {
    (Hit { t: t_max, id: NONE, u: 0.0, v: 0.0 }, Surface { leaf: NONE, source, pending: 1, ..Surface::default() })
}
