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

/// What was read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Reads {
    pub maps: u64,
    /// Bytes in the file.
    pub bytes: u64,
}

impl Maps {
    /// Of `file`, of which no more than `budget_bytes` are held.
    pub fn new(file: Arc<SceneFile>, budget_bytes: u64) -> Self {
        let most = usize::try_from(budget_bytes / OCCUPANCY_BYTES as u64).unwrap_or(usize::MAX);
        Self { file, held: lru::LruCache::unbounded(), most }
    }

    /// Whether a brick's map is held.
    pub fn holds(&self, brick: u32) -> bool {
        self.held.contains(&brick)
    }

    /// The maps of bricks, which need not fit into the budget together. Of those that do not, the last are held.
    ///
    /// # Errors
    /// A damaged file.
    pub fn get(&mut self, bricks: &[u32]) -> Result<(Vec<Arc<OccupancyMap>>, Reads), Error> {
        let missing: Vec<u32> = bricks.iter().copied().filter(|&brick| !self.holds(brick)).collect();
        let read: Vec<OccupancyMap> =
            missing.par_iter().map(|&brick| self.file.occupancy(brick)).collect::<Result<_, _>>()?;
        let bytes = missing.iter().map(|&brick| self.file.span(Payload::Proxies(brick)).bytes).sum();
        let mut reads = Reads { maps: read.len() as u64, bytes };
        let mut read = missing.into_iter().zip(read).peekable();
        let mut maps = Vec::with_capacity(bricks.len());
        for &brick in bricks {
            let map = match read.next_if(|(missing, _)| *missing == brick) {
                Some((_, map)) => Arc::new(map),
                // One that the bricks before put out is read again.
                None => match self.held.get(&brick) {
                    Some(map) => map.clone(),
                    None => {
                        reads.maps += 1;
                        reads.bytes += self.file.span(Payload::Proxies(brick)).bytes;
                        Arc::new(self.file.occupancy(brick)?)
                    }
                },
            };
            self.held.put(brick, map.clone());
            while self.held.len() > self.most {
                self.held.pop_lru();
            }
            maps.push(map);
        }
        Ok((maps, reads))
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
                let (found, _) = maps.get(&all).unwrap();
                assert!(found.iter().zip(&all).all(|(map, &brick)| **map == file.occupancy(brick).unwrap()));
                assert_eq!(maps.held.len(), held);
            }
            assert_eq!(maps.holds(count - 1), held > 0);
            let (_, reads) = maps.get(&[count - 1]).unwrap();
            assert_eq!((reads.maps == 0, reads.bytes == 0), (held > 0, held > 0));
        }
    }
}
