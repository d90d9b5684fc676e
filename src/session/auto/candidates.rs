//! What `--secondary auto` chooses among: methods with their parameters, effect by effect.

use crate::secondary::{EffectMethods, Method};
use crate::session::Settings;
use crate::settings::{Group, SettingsError};
use bricks::Resident;

/// The effects that methods answer.
pub const EFFECTS: [&str; 4] = ["ao", "shadow", "diffuse", "environment"];

/// A method with parameters, for the rays of an effect.
#[derive(Debug, PartialEq)]
pub struct Candidate {
    /// Whose rays.
    pub effect: &'static str,
    /// What rates and summaries call it.
    pub name: &'static str,
    /// The method.
    pub method: Method,
    /// Settings that are not the user's: keys and values.
    pub set: &'static [(&'static str, &'static str)],
    /// Whether rays are traced as well, so that bricks are loaded for them.
    pub traces: bool,
}

const fn maps(effect: &'static str, name: &'static str, set: &'static [(&'static str, &'static str)]) -> Candidate {
    Candidate { effect, name, method: Method::Roma, set, traces: false }
}

const fn displacement(effect: &'static str) -> Candidate {
    Candidate { effect, name: "displacement", method: Method::Displacement, set: &[], traces: true }
}

/// All of them: of each effect those that a study of Sponza, a city and teapots found on a front.
pub const CANDIDATES: &[Candidate] = &[
    maps("ao", "roma, 32 cells", &[("roma.size", "32"), ("roma.k", "8")]),
    maps("ao", "roma, 64 cells", &[("roma.size", "64"), ("roma.k", "4")]),
    maps("ao", "roma, 128 cells", &[("roma.size", "128"), ("roma.k", "4")]),
    Candidate {
        effect: "ao",
        name: "sift, one in 4",
        method: Method::Sift,
        set: &[("roma.one_in", "4"), ("roma.size", "64")],
        traces: true,
    },
    displacement("ao"),
    maps("shadow", "roma, 32 cells", &[("roma.size", "32"), ("roma.shadow_k", "4")]),
    maps("shadow", "roma, 128 cells", &[("roma.size", "128"), ("roma.shadow_k", "4")]),
    displacement("shadow"),
    maps("diffuse", "roma, 32 cells", &[("roma.size", "32"), ("roma.diffuse_k", "4")]),
    maps("diffuse", "roma, 64 cells", &[("roma.size", "64"), ("roma.diffuse_k", "4")]),
    maps("diffuse", "roma, 128 cells", &[("roma.size", "128"), ("roma.diffuse_k", "4")]),
    displacement("diffuse"),
    Candidate {
        effect: "environment",
        name: "dvf, 20,000 points",
        method: Method::Dvf,
        set: &[("dvf.points", "20000"), ("dvf.count", "rounding")],
        traces: true,
    },
    displacement("environment"),
];

/// Those of an effect that a scene has the data for.
pub fn possible(effect: &str, resident: &Resident) -> impl Iterator<Item = &'static Candidate> {
    let (has_cells, has_fields) = (!resident.occupancy.is_empty(), !resident.displacement.is_empty());
    CANDIDATES.iter().filter(move |candidate| match candidate.method {
        _ if candidate.effect != effect => false,
        Method::Displacement => has_fields,
        Method::Dvf => true,
        _ => has_cells,
    })
}

/// The options of a walk that has an effect by itself.
pub fn alone(effect: &str) -> &'static str {
    match effect {
        "ao" => "--effects ao --sun-intensity 0",
        "shadow" => "--effects shadow --sky-intensity 0",
        "diffuse" => "--effects shadow,diffuse --sky-intensity 0",
        _ => "--effects environment --environment sky",
    }
}

impl Candidate {
    /// `settings` by which it answers its rays, and no method any others.
    ///
    /// # Errors
    /// A setting that is none.
    pub fn over(&self, settings: &Settings) -> Result<Settings, SettingsError> {
        let mut own = settings.clone();
        own.secondary = EffectMethods::EXACT.by(self.effect, self.method);
        self.set.iter().try_for_each(|(key, value)| own.set(key, value))?;
        Ok(own)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn candidates_are_settings_with_names_of_their_own() {
        let mut names = BTreeSet::new();
        for candidate in CANDIDATES {
            let settings = candidate.over(&Settings::exact()).unwrap();
            settings.check().unwrap();
            assert!(settings.secondary.has(candidate.method), "{candidate:?}");
            assert_eq!(settings.secondary.list().iter().filter(|(_, method)| *method != Method::Exact).count(), 1);
            assert!(names.insert((candidate.effect, candidate.name)), "{candidate:?} twice");
        }
        for effect in EFFECTS {
            assert!(CANDIDATES.iter().any(|candidate| candidate.effect == effect), "{effect}");
            Settings::from_options(&format!("--quality exact {}", alone(effect))).unwrap().check().unwrap();
        }
    }
}
