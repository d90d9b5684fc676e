//! `brickwalk selftest`: is the arithmetic of this device what exact rendering needs, case by case?
//!
//! The kernels and the schedules that render are run, not copies of them, on scenes made to be hard, and compared with
//! truth that does not depend on them: integers of 128 bits and more, which are exact; brute force in f64;
//! closed forms; or two ways through the program that must give the same bits. Bounds follow from the arithmetic, γₙ =
//! n u / (1 − n u) with u = 2⁻²⁴, and are derived where they are used and in [`crate::reference::bounds`]; where a
//! comparison is exact its bound is 0.
//!
//! [`defects`] shows that the cases can fail.

pub mod args;
mod boxes;
pub mod case;
pub mod defects;
mod errors;
mod fields;
mod histories;
mod lab;
mod lights;
mod list;
mod maps;
mod meshes;
mod rays;
mod roma;
mod samples;
mod shapes;
mod streaming;
mod surfaces;
mod views;
mod visibility;

use crate::cpu;
use crate::gpu::probe;
use crate::gpu::probe::{ProbeReport, Traits};
use crate::kernels::DeviceInfo;
use crate::lab::console::Console;
use crate::session::device::Device;
use anyhow::{Result, bail};
use args::SelftestArgs;
use brickwalk_convert::progress::Progress;
use case::{Case, Check, Checks, Row, Source, Status};
use defects::Defect;
use lab::Lab;
use serde::Serialize;
use std::fmt::Write;
use std::time::Instant;

/// Raised when a field changes its meaning.
const FORMAT: u32 = 1;

/// What a test found.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Raised when a field changes its meaning.
    pub format: u32,
    /// The device.
    pub device: DeviceInfo,
    /// What it does.
    pub traits: Traits,
    /// Seed of scenes and rays.
    pub seed: u64,
    /// A line a case.
    pub rows: Vec<Row>,
    /// Cases that passed.
    pub passed: usize,
    /// Cases that failed.
    pub failed: usize,
    /// Cases whose part is not built yet.
    pub not_built: usize,
    /// Wall time, seconds.
    pub seconds: f64,
}

/// Runs the command.
///
/// # Errors
/// A case fails; there is no device.
pub fn run(args: &SelftestArgs, console: Console) -> Result<()> {
    if let Some(folder) = &args.errors {
        return errors::run(args, folder, console);
    }
    let report = test(args)?;
    if args.json {
        console.show(&(serde_json::to_string_pretty(&report)? + "\n"))?;
    } else {
        console.show(&as_text(&report))?;
    }
    if report.failed > 0 {
        let failed = report.rows.iter().filter(|row| row.status == Status::Fail);
        let numbers: Vec<String> = failed.map(|row| row.case.to_string()).collect();
        bail!("{} of the cases failed on {}: {}", report.failed, report.device.name, numbers.join(", "));
    }
    Ok(())
}

/// Runs the cases that `args` ask for.
///
/// # Errors
/// There is no device.
pub fn test(args: &SelftestArgs) -> Result<Report> {
    let start = Instant::now();
    let mut lab = Lab::open(&args.adapter, args.seed, args.rays as usize, args.plant)?;
    let (traits, probe) = device_traits(&lab.device, args.plant);
    let device = lab.device.info();
    let wanted: Vec<&Case> =
        list::CASES.iter().filter(|case| args.case.is_empty() || args.case.contains(&case.number)).collect();
    let mut rows = Vec::new();
    if let Some(probe) = probe.filter(|_| args.case.is_empty()) {
        let (title, truth) = ("the device's arithmetic", Source::Exact);
        rows.push(row(&Case { number: 0, title, truth, run: None }, Some(Ok(probe_checks(&probe))), probe.ms, args));
    }
    let progress = Progress::new();
    progress.phase("cases", wanted.len() as u64);
    for case in wanted {
        let start = Instant::now();
        let mut checks = Checks::default();
        let found = case.run.map(|run| run(&mut lab, &mut checks).map(|()| checks));
        rows.push(row(case, found, start.elapsed().as_secs_f64() * 1e3, args));
        progress.advance(1);
    }
    progress.finish();
    let count = |status: Status| rows.iter().filter(|row| row.status == status).count();
    Ok(Report {
        format: FORMAT,
        device,
        traits,
        seed: args.seed,
        passed: count(Status::Pass),
        failed: count(Status::Fail),
        not_built: count(Status::NotBuilt),
        seconds: start.elapsed().as_secs_f64(),
        rows,
    })
}

/// The line of a case; `None`: it was not run.
fn row(case: &Case, found: Option<Result<Checks>>, ms: f64, args: &SelftestArgs) -> Row {
    let Case { number, title, truth, .. } = *case;
    let (status, checks, error) = match found {
        None => (Status::NotBuilt, Vec::new(), None),
        Some(Ok(checks)) => (if checks.passed() { Status::Pass } else { Status::Fail }, checks.0, None),
        Some(Err(error)) => (Status::Fail, Vec::new(), Some(format!("{error:#}"))),
    };
    let replay = (status == Status::Fail).then(|| replay(number, args));
    Row { case: number, title, truth, status, checks, error, ms, replay }
}

/// The command that repeats a case; the probe, which goes before the cases, with all of them.
fn replay(number: u32, args: &SelftestArgs) -> String {
    let case = if number == 0 { String::new() } else { format!(" --case {number}") };
    let mut text = format!("brickwalk selftest{case} --seed {}", args.seed);
    let _ = write!(text, " --rays {} --adapter {:?}", args.rays, args.adapter.to_string());
    if let Some(defect) = args.plant {
        let _ = write!(text, " --plant {defect}");
    }
    text
}

/// What the device does; of a graphics device also the probe of its arithmetic, with what is planted.
fn device_traits(device: &Device, defect: Option<Defect>) -> (Traits, Option<ProbeReport>) {
    match device {
        Device::Cpu => {
            let tiny = std::hint::black_box(f32::MIN_POSITIVE);
            let nan = std::hint::black_box(f32::from_bits(0x7fc0_1234));
            let [a, b, c] = [1.0 + f32::EPSILON, 1.0 - f32::EPSILON, 1.0].map(std::hint::black_box);
            let traits = Traits {
                // a b is 1 - 2^-46, which rounds to 1.
                contracts: a * b - c * c != 0.0,
                flushes_denormals: tiny * 0.5 == 0.0,
                keeps_nan_bits: nan.to_bits() == 0x7fc0_1234,
                nan_in_max_min: if nan.max(1.0).is_nan() { "the NaN" } else { "the number" },
                subgroup_size: Some((cpu::lanes(), cpu::lanes())),
            };
            (traits, None)
        }
        Device::Gpu(gpu) => {
            let text = defect.map_or_else(probe::source, |defect| defect.plant(probe::source()));
            let report = probe::run_source(gpu, &text);
            (report.traits.clone(), Some(report))
        }
    }
}

/// What the probe found.
fn probe_checks(report: &ProbeReport) -> Checks {
    let check = |check: &probe::Check| Check {
        measured: format!("{}: {} of {} unlike {}", check.name, check.different, check.cases, check.against),
        bound: "0".into(),
        passed: check.different == 0,
    };
    Checks(report.checks.iter().map(check).collect())
}

fn as_text(report: &Report) -> String {
    let mut text = String::new();
    let DeviceInfo { name, driver, driver_info, backend, .. } = &report.device;
    let _ = writeln!(text, "{name} ({driver} {driver_info}, {backend}), seed {}", report.seed);
    let Traits { contracts, flushes_denormals, keeps_nan_bits, nan_in_max_min, subgroup_size } = &report.traits;
    let yes = |is_so: &bool| if *is_so { "yes" } else { "no" };
    let lanes = subgroup_size
        .map_or("unknown".into(), |(low, high)| if low == high { low.to_string() } else { format!("{low} to {high}") });
    let _ = writeln!(
        text,
        "contracts multiply-add: {}; flushes denormals: {}; keeps bits of NaN: {}; max and min of NaN and a number: \
         {nan_in_max_min}; subgroup: {lanes}\n",
        yes(contracts),
        yes(flushes_denormals),
        yes(keeps_nan_bits)
    );
    for row in &report.rows {
        let number = if row.case == 0 { "-".into() } else { row.case.to_string() };
        let _ = writeln!(text, "{number:>3}  {:<13}  {} ({:.1} s)", row.status.name(), row.title, row.ms / 1e3);
        for check in &row.checks {
            let mark = if check.passed { ' ' } else { '!' };
            let _ = writeln!(text, "   {mark} {}  [{}]", check.measured, check.bound);
        }
        if let Some(error) = &row.error {
            let _ = writeln!(text, "   ! {error}");
        }
        if let Some(replay) = &row.replay {
            let _ = writeln!(text, "     again: {replay}");
        }
    }
    let Report { passed, failed, not_built, seconds, .. } = report;
    let _ = writeln!(text, "\n{passed} passed, {failed} failed, {not_built} not built yet, in {seconds:.0} s");
    text
}
