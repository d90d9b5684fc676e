//! Occlusion and shadow rays that occupancy maps answer: which maps, and when they are made.

use crate::kernel::frame::Frame;
use crate::kernel::roma::RomaMaps;
use crate::kernel::{FrameExecutor, View};
use crate::schedule::{ExecutorError, Lamp, Pass, Step};
use crate::visibility::bom::{Assembler, Bom, BomError, Cascades, Settings};
use crate::visibility::roma::{Grid, MOST_LEVELS, Role, RomaPass, RomaSettings};
use bricks::{Leaf, Resident, SceneFile};
use glam::DVec3;
use std::sync::Arc;

/// The occupancy maps of the present frame and sample.
#[derive(Default)]
pub struct Roma {
    /// What makes the base maps, of so many cells on each axis.
    assembler: Option<(u32, Assembler)>,
    cascades: Arc<Cascades>,
    view: Option<RomaView>,
    /// Whether the base maps are those of the present camera and of where instances are.
    is_assembled: bool,
    /// The finest cells that the base maps were to have.
    finest_log2: Option<i32>,
    /// Whether instances have moved since.
    has_moved: bool,
    /// The ray-aligned maps that the executor has of the present sample.
    made: Option<(Grid, Role, usize)>,
}

struct RomaView {
    frame: Frame,
    camera: DVec3,
    sample: u32,
    seed: u32,
}

/// log2 of the side of cells, world units, than which those of three bricks in four are no larger. Finer base maps would repeat cells of
/// bricks, and rays would start within those: a street was dark around its trees.
fn usual_cell_log2(resident: &Resident) -> Option<i32> {
    let side = |leaf: &Leaf| {
        let scale = resident.instances[leaf.instance as usize].determinant().abs().cbrt();
        Some(resident.occupancy.get(leaf.brick as usize)?.cell_log2 + scale.log2().ceil() as i32)
    };
    let mut sides: Vec<i32> = resident.leaves.iter().filter_map(side).collect();
    let at = sides.len() * 3 / 4;
    (at < sides.len()).then(|| *sides.select_nth_unstable(at).1)
}

impl Roma {
    /// Begins a sample of a frame seen from `camera`, a point of the world.
    pub fn begin(&mut self, camera: DVec3, view: &View) {
        self.is_assembled &= self.view.as_ref().is_some_and(|before| before.camera == camera);
        self.view = Some(RomaView { frame: view.frame, camera, sample: view.params.sample, seed: view.params.seed });
        self.made = None;
    }

    /// Notes that instances have moved: maps are made anew where these were and are.
    pub fn scene_has_moved(&mut self) {
        self.is_assembled = false;
        self.has_moved = true;
    }

    /// How the rays of `pass` are answered; `None` where they are traced.
    pub fn pass_of(settings: &RomaSettings, pass: Pass) -> Option<RomaPass> {
        match pass {
            Pass::Occlusion(_) => Some(settings.occlusion),
            Pass::Diffuse(_) => settings.diffuse,
            Pass::Shadow(Lamp::Sun | Lamp::Emitter) | Pass::BounceShadow(Lamp::Sun | Lamp::Emitter) => {
                Some(settings.shadow)
            }
            _ => None,
        }
    }

    /// Has the executor take the maps of `pass` for rays that are `length` world units long at most, unless it has them; the step that then
    /// makes them. Levels are left out that such rays end in before they are off their surface, or before they are answered by maps.
    ///
    /// # Errors
    /// The executor's.
    pub fn prepare(
        &mut self,
        executor: &mut dyn FrameExecutor,
        scene: &Arc<SceneFile>,
        pass: RomaPass,
        length: f64,
    ) -> Result<Option<Step>, ExecutorError> {
        if self.view.is_none() {
            return Ok(None);
        }
        let RomaPass { grid, role, .. } = pass;
        self.assemble(scene, grid.size)?;
        let before = role.lift() / grid.scale(grid.size);
        let before = if let Role::Far(cells) = role { before.max(cells.into()) } else { before };
        let is_of_use = |bom: &&Bom| before * bom.side() < length;
        let levels = self.cascades.levels.iter().take_while(is_of_use).count();
        if self.made == Some((grid, role, levels)) {
            return Ok(None);
        }
        let Some(RomaView { frame, sample, seed, .. }) = &self.view else { return Ok(None) };
        executor.set_cascades(&self.cascades)?;
        executor.set_roma(&RomaMaps::new(&self.cascades, levels, frame, pass, (*sample, *seed)))?;
        self.made = Some((grid, role, levels));
        Ok(Some(Step::RomaRotate))
    }

    /// The base maps of `cells` on each axis around the present camera, and the frame; the same ones as long as nothing changes in them.
    ///
    /// # Errors
    /// A brick's occupancy that cannot be read.
    pub(super) fn base_maps(
        &mut self,
        scene: &Arc<SceneFile>,
        cells: u32,
    ) -> Result<Option<(Arc<Cascades>, Frame)>, ExecutorError> {
        self.assemble(scene, cells)?;
        Ok(self.view.as_ref().map(|view| (self.cascades.clone(), view.frame)))
    }

    /// The base maps around the camera of `size` cells on each axis.
    ///
    /// # Errors
    /// Occupancy that cannot be read.
    pub fn assemble(&mut self, scene: &Arc<SceneFile>, size: u32) -> Result<&Arc<Cascades>, ExecutorError> {
        let Some(RomaView { camera, .. }) = &self.view else { return Ok(&self.cascades) };
        let failed = |error: BomError| ExecutorError::Device(format!("got no occupancy maps: {error}"));
        // Scales may have changed.
        let is_as_fine = !self.has_moved || usual_cell_log2(scene.resident()) == self.finest_log2;
        self.has_moved = false;
        let (cells, mut assembler) = match self.assembler.take() {
            Some((cells, assembler)) if cells == size && is_as_fine => (cells, assembler),
            _ => {
                self.is_assembled = false;
                let finest_log2 = usual_cell_log2(scene.resident());
                self.finest_log2 = finest_log2;
                let settings = Settings { cells: size, finest_log2, levels: MOST_LEVELS, ..Settings::default() };
                (size, Assembler::new(scene.clone(), settings).map_err(failed)?)
            }
        };
        if !self.is_assembled {
            assembler.advance(scene.resident(), *camera).map_err(failed)?;
            if *self.cascades != *assembler.cascades() {
                self.cascades = Arc::new(assembler.cascades().clone());
            }
            self.is_assembled = true;
        }
        self.assembler = Some((cells, assembler));
        Ok(&self.cascades)
    }

    /// Side of the cells of the finest maps that were made, world units.
    pub fn finest_cell(&self) -> Option<f64> {
        self.cascades.levels.first().map(|bom| f64::from(bom.cell_log2).exp2())
    }
}
