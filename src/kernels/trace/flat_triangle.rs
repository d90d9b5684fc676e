//! One ray against triangles that lie side by side, a lane each: what [`super::packet_triangle`] does for rays.

use super::brick::Best;
use super::leaf::BrickRay;
use super::packet_triangle::{Met, Rays, ends, meet, shear};
use super::walk_brick::Group;
use crate::kernels::flat::{BLOCK, FlatBlock, FlatBrick};
use crate::kernels::simd::isa::Isa;
use crate::kernels::simd::wide::{Wide, three};
use crate::math::exact::TriangleHit;

impl BrickRay<'_> {
    /// [`BrickRay::test_triangles`] of the brick that `flat` is.
    #[inline(always)]
    pub fn test_flat<I: Isa>(&self, isa: I, flat: &FlatBrick, best: &mut Best, group: Group, any_hit: bool) {
        let mut first = group.base / BLOCK as u32;
        // At most 24 triangles, from one of 8 lanes on.
        let mut lanes = group.bits << (group.base % BLOCK as u32);
        while lanes != 0 {
            let own = lanes & 0xff;
            if own != 0 && self.test_block(isa, &flat.blocks[first as usize], best, (first, own), any_hit) && any_hit {
                break;
            }
            lanes >>= BLOCK;
            first += 1;
        }
    }

    /// Tests triangles of block `number`, a bit each.
    #[inline(always)]
    fn test_block<I: Isa>(
        &self,
        isa: I,
        block: &FlatBlock,
        best: &mut Best,
        (number, lanes): (u32, u32),
        any_hit: bool,
    ) -> bool {
        let frame = &self.ray.frame;
        let axes = [frame.kx, frame.ky, frame.kz].map(|k| k as usize % 3);
        let offset = three!(i => isa.eight(self.offset_high[axes[i]]));
        let origin = three!(i => isa.eight(self.ray.origin[axes[i]]));
        let [a, b, c] = three!(v => three!(i => isa.load_eight(&block.vertices[v][axes[i]]) + offset[i] - origin[i]));
        let (sx, sy) = (isa.eight(frame.sx), isa.eight(frame.sy));
        let (sa, sb, sc) = (shear(a, [sx, sy]), shear(b, [sx, sy]), shear(c, [sx, sy]));
        let rays = Rays {
            along: isa.eight(frame.iz),
            inverse: three!(i => isa.eight(frame.inv[axes[i]])),
            t_min: isa.eight(self.ray.t_min),
            t_max: isa.eight(best.t),
        };
        let met = meet(
            #[inline(always)]
            |x| isa.eight(x),
            [sa, sb, sc],
            #[inline(always)]
            || {
                ends(
                    #[inline(always)]
                    |x| isa.eight(x),
                    [a, b, c],
                )
            },
            &rays,
            lanes,
        );
        let Some(Met { hit, alone, values }) = met else { return false };
        let mut left = hit | alone;
        if left == 0 {
            return false;
        }
        let mut stored = [[0.0; BLOCK]; 5];
        for (to, value) in stored.iter_mut().zip(values) {
            value.store(to);
        }
        let mut is_nearer = false;
        while left != 0 {
            let lane = left.trailing_zeros() as usize % BLOCK;
            left &= left - 1;
            let triangle = number * BLOCK as u32 + lane as u32;
            is_nearer |= if alone >> lane & 1 != 0 {
                self.test_triangle(best, triangle)
            } else {
                let [t, u, v, w, det] = stored.map(|values| values[lane]);
                self.keep(best, triangle, TriangleHit { hit: true, t, u, v, w, det })
            };
            if is_nearer && any_hit {
                return true;
            }
        }
        is_nearer
    }
}
