//! The fixed cases of the probe.

use crate::math::random::Rng;
use std::fmt;

/// Four numbers for the kernel `arithmetic`.
pub struct ArithmeticCase {
    /// Bits of a, b, c, d.
    pub words: [u32; 4],
    /// fl(a b) = fl(c d), though a b and c d differ: only a fused operation sees that.
    pub cancels: bool,
}

impl fmt::Debug for ArithmeticCase {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{:08x?}", self.words)
    }
}

/// A triangle and a ray in one frame, for the kernel `triangles`.
#[derive(Debug)]
pub struct TriangleCase {
    /// a, b, c.
    pub vertices: [[f32; 3]; 3],
    /// Origin of the ray.
    pub origin: [f32; 3],
    /// Its direction, not normalised.
    pub direction: [f32; 3],
    /// Least parameter.
    pub t_min: f32,
}

impl TriangleCase {
    /// The 16 words of the kernel's input.
    pub fn words(&self) -> [u32; 16] {
        let [a, b, c] = self.vertices;
        let mut words = [self.t_min.to_bits(); 16];
        for (word, x) in words.iter_mut().zip([a, b, c, self.origin, self.direction].as_flattened()) {
            *word = x.to_bits();
        }
        words
    }
}

/// 2,048 random cases, a third of them with products that cancel when rounded, then special values.
pub fn arithmetic() -> Vec<ArithmeticCase> {
    let mut rng = Rng(1);
    let mut cases = Vec::new();
    let mut push = |x: [f32; 4], cancels: bool| cases.push(ArithmeticCase { words: x.map(f32::to_bits), cancels });
    for i in 0..2048 {
        let (a, b) = (rng.float(-40, 40), rng.float(-40, 40));
        let near = |x: f32, r: &mut Rng| f32::from_bits(x.to_bits() + r.below(9) as u32 - 4);
        match i % 3 {
            0 => {
                let c = near(a, &mut rng);
                let d = a * b / c;
                let cancels = a * b == c * d && f64::from(a) * f64::from(b) != f64::from(c) * f64::from(d);
                push([a, b, c, d], cancels);
            }
            1 => push([a, near(a, &mut rng), near(b, &mut rng), b], false),
            _ => push([a, b, rng.float(-40, 40), rng.float(-40, 40)], false),
        }
    }
    let ends = [0.0, -0.0, 1.0, -1.0, f32::MAX, f32::MIN_POSITIVE, 16_777_216.0, 3.0, 1e-30, 1e30];
    for a in ends {
        for b in ends {
            push([a, b, b, a], false);
            push([a, b, 1e-30, 1e-30], false);
        }
    }
    for nan in [0x7fc0_0000, 0x7f80_0001, 0xffc1_2345, 0x7fff_ffff] {
        push([f32::from_bits(nan), 1.0, 1.0, 1.0], false);
    }
    cases
}

/// A needle in a plane that holds the ray, with hardly any extent in y: t is ill-conditioned and the slab must hold it.
fn needle(rng: &mut Rng) -> TriangleCase {
    let direction = [1.0, 0.6 + 0.3 * rng.signed(), 0.5 + 0.4 * rng.signed()];
    let (x, long, thin, slope) = (20.0, 3.0 + 2.0 * rng.signed(), 0.001 * (1.0 + rng.signed()), rng.signed());
    let mut point = |s: f32, t: f32| {
        let noise = 1e-6 * rng.signed();
        [t + s, direction[1] * t, direction[2] * t + slope * s + noise]
    };
    let vertices = [point(-long, x), point(long, x), point(0.7 * long, x + thin)];
    TriangleCase { vertices, origin: [0.0; 3], direction, t_min: 0.0 }
}

/// 2,048 triangles: rays through the inside, through a vertex, through an edge and past it, along axes; needles.
pub fn triangles() -> Vec<TriangleCase> {
    let mut rng = Rng(2);
    // Vertices on a lattice of 2^-12, as a scene file holds them.
    let lattice = |x: f32| (x * 4096.0).round() / 4096.0;
    (0..2048)
        .map(|i| {
            if i % 16 == 7 {
                return needle(&mut rng);
            }
            let size = [0.01, 1.0, 30.0][rng.below(3) as usize];
            let centre = [rng.signed() * 60.0, rng.signed() * 60.0, rng.signed() * 60.0];
            let mut vertices = [[0.0; 3]; 3].map(|_| centre.map(|x| lattice(x + size * rng.signed())));
            if i % 16 == 15 {
                // In a plane across an axis: zero components of the normal.
                let k = rng.below(3) as usize;
                vertices.iter_mut().for_each(|v| v[k] = lattice(centre[k]));
            }
            let origin = [rng.signed() * 100.0, rng.signed() * 100.0, rng.signed() * 100.0].map(lattice);
            let [a, b, c] = vertices;
            let s = 0.5 + 0.5 * rng.signed();
            let t = (0.5 + 0.5 * rng.signed()) * (1.0 - s);
            let between = |k: usize| a[k] + s * (b[k] - a[k]) + t * (c[k] - a[k]);
            let mut aim = match i % 4 {
                0 => a,
                1 => [0, 1, 2].map(|k| a[k] + s * (b[k] - a[k])),
                2 => [0, 1, 2].map(between),
                _ => [0, 1, 2].map(|k| between(k) + 0.3 * size * rng.signed()),
            };
            if i % 8 == 4 {
                // Parallel to one axis or two.
                (0..1 + rng.below(2) as usize).for_each(|k| aim[(i / 8 + k) % 3] = origin[(i / 8 + k) % 3]);
                let shift = [0, 1, 2].map(|k| aim[k] - a[k]);
                vertices.iter_mut().for_each(|v| *v = [0, 1, 2].map(|k| v[k] + shift[k]));
            }
            let scale = [1.0, 0.125, 0.37][rng.below(3) as usize];
            let mut direction = [0, 1, 2].map(|k| (aim[k] - origin[k]) * scale);
            if i % 32 == 31 {
                // A component so small that it must count as 0.
                direction[rng.below(3) as usize] *= 1e-30;
            }
            TriangleCase { vertices, origin, direction, t_min: [0.0, 0.001][rng.below(2) as usize] }
        })
        .collect()
}
