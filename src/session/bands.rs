//! How many rows of a picture are rendered at a time: all of them, or those of a band where memory holds no more. Found
//! before anything is made.

use super::device::Device;
use super::picture_bytes::PictureBytes;
use crate::cpu;
use crate::session::Settings;
use crate::settings::sizes::{human_bytes, human_count};
use anyhow::{Result, bail};
use std::ops::Range;

/// Of the memory that joined pictures leave, a band takes at most one part of so many: the cache is to have most of it.
const SHARE: u64 = 4;

/// The rows of pictures that are rendered at a time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bands {
    /// Rows of a band, whole tiles; where there is one band, those of the picture.
    pub rows: u32,
    /// Bytes that pictures in bands leave to a cache that lies in the same memory.
    pub room: Option<u64>,
    /// Why there are several, where memory is the reason.
    pub why: Option<String>,
}

/// Memory that pictures take a part of.
#[derive(Clone, Copy, Debug)]
struct Pool {
    what: &'static str,
    /// Bytes; `None`: not known.
    available: Option<u64>,
    /// Bytes of a pixel of a picture that is rendered at once.
    whole: u64,
    /// Bytes of a pixel of a picture that is joined of bands.
    joined: u64,
    /// Bytes of a pixel of a band.
    band: u64,
    /// Whether the cache lies there, too, beside a joined picture.
    has_cache: bool,
}

impl Pool {
    /// Those that `device` takes pictures from.
    fn of(settings: &Settings, device: &Device, has_more: bool) -> Vec<Self> {
        let PictureBytes { device: on_device, filter, host, band, joined } = PictureBytes::of(settings, has_more);
        let [available, local] = [cpu::available_memory(), device.local_memory()];
        let of_host = Self { what: "memory", available, whole: host, joined, band, has_cache: false };
        if device.is_host_memory() {
            let available = [available, local].into_iter().flatten().min();
            let (whole, band) = (on_device + filter + host, on_device + band);
            return vec![Self { available, whole, band, has_cache: true, ..of_host }];
        }
        let (whole, band) = (on_device + filter, on_device);
        vec![Self { what: "memory of the device", available: local, whole, joined: 0, band, has_cache: false }, of_host]
    }

    /// Refuses a picture with `a_pixel` bytes for each pixel and `of_band` beside them.
    fn refuse<T>(&self, settings: &Settings, [a_pixel, of_band]: [u64; 2], remedy: &str) -> Result<T> {
        let (width, height) = (u64::from(settings.size.width), u64::from(settings.size.height));
        let (all, available) = (width * height * a_pixel, self.available.unwrap_or(0));
        // Scaled by s, a picture has s^2 of the pixels, and a band of as many rows s of what it takes.
        let [of_all, of_a_band, free] = [all, of_band, available].map(|bytes| bytes as f64);
        let share = 2.0 * free / (of_a_band + (of_a_band * of_a_band + 4.0 * of_all * free).sqrt());
        let [width, height] = [width, height].map(|edge| ((edge as f64 * share) as u64).max(1));
        bail!(
            "--size {}: pictures take {} of {}, {a_pixel} bytes a pixel, and {} are available; give at most --size \
             {width}x{height}{remedy}",
            settings.size,
            human_bytes(all + of_band),
            self.what,
            human_bytes(available)
        )
    }
}

/// Rows of tiles of a band, of so many rows of tiles, in as few bands as that leaves: no band is much smaller.
fn even(all: u64, most: u64) -> u64 {
    all.div_ceil(all.div_ceil(most.max(1)).max(1))
}

/// The rows of the bands that settings ask for, where memory needs no more of them.
pub fn asked(settings: &Settings) -> Vec<Range<u32>> {
    let (height, tile) = (settings.size.height, settings.tile);
    let all = height.div_ceil(tile);
    let rows = even(all.into(), all.div_ceil(settings.bands.clamp(1, all.max(1))).into()) as u32 * tile;
    (0..height).step_by(rows.max(1) as usize).map(|first| first..(first + rows).min(height)).collect()
}

impl Bands {
    /// As many as `settings` ask for, or as the memory of `device` and of the host need; `has_more`: for a scene with
    /// further textures.
    ///
    /// # Errors
    /// The picture is too large for a band, or to be joined, or for what needs all of it at once: how much it takes,
    /// how much there is, and the largest size that it is enough for.
    pub fn of(settings: &Settings, device: &Device, has_more: bool) -> Result<Self> {
        Self::within(settings, &Pool::of(settings, device, has_more), device.most_rays())
    }

    fn within(settings: &Settings, pools: &[Pool], most_rays: u64) -> Result<Self> {
        let (size, tile) = (settings.size, u64::from(settings.tile));
        let (width, height) = (u64::from(size.width), u64::from(size.height));
        let pixels = width * height;
        let short = pools.iter().find(|pool| pool.available.is_some_and(|bytes| bytes < pixels * pool.whole));
        let fits = short.is_none() && pixels <= most_rays;
        let needs_all = settings.needs_whole_pictures();
        if fits && (settings.bands <= 1 || needs_all.is_some()) {
            return Ok(Self { rows: size.height, room: None, why: None });
        }
        if let Some(option) = needs_all {
            let remedy = format!("or leave out {option}, without which it is rendered in bands");
            return match short {
                Some(pool) => pool.refuse(settings, [pool.whole, 0], &format!(", {remedy}")),
                None => bail!("--size {size}: the device holds {most_rays} pixels; give a smaller --size, {remedy}"),
            };
        }
        let given = [(settings.aov, "--aov"), (settings.denoise, "--denoise"), (settings.taa, "--taa")];
        let given: Vec<&str> = given.into_iter().filter(|(is_on, _)| *is_on).map(|(_, option)| option).collect();
        let remedy = if given.is_empty() { String::new() } else { format!(", or leave out {}", given.join(" and ")) };
        // Rows of tiles: all, and of a band at most.
        let all = height.div_ceil(tile);
        let mut most = all.div_ceil(u64::from(settings.bands).clamp(if fits { 1 } else { 2 }, all.max(2)));
        most = most.min(most_rays / (width * tile));
        let mut room: Option<u64> = None;
        for pool in pools {
            let Some(available) = pool.available else { continue };
            let least = width * tile * pool.band;
            let left = available.saturating_sub(pixels * pool.joined);
            if left < least {
                return pool.refuse(settings, [pool.joined, least], &remedy);
            }
            most = most.min(left / SHARE / least);
            if pool.has_cache {
                room = Some(left / 2);
            }
        }
        let rows = (even(all, most) * tile).min(height) as u32;
        let why = match short {
            _ if fits => None,
            Some(pool) => Some(format!(
                "{} of {}, {} bytes a pixel, and {} are available",
                human_bytes(pixels * pool.whole),
                pool.what,
                pool.whole,
                human_bytes(pool.available.unwrap_or(0))
            )),
            None => Some(format!(
                "room for {} pixels, and the device has some for {}",
                human_count(pixels),
                human_count(most_rays)
            )),
        };
        let bands = height.div_ceil(u64::from(rows));
        let why =
            why.map(|why| format!("--size {size}: rendered in {bands} bands of {rows} rows; at once it takes {why}"));
        Ok(Self { rows, room, why })
    }
}

/// Refuses pictures of `settings`, rendered at once in the place of those of `before`, that memory does not hold.
/// `is_on_host`: rays and what shading keeps lie there, too.
///
/// # Errors
/// How much they take, how much there is, and the largest size that it is enough for.
pub fn check_whole(settings: &Settings, before: &Settings, (is_on_host, has_more): (bool, bool)) -> Result<()> {
    check_within(settings, before, (is_on_host, has_more), cpu::available_memory)
}

fn check_within(
    settings: &Settings,
    before: &Settings,
    (is_on_host, has_more): (bool, bool),
    available: impl FnOnce() -> Option<u64>,
) -> Result<()> {
    let of = |settings: &Settings| {
        let PictureBytes { device, filter, host, .. } = PictureBytes::of(settings, has_more);
        let pixels = u64::from(settings.size.width) * u64::from(settings.size.height);
        let a_pixel = host + if is_on_host { device + filter } else { 0 };
        (pixels * a_pixel, a_pixel)
    };
    let ((wanted, whole), (held, _)) = (of(settings), of(before));
    // Most pictures are no larger than those before.
    let Some(free) = (wanted > held).then(available).flatten() else { return Ok(()) };
    if wanted <= held + free {
        return Ok(());
    }
    let available = Some(held + free);
    Pool { what: "memory", available, whole, joined: 0, band: 0, has_cache: false }.refuse(settings, [whole, 0], "")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(options: &str) -> Settings {
        Settings::from_options(options).unwrap()
    }

    /// Memory of so many bytes, of a processor.
    fn pools(settings: &Settings, available: Option<u64>) -> [Pool; 1] {
        let PictureBytes { device, filter, host, band, joined } = PictureBytes::of(settings, false);
        [Pool {
            what: "memory",
            available,
            whole: device + filter + host,
            joined,
            band: device + band,
            has_cache: true,
        }]
    }

    fn bands(options: &str, available: Option<u64>) -> Result<Bands> {
        let settings = settings(options);
        Bands::within(&settings, &pools(&settings, available), u64::MAX)
    }

    #[test]
    fn what_fits_is_rendered_at_once() {
        let whole = Bands { rows: 720, room: None, why: None };
        assert_eq!(bands("", Some(1 << 30)).unwrap(), whole);
        assert_eq!(bands("", None).unwrap(), whole, "what is not known is no reason");
        assert!(bands("", Some(100 << 20)).unwrap().rows < 720, "the control");
    }

    #[test]
    fn what_does_not_fit_is_rendered_in_as_few_bands_as_memory_needs() {
        let options = "--size 16384x16000 --effects shadow";
        let PictureBytes { device, band, joined, .. } = PictureBytes::of(&settings(options), false);
        let found = [12 << 30, 16 << 30, 64 << 30].map(|available| {
            let Bands { rows, room, why } = bands(options, Some(available)).unwrap();
            let why = why.unwrap();
            let count = 16_000u32.div_ceil(rows);
            assert!(rows.is_multiple_of(64) && why.contains(&format!("in {count} bands of {rows} rows")), "{why}");
            assert!(why.contains("bytes a pixel, and ") && why.contains(&human_bytes(available)), "{why}");
            let of_picture = 16_384 * 16_000 * joined;
            let of_band = 16_384 * u64::from(rows) * (device + band);
            assert!(of_picture + of_band + room.unwrap() <= available, "{available}");
            count
        });
        assert!(found.is_sorted_by(|a, b| a > b) && found[2] >= 2, "{found:?}");
    }

    #[test]
    fn bands_that_are_asked_for_are_whole_tiles() {
        let rows = |options: &str| bands(options, Some(1 << 40)).unwrap().rows;
        let found = ["1", "2", "3", "4", "12", "1000"].map(|count| rows(&format!("--bands {count}")));
        assert_eq!(found, [720, 384, 256, 192, 64, 64]);
        for count in 1..14 {
            let settings = settings(&format!("--bands {count}"));
            let asked = asked(&settings);
            let rows = Bands::within(&settings, &pools(&settings, Some(1 << 40)), u64::MAX).unwrap().rows;
            assert!(asked.iter().all(|own| own.start.is_multiple_of(64)) && asked[0] == (0..rows), "{count}");
            assert!(asked.is_sorted_by(|a, b| a.end == b.start) && asked.last().unwrap().end == 720, "{count}");
        }
        assert_eq!(rows("--bands 7 --tile 8 --size 64x100"), 16);
        assert_eq!(rows("--bands 7 --tile 512 --size 64x100"), 100);
        // Methods need the whole picture; a session refuses both together.
        assert_eq!(rows("--bands 4 --secondary roma"), 720);
        assert_eq!(bands("--bands 4", None).unwrap().why, None);
    }

    #[test]
    fn what_a_device_holds_at_a_time_bounds_a_band() {
        let settings = settings("--size 4096x4096");
        let pools = pools(&settings, None);
        let found = Bands::within(&settings, &pools, 1 << 20).unwrap();
        assert_eq!((found.rows, found.room), (256, None));
        assert!(found.why.unwrap().contains("in 16 bands of 256 rows"));
        assert_eq!(Bands::within(&settings, &pools, 1 << 24).unwrap().rows, 4096);
    }

    #[test]
    fn the_size_that_is_named_is_accepted() {
        for (options, memory) in [
            ("--size 16384x16384", 3 << 30),
            ("--size 16384x8000 --aov --effects diffuse --denoise", 3 << 30),
            ("--size 16384x16384 --secondary roma", 30 << 30),
        ] {
            let settings = settings(options);
            let has = |settings: &Settings| Bands::within(settings, &pools(settings, Some(memory)), u64::MAX);
            let says = has(&settings).unwrap_err().to_string();
            assert!(says.contains(".0 GiB are available"), "{says}");
            assert_eq!(says.contains("leave out --secondary"), options.contains("roma"), "{says}");
            let named = says.split("at most ").nth(1).unwrap().split(',').next().unwrap();
            let smaller = Settings { size: Settings::from_options(named).unwrap().size, ..settings.clone() };
            assert!(has(&smaller).is_ok() && smaller.size.width > 1000, "{named}");
            let Settings { size, .. } = smaller;
            let larger = crate::settings::ImageSize { width: size.width + 40, height: size.height + 40 };
            assert!(has(&Settings { size: larger, ..settings }).is_err(), "{named} is not the largest");
        }
    }

    #[test]
    fn what_takes_the_place_of_another_picture_must_fit() {
        let of = |options: &str| Settings::from_options(options).unwrap();
        let (small, large) = (of("--size 640x360"), of("--size 16384x16384"));
        let error = check_within(&large, &small, (true, false), || Some(8 << 30)).unwrap_err().to_string();
        assert!(
            error.starts_with("--size 16384x16384: pictures take") && error.contains("give at most --size"),
            "{error}"
        );
        // What it says is enough is enough.
        let at_most = error.rsplit("--size ").next().unwrap();
        check_within(&of(&format!("--size {at_most}")), &small, (true, false), || Some(8 << 30)).unwrap();
        check_within(&large, &small, (true, false), || Some(1 << 40)).unwrap();
        check_within(&large, &small, (true, false), || None).unwrap();
        // What is no larger is not asked about, and what is held already is there.
        check_within(&small, &large, (true, false), || panic!("asked")).unwrap();
        check_within(&of("--size 641x360"), &small, (true, false), || Some(1 << 20)).unwrap();
        // Of a device with memory of its own, the host has the smaller part.
        let middle = of("--size 4096x4096");
        let free = || Some(3 << 30);
        assert!(
            check_within(&middle, &small, (false, false), free).is_ok()
                && check_within(&middle, &small, (true, false), free).is_err()
        );
    }
}
