// Where the further textures of hits are kept: in the second half of the G-buffer, so that kernels bind no buffer more.
// Only scenes with further textures have that half.

fn keep_more(index: u32, x: More) {
    var g: GBuffer;
    g.albedo = x.specular;
    g.footprint = x.specular_weight;
    g.emission = x.sheen;
    g.handedness = x.sheen_roughness;
    g.normal = x.normal;
    g.weights = x.along;
    g.uv = vec2<f32>(x.coat, x.coat_roughness);
    g.tangent = vec3<f32>(x.anisotropy, x.film, x.film_thickness);
    g.state = x.state;
    gbuffer[arrayLength(&gbuffer) / 2u + index] = g;
}

fn kept_more(index: u32) -> More {
    let g = gbuffer[arrayLength(&gbuffer) / 2u + index];
    let t = g.tangent;
    return More(g.albedo, g.footprint, g.emission, g.handedness, g.normal, g.uv.x, g.weights, t.x, g.uv.y, t.y, t.z,
        g.state, 0u);
}
