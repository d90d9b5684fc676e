//! Building meshes out of panels, boxes, tubes and extrusions in local frames.
//!
//! Every face has vertices of its own, so that faces stay flat-shaded however normals are made from them.

use crate::material::{Mat, Tint};
use brickwalk_convert::source::Primitive;
use glam::{DAffine3, DVec2, DVec3};

/// Faces of a box, in the frame's axes.
pub mod face {
    /// Toward −u.
    pub const LEFT: u8 = 1;
    /// Toward +u.
    pub const RIGHT: u8 = 2;
    /// Toward −v.
    pub const BOTTOM: u8 = 4;
    /// Toward +v.
    pub const TOP: u8 = 8;
    /// Toward −n.
    pub const BACK: u8 = 16;
    /// Toward +n.
    pub const FRONT: u8 = 32;
    /// All six.
    pub const ALL: u8 = 63;
    /// All but the one that stands on something.
    pub const STANDING: u8 = ALL & !BOTTOM;
    /// All but the one that leans on a wall.
    pub const ON_WALL: u8 = ALL & !BACK;
    /// Around a vertical bar on a wall.
    pub const UPRIGHT: u8 = FRONT | LEFT | RIGHT;
    /// Around a horizontal bar on a wall.
    pub const LEVEL: u8 = FRONT | TOP | BOTTOM;
}

/// A right-handed orthonormal frame: u to the right, v up, n toward the one who looks at it.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// Origin.
    pub o: DVec3,
    /// Right.
    pub u: DVec3,
    /// Up.
    pub v: DVec3,
    /// Outward, u × v.
    pub n: DVec3,
}

impl Frame {
    /// The wall from `a` to `b` (x, z) at height `y`, and its length. Its outside is to the right of the way from a to
    /// b as seen from above.
    pub fn wall(a: DVec2, b: DVec2, y: f64) -> (Self, f64) {
        let length = (b - a).length();
        let d = (b - a) / length;
        let u = DVec3::new(d.x, 0.0, d.y);
        (Self { o: DVec3::new(a.x, y, a.y), u, v: DVec3::Y, n: DVec3::new(-d.y, 0.0, d.x) }, length)
    }

    /// Something that stands at `o` and faces the horizontal direction at `yaw` (0: +z, π/2: +x).
    pub fn standing(o: DVec3, yaw: f64) -> Self {
        let n = DVec3::new(yaw.sin(), 0.0, yaw.cos());
        Self { o, u: DVec3::new(n.z, 0.0, -n.x), v: DVec3::Y, n }
    }

    /// The point at `u`, `v`, `w`.
    pub fn at(&self, u: f64, v: f64, w: f64) -> DVec3 {
        self.o + self.u * u + self.v * v + self.n * w
    }

    /// The same axes at another origin.
    pub fn moved(&self, u: f64, v: f64, w: f64) -> Self {
        Self { o: self.at(u, v, w), ..*self }
    }

    /// Turned by `angle` about its own up axis.
    pub fn turned(&self, angle: f64) -> Self {
        let (s, c) = angle.sin_cos();
        Self { u: self.u * c - self.n * s, n: self.n * c + self.u * s, ..*self }
    }
}

/// Triangles of one material.
#[derive(Clone, Debug, Default)]
struct Part {
    positions: Vec<[f64; 3]>,
    /// Empty in a mesh whose normals are its faces'.
    normals: Vec<[f32; 3]>,
    colors: Vec<[f32; 4]>,
    indices: Vec<u32>,
}

/// Lengths of a builder's arrays, to return to.
pub struct Mark(Vec<(usize, usize)>);

/// A mesh under construction, one part a material.
#[derive(Clone, Debug)]
pub struct Builder {
    parts: Vec<Part>,
    smooth: bool,
}

impl Builder {
    /// An empty mesh.
    pub fn new() -> Self {
        Self { parts: vec![Part::default(); Mat::COUNT], smooth: false }
    }

    /// An empty mesh that may have smooth surfaces: it gives a normal to every vertex.
    pub fn smooth() -> Self {
        Self { smooth: true, ..Self::new() }
    }

    /// Number of triangles.
    pub fn triangles(&self) -> u64 {
        self.parts.iter().map(|p| p.indices.len() as u64 / 3).sum()
    }

    /// Least and greatest coordinates; infinite when there is nothing.
    pub fn bounds(&self) -> [DVec3; 2] {
        let all = self.parts.iter().flat_map(|p| &p.positions);
        all.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| {
            let p = DVec3::from_array(*p);
            [low.min(p), high.max(p)]
        })
    }

    /// What there is now.
    pub fn mark(&self) -> Mark {
        Mark(self.parts.iter().map(|p| (p.positions.len(), p.indices.len())).collect())
    }

    /// Removes what was added after `mark`.
    pub fn rollback(&mut self, mark: &Mark) {
        for (part, &(vertices, indices)) in self.parts.iter_mut().zip(&mark.0) {
            part.positions.truncate(vertices);
            part.normals.truncate(vertices);
            part.colors.truncate(vertices);
            part.indices.truncate(indices);
        }
    }

    /// Adds a transformed copy of `other`, which must be flat.
    pub fn append(&mut self, other: &Self, transform: &DAffine3) {
        for (part, from) in self.parts.iter_mut().zip(&other.parts) {
            let base = part.positions.len() as u32;
            part.positions
                .extend(from.positions.iter().map(|p| transform.transform_point3(DVec3::from_array(*p)).to_array()));
            part.colors.extend_from_slice(&from.colors);
            part.indices.extend(from.indices.iter().map(|i| base + i));
        }
    }

    /// Numbers of triangles of the primitives that [`Self::into_primitives`] makes.
    pub fn counts(&self) -> Vec<u32> {
        self.parts.iter().map(|p| p.indices.len() as u32 / 3).filter(|count| *count > 0).collect()
    }

    /// One primitive a material, in ascending order; none without triangles.
    pub fn into_primitives(self) -> Vec<Primitive> {
        let primitives = self.parts.into_iter().enumerate().filter(|(_, p)| !p.indices.is_empty());
        primitives
            .map(|(m, mut p)| {
                p.positions.shrink_to_fit();
                p.normals.shrink_to_fit();
                p.colors.shrink_to_fit();
                p.indices.shrink_to_fit();
                Primitive {
                    material: m as u32,
                    positions: p.positions,
                    normals: self.smooth.then_some(p.normals),
                    colors: Some(p.colors),
                    indices: p.indices,
                    ..Primitive::default()
                }
            })
            .collect()
    }

    /// A convex polygon, counter-clockwise as seen from outside, a tint a vertex.
    fn polygon(&mut self, m: Mat, points: impl IntoIterator<Item = (DVec3, Tint)>) {
        let part = &mut self.parts[m as usize];
        let base = part.positions.len() as u32;
        for (p, [r, g, b]) in points {
            part.positions.push(p.to_array());
            part.colors.push([r, g, b, 1.0]);
        }
        let count = part.positions.len() as u32 - base;
        if self.smooth {
            let at = |k: u32| DVec3::from_array(part.positions[(base + k) as usize]);
            // Twice the area as a vector, whatever corners are nearly straight.
            let area = (2..count).fold(DVec3::ZERO, |sum, k| sum + (at(k - 1) - at(0)).cross(at(k) - at(0)));
            let normal = area.normalize_or(DVec3::Y).as_vec3().to_array();
            part.normals.extend((0..count).map(|_| normal));
        }
        for k in 2..count {
            part.indices.extend([base, base + k - 1, base + k]);
        }
    }

    /// A convex polygon, counter-clockwise as seen from outside.
    pub fn fan(&mut self, m: Mat, tint: Tint, points: &[DVec3]) {
        self.polygon(m, points.iter().map(|p| (*p, tint)));
    }

    /// A smooth surface of `rows` times `columns` vertices, whose outside is on the side of (next column) × (next row);
    /// `at` gives position, normal and tint. Where two neighbours of a row coincide, a quad is a triangle.
    pub fn lattice(
        &mut self,
        m: Mat,
        rows: usize,
        columns: usize,
        mut at: impl FnMut(usize, usize) -> (DVec3, DVec3, Tint),
    ) {
        debug_assert!(self.smooth, "a flat mesh has no smooth surface");
        let part = &mut self.parts[m as usize];
        let base = part.positions.len();
        for row in 0..rows {
            for column in 0..columns {
                let (p, n, [r, g, b]) = at(row, column);
                part.positions.push(p.to_array());
                part.normals.push(n.as_vec3().to_array());
                part.colors.push([r, g, b, 1.0]);
            }
        }
        for row in 1..rows {
            for column in 1..columns {
                let index = |row: usize, column: usize| base + row * columns + column;
                let [a, b] = [index(row - 1, column - 1), index(row - 1, column)];
                let [c, d] = [index(row, column), index(row, column - 1)];
                if part.positions[a] != part.positions[b] {
                    part.indices.extend([a, b, c].map(|k| k as u32));
                }
                if part.positions[c] != part.positions[d] {
                    part.indices.extend([a, c, d].map(|k| k as u32));
                }
            }
        }
    }

    /// A quad whose first two vertices have the tint `low` and the others `high`.
    pub fn graded(&mut self, m: Mat, low: Tint, high: Tint, points: [DVec3; 4]) {
        self.polygon(m, points.into_iter().zip([low, low, high, high]));
    }

    /// A rectangle that faces n, at distance `w` from the frame's plane.
    pub fn panel(&mut self, f: &Frame, m: Mat, tint: Tint, [u0, u1]: [f64; 2], [v0, v1]: [f64; 2], w: f64) {
        self.fan(m, tint, &[f.at(u0, v0, w), f.at(u1, v0, w), f.at(u1, v1, w), f.at(u0, v1, w)]);
    }

    /// The faces `faces` of a box.
    #[expect(clippy::too_many_arguments, reason = "a box is three intervals, and calls read as such")]
    pub fn cuboid(
        &mut self,
        f: &Frame,
        m: Mat,
        tint: Tint,
        [u0, u1]: [f64; 2],
        [v0, v1]: [f64; 2],
        [w0, w1]: [f64; 2],
        faces: u8,
    ) {
        let corners = |a: [(f64, f64, f64); 4]| a.map(|(u, v, w)| f.at(u, v, w));
        if faces & face::FRONT != 0 {
            self.fan(m, tint, &corners([(u0, v0, w1), (u1, v0, w1), (u1, v1, w1), (u0, v1, w1)]));
        }
        if faces & face::BACK != 0 {
            self.fan(m, tint, &corners([(u1, v0, w0), (u0, v0, w0), (u0, v1, w0), (u1, v1, w0)]));
        }
        if faces & face::RIGHT != 0 {
            self.fan(m, tint, &corners([(u1, v0, w1), (u1, v0, w0), (u1, v1, w0), (u1, v1, w1)]));
        }
        if faces & face::LEFT != 0 {
            self.fan(m, tint, &corners([(u0, v0, w0), (u0, v0, w1), (u0, v1, w1), (u0, v1, w0)]));
        }
        if faces & face::TOP != 0 {
            self.fan(m, tint, &corners([(u0, v1, w1), (u1, v1, w1), (u1, v1, w0), (u0, v1, w0)]));
        }
        if faces & face::BOTTOM != 0 {
            self.fan(m, tint, &corners([(u0, v0, w0), (u1, v0, w0), (u1, v0, w1), (u0, v0, w1)]));
        }
    }

    /// A tapered tube from `a` (radius `ra`) to `b` (radius `rb`); a radius of 0 makes a cone. `cap` closes the end at
    /// b.
    pub fn tube(&mut self, m: Mat, tint: Tint, [a, b]: [DVec3; 2], [ra, rb]: [f64; 2], sides: u32, cap: bool) {
        let axis = (b - a).normalize();
        let x = axis.any_orthonormal_vector();
        let y = axis.cross(x);
        let at = |k: u32| {
            let (s, c) = (f64::from(k % sides) * std::f64::consts::TAU / f64::from(sides)).sin_cos();
            x * c + y * s
        };
        for k in 0..sides {
            let (d0, d1) = (at(k), at(k + 1));
            if ra <= 0.0 {
                self.fan(m, tint, &[a, b + d1 * rb, b + d0 * rb]);
            } else if rb <= 0.0 {
                self.fan(m, tint, &[a + d0 * ra, a + d1 * ra, b]);
            } else {
                self.fan(m, tint, &[a + d0 * ra, a + d1 * ra, b + d1 * rb, b + d0 * rb]);
            }
        }
        if cap && rb > 0.0 {
            let ring: Vec<DVec3> = (0..sides).map(|k| b + at(k) * rb).collect();
            self.fan(m, tint, &ring);
        }
    }

    /// A disc at `center` that faces `normal`, whose length is the radius.
    pub fn disc(&mut self, m: Mat, tint: Tint, center: DVec3, normal: DVec3, sides: u32) {
        let radius = normal.length();
        let x = normal.any_orthogonal_vector().normalize() * radius;
        let y = normal.cross(x) / radius;
        let ring: Vec<DVec3> = (0..sides)
            .map(|k| {
                let (s, c) = (f64::from(k) * std::f64::consts::TAU / f64::from(sides)).sin_cos();
                center + x * c + y * s
            })
            .collect();
        self.fan(m, tint, &ring);
    }

    /// A convex profile of (n, v) pairs, counter-clockwise with n drawn to the right and v up, extruded from `u0` to
    /// `u1`; `caps` closes both ends.
    pub fn extrude(&mut self, f: &Frame, m: Mat, tint: Tint, profile: &[[f64; 2]], [u0, u1]: [f64; 2], caps: bool) {
        let count = profile.len();
        for k in 0..count {
            let ([w0, v0], [w1, v1]) = (profile[k], profile[(k + 1) % count]);
            self.fan(m, tint, &[f.at(u0, v0, w0), f.at(u1, v0, w0), f.at(u1, v1, w1), f.at(u0, v1, w1)]);
        }
        if caps {
            let right: Vec<DVec3> = profile.iter().map(|[w, v]| f.at(u1, *v, *w)).rev().collect();
            let left: Vec<DVec3> = profile.iter().map(|[w, v]| f.at(u0, *v, *w)).collect();
            self.fan(m, tint, &right);
            self.fan(m, tint, &left);
        }
    }
}

/// `polygon` (x, z; walls as [`Frame::wall`] has them) with edge k moved inward by `distances[k]`. The polygon must
/// stay convex and keep its edges.
pub fn inset(polygon: &[DVec2], distances: &[f64]) -> Vec<DVec2> {
    let count = polygon.len();
    let line = |k: usize| {
        let (a, b) = (polygon[k], polygon[(k + 1) % count]);
        let d = (b - a).normalize();
        (a - DVec2::new(-d.y, d.x) * distances[k], d)
    };
    (0..count)
        .map(|k| {
            let (a, d) = line((k + count - 1) % count);
            let (b, e) = line(k);
            a + d * ((b - a).perp_dot(e) / d.perp_dot(e))
        })
        .collect()
}

/// Lifts a polygon to height `y`.
pub fn lift(polygon: &[DVec2], y: f64) -> Vec<DVec3> {
    polygon.iter().map(|p| DVec3::new(p.x, y, p.y)).collect()
}
