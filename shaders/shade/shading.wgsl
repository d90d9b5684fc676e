// Bindings of group 3: materials, what shading keeps per pixel, and the set of rays whose hits are shaded: the one
// before that of the pass.

@group(3) @binding(0) var<storage, read> materials: array<Material>;
@group(3) @binding(1) var<storage, read_write> gbuffer: array<GBuffer>;      // of the set
@group(3) @binding(2) var<storage, read_write> radiance: array<vec4<f32>>; // summed over samples; w: samples
@group(3) @binding(3) var<storage, read_write> seen_rays: array<Ray>;
@group(3) @binding(4) var<storage, read_write> seen_hits: array<Hit>;
@group(3) @binding(5) var<storage, read_write> seen_surfaces: array<Surface>;
// Of the light that the rays of set 1 bring; w: by which density their directions were drawn, 0 where no lamp's rays
// bring the same light.
@group(3) @binding(6) var<storage, read_write> throughput: array<vec4<f32>>;
// Of the rays of set 1. Behind them, block of 8 x 8 by block, as `count_paths` numbers them: `pixel` is the number of
// the first ray of those that go on, and behind the last block that of all.
@group(3) @binding(7) var<storage, read_write> origins: array<Origin>;

// The pixel of the band that a hit of the shaded set belongs to.
fn own_pixel(index: u32) -> u32 {
    if (params.flags & PARAM_BOUNCE) != 0u {
        return origins[index].pixel;
    }
    return index;
}

// That of the picture: random numbers are drawn by it, not by a ray's place in a band or in its set.
fn pixel_of(index: u32) -> u32 {
    return params.first_row * params.width + own_pixel(index);
}
