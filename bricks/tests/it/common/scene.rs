//! The scenes, with payloads that are right.

use super::Scene;
use bricks::*;
use std::collections::BTreeMap;

/// Positions of a triangle in lattice steps of its object.
pub type Triangle = [[i64; 3]; 3];

/// A generator of repeatable numbers.
pub struct Numbers(pub u64);

impl Numbers {
    pub fn next(&mut self, bound: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 33) % bound
    }
}

/// Triangles without order within `extent` steps of `corner`, none of zero area.
pub fn triangles(count: usize, corner: [i64; 3], extent: i64, seed: u64) -> Vec<Triangle> {
    let mut numbers = Numbers(seed);
    let mut point = |_| corner.map(|c| c + numbers.next(extent as u64) as i64);
    let mut triangles = Vec::new();
    while triangles.len() < count {
        let triangle = [0, 1, 2].map(&mut point);
        let [a, b, c] = triangle.map(|p| p.map(i128::from));
        let (u, v) = ([0, 1, 2].map(|k| b[k] - a[k]), [0, 1, 2].map(|k| c[k] - a[k]));
        if (0..3).any(|k| u[k] * v[(k + 1) % 3] != u[(k + 1) % 3] * v[k]) {
            triangles.push(triangle);
        }
    }
    triangles
}

fn bounds(triangles: &[Triangle]) -> ([i64; 3], [i64; 3]) {
    let points = || triangles.iter().flatten();
    let axes = [0, 1, 2];
    (axes.map(|k| points().map(|p| p[k]).min().unwrap()), axes.map(|k| points().map(|p| p[k]).max().unwrap()))
}

fn pad16(bytes: &mut Vec<u8>) {
    bytes.resize(bytes.len().next_multiple_of(16), 0);
}

/// A node over children, each with bounds relative to the brick's origin and a meta byte.
fn node(children: &[(Triangle, u8)], child_base: u32, triangle_base: u32, scale_log2: i32) -> Node {
    let boxes: Vec<_> = children.iter().map(|(bounds, _)| *bounds).collect();
    let (min, max) = bounds(&boxes);
    let mut node: Node = bytemuck::Zeroable::zeroed();
    (node.child_base, node.triangle_base) = (child_base, triangle_base);
    for k in 0..3 {
        let mut exponent = 0;
        while (max[k] - min[k] + (1 << exponent) - 1) >> exponent > 255 {
            exponent += 1;
        }
        node.origin[k] = (min[k] as f64 * 2f64.powi(scale_log2)) as f32;
        node.exponent[k] = (127 + exponent + scale_log2) as u8;
        for (slot, (bounds, meta)) in children.iter().enumerate() {
            node.lo[k][slot] = ((bounds[0][k] - min[k]) >> exponent) as u8;
            node.hi[k][slot] = ((bounds[1][k] - min[k] + (1 << exponent) - 1) >> exponent) as u8;
            node.meta[slot] = *meta;
            if meta & 24 == 24 {
                node.inner_mask |= 1 << slot;
            }
        }
    }
    node
}

/// A brick over at most 192 triangles: one node of leaves, or a root over such nodes and leaves of up to 3 triangles.
pub fn brick(
    object: (u32, &Object),
    flags: u32,
    origin: [i64; 3],
    triangles: &[Triangle],
    ids: &[u32],
    materials: u32,
) -> (Brick, Vec<u8>, Vec<u8>) {
    let scale_log2 = object.1.step_log2 - object.1.unit_log2;
    let local: Vec<Triangle> = triangles.iter().map(|t| t.map(|p| [0, 1, 2].map(|k| p[k] - origin[k]))).collect();
    let extent = |t: &[Triangle]| {
        let (min, max) = bounds(t);
        [min, max, max]
    };
    let leaf_node = |first: usize, chunk: &[Triangle]| {
        let leaves: Vec<_> = (0..)
            .zip(chunk.chunks(3))
            .map(|(index, leaf)| (extent(leaf), ((1 << leaf.len()) - 1) << 5 | (3 * index)))
            .collect();
        node(&leaves, 0, first as u32, scale_log2)
    };
    let nodes = if local.len() <= 24 {
        vec![leaf_node(0, &local)]
    } else {
        let (mut inner, mut children, mut triangle_base) = (Vec::new(), Vec::new(), 0);
        for (slot, (first, chunk)) in (0..).zip((0..).step_by(24).zip(local.chunks(24))) {
            if chunk.len() <= 3 {
                triangle_base = first as u32;
                children.push((extent(chunk), ((1u8 << chunk.len()) - 1) << 5));
            } else {
                children.push((extent(chunk), 0x38 + slot));
                inner.push(leaf_node(first, chunk));
            }
        }
        let mut nodes = vec![node(&children, 1, triangle_base, scale_log2)];
        nodes.append(&mut inner);
        nodes
    };

    let mut vertices: Vec<[i64; 3]> = Vec::new();
    let (mut indices, mut surfaces) = (Vec::new(), Vec::new());
    for (index, triangle) in (0..).zip(&local) {
        let rotation = (0..3).min_by_key(|&r| triangle[r]).unwrap();
        surfaces.push(((rotation as u32) << SURFACE_ROTATION_SHIFT) | (index % materials));
        for i in 0..3 {
            let vertex = triangle[(i + rotation) % 3];
            let found = vertices.iter().position(|v| *v == vertex);
            indices.push(found.unwrap_or_else(|| {
                vertices.push(vertex);
                vertices.len() - 1
            }) as u32);
        }
    }
    let index_bytes = |indices: &[u32]| -> Vec<u8> {
        if flags & BRICK_INDEX32 != 0 {
            bytemuck::cast_slice(indices).to_vec()
        } else {
            indices.iter().flat_map(|&index| (index as u16).to_le_bytes()).collect()
        }
    };

    let mut geometry: Vec<u8> = bytemuck::cast_slice(&nodes).to_vec();
    for vertex in &vertices {
        let high = vertex.map(|v| if flags & BRICK_WIDE != 0 { (v + (1 << 22)) >> 23 << 23 } else { v });
        let low = [0, 1, 2].map(|k| vertex[k] - high[k]);
        let parts: &[[i64; 3]] = if flags & BRICK_WIDE != 0 { &[high, low] } else { &[high] };
        for part in parts {
            let part = part.map(|steps| (steps as f64 * 2f64.powi(scale_log2)) as f32);
            geometry.extend_from_slice(bytemuck::bytes_of(&part));
        }
    }
    pad16(&mut geometry);
    geometry.extend_from_slice(bytemuck::cast_slice(ids));
    pad16(&mut geometry);
    geometry.extend_from_slice(&index_bytes(&indices));
    pad16(&mut geometry);

    let corners: Vec<AttributeVertex> = (0..triangles.len() as u32 * 3)
        .map(|i| AttributeVertex { normal: 0x7fff_0000 + i, uv: [i as f32 / 8.0, -0.5], color: 0xffff_ffff - i })
        .collect();
    let mut attributes: Vec<u8> = bytemuck::cast_slice(&corners).to_vec();
    attributes.extend_from_slice(bytemuck::cast_slice(&surfaces));
    pad16(&mut attributes);
    attributes.extend_from_slice(&index_bytes(&(0..corners.len() as u32).collect::<Vec<_>>()));
    pad16(&mut attributes);
    if flags & BRICK_DETAIL != 0 {
        let details = (0..corners.len() as u32).map(|i| match i % 3 {
            0 => AttributeDetail { tangent: NO_NORMAL, handedness: 0.0, uv: [i as f32 / 4.0, 2.0] },
            side => AttributeDetail { tangent: 0x7fff - i, handedness: 3.0 - 2.0 * side as f32, uv: [-0.125; 2] },
        });
        attributes.extend_from_slice(bytemuck::cast_slice(&details.collect::<Vec<_>>()));
    }

    let opacity_count = if flags & BRICK_OPACITY != 0 { triangles.len() as u32 / 2 } else { 0 };
    if opacity_count > 0 {
        // Every other triangle.
        let of: Vec<u32> = (0..triangles.len() as u32).map(|i| if i % 2 == 1 { i / 2 } else { NONE }).collect();
        geometry.extend_from_slice(bytemuck::cast_slice(&of));
        pad16(&mut geometry);
        for i in 0..opacity_count {
            let uv = [[i as f32, 0.25], [0.5, -1.0], [2.0, 3.0]];
            let triangle = OpacityTriangle { uv, material: i % materials, alphas: 0x00ff_80c0 };
            geometry.extend_from_slice(bytemuck::bytes_of(&triangle));
        }
    }

    let (min, max) = bounds(triangles);
    let brick = Brick {
        object: object.0,
        flags,
        node_count: nodes.len() as u32,
        triangle_count: triangles.len() as u32,
        vertex_count: vertices.len() as u32,
        attribute_vertex_count: corners.len() as u32,
        height: if nodes.len() == 1 { 1 } else { 2 },
        origin,
        min,
        max,
        mean_albedo: [0.5, 0.25, 0.125],
        mean_emission: [0.0, 1.5, 0.0],
        root: nodes[0],
        opacity_count,
        ..bytemuck::Zeroable::zeroed()
    };
    (brick, geometry, attributes)
}

/// The cells of the vertices alone: as much as the format asks for.
fn occupied(brick: &Brick, step_log2: i32, triangles: &[Triangle]) -> (OccupancyGrid, OccupancyMap) {
    let grid = OccupancyGrid::of(step_log2, brick.min, brick.max);
    let mut columns = [0; 4096];
    for &vertex in triangles.iter().flatten() {
        let [x, y, z] = grid.cell(step_log2, vertex);
        columns[(x + 64 * y) as usize] |= 1u64 << z;
    }
    (grid, OccupancyMap::of_finest(&columns))
}

/// Bounds of a leaf in steps of the world's lattice, outward.
fn world_bounds(resident: &Resident, leaf: &Leaf) -> Triangle {
    let brick = resident.brick(leaf.brick).unwrap();
    let instance = &resident.instances[leaf.instance as usize];
    let step = 2f64.powi(resident.objects[brick.object as usize].step_log2);
    let world_step = 2f64.powi(resident.objects[0].step_log2);
    let m = &instance.world_from_object;
    let mut corners = Vec::new();
    for corner in 0..8 {
        let p = [0, 1, 2].map(|k| (if corner >> k & 1 == 0 { brick.min[k] } else { brick.max[k] }) as f64 * step);
        let row = |r: usize| (m[4 * r] * p[0] + m[4 * r + 1] * p[1] + m[4 * r + 2] * p[2] + m[4 * r + 3]) / world_step;
        corners.push([
            [0, 1, 2].map(|r| row(r).floor() as i64),
            [0, 1, 2].map(|r| row(r).ceil() as i64),
            [0, 1, 2].map(|r| row(r).ceil() as i64),
        ]);
    }
    let (min, max) = bounds(&corners);
    [min, max, max]
}

fn top_node(children: &[(Triangle, u8)], child_base: u32, leaf_base: u32) -> TopNode8 {
    let boxes: Vec<_> = children.iter().map(|(bounds, _)| *bounds).collect();
    let (origin, _) = bounds(&boxes);
    let node = node(children, child_base, leaf_base, 0);
    TopNode8 {
        origin,
        exponent: node.exponent.map(|exponent| exponent - 127),
        inner_mask: node.inner_mask,
        child_base,
        leaf_base,
        meta: node.meta,
        lo: node.lo,
        hi: node.hi,
        _reserved: 0,
    }
}

/// Three bricks (near, wide, of an instanced object that rays pass through, with details), three instances, two
/// textures, an opacity map, two lights; spans not yet known.
pub fn scene() -> Scene {
    let object = |step_log2, unit_log2, first_brick, brick_count, triangle_ids, triangle_count| Object {
        step_log2,
        unit_log2,
        first_brick,
        brick_count,
        triangle_ids,
        triangle_count,
        _reserved: [0; 2],
    };
    let objects = vec![object(-10, 0, 0, 2, 52, 32), object(-12, -1, 2, 1, 10, 10)];
    let near = triangles(27, [3 << 20, -700, 5], 60_000, 1);
    let wide = triangles(5, [-(1 << 30), 0, -77], 1 << 33, 2);
    let small = triangles(10, [-500, -500, -500], 1000, 3);
    let ids = |range: std::ops::Range<u32>| range.collect::<Vec<_>>();
    let built = [
        brick((0, &objects[0]), 0, [3 << 20, 0, 0], &near, &ids(0..27), 2),
        brick((0, &objects[0]), BRICK_WIDE | BRICK_INDEX32, [0; 3], &wide, &ids(37..42), 2),
        brick((1, &objects[1]), BRICK_OPACITY | BRICK_DETAIL, [0; 3], &small, &ids(0..10), 2),
    ];
    let mut payloads = BTreeMap::new();
    let (mut bricks, mut occupancy) = (Vec::new(), Vec::new());
    let corners = [near, wide, small];
    for (index, ((brick, geometry, attributes), triangles)) in (0..).zip(built.into_iter().zip(&corners)) {
        let (grid, map) = occupied(&brick, objects[brick.object as usize].step_log2, triangles);
        occupancy.push(map.record(&grid));
        bricks.push(brick);
        payloads.insert(Payload::Geometry(index), geometry);
        payloads.insert(Payload::Attributes(index), attributes);
        payloads.insert(Payload::Proxies(index), map.pack());
    }
    let opacity_map =
        OpacityMap { width: 5, height: 3, wrap: WRAP_MIRROR | WRAP_CLAMP << 16, _reserved: 0, texels: Span::default() };
    let mut alphas: Vec<u8> = (100..115).collect();
    pad16(&mut alphas);
    payloads.insert(Payload::Opacity(0), alphas);
    let texture = |width, height, levels, encoding, flags, tile_count| Texture {
        width,
        height,
        levels,
        wrap: WRAP_CLAMP | WRAP_MIRROR << 16,
        encoding,
        flags,
        first_tile: 0,
        tile_count,
        tail: Span::default(),
    };
    // One that is all tail, and one with two tiles. The bytes are any, but blocks have modes.
    let textures = vec![texture(4, 2, 3, TEXTURE_RGBA8, TEXTURE_SRGB, 0), texture(130, 3, 8, TEXTURE_BC7, 0, 2)];
    let texels = |from: u64, bytes: u64| -> Vec<u8> { (from..from + bytes).map(|i| ((i * i / 3) | 1) as u8).collect() };
    for (index, texture) in (0..).zip(&textures) {
        payloads.insert(Payload::Texture(index), texels(u64::from(index), texture.tail_bytes()));
    }
    for tile in 0..2 {
        payloads.insert(Payload::Tile(tile), texels(7 + u64::from(tile), textures[1].tile_bytes()));
    }

    let instance =
        |object, base, flags, world_from_object| Instance { object, base, flags, _reserved: 0, world_from_object };
    let instances = vec![
        instance(0, 0, INSTANCE_IDENTITY, Instance::IDENTITY),
        instance(1, 27, 0, [0.0, -2.0, 0.0, 3075.5, 2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 7.0]),
        instance(1, 42, INSTANCE_MIRRORED, [-1.0, 0.0, 0.0, 3070.0, 0.0, 1.0, 0.0, 0.25, 0.0, 0.0, 1.0, -3.0]),
    ];
    let material = |base_color_texture, flags, emission| Material {
        base_color: [1.0, 0.5, 0.25, 1.0],
        emission,
        roughness: 0.75,
        flags,
        base_color_texture,
        opacity_map: if base_color_texture == NONE { NONE } else { 0 },
        ..Material::DIFFUSE
    };
    // Normals from the linear texture, by the second set of coordinates turned by a right angle and doubled.
    let mut detailed = material(0, MATERIAL_MASK | MATERIAL_DOUBLE_SIDED, [0.0; 3]);
    (detailed.normal_texture, detailed.uv_sets, detailed.normal_scale) = (1, 1 << NORMAL, -0.5);
    (detailed.specular, detailed.specular_weight, detailed.clearcoat) = ([0.04, 0.5, 0.25], 1.0, 0.125);
    detailed.uv_from_set[2 * NORMAL..2 * NORMAL + 2].copy_from_slice(&[[0.0, 2.0, 0.5, 4.0], [-2.0, 0.0, 0.25, 0.0]]);
    let light = |kind, direction, cone| PunctualLight {
        kind,
        range: 20.0,
        position: [1.5, 1e6, -3.0],
        direction,
        color: [100.0, 50.0, 25.5],
        cone,
        _reserved: 0,
    };
    let lights =
        vec![light(LIGHT_SPOT, [0.0, -0.6, 0.8], [0.25, 0.75]), light(LIGHT_DISTANT, [1.0, 0.0, 0.0], [0.0, 0.5])];
    let provenance = |first_id, count, node: &str| Provenance {
        first_id,
        count,
        source: 0,
        node: node.to_owned(),
        mesh: "mesh".to_owned(),
        primitive: 0,
        under: Vec::new(),
    };
    let manifest = Manifest {
        generator: "test 1".to_owned(),
        sources: vec![Source { name: "scene.gltf".to_owned(), bytes: 1234, hash: "0123456789abcdef".to_owned() }],
        brick_triangles: 32,
        triangle_ids: 52,
        triangles_stored: 42,
        triangles_instanced: 52,
        min: [-1048576.0, -1.5, -2.0],
        max: [7340032.0, 8388608.0, 8388608.0],
        has_textures: true,
        has_normal_maps: true,
        is_glossy: true,
        texture_names: vec!["small.png".to_owned(), "long.png".to_owned()],
        has_alpha_mask: true,
        has_emission: true,
        has_instances: true,
        has_wide_bricks: true,
        has_proxies: true,
        instance_scale_ratio: 1.0,
        warnings: vec!["a warning".to_owned()],
        provenance: vec![
            provenance(0, 27, "ground"),
            provenance(27, 10, "left"),
            provenance(37, 5, "sky"),
            provenance(42, 10, "right"),
        ],
        ..Manifest::default()
    };
    let leaf = |instance, brick| Leaf { instance, brick };
    let mut resident = Resident {
        manifest,
        objects,
        instances,
        leaves: vec![leaf(0, 0), leaf(2, 2), leaf(0, 1), leaf(1, 2)],
        bricks,
        materials: vec![detailed, material(NONE, MATERIAL_UNLIT, [0.0, 3.0, 0.0])],
        opacity_maps: vec![opacity_map],
        textures,
        tiles: vec![Span::default(); 2],
        lights,
        occupancy,
        ..Resident::default()
    };
    top_level(&mut resident);
    Scene { resident, payloads }
}

/// The small scene with displacement fields: of a brick and of the object that it is of, and bits of another object.
pub fn scene_with_fields() -> Scene {
    let Scene { mut resident, mut payloads } = scene();
    let field = |object, brick, rings, directions, bits| DisplacementField {
        object,
        brick,
        rings,
        directions,
        bits,
        executor: if bits == DISPLACEMENT_HITS { DISPLACEMENT_BY_GPU } else { DISPLACEMENT_BY_CPU },
        center: [3072.0, -0.25, 1e-3],
        radius: 60.5,
        mean: 0.375,
        span: Span::default(),
    };
    resident.displacement = vec![
        field(0, 1, 1, 3, DISPLACEMENT_DISTANCES),
        field(0, NONE, 3, 2, DISPLACEMENT_DISTANCES),
        field(1, NONE, 1, 3, DISPLACEMENT_HITS),
    ];
    for (index, field) in (0..).zip(&resident.displacement) {
        let mut numbers = Numbers(u64::from(index) + 9);
        // Distances of all values, and runs of rays that hit nothing.
        let mut sample = |at: u64| if at / 20 % 2 == 1 { DISPLACEMENT_MISS } else { numbers.next(256) as u8 };
        let mut bytes: Vec<u8> = (0..field.sample_bytes()).map(&mut sample).collect();
        if field.bits == DISPLACEMENT_HITS {
            // 90 samples: two bits of the last byte.
            *bytes.last_mut().unwrap() &= 3;
        }
        bytes.resize(field.loaded_bytes() as usize, 0);
        payloads.insert(Payload::Displacement(index), bytes);
    }
    Scene { resident, payloads }
}

/// Adds levels to the small scene, with or without fields: one over the bricks of the world, one over that of the other
/// object, and one over the first and over both instances of the second.
pub fn with_levels(scene: Scene) -> Scene {
    let Scene { mut resident, mut payloads } = scene;
    let objects = resident.objects.clone();
    let leaf = |instance, brick| Leaf { instance, brick };
    let none = leaf(NONE, NONE);
    let world = |count, seed| triangles(count, [-(1 << 20), 0, -77], 1 << 32, seed);
    let wide = BRICK_WIDE | BRICK_INDEX32;
    let own = triangles(5, [-500, -500, -500], 1000, 6);
    let levels = [
        (0, wide, world(30, 4), 40, [leaf(NONE, 0), leaf(NONE, 1), none, none], [1.0, 2.0, 0.25]),
        (1, BRICK_DETAIL, own, 9, [leaf(NONE, 2), none, none, none], [0.5, 4.0, 1.0]),
        // Its lengths are not those of the level over the other object's brick.
        (0, wide, world(4, 5), 51, [leaf(NONE, 3), leaf(1, 4), leaf(2, 4), none], [1.0, 2.5, 0.0]),
    ];
    for (number, (object, flags, triangles, last_id, children, [error, bound, color])) in (3..).zip(levels) {
        let ids: Vec<u32> = (0..triangles.len() as u32).map(|i| last_id - i % 9).collect();
        let own = (object, &objects[object as usize]);
        let (brick, geometry, attributes) = brick(own, flags, [0; 3], &triangles, &ids, 2);
        resident.levels.push(Level { brick, children, error, bound, color: color as f32, _reserved: 0 });
        payloads.insert(Payload::Geometry(number), geometry);
        payloads.insert(Payload::Attributes(number), attributes);
    }
    resident.level_leaves =
        [(0, 0), (2, 4), (0, 5), (1, 2), (0, 1), (2, 2), (0, 3), (1, 4)].map(|(i, b)| leaf(i, b)).into();
    let leaves: Vec<Triangle> = resident.level_leaves.iter().map(|leaf| world_bounds(&resident, leaf)).collect();
    // The children of node i of a full binary tree are 2 i + 1 and 2 i + 2.
    let mut nodes = vec![(leaves[0], 0, TOP_LEAF); 7];
    nodes.extend((0..).zip(&leaves).map(|(index, leaf)| (*leaf, index, TOP_LEAF)));
    for index in (0..7).rev() {
        let children = [2 * index + 1, 2 * index + 2];
        let (min, max) = bounds(&children.map(|child| nodes[child].0));
        nodes[index] = ([min, max, max], children[0] as u32, children[1] as u32);
    }
    let node = |([min, max, _], left, right): (Triangle, u32, u32)| TopNode2 { min, max, left, right };
    resident.level_top2 = nodes.into_iter().map(node).collect();
    let (min, max) = bounds(&leaves[1..]);
    let others: Vec<(Triangle, u8)> = leaves[1..].iter().copied().zip(0x20..).collect();
    resident.level_top8 = vec![top_node(&[(leaves[0], 0x20), ([min, max, max], 0x39)], 1, 0), top_node(&others, 0, 1)];
    Scene { resident, payloads }
}

/// Both trees over the four leaves.
fn top_level(resident: &mut Resident) {
    let leaves: Vec<Triangle> = resident.leaves.iter().map(|leaf| world_bounds(resident, leaf)).collect();
    let of = |leaves: &[Triangle], left, right| {
        let (min, max) = bounds(leaves);
        TopNode2 { min, max, left, right }
    };
    resident.top2 = vec![of(&leaves, 1, 2), of(&leaves[..2], 3, 4), of(&leaves[2..], 5, 6)];
    resident.top2.extend((0..4).map(|leaf| of(&leaves[leaf..][..1], leaf as u32, TOP_LEAF)));
    let (min, max) = bounds(&leaves[1..]);
    let inner = [min, max, max];
    resident.top8 = vec![
        top_node(&[(leaves[0], 0x20), (inner, 0x39)], 1, 0),
        top_node(&[(leaves[1], 0x20), (leaves[2], 0x21), (leaves[3], 0x22)], 0, 1),
    ];
}

/// A scene with objects and instances but no triangles.
pub fn empty() -> Scene {
    let mut resident = scene().resident;
    resident.objects.truncate(1);
    resident.instances.truncate(1);
    resident.objects[0] = Object { brick_count: 0, triangle_ids: 0, triangle_count: 0, ..resident.objects[0] };
    let manifest = Manifest { min: [1.0; 3], max: [-1.0; 3], instance_scale_ratio: 1.0, ..Manifest::default() };
    Scene {
        resident: Resident {
            manifest,
            objects: resident.objects,
            instances: resident.instances,
            ..Resident::default()
        },
        payloads: BTreeMap::new(),
    }
}
