//! Texture lookups against the decoder of another library, naive bilinear lookups in f64, and heavily supersampled
//! pictures.

use super::look_up::Lookups;
use super::sample::look_up;
use super::texels::{Sampling, Texels, TileDemand};
use super::texture::{Levels, color_at, level_at, levels_of, tile_at};
use super::{bc5, bc7};
use crate::kernels::layout::{GBUFFER_COARSER, GBUFFER_FIRST, GBUFFER_READ, GBuffer, NONE, Params, Ray, Surface};
use crate::kernels::shade::resolve::footprint_of;
use block_compression::decode::decompress_blocks_as_rgba8;
use block_compression::{BC7Settings, CompressionVariant};
use bricks::{Payload, SceneFile, TEXTURE_BC7, Texture};
use brickwalk_convert::build::{BuildSettings, TextureEncoding, build};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{IDENTITY, Mesh, Placement, Primitive, SourceScene, SourceTexture};
use brickwalk_scenes::Rng;
use std::f64::consts::TAU;

/// Blocks in rows of `width` texels by the other library.
fn decoded(blocks: &[u8], width: u32, height: u32) -> Vec<u8> {
    decoded_as(CompressionVariant::BC7(BC7Settings::opaque_ultra_fast()), blocks, width, height)
}

fn decoded_as(variant: CompressionVariant, blocks: &[u8], width: u32, height: u32) -> Vec<u8> {
    let mut rgba = vec![0; (4 * width * height) as usize];
    decompress_blocks_as_rgba8(variant, width, height, blocks, &mut rgba);
    rgba
}

#[test]
fn blocks_of_all_modes_decode_as_another_library_does() {
    let mut rng = Rng::new(41, &[]);
    let mut other = 0;
    for mode in 0..9 {
        for shape in 0..256 {
            let mut block: [u8; 16] = std::array::from_fn(|_| rng.int(0, 255) as u8);
            // The mode by its lowest bits, then the bits in which partition, rotation and selection begin, each once.
            let low = u32::from_le_bytes([block[0], block[1], block[2], block[3]]);
            let header = (if mode < 8 { 1 << mode } else { 0 }) | shape << (mode + 1);
            let kept = low >> (mode + 9) << (mode + 9);
            block[..4].copy_from_slice(&(kept | header).to_le_bytes());
            if mode == 8 {
                block[0] = 0;
            }
            let words = [0, 1, 2, 3].map(|w| u32::from_le_bytes(block[4 * w..4 * w + 4].try_into().unwrap()));
            let expected = decoded(&block, 4, 4);
            for texel in 0..16 {
                let own = bc7::texel(words, texel).to_le_bytes();
                assert_eq!(own, expected[4 * texel as usize..][..4], "mode {mode}, block {block:02x?}, texel {texel}");
            }
            // Control: another bit is another block, almost always.
            let changed = bc7::texel([words[0], words[1], words[2] ^ 0x0101_0101, words[3]], 5);
            other += u32::from(changed != bc7::texel(words, 5));
        }
    }
    assert!(other > 500, "{other}");
}

/// Texels of a block of BC5 in f64 by the words of its specification and of `bricks/FORMAT.md`.
fn direction_of(block: &[u8; 16], texel: usize) -> [u8; 4] {
    let channel = |half: &[u8]| {
        let [e0, e1] = [half[0], half[1]].map(f64::from);
        let bit = |i: usize| usize::from(half[2 + i / 8] >> (i % 8) & 1);
        let index = bit(3 * texel) + 2 * bit(3 * texel + 1) + 4 * bit(3 * texel + 2);
        let values = if e0 > e1 {
            [7.0, 0.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0].map(|w| (w * e0 + (7.0 - w) * e1) / 7.0)
        } else {
            let [a, b, c, d] = [4.0, 3.0, 2.0, 1.0].map(|w| (w * e0 + (5.0 - w) * e1) / 5.0);
            [e0, e1, a, b, c, d, 0.0, 255.0]
        };
        values[index].round()
    };
    let [x, y] = [channel(&block[..8]), channel(&block[8..])];
    let rest = 1.0 - (x / 127.5 - 1.0).powi(2) - (y / 127.5 - 1.0).powi(2);
    // Nothing lies close to the middle of two bytes but what lies there, where z is 0.
    let z = (127.5 + 127.5 * rest.max(0.0).sqrt() + 1e-6).round();
    [x as u8, y as u8, z as u8, 255]
}

#[test]
fn blocks_of_directions_decode_as_their_definition_says() {
    let mut rng = Rng::new(43, &[]);
    let (mut exchanged, mut apart) = (0, 0);
    for number in 0..2000 {
        let mut block: [u8; 16] = std::array::from_fn(|_| rng.int(0, 255) as u8);
        if number % 50 == 0 {
            block[1] = block[0];
        }
        let words =
            |block: &[u8; 16]| [0, 1, 2, 3].map(|w| u32::from_le_bytes(block[4 * w..4 * w + 4].try_into().unwrap()));
        let mut other = block;
        other.swap(0, 1);
        let found = decoded_as(CompressionVariant::BC5, &block, 4, 4);
        for texel in 0..16 {
            let own = bc5::texel(words(&block), texel as u32).to_le_bytes();
            let expected = direction_of(&block, texel);
            assert_eq!(own, expected, "block {block:02x?}, texel {texel}");
            // The other library rounds down.
            let steps = [0, 1].map(|k| own[k].wrapping_sub(found[4 * texel + k]));
            assert!(steps.iter().all(|&step| step <= 1), "block {block:02x?}, texel {texel}: {steps:?}");
            // Control: endpoints the other way round are noticed, and so is rounding down.
            exchanged += u32::from(bc5::texel(words(&other), texel as u32).to_le_bytes() != expected);
            apart += u32::from(steps != [0; 2]);
        }
    }
    assert!(exchanged > 25_000 && apart > 8000, "{exchanged} {apart}");
    // Every direction: of all bytes of x and y.
    for (x, y) in (0..=255u8).flat_map(|y| (0..=255).map(move |x| (x, y))) {
        let block: [u8; 16] = std::array::from_fn(|i| [x, x, 0, 0, 0, 0, 0, 0, y, y, 0, 0, 0, 0, 0, 0][i]);
        let words = [u32::from(x) * 0x101, 0, u32::from(y) * 0x101, 0];
        assert_eq!(bc5::texel(words, 7).to_le_bytes(), direction_of(&block, 7), "{x}, {y}");
    }
}

/// A scene of one triangle with textures of sizes and ways to wrap of their own.
fn scene(encoding: TextureEncoding, textures: Vec<SourceTexture>) -> SceneFile {
    let primitive = Primitive {
        positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        indices: vec![0, 1, 2],
        ..Primitive::default()
    };
    let material =
        |i: usize| bricks::Material { base_color: [1.0; 4], base_color_texture: i as u32, ..bricks::Material::DIFFUSE };
    let source = SourceScene {
        meshes: vec![Mesh { name: "m".into(), primitives: vec![primitive] }],
        placements: vec![Placement {
            name: "p".into(),
            mesh: 0,
            source: 0,
            world_from_mesh: IDENTITY,
            ..Placement::default()
        }],
        materials: (0..textures.len()).map(material).collect(),
        textures,
        sources: vec![bricks::Source { name: "t".into(), bytes: 0, hash: "2d06800538d394c2".into() }],
        ..SourceScene::default()
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.bricks");
    build(source, &BuildSettings { textures: encoding, ..BuildSettings::default() }, &path, &Progress::hidden())
        .unwrap();
    SceneFile::from_bytes("textures", std::fs::read(&path).unwrap()).unwrap()
}

fn noise(size: [u32; 2], wrap: u32, alpha: bool) -> SourceTexture {
    let texel = |i: u32| {
        let [x, y] = [i % size[0], i / size[0]];
        let hash = |k: u32| {
            (x / 3).wrapping_mul(0x9E37_79B1) ^ (y / 2).wrapping_mul(0x85EB_CA77) ^ k.wrapping_mul(0xC2B2_AE3D)
        };
        [1, 2, 3, 4].map(|k| if k == 4 && !alpha { 255 } else { (hash(k).wrapping_mul(0x27D4_EB2F) >> 24) as u8 })
    };
    let rgba = (0..size[0] * size[1]).flat_map(texel).collect();
    SourceTexture { name: "noise".into(), width: size[0], height: size[1], wrap, rgba }
}

/// The words of all tiles.
fn tiles(scene: &SceneFile) -> Vec<Vec<u32>> {
    let tile = |tile| {
        let payload = Payload::Tile(tile);
        let mut words = vec![0u32; scene.loaded_bytes(payload) as usize / 4];
        scene.copy(payload, bytemuck::cast_slice_mut(&mut words)).unwrap();
        words
    };
    (0..scene.resident().tiles.len() as u32).map(tile).collect()
}

/// A level as one picture, put together from tiles, or out of the tail, by the other library.
fn picture(scene: &SceneFile, number: usize, level: u32) -> Vec<[u8; 4]> {
    let t: &Texture = &scene.resident().textures[number];
    let [width, height] = t.size(level);
    let read = |payload| {
        let mut bytes = vec![0; scene.loaded_bytes(payload) as usize];
        scene.copy(payload, &mut bytes).unwrap();
        bytes
    };
    let texels = |bytes: Vec<u8>, w, h| if t.encoding == TEXTURE_BC7 { decoded(&bytes, w, h) } else { bytes };
    let mut out = vec![[0; 4]; (width * height) as usize];
    let mut put = |rgba: &[u8], corner: [u32; 2], pitch: u32, rows: u32| {
        for (y, x) in (0..rows).flat_map(|y| (0..pitch).map(move |x| (y, x))) {
            if corner[0] + x < width && corner[1] + y < height {
                let at = 4 * (y * pitch + x) as usize;
                out[((corner[1] + y) * width + corner[0] + x) as usize] = rgba[at..at + 4].try_into().unwrap();
            }
        }
    };
    if level >= t.tail_level() {
        let [w, h] = [width, height].map(|side| side.next_multiple_of(4));
        let bytes = if t.encoding == TEXTURE_BC7 { w * h } else { 4 * w * h } as usize;
        let first = t.tail_offset(level) as usize;
        let tail = read(Payload::Texture(number as u32))[first..first + bytes].to_vec();
        put(&texels(tail, w, h), [0; 2], w, h);
        return out;
    }
    let [columns, rows] = t.tiles_of(level);
    for tile in 0..columns * rows {
        let bytes = read(Payload::Tile(t.first_tile + t.first_of_level(level) + tile));
        put(&texels(bytes, 128, 128), [tile % columns * 128, tile / columns * 128], 128, 128);
    }
    out
}

/// Bilinear lookup in a whole level in f64.
fn naive(picture: &[[u8; 4]], size: [u32; 2], wrap: u32, uv: [f32; 2], is_srgb: bool) -> [f64; 4] {
    let fold = |x: i64, size: i64, mode: u32| match mode {
        bricks::WRAP_CLAMP => x.clamp(0, size - 1),
        bricks::WRAP_MIRROR if x.rem_euclid(2 * size) >= size => 2 * size - 1 - x.rem_euclid(2 * size),
        bricks::WRAP_MIRROR => x.rem_euclid(2 * size),
        _ => x.rem_euclid(size),
    };
    let p = [0, 1].map(|k| f64::from(uv[k]) * f64::from(size[k]) - 0.5);
    let texel = |dx: i64, dy: i64| {
        let x = fold(p[0].floor() as i64 + dx, size[0].into(), wrap & 0xffff);
        let y = fold(p[1].floor() as i64 + dy, size[1].into(), wrap >> 16);
        let bytes = picture[(y * i64::from(size[0]) + x) as usize];
        let linear = |c: f64| if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
        std::array::from_fn::<f64, 4, _>(|k| {
            let c = f64::from(bytes[k]) / 255.0;
            if k < 3 && is_srgb { linear(c) } else { c }
        })
    };
    let f = p.map(|p| p - p.floor());
    let four = [texel(0, 0), texel(1, 0), texel(0, 1), texel(1, 1)];
    let weights = [(1.0 - f[0]) * (1.0 - f[1]), f[0] * (1.0 - f[1]), (1.0 - f[0]) * f[1], f[0] * f[1]];
    std::array::from_fn(|k| (0..4).map(|i| weights[i] * four[i][k]).sum())
}

#[test]
fn lookups_are_bilinear_over_borders_of_tiles_and_however_they_wrap() {
    let sizes = [[300, 140], [129, 513], [256, 128], [61, 17]];
    let wraps = [bricks::WRAP_REPEAT, bricks::WRAP_CLAMP, bricks::WRAP_MIRROR];
    let all = || {
        sizes
            .iter()
            .flat_map(|&size| wraps.map(|wrap| noise(size, wrap | wraps[size[0] as usize % 3] << 16, size[0] == 300)))
    };
    let (mut wide, mut several, mut control) = (0, 0, 0);
    for encoding in [TextureEncoding::Bc7, TextureEncoding::Raw] {
        let scene = scene(encoding, all().collect());
        let texels = Texels::new(&scene).unwrap();
        let tiles = tiles(&scene);
        let tiles: Vec<&[u32]> = tiles.iter().map(|words| &words[..]).collect();
        let from = Sampling { texels: &texels, tiles: &tiles };
        let mut rng = Rng::new(7, &[]);
        for (number, t) in texels.textures.iter().enumerate() {
            let record = &scene.resident().textures[number];
            assert_eq!(record.tile_count > 0, number < 9, "the last sizes fit into a tail");
            for level in 0..record.levels {
                let picture = picture(&scene, number, level);
                let size = record.size(level);
                for lookup in 0..200 {
                    // At random, and around corners of tiles and of the picture.
                    let near = |rng: &mut Rng, size: u32| {
                        let corner = rng.int(-2, 2 + i64::from(size / 128)) as f64 * 128.0;
                        let edge = rng.int(-2, 3) as f64 * f64::from(size);
                        let at = if lookup % 4 == 0 { corner } else { edge } + rng.range(-2.0, 2.0);
                        (at / f64::from(size)) as f32
                    };
                    let uv = if lookup % 2 == 0 {
                        [0, 1].map(|k| near(&mut rng, size[k]))
                    } else {
                        [0, 1].map(|_| rng.range(-3.0, 3.0) as f32)
                    };
                    let uv = uv.map(|x| x.clamp(-3.9, 3.9));
                    let around = level_at(t, level, uv);
                    let distinct = (0..4).filter(|&k| tile_at(&around, k) != NONE).count();
                    (wide, several) = (wide + u32::from(distinct > 0), several + u32::from(distinct > 1));
                    let own = color_at(t, &around, from);
                    let expected = naive(&picture, size, record.wrap, uv, true);
                    // The place of a lookup is off by 2^-22 of the picture in f32, its colour by as much of the
                    // steepest slope.
                    let bound = 2e-6 * f64::from(size[0].max(size[1])) + 4e-6;
                    for k in 0..4 {
                        let apart = (f64::from(own[k]) - expected[k]).abs();
                        assert!(apart <= bound, "{encoding:?} {number} level {level} at {uv:?}: {own:?}, {expected:?}");
                    }
                    // Control: half a texel aside is noticed.
                    let aside = naive(&picture, size, record.wrap, [uv[0] + 0.5 / size[0] as f32, uv[1]], true);
                    control += u32::from((0..3).any(|k| (f64::from(own[k]) - aside[k]).abs() > bound));
                }
            }
        }
    }
    assert!(wide > 5000 && several > 500 && control > 20_000, "{wide} {several} {control}");
}

#[test]
fn a_hit_waits_for_all_of_its_tiles() {
    let scene = scene(TextureEncoding::Bc7, vec![noise([512, 512], 0, false)]);
    let texels = Texels::new(&scene).unwrap();
    let whole = tiles(&scene);
    let mut held: Vec<&[u32]> = vec![&[]; whole.len()];
    // On the corner of four tiles of level 0, which lie in one tile of level 1: between levels 0 and 1.
    let uv = [0.5; 2];
    let footprint = 2.0 / (512.0 * 512.0);
    let waiting =
        GBuffer { albedo: [1.0; 3], state: GBUFFER_READ | 1 << GBUFFER_FIRST, uv, footprint, ..GBuffer::default() };
    let all: Vec<&[u32]> = whole.iter().map(|words| &words[..]).collect();
    let asked = |g: &mut GBuffer, tiles: &[&[u32]]| -> Vec<(usize, u32, u32, u32)> {
        let demand: Vec<TileDemand> = tiles.iter().map(|_| TileDemand::default()).collect();
        let from = Sampling { texels: &texels, tiles };
        look_up(g, 77, &Lookups { from, demand: &demand, takes_coarser: false });
        let demand = demand.iter().map(TileDemand::get).enumerate();
        demand.filter(|(_, d)| d.rays + d.used > 0).map(|(i, d)| (i, d.rays, d.first, d.used)).collect()
    };
    let mut with_all = waiting;
    let used = asked(&mut with_all, &all);
    let needed: Vec<usize> = used.iter().map(|one| one.0).collect();
    // Level 1 has a border in the middle as well.
    assert_eq!(needed, [5, 6, 9, 10, 16, 17, 18, 19]);
    assert!(with_all.state == GBUFFER_READ && used.iter().all(|one| (one.1, one.3) == (0, 1)), "{used:?}");
    let mut g = waiting;
    for &tile in &needed {
        let found = asked(&mut g, &held);
        assert!(g == waiting && found.iter().all(|one| *one == (one.0, 1, 77, 0)), "it waits: {found:?}");
        assert_eq!(found.iter().map(|one| one.0).collect::<Vec<_>>(), needed, "it asks for what it has, too");
        held[tile] = &whole[tile];
    }
    assert_eq!(asked(&mut g, &held), used);
    assert_eq!(g, with_all, "what else is resident does not show");
}

#[test]
fn the_next_resident_level_stands_for_missing_tiles() {
    let scene = scene(TextureEncoding::Raw, vec![noise([512, 512], 0, false)]);
    let texels = Texels::new(&scene).unwrap();
    let whole = tiles(&scene);
    let uv = [0.5; 2];
    let footprint = 2.0 / (512.0 * 512.0);
    let waiting =
        GBuffer { albedo: [1.0; 3], state: GBUFFER_READ | 1 << GBUFFER_FIRST, uv, footprint, ..GBuffer::default() };
    let held: Vec<&[u32]> = vec![&[]; whole.len()];
    let t = &texels.textures[0];
    assert_eq!((t.levels, t.tail_level, whole.len()), (10, 2, 20));
    let look = |held: &[&[u32]]| {
        let from = Sampling { texels: &texels, tiles: held };
        let demand: Vec<TileDemand> = held.iter().map(|_| TileDemand::default()).collect();
        let mut g = waiting;
        let is_coarser = look_up(&mut g, 77, &Lookups { from, demand: &demand, takes_coarser: true });
        let state = if is_coarser { GBUFFER_READ | GBUFFER_COARSER } else { GBUFFER_READ };
        assert!(g.state == state && demand.iter().all(|d| d.get().rays == 0), "no hit waits");
        let used = demand.iter().filter(|d| d.get().used > 0).count();
        (is_coarser, used, g.albedo)
    };
    let all: Vec<&[u32]> = whole.iter().map(|words| &words[..]).collect();
    let of_level = |level| {
        let [r, g, b, _] = color_at(t, &level_at(t, level, uv), Sampling { texels: &texels, tiles: &all });
        [r, g, b]
    };
    // Nothing but the tail, then level 1, then level 0 alone, which is finer than the lookup asks for, then all.
    let steps: [(std::ops::Range<usize>, u32, usize); 3] = [(0..0, 2, 0), (16..20, 1, 4), (0..16, 0, 4)];
    for (tiles, level, read) in steps {
        let mut held = held.clone();
        tiles.for_each(|tile| held[tile] = &whole[tile]);
        assert_eq!(look(&held), (true, read, of_level(level)), "level {level}");
    }
    let (is_coarser, used, albedo) = look(&all);
    assert!(!is_coarser && used == 8);
    assert!((0..3).all(|level| albedo != of_level(level)), "control: it lies between two levels");
}

#[test]
fn levels_follow_from_the_exponent() {
    let scene = scene(TextureEncoding::Raw, vec![noise([256, 64], 0, false)]);
    let t = &Texels::new(&scene).unwrap().textures[0];
    let of = |area: f32| levels_of(t, area / (256.0 * 64.0));
    let one = |finer| Levels { finer, count: 1, share: 0.0 };
    for magnified in [0.0, 0.3, 1.0, f32::NAN, -1.0] {
        assert_eq!(of(magnified), one(0), "{magnified}");
    }
    assert_eq!((of(4.0).finer, of(4.0).share), (1, 0.0));
    assert_eq!((of(3.9999998).finer, of(16.5).finer), (0, 2));
    for coarse in [65_536.0, 1e9, f32::INFINITY] {
        assert_eq!(of(coarse), one(8), "{coarse}");
    }
    for i in 1..1000 {
        let area = 1.0 + 60.0 * i as f32;
        let Levels { finer, count, share } = of(area);
        let exact = 0.5 * f64::from(area).log2();
        if count == 2 {
            assert!((f64::from(finer) + f64::from(share) - exact).abs() < 6e-4, "{area}: {finer} + {share}, {exact}");
        }
    }
}

/// A plane seen through pixels at many angles and distances: the mean difference between what a lookup by ray cones
/// shows and the mean of bilinear lookups in level 0 over the pixel.
#[test]
fn ray_cones_show_what_supersampling_shows() {
    let scene = scene(TextureEncoding::Raw, vec![noise([512, 512], 0, false)]);
    let texels = Texels::new(&scene).unwrap();
    let whole = tiles(&scene);
    let tiles: Vec<&[u32]> = whole.iter().map(|words| &words[..]).collect();
    let from = Sampling { texels: &texels, tiles: &tiles };
    let t = &texels.textures[0];
    let finest = |uv: [f32; 2]| color_at(t, &level_at(t, 0, uv), from);
    // The angle of a pixel; texture coordinates are x and y by `scale`, so two edges of the unit triangle span scale
    // squared.
    let (angle, scale) = (0.004f32, 0.25f32);
    let params = Params { step_y: [0.0, 0.0, 0.0, angle], ..Params::default() };
    let mut rng = Rng::new(3, &[]);
    let mut pixels: Vec<(f64, [f64; 4])> = Vec::new();
    for _ in 0..300 {
        let (slant, turn) = (rng.range(0.0, 1.1) as f32, rng.range(0.0, TAU) as f32);
        let height = 2f64.powf(rng.range(-4.0, 3.0)) as f32;
        let axis = [slant.sin() * turn.cos(), slant.sin() * turn.sin(), -slant.cos()];
        let shift = [rng.range(-9.0, 9.0) as f32, rng.range(-9.0, 9.0) as f32];
        let (right, up) = {
            let right = [-turn.sin(), turn.cos(), 0.0];
            (
                right,
                [
                    axis[1] * right[2] - axis[2] * right[1],
                    axis[2] * right[0] - axis[0] * right[2],
                    axis[0] * right[1] - axis[1] * right[0],
                ],
            )
        };
        let uv_of = |d: [f32; 3]| [0, 1].map(|k| (shift[k] - d[k] / d[2] * height) * scale);
        let wrapped = |uv: [f32; 2]| uv.map(|x| x - x.floor());
        let ray = Ray { direction: axis, ..Ray::default() };
        let surface = Surface { normal: [0.0, 0.0, 1.0], area: 1.0, ..Surface::default() };
        let uvs = [[0.0, 0.0], [scale, 0.0], [0.0, scale]];
        let footprint = footprint_of(&params, &ray, height / slant.cos(), &surface, uvs);
        let by_cone = |footprint: f32| {
            let Levels { finer, count, share } = levels_of(t, footprint);
            let uv = wrapped(uv_of(axis));
            let level = |n| color_at(t, &level_at(t, finer + n, uv), from);
            let (a, b) = (level(0), level(count - 1));
            [0, 1, 2].map(|k| f64::from(a[k] * (1.0 - share) + b[k] * share))
        };
        const SIDE: usize = 48;
        let mut mean = [0.0f64; 3];
        for i in 0..SIDE * SIDE {
            let [x, y] = [i % SIDE, i / SIDE].map(|i| ((i as f32 + 0.5) / SIDE as f32 - 0.5) * angle);
            let color = finest(wrapped(uv_of([0, 1, 2].map(|k| axis[k] + x * right[k] + y * up[k]))));
            (0..3).for_each(|k| mean[k] += f64::from(color[k]) / (SIDE * SIDE) as f64);
        }
        let apart = |color: [f64; 3]| (0..3).map(|k| (color[k] - mean[k]).abs()).sum::<f64>() / 3.0;
        let others = [by_cone(0.0), by_cone(footprint * 64.0), by_cone(footprint / 64.0), by_cone(1e9)].map(apart);
        pixels.push((apart(by_cone(footprint)), others));
    }
    let count = pixels.len() as f64;
    let own = pixels.iter().map(|pixel| pixel.0).sum::<f64>() / count;
    let others = [0, 1, 2, 3].map(|i| pixels.iter().map(|pixel| pixel.1[i]).sum::<f64>() / count);
    println!(
        "mean difference {own:.4}; finest level {:.4}, 3 levels coarser {:.4}, 3 finer {:.4}, coarsest {:.4}",
        others[0], others[1], others[2], others[3]
    );
    assert!(own < 0.02, "{own}");
    // Controls: other levels are worse.
    assert!(others.iter().all(|&other| other > 1.5 * own), "{own} {others:?}");
}
