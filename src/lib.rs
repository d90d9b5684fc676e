//! brickwalk.
