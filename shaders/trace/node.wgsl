// The padded test of a ray against the eight child boxes of a wide node (docs/methods/exact.md, "Boxes").

// A ray with all that traversal derives from it once, in the world's frame or an instance's.
struct FramedRay {
    origin: vec3<f32>,
    t_min: f32,           // not negative
    direction: vec3<f32>,
    flip: u32,            // slot ^ flip ascends away from the ray's origin
    frame: RayFrame,
}

const UNIT: f32 = 5.9604645e-8;       // 2^-24

fn framed_ray(origin: vec3<f32>, direction: vec3<f32>, t_min: f32) -> FramedRay {
    let negative = (bitcast<vec3<u32>>(direction) >> vec3<u32>(31u));
    // Slots are placed by octant: slot bit 2 is x, bit 1 y, bit 0 z, set for the upper half of the parent.
    let flip = (negative.x << 2u) | (negative.y << 1u) | negative.z;
    return FramedRay(origin, max(t_min, 0.0), direction, flip, ray_frame(direction));
}

fn bytes4(word: u32) -> vec4<f32> {
    return vec4<f32>(vec4<u32>(word, word >> 8u, word >> 16u, word >> 24u) & vec4<u32>(255u));
}

struct NodeHits {
    near: array<vec4<f32>, 2>,
    mask: u32,            // bit i: child i is entered
}

// Words of a node: [0] origin xyz, exponents and inner mask; [1] child base, triangle base, meta; [2..5] lo x y z, hi x
// y z. `offset` turns node space into the ray's; `slack` adds to the padding in units of 2^-24 of the largest distance.
fn node_hits(
    ray: FramedRay,
    n0: vec4<u32>,
    n2: vec4<u32>,
    n3: vec4<u32>,
    n4: vec4<u32>,
    offset_high: vec3<f32>,
    offset_low: vec3<f32>,
    slack: f32,
    t_max: f32,
) -> NodeHits {
    let p = bitcast<vec3<f32>>(n0.xyz);
    let s = bitcast<vec3<f32>>((vec3<u32>(n0.w, n0.w >> 8u, n0.w >> 16u) & vec3<u32>(255u)) << vec3<u32>(23u));
    let pc = (p + offset_high) + offset_low;
    let w = pc - ray.origin;
    let reach = abs(w) + 255.0 * s;
    let m = max(reach.x, max(reach.y, reach.z));
    let o = abs(ray.origin);
    // The last term covers the roundings of a wide brick's offset and is below the others for near bricks.
    let delta = vec3<f32>(64.0 * UNIT * m + slack * (m + max(o.x, max(o.y, o.z))))
        + 4.0 * UNIT * abs(pc) + 2.0 * UNIT * abs(offset_low);
    let inverse = ray.frame.inv;
    let negative = inverse < vec3<f32>(0.0);
    let scale = s * inverse;
    let signed_delta = select(delta, -delta, negative);
    let near0 = (w - signed_delta) * inverse;
    let far0 = (w + signed_delta) * inverse;
    // lo x: n2.xy, lo y: n2.zw, lo z: n3.xy, hi x: n3.zw, hi y: n4.xy, hi z: n4.zw
    let near_x = select(n2.xy, n3.zw, negative.x);
    let far_x = select(n3.zw, n2.xy, negative.x);
    let near_y = select(n2.zw, n4.xy, negative.y);
    let far_y = select(n4.xy, n2.zw, negative.y);
    let near_z = select(n3.xy, n4.zw, negative.z);
    let far_z = select(n4.zw, n3.xy, negative.z);
    var out: NodeHits;
    var mask = 0u;
    for (var half = 0u; half < 2u; half++) {
        let tn = max(max(bytes4(near_x[half]) * scale.x + near0.x, bytes4(near_y[half]) * scale.y + near0.y),
                     max(bytes4(near_z[half]) * scale.z + near0.z, vec4<f32>(ray.t_min)));
        let tf = min(min(bytes4(far_x[half]) * scale.x + far0.x, bytes4(far_y[half]) * scale.y + far0.y),
                     min(bytes4(far_z[half]) * scale.z + far0.z, vec4<f32>(t_max)));
        // Not pruned at equality: a hit at equal distance with a lower id must be found.
        let entered = select(vec4<u32>(0u), vec4<u32>(1u, 2u, 4u, 8u), tn <= tf);
        mask |= (entered.x | entered.y | entered.z | entered.w) << (4u * half);
        out.near[half] = tn;
    }
    out.mask = mask;
    return out;
}

// Turns entered children into a traversal mask: bits 24..31 inner children by priority (the highest is nearest), bits
// 0..23 triangles of leaf children.
fn traversal_mask(entered: u32, n1: vec4<u32>, flip: u32) -> u32 {
    var bits = 0u;
    for (var i = 0u; i < 8u; i++) {
        if (entered & (1u << i)) != 0u {
            let what = (select(n1.z, n1.w, i >= 4u) >> (8u * (i & 3u))) & 255u;
            let count = what >> 5u;
            let inner = (what & 24u) == 24u && count == 1u;
            bits |= count << select(what & 31u, 31u - ((what & 7u) ^ flip), inner);
        }
    }
    return bits;
}
