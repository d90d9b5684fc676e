//! Real input: Sponza is converted, checked, streamed through a small cache, and looks the same however it is streamed.

use crate::common::{brickwalk, folder, frames, records, shared_scenes, succeed, walk};

#[test]
fn sponza_converts_streams_and_verifies() {
    let Some(scenes) = shared_scenes() else { return };
    let folder = folder();
    let scene = folder.path().join("s.bricks");
    let input = scenes.join("sponza/Sponza.gltf");
    let words = ["convert".as_ref(), input.as_os_str(), "-o".as_ref(), scene.as_os_str()];
    succeed(words.into_iter().chain(["--brick-triangles", "4K"].map(std::ffi::OsStr::new)));
    succeed(["verify".as_ref(), scene.as_os_str()]);
    let info = succeed(["info".as_ref(), scene.as_os_str(), "--json".as_ref()]);
    let info: serde_json::Value = serde_json::from_str(&info).expect("JSON");
    assert_eq!(info["format"], 4);

    let (small, all) = (folder.path().join("small"), folder.path().join("all"));
    let view = "--frames 2 --size 160x90 --aov";
    walk(&scene, &small, &format!("{view} --cache 2M"));
    walk(&scene, &all, &format!("{view} --cache 100% --schedule plain"));
    let picture = frames(&small);
    assert!(picture == frames(&all), "a cache of 2 MiB shows what a resident scene shows");
    let evicted: u64 = records(&small).iter().filter_map(|r| r["bricks_evicted"].as_u64()).sum();
    assert!(evicted > 0, "2 MiB make it stream");
    // Through a cache smaller than its textures: close enough to see tiles of many, it shows the same in core.
    let tiles: u64 = bricks::SceneFile::open(&scene).expect("the scene").resident().tiles.iter().map(|t| t.bytes).sum();
    assert!(tiles > 8 << 20, "{tiles} bytes of tiles");
    let close = "--adapter cpu --frames 3 --size 96x54 --aov --effects shadow,diffuse,glossy --diffuse-rays 1 --fov 5";
    let least = info["least_cache_bytes"].as_u64().expect("a size").to_string();
    let [few, whole] = [&least[..], "100%"].map(|cache| {
        let output = folder.path().join(format!("close-{cache}"));
        walk(&scene, &output, &format!("{close} --cache {cache}"));
        (frames(&output), records(&output).iter().filter_map(|r| r["bytes_textures"].as_u64()).sum::<u64>())
    });
    assert!(few.0 == whole.0, "the least cache shows what a resident scene shows");
    assert!(few.1 > whole.1 && whole.1 > 0, "tiles are streamed: {} bytes, {} in core", few.1, whole.1);
    let other = folder.path().join("other");
    walk(&scene, &other, &format!("{}.01 --cache 100%", close));
    assert!(frames(&other) != whole.0, "another view shows something else");

    // Textured: many colours, neither all dark nor all sky.
    let image = image::open(small.join("frames/0000.png")).expect("a frame").to_rgb8();
    let colours: std::collections::HashSet<_> = image.pixels().map(|p| p.0.map(|c| c / 8)).collect();
    assert!(colours.len() > 150, "{} colours", colours.len());

    // One flipped byte in each tenth of the file: verify fails and names what is damaged.
    let whole = std::fs::read(&scene).expect("the file");
    for tenth in 0..10 {
        let at = tenth * whole.len() / 10 + 123;
        let mut damaged = whole.clone();
        damaged[at] ^= 0x40;
        std::fs::write(&scene, &damaged).expect("a file");
        let output = brickwalk(["verify".as_ref(), scene.as_os_str()]);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "byte {at}: {message}");
        let named = ["brick", "texture", "section", "header", "directory", "padding", "resident"];
        assert!(named.iter().any(|n| message.contains(n)), "byte {at}: {message}");
    }
}
