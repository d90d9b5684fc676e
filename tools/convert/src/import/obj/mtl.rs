//! Materials of OBJ (Wavefront, "MTL material format"; the factors of "PBR extension to MTL" by Exocortex).

use crate::import::plain;
use crate::import::text::{Lines, number};
use bricks::{MATERIAL_BLEND, Material, WRAP_CLAMP, WRAP_REPEAT};
use std::io;

/// A material and the picture of its colour.
#[derive(Clone, Debug)]
pub(super) struct Definition {
    pub name: String,
    pub material: Material,
    /// Path as written, and `bricks::WRAP_*` of s in the low half, of t in the high half.
    pub texture: Option<(String, u32)>,
    /// Whether there is a map that is not read.
    pub has_other_maps: bool,
}

/// Reads all materials. Numbers that are none leave a factor as it was.
pub(super) fn read(lines: &mut Lines) -> io::Result<Vec<Definition>> {
    let mut definitions: Vec<Definition> = Vec::new();
    while let Some(line) = lines.next()? {
        let text = String::from_utf8_lossy(line);
        let text = text.trim();
        let (keyword, rest) = text.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((text, ""));
        let rest = rest.trim();
        if keyword == "newmtl" {
            let material = plain::material();
            let name = rest.to_owned();
            definitions.push(Definition { name, material, texture: None, has_other_maps: false });
            continue;
        }
        let Some(definition) = definitions.last_mut() else { continue };
        let material = &mut definition.material;
        let values = || rest.split_ascii_whitespace().map_while(|word| number(word.as_bytes()).ok());
        let first = values().next().filter(|value| !value.is_nan());
        let unit = |value: f64| value.clamp(0.0, 1.0) as f32;
        match keyword {
            "Kd" => {
                if let Some(color) = color(values(), 1.0) {
                    material.base_color[..3].copy_from_slice(&color);
                }
            }
            "Ke" => material.emission = color(values(), f64::from(f32::MAX)).unwrap_or(material.emission),
            "d" => set_opacity(material, first),
            "Tr" => set_opacity(material, first.map(|transparency| 1.0 - transparency)),
            "Pr" => material.roughness = first.map_or(material.roughness, unit),
            "Pm" => material.metallic = first.map_or(material.metallic, unit),
            "map_Kd" => definition.texture = texture(rest),
            _ => definition.has_other_maps |= keyword.starts_with("map_") || keyword == "bump" || keyword == "norm",
        }
    }
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
fn texture(text: &str) -> Option<(String, u32)> {
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
        let path = |text| texture(text).map(|(path, _)| path);
        assert_eq!(path("a b.png").as_deref(), Some("a b.png"));
        assert_eq!(path("-s 1 1 1 -o 0.5 tex/a.png").as_deref(), Some("tex/a.png"));
        assert_eq!(path("-bm 0.5 -mm 0 1 -blendu off c:\\a b.png").as_deref(), Some("c:\\a b.png"));
        assert_eq!(path("-s 1 1 1"), None);
        assert_eq!(path(""), None);
        assert_eq!(texture("-clamp on a.png"), Some(("a.png".into(), WRAP_CLAMP | WRAP_CLAMP << 16)));
    }
}
