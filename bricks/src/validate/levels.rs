//! Checks of levels of detail: the records, and the top level over them and the bricks.

use super::rule::rule;
use super::{brick, scene, top};
use crate::error::{Flaw, Part};
use crate::layout::Section;
use crate::levels::Level;
use crate::records::{Instance, Leaf, NONE, Span};
use crate::resident::Resident;
use std::collections::HashMap;

/// Levels are sound bricks that stand for bricks and levels before them, each of which has one parent at most; the
/// leaves are those of bricks and levels, and both trees are trees over them. Bricks, objects and instances are right.
pub(super) fn levels(resident: &Resident) -> Result<(), Flaw> {
    let count = resident.levels.len();
    for section in [Section::LevelLeaves, Section::LevelTop2, Section::LevelTop8] {
        let records = resident.count(section);
        rule((records > 0) == (count > 0), Part::Section(section), || {
            (format!("{records} records with {count} levels"), "records if and only if there are levels")
        })?;
    }
    if count == 0 {
        return Ok(());
    }
    let all = resident.bricks.len() + count;
    rule(all < u32::MAX as usize, Part::Section(Section::Levels), || {
        (format!("{all} bricks and levels"), "less than 2^32 - 1")
    })?;
    let mut parents = Parents::none(resident);
    for (index, level) in (0u32..).zip(&resident.levels) {
        record(resident, index, level)?;
        children(resident, index, level)?;
        parents.meet(index, level)?;
    }
    parents.finish(resident)?;
    scene::leaves(resident, Section::LevelLeaves, &resident.level_leaves, &resident.levels)?;
    top::binary(Section::LevelTop2, &resident.level_top2, resident.level_leaves.len())?;
    top::wide(Section::LevelTop8, &resident.level_top8, resident.level_leaves.len())
}

/// Checks a level but for its children.
fn record(resident: &Resident, index: u32, level: &Level) -> Result<(), Flaw> {
    let part = Part::Record(Section::Levels, index);
    let objects = resident.objects.len();
    rule((level.brick.object as usize) < objects, part, || {
        (format!("object {}", level.brick.object), format!("less than {objects}"))
    })?;
    rule(level.brick.proxies == Span::default(), part, || ("a span of proxies", "none"))?;
    rule(level._reserved == 0, part, || (format!("{:#x} in the reserved word", level._reserved), "zero"))?;
    brick::record(part, resident.bricks.len() as u32 + index, &level.brick)?;
    for (name, length) in [("error", level.error), ("bound", level.bound)] {
        rule(length.is_finite() && length >= 0.0, part, || {
            (format!("{name} {length}"), "a finite number, not negative")
        })?;
    }
    rule((0.0..=1.0).contains(&level.color), part, || (format!("a difference of colours of {}", level.color), "0 to 1"))
}

/// Checks what a level stands for.
fn children(resident: &Resident, index: u32, level: &Level) -> Result<(), Flaw> {
    let part = Part::Record(Section::Levels, index);
    let bricks = resident.bricks.len() as u32;
    let count = level.children.iter().take_while(|child| child.brick != NONE).count();
    rule(count > 0, part, || ("no first child", "one at least"))?;
    let behind = level.children[count..].iter().position(|child| child.brick != NONE);
    rule(behind.is_none(), part, || {
        (format!("child {} behind none", count + behind.unwrap_or(0)), "present children first")
    })?;
    for (number, child) in level.children[..count].iter().enumerate() {
        let end = bricks + index;
        rule(child.brick < end, part, || {
            (
                format!("brick {} as child {number}", child.brick),
                format!("a brick or an earlier level, less than {end}"),
            )
        })?;
        let object = placed_object(resident, part, level, *child)?;
        let earlier = child.brick.checked_sub(bricks).map(|earlier| &resident.levels[earlier as usize]);
        let found = earlier.map_or_else(|| resident.bricks[child.brick as usize].object, |level| level.brick.object);
        rule(found == object, part, || {
            (format!("brick {} of object {found} as child {number}", child.brick), format!("one of object {object}"))
        })?;
        // Lengths of other objects are in their units.
        let Some(earlier) = earlier.filter(|_| child.instance == NONE) else { continue };
        for (name, own, least) in [("error", level.error, earlier.error), ("bound", level.bound, earlier.bound)] {
            rule(own >= least, part, || {
                (format!("{name} {own}"), format!("at least {least}, that of child {number}"))
            })?;
        }
    }
    Ok(())
}

/// The object that a child has to be of: that of the level, or that of the instance it names.
fn placed_object(resident: &Resident, part: Part, level: &Level, child: Leaf) -> Result<u32, Flaw> {
    if child.instance == NONE {
        return Ok(level.brick.object);
    }
    let placed = resident.instances.get(child.instance as usize).filter(|_| child.instance > 0);
    rule(placed.is_some(), part, || {
        (format!("a child of instance {}", child.instance), format!("none, or 1 to {}", resident.instances.len() - 1))
    })?;
    rule(level.brick.object == 0, part, || {
        (format!("a child of instance {} in object {}", child.instance, level.brick.object), "one of the same object")
    })?;
    // Else a level of the world would stand for the same child wherever the world is placed.
    let object = placed.map_or(0, |instance| instance.object);
    rule(object != 0, part, || (format!("a child of instance {} of the world", child.instance), "another object's"))?;
    Ok(object)
}

/// The levels that stand for things, to see that none has two.
struct Parents {
    /// Of each brick, then of each level, in its own object; [`NONE`] while no parent was met.
    own: Vec<u32>,
    /// Of bricks and levels of instances.
    placed: HashMap<(u32, u32), u32>,
    /// Whether the world is placed once.
    has_one_world: bool,
}

impl Parents {
    fn none(resident: &Resident) -> Self {
        let all = resident.bricks.len() + resident.levels.len();
        let is_world = |instance: &Instance| instance.object == 0;
        let has_one_world = !resident.instances.iter().skip(1).any(is_world);
        Self { own: vec![NONE; all], placed: HashMap::new(), has_one_world }
    }

    /// Meets the children of a level, which exist.
    fn meet(&mut self, index: u32, level: &Level) -> Result<(), Flaw> {
        let part = Part::Record(Section::Levels, index);
        for child in level.children() {
            let other = if child.instance == NONE {
                Some(std::mem::replace(&mut self.own[child.brick as usize], index)).filter(|other| *other != NONE)
            } else {
                rule(self.has_one_world, part, || {
                    (format!("a child of instance {}", child.instance), "none, as the world is placed more than once")
                })?;
                self.placed.insert((child.instance, child.brick), index)
            };
            rule(other.is_none(), part, || twice(child, other))?;
        }
        Ok(())
    }

    /// What levels of the world stand for has no parent in its own object.
    fn finish(self, resident: &Resident) -> Result<(), Flaw> {
        if self.placed.is_empty() {
            return Ok(());
        }
        for (index, level) in (0u32..).zip(&resident.levels) {
            for child in level.children().filter(|child| child.instance != NONE) {
                let other = Some(self.own[child.brick as usize]).filter(|other| *other != NONE);
                rule(other.is_none(), Part::Record(Section::Levels, index), || twice(child, other))?;
            }
        }
        Ok(())
    }
}

/// What is said of a child with another parent.
fn twice(child: Leaf, other: Option<u32>) -> (String, &'static str) {
    let instance = if child.instance == NONE { String::new() } else { format!(" of instance {}", child.instance) };
    let other = other.unwrap_or(NONE);
    (format!("brick {}{instance}, for which level {other} stands", child.brick), "one level at most for everything")
}
