//! Numbers as people read them.

/// A count with a comma between groups of three digits; the fraction is rounded away.
pub fn count(value: f64) -> String {
    let digits = format!("{:.0}", value.abs());
    let mut out = String::with_capacity(digits.len() + digits.len() / 3 + 1);
    if value <= -0.5 {
        out.push('-');
    }
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

/// A number with three significant digits or all digits before the point: `0.0123`, `1.50`, `23.4`, `1,235`.
pub fn number(value: f64) -> String {
    let magnitude = value.abs();
    if magnitude == 0.0 {
        "0".into()
    } else if magnitude >= 99.95 {
        count(value)
    } else if magnitude >= 9.995 {
        format!("{value:.1}")
    } else if magnitude >= 0.9995 {
        format!("{value:.2}")
    } else if magnitude >= 0.0005 {
        format!("{value:.3}")
    } else {
        format!("{value:.1e}")
    }
}

/// Bytes in the largest unit that keeps them short: `1,536 B`, `23.4 MiB`.
pub fn bytes(value: f64) -> String {
    if value < 10_240.0 {
        return format!("{} B", count(value));
    }
    let (unit, size) = byte_unit(value);
    format!("{} {unit}", number(value / size))
}

/// The unit of bytes that suits values up to `max`, and its size in bytes.
pub fn byte_unit(max: f64) -> (&'static str, f64) {
    const UNITS: [&str; 6] = ["B", "KiB", "MiB", "GiB", "TiB", "PiB"];
    let (mut unit, mut size) = (0, 1.0);
    while max / size >= 1024.0 && unit + 1 < UNITS.len() {
        size *= 1024.0;
        unit += 1;
    }
    (UNITS[unit], size)
}

/// `number` of MiB, for columns whose head names the unit.
pub fn mebibytes(value: f64) -> String {
    number(value / (1024.0 * 1024.0))
}

/// Names as a list in a sentence: `a`, `a and b`, `a, b and c`.
pub fn list(names: &[&str]) -> String {
    match names {
        [] => String::new(),
        [one] => (*one).to_string(),
        [start @ .., last] => format!("{} and {last}", start.join(", ")),
    }
}

/// Bytes in base 64 (RFC 4648, with padding).
pub fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let word = chunk.iter().fold(0u32, |word, &b| word << 8 | u32::from(b)) << (8 * (3 - chunk.len()));
        for digit in 0..4 {
            let index = (word >> (18 - 6 * digit)) & 63;
            out.push(if digit <= chunk.len() { char::from(DIGITS[index as usize]) } else { '=' });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_and_numbers_are_grouped_and_rounded() {
        assert_eq!(count(0.0), "0");
        assert_eq!(count(999.0), "999");
        assert_eq!(count(1_234_567.0), "1,234,567");
        assert_eq!(number(0.0), "0");
        assert_eq!(number(0.0123), "0.012");
        assert_eq!(number(0.00001), "1.0e-5");
        assert_eq!(number(1.5), "1.50");
        assert_eq!(number(9.999), "10.0");
        assert_eq!(number(23.44), "23.4");
        assert_eq!(number(99.96), "100");
        assert_eq!(number(1234.6), "1,235");
    }

    #[test]
    fn bytes_name_their_unit() {
        assert_eq!(bytes(0.0), "0 B");
        assert_eq!(bytes(1536.0), "1,536 B");
        assert_eq!(bytes(24.0 * 1024.0 * 1024.0), "24.0 MiB");
        assert_eq!(byte_unit(1023.0), ("B", 1.0));
        assert_eq!(byte_unit(1024.0), ("KiB", 1024.0));
        assert_eq!(byte_unit(f64::MAX).0, "PiB");
    }

    #[test]
    fn base64_matches_the_vectors_of_rfc_4648() {
        let vectors = [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
            ("foobar", "Zm9vYmFy"),
        ];
        for (plain, coded) in vectors {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
        assert_eq!(base64(&[0xfb, 0xff, 0xbf]), "+/+/");
    }

    #[test]
    fn lists_read_as_sentences() {
        assert_eq!(list(&[]), "");
        assert_eq!(list(&["a"]), "a");
        assert_eq!(list(&["a", "b", "c"]), "a, b and c");
    }
}
