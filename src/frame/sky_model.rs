//! A clear sky: Hillaire, "A Scalable and Production Ready Sky and Atmosphere Rendering Technique" (EGSR 2020).
//!
//! Rayleigh and Mie scattering and the absorption of ozone, with the constants of its table 1. Light that is scattered
//! once is summed along rays; all further orders by its equation 10, which takes them to be isotropic (section 5.5). We
//! compute in f64 on the host, once, into an image of all directions; the ground below is Lambertian and lit by sun and
//! sky. Without the sun's disc, which is a lamp of its own. Radiance is relative to a sun of irradiance 1 in all
//! channels outside of the atmosphere.

use super::environment::Equirectangular;
use rayon::prelude::*;
use std::f64::consts::PI;
use std::sync::OnceLock;

/// Radius of the ground and of the top of the atmosphere, km.
const GROUND: f64 = 6360.0;
const TOP: f64 = 6460.0;
/// Scattering of air at the ground, 1/km; it halves every 5.5 km.
const RAYLEIGH: Color = [5.802e-3, 13.558e-3, 33.1e-3];
const RAYLEIGH_HEIGHT: f64 = 8.0;
/// Scattering and absorption of aerosols at the ground, 1/km.
const MIE: f64 = 3.996e-3;
const MIE_ABSORPTION: f64 = 4.40e-3;
const MIE_HEIGHT: f64 = 1.2;
/// Asymmetry of scattering by aerosols.
const MIE_G: f64 = 0.8;
/// Absorption of ozone, 1/km, at its most: 25 km above the ground, with none 15 km below and above that.
const OZONE: Color = [0.650e-3, 1.881e-3, 0.085e-3];
/// What the ground reflects: dry grass and stone.
const ALBEDO: Color = [0.24, 0.22, 0.18];
/// Height of the viewer, km.
const VIEWER: f64 = 0.2;
/// Steps of a ray; of the rays that the tables are made of.
const STEPS: u32 = 32;
const TABLE_STEPS: u32 = 20;

type Color = [f64; 3];

fn map(f: impl Fn(usize) -> f64) -> Color {
    [f(0), f(1), f(2)]
}

/// What air does to light at a height above the ground, 1/km.
struct Medium {
    rayleigh: Color,
    mie: f64,
    extinction: Color,
}

impl Medium {
    fn at(height: f64) -> Self {
        let (air, haze) = ((-height / RAYLEIGH_HEIGHT).exp(), (-height / MIE_HEIGHT).exp());
        let ozone = (1.0 - (height - 25.0).abs() / 15.0).max(0.0);
        Self {
            rayleigh: RAYLEIGH.map(|c| c * air),
            mie: MIE * haze,
            extinction: map(|k| RAYLEIGH[k] * air + (MIE + MIE_ABSORPTION) * haze + OZONE[k] * ozone),
        }
    }
}

/// Distance from radius `r`, in the direction whose cosine with the vertical is `mu`, to the ground or the top, and
/// whether it is the ground.
fn end(r: f64, mu: f64) -> (f64, bool) {
    let below = r * r * (mu * mu - 1.0) + GROUND * GROUND;
    if mu < 0.0 && below >= 0.0 {
        return ((-r * mu - below.sqrt()).max(0.0), true);
    }
    let above = (r * r * (mu * mu - 1.0) + TOP * TOP).max(0.0);
    ((-r * mu + above.sqrt()).max(0.0), false)
}

/// Values over the height and the cosine of the sun's zenith, between them bilinearly.
struct Table {
    columns: usize,
    rows: usize,
    values: Vec<Color>,
}

impl Table {
    /// The cosine of a column; finer around the horizon.
    fn cosine(column: usize, columns: usize) -> f64 {
        let x = 2.0 * column as f64 / (columns - 1) as f64 - 1.0;
        x * x.abs()
    }

    /// The radius of a row; finer near the ground.
    fn radius(row: usize, rows: usize) -> f64 {
        let y = row as f64 / (rows - 1) as f64;
        GROUND + (TOP - GROUND) * y * y
    }

    fn new(columns: usize, rows: usize, value: impl Fn(f64, f64) -> Color + Sync) -> Self {
        let at = |i: usize| value(Self::radius(i / columns, rows), Self::cosine(i % columns, columns));
        Self { columns, rows, values: (0..columns * rows).into_par_iter().map(at).collect() }
    }

    fn get(&self, r: f64, mu: f64) -> Color {
        let x = (0.5 + 0.5 * mu.signum() * mu.abs().sqrt()) * (self.columns - 1) as f64;
        let y = ((r - GROUND) / (TOP - GROUND)).clamp(0.0, 1.0).sqrt() * (self.rows - 1) as f64;
        let (column, row) = ((x as usize).min(self.columns - 2), (y as usize).min(self.rows - 2));
        let (u, v) = (x - column as f64, y - row as f64);
        let at = |x: usize, y: usize| &self.values[(row + y) * self.columns + column + x];
        let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
        map(|k| mix(mix(at(0, 0)[k], at(1, 0)[k], u), mix(at(0, 1)[k], at(1, 1)[k], u), v))
    }
}

/// A sky, for any sun.
pub struct SkyModel {
    /// What of the sun's light arrives.
    transmittance: Table,
    /// Light that was scattered more than once, for a sun of irradiance 1.
    multiple: Table,
}

/// What a ray gathers.
struct Gathered {
    light: Color,
    /// Of light that is scattered evenly everywhere: for [`SkyModel::multiple`].
    even: Color,
    transmittance: Color,
    reaches_ground: bool,
    /// Where it ends: cosine of the sun's zenith there.
    sun_at_end: f64,
}

fn rayleigh_phase(c: f64) -> f64 {
    3.0 / (16.0 * PI) * (1.0 + c * c)
}

/// Cornette and Shanks 1992.
fn mie_phase(c: f64) -> f64 {
    let g = MIE_G;
    let scale = 3.0 / (8.0 * PI) * (1.0 - g * g) / (2.0 + g * g);
    scale * (1.0 + c * c) / (1.0 + g * g - 2.0 * g * c).powf(1.5)
}

impl SkyModel {
    /// The model, computed once a process.
    pub fn shared() -> &'static Self {
        static MODEL: OnceLock<SkyModel> = OnceLock::new();
        MODEL.get_or_init(Self::computed)
    }

    /// Computes the tables.
    fn computed() -> Self {
        let transmittance = Table::new(256, 64, |r, mu| {
            let (length, reaches_ground) = end(r, mu);
            if reaches_ground {
                return [0.0; 3];
            }
            let mut depth = [0.0; 3];
            for step in 0..40 {
                let t = length * (f64::from(step) + 0.5) / 40.0;
                let height = (r * r + t * t + 2.0 * r * t * mu).sqrt() - GROUND;
                let extinction = Medium::at(height.max(0.0)).extinction;
                (0..3).for_each(|k| depth[k] += extinction[k] * length / 40.0);
            }
            depth.map(|d| (-d).exp())
        });
        let mut model = Self { transmittance, multiple: Table { columns: 2, rows: 2, values: vec![[0.0; 3]; 4] } };
        let multiple = Table::new(32, 32, |r, sun| model.scattered_again(r.clamp(GROUND + 1e-3, TOP - 1e-3), sun));
        model.multiple = multiple;
        model
    }

    /// Equations 5 to 10: what is scattered twice, and of every order what the next has.
    fn scattered_again(&self, r: f64, sun: f64) -> Color {
        const SIDE: u32 = 8;
        let (mut second, mut share) = ([0.0; 3], [0.0; 3]);
        for i in 0..SIDE * SIDE {
            let mu = 1.0 - 2.0 * (f64::from(i / SIDE) + 0.5) / f64::from(SIDE);
            let azimuth = 2.0 * PI * (f64::from(i % SIDE) + 0.5) / f64::from(SIDE);
            let along = mu * sun + (1.0 - mu * mu).sqrt() * (1.0 - sun * sun).max(0.0).sqrt() * azimuth.cos();
            let ray = self.gather(r, mu, sun, along, TABLE_STEPS, |_| 1.0 / (4.0 * PI), |_| 1.0 / (4.0 * PI));
            let ground = self.ground(&ray, 1.0, [0.0; 3]);
            for k in 0..3 {
                second[k] += (ray.light[k] + ground[k]) / f64::from(SIDE * SIDE);
                share[k] += ray.even[k] / f64::from(SIDE * SIDE);
            }
        }
        map(|k| second[k] / (1.0 - share[k]))
    }

    /// What the ground at the end of a ray sends along it, lit by a sun of this irradiance outside of the atmosphere
    /// and by a sky of this irradiance.
    fn ground(&self, ray: &Gathered, sun_irradiance: f64, sky: Color) -> Color {
        if !ray.reaches_ground {
            return [0.0; 3];
        }
        let sun = self.transmittance.get(GROUND, ray.sun_at_end);
        let cosine = ray.sun_at_end.max(0.0);
        map(|k| ray.transmittance[k] * ALBEDO[k] / PI * (sun_irradiance * sun[k] * cosine + sky[k]))
    }

    /// Light scattered once along a ray from radius `r`, and, as the table has it by now, more often. `mu` and `sun`
    /// are cosines with the vertical, `along` is that between ray and sun.
    #[expect(clippy::too_many_arguments, reason = "numbers of one formula")]
    fn gather(
        &self,
        r: f64,
        mu: f64,
        sun: f64,
        along: f64,
        steps: u32,
        rayleigh: impl Fn(f64) -> f64,
        mie: impl Fn(f64) -> f64,
    ) -> Gathered {
        let (length, reaches_ground) = end(r, mu);
        let (rayleigh, mie) = (rayleigh(along), mie(along));
        let mut out = Gathered {
            light: [0.0; 3],
            even: [0.0; 3],
            transmittance: [1.0; 3],
            reaches_ground,
            sun_at_end: ((r * sun + length * along) / GROUND).clamp(-1.0, 1.0),
        };
        // Steps grow with the square of the distance.
        let place = |step: u32| length * (f64::from(step) / f64::from(steps)).powi(2);
        for step in 0..steps {
            let (near, far) = (place(step), place(step + 1));
            let t = 0.5 * (near + far);
            let here = (r * r + t * t + 2.0 * r * t * mu).sqrt().clamp(GROUND, TOP);
            let sun_here = ((r * sun + t * along) / here).clamp(-1.0, 1.0);
            let medium = Medium::at(here - GROUND);
            let arriving = self.transmittance.get(here, sun_here);
            let again = self.multiple.get(here, sun_here);
            for k in 0..3 {
                let passes = (-medium.extinction[k] * (far - near)).exp();
                let scattering = medium.rayleigh[k] + medium.mie;
                let source = arriving[k] * (medium.rayleigh[k] * rayleigh + medium.mie * mie) + again[k] * scattering;
                // The integral of a source that is constant over the step (section 5.3).
                let over = out.transmittance[k] * (1.0 - passes) / medium.extinction[k];
                out.light[k] += source * over;
                out.even[k] += scattering * over;
                out.transmittance[k] *= passes;
            }
        }
        out
    }

    /// What arrives of a sun whose zenith has this cosine.
    pub fn sun(&self, cosine: f64) -> Color {
        self.transmittance.get(GROUND + VIEWER, cosine)
    }

    /// The sky, `sky_scale` times as bright, and the ground, which this sky and a sun of `sun_irradiance` outside of
    /// the atmosphere light; the sun is at a unit direction, +Y is up. Where both scales are the same, this is the
    /// model's.
    pub fn image(
        &self,
        sun: [f64; 3],
        [sun_irradiance, sky_scale]: [f64; 2],
        [width, height]: [u32; 2],
    ) -> Equirectangular {
        let r = GROUND + VIEWER;
        let trace = |v: f64, u: f64| {
            let (level, mu) = (PI * v).sin_cos();
            let (sin, cos) = (2.0 * PI * (u - 0.5)).sin_cos();
            let along = (level * sin * sun[0] + mu * sun[1] - level * cos * sun[2]).clamp(-1.0, 1.0);
            self.gather(r, mu, sun[1], along, STEPS, rayleigh_phase, mie_phase)
        };
        let rays: Vec<Gathered> = (0..width * height)
            .into_par_iter()
            .map(|i| {
                trace((f64::from(i / width) + 0.5) / f64::from(height), (f64::from(i % width) + 0.5) / f64::from(width))
            })
            .collect();
        // The sky's irradiance, for the ground.
        let mut sky = [0.0; 3];
        for (row, rays) in (0..).zip(rays.chunks(width as usize)) {
            let down = |row: u32| (PI * f64::from(row) / f64::from(height)).min(PI / 2.0).sin().powi(2);
            let weight = PI * (down(row + 1) - down(row)) / f64::from(width);
            rays.iter().for_each(|ray| (0..3).for_each(|k| sky[k] += weight * sky_scale * ray.light[k]));
        }
        let texel = |ray: &Gathered| {
            let ground = self.ground(ray, sun_irradiance, sky);
            map(|k| sky_scale * ray.light[k] + ground[k]).map(|c| c as f32)
        };
        Equirectangular { width, height, texels: rays.iter().map(texel).collect() }
    }

    /// The irradiance of the upper half of an image of [`SkyModel::image`] on the ground.
    pub fn irradiance(image: &Equirectangular) -> Color {
        let down = |row: u32| (PI * f64::from(row) / f64::from(image.height)).min(PI / 2.0).sin().powi(2);
        let mut sum = [0.0; 3];
        for (row, texels) in (0..).zip(image.texels.chunks(image.width as usize)) {
            let weight = PI * (down(row + 1) - down(row)) / f64::from(image.width);
            texels.iter().for_each(|texel| (0..3).for_each(|k| sum[k] += weight * f64::from(texel[k])));
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phase_functions_sum_to_one() {
        for phase in [rayleigh_phase as fn(f64) -> f64, mie_phase] {
            let n = 100_000;
            let sum: f64 = (0..n).map(|i| phase(2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0)).sum();
            assert!((sum * 4.0 * PI / f64::from(n) - 1.0).abs() < 1e-6, "{sum}");
        }
    }

    /// Looking down one sees what the ground reflects of the light that there is, and no more.
    #[test]
    fn the_ground_shows_the_light_that_falls_on_it() {
        let (model, sun) = (SkyModel::computed(), [0.0, 0.8, -0.6]);
        for scales in [[1.0, 1.0], [2.0, 5.0], [0.0, 1.0], [3.0, 0.0]] {
            let image = model.image(sun, scales, [16, 256]);
            let sky = SkyModel::irradiance(&image);
            let direct = model.sun(sun[1]);
            let below = image.texels[255 * 16 + 7];
            for k in 0..3 {
                let reflected = ALBEDO[k] / PI * (scales[0] * direct[k] * sun[1] + sky[k]);
                // Through 200 m of air, which takes a little and adds a little.
                let seen = f64::from(below[k]);
                assert!(
                    (0.9 * reflected..1.2 * reflected + 1e-4 * scales[1]).contains(&seen),
                    "{scales:?}: {seen} {reflected}"
                );
            }
            // At the horizon the air hides where the ground ends.
            let [above, under] = [127, 128].map(|row| f64::from(image.texels[row * 16][1]));
            assert!(scales[1] == 0.0 || (0.5..2.0).contains(&(under / above)), "{scales:?}: {above} {under}");
        }
    }

    #[test]
    fn the_sky_is_blue_by_day_red_at_dusk_and_finite_at_night() {
        let model = SkyModel::computed();
        let at = |elevation: f64| {
            let (up, level) = elevation.to_radians().sin_cos();
            model.image([0.0, up, -level], [1.0; 2], [64, 32])
        };
        // Known by measurement: of a clear day's light at the ground a tenth to a fifth is the sky's.
        let (noon, sun) = (at(60.0), model.sun(60f64.to_radians().sin()));
        let sky = SkyModel::irradiance(&noon);
        let share = sky[1] / (sky[1] + sun[1] * 60f64.to_radians().sin());
        assert!((0.05..0.25).contains(&share), "{share}");
        assert!(sky[2] > 1.5 * sky[0], "{sky:?}");
        assert!(sun[0] > sun[1] && sun[1] > sun[2] && sun[2] > 0.5, "{sun:?}");
        let (dusk, low) = (at(1.0), model.sun(1f64.to_radians().sin()));
        assert!(low[0] > 5.0 * low[2], "{low:?}");
        // Toward the sun redder than away from it.
        let color = |image: &Equirectangular, u: u32| image.texels[(15 * 64 + u) as usize];
        let ratio = |c: [f32; 3]| c[0] / c[2];
        assert!(ratio(color(&dusk, 32)) > 2.0 * ratio(color(&dusk, 0)), "{:?}", color(&dusk, 32));
        let mut before = f64::INFINITY;
        for elevation in [60.0, 20.0, 1.0, -5.0, -30.0, -90.0] {
            let image = at(elevation);
            assert!(image.texels.iter().flatten().all(|c| c.is_finite() && *c >= 0.0), "{elevation}");
            let light = SkyModel::irradiance(&image)[1];
            assert!(light < before, "{elevation}: {light}");
            before = light;
        }
        assert!(before < 1e-6, "{before}");
        // Light of all orders is more than light of one.
        let once =
            SkyModel { multiple: Table { columns: 2, rows: 2, values: vec![[0.0; 3]; 4] }, ..SkyModel::computed() };
        let single = SkyModel::irradiance(&once.image([0.0, 0.5, -0.866], [1.0; 2], [64, 32]))[2];
        let all = SkyModel::irradiance(&model.image([0.0, 0.5, -0.866], [1.0; 2], [64, 32]))[2];
        assert!((1.05..2.5).contains(&(all / single)), "{}", all / single);
    }
}
