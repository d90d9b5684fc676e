//! Checks of occupancy: the resident records, the maps, and the vertices against the maps.

use super::rule::rule;
use crate::error::{Flaw, Part};
use crate::layout::Section;
use crate::occupancy::{OCCUPANCY_CELLS, OCCUPANCY_LIMIT, OccupancyGrid, OccupancyMap, RESIDENT_LEVEL};
use crate::payload::Payload;
use crate::records::Span;
use crate::resident::Resident;
use bytemuck::Zeroable;

/// Longest proxies payload: more than packing makes of any map.
const MAX_PROXIES_BYTES: u64 = 1 << 16;

/// Every brick has a record and a payload, or none has; grids follow from bounds; no map is empty.
pub(super) fn records(resident: &Resident) -> Result<(), Flaw> {
    let (records, bricks) = (resident.occupancy.len(), resident.bricks.len());
    rule(records == 0 || records == bricks, Part::Section(Section::Occupancy), || {
        (format!("{records} records"), format!("none or {bricks}, one a brick"))
    })?;
    let has_proxies = resident.manifest.has_proxies;
    rule(has_proxies == (records > 0), Part::Section(Section::Manifest), || {
        (format!("has_proxies {has_proxies}"), format!("as of {records} occupancy records"))
    })?;
    for (index, brick) in (0u32..).zip(&resident.bricks) {
        let Some(record) = resident.occupancy.get(index as usize) else {
            rule(brick.proxies == Span::zeroed(), Part::Record(Section::Bricks, index), || {
                ("a span of proxies", "none without occupancy records")
            })?;
            continue;
        };
        let bytes = brick.proxies.bytes;
        rule((16..=MAX_PROXIES_BYTES).contains(&bytes) && bytes % 16 == 0, proxies(index), || {
            (format!("{bytes} bytes"), format!("a multiple of 16 from 16 to {MAX_PROXIES_BYTES}"))
        })?;
        let part = Part::Record(Section::Occupancy, index);
        rule(record._reserved == 0, part, || (format!("{:#x} in the reserved word", record._reserved), "zero"))?;
        let mut coordinates = brick.min.iter().chain(&brick.max);
        rule(coordinates.all(|x| x.abs_diff(0) <= OCCUPANCY_LIMIT as u64), part, || {
            let found = format!("a brick with bounds {:?} to {:?}", brick.min, brick.max);
            (found, format!("coordinates within ±{OCCUPANCY_LIMIT}"))
        })?;
        let found = OccupancyGrid { cell_log2: record.cell_log2, origin: record.origin };
        let expected = OccupancyGrid::of(resident.objects[brick.object as usize].step_log2, brick.min, brick.max);
        rule(found == expected, part, || {
            (format!("{found:?}"), format!("{expected:?}, which follows from the brick's bounds"))
        })?;
        rule(record.bits.iter().any(|byte| *byte != 0), part, || ("no occupied cell", "one at least"))?;
    }
    Ok(())
}

fn proxies(index: u32) -> Part {
    Part::Payload(Payload::Proxies(index))
}

/// A proxies payload is a map whose levels agree with each other and with the resident one, with nothing beyond the
/// bounds of the brick.
pub(super) fn map(resident: &Resident, index: u32, bytes: &[u8]) -> Result<(), Flaw> {
    let part = proxies(index);
    let map = OccupancyMap::unpack(bytes).map_err(|error| Flaw::packed(part, error))?;
    let columns = map.finest();
    rule(map == OccupancyMap::of_finest(&columns), part, || {
        ("a level that does not follow from the finest", "each the OR of the one before")
    })?;
    let record = &resident.occupancy[index as usize];
    rule(map.level(RESIDENT_LEVEL) == record.bits, part, || {
        ("another level of 16 cells than in section occupancy", "the same")
    })?;
    let brick = &resident.bricks[index as usize];
    let object = &resident.objects[brick.object as usize];
    let last = OccupancyGrid::of(object.step_log2, brick.min, brick.max).cell(object.step_log2, brick.max);
    let beyond = (0i64..).zip(&columns).find(|&(column, &cells)| {
        let (x, y) = (column % i64::from(OCCUPANCY_CELLS), column / i64::from(OCCUPANCY_CELLS));
        cells != 0 && (x > last[0] || y > last[1] || cells >> last[2] > 1)
    });
    rule(beyond.is_none(), part, || ("an occupied cell beyond the brick's bounds", format!("none after {last:?}")))
}

/// Checks that the cells of vertices are occupied. `vertices` are those of brick `index`, in lattice steps from its
/// origin and within its bounds.
pub(super) fn vertices(resident: &Resident, index: u32, vertices: &[[i64; 3]], map: &OccupancyMap) -> Result<(), Flaw> {
    let brick = &resident.bricks[index as usize];
    let step_log2 = resident.objects[brick.object as usize].step_log2;
    let grid = OccupancyGrid::of(step_log2, brick.min, brick.max);
    let columns = map.finest();
    for (number, vertex) in vertices.iter().enumerate() {
        // Within the bounds, so within the grid.
        let [x, y, z] = grid.cell(step_log2, std::array::from_fn(|k| vertex[k] + brick.origin[k]));
        rule(columns[(x + i64::from(OCCUPANCY_CELLS) * y) as usize] >> z & 1 != 0, proxies(index), || {
            (format!("an empty cell [{x}, {y}, {z}] with vertex {number}"), "every vertex in an occupied cell")
        })?;
    }
    Ok(())
}
