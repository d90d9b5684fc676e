// Rays through levels, cubes of cells around the camera each of which has cells twice as large as the one before.

// A level ends before its sides, ray by ray, by up to this share of them, so that no edge between levels shows.
const BLEND: f32 = 1.0 / 16.0;
// Rays that are this long, device units, have no end that matters, and its square does not overflow.
const UNBOUNDED: f32 = 0x1p40;
// Slower than this, in cells a unit of t, a ray stays where it is.
const LEAST_SPEED: f32 = 0x1p-60;

// The part of the range of t in which a coordinate lies between `low` and `high`.
fn clipped(range: vec2<f32>, at: f32, speed: f32, low: f32, high: f32) -> vec2<f32> {
    if abs(speed) < LEAST_SPEED {
        return select(vec2<f32>(1.0, 0.0), range, at >= low && at <= high);
    }
    let inverse = divide(1.0, speed);
    let a = barrier(barrier(low - at) * inverse);
    let b = barrier(barrier(high - at) * inverse);
    return vec2<f32>(max(range.x, min(a, b)), min(range.y, max(a, b)));
}

// Where a ray ends that is `lift` off its surface, so that it leaves the ball around its origin no farther than
// without: what it goes along must not reach across a narrow room. `squares` and `rise` are the products of its
// direction with itself and with the normal.
fn end_of(t_max: f32, lift: f32, squares: f32, rise: f32) -> f32 {
    if t_max >= UNBOUNDED {
        return t_max;
    }
    let height = barrier(lift * rise);
    let past = barrier(barrier(barrier(t_max * t_max) * squares) - barrier(lift * lift));
    let root = square_root(max(barrier(barrier(height * height) + barrier(squares * past)), 0.0));
    return clamp(divide(barrier(root - height), squares), 0.0, t_max);
}

// Position at t.
fn along(at: f32, speed: f32, t: f32) -> f32 {
    return barrier(at + barrier(t * speed));
}
