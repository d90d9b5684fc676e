//! What references lead to: the model's folder, or one around it that is named, and nothing beyond.

use super::tiles::{model, sizes, tileset, write_json};
use super::writer::*;
use brickwalk_convert::import::Input;
use brickwalk_convert::source::SourceScene;
use serde_json::json;
use std::path::{Path, PathBuf};

/// A folder with models in `models/deep` whose buffers, materials, textures and tiles lie in `parts`, beside `models`.
fn library() -> tempfile::TempDir {
    let top = tempfile::tempdir().unwrap();
    let root = top.path().join("library");
    std::fs::create_dir_all(root.join("models/deep")).unwrap();
    std::fs::create_dir_all(root.join("parts")).unwrap();
    let mut file = Writer::triangle();
    file.push("images", json!({"uri": "../../parts/c.png"}));
    file.push("textures", json!({"source": 0}));
    file.push("materials", json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    file.root["meshes"][0]["primitives"][0]["material"] = json!(0);
    let uvs = file.floats("VEC2", &[0.0; 6]);
    file.root["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(uvs);
    write(&root, "models/deep/test.gltf", &file.json(Some("../../parts/b.bin")));
    write(&root, "parts/b.bin", &file.bytes);
    write(&root, "parts/c.png", &png(1, 1, &[7; 4]));
    let text = "mtllib ../../parts/m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n";
    write(&root, "models/deep/a.obj", text.as_bytes());
    write(&root, "parts/m.mtl", b"newmtl a\nKd 1 1 1\nmap_Kd ..\\..\\parts\\c.png\n");
    write(&root, "parts/tile.glb", &model(3.0));
    write_json(&root, "parts/more.json", &tileset(json!({"content": {"uri": "tile.glb"}})));
    write_json(&root, "models/deep/tileset.json", &tileset(json!({"content": {"uri": "../../parts/more.json"}})));
    top
}

fn within(path: PathBuf, folder: &Path) -> Result<SourceScene, String> {
    import_all(&[Input { within: Some(folder.into()), ..Input::from(path) }])
}

fn texels(scene: &SourceScene) -> Vec<u8> {
    scene.textures.iter().map(|texture| texture.rgba[0]).collect()
}

#[test]
fn a_named_folder_is_read_and_none_else() {
    let top = library();
    let root = top.path().join("library");
    let at = |name: &str| root.join("models/deep").join(name);
    // Without the folder neither is read, and the remedy is named.
    let error = error_text(import_one(&at("test.gltf")));
    assert!(error.contains("../../parts/b.bin") && error.contains("--within"), "{error}");
    let alone = import_one(&at("a.obj")).unwrap();
    assert!(alone.textures.is_empty() && alone.warnings[0].contains("--within"), "{:?}", alone.warnings);
    assert!(import_one(&at("tileset.json")).unwrap_err().contains("--within"));
    // With it, however it is written, all are.
    for folder in [root.clone(), root.join("models/../models/.."), top.path().to_owned()] {
        let gltf = within(at("test.gltf"), &folder).unwrap();
        assert_eq!((texels(&gltf), gltf.warnings.len()), (vec![7], 0), "{:?}", gltf.warnings);
        let obj = within(at("a.obj"), &folder).unwrap();
        assert_eq!((texels(&obj), obj.warnings.len()), (vec![7], 0), "{:?}", obj.warnings);
        let tiles = within(at("tileset.json"), &folder).unwrap();
        assert_eq!(sizes(&tiles), [3.0]);
    }
    // A folder between does not do, nor one in which the model is not, nor one that is not there.
    assert!(within(at("test.gltf"), &root.join("models")).unwrap_err().contains("leads out of the folder"));
    for (folder, expected) in [("parts", "test.gltf: --within "), ("none", "cannot read the folder")] {
        let error = error_text(within(at("test.gltf"), &root.join(folder)));
        assert!(error.contains(expected), "{error}");
    }
    let error = error_text(within(at("test.gltf"), &root.join("parts/c.png")));
    assert!(error.contains("cannot read the folder: not a directory"), "{error}");
}

#[test]
fn sources_are_named_as_without_it() {
    let top = library();
    let root = top.path().join("library");
    write(&root, "models/deep/tile.glb", &model(1.0));
    let path = root.join("models/deep/tileset.json");
    std::fs::write(&path, tileset(json!({"content": {"uri": "tile.glb"}})).to_string()).unwrap();
    let names = |scene: SourceScene| scene.sources.into_iter().map(|source| source.name).collect::<Vec<_>>();
    assert_eq!(names(import_one(&path).unwrap()), names(within(path, &root).unwrap()));
}

#[cfg(unix)]
#[test]
fn symbolic_links_lead_out_of_no_named_folder() {
    use std::os::unix::fs::symlink;
    let top = library();
    let root = top.path().join("library");
    // The buffer is a link to a file within, then to one outside; the picture is in a folder that is a link.
    let buffer = root.join("parts/b.bin");
    std::fs::rename(&buffer, root.join("models/real.bin")).unwrap();
    symlink(root.join("models/real.bin"), &buffer).unwrap();
    let path = root.join("models/deep/test.gltf");
    assert_eq!(texels(&within(path.clone(), &root).unwrap()), [7]);
    let outside = top.path().join("outside.bin");
    std::fs::rename(root.join("models/real.bin"), &outside).unwrap();
    std::fs::remove_file(&buffer).unwrap();
    symlink(&outside, &buffer).unwrap();
    let error = error_text(within(path.clone(), &root));
    assert!(error.contains("a symbolic link leads out of"), "{error}");
    // Control: around both it is one like any other.
    assert_eq!(texels(&within(path.clone(), top.path()).unwrap()), [7]);
    std::fs::rename(root.join("parts"), top.path().join("parts")).unwrap();
    symlink(top.path().join("parts"), root.join("parts")).unwrap();
    let error = error_text(within(path, &root));
    assert!(error.contains("a symbolic link leads out of"), "{error}");
}
