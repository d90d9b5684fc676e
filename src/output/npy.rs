//! NumPy `.npy` files: rays in, hits out.

use super::atomic;
use anyhow::{Context, Result, bail, ensure};
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

/// A row of the output: numpy dtype `[('t', '<f8'), ('triangle', '<u4'), ('u', '<f4'), ('v', '<f4')]`, packed.
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
}

/// Reads float64 (N, 8) in C order, of either byte order. Values are as in the file: what makes a ray valid is for the
/// caller to say.
///
/// # Errors
/// The file cannot be read, is no `.npy` file, has another type, shape or order, or is shorter or longer than its
/// header says.
pub fn read_rays(path: &Path) -> Result<Vec<Ray>> {
    let name = path.display();
    let mut file = File::open(path).with_context(|| format!("{name}: cannot open the rays"))?;
    let length = file.metadata().with_context(|| format!("{name}: cannot read the rays"))?.len();
    let (header, header_bytes) = read_header(&mut file)
        .with_context(|| format!("{name}: not a NumPy file; write it with numpy.save(path, rays)"))?;
    let header = NpyFile::new(Cursor::new(header))
        .with_context(|| format!("{name}: its NumPy header is damaged; write it with numpy.save(path, rays)"))?;
    let remedy = "rays are float64 of shape (N, 8); use numpy.ascontiguousarray(rays, dtype=numpy.float64)";
    let double = |order: &str| order.parse::<TypeStr>().is_ok_and(|t| header.dtype() == DType::new_scalar(t));
    if !double("<f8") && !double(">f8") {
        bail!("{name}: its type is {}; {remedy}", header.dtype().descr());
    }
    let &[rows, 8] = header.shape() else {
        bail!("{name}: its shape is {:?}; {remedy}", header.shape());
    };
    // One row or none is the same in both orders.
    if header.order() != Order::C && rows > 1 {
        bail!("{name}: its rows are in Fortran order; {remedy}");
    }
    let expected = rows.checked_mul(64).and_then(|bytes| bytes.checked_add(header_bytes));
    ensure!(
        expected == Some(length),
        "{name}: it has {length} bytes where its header promises {rows} rays of 64; write it again"
    );
    let mut rays = vec![Ray::zeroed(); usize::try_from(rows).context("too many rays for this machine")?];
    // The header's reader may have read ahead; the file itself stands behind the header.
    let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut rays);
    BufReader::new(file).read_exact(bytes).with_context(|| format!("{name}: cannot read the rays"))?;
    if double(">f8") != cfg!(target_endian = "big") {
        bytes.as_chunks_mut::<8>().0.iter_mut().for_each(|number| number.reverse());
    }
    Ok(rays)
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

/// Writes a one-dimensional array; `rows` yields the bytes of its data.
fn write(path: &Path, dtype: DType, count: usize, data: &[u8]) -> Result<()> {
    let context = || format!("{}: cannot write this file", path.display());
    atomic::write_with(path, |out| {
        WriteOptions::new_header_only()
            .dtype(dtype)
            .shape(&[count as u64])
            .writer(&mut *out)
            .write_header_only()
            .with_context(context)?;
        out.write_all(data).with_context(context)
    })
}

fn scalar(text: &'static str) -> Result<DType> {
    Ok(DType::new_scalar(text.parse().with_context(|| format!("the NumPy type {text}"))?))
}

/// Writes hits as a structured array, a row a ray.
///
/// # Errors
/// The file cannot be written.
pub fn write_hits(path: &Path, hits: &[Hit]) -> Result<()> {
    let field = |name: &str, text| Ok::<_, anyhow::Error>(Field { name: name.into(), dtype: scalar(text)? });
    let dtype =
        DType::Record(vec![field("t", "<f8")?, field("triangle", "<u4")?, field("u", "<f4")?, field("v", "<f4")?]);
    let mut data = Vec::with_capacity(hits.len() * 20);
    for hit in hits {
        data.extend_from_slice(&hit.t.to_le_bytes());
        data.extend_from_slice(&hit.triangle.to_le_bytes());
        data.extend_from_slice(&hit.u.to_le_bytes());
        data.extend_from_slice(&hit.v.to_le_bytes());
    }
    write(path, dtype, hits.len(), &data)
}

/// Writes, a row a ray, whether something was hit.
///
/// # Errors
/// The file cannot be written.
pub fn write_any(path: &Path, hit: &[bool]) -> Result<()> {
    let data: Vec<u8> = hit.iter().map(|&b| u8::from(b)).collect();
    write(path, scalar("|b1")?, hit.len(), &data)
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
        let little = read_rays(&file(folder.path(), "<f8", "False", "(3, 8)", &numbers(24))).unwrap();
        assert_eq!(little.len(), 3);
        assert_eq!(little[0].origin, [-3.0, -2.5, -2.0]);
        assert_eq!(little[2].direction, [6.5, 7.0, 7.5]);
        assert_eq!((little[1].t_min, little[1].t_max), (4.0, 4.5));
        let swapped: Vec<u8> =
            numbers(24).chunks(8).flat_map(|c| c.iter().rev().copied().collect::<Vec<_>>()).collect();
        assert_eq!(read_rays(&file(folder.path(), ">f8", "False", "(3, 8)", &swapped)).unwrap(), little);
        assert_eq!(read_rays(&file(folder.path(), "<f8", "False", "(0, 8)", &[])).unwrap(), []);
        // numpy.save marks (1, 8) and (0, 8) as C order, other writers may not.
        assert_eq!(read_rays(&file(folder.path(), "<f8", "True", "(1, 8)", &numbers(8))).unwrap().len(), 1);
    }

    #[test]
    fn refuses_anything_else_and_names_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let refused = |path: PathBuf, part: &str| {
            let message = format!("{:#}", read_rays(&path).unwrap_err());
            assert!(message.contains("r.npy") && message.contains(part), "{message:?} lacks {part:?}");
        };
        refused(file(folder, "<f4", "False", "(3, 8)", &numbers(12)), "<f4");
        refused(file(folder, "|O", "False", "(3, 8)", &numbers(24)), "float64");
        refused(file(folder, "<f8", "False", "(4, 6)", &numbers(24)), "[4, 6]");
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
    fn hits_are_a_structured_array() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("h.npy");
        let hits = [
            Hit { t: 1.5, triangle: 7, u: 0.25, v: 0.5 },
            Hit { t: f64::INFINITY, triangle: u32::MAX, u: 0.0, v: 0.0 },
        ];
        write_hits(&path, &hits).unwrap();
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
    }

    #[test]
    fn occlusion_is_an_array_of_bool() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("h.npy");
        write_any(&path, &[true, false, true]).unwrap();
        let file = NpyFile::new(File::open(&path).unwrap()).unwrap();
        assert_eq!(file.dtype().descr(), "'|b1'");
        assert_eq!(file.into_vec::<bool>().unwrap(), [true, false, true]);
        write_any(&path, &[]).unwrap();
        assert_eq!(NpyFile::new(File::open(&path).unwrap()).unwrap().shape(), [0]);
    }
}
