//! The kernels of reflective shadow maps, and the steps that they are run by.

use super::maps::RsmMaps;
use super::twin::{rsm_light, rsm_write};
use crate::kernels;
use crate::kernels::FrameExecutor;
use crate::kernels::layout::{RsmMap, RsmOwn, RsmTexel};
use crate::kernels::table::{Family, FamilyBuffer};
use crate::schedule::{ExecutorError, Own, Step};

kernels! {
    /// The kernels.
    static KERNELS, names;

    rsm_write: "rsm/rsm_write" Own [] |b, t| rsm_write(b, t.buffers, t.pixels, t.seen, t.materials);
    rsm_light: "rsm/rsm_light" Own [] |b, t| rsm_light(b, t.buffers, (t.pixels, t.shaded), t.seen);
}

/// Number of the buffer of maps in the frame.
pub const MAPS: usize = 0;

/// The kernels and their buffers.
pub static FAMILY: Family = Family {
    name: "rsm",
    what: "reflective shadow maps",
    remedy: "give a smaller --rsm-size or fewer --rsm-lamps",
    has_lamps: true,
    buffers: &[
        FamilyBuffer { name: "maps", stride: size_of::<RsmMap>(), is_written: false },
        FamilyBuffer { name: "texels", stride: size_of::<RsmTexel>(), is_written: true },
    ],
    kernels: KERNELS,
};

/// Which random numbers the look-ups take.
const STREAM: u32 = 10 << 24;

impl RsmMaps {
    /// Gives an executor the maps as they lie in the frame that has begun. Texels keep what was written as long as
    /// there are as many.
    ///
    /// # Errors
    /// More than the device holds in one buffer, with how much it does; a device that binds too few buffers.
    pub fn give(&self, executor: &mut dyn FrameExecutor) -> Result<(), ExecutorError> {
        executor.reserve(&FAMILY, &[self.maps.len(), self.texels as usize])?;
        executor.write(&FAMILY, MAPS, 0, bytemuck::cast_slice(&self.maps));
        Ok(())
    }

    /// Writes a block of texels of a map from the hits of the set before, whose attributes are read. `corner`: the
    /// texel that ray 0 is for.
    pub fn write(&self, map: u32, [x, y]: [u32; 2]) -> Step {
        Own::new(names::rsm_write, &RsmOwn { maps: self.maps.len() as u32, map, x, y }).into()
    }

    /// Adds what the hits of the set before that occupancy maps gave reflect of the lamps: phase 3.
    pub fn light(&self) -> Step {
        let own = RsmOwn { maps: self.maps.len() as u32, ..RsmOwn::default() };
        Own { stream: Some(STREAM), ..Own::new(names::rsm_light, &own).in_phase(2) }.into()
    }
}
