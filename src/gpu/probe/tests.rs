//! The probe passes where it must and names what is broken on purpose.

use super::*;
use crate::gpu::device::Gpu;
use crate::gpu::executor::{GpuExecutor, Setup};
use crate::gpu::kernels::{self, Kernels};
use crate::gpu::rays::Extent;
use crate::stream::{HostCache, Workers};
use std::sync::Arc;

/// A device of the first adapter, or a note why the test is skipped.
fn device() -> Option<(wgpu::Device, wgpu::Queue)> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    let Some(adapter) = adapters.into_iter().next() else {
        println!("skipped: no adapter");
        return None;
    };
    pollster::block_on(adapter.request_device(&Default::default())).ok()
}

#[test]
fn a_sound_device_passes() {
    let Some((device, queue)) = device() else { return };
    let report = run(&device, &queue);
    println!("{report:?}");
    assert_eq!(failures(&report.checks), Vec::<String>::new());
    assert!(report.checks.iter().all(|c| c.cases > 500), "{report:?}");
}

/// An executor over the probe's own scene, with as many pages as asked and one kernel's text changed.
fn executor(pages: usize, change: &dyn Fn(&str, String) -> String) -> Option<GpuExecutor> {
    let Ok(gpu) = Gpu::open(None) else {
        println!("skipped: no adapter");
        return None;
    };
    let pages = Pages { cache: pages, texels: 1 };
    let source = |kernel: &str| change(kernel, kernels::source(kernel, pages));
    let kernels = Arc::new(Kernels::from_sources(&gpu, pages, false, &source));
    let scene = Arc::new(scene().unwrap());
    let workers = Workers::new(scene.clone(), HostCache::new(0), 1, 0).unwrap();
    let extent = Extent { width: 8, height: 8, tile: 8 };
    let setup = Setup { extent, threshold: 0, count: false };
    Some(GpuExecutor::with_kernels(gpu, kernels, scene, workers, &[], setup).unwrap())
}

#[test]
fn sound_pipelines_agree() {
    for pages in [1, 3] {
        let Some(executor) = executor(pages, &|_, text| text) else { return };
        let start = Instant::now();
        let checks = compare_pipelines(&executor);
        println!("{pages} pages: {:?}", start.elapsed());
        assert_eq!(failures(&checks), Vec::<String>::new());
        assert!(checks.len() == 8 && checks.iter().all(|check| check.cases > 500), "{checks:?}");
    }
}

#[test]
fn cases_are_of_every_kind() {
    assert!(cases::arithmetic().iter().filter(|c| c.cancels).count() > 100);
    let (mut hits, mut zeros) = (0, 0);
    for case in cases::triangles() {
        let f = exact::ray_frame(case.direction);
        let relative = |v: [f32; 3]| [0, 1, 2].map(|k| v[k] - case.origin[k]);
        let [a, b, c] = case.vertices.map(relative);
        let h = exact::intersect_triangle(&f, a, b, c, case.t_min);
        hits += u32::from(h.hit);
        zeros += u32::from(h.hit && (h.u == 0.0 || h.v == 0.0 || h.w == 0.0));
        assert!(case.direction.iter().any(|x| x.abs() > 1e-6));
    }
    assert!(hits > 600 && hits < 2000 && zeros > 20, "{hits} {zeros}");
}

#[test]
fn planted_defects_are_named() {
    let Some((device, queue)) = device() else { return };
    let defects = [
        // A compiler that sees through the barrier and fuses: the difference of exact products.
        ("barrier", "barrier(x.x * x.y) - barrier(x.z * x.w)", "diffprod(x.x, x.y, x.z, x.w)"),
        (
            "intersect_triangle",
            "var u = barrier(barrier(sc.x * sb.y) - barrier(sc.y * sb.x));",
            "var u = diffprod(sc.x, sb.y, sc.y, sb.x);",
        ),
        // A truncated sum and product.
        ("rounding of +", "put(at, x.x + x.y);", "put(at, bitcast<f32>(bitcast<u32>(x.x + x.y) & ~1u));"),
        ("rounding of *", "put(at + 2u, x.x * x.y);", "put(at + 2u, bitcast<f32>(bitcast<u32>(x.x * x.y) & ~1u));"),
        // A quotient from a reciprocal, a root that is not corrected.
        ("divide", "put(at + 5u, divide(x.x, x.y));", "put(at + 5u, x.x * (1.0 / x.y));"),
        ("square_root", "root_step(qr, 8u), 4u), 2u), 1u)", "root_step(qr, 8u), 4u), 2u), 0u)"),
        ("diffprod", "shift_down_sticky(q, u32(clamp(apart - 15, 0, 63)))", "q"),
        ("ray_frame", "const GREATEST_INVERSE: f32 = 0x1p96;", "const GREATEST_INVERSE: f32 = 0x1p90;"),
        ("intersect_triangle", "const CLAMP_ULPS: f32 = 0x1p-19;", "const CLAMP_ULPS: f32 = 0x1p-5;"),
        ("intersect_triangle", "if is_tiny(u) || is_tiny(v) || is_tiny(w) {", "if false {"),
        ("surface_point", "const OFFSET_ULPS: f32 = 0x1p-19;", "const OFFSET_ULPS: f32 = 0x1p-20;"),
        ("offset_origin", "select(bits - 1u, bits + 1u, away)", "select(bits - 2u, bits + 2u, away)"),
    ];
    let fused = source().replace("x.x * x.y - x.z * x.w);", "diffprod(x.x, x.y, x.z, x.w));");
    assert!(run_source(&device, &queue, &fused).contracts);
    for (name, sound, broken) in defects {
        let text = source();
        assert!(text.contains(sound), "{sound}");
        let report = run_source(&device, &queue, &text.replace(sound, broken));
        let failures = failures(&report.checks);
        assert!(failures.iter().any(|f| f.starts_with(name)), "{name}: {broken}: {failures:?}");
    }
}
