//! Images from files: PNG and EXR.

use super::color::linear_from_srgb;
use super::image::Image;
use bricks::planted::{self, Defect};
use exr::prelude::{FlatSamples, MetaData, ReadChannels, ReadLayers};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

/// Most pixels of an EXR file that is read: 16384², against files whose header asks for more memory than there is.
const MAX_PIXELS: u64 = 1 << 28;

/// Most pixels of a byte of a PNG file: deflate reaches 1032:1, and a grey pixel takes a bit.
const MAX_PIXELS_A_BYTE: u64 = 8 * 1032;

/// The same of an EXR file, whose pixels take two bytes at least.
const MAX_EXR_PIXELS_A_BYTE: u64 = 1032;

/// How a file encodes its colours, which decides which FLIP applies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// PNG: sRGB, 8 or 16 bits.
    Png,
    /// OpenEXR: linear, f16 or f32.
    Exr,
}

/// One channel of an EXR file: a value a pixel, row by row.
#[derive(Clone, Debug, PartialEq)]
pub enum Channel {
    /// f32 samples, or f16 samples widened.
    Float(Vec<f32>),
    /// u32 samples.
    Integer(Vec<u32>),
}

/// What [`load()`] found in a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// The file.
    pub path: PathBuf,
    /// Its encoding.
    pub encoding: Encoding,
    /// The picture in linear RGB. Alpha is dropped, not multiplied.
    pub image: Image,
    /// All channels of an EXR file by full name, such as `triangle.id`; R, G and B among them. Empty for PNG. In a file
    /// of several parts, those of a part with a name are called `part.channel`.
    pub channels: BTreeMap<String, Channel>,
}

/// A file that cannot be read as an image.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The file cannot be opened or read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is neither PNG nor EXR by its first bytes.
    #[error("{}: neither a PNG nor an EXR file; convert it to one of them", path.display())]
    Format {
        /// The file.
        path: PathBuf,
    },
    /// The PNG decoder refused the file.
    #[error("{}: damaged or unsupported PNG: {source}", path.display())]
    Png {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: image::ImageError,
    },
    /// The EXR decoder refused the file.
    #[error("{}: damaged or unsupported EXR: {source}", path.display())]
    Exr {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: exr::error::Error,
    },
    /// The file is not of a kind that can be compared.
    #[error("{}: {found}; {expected}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What the file has.
        found: String,
        /// What it should have.
        expected: &'static str,
    },
}

/// Reads a PNG (decoded from sRGB to linear) or an EXR file (taken as linear), told apart by their first bytes.
pub fn load(path: impl AsRef<Path>) -> Result<Loaded, LoadError> {
    let path = path.as_ref();
    let io = |source| LoadError::Io { path: path.to_owned(), source };
    let mut magic = Vec::with_capacity(8);
    File::open(path).and_then(|file| file.take(8).read_to_end(&mut magic)).map_err(io)?;
    if magic.starts_with(b"\x89PNG\r\n\x1a\n") {
        load_png(path)
    } else if magic.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        load_exr(path)
    } else {
        Err(LoadError::Format { path: path.to_owned() })
    }
}

fn load_png(path: &Path) -> Result<Loaded, LoadError> {
    let io = |source| LoadError::Io { path: path.to_owned(), source };
    let png = |source| LoadError::Png { path: path.to_owned(), source };
    let file = File::open(path).map_err(io)?;
    let bytes = file.metadata().map_err(io)?.len();
    let reader = image::ImageReader::with_format(BufReader::new(&file), image::ImageFormat::Png);
    let (width, height) = reader.into_dimensions().map_err(png)?;
    let pixels = u64::from(width) * u64::from(height);
    // Before memory is taken for them.
    let fits = pixels <= bytes.saturating_mul(MAX_PIXELS_A_BYTE) || planted::is(Defect::PngSize);
    if !fits || pixels > MAX_PIXELS {
        let found = format!("{width}x{height} pixels in {bytes} bytes");
        let expected = "images of up to 2^28 pixels are compared, and a file has bytes for its own";
        return Err(LoadError::Unsupported { path: path.to_owned(), found, expected });
    }
    let file = File::open(path).map_err(io)?;
    let reader = image::ImageReader::with_format(BufReader::new(file), image::ImageFormat::Png);
    let picture = reader.decode().map_err(png)?;
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let table = |codes: usize| -> Vec<f32> {
        (0..codes).map(|code| linear_from_srgb(code as f64 / (codes - 1) as f64) as f32).collect()
    };
    let rgb = if picture.color().bytes_per_pixel() / picture.color().channel_count() > 1 {
        let linear = table(1 << 16);
        picture.into_rgb16().pixels().map(|p| p.0.map(|code| linear[code as usize])).collect()
    } else {
        let linear = table(1 << 8);
        picture.into_rgb8().pixels().map(|p| p.0.map(|code| linear[code as usize])).collect()
    };
    let image = Image { width, height, rgb };
    Ok(Loaded { path: path.to_owned(), encoding: Encoding::Png, image, channels: BTreeMap::new() })
}

fn load_exr(path: &Path) -> Result<Loaded, LoadError> {
    let damaged = |source| LoadError::Exr { path: path.to_owned(), source };
    let unsupported = |found: String, expected| LoadError::Unsupported { path: path.to_owned(), found, expected };

    let metadata = MetaData::read_from_file(path, false).map_err(damaged)?;
    let length = std::fs::metadata(path).map_err(|source| LoadError::Io { path: path.to_owned(), source })?.len();
    let size = metadata.headers.first().map(|header| header.layer_size).unwrap_or_default();
    let (width, height) = (size.width(), size.height());
    for header in &metadata.headers {
        let pixels = header.layer_size.width() as u64 * header.layer_size.height() as u64;
        if pixels > MAX_PIXELS {
            return Err(unsupported(format!("{pixels} pixels"), "images of up to 2^28 pixels are compared"));
        }
        // Before memory is taken for them.
        if pixels > length.saturating_mul(MAX_EXR_PIXELS_A_BYTE) {
            let found = format!("{width}x{height} pixels in {length} bytes");
            return Err(unsupported(found, "a file has bytes for its own; it is damaged"));
        }
        if header.layer_size != size {
            let (w, h) = (header.layer_size.width(), header.layer_size.height());
            return Err(unsupported(format!("parts of {width}x{height} and {w}x{h}"), "all parts must have one size"));
        }
    }

    let file = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels().all_layers();
    let file = file.all_attributes().from_file(path).map_err(damaged)?;
    let several = file.layer_data.len() > 1;
    let mut channels = BTreeMap::new();
    for layer in file.layer_data {
        let prefix = layer.attributes.layer_name.filter(|_| several).map(|name| format!("{name}.")).unwrap_or_default();
        for channel in layer.channel_data.list {
            let name = format!("{prefix}{}", channel.name);
            let values = match channel.sample_data {
                FlatSamples::F16(values) => Channel::Float(values.iter().map(|value| value.to_f32()).collect()),
                FlatSamples::F32(values) => Channel::Float(values),
                FlatSamples::U32(values) => Channel::Integer(values),
            };
            let samples = match &values {
                Channel::Float(values) => values.len(),
                Channel::Integer(values) => values.len(),
            };
            if samples != width * height {
                let found = format!("channel {name} has {samples} samples for {width}x{height} pixels");
                return Err(unsupported(found, "subsampled channels cannot be compared"));
            }
            channels.insert(name, values);
        }
    }

    let color = |name: &'static str| match channels.get(name) {
        Some(Channel::Float(values)) => Ok(values),
        _ => {
            let found = format!("no floating-point channel {name}");
            Err(unsupported(found, "the colours must be in channels R, G and B of f16 or f32"))
        }
    };
    let (r, g, b) = (color("R")?, color("G")?, color("B")?);
    let rgb = r.iter().zip(g).zip(b).map(|((&r, &g), &b)| [r, g, b]).collect();
    let image = Image { width, height, rgb };
    Ok(Loaded { path: path.to_owned(), encoding: Encoding::Exr, image, channels })
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::prelude::{AnyChannel, AnyChannels, Encoding as ExrEncoding, Layer, LayerAttributes, WritableImage, f16};

    fn write_exr(path: &Path, width: usize, height: usize, channels: Vec<AnyChannel<FlatSamples>>) {
        let channels = AnyChannels::sort(channels.into_iter().collect());
        let layer = Layer::new((width, height), LayerAttributes::default(), ExrEncoding::FAST_LOSSLESS, channels);
        exr::prelude::Image::from_layer(layer).write().to_file(path).unwrap();
    }

    #[test]
    fn exr_channels_by_name() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.exr");
        let halves = FlatSamples::F16([0.5, 1.0, 2.0, -3.0].map(f16::from_f32).to_vec());
        write_exr(
            &path,
            2,
            2,
            vec![
                AnyChannel::new("R", halves),
                AnyChannel::new("G", FlatSamples::F32(vec![0.1, 0.2, 0.3, 0.4])),
                AnyChannel::new("B", FlatSamples::F32(vec![f32::INFINITY, 0.0, 0.0, 1e20])),
                AnyChannel::new("triangle.id", FlatSamples::U32(vec![16_777_217, 0, u32::MAX, 4])),
            ],
        );
        let loaded = load(&path).unwrap();
        assert_eq!((loaded.encoding, loaded.image.width, loaded.image.height), (Encoding::Exr, 2, 2));
        assert_eq!(loaded.image.get(1, 1), [-3.0, 0.4, 1e20]);
        assert_eq!(loaded.image.get(0, 0), [0.5, 0.1, f32::INFINITY]);
        // 16,777,217 has no f32, so the ids came as integers.
        assert_eq!(loaded.channels["triangle.id"], Channel::Integer(vec![16_777_217, 0, u32::MAX, 4]));

        let without = directory.path().join("b.exr");
        write_exr(&without, 1, 1, vec![AnyChannel::new("R", FlatSamples::F32(vec![0.0]))]);
        let text = load(&without).unwrap_err().to_string();
        assert!(text.contains("b.exr") && text.contains("channel G"), "{text}");
    }

    #[test]
    fn png_is_decoded_from_srgb() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.png");
        image::RgbaImage::from_fn(2, 1, |x, _| image::Rgba([188, 0, 255, 77 * x as u8])).save(&path).unwrap();
        let eight = load(&path).unwrap();
        assert_eq!(eight.encoding, Encoding::Png);
        assert_eq!(eight.image.get(0, 0), eight.image.get(1, 0), "alpha is dropped");
        assert!((eight.image.get(0, 0)[0] - 0.502_886_5).abs() < 1e-6);
        assert_eq!(eight.image.get(0, 0)[1..], [0.0, 1.0]);

        let path = directory.path().join("b.png");
        let sixteen: image::ImageBuffer<image::Rgb<u16>, Vec<u16>> =
            image::ImageBuffer::from_fn(1, 1, |_, _| image::Rgb([188 * 257 + 1, 188 * 257, 65535]));
        sixteen.save(&path).unwrap();
        let p = load(&path).unwrap().image.get(0, 0);
        assert_eq!(p[1], eight.image.get(0, 0)[0]);
        assert!(p[0] > p[1] && p[0] < p[1] + 1e-4, "the low byte counts");
    }

    /// The checksum of the first chunk of a PNG file, a bit at a time.
    fn crc_of_ihdr(file: &[u8]) -> u32 {
        let step = |crc: u32, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 };
        !file[12..29].iter().fold(u32::MAX, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), step))
    }

    #[test]
    fn bad_files_are_errors_that_name_them() {
        let directory = tempfile::tempdir().unwrap();
        let check = |name: &str, bytes: &[u8]| {
            let path = directory.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            let text = load(&path).unwrap_err().to_string();
            assert!(text.contains(name), "{text}");
        };
        check("text.png", b"not a picture");
        check("empty.exr", b"");
        check("short.png", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR");
        check("short.exr", &[0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0]);
        assert!(matches!(load(directory.path().join("absent.png")), Err(LoadError::Io { .. })));

        // A header that promises more than the file can hold.
        let mut huge = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\x3e\x80\0\0\x1f\x40\x08\x02\0\0\0".to_vec();
        huge.extend([0x2d, 0x76, 0x34, 0x1a, 0, 0, 0, 0]);
        let path = directory.path().join("huge.png");
        let checksum = crc_of_ihdr(&huge);
        huge.splice(29..33, checksum.to_be_bytes());
        huge.extend(b"IDAT\x35\xaf\x06\x1e");
        std::fs::write(&path, huge).unwrap();
        let text = load(&path).unwrap_err().to_string();
        assert!(text.contains("16000x8000 pixels in "), "{text}");

        // A sound file cut anywhere is an error too.
        let path = directory.path().join("c.exr");
        let plane = || FlatSamples::F32((0..64).map(|i| i as f32).collect());
        write_exr(&path, 8, 8, ["R", "G", "B"].map(|name| AnyChannel::new(name, plane())).to_vec());
        let bytes = std::fs::read(&path).unwrap();
        // As with PNG: of its window the largest x is another.
        let mut huge = bytes.clone();
        let window = b"dataWindow\0box2i\0";
        let at = huge.windows(window.len()).position(|part| part == window).unwrap() + window.len() + 4;
        huge[at + 8..at + 12].copy_from_slice(&3_000_000i32.to_le_bytes());
        std::fs::write(&path, huge).unwrap();
        let text = load(&path).unwrap_err().to_string();
        assert!(text.contains("3000001x8 pixels in "), "{text}");
        for keep in (4..bytes.len()).step_by(bytes.len() / 13) {
            check("cut.exr", &bytes[..keep]);
        }
    }
}
