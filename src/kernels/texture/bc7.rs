//! Texels of BC7 blocks, in integers: twin of `shaders/texture/bc7.wgsl` (Khronos Data Format Specification 1.3, "BPTC
//! Compressed Texture Image Formats").

/// By mode, from the lowest bit: subsets (2 bits), bits of the partition (3), of the rotation (2), of the index
/// selection (1), of a colour component of an endpoint (4), of its alpha (4), p-bits of each endpoint (1), of each
/// subset (1), bits of an index (3), of a second index (2).
#[rustfmt::skip]
const MODES: [u32; 8] = [
    0x000d_0413, 0x000e_061a, 0x0008_051b, 0x0009_071a, 0x0068_65c1, 0x0048_8741, 0x0011_7701, 0x0009_551a,
];

/// Subsets of the texels of partitions into two, a bit a texel, two partitions a word.
#[rustfmt::skip]
const TWO: [u32; 32] = [
    0x8888_cccc, 0xecc8_eeee, 0xfeec_c880, 0xec80_fec8, 0xffec_c800, 0xe800_fe80, 0xff00_ffe8, 0xf000_fff0,
    0x008e_f710, 0x08ce_7100, 0x7310_008c, 0x8cce_3100, 0x3110_088c, 0x366c_6666, 0x0ff0_17e8, 0x399c_718e,
    0xf0f0_aaaa, 0x33cc_5a5a, 0x55aa_3c3c, 0xa55a_9696, 0x13c8_73ce, 0x3bdc_324c, 0xc33c_6996, 0x0660_9966,
    0x04e4_0272, 0x2720_4e40, 0x936c_c936, 0x639c_39c6, 0x9cc6_9336, 0xe718_817e, 0x0fcc_ccf0, 0xee22_7744,
];

/// Subsets of the texels of partitions into three, two bits a texel.
#[rustfmt::skip]
const THREE: [u32; 64] = [
    0xaa68_5050, 0x6a5a_5040, 0x5a5a_4200, 0x5450_a0a8, 0xa5a5_0000, 0xa0a0_5050, 0x5555_a0a0, 0x5a5a_5050,
    0xaa55_0000, 0xaa55_5500, 0xaaaa_5500, 0x9090_9090, 0x9494_9494, 0xa4a4_a4a4, 0xa9a5_9450, 0x2a0a_4250,
    0xa594_5040, 0x0a42_5054, 0xa5a5_a500, 0x55a0_a0a0, 0xa8a8_5454, 0x6a6a_4040, 0xa4a4_5000, 0x1a1a_0500,
    0x0050_a4a4, 0xaaa5_9090, 0x1469_6914, 0x6969_1400, 0xa085_85a0, 0xaa82_1414, 0x50a4_a450, 0x6a5a_0200,
    0xa9a5_8000, 0x5090_a0a8, 0xa8a0_9050, 0x2424_2424, 0x00aa_5500, 0x2492_4924, 0x2449_9224, 0x50a5_0a50,
    0x500a_a550, 0xaaaa_4444, 0x6666_0000, 0xa5a0_a5a0, 0x50a0_50a0, 0x6928_6928, 0x44aa_aa44, 0x6666_6600,
    0xaa44_4444, 0x54a8_54a8, 0x9580_9580, 0x9696_9600, 0xa854_54a8, 0x8095_9580, 0xaa14_1414, 0x9696_0000,
    0xaaaa_1414, 0xa050_50a0, 0xa0a5_a5a0, 0x9600_0000, 0x4080_4080, 0xa9a8_a9a8, 0xaaaa_aa44, 0x2a4a_5254,
];

/// The texels, four bits each, whose index has a bit less: of subset 1 of two.
#[rustfmt::skip]
const ANCHOR_OF_TWO: [u32; 8] = [
    0xffff_ffff, 0xffff_ffff, 0xf882_282f, 0x2288_2282, 0xff82_86ff, 0x6ff2_2282, 0x22ff_8626, 0xf22f_ffff,
];

/// Of subset 1 of three.
#[rustfmt::skip]
const ANCHOR_1_OF_THREE: [u32; 8] = [
    0xff38_ff33, 0x3356_6688, 0xa633_f833, 0xff58_6885, 0xf8a6_53f8, 0xffff_5f3f, 0xa585_55f3, 0x33cf_d8a5,
];

/// Of subset 2 of three.
#[rustfmt::skip]
const ANCHOR_2_OF_THREE: [u32; 8] = [
    0x83ff_388f, 0x8fff_ffff, 0x8f8f_3f8f, 0x8aff_a6f3, 0xa98a_af3f, 0x8663_f8f6, 0xffff_ff3f, 0x8ff3_ffff,
];

/// Weights by indices of 2 bits, from 4 on of 3 bits, from 12 on of 4 bits; a byte each.
#[rustfmt::skip]
const WEIGHTS: [u32; 7] = [
    0x402b_1500, 0x1b12_0900, 0x4037_2e25, 0x0d09_0400, 0x1e1a_1511, 0x2f2b_2622, 0x403c_3733,
];

/// `count` <= 8 bits from bit `at` < 128 on.
#[inline(always)]
pub fn bits(block: u128, at: u32, count: u32) -> u32 {
    (block >> at) as u32 & ((1 << count) - 1)
}

/// A component of `bits` > 0 bits as one of eight, its highest bits repeated below.
#[inline(always)]
fn widen(value: u32, bits: u32) -> u32 {
    let high = value << (8 - bits);
    high | high >> bits
}

#[inline(always)]
fn nibble(words: &[u32; 8], index: u32) -> u32 {
    words[(index >> 3) as usize] >> (4 * (index & 7)) & 15
}

#[inline(always)]
fn weight(index: u32, bits: u32) -> u32 {
    let first = match bits {
        4 => 12,
        3 => 4,
        _ => 0,
    };
    let at = index + first;
    WEIGHTS[(at >> 2) as usize] >> (8 * (at & 3)) & 255
}

#[inline(always)]
fn mix(a: u32, b: u32, weight: u32) -> u32 {
    ((64 - weight) * a + weight * b + 32) >> 6
}

/// Texel `texel` = x + 4 y of a block: red in the lowest byte, then green, blue, alpha. Blocks of the reserved mode are
/// 0.
pub fn texel(block: [u32; 4], texel: u32) -> u32 {
    let number = (block[0] & 255).trailing_zeros();
    if number > 7 {
        return 0;
    }
    let block = block.iter().rev().fold(0, |all, &word| all << 32 | u128::from(word));
    let mode = MODES[number as usize];
    let subsets = mode & 3;
    let partition_bits = mode >> 2 & 7;
    let rotation_bits = mode >> 5 & 3;
    let selection_bits = mode >> 7 & 1;
    let color_bits = mode >> 8 & 15;
    let alpha_bits = mode >> 12 & 15;
    let endpoint_bits = mode >> 16 & 1;
    let subset_bits = mode >> 17 & 1;
    let index_bits = mode >> 18 & 7;
    let second_bits = mode >> 21 & 3;

    let mut at = number + 1;
    let mut take = |count| {
        at += count;
        bits(block, at - count, count)
    };
    let (partition, rotation, selection) = (take(partition_bits), take(rotation_bits), take(selection_bits));

    // The subset of the texel, and the texels whose index has a bit less; 16 where there is none.
    let (mut subset, mut anchors) = (0, [16; 2]);
    if subsets == 2 {
        subset = TWO[(partition >> 1) as usize] >> (16 * (partition & 1) + texel) & 1;
        anchors[0] = nibble(&ANCHOR_OF_TWO, partition);
    }
    if subsets == 3 {
        subset = THREE[partition as usize] >> (2 * texel) & 3;
        anchors = [&ANCHOR_1_OF_THREE, &ANCHOR_2_OF_THREE].map(|words| nibble(words, partition));
    }

    // Where things begin: alpha of endpoints, p-bits, indices, second indices.
    let endpoints = 2 * subsets;
    let alphas = at + 3 * endpoints * color_bits;
    let parities = alphas + endpoints * alpha_bits;
    let indices = parities + endpoints * endpoint_bits + subsets * subset_bits;
    let seconds = indices + 16 * index_bits - subsets;

    let parity_bits = endpoint_bits | subset_bits;
    let ends = [0, 1].map(|k| {
        let endpoint = 2 * subset + k;
        let parity = bits(block, parities + if endpoint_bits == 1 { endpoint } else { subset }, parity_bits);
        let component = |at, own| widen(bits(block, at, own) << parity_bits | parity, own + parity_bits);
        let color = |c: u32| component(at + (c * endpoints + endpoint) * color_bits, color_bits);
        let alpha = if alpha_bits > 0 { component(alphas + endpoint * alpha_bits, alpha_bits) } else { 255 };
        [color(0), color(1), color(2), alpha]
    });

    let shorter = u32::from(texel > 0) + u32::from(texel > anchors[0]) + u32::from(texel > anchors[1]);
    let is_anchor = texel == 0 || texel == anchors[0] || texel == anchors[1];
    let index = bits(block, indices + texel * index_bits - shorter, index_bits - u32::from(is_anchor));
    let first = weight(index, index_bits);
    let mut weights = [first; 2];
    if second_bits > 0 {
        let at_second = seconds + texel * second_bits - u32::from(texel > 0);
        let second = weight(bits(block, at_second, second_bits - u32::from(texel == 0)), second_bits);
        weights = if selection == 1 { [second, first] } else { [first, second] };
    }
    let mut color = [0, 1, 2, 3].map(|c| mix(ends[0][c], ends[1][c], weights[usize::from(c == 3)]));
    if rotation > 0 {
        color.swap(rotation as usize - 1, 3);
    }
    color[0] | color[1] << 8 | color[2] << 16 | color[3] << 24
}
