// Random words by hashing, as common/random.wgsl has them, and numbers of them.
#include "common/random.wgsl"

// A word as a number in [0, 1).
fn unit_of(word: u32) -> f32 {
    return f32(word >> 8u) * 5.9604645e-8;
}
