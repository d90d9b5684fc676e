//! Presets: what `--quality` names, and the settings that each stands for.

use super::Settings;
use crate::settings::{Entry, Group, Heading, Plain, Rule, Value};
use std::fmt;

/// What pictures are made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quality {
    /// One of the others, by what else is chosen: [`Settings::for_pictures`].
    Auto,
    /// To find one's way: the sun, and occlusion of the sky.
    Draft,
    /// To be looked at: the light of two bounces, without the noise of few samples.
    Preview,
    /// To be shown: all light, and many samples.
    High,
    /// To be measured: nothing between the rays and the picture.
    Exact,
}

/// A preset's name, and what it sets: keys and values.
type Preset = (Quality, &'static str, &'static [(&'static str, &'static str)]);

/// All of them, in the order of [`Quality`].
const PRESETS: [Preset; 5] = [
    (Quality::Auto, "auto", &[]),
    (Quality::Draft, "draft", &[]),
    (
        Quality::Preview,
        "preview",
        &[
            ("effects", "shadow,diffuse,environment"),
            ("diffuse_rays", "1"),
            ("bounces", "2"),
            ("spp", "4"),
            ("denoise", "on"),
        ],
    ),
    (Quality::High, "high", &[("effects", "path"), ("diffuse_rays", "1"), ("spp", "16"), ("denoise", "on")]),
    (
        Quality::Exact,
        "exact",
        &[
            ("effects", "primary,shadow"),
            ("ao_rays", "20"),
            ("ao_length", "0.5"),
            ("diffuse_rays", "20"),
            ("rotation", "36"),
            ("environment", "none"),
            ("spp", "1"),
            ("exposure", "0"),
            ("tone_map", "none"),
            ("denoise", "off"),
            ("taa", "off"),
            ("secondary", "exact"),
        ],
    ),
];

/// Settings beside those of effects, methods and measurements with which pictures are what these say, and no more.
const OWN: [&str; 7] = ["spp", "noise", "denoise", "taa", "lod_correct", "frame_budget", "interactive"];

/// The filter takes about 700 bytes a pixel of the host's memory.
const MOST_PIXELS: u64 = 1 << 23;

impl Settings {
    /// These settings with `draft` in the place of `auto`, so that options that are told stand for what is
    /// shown.
    pub fn for_windows(&self) -> Self {
        let quality = if self.quality == Quality::Auto { Quality::Draft } else { self.quality };
        Self { quality, ..self.clone() }
    }

    /// These settings with a preset in the place of `auto`: `preview`, or `draft` where single settings
    /// choose effects, samples, methods or measurements, and where a picture has more than 8,388,608 pixels.
    pub fn for_pictures(&self) -> Self {
        let mut settled = self.clone();
        if self.quality == Quality::Auto {
            let is_own = |entry: &Entry| {
                let heading = entry.field.heading;
                matches!(heading, Heading::Effects | Heading::Methods | Heading::Measurement)
                    || OWN.contains(&entry.field.key)
            };
            let is_large = u64::from(self.size.width) * u64::from(self.size.height) > MOST_PIXELS;
            let is_draft = is_large || self.chosen().iter().any(is_own);
            let preset = if is_draft { Quality::Draft } else { Quality::Preview };
            // What a preset sets are values, as a test shows.
            let _ = settled.set("quality", preset.name());
        }
        settled
    }
}

impl Quality {
    fn preset(self) -> &'static Preset {
        &PRESETS[self as usize]
    }

    /// The preset's name.
    pub fn name(self) -> &'static str {
        self.preset().1
    }
}

impl fmt::Display for Quality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Value for Quality {
    const NAMES: &'static [&'static str] = &[PRESETS[0].1, PRESETS[1].1, PRESETS[2].1, PRESETS[3].1, PRESETS[4].1];
    const IS_PRESET: bool = true;

    fn read(text: &str, _: Rule, _: &str) -> Result<Self, String> {
        let found = PRESETS.iter().find(|(_, name, _)| *name == text);
        found.map(|(quality, ..)| *quality).ok_or_else(|| crate::settings::removed::unknown(text, Self::NAMES, &[]))
    }

    fn plain(&self) -> Plain {
        Plain::Text(self.name().into())
    }

    fn presets(&self) -> &'static [(&'static str, &'static str)] {
        self.preset().2
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::EffectList;

    #[test]
    fn presets_set_values_and_stand_in_their_order() {
        for (quality, name, sets) in PRESETS {
            assert_eq!((quality.preset().0, quality.name()), (quality, name));
            let settings = Settings::from_options(&format!("--quality {name}")).unwrap();
            for (key, text) in sets {
                let mut one = Settings::default();
                one.set(key, text).unwrap();
                assert_eq!(settings.get(key), one.get(key), "{name}: {key}");
            }
            assert!(settings.chosen().is_empty(), "{name}: {}", settings.options());
            assert_eq!(Settings::from_toml(&settings.to_toml()), Ok(settings), "{name}");
        }
        assert_eq!(Settings::from_options("--quality exact"), Ok(Settings::exact()));
        assert_eq!(Settings::exact().options(), "--quality exact");
        assert!(
            Settings::from_options("--quality best")
                .unwrap_err()
                .to_string()
                .contains("auto, draft, preview, high, exact")
        );
    }

    #[test]
    fn pictures_look_finished_unless_single_settings_say_what_they_are() {
        let found = |options: &str| Settings::from_options(options).unwrap().for_pictures();
        for options in ["", "--cache 20% --size 640x360", "--environment none --sun 0,1,0", "--schedule chc --bands 4"]
        {
            let settings = found(options);
            assert!(settings.quality == Quality::Preview && settings.denoise && settings.effects.diffuse, "{options}");
            let named = Settings::from_options(&format!("--quality preview {options}")).unwrap();
            assert_eq!(settings, named, "{options}");
            assert_eq!(Settings::from_options(&settings.options()), Ok(settings), "{options}");
        }
        for options in
            ["--effects shadow", "--spp 16", "--secondary roma", "--measure-needed", "--frame-budget 8M", "--ao-rays 8"]
        {
            let settings = found(options);
            let named = Settings::from_options(&format!("--quality draft {options}")).unwrap();
            assert_eq!(settings, named, "{options}");
            assert!(settings.quality == Quality::Draft && !settings.denoise, "{options}");
        }
        assert_eq!(found("--size 8192x8192").quality, Quality::Draft);
        for name in ["draft", "high", "exact"] {
            assert_eq!(found(&format!("--quality {name}")).quality.name(), name);
        }
    }

    #[test]
    fn single_settings_win_over_presets_whatever_their_order() {
        let expected = Settings { spp: 7, effects: EffectList::PRIMARY, ..Settings::exact() };
        for options in ["--spp 7 --quality exact --effects primary", "--quality exact --effects primary --spp 7"] {
            assert_eq!(Settings::from_options(options), Ok(expected.clone()), "{options}");
        }
        for text in [
            "spp = 7\nquality = \"exact\"\neffects = \"primary\"",
            "effects = \"primary\"\nspp = 7\nquality = \"exact\"",
        ] {
            assert_eq!(Settings::from_toml(text), Ok(expected.clone()), "{text}");
        }
        assert_eq!(expected.options(), "--quality exact --effects primary --spp 7");
        assert_eq!(Settings::from_options(&expected.options()), Ok(expected));
        // What a preset has otherwise than the defaults may be chosen as the defaults have it.
        let lit = Settings { environment: Settings::default().environment, ..Settings::exact() };
        assert_eq!(Settings::from_toml(&lit.to_toml()), Ok(lit.clone()));
        assert_eq!(Settings::from_options(&lit.options()), Ok(lit));
    }
}
