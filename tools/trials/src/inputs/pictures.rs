//! Pictures that `compare` reads: PNG and OpenEXR.

use super::{Files, Format, Verdict, image};
use crate::kind::Fault;
use crate::mutate::{Harm, chunks};
use crate::random::Random;
use brickwalk::metrics::{Channel, load};
use exr::prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, Layer, LayerAttributes, WritableImage};
use std::io::Cursor;
use std::path::Path;

/// An OpenEXR file of a few pixels.
pub fn exr(random: &mut Random) -> Vec<u8> {
    let (width, height) = (random.within(1, 12), random.within(1, 12));
    let mut plane = |_: &str| {
        let values: Vec<f32> = (0..width * height).map(|_| random.below(4096) as f32 / 256.0).collect();
        match random.below(3) {
            0 => FlatSamples::F16(values.iter().map(|value| exr::prelude::f16::from_f32(*value)).collect()),
            _ => FlatSamples::F32(values),
        }
    };
    let channels = ["R", "G", "B"].map(|name| AnyChannel::new(name, plane(name)));
    let encoding = random.pick([
        Encoding::UNCOMPRESSED,
        Encoding::FAST_LOSSLESS,
        Encoding::SMALL_LOSSLESS,
        Encoding::SMALL_FAST_LOSSLESS,
    ]);
    let channels = AnyChannels::sort(channels.into_iter().collect());
    let layer = Layer::new((width, height), LayerAttributes::default(), encoding, channels);
    let mut file = Cursor::new(Vec::new());
    // Writing to memory does not fail; an empty file is refused by who reads it.
    let _ = exr::prelude::Image::from_layer(layer).write().to_buffered(&mut file);
    file.into_inner()
}

/// Changes numbers of an OpenEXR file's header, which takes the first few hundred bytes.
pub fn change_exr(harm: Harm, random: &mut Random, file: &mut Vec<u8>) {
    let end = file.len().min(random.pick([64, 200, 400]));
    let mut head = file[..end].to_vec();
    harm.bytes(random, &mut head, 100);
    file.splice(..end, head);
}

/// Pictures.
pub struct Pictures;

impl Format for Pictures {
    const NAME: &'static str = "inputs/pictures";
    const ABOUT: &'static str =
        "PNG and OpenEXR pictures as compare reads them: chunks with right checksums, headers, blocks";

    fn make(&self, random: &mut Random, harm: Harm) -> Files {
        if random.chance(50) {
            let mut file = image(random, image::ImageFormat::Png);
            if harm.does(random, 70) {
                chunks::change_png(harm, random, &mut file);
            }
            harm.bytes(random, &mut file, 30);
            return Files::one("a.png", file);
        }
        let mut file = exr(random);
        if harm.does(random, 50) {
            change_exr(harm, random, &mut file);
        }
        harm.bytes(random, &mut file, 50);
        Files::one("a.exr", file)
    }

    fn read(&self, _: &mut Random, files: &Files, folder: &Path) -> Result<Verdict, Fault> {
        let loaded = match load(files.write(folder)?) {
            Ok(loaded) => loaded,
            Err(error) => return Ok(Verdict::Refused(error.to_string())),
        };
        let pixels = loaded.image.width * loaded.image.height;
        let length = |channel: &Channel| match channel {
            Channel::Float(values) => values.len(),
            Channel::Integer(values) => values.len(),
        };
        match loaded.image.rgb.len() == pixels && loaded.channels.values().all(|channel| length(channel) == pixels) {
            true => Ok(Verdict::Read),
            false => Err(Fault::new("a picture has another number of pixels than its size says", files.name())),
        }
    }
}
