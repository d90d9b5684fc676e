//! Parses and validates every kernel, so that a typo is a build error, and writes the assertions that hold the WGSL
//! structures and constants to their Rust mirrors.

#[path = "src/gpu/wgsl.rs"]
#[allow(dead_code)]
mod wgsl;

use std::fmt::Write;
use std::path::Path;
use std::{env, fs};

fn main() {
    println!("cargo::rerun-if-changed=shaders");
    println!("cargo::rerun-if-changed=src/gpu/wgsl.rs");
    println!("cargo::rustc-env=BRICKWALK_COMMIT={}", commit());
    let shaders = Path::new("shaders");
    let read = |name: &str| match name {
        "trace/binary.wgsl" => Some(wgsl::binary_accessors(2, 64)),
        _ => fs::read_to_string(shaders.join(name)).ok(),
    };
    let files = files(shaders);
    let is_kernel = |name: &&String| fs::read_to_string(shaders.join(name)).is_ok_and(|text| text.contains("@compute"));
    let mut structures = None;
    for name in files.iter().filter(is_kernel) {
        for pages in [
            wgsl::Pages { cache: 1, texels: 1, opacity: false, gloss: false },
            wgsl::Pages { cache: 3, texels: 2, opacity: true, gloss: true },
        ] {
            let text =
                wgsl::assemble(name, pages, &read).unwrap_or_else(|| panic!("{name}: an included file is missing"));
            let module =
                naga::front::wgsl::parse_str(&text).unwrap_or_else(|e| panic!("{name}:\n{}", e.emit_to_string(&text)));
            naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::default())
                .validate(&module)
                .unwrap_or_else(|e| panic!("{name}:\n{}", e.emit_to_string(&text)));
            if name == "shade/resolve.wgsl" {
                structures = Some(module);
            }
        }
    }
    let out = env::var("OUT_DIR").expect("cargo sets OUT_DIR");
    let out = Path::new(&out);
    fs::write(out.join("shaders.rs"), embedded(&files)).expect("write shaders.rs");
    let module = structures.expect("shaders/shade/resolve.wgsl declares every shared structure");
    fs::write(out.join("layout_checks.rs"), layout_checks(&module)).expect("write layout_checks.rs");
}

/// The commit of the sources, or "unknown" outside a checkout.
fn commit() -> String {
    let git = |arguments: &[&str]| {
        let output = std::process::Command::new("git").arg("rev-parse").args(arguments).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_string())
    };
    // The log of HEAD grows with every commit, checkout and rebase. A file that does not exist would make every build
    // run anew.
    for file in ["HEAD", "logs/HEAD"] {
        if let Some(path) = git(&["--git-path", file]).filter(|path| Path::new(path).exists()) {
            println!("cargo::rerun-if-changed={path}");
        }
    }
    git(&["--short=12", "HEAD"]).unwrap_or_else(|| "unknown".to_string())
}

/// The names of all shader files, each with its family: `trace/leaf.wgsl`.
fn files(shaders: &Path) -> Vec<String> {
    let folder = |path: &Path| -> Vec<String> {
        let entries = fs::read_dir(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok()).collect()
    };
    let of_family = |family: String| {
        let names = folder(&shaders.join(&family));
        names.into_iter().filter(|name| name.ends_with(".wgsl")).map(move |name| format!("{family}/{name}"))
    };
    let mut all: Vec<String> = folder(shaders).into_iter().flat_map(of_family).collect();
    all.sort();
    all
}

/// A table of all shader files.
fn embedded(files: &[String]) -> String {
    let mut s = String::from("const FILES: &[(&str, &str)] = &[\n");
    for file in files {
        let _ = writeln!(s, "({file:?}, include_str!(concat!(env!(\"CARGO_MANIFEST_DIR\"), \"/shaders/{file}\"))),");
    }
    s.push_str("];\n");
    s
}

/// Compile-time assertions: size and member offsets of every structure that `layout` mirrors, values of its constants.
fn layout_checks(module: &naga::Module) -> String {
    let mirrored = [
        "Params",
        "Ray",
        "Hit",
        "Surface",
        "TileBounds",
        "TileList",
        "Entry",
        "TopNode2",
        "BinaryNode",
        "Leaf",
        "Instance",
        "Brick",
        "Opacity",
        "Slot",
        "Demand",
        "Pair",
        "Material",
        "Texture",
        "TileSlot",
        "TileDemand",
        "GBuffer",
        "Emitter",
    ];
    let mut s = String::new();
    for name in mirrored {
        let found = module.types.iter().find(|(_, t)| t.name.as_deref() == Some(name));
        let Some((_, naga::Type { inner: naga::TypeInner::Struct { members, span }, .. })) = found else {
            panic!("shaders/common/types.wgsl lacks the structure {name}");
        };
        let _ = writeln!(s, "const _: () = assert!(size_of::<layout::{name}>() == {span}, \"size of {name}\");");
        for member in members {
            let field = member.name.as_deref().unwrap_or_default();
            let _ = writeln!(
                s,
                "const _: () = assert!(std::mem::offset_of!(layout::{name}, {field}) == {}, \"{name}.{field}\");",
                member.offset
            );
        }
    }
    for (_, constant) in module.constants.iter() {
        let Some(name) = constant.name.as_deref() else { continue };
        let prefixes = [
            "PARAM_",
            "STATE_",
            "COUNTER_",
            "WORK_",
            "INSTANCE_",
            "BRICK_",
            "BINARY_",
            "BATCH_",
            "EMITTER_",
            "GBUFFER_",
            "TEXTURE_",
            "TILE_",
            "MATERIAL_DOUBLE",
            "MATERIAL_UNLIT",
            "REFLECTANCE_",
            "NONE",
        ];
        if prefixes.iter().any(|p| name.starts_with(p))
            && let naga::Expression::Literal(naga::Literal::U32(value)) = module.global_expressions[constant.init]
        {
            let _ = writeln!(s, "const _: () = assert!(layout::{name} == {value}, \"{name}\");");
        }
    }
    s
}
