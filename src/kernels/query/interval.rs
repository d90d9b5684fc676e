//! The interval test of a whole tile against a box: twin of `shaders/query/interval.wgsl`. Can any ray of the tile meet
//! it within its range? At least as conservative as the ray's own padded test, because every bound holds for every ray
//! of the tile.

use crate::kernels::layout::{T_INFINITE, TileBounds};
use crate::kernels::trace::node::UNIT;
use crate::kernels::vector::{Vec3, each, least, most, most3};

/// Whether a tile meets a box, and where.
#[derive(Clone, Copy, Debug)]
pub struct IntervalHit {
    /// No ray of the tile enters the box before this distance.
    pub near: f32,
    /// Whether any ray may meet it.
    pub hit: bool,
}

/// Range of distances on one axis: slab lo..hi, origins o0..o1, directions d0..d1.
fn axis_range(lo: f32, hi: f32, [o0, o1]: [f32; 2], [d0, d1]: [f32; 2]) -> [f32; 2] {
    // Least signed distance to the lower plane, greatest to the upper.
    let (below, above) = (lo - o1, hi - o0);
    if d0 > 0.0 {
        // Near: the lower plane; it is nearest for the fastest direction where ahead, for the slowest where behind.
        let near = if below > 0.0 { below / d1 } else { below / d0 };
        let far = if above > 0.0 { above / d0 } else { above / d1 };
        return [near, far];
    }
    if d1 < 0.0 {
        let near = if above < 0.0 { above / d0 } else { above / d1 };
        let far = if below < 0.0 { below / d1 } else { below / d0 };
        return [near, far];
    }
    // Some ray runs parallel: only a slab strictly ahead on one side bounds the near distance.
    let mut near = -T_INFINITE;
    if below > 0.0 {
        if d1 <= 0.0 {
            return [T_INFINITE, -T_INFINITE];
        }
        near = below / d1;
    }
    if above < 0.0 {
        if d0 >= 0.0 {
            return [T_INFINITE, -T_INFINITE];
        }
        near = above / d0;
    }
    [near, T_INFINITE]
}

/// Whether and where the rays of a tile may meet a box.
pub fn tile_meets_box(tile: &TileBounds, box_min: Vec3, box_max: Vec3, slack: f32) -> IntervalHit {
    let (o0, o1) = (tile.origin_min, tile.origin_max);
    let reach = each(|k| {
        let a = most((box_min[k] - o0[k]).abs(), (box_max[k] - o1[k]).abs());
        most((box_min[k] - o1[k]).abs(), most((box_max[k] - o0[k]).abs(), a))
    });
    let m = most3(reach);
    let o = most3(each(|k| most(o0[k].abs(), o1[k].abs())));
    let all = 64.0 * UNIT * m + slack * (m + o);
    let delta = each(|k| all + 8.0 * UNIT * most(box_min[k].abs(), box_max[k].abs()));
    let axis = |k: usize| {
        let directions = [tile.direction_min[k], tile.direction_max[k]];
        axis_range(box_min[k] - delta[k], box_max[k] + delta[k], [o0[k], o1[k]], directions)
    };
    let [x, y, z] = [axis(0), axis(1), axis(2)];
    let near = most(most(x[0], y[0]), z[0]);
    let far = least(least(x[1], y[1]), z[1]);
    // Quotients err by 2.5 ulp each; eight units of the last place on both sides cover the comparison.
    let widened_near = near - near.abs() * 16.0 * UNIT;
    let widened_far = least(far, T_INFINITE) + least(far.abs(), 1.0e30) * 16.0 * UNIT;
    let start = most(widened_near, most(tile.t_min, 0.0));
    IntervalHit { near: start, hit: tile.rays > 0 && start <= least(widened_far, tile.t_max) }
}
