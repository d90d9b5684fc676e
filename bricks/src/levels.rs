//! Levels of detail: bricks that stand for others, and a top level over all of them.
//!
//! A level stands for up to four bricks or levels of its object, or of instances of other objects, its *children*. So
//! levels are inner nodes of trees whose leaves are the bricks. A ray descends such a tree as far as its cone asks for:
//! a function of the ray alone, so that pictures do not depend on what is resident.
//!
//! As a file is opened, its levels are beside the scene: nothing but [`Resident::payloads`] knows of them. With
//! [`Resident::use_levels`] they become bricks like others, behind those of the objects, and the top level becomes the
//! one over all of them.

use crate::records::{Brick, Leaf, NONE};
use crate::resident::Resident;
use bytemuck::{Pod, Zeroable};

/// Most children of a level.
pub const LEVEL_CHILDREN: usize = 4;

/// A level of detail. Lengths are in units of its object.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Level {
    /// What stands for the children: a brick like others, of the same object, without proxies. Its positions are on the
    /// object's lattice, and vertices of the children.
    pub brick: Brick,
    /// What it stands for, the first of them always there. `instance` is [`NONE`] where the child is placed as the level
    /// is, else an instance of another object; then the level is one of the world. `brick` is a brick, or the number of
    /// all bricks and the number of a level before this one, or [`NONE`]: no child.
    pub children: [Leaf; LEVEL_CHILDREN],
    /// What selection goes by: the distance that 99 % of what it stands for, by area, are away from it at most, the
    /// difference of colours weighed in, and half the largest of the children. At least that of any child.
    pub error: f64,
    /// The largest distance of any point of the bricks that it stands for to it, and of any point of it to them. At
    /// least that of any child.
    pub bound: f64,
    /// The largest difference of a linear colour channel between it and what it stands for, 0 to 1.
    pub color: f32,
    /// Zero.
    pub _reserved: u32,
}

impl Level {
    /// The children there are.
    pub fn children(&self) -> impl Iterator<Item = Leaf> + '_ {
        self.children.iter().copied().filter(|child| child.brick != NONE)
    }
}

impl Resident {
    /// Number of bricks of all objects, without levels.
    pub fn exact_bricks(&self) -> usize {
        self.objects.last().map_or(0, |object| (object.first_brick + object.brick_count) as usize)
    }

    /// Whether levels are bricks like others.
    pub fn has_levels_in_use(&self) -> bool {
        !self.levels.is_empty() && self.bricks.len() > self.exact_bricks()
    }

    /// The levels that are beside the scene.
    pub(crate) fn levels_beside(&self) -> &[Level] {
        if self.has_levels_in_use() { &[] } else { &self.levels }
    }

    /// A brick, or behind them a level, whether levels are in use or not.
    pub fn brick(&self, index: u32) -> Option<&Brick> {
        let level = || self.levels.get((index as usize).checked_sub(self.bricks.len())?);
        self.bricks.get(index as usize).or_else(|| level().map(|level| &level.brick))
    }

    /// Has levels be bricks like others, and the top level that over all of them. Nothing happens where there are none.
    pub fn use_levels(&mut self) {
        if self.levels.is_empty() || self.has_levels_in_use() {
            return;
        }
        self.bricks.extend(self.levels.iter().map(|level| level.brick));
        self.leaves = std::mem::take(&mut self.level_leaves);
        self.top2 = std::mem::take(&mut self.level_top2);
        self.top8 = std::mem::take(&mut self.level_top8);
    }

    /// For each leaf of the top level the leaf of the level that stands for it, or [`NONE`]; levels are in use.
    pub fn level_parents(&self) -> Vec<u32> {
        let first = self.exact_bricks() as u32;
        let mut places = std::collections::HashMap::with_capacity(self.leaves.len());
        for (index, leaf) in (0u32..).zip(&self.leaves) {
            places.insert((leaf.instance, leaf.brick), index);
        }
        let mut parents = vec![NONE; self.leaves.len()];
        for (index, leaf) in (0u32..).zip(&self.leaves) {
            let Some(level) = leaf.brick.checked_sub(first).and_then(|level| self.levels.get(level as usize)) else {
                continue;
            };
            for child in level.children() {
                let instance = if child.instance == NONE { leaf.instance } else { child.instance };
                if let Some(&place) = places.get(&(instance, child.brick)) {
                    parents[place as usize] = index;
                }
            }
        }
        parents
    }
}
