//! Closed sets of names.

/// Declares an enum of named values: their names, reading, printing, and [`Value`](crate::settings::Value). Names after
/// `later` are refused as not being in this version. `#[cfg(..)]` after its description leaves a value out of a build.
macro_rules! names {
    ($(#[$doc:meta])* $name:ident {
        $($(#[doc = $vdoc:literal])* $(#[cfg($on:meta)])? $variant:ident = $text:literal,)*
    } $(later $later:expr)?) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub enum $name { $($(#[doc = $vdoc])* $(#[cfg($on)])? $variant,)* }

        impl $name {
            /// All of them, in their order.
            pub const ALL: &[Self] = &[$($(#[cfg($on)])? Self::$variant,)*];
            /// Their names, in the same order.
            pub const NAMES: &[&str] = &[$($(#[cfg($on)])? $text,)*];

            /// The value's name.
            pub fn name(self) -> &'static str {
                match self { $($(#[cfg($on)])? Self::$variant => $text,)* }
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.name())
            }
        }

        impl std::str::FromStr for $name {
            type Err = String;

            fn from_str(text: &str) -> Result<Self, String> {
                let later: &[&[&str]] = &[$($later)?];
                let found = Self::ALL.iter().copied().find(|value| value.name() == text);
                found.ok_or_else(|| $crate::settings::removed::unknown(text, Self::NAMES, &later.concat()))
            }
        }

        $crate::settings::value::value_of_name!($name);
    };
}

pub(crate) use names;
