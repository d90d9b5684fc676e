//! How wrong hits are, against the distance from the origin and against scale: this program's arithmetic beside what it
//! replaces.
//!
//! A closed bumpy sphere on a lattice, truth by exact predicates in f64. Each contender is given the same rays in f64
//! and rounds them and the vertices as it would: to f32 relative to the world's origin, or relative to a reference
//! point near the eye. All triangles are tested, so that no tree takes part.
//!
//! Expected: a coordinate of size D is rounded by u·D, u = 2⁻²⁴. In world space this is the error of a vertex and of
//! the origin, so the relative error of a hit at distance r grows as u·D/r, 24 − log₂(r/(u·D)) bits of 24 are lost, and
//! nothing is left where D is 2²⁴ r. Relative to a reference point, positions of the lattice are exact up to 2²⁴ steps
//! and D has no part in it.

use super::args::SelftestArgs;
use crate::lab::bench::results::plot;
use crate::lab::console::Console;
use crate::math::exact::{intersect_triangle, ray_frame};
use crate::output::atomic;
use crate::reference::{Truth, TruthInstance, TruthObject, TruthRay, TruthTriangle};
use anyhow::Result;
use brickwalk_report::{Graph, Section, Sheet, Table, Unit, Value, write_sheet};
use brickwalk_scenes::{Rng, Stiff, stiff};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::fmt::Write;

/// Rays of each kind in each place.
const RAYS: usize = 12_000;
/// Steps of the lattice in a radius.
const STEPS: f64 = 16_384.0;
/// Steps between reference points.
const CELL: f64 = 1_048_576.0;

/// Who tests a triangle, and where coordinates are relative to.
#[derive(Clone, Copy)]
struct Contender {
    name: &'static str,
    is_local: bool,
    is_woop: bool,
}

const CONTENDERS: [Contender; 4] = [
    Contender { name: "brickwalk", is_local: true, is_woop: true },
    Contender { name: "Möller–Trumbore, relative", is_local: true, is_woop: false },
    Contender { name: "f32 world space", is_local: false, is_woop: true },
    Contender { name: "Möller–Trumbore, world", is_local: false, is_woop: false },
];

/// A sphere of `radius` at (`distance`, 0, 0).
struct Place {
    truth: Truth,
    vertices: Vec<[DVec3; 3]>,
    middle: DVec3,
    reference: DVec3,
    radius: f64,
}

impl Place {
    fn new(radius_log2: i32, distance: f64, seed: u64) -> Result<Self> {
        let radius = f64::from(radius_log2).exp2();
        let step = radius / STEPS;
        let primitive = stiff(Stiff::Shell, 2, seed).meshes.remove(0).primitives.remove(0);
        // The nearest place at which a reference point can be.
        let cells = (distance / (step * CELL)).round();
        let middle = DVec3::X * (cells * CELL * step);
        let shift = (cells * CELL) as i64;
        let corner = |&i: &u32| {
            let [x, y, z] = primitive.positions[i as usize].map(|x| (x * STEPS).round() as i64);
            [x + shift, y, z]
        };
        let triangle = |(id, t): (u32, &[u32])| TruthTriangle {
            local_id: id,
            rotation: 0,
            vertices: [corner(&t[0]), corner(&t[1]), corner(&t[2])],
            opacity: None,
        };
        let triangles: Vec<TruthTriangle> = (0..).zip(primitive.indices.chunks(3)).map(triangle).collect();
        let world = |v: [i64; 3]| DVec3::from(v.map(|x| x as f64)) * step;
        let vertices = triangles.iter().map(|t| t.vertices.map(world)).collect();
        let object = TruthObject::new(radius_log2 - STEPS.log2() as i32, triangles);
        let truth = Truth::new(vec![object], vec![TruthInstance { object: 0, base: 0, world_from_object: None }])?;
        Ok(Self { truth, vertices, middle, reference: middle, radius })
    }

    fn point(&self, rng: &mut Rng, kind: usize) -> DVec3 {
        let [a, b, c] = self.vertices[rng.int(0, self.vertices.len() as i64 - 1) as usize];
        match kind {
            0 => a,
            1 => a + rng.unit() * (b - a),
            _ => {
                let (s, t) = (rng.range(0.1, 0.45), rng.range(0.1, 0.45));
                a + s * (b - a) + t * (c - a)
            }
        }
    }
}

/// A ray as contenders are given it.
#[derive(Clone, Copy)]
struct Given {
    origin: DVec3,
    direction: DVec3,
}

/// The nearest hit that a contender finds: triangle and distance in world units.
fn nearest(place: &Place, who: Contender, ray: Given) -> Option<(usize, f64)> {
    let reference = if who.is_local { place.reference } else { DVec3::ZERO };
    let o = (ray.origin - reference).as_vec3();
    let d = ray.direction.as_vec3();
    let frame = ray_frame(d.to_array());
    let mut best: Option<(usize, f32)> = None;
    for (index, triangle) in place.vertices.iter().enumerate() {
        let [a, b, c] = triangle.map(|v| (v - reference).as_vec3() - o);
        let t = if who.is_woop {
            let hit = intersect_triangle(&frame, a.to_array(), b.to_array(), c.to_array(), 0.0);
            hit.hit.then_some(hit.t)
        } else {
            moller_trumbore(d, a, b, c)
        };
        if let Some(t) = t
            && best.is_none_or(|(_, nearest)| t < nearest)
        {
            best = Some((index, t));
        }
    }
    best.map(|(index, t)| (index, f64::from(t) * d.as_dvec3().length()))
}

/// Möller and Trumbore 1997, both sides, from the origin.
fn moller_trumbore(d: Vec3, a: Vec3, b: Vec3, c: Vec3) -> Option<f32> {
    let (ab, ac) = (b - a, c - a);
    let p = d.cross(ac);
    let det = ab.dot(p);
    if det == 0.0 {
        return None;
    }
    let v = -a.dot(p) / det;
    let q = (-a).cross(ab);
    let w = d.dot(q) / det;
    let t = ac.dot(q) / det;
    (v >= 0.0 && w >= 0.0 && v + w <= 1.0 && t >= 0.0).then_some(t)
}

/// What one contender gets wrong in one place.
#[derive(Clone, Copy, Default)]
struct Wrong {
    /// Bits of 24 that the middle of all hits has lost, and the worst one.
    bits: f64,
    worst_bits: f64,
    /// In percent.
    triangle: f64,
    false_miss: f64,
    false_hit: f64,
}

/// What truth says of a ray: the triangle and the distance.
fn exactly(place: &Place, ray: &Given) -> Option<(usize, f64)> {
    let truth_ray = TruthRay::new(ray.origin.to_array(), ray.direction.to_array(), 0.0, f64::INFINITY);
    place.truth.closest(&truth_ray).map(|hit| (hit.id as usize, hit.t * ray.direction.length()))
}

fn measure(place: &Place, seed: u64) -> [Wrong; 4] {
    let mut rng = Rng::new(seed, &[70]);
    let inside = |rng: &mut Rng| place.middle + 0.6 * place.radius * rng.unit() * rng.direction();
    let through = |origin: DVec3, to: DVec3| Given { origin, direction: (to - origin).normalize() };
    let mut aimed = |kind: fn(usize) -> usize| -> Vec<Given> {
        let one = |i| {
            let (from, to) = (inside(&mut rng), place.point(&mut rng, kind(i)));
            through(from, to)
        };
        (0..RAYS).map(one).collect()
    };
    // At edges and vertices, from inside: every ray meets the closed mesh.
    let at_edges = aimed(|i| i % 2);
    // At insides of triangles.
    let at_insides = aimed(|_| 2);
    // Past the mesh's farthest vertex in some direction, by 10⁻⁶ to 10⁻² of the radius, across that direction.
    let past: Vec<Given> = (0..RAYS)
        .map(|_| {
            let out = rng.direction();
            let farthest =
                place.vertices.as_flattened().iter().copied().max_by(|a, b| a.dot(out).total_cmp(&b.dot(out)));
            let gap = place.radius * 10f64.powf(rng.range(-6.0, -2.0));
            let side = out.any_orthonormal_vector();
            let over = farthest.unwrap_or_default() + gap * out;
            Given { origin: over + 3.0 * place.radius * side, direction: -side }
        })
        .collect();
    let truth_inside: Vec<_> = at_insides.par_iter().map(|ray| exactly(place, ray)).collect();
    let missing: Vec<&Given> = past.par_iter().filter(|ray| exactly(place, ray).is_none()).collect();
    let percent = |wrong: usize, of: usize| 100.0 * wrong as f64 / of.max(1) as f64;
    CONTENDERS.map(|who| {
        let misses = at_edges.par_iter().filter(|ray| nearest(place, who, **ray).is_none()).count();
        let hits = missing.par_iter().filter(|ray| nearest(place, who, ***ray).is_some()).count();
        let found: Vec<_> = at_insides.par_iter().map(|ray| nearest(place, who, *ray)).collect();
        let pairs =
            || found.iter().zip(&truth_inside).filter_map(|(found, truth)| Some((found.as_ref()?, truth.as_ref()?)));
        let wrong = pairs().filter(|(found, truth)| found.0 != truth.0).count();
        let lost = |(found, truth): (&(usize, f64), &(usize, f64))| {
            (1.0 + (found.1 - truth.1).abs() / truth.1.max(0.1 * place.radius) * 16_777_216.0).log2()
        };
        let mut bits: Vec<f64> = pairs().filter(|(found, truth)| found.0 == truth.0).map(lost).collect();
        bits.sort_by(f64::total_cmp);
        Wrong {
            bits: bits.get(bits.len() / 2).copied().unwrap_or(24.0),
            worst_bits: bits.last().copied().unwrap_or(24.0),
            triangle: percent(wrong, RAYS),
            false_miss: percent(misses, RAYS),
            false_hit: percent(hits, missing.len()),
        }
    })
}

/// A row of places.
struct Sweep {
    title: &'static str,
    across: &'static str,
    /// Where, as a number to plot over and in words, and what was found.
    rows: Vec<(f64, String, [Wrong; 4])>,
}

/// Runs the measurements and writes `errors.md` and `report.html` into `folder`.
///
/// # Errors
/// The folder cannot be written.
pub fn run(args: &SelftestArgs, folder: &std::path::Path, console: Console) -> Result<()> {
    atomic::create_folder(folder)?;
    let measured = |radius_log2: i32, distance: f64| -> Result<[Wrong; 4]> {
        Ok(measure(&Place::new(radius_log2, distance, args.seed)?, args.seed))
    };
    let mut far =
        Sweep { title: "Against the distance from the origin", across: "decades of the distance, m", rows: Vec::new() };
    for decade in 0..=8 {
        let distance = if decade == 0 { 0.0 } else { 10f64.powi(decade) };
        let words = if decade == 0 { "0".into() } else { format!("10^{decade} m") };
        far.rows.push((f64::from(decade), words, measured(0, distance)?));
    }
    let mut scale = Sweep {
        title: "Against scale, 1000 m from the origin",
        across: "decades of the radius, from 10^-4 m",
        rows: Vec::new(),
    };
    for decade in 0..=8 {
        let radius_log2 = (10f64.powi(decade - 4)).log2().round() as i32;
        scale.rows.push((f64::from(decade), format!("10^{} m", decade - 4), measured(radius_log2, 1000.0)?));
    }
    let sweeps = [far, scale];
    atomic::write(&folder.join("errors.md"), markdown(args, &sweeps).as_bytes())?;
    write_sheet(folder, &sheet(args, &sweeps))?;
    console.show(&format!("{} and report.html beside it\n", folder.join("errors.md").display()))
}

const READING: &str = "A closed bumpy sphere of 320 triangles, radius 1 m or as said, on a lattice of 2^-14 of its \
    radius, against exact predicates in f64. False misses: of rays from inside at vertices and points of edges, all of \
    which meet the closed mesh. Wrong triangle, and bits of distance lost (log2(1 + relative error / 2^-24), the \
    middle one, and the worst): of rays at insides of triangles. False hits: of rays that pass by at 10^-6 to 10^-2 of \
    the radius, all of which miss.";

fn table(sweep: &Sweep) -> Table {
    let columns = ["place", "arithmetic", "bits lost", "worst", "wrong triangle", "false misses", "false hits"];
    let mut rows = Vec::new();
    for (_, words, found) in &sweep.rows {
        for (who, wrong) in CONTENDERS.iter().zip(found) {
            let share = |x: f64| Value::Text(if x == 0.0 { "0".into() } else { format!("{x:.2} %") });
            rows.push(vec![
                words.as_str().into(),
                who.name.into(),
                Value::Text(format!("{:.1}", wrong.bits)),
                Value::Text(format!("{:.1}", wrong.worst_bits)),
                share(wrong.triangle),
                share(wrong.false_miss),
                share(wrong.false_hit),
            ]);
        }
    }
    Table { name: "errors".into(), caption: String::new(), columns: columns.map(String::from).to_vec(), rows }
}

fn plots(sweep: &Sweep) -> Vec<Graph> {
    let graph = |title: &str, unit: Unit, of: fn(&Wrong) -> f64| {
        let line = |(k, who): (usize, &Contender)| {
            (who.name.to_string(), sweep.rows.iter().map(|(x, _, found)| (*x, of(&found[k]))).collect())
        };
        plot(title.into(), "", sweep.across, unit, CONTENDERS.iter().enumerate().map(line).collect())
    };
    vec![
        graph("Bits of distance lost, of 24", Unit::Count, |wrong| wrong.bits),
        graph("Wrong triangle", Unit::Percent, |wrong| wrong.triangle),
        graph("False misses", Unit::Percent, |wrong| wrong.false_miss),
        graph("False hits", Unit::Percent, |wrong| wrong.false_hit),
    ]
}

fn sheet(args: &SelftestArgs, sweeps: &[Sweep]) -> Sheet {
    let section = |sweep: &Sweep| Section {
        title: sweep.title.into(),
        reading: READING.into(),
        tables: vec![table(sweep)],
        plots: plots(sweep),
        ..Section::default()
    };
    Sheet {
        kicker: "brickwalk · selftest --errors".into(),
        title: "How wrong hits are".into(),
        verdicts: Vec::new(),
        facts: vec![("Rays of each kind".into(), RAYS.to_string()), ("Seed".into(), args.seed.to_string())],
        sections: sweeps.iter().map(section).collect(),
    }
}

fn markdown(args: &SelftestArgs, sweeps: &[Sweep]) -> String {
    let mut text = format!("# How wrong hits are\n\n{READING}\n\n");
    // Writing to a string does not fail.
    let _ = writeln!(
        text,
        "{RAYS} rays of each kind, seed {}; `brickwalk selftest --errors DIR` makes this and the plots.",
        args.seed
    );
    for sweep in sweeps {
        let _ = write!(text, "\n## {}\n\n{}", sweep.title, table(sweep).to_markdown());
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_design_is_exact_where_others_are_not() {
        let [ours, moller, world, _] = measure(&Place::new(0, 1e6, 1).unwrap(), 1);
        assert_eq!([ours.false_miss, ours.false_hit, ours.triangle], [0.0; 3]);
        assert!(ours.bits < 3.0 && world.bits > 10.0, "{} {}", ours.bits, world.bits);
        assert!(moller.false_miss > 1.0 && world.false_hit > 10.0, "{} {}", moller.false_miss, world.false_hit);
    }
}
