//! The probe passes where it must and names what is broken on purpose.

use crate::gpu::device::Gpu;
use crate::gpu::executor::GpuExecutor;
use crate::gpu::kernels;
use crate::gpu::kernels::Kernels;
use crate::gpu::probe::*;
use crate::kernels::frame::Frame;
use crate::kernels::{Extent, Keep, Setup};
use crate::skip::skip;
use crate::stream::{HostCache, Workers};
use std::sync::Arc;

/// A device, or the test is skipped.
fn device() -> Option<Gpu> {
    Gpu::open(None).map_err(|error| skip(&error.to_string())).ok()
}

#[test]
fn a_sound_device_passes() {
    let Some(gpu) = device() else { return };
    let report = run(&gpu);
    println!("{report:?}");
    assert_eq!(failures(&report.checks), Vec::<String>::new());
    assert!(report.checks.iter().all(|c| c.cases > 500), "{report:?}");
}

/// An executor over the probe's own scene, with as many pages as asked and one kernel's text changed.
fn executor(pages: usize, change: impl Fn(&str, String) -> String + Send + Sync + 'static) -> Option<GpuExecutor> {
    let gpu = device()?;
    let pages =
        Pages { cache: pages, texels: 1, opacity: false, gloss: false, layers: false, levels: false, hides: false };
    let source = move |kernel: &str| change(kernel, kernels::source(kernel, pages));
    let kernels = Arc::new(Kernels::from_sources(&gpu, pages, false, source));
    let scene = Arc::new(scene().unwrap());
    let workers = Workers::new(scene.clone(), HostCache::new(0), 1).unwrap();
    let extent = Extent { width: 8, height: 8, tile: 8 };
    let setup =
        Setup { extent, threshold: 0, count: false, opaque: false, hides: false, flat_bytes: 0, keep: Keep::default() };
    Some(GpuExecutor::with_kernels(gpu, kernels, scene, workers, &[], setup).unwrap())
}

#[test]
fn sound_pipelines_agree() {
    for pages in [1, 3] {
        let Some(executor) = executor(pages, |_, text| text) else { return };
        let start = Instant::now();
        let checks = compare_pipelines(&executor);
        println!("{pages} pages: {:?}", start.elapsed());
        assert_eq!(failures(&checks), Vec::<String>::new());
        assert!(checks.len() == 23 && checks.iter().all(|check| check.cases > 500), "{checks:?}");
    }
}

#[test]
fn a_pipeline_that_differs_is_named() {
    let (list, all) = ("intersect_list", "intersect_all");
    let (closest, any) = (" (closest hit) differs from ", " (any hit) differs from ");
    // Kernel, what is changed in its text, the lines that must be there.
    let defects = [
        // t off by one ulp.
        (
            list,
            "*best = Best(h.t,",
            "*best = Best(bitcast<f32>(bitcast<u32>(h.t) + 1u),",
            vec![
                format!("{list}{closest}brute force"),
                format!("{list}{any}brute force"),
                format!("{list}{closest}{all}"),
                format!("{list}{any}{all}"),
            ],
        ),
        // Of equally near triangles that with the highest id.
        (
            all,
            "id >= (*best).id",
            "id <= (*best).id",
            vec![format!("{all}{closest}brute force"), format!("{list}{closest}{all}")],
        ),
        // The open end of the range.
        (
            all,
            "h.t > (*best).t",
            "h.t >= (*best).t",
            vec![format!("{all}{any}brute force"), format!("{list}{any}{all}")],
        ),
        // Wide bricks without the low parts.
        (
            list,
            "barrier3(barrier3(high + (*r).offset_high) + barrier3(low + (*r).offset_low))",
            "barrier3(high + (*r).offset_high)",
            vec![format!("{list}{closest}brute force"), format!("{list}{any}brute force")],
        ),
        // The first rays of tiles without lists.
        (
            all,
            "return work_of(WORK_ROOTED, workgroup);",
            "return work_of(WORK_ROOTED, workgroup + 1u);",
            ["intersect_from_root", "intersect_from_root_all"]
                .iter()
                .flat_map(|name| [format!("{name}{closest}brute force"), format!("{name}{any}{all}")])
                .collect(),
        ),
        // The same hits, but rays that start elsewhere: brute force does not tell.
        (
            list,
            "Surface(point, best.leaf,",
            "Surface(point + point * 0x1p-22, best.leaf,",
            vec![format!("{list}{closest}{all}")],
        ),
        // The same, where rays ask whether there is any hit: those of another leaf.
        (
            list,
            "surfaces[ray].leaf = best.leaf;",
            "surfaces[ray].leaf = best.leaf + 1u;",
            vec![format!("{list}{any}{all}")],
        ),
    ];
    for (kernel, sound, broken, lines) in defects {
        let change = move |file: &str, text: String| {
            let is_own = file.rsplit('/').next() == Some(kernel);
            assert!(!is_own || text.contains(sound), "{sound}");
            if is_own { text.replace(sound, broken) } else { text }
        };
        let Some(executor) = executor(1, change) else { return };
        let failures = failures(&compare_pipelines(&executor));
        for line in lines {
            assert!(failures.iter().any(|f| f.starts_with(&line)), "{broken}: {line}: {failures:#?}");
        }
        // The other pipeline is right.
        let other = if kernel == list { all } else { list };
        assert!(!failures.iter().any(|f| f.starts_with(other) && f.contains("brute force")), "{broken}: {failures:#?}");
        assert!(failures.iter().all(|f| f.contains("(first: ") && f.contains(" for ray ")), "{failures:#?}");
    }
}

#[test]
fn rays_of_the_probe_are_of_every_kind() {
    let scene = scene().unwrap();
    let frame = Frame::near(scene.resident(), glam::DVec3::ZERO);
    let twin = twin::Twin::new(&scene, &frame).unwrap();
    let (mut hits, mut ties, mut ends, mut edges, mut untraced) = (0, 0, 0, 0, 0);
    for ray in rays::rays(&twin, frame.unit) {
        let met = twin.hits(&ray);
        let closest = twin::closest(&ray, &met);
        hits += usize::from(!met.is_empty());
        ties += usize::from(met.iter().filter(|hit| hit.t == closest.t).count() > 1);
        ends += usize::from(!met.is_empty() && closest.t == ray.t_max);
        edges += usize::from(!met.is_empty() && (closest.u == 0.0 || closest.v == 0.0));
        untraced += usize::from(ray.t_min > ray.t_max);
    }
    println!("{hits} hits, {ties} ties, {ends} at the end of the range, {edges} on edges, {untraced} untraced");
    assert!((800..rays::RAYS - 100).contains(&hits), "{hits} hits");
    assert!(ties > 50 && ends > 2 && edges > 50 && untraced > 2);
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
    let Some(gpu) = device() else { return };
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
    assert!(run_source(&gpu, &fused).traits.contracts);
    for (name, sound, broken) in defects {
        let text = source();
        assert!(text.contains(sound), "{sound}");
        let report = run_source(&gpu, &text.replace(sound, broken));
        let failures = failures(&report.checks);
        assert!(failures.iter().any(|f| f.starts_with(name)), "{name}: {broken}: {failures:?}");
    }
}
