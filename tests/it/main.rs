//! What only the whole can show, in one binary: the commands as a user runs them, and frames of a session against
//! truth.
//!
//! A family of tests is a folder. `cargo test --release --test it -- exact::records::` runs one file.

mod common;
#[path = "../skip.rs"]
mod skip;

/// Commands on good and bad input: outputs, progress, interruption, repair.
mod command {
    mod checkpoints;
    mod command_line;
    mod crafted;
    mod defaults;
    mod ends;
    mod models;
    mod outputs;
    #[cfg(unix)]
    mod pages;
    mod progress;
    mod query;
    mod repair;
    mod replay;
    mod resume;
    mod scene_commands;
    mod trace;
    mod words;
}

/// Hits and records against truth; equal bits whatever the cache, the schedule, the executor, the bands and
/// the motion.
mod exact {
    mod bands;
    mod budget;
    mod cache_independence;
    mod clip;
    mod cones;
    mod exactness;
    mod given_rays;
    mod hidden;
    mod levels;
    mod motion;
    mod parts;
    mod paths;
    mod rays;
    mod records;
    mod refused;
    mod threshold;
    mod twins;
}

/// The sources themselves: arrows, circles, folders.
mod house {
    mod skipped;
    mod sources;
    mod structure;
}

/// Files of the shared scenes and models of other projects: what converting does, what the picture shows.
mod scenes {
    mod expected;
    mod file_lights;
    mod finished;
    mod millimetres;
    mod pictures;
    mod samples;
    mod sponza;
    mod textures;
}

/// Light, materials and filters of the picture against closed forms.
mod shading {
    mod adaptive;
    mod aov;
    mod further;
    mod glass;
    mod gloss;
    mod instances;
    mod light;
    mod maps;
    mod opacity;
    mod post;
    mod supersampling;
}

/// Methods of secondary visibility against closed forms and exact rays.
mod secondary {
    mod auto;
    mod displacement;
    mod dvf;
    mod dvf_paper;
    mod dvf_renew;
    mod roma;
    mod roma_diffuse;
}

/// The window: the thread that renders for it, its panels, the window itself on a display, and the same in a browser.
#[cfg(all(feature = "serve", feature = "viewer"))]
mod window {
    mod browser;
    mod display;
    mod overlays;
    mod panels;
    mod serve;
    mod studio;
}

/// Bench, selftest and switchable optimisations.
mod lab {
    mod bench;
    mod bench_displacement;
    mod bench_dvf;
    mod bench_lod;
    mod optimisations;
    mod selftest;
    mod study;
}
