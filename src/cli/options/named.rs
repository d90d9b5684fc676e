//! Option values with names.

use super::removed::removed;

/// Declares an enum of named values some of which this version only knows by name.
macro_rules! named_values {
    ($(#[$doc:meta])* $name:ident { $($(#[$vdoc:meta])* $variant:ident = $text:literal,)* } later $later:expr) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name { $($(#[$vdoc])* $variant,)* }

        impl $name {
            const NAMES: &[&str] = &[$($text),*];

            /// The value's name on the command line.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $text,)* }
            }
        }

        impl std::str::FromStr for $name {
            type Err = String;

            fn from_str(text: &str) -> Result<Self, String> {
                match text {
                    $($text => Ok(Self::$variant),)*
                    other => Err($crate::cli::options::named::unknown(other, Self::NAMES, $later)),
                }
            }
        }
    };
}

/// Why a value is refused that is none of `known`; those of `later` are announced, of removed ones it says what stands
/// in their place.
pub(crate) fn unknown(text: &str, known: &[&str], later: &[&str]) -> String {
    if let Some(message) = removed(text) {
        return message;
    }
    let known = known.join(", ");
    if later.contains(&text) {
        format!("{text} is not in this version; it has: {known}")
    } else {
        format!("there is no '{text}'; known: {known}")
    }
}

pub(crate) use named_values;
