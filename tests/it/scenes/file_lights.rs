//! Lights that a scene file brings (KHR_lights_punctual), from glTF to the picture, against closed forms.

use crate::common;
use exr::prelude::*;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

/// A matt plane of y = 0 with an albedo of 0.5, and `lights` in nodes with these properties, as glTF.
fn gltf(folder: &Path, name: &str, lights: &[(&str, &str)]) -> PathBuf {
    let corners: [f32; 12] = [-200.0, 0.0, -200.0, -200.0, 0.0, 200.0, 200.0, 0.0, 200.0, 200.0, 0.0, -200.0];
    let mut bytes: Vec<u8> = corners.iter().flat_map(|x| x.to_le_bytes()).collect();
    bytes.extend([0u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
    std::fs::write(folder.join("plane.bin"), &bytes).expect("a buffer");
    let (defined, nodes): (Vec<_>, Vec<_>) = (0..)
        .zip(lights)
        .map(|(i, (light, node))| {
            (
                format!("{{{light}}}"),
                format!(r#"{{"extensions": {{"KHR_lights_punctual": {{"light": {i}}}}}, {node}}}"#),
            )
        })
        .unzip();
    let roots: Vec<String> = (0..=lights.len()).map(|node| node.to_string()).collect();
    let text = format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [{}]}}],
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_specular"],
        "extensions": {{"KHR_lights_punctual": {{"lights": [{}]}}}},
        "nodes": [{{"mesh": 0}}{}{}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "indices": 1, "material": 0}}]}}],
        "materials": [{{"pbrMetallicRoughness": {{"baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicFactor": 0}},
            "extensions": {{"KHR_materials_specular": {{"specularFactor": 0}}}}}}],
        "buffers": [{{"uri": "plane.bin", "byteLength": {}}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 48}}, {{"buffer": 0, "byteOffset": 48, "byteLength": 12}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}},
            {{"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}}]}}"#,
        roots.join(", "),
        defined.join(", "),
        if nodes.is_empty() { "" } else { ", " },
        nodes.join(", "),
        bytes.len(),
    );
    let input = folder.join(format!("{name}.gltf"));
    std::fs::write(&input, text).expect("a file");
    let scene = folder.join(format!("{name}.bricks"));
    common::succeed(["convert".as_ref(), input.as_os_str(), "-o".as_ref(), scene.as_os_str()]);
    scene
}

/// The mean radiance, red and green, of the plane around the origin, seen from above.
fn radiance(scene: &Path, options: &str) -> [f64; 2] {
    let path = scene.with_extension("json");
    let text =
        r#"{"fov_y_degrees": 1, "up": [0,0,1], "keyframes": [{"time": 0, "position": [0,3,0], "target": [0,0,0]}]}"#;
    std::fs::write(&path, text).expect("a camera path");
    let output = scene.with_extension("walk");
    let options = format!(
        "--adapter cpu --frames 1 --size 16x16 --aov --cache 100% --sun-intensity 0 --sky-intensity 0 --effects shadow \
         --path {} {options}",
        path.display()
    );
    common::walk(scene, &output, &options);
    let image = read_all_flat_layers_from_file(output.join("frames/0000.exr")).expect("an EXR");
    let list = &image.layer_data[0].channel_data.list;
    ["R", "G"].map(|name| {
        let channel = list.iter().find(|channel| channel.name.to_string() == name).expect("a channel");
        let values: Vec<f64> = channel.sample_data.values_as_f32().map(f64::from).collect();
        values.iter().sum::<f64>() / values.len() as f64
    })
}

/// A turn about x that takes the axis of a light, -z, by `angle` from straight down towards -z.
fn turned(angle: f64) -> String {
    // Straight down is a turn by -90 degrees.
    let half = 0.5 * (angle - PI / 2.0);
    format!("[{}, 0, 0, {}]", half.sin(), half.cos())
}

#[test]
fn lights_of_the_file_shine_as_their_units_say() {
    let folder = common::folder();
    let folder = folder.path();
    let near = |found: f64, truth: f64| assert!((found / truth - 1.0).abs() < 1e-3, "{found}, not {truth}");
    let shed =
        |name: &str, light: &str, node: &str, options: &str| radiance(&gltf(folder, name, &[(light, node)]), options);

    // A point of 40 cd (20 in green) at a distance of 5, over the plane at a cosine of 0.8: I / d^2 * cos * albedo /
    // pi.
    let point = r#""type": "point", "color": [1, 0.5, 0], "intensity": 40"#;
    let truth = 40.0 / 25.0 * 0.8 * 0.5 / PI;
    let [red, green] = shed("point", point, r#""translation": [3, 4, 0]"#, "");
    near(red, truth);
    near(green, truth / 2.0);
    // The range ends it (KHR_lights_punctual: 1 - (d / range)^4), scales of the node do not change it.
    let ranged = format!(r#"{point}, "range": 10"#);
    near(shed("ranged", &ranged, r#""translation": [3, 4, 0], "scale": [3, 3, 3]"#, "")[0], truth * (1.0 - 0.0625));
    let short = format!(r#"{point}, "range": 4.9"#);
    assert_eq!(shed("short", &short, r#""translation": [3, 4, 0]"#, ""), [0.0; 2]);
    // It may be turned down, and off.
    near(shed("half", point, r#""translation": [3, 4, 0]"#, "--lights-intensity 0.5")[0], truth / 2.0);
    assert_eq!(shed("off", point, r#""translation": [3, 4, 0]"#, "--lights-intensity 0"), [0.0; 2]);

    // A spot 2 above, tilted: within its inner angle, between, beyond.
    let spot = r#""type": "spot", "intensity": 8, "spot": {"innerConeAngle": 0.3, "outerConeAngle": 0.6}"#;
    let tilted = |angle: f64| {
        let node = format!(r#""translation": [0, 2, 0], "rotation": {}"#, turned(angle));
        shed("spot", spot, &node, "")[0]
    };
    let below = 8.0 / 4.0 * 0.5 / PI;
    near(tilted(0.2), below);
    let between = (0.45f64.cos() - 0.6f64.cos()) / (0.3f64.cos() - 0.6f64.cos());
    near(tilted(0.45), below * between * between);
    assert_eq!(tilted(0.65), 0.0);

    // A distant light of 3 lux at 0.5 from the vertical, wherever its node is.
    let distant = r#""type": "directional", "intensity": 3"#;
    let node = format!(r#""translation": [0, -9, 0], "rotation": {}"#, turned(0.5));
    near(shed("distant", distant, &node, "")[0], 3.0 * 0.5f64.cos() * 0.5 / PI);

    // Without lights it is dark: nothing else shone.
    assert_eq!(radiance(&gltf(folder, "dark", &[]), ""), [0.0; 2]);
}

#[test]
fn info_lists_the_lights() {
    let folder = common::folder();
    let lights = [
        (r#""type": "point", "intensity": 40"#, r#""translation": [3, 4, 0]"#),
        (r#""type": "directional", "color": [1, 0.5, 0]"#, r#""name": "sun""#),
    ];
    let scene = gltf(folder.path(), "two", &lights);
    let text = common::succeed(["info".as_ref(), scene.as_os_str()]);
    assert!(text.contains("point, [40.0, 40.0, 40.0] cd at [3.0, 4.0, 0.0]"), "{text}");
    assert!(text.contains("distant, [1.0, 0.5, 0.0] lux along"), "{text}");
    let json = common::succeed(["info".as_ref(), scene.as_os_str(), "--json".as_ref()]);
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(json["lights"][0]["kind"], "point");
    assert_eq!(json["lights"][1]["direction"], serde_json::json!([0.0, 0.0, -1.0]));
    assert_eq!(json["is_glossy"], false);
}
