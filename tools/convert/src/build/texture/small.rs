//! Small copies of textures of colours, for what stands for textured triangles far away.

use crate::build::disk::journal::{WordReader, Words};
use crate::srgb::linear_of_srgb;
use bricks::{WRAP_CLAMP, WRAP_MIRROR};

/// Texels of a small copy each way, at most.
pub(super) const SMALL_TEXELS: u32 = 64;

/// The first level of a texture that is small enough.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Small {
    /// Width and height in texels.
    pub size: [u32; 2],
    /// `WRAP_*` of s in the low half, of t in the high half.
    pub wrap: u32,
    /// RGBA8, sRGB, rows top to bottom.
    pub rgba: Vec<u8>,
}

impl Small {
    /// The texel at coordinates, linear RGBA.
    pub fn at(&self, uv: [f64; 2]) -> [f32; 4] {
        let [x, y] = [0, 1].map(|k| {
            let size = f64::from(self.size[k]);
            let wrapped = wrapped(uv[k], self.wrap >> (16 * k) & 0xffff);
            // A cast of what is no number gives 0.
            ((wrapped * size) as u32).min(self.size[k] - 1)
        });
        self.texel((y * self.size[0] + x) as usize)
    }

    fn texel(&self, index: usize) -> [f32; 4] {
        let texel = &self.rgba[4 * index..4 * index + 4];
        let [r, g, b] = [0, 1, 2].map(|k| linear_of_srgb(texel[k]));
        [r, g, b, f32::from(texel[3]) / 255.0]
    }

    /// The mean of all texels, each as much as it is opaque, and the mean opacity.
    pub fn opaque_mean(&self) -> [f32; 4] {
        let count = (self.size[0] * self.size[1]) as usize;
        let mut sum = [0.0f64; 4];
        for [r, g, b, a] in (0..count).map(|index| self.texel(index)) {
            for (sum, x) in sum.iter_mut().zip([r * a, g * a, b * a, a]) {
                *sum += f64::from(x);
            }
        }
        let [r, g, b, a] = sum;
        let over = |x: f64| if a > 0.0 { (x / a) as f32 } else { 0.0 };
        [over(r), over(g), over(b), (a / count as f64) as f32]
    }

    /// For the journal.
    pub fn put(&self, words: &mut Words) {
        words.put(self.size[0].into()).put(self.size[1].into()).put(self.wrap.into()).put_records(&self.rgba);
    }

    /// From the journal.
    pub fn take(words: &mut WordReader) -> Option<Self> {
        let [width, height, wrap] = [words.take()?, words.take()?, words.take()?].map(|word| word as u32);
        let small = Self { size: [width, height], wrap, rgba: words.take_records()? };
        (small.rgba.len() as u64 == 4 * u64::from(width) * u64::from(height) && width > 0).then_some(small)
    }
}

/// A coordinate within 0 to 1 as a texture is repeated.
fn wrapped(x: f64, wrap: u32) -> f64 {
    match wrap {
        WRAP_CLAMP => x.clamp(0.0, 1.0),
        WRAP_MIRROR => 1.0 - (x.rem_euclid(2.0) - 1.0).abs(),
        _ => x.rem_euclid(1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bricks::WRAP_REPEAT;

    #[test]
    fn texels_are_found_as_textures_repeat() {
        let rgba = vec![0, 0, 0, 255, 255, 0, 0, 255, 0, 255, 0, 0, 0, 0, 255, 255];
        let small = |wrap: u32| Small { size: [2, 2], wrap: wrap | wrap << 16, rgba: rgba.clone() };
        let [repeat, clamp, mirror] = [WRAP_REPEAT, WRAP_CLAMP, WRAP_MIRROR].map(small);
        let (black, red, blue) = ([0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]);
        assert_eq!([repeat.at([0.1, 0.1]), repeat.at([0.6, 0.2]), repeat.at([-0.3, 3.9])], [black, red, blue]);
        assert_eq!([clamp.at([-7.0, -1.0]), clamp.at([9.0, 0.0]), clamp.at([1.0, 1.0])], [black, red, blue]);
        assert_eq!([mirror.at([-0.1, 0.1]), mirror.at([1.2, 0.0]), mirror.at([1.1, 1.3])], [black, red, blue]);
        assert_eq!(repeat.at([f64::NAN, f64::INFINITY]), black);
        // The green texel is transparent.
        assert_eq!(repeat.opaque_mean(), [1.0 / 3.0, 0.0, 1.0 / 3.0, 0.75]);
        let mut words = Words::default();
        mirror.put(&mut words);
        assert_eq!(Small::take(&mut WordReader(&words.0)), Some(mirror));
        assert_eq!(Small::take(&mut WordReader(&words.0[..3])), None);
    }
}
