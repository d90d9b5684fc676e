//! The kinds of stiff scenes: their names, sizes and what they need.

use std::fmt;

/// Kinds of stiff scenes. `n` is the size that [`super::stiff`] is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stiff {
    /// A closed bumpy sphere around the origin, radius 0.8 to 1.2: an icosahedron divided `n` times, 20 · 4ⁿ triangles.
    Shell,
    /// A closed double cone around the origin, radius 1, height 2: two fans of `n` triangles.
    Fans,
    /// A closed cube around the origin, side 2, its faces `n` x `n` squares of two triangles; coordinates are multiples
    /// of 1/n.
    Cube,
    /// `n` triangles a hundred million times longer than wide, in all directions within a cube of side 2; they need a
    /// lattice of 2⁻³⁰ or finer.
    Slivers,
    /// Four times the same sheet of `n` x `n` squares, triangle by triangle, in a plane that no axis lies in.
    Sheets,
    /// `n` triangles at one corner, each 0.985 times as large as the one before, from 1000 down.
    Series,
    /// `n` triangles, the k-th of size k, whose boxes all have the origin as their centre.
    EqualCentroids,
    /// One triangle `n` times.
    Duplicates,
    /// Thirty-two triangles of size 200 through a cube of side 20 that holds `n` of size 0.3.
    Spanning,
    /// `n` axis-aligned boxes of 12 triangles, two thirds of them flat on one axis, on multiples of 1/64 within a cube
    /// of side 8.
    FlatBoxes,
    /// Closed bumpy spheres around the origin, one in the other, of sizes from 10⁻⁴ to 10⁶, a decade each; icosahedra
    /// divided `n` times. They need a lattice of 2⁻¹⁹, the finest that there is for them.
    ScaleMix,
    /// One triangle.
    Triangle,
    /// Nothing.
    Empty,
    /// [`Self::Shell`] on multiples of 2⁻¹⁴, 10⁷ from the origin along x.
    FarOrigin,
}

impl Stiff {
    /// Every kind.
    pub const ALL: [Self; 14] = [
        Self::FarOrigin,
        Self::ScaleMix,
        Self::Slivers,
        Self::Sheets,
        Self::Series,
        Self::EqualCentroids,
        Self::Duplicates,
        Self::Spanning,
        Self::FlatBoxes,
        Self::Fans,
        Self::Cube,
        Self::Shell,
        Self::Triangle,
        Self::Empty,
    ];

    /// Most triangles of a scene that is made on request: it is held in memory.
    pub const MOST_TRIANGLES: u64 = 10_000_000;

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        self.facts().0
    }

    /// What it is, in one line.
    pub fn about(self) -> &'static str {
        self.facts().1
    }

    /// Triangles where nothing else is asked for.
    pub fn default_triangles(self) -> u64 {
        self.facts().2
    }

    fn facts(self) -> (&'static str, &'static str, u64) {
        match self {
            Self::FarOrigin => ("far-origin", "a closed bumpy sphere of radius 1, 10^7 m from the origin", 5120),
            Self::ScaleMix => ("scale-mix", "closed spheres in each other, of sizes from 10^-4 to 10^6 m", 880),
            Self::Slivers => {
                ("slivers", "triangles a hundred million times longer than wide, too thin to be seen", 4000)
            }
            Self::Sheets => ("sheets", "four sheets in one place, triangle by triangle", 1152),
            Self::Series => ("series", "a geometric series of triangles at one corner: very deep trees", 1000),
            Self::EqualCentroids => ("equal-centroids", "triangles whose boxes all have one centre", 1000),
            Self::Duplicates => ("duplicates", "the same triangle again and again", 1_000_000),
            Self::Spanning => ("spanning", "huge triangles through every brick of small ones", 4032),
            Self::FlatBoxes => ("flat-boxes", "axis-aligned boxes, most of them flat", 2000),
            Self::Fans => ("fans", "two closed fans whose triangles meet at two points", 2000),
            Self::Cube => ("cube", "a closed cube of squares along the axes", 3072),
            Self::Shell => ("shell", "a closed bumpy sphere of radius 1 around the origin", 5120),
            Self::Triangle => ("triangle", "one triangle", 1),
            Self::Empty => ("empty", "nothing", 0),
        }
    }

    /// The size `n` of a scene with at most so many triangles, or of the least that there is.
    pub fn size_of(self, triangles: u64) -> u32 {
        let divisions = |least: u64| (0..12).rev().find(|n| least << (2 * n) <= triangles).unwrap_or(0);
        let side = |of_square: u64| (triangles / of_square).isqrt().max(1) as u32;
        let count = |n: u64, least: u64| u32::try_from(n.max(least)).unwrap_or(u32::MAX);
        match self {
            Self::Shell | Self::FarOrigin => divisions(20),
            Self::ScaleMix => divisions(11 * 20),
            Self::Fans => count(triangles / 2, 3),
            Self::Cube => side(12),
            Self::Sheets => side(8),
            Self::Slivers | Self::Series | Self::EqualCentroids | Self::Duplicates => count(triangles, 1),
            Self::Spanning => count(triangles.saturating_sub(32), 1),
            // Of three boxes one is whole, two are flat: 12 + 4 + 4 triangles.
            Self::FlatBoxes => count(3 * (triangles / 20), 1),
            Self::Triangle | Self::Empty => 1,
        }
    }

    /// Triangles of a brick that bring out what the scene is about: few, so that much is cut, or, with `None`, as many
    /// as usual.
    pub fn brick_triangles(self) -> Option<u32> {
        match self {
            Self::Duplicates | Self::Series => None,
            _ => Some(64),
        }
    }

    /// What [`super::stiff`] was given for the scene whose source is called `name`, as in "stiff slivers seed=0
    /// n=4000". `None` if no stiff scene is called so.
    pub fn of_source(name: &str) -> Option<(Self, u32, u64)> {
        let (kind, rest) = name.strip_prefix("stiff ")?.split_once(" seed=")?;
        let (seed, n) = rest.split_once(" n=")?;
        Some((kind.parse().ok()?, n.parse().ok()?, seed.parse().ok()?))
    }

    /// Binary logarithm of the lattice's step that the scene needs, if the one that follows from its bricks is too
    /// coarse.
    pub fn lattice_log2(self) -> Option<i32> {
        match self {
            Self::FarOrigin => Some(-14),
            Self::ScaleMix => Some(-19),
            Self::Slivers => Some(-32),
            _ => None,
        }
    }
}

impl fmt::Display for Stiff {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(self.name())
    }
}
