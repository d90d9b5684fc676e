//! `brickwalk query`: what rays meet, and what is near to points.

use super::cached;
use super::options::query_args::{Kind, QueryArgs};
use crate::cli::output::print_json;
use crate::output::npy::{self, Hit, Ray, Rays, Rows};
use crate::query::{Closest, Queries, Watch};
use crate::remote;
use crate::session::open_unmapped;
use crate::session::trace::check;
use anyhow::{Context, Result};
use bricks::SceneFile;
use brickwalk_convert::progress::Progress;
use std::path::Path;
use std::sync::Arc;

/// Runs the command.
///
/// # Errors
/// Bad rays or points, by their row; a bad scene, cache or output; a damaged brick; the device's.
pub fn run(args: &QueryArgs) -> Result<()> {
    let start = std::time::Instant::now();
    // Said before the work rather than after it.
    let input = Input::read(args)?;
    let path = &cached::scene(&args.scene)?;
    let scene = open_unmapped(path)?;
    let progress = Progress::new();
    progress.phase(input.name(), input.len());
    let (answers, stats) = ask(args, scene, &input, &progress).with_context(|| path.display().to_string())?;
    progress.finish();
    answers.write(&args.output, input.shape())?;
    if args.json {
        let mut report = serde_json::json!({ "format": 1, input.name(): input.len() });
        if let (Some(report), serde_json::Value::Object(stats)) = (report.as_object_mut(), stats) {
            report.extend(stats);
            report.insert("seconds".into(), start.elapsed().as_secs_f64().into());
            if let Some(traffic) = remote::traffic(path) {
                report.insert("remote".into(), serde_json::json!(traffic));
            }
        }
        print_json(&report)?;
    }
    Ok(())
}

/// What is asked about.
enum Input {
    Rays(Rays),
    Points(Rows<[f64; 3]>),
    Pairs(Rows<[[f64; 3]; 2]>),
}

impl Input {
    fn read(args: &QueryArgs) -> Result<Self> {
        let file = &args.input;
        let bad = |row: usize| format!("{}: row {row}", file.display());
        let finite = |points: &[[f64; 3]], each: usize| {
            let wrong = points.iter().position(|point| point.iter().any(|x| !x.is_finite()));
            wrong.map_or(Ok(()), |number| Err(anyhow::anyhow!("a point must be finite")).context(bad(number / each)))
        };
        match args.kind {
            Kind::Cast | Kind::Any | Kind::Count | Kind::All => {
                let rays = npy::read_rays(file)?;
                rays.rays.iter().enumerate().try_for_each(|(row, ray)| check(ray).with_context(|| bad(row)))?;
                Ok(Self::Rays(rays))
            }
            Kind::Closest | Kind::Distance | Kind::SignedDistance | Kind::Occupancy => {
                let points = npy::read_points(file)?;
                finite(&points.rows, 1)?;
                Ok(Self::Points(points))
            }
            Kind::Visibility => {
                let pairs = npy::read_pairs(file)?;
                finite(pairs.rows.as_flattened(), 2)?;
                Ok(Self::Pairs(pairs))
            }
        }
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Rays(_) => "rays",
            Self::Points(_) => "points",
            Self::Pairs(_) => "pairs",
        }
    }

    fn shape(&self) -> &[u64] {
        match self {
            Self::Rays(Rays { shape, .. }) | Self::Points(Rows { shape, .. }) | Self::Pairs(Rows { shape, .. }) => {
                shape
            }
        }
    }

    fn len(&self) -> u64 {
        self.shape().iter().product()
    }
}

/// What was found.
enum Answers {
    Hits(Vec<Hit>),
    Truths(Vec<bool>),
    Counts(Vec<u32>),
    All(crate::query::Intersections),
    Closest(Vec<Closest>),
    Distances(Vec<f64>),
}

/// By queries.
fn ask(
    args: &QueryArgs,
    scene: Arc<SceneFile>,
    input: &Input,
    progress: &Progress,
) -> Result<(Answers, serde_json::Value)> {
    let queries = Queries::new(scene, args.cache, args.threads.unwrap_or(0) as usize)?;
    let mut advance = |done: u64| {
        progress.advance(done);
        Ok(())
    };
    let watch: &mut Watch = &mut advance;
    let answers = match input {
        Input::Rays(rays) => of_rays(&queries, args.kind, &rays.rays, watch)?,
        Input::Points(points) => of_points(&queries, args, &points.rows, watch)?,
        Input::Pairs(pairs) => {
            let [from, to] = [0, 1].map(|end| pairs.rows.iter().map(|pair| pair[end]).collect::<Vec<_>>());
            Answers::Truths(queries.visibility(&from, &to, watch)?)
        }
    };
    let stats = queries.stats();
    let stats = serde_json::json!({
        "payloads_read": stats.payloads_read,
        "bytes_read": stats.bytes_read,
        "most_bytes": stats.most_bytes,
    });
    Ok((answers, stats))
}

fn of_rays(queries: &Queries, kind: Kind, rays: &[Ray], watch: &mut Watch) -> Result<Answers> {
    Ok(match kind {
        Kind::Cast => Answers::Hits(queries.cast(rays, watch)?),
        Kind::Any => Answers::Truths(queries.any(rays, watch)?),
        Kind::All => Answers::All(queries.list_intersections(rays, watch)?),
        _ => Answers::Counts(queries.count_intersections(rays, watch)?),
    })
}

fn of_points(queries: &Queries, args: &QueryArgs, points: &[[f64; 3]], watch: &mut Watch) -> Result<Answers> {
    Ok(match args.kind {
        Kind::Occupancy => Answers::Truths(queries.occupancy(points, args.allow_open, watch)?),
        Kind::SignedDistance => Answers::Distances(queries.signed_distance(points, args.allow_open, watch)?),
        Kind::Distance => Answers::Distances(queries.distance(points, watch)?),
        _ => Answers::Closest(queries.closest_points(points, watch)?),
    })
}

impl Answers {
    fn write(&self, file: &Path, shape: &[u64]) -> Result<()> {
        match self {
            Self::Hits(hits) => npy::write_hits(file, hits, shape, true),
            Self::Truths(truths) => npy::write_any(file, truths, shape),
            Self::Counts(counts) => npy::write_numbers(file, "<u4", &little(counts, u32::to_le_bytes), shape),
            Self::Distances(all) => npy::write_numbers(file, "<f8", &little(all, f64::to_le_bytes), shape),
            Self::Closest(all) => {
                let fields = [
                    ("point", "<f8", 3),
                    ("distance", "<f8", 1),
                    ("triangle", "<u4", 1),
                    ("u", "<f4", 1),
                    ("v", "<f4", 1),
                    ("normal", "<f4", 3),
                ];
                let mut data = Vec::with_capacity(56 * all.len());
                for Closest { point, distance, triangle, u, v, normal } in all {
                    data.extend(little(point, f64::to_le_bytes));
                    data.extend(distance.to_le_bytes());
                    data.extend(triangle.to_le_bytes());
                    data.extend(little(&[*u, *v], f32::to_le_bytes));
                    data.extend(little(normal, f32::to_le_bytes));
                }
                npy::write_records(file, &fields, &data, shape)
            }
            Self::All(all) => {
                let fields = [
                    ("ray", "<u8", 1),
                    ("t", "<f8", 1),
                    ("triangle", "<u4", 1),
                    ("u", "<f4", 1),
                    ("v", "<f4", 1),
                    ("normal", "<f4", 3),
                ];
                let mut data = Vec::with_capacity(40 * all.hits.len());
                for (ray, ends) in (0u64..).zip(all.starts.windows(2)) {
                    for hit in &all.hits[ends[0] as usize..ends[1] as usize] {
                        data.extend(ray.to_le_bytes());
                        data.extend(hit.t.to_le_bytes());
                        data.extend(hit.triangle.to_le_bytes());
                        data.extend(little(&[hit.u, hit.v], f32::to_le_bytes));
                        data.extend(little(&hit.normal, f32::to_le_bytes));
                    }
                }
                npy::write_records(file, &fields, &data, &[all.hits.len() as u64])
            }
        }
    }
}

/// The bytes of numbers, the lowest first.
fn little<T: Copy, const N: usize>(numbers: &[T], bytes: impl Fn(T) -> [u8; N]) -> Vec<u8> {
    numbers.iter().flat_map(|&number| bytes(number)).collect()
}
