//! Tangents of triangles that bring none: MikkTSpace (Mikkelsen, "Simulation of Wrinkled Surfaces Revisited", 2008),
//! which normal textures are made for by convention (glTF 2.0, section 3.7.2.1).
//!
//! They are made for each part of a source by itself, so that at the border of two parts of a large primitive they are
//! those of one side. Where there are no normals those of the triangles are taken.

use super::panics::quietly;
use crate::source::Primitive;
use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};

/// The tangents of all corners of `primitive`: unit vectors with the sign of the bitangent, zero where there is none.
/// The normal texture takes set `set` of the coordinates through `rows`, see [`bricks::Material::uv_from_set`]. `None`:
/// it lacks the set.
pub(super) fn make(primitive: &Primitive, set: usize, rows: &[[f32; 4]; 2]) -> Option<Vec<[f32; 4]>> {
    let uvs = if set == 0 { &primitive.uvs } else { &primitive.uvs1 }.as_ref()?;
    let origin = primitive.indices.first().map_or([0.0; 3], |&index| primitive.positions[index as usize]);
    let mut surface = Surface { primitive, uvs, rows, origin, tangents: vec![[0.0; 4]; primitive.indices.len()] };
    // What it makes of numbers that are none is not known; without tangents surfaces are as smooth as their normals.
    let made = quietly(|| generate_tangents(&mut surface).is_ok()) == Some(true);
    if !made {
        surface.tangents.fill([0.0; 4]);
    }
    Some(surface.tangents)
}

/// What MikkTSpace asks.
struct Surface<'a> {
    primitive: &'a Primitive,
    uvs: &'a [[f32; 2]],
    rows: &'a [[f32; 4]; 2],
    /// What positions are taken from, so that they keep their digits far out.
    origin: [f64; 3],
    tangents: Vec<[f32; 4]>,
}

impl Surface<'_> {
    fn vertex(&self, face: usize, corner: usize) -> usize {
        self.primitive.indices[3 * face + corner] as usize
    }
}

impl Geometry for Surface<'_> {
    fn num_faces(&self) -> usize {
        self.primitive.indices.len() / 3
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        let position = self.primitive.positions[self.vertex(face, corner)];
        std::array::from_fn(|k| (position[k] - self.origin[k]) as f32)
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        let normal = match &self.primitive.normals {
            Some(normals) => normals[self.vertex(face, corner)].map(f64::from),
            None => {
                let [a, b, c] = [0, 1, 2].map(|corner| self.primitive.positions[self.vertex(face, corner)]);
                let [u, v]: [[f64; 3]; 2] = [b, c].map(|p| std::array::from_fn(|k| p[k] - a[k]));
                std::array::from_fn(|k| u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3])
            }
        };
        let length = normal.iter().map(|c| c * c).sum::<f64>().sqrt();
        if length > 0.0 { normal.map(|c| (c / length) as f32) } else { [0.0; 3] }
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        let [s, t] = self.uvs[self.vertex(face, corner)];
        self.rows.map(|[a, b, c, _]| a * s + b * t + c)
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, corner: usize) {
        // Its second coordinate grows upwards, that of images here downwards.
        let tangent = space.map_or([0.0; 4], |space| space.tangent_encoded());
        let [x, y, z, sign] = tangent;
        let is_sound = [x, y, z].iter().all(|c| c.is_finite());
        self.tangents[3 * face + corner] = if is_sound { [x, y, z, -sign] } else { [0.0; 4] };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SAME: [[f32; 4]; 2] = [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.0]];

    /// A square in the plane of x and y, seen from +z, with coordinates of an image as it is seen: u along x, v along
    /// -y.
    fn square() -> Primitive {
        let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let uvs = positions.iter().map(|p: &[f64; 3]| [p[0] as f32, 1.0 - p[1] as f32]).collect();
        Primitive { uvs: Some(uvs), indices: vec![0, 1, 2, 0, 2, 3], positions, ..Primitive::default() }
    }

    #[test]
    fn up_in_the_image_is_up_on_the_surface() {
        // cross(z, x) = y, up in the image, by the sign 1: a normal texture's green points there.
        let mut primitive = square();
        assert_eq!(make(&primitive, 0, &SAME).unwrap(), [[1.0, 0.0, 0.0, 1.0]; 6]);
        primitive.normals = Some(vec![[0.0, 0.0, 2.0]; 4]);
        assert_eq!(make(&primitive, 0, &SAME).unwrap(), [[1.0, 0.0, 0.0, 1.0]; 6]);
        // Mirrored along u, and turned by a quarter: u along y.
        let mirror = [[-1.0, 0.0, 1.0, 1.0], [0.0, 1.0, 0.0, 0.0]];
        assert_eq!(make(&primitive, 0, &mirror).unwrap(), [[-1.0, 0.0, 0.0, -1.0]; 6]);
        let turned = [[0.0, -1.0, 1.0, 1.0], [1.0, 0.0, 0.0, 0.0]];
        assert_eq!(make(&primitive, 0, &turned).unwrap(), [[0.0, 1.0, 0.0, 1.0]; 6]);
        assert_eq!(make(&primitive, 1, &SAME), None);
    }

    #[test]
    fn what_has_no_tangent_has_none() {
        let mut primitive = square();
        primitive.uvs = Some(vec![[f32::NAN; 2]; 4]);
        let bad = make(&primitive, 0, &SAME).unwrap();
        assert!(bad.iter().flatten().all(|c| c.is_finite()));
        primitive.uvs = Some(vec![[0.5; 2]; 4]);
        assert_eq!(make(&primitive, 0, &SAME).unwrap().len(), 6);
        assert_eq!(
            make(&Primitive { uvs: Some(Vec::new()), ..Primitive::default() }, 0, &SAME).unwrap(),
            [[0.0; 4]; 0]
        );
    }
}
