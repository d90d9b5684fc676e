//! Pixels that take no more samples: the kernel that leaves out their rays, its twin, and the step it is run by. Which
//! they are is said by [`crate::frame::noise`].

use super::bound::Bound;
use super::rays::RaySet;
use super::table::{Family, FamilyBuffer, words};
use crate::kernels;
use crate::schedule::{ExecutorError, Own, Step};

/// Columns and rows of a block of pixels that stop together.
pub const BLOCK: usize = 8;

kernels! {
    /// The kernel.
    static KERNELS, names;

    stop_rays: "noise/stop_rays" Own [] |b, t| stop_rays(b, t.buffers, t.own);
}

/// Number of the buffer that says which blocks stop.
pub const STOPPED: usize = 0;

/// The kernel and its buffer.
pub static FAMILY: Family = Family {
    name: "noise",
    what: "blocks of pixels that stop",
    remedy: "leave out --noise",
    has_lamps: false,
    buffers: &[FamilyBuffer { name: "stopped", stride: 4, is_written: false }],
    kernels: KERNELS,
};

/// Leaves out the rays of blocks that stop, of the pass that has made them.
pub fn stop() -> Step {
    Own::new(names::stop_rays, &0u32).into()
}

/// Twin of `shaders/noise/stop_rays.wgsl`.
fn stop_rays(bound: &Bound, buffers: &mut [Vec<u32>], own: &mut RaySet) -> Result<(), ExecutorError> {
    let [stopped] = words(buffers)?;
    let width = bound.params.width as usize;
    for (index, (ray, hit)) in own.rays.iter_mut().zip(&mut own.hits).enumerate() {
        let (column, row) = (index % width, index / width);
        if stopped[row / BLOCK * width.div_ceil(BLOCK) + column / BLOCK] != 0 {
            (ray.t_min, ray.t_max, hit.t) = (1.0, 0.0, 0.0);
        }
    }
    Ok(())
}
