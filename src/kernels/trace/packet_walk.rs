//! Packets in bricks: what [`super::walk_brick`] does for a ray, for up to 64.

use super::flat_node::{FlatOpen, FlatStack, Sight};
use super::leaf::BrickRay;
use super::packet::{Column, Packet};
use super::packet_flat::Sights;
use super::packet_node::Place;
use super::packet_surface::Facts;
use super::packet_triangle::Seen;
use super::scratch::Scratch;
use super::walk_brick::{Group, STACK_SIZE, Stack, Visits};
use crate::kernels::bound::{Bound, Tally};
use crate::kernels::flat::{BLOCK, FlatBrick, FlatNode};
use crate::kernels::layout::{COUNTER_STACK_OVERFLOW, INSTANCE_IDENTITY, NONE};
use crate::kernels::simd::isa::{Isa, Lanes};

/// Where fewer rays than this go, each goes by itself: testing eight children for one ray costs less than testing the
/// rays for each child.
const TOGETHER: u32 = 3;
/// The same in bricks that are flat, where a ray by itself costs less.
const FLAT_TOGETHER: u32 = 4;

/// A node's entered children, with the rays that enter each by slot.
#[derive(Clone, Copy, Debug, Default)]
pub struct PacketGroup {
    /// Those that any ray enters.
    pub group: Group,
    /// Who enters each.
    pub rays: [u64; 8],
    /// No more than the distance at which any ray enters each.
    pub near: [f32; 8],
}

/// Groups that are left to be visited.
pub type PacketStack = [PacketGroup; STACK_SIZE];

/// What packets work with.
pub struct PacketScratch {
    /// The rays.
    pub packet: Packet,
    /// Groups of bricks.
    pub bricks: PacketStack,
    /// Groups of the top level.
    pub top: PacketStack,
    /// What the rays add to the boxes of the brick that they are in.
    pub sights: Sights,
    /// Triangles that rays from one point have seen.
    seen: Seen,
    /// What follows from the triangles that they have hit.
    pub facts: Facts,
    /// Nodes that a ray is to visit by itself.
    open: FlatStack,
    /// Visits of all rays.
    pub visits: Visits,
    /// What queries work with.
    pub entries: Entries,
}

/// Where rays enter what they ask about.
pub struct Entries {
    /// Each child of a node.
    pub children: [Column; 8],
    /// The same of a brick's root,
    pub root: [Column; 8],
    /// and the nearest of these.
    pub brick: Column,
    /// Nodes of the top level that are left to be visited.
    pub waiting: Vec<Waiting>,
}

/// A node that rays are to visit.
pub struct Waiting {
    /// Its number.
    pub node: u32,
    /// The rays.
    pub rays: u64,
    /// Where each enters it.
    pub near: Column,
}

impl Default for PacketScratch {
    fn default() -> Self {
        let stack = [PacketGroup::default(); STACK_SIZE];
        let (packet, sights, visits) = (Packet::empty(), Sights::empty(), Visits::default());
        let open = [FlatOpen::default(); STACK_SIZE];
        let none = [Column::ZERO; 8];
        let entries = Entries { children: none, root: none, brick: Column::ZERO, waiting: Vec::new() };
        Self {
            packet,
            bricks: stack,
            top: stack,
            sights,
            seen: Seen::default(),
            facts: Facts::empty(),
            open,
            visits,
            entries,
        }
    }
}

/// The children of a node of the wide top level, of a mask, that `rays` of the packet enter.
#[inline(always)]
pub fn top_group<I: Isa>(
    isa: I,
    bound: &Bound,
    packet: &Packet,
    place: &Place,
    (base, children, rays): (u32, u32, u64),
) -> PacketGroup {
    let node = &bound.scene.top8[base as usize];
    let mut group = PacketGroup { group: Group { base, bits: 0 }, ..PacketGroup::default() };
    let mut met = packet.open_of(isa, (node, place, children), rays, &mut group.rays);
    while met != 0 {
        group.group.bits |= 0x8000_0000 >> (met.trailing_zeros() ^ packet.flip);
        met &= met - 1;
    }
    group
}

/// Takes the nearest child of the group on top of the stack: its node, its slot and the rays that enter it. The group
/// is taken down with its last child.
#[inline(always)]
pub fn take(stack: &mut PacketStack, depth: &mut usize, flip: u32, t_max: f32) -> (Group, u32, u64) {
    let top = &mut stack[*depth - 1];
    let group = top.group;
    let (slot, rest) = group.nearest_child(flip);
    top.group = rest;
    let rays = if top.near[(slot & 7) as usize] <= t_max { top.rays[(slot & 7) as usize] } else { 0 };
    if !rest.has_children() {
        *depth -= 1;
    }
    (group, slot, rays)
}

/// Puts a group on the stack, if it has children. False: there is no room.
#[inline(always)]
pub fn put(stack: &mut PacketStack, depth: &mut usize, group: PacketGroup, tally: &mut Tally) -> bool {
    if group.group.has_children() {
        if *depth == STACK_SIZE {
            tally.add(COUNTER_STACK_OVERFLOW, 1);
            return false;
        }
        stack[*depth] = group;
        *depth += 1;
    }
    true
}

impl PacketScratch {
    /// Has `rays` meet the brick of a leaf of the top level.
    #[inline(always)]
    pub fn walk_leaf<I: Isa>(
        &mut self,
        isa: I,
        bound: &Bound,
        scratch: &mut Scratch,
        leaf: u32,
        rays: u64,
        any_hit: bool,
    ) {
        let Scratch { tally, stack, .. } = scratch;
        let first = self.packet.ray(0);
        let mut r = BrickRay::outside(&first);
        let instance = &bound.scene.instances[bound.scene.leaves[leaf as usize].instance as usize];
        r.enter_brick(bound, bound.brick_of(leaf));
        if instance.flags & INSTANCE_IDENTITY == 0 {
            // Rays of one octant of the world may be of several here.
            let mut left = rays & !self.packet.done;
            while left != 0 {
                let i = left.trailing_zeros() as usize;
                left &= left - 1;
                r.enter_leaf(bound.scene, &self.packet.ray(i), leaf);
                if let Some(flat) = r.brick.flat
                    && bound.is_used(leaf)
                {
                    let sight = Sight::new(&r.ray, flat, r.offset_high, r.offset_low);
                    self.walk_flat(isa, (&r, &sight), flat, tally, (i, 0), any_hit);
                    continue;
                }
                self.walk_alone(isa, bound, &r, stack, tally, (i, 0), any_hit);
            }
            return;
        }
        r.enter_leaf(bound.scene, &first, leaf);
        let place = Place::new(r.offset_high, r.offset_low, 0.0);
        let flip = self.packet.flip;
        // The packed root says whether a brick is of use.
        let first_flat = u32::from(!bound.is_used(leaf));
        if let Some(flat) = r.brick.flat {
            self.sights.begin(&self.packet, flat, (r.offset_high, r.offset_low));
        }
        self.bricks[0] = PacketGroup { group: Group::root(flip), rays: [rays; 8], near: [0.0; 8] };
        let mut depth = 1;
        while depth > 0 {
            let (group, slot, rays) = take(&mut self.bricks, &mut depth, flip, self.packet.bounds.t[1]);
            let index = group.child_index(slot);
            let rays = rays & !self.packet.done;
            let flat = r.brick.flat.filter(|_| index >= first_flat);
            if rays.count_ones() < if flat.is_some() { FLAT_TOGETHER } else { TOGETHER } {
                let mut left = rays;
                while left != 0 {
                    let i = left.trailing_zeros() as usize;
                    left &= left - 1;
                    r.ray = self.packet.ray(i);
                    if let Some(flat) = flat {
                        self.sights.make(isa, &self.packet);
                        let sight = self.sights.of(i);
                        self.walk_flat(isa, (&r, &sight), flat, tally, (i, index), any_hit);
                        continue;
                    }
                    r.lanes = Lanes::new(&r.ray, r.offset_high, r.offset_low);
                    self.walk_alone(isa, bound, &r, stack, tally, (i, index), any_hit);
                }
                continue;
            }
            let children = match flat {
                Some(flat) => self.open_flat(isa, &r, &flat.nodes[index as usize], rays, any_hit),
                _ => self.open_node(isa, bound, &r, &place, (index, rays), any_hit),
            };
            if !put(&mut self.bricks, &mut depth, children, tally) {
                break;
            }
        }
    }

    /// Opens a node of a brick, and tests its triangles.
    #[inline(always)]
    fn open_node<I: Isa>(
        &mut self,
        isa: I,
        bound: &Bound,
        r: &BrickRay,
        place: &Place,
        (index, rays): (u32, u64),
        any_hit: bool,
    ) -> PacketGroup {
        let node = &r.brick.nodes[index as usize];
        let mut entered = [0; 8];
        let met = self.packet.open(isa, node, place, rays, &mut entered);
        self.visits.nodes = self.visits.nodes.wrapping_add(rays.count_ones());
        if index == 0 && met != 0 {
            bound.note_use(r.leaf);
        }
        let mut children = Group { base: node.child_base, bits: u32::from(node.inner_mask) };
        let mut triangles = 0;
        let mut testing = [0; 32];
        let mut left = met;
        while left != 0 {
            let i = left.trailing_zeros() as usize;
            left &= left - 1;
            let what = u32::from(node.meta[i]);
            let count = what >> 5;
            if what & 24 == 24 && count == 1 {
                children.bits |= 1 << (31 - ((what & 7) ^ self.packet.flip));
                continue;
            }
            let first = what & 31;
            triangles |= count << first;
            self.visits.triangles = self.visits.triangles.wrapping_add(count.count_ones() * entered[i].count_ones());
            for k in 0..3 {
                if count >> k & 1 != 0 {
                    testing[((first + k) & 31) as usize] = entered[i];
                }
            }
        }
        self.test_triangles(isa, r, Group { base: node.triangle_base, bits: triangles }, &testing, any_hit);
        PacketGroup { group: children, rays: entered, near: [0.0; 8] }
    }

    /// Tests a group of triangles, each with rays of its own.
    #[inline(always)]
    fn test_triangles<I: Isa>(&mut self, isa: I, r: &BrickRay, group: Group, testing: &[u64; 32], any_hit: bool) {
        let is_nearer = match r.brick.flat {
            Some(flat) if self.packet.bounds.is_point => self.test_seen(isa, (r, flat), group, testing, any_hit),
            _ => {
                let (mut triangles, mut is_nearer) = (group.bits, false);
                while triangles != 0 {
                    let bit = triangles.trailing_zeros();
                    triangles &= triangles - 1;
                    let rays = testing[bit as usize] & !self.packet.done;
                    is_nearer |= self.packet.test_triangle(isa, r, group.base + bit, rays, any_hit);
                }
                is_nearer
            }
        };
        if is_nearer {
            self.packet.shorten(isa);
        }
    }

    /// [`PacketScratch::test_triangles`] with rays that begin at one point, block by block: whether hits have come
    /// nearer.
    #[inline(always)]
    fn test_seen<I: Isa>(
        &mut self,
        isa: I,
        (r, flat): (&BrickRay, &FlatBrick),
        group: Group,
        testing: &[u64; 32],
        any_hit: bool,
    ) -> bool {
        let (mut number, skipped) = (group.base / BLOCK as u32, group.base % BLOCK as u32);
        let mut is_nearer = false;
        // At most 24 triangles, from one of 8 lanes on.
        let (mut left, mut first) = (group.bits << skipped, 0);
        while left != 0 {
            let mut lanes = left & 0xff;
            if lanes != 0 {
                self.seen.look(isa, &self.packet, &flat.blocks[number as usize], r.offset_high);
            }
            while lanes != 0 {
                let lane = lanes.trailing_zeros();
                lanes &= lanes - 1;
                let rays = testing[(first + lane - skipped) as usize % 32] & !self.packet.done;
                let triangle = number * BLOCK as u32 + lane;
                is_nearer |= self.packet.test_seen(isa, r, (&self.seen, triangle), rays, any_hit);
            }
            left >>= BLOCK;
            (number, first) = (number + 1, first + BLOCK as u32);
        }
        is_nearer
    }

    /// [`PacketScratch::open_node`] of a brick that is flat.
    #[inline(always)]
    fn open_flat<I: Isa>(&mut self, isa: I, r: &BrickRay, node: &FlatNode, rays: u64, any_hit: bool) -> PacketGroup {
        let (mut entered, mut near) = ([0; 8], [0.0; 8]);
        let met = self.sights.open(isa, &self.packet, node, rays, (&mut entered, &mut near));
        let opened = node.opened(met, self.packet.flip);
        if opened.triangles.bits != 0 {
            let mut testing = [0; 32];
            let mut leaves = met & !u32::from(node.inner_mask);
            while leaves != 0 {
                let i = leaves.trailing_zeros() as usize % 8;
                leaves &= leaves - 1;
                let mut own = node.triangles_of(i);
                while own != 0 {
                    testing[own.trailing_zeros() as usize] = entered[i];
                    own &= own - 1;
                }
            }
            self.test_triangles(isa, r, opened.triangles, &testing, any_hit);
        }
        PacketGroup { group: opened.children, rays: entered, near }
    }

    /// Has ray `i`, which `r` is, visit a node and what is below it.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    fn walk_alone<I: Isa>(
        &mut self,
        isa: I,
        bound: &Bound,
        r: &BrickRay,
        stack: &mut Stack,
        tally: &mut Tally,
        (i, index): (usize, u32),
        any_hit: bool,
    ) {
        let packet = &mut self.packet;
        let mut best = packet.best(i);
        best.leaf = NONE;
        let mut depth = 0;
        let mut group = Group { base: index, ..Group::root(r.ray.flip) };
        loop {
            if !group.has_children() {
                if depth == 0 {
                    break;
                }
                depth -= 1;
                group = stack[depth];
            }
            let Some(child) = group.take_nearest(r.ray.flip, stack, &mut depth, tally) else { break };
            let opened = r.open_node(isa, bound, &mut self.visits, best.t, group.child_index(child));
            group = opened.children;
            if opened.triangles.bits != 0 {
                r.test_triangles(&mut self.visits, &mut best, opened.triangles, any_hit);
                if any_hit && best.leaf != NONE {
                    packet.done |= 1 << i;
                    break;
                }
            }
        }
        if best.leaf != NONE {
            packet.set_best(i, &best);
        }
    }

    /// The same in a brick that is flat.
    #[inline(always)]
    fn walk_flat<I: Isa>(
        &mut self,
        isa: I,
        (r, sight): (&BrickRay, &Sight),
        flat: &FlatBrick,
        tally: &mut Tally,
        (i, index): (usize, u32),
        any_hit: bool,
    ) {
        let mut best = self.packet.best(i);
        best.leaf = NONE;
        let octant = any_hit.then_some(r.ray.flip);
        let (mut next, mut depth) = (Some(index), 0);
        while let Some(index) = next {
            if depth == STACK_SIZE {
                tally.add(COUNTER_STACK_OVERFLOW, 1);
                break;
            }
            let triangles = sight.open(isa, &flat.nodes[index as usize], (r.ray.t_min, best.t), &mut self.open[depth]);
            if triangles.bits != 0 {
                r.test_flat(isa, flat, &mut best, triangles, any_hit);
                if any_hit && best.leaf != NONE {
                    self.packet.done |= 1 << i;
                    break;
                }
            }
            depth += 1;
            next = FlatOpen::take(&mut self.open, &mut depth, octant, best.t);
        }
        if best.leaf != NONE {
            self.packet.set_best(i, &best);
        }
    }

    /// Counts visits, if they are asked for, and begins anew.
    #[inline(always)]
    pub fn count(&mut self, bound: &Bound, tally: &mut Tally) {
        std::mem::take(&mut self.visits).count(bound, tally);
    }
}
