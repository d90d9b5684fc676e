//! The command `brickwalk`.
fn main() {}
