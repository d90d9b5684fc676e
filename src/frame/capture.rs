//! What every effect of a frame adds to the picture and what its rays hit, to be set beside another rendering of the
//! frame.

use crate::kernels::FrameExecutor;
use crate::kernels::layout::{Hit, NONE};
use crate::schedule::{ExecutorError, Lamp, Pass};

/// The pictures of the effects of one frame.
#[derive(Clone, Debug, Default)]
pub struct Captures {
    /// Radiance summed over the samples of the batch when the pass before ended.
    before: Vec<[f32; 4]>,
    effects: Vec<Capture>,
}

/// What the passes of one effect did.
#[derive(Clone, Debug)]
struct Capture {
    name: &'static str,
    /// What they added to the radiance summed over samples, per pixel.
    radiance: Vec<[f64; 3]>,
    /// Per pixel a digest of what the rays hit, pass by pass: closest hits by their triangles, any hits by whether
    /// there is one.
    hits: Vec<u64>,
}

/// How far an effect's picture is from that of another rendering.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EffectError {
    /// Mean absolute difference over pixels and channels, linear radiance.
    pub mean: f64,
    /// The same over the tile where it is largest.
    pub worst_tile: f64,
    /// Pixels of which a ray hit something else, by triangle for closest hits.
    pub pixels: u64,
}

impl Captures {
    /// Begins a frame.
    pub fn clear(&mut self) {
        self.before.clear();
        self.effects.clear();
    }

    /// Begins a batch of samples, whose radiance is summed from nothing.
    pub fn begin_batch(&mut self) {
        self.before.clear();
    }

    /// Notes what a pass of the effect `name`, which has just ended, did.
    ///
    /// # Errors
    /// The device's.
    pub fn note(&mut self, executor: &mut dyn FrameExecutor, name: &'static str) -> Result<(), ExecutorError> {
        let now = executor.read_radiance()?;
        let of_bounce = name.ends_with("-shadow") || name.ends_with("-environment");
        let pass = match name {
            "primary" => Pass::Primary,
            _ if of_bounce => Pass::BounceShadow(Lamp::Sun),
            _ => Pass::Shadow(Lamp::Sun),
        };
        let any_hit = of_bounce || ["shadow", "environment", "ao"].contains(&name);
        let hits: Vec<Hit> = executor.read_hits(pass)?;
        let index = self.effects.iter().position(|effect| effect.name == name).unwrap_or_else(|| {
            let (radiance, hits) = (vec![[0.0; 3]; now.len()], vec![0; now.len()]);
            self.effects.push(Capture { name, radiance, hits });
            self.effects.len() - 1
        });
        let effect = &mut self.effects[index];
        self.before.resize(now.len(), [0.0; 4]);
        for ((sum, now), before) in effect.radiance.iter_mut().zip(&now).zip(&self.before) {
            for (channel, sum) in sum.iter_mut().enumerate() {
                *sum += f64::from(now[channel]) - f64::from(before[channel]);
            }
        }
        for (digest, hit) in effect.hits.iter_mut().zip(&hits) {
            let what = if any_hit { u32::from(hit.id != NONE) } else { hit.id };
            // A bijection of the digest for every hit: equal digests stay equal by equal hits alone, but for chance.
            *digest = (*digest ^ u64::from(what)).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(29) ^ 0x5851_F42D;
        }
        self.before = now;
        Ok(())
    }

    /// What the passes that `is_of` names added to the mean of `samples`, pixel by pixel; nothing where there were
    /// none.
    pub fn added(&self, is_of: impl Fn(&str) -> bool, samples: u32) -> Vec<[f32; 3]> {
        let mut sum: Vec<[f64; 3]> = Vec::new();
        for effect in self.effects.iter().filter(|effect| is_of(effect.name)) {
            sum.resize(effect.radiance.len(), [0.0; 3]);
            for (sum, own) in sum.as_flattened_mut().iter_mut().zip(effect.radiance.as_flattened()) {
                *sum += own;
            }
        }
        sum.into_iter().map(|rgb| rgb.map(|x| (x / f64::from(samples)) as f32)).collect()
    }

    /// The error of the effect `name` against `exact`, for pictures `width` wide in square tiles of edge `tile`, each
    /// the mean of `samples`. Zero where either lacks the effect.
    pub fn error(&self, exact: &Self, name: &str, width: u32, tile: u32, samples: u32) -> EffectError {
        let find = |captures: &Self| captures.effects.iter().position(|effect| effect.name == name);
        let (Some(a), Some(b)) = (find(self), find(exact)) else { return EffectError::default() };
        let (a, b) = (&self.effects[a], &exact.effects[b]);
        let difference = |(a, b): (&[f64; 3], &[f64; 3])| {
            let channels = a.iter().zip(b).map(|(a, b)| (a - b).abs());
            channels.sum::<f64>() / 3.0 / f64::from(samples)
        };
        let mut tiles = std::collections::BTreeMap::<(u32, u32), (f64, u32)>::new();
        for (pixel, difference) in a.radiance.iter().zip(&b.radiance).map(difference).enumerate() {
            let (x, y) = (pixel as u32 % width, pixel as u32 / width);
            let (sum, count) = tiles.entry((y / tile, x / tile)).or_default();
            *sum += difference;
            *count += 1;
        }
        EffectError {
            mean: tiles.values().map(|(sum, _)| sum).sum::<f64>() / a.radiance.len().max(1) as f64,
            worst_tile: tiles.values().map(|(sum, count)| sum / f64::from(*count)).fold(0.0, f64::max),
            pixels: a.hits.iter().zip(&b.hits).filter(|(a, b)| a != b).count() as u64,
        }
    }
}
