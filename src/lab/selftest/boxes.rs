//! Rays at boxes (cases 15 to 19).
//!
//! **Truth** is in integers of 128 bits: all coordinates are multiples of 2⁻¹² below 2³³ of them, and directions as
//! well, so that distances are fractions whose comparison needs 68 bits.
//!
//! **No box is lost.** A child box that a ray meets within its range must be entered.
//!
//! **Few are entered in vain.** The kernel computes p + offset with one rounding, subtracts the origin, multiplies and
//! adds; each of these errs by u of what it gives, so a plane is off by at most u·abs(pc) + 4u·M along its axis, M
//! being the greatest distance on any axis from the origin to the node's far end, and δ = 64u·M + 4u·abs(pc) of padding
//! is added. A box that is entered must therefore be met when it is grown by 2δ.

use super::case::Checks;
use super::lab::{Lab, cached, settings};
use super::rays::{Aim, ray};
use crate::gpu::wgsl::Pages;
use crate::gpu::{kernels, probe};
use crate::kernels::layout::{Ray, T_INFINITE};
use crate::kernels::trace::node::{framed_ray, node_hits};
use crate::session::device::Device;
use anyhow::Result;
use bricks::Node;
use brickwalk_scenes::{Rng, Stiff, stiff};

/// Multiples of this are the integers.
const GRID: f64 = 1.0 / 4096.0;

/// What a case's rays and boxes have in common.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A zero component of the direction, of either sign: outside of the slab a miss, inside no bound.
    Zero,
    /// An origin on a face's plane, and a direction along it: met.
    OnFace,
    /// A component so small that its reciprocal is beyond what f32 holds.
    Tiny,
    /// A box that is flat on an axis.
    Flat,
    /// Corners, edges and insides, near and far from the origin of the frame.
    Any,
}

/// A node, a ray, and the offset of the node's brick.
struct BoxCase {
    node: Node,
    ray: Ray,
    offset: [f32; 3],
}

impl BoxCase {
    fn words(&self) -> [u32; 32] {
        let mut words = [0; 32];
        words[..20].copy_from_slice(bytemuck::cast_slice(std::slice::from_ref(&self.node)));
        words[20..28].copy_from_slice(bytemuck::cast_slice(std::slice::from_ref(&self.ray)));
        words[28..31].copy_from_slice(&self.offset.map(f32::to_bits));
        words
    }

    /// Bounds of child `i` in multiples of the grid.
    fn bounds(&self, i: usize) -> [[i128; 2]; 3] {
        std::array::from_fn(|k| {
            let step = self.step(k);
            let origin = units(self.node.origin[k]) + units(self.offset[k]);
            [self.node.lo[k][i], self.node.hi[k][i]].map(|q| origin + i128::from(q) * step)
        })
    }

    fn step(&self, k: usize) -> i128 {
        units(f32::from_bits(u32::from(self.node.exponent[k]) << 23))
    }

    /// 2δ of every axis, in multiples of the grid, rounded up.
    fn slack(&self) -> [i128; 3] {
        let u = 0.5f64.powi(24);
        let pc: [f64; 3] = std::array::from_fn(|k| f64::from(self.node.origin[k]) + f64::from(self.offset[k]));
        let reach = |k: usize| (pc[k] - f64::from(self.ray.origin[k])).abs() + 255.0 * self.step(k) as f64 * GRID;
        let m = reach(0).max(reach(1)).max(reach(2));
        pc.map(|pc| (2.0 * (64.0 * u * m + 4.0 * u * pc.abs()) / GRID).ceil() as i128 + 1)
    }
}

fn units(x: f32) -> i128 {
    (f64::from(x) / GRID) as i128
}

/// Whether the ray { o + t d : 0 ≤ t ≤ t_max } meets the closed box, exactly. `t_max`: `None` without an end.
fn meets(bounds: [[i128; 2]; 3], o: [i128; 3], d: [i128; 3], t_max: Option<i128>) -> bool {
    // Fractions with positive denominators.
    let mut low = (0i128, 1i128);
    let mut high = t_max.map(|t| (t, 1));
    let less = |a: (i128, i128), b: (i128, i128)| a.0 * b.1 < b.0 * a.1;
    for k in 0..3 {
        let [min, max] = bounds[k];
        if d[k] == 0 {
            if o[k] < min || o[k] > max {
                return false;
            }
            continue;
        }
        let (near, far) = if d[k] > 0 { (min - o[k], max - o[k]) } else { (o[k] - max, o[k] - min) };
        let size = d[k].abs();
        if less(low, (near, size)) {
            low = (near, size);
        }
        if high.is_none_or(|high| less((far, size), high)) {
            high = Some((far, size));
        }
    }
    high.is_none_or(|high| !less(high, low))
}

fn case(rng: &mut Rng, kind: Kind, number: usize) -> BoxCase {
    let is_far = kind == Kind::Any && number % 2 == 1;
    let whole = |rng: &mut Rng, most: i64, step: f64| rng.int(-most, most) as f64 * step;
    let exponent = [0; 3].map(|_| (127 + rng.int(-8, 0)) as u8);
    let mut node = Node {
        origin: [0; 3].map(|_| whole(rng, 1 << 14, 1.0 / 256.0) as f32),
        exponent,
        inner_mask: 0,
        child_base: 1,
        triangle_base: 0,
        meta: [0x20; 8],
        lo: [[0; 8]; 3],
        hi: [[0; 8]; 3],
    };
    let flat = rng.int(0, 2) as usize;
    for (k, i) in (0..3).flat_map(|k| (0..8).map(move |i| (k, i))) {
        let [a, b] = [0; 2].map(|_| rng.int(0, 255) as u8);
        (node.lo[k][i], node.hi[k][i]) = (a.min(b), a.max(b));
        if kind == Kind::Flat && k == flat {
            node.hi[k][i] = node.lo[k][i];
        }
    }
    // Offsets beyond 2^16 leave the sum with the node's origin more than 24 bits.
    let offset = if is_far { [0; 3].map(|_| whole(rng, 1 << 10, 1024.0) as f32) } else { [0.0; 3] };
    let mut case = BoxCase { node, ray: Ray { t_max: T_INFINITE, ..Ray::default() }, offset };
    let bounds = case.bounds(rng.int(0, 7) as usize);
    // A corner, a point of an edge, of a face or of the inside.
    let inside = rng.int(0, 3);
    let aim: [i128; 3] = std::array::from_fn(|k| {
        let [min, max] = bounds[k];
        if rng.int(0, 3) < inside {
            min + (rng.unit() * (max - min) as f64) as i128
        } else {
            [min, max][rng.int(0, 1) as usize]
        }
    });
    let mut origin: [i128; 3] = std::array::from_fn(|k| {
        // What f32 holds there.
        let near = (aim[k] as f64 * GRID + rng.range(-100.0, 100.0)) as f32;
        units((f64::from(near) / GRID).round() as f32 * GRID as f32)
    });
    // Not through the aim exactly, every third time.
    let mut miss = [0i128; 3].map(|_| if number % 3 == 2 { i128::from(rng.int(-3, 3)) } else { 0 });
    let axes = if rng.chance(0.3) { 2 } else { 1 };
    for k in (0..axes).map(|i| (flat + i) % 3) {
        let [min, max] = bounds[k];
        let slack = 1 << 12;
        match kind {
            Kind::Zero | Kind::Tiny => {
                origin[k] = match number % 4 {
                    0 => min - slack,
                    1 => max + slack,
                    _ => min + (max - min) / 2,
                };
                miss[k] = aim[k] - origin[k];
            }
            Kind::OnFace => {
                origin[k] = [min, max][number % 2];
                miss[k] = aim[k] - origin[k];
            }
            Kind::Flat | Kind::Any => {}
        }
    }
    case.ray.origin = origin.map(|x| (x as f64 * GRID) as f32);
    let origin = case.ray.origin.map(units);
    case.ray.direction = std::array::from_fn(|k| ((aim[k] - origin[k] - miss[k]) as f64 * GRID) as f32);
    for k in 0..3 {
        if case.ray.direction[k] == 0.0 && kind != Kind::Any {
            let zero = if kind == Kind::Tiny { [1e-30, 1e-38, 1e-42][number / 4 % 3] } else { 0.0 };
            case.ray.direction[k] = [zero, -zero][number / 2 % 2];
        }
    }
    if case.ray.direction.iter().all(|x| x.abs() < 1e-6) {
        case.ray.direction[(flat + 2) % 3] = 1.0;
    }
    if number.is_multiple_of(5) {
        case.ray.t_max = 1.0;
    } else if kind == Kind::Tiny {
        case.ray.t_max = 1_048_576.0;
    }
    case
}

/// What the device says to every case: mask of children entered, and where.
fn entered(lab: &Lab, cases: &[BoxCase]) -> Result<Vec<(u32, [f32; 8])>> {
    let Device::Gpu(gpu) = &lab.device else {
        let one = |case: &BoxCase| {
            let ray = framed_ray(case.ray.origin, case.ray.direction, case.ray.t_min);
            let hits = node_hits(&ray, &case.node, case.offset, [0.0; 3], 0.0, case.ray.t_max);
            (hits.mask, hits.near)
        };
        return Ok(cases.iter().map(one).collect());
    };
    let text = kernels::source(
        "probe/probe_boxes",
        Pages { cache: 1, texels: 1, opacity: false, gloss: false, layers: false, levels: false, hides: false },
    );
    let text = lab.defect.map_or(text.clone(), |defect| defect.plant(text));
    let words = probe::dispatch(gpu, &probe::module(gpu, &text), "boxes", cases, BoxCase::words, 9)?;
    let one = |words: &[u32]| (words[0], std::array::from_fn(|i| f32::from_bits(words[1 + i])));
    Ok(words.chunks_exact(9).map(one).collect())
}

/// Cases 15 to 19: compares what the device enters with truth; where boxes of scenes can be of the kind, also whole
/// trees.
pub fn nodes(lab: &mut Lab, checks: &mut Checks, kind: Kind) -> Result<()> {
    let count = lab.share(100_000);
    let mut rng = lab.random(&[15, kind as i64]);
    let cases: Vec<BoxCase> = (0..count).map(|number| case(&mut rng, kind, number)).collect();
    let (mut lost, mut met, mut vain, mut passed, mut unordered) = (0, 0, 0, 0, 0);
    for (case, (mask, near)) in cases.iter().zip(entered(lab, &cases)?) {
        let Ray { origin, direction, t_max, .. } = case.ray;
        let (o, d) = (origin.map(units), direction.map(units));
        let end = (t_max < T_INFINITE).then_some(t_max as i128);
        let slack = case.slack();
        for (i, near) in near.iter().enumerate() {
            let bounds = case.bounds(i);
            let grown = std::array::from_fn(|k| [bounds[k][0] - slack[k], bounds[k][1] + slack[k]]);
            let is_entered = mask & 1 << i != 0;
            unordered += u64::from(!near.is_finite());
            if meets(bounds, o, d, end) {
                met += 1;
                lost += u64::from(!is_entered);
            } else if !meets(grown, o, d, end) {
                passed += 1;
                vain += u64::from(is_entered);
            }
        }
    }
    checks.none("boxes met and not entered", lost, met);
    checks.none("boxes entered that are not met even when grown by twice the padding", vain, passed);
    checks.equal("distances that are not finite", unordered, 0);
    if matches!(kind, Kind::Zero | Kind::Flat) { scene(lab, checks, kind) } else { Ok(()) }
}

/// Judges rays through whole trees over axis-aligned boxes, most of them flat.
fn scene(lab: &mut Lab, checks: &mut Checks, kind: Kind) -> Result<()> {
    let count = lab.share(12_000);
    let mut stage = lab.judged(stiff(Stiff::FlatBoxes, 200, lab.seed), &settings(32, -10), &cached(50))?;
    let mut rng = lab.random(&[16, kind as i64]);
    let rays: Vec<Ray> = (0..count)
        .map(|number| {
            let aim = stage.targets.point(&mut rng, Aim::ALL[number % 3]);
            let mut origin = aim + rng.range(0.1, 6.0) / stage.frame.unit * rng.direction();
            // In the planes of a face, or along a line of its edges.
            let axes = if number % 4 == 0 { 2 } else { 1 };
            let first = rng.int(0, 2) as usize;
            (0..axes).for_each(|k| origin[(first + k) % 3] = aim[(first + k) % 3]);
            let mut one = ray(origin, aim);
            if number % 2 == 1 {
                one.direction = one.direction.map(|x| if x == 0.0 { -0.0 } else { x });
            }
            one
        })
        .collect();
    stage.note(checks, "scene of flat boxes", &rays)?;
    Ok(())
}
