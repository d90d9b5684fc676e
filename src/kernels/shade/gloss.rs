//! How surfaces reflect otherwise than diffusely: twin of `shaders/shade/gloss.wgsl`.

use super::lamps::unit;
use super::layers::{Below, Frame, LEAST_COS_VIEW, Layers, table_at};
use super::light::ambient;
use super::more::Shown;
use super::random::tangent;
use crate::kernels::bound::Bound;
use crate::kernels::layout::{
    GBUFFER_BACK, GBUFFER_REFRACTS, GBuffer, MATERIAL_LAYERS, MATERIAL_REFRACTS, MATERIAL_UNLIT, More, PARAM_BOUNCE,
    PARAM_GLOSSY,
};
use crate::kernels::reflectance::REFLECTANCES;
use crate::kernels::vector::{Vec3, cross, dot, each, least, mix, most, most3, normalize, xyz};
use crate::math::sampling::pcg;
use bricks::{Material, unpack_absorption};
use std::f32::consts::{PI, TAU};

/// Of a lobe's square root of roughness; smoother ones are as sharp as this.
const LEAST_ALPHA: f32 = 0.001;
/// What a clear coat reflects along its normal (KHR_materials_clearcoat: index of refraction 1.5).
const COAT_F0: f32 = 0.04;

/// How a hit reflects; of Lambertian ones all but `diffuse` is zero.
#[derive(Clone, Copy, Debug, Default)]
pub struct Gloss {
    normal: Vec3,
    /// Of the normal and the view.
    cos_view: f32,
    /// Unit vector to where the hit is seen from.
    view: Vec3,
    alpha: f32,
    /// Reflectance along the normal, bounces between facets included.
    f0: Vec3,
    /// And at grazing angles.
    f90: Vec3,
    /// Share of the clear coat.
    coat: f32,
    /// Albedo of the diffuse part.
    pub diffuse: Vec3,
    coat_alpha: f32,
    /// Of light from everywhere, reflected by the facets below the coat.
    share: Vec3,
    /// Share of the light that the coat leaves.
    under: f32,
    /// Of light from everywhere, reflected by the coat.
    coat_share: f32,
    /// Probability that a direction is drawn by the coat.
    choice: f32,
    /// Share of the light that facets do not reflect which enters the body, or leaves it.
    pub through: Vec3,
    /// Index of refraction on the side of the view over that beyond; 0 where nothing refracts.
    pub eta: f32,
    layers: Option<Layers>,
}

/// A direction that was drawn, a unit vector.
#[derive(Clone, Copy, Debug)]
pub struct Drawn {
    /// It may lead below the surface.
    pub direction: Vec3,
    /// It leads through a facet; else it is reflected.
    pub is_through: bool,
}

impl Gloss {
    /// Of a hit seen along -view, of any length.
    #[inline]
    pub fn of<'a>(hit: impl Into<Shown<'a>>, m: &Material, view: Vec3) -> Self {
        let shown = hit.into();
        let g: &GBuffer = &shown;
        let has_layers = m.flags & MATERIAL_LAYERS != 0;
        let is_matt = !(g.metallic > 0.0 || m.specular_weight > 0.0 || m.clearcoat > 0.0 || has_layers);
        if m.flags & MATERIAL_UNLIT != 0 || is_matt {
            return Self { diffuse: g.albedo, ..Self::default() };
        }
        Self::of_facets(&shown, m, view)
    }

    /// The same of one that is not matt.
    fn of_facets(shown: &Shown, m: &Material, view: Vec3) -> Self {
        let (g, x): (&GBuffer, More) = (shown, shown.more(m));
        let mut albedo = g.albedo;
        let mut s = Self { diffuse: g.albedo, ..Self::default() };
        s.normal = g.normal;
        s.view = normalize(view);
        s.cos_view = most(dot(s.normal, s.view), LEAST_COS_VIEW);
        s.alpha = most(g.roughness * g.roughness, LEAST_ALPHA);
        s.layers = Layers::of(g, (m, &x), &s.below());
        let stretched = s.layers.and_then(|layers| layers.facets_around(&s.below()));
        let [along, grazing] = stretched.unwrap_or_else(|| table_at(&REFLECTANCES, s.cos_view, s.alpha));
        let white = along + grazing;
        let (mut specular, mut specular_weight) = (m.specular, m.specular_weight);
        let (mut bounces, mut inside) = ((1.0 - white) / white, 0.0);
        if m.flags & MATERIAL_REFRACTS == 0 {
            specular = each(|k| specular[k] * (x.specular[k] * x.specular_weight));
            specular_weight *= x.specular_weight;
        } else {
            let share = m.transmission * x.specular_weight;
            if g.state & GBUFFER_REFRACTS != 0 {
                let root = m.specular[0].sqrt();
                let ior = (1.0 + root) / (1.0 - root);
                s.eta = if g.state & GBUFFER_BACK != 0 { ior } else { 1.0 / ior };
                (bounces, inside) = (0.0, share);
            } else {
                // Rays that meet it stand for those as well that pass straight through, by alpha. Light enters it more
                // often, and by as much its base colour is brighter.
                let passing = share * (1.0 - m.metallic) * most3(xyz(m.base_color));
                let alpha = 1.0 - passing * (1.0 - m.specular[0]);
                specular = specular.map(|c| least(c / most(alpha, 1.0e-6), 1.0));
                let rest = if passing < 1.0 { (1.0 - share) / (1.0 - passing) } else { 0.0 };
                albedo = albedo.map(|c| c * rest);
            }
        }
        let of_dielectric = specular.map(|c| 1.0 + c * bounces);
        let of_metal = albedo.map(|c| 1.0 + c * bounces);
        s.f0 = each(|k| mix(specular[k] * of_dielectric[k], albedo[k] * of_metal[k], g.metallic));
        s.f90 = each(|k| mix(specular_weight * of_dielectric[k], of_metal[k], g.metallic));
        s.share = each(|k| s.f0[k] * along + s.f90[k] * grazing);
        let mut left = each(|k| 1.0 - (specular[k] * along + specular_weight * grazing) * of_dielectric[k]);
        let below = s.below();
        if let Some(layers) = &mut s.layers {
            layers.lay_film(&below, (&mut s.share, &mut left), specular, (albedo, g.metallic), [white, bounces]);
        }
        let below_facets = albedo.map(|c| c * (1.0 - g.metallic));
        s.diffuse = each(|k| below_facets[k] * (1.0 - inside) * most(left[k], 0.0));
        s.through = below_facets.map(|c| c * inside);
        s.coat = m.clearcoat * x.coat;
        s.under = 1.0;
        if s.coat > 0.0 {
            let roughness = m.clearcoat_roughness * x.coat_roughness;
            s.coat_alpha = most(roughness * roughness, LEAST_ALPHA);
            let of_coat = table_at(&REFLECTANCES, s.coat_frame().cos_view, s.coat_alpha);
            s.coat_share = s.coat * (COAT_F0 * of_coat[0] + of_coat[1]);
            s.under = 1.0 - s.coat_share;
            s.diffuse = s.diffuse.map(|c| c * s.under);
            s.through = s.through.map(|c| c * s.under);
        }
        if let Some(layers) = &mut s.layers {
            let left = layers.lay_sheen(&below, s.under);
            s.under *= left;
            s.diffuse = s.diffuse.map(|c| c * left);
            s.through = s.through.map(|c| c * left);
        }
        let below = s.under * most3(s.share);
        let of_sheen = s.layers.map_or(0.0, |layers| most3(layers.sheen_around()));
        let all = most(s.coat_share + below + of_sheen, 1.0e-20);
        s.choice = s.coat_share / all;
        if let Some(layers) = &mut s.layers {
            layers.choice = of_sheen / all;
        }
        s
    }

    /// What its layers lie on.
    fn below(&self) -> Below {
        Below { normal: self.normal, view: self.view, cos_view: self.cos_view, alpha: self.alpha }
    }

    /// Square of the roughness of its widest lobe.
    pub fn greatest_alpha(&self) -> f32 {
        most(most(self.alpha, self.coat_alpha), self.layers.map_or(0.0, |layers| layers.greatest_alpha()))
    }

    /// Probability that a direction is drawn by the sheen.
    fn sheen_choice(&self) -> f32 {
        self.layers.map_or(0.0, |layers| layers.choice)
    }

    /// The lobe of the facets below the coat.
    fn facet_lobe(&self, d: Vec3, half_way: Vec3) -> [f32; 2] {
        let stretched = self.layers.as_ref().and_then(|layers| layers.facet_lobe(&self.below(), d, half_way));
        stretched.unwrap_or_else(|| self.frame().lobe(self.alpha, d, half_way))
    }

    /// The side of the facets below the coat that is seen.
    fn frame(&self) -> Frame {
        Frame { normal: self.normal, cos_view: self.cos_view }
    }

    /// That of the coat.
    fn coat_frame(&self) -> Frame {
        self.layers.as_ref().and_then(|layers| layers.coat).unwrap_or_else(|| self.frame())
    }

    /// The cosine of a direction and the coat's normal over that of what is below, by which its light is weighted.
    fn coat_cosines(&self, d: Vec3) -> f32 {
        let coat = self.layers.as_ref().and_then(|layers| layers.coat);
        coat.map_or(1.0, |coat| most(dot(coat.normal, d), 0.0) / most(dot(self.normal, d), 1.0e-20))
    }

    /// Whether there is more than the diffuse part.
    pub fn is_glossy(&self) -> bool {
        self.alpha > 0.0
    }

    fn grazing(&self, half_way: Vec3) -> f32 {
        let c = (1.0 - dot(half_way, self.view)).clamp(0.0, 1.0);
        c * c * c * c * c
    }

    /// Square of the cosine of the angle by which light goes on beyond a facet that it meets by this cosine; negative
    /// where all of it is reflected.
    fn squared_beyond(&self, cosine: f32) -> f32 {
        1.0 - self.eta * self.eta * (1.0 - cosine * cosine)
    }

    /// What a facet reflects, by the cosine on the side that is not within the body (Schlick).
    fn fresnel(&self, half_way: Vec3) -> Vec3 {
        let mut cosine = dot(half_way, self.view);
        if self.eta > 1.0 {
            let squared = self.squared_beyond(cosine);
            if squared <= 0.0 {
                return [1.0; 3];
            }
            cosine = squared.sqrt();
        }
        let c = (1.0 - cosine).clamp(0.0, 1.0);
        let f = c * c * c * c * c;
        let bare = each(|k| mix(self.f0[k], self.f90[k], f));
        self.layers.as_ref().map_or(bare, |layers| layers.with_film(cosine, bare))
    }

    /// Probability that a direction by a facet is one of reflection.
    fn reflects_by(&self, half_way: Vec3) -> f32 {
        if self.eta == 0.0 { 1.0 } else { most3(self.fresnel(half_way)) }
    }

    fn half_way(&self, d: Vec3) -> Vec3 {
        normalize(each(|k| self.view[k] + d[k]))
    }

    /// What the surface reflects of light from d, a unit vector, otherwise than diffusely: pi times its distribution
    /// function.
    pub fn reflected(&self, d: Vec3) -> Vec3 {
        if self.alpha == 0.0 || dot(self.normal, d) <= 0.0 {
            return [0.0; 3];
        }
        let half_way = self.half_way(d);
        let lobe = self.under * self.facet_lobe(d, half_way)[0];
        let mut sum = self.fresnel(half_way).map(|f| f * lobe);
        if let Some(layers) = &self.layers {
            let sheen = layers.sheen_toward(&self.below(), d, half_way);
            sum = each(|k| sum[k] + sheen[k]);
        }
        if self.coat > 0.0 {
            let f = self.grazing(half_way);
            let lobe = self.coat_frame().lobe(self.coat_alpha, d, half_way)[0] * self.coat_cosines(d);
            let of_coat = self.coat * mix(COAT_F0, 1.0, f) * lobe;
            sum = sum.map(|c| c + of_coat);
        }
        sum.map(|c| PI * c)
    }

    /// By which [`Self::direction`] draws d, a unit vector.
    pub fn density(&self, d: Vec3) -> f32 {
        if self.alpha == 0.0 || dot(self.normal, d) <= 0.0 {
            return 0.0;
        }
        let half_way = self.half_way(d);
        let of_facets = 1.0 - self.choice - self.sheen_choice();
        let by_facets = of_facets * self.reflects_by(half_way) * self.facet_lobe(d, half_way)[1];
        let mut density = by_facets + self.sheen_choice() / TAU;
        if self.coat > 0.0 {
            density += self.choice * self.coat_frame().lobe(self.coat_alpha, d, half_way)[1];
        }
        density
    }

    /// Share of light of one radiance from everywhere that the surface reflects otherwise than diffusely.
    pub(super) fn around(&self) -> Vec3 {
        let around = self.share.map(|c| c * self.under + self.coat_share);
        let sheen = self.layers.map_or([0.0; 3], |layers| layers.sheen_around());
        each(|k| around[k] + sheen[k])
    }

    /// Share of light of one radiance from everywhere that the surface reflects, or lets through.
    pub fn albedo(&self) -> Vec3 {
        let around = self.around();
        each(|k| self.diffuse[k] + around[k] + self.through[k])
    }

    /// How much of what it reflects it mirrors, 0..=1, and the square of the roughness of that, a mean of its lobes.
    pub fn mirrors(&self) -> [f32; 2] {
        let mean = |c: Vec3| (c[0] + c[1] + c[2]) / 3.0;
        let (facets, all) = (mean(self.share) * self.under, mean(self.albedo()));
        let both = facets + self.coat_share;
        if both <= 0.0 {
            return [0.0, 1.0];
        }
        [least(both / all, 1.0), (facets * self.alpha + self.coat_share * self.coat_alpha) / both]
    }

    /// What the surface reflects otherwise than diffusely of the background, unshadowed, where rays of its own do not
    /// bring it.
    pub fn reflected_ambient(&self, bound: &Bound) -> Vec3 {
        if self.alpha == 0.0 || (bound.has(PARAM_GLOSSY) && !bound.has(PARAM_BOUNCE)) {
            return [0.0; 3];
        }
        let (n, v) = (self.normal, self.view);
        let along = 2.0 * dot(n, v);
        let light = ambient(bound.params, each(|k| along * n[k] - v[k]));
        let around = self.around();
        each(|k| around[k] * light[k])
    }

    /// Of light from around, what diffuse rays stand for: the diffuse part, and the rest where it has no rays of its
    /// own and diffuse rays share nothing with rays to the environment.
    pub fn reflected_by_diffuse_rays(&self, bound: &Bound) -> Vec3 {
        if self.alpha == 0.0 || bound.has(PARAM_GLOSSY) || bound.params.diffuse_count > 0.0 {
            return self.diffuse;
        }
        self.albedo()
    }

    /// A direction drawn by the facets that are seen (Dupuy, Benyoub 2023, "Sampling visible GGX normals with spherical
    /// caps").
    pub fn direction(&self, words: [u32; 4]) -> Drawn {
        let number = unit(words[2]);
        let is_coat = number < self.choice;
        let layers = self.layers.as_ref().filter(|_| !is_coat);
        if let Some(layers) = layers.filter(|layers| number < self.choice + layers.choice) {
            return Drawn { direction: layers.sheen_direction(self.normal, words), is_through: false };
        }
        let alpha = if is_coat { self.coat_alpha } else { self.alpha };
        let stretched = layers.and_then(|layers| layers.stretched(&self.below()));
        let frame = if is_coat { self.coat_frame() } else { self.frame() };
        let (x, alphas) = stretched.unwrap_or_else(|| (tangent(frame.normal), [alpha; 2]));
        let y = cross(frame.normal, x);
        let v = normalize([alphas[0] * dot(self.view, x), alphas[1] * dot(self.view, y), frame.cos_view]);
        let around = TAU * unit(words[0]);
        let down = unit(words[1]);
        // On the cap of heights -v.z to 1.
        let height = 1.0 - down * (1.0 + v[2]);
        let level = most((1.0 - height) * (1.0 + height), 0.0).sqrt();
        let h = [level * around.cos() + v[0], level * around.sin() + v[1], height + v[2]];
        let facet = normalize([alphas[0] * h[0], alphas[1] * h[1], most(h[2], 0.0)]);
        let half_way = each(|k| facet[0] * x[k] + facet[1] * y[k] + facet[2] * frame.normal[k]);
        let cosine = dot(self.view, half_way);
        if self.eta > 0.0 && !is_coat && unit(pcg(words[2])) >= self.reflects_by(half_way) {
            let along = self.eta * cosine - most(self.squared_beyond(cosine), 0.0).sqrt();
            let direction = normalize(each(|k| along * half_way[k] - self.eta * self.view[k]));
            return Drawn { direction, is_through: true };
        }
        let along = 2.0 * cosine;
        Drawn { direction: normalize(each(|k| along * half_way[k] - self.view[k])), is_through: false }
    }

    /// What light from d, a direction through a facet, brings over the density by which it was drawn: what the facet
    /// does not reflect of it, and others do not mask. Radiance grows by the square of the index of refraction; that is
    /// left out.
    pub fn passed(&self, d: Vec3) -> Vec3 {
        let sum: Vec3 = each(|k| d[k] + self.eta * self.view[k]);
        // Of a body like what is around it every facet is one.
        let across = if dot(sum, sum) < 1.0e-12 { self.normal } else { sum };
        let half_way = normalize(if dot(across, self.view) < 0.0 { across.map(|x| -x) } else { across });
        let reflects = self.fresnel(half_way);
        let left = most(1.0 - most3(reflects), 1.0e-6);
        let cosine = most(-dot(self.normal, d), 0.0);
        let squared = self.alpha * self.alpha;
        let stretched = self.layers.as_ref().and_then(|layers| layers.facet_root(&self.below(), d, cosine));
        let root = stretched.unwrap_or_else(|| (squared + (1.0 - squared) * cosine * cosine).sqrt());
        let unmasked = 2.0 * cosine / most(cosine + root, 1.0e-20);
        let of_facets = 1.0 - self.choice - self.sheen_choice();
        each(|k| self.through[k] * (1.0 - reflects[k]) * (unmasked / (left * of_facets)))
    }
}

/// What is left of light that went through the body whose back is hit, so far from where it started, device units.
pub fn left_within(bound: &Bound, g: &GBuffer, m: &Material, way: f32) -> Vec3 {
    let within = GBUFFER_REFRACTS | GBUFFER_BACK;
    if g.state & within != within || m.absorption == 0 {
        return [1.0; 3];
    }
    let scale = bound.params.origin[3] * way;
    unpack_absorption(m.absorption).map(|c| (-scale * c).exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampling::random4;

    const NORMAL: Vec3 = [0.0, 0.0, 1.0];

    fn material(f0: f32, metallic: f32, clearcoat: f32) -> Material {
        Material {
            metallic,
            specular: [f0; 3],
            specular_weight: if f0 > 0.0 { 1.0 } else { 0.0 },
            clearcoat,
            clearcoat_roughness: 0.3,
            ..Material::DIFFUSE
        }
    }

    fn gloss(m: &Material, roughness: f32, cosine: f32) -> Gloss {
        let view = [(1.0 - cosine * cosine).sqrt(), 0.0, cosine];
        let g = GBuffer { albedo: [1.0; 3], normal: NORMAL, metallic: m.metallic, roughness, ..GBuffer::default() };
        Gloss::of(&g, m, view.map(|x| 3.0 * x))
    }

    /// The integral of `f` over the directions of the hemisphere and their cosines, by a grid in f64.
    fn over_hemisphere(rows: u32, columns: u32, f: impl Fn(Vec3, f64) -> f64) -> f64 {
        let mut sum = 0.0;
        for i in 0..rows {
            let c = (f64::from(i) + 0.5) / f64::from(rows);
            for j in 0..columns {
                let phi = f64::from(TAU) * (f64::from(j) + 0.5) / f64::from(columns);
                let level = (1.0 - c * c).sqrt();
                sum += f([level * phi.cos(), level * phi.sin(), c].map(|x| x as f32), c);
            }
        }
        sum * f64::from(TAU) / f64::from(rows * columns)
    }

    /// What the distribution function itself reflects of light from everywhere.
    fn integrated(s: &Gloss) -> f64 {
        over_hemisphere(2000, 300, |d, c| c * f64::from(s.reflected(d)[0]) / f64::from(PI))
    }

    /// White metals, and white dielectrics with and without a clear coat, lose and gain nothing, whatever their
    /// roughness.
    #[test]
    fn energy_is_conserved_for_every_roughness() {
        let materials = [material(0.04, 1.0, 0.0), material(0.04, 0.0, 0.0), material(0.3, 0.5, 0.0)];
        let coated = material(0.04, 0.0, 1.0);
        for roughness in [0.3, 0.4, 0.55, 0.7, 0.85, 1.0] {
            for cosine in [0.15, 0.4, 0.7, 0.95] {
                for m in &materials {
                    let s = gloss(m, roughness, cosine);
                    let (sum, of_table) = (integrated(&s), f64::from(s.around()[0]));
                    assert!((sum - of_table).abs() < 4e-3, "{roughness} {cosine}: {sum} instead of {of_table}");
                    let all = sum + f64::from(s.diffuse[0]);
                    assert!((all - 1.0).abs() < 4e-3, "{roughness} {cosine} {}: {all}", m.metallic);
                }
                let s = gloss(&coated, roughness, cosine);
                let all = integrated(&s) + f64::from(s.diffuse[0]);
                assert!((all - 1.0).abs() < 0.01, "coated {roughness} {cosine}: {all}");
            }
        }
        // Without the light of further bounces a rough metal is far too dark.
        let rough = Gloss { f0: [1.0; 3], f90: [1.0; 3], ..gloss(&materials[0], 1.0, 0.7) };
        assert!(integrated(&rough) < 0.8, "{}", integrated(&rough));
    }

    /// The mean of what is reflected over the density, over drawn directions, is the same sum for the sharpest lobes,
    /// too.
    #[test]
    fn drawn_directions_bring_what_is_reflected() {
        for (m, bound) in [(material(0.04, 1.0, 0.0), 5e-3), (material(0.04, 0.0, 0.7), 5e-3)] {
            for roughness in [0.0, 0.05, 0.2, 0.5, 1.0] {
                for cosine in [0.2, 0.8] {
                    let s = gloss(&m, roughness, cosine);
                    let count = 200_000;
                    let (mut sum, mut below) = (0.0, 0);
                    for i in 0..count {
                        let d = s.direction(random4(i, 1, 2)).direction;
                        let density = s.density(d);
                        if density > 0.0 {
                            sum += f64::from(s.reflected(d)[0] * d[2] / (PI * density));
                        } else {
                            below += 1;
                        }
                    }
                    let (mean, expected) = (sum / f64::from(count), f64::from(s.around()[0]));
                    assert!((mean - expected).abs() < bound, "{roughness} {cosine}: {mean} instead of {expected}");
                    assert!(f64::from(below) < 0.5 * f64::from(count), "{below} directions lead below");
                }
            }
        }
    }

    /// Densities are those of the directions drawn: shares of the hemisphere agree.
    #[test]
    fn directions_are_drawn_by_their_density() {
        let s = gloss(&material(0.04, 0.0, 0.6), 0.6, 0.6);
        let cap = |d: Vec3| d[2] > 0.8 && d[0] < 0.0;
        let count = 400_000;
        let drawn =
            (0..count).filter(|&i| cap(s.direction(random4(i, 5, 9)).direction)).count() as f64 / f64::from(count);
        let expected = over_hemisphere(800, 800, |d, _| if cap(d) { f64::from(s.density(d)) } else { 0.0 });
        assert!((drawn - expected).abs() < 4e-3 && expected > 0.05, "{drawn} instead of {expected}");
    }

    /// What facets that refract reflect and let pass comes to all of it where they are smooth, from both sides, and to
    /// no more where they are rough. Beyond the critical angle all is reflected.
    #[test]
    fn facets_that_refract_gain_nothing() {
        let m = Material { transmission: 1.0, flags: MATERIAL_REFRACTS, ..material(0.04, 0.0, 0.0) };
        for roughness in [0.0, 0.3, 0.7] {
            for back in [0, GBUFFER_BACK] {
                for cosine in [0.2, 0.5, 0.8, 0.95] {
                    let view = [(1.0f32 - cosine * cosine).sqrt(), 0.0, cosine];
                    let state = GBUFFER_REFRACTS | back;
                    let g = GBuffer { albedo: [1.0; 3], normal: NORMAL, roughness, state, ..GBuffer::default() };
                    let s = Gloss::of(&g, &m, view);
                    let (count, mut sum, mut through) = (100_000, 0.0, 0);
                    for i in 0..count {
                        let drawn = s.direction(random4(i, 3, 4));
                        let d = drawn.direction;
                        if drawn.is_through {
                            through += 1;
                            sum += if d[2] < 0.0 { f64::from(s.passed(d)[0]) } else { 0.0 };
                        } else if s.density(d) > 0.0 {
                            sum += f64::from(s.reflected(d)[0] * d[2] / (PI * s.density(d)));
                        }
                    }
                    let mean = sum / f64::from(count);
                    // Facets turned away from the view as far as 0.7 lets them lose a third.
                    let least = if roughness == 0.0 { 0.998 } else { 1.05 - f64::from(roughness) };
                    assert!((least..1.002).contains(&mean), "{roughness} {back} {cosine}: {mean}");
                    // The sine of the critical angle is 1 / 1.5.
                    if roughness == 0.0 && back != 0 && cosine < 0.74 {
                        assert_eq!(through, 0, "{cosine}");
                    }
                }
            }
        }
    }

    #[test]
    fn matt_and_unlit_surfaces_are_diffuse_alone() {
        let s = gloss(&Material::DIFFUSE, 0.5, 0.7);
        assert!(!s.is_glossy() && s.diffuse == [1.0; 3] && s.reflected(NORMAL) == [0.0; 3] && s.density(NORMAL) == 0.0);
        let unlit = Material { flags: MATERIAL_UNLIT, ..material(0.04, 1.0, 1.0) };
        assert!(!gloss(&unlit, 0.5, 0.7).is_glossy());
    }
}
