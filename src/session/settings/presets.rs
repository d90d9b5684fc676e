//! Presets: what `--quality` names, and the settings that each stands for.

use crate::settings::{Plain, Rule, Value};
use std::fmt;

/// What pictures are made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quality {
    /// To find one's way: the fastest picture of the scene.
    Draft,
    /// To be looked at; what all settings are by default.
    Preview,
    /// To be shown: all light, and many samples.
    High,
    /// To be measured: nothing between the rays and the picture.
    Exact,
}

/// A preset's name, and what it sets: keys and values.
type Preset = (Quality, &'static str, &'static [(&'static str, &'static str)]);

/// All of them, in the order of [`Quality`].
const PRESETS: [Preset; 4] = [
    (Quality::Draft, "draft", &[("effects", "primary,shadow"), ("spp", "1")]),
    (Quality::Preview, "preview", &[]),
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
    const NAMES: &'static [&'static str] = &[PRESETS[0].1, PRESETS[1].1, PRESETS[2].1, PRESETS[3].1];
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
    use crate::session::Settings;
    use crate::settings::{EffectList, Group};

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
            Settings::from_options("--quality best").unwrap_err().to_string().contains("draft, preview, high, exact")
        );
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
