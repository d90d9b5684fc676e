// Angles, equal bit for bit on every device. Twin: src/math/angles.rs.

const TAN_8: f32 = 0.41421356; // tan(pi / 8)

// Arc tangent of 0 to 1, in units of pi / 4 (Moshier, Cephes, atanf).
fn eighth_turns(x: f32) -> f32 {
    let is_steep = x > TAN_8;
    var y = x;
    if is_steep {
        y = divide(x - 1.0, x + 1.0);
    }
    let z = barrier(y * y);
    var p = barrier(8.0537445e-2 * z) - 1.3877686e-1;
    p = barrier(p * z) + 1.9977711e-1;
    p = barrier(p * z) - 3.333295e-1;
    let angle = barrier(barrier(p * barrier(z * y)) + y);
    let turns = barrier(1.2732395 * angle);
    return select(turns, 1.0 + turns, is_steep);
}

// Where in the unit square the point of the unit disc lies that is `radius` from its middle, toward d: the inverse of
// the concentric map (Shirley, Chiu 1997).
fn square_of_disc(d: vec2<f32>, radius: f32) -> vec2<f32> {
    let a = abs(d.x);
    let b = abs(d.y);
    let greater = max(a, b);
    if greater == 0.0 {
        return vec2<f32>(0.5);
    }
    let other = barrier(radius * eighth_turns(divide(min(a, b), greater)));
    let w = select(vec2<f32>(other, radius), vec2<f32>(radius, other), a > b);
    return vec2<f32>(0.5) + 0.5 * select(w, -w, d < vec2<f32>(0.0));
}

// The angle of the point (x, y) from the x axis, in units of pi / 4: 0 to 8; 0 of the origin.
fn eighths_around(x: f32, y: f32) -> f32 {
    let a = abs(x);
    let b = abs(y);
    let greater = max(a, b);
    if greater == 0.0 {
        return 0.0;
    }
    let part = eighth_turns(divide(min(a, b), greater));
    let quarter = select(2.0 - part, part, a > b);
    let half = select(quarter, 4.0 - quarter, x < 0.0);
    return select(half, 8.0 - half, y < 0.0);
}
