//! Sun, sky, environment and emitters of a session, from its settings and from the scene.

use crate::frame::{
    EnvironmentNotes, Equirectangular, Light, MOST_TRIANGLES, ShiningTriangles, SkyModel, emissive_triangles,
    environment, luminance,
};
use crate::kernels::Lamps;
use crate::kernels::lamps::{Emitter, Shape};
use crate::session::Settings;
use crate::settings;
use crate::settings::sizes::counted;
use anyhow::{Context, Result, anyhow, bail};
use bricks::planted::{self, Defect};
use bricks::{LIGHT_DISTANT, LIGHT_SPOT, PunctualLight, Resident, SceneFile};
use exr::prelude::{MetaData, ReadChannels, ReadLayers};
use glam::DVec3;
use image::ImageDecoder;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;
use std::sync::{Arc, OnceLock};

/// Most texels of an environment image each way, and in all: 1.5 GiB as it is read.
const MOST_SIZE: usize = 1 << 15;
const MOST_TEXELS: usize = 1 << 27;

/// Size of the image of the physical sky.
const SKY_SIZE: [u32; 2] = [512, 256];

/// What lights a walk.
#[derive(Clone, Debug)]
pub struct Lighting {
    /// Sun, sky and lamps.
    pub light: Light,
    /// What the emitters among the lamps are made of.
    pub sources: LampSources,
    /// What became of the environment's image; `None` without an environment.
    pub environment: Option<EnvironmentNotes>,
    /// What a person should know, a line each.
    pub warnings: Vec<String>,
}

/// What emitters are made of.
#[derive(Clone, Debug, Default)]
pub struct LampSources {
    /// Those that stay where they are.
    fixed: Vec<Emitter>,
    /// Those that instances take along.
    shining: ShiningTriangles,
}

impl LampSources {
    /// The lamps of a scene whose instances have moved, those named; `None`: the same as before.
    pub fn moved(&self, before: &Lamps, resident: &Resident, moved: &[u32]) -> Option<Lamps> {
        let shines = |&instance: &u32| self.shining.shines(resident.instances[instance as usize].object);
        // What distant lights send depends on the scene's size.
        let is_distant = |emitter: &Emitter| matches!(emitter.shape, Shape::Distant { .. });
        let is_same = !moved.iter().any(shines) && !self.fixed.iter().any(is_distant);
        (!is_same).then(|| Lamps::new(before.environment.clone(), self.emitters(resident), radius(resident)))
    }

    fn emitters(&self, resident: &Resident) -> Vec<Emitter> {
        self.fixed.iter().copied().chain(self.shining.emitters(resident)).collect()
    }
}

/// Half the diagonal of a scene's bounds, world units.
fn radius(resident: &Resident) -> f64 {
    let manifest = &resident.manifest;
    0.5 * (DVec3::from_array(manifest.max) - DVec3::from_array(manifest.min)).length()
}

/// The light of the scene `file`, whose name is `path`, by `settings`.
///
/// # Errors
/// An image that cannot be read or is too large; a brick that cannot be read.
pub fn lighting(settings: &Settings, file: &SceneFile, path: &Path) -> Result<Lighting> {
    let settings = &settings.suited(&file.resident().manifest);
    let effects = settings.effects;
    let (sun_intensity, sky_intensity) = (settings.sun_intensity(), settings.sky_intensity);
    let mut warnings = Vec::new();
    let mut light = Light::new(settings.sun.unit(), settings.sun_angle, sun_intensity as f32, sky_intensity as f32);
    let mut turn = 0.0;
    let image = match &settings.environment {
        Some(settings::Environment::Auto | settings::Environment::Sky) => {
            Some(physical_sky(&mut light, sun_intensity, sky_intensity))
        }
        Some(settings::Environment::File(path)) => {
            turn = settings.environment_rotation;
            let image = read(path)?;
            if image.width != 2 * image.height {
                let (width, height) = (image.width, image.height);
                warnings.push(format!(
                    "{}: an environment is twice as wide as high; this image of {width} x {height} is stretched",
                    path.display()
                ));
            }
            Some(image)
        }
        None => effects.environment.then(|| light.sky_image()),
    };
    let prepared = image.map(|image| environment(image, settings.environment_intensity, turn));
    let (environment, notes) = prepared.unzip();
    if let (Some(notes), Some(choice)) = (notes, &settings.environment) {
        if notes.bad_texels > 0 {
            let count = counted(notes.bad_texels, "texel");
            warnings.push(format!("{choice}: {count} infinite, negative or NaN; treated as black"));
        }
        if notes.energy_change.abs() > 1e-4 {
            warnings.push(format!("{choice}: scaling it down changed its power by {:e}", notes.energy_change));
        }
    }
    let mut sources = LampSources::default();
    sources.fixed.extend(rectangle(settings));
    sources.fixed.extend(file.resident().lights.iter().map(|light| punctual(light, settings.lights_intensity)));
    if effects.shadow {
        let found = emissive_triangles(file, MOST_TRIANGLES).with_context(|| path.display().to_string())?;
        match found {
            Ok(triangles) => sources.shining = triangles,
            Err(count) => warnings.push(format!(
                "{}: {count} triangles emit light, of which at most {MOST_TRIANGLES} can be lamps; their light comes \
                 by --effects diffuse alone",
                path.display()
            )),
        }
    }
    if effects.environment && effects.ao {
        warnings
            .push("--effects ao has no effect together with environment, which traces its own shadows; skipped".into());
    }
    let resident = file.resident();
    light.lamps = Arc::new(Lamps::new(environment, sources.emitters(resident), radius(resident)));
    Ok(Lighting { light, sources, environment: notes, warnings })
}

/// The rectangular light, if there is one.
fn rectangle(settings: &Settings) -> Option<Emitter> {
    let radiance = [settings.rect_light_intensity as f32; 3];
    let shape = |settings::Rectangle { corner, edges }| Shape::Parallelogram { corner, edges };
    settings.rect_light.map(|light| Emitter { shape: shape(light), two_sided: false, radiance })
}

/// A light of the scene file, `scale` times as bright. Photometric units are taken as radiometric ones: 1 candela as 1
/// W/sr, 1 lux as 1 W/m², so that a white surface under 1 lux has a radiance of 1/π.
fn punctual(light: &PunctualLight, scale: f64) -> Emitter {
    let (position, direction) = (DVec3::from_array(light.position), DVec3::from_array(light.direction));
    let range = light.range.into();
    let shape = match light.kind {
        LIGHT_DISTANT => Shape::Distant { direction },
        LIGHT_SPOT => Shape::Spot { position, direction, range, cone: light.cone.map(f64::from) },
        _ => Shape::Point { position, range },
    };
    let radiance = light.color.map(|c| (f64::from(c) * scale).min(f32::MAX.into()) as f32);
    Emitter { shape, two_sided: false, radiance }
}

/// The sky of the sun of `light`, which takes the colour that the air leaves it, over a ground that both light. At an
/// elevation of 45 degrees both are as bright as those that they replace.
fn physical_sky(light: &mut Light, sun_intensity: f64, sky_intensity: f64) -> Equirectangular {
    let model = SkyModel::shared();
    let [usual_sun, usual_sky] = Light::usual_luminance();
    let half = std::f64::consts::FRAC_1_SQRT_2;
    static REFERENCE: OnceLock<[f64; 3]> = OnceLock::new();
    let reference =
        *REFERENCE.get_or_init(|| SkyModel::irradiance(&model.image([0.0, half, -half], [1.0; 2], [128, 64])));
    let sun = model.sun(light.sun_direction.y);
    let sun_scale = sun_intensity * usual_sun / luminance(model.sun(half));
    light.sun_color = sun.map(|c| (c * sun_scale) as f32);
    let sky_scale = sky_intensity * usual_sky * std::f64::consts::PI / luminance(reference);
    // The sun's colour is what white reflects of it.
    model.image(light.sun_direction.to_array(), [sun_scale * std::f64::consts::PI, sky_scale], SKY_SIZE)
}

/// Reads an equirectangular image of linear radiance: Radiance HDR or OpenEXR, told apart by their first bytes.
///
/// # Errors
/// It cannot be read, is damaged, is neither, or is too large.
pub fn read(path: &Path) -> Result<Equirectangular> {
    let name = path.display();
    let mut magic = [0; 4];
    let found = File::open(path)
        .and_then(|mut file| file.read_exact(&mut magic))
        .with_context(|| format!("{name}: cannot read the environment; give an .hdr or .exr image, or the word sky"));
    found?;
    let damaged = || format!("{name}: the environment is damaged or truncated; give a complete .hdr or .exr image");
    let image = match &magic {
        b"#?RA" | b"#?RG" => read_hdr(path),
        [0x76, 0x2f, 0x31, 0x01] => read_exr(path),
        _ => bail!("{name}: the environment is neither Radiance HDR nor OpenEXR; convert it to one of them"),
    };
    image.with_context(damaged)
}

/// Refuses sizes that no environment has before memory is taken for them.
fn check_size(width: usize, height: usize) -> Result<()> {
    let is_sound = (1..=MOST_SIZE).contains(&width) && (1..=MOST_SIZE).contains(&height);
    if is_sound && width * height <= MOST_TEXELS {
        return Ok(());
    }
    Err(anyhow!(
        "it states {width} x {height} texels, of at most {MOST_SIZE} each way and {MOST_TEXELS} in all; scale it down"
    ))
}

fn read_hdr(path: &Path) -> Result<Equirectangular> {
    let file = File::open(path)?;
    let bytes = file.metadata()?.len();
    let decoder = image::codecs::hdr::HdrDecoder::new(BufReader::new(file))?;
    let (width, height) = decoder.dimensions();
    check_size(width as usize, height as usize)?;
    // Runs of up to 127 take two bytes in each of four channels.
    if u64::from(width) * u64::from(height) > bytes.saturating_mul(16) && !planted::is(Defect::HdrSize) {
        bail!("its {bytes} bytes cannot hold {width} x {height} texels");
    }
    let values = image::DynamicImage::from_decoder(decoder)?.into_rgb32f().into_raw();
    Ok(Equirectangular { width, height, texels: values.as_chunks::<3>().0.to_vec() })
}

fn read_exr(path: &Path) -> Result<Equirectangular> {
    let bytes = std::fs::metadata(path)?.len();
    for header in &MetaData::read_from_file(path, false)?.headers {
        let (width, height) = (header.layer_size.0, header.layer_size.1);
        check_size(width, height)?;
        // Deflate reaches 1032:1, and a texel takes two bytes at least.
        if (width * height) as u64 > bytes.saturating_mul(1032) {
            bail!("its {bytes} bytes cannot hold {width} x {height} texels");
        }
    }
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgba_channels(
            |size, _| Equirectangular {
                width: size.0 as u32,
                height: size.1 as u32,
                texels: vec![[0.0; 3]; size.0 * size.1],
            },
            |image, at, (r, g, b, _): (f32, f32, f32, f32)| {
                let index = at.1 * image.width as usize + at.0;
                image.texels[index] = [r, g, b];
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_file(path)?;
    Ok(image.layer_data.channel_data.pixels)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(path: &Path) -> String {
        let line = format!("{:#}", read(path).unwrap_err());
        assert!(line.contains(&path.display().to_string()) && !line.contains('\n'), "{line}");
        line
    }

    #[test]
    fn images_are_read_and_what_is_none_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            path
        };
        // Two texels of 1 and 10^6, without runs: 1 = 128/256 * 2^1, 10^6 = 244.14/256 * 2^20.
        let hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x80\x80\x81\xf4\xf4\xf4\x94";
        let image = read(&file("two.hdr", hdr)).unwrap();
        assert_eq!((image.width, image.height, image.texels[0]), (2, 1, [1.0; 3]));
        assert!((image.texels[1][0] / 1e6 - 1.0).abs() < 0.01, "{:?}", image.texels);
        assert!(refused(&file("cut.hdr", &hdr[..hdr.len() - 3])).contains("truncated"));
        let huge = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1000000 +X 1000000\n\x80\x80\x80\x81";
        assert!(refused(&file("huge.hdr", huge)).contains("scale it down"));
        let vast = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8000 +X 16000\n\x80\x80\x80\x81";
        assert!(refused(&file("vast.hdr", vast)).contains("cannot hold"));
        assert!(refused(&file("what.png", b"\x89PNG\r\n")).contains("neither"));
        assert!(refused(&file("empty.exr", b"")).contains("word sky"));
        assert!(refused(&folder.path().join("missing.hdr")).contains("cannot read"));
        let path = folder.path().join("three.exr");
        exr::prelude::write_rgb_file(&path, 3, 1, |x, _| (x as f32, 1e6f32, -1.0f32)).unwrap();
        assert_eq!(read(&path).unwrap().texels, [[0.0, 1e6, -1.0], [1.0, 1e6, -1.0], [2.0, 1e6, -1.0]]);
        let whole = std::fs::read(&path).unwrap();
        assert!(refused(&file("cut.exr", &whole[..whole.len() - 9])).contains("truncated"));
        assert!(refused(&file("head.exr", &whole[..40])).contains("truncated"));
        let mut vast = whole;
        let window = b"dataWindow\0box2i\0";
        let at = vast.windows(window.len()).position(|part| part == window).unwrap() + window.len() + 4;
        vast[at + 8..at + 12].copy_from_slice(&15_999i32.to_le_bytes());
        vast[at + 12..at + 16].copy_from_slice(&7_999i32.to_le_bytes());
        assert!(refused(&file("vast.exr", &vast)).contains("cannot hold 16000 x 8000"));
    }
}
