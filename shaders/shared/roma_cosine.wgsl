// Maps that are drawn by the cosine to a normal. Twin: src/cpu/roma_cosine.rs.

const GOLDEN: u32 = 0x9e3779b9u;          // the golden section of 2^32
const LEAST_COSINE: f32 = 9.313226e-10;   // 2^-30; what is less is rounding

// The number, from 0 to below 1, by which a ray draws its map: the directions of a pixel, those of all samples, go on by the golden section, so that any
// that follow each other are spread evenly; where they begin is the pixel's own.
fn drawn_number(index: u32) -> f32 {
    let first = random4(index, ~(params.stream - params.sample), params.seed).y;
    return f32((first + params.direction * GOLDEN) >> 8u) * 5.9604645e-8;
}

fn product(d: vec3<f32>, v: vec3<f32>) -> f32 {
    return barrier(barrier(barrier(d.x * v.x) + barrier(d.y * v.y)) + barrier(d.z * v.z));
}

// The direction of a map in the sense that leads above the surface.
fn upward(map: u32, normal: vec3<f32>) -> vec3<f32> {
    let d = roma_maps[map].direction.xyz;
    return select(-d, d, product(d, normal) >= 0.0);
}

// The cosine by which a map is drawn: what is below the surface is no direction of a ray, and what is below the normal that light is weighed by brings none.
fn cosine_of(map: u32, shading_normal: vec3<f32>, normal: vec3<f32>) -> f32 {
    let cosine = product(upward(map, normal), shading_normal);
    return select(0.0, cosine, cosine >= LEAST_COSINE);
}

// The map, and its direction, that a ray draws in proportion to cosines; the nearest where there is none to draw.
fn drawn(index: u32, ray: Ray) -> Taken {
    let normal = seen_surfaces[index].normal;
    let shading_normal = gbuffer[index].normal;
    let maps = params.roma_k * params.roma_k;
    var total = 0.0;
    for (var map = 0u; map < maps; map++) {
        total = barrier(total + cosine_of(map, shading_normal, normal));
    }
    let wanted = barrier(drawn_number(index) * total);
    var sum = 0.0;
    for (var map = 0u; map < maps; map++) {
        sum = barrier(sum + cosine_of(map, shading_normal, normal));
        // The last sum is the total, and any number's share of it is less.
        if sum > wanted {
            return Taken(map, barrier3(length_of(ray.direction) * upward(map, normal)), 0u);
        }
    }
    return nearest(index, ray);
}
