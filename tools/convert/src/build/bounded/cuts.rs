//! Cuts objects within a budget: small ones together in memory, large ones on the scratch disk until their nodes fit.

use super::budget::{self, Budget};
use super::external::{self, Node};
use crate::build::crew::{Hands, Tasks};
use crate::build::cut::cuts::{ObjectCut, cut_object, extents};
use crate::build::cut::gather::{self, Gathered};
use crate::build::cut::partition::{self, Bounds, Rule};
use crate::build::disk::journal::{Journal, Step, WordReader, Words};
use crate::build::disk::scratch::Scratch;
use crate::build::error::BuildError;
use crate::build::input::objects::{ObjectPlan, Part, Piece, Plan};
use crate::build::input::parts::Reader;
use crate::build::settings::BuildSettings;
use crate::progress::Progress;
use crate::source::PART_TRIANGLES;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;

/// A conversion within a budget.
pub(crate) struct Bounded<'a> {
    /// Gives the geometry.
    pub reader: &'a Reader<'a>,
    /// What is built.
    pub plan: &'a Plan<'a>,
    /// How.
    pub settings: &'a BuildSettings,
    /// Within what.
    pub budget: Budget,
    /// Where.
    pub scratch: &'a Scratch,
    /// By whom.
    pub hands: Hands<'a>,
    /// Who watches.
    pub progress: &'a Progress,
}

/// The cuts of all objects.
pub(crate) struct BoundedCuts {
    /// By object, without their orders.
    pub objects: Vec<ObjectCut>,
    /// Shards of the orders, one after the other.
    pub order: Vec<String>,
    /// Which materials are used, a bit each.
    pub materials: Vec<u64>,
    /// Whether something that was read for them was repaired.
    pub is_repaired: bool,
}

/// What was cut so far.
#[derive(Default)]
pub(super) struct Found {
    /// By object.
    objects: BTreeMap<usize, ObjectCut>,
    /// Shards of orders, by the first object in them.
    order: BTreeMap<usize, Vec<String>>,
    /// Which materials are used, a bit each.
    materials: Vec<u64>,
    is_repaired: bool,
    /// Shards that were named.
    names: u64,
}

/// What was cut so far of a large object.
#[derive(Default)]
struct Pieces {
    bricks: Vec<u32>,
    /// Canonical extents.
    chunks: Vec<f64>,
    /// Shards of slots by brick.
    order: Vec<String>,
}

impl Bounded<'_> {
    /// Cuts all objects: first the small ones, several at a time, then the large ones.
    pub fn cut(&self, journal: &mut Journal) -> Result<BoundedCuts, BuildError> {
        budget::give_back();
        self.progress.phase("partition", self.plan.objects.iter().map(slots).sum());
        let materials = Gathered::nothing(self.reader.outline().materials.len()).materials;
        let mut found = Found { materials, ..Found::default() };
        let small = self.small();
        for some in small.chunks(self.hands.at_once(small.len())) {
            self.cut_small(some, &mut found, journal)?;
        }
        for (index, object) in self.plan.objects.iter().enumerate() {
            if slots(object) > self.budget.items {
                self.cut_large(index, &mut found, journal)?;
            }
        }
        Ok(BoundedCuts {
            objects: found.objects.into_values().collect(),
            order: found.order.into_values().flatten().collect(),
            materials: found.materials,
            is_repaired: found.is_repaired,
        })
    }

    /// Objects next to each other that fit in memory together.
    fn small(&self) -> Vec<Range<usize>> {
        let objects = &self.plan.objects;
        let (mut small, mut first) = (Vec::new(), 0);
        while first < objects.len() {
            let mut sum = 0;
            let fits = |object: &&ObjectPlan| {
                sum += slots(object);
                sum <= self.budget.items
            };
            let count = objects[first..].iter().take_while(fits).count();
            if count > 0 {
                small.push(first..first + count);
            }
            first += count.max(1);
        }
        small
    }

    /// Cuts groups of objects, each of which fits in memory.
    fn cut_small(&self, groups: &[Range<usize>], found: &mut Found, journal: &mut Journal) -> Result<(), BuildError> {
        let names: Vec<String> = groups.iter().map(|_| found.next("order")).collect();
        let words = journal.shared_step(Step::Objects, |position| {
            let mut words = Words::default();
            let tasks = Tasks {
                step: Step::Objects,
                position,
                count: groups.len(),
                shards: &|task| vec![names[task].clone()],
                work: &|task| self.cut_group(&groups[task], &names[task]),
            };
            self.hands.perform(self.scratch, &tasks, &mut |task| {
                self.note(self.plan.objects[groups[task].clone()].iter().map(slots).sum());
                words.0.extend(self.scratch.shard(&names[task])?.facts());
                Ok(())
            })?;
            Ok(words.0)
        })?;
        let mut words = WordReader(&words);
        for (group, name) in groups.iter().zip(names) {
            for index in group.clone() {
                let read = take_cut(&mut words).zip(take_gathered(&mut words));
                let ((bricks, chunks), gathered) = read.ok_or_else(|| journal.damaged())?;
                let pieces = Pieces { bricks, chunks, order: Vec::new() };
                found.push(index, &self.plan.objects[index], pieces, &gathered);
            }
            found.order.insert(group.start, vec![name]);
            found.is_repaired |= words.take().ok_or_else(|| journal.damaged())? != 0;
        }
        Ok(())
    }

    /// Cuts objects that fit in memory together into the shard `name` of their orders.
    fn cut_group(&self, objects: &Range<usize>, name: &str) -> Result<(), BuildError> {
        let objects = &self.plan.objects[objects.clone()];
        let cut = |object: &ObjectPlan| cut_object(self.reader, object, self.settings, self.progress);
        let results: Vec<_> = objects.par_iter().map(cut).collect();
        let (shard, mut words) = (self.scratch.write(name)?, Words::default());
        for result in results {
            let (cut, gathered) = result?;
            shard.append_all(0, &cut.order)?;
            put_cut(&mut words, &cut.bricks, &cut.extents.chunks);
            put_gathered(&mut words, &gathered);
        }
        words.put(self.has_repairs());
        self.scratch.finish(shard, &words.0)
    }

    /// Cuts an object that does not fit in memory.
    fn cut_large(&self, index: usize, found: &mut Found, journal: &mut Journal) -> Result<(), BuildError> {
        let object = &self.plan.objects[index];
        let rule = Rule { limit: self.settings.brick_triangles as usize, is_object: true };
        let (root, gathered) = self.gather(object, found, journal)?;
        let mut pieces = Pieces::default();
        let large = self.cut_tree(root, rule, found, &mut pieces, journal)?;
        if large.count > 0 {
            self.cut_tree(large, rule.of_large(), found, &mut pieces, journal)?;
        }
        found.order.insert(index, std::mem::take(&mut pieces.order));
        found.push(index, object, pieces, &gathered);
        Ok(())
    }

    /// Reads all parts, for what the source tells of them.
    pub fn read_all(&self) -> Result<(), BuildError> {
        let parts = self.plan.objects.iter().flat_map(|object| &object.parts);
        let distinct: BTreeMap<(u32, u32), &Part> = parts.map(|part| ((part.mesh, part.part), part)).collect();
        let distinct: Vec<&Part> = distinct.into_values().collect();
        distinct.par_iter().with_max_len(1).try_for_each(|part| {
            self.progress.check()?;
            self.reader.get(&Piece { part, first: 0, end: part.triangles }).map(drop)
        })
    }

    /// Whether this process has read something that was repaired.
    fn has_repairs(&self) -> u64 {
        u64::from(!self.reader.repairs().is_empty())
    }

    /// Notes so many steps that another process did.
    pub fn note(&self, steps: u64) {
        if self.hands.are_many() {
            self.progress.advance(steps);
        }
    }

    /// Collects the items of an object.
    fn gather(
        &self,
        object: &ObjectPlan,
        found: &mut Found,
        journal: &mut Journal,
    ) -> Result<(Node, Gathered), BuildError> {
        let runs = object.runs(PART_TRIANGLES);
        let groups: Vec<&[Vec<Piece>]> = runs.chunks(self.hands.runs_per_task(runs.len())).collect();
        let names: Vec<String> = groups.iter().map(|_| found.next("items")).collect();
        let words = journal.shared_step(Step::Gather, |position| {
            let (mut all, mut is_repaired) = (Gathered::nothing(self.reader.outline().materials.len()), 0);
            let tasks = Tasks {
                step: Step::Gather,
                position,
                count: groups.len(),
                shards: &|task| vec![names[task].clone()],
                work: &|task| self.gather_runs(groups[task], &names[task]),
            };
            self.hands.perform(self.scratch, &tasks, &mut |task| {
                let shard = self.scratch.shard(&names[task])?;
                let mut facts = WordReader(shard.facts());
                let read = take_gathered(&mut facts).zip(facts.take());
                let (gathered, repaired) = read.ok_or_else(|| shard.damaged())?;
                all.add(&gathered);
                is_repaired |= repaired;
                self.note(groups[task].iter().flatten().map(|piece| u64::from(piece.end - piece.first)).sum());
                Ok(())
            })?;
            let mut words = Words::default();
            put_gathered(&mut words, &all);
            words.put(is_repaired);
            Ok(words.0)
        })?;
        let mut words = WordReader(&words);
        let read = take_gathered(&mut words).zip(words.take());
        let (gathered, is_repaired) = read.ok_or_else(|| journal.damaged())?;
        found.is_repaired |= is_repaired != 0;
        Ok((Node { shards: names, count: gathered.stored, centroids: gathered.centroids }, gathered))
    }

    /// Collects the items of runs into the shard `name`.
    fn gather_runs(&self, runs: &[Vec<Piece>], name: &str) -> Result<(), BuildError> {
        let shard = self.scratch.write(name)?;
        let gather = |run: &Vec<_>| {
            let (found, gathered) = gather::gather(self.reader, run, self.settings.drop_non_finite, self.progress)?;
            external::append(&found, &shard)?;
            Ok(gathered)
        };
        let results: Vec<Result<Gathered, BuildError>> = runs.par_iter().with_max_len(1).map(gather).collect();
        let mut all = Gathered::nothing(self.reader.outline().materials.len());
        for result in results {
            all.add(&result?);
        }
        let mut words = Words::default();
        put_gathered(&mut words, &all);
        words.put(self.has_repairs());
        self.scratch.finish(shard, &words.0)
    }

    /// Cuts the items below a node. Returns those that are too large for their parts, if the rule asks for that.
    fn cut_tree(
        &self,
        root: Node,
        rule: Rule,
        found: &mut Found,
        pieces: &mut Pieces,
        journal: &mut Journal,
    ) -> Result<Node, BuildError> {
        let mut leaves = vec![root];
        let is_large = |node: &&Node| node.count > self.budget.items;
        while leaves.iter().any(|node| is_large(&node)) {
            let nodes: Vec<&Node> = leaves.iter().filter(is_large).collect();
            let mut sides = Vec::with_capacity(nodes.len());
            for some in nodes.chunks(self.hands.at_once(nodes.len())) {
                self.progress.check()?;
                sides.extend(self.split(some, found, journal)?);
                some.iter().for_each(|node| self.discard(node));
            }
            let mut sides = sides.into_iter();
            // Sides take the place of their node, the left one first.
            let replace = |node: Node| match is_large(&&node) {
                true => sides.next().map_or_else(Vec::new, |[left, right]| vec![left, right]),
                false => vec![node],
            };
            leaves = leaves.into_iter().flat_map(replace).collect();
        }
        let mut large = Node { shards: Vec::new(), count: 0, centroids: Bounds::EMPTY };
        for some in leaves.chunks(self.hands.at_once(leaves.len())) {
            self.progress.check()?;
            self.cut_nodes(some, rule, &mut large, (found, pieces), journal)?;
            some.iter().for_each(|node| self.discard(node));
        }
        Ok(large)
    }

    /// Removes the items of a node that are not needed any more.
    fn discard(&self, node: &Node) {
        if !self.hands.is_task() {
            self.scratch.remove(&node.shards);
        }
    }

    /// Cuts nodes that fit in memory; adds to the large items.
    fn cut_nodes(
        &self,
        nodes: &[Node],
        rule: Rule,
        large: &mut Node,
        (found, pieces): (&mut Found, &mut Pieces),
        journal: &mut Journal,
    ) -> Result<(), BuildError> {
        let names: Vec<[String; 2]> = nodes.iter().map(|_| [found.next("order"), found.next("large")]).collect();
        let words = journal.shared_step(Step::Cut, |position| {
            let mut words = Words::default();
            let tasks = Tasks {
                step: Step::Cut,
                position,
                count: nodes.len(),
                shards: &|task| names[task].to_vec(),
                work: &|task| self.cut_node(&nodes[task], rule, &names[task]),
            };
            self.hands.perform(self.scratch, &tasks, &mut |task| {
                words.0.extend(self.scratch.shard(&names[task][0])?.facts());
                Ok(())
            })?;
            Ok(words.0)
        })?;
        let mut words = WordReader(&words);
        for [order, large_items] in names {
            let mut read = || {
                let count = words.take()?;
                let centroids = Bounds { min: words.take_point()?, max: words.take_point()? };
                Some((count, centroids, take_cut(&mut words)?))
            };
            let (count, centroids, (bricks, chunks)) = read().ok_or_else(|| journal.damaged())?;
            large.shards.push(large_items);
            large.count += count;
            large.centroids = large.centroids.union(centroids);
            pieces.order.push(order);
            pieces.bricks.extend(bricks);
            pieces.chunks.extend(chunks);
        }
        Ok(())
    }

    /// Cuts a node that fits in memory into two shards: its order and its large items.
    fn cut_node(&self, node: &Node, rule: Rule, [order, large]: &[String; 2]) -> Result<(), BuildError> {
        budget::give_back();
        let mut items = external::load(&self.scratch.blocks(&node.shards)?)?;
        if items.len() as u64 != node.count {
            return Err(self.scratch.damaged(node.shards.first().map_or("", String::as_str)));
        }
        let cuts = partition::cut(&mut items, rule);
        drop(items);
        let shard = self.scratch.write(large)?;
        external::append(&cuts.large, &shard)?;
        self.scratch.finish(shard, &[])?;
        let shard = self.scratch.write(order)?;
        shard.append_all(0, &cuts.order)?;
        let mut words = Words::default();
        let centroids = partition::bounds(&cuts.large).1;
        words.put(cuts.large.len() as u64).put_point(centroids.min).put_point(centroids.max);
        put_cut(&mut words, &cuts.parts, &cuts.extents);
        self.scratch.finish(shard, &words.0)
    }
}

impl Found {
    fn push(&mut self, index: usize, object: &ObjectPlan, pieces: Pieces, gathered: &Gathered) {
        self.materials.iter_mut().zip(&gathered.materials).for_each(|(own, other)| *own |= other);
        let cut = ObjectCut {
            order: Vec::new(),
            bricks: pieces.bricks,
            extents: extents(object, pieces.chunks, &gathered.bounds),
            zero_area: gathered.zero_area,
            non_finite: gathered.non_finite,
        };
        self.objects.insert(index, cut);
    }

    /// A name for a shard of a kind.
    pub fn next(&mut self, kind: &str) -> String {
        self.names += 1;
        format!("{kind}-{}", self.names)
    }
}

fn slots(object: &ObjectPlan) -> u64 {
    u64::from(object.slots)
}

fn put_cut(words: &mut Words, bricks: &[u32], chunks: &[f64]) {
    words.put_records(bricks).put_all(chunks.iter().map(|extent| extent.to_bits()));
}

fn take_cut(words: &mut WordReader) -> Option<(Vec<u32>, Vec<f64>)> {
    Some((words.take_records()?, words.take_all()?.into_iter().map(f64::from_bits).collect()))
}

fn put_gathered(words: &mut Words, gathered: &Gathered) {
    let Gathered { bounds, centroids, stored, zero_area, non_finite, materials } = gathered;
    words.put_point(bounds.min).put_point(bounds.max).put_point(centroids.min).put_point(centroids.max);
    words.put(*stored).put(u64::from(*zero_area)).put(u64::from(*non_finite)).put_all(materials.iter().copied());
}

fn take_gathered(words: &mut WordReader) -> Option<Gathered> {
    let bounds = Bounds { min: words.take_point()?, max: words.take_point()? };
    let centroids = Bounds { min: words.take_point()?, max: words.take_point()? };
    let (stored, zero_area, non_finite) = (words.take()?, words.take()? as u32, words.take()? as u32);
    Some(Gathered { bounds, centroids, stored, zero_area, non_finite, materials: words.take_all()? })
}
