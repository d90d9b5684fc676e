//! Checks of objects, instances, leaves, materials, textures, lights and the manifest.

use super::rule::{length, rule};
use crate::error::{Flaw, Part};
use crate::layers::{MATERIAL_ANISOTROPIC, MATERIAL_FURTHER, MATERIAL_LAYERS, MATERIAL_MORE};
use crate::layout::Section;
use crate::levels::Level;
use crate::payload::Payload;
use crate::records::WRAP_MIRROR;
use crate::records::{
    BRICK_WIDE, INSTANCE_IDENTITY, INSTANCE_MIRRORED, Instance, LIGHT_DISTANT, Leaf, MATERIAL_BLEND,
    MATERIAL_DOUBLE_SIDED,
};
use crate::records::{
    MATERIAL_MASK, MATERIAL_REFRACTS, MATERIAL_TEXTURES, MATERIAL_UNLIT, MAX_LATTICE_LOG2, MAX_TEXTURE_SIZE,
};
use crate::records::{
    MAX_TRIANGLE_IDS, Material, NONE, STEP_UNIT_LOG2, TEXTURE_BC5, TEXTURE_BC7, TEXTURE_RGBA8, TEXTURE_SRGB,
};
use crate::resident::Resident;

/// Every brick belongs to one object, whose bricks are contiguous.
pub(super) fn objects(resident: &Resident) -> Result<(), Flaw> {
    let bricks = resident.bricks.len() as u64;
    rule(!resident.objects.is_empty(), Part::Section(Section::Objects), || ("no object", "the world's at least"))?;
    let mut brick_count = 0;
    for (index, object) in (0u32..).zip(&resident.objects) {
        let part = Part::Record(Section::Objects, index);
        rule(object._reserved == [0; 2], part, || ("reserved words", "zero in them"))?;
        let logs = [object.step_log2, object.unit_log2];
        rule(logs.iter().all(|log2| log2.unsigned_abs() <= MAX_LATTICE_LOG2), part, || {
            (format!("step 2^{} and unit 2^{}", logs[0], logs[1]), format!("exponents within ±{MAX_LATTICE_LOG2}"))
        })?;
        rule(STEP_UNIT_LOG2.contains(&(logs[0] - logs[1])), part, || {
            let expected = format!("2^{} to 2^{} units", STEP_UNIT_LOG2.start(), STEP_UNIT_LOG2.end());
            (format!("a lattice step of 2^{} device units", logs[0] - logs[1]), expected)
        })?;
        let (first, count) = (u64::from(object.first_brick), u64::from(object.brick_count));
        rule(first + count <= bricks, part, || {
            (format!("bricks {first} to {}", first + count), format!("at most {bricks}"))
        })?;
        brick_count += count;
        let range = first as usize..(first + count) as usize;
        let stranger = resident.bricks[range.clone()].iter().position(|brick| brick.object != index);
        rule(stranger.is_none(), part, || {
            (format!("brick {}, which is not of it", range.start + stranger.unwrap_or(0)), "bricks of this object")
        })?;
        let stored: u64 = resident.bricks[range].iter().map(|brick| u64::from(brick.triangle_count)).sum();
        rule(object.triangle_count <= object.triangle_ids && u64::from(object.triangle_count) <= stored, part, || {
            let found = format!("{} triangles, {} ids, {stored} in bricks", object.triangle_count, object.triangle_ids);
            (found, "as many ids as triangles, each in a brick")
        })?;
        rule(count == 0 || object.triangle_count > 0, part, || {
            (format!("{count} bricks without triangles"), "triangles")
        })?;
    }
    // No brick is in the ranges of two objects, so with equal counts each is in one.
    rule(brick_count == bricks, Part::Section(Section::Objects), || {
        (format!("{brick_count} bricks in all objects"), format!("all {bricks}"))
    })
}

/// Instances place objects by finite, invertible matrices; the first is the world.
pub(super) fn instances(resident: &Resident) -> Result<(), Flaw> {
    let world = resident.instances.first();
    let identity = |instance: &Instance| {
        instance.object == 0
            && instance.base == 0
            && instance.flags == INSTANCE_IDENTITY
            && instance.world_from_object == Instance::IDENTITY
    };
    rule(world.is_some_and(identity), Part::Record(Section::Instances, 0), || {
        (format!("{world:?}"), "object 0 with base 0 and the identity, so flagged")
    })?;
    for (index, instance) in (0u32..).zip(&resident.instances) {
        let part = Part::Record(Section::Instances, index);
        rule(instance._reserved == 0, part, || ("a reserved word", "zero in it"))?;
        let flags = if index == 0 { INSTANCE_IDENTITY } else { INSTANCE_MIRRORED };
        rule(instance.flags & !flags == 0, part, || {
            (format!("flags {:#x}", instance.flags), "the world's flag or mirrored")
        })?;
        let object = resident.objects.get(instance.object as usize);
        rule(object.is_some(), part, || {
            (format!("object {}", instance.object), format!("less than {}", resident.objects.len()))
        })?;
        let ids = object.map_or(0, |object| object.triangle_ids);
        let end = u64::from(instance.base) + u64::from(ids);
        rule(end <= resident.manifest.triangle_ids, part, || {
            let all = resident.manifest.triangle_ids;
            (format!("triangle ids {} to {end}", instance.base), format!("at most {all}, as the manifest says"))
        })?;
        let finite = instance.world_from_object.iter().all(|value| value.is_finite());
        let determinant = instance.determinant();
        rule(finite && determinant.is_finite() && determinant != 0.0, part, || {
            (format!("matrix {:?}", instance.world_from_object), "finite numbers and an inverse")
        })?;
        rule(in_units(resident, instance).iter().all(|value| (*value as f32).is_finite()), part, || {
            (format!("matrix {:?}", instance.world_from_object), "one that f32 holds in device units, and its inverse")
        })?;
        rule((determinant < 0.0) == (instance.flags & INSTANCE_MIRRORED != 0), part, || {
            (
                format!("determinant {determinant}, flags {:#x}", instance.flags),
                "the mirrored flag if and only if negative",
            )
        })?;
    }
    Ok(())
}

/// The numbers of an instance's matrix and of the linear part of its inverse, between device units of its object and of
/// the world. The object exists, and there is an inverse.
fn in_units(resident: &Resident, instance: &Instance) -> [f64; 21] {
    let exp2 = |log2: i32| f64::from(log2).exp2();
    let world = resident.objects[0].unit_log2;
    let scale = exp2(resident.objects[instance.object as usize].unit_log2 - world);
    let (m, determinant) = (&instance.world_from_object, instance.determinant());
    // Cofactor by cofactor, in rows of four; transposed, which does not matter here.
    let cofactor = |i: usize| {
        let at = |row: usize, column: usize| m[4 * ((i / 3 + row) % 3) + (i + column) % 3];
        at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1)
    };
    std::array::from_fn(|i| match i {
        3 | 7 | 11 => m[i] / exp2(world),
        0..12 => m[i] * scale,
        _ => cofactor(i - 12) / determinant / scale,
    })
}

/// `section` has one of `leaves` for every brick, and every one of `levels`, of every instance. Levels are of objects
/// that exist.
pub(super) fn leaves(resident: &Resident, section: Section, leaves: &[Leaf], levels: &[Level]) -> Result<(), Flaw> {
    // Bricks of an object are numbered from its first, its levels behind them in their order.
    let mut own: Vec<u32> = resident.objects.iter().map(|object| object.brick_count).collect();
    let mut places = Vec::with_capacity(levels.len());
    for level in levels {
        let count = &mut own[level.brick.object as usize];
        places.push(*count);
        *count += 1;
    }
    // Leaves of one instance are numbered so from `starts[instance]`, to see that none comes twice.
    let mut starts = Vec::with_capacity(resident.instances.len());
    let mut count = 0u64;
    for instance in &resident.instances {
        starts.push(count);
        count += u64::from(own[instance.object as usize]);
    }
    let all = if levels.is_empty() { "the bricks" } else { "the bricks and levels" };
    rule(count == leaves.len() as u64, Part::Section(section), || {
        (format!("{} leaves", leaves.len()), format!("{count}, {all} of all instances"))
    })?;
    let mut met = vec![false; leaves.len()];
    for (index, leaf) in (0u32..).zip(leaves) {
        let part = Part::Record(section, index);
        let instance = resident.instances.get(leaf.instance as usize);
        let brick = instance.and_then(|instance| {
            let object = &resident.objects[instance.object as usize];
            let Some(level) = leaf.brick.checked_sub(resident.bricks.len() as u32) else {
                return leaf.brick.checked_sub(object.first_brick).filter(|&brick| brick < object.brick_count);
            };
            let is_of_it = levels.get(level as usize)?.brick.object == instance.object;
            is_of_it.then(|| places[level as usize])
        });
        rule(brick.is_some(), part, || {
            (format!("brick {} of instance {}", leaf.brick, leaf.instance), "a brick of the instance's object")
        })?;
        let met = &mut met[(starts[leaf.instance as usize] + u64::from(brick.unwrap_or(0))) as usize];
        rule(!*met, part, || {
            (format!("brick {} of instance {} again", leaf.brick, leaf.instance), "every brick of an instance once")
        })?;
        *met = true;
    }
    Ok(())
}

pub(super) fn materials(resident: &Resident) -> Result<(), Flaw> {
    for (index, material) in (0u32..).zip(&resident.materials) {
        let part = Part::Record(Section::Materials, index);
        let refracts = material.flags & MATERIAL_REFRACTS != 0;
        rule(refracts || material.absorption == 0, part, || {
            (format!("absorption {:#x}", material.absorption), "zero where nothing refracts")
        })?;
        rule(!refracts || material.flags & MATERIAL_BLEND != 0 && material.specular[0] < 1.0, part, || {
            let (flags, specular) = (material.flags, material.specular[0]);
            (format!("flags {flags:#x}, specular {specular}"), "a body that refracts with BLEND, and specular below 1")
        })?;
        let both = MATERIAL_MASK | MATERIAL_BLEND;
        let known = both | MATERIAL_DOUBLE_SIDED | MATERIAL_UNLIT | MATERIAL_REFRACTS;
        let known = known | MATERIAL_LAYERS | MATERIAL_ANISOTROPIC | MATERIAL_MORE | MATERIAL_FURTHER;
        rule(material.flags & !known == 0 && material.flags & both != both, part, || {
            (format!("flags {:#x}", material.flags), "known flags, not both MASK and BLEND")
        })?;
        let mut factors = material.base_color.iter().chain(&material.emission).chain([&material.alpha_cutoff]);
        rule(factors.all(|value| value.is_finite() && *value >= 0.0), part, || {
            (format!("{material:?}"), "finite factors, not negative")
        })?;
        let Material { metallic, roughness, occlusion_strength, specular_weight, .. } = *material;
        let Material { clearcoat, clearcoat_roughness, transmission, .. } = *material;
        let shares =
            [metallic, roughness, occlusion_strength, specular_weight, clearcoat, clearcoat_roughness, transmission];
        let mut shares = shares.iter().chain(&material.specular);
        rule(shares.all(|share| (0.0..=1.0).contains(share)) && material.normal_scale.is_finite(), part, || {
            (format!("{material:?}"), "shares from 0 to 1, a finite scale of normals")
        })?;
        for texture in material.textures() {
            rule(texture == NONE || (texture as usize) < resident.textures.len(), part, || {
                (format!("texture {texture}"), format!("none or less than {}", resident.textures.len()))
            })?;
        }
        rule(material.uv_sets >> MATERIAL_TEXTURES == 0, part, || {
            (format!("sets of texture coordinates {:#x}", material.uv_sets), "a bit for each texture")
        })?;
        for [u, v] in material.uv_from_set.as_chunks::<2>().0 {
            let finite = u.iter().chain(v).all(|value| value.is_finite());
            rule(finite && u[3] >= 0.0, part, || {
                (format!("coordinates by {u:?}, {v:?}"), "finite numbers, the fourth of the first a determinant")
            })?;
        }
        rule(material.has_sound_layers(), part, || {
            let words: Vec<f32> = material.uv_from_set.iter().skip(1).step_by(2).map(|row| row[3]).collect();
            (
                format!("flags {:#x} and words of layers {words:?}", material.flags),
                "words of 24 bits that the flags name",
            )
        })?;
        let is_further = material.flags & MATERIAL_FURTHER != 0;
        let is_wanted = index > 0 && resident.materials[index as usize - 1].flags & MATERIAL_MORE != 0;
        rule(is_further == is_wanted && (!is_further || material.is_sound_further()), part, || {
            (format!("flags {:#x}", material.flags), "further textures of the material before, and nothing else")
        })?;
        let is_last = index as usize + 1 == resident.materials.len();
        rule(!is_last || material.flags & MATERIAL_MORE == 0, part, || {
            (format!("flags {:#x}", material.flags), "a record of further textures behind it")
        })?;
        let map = material.opacity_map;
        rule(map == NONE || (map as usize) < resident.opacity_maps.len(), part, || {
            (format!("opacity map {map}"), format!("none or less than {}", resident.opacity_maps.len()))
        })?;
    }
    Ok(())
}

pub(super) fn textures(resident: &Resident) -> Result<(), Flaw> {
    let mut tiles = 0;
    for (index, texture) in (0u32..).zip(&resident.textures) {
        let part = Part::Record(Section::Textures, index);
        let sizes = [texture.width, texture.height];
        rule(sizes.iter().all(|size| (1..=MAX_TEXTURE_SIZE).contains(size)), part, || {
            (format!("{} by {} texels", sizes[0], sizes[1]), format!("1 to {MAX_TEXTURE_SIZE} each way"))
        })?;
        let levels = sizes[0].max(sizes[1]).ilog2() + 1;
        rule(texture.levels == levels, part, || {
            (format!("{} levels", texture.levels), format!("{levels}, down to 1 by 1"))
        })?;
        rule(texture.wrap & 0xffff <= WRAP_MIRROR && texture.wrap >> 16 <= WRAP_MIRROR, part, || {
            (format!("wrap {:#x}", texture.wrap), "known ways of wrapping")
        })?;
        rule([TEXTURE_RGBA8, TEXTURE_BC7, TEXTURE_BC5].contains(&texture.encoding), part, || {
            (format!("encoding {}", texture.encoding), "a known one")
        })?;
        rule(texture.flags & !TEXTURE_SRGB == 0, part, || (format!("flags {:#x}", texture.flags), "known flags"))?;
        rule(texture.encoding != TEXTURE_BC5 || texture.flags & TEXTURE_SRGB == 0, part, || {
            ("sRGB in BC5".to_owned(), "BC5 of directions, which are linear")
        })?;
        let own = (u64::from(texture.first_tile), u64::from(texture.tile_count));
        rule(own == (tiles, texture.expected_tiles()), part, || {
            let expected = format!("{} from {tiles} on, as its size says", texture.expected_tiles());
            (format!("{} tiles from {} on", own.1, own.0), expected)
        })?;
        length(Payload::Texture(index), texture.tail, texture.tail_bytes())?;
        for tile in tiles..(tiles + own.1).min(resident.tiles.len() as u64) {
            // A section has less than 2^32 records.
            length(Payload::Tile(tile as u32), resident.tiles[tile as usize], texture.tile_bytes())?;
        }
        tiles += own.1;
    }
    rule(tiles == resident.tiles.len() as u64, Part::Section(Section::Tiles), || {
        (format!("{} tiles", resident.tiles.len()), format!("{tiles}, those of all textures"))
    })
}

pub(super) fn opacity_maps(resident: &Resident) -> Result<(), Flaw> {
    for (index, map) in (0u32..).zip(&resident.opacity_maps) {
        let part = Part::Record(Section::OpacityMaps, index);
        let sizes = [map.width, map.height];
        rule(sizes.iter().all(|size| (1..=MAX_TEXTURE_SIZE).contains(size)), part, || {
            (format!("{} by {} texels", sizes[0], sizes[1]), format!("1 to {MAX_TEXTURE_SIZE} each way"))
        })?;
        rule(map.wrap & 0xffff <= WRAP_MIRROR && map.wrap >> 16 <= WRAP_MIRROR && map._reserved == 0, part, || {
            (format!("wrap {:#x}, reserved word {}", map.wrap, map._reserved), "known ways of wrapping, and zero")
        })?;
        length(Payload::Opacity(index), map.texels, map.texel_bytes().next_multiple_of(16))?;
    }
    Ok(())
}

/// Lights are of known kinds, finite, along unit vectors.
pub(super) fn lights(resident: &Resident) -> Result<(), Flaw> {
    for (index, light) in (0u32..).zip(&resident.lights) {
        let part = Part::Record(Section::Lights, index);
        rule(light.kind <= LIGHT_DISTANT && light._reserved == 0, part, || {
            (format!("kind {}, reserved word {}", light.kind, light._reserved), "a known kind, and zero")
        })?;
        let length = light.direction.iter().map(|x| x * x).sum::<f64>();
        // Written as a unit vector in f64, so that the square is 1 but for a few roundings.
        rule(light.position.iter().all(|x| x.is_finite()) && (length - 1.0).abs() < 1e-9, part, || {
            (format!("position {:?}, direction {:?}", light.position, light.direction), "finite numbers, a unit vector")
        })?;
        let mut values = light.color.iter().chain([&light.range]);
        let [inner, outer] = light.cone;
        let cone = 0.0 <= inner && inner <= outer && outer <= std::f32::consts::FRAC_PI_2;
        rule(values.all(|value| value.is_finite() && *value >= 0.0) && cone, part, || {
            (format!("{light:?}"), "finite numbers, not negative, and angles in order up to a right one")
        })?;
    }
    Ok(())
}

/// The manifest says what the records say.
pub(super) fn manifest(resident: &Resident) -> Result<(), Flaw> {
    let part = Part::Section(Section::Manifest);
    let manifest = &resident.manifest;
    rule(manifest.triangle_ids <= MAX_TRIANGLE_IDS, part, || {
        (format!("{} triangle ids", manifest.triangle_ids), format!("at most {MAX_TRIANGLE_IDS}"))
    })?;
    let stored: u64 = resident.objects.iter().map(|object| u64::from(object.triangle_count)).sum();
    rule(manifest.triangles_stored == stored, part, || {
        (format!("{} triangles stored", manifest.triangles_stored), format!("{stored}, as the objects say"))
    })?;
    let objects = resident.instances.iter().map(|instance| &resident.objects[instance.object as usize]);
    let instanced: u64 = objects.map(|object| u64::from(object.triangle_count)).sum();
    rule(manifest.triangles_instanced == instanced, part, || {
        (
            format!("{} triangles with instances", manifest.triangles_instanced),
            format!("{instanced}, as the records say"),
        )
    })?;
    rule(manifest.has_instances == (resident.instances.len() > 1), part, || {
        (format!("has_instances {}", manifest.has_instances), format!("as of {} instances", resident.instances.len()))
    })?;
    let (names, textures) = (manifest.texture_names.len(), resident.textures.len());
    rule(names == textures, part, || (format!("{names} names of textures"), format!("{textures}, one for each")))?;
    let wide = resident.bricks.iter().any(|brick| brick.flags & BRICK_WIDE != 0);
    rule(manifest.has_wide_bricks == wide, part, || (format!("has_wide_bricks {}", manifest.has_wide_bricks), wide))?;
    let empty = resident.leaves.is_empty();
    let bounds = manifest.min.iter().zip(&manifest.max);
    let right = bounds.clone().all(|(min, max)| min.is_finite() && max.is_finite() && (min <= max) != empty);
    rule(right, part, || {
        (format!("bounds {:?} to {:?}", manifest.min, manifest.max), "finite bounds in order, or min > max if empty")
    })?;
    let ratio = manifest.instance_scale_ratio;
    rule(ratio.is_finite() && ratio >= 1.0, part, || (format!("ratio of scales {ratio}"), "a number from 1"))?;
    let mut end = 0u64;
    for (index, provenance) in manifest.provenance.iter().enumerate() {
        let right = u64::from(provenance.first_id) == end && (provenance.source as usize) < manifest.sources.len();
        rule(right, part, || {
            let found = format!("provenance {index} from id {} in source {}", provenance.first_id, provenance.source);
            (found, format!("id {end} in one of {} sources", manifest.sources.len()))
        })?;
        end += u64::from(provenance.count);
    }
    rule(end == manifest.triangle_ids, part, || {
        (format!("provenance of {end} ids"), format!("all {}", manifest.triangle_ids))
    })
}
