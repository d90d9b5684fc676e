//! Reads the attributes of hits in bricks whose attributes are resident: twin of `shaders/resolve.wgsl`. Normal, texture coordinates,
//! base colour.

use super::indices::Indices;
use super::rays::RaySet;
use super::scene::Bound;
use super::vector::{Vec3, dot, each, most, normalize, xyz};
use crate::kernel::layout::{GBuffer, NO_NORMAL, NONE, Params, STATE_ATTRIBUTES, Texture};
use crate::schedule::ExecutorError;
use bricks::{AttributeLayout, AttributeVertex, Brick, Payload, SURFACE_MATERIAL, SURFACE_ROTATION_SHIFT, SceneFile};
use rayon::prelude::*;

/// The arrays of a brick's attributes where they lie.
#[derive(Clone, Copy, Default)]
pub struct AttributeView<'a> {
    vertices: &'a [AttributeVertex],
    /// Material and rotation of each triangle.
    surfaces: &'a [u32],
    indices: Indices<'a>,
}

impl<'a> AttributeView<'a> {
    /// The arrays in the verified attributes of `brick`, which are aligned for u32 and of the length that the record implies.
    pub fn new(brick: &Brick, bytes: &'a [u8]) -> Self {
        let layout = AttributeLayout::of(brick);
        let part = |from: u64, to: u64| &bytes[from as usize..to as usize];
        Self {
            vertices: bytemuck::cast_slice(part(0, layout.surfaces)),
            surfaces: bytemuck::cast_slice(part(layout.surfaces, layout.indices)),
            indices: Indices::new(brick, part(layout.indices, layout.bytes)),
        }
    }

    fn corners(&self, triangle: u32) -> [AttributeVertex; 3] {
        self.indices.of(triangle).map(|index| self.vertices[index as usize])
    }
}

/// Materials and textures, resident throughout.
pub struct Texels {
    materials: Vec<bricks::Material>,
    textures: Vec<(Texture, Vec<u32>)>,
    /// Bytes of texels.
    pub bytes: u64,
}

impl Texels {
    /// Reads and verifies every texture.
    ///
    /// # Errors
    /// A texture that cannot be read or verified.
    pub fn new(scene: &SceneFile) -> Result<Self, ExecutorError> {
        let resident = scene.resident();
        let read = |(i, t): (usize, &bricks::Texture)| {
            let mut texels = vec![0u32; t.texels.bytes as usize / 4];
            scene
                .copy(Payload::Texture(i as u32), bytemuck::cast_slice_mut(&mut texels))
                .map_err(|error| ExecutorError::Device(format!("failed: {error}")))?;
            let (width, height, levels, wrap) = (t.width, t.height, t.levels, t.wrap);
            Ok((Texture { width, height, levels, wrap, ..Texture::default() }, texels))
        };
        Ok(Self {
            materials: resident.materials.clone(),
            textures: resident.textures.iter().enumerate().map(read).collect::<Result<_, ExecutorError>>()?,
            bytes: resident.textures.iter().map(|t| t.texels.bytes).sum(),
        })
    }
}

fn unpack4x8unorm(word: u32) -> [f32; 4] {
    word.to_le_bytes().map(|b| f32::from(b) / 255.0)
}

/// The normal of an attribute vertex; zero if it has none.
fn octahedral(word: u32) -> Vec3 {
    if word == NO_NORMAL {
        return [0.0; 3];
    }
    let snorm = |bits: u32| most(f32::from(bits as u16 as i16) / 32_767.0, -1.0);
    let [x, y] = [snorm(word), snorm(word >> 16)];
    let mut n = [x, y, 1.0 - x.abs() - y.abs()];
    let t = most(-n[2], 0.0);
    n[0] += if n[0] >= 0.0 { -t } else { t };
    n[1] += if n[1] >= 0.0 { -t } else { t };
    normalize(n)
}

fn wrap(x: i32, size: i32, mode: u32) -> i32 {
    match mode {
        bricks::WRAP_CLAMP => x.clamp(0, size - 1),
        bricks::WRAP_MIRROR => {
            let period = 2 * size;
            let m = x.rem_euclid(period);
            if m >= size { period - 1 - m } else { m }
        }
        _ => x.rem_euclid(size),
    }
}

fn linear_from_srgb(c: f32) -> f32 {
    if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// Bilinear lookup in the level nearest to the footprint: `texels_squared` is the area of a pixel in texels of level 0.
fn sample_texture((t, texels): &(Texture, Vec<u32>), uv: [f32; 2], texels_squared: f32) -> [f32; 4] {
    let lod = 0.5 * texels_squared.clamp(1.0e-12, 1.0e12).log2();
    let level = (lod + 0.5).floor().clamp(0.0, (t.levels - 1) as f32) as u32;
    let size_of = |level: u32| [(t.width >> level).max(1), (t.height >> level).max(1)];
    let offset: u32 = (0..level).map(size_of).map(|[w, h]| w * h).sum();
    let size = size_of(level).map(|s| s as i32);
    let modes = [t.wrap & 0xffff, t.wrap >> 16];
    // Whole turns are taken off first so that large coordinates keep their fraction; the bound keeps integers in range.
    let turned = |k: usize| {
        if modes[k] == bricks::WRAP_CLAMP { uv[k] } else { uv[k] - 2.0 * (0.5 * uv[k]).floor() }
    };
    let p = [0, 1].map(|k| turned(k).clamp(-4.0, 4.0) * size[k] as f32 - 0.5);
    let f = p.map(|p| p - p.floor());
    let i = p.map(|p| p.floor() as i32);
    let texel = |x: i32, y: i32| {
        let (u, v) = (wrap(x, size[0], modes[0]), wrap(y, size[1], modes[1]));
        let c = unpack4x8unorm(texels[(offset as i32 + v * size[0] + u) as usize]);
        [linear_from_srgb(c[0]), linear_from_srgb(c[1]), linear_from_srgb(c[2]), c[3]]
    };
    let mix = |a: [f32; 4], b: [f32; 4], t: f32| [0, 1, 2, 3].map(|k| super::vector::mix(a[k], b[k], t));
    let top = mix(texel(i[0], i[1]), texel(i[0] + 1, i[1]), f[0]);
    let bottom = mix(texel(i[0], i[1] + 1), texel(i[0] + 1, i[1] + 1), f[0]);
    mix(top, bottom, f[1])
}

/// Of all hits of the shaded set that have none yet.
pub fn resolve(bound: &Bound, seen: &RaySet, gbuffer: &mut [GBuffer], texels: &Texels, attributes: &[AttributeView]) {
    gbuffer.par_iter_mut().enumerate().with_min_len(256).for_each(|(index, g)| {
        let surface = &seen.surfaces[index];
        if surface.leaf == NONE || g.state != 0 {
            return;
        }
        let brick = bound.brick_of(surface.leaf);
        if bound.slots[brick].state & STATE_ATTRIBUTES != 0 {
            *g = read(bound, seen, index, texels, &attributes[brick]);
        }
    });
}

fn read(bound: &Bound, seen: &RaySet, index: usize, texels: &Texels, attributes: &AttributeView) -> GBuffer {
    let params: &Params = bound.params;
    let surface = &seen.surfaces[index];
    let word = attributes.surfaces[surface.triangle as usize];
    let material = &texels.materials[(word & SURFACE_MATERIAL) as usize];
    let rotation = word >> SURFACE_ROTATION_SHIFT;
    let hit = &seen.hits[index];
    let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
    let (mut normal, mut uv, mut color) = ([0.0; 3], [0.0; 2], [0.0; 4]);
    let corners = attributes.corners(surface.triangle);
    for (weight, v) in weights.into_iter().zip(&corners) {
        let (n, c) = (octahedral(v.normal), unpack4x8unorm(v.color));
        normal = each(|k| normal[k] + weight * n[k]);
        uv = [0, 1].map(|k| uv[k] + weight * v.uv[k]);
        color = [0, 1, 2, 3].map(|k| color[k] + weight * c[k]);
    }
    let instance = bound.scene.leaves[surface.leaf as usize].instance;
    let m = &bound.scene.instances[instance as usize].object_from_world;
    let mut n = each(|k| m[0][k] * normal[0] + m[1][k] * normal[1] + m[2][k] * normal[2]);
    let size = dot(n, n);
    // No normals, normals that cancel, and normals turned away from the side that was hit give way to the geometric one.
    let inverse = 1.0 / most(size, 1.0e-30).sqrt();
    n = if size > 1.0e-12 { n.map(|x| x * inverse) } else { surface.normal };
    if dot(n, surface.normal) < 0.0 {
        n = n.map(|x| -x);
    }
    let mut base = [0, 1, 2, 3].map(|k| material.base_color[k] * color[k]);
    if material.base_color_texture != NONE {
        let texture = &texels.textures[material.base_color_texture as usize];
        let [a, b, c] = corners.map(|v| v.uv);
        let e1 = [0, 1].map(|k| b[k] - a[k]);
        let e2 = [0, 1].map(|k| c[k] - a[k]);
        let uv_area = (e1[0] * e2[1] - e1[1] * e2[0]).abs() * texture.0.width as f32 * texture.0.height as f32;
        let ray = &seen.rays[index];
        let length = dot(ray.direction, ray.direction).sqrt();
        let cosine = most(dot(ray.direction, surface.normal).abs() / length, 0.05);
        let footprint = hit.t * length * params.step_y[3];
        let area = uv_area / most(surface.area, 1.0e-30) * footprint * footprint / cosine;
        let sample = sample_texture(texture, uv, area);
        base = [0, 1, 2, 3].map(|k| base[k] * sample[k]);
    }
    // Source vertex (i + rotation) mod 3 was stored as vertex i.
    let source = |i: u32| weights[((i + 3 - rotation) % 3) as usize];
    GBuffer {
        albedo: xyz(base),
        state: 1,
        normal: n,
        material: word & SURFACE_MATERIAL,
        emission: material.emission,
        padding: 0,
        weights: [source(1), source(2)],
        uv,
    }
}
