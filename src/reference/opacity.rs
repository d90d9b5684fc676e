//! Which rays pass through triangles, in f64.

use super::assessment::Assessment;
use super::decode::DecodeError;
use bricks::{
    MATERIAL_BLEND, Material, OpacityMap, OpacityTriangle, Payload, SceneFile, WRAP_CLAMP, WRAP_MIRROR, WRAP_REPEAT,
};

/// f32's unit roundoff.
const U: f64 = f32::EPSILON as f64 / 2.0;

/// What decides which rays pass: materials and maps of a scene.
#[derive(Clone, Debug, Default)]
pub(super) struct Opacities {
    materials: Vec<Material>,
    maps: Vec<(OpacityMap, Vec<u8>)>,
}

/// What a kernel may do with a ray that meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Passing {
    /// Stop it there.
    pub may_stop: bool,
    /// Let it pass.
    pub may_pass: bool,
}

impl Passing {
    /// Of a triangle that no ray passes through.
    pub const NEVER: Self = Self { may_stop: true, may_pass: false };
}

impl Opacities {
    /// Those of a scene file.
    pub fn load(file: &SceneFile) -> Result<Self, DecodeError> {
        let resident = file.resident();
        let mut maps = Vec::new();
        for (index, &map) in (0u32..).zip(&resident.opacity_maps) {
            let mut texels = vec![0; map.texels.bytes as usize];
            file.copy(Payload::Opacity(index), &mut texels)?;
            maps.push((map, texels));
        }
        Ok(Self { materials: resident.materials.clone(), maps })
    }

    /// Whether a ray that meets `triangle` at a point of these weights, of the stored vertices, passes: by the cutoff,
    /// or, where that is left to chance, never.
    pub fn passes(&self, triangle: &OpacityTriangle, weights: [f64; 3]) -> bool {
        let material = &self.materials[triangle.material as usize];
        material.flags & MATERIAL_BLEND == 0
            && self.alpha(triangle, weights, [0.0; 3])[0] < f64::from(material.alpha_cutoff)
    }

    /// What a kernel may do that has weights of the errors that f32 brings to the edges, as assessed.
    pub fn assess(&self, triangle: &OpacityTriangle, at: &Assessment) -> Passing {
        let p = at.sheared;
        let edges: [[f64; 2]; 3] = std::array::from_fn(|i| {
            let (q, r) = (p[(i + 1) % 3], p[(i + 2) % 3]);
            [r[0] - q[0], r[1] - q[1]]
        });
        let area = edges[2][0] * edges[1][1] - edges[2][1] * edges[1][0];
        let weights = std::array::from_fn(|i| {
            let (q, r) = (p[(i + 1) % 3], p[(i + 2) % 3]);
            -(q[0] * r[1] - q[1] * r[0]) / area
        });
        // A shift of the ray across an edge by e changes the weight of the vertex opposite by e over its height.
        let errors = edges.map(|[x, y]| 2.0 * at.edge_epsilon * x.hypot(y) / area.abs() + 16.0 * U);
        let [alpha, error] = self.alpha(triangle, weights, errors);
        if !(alpha + error).is_finite() {
            return Passing { may_stop: true, may_pass: true };
        }
        let material = &self.materials[triangle.material as usize];
        if material.flags & MATERIAL_BLEND != 0 {
            return Passing { may_stop: alpha + error > 0.0, may_pass: alpha - error < 1.0 };
        }
        let cutoff = f64::from(material.alpha_cutoff);
        Passing { may_stop: alpha + error >= cutoff, may_pass: alpha - error < cutoff }
    }

    /// Alpha at `weights`, and by how much it may differ where they differ by `errors`.
    fn alpha(&self, triangle: &OpacityTriangle, weights: [f64; 3], errors: [f64; 3]) -> [f64; 2] {
        let material = &self.materials[triangle.material as usize];
        let sum = |values: [f64; 3]| -> [f64; 2] {
            let error = (0..3).map(|i| errors[i] * values[i].abs()).sum::<f64>();
            [
                (0..3).map(|i| weights[i] * values[i]).sum(),
                error + 16.0 * U * values.iter().map(|x| x.abs()).sum::<f64>(),
            ]
        };
        let factor = f64::from(material.base_color[3]);
        let [vertex, vertex_error] = sum([0, 8, 16].map(|shift| f64::from(triangle.alphas >> shift & 255) / 255.0));
        let Some((map, texels)) = self.maps.get(material.opacity_map as usize) else {
            return [factor * vertex, factor * (vertex_error + 1.0 / 65_025.0)];
        };
        let [u, v] = [0, 1].map(|k| sum(triangle.uv.map(|uv| f64::from(uv[k]))));
        let texel = lookup(map, texels, u[0], v[0]);
        // Between neighbouring texels alpha changes by 1 at most.
        let texel_error = f64::from(map.width) * u[1]
            + f64::from(map.height) * v[1]
            + 64.0 * U * f64::from(map.width.max(map.height));
        [factor * vertex * texel, factor * (vertex_error + vertex.abs() * texel_error + 1.0 / 65_025.0)]
    }
}

/// Bilinear lookup, 0 to 1.
fn lookup(map: &OpacityMap, texels: &[u8], u: f64, v: f64) -> f64 {
    let along = |x: f64, size: u32, mode: u32| {
        let p =
            if mode == WRAP_CLAMP { x.clamp(-4.0, 4.0) } else { x - 2.0 * (x / 2.0).floor() } * f64::from(size) - 0.5;
        let texel = |i: i64| match mode {
            WRAP_REPEAT => i.rem_euclid(size.into()),
            WRAP_MIRROR => {
                let m = i.rem_euclid(2 * i64::from(size));
                m.min(2 * i64::from(size) - 1 - m)
            }
            _ => i.clamp(0, i64::from(size) - 1),
        } as usize;
        ([texel(p.floor() as i64), texel(p.floor() as i64 + 1)], p - p.floor())
    };
    let (columns, s) = along(u, map.width, map.wrap & 0xffff);
    let (rows, t) = along(v, map.height, map.wrap >> 16);
    let at = |row: usize, column: usize| f64::from(texels[rows[row] * map.width as usize + columns[column]]) / 255.0;
    let row = |row: usize| at(row, 0) + s * (at(row, 1) - at(row, 0));
    row(0) + t * (row(1) - row(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lookups_interpolate_and_wrap() {
        let map = |wrap| OpacityMap { width: 2, height: 1, wrap, _reserved: 0, texels: bricks::Span::default() };
        let texels = [0, 255];
        for (wrap, u, expected) in [
            (WRAP_REPEAT, 0.25, 0.0),
            (WRAP_REPEAT, 0.5, 0.5),
            (WRAP_REPEAT, 0.75, 1.0),
            (WRAP_REPEAT, 1.0, 0.5),
            (WRAP_REPEAT, 7.25, 0.0),
            (WRAP_CLAMP, 1.0, 1.0),
            (WRAP_CLAMP, -1.0, 0.0),
            (WRAP_MIRROR, 1.0, 1.0),
            (WRAP_MIRROR, 1.75, 0.0),
            (WRAP_MIRROR, -0.75, 1.0),
        ] {
            assert_eq!(lookup(&map(wrap | WRAP_REPEAT << 16), &texels, u, 0.5), expected, "{wrap} {u}");
        }
    }
}
