//! Passes: which rays a step works on.

/// What shadow rays lead to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Lamp {
    /// A point of the sun's disc.
    Sun,
    /// A point of one of the emitters: area lights, emissive triangles, points, spots, distant lights.
    Emitter,
    /// A direction of the environment.
    Environment,
}

/// The rays that a step works on. One pass has one ray a pixel at most.
///
/// Rays lie in *sets*: set 0 are camera rays, set 1 what starts at their hits, set 2 what starts at the hits of set 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Pass {
    /// Camera rays, or rays given from outside: closest hit.
    Primary,
    /// Rays from primary hits to a lamp, or rays given from outside: any hit.
    Shadow(Lamp),
    /// Rays of limited length from primary hits, in the direction of this number around the normal: any hit.
    Occlusion(u32),
    /// Rays from primary hits in the direction of this number around the normal: closest hit.
    Diffuse(u32),
    /// Rays from primary hits in a direction drawn by their gloss: closest hit.
    Glossy,
    /// Rays by which paths go on from the hits of set 1, the ray of this number of each, from 2: closest hit.
    Path(u32),
    /// Rays from the hits of set 1 to a lamp: any hit.
    BounceShadow(Lamp),
    /// The same where paths go on from these hits.
    PathShadow(Lamp),
}

impl Pass {
    /// Number of the set that the rays lie in.
    pub fn set(self) -> usize {
        match self {
            Pass::Primary => 0,
            Pass::Shadow(_) | Pass::Occlusion(_) | Pass::Diffuse(_) | Pass::Glossy | Pass::Path(_) => 1,
            Pass::BounceShadow(_) | Pass::PathShadow(_) => 2,
        }
    }

    /// Whether its rays start a chain: paths that came together before it have their places no more.
    pub fn begins(self) -> bool {
        self.set() < 2 && !matches!(self, Pass::Path(_))
    }

    /// The lamp that its rays lead to.
    pub fn lamp(self) -> Option<Lamp> {
        match self {
            Pass::Shadow(lamp) | Pass::BounceShadow(lamp) | Pass::PathShadow(lamp) => Some(lamp),
            _ => None,
        }
    }

    /// Whether any hit ends a ray.
    pub fn is_any_hit(self) -> bool {
        matches!(self, Pass::Shadow(_) | Pass::Occlusion(_) | Pass::BounceShadow(_) | Pass::PathShadow(_))
    }

    /// The pass whose visibility from the frame before stands for this one's: each direction has one of its own, shadow
    /// rays share one (CHC+RT §5.4), but for those to the environment, which go everywhere.
    pub fn visibility_state(self) -> Pass {
        match self {
            own if own.lamp() == Some(Lamp::Environment) => self,
            Pass::Shadow(_) => Pass::Shadow(Lamp::Sun),
            Pass::BounceShadow(_) => Pass::BounceShadow(Lamp::Sun),
            Pass::PathShadow(_) => Pass::PathShadow(Lamp::Sun),
            own => own,
        }
    }
}
