// Maps that are drawn by the cosine to a normal. Twin: src/secondary/roma/cosine.rs.

const TRIES: u32 = 8u;

// The word by which a ray first tries a map: the directions of a pixel, those of all samples, go on by the golden
// section, so that any that follow each other are spread evenly; where they begin is the pixel's own.
fn drawn_word(index: u32) -> u32 {
    let first = random4(index, ~(params.stream - params.sample), params.seed).y;
    return first + params.direction * GOLDEN;
}

fn product(d: vec3<f32>, v: vec3<f32>) -> f32 {
    return barrier(barrier(barrier(d.x * v.x) + barrier(d.y * v.y)) + barrier(d.z * v.z));
}

// The direction of a map in the sense that leads above the surface.
fn upward(map: u32, normal: vec3<f32>) -> vec3<f32> {
    let d = roma_maps[map].direction.xyz;
    return select(-d, d, product(d, normal) >= 0.0);
}

// The map, and its direction, that a ray draws in proportion to cosines: any map is tried, and taken with the
// probability of its cosine. What is below the surface is no direction of a ray, and what is below the normal that
// light is weighed by brings none. The nearest where all are refused.
fn drawn(index: u32, ray: Ray) -> Taken {
    let normal = seen_surfaces[index].normal;
    let shading_normal = gbuffer[index].normal;
    let maps = own.k * own.k;
    var word = drawn_word(index);
    for (var i = 0u; i < TRIES; i++) {
        let at = barrier(f32(word >> 8u) * 5.9604645e-8 * f32(maps)); // by powers of two: exact
        let map = min(u32(at), maps - 1u);
        let direction = upward(map, normal);
        if at - f32(map) < product(direction, shading_normal) {
            return Taken(map, barrier3(length_of(ray.direction) * direction), 0u);
        }
        word = pcg(word);
    }
    return nearest(index, ray);
}
