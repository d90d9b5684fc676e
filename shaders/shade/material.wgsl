// Textures of materials, and what a hit shows once they are known.

fn texture_of(m: Material, place: u32) -> u32 {
    switch place {
        case BASE_COLOR: { return m.base_color_texture; }
        case NORMAL: { return m.normal_texture; }
        case METALLIC_ROUGHNESS: { return m.metallic_roughness_texture; }
        case OCCLUSION: { return m.occlusion_texture; }
        default: { return m.emissive_texture; }
    }
}

// Of a material without further textures.
const WHOLE = More(vec3<f32>(1.0), 1.0, vec3<f32>(1.0), 1.0, vec3<f32>(0.0), 1.0, vec2<f32>(1.0, 0.0), 1.0, 1.0, 1.0, 1.0,
    0u, 0u);

// Unlit surfaces show their base colour whatever the light (KHR_materials_unlit).
fn settled(g: GBuffer, flags: u32) -> GBuffer {
    var s = g;
    if (flags & MATERIAL_UNLIT) != 0u {
        s.emission = g.albedo;
        s.albedo = vec3<f32>(0.0);
    }
    return s;
}
