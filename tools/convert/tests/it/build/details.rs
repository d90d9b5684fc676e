//! Tangents and second texture coordinates: stored where a material needs them, turned as the mesh is.

use super::bounded::{Computed, bounded, bytes};
use super::decode::{Decoded, decode};
use super::placement::octahedral;
use super::scenes::*;
use bricks::{AttributeDetail, BRICK_DETAIL, Material, NO_NORMAL, NORMAL, OCCLUSION};
use brickwalk_convert::source::{IDENTITY, Outline, Primitive, Source, SourceError, SourceScene, SourceTexture};
use std::borrow::Cow;

/// A texture of one texel.
fn texel(name: &str, rgba: [u8; 4]) -> SourceTexture {
    SourceTexture { name: name.to_owned(), width: 1, height: 1, wrap: 0, rgba: rgba.to_vec() }
}

/// A square in the plane of x and y whose texture runs along it, turned by a quarter, with the second coordinates
/// halved.
fn square(material: u32, y: f64) -> Primitive {
    let positions = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, z]| [x, y + z, 0.0]).to_vec();
    let uvs: Vec<[f32; 2]> = positions.iter().map(|p| [p[1] as f32, p[0] as f32]).collect();
    let indices = vec![0, 1, 2, 0, 2, 3];
    Primitive {
        material,
        normals: Some(vec![[0.0, 0.0, 1.0]; 4]),
        uvs1: Some(uvs.iter().map(|uv| uv.map(|c| c / 2.0)).collect()),
        uvs: Some(uvs),
        // u grows along y, v along x: cross(z, y) = -x.
        tangents: Some(vec![[0.0, 2.0, 0.0, -1.0]; 6]),
        positions,
        indices,
        ..Primitive::default()
    }
}

fn squares(primitives: Vec<Primitive>, world_from_mesh: [f64; 12]) -> SourceScene {
    let mut source = scene(vec![mesh("m", primitives)], vec![placement("n", 0, world_from_mesh)]);
    source.materials[0].normal_texture = 0;
    source.textures = vec![texel("normals", [128, 128, 255, 255])];
    source
}

/// Details of the vertices of material 0, of those of others, and how many bricks have the flag.
fn details(scene: &Decoded) -> ([Vec<AttributeDetail>; 2], usize) {
    let mut found = [Vec::new(), Vec::new()];
    let detailed = scene.bricks.iter().filter(|brick| brick.record.flags & BRICK_DETAIL != 0);
    for brick in detailed.clone() {
        for (corners, &material) in brick.attribute_indices.iter().zip(&brick.materials) {
            found[(material != 0) as usize].extend(corners.map(|corner| brick.details[corner as usize]));
        }
    }
    (found, detailed.count())
}

#[test]
fn tangents_turn_with_the_mesh_and_mirrors_turn_the_side() {
    for scale in [[1.0; 3], [-1.0, 1.0, 1.0], [2.0, 0.5, 1.0]] {
        let linear = rotation(0.9, scale);
        let source = squares(vec![square(0, 0.0)], matrix(linear, [3.0, 4.0, 5.0]));
        let scene = decode(&built(&source, &settings(10)).path());
        let ([found, _], _) = details(&scene);
        assert_eq!(found.len(), 6);
        let vertices = &scene.bricks[0].attributes;
        for (vertex, detail) in vertices.iter().zip(&scene.bricks[0].details) {
            let column = |k: usize| {
                let v = linear.map(|row| row[k]);
                let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
                v.map(|c| c / length)
            };
            let (normal, tangent) = (octahedral(vertex.normal), octahedral(detail.tangent));
            let [bitangent, along] = [column(0), column(1)];
            for k in 0..3 {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                let cross = normal[i] * tangent[j] - normal[j] * tangent[i];
                assert!((tangent[k] - along[k]).abs() < 1e-4, "{tangent:?} is not {along:?}");
                let side = f64::from(detail.handedness) * cross;
                assert!((side - bitangent[k]).abs() < 1e-3, "axis {k}: {side} is not {}", bitangent[k]);
            }
            assert_eq!(detail.uv, vertex.uv.map(|c| c / 2.0));
        }
        let mirrored = scale[0] < 0.0;
        assert!(found.iter().all(|detail| (detail.handedness > 0.0) == mirrored), "{found:?}");
    }
}

#[test]
fn details_are_stored_where_they_are_needed() {
    let both = squares(vec![square(0, 0.0), square(1, 50.0)], IDENTITY);
    // One brick for both, then one for each.
    for (limit, bricks) in [(10, 1), (2, 2)] {
        let scene = decode(&built(&both, &settings(limit)).path());
        let ([needed, others], detailed) = details(&scene);
        assert_eq!((scene.bricks.len(), detailed, needed.len()), (bricks, 1, 6));
        assert!(needed.iter().all(|detail| detail.handedness == -1.0 && detail.tangent != NO_NORMAL));
        let nothing = AttributeDetail { tangent: NO_NORMAL, handedness: 0.0, uv: [0.0; 2] };
        assert!(others.iter().all(|detail| *detail == nothing) && others.len() == if bricks == 1 { 6 } else { 0 });
        assert!(scene.resident.manifest.has_normal_maps && !scene.resident.manifest.is_glossy);
    }
    // Without tangents, with bad ones, and for the second set alone.
    let mut bad = square(0, 0.0);
    bad.tangents = Some(vec![[0.0; 4], [f32::NAN; 4], [0.0, 0.0, 0.0, -1.0], [0.0; 4], [1.0; 4], [1.0, 0.0, 0.0, 0.0]]);
    let ([found, _], _) = details(&decode(&built(&squares(vec![bad], IDENTITY), &settings(10)).path()));
    let signs: Vec<f32> = found.iter().map(|detail| detail.handedness).collect();
    assert_eq!(signs.iter().filter(|sign| **sign == 0.0).count(), 4, "{signs:?}");
    assert_eq!(signs.iter().filter(|sign| **sign == 1.0).count(), 2, "{signs:?}");
    let mut second = squares(vec![Primitive { tangents: None, ..square(0, 0.0) }], IDENTITY);
    (second.materials[0].normal_texture, second.materials[0].occlusion_texture) = (bricks::NONE, 0);
    let without = decode(&built(&second, &settings(10)).path());
    assert!(without.bricks[0].details.is_empty() && !without.resident.manifest.has_normal_maps);
    second.materials[0].uv_sets = 1 << OCCLUSION;
    let ([found, _], _) = details(&decode(&built(&second, &settings(10)).path()));
    assert!(found.iter().all(|detail| detail.tangent == NO_NORMAL && detail.handedness == 0.0));
    assert!(found.iter().any(|detail| detail.uv == [0.5, 0.5]));
}

#[test]
fn textures_used_in_two_ways_are_stored_twice() {
    let mut source = squares(vec![square(0, 0.0)], IDENTITY);
    let material = &mut source.materials[0];
    (material.base_color_texture, material.emissive_texture, material.emission) = (0, 1, [2.0, 4.0, 6.0]);
    (material.metallic_roughness_texture, material.occlusion_texture) = (2, 2);
    source.textures.extend([texel("glow", [255, 188, 0, 255]), texel("rough", [10, 20, 30, 40])]);
    let scene = decode(&built(&source, &settings(10)).path());
    let found = &scene.resident.materials[0];
    assert_eq!(found.textures(), [0, 1, 3, 3, 2]);
    let flags: Vec<u32> = scene.resident.textures.iter().map(|texture| texture.flags).collect();
    assert_eq!(flags, [bricks::TEXTURE_SRGB, 0, bricks::TEXTURE_SRGB, 0]);
    let encodings: Vec<&str> = scene.resident.textures.iter().map(bricks::Texture::encoding_name).collect();
    assert_eq!(encodings, ["bc7", "bc5", "bc7", "bc7"], "normals apart");
    assert_eq!(scene.resident.manifest.texture_names, ["normals", "normals", "glow", "rough"]);
    let mean = scene.bricks[0].record.mean_emission;
    let expected = [2.0, 4.0 * 0.5028865, 0.0];
    assert!((0..3).all(|k| (mean[k] - expected[k]).abs() < 1e-5), "{mean:?}");
}

/// [`Computed`], whose every other part has a normal texture and a second set of coordinates.
pub struct Detailed {
    plain: Computed,
    outline: Outline,
    turned: bool,
}

impl Detailed {
    pub fn new(plain: Computed, turned: bool) -> Self {
        let mut outline = plain.outline().clone();
        outline.textures = vec!["normals".to_owned()];
        outline.materials[1] = Material { normal_texture: 0, uv_sets: 1 << NORMAL, ..outline.materials[1] };
        Self { plain, outline, turned }
    }
}

impl Source for Detailed {
    fn outline(&self) -> &Outline {
        &self.outline
    }

    fn part(&self, mesh: usize, part: usize) -> Result<Cow<'_, Primitive>, SourceError> {
        let mut primitive = self.plain.part(mesh, part)?.into_owned();
        let mut random = Random(part as u64);
        let vertices = primitive.positions.len();
        primitive.normals = Some((0..vertices).map(|_| random.point(1.0).map(|c| c as f32)).collect());
        primitive.uvs1 = Some((0..vertices).map(|_| [random.next() as f32, 0.5]).collect());
        let mut tangent = |i: usize| {
            let [x, y, z] = random.point(1.0).map(|c| c as f32);
            [x, y, z, if i.is_multiple_of(3) == self.turned { 1.0 } else { -1.0 }]
        };
        primitive.tangents = Some((0..primitive.indices.len()).map(&mut tangent).collect());
        Ok(Cow::Owned(primitive))
    }

    fn texture(&self, _index: usize) -> Result<Cow<'_, SourceTexture>, SourceError> {
        Ok(Cow::Owned(texel("normals", [128, 128, 255, 255])))
    }
}

#[test]
fn the_file_does_not_depend_on_memory_with_details_either() {
    let source = Detailed::new(Computed::new(60_000, 40_000), false);
    let all = bytes(&source, &bounded(2, 1000));
    assert!(bytes(&source, &bounded(1, 40)) == all);
    assert!(bytes(&source, &bounded(2, 50)) == all);
    assert!(bytes(&Detailed::new(Computed::new(60_000, 40_000), true), &bounded(2, 50)) != all, "the side is stored");
}
