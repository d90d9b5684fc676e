//! What is streamed and where it lies: items, slots, policies.

use std::fmt;
use std::str::FromStr;

/// The kind of a streamed payload of a brick.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Kind {
    /// What traversal reads: nodes, vertices, ids, indices.
    Geometry,
    /// What shading of hits reads: normals, texture coordinates, colours, materials.
    Attributes,
}

/// One streamed payload: the unit that is loaded, placed and evicted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Item {
    /// The brick.
    pub brick: u32,
    /// Which of its payloads.
    pub kind: Kind,
}

impl Item {
    /// The geometry of `brick`.
    pub const fn geometry(brick: u32) -> Self {
        Self { brick, kind: Kind::Geometry }
    }

    /// The attributes of `brick`.
    pub const fn attributes(brick: u32) -> Self {
        Self { brick, kind: Kind::Attributes }
    }

    /// Position in a table with two rows a brick, geometry first.
    pub const fn index(self) -> usize {
        self.brick as usize * 2 + self.kind as usize
    }

    /// The inverse of [`Self::index`]; `None` when no brick number is that large.
    pub fn from_index(index: usize) -> Option<Self> {
        let brick = u32::try_from(index / 2).ok()?;
        Some(if index.is_multiple_of(2) { Self::geometry(brick) } else { Self::attributes(brick) })
    }

    /// The short form used in request traces: `g17` or `a17`.
    pub fn code(self) -> String {
        match self.kind {
            Kind::Geometry => format!("g{}", self.brick),
            Kind::Attributes => format!("a{}", self.brick),
        }
    }
}

impl fmt::Display for Item {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = match self.kind {
            Kind::Geometry => "geometry",
            Kind::Attributes => "attributes",
        };
        write!(f, "brick {} {kind}", self.brick)
    }
}

/// A string is not the short form of an [`Item`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0:?} is not an item: expected g or a and a brick number, such as g17")]
pub struct ParseItemError(pub String);

impl FromStr for Item {
    type Err = ParseItemError;

    /// Reads the short form written by [`Item::code`].
    fn from_str(text: &str) -> Result<Self, ParseItemError> {
        let error = || ParseItemError(text.to_owned());
        let make = match text.as_bytes().first() {
            Some(b'g') => Self::geometry,
            Some(b'a') => Self::attributes,
            _ => return Err(error()),
        };
        let digits = &text[1..];
        if digits.is_empty() || !digits.bytes().all(|b| b.is_ascii_digit()) {
            return Err(error());
        }
        digits.parse().map(make).map_err(|_| error())
    }
}

/// Where an item lies in the device cache.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Slot {
    /// The page, an index into [`super::Residency::page_sizes`].
    pub page: u32,
    /// Bytes from the start of the page, a multiple of 16.
    pub offset: u32,
}

/// What is overwritten when the cache is full.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Policy {
    /// Write at the next position, wrap, evict what is overlapped (the paper's cache).
    #[default]
    RoundRobin,
    /// Round robin that passes over once what was used, and stays in place where a cycle of requests does not fit.
    SecondChance,
    /// Evict what was not used for longest.
    Lru,
}

impl Policy {
    /// Every policy, in the order of the command line's help.
    pub const ALL: [Self; 3] = [Self::RoundRobin, Self::SecondChance, Self::Lru];

    /// The name used on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::RoundRobin => "round-robin",
            Self::SecondChance => "second-chance",
            Self::Lru => "lru",
        }
    }
}

impl fmt::Display for Policy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Policy {
    type Err = String;

    /// Reads a [`Self::name`]; the error is one line for the user.
    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL
            .into_iter()
            .find(|policy| policy.name() == text)
            .ok_or_else(|| format!("{text:?} is not a policy: expected round-robin, second-chance or lru"))
    }
}
