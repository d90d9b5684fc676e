//! A measurement: a line of `rows.jsonl`.

use super::plan::{Job, Way, base, rays};
use super::view::{Party, Picture};
use crate::counters::Record;
use crate::lab::bench::store::{Entry, median};
use crate::metrics::{Image, PIXELS_PER_DEGREE, flip_ldr, pixel_errors};
use crate::session::Settings;
use crate::settings::Group;
use anyhow::Result;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What a way took in a view with a cache, and how far its picture is from the exact one and from the converged one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// What it is told from others by.
    pub key: String,
    /// Name of the scene file.
    pub scene: String,
    /// Number of the view.
    pub view: u32,
    /// The effect.
    pub effect: String,
    /// What answered its rays.
    pub method: String,
    /// The source of error that is less than where this is empty, in a study of sources.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub source: String,
    /// Settings that are not those of `--quality exact`, by their keys.
    pub settings: BTreeMap<String, String>,
    /// Percent of all bricks that the cache was asked to hold.
    pub cache_percent: u32,
    /// Bytes that it held.
    pub cache_bytes: u64,
    /// Whether every picture began with an empty cache.
    pub cold: bool,
    /// Rays of the effect a pixel.
    pub rays_per_pixel: u32,
    /// Median over turns, with everything that a picture needs.
    pub seconds_frame: f64,
    /// 95 of 100 took no longer.
    pub seconds_p95: f64,
    /// Before the first picture.
    pub seconds_making: f64,
    /// Camera rays of a picture.
    #[serde(default)]
    pub rays_camera: u64,
    /// Rays of a picture that were traced.
    pub rays_traced: u64,
    /// Rays of a picture that a method answered.
    pub rays_answered: u64,
    /// Query pairs of a picture.
    #[serde(default)]
    pub queries: u64,
    /// Bytes that a picture loaded; of those that begin with a cache as it was left, the mean.
    pub bytes_loaded: f64,
    /// Mean FLIP against the exact picture of the same rays.
    pub flip_same: f64,
    /// relMSE against it.
    pub relmse_same: f64,
    /// Mean of the difference from it, as a share of its mean.
    pub bias_same: f64,
    /// Mean FLIP against the converged picture.
    pub flip_converged: f64,
    /// relMSE against it.
    pub relmse_converged: f64,
    /// Mean FLIP of the exact picture of as many rays against the converged one.
    pub noise_flip: f64,
    /// What renders such a picture: it is the frame with the number of the view.
    pub command: String,
    /// Of the program.
    pub commit: String,
    /// Name of what rendered.
    pub adapter: String,
}

impl Entry for Row {
    fn key(&self) -> String {
        self.key.clone()
    }
}

/// The turns of a party that count.
#[derive(Default)]
pub struct Turns {
    seconds: Vec<f64>,
    loaded: Vec<u64>,
    last: Option<Picture>,
}

impl Turns {
    /// Notes one.
    pub fn note(&mut self, picture: Picture) {
        self.seconds.push(picture.seconds);
        self.loaded.push(picture.records.iter().map(Record::loaded_bytes).sum());
        self.last = Some(picture);
    }

    /// The last picture.
    pub fn image(&self) -> Option<&Image> {
        self.last.as_ref().map(|picture| &picture.image)
    }
}

/// What was measured of a party.
pub struct Measured<'a> {
    /// The job.
    pub job: &'a Job,
    /// The party.
    pub party: &'a Party,
    /// Its turns.
    pub turns: &'a Turns,
    /// The exact picture of the same rays.
    pub same: &'a Image,
    /// The converged picture.
    pub converged: &'a Image,
    /// Name of the scene file.
    pub scene: &'a str,
    /// The path of the scene file, and that of the camera path, as the command has them.
    pub files: (&'a str, Option<&'a str>),
    /// Views along the path.
    pub views: u32,
    /// Bytes of the cache.
    pub cache_bytes: u64,
    /// Name of what rendered.
    pub adapter: &'a str,
}

/// The value that a share of all values are not above, by linear interpolation.
fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let Some(last) = values.len().checked_sub(1) else { return 0.0 };
    let at = share * last as f64;
    let below = values[at as usize];
    below + (values[at.ceil() as usize] - below) * at.fract()
}

/// Settings that are not those of `--quality exact`.
fn chosen(settings: &Settings) -> BTreeMap<String, String> {
    let exact = Settings::exact();
    let own = |key: &str| settings.get(key).filter(|own| exact.get(key).as_ref() != Some(own));
    let named = |key: String| own(&key).map(|value| (key, value.to_string()));
    Settings::entries().into_iter().filter_map(|entry| named(entry.key())).collect()
}

impl Measured<'_> {
    /// As a line.
    ///
    /// # Errors
    /// Pictures of different sizes.
    pub fn row(&self) -> Result<Row> {
        let Self { job, party, turns, same, converged, scene, files: (file, path), views, cache_bytes, adapter } =
            *self;
        let Way { method, rays: rays_per_pixel, options, source } = &party.way;
        let records = turns.last.as_ref().map_or(&[][..], |picture| &picture.records);
        let sum = |value: fn(&Record) -> u64| records.iter().map(value).sum::<u64>();
        let image = turns.image().unwrap_or(same);
        let [of_same, of_converged] = [pixel_errors(image, same)?, pixel_errors(image, converged)?];
        let flip = |a: &Image, b: &Image| Ok::<f64, anyhow::Error>(flip_ldr(a, b, PIXELS_PER_DEGREE)?.mean());
        let values = same.rgb.as_flattened();
        let mean = values.iter().map(|&x| f64::from(x)).sum::<f64>() / values.len().max(1) as f64;
        let text = format!(
            "brickwalk walk {} -o OUT --quality exact {} {} {options} --cache {}% --size {} --frames {}{}",
            file,
            base(job.effect),
            rays(job.effect, *rays_per_pixel),
            job.cache,
            party.settings.size,
            views,
            path.map_or(String::new(), |path| format!(" --path {path}"))
        );
        Ok(Row {
            key: job.key(&party.way),
            scene: scene.into(),
            view: job.view,
            effect: job.effect.name().into(),
            method: (*method).into(),
            source: (*source).into(),
            settings: chosen(&party.settings),
            cache_percent: job.cache,
            cache_bytes,
            cold: job.is_cold,
            rays_per_pixel: *rays_per_pixel,
            seconds_frame: median(turns.seconds.clone()).unwrap_or(0.0),
            seconds_p95: quantile(turns.seconds.clone(), 0.95),
            seconds_making: party.making,
            rays_camera: sum(|record| if record.pass == "primary" { record.rays() } else { 0 }),
            rays_traced: sum(|record| record.rays_traced),
            rays_answered: sum(|record| record.rays_answered),
            queries: sum(|record| record.queries()),
            bytes_loaded: turns.loaded.iter().sum::<u64>() as f64 / turns.loaded.len().max(1) as f64,
            flip_same: flip(image, same)?,
            relmse_same: of_same.rel_mse,
            bias_same: if mean > 0.0 { of_same.bias / mean } else { 0.0 },
            flip_converged: flip(image, converged)?,
            relmse_converged: of_converged.rel_mse,
            noise_flip: flip(same, converged)?,
            command: text.split_whitespace().collect::<Vec<_>>().join(" "),
            commit: env!("BRICKWALK_COMMIT").into(),
            adapter: adapter.into(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_values() {
        assert_eq!(quantile(vec![], 0.95), 0.0);
        assert_eq!(quantile(vec![7.0], 0.95), 7.0);
        assert_eq!(quantile(vec![3.0, 1.0, 2.0], 0.5), 2.0);
        assert_eq!(quantile((0..=100).map(f64::from).collect(), 0.95), 95.0);
    }

    #[test]
    fn settings_are_named_that_are_not_exact() {
        let settings = Settings::from_options("--quality exact --spp 4 --secondary ao=roma").unwrap();
        let found = chosen(&settings);
        assert_eq!(found.get("spp").map(String::as_str), Some("4"));
        assert!(found.contains_key("secondary") && !found.contains_key("exposure"), "{found:?}");
    }
}
