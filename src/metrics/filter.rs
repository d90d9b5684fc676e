//! Separable convolution of planes with the border repeated.

use rayon::prelude::*;

/// One channel of an image, rows top to bottom.
#[derive(Clone, Debug)]
pub(crate) struct Plane {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) values: Vec<f32>,
}

impl Plane {
    /// A plane of the size of an image.
    pub(crate) fn new(width: usize, height: usize, values: Vec<f32>) -> Self {
        debug_assert!(values.len() == width * height && !values.is_empty());
        Self { width, height, values }
    }

    /// Correlates every row with `kernel`, whose middle tap (of an odd number) lies on the pixel.
    pub(crate) fn along_x(&self, kernel: &[f32]) -> Plane {
        let radius = kernel.len() / 2;
        let width = self.width;
        let mut out = vec![0.0; self.values.len()];
        let padded = || Vec::with_capacity(width + 2 * radius);
        out.par_chunks_mut(width).zip(self.values.par_chunks(width)).for_each_init(padded, |padded, (out, row)| {
            padded.clear();
            padded.extend(std::iter::repeat_n(row[0], radius));
            padded.extend_from_slice(row);
            padded.extend(std::iter::repeat_n(row[width - 1], radius));
            for (tap, &weight) in kernel.iter().enumerate() {
                for (sum, &value) in out.iter_mut().zip(&padded[tap..]) {
                    *sum += weight * value;
                }
            }
        });
        Plane { values: out, ..*self }
    }

    /// Correlates every column with `kernel`, as [`Self::along_x`] does rows.
    pub(crate) fn along_y(&self, kernel: &[f32]) -> Plane {
        let radius = kernel.len() / 2;
        let width = self.width;
        let mut out = vec![0.0; self.values.len()];
        out.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
            for (tap, &weight) in kernel.iter().enumerate() {
                let from = (y + tap).saturating_sub(radius).min(self.height - 1);
                for (sum, &value) in out.iter_mut().zip(&self.values[from * width..][..width]) {
                    *sum += weight * value;
                }
            }
        });
        Plane { values: out, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matches_the_definition() {
        let (width, height) = (5usize, 3usize);
        let plane = Plane::new(width, height, (0..15).map(|i| (i * i % 7) as f32).collect());
        let kernel = [0.5, -1.0, 2.0, 0.25, 4.0];
        let at = |x: i64, y: i64| {
            plane.values[y.clamp(0, height as i64 - 1) as usize * width + x.clamp(0, width as i64 - 1) as usize]
        };
        let (along_x, along_y) = (plane.along_x(&kernel), plane.along_y(&kernel));
        for y in 0..height as i64 {
            for x in 0..width as i64 {
                let taps = || kernel.iter().zip(-2i64..);
                let i = y as usize * width + x as usize;
                assert_eq!(along_x.values[i], taps().map(|(w, d)| w * at(x + d, y)).sum::<f32>());
                assert_eq!(along_y.values[i], taps().map(|(w, d)| w * at(x, y + d)).sum::<f32>());
            }
        }
        assert_ne!(along_x.values, along_y.values);
    }
}
