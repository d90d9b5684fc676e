//! The start-up probe: does this device compute what exact rendering needs?
//!
//! WGSL promises little about floats: compilers may contract, division and square root may be off by some ulps. The
//! kernels are built to give equal bits all the same (`shaders/common/exact.wgsl`), provided that + - * round to
//! nearest and nothing sees through `barrier`. The probe runs them on fixed cases, those made to tell included, and
//! compares every result with the twin in [`crate::math::exact`] bit for bit. The pipelines that trace rays are then
//! compared with each other, see [`compare_pipelines`].

use super::device::Gpu;
use super::groups::numbered;
use super::kernels;
use super::rays::storage;
use super::readback::Readback;
use super::wgsl::Pages;
use crate::math::exact;
use crate::schedule::ExecutorError;
use cases::{ArithmeticCase, TriangleCase};
use check::{TWIN, no_results};
use serde::Serialize;
use std::time::Instant;

mod cases;
mod check;
mod rays;
mod scene;
mod traversal;
mod twin;

pub use check::{Check, failures};
pub use traversal::compare_pipelines;

#[cfg(test)]
pub(crate) use scene::scene;

/// What a device does where WGSL leaves it open.
#[derive(Clone, Debug, Serialize)]
pub struct Traits {
    /// Whether the compiler fuses `a * b - c * d` where no barrier stands between. Harmless behind barriers.
    pub contracts: bool,
    /// Whether products in the denormal range become 0. Harmless in the ranges that exact.wgsl states.
    pub flushes_denormals: bool,
    /// Whether the bits of a NaN survive a load and a store as f32.
    pub keeps_nan_bits: bool,
    /// What max and min give of a NaN and a number: "the number", "the NaN", or "either".
    pub nan_in_max_min: &'static str,
    /// Least and greatest subgroup size, where the driver tells.
    pub subgroup_size: Option<(u32, u32)>,
}

/// What the probe found on a device.
#[derive(Clone, Debug)]
pub struct ProbeReport {
    /// What was compared.
    pub checks: Vec<Check>,
    /// What the device does.
    pub traits: Traits,
    /// Wall time of the probe, milliseconds, compilation included.
    pub ms: f64,
}

/// The rays of the probe, at its scene in `frame`, for tests of others.
#[cfg(test)]
pub(crate) fn adverse_rays(
    scene: &bricks::SceneFile,
    frame: &crate::kernels::frame::Frame,
) -> Result<Vec<crate::kernels::layout::Ray>, bricks::Error> {
    Ok(rays::rays(&twin::Twin::new(scene, frame)?, frame.unit))
}

/// Words of results per case of the kernel `arithmetic`.
const ARITHMETIC_WORDS: usize = 12;
/// Words of results per case of the kernel `triangles`.
const TRIANGLE_WORDS: usize = 28;

/// Runs the probe; about 4,000 cases, some milliseconds beside the compilation of two kernels.
///
/// A device that returns nothing gives a report whose one failure says so.
pub fn run(gpu: &Gpu) -> ProbeReport {
    run_source(gpu, &source())
}

/// The text of `shaders/probe/probe.wgsl` with what it includes.
pub fn source() -> String {
    kernels::source(
        "probe/probe",
        Pages { cache: 1, texels: 1, opacity: false, gloss: false, layers: false, levels: false, hides: false },
    )
}

/// [`run`] with another text of the kernels.
pub fn run_source(gpu: &Gpu, source: &str) -> ProbeReport {
    let start = Instant::now();
    let info = &gpu.info;
    let module = module(gpu, source);
    let arithmetic = cases::arithmetic();
    let triangles = cases::triangles();
    let mut report = ProbeReport {
        checks: Vec::new(),
        traits: Traits {
            contracts: false,
            flushes_denormals: false,
            keeps_nan_bits: true,
            nan_in_max_min: "the number",
            subgroup_size: (info.subgroup_max_size > 0).then_some((info.subgroup_min_size, info.subgroup_max_size)),
        },
        ms: 0.0,
    };
    let words = |c: &ArithmeticCase| c.words;
    match dispatch(gpu, &module, "arithmetic", &arithmetic, words, ARITHMETIC_WORDS) {
        Ok(results) => check_arithmetic(&mut report, &arithmetic, &results),
        Err(reason) => report.checks.push(no_results("arithmetic", &reason)),
    }
    match dispatch(gpu, &module, "triangles", &triangles, TriangleCase::words, TRIANGLE_WORDS) {
        Ok(results) => check_triangles(&mut report, &triangles, &results),
        Err(reason) => report.checks.push(no_results("triangles", &reason)),
    }
    report.ms = start.elapsed().as_secs_f64() * 1e3;
    report
}

/// What the text of a kernel is compiled to.
pub fn module(gpu: &Gpu, source: &str) -> wgpu::ShaderModule {
    let source = wgpu::ShaderSource::Wgsl(source.into());
    gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some("probe"), source })
}

/// Runs one entry point over all cases; `result_words` words a case come back.
///
/// # Errors
/// The device returns nothing.
pub fn dispatch<Case, const N: usize>(
    gpu: &Gpu,
    module: &wgpu::ShaderModule,
    entry_point: &'static str,
    cases: &[Case],
    words: impl Fn(&Case) -> [u32; N],
    result_words: usize,
) -> Result<Vec<u32>, ExecutorError> {
    let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(entry_point),
        layout: None,
        module,
        entry_point: Some(entry_point),
        compilation_options: Default::default(),
        cache: None,
    });
    let input: Vec<u32> = cases.iter().flat_map(words).collect();
    let params = gpu.buffer("probe params", 16, wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST);
    let given = storage(gpu, "probe cases", input.len(), 4);
    let results = storage(gpu, "probe results", cases.len() * result_words, 4);
    gpu.queue.write_buffer(&params, 0, bytemuck::cast_slice(&[0, cases.len() as u32, 0, 0]));
    gpu.queue.write_buffer(&given, 0, bytemuck::cast_slice(&input));
    let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("probe"),
        layout: &pipeline.get_bind_group_layout(0),
        entries: &numbered([&params, &given, &results], 0),
    });
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(cases.len().div_ceil(64) as u32, 1, 1);
    }
    gpu.queue.submit([encoder.finish()]);
    Readback::new(gpu, 0).read(gpu, &results)
}

/// Neither denormal, infinite nor NaN: what the kernels' arithmetic is promised to see and give.
fn ordinary(x: f32) -> bool {
    x == 0.0 || x.is_normal()
}

fn check_arithmetic(report: &mut ProbeReport, cases: &[ArithmeticCase], results: &[u32]) {
    let names = ["rounding of +", "rounding of -", "rounding of *", "barrier", "divide", "square_root", "diffprod"];
    let mut checks = names.map(|name| Check::new(name, TWIN));
    let mut nans = Vec::new();
    for (case, found) in cases.iter().zip(results.chunks_exact(ARITHMETIC_WORDS)) {
        let [a, b, c, d] = case.words.map(f32::from_bits);
        if !case.words.iter().all(|&x| ordinary(f32::from_bits(x))) {
            report.traits.keeps_nan_bits &= !a.is_nan() || found[8] == case.words[0];
            if a.is_nan() {
                nans.extend([found[9], found[10]].map(|x| f32::from_bits(x).is_nan()));
            }
            continue;
        }
        let product = a * b;
        if !ordinary(product) && product.is_finite() && product != 0.0 {
            report.traits.flushes_denormals |= f32::from_bits(found[2]) == 0.0;
        }
        let apart = product - c * d;
        let expected = [
            (0, a + b, true),
            (1, a - b, true),
            (2, product, true),
            (3, apart, ordinary(product) && ordinary(c * d)),
            (5, exact::divide(a, b), b != 0.0),
            (6, exact::square_root(a.abs()), true),
            (7, exact::diffprod(a, b, c, d), true),
        ];
        for ((word, value, applies), check) in expected.into_iter().zip(&mut checks) {
            if applies && ordinary(value) {
                check.compare(&[found[word]], &[value.to_bits()], case);
            }
        }
        if case.cancels {
            report.traits.contracts |= f32::from_bits(found[4]) != 0.0;
        }
    }
    report.traits.nan_in_max_min = match (nans.contains(&true), nans.contains(&false)) {
        (true, true) => "either",
        (true, false) => "the NaN",
        _ => "the number",
    };
    report.checks.extend(checks);
}

fn check_triangles(report: &mut ProbeReport, cases: &[TriangleCase], results: &[u32]) {
    let mut checks =
        ["ray_frame", "intersect_triangle", "surface_point", "offset_origin"].map(|name| Check::new(name, TWIN));
    for (case, found) in cases.iter().zip(results.chunks_exact(TRIANGLE_WORDS)) {
        let [a, b, c] = case.vertices;
        let f = exact::ray_frame(case.direction);
        let relative = |v: [f32; 3]| [0, 1, 2].map(|k| v[k] - case.origin[k]);
        let h = exact::intersect_triangle(&f, relative(a), relative(b), relative(c), case.t_min);
        let mut expected = vec![f.kx | f.ky << 8 | f.kz << 16];
        let bits = |x: &[f32]| x.iter().map(|x| x.to_bits()).collect::<Vec<u32>>();
        expected.extend(bits(&[f.sx, f.sy, f.iz, f.inv[0], f.inv[1], f.inv[2]]));
        checks[0].compare(&found[..7], &expected, case);
        let mut expected = vec![u32::from(h.hit)];
        expected.extend(bits(&[h.t, h.u, h.v, h.w, h.det]));
        checks[1].compare(&found[7..13], &expected, case);
        if h.hit {
            let s = exact::surface_point(a, b, c, &h, case.direction);
            let mut expected = bits(&[s.p[0], s.p[1], s.p[2], s.delta, s.n[0], s.n[1], s.n[2]]);
            expected.extend([s.down, s.area.to_bits()]);
            checks[2].compare(&[&found[13..21], &found[24..25]].concat(), &expected, case);
            checks[3].compare(&found[21..24], &bits(&exact::offset_origin(&s)), case);
        }
    }
    report.checks.extend(checks);
}

#[cfg(test)]
mod scene_tests;
#[cfg(test)]
mod tests;
