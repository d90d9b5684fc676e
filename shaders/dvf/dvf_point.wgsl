// Points on a group's triangles, and where their rays start. Points are numbered over all triangles and found by the
// sums of their numbers. Every operation is rounded by itself.

struct DvfStart {
    origin: vec3<f32>,
    cell: u32,            // that holds it; NONE: no ray starts here
    n: vec3<f32>,         // unit normal on the side of the rays
    source: u32,          // id of the triangle
    around: vec2<f32>,    // point of the unit circle by which directions are turned
}

// The triangle that point `point` of the group lies on: the last before which there are no more.
fn triangle_of(point: u32) -> u32 {
    var low = 0u;
    var high = dvf.triangles;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if dvf_sums[middle].x <= point {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

// Where the rays of a point start, on the front of its triangle or behind it.
fn start_of(point: u32, is_behind: bool) -> DvfStart {
    var found = DvfStart(vec3<f32>(0.0), NONE, vec3<f32>(0.0), NONE, vec2<f32>(0.0));
    let number = triangle_of(point);
    let t = dvf_triangles[number];
    var end = dvf.point_count;
    if number + 1u < dvf.triangles {
        end = dvf_sums[number + 1u].x;
    }
    let first = dvf_sums[number].x;
    let count = max(end - first, 1u);
    let own = point - first;
    let words = random4(own, t.id, dvf.seed);
    var r = vec2<f32>(unit_of(words.x), unit_of(words.y));
    if (dvf.flags & DVF_HAMMERSLEY) != 0u {
        r = vec2<f32>(divide(barrier(f32(own) + 0.5), f32(count)), unit_of(reverseBits(own)));
    }
    // P = (1 - sqrt(r1)) A + sqrt(r1) (1 - r2) B + sqrt(r1) r2 C (eq. 2); the set's first number may round to 1.
    let s = square_root(min(r.x, 0x1.fffffep-1));
    let weights = vec3<f32>(barrier(1.0 - s), barrier(s * barrier(1.0 - r.y)), barrier(s * r.y));
    let back = back_of(t);
    let m = abs(back);
    if max(m.x, max(m.y, m.z)) == 0.0 {
        return found;
    }
    let direction = scaled(select(back, -back, is_behind)).x;
    let start = surface_point(t.a, t.b, t.c, weights.x, weights.y, weights.z, 1.0, direction);
    found.origin = offset_origin(start);
    found.cell = dvf_cell(found.origin);
    found.n = start.n;
    found.source = t.id;
    found.around = dvf_directions[dvf.rays + words.z % DVF_CIRCLE_POINTS].xy;
    return found;
}

// Direction `turn` of the rays that start there.
fn direction_of(start: DvfStart, turn: u32) -> vec3<f32> {
    return dvf_around(start.around, dvf_directions[turn].xyz, start.n);
}

// Whether cells are made anew where others are not.
fn dvf_renews() -> bool {
    return (dvf.flags & DVF_RENEW) != 0u;
}

// The entry of a cell that is made anew; NONE: it is not.
fn entry_of(cell: u32) -> u32 {
    if cell == NONE {
        return NONE;
    }
    return dvf_fresh[cell];
}

// Whether an entry is made anew in a direction.
fn is_fresh(entry: u32, direction: vec3<f32>) -> bool {
    let texel = dvf_texel(direction);
    let cells = dvf.size.x * dvf.size.y * dvf.size.z;
    return (dvf_fresh[cells + entry * dvf_words() + texel / 32u] >> (texel % 32u) & 1u) != 0u;
}
