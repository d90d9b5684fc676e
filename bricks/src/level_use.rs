//! Levels of detail in a scene: beside its bricks as a file is opened, or in use as bricks like others.

use crate::levels::Level;
use crate::payload::Payload;
use crate::records::{Brick, Leaf, NONE};
use crate::resident::Resident;
use std::collections::HashMap;

impl Resident {
    /// Number of bricks of all objects, without levels.
    pub fn exact_bricks(&self) -> usize {
        self.bricks.len() - if self.has_levels_in_use() { self.levels.len() } else { 0 }
    }

    /// Whether levels are bricks like others.
    pub fn has_levels_in_use(&self) -> bool {
        let Some(last) = self.levels.last().filter(|_| self.level_leaves.is_empty()) else { return false };
        // No two bricks have the same payload.
        self.bricks.len() >= self.levels.len() && self.bricks.last().is_some_and(|brick| *brick == last.brick)
    }

    /// The level of a payload: of its geometry or attributes, whether levels are in use or not.
    pub fn level_of(&self, payload: Payload) -> Option<u32> {
        let (Payload::Geometry(index) | Payload::Attributes(index)) = payload else { return None };
        let level = (index as usize).checked_sub(self.exact_bricks())?;
        (level < self.levels.len()).then_some(level as u32)
    }

    /// What a payload is called by those who know the scene: that of a level by the level.
    pub fn name_of(&self, payload: Payload) -> String {
        match (payload, self.level_of(payload)) {
            (Payload::Geometry(_), Some(level)) => format!("level {level} geometry"),
            (Payload::Attributes(_), Some(level)) => format!("level {level} attributes"),
            _ => payload.to_string(),
        }
    }

    /// The levels that are beside the scene.
    pub(crate) fn levels_beside(&self) -> &[Level] {
        if self.has_levels_in_use() { &[] } else { &self.levels }
    }

    /// A brick, or behind them a level, whether levels are in use or not.
    pub fn brick(&self, index: u32) -> Option<&Brick> {
        let level = || self.levels_beside().get((index as usize).checked_sub(self.bricks.len())?);
        self.bricks.get(index as usize).or_else(|| level().map(|level| &level.brick))
    }

    /// As [`Self::brick`], of one that exists.
    pub(crate) fn existing_brick(&self, index: u32) -> &Brick {
        match (index as usize).checked_sub(self.bricks.len()) {
            Some(level) => &self.levels[level].brick,
            None => &self.bricks[index as usize],
        }
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

    /// Has no ray take a level that stands for instances that have moved: it shows them where they were.
    pub(crate) fn leave_levels_of(&mut self, has_moved: &[bool]) {
        let first = self.exact_bricks();
        let mut is_left = vec![false; self.levels.len()];
        for index in 0..self.levels.len() {
            let is_of_moved = |child: Leaf| has_moved.get(child.instance as usize).is_some_and(|&moved| moved);
            // Children lie before their parents.
            let is_left_level = |child: Leaf| {
                child.instance == NONE && (child.brick as usize).checked_sub(first).is_some_and(|level| is_left[level])
            };
            is_left[index] = self.levels[index].children().any(|child| is_of_moved(child) || is_left_level(child));
            if is_left[index] {
                self.levels[index].error = f64::MAX;
            }
        }
    }

    /// For each leaf of the top level the leaf of the level that stands for it, or [`NONE`]; levels are in use.
    pub fn level_parents(&self) -> Vec<u32> {
        let first = self.exact_bricks() as u32;
        let mut places = HashMap::with_capacity(self.leaves.len());
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
