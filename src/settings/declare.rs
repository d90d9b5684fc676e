//! How groups of settings are declared: once, as a table of which the structure, its defaults and everything that
//! reads or shows it are made.

/// Declares a group of settings:
///
/// ```text
/// settings! {
///     /// What the group is.
///     pub struct Options {
///         /// What the setting does.
///         rays: u32 = 20, "--ao-rays N", Rule::Whole(1, 1024), "rays", Effects, Usual;
///     }
///     tables {
///         /// Settings of their own, in a table `[roma]` of a settings file.
///         roma: roma::Options,
///     }
/// }
/// ```
///
/// `#[cfg(..)]` after its description leaves a setting or a table out of a build. A setting has a type, which is a
/// [`Value`](super::Value), a default, its form on the command line, a rule, a unit, a heading and a level. The
/// structure, its default, [`Group`] and serde's traits follow.
macro_rules! settings {
    (
        $(#[doc = $doc:literal])*
        pub struct $name:ident {
            $(
                $(#[doc = $help:literal])+
                $(#[cfg($on:meta)])?
                $field:ident: $type:ty = $default:expr, $usage:literal, $rule:expr, $unit:literal,
                    $heading:ident, $level:ident;
            )*
        }
        $(tables { $($(#[doc = $about:literal])+ $(#[cfg($with:meta)])? $table:ident: $group:ty,)* })?
    ) => {
        $(#[doc = $doc])*
        #[derive(Clone, Debug, PartialEq)]
        pub struct $name {
            $($(#[doc = $help])+ $(#[cfg($on)])? pub $field: $type,)*
            $($($(#[doc = $about])+ $(#[cfg($with)])? pub $table: $group,)*)?
        }

        impl Default for $name {
            fn default() -> Self {
                Self {
                    $($(#[cfg($on)])? $field: $default,)*
                    $($($(#[cfg($with)])? $table: Default::default(),)*)?
                }
            }
        }

        impl $name {
            /// The settings, tables apart.
            pub const FIELDS: &[$crate::settings::Field] = &[$(
                $(#[cfg($on)])?
                $crate::settings::Field {
                    key: stringify!($field),
                    usage: $usage,
                    doc: &[$($help),+],
                    unit: $unit,
                    rule: $rule,
                    names: <$type as $crate::settings::Value>::NAMES,
                    is_list: <$type as $crate::settings::Value>::IS_LIST,
                    is_signed: <$type as $crate::settings::Value>::IS_SIGNED,
                    is_preset: <$type as $crate::settings::Value>::IS_PRESET,
                    heading: $crate::settings::Heading::$heading,
                    level: $crate::settings::Level::$level,
                    default: || {
                        let default: $type = $default;
                        $crate::settings::Value::plain(&default)
                    },
                },
            )*];
        }

        impl $crate::settings::Group for $name {
            fn entries() -> Vec<$crate::settings::Entry> {
                let own = Self::FIELDS.iter().map(|field| $crate::settings::Entry { table: "", field });
                #[allow(unused_mut)]
                let mut all: Vec<_> = own.collect();
                $($(
                    $(#[cfg($with)])?
                    for entry in <$group as $crate::settings::Group>::entries() {
                        all.push($crate::settings::Entry { table: stringify!($table), ..entry });
                    }
                )*)?
                all
            }

            fn get(&self, key: &str) -> Option<$crate::settings::Plain> {
                match key.split_once('.') {
                    $($($(#[cfg($with)])? Some((stringify!($table), key)) => {
                        $crate::settings::Group::get(&self.$table, key)
                    })*)?
                    Some(_) => None,
                    None => match key {
                        $($(#[cfg($on)])? stringify!($field) => Some($crate::settings::Value::plain(&self.$field)),)*
                        _ => None,
                    },
                }
            }

            fn set(&mut self, key: &str, text: &str) -> Result<(), $crate::settings::SettingsError> {
                match key.split_once('.') {
                    $($($(#[cfg($with)])? Some((table @ stringify!($table), inner)) => {
                        let set = $crate::settings::Group::set(&mut self.$table, inner, text);
                        return set.map_err(|error| error.within(table));
                    })*)?
                    Some(_) => {}
                    None => match key {
                        $($(#[cfg($on)])? stringify!($field) => {
                            let value = $crate::settings::Value::read(text, $rule, $unit);
                            self.$field = value.map_err(|why| $crate::settings::SettingsError::wrong(key, why))?;
                            let presets = $crate::settings::Value::presets(&self.$field).iter();
                            return presets
                                .copied()
                                .try_for_each(|(key, text)| $crate::settings::Group::set(self, key, text));
                        })*
                        _ => {}
                    },
                }
                Err($crate::settings::SettingsError::unknown::<Self>(key))
            }
        }

        impl serde::Serialize for $name {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                $crate::settings::file::serialize(self, serializer)
            }
        }

        impl<'de> serde::Deserialize<'de> for $name {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                $crate::settings::file::deserialize(deserializer)
            }
        }
    };
}

pub(crate) use settings;
