//! Reads a scene file back into integers.

use bricks::{
    AttributeDetail, AttributeLayout, AttributeVertex, BRICK_DETAIL, BRICK_INDEX32, BRICK_WIDE, Brick, GeometryLayout,
    Node, Object,
};
use bricks::{Payload, Resident, SURFACE_MATERIAL, SURFACE_ROTATION_SHIFT, SceneFile, WIDE_HIGH_STEPS};
use std::collections::BTreeMap;
use std::path::Path;

pub struct DecodedBrick {
    pub record: Brick,
    /// log2 of the lattice step in device units.
    pub step_unit_log2: i32,
    pub nodes: Vec<Node>,
    /// Relative to the brick's origin, in lattice steps.
    pub vertices: Vec<[i64; 3]>,
    pub ids: Vec<u32>,
    pub indices: Vec<[u32; 3]>,
    pub attributes: Vec<AttributeVertex>,
    /// None without the flag.
    pub details: Vec<AttributeDetail>,
    pub materials: Vec<u32>,
    pub rotations: Vec<u32>,
    pub attribute_indices: Vec<[u32; 3]>,
}

/// A triangle in lattice steps of its object, stored order.
#[derive(Clone, Debug, PartialEq)]
pub struct Triangle {
    pub corners: [[i64; 3]; 3],
    pub attributes: [AttributeVertex; 3],
    pub material: u32,
    pub rotation: u32,
}

pub struct Decoded {
    pub resident: Resident,
    pub bricks: Vec<DecodedBrick>,
}

/// Reads a file; everything that can be verified must be right.
pub fn decode(path: &Path) -> Decoded {
    let file = open(path);
    Decoded { resident: file.resident().clone(), bricks: bricks(&file) }
}

/// Reads a file whose levels are bricks like others, behind those of its objects.
pub fn decode_levels(path: &Path) -> (Resident, Vec<DecodedBrick>) {
    let mut file = open(path);
    file.use_levels();
    (file.resident().clone(), bricks(&file))
}

fn open(path: &Path) -> SceneFile {
    let file = SceneFile::open(path).unwrap();
    let report = file.verify(&mut |_, _| {}).unwrap();
    assert!(report.problems.is_empty(), "{:?}", report.problems);
    file
}

fn bricks(file: &SceneFile) -> Vec<DecodedBrick> {
    let resident = file.resident();
    let bricks = (0u32..).zip(&resident.bricks).map(|(index, record)| {
        let read = |payload| {
            let mut bytes = vec![0; file.loaded_bytes(payload) as usize];
            file.copy(payload, &mut bytes).unwrap();
            bytes
        };
        let object = &resident.objects[record.object as usize];
        brick(record, object, &read(Payload::Geometry(index)), &read(Payload::Attributes(index)))
    });
    bricks.collect()
}

fn pods<T: bytemuck::Pod>(bytes: &[u8], offset: u64, count: usize) -> Vec<T> {
    let bytes = &bytes[offset as usize..][..count * size_of::<T>()];
    bytes.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect()
}

fn triples(bytes: &[u8], offset: u64, brick: &Brick) -> Vec<[u32; 3]> {
    let count = brick.triangle_count as usize;
    if brick.flags & BRICK_INDEX32 != 0 {
        pods(bytes, offset, count)
    } else {
        pods::<[u16; 3]>(bytes, offset, count).into_iter().map(|t| t.map(u32::from)).collect()
    }
}

fn brick(record: &Brick, object: &Object, geometry: &[u8], attributes: &[u8]) -> DecodedBrick {
    let step_unit_log2 = object.step_log2 - object.unit_log2;
    // Exactly a whole number of steps, or the test fails.
    let steps = |x: f32| {
        let steps = f64::from(x) * 2f64.powi(-step_unit_log2);
        assert_eq!(steps.fract(), 0.0, "{x} is off the lattice");
        steps as i64
    };
    let layout = GeometryLayout::of(record);
    let count = record.vertex_count as usize;
    let vertices = if record.flags & BRICK_WIDE != 0 {
        let parts: Vec<[f32; 6]> = pods(geometry, layout.vertices, count);
        let join = |high: i64, low: i64| {
            assert!(high % WIDE_HIGH_STEPS == 0 && low.abs() <= WIDE_HIGH_STEPS / 2);
            high + low
        };
        parts.iter().map(|p| std::array::from_fn(|k| join(steps(p[k]), steps(p[k + 3])))).collect()
    } else {
        pods::<[f32; 3]>(geometry, layout.vertices, count).into_iter().map(|p| p.map(steps)).collect()
    };
    let triangles = record.triangle_count as usize;
    let surfaces = AttributeLayout::of(record);
    let words: Vec<u32> = pods(attributes, surfaces.surfaces, triangles);
    DecodedBrick {
        record: *record,
        step_unit_log2,
        nodes: pods(geometry, 0, record.node_count as usize),
        vertices,
        ids: pods(geometry, layout.ids, triangles),
        indices: triples(geometry, layout.indices, record),
        attributes: pods(attributes, 0, record.attribute_vertex_count as usize),
        details: match record.flags & BRICK_DETAIL {
            0 => Vec::new(),
            _ => pods(attributes, surfaces.details, record.attribute_vertex_count as usize),
        },
        materials: words.iter().map(|word| word & SURFACE_MATERIAL).collect(),
        rotations: words.iter().map(|word| word >> SURFACE_ROTATION_SHIFT).collect(),
        attribute_indices: triples(attributes, surfaces.indices, record),
    }
}

impl DecodedBrick {
    /// Corners of a triangle in lattice steps of the object.
    pub fn corners(&self, triangle: usize) -> [[i64; 3]; 3] {
        self.indices[triangle].map(|vertex| {
            let p = self.vertices[vertex as usize];
            std::array::from_fn(|k| p[k] + self.record.origin[k])
        })
    }

    pub fn triangle(&self, triangle: usize) -> Triangle {
        Triangle {
            corners: self.corners(triangle),
            attributes: self.attribute_indices[triangle].map(|vertex| self.attributes[vertex as usize]),
            material: self.materials[triangle],
            rotation: self.rotations[triangle],
        }
    }
}

impl Decoded {
    /// Triangles of an object by id; no id twice.
    pub fn triangles(&self, object: u32) -> BTreeMap<u32, Triangle> {
        let mut all = BTreeMap::new();
        for brick in self.bricks.iter().filter(|brick| brick.record.object == object) {
            for (index, &id) in brick.ids.iter().enumerate() {
                assert!(all.insert(id, brick.triangle(index)).is_none(), "id {id} twice");
            }
        }
        all
    }

    /// Object units of a lattice step of an object.
    pub fn step(&self, object: u32) -> f64 {
        2f64.powi(self.resident.objects[object as usize].step_log2)
    }
}

/// Ties of a source corner to a stored one: stored corner i is source corner (i + rotation) mod 3.
pub fn source_order<T: Copy>(stored: [T; 3], rotation: u32) -> [T; 3] {
    std::array::from_fn(|i| stored[(i + 3 - rotation as usize) % 3])
}
