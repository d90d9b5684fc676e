// Workgroups of 8 x 8 rays, dealt out tile by tile, so that rays that lie together are traced together.

struct Work {
    tile: u32,            // NONE: no work
    ray: vec2<u32>,       // column and row of the first of the workgroup's rays
}

fn blocks_of_tile() -> u32 {
    return (params.tile / 8u) * (params.tile / 8u);
}

// A block of the tile; the workgroups of a tile are numbered one after the other.
fn block_of_tile(tile: u32, workgroup: u32) -> Work {
    let edge = params.tile / 8u;
    let block = workgroup % (edge * edge);
    let first = vec2<u32>(tile % params.tiles_x, tile / params.tiles_x) * params.tile;
    return Work(tile, first + 8u * vec2<u32>(block % edge, block / edge));
}

// Index of the ray of thread `local`; NONE without work and beyond the picture.
fn ray_of(work: Work, local: vec3<u32>) -> u32 {
    let ray = work.ray + local.xy;
    let is_outside = work.tile == NONE || ray.x >= params.width || ray.y >= params.height;
    return select(ray.y * params.width + ray.x, NONE, is_outside);
}

// What a workgroup has to do of the work over all tiles.
fn work_of_all(workgroup: u32) -> Work {
    let tile = workgroup / blocks_of_tile();
    if tile >= params.tiles {
        return Work(NONE, vec2<u32>(0u));
    }
    return block_of_tile(tile, workgroup);
}
