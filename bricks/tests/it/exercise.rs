//! Reads everything in a scene file of any bytes. The fuzz target and the tests share it.

use bricks::layout::{DirectoryEntry, ENTRY_BYTES, Header, MAX_DIRECTORY_BYTES, MIN_DIRECTORY_BYTES, PAGE_BYTES};
use bricks::{
    BRICK_INDEX32, Brick, Corners, DISPLACEMENT_HITS, DisplacementField, GeometryLayout, Level, MAX_BRICK_HEIGHT, Node,
    OCCUPANCY_LEVELS, OccupancyMap, OpacityMap, Payload, Resident, SceneFile, Section, Span, Texture, pack, validate,
};
use bytemuck::Pod;
use std::ops::Range;
use xxhash_rust::xxh3::xxh3_64;

/// Opens the file in `bytes`, copies every payload, follows its indices and verifies all of it; whether it opened, and
/// how many payloads were copied.
///
/// # Panics
/// The reader accepts what does not obey the format.
pub fn exercise(bytes: &[u8]) -> (bool, usize) {
    let file = match SceneFile::from_bytes("fuzzed.bricks", bytes.to_vec()) {
        Ok(file) => file,
        Err(error) => {
            let message = error.to_string();
            assert!(message.contains("fuzzed.bricks") && !message.contains('\n'), "{message}");
            return (false, 0);
        }
    };
    validate::resident(file.resident()).expect("what opens is valid");
    levels(file.resident());
    let mut copied = 0;
    for (payload, span) in file.resident().payloads() {
        assert!(span.bytes <= bytes.len() as u64, "a payload longer than the file");
        // A triangle has at least 10 bytes of geometry and, when decoded, at most 106 of attributes, or 16 and 112.
        let most = if let Payload::Displacement(_) = payload { pack::MAX_RATIO } else { 11 };
        let length = file.loaded_bytes(payload);
        assert!(length <= most * bytes.len() as u64, "{payload}: {length} bytes out of {}", bytes.len());
        let mut out = vec![0; length as usize];
        if file.copy(payload, &mut out).is_ok() {
            copied += 1;
            traverse(file.resident(), payload, &out);
            again(&file, payload, &out);
        }
    }
    requests(&file);
    placed(&file);
    let report = file.verify(&mut |_, _| {}).expect("bytes in memory can be read");
    for problem in &report.problems {
        assert!(problem.part().is_some() && !problem.to_string().contains('\n'));
    }
    assert!(!report.is_ok() || copied == file.resident().payloads().count(), "verify finds what copying finds");
    (true, copied)
}

/// What was copied comes by other ways, too.
fn again(file: &SceneFile, payload: Payload, bytes: &[u8]) {
    let span = file.resident().span(payload).expect("what was copied has a place");
    file.copy_stored(payload, &mut vec![0; span.bytes as usize]).expect("what was copied is stored");
    match payload {
        Payload::Proxies(brick) => drop(file.occupancy(brick).expect("what was copied is a map")),
        Payload::Displacement(field) => assert_eq!(file.displacement(field).expect("what was copied"), bytes),
        _ => {}
    }
}

/// What is not there is refused, and so is room of another size.
fn requests(file: &SceneFile) {
    let none = u32::MAX - 1;
    let absent = [
        Payload::Geometry(none),
        Payload::Attributes(none),
        Payload::Proxies(none),
        Payload::Texture(none),
        Payload::Opacity(none),
        Payload::Tile(none),
        Payload::Displacement(none),
    ];
    let all: Vec<Payload> = file.resident().payloads().map(|(payload, _)| payload).collect();
    let first = all.first().copied();
    let parts: usize = file.in_parts(&all).map(<[Payload]>::len).sum();
    assert_eq!(parts, all.len(), "parts are all");
    let room = first.map_or(0, |payload| file.loaded_bytes(payload) as usize + 1);
    let wrong = first.map(|payload| file.copy(payload, &mut vec![0; room]));
    let absent = absent.into_iter().map(|payload| file.copy_stored(payload, &mut []));
    for answer in absent.chain(wrong).chain([file.occupancy(none).map(drop), file.displacement(none).map(drop)]) {
        let message = answer.expect_err("what is not there is refused").to_string();
        assert!(message.contains("fuzzed.bricks") && !message.contains('\n'), "{message}");
    }
}

/// Instances may be placed anew where they are, or farther on, in a scene of its own.
fn placed(file: &SceneFile) {
    let instances = &file.resident().instances;
    let places: Vec<(u32, [f64; 12])> =
        (1..).zip(instances.iter().skip(1)).map(|(at, instance)| (at, instance.world_from_object)).collect();
    let Some(&(_, mut farther)) = places.first() else { return };
    let mut other = file.duplicate();
    farther[3] += 1.0;
    let moved = other.place(&places).and_then(|()| other.place(&[(1, farther)]));
    if moved.is_ok() {
        validate::resident(other.resident()).expect("what is placed is valid");
    }
    assert!(other.place(&[(0, farther)]).is_err() && other.place(&[(u32::MAX, farther)]).is_err());
    assert!(other.place(&[(1, [0.0; 12])]).is_err() && other.place(&[(1, [f64::NAN; 12])]).is_err());
    assert_eq!(&file.resident().instances, instances, "the first stays");
}

/// Has levels be bricks: every leaf has at most one that stands for it, and none stands for itself in the end.
fn levels(resident: &Resident) {
    let mut resident = resident.clone();
    let before: Vec<_> = resident.payloads().collect();
    resident.use_levels();
    assert_eq!(resident.payloads().collect::<Vec<_>>(), before);
    let parents = resident.level_parents();
    for leaf in 0..parents.len() {
        let depth = std::iter::successors(Some(leaf), |&leaf| {
            parents.get(parents[leaf] as usize).map(|_| parents[leaf] as usize)
        });
        assert!(depth.take(resident.levels.len() + 2).count() <= resident.levels.len() + 1, "a circle");
    }
    let children = |leaf: &bricks::Leaf| {
        let level = (leaf.brick as usize).checked_sub(resident.exact_bricks());
        level.map_or(0, |level| resident.levels[level].children().count())
    };
    let stood_for = parents.iter().filter(|parent| **parent != bricks::NONE).count();
    assert_eq!(
        stood_for,
        resident.leaves.iter().map(children).sum::<usize>(),
        "every child of a level is a leaf, once"
    );
}

/// Follows every index of a geometry payload without any check, as a kernel does, unpacks proxies, and looks up samples
/// of a displacement field.
pub fn traverse(resident: &Resident, payload: Payload, bytes: &[u8]) {
    if let Payload::Proxies(_) = payload {
        let map = OccupancyMap::unpack(bytes).expect("what was copied is a map");
        assert!(map.is_occupied(OCCUPANCY_LEVELS - 1, [0; 3]), "some cell is occupied");
    }
    if let Payload::Displacement(index) = payload {
        let field = &resident.displacement[index as usize];
        assert!(field.object < resident.objects.len() as u32);
        assert!(field.of_brick().is_none_or(|brick| resident.bricks[brick as usize].object == field.object));
        let last = field.positions() * u64::from(field.directions).pow(2) - 1;
        let (byte, end) = match field.bits {
            DISPLACEMENT_HITS => (last / 8, u32::from(bytes[last as usize / 8]) >> (last % 8 + 1)),
            _ => (last, 0),
        };
        assert!(end == 0 && bytes[byte as usize + 1..].iter().all(|&byte| byte == 0), "nothing behind the samples");
    }
    let Payload::Geometry(index) = payload else { return };
    let brick = resident.brick(index).expect("what was copied exists");
    let ids = match index as usize >= resident.bricks.len() && brick.object == 0 {
        true => resident.manifest.triangle_ids,
        false => resident.objects[brick.object as usize].triangle_ids.into(),
    };
    let layout = GeometryLayout::of(brick);
    let word = |at: u64| u32::from_le_bytes(bytes[at as usize..at as usize + 4].try_into().unwrap());
    let mut stack = vec![(0u32, 1u32)];
    let mut visits = 0;
    while let Some((index, level)) = stack.pop() {
        visits += 1;
        assert!(visits <= brick.node_count && level <= brick.height && brick.height <= MAX_BRICK_HEIGHT);
        let node: Node = bytemuck::pod_read_unaligned(&bytes[index as usize * 80..][..80]);
        for slot in 0..8 {
            if node.inner_mask >> slot & 1 != 0 {
                let below = node.inner_mask & ((1u32 << slot) - 1) as u8;
                stack.push((node.child_base + below.count_ones(), level + 1));
            } else if node.meta[slot] != 0 {
                let first = node.triangle_base + u32::from(node.meta[slot] & 31);
                for triangle in first..first + u32::from(node.meta[slot] >> 5).count_ones() {
                    let id = word(layout.ids + u64::from(triangle) * 4);
                    assert!(u64::from(id) < ids);
                    for corner in 0..3 {
                        let at = u64::from(triangle * 3 + corner);
                        let vertex = if brick.flags & BRICK_INDEX32 != 0 {
                            word(layout.indices + at * 4)
                        } else {
                            word((layout.indices + at * 2) & !3) >> (at % 2 * 16) & 0xffff
                        };
                        assert!(vertex < brick.vertex_count);
                    }
                }
            }
        }
    }
    assert_eq!(visits, brick.node_count);
    let corners = Corners::new(brick, bytes);
    let places = (0..brick.triangle_count).flat_map(|triangle| corners.of(triangle)).flatten();
    assert!(places.into_iter().all(f64::is_finite), "vertices are finite");
}

/// Makes every checksum right that can be found in `bytes`, so that the checks behind them are reached. What leads out
/// of the file is left as it is.
pub fn seal(bytes: &mut [u8]) {
    let Some(mut header) = read::<Header>(bytes, 0) else { return };
    if bytes.len() < PAGE_BYTES as usize {
        return;
    }
    let directory = header.directory_offset;
    let directory_bytes = header.directory_bytes.clamp(MIN_DIRECTORY_BYTES, MAX_DIRECTORY_BYTES);
    for index in 0..directory_bytes / ENTRY_BYTES {
        let at = directory.saturating_add(index * size_of::<DirectoryEntry>() as u64);
        let Some(mut entry) = read::<DirectoryEntry>(bytes, at) else { return };
        match Section::ALL.into_iter().find(|section| section.kind() == entry.kind) {
            Some(Section::Bricks) => {
                records::<Brick>(bytes, &entry, |brick| {
                    vec![&mut brick.geometry, &mut brick.attributes, &mut brick.proxies]
                });
            }
            Some(Section::Levels) => {
                records::<Level>(bytes, &entry, |level| vec![&mut level.brick.geometry, &mut level.brick.attributes])
            }
            Some(Section::OpacityMaps) => records::<OpacityMap>(bytes, &entry, |map| vec![&mut map.texels]),
            Some(Section::Textures) => records::<Texture>(bytes, &entry, |texture| vec![&mut texture.tail]),
            Some(Section::Tiles) => records::<Span>(bytes, &entry, |span| vec![span]),
            Some(Section::Displacement) => records::<DisplacementField>(bytes, &entry, |field| vec![&mut field.span]),
            _ => {}
        }
        if let Some(section) = range(bytes, entry.offset, entry.bytes) {
            entry.checksum = xxh3_64(&bytes[section]);
            write(bytes, at, &entry);
        }
    }
    if let Some(directory) = range(bytes, directory, directory_bytes) {
        header.directory_checksum = xxh3_64(&bytes[directory]);
    }
    header.file_bytes = bytes.len() as u64;
    header.checksum = 0;
    write(bytes, 0, &header);
    header.checksum = xxh3_64(&bytes[..PAGE_BYTES as usize]);
    write(bytes, 0, &header);
}

/// Makes the checksums right that the records of a section state of payloads.
fn records<T: Pod>(bytes: &mut [u8], entry: &DirectoryEntry, spans: impl Fn(&mut T) -> Vec<&mut Span>) {
    for index in 0..entry.count.min(entry.bytes / size_of::<T>() as u64) {
        let at = entry.offset.saturating_add(index * size_of::<T>() as u64);
        let Some(mut record) = read::<T>(bytes, at) else { return };
        for span in spans(&mut record) {
            // A span of nothing has no checksum.
            if let Some(payload) = range(bytes, span.offset, span.bytes).filter(|payload| !payload.is_empty()) {
                span.checksum = xxh3_64(&bytes[payload]);
            }
        }
        write(bytes, at, &record);
    }
}

/// The bytes at `offset`, if the file has as many.
fn range(bytes: &[u8], offset: u64, length: u64) -> Option<Range<usize>> {
    let end = offset.checked_add(length).filter(|&end| end <= bytes.len() as u64)?;
    Some(offset as usize..end as usize)
}

fn read<T: Pod>(bytes: &[u8], offset: u64) -> Option<T> {
    Some(bytemuck::pod_read_unaligned(&bytes[range(bytes, offset, size_of::<T>() as u64)?]))
}

/// Writes where [`read`] found something.
fn write<T: Pod>(bytes: &mut [u8], offset: u64, value: &T) {
    bytes[offset as usize..][..size_of::<T>()].copy_from_slice(bytemuck::bytes_of(value));
}
