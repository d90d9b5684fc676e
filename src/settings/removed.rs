//! Options and named values that are gone, and what stands in their place.

/// Each name as it was written on the command line, and what to write now.
pub const REMOVED: &[(&str, &str)] = &[
    ("mirror", "glossy shows what smooth metals mirror"),
    ("leaf-cache", "triangles are tested where they are found, which is faster"),
    ("--with", "every optimisation is on; --without LIST switches some off"),
    ("--prefetch", "bricks are read when rays ask for them, and --host-cache keeps them"),
    ("--roma-near", HANDED_OVER),
    ("--roma-shadow-near", HANDED_OVER),
];

const HANDED_OVER: &str = "--secondary auto hands rays over to maps where their measured error allows it";

/// What to say to somebody who writes `name`, if it is gone.
pub fn removed(name: &str) -> Option<String> {
    let (_, instead) = REMOVED.iter().find(|(gone, _)| *gone == name)?;
    Some(format!("{name} was removed: {instead}"))
}

/// Why a value is refused that is none of `known`; those of `later` are announced, of removed ones it says what stands
/// in their place.
pub fn unknown(text: &str, known: &[&str], later: &[&str]) -> String {
    if let Some(message) = removed(text) {
        return message;
    }
    let known = known.join(", ");
    if later.contains(&text) {
        format!("{text} is not in this version; it has: {known}")
    } else {
        format!("there is no '{text}'; known: {known}")
    }
}
