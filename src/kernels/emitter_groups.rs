//! Groups of emitters: a binary tree over them, by which one is drawn for a surface (`shaders/shade/choose.wgsl`).
//!
//! A group knows a ball around its emitters, how their normals lie about an axis, and what they send together. From
//! that follows a bound of what they send to any surface.

use super::emitters::{Emitter, Shape};
use super::frame::Frame;
use super::layout;
use glam::DVec3;

/// What kernels add to bounds so that rounding to f32 takes none of an emitter's light: of the radius, and of normals.
const MARGIN: f64 = 1e-4;
/// Groups of fewer emitters are made by one task.
const OF_A_TASK: usize = 4096;

/// A group, in the world.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Group {
    /// The entries of its halves: emitters by their number, behind them groups.
    halves: [u32; 2],
    is_distant: bool,
    middle: DVec3,
    /// Of the ball around the middle that holds the emitters.
    radius: f64,
    /// The mean of normals, a unit vector.
    axis: DVec3,
    /// Greatest distance of a normal from the axis.
    spread: f64,
    /// Greatest distance of an emitter behind the middle, along its normal.
    behind: f64,
    /// Luminance of radiance times area, or of radiant intensity, summed; of distant lights that of irradiance.
    sent: f64,
}

/// An emitter as groups see it.
struct Member {
    number: u32,
    corners: [DVec3; 4],
    middle: DVec3,
    /// Unit vector to the side that it shines to, if it is one.
    normal: Option<DVec3>,
    sent: f64,
}

impl Member {
    fn new(number: u32, emitter: &Emitter) -> Self {
        let [r, g, b] = emitter.radiance.map(f64::from);
        let luminance = 0.2126 * r + 0.7152 * g + 0.0722 * b;
        let (corners, across) = match emitter.shape {
            Shape::Parallelogram { corner: c, edges: [u, v] } => ([c, c + u, c + v, c + u + v], u.cross(v)),
            Shape::Triangle { corner: c, edges: [u, v] } => ([c, c, c + u, c + v], 0.5 * u.cross(v)),
            Shape::Point { position, .. } | Shape::Spot { position, .. } => ([position; 4], DVec3::ZERO),
            Shape::Distant { .. } => ([DVec3::ZERO; 4], DVec3::ZERO),
        };
        let is_area = matches!(emitter.shape, Shape::Parallelogram { .. } | Shape::Triangle { .. });
        Self {
            number,
            corners,
            middle: corners.iter().sum::<DVec3>() / 4.0,
            normal: across.try_normalize().filter(|_| !emitter.two_sided),
            // What overflows is as bright as any.
            sent: (luminance * if is_area { across.length() } else { 1.0 }).min(1e30),
        }
    }
}

/// The groups of emitters, the one of all first; none of fewer than two.
pub fn groups(emitters: &[Emitter]) -> Vec<Group> {
    if emitters.len() < 2 {
        return Vec::new();
    }
    let members = (0..).zip(emitters).map(|(number, emitter)| Member::new(number, emitter));
    let is_distant = |member: &Member| matches!(emitters[member.number as usize].shape, Shape::Distant { .. });
    let (mut distant, mut near): (Vec<Member>, Vec<Member>) = members.partition(is_distant);
    let mut groups = vec![Group::default(); emitters.len() - 1];
    let first = emitters.len() as u32;
    if distant.is_empty() || near.is_empty() {
        let (members, is_distant) = if near.is_empty() { (&mut distant, true) } else { (&mut near, false) };
        fill(members, &mut groups, first, is_distant);
        return groups;
    }
    // Distant lights have no place: they are a half of their own. What the whole sends is not asked.
    let (own, rest) = groups.split_at_mut(1);
    let (of_distant, of_near) = rest.split_at_mut(distant.len() - 1);
    own[0].halves = [
        fill(&mut distant, of_distant, first + 1, true),
        fill(&mut near, of_near, first + 1 + of_distant.len() as u32, false),
    ];
    groups
}

/// Makes the groups of `members`, the first of which is entry `first`; returns the entry that stands for all of them.
fn fill(members: &mut [Member], groups: &mut [Group], first: u32, is_distant: bool) -> u32 {
    let Some((group, rest)) = groups.split_first_mut() else { return members[0].number };
    *group = group_of(members, is_distant);
    let (low, high) = bounds(members.iter().map(|member| member.middle));
    let axis = (high - low).max_position();
    let half = members.len() / 2;
    // Equal places keep an order of their own, so that the tree is the same everywhere.
    members
        .select_nth_unstable_by(half, |a, b| a.middle[axis].total_cmp(&b.middle[axis]).then(a.number.cmp(&b.number)));
    let (left, right) = members.split_at_mut(half);
    let (of_left, of_right) = rest.split_at_mut(half - 1);
    let [a, b] = [first + 1, first + half as u32];
    let (left, right) = if left.len() < OF_A_TASK {
        (fill(left, of_left, a, is_distant), fill(right, of_right, b, is_distant))
    } else {
        rayon::join(|| fill(left, of_left, a, is_distant), || fill(right, of_right, b, is_distant))
    };
    group.halves = [left, right];
    first
}

fn bounds(points: impl Iterator<Item = DVec3>) -> (DVec3, DVec3) {
    points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
}

fn group_of(members: &[Member], is_distant: bool) -> Group {
    let (low, high) = bounds(members.iter().flat_map(|member| member.corners));
    let middle = 0.5 * (low + high);
    let corners = members.iter().flat_map(|member| member.corners);
    let radius = corners.map(|corner| corner.distance_squared(middle)).fold(0.0, f64::max).sqrt();
    let normals = members.iter().map(|member| Some(member.sent * member.normal?));
    let axis = normals.sum::<Option<DVec3>>().and_then(DVec3::try_normalize);
    let mut group = Group {
        is_distant,
        middle,
        radius,
        // Without normals, or with ones all around, every direction counts as along one.
        axis: DVec3::Y,
        spread: 2.0,
        behind: radius,
        sent: members.iter().map(|member| member.sent).sum(),
        ..Group::default()
    };
    if let Some(axis) = axis {
        let of = |f: &dyn Fn(DVec3, &Member) -> f64| {
            let values = members.iter().filter_map(|member| Some(f(member.normal?, member)));
            values.fold(f64::NEG_INFINITY, f64::max)
        };
        group.axis = axis;
        group.spread = of(&|normal, _| normal.distance(axis));
        group.behind = of(&|normal, member| normal.dot(middle - member.corners[0]));
    }
    group
}

impl Group {
    /// As kernels see it in `frame`.
    pub fn placed(&self, frame: &Frame) -> layout::Emitter {
        let [first, second] = self.halves;
        let entry = layout::Emitter { first, second, ..Default::default() };
        if self.is_distant {
            return layout::Emitter {
                kind: layout::EMITTER_DISTANT_GROUP,
                radiance: [self.sent as f32, 0.0, 0.0],
                ..entry
            };
        }
        let radius = self.radius * (1.0 + MARGIN) / frame.unit;
        layout::Emitter {
            kind: layout::EMITTER_GROUP,
            corner: frame.point(self.middle),
            u: self.axis.as_vec3().to_array(),
            v: [radius as f32, (self.spread + MARGIN) as f32, (self.behind / frame.unit + MARGIN * radius) as f32],
            radiance: [(self.sent / (frame.unit * frame.unit)).min(1e30) as f32, 0.0, 0.0],
            ..entry
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::lamps::Lamps;
    use super::*;
    use crate::kernels::shade::choose::{choose_emitter, share_of_first};
    use crate::math::sampling::pcg;

    /// Numbers in [0, 1), one after the other.
    fn numbers() -> impl FnMut() -> f64 {
        let mut state = 7u32;
        move || {
            state = pcg(state);
            f64::from(state) / 4_294_967_296.0
        }
    }

    /// Small lamps over a square of `side` metres, of every kind, a few of them far brighter.
    fn lamps(count: usize, side: f64) -> Vec<Emitter> {
        let mut next = numbers();
        let mut vector = move |size: f64| DVec3::new(next() - 0.5, next() - 0.5, next() - 0.5) * size;
        (0..count)
            .map(|i| {
                let position = vector(side) * DVec3::new(1.0, 0.1, 1.0);
                let edges = [vector(0.6), vector(0.6)];
                let direction = vector(1.0).normalize();
                let shape = match i % 11 {
                    0..6 => Shape::Triangle { corner: position, edges },
                    6..8 => Shape::Parallelogram { corner: position, edges },
                    8 => Shape::Point { position, range: 0.0 },
                    9 => Shape::Spot { position, direction, range: 0.0, cone: [0.3, 0.6] },
                    _ => Shape::Distant { direction },
                };
                let radiance = [if i % 50 == 0 { 400.0 } else { 10.0 }; 3];
                let radiance = if i % 11 == 10 { [1e-3; 3] } else { radiance };
                Emitter { shape, two_sided: i % 3 == 0, radiance }
            })
            .collect()
    }

    /// The probability of every emitter at a surface, by all branches of the tree.
    fn probabilities(entries: &[layout::Emitter], count: u32, p: [f32; 3], n: [f32; 3]) -> Vec<f64> {
        let mut all = vec![0.0; count as usize];
        let mut open = vec![(count, 1.0f64)];
        while let Some((entry, probability)) = open.pop() {
            if entry < count {
                all[entry as usize] += probability;
            } else if let Some(share) = share_of_first(entries, entry, p, n) {
                let group = &entries[entry as usize];
                open.push((group.first, probability * f64::from(share)));
                open.push((group.second, probability * f64::from(1.0 - share)));
            }
        }
        all
    }

    /// The irradiance of a surface by an emitter without shadows, by many points of it; of points and spots their own.
    fn irradiance(e: &layout::Emitter, p: [f32; 3], n: [f32; 3], points: u32) -> f64 {
        use crate::kernels::shade::lamps::shines;
        let mut next = numbers();
        let kind = e.kind & layout::EMITTER_KIND;
        let is_area = kind <= layout::EMITTER_TRIANGLE;
        let points = if is_area { points } else { 1 };
        let mut sum = 0.0;
        for _ in 0..points {
            let [mut s, mut t] = [next(), next()];
            if kind == layout::EMITTER_TRIANGLE && s + t > 1.0 {
                (s, t) = (1.0 - s, 1.0 - t);
            }
            let along = |k: usize| {
                let inside = if is_area { s as f32 * e.u[k] + t as f32 * e.v[k] } else { 0.0 };
                if kind == layout::EMITTER_DISTANT { -e.u[k] } else { e.corner[k] + inside - p[k] }
            };
            let d = [along(0), along(1), along(2)];
            let cosine: f32 = (0..3).map(|k| n[k] * d[k]).sum();
            let squared: f32 = d.iter().map(|x| x * x).sum();
            sum += f64::from(e.radiance[0] * cosine.max(0.0) * shines(e, d) / (squared * squared));
        }
        sum / f64::from(points)
    }

    fn surface(next: &mut impl FnMut() -> f64, side: f64) -> ([f32; 3], [f32; 3]) {
        let p = [side * (next() - 0.5), 0.12 * side * (next() - 0.5), side * (next() - 0.5)].map(|x| x as f32);
        let n = DVec3::new(next() - 0.5, next() - 0.5, next() - 0.5).normalize();
        (p, n.as_vec3().to_array())
    }

    const PLAIN: Frame = Frame { origin: DVec3::ZERO, reference: [0; 3], unit: 1.0 };

    #[test]
    fn whatever_shines_on_a_surface_is_drawn_and_nothing_twice() {
        for count in [2usize, 3, 17, 400] {
            let all = lamps(count, 40.0);
            let made = Lamps::new(None, all, 30.0);
            let entries = made.placed(&PLAIN);
            let count = made.emitters().len() as u32;
            assert_eq!(entries.len(), 2 * count as usize - 1);
            let mut next = numbers();
            let mut lit = 0;
            for _ in 0..60 {
                let (p, n) = surface(&mut next, 40.0);
                let found = probabilities(&entries, count, p, n);
                let sum: f64 = found.iter().sum();
                assert!(sum < 1.0 + 1e-5, "{sum}");
                for (number, probability) in found.iter().enumerate() {
                    let light = irradiance(&entries[number], p, n, 64);
                    lit += u32::from(light > 0.0);
                    assert!(light <= 1e-9 || *probability > 0.0, "{number} of {count}: {light} is never drawn");
                }
            }
            assert!(lit > 20, "{lit} lit surfaces of {count} lamps");
        }
    }

    #[test]
    fn draws_have_the_probability_that_they_state() {
        let made = Lamps::new(None, lamps(40, 10.0), 8.0);
        let (entries, count) = (made.placed(&PLAIN), made.emitters().len() as u32);
        let mut next = numbers();
        for _ in 0..4 {
            let (p, n) = surface(&mut next, 10.0);
            let expected = probabilities(&entries, count, p, n);
            let draws = 200_000u32;
            let mut found = vec![0u32; count as usize];
            for draw in 0..draws {
                let chosen = choose_emitter(&entries, count, pcg(draw), p, n);
                // A half without light ends a draw.
                let Some(found) = found.get_mut(chosen.emitter as usize) else { continue };
                *found += 1;
                let apart = f64::from(chosen.probability) / expected[chosen.emitter as usize] - 1.0;
                assert!(apart.abs() < 1e-4, "{apart}");
            }
            for (found, expected) in found.iter().zip(&expected) {
                let share = f64::from(*found) / f64::from(draws);
                let deviation = (expected * (1.0 - expected) / f64::from(draws)).sqrt();
                assert!((share - expected).abs() < 5.0 * deviation + 1e-6, "{share} instead of {expected}");
            }
        }
    }

    /// What one draw says of the light of all lamps is right in the mean, and varies less than by power.
    #[test]
    fn one_draw_tells_the_light_of_all_and_better_than_by_power() {
        let made = Lamps::new(None, lamps(300, 60.0), 40.0);
        let (entries, count) = (made.placed(&PLAIN), made.emitters().len() as u32);
        let mut next = numbers();
        let (mut by_tree, mut by_power) = (0.0, 0.0);
        for _ in 0..40 {
            let (p, n) = surface(&mut next, 60.0);
            let drawn = probabilities(&entries, count, p, n);
            let lights: Vec<f64> = entries[..count as usize].iter().map(|e| irradiance(e, p, n, 256)).collect();
            let truth: f64 = lights.iter().sum();
            if truth <= 0.0 {
                continue;
            }
            // The second moment of an unbiased draw over its squared mean.
            let moment = |probability: &dyn Fn(usize) -> f64| {
                let shining = lights.iter().enumerate().filter(|(_, light)| **light > 0.0);
                shining.map(|(k, light)| light * light / probability(k)).sum::<f64>() / (truth * truth)
            };
            by_tree += moment(&|k| drawn[k]);
            by_power += moment(&|k| f64::from(made.probabilities()[k]));
        }
        assert!(by_tree < 0.2 * by_power, "second moments: {by_tree} by the tree, {by_power} by power");
    }
}
