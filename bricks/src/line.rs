//! Text that is to be one line.

/// `text` with every run of control characters and white space as one space.
///
/// What others say of a file may quote the file, whose names may hold anything.
pub fn one_line(text: &str) -> String {
    text.split(|c: char| c.is_whitespace() || c.is_control())
        .filter(|word| !word.is_empty())
        .collect::<Vec<_>>()
        .join(" ")
}

#[cfg(test)]
mod tests {
    use super::one_line;

    #[test]
    fn runs_of_control_characters_and_spaces_are_one_space() {
        assert_eq!(one_line("a\r\n\tb \u{7}c\n"), "a b c");
        assert_eq!(one_line("keyframe 2"), "keyframe 2");
    }
}
