//! Angles, equal bit for bit on every device: the twin of `shaders/common/angles.wgsl`.

use super::exact::divide;

/// tan(π / 8).
const TAN_8: f32 = 0.414_213_56;

/// Arc tangent of 0 to 1, in units of π / 4, within 2⁻²² (Moshier, Cephes, `atanf`).
pub fn eighth_turns(x: f32) -> f32 {
    let is_steep = x > TAN_8;
    let y = if is_steep { divide(x - 1.0, x + 1.0) } else { x };
    let z = y * y;
    let mut p = 8.053_744_5e-2 * z - 1.387_768_6e-1;
    p = p * z + 1.997_771_1e-1;
    p = p * z - 3.333_295e-1;
    let angle = p * (z * y) + y;
    let turns = 1.273_239_5 * angle;
    if is_steep { 1.0 + turns } else { turns }
}

/// Where in the unit square the point of the unit disc lies that is `radius` from its middle, toward (x, y): the
/// inverse of the concentric map (Shirley, Chiu 1997).
pub fn square_of_disc([x, y]: [f32; 2], radius: f32) -> [f32; 2] {
    let (a, b) = (x.abs(), y.abs());
    let (greater, lesser) = if a > b { (a, b) } else { (b, a) };
    if greater == 0.0 {
        return [0.5; 2];
    }
    let other = radius * eighth_turns(divide(lesser, greater));
    let (u, v) = if a > b { (radius, other) } else { (other, radius) };
    let signed = |w: f32, of: f32| 0.5 + 0.5 * if of < 0.0 { -w } else { w };
    [signed(u, x), signed(v, y)]
}

/// The angle of the point (x, y) from the x axis, in units of π / 4: 0 to 8; 0 of the origin.
pub fn eighths_around(x: f32, y: f32) -> f32 {
    let (a, b) = (x.abs(), y.abs());
    let (greater, lesser) = if a > b { (a, b) } else { (b, a) };
    if greater == 0.0 {
        return 0.0;
    }
    let part = eighth_turns(divide(lesser, greater));
    let quarter = if a > b { part } else { 2.0 - part };
    let half = if x < 0.0 { 4.0 - quarter } else { quarter };
    if y < 0.0 { 8.0 - half } else { half }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_those_of_f64() {
        let mut worst = 0.0f64;
        for i in 0..100_000 {
            let angle = f64::from(i) / 100_000.0 * std::f64::consts::TAU;
            for size in [1e-20, 1.0, 1e15] {
                let [x, y] = [size * angle.cos(), size * angle.sin()].map(|x| x as f32);
                let expected = f64::from(y).atan2(f64::from(x)).rem_euclid(std::f64::consts::TAU);
                let found = f64::from(eighths_around(x, y)) * std::f64::consts::FRAC_PI_4;
                let off = (found - expected).abs();
                worst = worst.max(off.min(std::f64::consts::TAU - off));
            }
        }
        assert!(worst < 1e-6, "{worst}");
        assert_eq!(eighths_around(0.0, 0.0), 0.0);
        assert_eq!(
            [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)].map(|(x, y)| eighths_around(x, y)),
            [0.0, 2.0, 4.0, 6.0]
        );
        // Control: with the axes exchanged it is another.
        assert!((eighths_around(0.2, 0.9) - eighths_around(0.9, 0.2)).abs() > 0.5);
    }
}
