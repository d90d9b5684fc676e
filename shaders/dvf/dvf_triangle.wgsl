// Areas of triangles, and how many points lie on them.

// a, b, c turned against the front, of any length; zero where the vertices lie on a line.
fn back_of(t: DvfTriangle) -> vec3<f32> {
    let ab = barrier3(t.b - t.a);
    let ca = barrier3(t.a - t.c);
    // cross(ab, ac) is -cross(ab, ca): this one.
    let back = vec3<f32>(
        diffprod(ab.y, ca.z, ab.z, ca.y),
        diffprod(ab.z, ca.x, ab.x, ca.z),
        diffprod(ab.x, ca.y, ab.y, ca.x),
    );
    return select(back, -back, (t.flags & INSTANCE_MIRRORED) != 0u);
}

// Twice the area of a triangle, device units.
fn twice_area(t: DvfTriangle) -> f32 {
    let back = back_of(t);
    let m = abs(back);
    if max(m.x, max(m.y, m.z)) == 0.0 {
        return 0.0;
    }
    let s = scaled(back);
    return barrier(length_of(s.x) * s.scale);
}

// An area in steps of the sums, at least one.
fn steps_of(area: f32) -> vec2<u32> {
    let steps = barrier(area * dvf.area_scale);
    let high = floor(barrier(steps * 0x1p-32));
    return vec2<u32>(select(u32(barrier(steps - barrier(high * 0x1p32))), 1u, steps < 1.0), u32(high));
}

// Points on a triangle: their share by area (Günay, Akyüz, eq. 1).
fn points_on(t: DvfTriangle) -> u32 {
    let share = divide(barrier(dvf.points * twice_area(t)), dvf.total);
    if (dvf.flags & DVF_ROUND) != 0u {
        return u32(floor(barrier(share + 0.5)));
    }
    return max(u32(ceil(share)), 1u);
}
