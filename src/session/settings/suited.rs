//! What settings leave to the scene.

use super::Settings;
use crate::settings::{EffectList, Environment, Length};
use bricks::Manifest;
use glam::DVec3;

impl Settings {
    /// These settings with what suits the scene of `manifest` in the place of `auto`.
    pub fn suited(&self, manifest: &Manifest) -> Self {
        let mut suited = Self { secondary: self.methods(), ..self.clone() };
        if self.ao_length == Length::Auto {
            suited.ao_length = Length::World(occlusion_length(manifest));
        }
        if self.environment == Some(Environment::Auto) {
            suited.environment = (!manifest.has_own_light).then_some(Environment::Sky);
            if manifest.has_own_light {
                suited.sun_intensity.get_or_insert(0.0);
                suited.sky_intensity = 0.0;
                // Where no sky shines, what lamps do not reach is lit by what they do reach.
                suited.effects.diffuse |= self.effects == EffectList::LIT;
            }
        }
        suited
    }
}

/// How far surfaces darken each other: what tells rooms, houses and folds apart. A city's is that of its houses,
/// however large it is: they are as high as its bounds.
fn occlusion_length(manifest: &Manifest) -> f64 {
    let size = DVec3::from_array(manifest.max) - DVec3::from_array(manifest.min);
    let diagonal = size.length();
    if !(diagonal.is_finite() && diagonal > 0.0 && size.min_element() >= 0.0) {
        return 1.0;
    }
    (0.2 * size.min_element()).clamp(0.01 * diagonal, 0.1 * diagonal)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(max: [f64; 3]) -> Manifest {
        Manifest { max, ..Manifest::default() }
    }

    #[test]
    fn lengths_follow_the_size_of_what_there_is() {
        let length = |max| match Settings::default().suited(&of(max)).ao_length {
            Length::World(length) => length,
            Length::Auto => panic!("not suited"),
        };
        assert!((length([10.0, 5.0, 10.0]) - 1.0).abs() < 1e-12);
        // A larger city of the same houses; a sheet; a cube.
        assert_eq!(length([500.0, 60.0, 500.0]), length([900.0, 60.0, 700.0]));
        assert!((length([3.0, 0.0, 4.0]) - 0.05).abs() < 1e-12);
        assert!((length([1.0; 3]) - 0.1 * 3f64.sqrt()).abs() < 1e-12);
        // Without triangles, and of a single point.
        assert_eq!((length([-1.0; 3]), length([0.0; 3])), (1.0, 1.0));
        let stated = Settings { ao_length: Length::World(3.0), ..Settings::default() };
        assert_eq!(stated.suited(&of([1.0; 3])).ao_length, Length::World(3.0));
    }

    #[test]
    fn a_scene_with_its_own_light_has_no_sky() {
        let room = Manifest { has_own_light: true, ..of([4.0; 3]) };
        let lit = Settings::default().suited(&room);
        assert_eq!((lit.environment.clone(), lit.sun_intensity(), lit.sky_intensity), (None, 0.0, 0.0));
        assert!(
            lit.effects.diffuse && !Settings::from_options("--effects shadow").unwrap().suited(&room).effects.diffuse
        );
        let outside = Settings::default().suited(&of([4.0; 3]));
        assert_eq!(outside.environment, Some(Environment::Sky));
        assert!(outside.sun_intensity() > 0.0 && outside.sky_intensity > 0.0 && !outside.effects.diffuse);
        // What is asked for stays.
        for options in ["--quality exact", "--environment sky", "--sun-intensity 3"] {
            let asked = Settings::from_options(options).unwrap().suited(&room);
            assert!(asked.sun_intensity() > 0.0, "{options}");
        }
    }
}
