//! Images of textures: PNG, JPEG, WebP, and KTX2 with Basis Universal.

use super::bytes::Bytes;
use super::error::one_line;
use super::panics::quietly;
use crate::source::SourceTexture;
use basisu::{DecodeFlags, TargetFormat, Transcoder};
use bricks::planted::{self, Defect};
use image::ImageFormat;
use std::borrow::Cow;

/// Longest side of an image, in texels.
const MAX_SIDE: u32 = bricks::MAX_TEXTURE_SIZE;

/// Most bytes of RGBA texels for a byte of an image file, so that a few bytes cannot demand gigabytes. Deflate reaches
/// 1032:1, and a grey texel of one byte becomes four.
const MAX_COMPRESSION: u64 = 8192;

/// Images of so few bytes of RGBA texels may be compressed at will.
const FREE_TEXEL_BYTES: u64 = 1 << 20;

/// Largest image file.
const MAX_FILE_BYTES: u64 = 1 << 30;

/// The first bytes of a KTX2 file (KTX 2.0, section 3.1).
const KTX2: &[u8; 12] = b"\xabKTX 20\xbb\r\n\x1a\n";

/// Reads and decodes an image; the error says why it cannot be used.
pub(super) fn decode_texture(bytes: &Bytes, name: String, wrap: u32) -> Result<SourceTexture, String> {
    if bytes.len() > MAX_FILE_BYTES {
        return Err(format!("its {} bytes are more than an image may have", bytes.len()));
    }
    let bytes = bytes.read()?;
    let decoded = quietly(|| if bytes.starts_with(KTX2) { transcode(&bytes) } else { decode(&bytes) });
    let (width, height, rgba) = decoded.unwrap_or_else(|| Err("its data is damaged".into()))?;
    Ok(SourceTexture { name, width, height, wrap, rgba })
}

/// One image of channels of several, each the number of an image and the channel of that; white where there is none. It
/// has the size of the largest; the others are interpolated.
pub(super) fn pack(
    images: &[SourceTexture],
    channels: [Option<(usize, usize)>; 4],
    name: String,
    wrap: u32,
) -> SourceTexture {
    let width = images.iter().map(|image| image.width).max().unwrap_or(1);
    let height = images.iter().map(|image| image.height).max().unwrap_or(1);
    let resized = |image: &SourceTexture| {
        let texels = image::ImageBuffer::<image::Rgba<u8>, _>::from_raw(image.width, image.height, &image.rgba[..])?;
        Some(image::imageops::resize(&texels, width, height, image::imageops::FilterType::Triangle).into_raw())
    };
    let mut rgba = vec![255; 4 * width as usize * height as usize];
    for (number, image) in images.iter().enumerate() {
        let wanted = || channels.iter().enumerate().filter_map(|(to, channel)| Some((to, (*channel)?)));
        let mut wanted = wanted().filter(|(_, (which, _))| *which == number).peekable();
        if wanted.peek().is_none() {
            continue;
        }
        let is_whole = (image.width, image.height) == (width, height);
        let Some(texels) = (if is_whole { Some(Cow::Borrowed(&image.rgba)) } else { resized(image).map(Cow::Owned) })
        else {
            continue;
        };
        for (to, (_, from)) in wanted {
            for (out, texel) in rgba.iter_mut().skip(to).step_by(4).zip(texels.iter().skip(from).step_by(4)) {
                *out = *texel;
            }
        }
    }
    SourceTexture { name, width, height, wrap, rgba }
}

/// Texels of an image: width, height, RGBA8.
type Texels = (u32, u32, Vec<u8>);

/// Refuses sizes out of proportion to the `held` bytes of the file.
fn check_size(width: u32, height: u32, held: usize) -> Result<(), String> {
    if width == 0 || height == 0 || width > MAX_SIDE || height > MAX_SIDE {
        return Err(format!("it has {width}x{height} texels; 1 to {MAX_SIDE} a side are read"));
    }
    let texel_bytes = 4 * u64::from(width) * u64::from(height);
    let is_free = texel_bytes <= FREE_TEXEL_BYTES || planted::is(Defect::ImageSize);
    if !is_free && texel_bytes / MAX_COMPRESSION > held as u64 {
        return Err(format!("it claims {width}x{height} texels, more than its {held} bytes can hold"));
    }
    Ok(())
}

fn decode(bytes: &[u8]) -> Result<Texels, String> {
    let format = match image::guess_format(bytes) {
        Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::WebP)) => format,
        _ => return Err("it is neither PNG, JPEG, WebP nor KTX2".into()),
    };
    let reader = || image::ImageReader::with_format(std::io::Cursor::new(bytes), format);
    let (width, height) = reader().into_dimensions().map_err(|e| one_line(&e.to_string()))?;
    check_size(width, height, bytes.len())?;
    let mut reader = reader();
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    limits.max_alloc = Some(4 * 4 * u64::from(MAX_SIDE) * u64::from(MAX_SIDE));
    reader.limits(limits);
    let image = reader.decode().map_err(|e| one_line(&e.to_string()))?.into_rgba8();
    Ok((image.width(), image.height(), image.into_raw()))
}

/// The largest level of a KTX2 file with Basis Universal (KTX 2.0, section 3).
fn transcode(bytes: &[u8]) -> Result<Texels, String> {
    let read = |at: usize| Some(u64::from_le_bytes(bytes.get(at..at + 8)?.try_into().ok()?));
    let cut = || "its header is cut off".to_owned();
    let word = |at: usize| read(at).map(|word| word as u32).ok_or_else(cut);
    let (width, height, depth, layers, faces) = (word(20)?, word(24)?, word(28)?, word(32)?, word(36)?);
    check_size(width, height, bytes.len())?;
    if depth > 0 || layers > 1 || faces != 1 {
        return Err("it is not one flat picture".into());
    }
    // Blocks of 4x4 texels have at most 16 bytes. The transcoder allocates what the header states.
    let most = 16 * u64::from(width.div_ceil(4)) * u64::from(height.div_ceil(4));
    if read(96).ok_or_else(cut)? > most {
        return Err("its largest level is longer than its texels".into());
    }
    let problem = |e: basisu::Error| one_line(&format!("{e:?}"));
    let transcoder = Transcoder::new(bytes).map_err(problem)?;
    let rgba = transcoder.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE).map_err(problem)?;
    if rgba.len() as u64 != 4 * u64::from(width) * u64::from(height) {
        return Err("its largest level has another size".into());
    }
    Ok((width, height, rgba))
}
