//! What is said at the end of every help text.

/// Units and exit status.
pub const UNITS: &str = "Sizes are bytes and take K, M, G (powers of 1024); counts take K, M (powers of 1000).\n\
     Exit status: 0 done, 1 the input is bad (one line says what and what to do), 2 wrong usage.";
