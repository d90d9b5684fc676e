// Materials, textures, and what shading reads of hits.

struct Material {         // What surfaces are made of, as in the scene file.
    base_color: vec4<f32>, // linear factor
    emission: vec3<f32>,  // linear factor, strength included
    metallic: f32,        // factor, 0 to 1
    roughness: f32,       // factor, 0 to 1
    alpha_cutoff: f32,    // of MASK
    flags: u32,           // MATERIAL_* bits
    base_color_texture: u32, // sRGB. NONE: it has none; so with the others
    opacity_map: u32,     // of the alpha of its base colour texture
    normal_texture: u32,  // linear
    metallic_roughness_texture: u32, // linear: roughness in green, metallic in blue
    occlusion_texture: u32, // linear, in red
    emissive_texture: u32, // sRGB
    normal_scale: f32,    // of x and y of the normal texture
    occlusion_strength: f32, // 0 to 1; 0: nothing of the texture
    clearcoat: f32,       // share of the surface that a clear coat covers
    specular: vec3<f32>,  // what the dielectric part reflects along the normal; of a body: by its index of refraction
    specular_weight: f32, // what it reflects at grazing angles
    clearcoat_roughness: f32, // 0 to 1
    transmission: f32,    // share of light that thin walls or a body let through
    uv_sets: u32,         // bit i: texture i takes the second set of coordinates
    absorption: u32,      // of a body that refracts, per world unit: mantissas of 9 bits, an exponent of 5
    // two rows a texture; w of the first: by what areas grow; of the second: a word of the layers, a number of 24 bits
    uv_from_set: array<vec4<f32>, 10>,
}

struct Texture {          // A texture that is cut into tiles.
    width: u32,           // texels of a row of level 0
    height: u32,          // rows of level 0
    levels: u32,          // number of levels
    wrap: u32,            // WRAP_* of s in the low half, of t in the high half
    encoding: u32,        // TEXTURE_RGBA8, TEXTURE_BC7 or TEXTURE_BC5
    flags: u32,           // TEXTURE_SRGB
    first_tile: u32,      // of level 0; the tiles of a level follow each other row by row, and so do levels
    tail_level: u32,      // the first of the levels that are resident throughout
    tail_page: u32,       // page of texels that holds these levels
    tail_offset: u32,     // words within the page
    padding0: u32,
    padding1: u32,
}

struct TileSlot {         // where a tile of a texture lies in the cache
    page: u32,            // NONE: nowhere
    offset: u32,          // in 16-byte units
}

struct TileDemand {       // what texture lookups ask of a tile
    rays: atomic<u32>,    // hits that wait for some tile and need this one
    first: atomic<u32>,   // the least number of a ray among them
    used: atomic<u32>,    // 1: a lookup has read it
}

struct GBuffer {          // what shading reads of a primary hit
    albedo: vec3<f32>,    // linear base colour
    state: u32,           // 0: attributes not read yet; else GBUFFER_*
    // unit normal, world space: interpolated on the side of the geometric one, then by its texture
    normal: vec3<f32>,
    material: u32,        // index of the material
    emission: vec3<f32>,  // linear radiance
    footprint: f32,       // what the pixel covers of the first coordinates' unit square, an area; 0 without textures
    weights: vec2<f32>,   // barycentric weights of source vertices 1 and 2
    uv: vec2<f32>,        // first coordinates
    tangent: vec3<f32>,   // of the normal texture, world space, not unit
    handedness: f32,      // the bitangent is this times cross(normal, tangent); 0 without a tangent
    uv1: vec2<f32>,       // second coordinates
    footprint1: f32,      // what the pixel covers of the unit square of second coordinates
    occlusion: f32,       // share of unshadowed light that the occlusion texture leaves
    metallic: f32,        // factor times texture
    roughness: f32,       // factor times texture
    padding0: u32,        // with DVF_PAPER: 1 where its cell is mostly occluded
    curvature: f32,       // size of the Gaussian curvature that the vertices' normals have, per square of a device unit
}

struct More {             // what the further textures of a hit's material show, and its coat's normal
    specular: vec3<f32>,  // by which what the dielectric part reflects is multiplied
    specular_weight: f32, // and its weight
    sheen: vec3<f32>,     // by which the sheen is multiplied
    sheen_roughness: f32, // and its roughness
    normal: vec3<f32>,    // of the clear coat, unit, world space
    coat: f32,            // by which the share of the coat is multiplied
    along: vec2<f32>,     // direction of the anisotropy from the tangent, any length
    anisotropy: f32,      // by which its strength is multiplied
    coat_roughness: f32,  // by which the roughness of the coat is multiplied
    film: f32,            // by which the share of the film is multiplied
    film_thickness: f32,  // from its least, 0, to its greatest, 1
    state: u32,           // bits of GBUFFER_WAITS
    padding0: u32,
}

const MATERIAL_DOUBLE_SIDED: u32 = 4u; // both sides are drawn
const MATERIAL_UNLIT: u32 = 8u;    // it shows its base colour, whatever the light
const MATERIAL_REFRACTS: u32 = 16u; // the surface of a body that bends light, with PARAM_REFRACT; else thin walls
const MATERIAL_LAYERS: u32 = 32u;  // it has sheen, anisotropy or a thin film
const MATERIAL_ANISOTROPIC: u32 = 64u; // its reflection has a direction along the surface
const MATERIAL_MORE: u32 = 128u;   // the next material holds further textures of it; its coat has a normal of its own
const GBUFFER_READ: u32 = 1u;      // attributes are read
const GBUFFER_WAITS: u32 = 62u;    // bits of textures that have still to be looked up, the first is that of texture 0
const GBUFFER_COARSER: u32 = 64u;  // a coarser level of a texture was looked up
const GBUFFER_REFRACTS: u32 = 128u; // light is bent at the hit
const GBUFFER_BACK: u32 = 256u;    // it is seen from behind, against its normals
const GBUFFER_FIRST: u32 = 1u;     // bit of texture 0 among GBUFFER_WAITS
const UNSHARED: f32 = 1.0e30;      // density of directions through facets: no lamp's rays bring the same light
const BASE_COLOR: u32 = 0u;        // textures of a material, by number
const NORMAL: u32 = 1u;            // its normal texture
const METALLIC_ROUGHNESS: u32 = 2u; // its metallic-roughness texture
const OCCLUSION: u32 = 3u;         // its occlusion texture
const EMISSIVE: u32 = 4u;          // its emissive texture
const MATERIAL_TEXTURES: u32 = 5u; // number of textures of a material
const REFLECTANCE_SIZE: u32 = 32u; // rows and columns of the table of reflectances
const SHEENS: u32 = 1024u;         // behind it: the table of sheen, of the same rows and columns
const FACET_COSINES: u32 = 2048u;  // that of cosines between views and facets, two entries each
const STRETCHED: u32 = 4096u;      // that of anisotropic facets
const STRETCHED_COSINES: u32 = 16u; // its columns, by the root of the view's cosine
const STRETCHED_ROUGHNESSES: u32 = 12u; // its rows, by the root of the alpha across the direction
const STRETCHED_STRENGTHS: u32 = 8u; // its blocks of rows, by the strength
const STRETCHED_AZIMUTHS: u32 = 5u; // how many such there are, by the cosine from the direction to the view
const LAYER_STEPS: u32 = 4095u;    // steps of a share in a word of the layers; its low 12 bits
const LAYER_BITS: u32 = 12u;       // where the other number begins
const LAYER_INDEX_STEPS: u32 = 1024u; // of indices of refraction above 1
const TEXTURE_RGBA8: u32 = 0u;     // encoding: texels
const TEXTURE_BC7: u32 = 1u;       // encoding: blocks of colours
const TEXTURE_BC5: u32 = 2u;       // encoding: blocks of x and y of directions
const TEXTURE_SRGB: u32 = 1u;      // flags: red, green and blue are sRGB, else linear
const TILE_TEXELS: u32 = 128u;     // side of a tile
