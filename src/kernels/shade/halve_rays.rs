//! Rays of one pixel in four: twin of `shaders/shade/halve_rays.wgsl`.

use crate::kernels::bound::Bound;
use crate::kernels::rays::RaySet;

/// Leaves out the rays of pixels whose column or row in the picture is odd.
pub fn halve_rays(bound: &Bound, own: &mut RaySet) {
    let p = bound.params;
    for (index, (ray, hit)) in (0u32..).zip(own.rays.iter_mut().zip(&mut own.hits)) {
        let (column, row) = (index % p.width, p.first_row + index / p.width);
        if (column | row) & 1 != 0 {
            (ray.t_min, ray.t_max, hit.t) = (1.0, 0.0, 0.0);
        }
    }
}
