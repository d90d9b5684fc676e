//! Materials of OBJ (Wavefront, "MTL material format"; the factors of "PBR extension to MTL" by Exocortex).
//!
//! Without `Ks`, or with `illum` 0 or 1, a material is Lambertian. With it, `Ks` is what is reflected along the normal
//! and `Ns`, the exponent of Phong's lobe, gives the roughness: α = √(2 / (Ns + 2)) (Walter et al. 2007, section 5.2),
//! of which glTF's roughness is the root. Beside `Pr` or `Pm` exporters write another `Ks`: then the reflectance is
//! that of the index of refraction `Ni`, or 0.04.

use crate::import::plain;
use crate::import::text::{Lines, number};
use bricks::{MATERIAL_BLEND, Material, WRAP_CLAMP, WRAP_REPEAT};
use std::io;

/// What a dielectric of unknown index reflects along the normal.
const DIELECTRIC: f64 = 0.04;

/// Path as written, and `bricks::WRAP_*` of s in the low half, of t in the high half.
pub(super) type Map = (String, u32);

/// A material and its pictures.
#[derive(Clone, Debug)]
pub(super) struct Definition {
    pub name: String,
    pub material: Material,
    /// Of the colour.
    pub color: Option<Map>,
    /// Of the emission.
    pub emission: Option<Map>,
    /// Normals in tangent space.
    pub normals: Option<Map>,
    /// Grey.
    pub roughness: Option<Map>,
    /// Grey.
    pub metallic: Option<Map>,
    /// What cannot be read, each once.
    pub warnings: Vec<&'static str>,
    specular: Option<[f32; 3]>,
    exponent: Option<f64>,
    index: Option<f64>,
    illumination: Option<f64>,
    alpha: Option<Map>,
    has_emission: bool,
    has_roughness: bool,
    has_metallic: bool,
}

impl Definition {
    fn new(name: String) -> Self {
        Self {
            name,
            material: plain::material(),
            color: None,
            emission: None,
            normals: None,
            roughness: None,
            metallic: None,
            warnings: Vec::new(),
            specular: None,
            exponent: None,
            index: None,
            illumination: None,
            alpha: None,
            has_emission: false,
            has_roughness: false,
            has_metallic: false,
        }
    }

    /// Its pictures.
    pub fn maps(&mut self) -> impl Iterator<Item = &mut Map> {
        let Self { color, emission, normals, roughness, metallic, .. } = self;
        [color, emission, normals, roughness, metallic].into_iter().flatten()
    }

    fn warn(&mut self, what: &'static str) {
        if !self.warnings.contains(&what) {
            self.warnings.push(what);
        }
    }

    /// A line of the file. Numbers that are none leave a factor as it was.
    fn read(&mut self, keyword: &str, rest: &str) {
        let material = &mut self.material;
        let values = || rest.split_ascii_whitespace().map_while(|word| number(word.as_bytes()).ok());
        let first = values().next().filter(|value| !value.is_nan());
        let unit = |value: f64| value.clamp(0.0, 1.0) as f32;
        match keyword {
            "Kd" => {
                if let Some(color) = color(values(), 1.0) {
                    material.base_color[..3].copy_from_slice(&color);
                }
            }
            "Ke" => {
                if let Some(emission) = color(values(), f64::from(f32::MAX)) {
                    (material.emission, self.has_emission) = (emission, true);
                }
            }
            "Ks" => self.specular = color(values(), 1.0).or(self.specular),
            "Ns" => self.exponent = first.or(self.exponent),
            "Ni" => self.index = first.or(self.index),
            "illum" => self.illumination = first.or(self.illumination),
            "d" => set_opacity(material, first),
            "Tr" => set_opacity(material, first.map(|transparency| 1.0 - transparency)),
            // Exporters write white and black of opaque materials too.
            "Tf" if values().zip(values().skip(1)).any(|(a, b)| a != b) => {
                self.warn("Tf (transmission filter) ignored");
            }
            "Pr" => (material.roughness, self.has_roughness) = (first.map_or(material.roughness, unit), true),
            "Pm" => (material.metallic, self.has_metallic) = (first.map_or(material.metallic, unit), true),
            "Pc" => material.clearcoat = first.map_or(material.clearcoat, unit),
            "Pcr" => material.clearcoat_roughness = first.map_or(material.clearcoat_roughness, unit),
            "map_Kd" => self.color = map(rest),
            "map_Ke" => self.emission = map(rest),
            "map_Pr" => self.roughness = map(rest),
            "map_Pm" => self.metallic = map(rest),
            "map_d" => self.alpha = map(rest),
            "norm" => self.normals = map(rest),
            "bump" | "map_bump" | "map_Bump" => {
                self.warn("bump maps (map_Bump, bump) ignored; normal maps (norm) are read");
            }
            "disp" | "decal" | "refl" | "Ps" | "map_Ps" | "aniso" | "anisor" => self.warn(OTHER_MAPS),
            _ if keyword.starts_with("map_") => self.warn(OTHER_MAPS),
            _ => {}
        }
    }

    /// Makes the material of what was read, in whatever order.
    fn finish(&mut self) {
        if let Some(alpha) = self.alpha.take() {
            if self.color.as_ref().is_some_and(|(color, _)| *color == alpha.0) {
                self.material.flags |= MATERIAL_BLEND;
            } else {
                self.warn("map_d ignored; opacity comes from map_Kd alone");
            }
        }
        let material = &mut self.material;
        // A map without a factor is taken as it is.
        if self.emission.is_some() && !self.has_emission {
            material.emission = [1.0; 3];
        }
        if self.roughness.is_some() && !self.has_roughness {
            material.roughness = 1.0;
        }
        if self.metallic.is_some() && !self.has_metallic {
            material.metallic = 1.0;
        }
        let is_lit = !self.illumination.is_some_and(|model| model < 2.0);
        let Some(specular) = self.specular.filter(|specular| is_lit && *specular != [0.0; 3]) else { return };
        material.specular_weight = 1.0;
        let has_factors =
            self.has_roughness || self.has_metallic || self.roughness.is_some() || self.metallic.is_some();
        if has_factors {
            let index = self.index.filter(|index| *index >= 1.0);
            let reflected = index.map_or(DIELECTRIC, |index| ((index - 1.0) / (index + 1.0)).powi(2));
            material.specular = [reflected as f32; 3];
        } else {
            material.specular = specular;
        }
        if !self.has_roughness && self.roughness.is_none() {
            let exponent = self.exponent.unwrap_or(0.0).max(0.0);
            material.roughness = (2.0 / (exponent + 2.0)).powf(0.25) as f32;
        }
    }
}

const OTHER_MAPS: &str = "maps other than map_Kd, map_Ke, map_Pr, map_Pm, map_d and norm ignored";

/// Reads all materials.
pub(super) fn read(lines: &mut Lines) -> io::Result<Vec<Definition>> {
    let mut definitions: Vec<Definition> = Vec::new();
    while let Some(line) = lines.next()? {
        let text = String::from_utf8_lossy(line);
        let text = text.trim();
        let (keyword, rest) = text.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((text, ""));
        let rest = rest.trim();
        if keyword == "newmtl" {
            definitions.push(Definition::new(rest.to_owned()));
        } else if let Some(definition) = definitions.last_mut() {
            definition.read(keyword, rest);
        }
    }
    definitions.iter_mut().for_each(Definition::finish);
    Ok(definitions)
}

/// One to three numbers; a single one stands for all three.
fn color(mut values: impl Iterator<Item = f64>, most: f64) -> Option<[f32; 3]> {
    let first = values.next()?;
    let color = [first, values.next().unwrap_or(first), values.next().unwrap_or(first)];
    color.iter().all(|c| !c.is_nan()).then(|| color.map(|c| c.clamp(0.0, most) as f32))
}

fn set_opacity(material: &mut Material, opacity: Option<f64>) {
    if let Some(opacity) = opacity {
        material.base_color[3] = opacity.clamp(0.0, 1.0) as f32;
        if opacity < 1.0 {
            material.flags |= MATERIAL_BLEND;
        }
    }
}

/// The path behind the options of a map, and how it is repeated. Paths may hold spaces.
fn map(text: &str) -> Option<Map> {
    let mut rest = text;
    let mut wrap = WRAP_REPEAT;
    while rest.starts_with('-') {
        let (option, behind) = rest.split_once(|c: char| c.is_ascii_whitespace())?;
        rest = behind.trim_start();
        // Most options have one value; these have up to three numbers.
        let values = match option {
            "-o" | "-s" | "-t" => 3,
            "-mm" => 2,
            _ => 1,
        };
        for i in 0..values {
            let (value, behind) = rest.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((rest, ""));
            if i > 0 && number(value.as_bytes()).is_err() {
                break;
            }
            if option == "-clamp" && value == "on" {
                wrap = WRAP_CLAMP;
            }
            rest = behind.trim_start();
        }
    }
    (!rest.is_empty()).then(|| (rest.to_owned(), wrap | wrap << 16))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_of_maps_are_passed_over() {
        let path = |text| map(text).map(|(path, _)| path);
        assert_eq!(path("a b.png").as_deref(), Some("a b.png"));
        assert_eq!(path("-s 1 1 1 -o 0.5 tex/a.png").as_deref(), Some("tex/a.png"));
        assert_eq!(path("-bm 0.5 -mm 0 1 -blendu off c:\\a b.png").as_deref(), Some("c:\\a b.png"));
        assert_eq!(path("-s 1 1 1"), None);
        assert_eq!(path(""), None);
        assert_eq!(map("-clamp on a.png"), Some(("a.png".into(), WRAP_CLAMP | WRAP_CLAMP << 16)));
    }
    fn definition(lines: &[(&str, &str)]) -> Definition {
        let mut definition = Definition::new("m".into());
        lines.iter().for_each(|(keyword, rest)| definition.read(keyword, rest));
        definition.finish();
        definition
    }

    #[test]
    fn highlights_become_reflectance_and_roughness() {
        // Without Ks, with a black one, or an illumination model without highlights: as before.
        for lines in [&[("Ns", "100"), ("Ni", "1.5")][..], &[("Ks", "0 0 0")], &[("Ks", "1"), ("illum", "1")]] {
            assert_eq!(definition(lines).material, plain::material(), "{lines:?}");
        }
        let phong = definition(&[("illum", "2"), ("Ns", "126"), ("Ks", "0.5 0.25 2")]).material;
        assert_eq!((phong.specular, phong.specular_weight), ([0.5, 0.25, 1.0], 1.0));
        // 2 / 128 = 1/64: alpha 1/8.
        assert!((phong.roughness - 0.125f32.sqrt()).abs() < 1e-6, "{}", phong.roughness);
        assert_eq!(definition(&[("Ks", "0.5")]).material.roughness, 1.0);
        let metal = definition(&[("Ks", "0.5"), ("Ns", "500"), ("Pr", "0.25"), ("Pm", "1"), ("Ni", "2")]).material;
        assert_eq!((metal.roughness, metal.metallic, metal.specular), (0.25, 1.0, [1.0 / 9.0f32; 3]));
        assert_eq!(definition(&[("Ks", "0.5"), ("Pr", "0.25")]).material.specular, [0.04; 3]);
    }

    #[test]
    fn maps_without_factors_are_taken_as_they_are() {
        let found = definition(&[("map_Ke", "e.png"), ("map_Pm", "m.png"), ("map_Pr", "r.png"), ("norm", "n.png")]);
        let material = found.material;
        assert_eq!((material.emission, material.metallic, material.roughness), ([1.0; 3], 1.0, 1.0));
        assert!(found.normals.is_some() && found.warnings.is_empty());
        let half = definition(&[("map_Ke", "e.png"), ("Ke", "0.5 0 0"), ("Pm", "0.5"), ("map_Pm", "m.png")]).material;
        assert_eq!((half.emission, half.metallic), ([0.5, 0.0, 0.0], 0.5));
        let alpha = |file| definition(&[("map_d", file), ("map_Kd", "c.png")]);
        assert_eq!(alpha("c.png").material.flags & MATERIAL_BLEND, MATERIAL_BLEND);
        let other = alpha("d.png");
        assert!(other.material.flags & MATERIAL_BLEND == 0 && other.warnings.len() == 1);
        let many = definition(&[("bump", "b"), ("map_Bump", "b"), ("map_Ks", "s"), ("refl", "r"), ("Tf", "1 1 1")]);
        assert_eq!(many.warnings.len(), 2);
        assert_eq!(definition(&[("Tf", "1 0.5 1")]).warnings.len(), 1);
    }
}
