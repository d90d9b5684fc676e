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
