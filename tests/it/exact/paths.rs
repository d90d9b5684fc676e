//! Paths of several bounces: the same bytes whatever the cache holds, and bytes loaded by bounce.

use crate::common::{adapters, folder, frames, polished_city, records, sum, walk};

const BYTES: [&str; 4] = ["bytes_bvh", "bytes_geometry", "bytes_attributes", "bytes_textures"];

#[test]
fn paths_do_not_depend_on_the_cache() {
    let folder = folder();
    let scene = polished_city(folder.path(), 60_000, 500);
    let path = scene.with_extension("near.json");
    let common = format!("--path {} --frames 2 --size 48x32 --aov --effects path --bounces 4", path.display());
    for adapter in adapters() {
        let name = adapter.split_whitespace().next().expect("a name");
        let run = |options: &str| {
            let output = folder.path().join("out");
            walk(&scene, &output, &format!("{common} --diffuse-rays 1 --spp 2 --adapter {name} {options}"));
            let records = records(&output);
            let loaded = |pass: &str| BYTES.map(|field| sum(&records, pass, field)).iter().sum::<f64>();
            let bounces = ["diffuse", "glossy", "bounce-2", "bounce-3", "bounce-4"].map(loaded);
            let rays = ["bounce-2", "bounce-3", "bounce-4"].map(|pass| sum(&records, pass, "rays_traced"));
            assert!(rays.iter().all(|&rays| rays > 0.0), "{options}: {rays:?}");
            (frames(&output), bounces)
        };
        let (first, in_core) = run("--cache 100% --schedule chc");
        assert_eq!(first.len(), 4, "two frames, PNG and EXR");
        for options in [
            "--cache 15% --schedule chc",
            "--cache 15% --schedule demand --evict lru",
            "--cache 15% --schedule chc --tile 16 --bands 2",
            "--cache 100% --schedule plain",
            // With fronts, rays of paths that go on keep their places.
            "--cache 100% --schedule chc --fronts on",
        ] {
            let (found, bounces) = run(options);
            assert!(found == first, "{adapter}: {options}: frames differ");
            if options.contains("15%") {
                println!("{options}: bytes by bounce {bounces:?}, in core {in_core:?}");
                let all = |bounces: &[f64]| bounces.iter().sum::<f64>();
                assert!(bounces.iter().all(|&bytes| bytes > 0.0), "{options}: {bounces:?}");
                assert!(all(&bounces) > 3.0 * all(&in_core), "{options}: {bounces:?}, {in_core:?}");
            }
        }
        assert!(run("--cache 15% --schedule chc --seed 1").0 != first, "{adapter}: another seed changed nothing");
    }
}
