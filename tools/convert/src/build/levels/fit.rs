//! Fits the colours of a level to those of what it stands for.
//!
//! Means over cells are the start. They run together where they are interpolated, and what lies along a border counts
//! for less than it should, as its vertex lies at the end of its cell. A few steps toward the least squares of the
//! difference at the points of the level nearest to what it stands for mend both.

use super::cluster::{Clusters, Output, Touching};
use super::merge::Merged;
use super::nearest::{closest, distance2};
use super::surface::Surface;
use super::vector::{CLASSES, Vec3, add_scaled, area_vector, class, dot, length, sub};
use bricks::NONE;

/// Steps toward the least squares (Jacobi).
const STEPS: usize = 2;

/// What a difference of unit normals counts as, as a distance: square cells for each 1 - cosine.
const TURNED: f64 = 0.5;

/// Colours of a level, linear RGB.
pub(super) struct Fitted {
    /// Of the corners of each output.
    pub corners: Vec<[Vec3; 3]>,
    /// Of the level where each source triangle was.
    pub shown: Vec<Vec3>,
    /// How far each source triangle is from the level, on the mean, steps; infinite where nothing is near.
    pub distances: Vec<f64>,
}

/// A point of what the level stands for.
struct Sample {
    source: u32,
    output: u32,
    /// Weights of the corners of the output at its nearest point.
    at: [f32; 3],
    distance: f32,
    /// Area.
    weight: f32,
}

/// The colours, from the means at the corners of each output.
pub(super) fn fit(
    merged: &Merged,
    points: &[Vec3],
    (clusters, touching): (&Clusters, &Touching),
    surface: &Surface,
    means: Vec<[Vec3; 3]>,
) -> Fitted {
    let samples = samples(merged, points, (clusters, touching), surface);
    let (unknown_of, count) = unknowns(points, clusters, surface);
    let mut colors = vec![[0.0; 3]; count];
    for (unknowns, means) in unknown_of.iter().zip(&means) {
        (0..3).for_each(|k| colors[unknowns[k] as usize] = means[k]);
    }
    let shown = |sample: &Sample, colors: &[Vec3]| {
        let unknowns = unknown_of[sample.output as usize];
        (0..3).fold([0.0; 3], |sum, k| add_scaled(sum, f64::from(sample.at[k]), colors[unknowns[k] as usize]))
    };
    // Steps must not go beyond what is there.
    let mut ranges = vec![([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]); count];
    for (unknowns, sample) in samples.iter().map(|sample| (unknown_of[sample.output as usize], sample)) {
        let albedo = surface.albedo[sample.source as usize].map(f64::from);
        for (unknown, _) in unknowns.into_iter().zip(sample.at).filter(|(_, at)| *at > 0.0) {
            let (least, most) = &mut ranges[unknown as usize];
            (0..3).for_each(|k| (least[k], most[k]) = (least[k].min(albedo[k]), most[k].max(albedo[k])));
        }
    }
    for _ in 0..STEPS {
        let mut sums = vec![([0.0; 3], 0.0); count];
        for sample in &samples {
            let difference = sub(surface.albedo[sample.source as usize].map(f64::from), shown(sample, &colors));
            for (unknown, at) in unknown_of[sample.output as usize].into_iter().zip(sample.at) {
                let (sum, weights) = &mut sums[unknown as usize];
                let weight = f64::from(sample.weight * at);
                *sum = add_scaled(*sum, weight, difference);
                *weights += weight;
            }
        }
        for ((color, (least, most)), (sum, weights)) in colors.iter_mut().zip(&ranges).zip(sums) {
            if weights > 0.0 {
                let moved = add_scaled(*color, 1.0 / weights, sum);
                *color = std::array::from_fn(|k| moved[k].clamp(least[k], most[k]));
            }
        }
    }
    let mut of_source = vec![([0.0; 3], 0.0, 0.0); merged.triangles.len()];
    for sample in &samples {
        let (color, distance, weights) = &mut of_source[sample.source as usize];
        let weight = f64::from(sample.weight);
        *color = add_scaled(*color, weight, shown(sample, &colors));
        *distance += weight * f64::from(sample.distance);
        *weights += weight;
    }
    let own = |(number, (color, distance, weights)): (usize, (Vec3, f64, f64))| match weights {
        0.0 => (surface.albedo[number].map(f64::from), f64::INFINITY),
        _ => (color.map(|x| x / weights), distance / weights),
    };
    let (shown, distances) = of_source.into_iter().enumerate().map(own).unzip();
    let corners = unknown_of.iter().map(|unknowns| unknowns.map(|unknown| colors[unknown as usize])).collect();
    Fitted { corners, shown, distances }
}

/// The unknown of each corner of each output, and how many there are: corners in a cell share one if their triangles
/// face one way and stand for nothing of their own.
fn unknowns(points: &[Vec3], clusters: &Clusters, surface: &Surface) -> (Vec<[u32; 3]>, usize) {
    let mut shared = vec![[NONE; CLASSES]; clusters.kept.len()];
    let mut of_group = vec![NONE; clusters.spread.len()];
    let mut count = 0;
    let mut next = |unknown: &mut u32| {
        if *unknown == NONE {
            *unknown = count;
            count += 1;
        }
        *unknown
    };
    let mut of_output = |output: &Output| {
        if clusters.is_thin(output.group) {
            return [next(&mut of_group[output.group as usize]); 3];
        }
        if surface.has_own(output.group) {
            return [NONE; 3].map(|mut unknown| next(&mut unknown));
        }
        let side = class(area_vector(output.corners.map(|corner| points[corner as usize])));
        output.cells.map(|cell| next(&mut shared[cell as usize][side]))
    };
    let unknowns = clusters.outputs.iter().map(&mut of_output).collect();
    (unknowns, count as usize)
}

/// Points of the source triangles, with where the level is nearest among what touches their cells.
fn samples(
    merged: &Merged,
    points: &[Vec3],
    (clusters, touching): (&Clusters, &Touching),
    surface: &Surface,
) -> Vec<Sample> {
    let places = Places::of(points, clusters);
    let face = clusters.size * clusters.size;
    let mut output_of = vec![NONE; clusters.spread.len()];
    (0u32..).zip(&clusters.outputs).for_each(|(number, output)| output_of[output.group as usize] = number);
    let mut samples = Vec::with_capacity(merged.triangles.len());
    let mut near: Vec<u32> = Vec::new();
    let mut bounds: Vec<f32> = Vec::new();
    let mut seen_by = vec![NONE; clusters.outputs.len()];
    for (source, triangle) in (0u32..).zip(&merged.triangles) {
        let (area, group) = (surface.area[source as usize], clusters.group_of[source as usize]);
        if area <= 0.0 {
            continue;
        }
        let corners = triangle.corners.map(|corner| points[corner as usize]);
        let n = unit(area_vector(corners));
        near.clear();
        let mut add = |output: u32| {
            if std::mem::replace(&mut seen_by[output as usize], source) != source {
                near.push(output);
            }
        };
        // What it became counts where others are as near.
        if group != NONE {
            add(output_of[group as usize]);
        }
        let [a, b, c] = triangle.corners.map(|corner| clusters.cell_of[corner as usize]);
        touching.outputs(a).iter().for_each(|&output| add(output));
        if b != a {
            touching.outputs(b).iter().for_each(|&output| add(output));
        }
        if c != a && c != b {
            touching.outputs(c).iter().for_each(|&output| add(output));
        }
        if group != NONE && clusters.is_thin(group) {
            near.retain(|&output| clusters.outputs[output as usize].group == group);
        }
        let cuts = if area > 4.0 * face { 4 } else { 1 + usize::from(area > face) };
        let weight = (area / (cuts * cuts) as f64) as f32;
        let [a, b, c] = corners;
        for (s, t) in centers(cuts) {
            let p = add_scaled(add_scaled(a, s, sub(b, a)), t, sub(c, a));
            let nearest = places.nearest(p, n, &near, &mut bounds);
            samples.extend(nearest.map(|(output, distance2, at)| {
                let at = at.map(|x| x as f32);
                Sample { source, output, at, distance: distance2.sqrt() as f32, weight }
            }));
        }
    }
    samples
}

fn unit(v: Vec3) -> Vec3 {
    let size = length(v);
    v.map(|x| if size > 0.0 { x / size } else { 0.0 })
}

/// A triangle of the level.
struct Place {
    corners: [Vec3; 3],
    normal: Vec3,
}

/// What holds a triangle of the level, and its normal; the fourth numbers are 0.
#[derive(Clone, Copy)]
struct Outline {
    min: [f32; 4],
    max: [f32; 4],
    normal: [f32; 4],
}

impl Outline {
    /// The square of the distance of a point, at least.
    fn distance2(&self, p: [f32; 4]) -> f32 {
        let beyond: [f32; 4] = std::array::from_fn(|k| (self.min[k] - p[k]).max(p[k] - self.max[k]).max(0.0));
        dot4(beyond, beyond)
    }
}

fn dot4(a: [f32; 4], b: [f32; 4]) -> f32 {
    let [x, y, z, w]: [f32; 4] = std::array::from_fn(|k| a[k] * b[k]);
    (x + z) + (y + w)
}

/// Rounded.
fn narrow([x, y, z]: Vec3) -> [f32; 4] {
    [x as f32, y as f32, z as f32, 0.0]
}

/// The triangles of a level. What is rounded to f32 only tells which need not be looked at: it is slack enough that
/// nothing that is near is left out.
struct Places {
    places: Vec<Place>,
    outlines: Vec<Outline>,
    /// A face of a cell times [`TURNED`].
    turned: f64,
}

/// Relative slack of what is computed in f32 from a few rounded numbers.
const SLACK: f64 = 1e-5;

impl Places {
    fn of(points: &[Vec3], clusters: &Clusters) -> Self {
        let all = clusters.outputs.iter().map(|output| output.corners.map(|corner| points[corner as usize]));
        let places: Vec<Place> = all.map(|corners| Place { corners, normal: unit(area_vector(corners)) }).collect();
        // The box and the point that is looked at are both rounded.
        let largest = points.as_flattened().iter().fold(0.0f64, |most, x| most.max(x.abs()));
        let slack = 4.0 * f64::from(f32::EPSILON) * largest;
        let outline = |Place { corners: [a, b, c], normal }: &Place| Outline {
            min: narrow(std::array::from_fn(|k| a[k].min(b[k]).min(c[k]) - slack)),
            max: narrow(std::array::from_fn(|k| a[k].max(b[k]).max(c[k]) + slack)),
            normal: narrow(*normal),
        };
        let outlines = places.iter().map(outline).collect();
        Self { places, outlines, turned: TURNED * clusters.size * clusters.size }
    }

    /// The nearest to `p` on a triangle of normal `n` of some, what is turned counted as farther away: its number, the
    /// square of its distance, and the weights of its corners there. Of equal ones the first. `bounds` is overwritten.
    fn nearest(&self, p: Vec3, n: Vec3, near: &[u32], bounds: &mut Vec<f32>) -> Option<(u32, f64, Vec3)> {
        let (point, normal, turned) = (narrow(p), narrow(n), self.turned as f32);
        let bound = |&output: &u32| {
            let outline = self.outlines[output as usize];
            outline.distance2(point) + turned * (1.0 - SLACK as f32 - dot4(normal, outline.normal))
        };
        bounds.clear();
        bounds.extend(near.iter().map(bound));
        let distance = |number: usize| {
            let place = &self.places[near[number] as usize];
            distance2(p, &place.corners) + self.turned * (1.0 - dot(n, place.normal))
        };
        // What is likely the nearest at first: others are then known to be farther away.
        let first = (0..bounds.len()).reduce(|best, k| if bounds[k] < bounds[best] { k } else { best })?;
        let (mut best, mut least) = (first, distance(first));
        let most = |least: f64| (least * (1.0 + SLACK)) as f32;
        let mut enough = most(least);
        for (number, &bound) in bounds.iter().enumerate() {
            if bound > enough || number == first {
                continue;
            }
            let distance = distance(number);
            if distance < least || distance == least && number < best {
                (best, least) = (number, distance);
                enough = most(least);
            }
        }
        let (distance2, at) = closest(p, &self.places[near[best] as usize].corners);
        Some((near[best], distance2, at))
    }
}

/// Centres of the parts of a triangle whose edges are cut in so many, along its first and second edge.
fn centers(cuts: usize) -> impl Iterator<Item = (f64, f64)> {
    let size = 1.0 / cuts as f64;
    let at = move |i: usize, j: usize, third: f64| ((i as f64 + third) * size, (j as f64 + third) * size);
    let upright = (0..cuts).flat_map(move |i| (0..cuts - i).map(move |j| at(i, j, 1.0 / 3.0)));
    let turned = (1..cuts).flat_map(move |i| (0..cuts - i).map(move |j| at(i - 1, j, 2.0 / 3.0)));
    upright.chain(turned)
}
