//! Base occupancy maps around the camera: assembled for a frame, kept as long as nothing changes in them.

#[cfg(feature = "lab")]
use super::raster::Raster;
use super::{Assembler, Bom, BomError, Cascades, Settings, Source};
use crate::kernels::View;
use crate::kernels::frame::Frame;
use crate::schedule::ExecutorError;
use bricks::{Leaf, Resident, SceneFile};
use glam::DVec3;
use std::sync::Arc;

/// Most base maps: ray-aligned maps of 8 x 8 directions and 128 cells take 96 MiB then.
pub const MOST_LEVELS: u32 = 6;

/// The base maps of the present frame and sample.
#[derive(Default)]
pub struct BaseMaps {
    /// What makes the base maps, and for what.
    assembler: Option<(Wanted, Assembler)>,
    source: Source,
    /// The scene's triangles, if base maps are made of these.
    #[cfg(feature = "lab")]
    raster: Option<Raster>,
    cascades: Arc<Cascades>,
    view: Option<BaseView>,
    /// Whether the base maps are those of the present camera and of where instances are, and of the sample if they
    /// depend on it.
    is_assembled: bool,
    /// [`usual_cell_log2`] of the scene, once it is known.
    usual_log2: Option<Option<i32>>,
}

/// What base maps were wanted.
#[derive(Clone, Copy, PartialEq)]
struct Wanted {
    /// Cells on each axis that would be enough.
    size: u32,
    /// Those that there are, once or twice as many.
    cells: u32,
    /// See [`BaseMaps::usual_log2`].
    usual_log2: Option<i32>,
}

/// From where a sample of a frame is seen.
#[derive(Clone, Copy)]
pub struct BaseView {
    /// The frame.
    pub frame: Frame,
    /// The camera's position, world units.
    pub camera: DVec3,
    /// The sample.
    pub sample: u32,
    /// The frame's seed.
    pub seed: u32,
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

impl BaseMaps {
    /// What they are made of.
    pub fn source(&self) -> Source {
        self.source
    }

    /// Of `source`.
    pub fn new(source: Source) -> Self {
        Self { source, ..Self::default() }
    }

    /// Begins a sample of a frame seen from `camera`, a point of the world.
    pub fn begin(&mut self, camera: DVec3, view: &View) {
        let keeps = |before: &BaseView| before.camera == camera && self.source == Source::Bricks;
        self.is_assembled &= self.view.as_ref().is_some_and(keeps);
        let (sample, seed) = (view.params.sample, view.params.seed);
        self.view = Some(BaseView { frame: view.frame, camera, sample, seed });
    }

    /// From where the sample is seen that has begun.
    pub fn view(&self) -> Option<&BaseView> {
        self.view.as_ref()
    }

    /// Notes that instances have moved: maps are made anew where these were and are.
    pub fn scene_has_moved(&mut self) {
        self.is_assembled = false;
        // Scales may have changed.
        self.usual_log2 = None;
    }

    fn usual_log2(&mut self, scene: &SceneFile) -> Option<i32> {
        *self.usual_log2.get_or_insert_with(|| usual_cell_log2(scene.resident()))
    }

    /// Side of the cells that bricks have, world units: those of three in four are no larger. `None` where there are no
    /// bricks.
    pub fn brick_cell(&mut self, scene: &SceneFile) -> Option<f64> {
        self.usual_log2(scene).map(|cell_log2| f64::from(cell_log2).exp2())
    }

    /// The base maps around the camera, as wide as `size` cells would be of which bricks have all, of `cells` on each
    /// axis, once or twice as many.
    ///
    /// # Errors
    /// Occupancy that cannot be read.
    pub fn assemble(&mut self, scene: &Arc<SceneFile>, size: u32, cells: u32) -> Result<&Arc<Cascades>, ExecutorError> {
        let usual_log2 = self.usual_log2(scene);
        let Some(view) = &self.view else { return Ok(&self.cascades) };
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
            assembler.advance(scene.resident(), view.camera).map_err(failed)?;
            let made = assembler.cascades();
            match self.source {
                Source::Bricks if *self.cascades == *made => {}
                Source::Bricks => self.cascades = Arc::new(made.clone()),
                #[cfg(feature = "lab")]
                Source::Triangles => {
                    let raster = self.raster.take().map_or_else(|| Raster::new(scene), Ok).map_err(failed)?;
                    self.cascades = Arc::new(raster.maps(scene, made, view.sample, view.seed));
                    self.raster = Some(raster);
                }
            }
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
