//! Assembly of WGSL: `#include "family/x.wgsl"` lines are replaced by the file, each file once; the accessors of paged
//! buffers are generated for the number of pages at hand, so that one page costs no branch, and so is what a scene does
//! not need.
//!
//! The build script includes this file to check every kernel; it must not depend on the rest of the crate.

use std::fmt::Write;

/// First binding of the texels in the group of texture lookups.
pub const TEXEL_BINDING: usize = 5;

/// Binding of the opacity maps in the group of the scene.
#[allow(dead_code)]
pub const OPACITY_BINDING: u32 = 7;

/// First binding of what levels are selected by in the group of the scene.
#[allow(dead_code)]
pub const LEVEL_BINDING: u32 = 8;

/// Binding of the ids that are hidden in the group of the scene.
#[allow(dead_code)]
pub const HIDDEN_BINDING: u32 = 10;

/// Numbers of pages that the generated accessors serve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pages {
    /// Pages of the brick cache.
    pub cache: usize,
    /// Pages of texels that are resident throughout.
    pub texels: usize,
    /// Whether rays may pass through triangles.
    pub opacity: bool,
    /// Whether surfaces reflect otherwise than diffusely.
    pub gloss: bool,
    /// Whether some of these surfaces have sheen, anisotropy, thin films or further textures.
    pub layers: bool,
    /// Whether levels of detail stand for bricks.
    pub levels: bool,
    /// Whether triangles may be hidden.
    pub hides: bool,
}

#[allow(dead_code)]
impl Pages {
    /// Buffers in the group of the scene that kernels ask for where the scene does.
    pub fn of_scene(self) -> usize {
        usize::from(self.opacity) + 2 * usize::from(self.levels) + usize::from(self.hides)
    }
}

/// The text of kernel `name`, with includes taken from `file`. `None` if a file is missing.
pub fn assemble(name: &str, pages: Pages, file: &dyn Fn(&str) -> Option<String>) -> Option<String> {
    let mut out = String::new();
    let mut seen = Vec::new();
    append(name, pages, file, &mut seen, &mut out)?;
    Some(out)
}

fn append(
    name: &str,
    pages: Pages,
    file: &dyn Fn(&str) -> Option<String>,
    seen: &mut Vec<String>,
    out: &mut String,
) -> Option<()> {
    if seen.iter().any(|s| s == name) {
        return Some(());
    }
    seen.push(name.to_string());
    let text = match name {
        "trace/cache.wgsl" => cache_accessors(pages.cache),
        "texture/texels.wgsl" => texel_accessors(pages.texels),
        "trace/opacity.wgsl" if !pages.opacity => OPAQUE.into(),
        "trace/hidden.wgsl" if !pages.hides => ALL_THERE.into(),
        "trace/levels.wgsl" if !pages.levels => NO_LEVELS.into(),
        "query/tile_spreads.wgsl" if !pages.levels => NO_SPREADS.into(),
        "shade/cones.wgsl" if !pages.levels => NO_CONES.into(),
        "shade/gloss.wgsl" if !pages.gloss => MATT.into(),
        "shade/layers.wgsl" if !pages.layers => NO_LAYERS.into(),
        "shade/more.wgsl" if !pages.layers => WHOLE_ALONE.into(),
        "texture/more.wgsl" if !pages.layers => NO_MORE_LOOKUPS.into(),
        _ => file(name)?,
    };
    for line in text.lines() {
        match line.strip_prefix("#include \"").and_then(|rest| rest.strip_suffix('"')) {
            Some(included) => append(included, pages, file, seen, out)?,
            None => {
                out.push_str(line);
                out.push('\n');
            }
        }
    }
    Some(())
}

/// What stands for `trace/opacity.wgsl` where no ray passes through a triangle.
const OPAQUE: &str = "\
fn passes(r: ptr<function, BrickRay>, triangle: u32, id: u32, h: TriangleHit) -> bool {
    return false;
}
";

/// What stands for `trace/hidden.wgsl` where no triangle is hidden.
const ALL_THERE: &str = "\
fn is_hidden(id: u32) -> bool {
    return false;
}
";

/// What stands for `trace/levels.wgsl` where every ray takes every brick.
const NO_LEVELS: &str = "\
struct Cone {
    square: f32,
}
fn is_pending(ray: u32) -> bool {
    return surfaces[ray].pending != 0u;
}
fn set_pending(ray: u32, pending: bool) {
    surfaces[ray].pending = u32(pending);
}
fn cone_of(index: u32, ray: Ray) -> Cone {
    return Cone(0.0);
}
fn takes(cone: Cone, leaf: u32) -> bool {
    return true;
}
fn is_stood_for(cone: Cone, node: u32) -> bool {
    return false;
}
fn is_stood_for_wide(cone: Cone, node: u32) -> bool {
    return false;
}
fn tile_is_stood_for(tile: TileBounds, node: u32) -> bool {
    return false;
}
fn tile_may_take(tile: TileBounds, leaf: u32) -> bool {
    return true;
}
fn is_marked(leaf: u32) -> bool {
    return false;
}
fn would_suffice(cone: Cone, leaf: u32) -> bool {
    return true;
}
fn would_take(cone: Cone, leaf: u32) -> bool {
    return true;
}
fn would_be_stood_for_wide(cone: Cone, node: u32) -> bool {
    return false;
}
fn stand_in_of(leaf: u32) -> u32 {
    return leaf;
}
fn level_offset(point: vec3<f32>, leaf: u32) -> f32 {
    return 0.0;
}
";

/// What stands for `query/tile_spreads.wgsl` there.
const NO_SPREADS: &str = "\
fn start_spreads(lane: u32) {}
fn bound_spread(lane: u32, ray: u32) {}
fn join_spreads(lane: u32, other: u32) {}
fn tile_spreads() -> u32 {
    return 0u;
}
";

/// What stands for `shade/cones.wgsl` there.
const NO_CONES: &str = "\
fn widen_reflected(ray: u32, density: f32, alpha: f32, curvature: f32) {}
";

/// What stands for `shade/gloss.wgsl` where all surfaces are Lambertian.
const MATT: &str = "\
struct Gloss {
    diffuse: vec3<f32>,
}
fn gloss_of(g: GBuffer, index: u32, view: vec3<f32>) -> Gloss {
    return Gloss(g.albedo);
}
fn is_glossy(s: Gloss) -> bool {
    return false;
}
fn greatest_alpha(s: Gloss) -> f32 {
    return 0.0;
}
fn reflected(s: Gloss, d: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(0.0);
}
fn density_of(s: Gloss, d: vec3<f32>) -> f32 {
    return 0.0;
}
fn reflected_ambient(s: Gloss) -> vec3<f32> {
    return vec3<f32>(0.0);
}
fn reflected_by_diffuse_rays(s: Gloss) -> vec3<f32> {
    return s.diffuse;
}
fn reflected_around(s: Gloss) -> vec3<f32> {
    return vec3<f32>(0.0);
}
fn gloss_direction(s: Gloss, words: vec4<u32>) -> vec4<f32> {
    return vec4<f32>(0.0);
}
fn through_facets(s: Gloss) -> vec3<f32> {
    return vec3<f32>(0.0);
}
fn passed(s: Gloss, d: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(0.0);
}
fn radiance_scale(s: Gloss) -> f32 {
    return 1.0;
}
fn left_within(g: GBuffer, way: f32) -> vec3<f32> {
    return vec3<f32>(1.0);
}
";

/// What stands for `shade/more.wgsl` where no material has layers.
const WHOLE_ALONE: &str = "\
fn start_more(index: u32, g: GBuffer, normal: vec3<f32>) {}
fn more_of(g: GBuffer, index: u32) -> More {
    return WHOLE;
}
";

/// What stands for `texture/more.wgsl` there.
const NO_MORE_LOOKUPS: &str = "\
fn look_up_more(g: GBuffer, index: u32) -> bool {
    return false;
}
";

/// What stands for `shade/layers.wgsl` where no material has sheen, anisotropy or a thin film.
const NO_LAYERS: &str = "\
struct Layers {
    choice: f32,
}
fn lay(s: ptr<function, Gloss>, g: GBuffer, m: Material, x: More) {}
fn coat_frame(s: Gloss) -> Frame {
    return Frame(s.normal, s.cos_view);
}
fn coat_cosines(s: Gloss, d: vec3<f32>) -> f32 {
    return 1.0;
}
fn facets_around(s: Gloss) -> vec2<f32> {
    return reflectance(s.cos_view, s.alpha);
}
fn facet_root(s: Gloss, d: vec3<f32>, cosine: f32) -> f32 {
    let squared = s.alpha * s.alpha;
    return sqrt(squared + (1.0 - squared) * cosine * cosine);
}
fn facet_lobe(s: Gloss, d: vec3<f32>, half_way: vec3<f32>) -> vec2<f32> {
    return lobe(Frame(s.normal, s.cos_view), s.alpha, d, half_way);
}
fn stretch(s: Gloss, x: ptr<function, vec3<f32>>, alphas: ptr<function, vec2<f32>>) {}
fn lay_film(s: ptr<function, Gloss>, left: ptr<function, vec3<f32>>, specular: vec3<f32>, g: GBuffer, white: f32, \
bounces: f32) {}
fn with_film(s: Gloss, cosine: f32, f: vec3<f32>) -> vec3<f32> {
    return f;
}
fn lay_sheen(s: ptr<function, Gloss>) {}
fn sheen_around(s: Gloss) -> vec3<f32> {
    return vec3<f32>(0.0);
}
fn sheen_toward(s: Gloss, d: vec3<f32>, half_way: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(0.0);
}
fn draws_sheen(s: Gloss, number: f32) -> bool {
    return false;
}
fn sheen_direction(s: Gloss, words: vec4<u32>) -> vec3<f32> {
    return s.normal;
}
fn layers_alpha(s: Gloss) -> f32 {
    return 0.0;
}
";

/// Accessors of the brick cache: group 2, binding k is page k. A word is a component of a vector, so that a page is
/// bound once.
fn cache_accessors(pages: usize) -> String {
    let mut s = String::new();
    for k in 0..pages {
        let _ = writeln!(s, "@group(2) @binding({k}) var<storage, read> cache_{k}: array<vec4<u32>>;");
    }
    accessor(&mut s, "cache_vec4", "vec4<u32>", "cache", "[index]", pages);
    accessor(&mut s, "cache_word", "u32", "cache", "[index >> 2u][index & 3u]", pages);
    s
}

/// Accessor of the texels of textures that are resident throughout: group 3, from binding [`TEXEL_BINDING`] on.
fn texel_accessors(pages: usize) -> String {
    let mut s = String::new();
    for k in 0..pages {
        let _ =
            writeln!(s, "@group(3) @binding({}) var<storage, read> texels_{k}: array<vec4<u32>>;", TEXEL_BINDING + k);
    }
    accessor(&mut s, "texel_vec4", "vec4<u32>", "texels", "[index]", pages);
    s
}

/// What kernels over binary trees include as `trace/binary.wgsl`: group 3, the root of each brick and, from binding 1,
/// the nodes in so many pages; and how many entries a traversal's stack has.
pub fn binary_accessors(pages: usize, stack: u32) -> String {
    let mut s = format!("const BINARY_STACK: u32 = {stack}u;\n");
    s.push_str("@group(3) @binding(0) var<storage, read> binary_roots: array<vec2<u32>>;\n");
    for k in 0..pages {
        let _ = writeln!(s, "@group(3) @binding({}) var<storage, read> binary_{k}: array<BinaryNode>;", 1 + k);
    }
    accessor(&mut s, "binary_node", "BinaryNode", "binary", "[index]", pages);
    s
}

fn accessor(s: &mut String, name: &str, kind: &str, array: &str, element: &str, pages: usize) {
    let _ = writeln!(s, "fn {name}(page: u32, index: u32) -> {kind} {{");
    for k in 1..pages {
        let _ = writeln!(s, "    if page == {k}u {{ return {array}_{k}{element}; }}");
    }
    let _ = writeln!(s, "    return {array}_0{element};\n}}");
}
