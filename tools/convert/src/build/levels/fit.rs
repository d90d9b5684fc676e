//! Fits the colours of a level to those of what it stands for.
//!
//! Means over cells are the start. They run together where they are interpolated, and what lies along a border counts
//! for less than it should, as its vertex lies at the end of its cell. A few steps toward the least squares of the
//! difference at the points of the level nearest to what it stands for mend both.

use super::cluster::{Clusters, Output, Touching};
use super::merge::Merged;
use super::nearest::closest;
use super::surface::Surface;
use super::vector::{CLASSES, Vec3, add_scaled, area_vector, class, dot, length, square, sub};
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
    let unit = |v: Vec3| {
        let size = length(v);
        v.map(|x| if size > 0.0 { x / size } else { 0.0 })
    };
    let place = |output: &Output| {
        let corners = output.corners.map(|corner| points[corner as usize]);
        let center = std::array::from_fn(|k| (corners[0][k] + corners[1][k] + corners[2][k]) / 3.0);
        let radius = corners.iter().map(|&corner| square(sub(corner, center))).fold(0.0, f64::max).sqrt();
        Place { corners, normal: unit(area_vector(corners)), center, radius }
    };
    let places: Vec<Place> = clusters.outputs.iter().map(place).collect();
    let face = clusters.size * clusters.size;
    let mut output_of = vec![NONE; clusters.spread.len()];
    (0u32..).zip(&clusters.outputs).for_each(|(number, output)| output_of[output.group as usize] = number);
    let mut samples = Vec::with_capacity(merged.triangles.len());
    let mut near: Vec<u32> = Vec::new();
    let mut seen_by = vec![NONE; clusters.outputs.len()];
    for (source, triangle) in (0u32..).zip(&merged.triangles) {
        let (area, group) = (surface.area[source as usize], clusters.group_of[source as usize]);
        if area <= 0.0 {
            continue;
        }
        near.clear();
        let mut add = |output: u32| {
            if std::mem::replace(&mut seen_by[output as usize], source) != source {
                near.push(output);
            }
        };
        // What it became first: others are then known to be farther away.
        if group != NONE {
            add(output_of[group as usize]);
        }
        for corner in triangle.corners {
            touching.outputs(clusters.cell_of[corner as usize]).iter().for_each(|&output| add(output));
        }
        if group != NONE && clusters.is_thin(group) {
            near.retain(|&output| clusters.outputs[output as usize].group == group);
        }
        let [a, b, c] = triangle.corners.map(|corner| points[corner as usize]);
        let n = unit(area_vector([a, b, c]));
        let cuts = if area > 4.0 * face { 4 } else { 1 + usize::from(area > face) };
        let weight = (area / (cuts * cuts) as f64) as f32;
        for (s, t) in centers(cuts) {
            let p = add_scaled(add_scaled(a, s, sub(b, a)), t, sub(c, a));
            let (mut least, mut root) = (f64::INFINITY, f64::INFINITY);
            let mut best = None;
            for &output in &near {
                let place = &places[output as usize];
                let turned = TURNED * face * (1.0 - dot(n, place.normal));
                if turned >= least || square(sub(p, place.center)) > (root + place.radius).powi(2) {
                    continue;
                }
                let (distance2, at) = closest(p, &place.corners);
                if distance2 + turned < least {
                    least = distance2 + turned;
                    root = least.sqrt();
                    let at = at.map(|x| x as f32);
                    best = Some(Sample { source, output, at, distance: distance2.sqrt() as f32, weight });
                }
            }
            samples.extend(best);
        }
    }
    samples
}

/// A triangle of the level.
struct Place {
    corners: [Vec3; 3],
    normal: Vec3,
    /// Of a ball that holds it.
    center: Vec3,
    radius: f64,
}

/// Centres of the parts of a triangle whose edges are cut in so many, along its first and second edge.
fn centers(cuts: usize) -> impl Iterator<Item = (f64, f64)> {
    let size = 1.0 / cuts as f64;
    let at = move |i: usize, j: usize, third: f64| ((i as f64 + third) * size, (j as f64 + third) * size);
    let upright = (0..cuts).flat_map(move |i| (0..cuts - i).map(move |j| at(i, j, 1.0 / 3.0)));
    let turned = (1..cuts).flat_map(move |i| (0..cuts - i).map(move |j| at(i - 1, j, 2.0 / 3.0)));
    upright.chain(turned)
}
