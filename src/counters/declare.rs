//! The macro that makes of the table of counters all that follows from it.

/// Declares the counters, a row each:
///
/// ```text
/// /// Meaning.
/// name: type ["unit"] kind;                     the host counts it
/// name: type ["unit"] kind from COUNTER_NAME;   kernels do, in this word
/// name: type ["unit"] = |c| ...;                follows from others
/// ```
///
/// `, only "..."` says in which records it is not zero; `[unwritten]` keeps it out of records. Kinds: see
/// [`Kind`](super::Kind).
macro_rules! counters {
    // Fields and columns are collected row by row; then the items are written.
    (@read [$($fields:tt)*] [$($columns:tt)*]) => {
        counters! { @write [$($fields)*] [$($columns)*] }
    };
    (@read [$($fields:tt)*] [$($columns:tt)*]
        $(#[doc = $doc:literal])+ $name:ident: $type:ident [$unit:literal] = $value:expr
        $(, only $only:literal)?; $($rest:tt)*) => {
        counters! { @read [$($fields)*]
            [$($columns)* { [$($doc)+] $name $type $unit derived host [$($only)?] [] [$value] }] $($rest)* }
    };
    (@read [$($fields:tt)*] [$($columns:tt)*]
        $(#[doc = $doc:literal])+ $name:ident: $type:ident [$unit:literal] $kind:ident from $word:ident
        $(, only $only:literal)? $([$unwritten:ident])?; $($rest:tt)*) => {
        counters! { @read [$($fields)* { [$($doc)+] $name $type $kind [$word] }]
            [$($columns)* { [$($doc)+] $name $type $unit $kind device [$($only)?] [$($unwritten)?] [] }] $($rest)* }
    };
    (@read [$($fields:tt)*] [$($columns:tt)*]
        $(#[doc = $doc:literal])+ $name:ident: $type:ident [$unit:literal] $kind:ident
        $(, only $only:literal)? $([$unwritten:ident])?; $($rest:tt)*) => {
        counters! { @read [$($fields)* { [$($doc)+] $name $type $kind [] }]
            [$($columns)* { [$($doc)+] $name $type $unit $kind host [$($only)?] [$($unwritten)?] [] }] $($rest)* }
    };
    (@write [$({ [$($doc:literal)+] $name:ident $type:ident $kind:ident [$($word:ident)?] })*]
        [$({ [$($text:literal)+] $column:ident $of:ident $unit:literal $sum:ident $source:ident
            [$($only:literal)?] [$($unwritten:ident)?] [$($value:expr)?] })*]) => {
        /// What was counted: in a round trip, in a pass, in all passes of an effect over a frame. Generated from the
        /// table, as is all that is done with every counter.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Counters {
            $($(#[doc = $doc])+ pub $name: $type,)*
        }

        impl Counters {
            $(counters! { @method $column $of [$($text)+] $($value)? })*

            /// Adds those of more work, such as a report's, each as its kind says.
            pub fn add(&mut self, other: impl AsRef<Self>) {
                let other = other.as_ref();
                $(counters! { @add $kind self.$name, other.$name })*
            }

            /// Does something with every set of bricks.
            pub(super) fn each_set(&mut self, work: impl Fn(&mut Bricks)) {
                $(counters! { @each $kind work, self.$name })*
            }

            /// The sets of bricks that records have, by name.
            pub(super) fn sets(&self) -> Vec<(&'static str, &Bricks)> {
                [$(counters! { @set self $column $sum [$($unwritten)?] }),*].into_iter().flatten().collect()
            }

            /// The names and values of what kernels count.
            #[cfg(test)]
            pub(crate) fn counted_by_device(&self) -> Vec<(&'static str, u64)> {
                vec![$($((counters!(@named $name $word), self.$name),)?)*]
            }

            /// Writes them in the order of the table.
            pub(super) fn write<M: SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
                $(counters! { @entry self map $column $sum [$($unwritten)?] })*
                Ok(())
            }

            /// Those of a record, as [`Counters::write`] wrote it; `None` where a value is of another type. Of sets it
            /// is known how many are in them.
            pub(super) fn read(record: &Map<String, Value>) -> Option<Self> {
                let mut counters = Self::default();
                $(if let Some(value) = record.get(stringify!($name)) {
                    counters.$name = counters! { @read_one $type value }?;
                })*
                Some(counters)
            }
        }

        /// The fields of records, in their order, behind `frame` and `pass`.
        pub const COLUMNS: &[Column] = &[
            $(Column {
                name: stringify!($column),
                unit: $unit,
                is_float: counters!(@float $of),
                kind: counters!(@kind $sum),
                source: counters!(@source $source),
                only: concat!($($only)?),
                meaning: concat!($($text),+),
                is_written: counters!(@written $($unwritten)?),
            },)*
        ];

        /// Which word of the device each counter is that kernels count, where `layout` names the words.
        macro_rules! device_words {
            () => {
                &[$($((layout::$word, |counters| &mut counters.$name),)?)*]
            };
        }
        pub(crate) use device_words;
    };
    (@method $name:ident $of:ident [$($doc:literal)+] $value:expr) => {
        $(#[doc = $doc])+
        pub fn $name(&self) -> $of {
            let value: fn(&Self) -> $of = $value;
            value(self)
        }
    };
    (@method $name:ident $of:ident [$($doc:literal)+]) => {};
    (@add sum $to:expr, $from:expr) => { $to += $from; };
    (@add max $to:expr, $from:expr) => { $to = $to.max($from); };
    (@add state $to:expr, $from:expr) => { let _ = $from; };
    (@add distinct $to:expr, $from:expr) => { $to.add(&$from); };
    (@add names $to:expr, $from:expr) => { $to.add(&$from); };
    (@each distinct $work:ident, $set:expr) => { $work(&mut $set); };
    (@each $kind:ident $work:ident, $set:expr) => {};
    (@set $self:ident $name:ident distinct []) => { Some((stringify!($name), &$self.$name)) };
    (@set $self:ident $name:ident $sum:ident [$($unwritten:ident)?]) => { None };
    (@entry $self:ident $map:ident $name:ident $sum:ident [unwritten]) => {};
    (@entry $self:ident $map:ident $name:ident derived []) => {
        $map.serialize_entry(stringify!($name), &$self.$name())?;
    };
    (@entry $self:ident $map:ident $name:ident distinct []) => {
        $map.serialize_entry(stringify!($name), &$self.$name.count())?;
    };
    (@entry $self:ident $map:ident $name:ident names []) => {
        $map.serialize_entry(stringify!($name), &$self.$name.to_string())?;
    };
    (@entry $self:ident $map:ident $name:ident $sum:ident []) => {
        $map.serialize_entry(stringify!($name), &$self.$name)?;
    };
    (@read_one u64 $value:ident) => { $value.as_u64() };
    // What is no number is written as null.
    (@read_one f64 $value:ident) => { if $value.is_null() { Some(f64::NAN) } else { $value.as_f64() } };
    (@read_one Bricks $value:ident) => { Bricks::of_value($value) };
    (@read_one Names $value:ident) => { $value.as_str().map(Names::of_text) };
    (@named $name:ident $word:ident) => { stringify!($name) };
    (@float f64) => { true };
    (@float $other:ident) => { false };
    (@kind sum) => { Kind::Sum };
    (@kind max) => { Kind::Max };
    (@kind state) => { Kind::State };
    (@kind distinct) => { Kind::Distinct };
    (@kind names) => { Kind::Names };
    (@kind derived) => { Kind::Derived };
    (@source host) => { Source::Host };
    (@source device) => { Source::Device };
    (@written) => { true };
    (@written unwritten) => { false };
    ($(#[doc = $doc:literal])+ $name:ident $($rest:tt)+) => {
        counters! { @read [] [] $(#[doc = $doc])+ $name $($rest)+ }
    };
}

pub(super) use counters;
