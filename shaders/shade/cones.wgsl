// How wide the cones of rays are that each have a width of their own (docs/methods/levels.md). Twin:
// src/kernels/shade/cones.rs.

// One of so many rays stands for its share of what is around.
const RAYS_AROUND: f32 = 100.0;
// Square of the angle of one of them that is cosine-weighted, along the normal: pi / 100. No cone is wider.
const WIDEST: f32 = 0.031415927;
// What no square exceeds whatever the tolerance: `pending` has room for no more.
const MOST_SPREAD: f32 = 1.0;

// Has the cone of a ray that was just started spread by an angle, given squared.
fn widen(ray: u32, square: f32) {
    surfaces[ray].pending |= bitcast<u32>(min(params.levels.z * min(square, WIDEST), MOST_SPREAD)) << 1u;
}

// Of a ray drawn by a density over solid angles, from a lobe with the square `alpha` of a roughness: the solid angle
// that one of many stands for is 1 / (their number * density) (Colbert, Krivanek, "GPU-Based Importance Sampling", GPU
// Gems 3, ch. 20). What a sharp lobe reflects far off its middle stays as sharp as the lobe.
fn widen_reflected(ray: u32, density: f32, alpha: f32) {
    widen(ray, min(1.0 / (RAYS_AROUND * density), alpha * alpha));
}
