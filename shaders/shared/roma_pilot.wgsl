// Which of the rays that are sifted are traced all the same. Twin: src/cpu/roma.rs.

// What hits of rays that are sifted have in place of a distance: answered, and waiting for maps to answer them.
const ANSWERED: f32 = -1.0;
const WAITING: f32 = -2.0;

// Random numbers of a ray's workgroup, whose rays go together.
fn workgroup_words(index: u32) -> vec2<f32> {
    let workgroup = index / params.width / 8u * params.width + index % params.width / 8u;
    return random2(workgroup, ~params.stream, params.seed);
}

// Whether a ray in doubt is traced: of the directions of a pixel one in so many, evenly, the first at random.
fn is_chosen(index: u32) -> bool {
    let first = u32(workgroup_words(index).y * f32(params.roma_one_in));
    return (first + params.direction) % params.roma_one_in == 0u;
}

// Whether a ray is traced to its end, whatever maps say of it, and shows what they would have got wrong.
fn is_pilot(index: u32) -> bool {
    if params.roma_pilots == 0u {
        return false;
    }
    let first = u32(workgroup_words(index).x * f32(params.roma_pilots));
    return (first + params.direction) % params.roma_pilots == 0u;
}
