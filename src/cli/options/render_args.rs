//! Options of what renders and traces: views of the settings, and what is read and written.

#[cfg(any(feature = "serve", feature = "viewer"))]
use super::group_args::OfView;
use super::group_args::{GroupArgs, OfTrace, OfWalk};
use super::job_args::PartRange;
use super::scene_name::scene_name;
use super::units::UNITS;
use crate::cli::output::Usage;
use crate::session::Settings;
use crate::settings::SettingsError;
#[cfg(feature = "serve")]
use crate::settings::sizes::ranged;
use clap::Args;
use std::path::{Path, PathBuf};

/// Options of `walk`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct WalkArgs {
    /// The scene: a .bricks file, the URL of one, or a model
    ///
    /// A model (.gltf, .glb, .obj, .ply, .stl, tileset.json) is converted once into a folder and taken from there the
    /// next time, as long as its files are the same; a line says where it is. The folder is BRICKWALK_CACHE_DIR, else
    /// brickwalk in the user's cache. `convert` has options for how a model is converted
    #[arg(value_name = "S.bricks|MODEL", value_parser = scene_name(), required_unless_present = "print_settings")]
    scene: Option<PathBuf>,
    /// Output folder for frames, records and report; created if missing
    #[arg(short, long, value_name = "DIR", required_unless_present = "print_settings")]
    output: Option<PathBuf>,
    /// Read settings from a file (TOML); options on the command line override it [default: none]
    #[arg(long = "settings", value_name = "F.toml", hide_short_help = true)]
    file: Option<PathBuf>,
    /// Print the settings as a TOML file and exit
    #[arg(long, hide_short_help = true)]
    pub print_settings: bool,
    /// Print records on standard output, too, one JSON object per line
    #[arg(long, hide_short_help = true)]
    pub json: bool,
    /// Render frame N, or FIRST to LAST, apart from the others, into DIR/parts, for --join [default: none]
    ///
    /// With --bands B a frame is B parts: N is band N mod B of frame N / B, from the top. Any machine may render any
    /// part, in any order; the commands differ in this option alone. What is there and whole is not rendered again.
    #[arg(long, value_name = "N|FIRST-LAST", conflicts_with_all = ["join", "json"], hide_short_help = true,
        hide_long_help = true)]
    pub part: Option<PartRange>,
    /// Take frames from DIR/parts, and render those that are missing there; removes the parts at the end
    ///
    /// Frames are, byte for byte, those of one walk on the machine that joins them, if the parts come from a device
    /// of the same kind.
    #[arg(long, hide_short_help = true, hide_long_help = true)]
    pub join: bool,
    /// Show all options, with those for experts
    #[arg(long, action = clap::ArgAction::HelpLong)]
    pub help_all: Option<bool>,
    /// Everything that renders.
    #[command(flatten)]
    given: GroupArgs<OfWalk>,
}

impl WalkArgs {
    /// The settings: what was given, else what the file says, else the defaults.
    ///
    /// # Errors
    /// A bad file; settings that do not go together.
    pub fn settings(&self) -> anyhow::Result<Settings> {
        let settings = self.given.over(self.file.as_deref())?.for_pictures();
        settings.check().map_err(usage)?;
        Ok(settings)
    }

    /// The scene and the folder for what is written.
    ///
    /// # Errors
    /// There are none, which the parser sees to but for `--print-settings`.
    pub fn files(&self) -> Result<(&Path, &Path), Usage> {
        let missing = || Usage("walk needs a scene and --output".into());
        self.scene.as_deref().zip(self.output.as_deref()).ok_or_else(missing)
    }
}

/// Which settings `view` and `serve` begin with.
#[cfg(any(feature = "serve", feature = "viewer"))]
#[derive(Clone, Debug, Args)]
pub struct ViewSettings {
    /// Read settings from a file (TOML); options on the command line override it [default: none]
    #[arg(long = "settings", value_name = "F.toml", hide_short_help = true)]
    file: Option<PathBuf>,
    /// Show all options, with those for experts
    #[arg(long, action = clap::ArgAction::HelpLong)]
    pub help_all: Option<bool>,
    /// What is rendered, and how.
    #[command(flatten)]
    given: GroupArgs<OfView>,
}

#[cfg(any(feature = "serve", feature = "viewer"))]
impl ViewSettings {
    /// The settings, as those of `walk`.
    ///
    /// # Errors
    /// A bad file; settings that do not go together.
    pub fn settings(&self) -> anyhow::Result<Settings> {
        let settings = self.given.over(self.file.as_deref())?.for_windows();
        settings.check().map_err(usage)?;
        Ok(settings)
    }
}

/// Options of `view`.
#[cfg(feature = "viewer")]
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct ViewArgs {
    /// The scene: a .bricks file, the URL of one, or a model, which is converted first, as by `walk`. [default: none;
    /// drop one on the window]
    #[arg(value_name = "S.bricks|MODEL", value_parser = scene_name())]
    pub scene: Option<PathBuf>,
    /// Folder for screenshots and paths [default: the current one]
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// What is rendered, and how.
    #[command(flatten)]
    pub given: ViewSettings,
}

/// Options of `serve`.
#[cfg(feature = "serve")]
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct ServeArgs {
    /// The scene: a .bricks file, the URL of one, or a model, which is converted first, as by `walk`
    #[arg(value_name = "S.bricks|MODEL", value_parser = scene_name())]
    pub scene: PathBuf,
    /// Port to listen on; 0: any that is free
    #[arg(long, value_name = "N", default_value_t = 7878)]
    pub port: u16,
    /// Address to listen on. All of a network can reach 0.0.0.0; the token in the link is all that keeps others out,
    /// and it is not encrypted. Better is a tunnel: ssh -L 7878:127.0.0.1:7878 HOST
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1")]
    pub bind: std::net::IpAddr,
    /// Sessions at a time, at most; each has a cache of its own
    #[arg(long, value_name = "N", default_value = "4", value_parser = ranged::<1, 64>)]
    pub viewers: u32,
    /// What is rendered, and how.
    #[command(flatten)]
    pub given: ViewSettings,
}

/// Settings that do not go together are wrong usage.
fn usage(error: SettingsError) -> anyhow::Error {
    match error {
        SettingsError::Conflict(text) => Usage(text).into(),
        error => error.into(),
    }
}

/// Options of `trace`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct TraceArgs {
    /// The scene: a .bricks file, the URL of one, or a model
    ///
    /// A model (.gltf, .glb, .obj, .ply, .stl, tileset.json) is converted once into a folder and taken from there the
    /// next time, as long as its files are the same; a line says where it is. The folder is BRICKWALK_CACHE_DIR, else
    /// brickwalk in the user's cache. `convert` has options for how a model is converted
    #[arg(value_name = "S.bricks|MODEL", value_parser = scene_name())]
    pub scene: PathBuf,
    /// Rays: a NumPy array, float64 or float32, shape (N, 8) or (N, 6): origin xyz, direction xyz, t_min, t_max; world
    /// space
    ///
    /// Without t_min and t_max they are 0 and infinity. N may be any number of axes.
    #[arg(long, value_name = "R.npy")]
    pub rays: PathBuf,
    /// Hits: a NumPy structured array, one element per ray, shaped as the rays: t (f8), triangle (u4), u (f4), v (f4)
    ///
    /// t counts in lengths of the direction, +inf on a miss, where triangle is 4294967295. u weights vertex 1 and v
    /// vertex 2 of the triangle in the order of the source file; 1 - u - v weights vertex 0.
    #[arg(short, long, value_name = "H.npy")]
    pub output: PathBuf,
    /// Test only whether a ray hits anything; the output is an array of bool
    #[arg(long)]
    pub any: bool,
    /// Add a field to the hits: normal (three f4), the triangle's unit normal in world space
    ///
    /// Seen from its tip, vertices 0, 1, 2 of the source file run counter-clockwise. It is zero on a miss.
    #[arg(long, conflicts_with = "any")]
    pub normals: bool,
    /// With --lod: the angle of the pixel that each ray stands for, in radians, above 0 to 1 [default: none]
    ///
    /// At a distance of D world units from a ray's origin a pixel is RADIANS * D wide. A camera of H rows with a
    /// vertical angle of view FOV has about FOV / H. A hit on a level of detail has the distance and normal of the
    /// level's triangle, u and v weight its vertices, and triangle is one of those of the source that it stands for
    #[arg(long, value_name = "RADIANS", allow_negative_numbers = true, value_parser = spread)]
    pub spread: Option<f64>,
    /// Print statistics as a JSON object
    #[arg(long)]
    pub json: bool,
    /// Read settings from a file (TOML); options on the command line override it [default: none]
    #[arg(long = "settings", value_name = "F.toml")]
    file: Option<PathBuf>,
    /// What streams bricks.
    #[command(flatten)]
    given: GroupArgs<OfTrace>,
}

impl TraceArgs {
    /// The settings: what was given, else what the file says, else the defaults.
    ///
    /// # Errors
    /// A bad file; an option that means nothing without frames.
    pub fn settings(&self) -> anyhow::Result<Settings> {
        if let Some(entry) = self.given.over(None)?.for_frames_alone() {
            let flag = entry.field.flag();
            return Err(Usage(format!("--{flag} is for walk; leave it out of trace")).into());
        }
        let settings = self.given.over(self.file.as_deref())?;
        if settings.lod > 0.0 && self.spread.is_none() {
            let text = "--lod needs --spread RADIANS: rays of a file have no pixels; give the angle that each stands \
                        for, such as --spread 0.001";
            return Err(Usage(text.into()).into());
        }
        Ok(settings)
    }
}

/// The angle of a pixel.
fn spread(text: &str) -> Result<f64, String> {
    let found = text.parse().ok().filter(|&angle: &f64| angle > 0.0 && angle <= 1.0);
    found.ok_or_else(|| "it must be an angle in radians, above 0 and at most 1, such as 0.001".into())
}
