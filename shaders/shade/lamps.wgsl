// Bindings of group 2 of kernels that light: the environment and the emitters, and how a point of them is drawn.

// Rows from +Y down: radiance, and in w the density by which directions are drawn, over both angles.
@group(2) @binding(0) var<storage, read> environment: array<vec4<f32>>;
// Threshold and other entry of each texel's.
@group(2) @binding(1) var<storage, read> environment_table: array<vec2<u32>>;
@group(2) @binding(2) var<storage, read> emitters: array<Emitter>;
// See shade/gloss.wgsl: rows by the root of alpha, in them by that of the cosine.
@group(2) @binding(3) var<storage, read> reflectances: array<vec2<f32>>;

const TURN: f32 = 6.2831855;      // 2 pi
const HALF_TURN: f32 = 3.1415927;
const QUARTER_TURN: f32 = 1.5707964;

// The high word of a product.
fn multiply_high(a: u32, b: u32) -> u32 {
    let low = (a & 0xffffu) * (b & 0xffffu);
    let m = (a >> 16u) * (b & 0xffffu) + (low >> 16u);
    let n = (a & 0xffffu) * (b >> 16u) + (m & 0xffffu);
    return (a >> 16u) * (b >> 16u) + (m >> 16u) + (n >> 16u);
}

// A random word as a number in [0, 1).
fn unit(word: u32) -> f32 {
    return f32(word >> 8u) * 5.9604645e-8;
}

// Which random numbers the ray of a pixel takes to draw candidate `number` for a lamp: those that start at hits of
// bounces take some of their own in every direction that their paths begin with.
fn lamp_words(index: u32, number: u32) -> vec4<u32> {
    var pixel = pixel_of(index);
    if (params.flags & PARAM_BOUNCE) != 0u {
        pixel ^= pcg(origins[index].direction + 1u);
    }
    return points4(pixel, params.stream, params.seed ^ (number * GOLDEN));
}

// The angle of the point (x, y) from the x axis, -pi to pi: Abramowitz, Stegun, "Handbook of Mathematical Functions",
// 4.4.49, within 2e-8 of the arc tangent; 0 of the origin.
fn angle_of(y: f32, x: f32) -> f32 {
    let a = abs(x);
    let b = abs(y);
    let q = min(a, b) / max(max(a, b), 1.0e-30);
    let s = q * q;
    var p = 0.0028662257;
    p = p * s - 0.0161657367;
    p = p * s + 0.0429096138;
    p = p * s - 0.0752896400;
    p = p * s + 0.1065626393;
    p = p * s - 0.1420889944;
    p = p * s + 0.1999355085;
    p = p * s - 0.3333314528;
    var angle = q + q * s * p;
    if b > a {
        angle = QUARTER_TURN - angle;
    }
    if x < 0.0 {
        angle = HALF_TURN - angle;
    }
    return select(angle, -angle, y < 0.0);
}

fn environment_texel(column: i32, row: i32) -> vec3<f32> {
    let width = i32(params.environment_width);
    let x = ((column % width) + width) % width;
    let y = clamp(row, 0, i32(params.environment_height) - 1);
    return environment[y * width + x].rgb;
}

// Radiance at a place in texels, between their centres bilinearly.
fn environment_lookup(place: vec2<f32>) -> vec3<f32> {
    let p = place - vec2<f32>(0.5);
    let f = p - floor(p);
    let i = vec2<i32>(floor(p));
    let top = mix(environment_texel(i.x, i.y), environment_texel(i.x + 1, i.y), f.x);
    let bottom = mix(environment_texel(i.x, i.y + 1), environment_texel(i.x + 1, i.y + 1), f.x);
    return mix(top, bottom, f.y);
}

fn environment_size() -> vec2<f32> {
    return vec2<f32>(vec2<u32>(params.environment_width, params.environment_height));
}

// Where in the image direction d, a unit vector, leads, in texels: its centre lies along -Z, its right along +X, turned
// about +Y.
fn environment_place(d: vec3<f32>) -> vec2<f32> {
    let turn = params.environment_turn;
    let x = turn.x * d.x - turn.y * d.z;
    let z = turn.y * d.x + turn.x * d.z;
    let u = 0.5 + angle_of(x, -z) / TURN;
    let v = angle_of(sqrt(x * x + z * z), d.y) / HALF_TURN;
    return vec2<f32>(u, v) * environment_size();
}

// Radiance from direction d, of any length.
fn environment_at(d: vec3<f32>) -> vec3<f32> {
    return environment_lookup(environment_place(normalize(d)));
}

// By which environment_sample draws direction d, a unit vector.
fn environment_density(d: vec3<f32>) -> f32 {
    let place = vec2<u32>(max(environment_place(d), vec2<f32>(0.0)));
    let x = min(place.x, params.environment_width - 1u);
    let y = min(place.y, params.environment_height - 1u);
    return environment[y * params.environment_width + x].w / max(sqrt(d.x * d.x + d.z * d.z), 1.0e-7);
}

struct EnvironmentSample {
    direction: vec3<f32>,
    place: vec2<f32>, // in texels
    texel: u32,
    level: f32, // sine of the angle from +Y
}

// A direction drawn by the density that the texels state: a texel by their table, a place in it evenly over both
// angles.
fn environment_sample(words: vec4<u32>) -> EnvironmentSample {
    var texel = multiply_high(words.x, params.environment_width * params.environment_height);
    let entry = environment_table[texel];
    if words.y >= entry.x {
        texel = entry.y;
    }
    let corner = vec2<f32>(vec2<u32>(texel % params.environment_width, texel / params.environment_width));
    let place = corner + vec2<f32>(unit(words.z), unit(words.w));
    let share = place / environment_size();
    let around = TURN * (share.x - 0.5);
    let down = HALF_TURN * share.y;
    let level = sin(down);
    let x = level * sin(around);
    let z = -level * cos(around);
    let turn = params.environment_turn;
    let direction = vec3<f32>(turn.x * x + turn.y * z, cos(down), turn.x * z - turn.y * x);
    return EnvironmentSample(direction, place, texel, level);
}

// Radiance along a direction that was drawn over its density; zero where none is to be drawn.
fn drawn_light(drawn: EnvironmentSample) -> vec3<f32> {
    let density = environment[drawn.texel].w;
    if density > 0.0 {
        return environment_lookup(drawn.place) * (max(drawn.level, 0.0) / density);
    }
    return vec3<f32>(0.0);
}

// The density by which a direction was drawn.
fn drawn_density(drawn: EnvironmentSample) -> f32 {
    return environment[drawn.texel].w / max(drawn.level, 1.0e-7);
}

// How an emitter shines along `d`, which leads from a surface to the point of it that was drawn: what its radiance
// times the cosine of the surface, with d unnormalised, times this over d^4 gives is the irradiance; 0 where it does
// not shine. Of areas that is the area turned to the surface, times the length of d; points and spots fall off by
// KHR_lights_punctual.
fn shines(e: Emitter, d: vec3<f32>) -> f32 {
    let kind = e.kind & EMITTER_KIND;
    if kind == EMITTER_DISTANT {
        return 1.0;
    }
    if kind <= EMITTER_TRIANGLE {
        // The length of the cross product is the area of the parallelogram.
        let turned = dot(-d, cross(e.u, e.v));
        let from_light = max(select(turned, abs(turned), (e.kind & EMITTER_TWO_SIDED) != 0u), 0.0);
        return select(from_light, 0.5 * from_light, kind == EMITTER_TRIANGLE);
    }
    let squared = dot(d, d);
    let near = squared * e.v.z * e.v.z;
    let window = clamp(1.0 - near * near, 0.0, 1.0);
    var cone = 1.0;
    if kind == EMITTER_SPOT {
        cone = clamp(dot(-normalize(d), e.u) * e.v.x + e.v.y, 0.0, 1.0);
    }
    return window * cone * cone * sqrt(squared);
}

// By which the sun's disc draws d, with a part of 1 along the sun: evenly over a disc across it.
fn sun_density(d: vec3<f32>) -> f32 {
    let squared = dot(d, d);
    return squared * sqrt(squared) / (HALF_TURN * params.sun_radius * params.sun_radius);
}

// The share of a direction that was drawn by `own` where the other way draws it by `other` (Veach, Guibas 1995, the
// power heuristic).
fn outweighs(own: f32, other: f32) -> f32 {
    let ratio = other / own;
    return 1.0 / (1.0 + ratio * ratio);
}
