//! Roughness that stands for bumps which coarser levels of a normal texture no longer show.
//!
//! *Theory.* The mean of unit normals is the shorter the more they differ (Toksvig, "Mipmapping Normal Maps", 2005). As
//! a von Mises–Fisher distribution its length r gives the concentration κ = (3 r - r³) / (1 - r²) (Banerjee et al.
//! 2005), so that normals spread with a variance of 1 / κ along either tangent, and facets of roughness α with α² / 2:
//! together α² + 2 / κ.
//!
//! *Practice.* Normals are stored as unit vectors, so the levels of the roughness texture beside them carry the spread.
//! That needs one roughness texture for one normal texture, of the same size, looked up alike; others are left as they
//! are. The finest level is kept. A factor below 1 bounds what the texture can say, and [`MOST_SPREAD`] what is added:
//! facets far from the highlight would come out too bright by it (`docs/results/textures.md`).

use bricks::{MATERIAL_FURTHER, METALLIC_ROUGHNESS, Material, NONE, NORMAL};
use std::collections::{BTreeMap, BTreeSet};

/// Most that bumps add to α², for the reason that Tokuyoshi and Kaplanyan ("Improved Geometric Specular Antialiasing",
/// 2019) bound theirs: the tails of GGX grow with α², and those of bumps do not.
const MOST_SPREAD: f32 = 0.05;

/// The bumps that a roughness texture stands for at its coarser levels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bumps {
    /// Index of the normal texture in the source.
    pub normals: u32,
    /// Of x and y of the normals.
    scale: f32,
    /// By which materials multiply what the texture has.
    factor: f32,
}

/// The bumps of roughness textures, by their index in the source, where all materials that use one agree.
pub(crate) fn bumps(materials: &[Material]) -> BTreeMap<u32, Bumps> {
    let mut users: BTreeMap<u32, BTreeSet<[u32; 3]>> = BTreeMap::new();
    let is_rough = |m: &&Material| m.metallic_roughness_texture != NONE && m.flags & MATERIAL_FURTHER == 0;
    for m in materials.iter().filter(is_rough) {
        let rows = |which: usize| &m.uv_from_set[2 * which..2 * which + 2];
        let set = |which: usize| m.uv_sets >> which & 1;
        let is_alike = rows(NORMAL) == rows(METALLIC_ROUGHNESS) && set(NORMAL) == set(METALLIC_ROUGHNESS);
        let normals = if is_alike { m.normal_texture } else { NONE };
        let user = [normals, m.normal_scale.to_bits(), m.roughness.to_bits()];
        users.entry(m.metallic_roughness_texture).or_default().insert(user);
    }
    let only = |(texture, users): (u32, BTreeSet<[u32; 3]>)| {
        let &[normals, scale, factor] = users.first().filter(|_| users.len() == 1)?;
        let bumps = Bumps { normals, scale: f32::from_bits(scale), factor: f32::from_bits(factor) };
        (normals != NONE && bumps.factor > 0.0).then_some((texture, bumps))
    };
    users.into_iter().filter_map(only).collect()
}

impl Bumps {
    /// The unit vector that a texel of the normal texture stands for, as a texel whose means are those of vectors.
    pub fn unit(&self, [r, g, b, _]: [f32; 4]) -> [f32; 4] {
        let [x, y, z] = [self.scale * (2.0 * r - 1.0), self.scale * (2.0 * g - 1.0), 2.0 * b - 1.0];
        let length = (x * x + y * y + z * z).sqrt().max(1e-6);
        [x / length, y / length, z / length, 0.0]
    }

    /// What a texel of the roughness texture becomes where the mean of unit normals is `mean`.
    pub fn widen(&self, texel: &mut [f32; 4], mean: &[f32; 4]) {
        let squared: f32 = mean.iter().map(|c| c * c).sum::<f32>().min(1.0);
        let r = squared.sqrt();
        // 2 / κ.
        let spread = (2.0 * (1.0 - squared) / (r * (3.0 - squared)).max(1e-6)).min(MOST_SPREAD);
        let roughness = self.factor * texel[1];
        let widened = (roughness.powi(4) + spread).min(1.0).powf(0.25);
        texel[1] = (widened / self.factor).min(1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cone_of_normals_widens_roughness_by_its_variance() {
        let bumps = Bumps { normals: 0, scale: 1.0, factor: 1.0 };
        for tilt in [0.05f32, 0.1, 0.2] {
            // Normals all around at one angle have half its square as variance along either tangent.
            let around = (0..64).map(|k| (k as f32 / 64.0 * std::f32::consts::TAU).sin_cos());
            let mut mean = [0.0; 4];
            for (sin, cos) in around {
                let n = [tilt.sin() * sin, tilt.sin() * cos, tilt.cos()].map(|c| 0.5 * c + 0.5);
                let unit = bumps.unit([n[0], n[1], n[2], 1.0]);
                (0..4).for_each(|k| mean[k] += unit[k] / 64.0);
            }
            let mut texel = [0.0, 0.4, 1.0, 1.0];
            bumps.widen(&mut texel, &mean);
            let [before, after] = [0.4f32, texel[1]].map(|roughness| roughness.powi(4));
            let variance = 0.5 * (after - before);
            assert!((variance / (0.5 * tilt * tilt) - 1.0).abs() < 0.05, "{variance} of {tilt}");
            assert_eq!([texel[0], texel[2], texel[3]], [0.0, 1.0, 1.0]);
        }
        let mut flat = [0.0, 0.4, 1.0, 1.0];
        bumps.widen(&mut flat, &[0.0, 0.0, 1.0, 0.0]);
        assert!((flat[1] - 0.4).abs() < 1e-6, "{flat:?}");
        // Vectors that cancel out have an endless spread.
        let mut cancelled = [0.0, 0.1, 0.0, 1.0];
        bumps.widen(&mut cancelled, &[0.0; 4]);
        assert!((cancelled[1].powi(4) - 1e-4 - MOST_SPREAD).abs() < 1e-5, "{cancelled:?}");
    }

    #[test]
    fn a_roughness_texture_stands_for_the_bumps_of_one_normal_texture() {
        let one = Material { normal_texture: 3, metallic_roughness_texture: 5, roughness: 0.5, ..Material::DIFFUSE };
        let expected = Bumps { normals: 3, scale: one.normal_scale, factor: 0.5 };
        assert_eq!(bumps(&[one, one, Material::DIFFUSE]), BTreeMap::from([(5, expected)]));
        let turned = |change: fn(&mut Material)| {
            let mut other = one;
            change(&mut other);
            other
        };
        let others: [fn(&mut Material); 4] =
            [|m| m.normal_texture = 4, |m| m.normal_texture = NONE, |m| m.roughness = 1.0, |m| m.normal_scale = 0.5];
        for other in others {
            assert!(bumps(&[one, turned(other)]).is_empty(), "users differ");
        }
        assert!(bumps(&[turned(|m| m.uv_sets = 1 << NORMAL)]).is_empty(), "other coordinates");
        assert!(bumps(&[turned(|m| m.uv_from_set[0][0] = 2.0)]).len() == 1, "those of the base colour do not matter");
        assert!(bumps(&[turned(|m| m.uv_from_set[2][0] = 2.0)]).is_empty(), "placed otherwise");
    }
}
