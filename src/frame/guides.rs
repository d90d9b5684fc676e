//! What a frame saw: what guides denoising and anti-aliasing.

use super::Moved;
use crate::kernels::denoise::{LEAST_ALBEDO, difference, mixed, squared};
use crate::kernels::layout::{BATCH_SAMPLES, GBuffer, Hit, NONE, Ray, Surface};
use crate::kernels::shade::gloss::Gloss;
use crate::kernels::{FrameExecutor, View};
use crate::scene::{Camera, Projection};
use crate::schedule::{ExecutorError, Pass};
use bricks::Material;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// What a pixel's first sample saw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// The hit point, world units; on a miss the direction.
    pub point: DVec3,
    /// Geometric unit normal toward the camera.
    pub plane: Vec3,
    /// Unit normal that is shaded.
    pub normal: Vec3,
    /// Triangle, [`NONE`] on a miss.
    pub id: u32,
    /// Width of the pixel at the hit, world units.
    pub footprint: f32,
    /// Share of light from everywhere that it reflects, diffusely and otherwise, linear; of a pixel's samples together
    /// the mean, where those that see something else count as black.
    pub albedo: [f32; 3],
    /// 1 / the angle within which what it mirrors is alike, radians; 0 where it mirrors little.
    pub polish: f32,
}

/// The second surface that samples of a pixel saw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Second {
    /// What the first of these samples saw; the albedo is the mean over all samples of the pixel.
    pub seen: Seen,
    /// The light that it reflects, the mean over the samples.
    pub light: [f32; 3],
}

/// How the light on a pixel's first surface differs from sample to sample of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SampleNoise {
    /// Samples that saw the surface.
    pub samples: u32,
    /// Of the light of sun and emitters and of all other light, divided by the albedo: the mean of the squared
    /// distances from the samples' mean ([`crate::kernels::denoise::squared`]).
    pub spreads: [f32; 2],
}

impl Seen {
    /// Whether a surface was seen.
    pub fn is_hit(&self) -> bool {
        self.id != NONE
    }

    /// Distance of `other` from the plane of this surface in pixels of this one.
    pub fn off_plane(&self, other: &Self) -> f32 {
        let offset = (other.point - self.point).as_vec3();
        offset.dot(self.plane).abs() / self.footprint.max(f32::MIN_POSITIVE)
    }

    /// Whether both show the same surface: the same triangle, or normals within 26 degrees and planes within two
    /// pixels.
    pub fn is_same_surface(&self, other: &Self) -> bool {
        let both = self.is_hit() && other.is_hit();
        both && (self.id == other.id || (self.normal.dot(other.normal) > 0.9 && self.off_plane(other) <= 2.0))
    }
}

/// What a frame saw.
#[derive(Clone, Debug, PartialEq)]
pub struct Guides {
    /// Width and height, pixels.
    pub size: (u32, u32),
    /// The camera's picture.
    pub projection: Projection,
    /// Where in its pixel the first sample lies.
    pub jitter: [f64; 2],
    /// Pixel by pixel.
    pub seen: Vec<Seen>,
    /// The light of sun and emitters on what the first sample saw, the mean over the samples.
    pub direct: Vec<[f32; 3]>,
    /// The rest beside what the first surface reflects of other light, the mean over the samples: what hits show by
    /// themselves, the background, and all light on other surfaces.
    pub around: Vec<[f32; 3]>,
    /// How the light on the first surface differs from sample to sample.
    pub noise: Vec<SampleNoise>,
    /// The second surface, where samples saw another than the first one did.
    pub second: Vec<Option<Second>>,
    /// What has moved since the frame before.
    pub moved: Moved,
}

impl Guides {
    /// A surface where it was in the frame before, if it has moved with its instance.
    pub fn then(&self, seen: &Seen) -> Seen {
        let Some(motion) = self.moved.of_triangle(seen.id).filter(|_| seen.is_hit()) else { return *seen };
        let turned = |n: Vec3| motion.turn(n.as_dvec3()).as_vec3();
        Seen { point: motion.point(seen.point), plane: turned(seen.plane), normal: turned(seen.normal), ..*seen }
    }
}

/// Reads guides from an executor while it renders a frame.
#[derive(Clone, Debug)]
pub struct GuideReader {
    size: (u32, u32),
    projection: Projection,
    jitter: [f64; 2],
    seen: Vec<Seen>,
    /// Radiance summed over the batch before the sample at hand.
    before: Vec<[f32; 4]>,
    /// The same after the lamps' passes.
    lit: Vec<[f32; 4]>,
    sums: Vec<Sums>,
    /// What the first sample saw that saw another surface than the first of all.
    second: Vec<Option<Seen>>,
    moved: Moved,
}

/// Which of its pixel's surfaces a sample sees.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Which {
    /// That of the first sample.
    First,
    /// The other one that is kept.
    Second,
    /// One more, or the background.
    #[default]
    Other,
}

/// What is summed over the samples of a pixel.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    direct: [f64; 3],
    around: [f64; 3],
    /// Of the first and of the second surface.
    albedos: [[f64; 3]; 2],
    /// All light that the second one reflects.
    second: [f64; 3],
    samples: u32,
    /// What the sample at hand sees.
    which: Which,
    /// The albedo there.
    albedo: [f32; 3],
    /// Samples that saw the first surface.
    firsts: u32,
    /// Of the light of lamps on it, and of other light.
    spreads: [Spread; 2],
}

/// Mean of light divided by the albedo, and the sum of the squared distances from it, by Welford's recurrence.
#[derive(Clone, Copy, Debug, Default)]
struct Spread {
    mean: [f32; 3],
    squares: f32,
}

impl Spread {
    /// Takes the light of the sample of this number, from 1, on a surface of this albedo.
    fn push(&mut self, light: [f64; 3], albedo: [f32; 3], number: u32) {
        let light = [0, 1, 2].map(|k| if albedo[k] < LEAST_ALBEDO { 0.0 } else { light[k] as f32 / albedo[k] });
        let share = 1.0 / number as f32;
        let off = difference(light, self.mean);
        self.mean = mixed(self.mean, light, share);
        self.squares += squared(off) * (1.0 - share);
    }
}

impl Sums {
    /// Takes the light that a sample has after the lamps' passes, beside what it saw, and what that shows by itself.
    fn lamps(&mut self, added: [f64; 3], which: Which, seen: &Seen, emission: [f32; 3]) {
        self.samples += 1;
        self.which = which;
        if which == Which::First {
            self.albedo = seen.albedo;
            self.firsts += 1;
            let reflected = [0, 1, 2].map(|k| added[k] - f64::from(emission[k]));
            self.spreads[0].push(reflected, seen.albedo, self.firsts);
        }
        for (k, added) in added.into_iter().enumerate() {
            let [emission, albedo] = [emission[k], seen.albedo[k]].map(f64::from);
            match which {
                Which::First => {
                    self.around[k] += emission;
                    self.direct[k] += added - emission;
                    self.albedos[0][k] += albedo;
                }
                Which::Second => {
                    self.around[k] += added;
                    self.second[k] += added - emission;
                    self.albedos[1][k] += albedo;
                }
                Which::Other => self.around[k] += added,
            }
        }
    }

    /// Takes all other light of the sample.
    fn rest(&mut self, added: [f64; 3]) {
        if self.which == Which::First {
            self.spreads[1].push(added, self.albedo, self.firsts);
        }
        for (k, added) in added.into_iter().enumerate() {
            self.around[k] += if self.which == Which::First { 0.0 } else { added };
            self.second[k] += if self.which == Which::Second { added } else { 0.0 };
        }
    }

    /// How samples differ.
    fn noise(&self) -> SampleNoise {
        let spreads = self.spreads.map(|spread| spread.squares / self.firsts.max(1) as f32);
        SampleNoise { samples: self.firsts, spreads }
    }

    /// A sum's mean over the samples.
    fn mean(&self, sum: [f64; 3]) -> [f32; 3] {
        sum.map(|x| (x / f64::from(self.samples.max(1))) as f32)
    }
}

/// Of a pixel's angle: how far apart a mirror's directions bring much the same light.
const PIXEL: f32 = 0.5;

/// What was added to radiance that is summed.
fn added(now: [f32; 4], before: [f32; 4]) -> [f64; 3] {
    [0, 1, 2].map(|k| f64::from(now[k]) - f64::from(before[k]))
}

/// What the surface of a hit reflects of light from everywhere, and its polish, seen through a pixel of this angle.
///
/// Of a lobe with the square of roughness a, directions that are a / (1 - a) apart bring much the same light; what a
/// pixel covers is blurred as it is. Where the surface reflects diffusely as well, less depends on what it mirrors, so
/// its share counts, squared.
fn reflects(g: &GBuffer, materials: &[Material], ray: &Ray, pixel: f32) -> ([f32; 3], f32) {
    let Some(material) = materials.get(g.material as usize) else { return (g.albedo, 0.0) };
    let gloss = Gloss::of(g, material, ray.direction.map(|x| -x));
    let [share, alpha] = gloss.mirrors();
    (gloss.albedo(), share * share * (1.0 - alpha) / (alpha + PIXEL * pixel))
}

impl GuideReader {
    /// Of a frame of `width` x `height` pixels, before which instances have `moved`.
    pub fn new(camera: &Camera, size: (u32, u32), moved: &Moved) -> Self {
        Self {
            size,
            projection: Projection::new(camera, size),
            jitter: [0.5; 2],
            seen: Vec::new(),
            before: Vec::new(),
            lit: Vec::new(),
            sums: Vec::new(),
            second: Vec::new(),
            moved: moved.clone(),
        }
    }

    /// Takes what sample `sample` saw as `view` says, and the light of sun and emitters, whose passes have just ended;
    /// `materials` are those of the scene.
    ///
    /// # Errors
    /// The device's.
    pub fn lamps(
        &mut self,
        executor: &mut dyn FrameExecutor,
        materials: &[Material],
        view: &View,
        sample: u32,
    ) -> Result<(), ExecutorError> {
        self.lit = executor.read_radiance()?;
        if sample.is_multiple_of(BATCH_SAMPLES) {
            self.before = vec![[0.0; 4]; self.lit.len()];
        }
        let seen = self.read(executor, materials, view)?;
        if sample == 0 {
            self.jitter = [0, 1].map(|k| f64::from(view.params.jitter[k]));
            self.seen = seen.iter().map(|(seen, _)| *seen).collect();
            self.sums = vec![Sums::default(); seen.len()];
            self.second = vec![None; seen.len()];
        }
        let light = self.lit.par_iter().zip(&self.before);
        let surfaces = self.seen.par_iter().zip(&mut self.second);
        let pixels = self.sums.par_iter_mut().zip(surfaces).zip(light.zip(&seen)).with_min_len(1024);
        pixels.for_each(|((sums, (first, second)), ((&lit, &before), (seen, emission)))| {
            // Pixels that have stopped take no sample.
            if lit[3] > before[3] {
                let which = match seen {
                    seen if first.is_same_surface(seen) => Which::First,
                    seen if !seen.is_hit() => Which::Other,
                    seen if second.get_or_insert(*seen).is_same_surface(seen) => Which::Second,
                    _ => Which::Other,
                };
                sums.lamps(added(lit, before), which, seen, *emission);
            }
        });
        Ok(())
    }

    /// Ends a sample.
    ///
    /// # Errors
    /// The device's.
    pub fn sample(&mut self, executor: &mut dyn FrameExecutor) -> Result<(), ExecutorError> {
        let before = std::mem::replace(&mut self.before, executor.read_radiance()?);
        let light = self.before.par_iter().zip(&self.lit);
        let pixels = self.sums.par_iter_mut().zip(light.zip(&before)).with_min_len(1024);
        pixels.for_each(|(sums, ((&now, &lit), before))| {
            if lit[3] > before[3] {
                sums.rest(added(now, lit));
            }
        });
        Ok(())
    }

    /// What the pixels of the sample at hand see, and the radiance that they show by themselves.
    fn read(
        &self,
        executor: &mut dyn FrameExecutor,
        materials: &[Material],
        view: &View,
    ) -> Result<Vec<(Seen, [f32; 3])>, ExecutorError> {
        let rays: Vec<Ray> = executor.read_rays(Pass::Primary)?;
        let hits: Vec<Hit> = executor.read_hits(Pass::Primary)?;
        let surfaces: Vec<Surface> = executor.read_surfaces(Pass::Primary)?;
        let gbuffer: Vec<GBuffer> = executor.read_gbuffer()?;
        let in_f64 = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
        let all = rays.par_iter().zip(&hits).zip(surfaces.par_iter().zip(&gbuffer)).with_min_len(1024);
        let all = all
            .map(|((ray, hit), (surface, g))| {
                let is_hit = hit.id != NONE;
                let way = in_f64(ray.direction);
                let point = view.frame.origin + view.frame.unit * (in_f64(ray.origin) + f64::from(hit.t) * way);
                let point = if is_hit { point } else { way };
                let footprint = if is_hit { self.projection.footprint(point) as f32 } else { 0.0 };
                let distance = (point - self.projection.position()).length().max(f64::MIN_POSITIVE) as f32;
                let pixel = footprint / distance;
                let (albedo, polish) = if is_hit { reflects(g, materials, ray, pixel) } else { ([0.0; 3], 0.0) };
                let seen = Seen {
                    point,
                    plane: Vec3::from_array(surface.normal),
                    normal: Vec3::from_array(g.normal),
                    id: hit.id,
                    footprint,
                    albedo,
                    polish,
                };
                (seen, if is_hit { g.emission } else { [0.0; 3] })
            })
            .collect();
        Ok(all)
    }

    /// The guides of the frame.
    pub fn finish(self) -> Guides {
        let Self { size, projection, jitter, mut seen, second, sums, moved, .. } = self;
        seen.iter_mut().zip(&sums).for_each(|(seen, sums)| seen.albedo = sums.mean(sums.albedos[0]));
        let [direct, around] = [|sums: &Sums| sums.mean(sums.direct), |sums: &Sums| sums.mean(sums.around)]
            .map(|of| sums.iter().map(of).collect());
        let noise = sums.iter().map(Sums::noise).collect();
        let second = second.iter().zip(&sums).map(|(second, sums)| {
            let of = |seen: &Seen| Seen { albedo: sums.mean(sums.albedos[1]), ..*seen };
            second.as_ref().map(|seen| Second { seen: of(seen), light: sums.mean(sums.second) })
        });
        Guides { size, projection, jitter, seen, direct, around, noise, second: second.collect(), moved }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn albedo(g: &GBuffer, materials: &[Material], ray: &Ray) -> [f32; 3] {
        reflects(g, materials, ray, 0.001).0
    }

    /// Light is divided by all that a surface reflects: a dye that is black in a channel still shines by its surface,
    /// and light there divided by the base colour alone would be far too bright for its neighbours.
    #[test]
    fn albedos_have_what_is_reflected_otherwise_than_diffusely() {
        let ray = Ray { direction: [0.6, 0.0, -0.8], ..Ray::default() };
        let g = |metallic| GBuffer {
            albedo: [0.0, 0.25, 1.0],
            normal: [0.0, 0.0, 1.0],
            roughness: 0.5,
            metallic,
            ..GBuffer::default()
        };
        let glossy = Material { specular: [0.04; 3], specular_weight: 1.0, ..Material::DIFFUSE };
        assert_eq!(albedo(&g(0.0), &[Material::DIFFUSE], &ray), [0.0, 0.25, 1.0]);
        let [black, grey, white] = albedo(&g(0.0), &[glossy], &ray);
        assert!((0.03..0.08).contains(&black), "{black}");
        assert!((0.26..0.32).contains(&grey), "{grey}");
        assert!((white - 1.0).abs() < 0.005, "{white}");
        let metal = albedo(&g(1.0), &[glossy], &ray);
        assert!(metal[0] < 0.04 && (metal[1] - 0.25).abs() < 0.05 && (metal[2] - 1.0).abs() < 0.005, "{metal:?}");
    }
}
