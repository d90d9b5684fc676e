//! NumPy `.npy` files: rays in, hits out.

use super::atomic;
use anyhow::{Context, Result, anyhow, bail, ensure};
use bricks::planted::{self, Defect};
use bytemuck::{Pod, Zeroable};
use npyz::{DType, Field, NpyFile, Order, TypeStr, WriteOptions, WriterBuilder};
use std::fs::File;
use std::io::{BufReader, Cursor, Read, Write};
use std::path::Path;

/// Longest header that is parsed, as in NumPy.
const MAX_HEADER_BYTES: usize = 10_000;

/// Deepest nesting of brackets that is parsed; the header of a (N, 8) array has depth 2.
const MAX_HEADER_DEPTH: usize = 8;

/// A given ray, world space.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Ray {
    /// Origin.
    pub origin: [f64; 3],
    /// Direction, any length; distances count in its length.
    pub direction: [f64; 3],
    /// Nearest distance that counts.
    pub t_min: f64,
    /// Farthest distance that counts.
    pub t_max: f64,
}

/// What a ray hits. Without its normal an element of the output, packed: numpy dtype `[('t', '<f8'), ('triangle',
/// '<u4'), ('u', '<f4'), ('v', '<f4')]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance in lengths of the given direction, +inf on a miss.
    pub t: f64,
    /// Global triangle id, 4294967295 on a miss.
    pub triangle: u32,
    /// Weight of vertex 1 of the source's order.
    pub u: f32,
    /// Weight of vertex 2 of the source's order.
    pub v: f32,
    /// Geometric unit normal in world space, right-handed about the source's order of vertices as they lie in the
    /// world; zero on a miss.
    pub normal: [f32; 3],
}

/// Rays as an array holds them.
#[derive(Clone, Debug, PartialEq)]
pub struct Rays {
    /// The rays, row by row.
    pub rays: Vec<Ray>,
    /// Shape of the array without its last axis: that of the hits.
    pub shape: Vec<u64>,
}

/// Reads float64 or float32 of shape (..., 8) or (..., 6), in C order, of either byte order. Six numbers are origin and
/// direction; the interval is then from 0 to infinity. Values are as in the file: what makes a ray valid is for the
/// caller to say.
///
/// # Errors
/// The file cannot be read, is no `.npy` file, has another type, shape or order, or is shorter or longer than its
/// header says.
pub fn read_rays(path: &Path) -> Result<Rays> {
    let Rows { rows, shape } = read_rows(path, "rays", &[6, 8], |row| {
        let mut numbers = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, f64::INFINITY];
        numbers[..row.len()].copy_from_slice(row);
        bytemuck::cast(numbers)
    })?;
    Ok(Rays { rays: rows, shape })
}

/// What an array holds: an element a row, and its shape without the last axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows<T> {
    /// The elements, row by row.
    pub rows: Vec<T>,
    /// Shape of the array without its last axis.
    pub shape: Vec<u64>,
}

/// Reads points: float64 or float32 of shape (..., 3), as [`read_rays`] reads rays.
///
/// # Errors
/// As of [`read_rays`].
pub fn read_points(path: &Path) -> Result<Rows<[f64; 3]>> {
    read_rows(path, "points", &[3], |row| std::array::from_fn(|k| row[k]))
}

/// Reads pairs of points: float64 or float32 of shape (..., 6), as [`read_rays`] reads rays.
///
/// # Errors
/// As of [`read_rays`].
pub fn read_pairs(path: &Path) -> Result<Rows<[[f64; 3]; 2]>> {
    read_rows(path, "pairs of points", &[6], |row| [0, 3].map(|first| std::array::from_fn(|k| row[first + k])))
}

/// Reads `what`, rows of as many numbers as one of `widths`, by `row`.
fn read_rows<T>(path: &Path, what: &str, widths: &[u64], row: impl Fn(&[f64]) -> T) -> Result<Rows<T>> {
    let name = path.display();
    let mut file = File::open(path).with_context(|| format!("{name}: cannot open the {what}"))?;
    let length = file.metadata().with_context(|| format!("{name}: cannot read the {what}"))?.len();
    let (header, header_bytes) = read_header(&mut file)
        .with_context(|| format!("{name}: not a NumPy file; write it with numpy.save(path, array)"))?;
    // What a parser says repeats the header and draws arrows to it: of that the first line.
    let first = |error: std::io::Error| anyhow!(error.to_string().lines().next().unwrap_or_default().to_owned());
    let header = NpyFile::new(Cursor::new(header))
        .map_err(first)
        .with_context(|| format!("{name}: its NumPy header is damaged; write it with numpy.save(path, array)"))?;
    let shapes: Vec<String> = widths.iter().rev().map(|width| format!("(..., {width})")).collect();
    let remedy = format!(
        "{what} are float64 or float32 of shape {}; use numpy.ascontiguousarray(array, dtype=numpy.float64)",
        shapes.join(" or ")
    );
    let is = |kind: &str| kind.parse::<TypeStr>().is_ok_and(|t| header.dtype() == DType::new_scalar(t));
    let Some((_, number_bytes, read)) = NUMBERS.iter().find(|(kind, ..)| is(kind)) else {
        bail!("{name}: its type is {}; {remedy}", header.dtype().descr());
    };
    let (shape, columns) = match header.shape() {
        [shape @ .., columns] if widths.contains(columns) => (shape.to_vec(), *columns),
        other => bail!("{name}: its shape is {other:?}; {remedy}"),
    };
    let rows = shape.iter().try_fold(1u64, |rows, &n| rows.checked_mul(n));
    // One row or none is the same in both orders.
    if header.order() != Order::C && rows != Some(0) && rows != Some(1) {
        bail!("{name}: the array is in Fortran order; {remedy}");
    }
    let row_bytes = columns * number_bytes;
    let data = rows.and_then(|rows| rows.checked_mul(row_bytes));
    ensure!(
        data.and_then(|bytes| bytes.checked_add(header_bytes)) == Some(length) || planted::is(Defect::NpyRows),
        "{name}: found {length} bytes, but the header promises {what} of {row_bytes} bytes in shape {shape:?}; write \
         it again"
    );
    // As many as the file has bytes for.
    let count = usize::try_from(rows.unwrap_or(0)).with_context(|| format!("too many {what} for this machine"))?;
    let mut all = Vec::with_capacity(count);
    // The header's reader may have read ahead; the file itself stands behind the header.
    let mut file = BufReader::new(file);
    let (mut bytes, mut numbers) = (vec![0; row_bytes as usize], vec![0.0; columns as usize]);
    for _ in 0..count {
        file.read_exact(&mut bytes).with_context(|| format!("{name}: cannot read the {what}"))?;
        for (number, bytes) in numbers.iter_mut().zip(bytes.chunks_exact(*number_bytes as usize)) {
            *number = read(bytes);
        }
        all.push(row(&numbers));
    }
    Ok(Rows { rows: all, shape })
}

/// Reads a number from as many bytes as it has.
type ReadNumber = fn(&[u8]) -> f64;

/// Types of numbers, their bytes, and how one is read.
const NUMBERS: [(&str, u64, ReadNumber); 4] = [
    ("<f8", 8, |bytes| f64::from_le_bytes(sized(bytes))),
    (">f8", 8, |bytes| f64::from_be_bytes(sized(bytes))),
    ("<f4", 4, |bytes| f32::from_le_bytes(sized(bytes)).into()),
    (">f4", 4, |bytes| f32::from_be_bytes(sized(bytes)).into()),
];

/// The first bytes; zeros where there are too few.
fn sized<const N: usize>(bytes: &[u8]) -> [u8; N] {
    std::array::from_fn(|i| bytes.get(i).copied().unwrap_or(0))
}

/// The header of an `.npy` file, magic included, and its length in bytes; the file then stands at its data. Lengths and
/// nesting are bounded before anything parses it.
fn read_header(file: &mut File) -> Result<(Vec<u8>, u64)> {
    let mut header = vec![0; 8];
    file.read_exact(&mut header)?;
    ensure!(header.starts_with(b"\x93NUMPY"), "it does not begin with the magic of .npy");
    // Version 1 has a length of two bytes, versions 2 and 3 of four.
    let length_bytes = if header[6] == 1 { 2 } else { 4 };
    let mut length = [0; 4];
    file.read_exact(&mut length[..length_bytes])?;
    header.extend_from_slice(&length[..length_bytes]);
    let length = u32::from_le_bytes(length) as usize;
    ensure!(length <= MAX_HEADER_BYTES, "its header has {length} bytes");
    let start = header.len();
    header.resize(start + length, 0);
    file.read_exact(&mut header[start..])?;
    let mut depth = 0usize;
    for byte in &header[start..] {
        match byte {
            b'(' | b'[' | b'{' => depth += 1,
            b')' | b']' | b'}' => depth = depth.saturating_sub(1),
            _ => {}
        }
        ensure!(depth <= MAX_HEADER_DEPTH, "its header is nested too deeply");
    }
    let bytes = header.len() as u64;
    Ok((header, bytes))
}

/// Writes an array of `shape`, whose bytes are `data`.
fn write(path: &Path, dtype: DType, shape: &[u64], data: &[u8]) -> Result<()> {
    let context = || format!("{}: cannot write this file", path.display());
    atomic::write_with(path, |out| {
        WriteOptions::new_header_only()
            .dtype(dtype)
            .shape(shape)
            .writer(&mut *out)
            .write_header_only()
            .with_context(context)?;
        out.write_all(data).with_context(context)
    })
}

fn scalar(text: &'static str) -> Result<DType> {
    Ok(DType::new_scalar(text.parse().with_context(|| format!("the NumPy type {text}"))?))
}

/// Writes hits as a structured array of `shape`, an element a ray; with `normals` each has its normal, too: field
/// `normal`, three `<f4`.
///
/// # Errors
/// The file cannot be written.
pub fn write_hits(path: &Path, hits: &[Hit], shape: &[u64], normals: bool) -> Result<()> {
    let mut fields = vec![("t", "<f8", 1), ("triangle", "<u4", 1), ("u", "<f4", 1), ("v", "<f4", 1)];
    if normals {
        fields.push(("normal", "<f4", 3));
    }
    let mut data = Vec::with_capacity(hits.len() * if normals { 32 } else { 20 });
    for hit in hits {
        data.extend_from_slice(&hit.t.to_le_bytes());
        data.extend_from_slice(&hit.triangle.to_le_bytes());
        data.extend_from_slice(&hit.u.to_le_bytes());
        data.extend_from_slice(&hit.v.to_le_bytes());
        if normals {
            data.extend(hit.normal.iter().flat_map(|x| x.to_le_bytes()));
        }
    }
    write_records(path, &fields, &data, shape)
}

/// Writes an array of `shape`: whether something was hit, an element a ray.
///
/// # Errors
/// The file cannot be written.
pub fn write_any(path: &Path, hit: &[bool], shape: &[u64]) -> Result<()> {
    let data: Vec<u8> = hit.iter().map(|&b| u8::from(b)).collect();
    write_numbers(path, "|b1", &data, shape)
}

/// Writes an array of `shape` of numbers of a NumPy type such as `<u4`, whose bytes are `data`.
///
/// # Errors
/// The file cannot be written.
pub fn write_numbers(path: &Path, dtype: &'static str, data: &[u8], shape: &[u64]) -> Result<()> {
    write(path, scalar(dtype)?, shape, data)
}

/// Writes a structured array of `shape`: fields with their NumPy types and, of vectors, how many numbers they have, and
/// the bytes of all elements, packed.
///
/// # Errors
/// The file cannot be written.
pub fn write_records(path: &Path, fields: &[(&str, &'static str, u64)], data: &[u8], shape: &[u64]) -> Result<()> {
    let field = |&(name, dtype, count): &(&str, &'static str, u64)| {
        let one = scalar(dtype)?;
        let dtype = if count == 1 { one } else { DType::Array(count, Box::new(one)) };
        Ok(Field { name: name.into(), dtype })
    };
    write(path, DType::Record(fields.iter().map(field).collect::<Result<_>>()?), shape, data)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    /// An `.npy` file of version 1, made by hand.
    fn file(folder: &Path, descr: &str, order: &str, shape: &str, data: &[u8]) -> PathBuf {
        let mut dict = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}");
        while (10 + dict.len() + 1) % 64 != 0 {
            dict.push(' ');
        }
        dict.push('\n');
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((dict.len() as u16).to_le_bytes());
        bytes.extend(dict.as_bytes());
        bytes.extend(data);
        let path = folder.join("r.npy");
        std::fs::write(&path, bytes).unwrap();
        path
    }

    fn numbers(n: usize) -> Vec<u8> {
        (0..n).flat_map(|i| (i as f64 * 0.5 - 3.0).to_le_bytes()).collect()
    }

    #[test]
    fn reads_rays_of_either_byte_order() {
        let folder = tempfile::tempdir().unwrap();
        let read = |path: PathBuf| read_rays(&path).unwrap().rays;
        let little = read(file(folder.path(), "<f8", "False", "(3, 8)", &numbers(24)));
        assert_eq!(little.len(), 3);
        assert_eq!(little[0].origin, [-3.0, -2.5, -2.0]);
        assert_eq!(little[2].direction, [6.5, 7.0, 7.5]);
        assert_eq!((little[1].t_min, little[1].t_max), (4.0, 4.5));
        let swapped: Vec<u8> =
            numbers(24).chunks(8).flat_map(|c| c.iter().rev().copied().collect::<Vec<_>>()).collect();
        assert_eq!(read(file(folder.path(), ">f8", "False", "(3, 8)", &swapped)), little);
        assert_eq!(read(file(folder.path(), "<f8", "False", "(0, 8)", &[])), []);
        // numpy.save marks (1, 8) and (0, 8) as C order, other writers may not.
        assert_eq!(read(file(folder.path(), "<f8", "True", "(1, 8)", &numbers(8))).len(), 1);
        // What f32 holds is the same in f32.
        let single: Vec<u8> = (0..24).flat_map(|i| (i as f32 * 0.5 - 3.0).to_le_bytes()).collect();
        assert_eq!(read(file(folder.path(), "<f4", "False", "(3, 8)", &single)), little);
        let swapped: Vec<u8> = single.chunks(4).flat_map(|c| c.iter().rev().copied().collect::<Vec<_>>()).collect();
        assert_eq!(read(file(folder.path(), ">f4", "False", "(3, 8)", &swapped)), little);
    }

    #[test]
    fn reads_rays_of_any_shape_with_and_without_intervals() {
        let folder = tempfile::tempdir().unwrap();
        let read =
            |shape: &str, count| read_rays(&file(folder.path(), "<f8", "False", shape, &numbers(count))).unwrap();
        let long = read("(4, 8)", 32);
        for (shape, expected) in [("(2, 2, 8)", vec![2, 2]), ("(1, 4, 1, 8)", vec![1, 4, 1])] {
            assert_eq!(read(shape, 32), Rays { rays: long.rays.clone(), shape: expected });
        }
        assert_eq!(read("(8,)", 8), Rays { rays: long.rays[..1].to_vec(), shape: vec![] });
        let short = read("(2, 6)", 12);
        assert_eq!(short.shape, [2]);
        assert_eq!((short.rays[1].origin, short.rays[1].direction), ([0.0, 0.5, 1.0], [1.5, 2.0, 2.5]));
        assert!(short.rays.iter().all(|ray| ray.t_min == 0.0 && ray.t_max == f64::INFINITY));
    }

    #[test]
    fn refuses_anything_else_and_names_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let refused = |path: PathBuf, part: &str| {
            let message = format!("{:#}", read_rays(&path).unwrap_err());
            assert!(message.contains("r.npy") && message.contains(part), "{message:?} lacks {part:?}");
        };
        refused(file(folder, "<f2", "False", "(3, 8)", &numbers(6)), "<f2");
        refused(file(folder, "<f4", "False", "(3, 8)", &numbers(24)), "promises");
        refused(file(folder, "|O", "False", "(3, 8)", &numbers(24)), "float64");
        refused(file(folder, "<f8", "False", "(4, 7)", &numbers(28)), "[4, 7]");
        refused(file(folder, "<f8", "False", "(8, 3)", &numbers(24)), "[8, 3]");
        refused(file(folder, "<f8", "True", "(2, 2, 6)", &numbers(24)), "Fortran");
        refused(file(folder, "<f8", "False", "(24,)", &numbers(24)), "[24]");
        refused(file(folder, "<f8", "False", "()", &numbers(1)), "[]");
        refused(file(folder, "<f8", "True", "(3, 8)", &numbers(24)), "Fortran");
        refused(file(folder, "<f8", "False", "(3, 8)", &numbers(23)), "promises");
        refused(file(folder, "<f8", "False", "(3, 8)", &numbers(25)), "promises");
        refused(file(folder, "<f8", "False", "(288230376151711744, 8)", &numbers(8)), "promises");
        refused(file(folder, "<f8", "False", "(18446744073709551615, 8)", &numbers(8)), "promises");
        refused(file(folder, "<f8", "False", "(99999999999999999999999, 8)", &numbers(8)), "");
        refused(file(folder, "<f8", "False", "(-3, 8)", &numbers(24)), "");
        refused(file(folder, "", "False", "(3, 8)", &numbers(24)), "");
        refused(file(folder, "<f8", "False", &"(".repeat(9000), &[]), "nested");
        let path = folder.join("r.npy");
        for bytes in [&b""[..], b"PK\x03\x04 not npy", b"\x93NUMPY\x01\x00", b"\x93NUMPY\x02\x00\xff\xff\xff\xff{}"] {
            std::fs::write(&path, bytes).unwrap();
            refused(path.clone(), "not a NumPy file");
        }
        std::fs::remove_file(&path).unwrap();
        refused(path, "cannot open");
    }

    /// No flipped byte of the header may panic.
    #[test]
    fn damaged_headers_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let path = file(folder.path(), "<f8", "False", "(3, 8)", &numbers(24));
        let good = std::fs::read(&path).unwrap();
        let mut refused = 0;
        for i in 0..good.len() - 192 {
            for value in [0, b'(', b'9', 0xff] {
                let mut bytes = good.clone();
                bytes[i] = value;
                std::fs::write(&path, &bytes).unwrap();
                refused += usize::from(read_rays(&path).is_err());
            }
        }
        assert!(refused > 100, "{refused}");
    }

    #[test]
    fn what_a_parser_says_is_one_short_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npy");
        let text = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': (0, 8), }}{}0\n", " ".repeat(5000));
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((text.len() as u16).to_le_bytes());
        bytes.extend(text.into_bytes());
        std::fs::write(&path, &bytes).unwrap();
        let line = format!("{:#}", read_rays(&path).unwrap_err());
        assert!(line.contains("its NumPy header is damaged") && !line.contains('\n') && line.len() < 500, "{line}");
    }

    #[test]
    fn hits_are_a_structured_array() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("h.npy");
        let hits = [
            Hit { t: 1.5, triangle: 7, u: 0.25, v: 0.5, normal: [0.0, -1.0, 0.0] },
            Hit { t: f64::INFINITY, triangle: u32::MAX, u: 0.0, v: 0.0, normal: [0.0; 3] },
        ];
        write_hits(&path, &hits, &[2], false).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let header = NpyFile::new(&bytes[..]).unwrap();
        assert_eq!(header.shape(), [2]);
        assert_eq!(header.order(), Order::C);
        let fields: Vec<(String, String)> = match header.dtype() {
            DType::Record(fields) => fields.iter().map(|f| (f.name.clone(), f.dtype.descr())).collect(),
            other => panic!("{other:?}"),
        };
        let expected = [("t", "'<f8'"), ("triangle", "'<u4'"), ("u", "'<f4'"), ("v", "'<f4'")];
        assert_eq!(fields, expected.map(|(a, b)| (a.to_string(), b.to_string())));
        let data = &bytes[bytes.len() - 40..];
        assert_eq!(data[..8], 1.5f64.to_le_bytes());
        assert_eq!(data[8..12], 7u32.to_le_bytes());
        assert_eq!(data[16..20], 0.5f32.to_le_bytes());
        assert_eq!(data[28..32], u32::MAX.to_le_bytes());
        assert_eq!((bytes.len() - 40) % 64, 0, "numpy aligns the data to 64 bytes");
        write_hits(&path, &hits, &[2, 1], true).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let header = NpyFile::new(&bytes[..]).unwrap();
        assert_eq!(header.shape(), [2, 1]);
        assert!(header.dtype().descr().contains("('normal', '<f4', (3,))"), "{}", header.dtype().descr());
        assert_eq!(bytes[bytes.len() - 64..][24..28], (-1.0f32).to_le_bytes());
        write_hits(&path, &hits[..1], &[], false).unwrap();
        assert!(NpyFile::new(File::open(&path).unwrap()).unwrap().shape().is_empty());
    }

    #[test]
    fn occlusion_is_an_array_of_bool() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("h.npy");
        write_any(&path, &[true, false, true], &[3]).unwrap();
        let file = NpyFile::new(File::open(&path).unwrap()).unwrap();
        assert_eq!(file.dtype().descr(), "'|b1'");
        assert_eq!(file.into_vec::<bool>().unwrap(), [true, false, true]);
        write_any(&path, &[], &[0]).unwrap();
        assert_eq!(NpyFile::new(File::open(&path).unwrap()).unwrap().shape(), [0]);
    }
}
