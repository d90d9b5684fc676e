//! The payloads of bricks where they lie, as the arrays that twins read: geometry and attributes.

use super::flat::FlatBrick;
use super::layout::BRICK_WIDE;
use super::vector::{Vec3, each};
use crate::math::exact::barrier;
use bricks::{
    AttributeDetail, AttributeLayout, AttributeVertex, BRICK_INDEX32, Brick, GeometryLayout, Node, OpacityTriangle,
};

/// The arrays of a brick's geometry where they lie. What indices they hold has been checked when the payload was
/// loaded; they are checked on every use all the same.
#[derive(Clone, Copy, Default)]
pub struct BrickView<'a> {
    /// Nodes, the root first.
    pub nodes: &'a [Node],
    /// Three numbers a vertex, or six of a wide brick.
    vertices: &'a [f32],
    /// Mesh-local ids of the triangles.
    pub ids: &'a [u32],
    /// The triangles' vertices.
    indices: Indices<'a>,
    /// Whether vertices have two parts.
    is_wide: bool,
    /// Which rays pass through its triangles.
    pub opacity: OpacityView<'a>,
    /// The same in the form that is walked faster, where there is one.
    pub flat: Option<&'a FlatBrick>,
}

impl<'a> BrickView<'a> {
    /// The arrays in the verified geometry of `brick`, which is aligned for u32 and of the length that the record
    /// implies; `table` is that of [`crate::kernels::opacity`], or empty where every triangle is to be opaque.
    pub fn new(brick: &Brick, bytes: &'a [u8], table: &'a [[u32; 4]]) -> Self {
        let layout = GeometryLayout::of(brick);
        let part = |from: u64, to: u64| &bytes[from as usize..to as usize];
        Self {
            nodes: bytemuck::cast_slice(part(0, layout.vertices)),
            vertices: bytemuck::cast_slice(part(layout.vertices, layout.ids)),
            ids: bytemuck::cast_slice(part(layout.ids, layout.indices)),
            indices: Indices::new(brick, part(layout.indices, layout.opacity_of)),
            opacity: OpacityView {
                of: if table.is_empty() {
                    &[]
                } else {
                    bytemuck::cast_slice(part(layout.opacity_of, layout.opacities))
                },
                triangles: bytemuck::cast_slice(part(layout.opacities, layout.bytes)),
                table,
            },
            is_wide: brick.flags & BRICK_WIDE != 0,
            flat: None,
        }
    }

    /// The same with its other form, where there is one.
    pub fn with_flat(self, flat: Option<&'a FlatBrick>) -> Self {
        Self { flat, ..self }
    }

    /// Its other form, of so many triangles. `None`: the brick is wide.
    pub fn flattened(&self, triangles: u32) -> Option<FlatBrick> {
        let corner = |index: u32| each(|k| self.vertices[3 * index as usize + k]);
        let triangle = |number: u32| (self.indices.of(number).map(corner), self.ids[number as usize]);
        (!self.is_wide).then(|| FlatBrick::new(self.nodes, (0..triangles).map(triangle)))
    }

    /// A vertex in the object's frame, in which the brick's origin lies at the offset: the correctly rounded difference
    /// of its lattice position and the reference point.
    #[inline(always)]
    fn vertex(&self, index: u32, offset_high: Vec3, offset_low: Vec3) -> Vec3 {
        if !self.is_wide {
            let at = 3 * index as usize;
            let l = &self.vertices[at..at + 3];
            return each(|k| barrier(l[k] + offset_high[k]));
        }
        let at = 6 * index as usize;
        let l = &self.vertices[at..at + 6];
        each(|k| barrier(barrier(l[k] + offset_high[k]) + barrier(l[3 + k] + offset_low[k])))
    }

    /// The vertices of a triangle in f64, in device units of the object, relative to the brick's origin; exact.
    #[inline(always)]
    pub fn corners(&self, triangle: u32) -> [[f64; 3]; 3] {
        let [a, b, c] = self.indices.of(triangle);
        [self.corner(a), self.corner(b), self.corner(c)]
    }

    #[inline(always)]
    fn corner(&self, index: u32) -> [f64; 3] {
        if !self.is_wide {
            let at = 3 * index as usize;
            let l = &self.vertices[at..at + 3];
            return [f64::from(l[0]), f64::from(l[1]), f64::from(l[2])];
        }
        let at = 6 * index as usize;
        let l = &self.vertices[at..at + 6];
        // High and low part have 24 bits each and a common step.
        [f64::from(l[0]) + f64::from(l[3]), f64::from(l[1]) + f64::from(l[4]), f64::from(l[2]) + f64::from(l[5])]
    }

    /// The vertices of a triangle in the object's frame.
    #[inline(always)]
    pub fn vertices(&self, triangle: u32, offset_high: Vec3, offset_low: Vec3) -> [Vec3; 3] {
        if let Some(flat) = self.flat {
            let [a, b, c] = flat.vertices(triangle);
            let moved = |vertex: Vec3| each(|k| barrier(vertex[k] + offset_high[k]));
            return [moved(a), moved(b), moved(c)];
        }
        let [a, b, c] = self.indices.of(triangle);
        let vertex = |index| self.vertex(index, offset_high, offset_low);
        [vertex(a), vertex(b), vertex(c)]
    }
}

/// The opacity of a brick's triangles where it lies.
#[derive(Clone, Copy, Default)]
pub struct OpacityView<'a> {
    /// The number of each triangle among `triangles`, or NONE; empty in a brick that no ray passes through.
    pub of: &'a [u32],
    /// What decides.
    pub triangles: &'a [OpacityTriangle],
    /// [`super::layout::Opacity`] of each material in two vectors, then texels ([`crate::kernels::opacity`]).
    pub table: &'a [[u32; 4]],
}

/// The arrays of a brick's attributes where they lie.
#[derive(Clone, Copy, Default)]
pub struct AttributeView<'a> {
    vertices: &'a [AttributeVertex],
    /// Material and rotation of each triangle.
    pub surfaces: &'a [u32],
    indices: Indices<'a>,
    /// As many as vertices, or none.
    details: &'a [AttributeDetail],
}

impl<'a> AttributeView<'a> {
    /// The arrays in the verified attributes of `brick`, which are aligned for u32 and of the length that the record
    /// implies.
    pub fn new(brick: &Brick, bytes: &'a [u8]) -> Self {
        let layout = AttributeLayout::of(brick);
        let part = |from: u64, to: u64| &bytes[from as usize..to as usize];
        Self {
            vertices: bytemuck::cast_slice(part(0, layout.surfaces)),
            surfaces: bytemuck::cast_slice(part(layout.surfaces, layout.indices)),
            indices: Indices::new(brick, part(layout.indices, layout.details)),
            details: bytemuck::cast_slice(part(layout.details, layout.bytes)),
        }
    }

    /// The corners of a triangle.
    pub fn corners(&self, triangle: u32) -> [AttributeVertex; 3] {
        let ([a, b, c], vertex) = (self.indices.of(triangle), |index: u32| self.vertices[index as usize]);
        [vertex(a), vertex(b), vertex(c)]
    }

    /// What the corners of a triangle have besides, where they have.
    pub fn details(&self, triangle: u32) -> Option<[AttributeDetail; 3]> {
        let corners = self.indices.of(triangle);
        (!self.details.is_empty()).then(|| corners.map(|index| self.details[index as usize]))
    }
}

/// Three indices a triangle where they lie, as numbers of 16 or 32 bits.
#[derive(Clone, Copy, Default)]
struct Indices<'a> {
    /// Where they have 16 bits,
    short: &'a [u16],
    /// and where they have 32.
    long: &'a [u32],
}

impl<'a> Indices<'a> {
    /// The indices of `brick`, which `bytes` are, aligned for u32.
    fn new(brick: &Brick, bytes: &'a [u8]) -> Self {
        match brick.flags & BRICK_INDEX32 {
            0 => Self { short: bytemuck::cast_slice(bytes), long: &[] },
            _ => Self { short: &[], long: bytemuck::cast_slice(bytes) },
        }
    }

    /// The vertices of a triangle.
    #[inline(always)]
    fn of(&self, triangle: u32) -> [u32; 3] {
        let at = 3 * triangle as usize;
        if self.long.is_empty() {
            let i = &self.short[at..at + 3];
            return [i[0].into(), i[1].into(), i[2].into()];
        }
        let i = &self.long[at..at + 3];
        [i[0], i[1], i[2]]
    }
}
