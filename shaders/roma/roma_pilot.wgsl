// Which of the rays that maps answer are traced all the same. Twin: src/secondary/roma/twin.rs.

// What hits of rays have in place of a distance that are not traced: answered, and waiting for maps to answer them.
const ANSWERED: f32 = -1.0;
const WAITING: f32 = -2.0;

// The number of the block of side x side pixels that a ray's pixel lies in.
fn block_of(index: u32, side: u32) -> u32 {
    return index / params.width / side * params.width + index % params.width / side;
}

// Whether a ray is traced to its end, whatever maps say of it, and shows what they get wrong: of the directions of a
// pixel one in so many, the first at random, and those of a workgroup together. Where pilots alone are traced, those of
// as many pixels as a tile mostly has are together, since for tiles without any no query is made; which one of so many
// directions goes on by the golden section, so that over samples all have their turn.
fn is_pilot(index: u32) -> bool {
    let n = own.pilots;
    if n == 0u {
        return false;
    }
    if own.part == ROMA_CORRECT {
        let drawn = random4(block_of(index, 64u), ~(params.stream - params.sample), params.seed).z;
        let word = drawn + params.direction / n * GOLDEN;
        return params.direction % n == u32(barrier(f32(word >> 8u) * 5.9604645e-8 * f32(n))); // rounded, never up to n
    }
    let first = u32(random2(block_of(index, 8u), ~params.stream, params.seed).x * f32(n));
    return (first + params.direction) % n == 0u;
}
