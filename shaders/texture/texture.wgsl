// Lookups in textures that are cut into tiles (bricks/src/texture.rs): trilinear, a texel at a time, through the table
// of where tiles lie. Nothing here depends on what a texture is for.

// One level of a texture around a lookup.
struct Level {
    x: vec2<u32>,         // columns of the texels to the left and to the right, wrapped
    y: vec2<u32>,         // rows of those above and below
    share: vec2<f32>,     // of the right and of the lower ones
    first: u32,           // the level's first tile; NONE in the tail
    columns: u32,         // of its tiles
    page: u32,            // of the tail
    offset: u32,          // of the level in that page, words
    pitch: u32,           // texels in a row of the level in the tail
}

// The levels of a lookup and how much of the coarser one it takes.
struct Levels {
    finer: u32,
    count: u32,           // 1 or 2
    share: f32,
}

// log2(1 + x) for 0 <= x < 1, within 0.001.
fn log2_of_next(x: f32) -> f32 {
    return x + x * (1.0 - x) * (0.4229 - 0.1592 * x);
}

// Levels where a texel is as large as what a pixel covers: half of log2 of its area in texels of level 0. Which ones
// they are follows from the exponent alone, exactly.
fn levels_of(t: Texture, footprint: f32) -> Levels {
    let texels = barrier(barrier(footprint * f32(t.width)) * f32(t.height));
    if !(texels > 1.0) {
        return Levels(0u, 1u, 0.0);
    }
    let bits = bitcast<u32>(texels);
    let exponent = (bits >> 23u) - 127u;
    let finer = exponent >> 1u;
    if finer >= t.levels - 1u {
        return Levels(t.levels - 1u, 1u, 0.0);
    }
    let rest = bitcast<f32>((bits & 0x7fffffu) | 0x3f800000u) - 1.0;
    return Levels(finer, 2u, 0.5 * (f32(exponent & 1u) + log2_of_next(rest)));
}

fn wrap(x: i32, size: i32, mode: u32) -> u32 {
    if mode == 1u {
        return u32(clamp(x, 0, size - 1));
    }
    if mode == 2u {
        let period = 2 * size;
        let m = ((x % period) + period) % period;
        return u32(select(m, period - 1 - m, m >= size));
    }
    return u32(((x % size) + size) % size);
}

// The texel before a coordinate and the share of the next one.
fn place(uv: f32, size: u32, mode: u32) -> vec2<f32> {
    // Whole turns are taken off first so that large coordinates keep their fraction; the bound keeps integers in range.
    let turned = select(barrier(uv - barrier(2.0 * floor(0.5 * uv))), uv, mode == 1u);
    let p = barrier(barrier(clamp(turned, -4.0, 4.0) * f32(size)) - 0.5);
    let before = floor(p);
    return vec2<f32>(before, p - before);
}

fn size_of(t: Texture, number: u32) -> vec2<u32> {
    return max(vec2<u32>(1u), vec2<u32>(t.width, t.height) >> vec2<u32>(number));
}

fn level_at(t: Texture, number: u32, uv: vec2<f32>) -> Level {
    var level: Level;
    let size = size_of(t, number);
    let modes = vec2<u32>(t.wrap & 0xffffu, t.wrap >> 16u);
    let s = place(uv.x, size.x, modes.x);
    let r = place(uv.y, size.y, modes.y);
    let x = i32(s.x);
    let y = i32(r.x);
    level.x = vec2<u32>(wrap(x, i32(size.x), modes.x), wrap(x + 1, i32(size.x), modes.x));
    level.y = vec2<u32>(wrap(y, i32(size.y), modes.y), wrap(y + 1, i32(size.y), modes.y));
    level.share = vec2<f32>(s.y, r.y);
    level.first = NONE;
    if number < t.tail_level {
        level.first = t.first_tile;
        for (var l = 0u; l < number; l++) {
            let tiles = (size_of(t, l) + TILE_TEXELS - 1u) / TILE_TEXELS;
            level.first += tiles.x * tiles.y;
        }
        level.columns = (size.x + TILE_TEXELS - 1u) / TILE_TEXELS;
        return level;
    }
    level.page = t.tail_page;
    level.offset = t.tail_offset;
    for (var l = t.tail_level; l < number; l++) {
        let padded = (size_of(t, l) + 3u) & vec2<u32>(0xfffffffcu);
        level.offset += select(padded.x * padded.y / 4u, padded.x * padded.y, t.encoding == TEXTURE_RGBA8);
    }
    level.pitch = (size.x + 3u) & 0xfffffffcu;
    return level;
}

// The tile of texel `k` of a level: left above, right above, left below, right below. NONE in the tail, and where it is
// that of a texel before.
fn tile_at(level: Level, k: u32) -> u32 {
    let x = level.x / TILE_TEXELS;
    let y = level.y / TILE_TEXELS;
    let is_again = ((k & 1u) == 1u && x.x == x.y) || ((k & 2u) == 2u && y.x == y.y);
    let tile = level.first + y[k >> 1u] * level.columns + x[k & 1u];
    return select(tile, NONE, level.first == NONE || is_again);
}

fn linear_from_srgb(c: vec3<f32>) -> vec3<f32> {
    return select(pow((c + vec3<f32>(0.055)) / 1.055, vec3<f32>(2.4)), c / 12.92, c <= vec3<f32>(0.04045));
}

// Texel `k` of a level, linear.
fn texel_at(t: Texture, level: Level, k: u32) -> vec4<f32> {
    var x = level.x[k & 1u];
    var y = level.y[k >> 1u];
    let is_tiled = level.first != NONE;
    var pitch = level.pitch;
    // In units of 16 bytes.
    var start = level.offset / 4u;
    var page = level.page;
    if is_tiled {
        let slot = tile_slots[level.first + (y / TILE_TEXELS) * level.columns + x / TILE_TEXELS];
        x = x % TILE_TEXELS;
        y = y % TILE_TEXELS;
        pitch = TILE_TEXELS;
        start = slot.offset;
        page = slot.page;
    }
    let is_raw = t.encoding == TEXTURE_RGBA8;
    let at = start + select((y / 4u) * (pitch / 4u) + x / 4u, (y * pitch + x) / 4u, is_raw);
    var four: vec4<u32>;
    if is_tiled {
        four = cache_vec4(page, at);
    } else {
        four = texel_vec4(page, at);
    }
    var word = four[x & 3u];
    if t.encoding == TEXTURE_BC7 {
        word = bc7_texel(four, (x & 3u) + 4u * (y & 3u));
    } else if t.encoding == TEXTURE_BC5 {
        word = bc5_texel(four, (x & 3u) + 4u * (y & 3u));
    }
    let c = unpack4x8unorm(word);
    return vec4<f32>(select(c.rgb, linear_from_srgb(c.rgb), (t.flags & TEXTURE_SRGB) != 0u), c.a);
}

// Bilinear.
fn color_at(t: Texture, level: Level) -> vec4<f32> {
    let top = mix(texel_at(t, level, 0u), texel_at(t, level, 1u), level.share.x);
    let bottom = mix(texel_at(t, level, 2u), texel_at(t, level, 3u), level.share.x);
    return mix(top, bottom, level.share.y);
}
