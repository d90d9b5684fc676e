//! Levels of detail: bricks that stand for others, and a top level over all of them.
//!
//! A level stands for up to four bricks or levels of its object, or of instances of other objects, its *children*. So
//! levels are inner nodes of trees whose leaves are the bricks. A ray descends such a tree as far as its cone asks for:
//! a function of the ray alone, so that pictures do not depend on what is resident.
//!
//! As a file is opened, its levels are beside the scene: nothing but [`crate::Resident::payloads`] knows of them. With
//! [`crate::Resident::use_levels`] they become bricks like others, behind those of the objects, and the top level
//! becomes the one over all of them.

use crate::records::{Brick, Leaf, NONE};
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
    /// What it stands for, the first of them always there. `instance` is [`NONE`] where the child is placed as the
    /// level is, else an instance of another object; then the level is one of the world. `brick` is a brick, or the
    /// number of all bricks and the number of a level before this one, or [`NONE`]: no child.
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
