//! Writes small glTF files: JSON by hand, buffers by code.

use brickwalk_convert::import::{ImportSettings, Input, import, load_all};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::SourceScene;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

pub const U8: u32 = 5121;
pub const U16: u32 = 5123;
pub const U32: u32 = 5125;
pub const F32: u32 = 5126;

/// A glTF file in the making: one buffer, and a JSON root that tests change at will.
pub struct Writer {
    pub root: Value,
    pub bytes: Vec<u8>,
}

impl Writer {
    /// An asset without anything in it.
    pub fn new() -> Self {
        let root = json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}],
            "nodes": [], "meshes": [], "accessors": [], "bufferViews": [], "materials": []
        });
        Self { root, bytes: Vec::new() }
    }

    /// One triangle in one node: positions 0 0 0, 1 0 0, 0 1 0 and u16 indices 0 1 2.
    pub fn triangle() -> Self {
        let mut file = Self::new();
        let positions = file.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        let indices = file.accessor(&le16(&[0, 1, 2]), U16, "SCALAR", 3);
        let mesh = file.mesh(json!({"attributes": {"POSITION": positions}, "indices": indices}));
        file.node(json!({"mesh": mesh}));
        file
    }

    /// Appends to a list of the root.
    pub fn push(&mut self, list: &str, value: Value) -> usize {
        let root = self.root.as_object_mut().unwrap();
        let list = root.entry(list).or_insert(json!([])).as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    /// A buffer view of its own for `bytes`.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0xcd);
        let offset = self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        self.push("bufferViews", json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}))
    }

    pub fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        self.push("accessors", json!({"bufferView": view, "componentType": component, "type": kind, "count": count}))
    }

    pub fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let width = match kind {
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 1,
        };
        self.accessor(&le32(values), F32, kind, values.len() / width)
    }

    /// A mesh of one primitive.
    pub fn mesh(&mut self, primitive: Value) -> usize {
        self.push("meshes", json!({"primitives": [primitive]}))
    }

    /// A node that the scene lists.
    pub fn node(&mut self, node: Value) -> usize {
        let index = self.push("nodes", node);
        self.root["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(index));
        index
    }

    /// The JSON, with the buffer as `uri`.
    pub fn json(&self, uri: Option<&str>) -> Vec<u8> {
        let mut root = self.root.clone();
        if !self.bytes.is_empty() && root.get("buffers").is_none() {
            root["buffers"] = match uri {
                Some(uri) => json!([{"byteLength": self.bytes.len(), "uri": uri}]),
                None => json!([{"byteLength": self.bytes.len()}]),
            };
        }
        serde_json::to_vec(&root).unwrap()
    }

    pub fn glb(&self) -> Vec<u8> {
        let mut json = self.json(None);
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut bin = self.bytes.clone();
        bin.resize(bin.len().next_multiple_of(4), 0);
        let total = 12 + 8 + json.len() + 8 + bin.len();
        let word = |n: usize| (n as u32).to_le_bytes();
        [b"glTF", &word(2)[..], &word(total), &word(json.len()), b"JSON", &json, &word(bin.len()), b"BIN\0", &bin]
            .concat()
    }

    /// Imports it as GLB.
    pub fn import(&self) -> Result<SourceScene, String> {
        import_bytes("test.glb", &self.glb())
    }

    /// Imports it as GLB; prints the error on failure.
    pub fn scene(&self) -> SourceScene {
        self.import().unwrap_or_else(|e| panic!("{e}"))
    }

    /// The error of importing it, which must be one line that begins with the file.
    pub fn error(&self) -> String {
        error_text(self.import())
    }
}

/// The text of the expected error, which must be one line naming the file.
pub fn error_text(result: Result<SourceScene, String>) -> String {
    let text = result.expect_err("the import should fail");
    assert!(!text.contains('\n') && text.len() < 1000, "{text}");
    assert!(text.contains("test.gl") && text.contains("; "), "file and remedy: {text}");
    text
}

/// Opens the inputs as one scene and reads all of it.
pub fn import_all(inputs: &[Input]) -> Result<SourceScene, String> {
    let opened = import(inputs, &ImportSettings::default(), &Progress::hidden()).map_err(|e| e.to_string())?;
    load_all(&opened).map_err(|e| e.to_string())
}

pub fn import_one(path: &Path) -> Result<SourceScene, String> {
    import_all(&[path.into()])
}

/// Imports `bytes` as a file named `name` in a folder of its own.
pub fn import_bytes(name: &str, bytes: &[u8]) -> Result<SourceScene, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), name, bytes);
    import_one(&path)
}

pub fn write(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

pub fn le16(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

pub fn le32(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// A PNG of the given texels.
pub fn png(width: u32, height: u32, rgba: &[u8]) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let image = image::RgbaImage::from_raw(width, height, rgba.to_vec()).unwrap();
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}
