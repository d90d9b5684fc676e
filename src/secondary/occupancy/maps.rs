//! The 64³ maps of bricks, read when they are asked for, within a budget.

use bricks::{Error, OCCUPANCY_BYTES, OccupancyMap, Payload, SceneFile};
use rayon::prelude::*;
use std::sync::Arc;

/// Maps that were read, the least recently used out first.
pub(crate) struct Maps {
    file: Arc<SceneFile>,
    held: lru::LruCache<u32, Arc<OccupancyMap>>,
    /// Most maps held.
    most: usize,
}

impl Maps {
    /// Of `file`, of which no more than `budget_bytes` are held.
    pub fn new(file: Arc<SceneFile>, budget_bytes: u64) -> Self {
        let most = usize::try_from(budget_bytes / OCCUPANCY_BYTES as u64).unwrap_or(usize::MAX);
        Self { file, held: lru::LruCache::unbounded(), most }
    }

    /// The maps of bricks, which need not fit into the budget together. Of those that do not, the last are held.
    ///
    /// # Errors
    /// A damaged file.
    pub fn get(&mut self, bricks: &[u32]) -> Result<Vec<Arc<OccupancyMap>>, Error> {
        let map = |brick: &u32| match self.held.peek(brick) {
            Some(map) => Ok(map.clone()),
            None => self.file.occupancy(*brick).map(Arc::new),
        };
        let missing = bricks.iter().filter(|brick| !self.held.contains(brick));
        self.file.announce(missing.map(|&brick| Payload::Proxies(brick)));
        let maps: Vec<Arc<OccupancyMap>> = bricks.par_iter().map(map).collect::<Result<_, _>>()?;
        for (&brick, map) in bricks.iter().zip(&maps) {
            self.held.put(brick, map.clone());
            while self.held.len() > self.most {
                self.held.pop_lru();
            }
        }
        Ok(maps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use brickwalk_convert::build::{BuildSettings, build};
    use brickwalk_convert::progress::Progress;
    use brickwalk_scenes::{SoupKind, soup};

    #[test]
    fn maps_are_held_within_the_budget_and_are_the_files() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bricks");
        let settings = BuildSettings { brick_triangles: 64, ..BuildSettings::default() };
        build(soup(SoupKind::Uniform, 1000, 1), &settings, &path, &Progress::hidden()).unwrap();
        let file = Arc::new(SceneFile::open(&path).unwrap());
        let count = file.resident().bricks.len() as u32;
        assert!(count >= 8);
        let all: Vec<u32> = (0..count).collect();
        for (budget, held) in [(0, 0), (3, 3), (1000, count as usize)] {
            let mut maps = Maps::new(file.clone(), budget * OCCUPANCY_BYTES as u64);
            for _ in 0..2 {
                let found = maps.get(&all).unwrap();
                assert!(found.iter().zip(&all).all(|(map, &brick)| **map == file.occupancy(brick).unwrap()));
                assert_eq!(maps.held.len(), held);
            }
            assert_eq!(maps.held.contains(&(count - 1)), held > 0);
        }
    }
}
