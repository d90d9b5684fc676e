//! Which rays pass through a triangle: twin of `shaders/trace/opacity.wgsl`.

use super::leaf::{BrickRay, Draw};
use super::node::FramedRay;
use crate::kernels::layout::{NONE, Opacity};
use crate::kernels::payloads::OpacityView;
use crate::math::exact::{TriangleHit, barrier, divide};
use crate::math::sampling::pcg;
use bricks::{WRAP_CLAMP, WRAP_MIRROR};

const ALPHA_ONE: f32 = 65_025.0;

fn wrapped(x: i32, size: i32, mode: u32) -> i32 {
    match mode {
        WRAP_CLAMP => x.clamp(0, size - 1),
        WRAP_MIRROR => {
            let m = x.rem_euclid(2 * size);
            if m >= size { 2 * size - 1 - m } else { m }
        }
        _ => x.rem_euclid(size),
    }
}

fn coordinate(x: f32, size: u32, mode: u32) -> f32 {
    let turned = if mode == WRAP_CLAMP { x } else { barrier(x - barrier(2.0 * barrier(0.5 * x).floor())) };
    barrier(barrier(turned.clamp(-4.0, 4.0) * size as f32) - 0.5)
}

fn mix(a: f32, b: f32, t: f32) -> f32 {
    barrier(a + barrier(t * barrier(b - a)))
}

fn weighted_sum(weights: [f32; 3], [a, b, c]: [f32; 3]) -> f32 {
    barrier(barrier(barrier(weights[0] * a) + barrier(weights[1] * b)) + barrier(weights[2] * c))
}

fn drawn(draw: Draw, ray: &FramedRay, id: u32) -> f32 {
    let start = pcg(id ^ pcg(draw.stream ^ pcg(draw.seed)));
    let words = ray.origin.iter().chain(&ray.direction).map(|x| x.to_bits());
    let bits = words.fold(start, |bits, word| pcg(bits ^ word));
    (bits >> 8) as f32 / (1u32 << 24) as f32
}

impl OpacityView<'_> {
    fn texel(&self, m: &Opacity, x: i32, y: i32) -> f32 {
        let row = wrapped(y, m.height as i32, m.wrap >> 16) as u32;
        let at = row * m.width + wrapped(x, m.width as i32, m.wrap & 0xffff) as u32;
        let word = self.table[(m.texels + (at >> 4)) as usize][(at >> 2 & 3) as usize];
        (word >> (8 * (at & 3)) & 255) as f32
    }

    fn lookup(&self, m: &Opacity, u: f32, v: f32) -> f32 {
        let x = coordinate(u, m.width, m.wrap & 0xffff);
        let y = coordinate(v, m.height, m.wrap >> 16);
        let (i, j) = (x.floor() as i32, y.floor() as i32);
        let (s, t) = (barrier(x - x.floor()), barrier(y - y.floor()));
        let low = mix(self.texel(m, i, j), self.texel(m, i + 1, j), s);
        let high = mix(self.texel(m, i, j + 1), self.texel(m, i + 1, j + 1), s);
        mix(low, high, t)
    }
}

impl OpacityView<'_> {
    /// Whether a ray passes through a triangle of the brick that it meets where `weights` says; `refracts`: bodies that
    /// refract stop it. `drawn` is asked where that is left to chance.
    #[inline(always)]
    pub fn passes(&self, triangle: u32, weights: [f32; 3], refracts: bool, drawn: impl FnOnce() -> f32) -> bool {
        let number = self.of[triangle as usize];
        if number == NONE {
            return false;
        }
        let opacity = &self.triangles[number as usize];
        let at = 2 * opacity.material as usize;
        let m: Opacity = bytemuck::cast([self.table[at], self.table[at + 1]]);
        if m.blends & 2 != 0 && refracts {
            return false;
        }
        let alphas = [0, 8, 16].map(|shift| (opacity.alphas >> shift & 255) as f32);
        let mut alpha = barrier(m.factor * weighted_sum(weights, alphas));
        if m.texels == NONE {
            alpha = barrier(255.0 * alpha);
        } else {
            let [u, v] = [0, 1].map(|k| weighted_sum(weights, opacity.uv.map(|uv| uv[k])));
            alpha = barrier(alpha * self.lookup(&m, u, v));
        }
        if m.blends & 1 != 0 {
            return alpha <= barrier(ALPHA_ONE * drawn());
        }
        barrier(alpha + 0.5) < barrier(ALPHA_ONE * m.cutoff)
    }
}

impl BrickRay<'_> {
    /// Whether the ray passes through a triangle of the brick that it meets at `h`.
    #[inline(always)]
    pub fn passes(&self, triangle: u32, id: u32, h: &TriangleHit) -> bool {
        !self.brick.opacity.of.is_empty() && self.passes_by_alpha(triangle, id, h)
    }

    fn passes_by_alpha(&self, triangle: u32, id: u32, h: &TriangleHit) -> bool {
        let weights = [divide(h.u, h.det), divide(h.v, h.det), divide(h.w, h.det)];
        let drawn = || drawn(self.draw, &self.ray, id);
        self.brick.opacity.passes(triangle, weights, self.draw.refracts, drawn)
    }
}
