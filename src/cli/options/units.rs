//! What is said at the end of every help text.

/// Units and exit status.
pub const UNITS: &str = "Sizes: 16M and 16MiB are powers of 1024, 16MB of 1000. Counts: K and M are powers of 1000.\n\
     Exit status: 0 success, 1 bad input (one line says what is wrong and what to do), 2 wrong usage.";
