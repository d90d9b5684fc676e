//! `brickwalk study S.bricks`: error against run time. Every way to answer the rays of an effect, over its parameters
//! and sizes of the cache, in a scene of the caller's; what is fastest within an error; what does not pay.
//!
//! Ways that are compared take turns in one process. Errors are against the exact picture of the same rays and against
//! a converged one, so that bias and noise are told apart. Each finished measurement is a line of `rows.jsonl`, from
//! which alone tables, plots and the page are made.

pub mod args;
mod output;
mod pictures;
mod plan;
mod row;
mod view;

use super::bench::runner::Runner;
use super::bench::store::{Header, Store};
use super::console::Console;
use crate::metrics::Image;
use crate::output::atomic;
use crate::scene::{CameraPath, Picture as Framed};
use crate::session::{open_scene, viewpoint};
use anyhow::Result;
use args::{Effect, StudyArgs};
use plan::{Has, Job, USUAL, Way};
use row::{Measured, Row, Turns};
use serde_json::json;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::Path;
use view::{Fields, Party, Place, View};

/// Raised when a value changes its meaning.
const FORMAT: u32 = 1;

/// Converged pictures by effect and view.
type Converged = BTreeMap<(Effect, u32), Image>;

/// Runs the command.
///
/// # Errors
/// The folder holds other measurements or cannot be written; the scene cannot be read; the device's.
pub fn run(args: &StudyArgs, console: Console) -> Result<()> {
    let (scale, console) = (args.scale(), console.within(args.budget));
    let scene = open_scene(&args.scene)?;
    let resident = scene.resident();
    let has = Has {
        occupancy: !resident.occupancy.is_empty(),
        displacement: !resident.displacement.is_empty(),
        levels: !resident.levels.is_empty(),
    };
    let aspect = f64::from(scale.size.width) / f64::from(scale.size.height);
    let path = match &args.path {
        Some(file) => CameraPath::read(file)?,
        None => viewpoint::path(&scene, Framed { aspect, fov_y_degrees: None }),
    };
    let ways = |effect| {
        if args.attribute { plan::attributed(effect, has) } else { plan::ways(effect, has, args.quick) }
    };
    let mut jobs = plan::jobs(&scale, ways);
    // What is resident changes none of the sources.
    jobs.retain(|job| !(args.attribute && job.is_cold));
    atomic::create_folder(&args.output)?;
    let name = args.scene.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let own = json!({
        "scene": name,
        "triangles": resident.manifest.triangles_instanced,
        "path": path,
        "views": scale.views,
        "size": scale.size.to_string(),
        "samples": scale.samples,
        "repetitions": scale.repeat,
        "quick": args.quick,
        "attribute": args.attribute,
    });
    let header = Header::new(FORMAT, &args.adapter, own)?;
    let mut rows: Store<Row> = Store::open(args.output.join("rows.jsonl"), header, false)?;
    let place = Place { file: &args.scene, scene: &scene, path: &path, scale: &scale, adapter: &args.adapter, console };
    let adapter = rows.header.adapter["name"].as_str().unwrap_or_default().to_owned();
    let file = args.scene.display().to_string();
    let path_file = args.path.as_ref().map(|path| path.display().to_string());
    let named = Named { scene: &name, files: (&file, path_file.as_deref()), adapter: &adapter };
    let (mut converged, mut fields) = (Converged::new(), Fields::new()?);
    let mut runner = Runner::new(console);
    let keys = |job: &Job| job.ways.iter().map(|way| job.key(way)).collect();
    runner.measure(&mut rows, &jobs, keys, |job| {
        measure(place, job, (&mut converged, &mut fields), named, &args.output)
    })?;
    let planned = jobs.iter().map(|job| job.ways.len()).sum();
    let text = output::write(&args.output, &scale, &rows, planned)?;
    runner.end(&args.output, &text)
}

/// What rows name.
#[derive(Clone, Copy)]
struct Named<'a> {
    scene: &'a str,
    files: (&'a str, Option<&'a str>),
    adapter: &'a str,
}

/// Everything that is measured of the ways of a job.
fn measure(
    place: Place,
    job: &Job,
    (converged, fields): (&mut Converged, &mut Fields),
    named: Named,
    folder: &Path,
) -> Result<Vec<Row>> {
    let (scale, Named { scene, files, adapter }) = (place.scale, named);
    let mut view = View::open(place, job)?;
    if let Entry::Vacant(entry) = converged.entry((job.effect, job.view)) {
        // By other rays than those of the pictures.
        let mut party = view.party(job, &Way::new("exact", USUAL, ""), fields)?;
        entry.insert(view.picture(&mut party, scale.samples, 1, false)?.image);
    }
    let mut parties = job.ways.iter().map(|way| view.party(job, way, fields)).collect::<Result<Vec<_>>>()?;
    // In turns: a drift of the machine meets all ways alike. What the first turn of warm ones brings in is not counted.
    let mut turns: Vec<Turns> = job.ways.iter().map(|_| Turns::default()).collect();
    let first = u32::from(job.is_cold);
    for turn in first..=scale.repeat {
        for (party, turns) in parties.iter_mut().zip(&mut turns) {
            let picture = view.picture(party, 1, 0, job.is_cold)?;
            if turn > 0 {
                turns.note(picture);
            }
        }
    }
    let Some(converged) = converged.get(&(job.effect, job.view)) else { return Ok(Vec::new()) };
    let exact = |rays: u32| {
        let is = |party: &Party| party.way.method == "exact" && party.way.rays == rays;
        parties.iter().zip(&turns).find(|(party, _)| is(party)).and_then(|(_, turns)| turns.image())
    };
    let cache_bytes = view.cache_bytes();
    let mut found = Vec::new();
    for (party, turns) in parties.iter().zip(&turns) {
        let Some(same) = exact(party.way.rays) else { continue };
        let views = scale.views;
        let of = Measured { job, party, turns, same, converged, scene, files, views, cache_bytes, adapter };
        found.push((of.row()?, turns.image().unwrap_or(same)));
    }
    if pictures::are_of(job, scale) {
        pictures::write(folder, &found, converged)?;
    }
    Ok(found.into_iter().map(|(row, _)| row).collect())
}
