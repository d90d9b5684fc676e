//! Kinds of hostile inputs: a format makes a small valid input of its own, harms it on the way, and reads it. Whatever
//! the bytes, reading ends with what obeys the format's promises or with one line that says what is wrong.

pub mod arrays;
pub mod bricks_file;
pub mod compressed;
pub mod disk_cache;
pub mod draco;
pub mod environment;
pub mod field;
pub mod gltf;
pub mod imported;
pub mod keyframes;
pub mod messages;
pub mod npy;
pub mod obj;
pub mod pictures;
pub mod ply;
pub mod rates;
pub mod requests;
pub mod rows;
pub mod samples;
pub mod settings;
pub mod stl;
pub mod tiles;
pub mod words;

use crate::kind::{Fault, Kind, Limits, Outcome, Trial};
use crate::mutate::Harm;
use crate::random::Random;
use std::path::{Path, PathBuf};

/// Most characters of the line that refuses an input: it may name two paths, each as long as paths can be.
const MOST_LINE: usize = 10_000;

/// Files of an input: names, with folders, and bytes. The first is the one that is read.
#[derive(Clone, Debug, Default)]
pub struct Files(pub Vec<(String, Vec<u8>)>);

impl Files {
    /// One file.
    pub fn one(name: &str, bytes: Vec<u8>) -> Self {
        Self(vec![(name.into(), bytes)])
    }

    /// The name of the file that is read.
    pub fn name(&self) -> &str {
        self.0.first().map_or("", |(name, _)| name)
    }

    /// The bytes of the file that is read.
    pub fn bytes(&self) -> &[u8] {
        self.0.first().map_or(&[], |(_, bytes)| bytes)
    }

    /// Bytes of all.
    pub fn length(&self) -> u64 {
        self.0.iter().map(|(_, bytes)| bytes.len() as u64).sum()
    }

    /// Writes them into a folder; the path of the file that is read.
    ///
    /// # Errors
    /// They cannot be written.
    pub fn write(&self, folder: &Path) -> Result<PathBuf, Fault> {
        for (name, bytes) in &self.0 {
            let path = folder.join(name);
            let parent = path.parent().unwrap_or(folder);
            let written = std::fs::create_dir_all(parent).and_then(|()| std::fs::write(&path, bytes));
            written.map_err(|error| Fault::new("a file cannot be written", format!("{}: {error}", path.display())))?;
        }
        Ok(folder.join(self.name()))
    }
}

/// What reading came to.
#[derive(Debug)]
pub enum Verdict {
    /// It was read, and is as it should be.
    Read,
    /// It was refused, with these words.
    Refused(String),
}

/// A format that is read.
pub trait Format: Send + Sync {
    /// The name of its kind.
    const NAME: &'static str;
    /// What it tries, in a sentence without a full stop.
    const ABOUT: &'static str;
    /// Most bytes of memory that reading may take.
    const MOST_BYTES: u64 = 64 << 20;
    /// Whether a refusal names the file.
    const NAMES_FILE: bool = true;
    /// Whether a refusal is one line by itself; else who prints it makes it one.
    const IS_LINE: bool = true;
    /// Whether what is not harmed has to be read.
    const IS_SOUND: bool = true;

    /// Makes an input, harmed or not.
    fn make(&self, random: &mut Random, harm: Harm) -> Files;

    /// Reads it; `folder` is empty and may be used.
    ///
    /// # Errors
    /// What was read breaks a promise of the format.
    fn read(&self, random: &mut Random, files: &Files, folder: &Path) -> Result<Verdict, Fault>;

    /// Why it cannot run here; `None`: it can.
    fn lacks(&self) -> Option<String> {
        None
    }
}

impl<F: Format> Kind for F {
    fn name(&self) -> &'static str {
        F::NAME
    }

    fn about(&self) -> &'static str {
        F::ABOUT
    }

    fn limits(&self) -> Limits {
        Limits { seconds: 20.0, bytes: F::MOST_BYTES }
    }

    fn lacks(&self) -> Option<String> {
        Format::lacks(self)
    }

    fn trial(&self, trial: &Trial) -> Result<Outcome, Fault> {
        let mut random = Random::new(F::NAME, trial.seed);
        let harm = Harm::of(trial.seed);
        let files = self.make(&mut random, harm);
        if let Some(keep) = trial.keep {
            files.write(keep)?;
        }
        let line = match self.read(&mut random, &files, trial.folder)? {
            Verdict::Read => return Ok(Outcome::Passed),
            Verdict::Refused(line) => line,
        };
        if harm.is_off() && F::IS_SOUND {
            return Err(Fault::new("a sound input is refused", line));
        }
        let is_line = !F::IS_LINE || !line.contains('\n');
        if line.is_empty() || !is_line || line.chars().count() > MOST_LINE {
            return Err(Fault::new("a refusal is not one line", line));
        }
        // Of a set of files, one that is not there.
        let folder = trial.folder.to_string_lossy();
        if F::NAMES_FILE && !line.contains(&*folder) && !files.0.iter().any(|(name, _)| line.contains(name)) {
            return Err(Fault::new("a refusal names no file", line));
        }
        Ok(Outcome::Stopped)
    }
}

/// An input that was refused, by an error and its causes.
pub fn refused<T>(error: &anyhow::Error) -> Result<Verdict, T> {
    Ok(Verdict::Refused(format!("{error:#}")))
}

/// Little-endian bytes of numbers.
pub fn le32(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// Little-endian bytes of numbers.
pub fn le16(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// An image in one of the formats that textures have, of a few texels.
pub fn image(random: &mut Random, format: image::ImageFormat) -> Vec<u8> {
    let (width, height) = (random.within(1, 9) as u32, random.within(1, 9) as u32);
    let texels: Vec<u8> = (0..width * height * 3).map(|_| random.word() as u8).collect();
    let mut bytes = std::io::Cursor::new(Vec::new());
    let image = image::RgbImage::from_raw(width, height, texels).map(image::DynamicImage::ImageRgb8);
    let image = match (image, random.below(4)) {
        (Some(image), 0) if format == image::ImageFormat::Png => image.into_luma16().into(),
        (Some(image), 1) if format == image::ImageFormat::Png => image.into_rgba8().into(),
        (image, _) => image.unwrap_or_default(),
    };
    // Encoders into memory do not fail for formats that have them; an empty image is refused by who reads it.
    let _ = image.write_to(&mut bytes, format);
    bytes.into_inner()
}

/// An image of any of these formats, harmed.
pub fn harmed_image(random: &mut Random, harm: Harm, percent: usize) -> Vec<u8> {
    use image::ImageFormat::{Jpeg, Png, WebP};
    let format = random.pick([Png, Png, Jpeg, WebP]);
    let mut bytes = image(random, format);
    if format == Png && harm.does(random, percent) {
        crate::mutate::chunks::change_png(harm, random, &mut bytes);
    }
    harm.bytes(random, &mut bytes, percent / 2);
    bytes
}

/// A KTX2 file of one level in UASTC (KTX 2.0, sections 3 and 5): most blocks of one colour, the others of any bits.
pub fn ktx2(random: &mut Random, harm: Harm) -> Vec<u8> {
    let (width, height) = (random.within(1, 9) as u32, random.within(1, 9) as u32);
    let mut blocks: Vec<u8> = (0..16 * width.div_ceil(4) * height.div_ceil(4)).map(|_| random.word() as u8).collect();
    for block in blocks.chunks_exact_mut(16).filter(|_| random.chance(80)) {
        // The mode of one colour: five bits.
        block[0] = block[0] & !31 | 23;
    }
    let word = |bytes: &mut Vec<u8>, value: u32| bytes.extend_from_slice(&value.to_le_bytes());
    let mut bytes = b"\xabKTX 20\xbb\r\n\x1a\n".to_vec();
    // No format of Vulkan, bytes; size; no depth, no layers, one face, one level, no supercompression; where the
    // descriptor is, where keys are, where global data is.
    for value in [0, 1, width, height, 0, 0, 1, 1, 0, 104, 44, 0, 0, 0, 0, 0, 0] {
        word(&mut bytes, value);
    }
    // The level: where, its length, and that again.
    for value in [160, 0, blocks.len() as u32, 0, blocks.len() as u32, 0] {
        word(&mut bytes, value);
    }
    // The descriptor: its length, kind and version; UASTC, BT.709, sRGB; blocks of 4x4; a sample of 128 bits, RGBA.
    for value in [44, 0, 40 << 16 | 2, 166 | 1 << 8 | 2 << 16, 3 | 3 << 8, 16, 0, 127 << 16 | 3 << 24, 0, 0, u32::MAX] {
        word(&mut bytes, value);
    }
    bytes.resize(160, 0);
    bytes.extend_from_slice(&blocks);
    harm.bytes(random, &mut bytes, 30);
    bytes
}
