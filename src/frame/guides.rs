//! What a frame saw: what guides denoising and anti-aliasing.

use super::Moved;
use crate::kernels::layout::{BATCH_SAMPLES, GBuffer, Hit, NONE, Ray, Surface};
use crate::kernels::shade::gloss::Gloss;
use crate::kernels::{FrameExecutor, View};
use crate::scene::{Camera, Projection};
use crate::schedule::{ExecutorError, Pass};
use bricks::Material;
use glam::{DVec3, Vec3};

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
    /// Share of light from everywhere that it reflects, diffusely and otherwise, linear.
    pub albedo: [f32; 3],
    /// Linear radiance that it shows by itself, as much of it as is in the picture.
    pub emission: [f32; 3],
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
    /// What hits show by themselves and the light of sun and emitters, the mean over the samples.
    pub direct: Vec<[f32; 3]>,
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
    /// What the lamps' passes added, summed over samples.
    direct: Vec<[f64; 3]>,
    samples: u32,
    moved: Moved,
}

/// What the surface of a hit reflects of light from everywhere.
fn albedo(g: &GBuffer, materials: &[Material], ray: &Ray) -> [f32; 3] {
    let of = |material: &Material| Gloss::of(g, material, ray.direction.map(|x| -x)).albedo();
    materials.get(g.material as usize).map_or(g.albedo, of)
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
            direct: Vec::new(),
            samples: 0,
            moved: moved.clone(),
        }
    }

    /// Takes the light of sun and emitters, whose passes for sample `sample` have just ended.
    ///
    /// # Errors
    /// The device's.
    pub fn lamps(&mut self, executor: &mut dyn FrameExecutor, sample: u32) -> Result<(), ExecutorError> {
        let now = executor.read_radiance()?;
        if sample.is_multiple_of(BATCH_SAMPLES) {
            self.before = vec![[0.0; 4]; now.len()];
        }
        self.direct.resize(now.len(), [0.0; 3]);
        for (sum, (now, before)) in self.direct.iter_mut().zip(now.iter().zip(&self.before)) {
            for k in 0..3 {
                sum[k] += f64::from(now[k]) - f64::from(before[k]);
            }
        }
        self.samples += 1;
        Ok(())
    }

    /// Ends sample `sample` of `samples`, seen as `view` says; `materials` are those of the scene.
    ///
    /// # Errors
    /// The device's.
    pub fn sample(
        &mut self,
        executor: &mut dyn FrameExecutor,
        materials: &[Material],
        view: &View,
        (sample, samples): (u32, u32),
    ) -> Result<(), ExecutorError> {
        if sample == 0 {
            self.jitter = [0, 1].map(|k| f64::from(view.params.jitter[k]));
            self.read(executor, materials, view)?;
        }
        if sample + 1 < samples {
            self.before = executor.read_radiance()?;
        }
        Ok(())
    }

    fn read(
        &mut self,
        executor: &mut dyn FrameExecutor,
        materials: &[Material],
        view: &View,
    ) -> Result<(), ExecutorError> {
        let rays: Vec<Ray> = executor.read_rays(Pass::Primary)?;
        let hits: Vec<Hit> = executor.read_hits(Pass::Primary)?;
        let surfaces: Vec<Surface> = executor.read_surfaces(Pass::Primary)?;
        let gbuffer: Vec<GBuffer> = executor.read_gbuffer()?;
        let in_f64 = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
        let all = rays.iter().zip(&hits).zip(surfaces.iter().zip(&gbuffer));
        self.seen = all
            .map(|((ray, hit), (surface, g))| {
                let is_hit = hit.id != NONE;
                let way = in_f64(ray.direction);
                let point = view.frame.origin + view.frame.unit * (in_f64(ray.origin) + f64::from(hit.t) * way);
                let point = if is_hit { point } else { way };
                Seen {
                    point,
                    plane: Vec3::from_array(surface.normal),
                    normal: Vec3::from_array(g.normal),
                    id: hit.id,
                    footprint: if is_hit { self.projection.footprint(point) as f32 } else { 0.0 },
                    albedo: if is_hit { albedo(g, materials, ray) } else { [0.0; 3] },
                    emission: if is_hit { g.emission } else { [0.0; 3] },
                }
            })
            .collect();
        Ok(())
    }

    /// The guides of the frame.
    pub fn finish(self) -> Guides {
        let count = f64::from(self.samples.max(1));
        let direct = self.direct.iter().map(|sum| sum.map(|x| (x / count) as f32)).collect();
        let Self { size, projection, jitter, seen, moved, .. } = self;
        Guides { size, projection, jitter, seen, direct, moved }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
