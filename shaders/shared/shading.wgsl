// Bindings of group 3: materials, textures, and what shading keeps per pixel.

@group(3) @binding(0) var<storage, read> materials: array<Material>;
@group(3) @binding(1) var<storage, read> textures: array<Texture>;
@group(3) @binding(2) var<storage, read_write> gbuffer: array<GBuffer>;
@group(3) @binding(3) var<storage, read_write> radiance: array<vec4<f32>>; // summed over samples; w: samples
@group(3) @binding(4) var<storage, read_write> primary_rays: array<Ray>;
@group(3) @binding(5) var<storage, read_write> primary_hits: array<Hit>;
@group(3) @binding(6) var<storage, read_write> primary_surfaces: array<Surface>;
