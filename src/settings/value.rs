//! Values of settings: each is read from the same text on the command line and in a settings file, and is printed so
//! that it can be read again.

use super::sizes::{count, size_bytes};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::PathBuf;

/// A value as files hold it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Plain {
    /// Yes or no.
    Bool(bool),
    /// A whole number.
    Whole(i64),
    /// A number.
    Real(f64),
    /// Text.
    Text(String),
    /// Several.
    List(Vec<Plain>),
    /// Nothing: a setting that is off, or that is chosen elsewhere.
    Absent,
}

/// The text that [`Value::read`] takes.
impl fmt::Display for Plain {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bool(is_on) => f.write_str(if *is_on { "on" } else { "off" }),
            Self::Whole(number) => write!(f, "{number}"),
            Self::Real(number) => f.write_str(&short(*number)),
            Self::Text(text) => f.write_str(text),
            Self::List(all) if all.is_empty() => f.write_str(NONE),
            Self::List(all) => f.write_str(&all.iter().map(Self::to_string).collect::<Vec<_>>().join(",")),
            Self::Absent => f.write_str(OFF),
        }
    }
}

/// An empty list.
const NONE: &str = "none";
/// An absent value.
const OFF: &str = "off";

/// A number with an exponent where it is very large or very small.
fn short(number: f64) -> String {
    let size = number.abs();
    if size != 0.0 && !(1e-4..1e7).contains(&size) { format!("{number:e}") } else { number.to_string() }
}

/// What a value must be beyond its type.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rule {
    /// All values of the type.
    Any,
    /// A whole number from and to.
    Whole(u64, u64),
    /// A number from and to; infinity: no bound.
    Real(f64, f64),
    /// One of these.
    OneOf(&'static [u32]),
    /// A power of two from and to.
    PowerOfTwo(u32, u32),
    /// Bytes, at least so many.
    Bytes(u64),
}

impl Rule {
    /// In words; empty where there is none.
    pub fn text(self) -> String {
        match self {
            Self::Any => String::new(),
            Self::Whole(least, most) => format!("{least} to {most}"),
            Self::Real(least, f64::INFINITY) => format!("at least {}", short(least)),
            Self::Real(least, most) => format!("{} to {}", short(least), short(most)),
            Self::OneOf(known) => format!("one of {}", known.iter().map(u32::to_string).collect::<Vec<_>>().join(", ")),
            Self::PowerOfTwo(least, most) => format!("a power of two, {least} to {most}"),
            Self::Bytes(_) => "a size: K, M, G are powers of 1024".into(),
        }
    }

    /// Whether values may begin with a minus sign.
    pub fn is_signed(self) -> bool {
        matches!(self, Self::Real(least, _) if least < 0.0)
    }
}

/// A value of a setting.
pub trait Value: Sized {
    /// Several may be given, separated by commas.
    const IS_LIST: bool = false;
    /// Values may begin with a minus sign, whatever the rule.
    const IS_SIGNED: bool = false;
    /// The names that it can have, where these are all.
    const NAMES: &'static [&'static str] = &[];
    /// Choosing it may choose other settings, see [`Value::presets`].
    const IS_PRESET: bool = false;

    /// Reads and checks a value.
    ///
    /// # Errors
    /// A sentence that says what is right; `unit` is what numbers count.
    fn read(text: &str, rule: Rule, unit: &str) -> Result<Self, String>;

    /// The value as files hold it.
    fn plain(&self) -> Plain;

    /// What choosing the value chooses besides: keys of the group, and values for them.
    fn presets(&self) -> &'static [(&'static str, &'static str)] {
        &[]
    }
}

/// [`Value`] of an enum that [`names!`](super::names::names) declares.
macro_rules! value_of_name {
    ($name:ident) => {
        impl $crate::settings::value::Value for $name {
            const NAMES: &'static [&'static str] = Self::NAMES;

            fn read(text: &str, _: $crate::settings::value::Rule, _: &str) -> Result<Self, String> {
                text.parse()
            }

            fn plain(&self) -> $crate::settings::value::Plain {
                $crate::settings::value::Plain::Text(self.name().into())
            }
        }
    };
}

pub(crate) use value_of_name;

/// [`Value`] of a type that is read by [`std::str::FromStr`] and written by [`fmt::Display`].
macro_rules! value_of_text {
    ($($name:ty),*; $is_signed:literal) => { $(
        impl Value for $name {
            const IS_SIGNED: bool = $is_signed;

            fn read(text: &str, _: Rule, _: &str) -> Result<Self, String> {
                text.parse().map_err(|error| format!("{error}"))
            }

            fn plain(&self) -> Plain {
                Plain::Text(self.to_string())
            }
        }
    )* };
}

pub(crate) use value_of_text;

impl Value for bool {
    const NAMES: &'static [&'static str] = &["on", "off"];

    fn read(text: &str, _: Rule, _: &str) -> Result<Self, String> {
        match text {
            "on" | "true" => Ok(true),
            "off" | "false" => Ok(false),
            _ => Err(super::removed::unknown(text, Self::NAMES, &[])),
        }
    }

    fn plain(&self) -> Plain {
        Plain::Bool(*self)
    }
}

impl Value for u64 {
    fn read(text: &str, rule: Rule, _: &str) -> Result<Self, String> {
        match rule {
            Rule::Bytes(0) if text == "0" => Ok(0),
            Rule::Bytes(_) => size_bytes(text),
            Rule::Whole(least, most) => {
                let number = count(text).map_err(|why| format!("{why}; it must be from {least} to {most}"))?;
                let is_right = (least..=most).contains(&number);
                if is_right { Ok(number) } else { Err(format!("it must be from {least} to {most}")) }
            }
            _ => count(text),
        }
    }

    fn plain(&self) -> Plain {
        i64::try_from(*self).map_or_else(|_| Plain::Text(self.to_string()), Plain::Whole)
    }
}

impl Value for u32 {
    fn read(text: &str, rule: Rule, unit: &str) -> Result<Self, String> {
        match rule {
            Rule::OneOf(known) => {
                let found = text.parse().ok().filter(|number| known.contains(number));
                found.ok_or_else(|| format!("it must be {}", rule.text()))
            }
            Rule::PowerOfTwo(least, most) => {
                let found = count(text).ok().and_then(|number| u32::try_from(number).ok());
                let found = found.filter(|number| (least..=most).contains(number) && number.is_power_of_two());
                found.ok_or_else(|| format!("it must be a power of two from {least} to {most} {unit}"))
            }
            Rule::Whole(..) => Ok(u64::read(text, rule, unit)? as u32),
            _ => Ok(u64::read(text, Rule::Whole(0, u32::MAX.into()), unit)? as u32),
        }
    }

    fn plain(&self) -> Plain {
        Plain::Whole((*self).into())
    }
}

impl Value for f64 {
    fn read(text: &str, rule: Rule, unit: &str) -> Result<Self, String> {
        let number: Option<f64> = text.parse().ok();
        match rule {
            Rule::Real(least, f64::INFINITY) => {
                let found = number.filter(|number| number.is_finite() && *number >= least);
                found.ok_or_else(|| format!("it must be a finite number of at least {}", short(least)))
            }
            Rule::Real(least, most) => {
                let range = format!("it must be from {} to {} {unit}", short(least), short(most));
                let found = number.filter(|number| (least..=most).contains(number));
                found.ok_or_else(|| range.trim_end().into())
            }
            _ => number.filter(|number| number.is_finite()).ok_or_else(|| "it must be a finite number".into()),
        }
    }

    fn plain(&self) -> Plain {
        Plain::Real(*self)
    }
}

impl Value for f32 {
    fn read(text: &str, rule: Rule, unit: &str) -> Result<Self, String> {
        f64::read(text, rule, unit)?;
        text.parse().map_err(|_| "it must be a number".into())
    }

    fn plain(&self) -> Plain {
        // By way of its text, which has no more digits than it needs.
        Plain::Real(self.to_string().parse().unwrap_or((*self).into()))
    }
}

impl Value for PathBuf {
    fn read(text: &str, _: Rule, _: &str) -> Result<Self, String> {
        if text.is_empty() { Err("a file needs a name".into()) } else { Ok(text.into()) }
    }

    fn plain(&self) -> Plain {
        Plain::Text(self.to_string_lossy().into_owned())
    }
}

impl Value for String {
    fn read(text: &str, _: Rule, _: &str) -> Result<Self, String> {
        Ok(text.into())
    }

    fn plain(&self) -> Plain {
        Plain::Text(self.clone())
    }
}

/// `off` and `none` are `None`.
impl<T: Value> Value for Option<T> {
    const IS_SIGNED: bool = T::IS_SIGNED;
    const NAMES: &'static [&'static str] = T::NAMES;

    fn read(text: &str, rule: Rule, unit: &str) -> Result<Self, String> {
        if [OFF, NONE].contains(&text) { Ok(None) } else { T::read(text, rule, unit).map(Some) }
    }

    fn plain(&self) -> Plain {
        self.as_ref().map_or(Plain::Absent, T::plain)
    }
}

/// `none` is the empty list, except where it is a name.
impl<T: Value> Value for Vec<T> {
    const IS_LIST: bool = true;
    const NAMES: &'static [&'static str] = T::NAMES;

    fn read(text: &str, rule: Rule, unit: &str) -> Result<Self, String> {
        if text == NONE && !T::NAMES.contains(&NONE) {
            return Ok(Vec::new());
        }
        text.split([',', LINE]).map(|part| T::read(part.trim(), rule, unit)).collect()
    }

    fn plain(&self) -> Plain {
        Plain::List(self.iter().map(T::plain).collect())
    }
}

/// What stands between values that are given one by one.
pub const LINE: char = '\n';

/// Values that are given one by one and may have commas in them.
#[derive(Clone, Debug, PartialEq)]
pub struct Lines<T>(pub Vec<T>);

impl<T> Default for Lines<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T: Value> Value for Lines<T> {
    const IS_LIST: bool = true;

    fn read(text: &str, rule: Rule, unit: &str) -> Result<Self, String> {
        text.split(LINE).map(|line| T::read(line, rule, unit)).collect::<Result<_, _>>().map(Self)
    }

    fn plain(&self) -> Plain {
        self.0.plain()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn again<T: Value + PartialEq + std::fmt::Debug>(value: T, rule: Rule) {
        assert_eq!(T::read(&value.plain().to_string(), rule, ""), Ok(value));
    }

    #[test]
    fn what_is_printed_is_read_again() {
        again(true, Rule::Any);
        again(u64::MAX, Rule::Any);
        again(1u64 << 30, Rule::Bytes(1));
        again(0.1f32, Rule::Real(0.0, 360.0));
        again(1e-6f64, Rule::Real(0.0, f64::INFINITY));
        again(std::f64::consts::PI, Rule::Any);
        again(None::<u32>, Rule::Whole(1, 2));
        again(Some(2u32), Rule::Whole(1, 2));
        again(vec![1u32, 2], Rule::Any);
        again(Vec::<u32>::new(), Rule::Any);
        assert_eq!(0.1f32.plain(), Plain::Real(0.1));
    }

    #[test]
    fn rules_say_what_is_right() {
        let wrong = |text: &str, rule: Rule| u32::read(text, rule, "pixels").unwrap_err();
        assert_eq!(wrong("48", Rule::PowerOfTwo(8, 512)), "it must be a power of two from 8 to 512 pixels");
        assert_eq!(wrong("5", Rule::OneOf(&[4, 8])), "it must be one of 4, 8");
        assert_eq!(wrong("9", Rule::Whole(1, 8)), "it must be from 1 to 8");
        let wrong = |text: &str, rule: Rule| f64::read(text, rule, "degrees").unwrap_err();
        assert_eq!(wrong("91", Rule::Real(0.0, 90.0)), "it must be from 0 to 90 degrees");
        assert_eq!(wrong("x", Rule::Real(0.0, 90.0)), "it must be from 0 to 90 degrees");
        assert_eq!(wrong("nan", Rule::Real(0.0, f64::INFINITY)), "it must be a finite number of at least 0");
        assert_eq!(wrong("nan", Rule::Real(1e-6, 1e9)), "it must be from 1e-6 to 1e9 degrees");
        assert!(bool::read("yes", Rule::Any, "").unwrap_err().ends_with("known: on, off"));
    }
}
