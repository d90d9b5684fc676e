//! How far pictures are from references, one by one and from frame to frame.

use brickwalk::metrics::{Image, PIXELS_PER_DEGREE, flip_ldr};
use brickwalk::picture::tone_map::ToneMap;

/// What a display shows: radiance times 2^EV through a tone map, cut off at 0 and 1.
#[derive(Clone, Copy)]
pub struct Display {
    pub stops: f64,
    pub tone_map: ToneMap,
    pub size: (u32, u32),
}

/// A shown picture, linear, 0 to 1.
pub type Shown = Vec<[f32; 3]>;

impl Display {
    pub fn show(&self, radiance: &[[f32; 3]]) -> Shown {
        let scale = self.stops.exp2() as f32;
        radiance.iter().map(|c| self.tone_map.apply(c.map(|x| scale * x)).map(|x| x.clamp(0.0, 1.0))).collect()
    }

    fn image(&self, shown: &[[f32; 3]]) -> Image {
        let (width, height) = (self.size.0 as usize, self.size.1 as usize);
        Image::from_fn(width, height, |x, y| shown[y * width + x])
    }

    /// Mean FLIP.
    pub fn flip(&self, shown: &[[f32; 3]], truth: &[[f32; 3]]) -> f64 {
        flip_ldr(&self.image(shown), &self.image(truth), PIXELS_PER_DEGREE).expect("one size").mean()
    }
}

/// Mean squared difference over pixels and channels.
pub fn mse(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    let squares = a.iter().zip(b).flat_map(|(a, b)| (0..3).map(move |k| f64::from(a[k] - b[k]).powi(2)));
    squares.sum::<f64>() / (3 * a.len()) as f64
}

/// Mean absolute difference over channels, per pixel.
pub fn errors(a: &[[f32; 3]], b: &[[f32; 3]]) -> Vec<f64> {
    let of = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).map(|k| f64::from((a[k] - b[k]).abs())).sum::<f64>() / 3.0;
    a.iter().zip(b).map(of).collect()
}

/// Flicker from one frame to the next: the mean over pixels and channels of |(a₁ − a₀) − (b₁ − b₀)|, how far the change
/// of the picture is from the change of the reference.
pub fn flicker([a0, a1]: [&[[f32; 3]]; 2], [b0, b1]: [&[[f32; 3]]; 2]) -> f64 {
    let change = |x: &[[f32; 3]], y: &[[f32; 3]]| -> Vec<[f32; 3]> {
        x.iter().zip(y).map(|(x, y)| [0, 1, 2].map(|k| y[k] - x[k])).collect()
    };
    average(errors(&change(a0, a1), &change(b0, b1)))
}

/// The mean.
pub fn average(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) = values.into_iter().fold((0.0, 0), |(sum, count), x| (sum + x, count + 1));
    sum / f64::from(count.max(1))
}
