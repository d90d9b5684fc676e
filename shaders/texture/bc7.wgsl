// Texels of BC7 blocks, in integers: Khronos Data Format Specification 1.3, "BPTC Compressed Texture Image Formats".
// One texel is decoded at a time, so that a lookup reads what it needs and nothing else.

// By mode, from the lowest bit: subsets (2 bits), bits of the partition (3), of the rotation (2), of the index
// selection (1), of a colour component of an endpoint (4), of its alpha (4), p-bits of each endpoint (1), of each
// subset (1), bits of an index (3), of a second index (2).
const BC7_MODES = array<u32, 8>(
    0x000d0413u, 0x000e061au, 0x0008051bu, 0x0009071au, 0x006865c1u, 0x00488741u, 0x00117701u, 0x0009551au,
);
// Subsets of the texels of partitions into two, a bit a texel, two partitions a word.
const BC7_TWO = array<u32, 32>(
    0x8888ccccu, 0xecc8eeeeu, 0xfeecc880u, 0xec80fec8u, 0xffecc800u, 0xe800fe80u, 0xff00ffe8u, 0xf000fff0u,
    0x008ef710u, 0x08ce7100u, 0x7310008cu, 0x8cce3100u, 0x3110088cu, 0x366c6666u, 0x0ff017e8u, 0x399c718eu,
    0xf0f0aaaau, 0x33cc5a5au, 0x55aa3c3cu, 0xa55a9696u, 0x13c873ceu, 0x3bdc324cu, 0xc33c6996u, 0x06609966u,
    0x04e40272u, 0x27204e40u, 0x936cc936u, 0x639c39c6u, 0x9cc69336u, 0xe718817eu, 0x0fccccf0u, 0xee227744u,
);
// Subsets of the texels of partitions into three, two bits a texel.
const BC7_THREE = array<u32, 64>(
    0xaa685050u, 0x6a5a5040u, 0x5a5a4200u, 0x5450a0a8u, 0xa5a50000u, 0xa0a05050u, 0x5555a0a0u, 0x5a5a5050u,
    0xaa550000u, 0xaa555500u, 0xaaaa5500u, 0x90909090u, 0x94949494u, 0xa4a4a4a4u, 0xa9a59450u, 0x2a0a4250u,
    0xa5945040u, 0x0a425054u, 0xa5a5a500u, 0x55a0a0a0u, 0xa8a85454u, 0x6a6a4040u, 0xa4a45000u, 0x1a1a0500u,
    0x0050a4a4u, 0xaaa59090u, 0x14696914u, 0x69691400u, 0xa08585a0u, 0xaa821414u, 0x50a4a450u, 0x6a5a0200u,
    0xa9a58000u, 0x5090a0a8u, 0xa8a09050u, 0x24242424u, 0x00aa5500u, 0x24924924u, 0x24499224u, 0x50a50a50u,
    0x500aa550u, 0xaaaa4444u, 0x66660000u, 0xa5a0a5a0u, 0x50a050a0u, 0x69286928u, 0x44aaaa44u, 0x66666600u,
    0xaa444444u, 0x54a854a8u, 0x95809580u, 0x96969600u, 0xa85454a8u, 0x80959580u, 0xaa141414u, 0x96960000u,
    0xaaaa1414u, 0xa05050a0u, 0xa0a5a5a0u, 0x96000000u, 0x40804080u, 0xa9a8a9a8u, 0xaaaaaa44u, 0x2a4a5254u,
);
// The texels, four bits each, whose index has a bit less: of subset 1 of two, of subset 1 of three, of subset 2 of
// three.
const BC7_ANCHOR_OF_TWO = array<u32, 8>(
    0xffffffffu, 0xffffffffu, 0xf882282fu, 0x22882282u, 0xff8286ffu, 0x6ff22282u, 0x22ff8626u, 0xf22fffffu,
);
const BC7_ANCHOR_1_OF_THREE = array<u32, 8>(
    0xff38ff33u, 0x33566688u, 0xa633f833u, 0xff586885u, 0xf8a653f8u, 0xffff5f3fu, 0xa58555f3u, 0x33cfd8a5u,
);
const BC7_ANCHOR_2_OF_THREE = array<u32, 8>(
    0x83ff388fu, 0x8fffffffu, 0x8f8f3f8fu, 0x8affa6f3u, 0xa98aaf3fu, 0x8663f8f6u, 0xffffff3fu, 0x8ff3ffffu,
);
// Weights by indices of 2 bits, from 4 on of 3 bits, from 12 on of 4 bits; a byte each.
const BC7_WEIGHTS = array<u32, 7>(
    0x402b1500u, 0x1b120900u, 0x40372e25u, 0x0d090400u, 0x1e1a1511u, 0x2f2b2622u, 0x403c3733u,
);

// `count` <= 8 bits from bit `at` < 128 on.
fn bc7_bits(block: vec4<u32>, at: u32, count: u32) -> u32 {
    let word = at >> 5u;
    let shift = at & 31u;
    let high = select(0u, block[min(word + 1u, 3u)], word < 3u);
    // A shift by 32 does not exist.
    let bits = (block[word] >> shift) | ((high << (31u - shift)) << 1u);
    return bits & ((1u << count) - 1u);
}

// A component of `bits` > 0 bits as one of eight, its highest bits repeated below.
fn bc7_widen(value: u32, bits: u32) -> u32 {
    let high = value << (8u - bits);
    return high | (high >> bits);
}

fn bc7_nibble(word: u32, index: u32) -> u32 {
    return (word >> (4u * (index & 7u))) & 15u;
}

fn bc7_weight(index: u32, bits: u32) -> u32 {
    let at = index + select(select(0u, 4u, bits == 3u), 12u, bits == 4u);
    return (BC7_WEIGHTS[at >> 2u] >> (8u * (at & 3u))) & 255u;
}

fn bc7_mix(a: u32, b: u32, weight: u32) -> u32 {
    return ((64u - weight) * a + weight * b + 32u) >> 6u;
}

// Texel `texel` = x + 4 y of a block: red in the lowest byte, then green, blue, alpha. Blocks of the reserved mode are
// 0.
fn bc7_texel(block: vec4<u32>, texel: u32) -> u32 {
    let number = firstTrailingBit(block.x & 255u);
    if number > 7u {
        return 0u;
    }
    let mode = BC7_MODES[number];
    let subsets = mode & 3u;
    let partition_bits = (mode >> 2u) & 7u;
    let rotation_bits = (mode >> 5u) & 3u;
    let selection_bits = (mode >> 7u) & 1u;
    let color_bits = (mode >> 8u) & 15u;
    let alpha_bits = (mode >> 12u) & 15u;
    let endpoint_bits = (mode >> 16u) & 1u;
    let subset_bits = (mode >> 17u) & 1u;
    let index_bits = (mode >> 18u) & 7u;
    let second_bits = (mode >> 21u) & 3u;

    var at = number + 1u;
    let shape = bc7_bits(block, at, partition_bits);
    at += partition_bits;
    let rotation = bc7_bits(block, at, rotation_bits);
    at += rotation_bits;
    let selection = bc7_bits(block, at, selection_bits);
    at += selection_bits;

    // The subset of the texel, and the texels whose index has a bit less; 16 where there is none.
    var subset = 0u;
    var anchors = vec2<u32>(16u);
    if subsets == 2u {
        subset = (BC7_TWO[shape >> 1u] >> (16u * (shape & 1u) + texel)) & 1u;
        anchors.x = bc7_nibble(BC7_ANCHOR_OF_TWO[shape >> 3u], shape);
    }
    if subsets == 3u {
        subset = (BC7_THREE[shape] >> (2u * texel)) & 3u;
        anchors.x = bc7_nibble(BC7_ANCHOR_1_OF_THREE[shape >> 3u], shape);
        anchors.y = bc7_nibble(BC7_ANCHOR_2_OF_THREE[shape >> 3u], shape);
    }

    // Where things begin: alpha of endpoints, p-bits, indices, second indices.
    let endpoints = 2u * subsets;
    let alphas = at + 3u * endpoints * color_bits;
    let parities = alphas + endpoints * alpha_bits;
    let indices = parities + endpoints * endpoint_bits + subsets * subset_bits;
    let seconds = indices + 16u * index_bits - subsets;

    let parity_bits = endpoint_bits | subset_bits;
    var ends: array<vec4<u32>, 2>;
    for (var k = 0u; k < 2u; k++) {
        let endpoint = 2u * subset + k;
        let parity = bc7_bits(block, parities + select(subset, endpoint, endpoint_bits == 1u), parity_bits);
        var end = vec4<u32>(0u, 0u, 0u, 255u);
        for (var c = 0u; c < 3u; c++) {
            let value = bc7_bits(block, at + (c * endpoints + endpoint) * color_bits, color_bits);
            end[c] = bc7_widen((value << parity_bits) | parity, color_bits + parity_bits);
        }
        if alpha_bits > 0u {
            let value = bc7_bits(block, alphas + endpoint * alpha_bits, alpha_bits);
            end.w = bc7_widen((value << parity_bits) | parity, alpha_bits + parity_bits);
        }
        ends[k] = end;
    }

    let shorter = u32(texel > 0u) + u32(texel > anchors.x) + u32(texel > anchors.y);
    let is_anchor = texel == 0u || texel == anchors.x || texel == anchors.y;
    let index = bc7_bits(block, indices + texel * index_bits - shorter, index_bits - u32(is_anchor));
    var weights = vec2<u32>(bc7_weight(index, index_bits));
    if second_bits > 0u {
        let at_second = seconds + texel * second_bits - u32(texel > 0u);
        let second = bc7_bits(block, at_second, second_bits - u32(texel == 0u));
        let weight = bc7_weight(second, second_bits);
        weights = select(vec2<u32>(weights.x, weight), vec2<u32>(weight, weights.x), selection == 1u);
    }
    var color = vec4<u32>(
        bc7_mix(ends[0].x, ends[1].x, weights.x),
        bc7_mix(ends[0].y, ends[1].y, weights.x),
        bc7_mix(ends[0].z, ends[1].z, weights.x),
        bc7_mix(ends[0].w, ends[1].w, weights.y),
    );
    if rotation > 0u {
        let swapped = color[rotation - 1u];
        color[rotation - 1u] = color.w;
        color.w = swapped;
    }
    return color.x | (color.y << 8u) | (color.z << 16u) | (color.w << 24u);
}
