//! What shading reads of a vertex and of a triangle: normals, tangents, texture coordinates, colours, mean colours.

use super::intern::{Key, mix};
use crate::build::input::objects::Placed;
use crate::source::shines_to_front;
use bricks::{AttributeDetail, AttributeVertex, MATERIAL_REFRACTS, Material, NO_NORMAL, NONE};

/// [`AttributeVertex`] as bits.
pub(super) type PlainBits = [u32; 4];

/// [`AttributeDetail`] as bits.
pub(super) type DetailBits = [u32; 4];

/// The details of a vertex whose material needs none.
pub(crate) const NO_DETAIL: DetailBits = [NO_NORMAL, 0, 0, 0];

/// What triangles of a material want beside what all have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Wants {
    /// Details.
    pub details: bool,
    /// Normals, of the triangles themselves where vertices have none: they tell front from back.
    pub normals: bool,
}

impl Wants {
    /// Those of a material.
    pub fn of(material: &Material) -> Self {
        let normals = material.flags & MATERIAL_REFRACTS != 0 || shines_to_front(material);
        Self { details: material.needs_details(), normals }
    }
}

/// An attribute vertex with its details, for interning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct VertexBits(pub PlainBits, pub DetailBits);

impl Key for VertexBits {
    fn hash(&self) -> u64 {
        let [a, b, c, d] = self.0.map(u64::from);
        let plain = mix(mix(0xa409_3822_299f_31d0, a << 32 | b), c << 32 | d);
        if self.1 == NO_DETAIL {
            return plain;
        }
        let [a, b, c, d] = self.1.map(u64::from);
        mix(mix(plain, a << 32 | b), c << 32 | d)
    }
}

impl VertexBits {
    /// The record.
    pub fn vertex(&self) -> AttributeVertex {
        let [normal, u, v, color] = self.0;
        AttributeVertex { normal, uv: [f32::from_bits(u), f32::from_bits(v)], color }
    }

    /// Its details.
    pub fn detail(&self) -> AttributeDetail {
        let [tangent, handedness, u, v] = self.1;
        AttributeDetail { tangent, handedness: f32::from_bits(handedness), uv: [f32::from_bits(u), f32::from_bits(v)] }
    }

    /// Colour as linear RGB in 0..=1.
    pub fn rgb(&self) -> [f32; 3] {
        std::array::from_fn(|k| (self.0[3] >> (8 * k) & 255) as f32 / 255.0)
    }
}

/// The attributes of vertex `vertex` of a placed part, which is corner `corner` (of all triangles of the part one after
/// the other). `outside`: twice the area vector of its triangle.
pub(crate) fn vertex(placed: &Placed, vertex: u32, corner: usize, wants: Wants, outside: [f64; 3]) -> VertexBits {
    let primitive = placed.primitive;
    let of_triangle = || if wants.normals { octahedral(outside) } else { None };
    let normal = source_normal(placed, vertex).or_else(of_triangle).unwrap_or(NO_NORMAL);
    let [u, v] = coordinates(primitive.uvs.as_deref(), vertex);
    let color = primitive.colors.as_ref().map_or(u32::MAX, |colors| unorm8(colors[vertex as usize]));
    let mut detail = NO_DETAIL;
    if wants.details {
        [detail[2], detail[3]] = coordinates(primitive.uvs1.as_deref(), vertex);
        if let Some((tangent, handedness)) = source_tangent(placed, corner) {
            [detail[0], detail[1]] = [tangent, handedness.to_bits()];
        }
    }
    VertexBits([normal, u, v, color], detail)
}

/// The bits of the texture coordinates of a vertex; zero where there are none that are usable.
fn coordinates(uvs: Option<&[[f32; 2]]>, vertex: u32) -> [u32; 2] {
    let uv = uvs.map_or([0.0; 2], |uvs| uvs[vertex as usize]);
    // Adding zero turns -0 into 0, so that equal coordinates have equal bits.
    uv.map(|x| if x.is_finite() { (x + 0.0).to_bits() } else { 0 })
}

/// The octahedral tangent of a corner in object space, and the handedness there; `None` if the source has none that is
/// usable. Tangents are vectors, so the matrix itself maps them; a mirror turns the handedness, since normals keep to
/// the outside.
fn source_tangent(placed: &Placed, corner: usize) -> Option<(u32, f32)> {
    let [x, y, z, sign] = placed.primitive.tangents.as_ref()?[corner];
    let tangent = [x, y, z].map(f64::from);
    let side = if sign < 0.0 { -1.0 } else { 1.0 };
    let Some(baking) = &placed.part.baking else { return Some((octahedral(tangent)?, side)) };
    let mirror = if baking.matrix.determinant() < 0.0 { -1.0 } else { 1.0 };
    Some((octahedral(baking.matrix.vector(tangent))?, side * mirror))
}

/// The octahedral normal of a vertex in object space; `None` if the source has none that is usable.
fn source_normal(placed: &Placed, vertex: u32) -> Option<u32> {
    let normal = placed.primitive.normals.as_ref()?[vertex as usize].map(f64::from);
    let normal = match &placed.part.baking {
        None => normal,
        Some(baking) => {
            let m = &baking.normals;
            std::array::from_fn(|k| m[3 * k] * normal[0] + m[3 * k + 1] * normal[1] + m[3 * k + 2] * normal[2])
        }
    };
    octahedral(normal)
}

/// Twice the area vector of a lattice triangle, in squared steps, rounded from the exact integers.
pub(crate) fn cross(corners: &[[i64; 3]; 3]) -> [f64; 3] {
    exact_cross(corners).map(|x| x as f64)
}

/// Whether a lattice triangle has no area; exact.
pub(crate) fn is_degenerate(corners: &[[i64; 3]; 3]) -> bool {
    exact_cross(corners) == [0; 3]
}

/// Edges have 46 bits at most, so products and their differences fit.
fn exact_cross([a, b, c]: &[[i64; 3]; 3]) -> [i128; 3] {
    let e: [i128; 3] = std::array::from_fn(|k| i128::from(b[k] - a[k]));
    let f: [i128; 3] = std::array::from_fn(|k| i128::from(c[k] - a[k]));
    [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]]
}

/// Octahedral encoding (Cigolle et al. 2014) with z as the axis of the fold: two snorm16, x in the low half. `None` for
/// a vector without direction.
pub(crate) fn octahedral(v: [f64; 3]) -> Option<u32> {
    let sum = v[0].abs() + v[1].abs() + v[2].abs();
    if !sum.is_finite() || sum == 0.0 {
        return None;
    }
    let [mut x, mut y] = [v[0] / sum, v[1] / sum];
    if v[2] < 0.0 {
        let sign = |x: f64| if x < 0.0 { -1.0 } else { 1.0 };
        (x, y) = ((1.0 - y.abs()) * sign(x), (1.0 - x.abs()) * sign(y));
    }
    let snorm = |x: f64| u32::from((x.clamp(-1.0, 1.0) * 32767.0).round() as i16 as u16);
    Some(snorm(x) | snorm(y) << 16)
}

fn unorm8(color: [f32; 4]) -> u32 {
    // A cast of NaN gives 0.
    color.iter().rev().fold(0, |bits, &x| bits << 8 | u32::from((x.clamp(0.0, 1.0) * 255.0).round() as u8))
}

/// Mean linear colours of a material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MeanColors {
    /// Base colour: factor times the mean of the texture.
    pub albedo: [f32; 3],
    /// Emission: factor times the mean of the texture.
    pub emission: [f32; 3],
}

impl MeanColors {
    /// Of a material; `texture_means` are linear RGB by texture.
    pub fn of(material: &Material, texture_means: &[[f32; 3]]) -> Self {
        let mean = |texture| match texture {
            NONE => [1.0; 3],
            index => texture_means[index as usize],
        };
        let (color, glow) = (mean(material.base_color_texture), mean(material.emissive_texture));
        Self {
            albedo: std::array::from_fn(|k| material.base_color[k] * color[k]),
            emission: std::array::from_fn(|k| material.emission[k] * glow[k]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decode(bits: u32) -> [f64; 3] {
        let [x, y] = [bits as u16 as i16, (bits >> 16) as u16 as i16].map(|x| f64::from(x) / 32767.0);
        let z = 1.0 - x.abs() - y.abs();
        let t = (-z).max(0.0);
        let v = [x - t.copysign(x), y - t.copysign(y), z];
        let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
        v.map(|x| x / length)
    }

    #[test]
    fn octahedral_normals_round_trip() {
        let mut worst = 0.0f64;
        for i in 0..200 {
            for j in 0..100 {
                let (phi, z) = (f64::from(i) * 0.0314159, f64::from(j) / 49.5 - 1.0);
                let r = (1.0 - z * z).max(0.0).sqrt();
                let v = [r * phi.cos(), r * phi.sin(), z];
                let d = decode(octahedral(v).unwrap());
                assert_ne!(octahedral(v), Some(NO_NORMAL));
                worst = worst.max((0..3).map(|k| (d[k] - v[k]).abs()).fold(0.0, f64::max));
            }
        }
        assert!(worst < 1e-4 && worst > 0.0, "{worst}");
        for axis in 0..6 {
            let mut v = [0.0; 3];
            v[axis / 2] = if axis % 2 == 0 { 2.0 } else { -2.0 };
            assert_eq!(decode(octahedral(v).unwrap()), v.map(|x: f64| x / 2.0), "axes are exact");
        }
        assert_eq!(octahedral([0.0; 3]), None);
        assert_eq!(octahedral([f64::NAN, 0.0, 1.0]), None);
    }

    #[test]
    fn zero_area_is_exact() {
        let far = 1i64 << 43;
        let line = [[-far, -far, -far], [0, 0, 0], [far, far, far]];
        assert!(is_degenerate(&line));
        assert!(!is_degenerate(&[line[0], [0, 0, 1], line[2]]), "one step off a line 2^44 long");
        assert!(is_degenerate(&[[5, 5, 5], [5, 5, 5], [7, 8, 9]]));
    }

    #[test]
    fn colours_are_clamped() {
        assert_eq!(unorm8([1.0, 0.0, 0.5, 1.0]), 0xff80_00ff);
        assert_eq!(unorm8([2.0, -1.0, f32::NAN, 1.0]), 0xff00_00ff);
    }
}
