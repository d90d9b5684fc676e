//! Reads the attributes of hits in bricks whose attributes are resident: twin of `shaders/shade/resolve.wgsl`. Normal,
//! tangent, texture coordinates, the material without its textures, and what of these the pixel covers.

use crate::kernels::bound::Bound;
use crate::kernels::layout::{
    GBUFFER_BACK, GBUFFER_FIRST, GBUFFER_READ, GBUFFER_REFRACTS, GBuffer, INSTANCE_MIRRORED, INSTANCE_STRETCHED,
    MATERIAL_ANISOTROPIC, MATERIAL_MORE, MATERIAL_REFRACTS, More, NO_NORMAL, NONE, PARAM_REFRACT, Params, Ray,
    STATE_ATTRIBUTES, Surface,
};
use crate::kernels::payloads::AttributeView;
use crate::kernels::rays::RaySet;
use crate::kernels::shade::cones::WIDEST;
use crate::kernels::shade::more;
use crate::kernels::texture::sample::settle;
use crate::kernels::vector::{Vec3, cross, dot, each, least, most, normalize, unpack4x8unorm, xyz};
use crate::math::exact::{divide, square_root};
use bricks::{Material, NORMAL, SURFACE_MATERIAL, SURFACE_ROTATION_SHIFT};
use rayon::prelude::*;

/// Of the angle between a ray and a normal; below it a footprint is that of this one.
const LEAST_COSINE: f32 = 0.05;

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

/// Normals and tangents of vertices are unit vectors in the world before they are interpolated; see the kernel.
fn unit_or_zero(v: Vec3) -> Vec3 {
    let inverse = 1.0 / most(dot(v, v), 1.0e-30).sqrt();
    each(|k| v[k] * inverse)
}

/// Of the surface that has such unit normals at the corners of a triangle of half this area; see the kernel.
fn curvature_of([a, b, c]: [Vec3; 3], area: f32) -> f32 {
    let covered = cross(each(|k| b[k] - a[k]), each(|k| c[k] - a[k]));
    dot(covered, covered).sqrt() / most(area, 1.0e-30)
}

/// Tangent of the angle by which a reflection widens the cone of a camera ray that went so far; see the kernel.
fn bend(params: &Params, curvature: f32, way: f32) -> f32 {
    if curvature == 0.0 {
        return 0.0;
    }
    least(way * params.step_y[3] * square_root(curvature), WIDEST.sqrt())
}

/// What the pixel covers of the textures' unit square, an area, by ray cones; see the kernel.
pub(crate) fn footprint_of(params: &Params, ray: &Ray, t: f32, surface: &Surface, [a, b, c]: [[f32; 2]; 3]) -> f32 {
    let e1 = [0, 1].map(|k| b[k] - a[k]);
    let e2 = [0, 1].map(|k| c[k] - a[k]);
    let uv_area = (e1[0] * e2[1] - e1[1] * e2[0]).abs();
    let way = each(|k| ray.origin[k] - params.origin[k]);
    let length = square_root(dot(ray.direction, ray.direction));
    let (to_origin, from_origin) = (square_root(dot(way, way)), t * length);
    let distance = to_origin + from_origin;
    let cosine = most(divide(dot(ray.direction, surface.normal).abs(), length), LEAST_COSINE);
    let width = divide(distance * params.step_y[3], cosine);
    let spread = divide(bend(params, f32::from_bits(surface.emitter), to_origin) * from_origin, cosine);
    divide(uv_area, most(surface.area, 1.0e-30)) * (width * width + spread * spread)
}

/// Of all hits of the shaded set that have none yet. `mores`: of the same hits, or of none.
pub fn resolve(
    bound: &Bound,
    seen: &RaySet,
    (gbuffer, mores): (&mut [GBuffer], &mut [More]),
    materials: &[Material],
    attributes: &[AttributeView],
) {
    let waits: Vec<u32> = materials.iter().map(waits_of).collect();
    let resolved = |index: usize, g: &mut GBuffer, more: Option<&mut More>| {
        let surface = &seen.surfaces[index];
        if surface.leaf == NONE || g.state != 0 {
            return;
        }
        let brick = bound.brick_of(surface.leaf);
        if bound.slots[brick].state & STATE_ATTRIBUTES != 0 {
            let of_hit = read(bound, seen, index, (materials, &waits), &attributes[brick], g);
            if let (Some(more), Some(of_hit)) = (more, of_hit) {
                *more = of_hit;
            }
        }
    };
    let gbuffer = gbuffer.par_iter_mut();
    if mores.is_empty() {
        gbuffer.enumerate().with_min_len(256).for_each(|(index, g)| resolved(index, g, None));
    } else {
        let all = gbuffer.zip(mores).enumerate().with_min_len(256);
        all.for_each(|(index, (g, more))| resolved(index, g, Some(more)));
    }
}

/// What hits of a material wait for: its textures, as bits of a state.
fn waits_of(material: &Material) -> u32 {
    let textures = (0..).zip(material.textures()).filter(|(_, texture)| *texture != NONE);
    textures.fold(0, |bits, (place, _)| bits | 1 << (GBUFFER_FIRST + place))
}

/// What a hit shows, to `g`. Returns its further textures where it has some. `waits` is [`waits_of`] all materials.
fn read(
    bound: &Bound,
    seen: &RaySet,
    index: usize,
    (materials, waits): (&[Material], &[u32]),
    attributes: &AttributeView,
    g: &mut GBuffer,
) -> Option<More> {
    let surface = &seen.surfaces[index];
    let word = attributes.surfaces[surface.triangle as usize];
    let material = &materials[(word & SURFACE_MATERIAL) as usize];
    let rotation = word >> SURFACE_ROTATION_SHIFT;
    let hit = &seen.hits[index];
    let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
    let corners = attributes.corners(surface.triangle);
    let instance = bound.scene.leaves[surface.leaf as usize].instance;
    let place = &bound.scene.instances[instance as usize];
    let is_stretched = place.flags & INSTANCE_STRETCHED != 0;
    let m = &place.object_from_world;
    let turned = |n: Vec3| each(|k| m[0][k] * n[0] + m[1][k] * n[1] + m[2][k] * n[2]);
    let unpacked = |word: u32| {
        let n = octahedral(word);
        if is_stretched { unit_or_zero(turned(n)) } else { n }
    };
    let blend = |a: f32, b: f32, c: f32| 0.0 + weights[0] * a + weights[1] * b + weights[2] * c;
    let [a, b, c] = &corners;
    // Most triangles are flat, and white.
    let is_flat = a.normal == b.normal && a.normal == c.normal;
    let first = unpacked(a.normal);
    let (normal, curvature) = if is_flat {
        (each(|k| blend(first[k], first[k], first[k])), 0.0)
    } else {
        let (second, third) = (unpacked(b.normal), unpacked(c.normal));
        let normal = each(|k| blend(first[k], second[k], third[k]));
        (normal, curvature_of([first, second, third], surface.area))
    };
    let color = if a.color & b.color & c.color == u32::MAX {
        [blend(1.0, 1.0, 1.0); 3]
    } else {
        let (a, b, c) = (unpack4x8unorm(a.color), unpack4x8unorm(b.color), unpack4x8unorm(c.color));
        each(|k| blend(a[k], b[k], c[k]))
    };
    let mut n = if is_stretched { normal } else { turned(normal) };
    let size = dot(n, n);
    // No normals, normals that cancel, and normals turned away from the side that was hit give way to the geometric
    // one.
    let inverse = 1.0 / most(size, 1.0e-30).sqrt();
    n = if size > 1.0e-12 { each(|k| n[k] * inverse) } else { surface.normal };
    let is_turned = dot(n, surface.normal) < 0.0;
    if is_turned {
        n = each(|k| -n[k]);
    }
    // Source vertex (i + rotation) mod 3 was stored as vertex i.
    let source = |i: u32| weights[((i + 3 - rotation) % 3) as usize];
    *g = GBuffer {
        albedo: each(|k| material.base_color[k] * color[k]),
        state: GBUFFER_READ | waits[(word & SURFACE_MATERIAL) as usize],
        normal: n,
        material: word & SURFACE_MATERIAL,
        emission: material.emission,
        weights: [source(1), source(2)],
        uv: [blend(a.uv[0], b.uv[0], c.uv[0]), blend(a.uv[1], b.uv[1], c.uv[1])],
        occlusion: 1.0,
        metallic: material.metallic,
        roughness: material.roughness,
        curvature,
        ..GBuffer::default()
    };
    if g.state != GBUFFER_READ || material.flags & (MATERIAL_ANISOTROPIC | MATERIAL_MORE) != 0 {
        let footprint = |uvs| footprint_of(bound.params, &seen.rays[index], hit.t, surface, uvs);
        g.footprint = footprint(corners.map(|v| v.uv));
        if let Some(details) = attributes.details(surface.triangle) {
            let turned = |t: Vec3| place.world_from_object.map(|row| dot(xyz(row), t));
            let mut along = [0.0; 3];
            for (weight, v) in weights.into_iter().zip(&details) {
                let mut t = octahedral(v.tangent);
                if is_stretched {
                    t = unit_or_zero(turned(t));
                }
                along = each(|k| along[k] + weight * t[k]);
                g.uv1 = [0, 1].map(|k| g.uv1[k] + weight * v.uv[k]);
                g.handedness = v.handedness;
            }
            g.footprint1 = footprint(details.map(|v| v.uv));
            g.tangent = if is_stretched { along } else { turned(along) };
            // Seen from behind, the frame is turned about with its normal.
            if is_turned {
                g.tangent = g.tangent.map(|x| -x);
                g.handedness = -g.handedness;
            }
            if place.flags & INSTANCE_MIRRORED != 0 {
                g.handedness = -g.handedness;
            }
        }
        if g.handedness == 0.0 {
            g.state &= !(1 << (GBUFFER_FIRST + NORMAL as u32));
        }
    }
    let more = more::start(g, materials, n);
    if g.state == GBUFFER_READ {
        settle(g, material.flags);
    }
    if is_turned {
        g.state |= GBUFFER_BACK;
    }
    if material.flags & MATERIAL_REFRACTS != 0 && bound.has(PARAM_REFRACT) {
        g.state |= GBUFFER_REFRACTS;
    }
    more
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The corners of a triangle around (0, 0, 1) on a surface, and twice its area.
    fn triangle(point: impl Fn(f32, f32) -> Vec3) -> ([Vec3; 3], f32) {
        let corners = [point(0.0, 0.0), point(0.02, 0.0), point(0.0, 0.02)];
        let [a, b, c] = corners;
        let across = cross(each(|k| b[k] - a[k]), each(|k| c[k] - a[k]));
        (corners, dot(across, across).sqrt())
    }

    #[test]
    fn curvature_is_that_of_balls_and_none_of_what_can_be_unrolled() {
        for radius in [0.25, 1.0, 40.0] {
            let (normals, area) = triangle(|u, v| normalize([u, v, 1.0]));
            let found = curvature_of(normals, radius * radius * area);
            assert!((found * radius * radius - 1.0).abs() < 1e-3, "{radius}: {found}");
        }
        let (_, area) = triangle(|u, v| [u, v, 1.0]);
        assert_eq!(curvature_of([[0.0, 0.0, 1.0]; 3], area), 0.0, "a plane");
        let (normals, _) = triangle(|u, _| normalize([u, 0.0, 1.0]));
        assert_eq!(curvature_of(normals, area), 0.0, "a tube");
        assert_eq!(curvature_of([[0.0; 3]; 3], 0.0), 0.0, "no normals, no area");
    }

    /// The width of the cone of a camera ray, by its angle, that a mirror of such a curvature sent back after 5 units,
    /// another `way` behind it.
    fn width(curvature: f32, way: f32) -> f32 {
        let angle = 1e-4;
        let params = Params { step_y: [0.0, 0.0, 0.0, angle], ..Params::default() };
        let ray = Ray { origin: [0.0, 0.0, 5.0], direction: [0.0, 0.0, -1.0], ..Ray::default() };
        let normal = [0.0, 0.0, 1.0];
        let surface = Surface { normal, area: 1.0, emitter: curvature.to_bits(), ..Surface::default() };
        footprint_of(&params, &ray, way, &surface, [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]).sqrt() / angle
    }

    #[test]
    fn cones_widen_at_balls_and_are_never_wider_than_their_reflections() {
        let radius: f32 = 0.5;
        for way in [0.1, 1.0, 4.0, 20.0] {
            let flat = 5.0 + way;
            assert!((width(0.0, way) / flat - 1.0).abs() < 1e-5, "{way}: a plane");
            // A ray beside the axis turns by twice the angle that the normal does; so much beside it its normal lies.
            let convex = flat + 2.0 * 5.0 * way / radius;
            let found = width(1.0 / (radius * radius), way);
            assert!(found > flat && found < convex, "{way}: {flat} {found} {convex}");
            if way >= 1.0 {
                assert!(found > 0.44 * convex, "{way}: {found} of {convex}");
                let concave = (flat - 2.0 * 5.0 * way / radius).abs();
                assert!(found < 1.1 * concave, "{way}: {found}, from within {concave}");
            }
        }
        // No wider than a ray of a hundred over the hemisphere.
        let widest = (std::f32::consts::PI / 100.0).sqrt() * 20.0 / 1e-4;
        assert!((width(1e12, 20.0) / widest - 1.0).abs() < 1e-4);
    }
}
