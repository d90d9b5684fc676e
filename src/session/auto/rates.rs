//! The rates of devices: the file that `brickwalk calibrate` writes, and `--secondary auto` decides by.

use crate::kernels::DeviceInfo;
use crate::output::atomic;
use crate::settings::folder;
use anyhow::{Context, Result, bail};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use xxhash_rust::xxh3::xxh3_64;

/// Raised when rates mean something else.
const VERSION: u32 = 1;

/// What rays take on a device, in one scene or in any. Times are seconds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Rates {
    /// A camera ray, with what it shows.
    pub primary: f64,
    /// A byte that is loaded.
    pub byte: f64,
    /// A pixel that FLIP is measured of.
    pub flip: f64,
    /// A ray of an effect, traced.
    pub exact: BTreeMap<String, f64>,
    /// Methods.
    pub methods: Vec<MethodRate>,
}

/// What a method takes for the rays of an effect, and how it errs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MethodRate {
    /// Whose rays.
    pub effect: String,
    /// The name of a [`super::candidates::Candidate`].
    pub name: String,
    /// Seconds before the first frame.
    pub making: f64,
    /// Seconds a sample of a frame, whatever its rays.
    pub sample: f64,
    /// Seconds a ray.
    pub ray: f64,
    /// The least and the largest error over what was looked at: 100 √relMSE of the effect.
    pub percent: [f64; 2],
    /// The same: mean FLIP of the picture.
    pub flip_error: [f64; 2],
}

/// Rates of a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneRates {
    /// The name of its file, for people.
    pub name: String,
    /// The rates.
    pub rates: Rates,
}

/// Rates of a device.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DeviceRates {
    /// Of generated scenes, for those that have none of their own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub any: Option<Rates>,
    /// Of scenes, by their checksums.
    #[serde(default)]
    pub scenes: BTreeMap<String, SceneRates>,
}

/// The file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RateFile {
    version: u32,
    /// Devices, by [`device_key`].
    pub devices: BTreeMap<String, DeviceRates>,
}

/// The rates of a scene on a device.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The rates.
    pub rates: Rates,
    /// Whether they are the scene's own.
    pub is_own: bool,
    /// Of the rates: pictures depend on them.
    pub hash: u64,
}

/// What rates of a device are found by: its name, what it is reached through, and threads.
pub fn device_key(device: &DeviceInfo) -> String {
    format!("{} ({}), {} threads", device.name, device.backend, rayon::current_num_threads())
}

/// What rates of a scene are found by.
pub fn scene_key(checksum: u64) -> String {
    format!("{checksum:016x}")
}

/// The file in the user's folder for settings, where there is such a folder.
pub fn default_file() -> Option<PathBuf> {
    folder::settings().map(|folder| folder.join("rates.json"))
}

impl Default for RateFile {
    fn default() -> Self {
        Self { version: VERSION, devices: BTreeMap::new() }
    }
}

impl RateFile {
    /// Reads a file; `None`: there is none.
    ///
    /// # Errors
    /// It cannot be read, or is no file of rates.
    pub fn read(file: &Path) -> Result<Option<Self>> {
        let remedy = || format!("{}: not a file of rates; remove it, and run `brickwalk calibrate`", file.display());
        let bytes = match std::fs::read(file) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(error).with_context(|| format!("{}: cannot be read", file.display())),
        };
        let own: Self = serde_json::from_slice(&bytes).with_context(remedy)?;
        let all = own
            .devices
            .values()
            .flat_map(|device| device.any.iter().chain(device.scenes.values().map(|scene| &scene.rates)));
        if own.version != VERSION || !all.into_iter().all(Rates::is_sound) {
            bail!(remedy());
        }
        Ok(Some(own))
    }

    /// Writes it whole.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, file: &Path) -> Result<()> {
        if let Some(folder) = file.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            atomic::create_folder(folder)?;
        }
        atomic::write(file, (serde_json::to_string_pretty(self)? + "\n").as_bytes())
    }

    /// The rates of the scene of this checksum on a device: its own, else those of any scene.
    pub fn find(&self, device: &DeviceInfo, checksum: u64) -> Option<Found> {
        let device = self.devices.get(&device_key(device))?;
        let own = device.scenes.get(&scene_key(checksum)).map(|scene| &scene.rates);
        let rates = own.or(device.any.as_ref())?.clone();
        let text = serde_json::to_string(&rates).unwrap_or_default();
        Some(Found { is_own: own.is_some(), hash: xxh3_64(text.as_bytes()), rates })
    }
}

impl Rates {
    fn is_sound(&self) -> bool {
        let of_method = |rate: &MethodRate| {
            let [least, most] = rate.percent;
            let [least_flip, most_flip] = rate.flip_error;
            [rate.making, rate.sample, rate.ray, least, most, least_flip, most_flip]
        };
        let own = [self.primary, self.byte, self.flip];
        let all = own.into_iter().chain(self.exact.values().copied()).chain(self.methods.iter().flat_map(of_method));
        all.into_iter().all(|value| value.is_finite() && value >= 0.0)
    }

    /// The rate of a method.
    pub fn method(&self, effect: &str, name: &str) -> Option<&MethodRate> {
        self.methods.iter().find(|rate| rate.effect == effect && rate.name == name)
    }

    /// Rates that promise no more than these and `other` do: exact rays as fast as in the faster scene, methods as slow
    /// as in the slower one. Of methods that one of them lacks nothing is said.
    pub fn cautious(mut self, other: &Self) -> Self {
        self.byte = self.byte.min(other.byte);
        (self.primary, self.flip) = (self.primary.max(other.primary), self.flip.max(other.flip));
        for (effect, seconds) in &mut self.exact {
            *seconds = other.exact.get(effect).map_or(*seconds, |other| seconds.min(*other));
        }
        self.methods.retain_mut(|own| {
            let Some(other) = other.method(&own.effect, &own.name) else { return false };
            let union = |[a, b]: [f64; 2], [c, d]: [f64; 2]| [a.min(c), b.max(d)];
            own.making = own.making.max(other.making);
            own.sample = own.sample.max(other.sample);
            own.ray = own.ray.max(other.ray);
            own.percent = union(own.percent, other.percent);
            own.flip_error = union(own.flip_error, other.flip_error);
            true
        });
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rates(exact: f64, ray: f64) -> Rates {
        let method = MethodRate {
            effect: "ao".into(),
            name: "roma, 64 cells".into(),
            making: 0.0,
            sample: 0.1,
            ray,
            percent: [ray, 2.0 * ray],
            flip_error: [0.0, 0.1],
        };
        Rates { exact: [("ao".to_owned(), exact)].into(), methods: vec![method], ..Rates::default() }
    }

    fn device() -> DeviceInfo {
        DeviceInfo {
            name: "a card".into(),
            driver: String::new(),
            driver_info: String::new(),
            backend: "vulkan".into(),
            upload: "",
            timestamps: false,
        }
    }

    #[test]
    fn a_scenes_own_rates_come_first() {
        let mut file = RateFile::default();
        assert_eq!(file.find(&device(), 7), None);
        let own = file.devices.entry(device_key(&device())).or_default();
        own.any = Some(rates(1.0, 0.5));
        own.scenes.insert(scene_key(7), SceneRates { name: "S".into(), rates: rates(2.0, 0.5) });
        let found = file.find(&device(), 7).unwrap();
        assert!(found.is_own && found.rates == rates(2.0, 0.5));
        let other = file.find(&device(), 8).unwrap();
        assert!(!other.is_own && other.rates == rates(1.0, 0.5) && other.hash != found.hash);
        assert_eq!(file.find(&DeviceInfo { name: "another".into(), ..device() }, 7), None);
    }

    #[test]
    fn files_are_read_as_they_were_written_and_others_refused() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("a/rates.json");
        assert_eq!(RateFile::read(&name).unwrap(), None);
        let mut file = RateFile::default();
        file.devices.entry("a".into()).or_default().any = Some(rates(1e-7, 3e-8));
        file.write(&name).unwrap();
        assert_eq!(RateFile::read(&name).unwrap(), Some(file.clone()));
        let negative = serde_json::to_string(&file).unwrap().replace("1e-7", "-1e-7");
        let later = serde_json::to_string(&file).unwrap().replace("\"version\":1", "\"version\":99");
        for text in ["", "{}", "[1", negative.as_str(), later.as_str()] {
            std::fs::write(&name, text).unwrap();
            let error = RateFile::read(&name).unwrap_err();
            assert!(format!("{error:#}").contains("brickwalk calibrate"), "{text}: {error:#}");
        }
    }

    #[test]
    fn cautious_rates_promise_the_least() {
        let both = rates(1.0, 0.5).cautious(&rates(2.0, 0.7));
        assert_eq!((both.exact["ao"], both.methods[0].ray, both.methods[0].percent), (1.0, 0.7, [0.5, 1.4]));
        assert!(rates(1.0, 0.5).cautious(&Rates::default()).methods.is_empty());
    }
}
