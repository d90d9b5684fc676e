//! Rays that end or start at the plane that a scene is cut at: twin of `shaders/shade/clip_rays.wgsl`.

use crate::kernels::bound::Bound;
use crate::kernels::rays::RaySet;
use crate::kernels::vector::{Vec3, xyz};
use crate::math::exact::{barrier, divide};
use rayon::prelude::*;

/// Leaves of every ray what lies on the side of the plane ([`crate::kernels::layout::Params::clip`]) that its normal
/// points away from.
pub fn clip_rays(bound: &Bound, own: &mut RaySet) {
    let (n, off) = (xyz(bound.params.clip), bound.params.clip[3]);
    let along_normal = |p: Vec3| barrier(barrier(barrier(n[0] * p[0]) + barrier(n[1] * p[1])) + barrier(n[2] * p[2]));
    let RaySet { rays, hits, .. } = own;
    rays.par_iter_mut().zip(hits.par_iter_mut()).with_min_len(1024).for_each(|(ray, hit)| {
        if ray.t_min > ray.t_max {
            return;
        }
        let height = along_normal(ray.origin) - off;
        let rise = along_normal(ray.direction);
        let (mut t_min, mut t_max) = (ray.t_min, ray.t_max);
        if rise == 0.0 {
            t_max = if height > 0.0 { t_min } else { t_max };
        } else {
            let crossing = divide(-height, rise);
            if rise > 0.0 {
                t_max = t_max.min(crossing);
            } else {
                t_min = t_min.max(crossing);
            }
        }
        // A ray that lies beyond the plane is traced over a range of a point: it goes free.
        t_min = t_min.min(ray.t_max);
        t_max = t_max.max(t_min);
        (ray.t_min, ray.t_max, hit.t) = (t_min, t_max, t_max);
    });
}
