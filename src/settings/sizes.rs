//! Sizes in bytes, counts, image sizes, shares of a scene: exact and checked. Each parser returns one sentence that
//! says what is wrong and what is right.

use std::fmt;
use std::str::FromStr;

/// Largest width or height of an image, pixels.
pub const MAX_IMAGE_PX: u32 = 16384;

/// Longest time of a frame's budget, milliseconds: an hour.
const MAX_BUDGET_MS: f64 = 3.6e6;

/// Most digits behind a point.
const MOST_DECIMALS: usize = 9;

/// Splits a number from its unit and multiplies, with every overflow refused. What is left of a unit is cut off.
fn scaled(text: &str, units: &[(&str, u64)], what: &str) -> Result<u64, String> {
    let digits = text.trim_end_matches(|c: char| c.is_alphabetic());
    let unit = &text[digits.len()..];
    let factor = match units.iter().find(|(name, _)| name.eq_ignore_ascii_case(unit)) {
        Some(&(_, factor)) => factor,
        None if unit.is_empty() => 1,
        None => {
            let names = units.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
            return Err(format!("a {what} is a number, with {names} or nothing behind it"));
        }
    };
    let (whole, part) = digits.split_once('.').unwrap_or((digits, "0"));
    let are_digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let is_cut = factor == 1 && digits.contains('.');
    if is_cut || !are_digits(whole) || !are_digits(part) || part.len() > MOST_DECIMALS {
        return Err(format!("'{text}' is no {what}: give a whole number, or one with a unit such as 16M or 1.5M"));
    }
    let beyond = || format!("the {what} does not fit in 64 bits");
    let whole: u128 = whole.parse().map_err(|_| beyond())?;
    let part = part.parse::<u128>().map_err(|_| beyond())? * u128::from(factor) / 10u128.pow(part.len() as u32);
    let sum = whole.checked_mul(factor.into()).and_then(|product| product.checked_add(part));
    sum.and_then(|sum| u64::try_from(sum).ok()).ok_or_else(beyond)
}

/// Units of sizes: the short ones and those with an `i` are powers of 1024, those that end in `B` alone powers of 1000.
const SIZES: [(&str, u64); 13] = [
    ("K", 1 << 10),
    ("M", 1 << 20),
    ("G", 1 << 30),
    ("T", 1 << 40),
    ("KiB", 1 << 10),
    ("MiB", 1 << 20),
    ("GiB", 1 << 30),
    ("TiB", 1 << 40),
    ("kB", 1_000),
    ("MB", 1_000_000),
    ("GB", 1_000_000_000),
    ("TB", 1_000_000_000_000),
    ("B", 1),
];

/// A size in bytes: a number with `K`, `M`, `G`, `T` (powers of 1024; `KiB` is the same, `kB` a power of 1000) or
/// nothing behind it; 0 is refused.
///
/// # Errors
/// A sentence for the user.
pub fn size_bytes(text: &str) -> Result<u64, String> {
    match scaled(text, &SIZES, "size")? {
        0 => Err("a size of 0 bytes holds nothing; give at least 1".into()),
        bytes => Ok(bytes),
    }
}

/// A count: a number with `K`, `M` or `G` (powers of 1000) or nothing behind it.
///
/// # Errors
/// A sentence for the user.
pub fn count(text: &str) -> Result<u64, String> {
    scaled(text, &[("K", 1_000), ("M", 1_000_000), ("G", 1_000_000_000)], "count")
}

/// A count that is not 0.
///
/// # Errors
/// A sentence for the user.
pub fn positive_count(text: &str) -> Result<u64, String> {
    match count(text)? {
        0 => Err("it must be at least 1".into()),
        n => Ok(n),
    }
}

/// A count from 1 that fits in 32 bits.
///
/// # Errors
/// A sentence for the user.
pub fn positive_count32(text: &str) -> Result<u32, String> {
    u32::try_from(positive_count(text)?).map_err(|_| format!("it must be at most {}", u32::MAX))
}

/// Bytes in the largest unit that keeps them short: `1536 B`, `23.4 MiB`.
pub fn human_bytes(bytes: u64) -> String {
    const UNITS: [&str; 5] = ["KiB", "MiB", "GiB", "TiB", "PiB"];
    if bytes < 10 << 10 {
        return format!("{bytes} B");
    }
    let mut value = bytes as f64 / 1024.0;
    let mut unit = 0;
    while value >= 1024.0 && unit + 1 < UNITS.len() {
        value /= 1024.0;
        unit += 1;
    }
    format!("{value:.1} {}", UNITS[unit])
}

/// At least `bytes`, as [`size_bytes`] reads it: in the largest unit that adds less than 1 %, or 1 KiB.
pub fn option_bytes(bytes: u64) -> String {
    let units = [(30, 'G'), (20, 'M'), (10, 'K')];
    let fits = |shift: u32| bytes >> shift >= if shift == 10 { 10 } else { 100 };
    match units.into_iter().find(|&(shift, _)| fits(shift)) {
        Some((shift, unit)) => format!("{}{unit}", bytes.div_ceil(1 << shift)),
        None => bytes.to_string(),
    }
}

/// A count with a comma between groups of three digits.
pub fn human_count(count: u64) -> String {
    let digits = count.to_string();
    let mut out = String::with_capacity(digits.len() + digits.len() / 3);
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

/// A count and what is counted, in the plural unless there is one: `1 brick`, `2,000 bricks`.
pub fn counted(count: u64, thing: &str) -> String {
    format!("{} {thing}{}", human_count(count), if count == 1 { "" } else { "s" })
}

/// The device memory for bricks and tiles of textures: bytes, or a share of the sum over all of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CacheSize {
    /// All of them where the device has room, else as much as it has room for.
    Auto,
    /// Bytes, at least 1.
    Bytes(u64),
    /// Percent of the bytes of all bricks and tiles, above 0, at most 100.
    Percent(f64),
}

impl CacheSize {
    /// Bytes of the cache for a scene whose bricks and tiles take `all` bytes together, on a device that has `room` for
    /// so many; a share is rounded up.
    pub fn bytes(self, all: u64, room: u64) -> u64 {
        match self {
            Self::Auto => all.min(room),
            Self::Bytes(bytes) => bytes,
            Self::Percent(percent) if percent >= 100.0 => all,
            Self::Percent(percent) => (all as f64 * (percent / 100.0)).ceil() as u64,
        }
    }
}

impl FromStr for CacheSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let percent = match text.strip_suffix('%') {
            _ if text == "auto" => return Ok(Self::Auto),
            Some(share) => share.parse::<f64>(),
            // A share as a number: 0.25 is 25 %.
            None if text.starts_with("0.") => text.parse::<f64>().map(|share| 100.0 * share),
            None => return size_bytes(text).map(Self::Bytes),
        };
        match percent {
            Ok(percent) if percent > 0.0 && percent <= 100.0 => Ok(Self::Percent(percent)),
            _ => Err("a share is a number above 0 % and at most 100 %, as in 25%".into()),
        }
    }
}

impl fmt::Display for CacheSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Bytes(bytes) => write!(f, "{bytes}"),
            Self::Percent(percent) => write!(f, "{percent}%"),
        }
    }
}

/// The host memory for verified bricks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HostCacheSize {
    /// 1 GiB, or an eighth of what is available where that is less.
    Auto,
    /// Bytes; 0: none.
    Bytes(u64),
}

impl HostCacheSize {
    /// Its bytes where so many are `available`, if that is known.
    pub fn bytes(self, available: Option<u64>) -> u64 {
        match self {
            Self::Auto => available.map_or(1 << 30, |bytes| (bytes / 8).min(1 << 30)),
            Self::Bytes(bytes) => bytes,
        }
    }
}

impl FromStr for HostCacheSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "0" => Ok(Self::Bytes(0)),
            _ => size_bytes(text).map(Self::Bytes),
        }
    }
}

impl fmt::Display for HostCacheSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Bytes(bytes) => write!(f, "{bytes}"),
        }
    }
}

/// What a frame may load: bytes, or as much as arrives in so many milliseconds from its begin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FrameBudget {
    /// Milliseconds, above 0.
    Time(f64),
    /// Bytes, at least 1.
    Bytes(u64),
}

impl FrameBudget {
    /// Its bytes; of a time none.
    pub fn bytes(self) -> Option<u64> {
        match self {
            Self::Time(_) => None,
            Self::Bytes(bytes) => Some(bytes),
        }
    }
}

impl FromStr for FrameBudget {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = text.strip_suffix("ms").unwrap_or(text).parse::<f64>();
        match number {
            Ok(ms) if ms > 0.0 && ms <= MAX_BUDGET_MS => Ok(Self::Time(ms)),
            Ok(_) => Err(format!("a time is a number of milliseconds above 0 and at most {MAX_BUDGET_MS}")),
            Err(_) => size_bytes(text).map(Self::Bytes).map_err(|_| {
                "a budget is a time in milliseconds, as in 50, or a size with its unit, as in 8M".to_owned()
            }),
        }
    }
}

impl fmt::Display for FrameBudget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Time(ms) => write!(f, "{ms}ms"),
            Self::Bytes(bytes) => write!(f, "{bytes}B"),
        }
    }
}

/// The error that `--secondary auto` allows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ErrorLimit {
    /// Mean FLIP of the picture against the exact one of the same rays, above 0.
    Flip(f64),
    /// 100 times the root of relMSE of an effect against the exact one, above 0.
    Percent(f64),
}

impl ErrorLimit {
    /// Its number.
    pub fn value(self) -> f64 {
        match self {
            Self::Flip(value) | Self::Percent(value) => value,
        }
    }

    /// Of an error in percent and one in FLIP that which it bounds.
    pub fn of(self, percent: f64, flip: f64) -> f64 {
        match self {
            Self::Flip(_) => flip,
            Self::Percent(_) => percent,
        }
    }
}

impl FromStr for ErrorLimit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong =
            || "an error is a mean FLIP from 0.0001 to 1, as in 0.05, or a percentage to 100, as in 5%".to_owned();
        let (number, limit): (&str, fn(f64) -> Self) = match text.strip_suffix('%') {
            Some(number) => (number, Self::Percent),
            None => (text, Self::Flip),
        };
        let limit = limit(number.trim().parse::<f64>().map_err(|_| wrong())?);
        let most = if matches!(limit, Self::Flip(_)) { 1.0 } else { 100.0 };
        if (1e-4..=most).contains(&limit.value()) { Ok(limit) } else { Err(wrong()) }
    }
}

impl fmt::Display for ErrorLimit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Flip(value) => write!(f, "{value}"),
            Self::Percent(value) => write!(f, "{value}%"),
        }
    }
}

/// Width and height of an image, each 1..=[`MAX_IMAGE_PX`] pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageSize {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl FromStr for ImageSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("an image size is WIDTHxHEIGHT, each from 1 to {MAX_IMAGE_PX} pixels, as in 1280x720");
        let side = |text: &str| -> Result<u32, String> {
            let digits = !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
            let side = if digits { text.parse().ok() } else { None };
            side.filter(|side| (1..=MAX_IMAGE_PX).contains(side)).ok_or_else(wrong)
        };
        let (width, height) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
        Ok(Self { width: side(width)?, height: side(height)? })
    }
}

impl fmt::Display for ImageSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

/// Parses a whole number or count from `LEAST` to `MOST`.
#[cfg(feature = "cli")]
pub(crate) fn ranged<const LEAST: u32, const MOST: u32>(text: &str) -> Result<u32, String> {
    let found = u32::try_from(count(text)?).ok().filter(|n| (LEAST..=MOST).contains(n));
    found.ok_or_else(|| format!("it must be from {LEAST} to {MOST}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_exact_powers_of_1024() {
        assert_eq!(size_bytes("1"), Ok(1));
        assert_eq!(size_bytes("3K"), Ok(3072));
        assert_eq!(size_bytes("256m"), Ok(256 << 20));
        assert_eq!(size_bytes("2G"), Ok(2 << 30));
        assert_eq!(size_bytes("18446744073709551615"), Ok(u64::MAX));
        assert_eq!(size_bytes("17179869183G"), Ok(17179869183 << 30));
        assert_eq!(size_bytes("1.5G"), Ok(3 << 29));
        assert_eq!((size_bytes("10GiB"), size_bytes("10GB")), (Ok(10 << 30), Ok(10_000_000_000)));
        assert_eq!((size_bytes("7B"), size_bytes("2kb"), size_bytes("1T")), (Ok(7), Ok(2000), Ok(1 << 40)));
        let bad =
            ["", "0", "0G", "G", "-1", "+1", ".5G", "1.G", "1..5G", "1 G", "1P", "1KiBs", "0x10", "é", "5é", "nan"];
        for bad in bad {
            assert!(size_bytes(bad).is_err(), "{bad}");
        }
        // One beyond 64 bits, in the number and in the product.
        for bad in ["18446744073709551616", "17179869184G", "99999999999999999999999K"] {
            assert!(size_bytes(bad).unwrap_err().contains("64 bits"), "{bad}");
        }
    }

    #[test]
    fn counts_are_exact_powers_of_1000() {
        assert_eq!(count("0"), Ok(0));
        assert_eq!(count("16K"), Ok(16_000));
        assert_eq!(count("2M"), Ok(2_000_000));
        assert_eq!((count("2G"), count("1.5M")), (Ok(2_000_000_000), Ok(1_500_000)));
        assert!(["2GB", "2T", "1.5", "1.5."].iter().all(|bad| count(bad).is_err()));
        assert!(positive_count("0K").is_err());
        assert_eq!(positive_count32("4294967295"), Ok(u32::MAX));
        assert!(positive_count32("4294967296").is_err());
    }

    #[test]
    fn budgets_are_times_or_sizes() {
        assert_eq!("50".parse(), Ok(FrameBudget::Time(50.0)));
        assert_eq!("12.5ms".parse(), Ok(FrameBudget::Time(12.5)));
        assert_eq!("8M".parse(), Ok(FrameBudget::Bytes(8 << 20)));
        assert_eq!("1B".parse(), Ok(FrameBudget::Bytes(1)));
        for budget in [FrameBudget::Time(0.25), FrameBudget::Bytes(12_345)] {
            assert_eq!(budget.to_string().parse(), Ok(budget));
        }
        for bad in ["", "0", "-3", "0ms", "nan", "inf", "1e9", "0M", "8 M", "ms", "5s"] {
            assert!(bad.parse::<FrameBudget>().is_err(), "{bad}");
        }
    }

    #[test]
    fn caches_are_sizes_or_shares() {
        assert_eq!("64M".parse(), Ok(CacheSize::Bytes(64 << 20)));
        assert_eq!("12.5%".parse(), Ok(CacheSize::Percent(12.5)));
        for bad in ["0%", "-1%", "100.1%", "nan%", "inf%", "%", "25 %", "0"] {
            assert!(bad.parse::<CacheSize>().is_err(), "{bad}");
        }
        assert_eq!(("0.25".parse(), "auto".parse()), (Ok(CacheSize::Percent(25.0)), Ok(CacheSize::Auto)));
        assert_eq!(CacheSize::Percent(25.0).bytes(1001, 0), 251);
        assert_eq!(CacheSize::Percent(100.0).bytes(u64::MAX, 0), u64::MAX);
        assert_eq!(CacheSize::Bytes(7).bytes(1, 0), 7);
        assert_eq!([10, 100].map(|room| CacheSize::Auto.bytes(50, room)), [10, 50]);
        for text in ["25%", "1024", "auto"] {
            assert_eq!(text.parse::<CacheSize>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn image_sizes_are_bounded() {
        assert_eq!("1280x720".parse(), Ok(ImageSize { width: 1280, height: 720 }));
        assert_eq!("1x16384".parse(), Ok(ImageSize { width: 1, height: 16384 }));
        for bad in
            ["", "x", "0x1", "1x0", "16385x1", "1x16385", "1280", "-1x5", "+1x5", "1x2x3", "1.5x2", "99999999999x1"]
        {
            assert!(bad.parse::<ImageSize>().is_err(), "{bad}");
        }
    }

    #[test]
    fn human_forms() {
        assert_eq!(human_bytes(1536), "1536 B");
        assert_eq!(human_bytes(24 << 20), "24.0 MiB");
        assert_eq!(human_bytes(u64::MAX), "16384.0 PiB");
        for (bytes, text) in [(1, "1"), (10_239, "10239"), (10_240, "10K"), (10_241, "11K"), (150 << 20, "150M")] {
            assert_eq!(option_bytes(bytes), text);
        }
        for shift in 0..64 {
            for bytes in [1u64 << shift, (1 << shift) + 1, u64::MAX >> shift] {
                let read = size_bytes(&option_bytes(bytes)).unwrap_or(u64::MAX);
                assert!(read >= bytes && read - bytes <= (bytes / 100).max(1 << 10), "{bytes}");
            }
        }
        assert_eq!(human_count(0), "0");
        assert_eq!(human_count(123), "123");
        assert_eq!(human_count(1234567), "1,234,567");
    }
}
