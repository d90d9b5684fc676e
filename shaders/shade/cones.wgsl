// How wide the cones of rays are that each have a width of their own (docs/methods/levels.md). Twin:
// src/kernels/shade/cones.rs.

// One of so many rays stands for its share of what is around.
const RAYS_AROUND: f32 = 100.0;
// Square of the angle of one of them that is cosine-weighted, along the normal: pi / 100. No cone is wider.
const WIDEST: f32 = 0.031415927;
// What no square exceeds whatever the tolerance: `pending` has room for no more.
const MOST_SPREAD: f32 = 1.0;

// Of a ray drawn by a density over solid angles, from a lobe with the square `alpha` of a roughness: the solid angle
// that one of many stands for is 1 / (their number * density) (Colbert, Krivanek, "GPU-Based Importance Sampling", GPU
// Gems 3, ch. 20). What a sharp lobe reflects far off its middle stays as sharp as the lobe. Normals that differ over
// the width w of the cone at the hit spread it as well. By how much they do is known, not whether they spread or
// gather: by 2 sqrt(K) w a convex mirror of Gaussian curvature K, as a concave one does beyond its focus. Half of it is
// taken, so that cones are hardly anywhere too wide.
fn widen_reflected(ray: u32, density: f32, alpha: f32, curvature: f32) {
    let way = rays[ray].origin - params.origin.xyz;
    let of_lobe = params.levels.z * min(1.0 / (RAYS_AROUND * density), alpha * alpha);
    let of_curve = params.levels.x * dot(way, way) * curvature;
    let square = min(of_lobe + of_curve, params.levels.z * WIDEST);
    surfaces[ray].pending |= bitcast<u32>(min(square, MOST_SPREAD)) << 1u;
}
