//! Writes the Rust mirrors of the structures and constants that WGSL files declare.
//!
//! The build script includes this file to write `kernels::layout`; it must not depend on the rest of the crate.
//! A comment behind a declaration documents it, and so do the lines directly above. Lines that are indented more than
//! declarations continue the comment before them. Lines above the first of a run of constants document all of the run
//! that have no comment.

use std::collections::BTreeMap;
use std::fmt::Write;

use naga::{ArraySize, Expression, Literal, Module, Scalar, ScalarKind, StructMember, TypeInner, VectorSize};

/// Rust source of every structure and every constant of type u32 or f32 that `files`, pairs of a name and a text,
/// declare. `module` is what they parse to together.
///
/// # Errors
/// Names the file, the structure and the field whose layout differs between WGSL and `repr(C)`.
pub fn mirrors(files: &[(&str, String)], module: &Module) -> Result<String, String> {
    let mut out = String::new();
    for (file, text) in files {
        let docs = Docs::of(text);
        for name in &docs.names {
            let constant = module.constants.iter().find(|(_, c)| c.name.as_ref() == Some(name));
            if let Some((_, constant)) = constant {
                let (kind, value) = match module.global_expressions[constant.init] {
                    Expression::Literal(Literal::U32(value)) => {
                        ("u32", if value < 1 << 16 { format!("{value}") } else { format!("{value:#x}") })
                    }
                    Expression::Literal(Literal::F32(value)) => ("f32", format!("{value:?}")),
                    _ => continue,
                };
                let _ = writeln!(out, "{}pub const {name}: {kind} = {value};", docs.written(name, ""));
            }
            let structure = module.types.iter().find(|(_, t)| t.name.as_ref() == Some(name));
            if let Some((_, naga::Type { inner: TypeInner::Struct { members, span }, .. })) = structure {
                let fields = fields(name, members, *span, &docs, module).map_err(|e| format!("shaders/{file}: {e}"))?;
                let _ = writeln!(
                    out,
                    "{}#[repr(C)]\n\
                     #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]\n\
                     pub struct {name} {{\n{fields}}}\nconst _: () = assert!(size_of::<{name}>() == {span});",
                    docs.written(name, "")
                );
            }
        }
    }
    Ok(out)
}

/// The fields of a structure, unless it has padding that no field declares.
fn fields(name: &str, members: &[StructMember], span: u32, docs: &Docs, module: &Module) -> Result<String, String> {
    let mut out = String::new();
    let mut end = 0;
    for member in members {
        let field = member.name.as_deref().unwrap_or_default();
        let (kind, size) = mirror(module, member.ty).map_err(|e| format!("{name}.{field}: {e}"))?;
        if member.offset != end {
            let bytes = member.offset - end;
            return Err(format!("{name}.{field}: {bytes} bytes of padding before it; declare fields for them"));
        }
        if module.types[member.ty].inner.size(module.to_ctx()) != size {
            return Err(format!("{name}.{field}: padding between elements of its type"));
        }
        let _ = writeln!(out, "{}pub {field}: {kind},", docs.written(name, field));
        end += size;
    }
    if end != span {
        let last = members.last().and_then(|m| m.name.as_deref()).unwrap_or_default();
        return Err(format!("{name}.{last}: {} bytes of padding behind it; declare fields for them", span - end));
    }
    Ok(out)
}

/// The Rust type that stands for a WGSL type, and its size in bytes.
fn mirror(module: &Module, kind: naga::Handle<naga::Type>) -> Result<(String, u32), String> {
    let scalar = |s: Scalar| match (s.kind, s.width) {
        (ScalarKind::Float, 4) => Ok("f32"),
        (ScalarKind::Uint, 4) => Ok("u32"),
        (ScalarKind::Sint, 4) => Ok("i32"),
        _ => Err(format!("no mirror of {s:?}")),
    };
    let vector = |size: VectorSize, s: Scalar| Ok((format!("[{}; {}]", scalar(s)?, size as u32), 4 * size as u32));
    let of = |(element, size): (String, u32), n: u32| (format!("[{element}; {n}]"), size * n);
    let declared = &module.types[kind];
    match declared.inner {
        TypeInner::Scalar(s) | TypeInner::Atomic(s) => Ok((scalar(s)?.to_string(), 4)),
        TypeInner::Vector { size, scalar } => vector(size, scalar),
        TypeInner::Matrix { columns, rows, scalar } => Ok(of(vector(rows, scalar)?, columns as u32)),
        TypeInner::Array { base, size: ArraySize::Constant(n), .. } => Ok(of(mirror(module, base)?, n.get())),
        TypeInner::Struct { span, .. } => Ok((declared.name.clone().unwrap_or_default(), span)),
        ref other => Err(format!("no mirror of {other:?}")),
    }
}

/// What a file declares, in order, and the comments.
#[derive(Default)]
struct Docs {
    /// Structures and constants.
    names: Vec<String>,
    /// By structure or constant and by field, which is empty for the former themselves.
    of: BTreeMap<(String, String), String>,
}

impl Docs {
    fn of(text: &str) -> Self {
        let mut docs = Self::default();
        let mut last = None;
        let mut above = String::new();
        let (mut run, mut in_run) = (String::new(), false);
        let mut in_struct = false;
        for line in text.lines() {
            let (code, comment) = line.split_once("//").map_or((line, ""), |(code, comment)| (code, comment.trim()));
            let depth = if in_struct { 4 } else { 0 };
            let words = code.trim();
            if words.is_empty() {
                match last.as_ref().and_then(|key| docs.of.get_mut(key)) {
                    Some(doc) if !comment.is_empty() && code.len() > depth => append(doc, comment),
                    _ if comment.is_empty() => (above, in_run) = (String::new(), false),
                    _ => append(&mut above, comment),
                }
                continue;
            }
            let name_behind =
                |words: &str, end: &[char]| words.split(end).next().unwrap_or_default().trim().to_string();
            let structure = words.strip_prefix("struct ").map(|rest| name_behind(rest, &['{']));
            let constant = words.strip_prefix("const ").map(|rest| name_behind(rest, &[':', '=']));
            let is_constant = constant.is_some();
            let key = if let Some(name) = structure.or(constant) {
                in_struct = !is_constant && !words.contains('}');
                docs.names.push(name.clone());
                (name, String::new())
            } else if let (true, Some(name), Some((field, _))) = (in_struct, docs.names.last(), words.split_once(':')) {
                (name.clone(), field.split_whitespace().last().unwrap_or_default().to_string())
            } else {
                in_struct &= !words.contains('}');
                (above, in_run, last) = (String::new(), false, None);
                continue;
            };
            let mut doc = std::mem::take(&mut above);
            if !in_run {
                run.clone_from(&doc);
            }
            in_run = is_constant;
            append(&mut doc, comment);
            if is_constant && doc.is_empty() {
                doc.clone_from(&run);
            }
            docs.of.insert(key.clone(), doc);
            last = Some(key);
        }
        docs
    }

    /// As a doc comment. Fields whose names say that they are padding need none.
    fn written(&self, name: &str, field: &str) -> String {
        let doc = self.of.get(&(name.to_string(), field.to_string())).map_or("", String::as_str);
        let doc = if doc.is_empty() && field.starts_with("padding") { "Padding." } else { doc };
        // Neither links nor tags outside code.
        let plain = |part: &str| part.replace('<', "\\<").replace('[', "\\[");
        let parts = doc.split('`').enumerate().map(|(i, part)| if i % 2 == 0 { plain(part) } else { part.to_string() });
        let doc = parts.collect::<Vec<_>>().join("`");
        if doc.is_empty() { doc } else { format!("/// {doc}\n") }
    }
}

/// Adds to a comment.
fn append(doc: &mut String, more: &str) {
    if !doc.is_empty() && !more.is_empty() {
        doc.push(' ');
    }
    doc.push_str(more);
}

#[cfg(test)]
mod tests {
    use super::mirrors;

    fn mirrors_of(text: &str) -> Result<String, String> {
        let module = naga::front::wgsl::parse_str(text).expect("WGSL that parses");
        mirrors(&[("a/types.wgsl", text.to_string())], &module)
    }

    /// What is written for a text, lines of attributes and assertions left out.
    fn declarations(text: &str) -> String {
        let written = mirrors_of(text).expect("a layout without implicit padding");
        let is_declaration = |line: &&str| !line.starts_with('#') && !line.starts_with("const _");
        written.lines().filter(is_declaration).collect::<Vec<_>>().join("\n")
    }

    #[test]
    fn every_type_has_a_mirror() {
        let text = "
struct Inner { a: f32, b: f32 }
struct All {
    a: vec3<f32>,
    b: u32,
    c: array<vec4<f32>, 3>,
    d: atomic<u32>,
    e: i32,
    f: vec2<u32>,
    g: mat4x4<f32>,
    h: array<Inner, 2>,
}
";
        let expected = "\
pub struct Inner {
pub a: f32,
pub b: f32,
}
pub struct All {
pub a: [f32; 3],
pub b: u32,
pub c: [[f32; 4]; 3],
pub d: u32,
pub e: i32,
pub f: [u32; 2],
pub g: [[f32; 4]; 4],
pub h: [Inner; 2],
}";
        assert_eq!(declarations(text), expected);
    }

    #[test]
    fn comments_become_documentation() {
        let text = "\
// The file.

// Above.
struct A {            // Behind
                      // and below.
    // Above the field,
    // two lines
    a: u32,           // and behind.
    b: u32,           // An array<u32> of `c[i]`,
                      // of [d].
    padding0: u32,
}

// A run.
const X: u32 = 1u << 4u;
const Y: f32 = 0.5;   // Its own.
// Its own, above.
const Z: u32 = 3u;
const W: u32 = 5u;
const SIGNED: i32 = -1;

const V: u32 = 4u;
";
        let expected = "\
/// Above. Behind and below.
pub struct A {
/// Above the field, two lines and behind.
pub a: u32,
/// An array\\<u32> of `c[i]`, of \\[d].
pub b: u32,
/// Padding.
pub padding0: u32,
}
/// A run.
pub const X: u32 = 16;
/// Its own.
pub const Y: f32 = 0.5;
/// Its own, above.
pub const Z: u32 = 3;
/// A run.
pub const W: u32 = 5;
pub const V: u32 = 4;";
        assert_eq!(declarations(text), expected);
    }

    #[test]
    fn implicit_padding_is_refused() {
        for (fields, at, why) in [
            ("a: u32, b: vec3<f32>, c: f32,", "A.b", "12 bytes of padding before it"),
            ("a: vec3<f32>, b: vec3<f32>, c: f32,", "A.b", "4 bytes of padding before it"),
            ("a: vec4<f32>, b: u32,", "A.b", "12 bytes of padding behind it"),
            ("a: vec3<f32>,", "A.a", "4 bytes of padding behind it"),
            ("a: array<vec3<f32>, 2>,", "A.a", "padding between elements"),
            ("a: mat3x3<f32>,", "A.a", "padding between elements"),
            ("a: array<u32>,", "A.a", "no mirror"),
        ] {
            let text = format!("struct A {{\n    {}\n}}\n", fields.replace(", ", ",\n    "));
            let error = mirrors_of(&text).expect_err(fields);
            assert!(error.starts_with(&format!("shaders/a/types.wgsl: {at}: {why}")), "{fields}: {error}");
        }
    }
}
