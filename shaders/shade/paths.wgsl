// How paths go on from a surface. Twin: src/kernels/shade/paths.rs.

// Probability that a path goes on by the gloss of a surface: its share of what the surface reflects and lets through of
// light from everywhere.
fn path_choice(s: Gloss) -> f32 {
    if !is_glossy(s) {
        return 0.0;
    }
    let mirrored = reflected_around(s);
    let let_through = through_facets(s);
    let of_gloss = max(mirrored.x, max(mirrored.y, mirrored.z)) + max(let_through.x, max(let_through.y, let_through.z));
    let of_diffuse = max(s.diffuse.x, max(s.diffuse.y, s.diffuse.z));
    return of_gloss / max(of_gloss + of_diffuse, 1.0e-20);
}

// A direction from a surface with this normal, as gloss_direction has it.
fn path_direction(s: Gloss, normal: vec3<f32>, words: vec4<u32>) -> vec4<f32> {
    if unit(words.w) < path_choice(s) {
        return gloss_direction(s, words);
    }
    let around = TURN * unit(words.x);
    let squared = unit(words.y);
    let level = sqrt(squared);
    let x = tangent(normal);
    let y = cross(normal, x);
    let up = sqrt(1.0 - squared);
    return vec4<f32>(normalize(level * cos(around) * x + level * sin(around) * y + up * normal), 0.0);
}

// By which path_direction draws d, a unit vector.
fn path_density(s: Gloss, normal: vec3<f32>, d: vec3<f32>) -> f32 {
    let choice = path_choice(s);
    return (1.0 - choice) * max(dot(normal, d), 0.0) / PI + choice * density_of(s, d);
}
