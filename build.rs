//! Parses and validates every kernel, so that a typo is a build error, and writes the Rust mirrors of the structures
//! and constants that WGSL files named `*types.wgsl` declare.

#[path = "src/kernels/layout/mirror.rs"]
mod mirror;
#[path = "src/gpu/wgsl.rs"]
#[allow(dead_code)]
mod wgsl;

use std::fmt::Write;
use std::path::Path;
use std::{env, fs};

fn main() {
    println!("cargo::rerun-if-changed=shaders");
    println!("cargo::rerun-if-changed=src/gpu/wgsl.rs");
    println!("cargo::rerun-if-changed=src/kernels/layout/mirror.rs");
    println!("cargo::rustc-env=BRICKWALK_COMMIT={}", commit());
    let shaders = Path::new("shaders");
    let read = |name: &str| match name {
        "trace/binary.wgsl" => Some(wgsl::binary_accessors(2, 64)),
        _ => fs::read_to_string(shaders.join(name)).ok(),
    };
    let files = files(shaders);
    let is_kernel = |name: &&String| fs::read_to_string(shaders.join(name)).is_ok_and(|text| text.contains("@compute"));
    for name in files.iter().filter(is_kernel) {
        for pages in [
            wgsl::Pages {
                cache: 1,
                texels: 1,
                opacity: false,
                gloss: false,
                layers: false,
                levels: false,
                hides: false,
            },
            wgsl::Pages { cache: 3, texels: 2, opacity: true, gloss: true, layers: true, levels: true, hides: true },
        ] {
            let text =
                wgsl::assemble(name, pages, &read).unwrap_or_else(|| panic!("{name}: an included file is missing"));
            let module = parse(name, &text);
            naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::default())
                .validate(&module)
                .unwrap_or_else(|e| panic!("{name}:\n{}", e.emit_to_string(&text)));
        }
    }
    let out = env::var("OUT_DIR").expect("cargo sets OUT_DIR");
    let out = Path::new(&out);
    fs::write(out.join("shaders.rs"), embedded(&files)).expect("write shaders.rs");
    fs::write(out.join("layout.rs"), layout(&files, &read)).expect("write layout.rs");
}

/// Parses a text.
fn parse(name: &str, text: &str) -> naga::Module {
    naga::front::wgsl::parse_str(text).unwrap_or_else(|e| panic!("{name}:\n{}", e.emit_to_string(text)))
}

/// Rust mirrors of what all files of shared types declare.
fn layout(files: &[String], read: &dyn Fn(&str) -> Option<String>) -> String {
    let types = || files.iter().filter(|name| name.ends_with("types.wgsl"));
    let all = "*types.wgsl";
    let includes: String = types().map(|name| format!("#include \"{name}\"\n")).collect();
    let pages =
        wgsl::Pages { cache: 1, texels: 1, opacity: false, gloss: false, layers: false, levels: false, hides: false };
    let with_all = |name: &str| if name == all { Some(includes.clone()) } else { read(name) };
    let text = wgsl::assemble(all, pages, &with_all).unwrap_or_else(|| panic!("{all}: an included file is missing"));
    let texts: Vec<(&str, String)> = types().filter_map(|name| Some((name.as_str(), read(name)?))).collect();
    mirror::mirrors(&texts, &parse(all, &text)).unwrap_or_else(|e| panic!("{e}"))
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
