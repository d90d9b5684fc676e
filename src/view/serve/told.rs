//! What a page tells, and which settings it may change: those of pictures, and none that names a file of the machine
//! that serves.

use crate::session::Settings;
use crate::settings::{Environment, Group, SettingsError};
use crate::view::viewer::NodeAct;
use serde::Deserialize;

/// Settings that a page may change.
const OPEN: [&str; 17] = [
    "effects",
    "ao_rays",
    "ao_length",
    "diffuse_rays",
    "sun",
    "sun_angle",
    "sun_intensity",
    "sky_intensity",
    "environment",
    "environment_rotation",
    "environment_intensity",
    "lights_intensity",
    "spp",
    "lod",
    "exposure",
    "tone_map",
    "denoise",
];
/// Most samples a pixel that a page may ask for.
const MOST_SAMPLES: u32 = 4096;
/// Most pixels of a picture of a page: some 2 GB of rays and what shading keeps, where bounces are on.
pub const MOST_PIXELS: f64 = 4e6;

/// The settings that a page may change, by their keys.
pub fn open() -> &'static [&'static str] {
    &OPEN
}

/// What a page tells, an object of JSON a message.
#[derive(Debug, Deserialize, PartialEq)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum Told {
    /// The last picture is on the screen; the next may come.
    Taken,
    /// Pictures have this size in pixels from now on.
    Size {
        /// Width.
        width: u32,
        /// Height.
        height: u32,
    },
    /// The keys that are held, each from -1 to 1.
    Thrust {
        /// Forward.
        forward: f64,
        /// Right.
        right: f64,
        /// Up.
        up: f64,
        /// Faster.
        fast: bool,
    },
    /// Turn where the camera is, radians.
    Look {
        /// To the right.
        right: f64,
        /// Up.
        up: f64,
    },
    /// Turn about the point under a place, which the first of a drag names; shares of width and height, radians.
    Orbit {
        /// The place.
        at: Option<[f64; 2]>,
        /// To the right.
        right: f64,
        /// Up.
        up: f64,
    },
    /// Nearer to what is at a place.
    Dolly {
        /// The place.
        at: [f64; 2],
        /// Steps of the wheel.
        steps: f64,
    },
    /// A click: what is it, or where double, go there.
    Click {
        /// The place.
        at: [f64; 2],
        /// Twice.
        double: bool,
    },
    /// Clicks measure from now on, or tell what is there.
    Measure {
        /// Whether they do.
        on: bool,
    },
    /// Back to the first view.
    Home,
    /// The whole scene.
    All,
    /// Cuts the scene open, or makes it whole.
    Clip,
    /// Looks for nodes by name.
    Find {
        /// A part of it.
        text: String,
    },
    /// Does something with a node: one of those found by name, or the one that was clicked on.
    Node {
        /// What.
        act: NodeAct,
        /// Which of those found.
        number: Option<usize>,
    },
    /// Shows everything again.
    ShowAll,
    /// Leaves the camera behind, or forgets it.
    Freeze,
    /// Another overlay.
    Overlay {
        /// Its name.
        name: String,
    },
    /// Another value of a setting.
    Set {
        /// Its key in a settings file.
        key: String,
        /// Its value, as on the command line.
        value: String,
    },
    /// A keyframe where the camera is.
    Keyframe,
    /// Records a flight, or stops.
    Record,
    /// No keyframes any more.
    ForgetPath,
    /// Play the path, or stop.
    Play,
    /// The path, as a file that `walk` reads.
    Path,
    /// Compare with the exact picture.
    Compare,
}

/// Changes a setting, if a page may.
///
/// # Errors
/// It may not; the value is none.
pub fn set(settings: &mut Settings, key: &str, value: &str) -> Result<(), SettingsError> {
    if !OPEN.contains(&key) {
        let known = OPEN.join(", ");
        return Err(SettingsError::Unknown { key: key.into(), known });
    }
    let mut changed = settings.clone();
    changed.set(key, value)?;
    if matches!(changed.environment, Some(Environment::File(_))) && changed.environment != settings.environment {
        return Err(SettingsError::wrong(
            key,
            "it must be auto, sky or off; a file is named where it is served".into(),
        ));
    }
    changed.spp = changed.spp.min(MOST_SAMPLES);
    changed.check()?;
    *settings = changed;
    Ok(())
}

/// A number of a page that counts as none where it is not one, within a bound.
pub fn number(x: f64, most: f64) -> f64 {
    if x.is_finite() { x.clamp(-most, most) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_read_and_others_refused() {
        let read = |text: &str| serde_json::from_str::<Told>(text);
        assert_eq!(read(r#"{"do":"taken"}"#).unwrap(), Told::Taken);
        assert_eq!(read(r#"{"do":"look","right":0.5,"up":-1}"#).unwrap(), Told::Look { right: 0.5, up: -1.0 });
        let orbit = Told::Orbit { at: Some([0.5, 0.25]), right: 0.0, up: 0.0 };
        assert_eq!(read(r#"{"do":"orbit","at":[0.5,0.25],"right":0,"up":0}"#).unwrap(), orbit);
        for bad in ["", "{}", "[]", r#"{"do":"delete"}"#, r#"{"do":"look","right":"x","up":0}"#, r#"{"do":"size"}"#] {
            assert!(read(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn a_page_changes_pictures_and_nothing_else() {
        let mut settings = Settings::default();
        set(&mut settings, "spp", "16").unwrap();
        set(&mut settings, "effects", "primary,diffuse").unwrap();
        set(&mut settings, "environment", "off").unwrap();
        assert!(settings.spp == 16 && settings.effects.diffuse && settings.environment.is_none());
        let before = settings.clone();
        for (key, value) in [
            ("environment", "/etc/passwd"),
            ("path", "a.json"),
            ("cache", "1G"),
            ("requests_out", "x"),
            ("spp", "0"),
            ("lod", "-1"),
            ("nothing", "1"),
        ] {
            assert!(set(&mut settings, key, value).is_err(), "{key}");
            assert_eq!(settings, before);
        }
        set(&mut settings, "spp", "999999").unwrap();
        assert_eq!(settings.spp, MOST_SAMPLES);
        assert_eq!((number(f64::NAN, 1.0), number(9.0, 1.0), number(-9.0, 1.0)), (0.0, 1.0, -1.0));
    }

    #[test]
    fn what_a_page_may_set_is_a_setting_that_changes_while_a_scene_is_open() {
        let entries = Settings::entries();
        for key in OPEN {
            assert!(entries.iter().any(|entry| entry.key() == key), "{key}");
        }
    }
}
