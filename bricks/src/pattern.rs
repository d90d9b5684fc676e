//! Names with wildcards.

/// Whether `pattern` names `name`: it is the same, or it is where `*` stands for any characters or none and `?` for any
/// one.
pub fn names(pattern: &str, name: &str) -> bool {
    if pattern == name {
        return true;
    }
    let (pattern, name): (Vec<char>, Vec<char>) = (pattern.chars().collect(), name.chars().collect());
    let (mut at, mut from) = (0, 0);
    // Behind the last star that was met, and what of the name it began with: it takes one character more where the rest
    // does not fit.
    let mut retry = None;
    while from < name.len() {
        match pattern.get(at) {
            Some('*') => {
                at += 1;
                retry = Some((at, from));
            }
            Some(&c) if c == '?' || c == name[from] => {
                at += 1;
                from += 1;
            }
            _ => {
                let Some((behind, begin)) = retry else { return false };
                retry = Some((behind, begin + 1));
                (at, from) = (behind, begin + 1);
            }
        }
    }
    pattern[at..].iter().all(|&c| c == '*')
}

#[cfg(test)]
mod tests {
    use super::names;

    #[test]
    fn stars_and_question_marks_stand_for_characters() {
        for (pattern, name) in
            [("box", "box"), ("b*", "box"), ("*", ""), ("*x*", "box"), ("b?x", "böx"), ("a*b*c", "axbxbc")]
        {
            assert!(names(pattern, name), "{pattern} {name}");
        }
        assert!(names("what?*", "what?*") && names("[1]", "[1]"));
        for (pattern, name) in [("box", "boxes"), ("b?", "box"), ("?", ""), ("a*b*c", "axbxb"), ("", "a"), ("*a", "ab")]
        {
            assert!(!names(pattern, name), "{pattern} {name}");
        }
    }
}
