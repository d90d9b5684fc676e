//! Splits nodes that do not fit in memory: their items are counted, then written to either side.

use super::cuts::{Bounded, Found};
use super::external::{self, Node, Place};
use crate::build::crew::Tasks;
use crate::build::cut::partition::{Bins, Bounds};
use crate::build::disk::journal::{Journal, Step, WordReader, Words};
use crate::build::error::BuildError;

impl Bounded<'_> {
    /// Splits nodes that do not fit in memory.
    pub(super) fn split(
        &self,
        nodes: &[&Node],
        found: &mut Found,
        journal: &mut Journal,
    ) -> Result<Vec<[Node; 2]>, BuildError> {
        // Which shards of which node each task reads.
        let parts: Vec<(usize, &[String])> = (0..)
            .zip(nodes)
            .flat_map(|(index, node)| {
                let length = self.hands.parts_per_task(node.count, node.shards.len());
                node.shards.chunks(length).map(move |shards| (index, shards))
            })
            .collect();
        let places = self.count(nodes, &parts, found, journal)?;
        let names: Vec<[String; 2]> = parts.iter().map(|_| [found.next("items"), found.next("items")]).collect();
        let words = journal.shared_step(Step::Split, |position| {
            let mut words = Words::default();
            let tasks = Tasks {
                step: Step::Split,
                position,
                count: parts.len(),
                shards: &|task| names[task].to_vec(),
                work: &|task| self.separate(parts[task].1, &places[parts[task].0], &names[task]),
            };
            self.hands.perform(self.scratch, &tasks, &mut |task| {
                // The other side has been named before.
                self.scratch.shard(&names[task][1])?;
                words.0.extend(self.scratch.shard(&names[task][0])?.facts());
                Ok(())
            })?;
            Ok(words.0)
        })?;
        let mut words = WordReader(&words);
        let side = || Node { shards: Vec::new(), count: 0, centroids: Bounds::EMPTY };
        let mut sides: Vec<[Node; 2]> = nodes.iter().map(|_| [side(), side()]).collect();
        for ((index, _), names) in parts.iter().zip(names) {
            for (side, name) in sides[*index].iter_mut().zip(names) {
                let mut read = || Some((words.take()?, words.take_point()?, words.take_point()?));
                let (count, min, max) = read().ok_or_else(|| journal.damaged())?;
                side.shards.push(name);
                side.count += count;
                side.centroids = side.centroids.union(Bounds { min, max });
            }
        }
        let is_whole = |(node, [left, right]): (&&Node, &[Node; 2])| left.count + right.count == node.count;
        if nodes.iter().zip(&sides).all(is_whole) { Ok(sides) } else { Err(journal.damaged()) }
    }

    /// Where nodes are split.
    fn count(
        &self,
        nodes: &[&Node],
        parts: &[(usize, &[String])],
        found: &mut Found,
        journal: &mut Journal,
    ) -> Result<Vec<Place>, BuildError> {
        let names: Vec<String> = parts.iter().map(|_| found.next("counts")).collect();
        let words = journal.shared_step(Step::Count, |position| {
            let mut all: Vec<Bins> = nodes.iter().map(|node| Bins::new(&node.centroids)).collect();
            let tasks = Tasks {
                step: Step::Count,
                position,
                count: parts.len(),
                shards: &|task| vec![names[task].clone()],
                work: &|task| {
                    let (node, shards) = (nodes[parts[task].0], parts[task].1);
                    let mut words = Words::default();
                    external::count(node, &self.scratch.blocks(shards)?)?.put(&mut words);
                    self.scratch.finish(self.scratch.write(&names[task])?, &words.0)
                },
            };
            self.hands.perform(self.scratch, &tasks, &mut |task| {
                let index = parts[task].0;
                let shard = self.scratch.shard(&names[task])?;
                let bins = Bins::take(&mut WordReader(shard.facts()), &nodes[index].centroids);
                let empty = Bins::new(&nodes[index].centroids);
                let so_far = std::mem::replace(&mut all[index], empty);
                all[index] = so_far.merge(bins.ok_or_else(|| shard.damaged())?);
                Ok(())
            })?;
            let mut words = Words::default();
            for (node, bins) in nodes.iter().zip(&all) {
                external::place(node, bins, || self.scratch.blocks(&node.shards), &mut words)?;
            }
            self.scratch.remove(&names);
            Ok(words.0)
        })?;
        let mut words = WordReader(&words);
        let places = nodes.iter().map(|node| external::take_place(node, &mut words));
        places.collect::<Option<_>>().ok_or_else(|| journal.damaged())
    }

    /// Writes the items of shards that lie on either side of a place into a shard each.
    fn separate(&self, shards: &[String], place: &Place, names: &[String; 2]) -> Result<(), BuildError> {
        let to = [self.scratch.write(&names[0])?, self.scratch.write(&names[1])?];
        let sides = external::separate(&self.scratch.blocks(shards)?, [&to[0], &to[1]], place)?;
        let mut words = Words::default();
        for (count, centroids) in sides {
            words.put(count).put_point(centroids.min).put_point(centroids.max);
        }
        // The first shard goes last: what it says is of a task whose shards are all there.
        let [left, right] = to;
        self.scratch.finish(right, &[])?;
        self.scratch.finish(left, &words.0)
    }
}
