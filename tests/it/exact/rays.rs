//! Records count every ray that is generated once: as traced or as answered, in every mode, on both executors.

use crate::common::{adapters, city, folder, settings};
use brickwalk::counters::Record;
use brickwalk::frame::{Equirectangular, Renderer, environment};
use brickwalk::kernels::Lamps;
use brickwalk::scene::Camera;
use brickwalk::scene::path::CameraPath;
use brickwalk::schedule::{Lamp, Pass};
use brickwalk::secondary::dvf::{Cells, DvfSettings, DvfUse};
use brickwalk::secondary::dvf::{Dvf, DvfTracing, Region};
use brickwalk::session::opened::{Opened, open_scene};
use brickwalk::settings::Group;
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

const ROMA: &str = "--secondary ao=roma,diffuse=roma,shadow=roma --roma-size 64 --roma-k 4 --cache 20%";

/// Effects of the sky, and of an environment in place of it.
const EFFECTS: [&str; 2] = ["shadow,ao,diffuse,glossy --ao-rays 4 --ao-length 64", "shadow,environment,diffuse,glossy"];

/// A renderer with a sun, and a sky or an environment.
fn renderer(scene: &Path, adapter: &str, options: &str) -> Renderer {
    let mut settings = settings(&format!("--size 48x32 --tile 16 {options}"));
    settings.set("adapter", adapter).expect("an adapter");
    let opened = Opened::open(open_scene(scene).expect("a scene"), scene, &settings).expect("a session");
    let mut renderer = brickwalk::session::renderer::renderer(opened, scene, &settings).expect("lamps");
    if !options.contains("environment") {
        return renderer;
    }
    // An uneven one: of an even one diffuse rays bring the light, and no pass draws it from camera hits.
    let uneven = Equirectangular::of(16, 8, |[x, _, z]| [if x > 0.0 && z > 0.0 { 1.0 } else { 0.1 }; 3]);
    renderer.light.lamps = Arc::new(Lamps::new(Some(environment(uneven, 1.0, 0.0).0), Vec::new(), 1.0));
    renderer
}

/// Records of two frames; what is measured in the first may decide of the second.
fn records(renderer: &mut Renderer, camera: &Camera) -> Vec<Record> {
    (0..2).flat_map(|frame| renderer.frame(frame, camera).expect("a frame").records).collect()
}

/// A field of visibility of the scene, for what answers by it.
fn with_field(renderer: &mut Renderer, how: DvfUse) {
    let settings = DvfSettings { points: 4000, rays: 32, cells: Cells::Longest(32), ..DvfSettings::default() };
    let region = Region::scene(renderer.scene.resident());
    let made = renderer.make_dvf(&settings, &region, DvfTracing::over(32), &mut |_, _| true).expect("a field");
    renderer.methods.set(Dvf::new(Arc::new(made.field), how));
}

/// What is wrong with a record, by what it says as JSON, of `generated` rays.
fn fault(record: &Record, generated: Option<u64>) -> Option<String> {
    let json = serde_json::to_value(record).expect("a record");
    let count = |field: &str| json[field].as_u64().unwrap_or_else(|| panic!("{field} of {json}"));
    let [rays, traced, answered] = ["rays", "rays_traced", "rays_answered"].map(count);
    let (ms, rate) = (json["ms"].as_f64()?, json["mrays_per_s"].as_f64()?);
    if rays != traced + answered || generated.is_some_and(|generated| rays != generated) {
        return Some(format!("{rays} rays, {traced} traced, {answered} answered, {generated:?} generated"));
    }
    ((rate - traced as f64 / ms * 1e-3).abs() > 1e-9 * rate).then(|| format!("{rate} Mray/s of {traced} in {ms} ms"))
}

/// Rays of a pass over all records: traced, and answered.
fn rays(records: &[Record], pass: &str) -> [u64; 2] {
    let of_pass = || records.iter().filter(|record| record.pass == pass);
    [of_pass().map(|r| r.rays_traced).sum(), of_pass().map(|r| r.rays_answered).sum()]
}

#[test]
fn every_ray_is_traced_or_answered_once() {
    let folder = folder();
    let scene = city(folder.path(), "20K", "512");
    let camera = CameraPath::read(&scene.with_extension("near.json")).expect("a path").frame(0, 1);
    let labels = DvfUse::default();
    // First those whose kernels count in ways of their own: software Vulkan runs these alone.
    let modes: &[(&str, Option<DvfUse>)] = &[
        (ROMA, None),
        ("--secondary ao=df,shadow=df --cache 20% --df-size 32", None),
        ("--secondary ao=sift,shadow=sift --roma-size 64 --cache 20% --auto-one-in 4", None),
        ("--cache 20%", Some(labels)),
        ("--cache 20% --spp 2", Some(DvfUse { paper: true, ..labels })),
        ("--schedule demand --cache 20%", None),
        ("--schedule plain --cache 100%", None),
        ("--schedule auto --cache 20%", None),
        ("--schedule chc --cache 20% --fronts on", None),
        (
            "--secondary ao=roma,diffuse=roma,shadow=roma --roma-size 64 --roma-k 4 --cache 100% --roma-unsnapped all",
            None,
        ),
        ("--secondary ao=sift,shadow=sift --roma-size 64 --cache 20% --auto-error off", None),
        ("--secondary ao=sift,shadow=sift --roma-size 64 --cache 20% --auto-error 50", None),
        ("--schedule plain --cache 100%", Some(DvfUse { doubt: true, ..labels })),
    ];
    for adapter in adapters() {
        let modes = if adapter == "cpu" { modes } else { &modes[..5] };
        let of = |is_lit_around: bool, options: &str, how: Option<DvfUse>| {
            let effects = EFFECTS[usize::from(is_lit_around)];
            let mut renderer = renderer(&scene, &adapter, &format!("--diffuse-rays 2 --effects {effects} {options}"));
            if let Some(how) = how {
                with_field(&mut renderer, how);
            }
            records(&mut renderer, &camera)
        };
        let exact = [false, true].map(|is_lit_around| of(is_lit_around, "--schedule chc --cache 20%", None));
        for records in &exact {
            assert!(records.iter().all(|record| record.rays_answered == 0), "{adapter}");
            assert!(records.iter().filter(|record| record.rays_traced > 100).count() >= 10, "{adapter}");
        }
        let passes: BTreeSet<&str> = exact.iter().flatten().map(|record| record.pass).collect();
        assert_eq!(passes.len(), 10, "{passes:?}");
        let generated = |is_lit_around: bool, record: &Record| {
            let same = |other: &&Record| (other.frame, other.pass) == (record.frame, record.pass);
            exact[usize::from(is_lit_around)].iter().find(same).map(|other| other.rays_traced)
        };
        let mut of_modes = Vec::new();
        for (options, how) in modes {
            let found = of(how.is_some(), options, *how);
            let what = format!("{adapter}: {options} {how:?}");
            for record in &found {
                // Rays from hits that maps found start elsewhere; the paper's rays to the environment are others.
                let are_others = options.contains("ao=roma") && record.pass.starts_with("diffuse-")
                    || how.is_some_and(|how| how.paper) && record.pass == "environment";
                let expected =
                    if are_others || options.contains("spp") { None } else { generated(how.is_some(), record) };
                assert_eq!(fault(record, expected), None, "{what}: {}", record.pass);
            }
            let answered: u64 = found.iter().map(|record| record.rays_answered).sum();
            assert_eq!(answered > 0, options.contains("secondary") || how.is_some(), "{what}: {answered} answered");
            println!("{what}: ao {:?}, environment {:?}", rays(&found, "ao"), rays(&found, "environment"));
            let ([of_ao, ao], [_, environment]) = (rays(&found, "ao"), rays(&found, "environment"));
            match () {
                // What maps and fields answer is not traced at all; pilots and rays in doubt are.
                _ if options.contains("ao=roma") || options.contains("ao=df") => {
                    assert!(of_ao == 0 && ao > 0, "{what}")
                }
                _ if options.contains("ao=sift") => assert!(of_ao > 0 && ao > 0, "{what}"),
                _ => assert!(ao == 0 && (environment > 0) == how.is_some(), "{what}"),
            }
            if let Some(one_in) = options.contains("one-in 4").then_some(4) {
                assert!((one_in * of_ao).abs_diff(of_ao + ao) < (of_ao + ao) / 5, "{what}: {of_ao} of {}", of_ao + ao);
            }
            of_modes.push(found);
        }
        // Controls: rays counted twice, for one another, or not at all are noticed.
        let record = of_modes[0].iter().find(|record| record.pass == "ao").expect("a record");
        let wrong = |change: fn(&mut Record)| {
            let mut wrong = record.clone();
            change(&mut wrong);
            fault(&wrong, generated(false, &wrong))
        };
        assert_eq!(wrong(|_| {}), None);
        assert!(wrong(|record| record.rays_traced = record.rays_answered).is_some(), "asked about and answered");
        assert!(wrong(|record| record.rays_answered -= 1).is_some(), "one is missing");
        assert!(wrong(|record| record.rays_traced += 1).is_some(), "one too many");
    }
}

#[test]
fn counts_are_those_of_the_rays_themselves() {
    let folder = folder();
    let scene = city(folder.path(), "20K", "512");
    let camera = CameraPath::read(&scene.with_extension("near.json")).expect("a path").frame(0, 1);
    for adapter in adapters() {
        for secondary in ["exact", "shadow=roma", "shadow=df", "shadow=sift --auto-error off"] {
            let cells = "--roma-size 64 --df-size 32";
            let options = format!("--effects shadow --secondary {secondary} --cache 100% {cells}");
            let mut renderer = renderer(&scene, &adapter, &options);
            let records = renderer.frame(0, &camera).expect("a frame").records;
            let [traced, answered] = rays(&records, "shadow");
            let pass = Pass::Shadow(Lamp::Sun);
            let rays = renderer.executor.read_rays(pass).expect("rays");
            let hits = renderer.executor.read_hits(pass).expect("hits");
            let all = rays.iter().zip(&hits).filter(|(ray, _)| ray.t_min <= ray.t_max);
            // What is ended before its start is not traced.
            let ended = all.clone().filter(|(ray, hit)| hit.t < ray.t_min).count() as u64;
            let expected = match secondary {
                "exact" => [all.count() as u64, 0],
                "shadow=roma" | "shadow=df" => [0, all.count() as u64],
                _ => [all.count() as u64 - ended, ended],
            };
            assert_eq!([traced, answered], expected, "{adapter}, {secondary}");
            assert!(expected.iter().sum::<u64>() > 500, "{adapter}, {secondary}: {expected:?}");
            assert!(rays.len() as u64 > expected.iter().sum::<u64>(), "{adapter}: control: some rays are empty");
        }
    }
}
