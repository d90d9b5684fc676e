//! Options of what is traced beside camera rays, and of the lamps.

use super::named::named_values;
use super::sizes::{Direction, non_negative};
use crate::frame::{Effects, Occlusion};
use crate::kernels::lamps::{Emitter, Shape};
use clap::Args;
use glam::DVec3;
use std::convert::Infallible;
use std::path::PathBuf;
use std::str::FromStr;

/// Options of the passes.
#[derive(Clone, Debug, Args)]
pub struct EffectArgs {
    /// What to trace, separated by commas: primary, shadow (of the sun, the rectangular light and surfaces that emit,
    /// which light others by it), ao (ambient occlusion of the sky's light), diffuse (one bounce between surfaces, the
    /// sky's light with it), environment (the light of the environment, or of the sky, with shadows: rays in directions
    /// drawn by its brightness; ao is left out beside it, and diffuse rays share the light with them), glossy (what
    /// metals and polished surfaces mirror: one ray in a direction drawn by their roughness, whose hits are lit);
    /// all include primary
    #[arg(long, value_name = "LIST", default_value = "primary,shadow")]
    pub effects: EffectList,
    /// Rays a pixel and sample of ao, 1 to 1024
    #[arg(long, value_name = "N", default_value = "20", value_parser = direction_count)]
    pub ao_rays: u32,
    /// Length of the rays of ao in world units (metres in glTF)
    #[arg(long, value_name = "LENGTH", default_value = "0.5", value_parser = ray_length)]
    pub ao_length: f64,
    /// Rays a pixel and sample of diffuse, 1 to 1024; they are as long as the scene
    #[arg(long, value_name = "N", default_value = "20", value_parser = direction_count)]
    pub diffuse_rays: u32,
    /// Greatest random turn about the normal, a pixel, of the directions of ao and diffuse, in degrees from 0 to 360,
    /// or full; a small one keeps rays of neighbouring pixels alike. Not with --denoise or --taa, which give every
    /// pixel directions of its own
    #[arg(long, value_name = "DEG|full", default_value = "36", value_parser = turn)]
    pub rotation: f32,
}

impl EffectArgs {
    /// The effects of every frame.
    pub fn effects(&self) -> Effects {
        let EffectList { shadow, ao, diffuse, glossy, environment } = self.effects;
        Effects {
            shadow,
            environment,
            occlusion: (ao && !environment).then_some(Occlusion { rays: self.ao_rays, length: self.ao_length }),
            diffuse: diffuse.then_some(self.diffuse_rays),
            glossy,
            turn_degrees: self.rotation,
        }
    }
}

named_values! {
    /// A pass.
    Effect {
        /// Rays of the camera.
        Primary = "primary",
        /// Rays towards the lamps.
        Shadow = "shadow",
        /// Short rays around the normal.
        Ao = "ao",
        /// Rays around the normal whose hits are shaded.
        Diffuse = "diffuse",
        /// Rays drawn by the gloss of surfaces, whose hits are shaded.
        Glossy = "glossy",
        /// Rays towards the environment.
        Environment = "environment",
    } later &[]
}

/// The passes of a frame; primary rays are always among them, as every other pass starts where they end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EffectList {
    /// Rays towards the lamps.
    pub shadow: bool,
    /// Ambient occlusion.
    pub ao: bool,
    /// Diffuse interreflection.
    pub diffuse: bool,
    /// Reflections by the gloss of surfaces.
    pub glossy: bool,
    /// Rays towards the environment.
    pub environment: bool,
}

impl FromStr for EffectList {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut effects = Self::default();
        for name in text.split(',') {
            match name.trim().parse::<Effect>()? {
                Effect::Primary => {}
                Effect::Shadow => effects.shadow = true,
                Effect::Ao => effects.ao = true,
                Effect::Diffuse => effects.diffuse = true,
                Effect::Glossy => effects.glossy = true,
                Effect::Environment => effects.environment = true,
            }
        }
        Ok(effects)
    }
}

impl std::fmt::Display for EffectList {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let names = [
            (self.shadow, ",shadow"),
            (self.ao, ",ao"),
            (self.diffuse, ",diffuse"),
            (self.glossy, ",glossy"),
            (self.environment, ",environment"),
        ];
        f.write_str("primary")?;
        names.iter().filter(|(is_on, _)| *is_on).try_for_each(|(_, name)| f.write_str(name))
    }
}

/// Options of the lamps and the sky.
#[derive(Clone, Debug, Args)]
pub struct LightArgs {
    /// Direction towards the sun, world space, any length
    #[arg(long, value_name = "X,Y,Z", default_value = "0.4,0.8,0.45", allow_hyphen_values = true)]
    pub sun: Direction,
    /// Angular diameter of the sun in degrees, 0 (hard shadows) to 90
    #[arg(long, value_name = "DEG", default_value = "0.53", value_parser = sun_angle)]
    pub sun_angle: f64,
    /// Irradiance of the sun on a surface that faces it; a white surface then reflects 1/pi of it [default: 2.4, with
    /// an image as environment, which has its own sun, 0]
    #[arg(long, value_name = "X", value_parser = non_negative)]
    pub sun_intensity: Option<f64>,
    /// Radiance of the sky, the same in all directions; unshadowed without ao and diffuse
    #[arg(long, value_name = "X", default_value = "0.35", value_parser = non_negative)]
    pub sky_intensity: f64,
    /// What surrounds the scene, in place of the sky: an image of all directions, .hdr or .exr, linear, +Y up, its
    /// middle along -Z and its right along +X; or the word sky, a physical sky with the sun of --sun. It is seen where
    /// rays meet nothing; with --effects environment it lights with shadows, else without, by its spherical harmonics,
    /// or by diffuse [default: none]
    #[arg(long, value_name = "FILE|sky")]
    pub environment: Option<EnvironmentChoice>,
    /// Turn of the environment's image about +Y in degrees, counter-clockwise seen from above, -360 to 360
    #[arg(long, value_name = "DEG", default_value = "0", allow_hyphen_values = true, value_parser = image_turn)]
    pub environment_rotation: f64,
    /// Factor of the environment's radiance
    #[arg(long, value_name = "X", default_value = "1", value_parser = non_negative)]
    pub environment_intensity: f64,
    /// Factor of the lights that the scene file brings (KHR_lights_punctual of glTF), 0 for none; 1 candela is taken as
    /// 1 W/sr, 1 lux as 1 W/m2
    #[arg(long, value_name = "X", default_value = "1", value_parser = non_negative)]
    pub lights_intensity: f64,
    /// A rectangular light: a corner and the two edges U and V that start there, world space; it shines to the side of
    /// U x V and is not seen itself [default: none]
    #[arg(long, value_name = "X,Y,Z,UX,UY,UZ,VX,VY,VZ", allow_hyphen_values = true, value_parser = rectangle)]
    pub rect_light: Option<[DVec3; 3]>,
    /// Radiance of the rectangular light
    #[arg(long, value_name = "X", default_value = "10", value_parser = non_negative)]
    pub rect_light_intensity: f64,
}

impl LightArgs {
    /// The rectangular light, if there is one.
    pub fn rectangle(&self) -> Option<Emitter> {
        let radiance = [self.rect_light_intensity as f32; 3];
        let shape = |[corner, u, v]: [DVec3; 3]| Shape::Parallelogram { corner, edges: [u, v] };
        self.rect_light.map(|light| Emitter { shape: shape(light), two_sided: false, radiance })
    }

    /// `--sun-intensity`, or its default.
    pub fn sun_intensity(&self) -> f64 {
        let has_image = matches!(self.environment, Some(EnvironmentChoice::File(_)));
        self.sun_intensity.unwrap_or(if has_image { 0.0 } else { 2.4 })
    }
}

/// What `--environment` asks for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum EnvironmentChoice {
    /// The physical sky.
    Sky,
    /// An image.
    File(PathBuf),
}

impl FromStr for EnvironmentChoice {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(if text == "sky" { Self::Sky } else { Self::File(text.into()) })
    }
}

impl std::fmt::Display for EnvironmentChoice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Sky => f.write_str("sky"),
            Self::File(path) => path.display().fmt(f),
        }
    }
}

fn direction_count(text: &str) -> Result<u32, String> {
    super::args::ranged(text, 1, 1024)
}

pub(crate) fn ray_length(text: &str) -> Result<f64, String> {
    let length = text.parse().map_err(|_| "it must be a number")?;
    if (1e-6..=1e9).contains(&length) { Ok(length) } else { Err("it must be from 1e-6 to 1e9".into()) }
}

fn turn(text: &str) -> Result<f32, String> {
    if text == "full" {
        return Ok(360.0);
    }
    let degrees = text.parse().map_err(|_| "it must be a number of degrees, or full")?;
    if (0.0..=360.0).contains(&degrees) { Ok(degrees) } else { Err("it must be from 0 to 360".into()) }
}

fn sun_angle(text: &str) -> Result<f64, String> {
    non_negative(text).ok().filter(|deg| *deg <= 90.0).ok_or_else(|| "it must be from 0 to 90 degrees".into())
}

fn image_turn(text: &str) -> Result<f64, String> {
    let degrees: f64 = text.parse().map_err(|_| "it must be a number of degrees")?;
    if degrees.abs() <= 360.0 { Ok(degrees) } else { Err("it must be from -360 to 360".into()) }
}

/// A corner and two edges that span an area.
fn rectangle(text: &str) -> Result<[DVec3; 3], String> {
    let values: Vec<f64> = text.split(',').filter_map(|value| value.trim().parse().ok()).collect();
    let finite = values.iter().all(|value| value.is_finite() && value.abs() <= 1e9);
    if values.len() != 9 || text.split(',').count() != 9 || !finite {
        return Err("it must be nine numbers within 1e9: a corner, an edge, an edge".into());
    }
    let [corner, u, v] = [0, 3, 6].map(|at| DVec3::new(values[at], values[at + 1], values[at + 2]));
    if u.cross(v).length() > 1e-12 { Ok([corner, u, v]) } else { Err("its edges must span an area".into()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_read_and_written_alike() {
        for text in ["primary", "primary,shadow", "primary,ao", "primary,shadow,ao,diffuse,glossy,environment"] {
            assert_eq!(text.parse::<EffectList>().unwrap().to_string(), text);
        }
        assert_eq!("ao".parse::<EffectList>().unwrap().to_string(), "primary,ao");
        assert!("glow".parse::<EffectList>().is_err());
    }

    #[test]
    fn values_out_of_range_are_refused() {
        assert_eq!(image_turn("-90"), Ok(-90.0));
        assert!(image_turn("361").is_err() && image_turn("nan").is_err());
        assert_eq!(turn("full"), Ok(360.0));
        assert!(turn("361").is_err() && turn("nan").is_err() && ray_length("0").is_err() && ray_length("nan").is_err());
        assert!(rectangle("0,0,0,1,0,0,0,0,1").is_ok());
        for bad in ["0,0,0,1,0,0,2,0,0", "0,0,0,1,0,0", "0,0,0,1,0,0,0,0,x", "0,0,0,1,0,0,0,0,inf", ""] {
            assert!(rectangle(bad).is_err(), "{bad}");
        }
    }
}
