//! What a scene takes and how well its trees are built: sizes by section, bytes a triangle, the sizes of bricks,
//! depths, surface-area costs.

use crate::settings::sizes::{human_bytes, human_count};
use anyhow::Result;
use bricks::layout::PAGE_BYTES;
use bricks::{AttributeLayout, Brick, GeometryLayout, Node, Payload, Resident, SceneFile, Section};
use brickwalk_convert::build::TRIANGLE_COST;
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;

/// Most characters of a bar of the histogram.
const BAR_CHARACTERS: u64 = 32;

/// Bytes of the file by what they hold; their sum is the length of the file. An array of a payload counts with its
/// padding to 16 bytes.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Sections {
    /// The header page.
    pub header: u64,
    /// Nodes of bricks.
    pub nodes: u64,
    /// Vertices of bricks: positions.
    pub vertices: u64,
    /// Ids of triangles.
    pub ids: u64,
    /// Indices of vertices.
    pub indices: u64,
    /// What shading reads, textures apart, as it is encoded.
    pub attributes: u64,
    /// Occupancy maps that are read on demand.
    pub proxies: u64,
    /// Texels.
    pub textures: u64,
    /// Geometry and attributes of levels of detail. Not listed where there are none.
    #[serde(skip_serializing_if = "is_zero")]
    pub levels: u64,
    /// Displacement fields, as they are packed. Not listed where there are none.
    #[serde(skip_serializing_if = "is_zero")]
    pub displacement: u64,
    /// The directory of the resident part.
    pub directory: u64,
    /// The sections of the resident part by name.
    pub resident: BTreeMap<&'static str, u64>,
    /// Zeros between all of these.
    pub padding: u64,
}

impl Sections {
    /// Sizes of `scene`.
    pub fn of(scene: &SceneFile) -> Self {
        let resident = scene.resident();
        let mut sizes = Self { header: PAGE_BYTES, directory: resident.directory_bytes(), ..Self::default() };
        for brick in &resident.bricks {
            let geometry = GeometryLayout::of(brick);
            sizes.nodes += geometry.vertices;
            sizes.vertices += geometry.ids - geometry.vertices;
            sizes.ids += geometry.indices - geometry.ids;
            sizes.indices += geometry.bytes - geometry.indices;
            sizes.attributes += brick.attributes.bytes;
            sizes.proxies += brick.proxies.bytes;
        }
        sizes.textures = resident.texture_bytes();
        sizes.levels = resident.levels.iter().map(|level| bytes_of(&level.brick)).sum();
        sizes.displacement = resident.displacement.iter().map(|field| field.span.bytes).sum();
        let bytes = |section: Section| resident.count(section) as u64 * u64::from(section.record_bytes());
        sizes.resident = resident.sections().map(|section| (section.name(), bytes(section))).collect();
        let records: u64 = sizes.resident.values().sum();
        // It has no records; it is what the others leave of the resident part.
        sizes.resident.insert(Section::Manifest.name(), scene.resident_bytes() - sizes.directory - records);
        sizes.padding = scene.file_bytes() - sizes.sum();
        sizes
    }

    /// Bytes of what traversal reads.
    pub fn geometry(&self) -> u64 {
        self.nodes + self.vertices + self.ids + self.indices
    }

    fn sum(&self) -> u64 {
        let resident = self.directory + self.resident.values().sum::<u64>();
        let of_bricks = self.geometry() + self.attributes + self.proxies;
        self.header + of_bricks + self.levels + self.textures + self.displacement + resident + self.padding
    }

    /// Rows for people.
    pub fn human(&self) -> [String; 3] {
        let list = |parts: &[(&str, u64)]| {
            let parts: Vec<String> =
                parts.iter().map(|(name, bytes)| format!("{name} {}", human_bytes(*bytes))).collect();
            parts.join(", ")
        };
        let geometry =
            [("nodes", self.nodes), ("vertices", self.vertices), ("ids", self.ids), ("indices", self.indices)];
        let mut others = vec![
            ("attributes", self.attributes),
            ("proxies", self.proxies),
            ("textures", self.textures),
            ("padding", self.padding),
        ];
        for (name, bytes) in [("displacement", self.displacement), ("levels", self.levels)] {
            if bytes > 0 {
                others.insert(3, (name, bytes));
            }
        }
        let resident: Vec<(&str, u64)> = self.resident.iter().map(|(name, bytes)| (*name, *bytes)).collect();
        [format!("geometry: {}", list(&geometry)), list(&others), format!("resident: {}", list(&resident))]
    }
}

fn is_zero(bytes: &u64) -> bool {
    *bytes == 0
}

/// Bytes of a brick's geometry and attributes in the file.
pub fn bytes_of(brick: &Brick) -> u64 {
    brick.geometry.bytes + brick.attributes.bytes
}

/// Bytes of what shading reads, textures apart, as it is loaded.
pub fn loaded_attribute_bytes(resident: &Resident) -> u64 {
    resident.bricks.iter().map(|brick| AttributeLayout::of(brick).bytes).sum()
}

/// Bytes a stored triangle; 0 of none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PerTriangle {
    /// What traversal reads, as it lies in the file and in the cache of the device: the next four together.
    pub traversal: f64,
    /// Nodes.
    pub nodes: f64,
    /// Indices of vertices.
    pub indices: f64,
    /// Ids.
    pub ids: f64,
    /// Vertices.
    pub vertices: f64,
    /// What shading reads, textures apart, as it is encoded in the file.
    pub attributes: f64,
    /// What shading reads, textures apart, as it lies in the cache of the device.
    pub loaded_attributes: f64,
    /// Proxies: occupancy maps read on demand and resident ones.
    pub proxies: f64,
    /// The file without its textures.
    pub file_without_textures: f64,
    /// The whole file.
    pub file: f64,
    /// Number of vertices (not bytes).
    pub vertex_count: f64,
}

impl PerTriangle {
    /// Of a scene of `file_bytes`.
    pub fn of(resident: &Resident, sizes: &Sections, file_bytes: u64) -> Self {
        let triangles: u64 = resident.bricks.iter().map(|brick| u64::from(brick.triangle_count)).sum();
        let vertices: u64 = resident.bricks.iter().map(|brick| u64::from(brick.vertex_count)).sum();
        let share = |of: u64| of as f64 / triangles.max(1) as f64;
        if triangles == 0 {
            return Self::default();
        }
        Self {
            traversal: share(sizes.geometry()),
            nodes: share(sizes.nodes),
            indices: share(sizes.indices),
            ids: share(sizes.ids),
            vertices: share(sizes.vertices),
            attributes: share(sizes.attributes),
            loaded_attributes: share(loaded_attribute_bytes(resident)),
            proxies: share(sizes.proxies + size_of_val(resident.occupancy.as_slice()) as u64),
            file_without_textures: share(file_bytes - sizes.textures),
            file: share(file_bytes),
            vertex_count: share(vertices),
        }
    }

    /// A row for people.
    pub fn human(&self) -> String {
        format!(
            "{:.1} B for traversal (nodes {:.1}, indices {:.1}, ids {:.1}, vertices {:.1}), {:.1} B of proxies, \
             {:.1} B of the file without textures, {:.1} B with; {:.2} vertices",
            self.traversal,
            self.nodes,
            self.indices,
            self.ids,
            self.vertices,
            self.proxies,
            self.file_without_textures,
            self.file,
            self.vertex_count
        )
    }
}

/// A row of the histogram of brick sizes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Bin {
    /// Least triangles: a power of two.
    pub from_triangles: u32,
    /// Most triangles: one less than the next power of two.
    pub to_triangles: u32,
    /// Bricks.
    pub bricks: u64,
    /// Bytes of their geometry and attributes in the file.
    pub bytes: u64,
}

/// How many bricks have how many triangles, from the first row that is not empty to the last.
pub fn histogram(bricks: &[Brick]) -> Vec<Bin> {
    // A brick has a triangle.
    let log2 = |brick: &Brick| brick.triangle_count.max(1).ilog2();
    let (Some(first), Some(last)) = (bricks.iter().map(log2).min(), bricks.iter().map(log2).max()) else {
        return Vec::new();
    };
    let bin =
        |log2: u32| Bin { from_triangles: 1u32 << log2, to_triangles: u32::MAX >> (31 - log2), bricks: 0, bytes: 0 };
    let mut bins: Vec<Bin> = (first..=last).map(bin).collect();
    for brick in bricks {
        let bin = &mut bins[(log2(brick) - first) as usize];
        bin.bricks += 1;
        bin.bytes += bytes_of(brick);
    }
    bins
}

/// The histogram for people: a line and a bar a row.
pub fn human_histogram(bins: &[Bin]) -> Vec<String> {
    let most = bins.iter().map(|bin| bin.bricks).max().unwrap_or(0).max(1);
    let row = |bin: &Bin| {
        let bar = "#".repeat((bin.bricks * BAR_CHARACTERS).div_ceil(most) as usize);
        let range = format!("{} to {}", human_count(bin.from_triangles.into()), human_count(bin.to_triangles.into()));
        format!("{range:>20} triangles {:>9} {bar}", human_count(bin.bricks)).trim_end().to_string()
    };
    bins.iter().map(row).collect()
}

/// Levels of nodes from a root to the deepest leaf, both counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Depth {
    /// Of the binary top-level tree.
    pub top_binary: u32,
    /// Of the wide top-level tree.
    pub top_wide: u32,
    /// Of the tallest brick.
    pub brick: u32,
    /// Of wide nodes from the root of the top level to that of a triangle, at most.
    pub whole: u32,
}

/// What a ray that enters a node's box may expect, a child's box being met with the ratio of their areas (MacDonald and
/// Booth 1990); occlusion is not considered. 0 without triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct TopCost {
    /// Nodes of the binary tree, leaves counted.
    pub binary_nodes: f64,
    /// Nodes of the wide tree.
    pub wide_nodes: f64,
    /// Bricks entered, by the boxes of the wide tree.
    pub bricks: f64,
}

/// The surface-area cost of the wide top level with the trees of all bricks below it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct WholeCost {
    /// Wide nodes a ray visits.
    pub nodes: f64,
    /// Triangles a ray tests.
    pub triangles: f64,
    /// `nodes + 0.3 triangles`, the builder's measure.
    pub cost: f64,
}

/// Depths and costs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Trees {
    /// Levels.
    pub depth: Depth,
    /// Of the top level, a ray.
    pub top_level_sah: TopCost,
    /// Of the whole tree, a ray; only if the bricks were read.
    pub sah: Option<WholeCost>,
}

impl Trees {
    /// Of `scene`, whose bricks are read if `deep`.
    ///
    /// # Errors
    /// A brick cannot be read or is damaged.
    pub fn of(scene: &SceneFile, deep: bool) -> Result<Self> {
        let resident = scene.resident();
        let (mut depth, mut top, leaves) = wide_top(resident);
        (depth.top_binary, top.binary_nodes) = binary_top(resident);
        let sah = deep.then(|| whole(scene, &top, &leaves)).transpose()?;
        Ok(Self { depth, top_level_sah: top, sah })
    }

    /// Rows for people, each with its name.
    pub fn human(&self) -> Vec<(&'static str, String)> {
        let Self { depth, top_level_sah: top, sah } = self;
        let depths = format!(
            "{} levels from the root to a triangle; top level {} ({} binary), tallest brick {}",
            depth.whole, depth.top_wide, depth.top_binary, depth.brick
        );
        let top = format!(
            "a ray meets {:.1} nodes of the top level ({:.1} binary) and {:.1} bricks",
            top.wide_nodes, top.binary_nodes, top.bricks
        );
        let whole = sah.map(|sah| {
            let WholeCost { nodes, triangles, cost } = sah;
            format!("a ray meets {nodes:.1} nodes and {triangles:.1} triangles in all: {cost:.1}")
        });
        let cost = [Some(top), whole].into_iter().flatten().map(|text| ("SAH cost", text));
        std::iter::once(("depth", depths)).chain(cost).collect()
    }
}

/// Half the surface of a box.
fn half_area([x, y, z]: [f64; 3]) -> f64 {
    x * y + y * z + z * x
}

/// `part / whole`, 0 for a whole without area.
fn ratio(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { part / whole } else { 0.0 }
}

fn extent(min: [i64; 3], max: [i64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| max[axis] as f64 - min[axis] as f64)
}

/// A child of a wide node.
struct Child {
    is_inner: bool,
    /// Leaf: the first item relative to the node's base, and their number.
    first: u32,
    count: u32,
    half_area: f64,
}

/// The children of a wide node whose grid has the steps `step`, in slots.
fn children(
    meta: [u8; 8],
    inner_mask: u8,
    lo: [[u8; 8]; 3],
    hi: [[u8; 8]; 3],
    step: [f64; 3],
) -> impl Iterator<Item = Child> {
    (0..8).filter(move |&slot| meta[slot] != 0).map(move |slot| {
        let size = std::array::from_fn(|axis| f64::from(hi[axis][slot] - lo[axis][slot]) * step[axis]);
        Child {
            is_inner: inner_mask >> slot & 1 != 0,
            first: u32::from(meta[slot] & 31),
            count: (meta[slot] >> 5).count_ones(),
            half_area: half_area(size),
        }
    })
}

/// Depth and nodes a ray of the binary top level. Children follow their parents, so one sweep knows every level.
fn binary_top(resident: &Resident) -> (u32, f64) {
    let Some(root) = resident.top2.first() else { return (0, 0.0) };
    let root_area = half_area(extent(root.min, root.max));
    let mut levels = vec![1u32; resident.top2.len()];
    let (mut deepest, mut nodes) = (0, 0.0);
    for (index, node) in resident.top2.iter().enumerate() {
        nodes += ratio(half_area(extent(node.min, node.max)), root_area);
        deepest = deepest.max(levels[index]);
        if node.right != bricks::TOP_LEAF {
            for child in [node.left, node.right] {
                levels[child as usize] = levels[index] + 1;
            }
        }
    }
    (deepest, nodes)
}

/// Depths below and in the wide top level, its cost, and for each leaf the share of rays that enter it.
fn wide_top(resident: &Resident) -> (Depth, TopCost, Vec<f64>) {
    let mut depth = Depth::default();
    let mut shares = vec![0.0; resident.leaves.len()];
    let Some(root) = resident.top2.first() else { return (depth, TopCost::default(), shares) };
    let root_area = half_area(extent(root.min, root.max));
    let mut cost = TopCost { wide_nodes: 1.0, ..TopCost::default() };
    let mut levels = vec![1u32; resident.top8.len()];
    for (index, node) in resident.top8.iter().enumerate() {
        depth.top_wide = depth.top_wide.max(levels[index]);
        let step = node.exponent.map(|exponent| 2f64.powi(exponent.into()));
        let mut inner = node.child_base;
        for child in children(node.meta, node.inner_mask, node.lo, node.hi, step) {
            let share = ratio(child.half_area, root_area);
            if child.is_inner {
                levels[inner as usize] = levels[index] + 1;
                inner += 1;
                cost.wide_nodes += share;
                continue;
            }
            let leaf = (node.leaf_base + child.first) as usize;
            let brick = &resident.bricks[resident.leaves[leaf].brick as usize];
            depth.brick = depth.brick.max(brick.height);
            depth.whole = depth.whole.max(levels[index] + brick.height);
            cost.bricks += share;
            shares[leaf] = share;
        }
    }
    (depth, cost, shares)
}

/// The cost of the whole tree, from the shares of rays that enter the leaves of the top level.
fn whole(scene: &SceneFile, top: &TopCost, shares: &[f64]) -> Result<WholeCost> {
    let resident = scene.resident();
    let mut entered = vec![0.0; resident.bricks.len()];
    for (leaf, share) in resident.leaves.iter().zip(shares) {
        entered[leaf.brick as usize] += share;
    }
    let read = |buffer: &mut Vec<u8>, (index, &payload): (usize, &Payload)| -> Result<[f64; 2]> {
        buffer.resize(scene.span(payload).bytes as usize, 0);
        scene.copy(payload, buffer)?;
        Ok(in_brick(resident, &resident.bricks[index], buffer))
    };
    // Collected before they are added up, so that the sum does not depend on the threads.
    let payloads: Vec<Payload> = (0..entered.len() as u32).map(Payload::Geometry).collect();
    let mut costs: Vec<[f64; 2]> = Vec::with_capacity(payloads.len());
    for part in scene.in_parts(&payloads) {
        let first = costs.len();
        let read = |buffer: &mut Vec<u8>, (at, payload)| read(buffer, (first + at, payload));
        costs.extend(part.par_iter().enumerate().map_init(Vec::new, read).collect::<Result<Vec<_>>>()?);
    }
    let (mut nodes, mut triangles) = (top.wide_nodes, 0.0);
    for (share, [own_nodes, own_triangles]) in entered.iter().zip(costs) {
        nodes += share * own_nodes;
        triangles += share * own_triangles;
    }
    Ok(WholeCost { nodes, triangles, cost: nodes + f64::from(TRIANGLE_COST) * triangles })
}

/// Nodes and triangles that a ray meets that enters the box of a brick with the payload `geometry`.
fn in_brick(resident: &Resident, brick: &Brick, geometry: &[u8]) -> [f64; 2] {
    let object = &resident.objects[brick.object as usize];
    let device_step = 2f64.powi(object.step_log2 - object.unit_log2);
    let root_area = half_area(extent(brick.min, brick.max).map(|steps| steps * device_step));
    let (mut nodes, mut triangles) = (1.0, 0.0);
    let end = GeometryLayout::of(brick).vertices as usize;
    for bytes in geometry[..end].chunks_exact(size_of::<Node>()) {
        let node: Node = bytemuck::pod_read_unaligned(bytes);
        let step = node.exponent.map(|exponent| 2f64.powi(i32::from(exponent) - 127));
        for child in children(node.meta, node.inner_mask, node.lo, node.hi, step) {
            let share = ratio(child.half_area, root_area);
            match child.is_inner {
                true => nodes += share,
                false => triangles += share * f64::from(child.count),
            }
        }
    }
    [nodes, triangles]
}

#[cfg(test)]
mod tests {
    use super::*;
    use brickwalk_convert::build::{BuildSettings, build};
    use brickwalk_convert::progress::Progress;
    use brickwalk_convert::source::{IDENTITY, Mesh, Placement, Primitive, SourceScene};

    /// A sheet of `n` x `n` squares of two triangles at y = 0, in bricks of at most `brick_triangles`.
    fn sheet(n: u32, brick_triangles: u32) -> (tempfile::TempDir, SceneFile) {
        let row = n + 1;
        let positions = (0..row * row).map(|at| [f64::from(at % row), 0.0, f64::from(at / row)]).collect();
        let corners = (0..n * row).filter(|at| at % row < n);
        let indices = corners.flat_map(|at| [at, at + row, at + 1, at + 1, at + row, at + row + 1]).collect();
        let primitive = Primitive { positions, indices, ..Primitive::default() };
        let material = bricks::Material { base_color_texture: bricks::NONE, ..bricks::Material::DIFFUSE };
        let scene = SourceScene {
            meshes: vec![Mesh { name: "sheet".into(), primitives: vec![primitive] }],
            placements: vec![Placement { world_from_mesh: IDENTITY, ..Placement::default() }],
            materials: vec![material],
            sources: vec![bricks::Source::default()],
            ..SourceScene::default()
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sheet.bricks");
        let settings = BuildSettings { brick_triangles, ..BuildSettings::default() };
        build(scene, &settings, &path, &Progress::hidden()).unwrap();
        let scene = SceneFile::open(&path).unwrap();
        (folder, scene)
    }

    #[test]
    fn sections_and_bins_add_up() {
        let (_folder, scene) = sheet(40, 100);
        let resident = scene.resident();
        let sizes = Sections::of(&scene);
        assert_eq!(sizes.sum(), scene.file_bytes());
        let spans = |wanted: fn(&Payload) -> bool| -> u64 {
            resident.payloads().filter(|(payload, _)| wanted(payload)).map(|(_, span)| span.bytes).sum()
        };
        assert_eq!(sizes.geometry(), spans(|payload| matches!(payload, Payload::Geometry(_))));
        assert_eq!(sizes.attributes, spans(|payload| matches!(payload, Payload::Attributes(_))));
        let payloads = resident.payloads().count() as u64;
        // Less than a page after each payload, less than 64 bytes after the directory and each section.
        assert!(sizes.padding < payloads * PAGE_BYTES + 10 * 64, "{sizes:?}");
        assert_eq!(sizes.resident["bricks"], (resident.bricks.len() * size_of::<Brick>()) as u64);
        let manifest = serde_json::to_string(&resident.manifest).unwrap();
        assert_eq!(sizes.resident["manifest"], manifest.len() as u64);

        let per = PerTriangle::of(resident, &sizes, scene.file_bytes());
        assert!((per.traversal - (per.nodes + per.indices + per.ids + per.vertices)).abs() < 1e-9);
        // Two triangles a vertex, and those on the edges of bricks again in each; ids of 4 and indices of 6 bytes, each
        // array padded by less than 16.
        let bricks = resident.bricks.len() as f64;
        assert!((0.5..1.0).contains(&per.vertex_count), "{per:?}");
        assert!((4.0..4.0 + bricks * 16.0 / 3200.0).contains(&per.ids), "{per:?}");
        assert!((6.0..6.0 + bricks * 16.0 / 3200.0).contains(&per.indices), "{per:?}");

        let bins = histogram(&resident.bricks);
        assert_eq!(bins.iter().map(|bin| bin.bricks).sum::<u64>(), resident.bricks.len() as u64);
        assert_eq!(bins.iter().map(|bin| bin.bytes).sum::<u64>(), sizes.geometry() + sizes.attributes);
        for brick in &resident.bricks {
            let n = brick.triangle_count;
            assert!(bins.iter().any(|bin| (bin.from_triangles..=bin.to_triangles).contains(&n)), "{n} {bins:?}");
        }
        assert!(human_histogram(&bins).iter().any(|line| line.ends_with(&"#".repeat(BAR_CHARACTERS as usize))));
    }

    #[test]
    fn bins_are_powers_of_two() {
        let brick = |triangle_count| Brick { triangle_count, ..bytemuck::Zeroable::zeroed() };
        let counts = |bricks: &[u32]| {
            let bins = histogram(&bricks.iter().map(|n| brick(*n)).collect::<Vec<_>>());
            bins.iter().map(|bin| (bin.from_triangles, bin.to_triangles, bin.bricks)).collect::<Vec<_>>()
        };
        assert_eq!(counts(&[]), []);
        assert_eq!(counts(&[3, 2, 8]), [(2, 3, 2), (4, 7, 0), (8, 15, 1)]);
        assert_eq!(counts(&[1, u32::MAX]).last(), Some(&(1 << 31, u32::MAX, 1)));
    }

    #[test]
    fn costs_are_ratios_of_areas() {
        // One brick: the root of the top level, then the brick, which has the same box.
        let (_folder, scene) = sheet(1, 100);
        let trees = Trees::of(&scene, true).unwrap();
        assert_eq!((trees.depth.top_binary, trees.depth.top_wide, trees.depth.brick, trees.depth.whole), (1, 1, 1, 2));
        let sah = trees.sah.unwrap();
        // The boxes of the top level and of a brick's children reach beyond what is in them by steps of their grids.
        assert!((trees.top_level_sah.bricks - 1.0).abs() < 0.05, "{trees:?}");
        assert!((sah.nodes - 2.0).abs() < 0.05 && (sah.triangles - 2.0).abs() < 0.1, "{sah:?}");
        assert!((sah.cost - sah.nodes - 0.3 * sah.triangles).abs() < 1e-6);

        // A flat sheet cut into bricks: their boxes tile its own, so a ray enters about one, and of the tree's levels
        // each takes about one node.
        let (_folder, scene) = sheet(40, 100);
        let trees = Trees::of(&scene, true).unwrap();
        assert!((1.0..1.5).contains(&trees.top_level_sah.bricks), "{trees:?}");
        assert!(trees.depth.whole > trees.depth.top_wide && trees.depth.top_wide > 1, "{trees:?}");
        assert!(f64::from(trees.depth.whole) * 1.5 > trees.sah.unwrap().nodes, "{trees:?}");
        assert!(trees.sah.unwrap().triangles < 20.0, "{trees:?}");
        assert_eq!(Trees::of(&scene, false).unwrap().sah, None);
        assert_eq!(binary_top(&Resident::default()), (0, 0.0));
    }
}
