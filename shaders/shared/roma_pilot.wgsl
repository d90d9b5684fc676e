// Which of the rays that maps answer are traced all the same. Twin: src/cpu/roma.rs.

// What hits of rays have in place of a distance that are not traced: answered, and waiting for maps to answer them.
const ANSWERED: f32 = -1.0;
const WAITING: f32 = -2.0;

// Whether a ray is traced to its end, whatever maps say of it, and shows what they get wrong: of the directions of a pixel one in so many, evenly, the
// first at random. Those of a workgroup go together.
fn is_pilot(index: u32) -> bool {
    if params.roma_pilots == 0u {
        return false;
    }
    let workgroup = index / params.width / 8u * params.width + index % params.width / 8u;
    let first = u32(random2(workgroup, ~params.stream, params.seed).x * f32(params.roma_pilots));
    return (first + params.direction) % params.roma_pilots == 0u;
}
