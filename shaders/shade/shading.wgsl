// Bindings of group 3: materials, what shading keeps per pixel, and the set of rays whose hits are shaded: the one
// before that of the pass.

@group(3) @binding(0) var<storage, read> materials: array<Material>;
@group(3) @binding(1) var<storage, read_write> gbuffer: array<GBuffer>;      // of the set
@group(3) @binding(2) var<storage, read_write> radiance: array<vec4<f32>>; // summed over samples; w: samples
@group(3) @binding(3) var<storage, read_write> seen_rays: array<Ray>;
@group(3) @binding(4) var<storage, read_write> seen_hits: array<Hit>;
@group(3) @binding(5) var<storage, read_write> seen_surfaces: array<Surface>;
// Of the light that the rays of set 1 bring; w: number of their direction.
@group(3) @binding(6) var<storage, read_write> throughput: array<vec4<f32>>;
// By which the directions of the rays of set 1 were drawn; 0 where no lamp's rays bring the same light.
@group(3) @binding(7) var<storage, read_write> densities: array<f32>;
