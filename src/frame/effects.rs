//! What is traced beside camera rays.

/// Effects of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Effects {
    /// Shadows of the sun and of emitters, at primary hits and at the hits of diffuse and glossy rays.
    pub shadow: bool,
    /// The light of the environment, shadowed, at the same hits. Of an uneven one a direction is drawn by its radiance,
    /// and diffuse rays that miss share it with them. An even one is brought by diffuse and glossy rays and paths
    /// alone, where there are some ([`crate::kernels::lamps::Environment::is_even`]).
    pub environment: bool,
    /// Ambient occlusion, of the sky's light.
    pub occlusion: Option<Occlusion>,
    /// Diffuse interreflection: rays of each pixel and sample, as long as the scene. Their hits show their
    /// emission and what they reflect of the lamps; the sky's light comes from those that miss.
    pub diffuse: Option<u32>,
    /// What surfaces reflect otherwise than diffusely, by their materials, of all that is around: one ray, drawn by the
    /// gloss of the surface, at primary hits. Without it they reflect the lamps alone, and the sky's light unshadowed.
    pub glossy: bool,
    /// Bounces, 1 to 64: from the hits of diffuse and glossy rays paths go on, a ray from each hit, until so many rays
    /// have been reflected, and each hit is lit as the first is.
    pub bounces: u32,
    /// Greatest random turn of the directions of occlusion and diffuse rays about the normal, degrees from 0 to 360;
    /// each pixel has one of its own (CHC+RT §5.3). Small turns keep neighbouring rays alike. With 360 pixels do not
    /// share the heights of directions, either.
    pub turn_degrees: f32,
}

/// Ambient occlusion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Occlusion {
    /// Rays of each pixel and sample.
    pub rays: u32,
    /// Their length, world units.
    pub length: f64,
}

impl Effects {
    /// Most bounces.
    pub const MOST_BOUNCES: u32 = 64;

    /// Whether hits of rays that start at primary hits are shaded.
    pub fn has_bounces(&self) -> bool {
        self.diffuse.is_some() || self.glossy
    }

    /// Whether bodies that refract bend light: paths follow it out of them again.
    pub fn refracts(&self) -> bool {
        self.glossy && self.bounces > 1
    }
}
