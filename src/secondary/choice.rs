//! The methods by name, and which of them answers the secondary rays of which effect.

use crate::settings::removed::unknown;
use crate::settings::value::value_of_text;
use crate::settings::{Plain, Rule, Value, names};
use std::fmt;
use std::str::FromStr;

names! {
    /// How secondary rays are answered.
    Method {
        /// By tracing them.
        Exact = "exact",
        /// By occupancy maps, those that these can answer.
        Roma = "roma",
        /// By what the rates of this device and measured errors say.
        Auto = "auto",
        /// By occupancy maps where these find them free, else by tracing them.
        Sift = "sift",
        /// By distance fields, those that occupancy maps can answer: a baseline.
        #[cfg(feature = "lab")]
        Df = "df",
        /// By fields of visibility, those to the environment.
        Dvf = "dvf",
        /// By displacement fields, those that these can answer.
        Displacement = "displacement",
    }
}

/// How the secondary rays of each effect are answered. Read from a method, for the effects that it suits, or from
/// EFFECT=METHOD, with commas between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EffectMethods {
    /// Rays of ambient occlusion.
    pub ao: Method,
    /// Diffuse rays.
    pub diffuse: Method,
    /// Rays to the sun, to lights and to surfaces that emit.
    pub shadow: Method,
    /// Rays to the environment.
    pub environment: Method,
}

/// The effects that methods answer.
const EFFECTS: [&str; 4] = ["ao", "diffuse", "shadow", "environment"];

impl EffectMethods {
    /// All rays are traced.
    pub const EXACT: Self =
        Self { ao: Method::Exact, diffuse: Method::Exact, shadow: Method::Exact, environment: Method::Exact };

    /// A method for the effects that it suits: rays to the sun are among them where they are asked for alone, because
    /// the error of maps, a few cells, is wider than a shadow's edge.
    pub fn of(method: Method) -> Self {
        let all = Self::every(method);
        // `auto` keeps to an error.
        if method == Method::Auto { all } else { Self { shadow: Method::Exact, ..all } }
    }

    /// A method for all effects that it can answer.
    pub fn every(method: Method) -> Self {
        let mut all = Self::EXACT;
        for effect in EFFECTS {
            if can_answer(method, effect) {
                *all.method(effect) = method;
            }
        }
        all
    }

    /// Whether a method answers rays of some effect.
    pub fn has(self, method: Method) -> bool {
        self.list().iter().any(|&(_, chosen)| chosen == method)
    }

    /// Whether maps of what is occupied answer rays of some effect.
    pub fn has_maps(self) -> bool {
        let others = [Method::Exact, Method::Auto, Method::Dvf, Method::Displacement];
        self.list().iter().any(|(_, method)| !others.contains(method))
    }

    /// With one method in place of another where that can answer the rays.
    pub fn with(mut self, one: Method, other: Method) -> Self {
        for (effect, method) in self.list() {
            if method == one {
                *self.method(effect) = if can_answer(other, effect) { other } else { Method::Exact };
            }
        }
        self
    }

    /// Effects and their methods.
    pub fn list(self) -> [(&'static str, Method); 4] {
        let methods = [self.ao, self.diffuse, self.shadow, self.environment];
        std::array::from_fn(|i| (EFFECTS[i], methods[i]))
    }

    /// The same, but for an effect, which a method answers.
    pub fn by(mut self, effect: &str, method: Method) -> Self {
        *self.method(effect) = method;
        self
    }

    /// What answers the rays of an effect here, or of `other` where that is traced.
    pub fn over(mut self, other: Self) -> Self {
        for (effect, method) in self.list() {
            if method != Method::Exact {
                continue;
            }
            let other = other.list().into_iter().find(|(name, _)| *name == effect);
            *self.method(effect) = other.map_or(method, |(_, method)| method);
        }
        self
    }

    fn method(&mut self, effect: &str) -> &mut Method {
        match effect {
            "ao" => &mut self.ao,
            "diffuse" => &mut self.diffuse,
            "shadow" => &mut self.shadow,
            _ => &mut self.environment,
        }
    }
}

/// Whether a method can answer the rays of an effect.
fn can_answer(method: Method, effect: &str) -> bool {
    match method.name() {
        "exact" | "auto" | "displacement" => true,
        "roma" => effect != "environment",
        "dvf" => effect == "environment",
        _ => matches!(effect, "ao" | "shadow"),
    }
}

impl FromStr for EffectMethods {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut chosen = Self::EXACT;
        for (number, part) in text.split(',').map(str::trim).enumerate() {
            let Some((effect, name)) = part.split_once('=') else {
                if number > 0 {
                    return Err(format!("{part}: a method for several effects comes first; write EFFECT={part}"));
                }
                chosen = Self::of(part.parse()?);
                continue;
            };
            let (effect, name) = (effect.trim(), name.trim());
            if !EFFECTS.contains(&effect) {
                return Err(unknown(effect, &EFFECTS, &[]));
            }
            let method: Method = name.parse()?;
            if !can_answer(method, effect) {
                let known = Method::ALL.iter().filter(|&&method| can_answer(method, effect));
                let known: Vec<&str> = known.map(|method| method.name()).collect();
                return Err(format!("{name} does not answer rays of {effect}; known: {}", known.join(", ")));
            }
            *chosen.method(effect) = method;
        }
        Ok(chosen)
    }
}

impl fmt::Display for EffectMethods {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(method) = Method::ALL.iter().find(|&&method| *self == Self::of(method)) {
            return f.write_str(method.name());
        }
        let chosen = self.list().into_iter().filter(|(_, method)| *method != Method::Exact);
        f.write_str(&chosen.map(|(effect, method)| format!("{effect}={method}")).collect::<Vec<_>>().join(","))
    }
}

value_of_text!(EffectMethods; false);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_are_read_and_written_alike() {
        for text in [
            "exact",
            "roma",
            "auto",
            "df",
            "dvf",
            "displacement",
            "ao=roma",
            "shadow=df",
            "sift",
            "ao=roma,shadow=sift,environment=dvf",
        ] {
            assert_eq!(text.parse::<EffectMethods>().unwrap().to_string(), text);
        }
        let read = |text: &str| text.parse::<EffectMethods>().unwrap();
        assert_eq!(read("ao=sift").to_string(), "sift");
        assert_eq!(read("roma, ao = exact").to_string(), "diffuse=roma");
        assert_eq!(read("roma,shadow=roma"), EffectMethods::every(Method::Roma));
    }

    #[test]
    fn the_sun_is_traced_unless_its_method_is_named() {
        for &method in Method::ALL {
            let of_the_sun = if method == Method::Auto { method } else { Method::Exact };
            assert_eq!(EffectMethods::of(method).shadow, of_the_sun);
            assert!(EffectMethods::of(method).has(method), "{method} answers something");
        }
        let chosen: EffectMethods = "roma".parse().unwrap();
        assert_eq!((chosen.ao, chosen.diffuse, chosen.environment), (Method::Roma, Method::Roma, Method::Exact));
        assert_eq!("ao=roma,shadow=roma".parse::<EffectMethods>().unwrap().shadow, Method::Roma);
    }

    #[test]
    fn what_no_method_answers_is_refused() {
        for (text, says) in [
            ("glow=roma", "known: ao, diffuse, shadow, environment"),
            ("ao=dvf", "dvf does not answer rays of ao; known: exact, roma, auto, sift, df, displacement"),
            ("environment=roma", "known: exact, auto, dvf, displacement"),
            ("diffuse=sift", "known: exact, roma, auto, displacement"),
            ("ao=luck", "known: exact"),
            ("ao=roma,df", "EFFECT=df"),
        ] {
            let error = text.parse::<EffectMethods>().unwrap_err();
            assert!(error.contains(says), "{text}: {error}");
        }
    }
}
