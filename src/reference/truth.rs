//! The scene in f64 and its closest hits.

use super::assessment::Assessment;
use super::bvh::{Bounds, Bvh, Padding};
use super::decode;
use super::decode::{DecodeError, TruthObject, TruthTriangle};
use super::instance::{Extremes, TruthInstance};
use super::opacity::{Opacities, Passing};
use super::ray::TruthRay;
use crate::math::crossing::{Crossing, crossing, order};
use bricks::{INSTANCE_IDENTITY, SceneFile};
use std::cmp::Ordering;

/// A triangle of an instance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    pub(super) id: u32,
    pub(super) instance: u32,
    /// Index into the object's triangles.
    pub(super) triangle: u32,
}

/// Where a ray meets the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TruthHit {
    /// Parameter, in units of the direction's length.
    pub t: f64,
    /// Global id of the triangle.
    pub id: u32,
    /// Weight of vertex 1 of the source order.
    pub u: f64,
    /// Weight of vertex 2 of the source order.
    pub v: f64,
}

/// All triangles of a scene, lattice-exact, with their global ids.
pub struct Truth {
    pub(super) objects: Vec<TruthObject>,
    pub(super) instances: Vec<TruthInstance>,
    /// By increasing id.
    pub(super) placed: Vec<Placed>,
    pub(super) bvh: Bvh,
    opacities: Opacities,
    /// Of the instances.
    pub(super) extremes: Extremes,
}

impl Truth {
    /// Decodes every brick of a scene file and builds the tree; needs about 250 bytes a placed triangle while it does.
    ///
    /// # Errors
    /// A damaged file, a vertex off its lattice, copies of a triangle that differ, an id given twice.
    pub fn load(file: &SceneFile) -> Result<Self, DecodeError> {
        Self::of_objects(file, decode::objects(file)?)
    }

    /// What rays meet that take these bricks and levels of detail, by their indices, and nothing else.
    ///
    /// # Errors
    /// As of [`Truth::load`].
    pub fn load_cut(file: &SceneFile, bricks: &[u32]) -> Result<Self, DecodeError> {
        Self::of_objects(file, decode::objects_of(file, bricks)?)
    }

    fn of_objects(file: &SceneFile, objects: Vec<decode::TruthObject>) -> Result<Self, DecodeError> {
        let instance = |instance: &bricks::Instance| TruthInstance {
            object: instance.object,
            base: instance.base,
            world_from_object: (instance.flags & INSTANCE_IDENTITY == 0).then_some(instance.world_from_object),
        };
        let instances = file.resident().instances.iter().map(instance).collect();
        let truth = Self::new(objects, instances)?;
        Ok(Self { opacities: Opacities::load(file)?, ..truth })
    }

    /// The truth of these objects and instances, whose indices into `objects` must be valid, and whose triangles stop
    /// all rays.
    ///
    /// # Errors
    /// An id given twice or beyond the greatest.
    pub fn new(objects: Vec<TruthObject>, instances: Vec<TruthInstance>) -> Result<Self, DecodeError> {
        let mut placed = Vec::new();
        for (index, instance) in (0u32..).zip(&instances) {
            for (triangle, local) in (0u32..).zip(&objects[instance.object as usize].triangles) {
                let id = u64::from(instance.base) + u64::from(local.local_id);
                if id >= u64::from(u32::MAX) {
                    return Err(DecodeError::Id { id });
                }
                placed.push(Placed { id: id as u32, instance: index, triangle });
            }
        }
        placed.sort_unstable_by_key(|placed| placed.id);
        if let Some(pair) = placed.windows(2).find(|pair| pair[0].id == pair[1].id) {
            return Err(DecodeError::Id { id: pair[0].id.into() });
        }
        let extremes = Extremes::of(&objects, &instances);
        let mut truth =
            Self { objects, instances, placed, bvh: Bvh::build(&[]), opacities: Opacities::default(), extremes };
        let bounds: Vec<Bounds> = (0..truth.placed.len()).map(|i| Bounds::of(&truth.world_vertices(i))).collect();
        truth.bvh = Bvh::build(&bounds);
        Ok(truth)
    }

    /// Number of triangles, each of every instance once.
    pub fn triangle_count(&self) -> usize {
        self.placed.len()
    }

    /// Global ids in increasing order.
    pub fn ids(&self) -> impl Iterator<Item = u32> + '_ {
        self.placed.iter().map(|placed| placed.id)
    }

    /// The stored vertices of triangle `id` in world units, exact but for the product with an instance's matrix; `None`
    /// if there is no such triangle.
    pub fn vertices(&self, id: u32) -> Option<[[f64; 3]; 3]> {
        self.find(id).map(|index| self.world_vertices(index))
    }

    /// Index of a triangle by its id.
    pub(super) fn find(&self, id: u32) -> Option<usize> {
        self.placed.binary_search_by_key(&id, |placed| placed.id).ok()
    }

    /// The object's triangle behind a placed one.
    pub(super) fn stored(&self, index: usize) -> (&TruthInstance, &TruthObject, &TruthTriangle) {
        let placed = self.placed[index];
        let instance = &self.instances[placed.instance as usize];
        let object = &self.objects[instance.object as usize];
        (instance, object, &object.triangles[placed.triangle as usize])
    }

    /// World vertices of a placed triangle. The same object vertex gives the same bits in every triangle of an
    /// instance.
    pub(super) fn world_vertices(&self, index: usize) -> [[f64; 3]; 3] {
        let (instance, object, triangle) = self.stored(index);
        let step = f64::from(object.step_log2).exp2();
        triangle.vertices.map(|vertex| {
            let p = vertex.map(|x| x as f64 * step);
            match &instance.world_from_object {
                None => p,
                Some(m) => {
                    std::array::from_fn(|k| m[4 * k] * p[0] + m[4 * k + 1] * p[1] + m[4 * k + 2] * p[2] + m[4 * k + 3])
                }
            }
        })
    }

    /// The closest hit in the ray's closed interval but for the excluded triangle, the lowest id at equal distance;
    /// both decided exactly. `None` for an invalid ray.
    pub fn closest(&self, ray: &TruthRay) -> Option<TruthHit> {
        if !ray.is_valid() {
            return None;
        }
        let mut best = None;
        self.bvh.visit(ray, Padding::NONE, ray.t_max, |index| {
            self.consider(ray, index as usize, &mut best);
            best.as_ref().map_or(ray.t_max, |(crossing, _): &(Crossing, usize)| beyond(crossing.t))
        });
        self.hit(best)
    }

    /// [`Self::closest`] by testing every triangle.
    pub fn closest_brute(&self, ray: &TruthRay) -> Option<TruthHit> {
        if !ray.is_valid() {
            return None;
        }
        let mut best = None;
        (0..self.placed.len()).for_each(|index| self.consider(ray, index, &mut best));
        self.hit(best)
    }

    /// Whether the ray meets anything in its closed interval but the excluded triangle. False for an invalid ray.
    pub fn any(&self, ray: &TruthRay) -> bool {
        if !ray.is_valid() {
            return false;
        }
        let mut found = false;
        self.bvh.visit(ray, Padding::NONE, ray.t_max, |index| {
            found = found || self.crossing(ray, index as usize).is_some();
            if found { f64::NEG_INFINITY } else { ray.t_max }
        });
        found
    }

    /// Whether the ray passes through this triangle.
    pub(super) fn is_excluded(&self, ray: &TruthRay, index: usize) -> bool {
        ray.exclude == Some(self.placed[index].id)
    }

    /// Where the ray meets a triangle within its interval, and does not pass.
    fn crossing(&self, ray: &TruthRay, index: usize) -> Option<Crossing> {
        if self.is_excluded(ray, index) {
            return None;
        }
        let within = |hit: &Crossing| ray.t_min <= hit.t && hit.t <= ray.t_max;
        let opacity = self.stored(index).2.opacity();
        let stops = |hit: &Crossing| opacity.is_none_or(|opacity| !self.opacities.passes(&opacity, hit.weights));
        crossing(&ray.line(), self.world_vertices(index)).filter(within).filter(stops)
    }

    /// What a kernel may do with a ray that meets a triangle, as assessed.
    pub(super) fn passing(&self, index: usize, at: &Assessment) -> Passing {
        let opacity = self.stored(index).2.opacity();
        opacity.map_or(Passing::NEVER, |opacity| self.opacities.assess(&opacity, at))
    }

    /// Keeps the better of `best` and the hit of a triangle.
    fn consider(&self, ray: &TruthRay, index: usize, best: &mut Option<(Crossing, usize)>) {
        let Some(hit) = self.crossing(ray, index) else { return };
        let better = best.as_ref().is_none_or(|(other, other_index)| {
            match order(&ray.line(), (&hit, self.world_vertices(index)), (other, self.world_vertices(*other_index))) {
                Ordering::Less => true,
                // Indices are in the order of ids.
                Ordering::Equal => index < *other_index,
                Ordering::Greater => false,
            }
        });
        if better {
            *best = Some((hit, index));
        }
    }

    fn hit(&self, best: Option<(Crossing, usize)>) -> Option<TruthHit> {
        let (crossing, index) = best?;
        let rotation = self.stored(index).2.rotation as usize;
        let weight = |source: usize| crossing.weights[(source + 3 - rotation % 3) % 3];
        Some(TruthHit { t: crossing.t, id: self.placed[index].id, u: weight(1), v: weight(2) })
    }
}

/// A limit that no hit at exactly `t` fails, whatever the rounding of t.
fn beyond(t: f64) -> f64 {
    t + 1e-11 * t.abs()
}
