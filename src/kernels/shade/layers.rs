//! What sheen, anisotropy and thin films add to a surface: twin of `shaders/shade/layers.wgsl`, and of what
//! `shaders/shade/film.wgsl` does with surfaces.

use super::film::{Film, facet_cosines};
use super::lamps::unit;
use super::random::tangent;
use crate::kernels::layer_tables::{LAYER_TABLES, LEAST_SHEEN_ALPHA};
use crate::kernels::layout::{
    GBUFFER_REFRACTS, GBuffer, LAYER_BITS, LAYER_INDEX_STEPS, LAYER_STEPS, MATERIAL_LAYERS, MATERIAL_MORE,
    MATERIAL_REFRACTS, More, REFLECTANCE_SIZE, SHEENS, STRETCHED, STRETCHED_AZIMUTHS, STRETCHED_COSINES,
    STRETCHED_ROUGHNESSES, STRETCHED_STRENGTHS,
};
use crate::kernels::vector::{Vec3, cross, dot, each, mix, most, most3, normalize};
use bricks::Material;
use std::f32::consts::{PI, TAU};

/// Layers of a hit.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Layers {
    /// Probability that a direction is drawn by the sheen.
    pub choice: f32,
    /// 0: there is none.
    sheen_alpha: f32,
    /// Of light from everywhere, reflected by white sheen.
    sheen_share: f32,
    /// Of the view, by the fit for sheen.
    sheen_masked: f32,
    /// By what white sheen is multiplied.
    sheen: Vec3,
    /// Along the direction of anisotropy; 0: there is none.
    alpha_along: f32,
    /// That direction, a unit vector beside the normal.
    along: Vec3,
    strength: f32,
    /// A unit vector beside both.
    across: Vec3,
    /// Share of the surface that a film covers.
    coverage: f32,
    film: Film,
    /// Of what is below.
    metallic: f32,
    /// What is below reflects along the normal.
    dielectric: Vec3,
    /// By what further bounces between facets make it brighter.
    dielectric_more: Vec3,
    metal: Vec3,
    metal_more: Vec3,
    /// Of the clear coat; `None`: that of what is below.
    pub coat: Option<Frame>,
}

/// The side of a lobe that is seen: its normal, and the cosine of that and the view.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Frame {
    pub normal: Vec3,
    pub cos_view: f32,
}

impl Frame {
    /// A lobe toward d: distribution and masking over 4 times both cosines, and the density by which directions are
    /// drawn.
    pub fn lobe(&self, alpha: f32, d: Vec3, half_way: Vec3) -> [f32; 2] {
        let cosine = most(dot(self.normal, d), 0.0);
        let across = cross(self.normal, half_way);
        let c = dot(self.normal, half_way);
        let squared = alpha * alpha;
        // The squared sine by the cross product: that of small angles is not lost.
        let q = squared * c * c + dot(across, across);
        let distribution = squared / (PI * q * q);
        let by_view = (squared + (1.0 - squared) * self.cos_view * self.cos_view).sqrt();
        let by_light = (squared + (1.0 - squared) * cosine * cosine).sqrt();
        let masked = 0.5 / most(cosine * by_view + self.cos_view * by_light, 1.0e-20);
        [distribution * masked, 0.5 * distribution / (self.cos_view + by_view)]
    }
}

/// The surface that layers lie on: unit vectors, the cosine between them and the alpha of its facets.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Below {
    pub normal: Vec3,
    pub view: Vec3,
    pub cos_view: f32,
    pub alpha: f32,
}

/// Views are not flatter.
pub(super) const LEAST_COS_VIEW: f32 = 1.0e-4;

/// The two numbers of a word.
fn numbers_of(word: f32) -> [f32; 2] {
    let bits = word as u32;
    [bits & LAYER_STEPS, bits >> LAYER_BITS].map(|x| x as f32)
}

/// An entry of a table with the rows and columns of that of reflectances.
pub(super) fn table_at(table: &[[f32; 2]], cosine: f32, alpha: f32) -> [f32; 2] {
    let most = (REFLECTANCE_SIZE - 1) as f32;
    let [x, y] = [cosine, alpha].map(|x| x.sqrt().clamp(0.0, 1.0) * most);
    let [column, row] = [x, y].map(|x| (x as u32).min(REFLECTANCE_SIZE - 2));
    let at = (row * REFLECTANCE_SIZE + column) as usize;
    let (right, up) = (x - column as f32, y - row as f32);
    let size = REFLECTANCE_SIZE as usize;
    let between = |at: usize, k: usize| mix(table[at][k], table[at + 1][k], right);
    [0, 1].map(|k| mix(between(at, k), between(at + size, k), up))
}

/// How much of a direction by this cosine others of the sheen mask.
fn sheen_masking(cosine: f32, alpha: f32) -> f32 {
    let by = (1.0 - alpha) * (1.0 - alpha);
    let [a, b, c] = [mix(21.5473, 25.3245, by), mix(3.82987, 3.32435, by), mix(0.19823, 0.16801, by)];
    let [d, e] = [mix(-1.97760, -1.27393, by), mix(-4.32054, -4.85967, by)];
    let is_flat = cosine < 0.5;
    let x = most(if is_flat { cosine } else { 1.0 - cosine }, 1.0e-6);
    let l = a / (1.0 + b * x.powf(c)) + d * x + e;
    let half = a / (1.0 + b * 0.5f32.powf(c)) + d * 0.5 + e;
    (if is_flat { l } else { 2.0 * half - l }).exp()
}

impl Layers {
    /// The layers of a surface; `None`: it has none.
    pub fn of(g: &GBuffer, (m, x): (&Material, &More), below: &Below) -> Option<Self> {
        if m.flags & (MATERIAL_LAYERS | MATERIAL_MORE) == 0 {
            return None;
        }
        let mut l = Self::default();
        // Where it is turned away from the view, the coat has the normal of what is below.
        let cos_view = dot(x.normal, below.view);
        if m.flags & MATERIAL_MORE != 0 && cos_view > LEAST_COS_VIEW {
            l.coat = Some(Frame { normal: x.normal, cos_view });
        }
        if m.flags & MATERIAL_LAYERS == 0 {
            return Some(l);
        }
        let step = 1.0 / LAYER_STEPS as f32;
        let [first, second, stretch, film, thickness] = [1, 3, 5, 7, 9].map(|row| numbers_of(m.uv_from_set[row][3]));
        let (first, second) = (first.map(|x| x * step), second.map(|x| x * step));
        let sheen = [first[0], first[1], second[0]];
        l.sheen = each(|k| sheen[k] * x.sheen[k]);
        if most3(l.sheen) > 0.0 {
            let roughness = second[1] * x.sheen_roughness;
            l.sheen_alpha = most(roughness * roughness, LEAST_SHEEN_ALPHA as f32);
        }
        let n = below.normal;
        if stretch[0] > 0.0 {
            l.strength = stretch[0] * step * x.anisotropy;
            l.alpha_along = mix(below.alpha, 1.0, l.strength * l.strength);
            let along = dot(n, g.tangent);
            let beside = each(|k| g.tangent[k] - n[k] * along);
            let size = dot(beside, beside);
            let (mut t, mut side) = (tangent(n), 1.0);
            if g.handedness != 0.0 && size > 1.0e-12 {
                let length = size.sqrt();
                t = beside.map(|x| x / length);
                side = if g.handedness > 0.0 { 1.0 } else { -1.0 };
            }
            let angle = TAU / (LAYER_STEPS + 1) as f32 * stretch[1];
            let (cosine, sine, b) = (angle.cos(), angle.sin(), cross(n, t));
            let length = (x.along[0] * x.along[0] + x.along[1] * x.along[1]).sqrt();
            let a = if length > 1.0e-6 { x.along.map(|c| c / length) } else { [1.0, 0.0] };
            let turned = [cosine * a[0] - sine * a[1], sine * a[0] + cosine * a[1]];
            l.along = normalize(each(|k| turned[0] * t[k] + turned[1] * side * b[k]));
            l.across = cross(n, l.along);
        }
        // What rays pass straight through reflects for those that pass as well, and its film is left out.
        let passes = m.flags & MATERIAL_REFRACTS != 0 && g.state & GBUFFER_REFRACTS == 0;
        if !passes {
            l.coverage = film[0] * step * x.film;
            let thickness = mix(thickness[1], thickness[0], x.film_thickness);
            l.film = Film { index: 1.0 + film[1] / LAYER_INDEX_STEPS as f32, thickness };
        }
        Some(l)
    }

    /// What anisotropic facets reflect of light from everywhere, as the table of reflectances says of others; `None`:
    /// they are not.
    pub fn facets_around(&self, below: &Below) -> Option<[f32; 2]> {
        if self.alpha_along == 0.0 {
            return None;
        }
        let beside = most(1.0 - below.cos_view * below.cos_view, 1.0e-12).sqrt();
        let azimuth = dot(self.along, below.view).abs() / beside;
        let counts = [STRETCHED_COSINES, STRETCHED_ROUGHNESSES, STRETCHED_STRENGTHS, STRETCHED_AZIMUTHS];
        let place = [below.cos_view.sqrt(), below.alpha.sqrt(), self.strength, azimuth];
        let x: [f32; 4] = std::array::from_fn(|k| place[k].clamp(0.0, 1.0) * (counts[k] - 1) as f32);
        let low: [u32; 4] = std::array::from_fn(|k| (x[k] as u32).min(counts[k] - 2));
        let mut sum = [0.0; 2];
        for corner in 0..16u32 {
            let up = [corner & 1, corner >> 1 & 1, corner >> 2 & 1, corner >> 3];
            let share = |k: usize| {
                let right = x[k] - low[k] as f32;
                if up[k] == 1 { right } else { 1.0 - right }
            };
            let at = |k: usize| low[k] + up[k];
            let row = (at(3) * STRETCHED_STRENGTHS + at(2)) * STRETCHED_ROUGHNESSES + at(1);
            let entry = LAYER_TABLES[(STRETCHED + row * STRETCHED_COSINES + at(0)) as usize];
            let share = share(0) * share(1) * share(2) * share(3);
            sum = [0, 1].map(|k| sum[k] + entry[k] * share);
        }
        Some(sum)
    }

    /// Root of the squares of a direction's parts along and across, by the alphas, and of its cosine; `None`: facets
    /// are not anisotropic.
    pub fn facet_root(&self, below: &Below, d: Vec3, cosine: f32) -> Option<f32> {
        let along = self.alpha_along * dot(self.along, d);
        let across = below.alpha * dot(self.across, d);
        (self.alpha_along > 0.0).then(|| (along * along + across * across + cosine * cosine).sqrt())
    }

    /// The lobe of anisotropic facets, as that of others has it; `None`: they are not.
    pub fn facet_lobe(&self, below: &Below, d: Vec3, half_way: Vec3) -> Option<[f32; 2]> {
        let cosine = most(dot(below.normal, d), 0.0);
        let by_view = self.facet_root(below, below.view, below.cos_view)?;
        let by_light = self.facet_root(below, d, cosine)?;
        let squared = self.alpha_along * below.alpha;
        let along = below.alpha * dot(self.along, half_way);
        let across = self.alpha_along * dot(self.across, half_way);
        let up = squared * dot(below.normal, half_way);
        let w = squared / (along * along + across * across + up * up);
        let distribution = squared * w * w / PI;
        let masked = 0.5 / most(cosine * by_view + below.cos_view * by_light, 1.0e-20);
        Some([distribution * masked, 0.5 * distribution / (below.cos_view + by_view)])
    }

    /// The frame's first vector and the alphas that facets are drawn by, where they are anisotropic.
    pub fn stretched(&self, below: &Below) -> Option<(Vec3, [f32; 2])> {
        (self.alpha_along > 0.0).then_some((self.along, [self.alpha_along, below.alpha]))
    }

    /// Puts the film on the facets: what they reflect of light from everywhere, and what of it is left to the diffuse
    /// part, which is that of the brightest colour. `albedo`: of metal. `white`: what white facets reflect by single
    /// bounces; `bounces`: by what more.
    pub fn lay_film(
        &mut self,
        below: &Below,
        (share, left): (&mut Vec3, &mut Vec3),
        specular: Vec3,
        (albedo, metallic): (Vec3, f32),
        [white, bounces]: [f32; 2],
    ) {
        if self.coverage == 0.0 {
            return;
        }
        let (mut dielectric, mut metal) = ([0.0; 3], [0.0; 3]);
        for cosine in facet_cosines(below.cos_view, below.alpha) {
            if metallic < 1.0 {
                let color = self.film.color(specular, cosine);
                dielectric = each(|k| dielectric[k] + 0.25 * color[k]);
            }
            if metallic > 0.0 {
                let color = self.film.color(albedo, cosine);
                metal = each(|k| metal[k] + 0.25 * color[k]);
            }
        }
        self.metallic = metallic;
        (self.dielectric, self.metal) = (specular, albedo);
        self.dielectric_more = dielectric.map(|c| 1.0 + c * bounces);
        self.metal_more = metal.map(|c| 1.0 + c * bounces);
        let of_dielectric = each(|k| white * (dielectric[k] * self.dielectric_more[k]));
        let of_metal = each(|k| white * (metal[k] * self.metal_more[k]));
        *share = each(|k| mix(share[k], mix(of_dielectric[k], of_metal[k], metallic), self.coverage));
        let greatest = most3(of_dielectric);
        *left = left.map(|c| mix(c, 1.0 - greatest, self.coverage));
    }

    /// What a facet reflects by a cosine, with its film; f: without.
    pub fn with_film(&self, cosine: f32, f: Vec3) -> Vec3 {
        if self.coverage == 0.0 {
            return f;
        }
        let mut seen = [0.0; 3];
        if self.metallic < 1.0 {
            let color = self.film.color(self.dielectric, cosine);
            seen = each(|k| (1.0 - self.metallic) * (color[k] * self.dielectric_more[k]));
        }
        if self.metallic > 0.0 {
            let color = self.film.color(self.metal, cosine);
            seen = each(|k| seen[k] + self.metallic * (color[k] * self.metal_more[k]));
        }
        each(|k| mix(f[k], seen[k], self.coverage))
    }

    /// Puts the sheen between the coat, which leaves `under` of the light, and what is below: what it leaves to that.
    pub fn lay_sheen(&mut self, below: &Below, under: f32) -> f32 {
        if self.sheen_alpha == 0.0 {
            return 1.0;
        }
        let [share, _] = table_at(&LAYER_TABLES[SHEENS as usize..], below.cos_view, self.sheen_alpha);
        self.sheen_share = share;
        // The fit would have smooth sheen reflect more than all where it is seen flat.
        let gain = most(self.sheen_share, 1.0);
        let greatest = most3(self.sheen);
        let scale = under / gain;
        self.sheen = self.sheen.map(|c| c * scale);
        self.sheen_masked = sheen_masking(below.cos_view, self.sheen_alpha);
        1.0 - greatest * (self.sheen_share / gain)
    }

    /// Share of light of one radiance from everywhere that the sheen reflects.
    pub fn sheen_around(&self) -> Vec3 {
        self.sheen.map(|c| c * self.sheen_share)
    }

    /// What the sheen reflects of light from d: its distribution function.
    pub fn sheen_toward(&self, below: &Below, d: Vec3, half_way: Vec3) -> Vec3 {
        let alpha = self.sheen_alpha;
        if alpha == 0.0 {
            return [0.0; 3];
        }
        let cosine = most(dot(below.normal, d), 1.0e-6);
        let across = cross(below.normal, half_way);
        let squared = most(dot(across, across), 1.0e-20);
        let distribution = (2.0 + 1.0 / alpha) * squared.powf(0.5 / alpha) / TAU;
        let masked = 1.0 + self.sheen_masked + sheen_masking(cosine, alpha);
        let scale = distribution / (masked * 4.0 * below.cos_view * cosine);
        self.sheen.map(|c| c * scale)
    }

    /// A direction by the sheen: all of the hemisphere are as likely.
    pub fn sheen_direction(&self, normal: Vec3, words: [u32; 4]) -> Vec3 {
        let around = TAU * unit(words[0]);
        let height = unit(words[1]);
        let level = most(1.0 - height * height, 0.0).sqrt();
        let x = tangent(normal);
        let y = cross(normal, x);
        normalize(each(|k| level * around.cos() * x[k] + level * around.sin() * y[k] + height * normal[k]))
    }

    /// Square of the roughness of the widest lobe that layers make.
    pub fn greatest_alpha(&self) -> f32 {
        if self.sheen_alpha > 0.0 { 1.0 } else { self.alpha_along }
    }
}
