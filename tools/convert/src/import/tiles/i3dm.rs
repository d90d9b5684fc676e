//! Instanced 3D models (OGC 18-053r2, section 8.2): a header, two tables, a glTF file or its name. The feature table
//! places it many times.

use super::batched::{self, Place, Triple, floats};
use crate::import::affine::Affine;
use crate::import::bytes::{Bytes, Reader};
use serde::Deserialize;

const HEADER_WORDS: u64 = 8;

/// Longest name of a glTF file.
const MAX_URI_BYTES: u64 = 1 << 12;

/// The semi-axes of the WGS84 ellipsoid, metres.
const EQUATOR: f64 = 6_378_137.0;
const POLE: f64 = 6_356_752.314_245_179;

/// The feature table.
#[derive(Deserialize)]
#[serde(rename_all = "UPPERCASE")]
struct Features {
    instances_length: u32,
    rtc_center: Option<Triple>,
    #[serde(default)]
    east_north_up: bool,
    position: Option<Place>,
    position_quantized: Option<Place>,
    quantized_volume_offset: Option<Triple>,
    quantized_volume_scale: Option<Triple>,
    normal_up: Option<Place>,
    normal_right: Option<Place>,
    normal_up_oct32p: Option<Place>,
    normal_right_oct32p: Option<Place>,
    scale: Option<Place>,
    scale_non_uniform: Option<Place>,
}

/// Where the glTF file is.
pub(super) enum Model {
    /// Within the file.
    Within(Bytes),
    /// Elsewhere, by its URI.
    At(String),
}

/// The model within `bytes`, and from its coordinates, Z up, to those of the tile, for each instance, of which there
/// are `most` at most.
pub(super) fn open(bytes: &Bytes, reader: &Reader, most: u64) -> Result<(Model, Vec<Affine>), String> {
    let file = batched::open::<Features>(bytes, reader, HEADER_WORDS)?;
    let model = match file.format {
        0 => {
            if file.body.len() > MAX_URI_BYTES {
                return Err(format!("the URI of its glTF file has {} bytes", file.body.len()));
            }
            let text = String::from_utf8(file.body.read()?).map_err(|_| "the URI of its glTF file is not UTF-8")?;
            Model::At(text.trim_end_matches(['\0', ' ']).to_owned())
        }
        1 => Model::Within(file.body),
        other => return Err(format!("gltfFormat {other} is neither 0 nor 1")),
    };
    let features = file.features.ok_or("it has no feature table")?;
    if u64::from(features.instances_length) > most {
        return Err(format!("{} instances are too many; convert it in parts", features.instances_length));
    }
    Ok((model, features.places(&file.binary)?))
}

impl Features {
    fn places(&self, binary: &Bytes) -> Result<Vec<Affine>, String> {
        let count = self.instances_length as usize;
        let read = |place: Place, name, bytes: u64| place.read(binary, name, u64::from(self.instances_length) * bytes);
        let vectors = |place: Option<Place>, name| {
            place.map(|place| read(place, name, 12).map(|bytes| floats::<3>(&bytes))).transpose()
        };
        let rtc = self.rtc_center.map_or(Ok([0.0; 3]), |center| center.read(binary, "RTC_CENTER"))?;
        let positions = match (self.position, self.position_quantized) {
            (Some(_), _) => vectors(self.position, "POSITION")?.unwrap_or_default(),
            (None, Some(place)) => {
                let volume = |triple: Option<Triple>, name: &str| {
                    triple.ok_or_else(|| format!("POSITION_QUANTIZED without {name}"))?.read(binary, name)
                };
                let offset = volume(self.quantized_volume_offset, "QUANTIZED_VOLUME_OFFSET")?;
                let scale = volume(self.quantized_volume_scale, "QUANTIZED_VOLUME_SCALE")?;
                let position = |q: [u16; 3]| std::array::from_fn(|k| offset[k] + f64::from(q[k]) / 65535.0 * scale[k]);
                shorts::<3>(&read(place, "POSITION_QUANTIZED", 6)?).map(position).collect()
            }
            (None, None) => return Err("it has neither POSITION nor POSITION_QUANTIZED".into()),
        };
        let octahedral = |place: Option<Place>, name| {
            let decode = |bytes: Vec<u8>| shorts::<2>(&bytes).map(from_octahedral).collect::<Vec<_>>();
            place.map(|place| read(place, name, 4).map(decode)).transpose()
        };
        // The plain form goes before the packed one.
        let up = match vectors(self.normal_up, "NORMAL_UP")? {
            None => octahedral(self.normal_up_oct32p, "NORMAL_UP_OCT32P")?,
            up => up,
        };
        let right = match vectors(self.normal_right, "NORMAL_RIGHT")? {
            None => octahedral(self.normal_right_oct32p, "NORMAL_RIGHT_OCT32P")?,
            right => right,
        };
        let axes = match (up, right) {
            (Some(up), Some(right)) => Some((up, right)),
            (None, None) => None,
            _ => return Err("it has only one of up and right directions".into()),
        };
        let uniform = self.scale.map(|place| read(place, "SCALE", 4).map(|bytes| floats::<1>(&bytes))).transpose()?;
        let scales = vectors(self.scale_non_uniform, "SCALE_NON_UNIFORM")?;
        let place = |i: usize| {
            let position: [f64; 3] = std::array::from_fn(|k| positions[i][k] + rtc[k]);
            let scale = uniform.as_ref().map_or(1.0, |all| all[i][0]);
            let scale = scales.as_ref().map_or([scale; 3], |all| all[i].map(|s| s * scale));
            // Columns: what the axes of the model become.
            let columns = match &axes {
                Some((up, right)) => {
                    let [up, right] = [unit(up[i])?, unit(right[i])?];
                    [right, up, cross(right, up)]
                }
                None if self.east_north_up => east_north_up(position)?,
                None => [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            };
            let matrix: Affine = std::array::from_fn(|at| match at % 4 {
                3 => position[at / 4],
                column => columns[column][at / 4] * scale[column],
            });
            matrix.iter().all(|c| c.is_finite()).then_some(matrix)
        };
        let place =
            |i: usize| place(i).ok_or_else(|| format!("instance {i} is not placed by finite numbers and directions"));
        (0..count).map(place).collect()
    }
}

/// Numbers of 16 bits, `N` at a time.
fn shorts<const N: usize>(bytes: &[u8]) -> impl Iterator<Item = [u16; N]> {
    let number = |bytes: &[u8; 2]| u16::from_le_bytes(*bytes);
    bytes.as_chunks::<2>().0.chunks_exact(N).map(move |n| std::array::from_fn(|k| number(&n[k])))
}

/// A direction from its octahedral map (Cigolle et al. 2014), of 16 bits each way.
fn from_octahedral(packed: [u16; 2]) -> [f64; 3] {
    let [x, y] = packed.map(|c| f64::from(c) / 65535.0 * 2.0 - 1.0);
    let z = 1.0 - x.abs() - y.abs();
    if z >= 0.0 {
        return [x, y, z];
    }
    [(1.0 - y.abs()) * 1f64.copysign(x), (1.0 - x.abs()) * 1f64.copysign(y), z]
}

/// The unit vector along `v`, if that has a direction.
fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
    crate::import::affine::direction(&crate::source::IDENTITY, v)
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// East, north and up at an Earth-centred position; `None` at the centre.
fn east_north_up(position: [f64; 3]) -> Option<[[f64; 3]; 3]> {
    let [x, y, z] = position;
    let up = unit([x / (EQUATOR * EQUATOR), y / (EQUATOR * EQUATOR), z / (POLE * POLE)])?;
    // At a pole every direction is south, or north.
    let east = unit([-y, x, 0.0]).unwrap_or([0.0, 1.0, 0.0]);
    Some([east, cross(up, east), up])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn octahedral_directions_come_back() {
        // The map itself, as the paper has it.
        let to = |v: [f64; 3]| {
            let sum: f64 = v.iter().map(|c| c.abs()).sum();
            let [x, y] = [v[0] / sum, v[1] / sum];
            let fold = |a: f64, b: f64| if v[2] < 0.0 { (1.0 - b.abs()) * 1f64.copysign(a) } else { a };
            [fold(x, y), fold(y, x)].map(|c| ((c * 0.5 + 0.5) * 65535.0).round() as u16)
        };
        for i in 0..500 {
            let (z, angle) = (f64::from(i) / 250.0 - 0.999, f64::from(i) * 2.4);
            let radius = (1.0 - z * z).sqrt();
            let v = [radius * angle.cos(), radius * angle.sin(), z];
            let back = unit(from_octahedral(to(v))).unwrap();
            let error = (0..3).map(|k| (v[k] - back[k]).abs()).fold(0.0, f64::max);
            assert!(error < 1e-4, "{v:?} came back as {back:?}");
        }
    }

    #[test]
    fn up_is_the_ellipsoids_normal() {
        // 45° north on the prime meridian.
        let (sin, cos) = std::f64::consts::FRAC_PI_4.sin_cos();
        let squared = 1.0 - (POLE / EQUATOR).powi(2);
        let radius = EQUATOR / (1.0 - squared * sin * sin).sqrt();
        let [east, north, up] = east_north_up([radius * cos, 0.0, radius * (1.0 - squared) * sin]).unwrap();
        for (found, expected) in [(east, [0.0, 1.0, 0.0]), (north, [-sin, 0.0, cos]), (up, [cos, 0.0, sin])] {
            assert!((0..3).all(|k| (found[k] - expected[k]).abs() < 1e-12), "{found:?} is not {expected:?}");
        }
        assert_eq!(east_north_up([0.0, 0.0, POLE]).unwrap()[2], [0.0, 0.0, 1.0]);
        assert!(east_north_up([0.0; 3]).is_none());
    }
}
