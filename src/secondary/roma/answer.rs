//! Occlusion and shadow rays that occupancy maps answer: which maps, and when they are made.

use super::handover::Handover;
use super::maps::RomaMaps;
use super::{Grid, LEAST_CELLS, LIFT, LONG_CELLS, MOST_LEVELS, Role, RomaPass, RomaSettings};
use crate::kernels::frame::Frame;
use crate::kernels::{FrameExecutor, View};
use crate::schedule::{ExecutorError, Lamp, Pass, Step};
use crate::secondary::occupancy::raster::Raster;
use crate::secondary::occupancy::{Assembler, Bom, BomError, Cascades, Settings, Source};
use bricks::{Leaf, Resident, SceneFile};
use glam::DVec3;
use std::sync::Arc;

/// The occupancy maps of the present frame and sample.
#[derive(Default)]
pub struct Roma {
    /// What makes the base maps, and for what.
    assembler: Option<(Wanted, Assembler)>,
    source: Source,
    /// The scene's triangles, if base maps are made of these.
    raster: Option<Raster>,
    cascades: Arc<Cascades>,
    view: Option<RomaView>,
    /// Whether the base maps are those of the present camera and of where instances are, and of the sample if they
    /// depend on it.
    is_assembled: bool,
    /// [`usual_cell_log2`] of the scene, once it is known.
    usual_log2: Option<Option<i32>>,
    /// What was measured of the rays of ao, and of those from what is seen and from what that sees to lamps.
    handovers: [Handover; 3],
    /// The ray-aligned maps that the executor has of the present sample.
    made: Option<(Grid, Role, usize)>,
}

/// What base maps were wanted.
#[derive(Clone, Copy, PartialEq)]
struct Wanted {
    /// Cells on each axis that would be enough.
    size: u32,
    /// Those that there are, once or twice as many.
    cells: u32,
    /// See [`Roma::usual_log2`].
    usual_log2: Option<i32>,
}

struct RomaView {
    frame: Frame,
    camera: DVec3,
    sample: u32,
    seed: u32,
}

/// log2 of the side of cells, world units, than which those of three bricks in four are no larger. Finer base maps
/// would repeat cells of bricks, and rays would start within those: a street was dark around its trees.
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
    /// With base maps that are made of `source`.
    pub fn new(source: Source) -> Self {
        Self { source, ..Self::default() }
    }

    /// Begins a sample of a frame seen from `camera`, a point of the world.
    pub fn begin(&mut self, camera: DVec3, view: &View) {
        let keeps = |before: &RomaView| before.camera == camera && self.source == Source::Bricks;
        self.is_assembled &= self.view.as_ref().is_some_and(keeps);
        self.view = Some(RomaView { frame: view.frame, camera, sample: view.params.sample, seed: view.params.seed });
        self.made = None;
    }

    /// Notes that instances have moved: maps are made anew where these were and are.
    pub fn scene_has_moved(&mut self) {
        self.is_assembled = false;
        // Scales may have changed.
        self.usual_log2 = None;
    }

    /// What was measured of the rays of a pass that maps sift.
    pub fn handover(&mut self, pass: Pass) -> &mut Handover {
        let kind = match pass {
            Pass::Occlusion(_) => 0,
            Pass::BounceShadow(_) => 2,
            _ => 1,
        };
        &mut self.handovers[kind]
    }

    /// Of rays of ao, of those from what is seen to lamps, and of those from what that sees.
    pub fn handovers(&self) -> &[Handover; 3] {
        &self.handovers
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

    /// Has the executor take the maps of `pass` for rays that are `length` world units long at most, unless it has
    /// them; the step that then makes them. Levels are left out that such rays end in before they are off their
    /// surface.
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
        let cells = grid.base_cells();
        self.assemble(scene, grid.size, cells)?;
        let before = LIFT / grid.scale(cells);
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

    /// The base maps of `cells` on each axis around the present camera, and the frame; the same ones as long as nothing
    /// changes in them.
    ///
    /// # Errors
    /// A brick's occupancy that cannot be read.
    pub(crate) fn base_maps(
        &mut self,
        scene: &Arc<SceneFile>,
        cells: u32,
    ) -> Result<Option<(Arc<Cascades>, Frame)>, ExecutorError> {
        self.assemble(scene, cells, cells)?;
        Ok(self.view.as_ref().map(|view| (self.cascades.clone(), view.frame)))
    }

    fn usual_log2(&mut self, scene: &SceneFile) -> Option<i32> {
        *self.usual_log2.get_or_insert_with(|| usual_cell_log2(scene.resident()))
    }

    /// Side of the cells that bricks have, world units: those of three in four are no larger. `None` where there are no
    /// bricks.
    pub fn brick_cell(&mut self, scene: &SceneFile) -> Option<f64> {
        self.usual_log2(scene).map(|cell_log2| f64::from(cell_log2).exp2())
    }

    /// Whether rays of a length, world units, are too short for maps to help tracing them: what they meet is as near as
    /// what is overlooked.
    pub fn is_short(&mut self, scene: &SceneFile, length: f64) -> bool {
        self.brick_cell(scene).is_some_and(|cell| length < LEAST_CELLS * cell)
    }

    /// Whether rays of a length, world units, go so far that which way they go within a stratum counts for more than
    /// what cells add to things.
    pub fn is_long(&mut self, scene: &SceneFile, length: f64) -> bool {
        self.brick_cell(scene).is_some_and(|cell| length >= LONG_CELLS * cell)
    }

    /// The base maps around the camera, as wide as `size` cells would be of which bricks have all, of `cells` on each
    /// axis, once or twice as many.
    ///
    /// # Errors
    /// Occupancy that cannot be read.
    pub fn assemble(&mut self, scene: &Arc<SceneFile>, size: u32, cells: u32) -> Result<&Arc<Cascades>, ExecutorError> {
        let usual_log2 = self.usual_log2(scene);
        let Some(RomaView { camera, sample, seed, .. }) = &self.view else { return Ok(&self.cascades) };
        let failed = |error: BomError| ExecutorError::Device(format!("got no occupancy maps: {error}"));
        let wanted = Wanted { size, cells, usual_log2 };
        let mut assembler = match self.assembler.take() {
            Some((made, assembler)) if made == wanted => assembler,
            _ => {
                self.is_assembled = false;
                let halvings = (cells / size).ilog2() as i32;
                let finest_log2 = wanted.usual_log2.map(|usual| usual - halvings);
                let settings = Settings { cells, finest_log2, levels: MOST_LEVELS, ..Settings::default() };
                Assembler::new(scene.clone(), settings).map_err(failed)?
            }
        };
        if !self.is_assembled {
            assembler.advance(scene.resident(), *camera).map_err(failed)?;
            let raster = match (self.source, self.raster.take()) {
                (Source::Bricks, _) => None,
                (Source::Triangles, Some(raster)) => Some(raster),
                (Source::Triangles, None) => Some(Raster::new(scene).map_err(failed)?),
            };
            if let Some(raster) = &raster {
                self.cascades = Arc::new(raster.maps(scene, assembler.cascades(), *sample, *seed));
            } else if *self.cascades != *assembler.cascades() {
                self.cascades = Arc::new(assembler.cascades().clone());
            }
            self.raster = raster;
            self.is_assembled = true;
        }
        self.assembler = Some((wanted, assembler));
        Ok(&self.cascades)
    }

    /// The base maps that were made last, the finest first.
    pub fn levels(&self) -> &[Bom] {
        &self.cascades.levels
    }

    /// Side of the finest base map, world units, by the cells on each axis that it would have if they were bricks': of
    /// maps of twice as many, two of their cells.
    pub fn finest_cell(&self) -> Option<f64> {
        let per_cell = self.assembler.as_ref().map_or(1, |(made, _)| made.cells / made.size);
        self.cascades.levels.first().map(|bom| f64::from(bom.cell_log2).exp2() * f64::from(per_cell))
    }
}
