// A ray at a leaf of the top level: transformed into the frame of the leaf's instance.

struct BrickRay {
    ray: FramedRay,           // in the object's frame
    offset_high: vec3<f32>,   // brick origin in the object's frame
    offset_low: vec3<f32>,
    leaf: u32,
    base: u32,                // global id of the instance's triangle 0
    page: u32,                // of the geometry
    nodes: u32,               // 16-byte units
    vertices: u32,            // words
    ids: u32,                 // words
    indices: u32,             // words
    flags: u32,               // BRICK_* bits
}

// Whether the ray enters a box of the binary top level in its range, padded as in node_hits.
fn enters(ray: FramedRay, node: u32, t_max: f32) -> bool {
    let lo = top2[node].min;
    let hi = top2[node].max;
    let reach = max(abs(lo - ray.origin), abs(hi - ray.origin));
    let m = max(reach.x, max(reach.y, reach.z));
    let o = abs(ray.origin);
    let delta = vec3<f32>(64.0 * UNIT * m + params.instance_pad * (m + max(o.x, max(o.y, o.z))))
        + 8.0 * UNIT * max(abs(lo), abs(hi));
    let a = (lo - delta - ray.origin) * ray.frame.inv;
    let b = (hi + delta - ray.origin) * ray.frame.inv;
    let near = min(a, b);
    let far = max(a, b);
    return max(max(near.x, near.y), max(near.z, ray.t_min)) <= min(min(far.x, far.y), min(far.z, t_max));
}

// Whether the ray may meet the brick of a leaf node. To transform a ray costs more than to ask first whether it enters
// the box.
fn may_meet(ray: FramedRay, node: u32, t_max: f32) -> bool {
    let instance = leaves[top2[node].left].instance;
    return (instances[instance].flags & INSTANCE_IDENTITY) != 0u || enters(ray, node, t_max);
}

fn row_direction(row: vec4<f32>, d: vec3<f32>) -> f32 {
    return barrier(barrier(barrier(row.x * d.x) + barrier(row.y * d.y)) + barrier(row.z * d.z));
}

fn row_point(row: vec4<f32>, p: vec3<f32>) -> f32 {
    return barrier(row_direction(row, p) + row.w);
}

fn object_direction(instance: u32, d: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(row_direction(instances[instance].object_from_world[0], d),
                     row_direction(instances[instance].object_from_world[1], d),
                     row_direction(instances[instance].object_from_world[2], d));
}

fn object_point(instance: u32, p: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(row_point(instances[instance].object_from_world[0], p),
                     row_point(instances[instance].object_from_world[1], p),
                     row_point(instances[instance].object_from_world[2], p));
}

// Points `r` at a leaf. The ray of the instance is made anew only where the instance is not the world.
fn enter_leaf(r: ptr<function, BrickRay>, world: FramedRay, leaf: u32) {
    let l = leaves[leaf];
    (*r).leaf = leaf;
    (*r).offset_high = l.offset_high;
    (*r).offset_low = l.offset_low;
    (*r).base = instances[l.instance].base;
    if (instances[l.instance].flags & INSTANCE_IDENTITY) != 0u {
        (*r).ray = world;
    } else {
        let o = object_point(l.instance, world.origin);
        (*r).ray = framed_ray(o, object_direction(l.instance, world.direction), world.t_min);
    }
}
