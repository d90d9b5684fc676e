//! Pictures of a study: of each effect the converged one, and of each method that of its best setting beside what FLIP
//! sees of its error.

use super::args::Scale;
use super::plan::Job;
use super::row::Row;
use crate::metrics::{Image, PIXELS_PER_DEGREE, flip_ldr};
use crate::output::{atomic, png, srgb};
use crate::picture::error_heat;
use crate::settings::sizes::counted;
use anyhow::Result;
use brickwalk_report::Shown;
use std::path::{Path, PathBuf};

/// Whether pictures of a job are kept: of the first view, with as much resident as is studied.
pub fn are_of(job: &Job, scale: &Scale) -> bool {
    job.view == 0 && !job.is_cold && scale.caches.iter().max() == Some(&job.cache)
}

/// Of each method the row that is nearest to the exact picture of the same rays, of those with as many rays as all
/// methods have.
fn best<'a>(rows: impl Iterator<Item = &'a Row> + Clone) -> Vec<&'a Row> {
    let mut methods: Vec<&str> = Vec::new();
    for row in rows.clone() {
        if !methods.contains(&&*row.method) {
            methods.push(&row.method);
        }
    }
    let of = |method: &&str| {
        let own = rows.clone().filter(|row| row.method == **method && row.rays_per_pixel == super::USUAL);
        own.min_by(|a, b| a.flip_same.total_cmp(&b.flip_same))
    };
    methods.iter().filter_map(of).collect()
}

/// The files of a method's picture and of its error.
fn files(folder: &Path, row: &Row) -> [PathBuf; 2] {
    let name = |what: &str| folder.join("pictures").join(format!("{}-{}{what}.png", row.effect, row.method));
    [name(""), name("-error")]
}

fn converged_file(folder: &Path, effect: &str) -> PathBuf {
    folder.join("pictures").join(format!("{effect}-converged.png"))
}

/// Writes those of a job.
///
/// # Errors
/// The folder cannot be written; pictures of different sizes.
pub fn write(folder: &Path, found: &[(Row, &Image)], converged: &Image) -> Result<()> {
    atomic::create_folder(&folder.join("pictures"))?;
    let (width, height) = (converged.width as u32, converged.height as u32);
    for row in best(found.iter().map(|(row, _)| row)) {
        let Some((_, image)) = found.iter().find(|(own, _)| own.key == row.key) else { continue };
        let [picture, error] = files(folder, row);
        png::write(&picture, width, height, &srgb::pixels(&image.rgb))?;
        let map = flip_ldr(image, converged, PIXELS_PER_DEGREE)?;
        let colours: Vec<[u8; 3]> = map.errors.iter().map(|&error| error_heat(error)).collect();
        png::write(&error, width, height, &colours)?;
        png::write(&converged_file(folder, &row.effect), width, height, &srgb::pixels(&converged.rgb))?;
    }
    Ok(())
}

/// Those that were written of the measurements of an effect, for the page.
pub fn shown(folder: &Path, rows: &[&Row]) -> Vec<Shown> {
    let shown = |file: PathBuf, caption: String| Some(Shown { caption, png: std::fs::read(file).ok()? });
    let Some(first) = rows.first() else { return Vec::new() };
    let converged = shown(converged_file(folder, &first.effect), format!("{}, converged", first.effect));
    let of = |row: &Row| {
        let [picture, error] = files(folder, row);
        let rays = counted(row.rays_per_pixel.into(), "ray");
        let caption = format!("{}, {rays}: {:.1} ms", row.method, 1e3 * row.seconds_frame);
        let errs = format!("its error: FLIP {:.4}, brighter is more", row.flip_converged);
        [shown(picture, caption), shown(error, errs)]
    };
    let methods = best(rows.iter().copied()).into_iter().flat_map(of);
    std::iter::once(converged).chain(methods).flatten().collect()
}
