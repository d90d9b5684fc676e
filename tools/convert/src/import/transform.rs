//! Placements of inputs, written as numbers or as steps.

use super::affine::{Affine, multiply};
use crate::source::IDENTITY;

/// How a placement may be written, for messages.
const FORMS: &str = "give 12 or 16 numbers (a matrix row by row), or steps: translate X Y Z, scale S or scale X Y Z, \
    rotate x|y|z DEGREES";

/// The placement that `text` describes, row-major 3x4.
///
/// Either the 12 numbers of a 3x4 or the 16 of a 4x4 matrix, row by row, the translation last in each; or steps that
/// are carried out in the order in which they are written: `translate X Y Z`, `scale S`, `scale X Y Z`, `rotate x|y|z
/// DEGREES` (about the axis through the origin, counter-clockwise seen from its end). Words and numbers are separated
/// by spaces or commas.
///
/// # Errors
///
/// One line that says what is wrong with the text and what may be given.
pub fn parse_transform(text: &str) -> Result<[f64; 12], String> {
    let mut words = text.split(|c: char| c.is_whitespace() || c == ',').filter(|word| !word.is_empty()).peekable();
    let number = |word: &str| word.parse::<f64>().ok().filter(|number| number.is_finite());
    let matrix = if words.peek().is_some_and(|word| number(word).is_some()) {
        let numbers: Option<Vec<f64>> = words.map(number).collect();
        let numbers = numbers.ok_or_else(|| format!("not all of it is finite numbers; {FORMS}"))?;
        match numbers.len() {
            12 => {}
            16 if numbers[12..] == [0.0, 0.0, 0.0, 1.0] => {}
            16 => return Err("the last row of the matrix is not 0 0 0 1; only affine placements are possible".into()),
            n => return Err(format!("has {n} numbers; {FORMS}")),
        }
        std::array::from_fn(|i| numbers[i])
    } else {
        let mut matrix = IDENTITY;
        let mut is_empty = true;
        while let Some(step) = words.next() {
            let axis = if step == "rotate" { words.next() } else { None };
            let mut values = Vec::new();
            while let Some(value) = words.peek().and_then(|word| number(word)) {
                values.push(value);
                words.next();
            }
            let step = one_step(step, axis, &values).ok_or_else(|| format!("cannot read \"{step}\"; {FORMS}"))?;
            matrix = multiply(&step, &matrix);
            is_empty = false;
        }
        if is_empty {
            return Err(format!("is empty; {FORMS}"));
        }
        matrix
    };
    let is_sound = matrix.iter().all(|c: &f64| c.is_finite());
    if is_sound { Ok(matrix) } else { Err("leads beyond the range of numbers; use smaller ones".into()) }
}

/// The matrix of one step; `None` if it is none.
fn one_step(step: &str, axis: Option<&str>, values: &[f64]) -> Option<Affine> {
    Some(match (step, axis, values) {
        ("translate", None, &[x, y, z]) => [1.0, 0.0, 0.0, x, 0.0, 1.0, 0.0, y, 0.0, 0.0, 1.0, z],
        ("scale", None, &[s]) if s != 0.0 => one_step(step, None, &[s; 3])?,
        ("scale", None, &[x, y, z]) if x != 0.0 && y != 0.0 && z != 0.0 => {
            [x, 0.0, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, 0.0, z, 0.0]
        }
        ("rotate", Some(axis), &[degrees]) => {
            let (sin, cos) = sin_cos_degrees(degrees);
            match axis {
                "x" => [1.0, 0.0, 0.0, 0.0, 0.0, cos, -sin, 0.0, 0.0, sin, cos, 0.0],
                "y" => [cos, 0.0, sin, 0.0, 0.0, 1.0, 0.0, 0.0, -sin, 0.0, cos, 0.0],
                "z" => [cos, -sin, 0.0, 0.0, sin, cos, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
                _ => return None,
            }
        }
        _ => return None,
    })
}

/// Sine and cosine, exact at multiples of a quarter turn: 90 degrees have no exact radians.
fn sin_cos_degrees(degrees: f64) -> (f64, f64) {
    let turn = degrees.rem_euclid(360.0);
    match turn {
        0.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        _ => turn.to_radians().sin_cos(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn apply(m: &Affine, p: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|r| m[4 * r] * p[0] + m[4 * r + 1] * p[1] + m[4 * r + 2] * p[2] + m[4 * r + 3])
    }

    #[test]
    fn steps_are_carried_out_as_written() {
        let m = parse_transform("scale 2 rotate y 90 translate 10,0,-5").unwrap();
        // x is doubled, turned to -z, moved.
        assert_eq!(apply(&m, [1.0, 0.0, 0.0]), [10.0, 0.0, -7.0]);
        let other = parse_transform("translate 10 0 -5 rotate y 90 scale 2").unwrap();
        assert_ne!(m, other, "the order matters");
        assert_eq!(apply(&parse_transform("rotate x 90").unwrap(), [0.0, 1.0, 0.0]), [0.0, 0.0, 1.0]);
        assert_eq!(apply(&parse_transform("rotate z -270").unwrap(), [1.0, 0.0, 0.0]), [0.0, 1.0, 0.0]);
        let [x, y, _] = apply(&parse_transform("rotate z 30").unwrap(), [1.0, 0.0, 0.0]);
        assert!((x - 0.75f64.sqrt()).abs() < 1e-15 && (y - 0.5).abs() < 1e-15);
    }

    #[test]
    fn matrices_are_read_row_by_row() {
        let twelve = "1 2 3 4  5 6 7 8  9 10 11 12";
        let expected: Affine = std::array::from_fn(|i| i as f64 + 1.0);
        assert_eq!(parse_transform(twelve), Ok(expected));
        assert_eq!(parse_transform(&format!("{twelve}, 0 0 0 1")), Ok(expected));
        assert!(parse_transform(&format!("{twelve} 0 0 0 2")).unwrap_err().contains("0 0 0 1"));
    }

    #[test]
    fn what_is_no_placement_is_told() {
        let bad = [
            "",
            " , ",
            "1 2 3",
            "move 1 2 3",
            "translate 1 2",
            "translate 1 2 3 4",
            "scale",
            "scale 0",
            "scale 1 2",
            "scale nan",
            "rotate 90",
            "rotate w 90",
            "rotate x",
            "1 0 0 0 0 1 0 0 0 0 1 x",
            "1 0 0 0 0 1 0 0 0 0 1 inf",
            "scale 1e200 scale 1e200",
        ];
        for text in bad {
            let error = parse_transform(text).expect_err(text);
            assert!(!error.contains('\n') && error.contains("; "), "{error}");
        }
    }
}
