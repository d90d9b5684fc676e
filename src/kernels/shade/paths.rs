//! How surfaces draw the directions of paths: twin of `shaders/shade/paths.wgsl`.

use super::gloss::{Drawn, Gloss};
use super::lamps::unit;
use super::random::tangent;
use crate::kernels::vector::{Vec3, cross, dot, each, most, most3, normalize};
use std::f32::consts::{PI, TAU};

impl Gloss {
    /// Probability that a path goes on by the gloss: its share of what the surface reflects and lets through of light
    /// from everywhere.
    pub fn path_choice(&self) -> f32 {
        if !self.is_glossy() {
            return 0.0;
        }
        let of_gloss = most3(self.around()) + most3(self.through);
        let of_diffuse = most3(self.diffuse);
        of_gloss / most(of_gloss + of_diffuse, 1.0e-20)
    }

    /// A direction from a surface with this normal.
    pub fn path_direction(&self, normal: Vec3, words: [u32; 4]) -> Drawn {
        if unit(words[3]) < self.path_choice() {
            return self.direction(words);
        }
        let around = TAU * unit(words[0]);
        let squared = unit(words[1]);
        let level = squared.sqrt();
        let (x, up) = (tangent(normal), (1.0 - squared).sqrt());
        let y = cross(normal, x);
        let direction = normalize(each(|k| level * around.cos() * x[k] + level * around.sin() * y[k] + up * normal[k]));
        Drawn { direction, is_through: false }
    }

    /// By which a path draws its direction d, a unit vector.
    pub fn path_density(&self, normal: Vec3, d: Vec3) -> f32 {
        let choice = self.path_choice();
        (1.0 - choice) * most(dot(normal, d), 0.0) / PI + choice * self.density(d)
    }
}
