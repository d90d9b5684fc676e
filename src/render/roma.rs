//! Occlusion and shadow rays that occupancy maps answer: which maps, and when they are made.

use crate::kernel::frame::Frame;
use crate::kernel::roma::RomaMaps;
use crate::kernel::{FrameExecutor, View};
use crate::schedule::{ExecutorError, Lamp, Pass, Step};
use crate::visibility::bom::Cascades;
use crate::visibility::bom_resident;
use crate::visibility::roma::{Grid, RomaSettings};
use bricks::Resident;
use glam::DVec3;
use std::sync::Arc;

/// The occupancy maps of the present frame and sample.
#[derive(Default)]
pub struct Roma {
    cascades: Arc<Cascades>,
    view: Option<RomaView>,
    /// Whether the base maps are those of the present camera.
    is_assembled: bool,
    /// The ray-aligned maps that the executor has of the present sample.
    made: Option<Grid>,
}

struct RomaView {
    frame: Frame,
    camera: DVec3,
    sample: u32,
    seed: u32,
}

impl Roma {
    /// Begins a sample of a frame seen from `camera`, a point of the world.
    pub fn begin(&mut self, camera: DVec3, view: &View) {
        self.is_assembled &= self.view.as_ref().is_some_and(|before| before.camera == camera);
        self.view = Some(RomaView { frame: view.frame, camera, sample: view.params.sample, seed: view.params.seed });
        self.made = None;
    }

    /// The maps of `pass` and how many columns its rays pass; `None` where rays are traced.
    pub fn grid_of(settings: &RomaSettings, pass: Pass) -> Option<(Grid, u32)> {
        match pass {
            Pass::Occlusion(_) => Some((settings.occlusion, settings.occlusion_steps)),
            Pass::Shadow(Lamp::Sun | Lamp::Emitter) | Pass::BounceShadow(Lamp::Sun | Lamp::Emitter) => {
                Some((settings.shadow, settings.shadow_steps))
            }
            _ => None,
        }
    }

    /// Has the executor take the maps of `grid`, unless it has them; the step that then makes them.
    ///
    /// # Errors
    /// The executor's.
    pub fn prepare(
        &mut self,
        executor: &mut dyn FrameExecutor,
        resident: &Resident,
        grid: Grid,
    ) -> Result<Option<Step>, ExecutorError> {
        let Some(RomaView { frame, camera, sample, seed }) = &self.view else { return Ok(None) };
        if self.made == Some(grid) {
            return Ok(None);
        }
        if !self.is_assembled {
            let cascades = bom_resident::assemble(resident, *camera, grid.size);
            if *self.cascades != cascades {
                self.cascades = Arc::new(cascades);
            }
            self.is_assembled = true;
        }
        executor.set_cascades(&self.cascades)?;
        executor.set_roma(&RomaMaps::new(&self.cascades, frame, grid, *sample, *seed))?;
        self.made = Some(grid);
        Ok(Some(Step::RomaRotate))
    }

    /// Side of the cells of the finest maps that were made, world units.
    pub fn finest_cell(&self) -> Option<f64> {
        self.cascades.levels.first().map(|bom| f64::from(bom.cell_log2).exp2())
    }
}
