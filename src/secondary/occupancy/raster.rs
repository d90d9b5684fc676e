//! Base maps as the paper makes them: from all triangles, rasterised along three axes, moved by up to half a cell at
//! random (Zeng et al., ROMA, §4.1 and §4.3). Thinner than those that bricks carry, and with holes.

use super::{Bom, BomError, Cascades, Voxelisation, voxelise};
use crate::frame::triangles::{placed, triangles};
use crate::math::sampling::random4;
use bricks::{Leaf, SceneFile};
use glam::DVec3;
use rayon::prelude::*;

/// Most triangles of a scene that are held, 288 MB: those of instances once.
const MOST_TRIANGLES: u64 = 4_000_000;

/// What is drawn for base maps takes random numbers of its own.
const STREAM: u32 = 10 << 24;

/// The triangles of all bricks, object units.
pub(crate) struct Raster {
    bricks: Vec<Vec<[DVec3; 3]>>,
}

impl Raster {
    /// Reads them.
    ///
    /// # Errors
    /// A scene with too many; a brick that cannot be read.
    pub fn new(file: &SceneFile) -> Result<Self, BomError> {
        let resident = file.resident();
        let count = resident.bricks.iter().map(|brick| u64::from(brick.triangle_count)).sum();
        if count > MOST_TRIANGLES {
            return Err(BomError::TooManyTriangles { path: file.path().into(), count, most: MOST_TRIANGLES });
        }
        let bricks = (0..resident.bricks.len() as u32).into_par_iter();
        let corners = bricks.map(|brick| triangles(file, brick).map(|read| read.corners));
        Ok(Self { bricks: corners.collect::<Result<_, bricks::Error>>()? })
    }

    /// Maps where those of `like` lie, of a sample of a seed.
    pub fn maps(&self, file: &SceneFile, like: &Cascades, sample: u32, seed: u32) -> Cascades {
        let level = |(level, bom): (u32, &Bom)| {
            let drawn = random4(level, sample.wrapping_add(STREAM), seed);
            let jitter = [0, 1, 2].map(|k| f64::from(drawn[k]) * 0.5f64.powi(32) - 0.5);
            let empty = || Bom::new(bom.cells(), bom.cell_log2, bom.first);
            let (leaves, exact) = (&file.resident().leaves, file.resident().exact_bricks());
            leaves
                .par_iter()
                .filter(|leaf| (leaf.brick as usize) < exact)
                .fold(empty, |mut map, leaf| {
                    voxelise(&mut map, self.of_leaf(file, leaf), Voxelisation::Raster { jitter });
                    map
                })
                .reduce(empty, |mut a, b| {
                    a.words_mut().iter_mut().zip(b.words()).for_each(|(a, b)| *a |= b);
                    a
                })
        };
        Cascades { levels: (0..).zip(&like.levels).map(level).collect() }
    }

    fn of_leaf<'a>(&'a self, file: &'a SceneFile, leaf: &Leaf) -> impl Iterator<Item = [[f64; 3]; 3]> + 'a {
        let place = &file.resident().instances[leaf.instance as usize];
        self.bricks[leaf.brick as usize].iter().map(move |corners| placed(place, corners).map(|p| p.to_array()))
    }
}
