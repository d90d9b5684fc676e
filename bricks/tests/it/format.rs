//! FORMAT.md says what the code does: every table of a record is compared with the struct.

use bricks::layout::*;
use bricks::*;
use std::collections::BTreeMap;

const FORMAT: &str = include_str!("../../FORMAT.md");

/// A table of a record: fields with offset and size, and the size of the record.
type Table = (Vec<(String, usize, usize)>, usize);

/// The cells of a line of a table.
fn cells(line: &str) -> Vec<&str> {
    line.trim_matches('|').split('|').map(str::trim).collect()
}

/// The tables of `text` whose head says `offset` and `size`.
fn tables(text: &str) -> BTreeMap<String, Table> {
    let mut tables = BTreeMap::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        let head = cells(line);
        if head.len() != 4 || head[1..3] != ["offset", "size"] {
            continue;
        }
        let name = head[0].trim_matches('`').to_owned();
        assert_eq!(lines.next(), Some("| --- | --- | --- | --- |"));
        let mut fields = Vec::new();
        let total = loop {
            let row = cells(lines.next().expect("a row with the total"));
            let number = |cell: &str| cell.parse::<usize>().unwrap_or_else(|_| panic!("{name}: {cell}"));
            if row[0] == "total" {
                break number(row[1]);
            }
            fields.push((row[0].trim_matches('`').to_owned(), number(row[1]), number(row[2])));
        };
        assert!(tables.insert(name, (fields, total)).is_none());
    }
    tables
}

/// Size of the field that `_of` returns.
fn size_of_field<T, F>(_of: impl Fn(&T) -> &F) -> usize {
    size_of::<F>()
}

/// The table of a struct, from the struct. Naming every field in a pattern makes a forgotten one a compile error.
macro_rules! table {
    ($record:ident { $($field:ident),* $(,)? }) => {{
        let _complete = |record: $record| {
            let $record { $($field: _),* } = record;
        };
        let fields = vec![$((
            stringify!($field).to_owned(),
            std::mem::offset_of!($record, $field),
            size_of_field(|record: &$record| &record.$field),
        )),*];
        (stringify!($record).to_owned(), (fields, size_of::<$record>()))
    }};
}

fn structs() -> BTreeMap<String, Table> {
    BTreeMap::from([
        table!(Header {
            magic,
            version,
            page_bytes,
            file_bytes,
            directory_offset,
            directory_bytes,
            directory_checksum,
            checksum
        }),
        table!(DirectoryEntry { kind, record_bytes, count, offset, bytes, checksum }),
        table!(Span { offset, bytes, checksum }),
        table!(Object { step_log2, unit_log2, first_brick, brick_count, triangle_ids, triangle_count, _reserved }),
        table!(Instance { object, base, flags, _reserved, world_from_object }),
        table!(Leaf { instance, brick }),
        table!(TopNode2 { min, max, left, right }),
        table!(TopNode8 { origin, exponent, inner_mask, child_base, leaf_base, meta, lo, hi, _reserved }),
        table!(Brick {
            object,
            flags,
            node_count,
            triangle_count,
            vertex_count,
            attribute_vertex_count,
            height,
            _reserved0,
            origin,
            min,
            max,
            geometry,
            attributes,
            proxies,
            mean_albedo,
            mean_emission,
            root,
            opacity_count,
            _reserved1
        }),
        table!(Material {
            base_color,
            emission,
            metallic,
            roughness,
            alpha_cutoff,
            flags,
            base_color_texture,
            opacity_map,
            normal_texture,
            metallic_roughness_texture,
            occlusion_texture,
            emissive_texture,
            normal_scale,
            occlusion_strength,
            clearcoat,
            specular,
            specular_weight,
            clearcoat_roughness,
            transmission,
            uv_sets,
            absorption,
            uv_from_set
        }),
        table!(OpacityMap { width, height, wrap, _reserved, texels }),
        table!(OpacityTriangle { uv, material, alphas }),
        table!(DisplacementField { object, brick, rings, directions, bits, executor, center, radius, mean, span }),
        table!(Texture { width, height, levels, wrap, encoding, flags, first_tile, tile_count, tail }),
        table!(Node { origin, exponent, inner_mask, child_base, triangle_base, meta, lo, hi }),
        table!(Level { brick, children, error, bound, color, _reserved }),
        table!(Occupancy { cell_log2, _reserved, origin, bits }),
        table!(AttributeVertex { normal, uv, color }),
        table!(AttributeDetail { tangent, handedness, uv }),
        table!(PunctualLight { kind, range, position, direction, color, cone, _reserved }),
    ])
}

#[test]
fn tables_are_the_structs() {
    let (written, structs) = (tables(FORMAT), structs());
    assert_eq!(written.keys().collect::<Vec<_>>(), structs.keys().collect::<Vec<_>>());
    for (name, table) in &structs {
        assert_eq!(&written[name], table, "{name}");
        // No padding: fields follow each other up to the end.
        let end = table.0.iter().fold(0, |end, (field, offset, size)| {
            assert_eq!(*offset, end, "{name}::{field}");
            offset + size
        });
        assert_eq!(end, table.1, "{name}");
    }
}

#[test]
fn a_wrong_table_is_seen() {
    let wrong = FORMAT.replace("| `leaf_base` | 32 | 4 |", "| `leaf_base` | 36 | 4 |");
    assert_ne!(wrong, FORMAT);
    assert_ne!(tables(&wrong), structs());
    assert_eq!(tables(FORMAT), structs());
}

#[test]
fn sections_are_those_of_the_page() {
    let start = FORMAT.find("| section | kind | record bytes |").expect("the table of sections");
    let rows: Vec<_> = FORMAT[start..].lines().skip(2).take_while(|line| line.starts_with('|')).map(cells).collect();
    assert_eq!(rows.len(), Section::ALL.len());
    for (row, section) in rows.iter().zip(Section::ALL) {
        assert_eq!(row[0].trim_matches('`'), section.name());
        assert_eq!(row[1], section.kind().to_string());
        assert_eq!(row[2], section.record_bytes().to_string());
        assert_eq!(Section::ALL[section.index()], section);
        assert_eq!(row[3].starts_with("optional: "), section.is_optional());
    }
}

/// Numbers that the page states in sentences.
#[test]
fn numbers_are_those_of_the_page() {
    let magic: Vec<_> = MAGIC.iter().map(|byte| format!("{byte:02x}")).collect();
    for said in [
        format!("scene file, version {VERSION}\n"),
        format!("`{}`", magic.join(" ")),
        format!("| `version` | 8 | 4 | {VERSION} |"),
        format!("| `page_bytes` | 12 | 4 | {PAGE_BYTES} |"),
        format!(
            "| `directory_bytes` | 32 | 8 | {MIN_DIRECTORY_BYTES}, and {ENTRY_BYTES} more for each optional section: at \
             most {MAX_DIRECTORY_BYTES} |"
        ),
        format!(
            "{} entries, up to {} with optional sections",
            MIN_DIRECTORY_BYTES / ENTRY_BYTES,
            MAX_DIRECTORY_BYTES / ENTRY_BYTES
        ),
        format!("{PAGE_BYTES}\nbytes for payloads and the directory, {SECTION_ALIGN} for sections"),
        format!("later versions: {KIND_VISIBILITY_FIELDS} visibility fields."),
        format!("m, of a hemisphere, 1 to {MAX_DISPLACEMENT_RINGS} |"),
        format!("square of directions, {MIN_DISPLACEMENT_DIRECTIONS} to {MAX_DISPLACEMENT_DIRECTIONS} |"),
        format!("{DISPLACEMENT_DISTANCES} distances, {DISPLACEMENT_HITS} hits |"),
        format!("{DISPLACEMENT_BY_CPU} traced on the processor, {DISPLACEMENT_BY_GPU} on a GPU |"),
        format!("{DISPLACEMENT_MISS} if it hits nothing"),
        format!("at least a {}th of their unpacked", pack::MAX_RATIO),
        format!("1 to {MAX_TEXTURE_SIZE} texels"),
        format!("at most {MAX_TOP_EXPONENT} |"),
        format!("levels of nodes, 1 to {MAX_BRICK_HEIGHT} |"),
        format!("`top2` at most {MAX_TOP2_HEIGHT} and `top8` at most {MAX_TOP_HEIGHT} levels"),
        format!("at most {MAX_TRIANGLE_IDS}"),
        format!("is {NONE}."),
        format!("exponents within ±{MAX_LATTICE_LOG2}"),
    ] {
        assert!(FORMAT.contains(&said), "FORMAT.md does not say {said:?}");
    }
    assert_eq!((MAX_PAYLOAD_BYTES, LEVEL_CHILDREN), (1 << 31, 4));
    assert_eq!((ORIGIN_STEPS, NEAR_STEPS, WIDE_STEPS, LATTICE_LIMIT), (1 << 20, 1 << 24, 1 << 46, 1 << 61));
    assert_eq!((*STEP_UNIT_LOG2.start(), *STEP_UNIT_LOG2.end()), (-64, 32));
}

/// The layouts of payloads are those of the page: arrays in its order, padded to 16.
#[test]
fn payloads_are_those_of_the_page() {
    let mut brick: Brick = bytemuck::Zeroable::zeroed();
    (brick.node_count, brick.triangle_count, brick.vertex_count, brick.attribute_vertex_count) = (3, 5, 7, 9);
    let pad = |bytes: u64| bytes.div_ceil(16) * 16;
    for (flags, vertex, index) in [(0, 12, 6), (BRICK_WIDE, 24, 6), (BRICK_INDEX32, 12, 12)] {
        brick.flags = flags;
        let geometry = GeometryLayout::of(&brick);
        assert_eq!(geometry.vertices, 3 * 80);
        assert_eq!(geometry.ids, geometry.vertices + pad(7 * vertex));
        assert_eq!(geometry.indices, geometry.ids + pad(5 * 4));
        assert_eq!(geometry.bytes, geometry.indices + pad(5 * index));
        let attributes = AttributeLayout::of(&brick);
        assert_eq!(attributes.surfaces, 9 * 16);
        assert_eq!(attributes.indices, attributes.surfaces + pad(5 * 4));
        assert_eq!(attributes.bytes, attributes.indices + pad(5 * index));
        brick.flags |= BRICK_DETAIL;
        let detailed = AttributeLayout::of(&brick);
        assert_eq!((detailed.indices, detailed.details), (attributes.indices, attributes.bytes));
        assert_eq!(detailed.bytes, detailed.details + 9 * 16);
    }
    assert_eq!((TILE_TEXELS, BLOCK_TEXELS), (128, 4));
    assert_eq!((TEXTURE_RGBA8, TEXTURE_BC7, TEXTURE_BC5, TEXTURE_SRGB), (0, 1, 2, 1));
    assert_eq!((BASE_COLOR, NORMAL, METALLIC_ROUGHNESS, OCCLUSION, EMISSIVE), (0, 1, 2, 3, 4));
    let (rings, directions) = (5, 7);
    for (bits, bytes) in [(DISPLACEMENT_DISTANCES, 122 * 49), (DISPLACEMENT_HITS, (122 * 49u64).div_ceil(8))] {
        let field = DisplacementField { rings, directions, bits, ..bytemuck::Zeroable::zeroed() };
        assert_eq!(field.positions(), 2 * (2 * 25 + 2 * 5 + 1));
        assert_eq!(field.loaded_bytes(), pad(bytes));
    }
    assert_eq!((LIGHT_POINT, LIGHT_SPOT, LIGHT_DISTANT, BRICK_DETAIL), (0, 1, 2, 8));
}
