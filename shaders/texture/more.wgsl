// Looks up the further textures of hits, beside those of the G-buffer. Twin: src/kernels/texture/more.rs.
#include "shade/more_kept.wgsl"

// Of hit `index`; whether a coarser level stands for one that is missing.
fn look_up_more(g: GBuffer, index: u32) -> bool {
    let has_more = (materials[g.material].flags & MATERIAL_MORE) != 0u;
    if (g.state & GBUFFER_READ) == 0u || !has_more {
        return false;
    }
    var x = kept_more(index);
    if (x.state & GBUFFER_WAITS) == 0u {
        return false;
    }
    let material = g.material + 1u;
    var is_coarser = false;
    for (var which = 0u; which < MATERIAL_TEXTURES; which++) {
        let bit = 1u << (GBUFFER_FIRST + which);
        if (x.state & bit) == 0u {
            continue;
        }
        let found = look_up(g, material, which, index);
        if found.is_missing {
            continue;
        }
        is_coarser |= found.is_coarser;
        let color = found.color;
        switch which {
            case BASE_COLOR: {
                x.specular = color.rgb;
                x.specular_weight = color.a;
            }
            case NORMAL: { x.normal = turned_normal(x.normal, g, color.rgb, materials[material].normal_scale); }
            case METALLIC_ROUGHNESS: {
                x.coat = color.r;
                x.coat_roughness = color.g;
                x.film = color.b;
                x.film_thickness = color.a;
            }
            case OCCLUSION: {
                x.along = 2.0 * color.rg - vec2<f32>(1.0);
                x.anisotropy = color.b;
            }
            default: {
                x.sheen = color.rgb;
                x.sheen_roughness = color.a;
            }
        }
        x.state &= ~bit;
    }
    keep_more(index, x);
    return is_coarser;
}
