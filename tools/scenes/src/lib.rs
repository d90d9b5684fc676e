//! Generated scenes of any size, and camera paths through them.
