// What the further textures of hits show: of specular, clear coat, film, anisotropy and sheen. They are looked up
// beside those of the G-buffer (texture/more.wgsl). Twin: src/kernels/shade/more.rs.
#include "shade/more_kept.wgsl"

// What a hit shows before its further textures are looked up, by its normal before its normal texture.
fn start_more(index: u32, g: GBuffer, normal: vec3<f32>) {
    if (materials[g.material].flags & MATERIAL_MORE) == 0u {
        return;
    }
    var x = WHOLE;
    x.normal = normal;
    let further = materials[g.material + 1u];
    for (var place = 0u; place < MATERIAL_TEXTURES; place++) {
        let wants_tangent = place == NORMAL && g.handedness == 0.0;
        if texture_of(further, place) != NONE && !wants_tangent {
            x.state |= 1u << (GBUFFER_FIRST + place);
        }
    }
    keep_more(index, x);
}

// What they show at a hit whose textures are all looked up.
fn more_of(g: GBuffer, index: u32) -> More {
    if (materials[g.material].flags & MATERIAL_MORE) == 0u {
        return WHOLE;
    }
    return kept_more(index);
}
