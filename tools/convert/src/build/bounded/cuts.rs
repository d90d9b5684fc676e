//! Cuts objects within a budget: small ones together in memory, large ones on the scratch disk until their nodes fit.

use super::budget::{self, Budget};
use super::external::{self, Node, PackedItem};
use crate::build::cut::cuts::{ObjectCut, cut_object, extents};
use crate::build::cut::gather::{self, Gathered};
use crate::build::cut::partition::{self, Bounds, Rule};
use crate::build::disk::journal::{Journal, Step, WordReader, Words};
use crate::build::disk::scratch::Scratch;
use crate::build::disk::spill::Spill;
use crate::build::error::BuildError;
use crate::build::input::objects::{ObjectPlan, Part, Piece, Plan};
use crate::build::input::parts::Reader;
use crate::build::settings::BuildSettings;
use crate::progress::Progress;
use crate::source::PART_TRIANGLES;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;

/// Name of the file of slots by brick.
const ORDER: &str = "order";

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
    /// Who watches.
    pub progress: &'a Progress,
}

/// The cuts of all objects.
pub(crate) struct BoundedCuts {
    /// By object, without their orders.
    pub objects: Vec<ObjectCut>,
    /// The orders one after the other.
    pub order: Spill<u32>,
    /// Which materials are used, a bit each.
    pub materials: Vec<u64>,
}

/// What was cut so far.
struct Found {
    cuts: BoundedCuts,
    /// Bricks of the object at hand.
    bricks: Vec<u32>,
    /// Canonical extents of the object at hand.
    chunks: Vec<f64>,
    /// Files that were named.
    files: u64,
}

impl Bounded<'_> {
    /// Cuts all objects.
    pub fn cut(&self, journal: &mut Journal) -> Result<BoundedCuts, BuildError> {
        budget::give_back();
        let slots = |object: &ObjectPlan| u64::from(object.slots);
        self.progress.phase("partition", self.plan.objects.iter().map(slots).sum());
        let order = self.scratch.spill(ORDER, 0);
        let materials = Gathered::nothing(self.reader.outline().materials.len()).materials;
        let cuts = BoundedCuts { objects: Vec::with_capacity(self.plan.objects.len()), order, materials };
        let mut found = Found { cuts, bricks: Vec::new(), chunks: Vec::new(), files: 0 };
        let mut first = 0;
        while let Some(object) = self.plan.objects.get(first) {
            if slots(object) > self.budget.items {
                self.cut_large(object, &mut found, journal)?;
                first += 1;
                continue;
            }
            let mut sum = 0;
            let fits = |object: &&ObjectPlan| {
                sum += slots(object);
                sum <= self.budget.items
            };
            let end = first + self.plan.objects[first..].iter().take_while(fits).count();
            self.cut_small(first..end, &mut found, journal)?;
            first = end;
        }
        Ok(found.cuts)
    }

    /// Cuts objects that fit in memory together.
    fn cut_small(&self, objects: Range<usize>, found: &mut Found, journal: &mut Journal) -> Result<(), BuildError> {
        let objects = &self.plan.objects[objects];
        let cuts = &mut found.cuts;
        let words = journal.step(Step::Objects, || {
            let cut = |object: &ObjectPlan| cut_object(self.reader, object, self.settings, self.progress);
            let results: Vec<_> = objects.par_iter().map(cut).collect();
            let mut words = Words::default();
            for result in results {
                let (cut, gathered) = result?;
                cuts.order.append_all(&cut.order)?;
                put_cut(&mut words, &cut.bricks, &cut.extents.chunks);
                put_gathered(&mut words, &gathered);
            }
            words.put(cuts.order.length());
            Ok(words.0)
        })?;
        let mut words = WordReader(&words);
        for object in objects {
            let read = take_cut(&mut words).zip(take_gathered(&mut words));
            let ((bricks, chunks), gathered) = read.ok_or_else(|| journal.damaged())?;
            found.cuts.push(object, bricks, chunks, &gathered);
        }
        let length = words.take().ok_or_else(|| journal.damaged())?;
        found.cuts.order = self.scratch.spill(ORDER, length);
        Ok(())
    }

    /// Cuts an object that does not fit in memory.
    fn cut_large(&self, object: &ObjectPlan, found: &mut Found, journal: &mut Journal) -> Result<(), BuildError> {
        let rule = Rule { limit: self.settings.brick_triangles as usize, is_object: true };
        let number = found.next_file();
        let words = journal.step(Step::Gather, || {
            let items = self.items(number, 0);
            let gathered = self.gather(object, &items)?;
            let mut words = Words::default();
            put_gathered(words.put(items.length()), &gathered);
            Ok(words.0)
        })?;
        let mut words = WordReader(&words);
        let read = words.take().zip(take_gathered(&mut words));
        let (length, gathered) = read.ok_or_else(|| journal.damaged())?;
        let root = Node { number, length, count: gathered.stored, centroids: gathered.centroids };
        let large = self.cut_tree(root, rule, found, journal)?;
        if large.count > 0 {
            self.cut_tree(large, rule.of_large(), found, journal)?;
        }
        let (bricks, chunks) = (std::mem::take(&mut found.bricks), std::mem::take(&mut found.chunks));
        found.cuts.push(object, bricks, chunks, &gathered);
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

    fn items(&self, number: u64, length: u64) -> Spill<PackedItem> {
        self.scratch.spill(&format!("items-{number}"), length)
    }

    /// Appends the items of an object to a file.
    fn gather(&self, object: &ObjectPlan, items: &Spill<PackedItem>) -> Result<Gathered, BuildError> {
        let gather = |run: &Vec<_>| {
            let (found, gathered) = gather::gather(self.reader, run, self.settings.drop_non_finite, self.progress)?;
            external::append(&found, items)?;
            Ok(gathered)
        };
        let runs = object.runs(PART_TRIANGLES);
        let results: Vec<Result<Gathered, BuildError>> = runs.par_iter().with_max_len(1).map(gather).collect();
        let mut all = Gathered::nothing(self.reader.outline().materials.len());
        for result in results {
            all.add(&result?);
        }
        Ok(all)
    }

    /// Cuts the items below a node. Returns those that are too large for their parts, if the rule asks for that.
    fn cut_tree(&self, root: Node, rule: Rule, found: &mut Found, journal: &mut Journal) -> Result<Node, BuildError> {
        let mut large = Node { number: found.next_file(), length: 0, count: 0, centroids: Bounds::EMPTY };
        let mut stack = vec![root];
        while let Some(node) = stack.pop() {
            self.progress.check()?;
            if node.count > self.budget.items {
                // The left side is cut first.
                let [left, right] = self.split(&node, found, journal)?;
                stack.extend([right, left]);
            } else {
                large = self.cut_node(&node, rule, large, found, journal)?;
            }
            self.items(node.number, 0).remove();
        }
        Ok(large)
    }

    fn split(&self, node: &Node, found: &mut Found, journal: &mut Journal) -> Result<[Node; 2], BuildError> {
        let numbers = [found.next_file(), found.next_file()];
        let words = journal.step(Step::Split, || {
            let to = numbers.map(|number| self.items(number, 0));
            let sides = external::split(node, &self.items(node.number, node.length), [&to[0], &to[1]])?;
            let mut words = Words::default();
            for ((count, centroids), to) in sides.into_iter().zip(&to) {
                words.put(count).put(to.length()).put_point(centroids.min).put_point(centroids.max);
            }
            Ok(words.0)
        })?;
        let mut words = WordReader(&words);
        let mut side = |number| {
            let (count, length) = (words.take()?, words.take()?);
            let centroids = Bounds { min: words.take_point()?, max: words.take_point()? };
            Some(Node { number, length, count, centroids })
        };
        let sides = side(numbers[0]).zip(side(numbers[1]));
        sides.map(|(left, right)| [left, right]).ok_or_else(|| journal.damaged())
    }

    /// Cuts a node that fits in memory; adds to the large items.
    fn cut_node(
        &self,
        node: &Node,
        rule: Rule,
        large: Node,
        found: &mut Found,
        journal: &mut Journal,
    ) -> Result<Node, BuildError> {
        let words = journal.step(Step::Cut, || {
            budget::give_back();
            let mut items = external::load(&self.items(node.number, node.length))?;
            let cuts = partition::cut(&mut items, rule);
            drop(items);
            found.cuts.order.append_all(&cuts.order)?;
            let spill = self.items(large.number, large.length);
            external::append(&cuts.large, &spill)?;
            let mut words = Words::default();
            let centroids = large.centroids.union(partition::bounds(&cuts.large).1);
            words.put(found.cuts.order.length()).put(spill.length()).put(large.count + cuts.large.len() as u64);
            words.put_point(centroids.min).put_point(centroids.max);
            put_cut(&mut words, &cuts.parts, &cuts.extents);
            Ok(words.0)
        })?;
        let mut words = WordReader(&words);
        let mut read = || {
            let (order, length, count) = (words.take()?, words.take()?, words.take()?);
            let centroids = Bounds { min: words.take_point()?, max: words.take_point()? };
            Some((order, Node { length, count, centroids, ..large }, take_cut(&mut words)?))
        };
        let (order, large, (bricks, chunks)) = read().ok_or_else(|| journal.damaged())?;
        found.cuts.order = self.scratch.spill(ORDER, order);
        found.bricks.extend(bricks);
        found.chunks.extend(chunks);
        Ok(large)
    }
}

impl BoundedCuts {
    fn push(&mut self, object: &ObjectPlan, bricks: Vec<u32>, chunks: Vec<f64>, gathered: &Gathered) {
        self.materials.iter_mut().zip(&gathered.materials).for_each(|(own, other)| *own |= other);
        self.objects.push(ObjectCut {
            order: Vec::new(),
            bricks,
            extents: extents(object, chunks, &gathered.bounds),
            zero_area: gathered.zero_area,
            non_finite: gathered.non_finite,
        });
    }
}

impl Found {
    fn next_file(&mut self) -> u64 {
        self.files += 1;
        self.files
    }
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
