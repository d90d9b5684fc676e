//! Every setting of what renders. A method of `secondary/` declares its own in its folder; here each is a line.

use crate::frame::noise::LEAST;
use crate::frame::{BATCH_SAMPLES, Effects};
use crate::picture::exposure::Exposure;
use crate::picture::tone_map::ToneMap;
use crate::scene::camera::{MAX_FOV_Y_DEGREES, MIN_FOV_Y_DEGREES};
use crate::schedule::{Optimisation, Optimisations, PartOf};
#[cfg(feature = "lab")]
use crate::secondary::df;
use crate::secondary::{EffectMethods, Method, displacement, dvf, roma, rsm};
use crate::settings::file::{given_toml, read_toml, to_toml};
use crate::settings::{
    Adapter, Bounces, CacheSize, Direction, EffectList, Entry, Environment, ErrorLimit, FrameBudget, Group,
    HostCacheSize, ImageSize, Length, Plane, Policy, Rectangle, Rule, Schedule, SettingsError, Turn, settings,
};
use std::path::PathBuf;

mod presets;
mod suited;
#[cfg(test)]
mod tests;

pub use presets::Quality;

/// Without an upper bound.
const ANY: f64 = f64::INFINITY;
/// Rays of a pixel and sample.
const RAYS: Rule = Rule::Whole(1, 1024);
const BOUNCES: Rule = Rule::Whole(1, Effects::MOST_BOUNCES as u64);

settings! {
    /// Everything that can be chosen about what renders.
    ///
    /// ```
    /// use brickwalk::Settings;
    /// use brickwalk::settings::{CacheSize, Schedule};
    /// let settings = Settings { schedule: Schedule::Chc, cache: CacheSize::Bytes(64 << 20), ..Settings::default() };
    /// assert_eq!((settings.spp, Settings::exact().spp), (4, 1));
    /// ```
    pub struct Settings {
        /// Camera path (JSON). [default: one made from the scene's bounds]
        path: Option<PathBuf> = None, "--path P.json", Rule::Any, "", Camera, Common;
        /// Frames along the path.
        frames: u32 = 30, "--frames N", Rule::Whole(1, 1_000_000), "", Camera, Common;
        /// Width and height of a frame, each 1 to 16384.
        size: ImageSize = ImageSize { width: 1280, height: 720 }, "--size WxH", Rule::Any, "pixels", Camera, Common;
        /// Vertical field of view. [default: the path's]
        fov: Option<f64> = None, "--fov DEG", Rule::Real(MIN_FOV_Y_DEGREES, MAX_FOV_Y_DEGREES), "degrees",
            Camera, Usual;
        /// A plane that the scene is cut at, to look into it: a point and a normal, world space. What lies on the side
        /// that the normal points to is there for no ray, light and shadow among them. Not together with --secondary.
        /// [default: none]
        clip: Option<Plane> = None, "--clip X,Y,Z,NX,NY,NZ", Rule::Any, "", Camera, Usual;
        /// Nodes that are left out. Names have commas between them; * stands for any characters, ? for any one, and
        /// #N is the node that triangle N is of. What is hidden is there for no ray; lamps among it shine on. Not
        /// together with --lod and --secondary. [default: none]
        hide: Vec<String> = Vec::new(), "--hide NODES", Rule::Any, "", Camera, Usual;
        /// Nodes that are shown alone, named as those of --hide. [default: all]
        only: Vec<String> = Vec::new(), "--only NODES", Rule::Any, "", Camera, Usual;
        /// Motion of instances (JSON); docs/using.md has the form. What moves is an instance: see `info --instances`
        /// and `convert --movable`. [default: nothing moves]
        motion: Option<PathBuf> = None, "--motion M.json", Rule::Any, "", Camera, Usual;

        /// What is traced: primary, shadow, ao, diffuse, glossy, environment, path; with commas between them. All
        /// include primary. `shadow`: of the sun, the lights, and surfaces that emit. `ao`: ambient occlusion of the
        /// sky's light. `diffuse`: between surfaces, with the sky's light. `glossy`: what metals and polished surfaces
        /// mirror; --bounces says how often. `environment`: the environment's light with shadows; it takes the place of
        /// `ao`. `path`: all of these but `ao`, and eight bounces.
        effects: EffectList = EffectList::LIT, "--effects LIST", Rule::Any, "", Effects, Common;
        /// Rays of `ao` per pixel and sample.
        ao_rays: u32 = 2, "--ao-rays N", RAYS, "", Effects, Usual;
        /// Length of the rays of `ao`, in world units (metres in glTF), or auto. `auto` is a fifth of the shortest side
        /// of the scene's bounds, but no less than a hundredth of their diagonal and no more than a tenth.
        ao_length: Length = Length::Auto, "--ao-length LENGTH|auto", Rule::Real(1e-6, 1e9), "", Effects, Usual;
        /// Times that light is reflected between surfaces on its way, or auto: 8 with `path`, else 1. Paths go on from
        /// the hits of `diffuse` and `glossy`; from the third hit on they may end by chance.
        bounces: Bounces = Bounces::Auto, "--bounces N|auto", BOUNCES, "", Effects, Usual;
        /// Rays of `diffuse` per pixel and sample; they are as long as the scene.
        diffuse_rays: u32 = 4, "--diffuse-rays N", RAYS, "", Effects, Usual;
        /// Every triangle stops every ray, whatever its alpha.
        opaque: bool = false, "--opaque", Rule::Any, "", Effects, Expert;
        /// Greatest random turn of the directions of `ao` and `diffuse` about the normal. A small one keeps rays of
        /// neighbouring pixels alike, and shows ghosts of edges; below `full` all pixels share the heights of
        /// directions, so that few of them make pictures too bright or too dark. `full`, --denoise and --taa give every
        /// pixel directions of its own, all over the hemisphere.
        rotation: Turn = Turn::FULL, "--rotation DEG|full", Rule::Real(0.0, 360.0), "degrees", Effects, Expert;

        /// Direction towards the sun, world space, any length.
        sun: Direction = Direction([0.4, 0.8, 0.45]), "--sun X,Y,Z", Rule::Any, "", Light, Usual;
        /// Angular diameter of the sun; 0 makes hard shadows.
        sun_angle: f64 = 0.53, "--sun-angle DEG", Rule::Real(0.0, 90.0), "degrees", Light, Usual;
        /// Brightness of the sun. A white surface that faces it has the radiance 0.60, 0.56, 0.48 times this; with a
        /// physical sky one as bright, while the sun is half way up. Its irradiance is pi times that. [default: 2.4;
        /// with an image as environment 0]
        sun_intensity: Option<f64> = None, "--sun-intensity X", Rule::Real(0.0, ANY), "", Light, Usual;
        /// Radiance of the sky. It is the same in all directions, and without `ao` and `diffuse` it has no shadows.
        sky_intensity: f64 = 0.35, "--sky-intensity X", Rule::Real(0.0, ANY), "", Light, Usual;
        /// What surrounds the scene: an image (.hdr, .exr), sky, auto, or none. An image is linear, +Y up, its middle
        /// along -Z and its right along +X. `sky` is a physical sky with the sun of --sun, over a ground that both
        /// light. `auto` is `sky`, but black and without a sun around generated scenes that have their own light, to
        /// which it adds `diffuse` where effects are the default. `none` is a sky of one colour. With `--effects
        /// environment` it lights with shadows, else by its spherical harmonics, or by `diffuse`.
        environment: Option<Environment> = Some(Environment::Auto), "--environment FILE|NAME", Rule::Any, "",
            Light, Common;
        /// Turn of the environment's image about +Y, counter-clockwise seen from above.
        environment_rotation: f64 = 0.0, "--environment-rotation DEG", Rule::Real(-360.0, 360.0), "degrees",
            Light, Usual;
        /// Factor of the environment's radiance.
        environment_intensity: f64 = 1.0, "--environment-intensity X", Rule::Real(0.0, ANY), "", Light, Usual;
        /// Factor of the lights in the scene file. 1 candela is taken as 1 W/sr, 1 lux as 1 W/m2.
        lights_intensity: f64 = 1.0, "--lights-intensity X", Rule::Real(0.0, ANY), "", Light, Usual;
        /// A rectangular light: a corner, and the two edges U and V that start there, world space. It shines to the
        /// side of U x V and is not seen itself. [default: none]
        rect_light: Option<Rectangle> = None, "--rect-light X,Y,Z,UX,UY,UZ,VX,VY,VZ", Rule::Any, "", Light, Expert;
        /// Radiance of the rectangular light.
        rect_light_intensity: f64 = 10.0, "--rect-light-intensity X", Rule::Real(0.0, ANY), "", Light, Expert;

        /// What pictures are made for: auto, draft, preview, high, exact. It stands for other settings, which
        /// --print-settings shows, and single options win over it. `draft`: sun and ambient occlusion, four samples.
        /// `preview`: sun and sky by two bounces, four samples, denoised. `high`: all light, eight bounces, 16 samples,
        /// denoised. `exact`: one camera ray and one shadow ray a pixel, without exposure and tone map, for
        /// measurements. `auto`: `preview` for `walk` and `demo`; `draft` for the others, where options choose effects,
        /// samples, methods or measurements, and for pictures of more than 8 million pixels. On two cores a frame of
        /// 1280x720 of a city takes 7 s, 20 s, 90 s and 1 s, one of Sponza 18 s, 75 s, 5 min and 4 s. Hits are exact
        /// with all of them.
        quality: Quality = Quality::Auto, "--quality NAME", Rule::Any, "", Quality, Common;
        /// Samples per pixel. Beyond 64 they are summed in f64.
        spp: u32 = 4, "--spp N", Rule::Whole(1, 1_000_000), "", Quality, Common;
        /// Noise at which a pixel takes no more samples: the standard error of its mean as a part of that, as 0.02.
        /// Blocks of 8x8 pixels are judged together, after 16 samples and after every 8 more; --spp is the most that
        /// one takes. `summary.json` says how many they took. [default: off, all take --spp]
        noise: Option<f64> = None, "--noise PART", Rule::Real(1e-6, 1.0), "", Quality, Expert;
        /// Levels of detail: the error, in pixels, at which a coarser level stands for bricks; 0 is exact. 1 is hardly
        /// seen, more loads less. Secondary rays are wider than pixels and take coarser levels. Needs a scene converted
        /// with `--lod on`.
        lod: f64 = 0.0, "--lod PIXELS", Rule::Real(0.0, 1024.0), "pixels", Quality, Usual;
        /// Choose at random between two levels of detail where one gives way to the other. It takes noise in the place
        /// of steps that show as the camera moves.
        lod_blend: bool = false, "--lod-blend", Rule::Any, "", Quality, Expert;
        /// Trace one block of 8x8 pixels in so many exactly as well, and correct the others by its difference. What
        /// levels of detail change of a picture on average then vanishes over frames. [default: off]
        lod_correct: Option<u32> = None, "--lod-correct N", Rule::Whole(1, 65_536), "blocks", Quality, Expert;
        /// Seed of random sampling.
        seed: u64 = 0, "--seed N", Rule::Any, "", Quality, Usual;
        /// Exposure of PNGs and video in stops (EV), or auto. Radiance is multiplied by 2^EV before the tone map.
        /// `auto` brings the log-average luminance of what a frame hits half a stop above middle grey. It keeps 98 % of
        /// it from white and adapts along the path. It stays within 8 stops of 0, or from MIN to MAX. EXR keeps the
        /// radiance.
        exposure: Exposure = Exposure::AUTO, "--exposure EV|auto|auto:MIN,MAX", Rule::Real(-32.0, 32.0), "stops",
            Quality, Usual;
        /// How PNGs and video show what is brighter than a display: none, agx, aces, reinhard. `none` cuts off at 1;
        /// `agx` is AgX, base look; `aces` is Hill's fit of the ACES transforms; `reinhard` works on luminance, 4 is
        /// white. EXR keeps the radiance.
        tone_map: ToneMap = ToneMap::AgX, "--tone-map NAME", Rule::Any, "", Quality, Usual;
        /// Take the noise of few samples out of the frames. Variance-guided filtering over frames and neighbours (SVGF)
        /// trades noise for a small error; without it a picture is the unbiased estimate. EXR has the filtered
        /// radiance. `summary.json` says what energy was cut off fireflies.
        denoise: bool = false, "--denoise", Rule::Any, "", Quality, Usual;
        /// Temporal anti-aliasing. Samples lie at other points of their pixels in every frame, and frames are averaged
        /// where the world was seen before. Not together with --aov.
        taa: bool = false, "--taa", Rule::Any, "", Quality, Usual;

        /// Write an EXR beside each PNG: radiance, depth, normal, triangle id, albedo.
        aov: bool = false, "--aov", Rule::Any, "", Output, Usual;
        /// Write all frames as a video, too: YUV4MPEG2, uncompressed, 4:4:4, 8 bit, BT.709 in limited range. The
        /// ffmpeg commands that make an mp4 are printed. [default: none]
        video: Option<PathBuf> = None, "--video FILE.y4m", Rule::Any, "", Output, Usual;
        /// Frames of the video per second.
        video_fps: u32 = 30, "--video-fps N", Rule::Whole(1, 1000), "", Output, Expert;
        /// Show frames of more than 64 samples while they are made. `DIR/preview.png` is replaced after 64, 128, 256
        /// samples and so on, and removed at the end.
        progressive: bool = false, "--progressive", Rule::Any, "", Output, Usual;

        /// Device memory for bricks and tiles of textures: a size, a share P% of all of them, or auto. A size must hold
        /// the two largest bricks. `auto`: all of them, if three quarters of the device's memory hold them, or half of
        /// what is available on the processor. What is left of that, or of a size, the processor uses for bricks in a
        /// form that rays walk faster, if it holds all.
        cache: CacheSize = CacheSize::Auto, "--cache SIZE|P%|auto", Rule::Any, "", Cache, Common;
        /// Host memory for verified bricks: a size, or auto; 0 keeps none. `auto`: 1 GiB, or an eighth of the memory
        /// that is available where that is less.
        host_cache: HostCacheSize = HostCacheSize::Auto, "--host-cache SIZE|auto", Rule::Any, "", Cache, Expert;
        /// What a frame loads at most: a size, as 8M, or what arrives in so many milliseconds, as 50. Levels of detail
        /// that are resident stand in for other bricks, coarser levels of textures for other tiles. What most rays ask
        /// for comes first, so that while the camera rests frames become exact. Records count pixels that are, and
        /// `state.id` in EXR files says which. The largest payload is always loaded whole. Not together with
        /// --secondary. [default: off, everything is waited for]
        frame_budget: Option<FrameBudget> = None, "--frame-budget MS|SIZE", Rule::Any, "", Cache, Usual;
        /// Old form of --frame-budget SIZE.
        interactive: Option<u64> = None, "--interactive SIZE", Rule::Bytes(1), "bytes", Cache, Expert;
        /// Which brick makes room for another: round-robin, second-chance, lru. `round-robin`: the next one in the
        /// cache; `second-chance`: the next one not used since its last turn; `lru`: the one not used for longest.
        evict: Policy = Policy::RoundRobin, "--evict NAME", Rule::Any, "", Cache, Expert;
        /// Threads that read bricks and check them. [default: one per core, at most 4]
        workers: Option<u32> = None, "--workers|--hash-threads N", Rule::Whole(1, 1024), "", Cache, Expert;
        /// Write the trace of brick requests to a file, for `replay`. [default: none]
        requests_out: Option<PathBuf> = None, "--requests-out F", Rule::Any, "", Cache, Expert;

        /// How bricks to intersect are found: chc, demand, plain, auto; pictures are the same. `chc`: tiles against the
        /// top level, loading what rays need. `demand`: one traversal per ray over what is resident, loading what rays
        /// ask for. `plain`: everything resident, one traversal per ray. `auto`: the cheapest of these by measurement,
        /// for each effect. `plain-bvh2`, for measurements: `plain` over binary trees made at the start.
        schedule: Schedule = Schedule::Auto, "--schedule NAME", Rule::Any, "", Schedule, Usual;
        /// Width and height of a screen tile.
        tile: u32 = 64, "--tile PIXELS", Rule::PowerOfTwo(8, 512), "pixels", Schedule, Expert;
        /// Bands of tiles that a frame is rendered in, one after the other, at least. Each takes memory for its own
        /// rays alone. Where a picture is larger than memory allows there are as many as it needs. Pictures are the
        /// same.
        bands: u32 = 1, "--bands N", Rule::Whole(1, 2048), "", Schedule, Expert;
        /// Keep query pairs of tiles and nodes from frame to frame (schedule chc).
        #[cfg(feature = "lab")]
        fronts: bool = false, "--fronts on|off", Rule::Any, "", Schedule, Expert;
        /// Leave a brick out of a tile where at most this many of its rays could see it; 0 is exact. The number is
        /// scaled to a tile of 200x200 pixels. More loads less and misses hits.
        query_threshold: u32 = 0, "--query-threshold PIXELS", Rule::Whole(0, 40_000), "pixels", Schedule, Expert;
        /// Optimisations to switch off, with commas between them, to measure what each is worth. Pictures are the same.
        /// Of loading: nearest-first, requery, resident-first. Of lists (chc): front-to-back, by-tile, root-walk. Of
        /// --fronts on: multi-queries, tighter-bounds, lazy-requery, pull-up. docs/methods/chc.md says what each does.
        without: Vec<Optimisation> = Vec::new(), "--without LIST", Rule::Any, "", Schedule, Expert;

        /// How secondary rays are answered: exact, roma, auto, sift, df, dvf, displacement, or by effect: ao=roma.
        /// `exact`: all are traced. `auto`: by whatever is fastest on this device within --error, by the rates that
        /// `brickwalk calibrate` has measured; else traced. `roma`: those of `ao` and `diffuse` by occupancy maps, with
        /// a bias of a few cells and without a brick loaded. `sift`: those of `ao` that the maps find free are not
        /// traced. `df`: those of `ao` by
        /// distance fields, a baseline. `dvf`: those to the environment by a field of visibility, made on the first
        /// walk. `displacement`: by what `bake-displacement` has put into the scene file, mostly rays against bricks
        /// that are not resident. Rays of `shadow` are traced unless asked: shadow=roma.
        secondary: EffectMethods = EffectMethods::EXACT, "--secondary METHOD", Rule::Any, "", Methods, Common;
        /// With --secondary auto: the error that methods may have, as a mean FLIP, 0.05, or as a percentage, 5%. FLIP
        /// is that of the picture against the exact one of the same rays, a percentage 100 times the root of an
        /// effect's relMSE. The first of every 32 frames is rendered exactly as well and measures it.
        error: ErrorLimit = ErrorLimit::Percent(5.0), "--error FLIP|P%", Rule::Any, "", Methods, Usual;
        /// With --secondary auto: the file of rates that `brickwalk calibrate` has written. [default: rates.json in the
        /// user's folder for settings, or in BRICKWALK_CONFIG_DIR]
        rates: Option<PathBuf> = None, "--rates FILE", Rule::Any, "", Methods, Expert;

        /// Measure the error of frames after so many samples per pixel, as 1,4,16,64. `--reference` is what they are
        /// measured against; `checkpoints.jsonl` and the report have RMSE, relMSE, bias and FLIP over samples and over
        /// seconds. `--spp` is at least the greatest of them. Not together with --denoise and --taa.
        checkpoints: Vec<u32> = Vec::new(), "--checkpoints LIST", Rule::Whole(1, 1_000_000), "samples",
            Measurement, Usual;
        /// Reference for --checkpoints: an EXR for frame 0, or a folder with one for each frame. In a folder they are
        /// called 0000.exr, 0001.exr and so on, as `walk --aov` writes them. [default: none]
        reference: Option<PathBuf> = None, "--reference FILE.exr|DIR", Rule::Any, "", Measurement, Usual;
        /// Record which bricks every pass needed (`bricks_needed`). It takes one more traversal per pass.
        measure_needed: bool = false, "--measure-needed", Rule::Any, "", Measurement, Expert;
        /// Record how far each effect is from the exact picture (`error_mean`, `error_worst_tile`, `error_pixels`). A
        /// second session renders that picture: it takes twice the time and device memory.
        measure_error: bool = false, "--measure-error", Rule::Any, "", Measurement, Expert;
        /// State in `summary.json` what leaving out what a scene does not need saves. The first frame is rendered six
        /// times more for each thing that is left out, in sessions of their own.
        measure_left_out: bool = false, "--measure-left-out", Rule::Any, "", Measurement, Expert;
        /// Record the nodes that rays visit and the triangles that they test. It takes time.
        count: bool = false, "--count", Rule::Any, "", Measurement, Expert;

        /// What renders: auto, cpu, or the graphics adapter whose name contains NAME. `auto` is a hardware GPU if there
        /// is one, else the processor; `brickwalk adapters` lists what there is.
        adapter: Adapter = Adapter::Auto, "--adapter NAME", Rule::Any, "", Device, Common;
    }
    tables {
        /// Ray-aligned occupancy maps.
        roma: roma::Options,
        /// Reflective shadow maps.
        rsm: rsm::Options,
        /// Distance fields.
        #[cfg(feature = "lab")]
        df: df::Options,
        /// Fields of visibility.
        dvf: dvf::Options,
        /// Displacement fields.
        displacement: displacement::Options,
    }
}

impl Settings {
    /// Refuses settings that do not go together.
    ///
    /// # Errors
    /// Which one to leave out.
    pub fn check(&self) -> Result<(), SettingsError> {
        if self.taa && self.aov {
            let text = "--aov and --taa exclude each other: AOVs are sampled at pixel centres, which --taa jitters; \
                        leave one out";
            return Err(SettingsError::Conflict(text.into()));
        }
        if let Some(file) = self.video.as_ref().filter(|file| file.extension().is_none_or(|ending| ending != "y4m")) {
            let (name, right) = (file.display(), file.with_extension("y4m"));
            return Err(SettingsError::Conflict(format!(
                "--video {name}: a video is written as YUV4MPEG2; name it {}; the command that makes an mp4 of it is \
                 printed at the end",
                right.display()
            )));
        }
        if let Some(method) = [Method::Dvf, Method::Displacement].into_iter().find(|&method| self.secondary.has(method))
            && self.lod > 0.0
        {
            let text = format!(
                "--lod and --secondary {method} exclude each other: {method} knows bricks alone; leave one out"
            );
            return Err(SettingsError::Conflict(text));
        }
        let leaves_out = [(self.clip.is_some(), "--clip"), (self.hides(), "--hide or --only")];
        if let Some((_, option)) = leaves_out.into_iter().find(|(is_on, _)| *is_on)
            && self.secondary != EffectMethods::EXACT
        {
            return Err(SettingsError::Conflict(format!(
                "{option} and --secondary exclude each other: methods know the whole scene; leave one out"
            )));
        }
        if self.hides() && self.lod > 0.0 {
            let text = "--hide or --only and --lod exclude each other: levels of detail stand for what is hidden, too; \
                        leave one out";
            return Err(SettingsError::Conflict(text.into()));
        }
        if self.frame_budget().is_some() {
            let has_methods = self.secondary != EffectMethods::EXACT;
            let others = [(has_methods, "--secondary"), (self.lod_correct.is_some(), "--lod-correct")];
            if let Some((_, other)) = others.into_iter().find(|(is_on, _)| *is_on) {
                let text = format!(
                    "--frame-budget and {other} exclude each other: rays of a budget meet what has arrived, \
                                    others wait; leave one out"
                );
                return Err(SettingsError::Conflict(text));
            }
        }
        if let Some(noise) = self.noise {
            let compare = [
                (self.taa, "--taa"),
                (self.measure_error, "--measure-error"),
                (self.lod_correct.is_some(), "--lod-correct"),
                (self.secondary.has(Method::Auto), "--secondary auto"),
                (self.frame_budget().is_some(), "--frame-budget"),
            ];
            if let Some((_, other)) = compare.into_iter().find(|(is_on, _)| *is_on) {
                let text = format!(
                    "--noise and {other} exclude each other: one compares pictures of as many samples everywhere; \
                     leave one out"
                );
                return Err(SettingsError::Conflict(text));
            }
            if self.samples() <= LEAST {
                let text = format!(
                    "--noise {noise}: every pixel takes {LEAST} samples, and --spp {} is the most that one takes; give \
                     more, as --spp 256",
                    self.samples()
                );
                return Err(SettingsError::Conflict(text));
            }
        }
        if !self.checkpoints.is_empty() {
            let text = match (&self.reference, self.denoise || self.taa) {
                (None, _) => "--checkpoints needs a reference; give --reference FILE.exr, as walk --aov writes it",
                (Some(_), true) => "--checkpoints measures samples as they are; leave out --denoise and --taa",
                (Some(_), false) => "",
            };
            if !text.is_empty() {
                return Err(SettingsError::Conflict(text.into()));
            }
        }
        if let Some(option) = self.needs_whole_pictures().filter(|_| self.bands > 1) {
            return Err(SettingsError::Conflict(format!(
                "--bands {}: {option} needs the whole picture at once; leave one of them out",
                self.bands
            )));
        }
        let is_chc = matches!(self.schedule, Schedule::Chc | Schedule::Auto);
        let is_plain = self.schedule.is_plain();
        for which in &self.without {
            let (has_meaning, belongs) = match which.part_of() {
                PartOf::Loading => (!is_plain, "--schedule chc, demand or auto"),
                PartOf::Lists => (is_chc, "--schedule chc or auto"),
                PartOf::Fronts => (is_chc && self.has_fronts(), "--fronts on (schedule chc)"),
            };
            if !has_meaning {
                let text = format!("--without {}: only with {belongs}", which.name());
                return Err(SettingsError::Conflict(text));
            }
        }
        Ok(())
    }

    /// What answers which effects. `auto` with `--auto-error` or `--auto-one-in` is an old form of `sift`.
    pub fn methods(&self) -> EffectMethods {
        let (own, usual) = (&self.roma, crate::secondary::roma::Options::default());
        let is_old = (own.error, own.one_in) != (usual.error, usual.one_in);
        if is_old { self.secondary.with(Method::Auto, Method::Sift) } else { self.secondary }
    }

    /// Settings that were chosen and have no effect, a line each: what they belong to is not on.
    pub fn without_effect(&self) -> Vec<String> {
        let effects = self.effects;
        let chosen = self.methods();
        let by_maps = |method| matches!(method, Method::Roma | Method::Sift);
        let maps = chosen.has(Method::Roma) || chosen.has(Method::Sift);
        let fields = chosen.list().iter().any(|(_, method)| method.name() == "df");
        let lit = self.environment.is_some();
        let needs: [(&str, bool, &str); 28] = [
            ("ao_rays", effects.ao, "--effects ao"),
            ("ao_length", effects.ao, "--effects ao"),
            ("diffuse_rays", effects.diffuse, "--effects diffuse"),
            ("bounces", effects.diffuse || effects.glossy, "--effects diffuse or glossy"),
            ("rotation", effects.ao || effects.diffuse, "--effects ao or diffuse"),
            ("environment_rotation", lit, "--environment"),
            ("environment_intensity", lit, "--environment"),
            ("rect_light_intensity", self.rect_light.is_some(), "--rect-light"),
            ("video_fps", self.video.is_some(), "--video"),
            ("reference", !self.checkpoints.is_empty(), "--checkpoints"),
            ("lod_correct", self.lod > 0.0, "--lod above 0"),
            ("lod_blend", self.lod > 0.0, "--lod above 0"),
            ("progressive", self.samples() > BATCH_SAMPLES, "--spp above 64"),
            ("error", chosen.has(Method::Auto), "--secondary auto"),
            ("rates", chosen.has(Method::Auto), "--secondary auto"),
            ("roma.bom", maps || fields, "--secondary roma, sift or df"),
            ("roma.k", by_maps(chosen.ao), "--secondary ao=roma or ao=sift"),
            ("roma.shadow_k", by_maps(chosen.shadow), "--secondary shadow=roma or shadow=sift"),
            ("roma.diffuse_k", by_maps(chosen.diffuse), "--secondary diffuse=roma"),
            ("roma.one_in", chosen.ao == Method::Sift, "--secondary ao=sift"),
            ("roma.error", chosen.has(Method::Sift), "--secondary sift"),
            ("roma.", maps, "--secondary roma or sift"),
            ("rsm.", chosen.diffuse == Method::Roma, "--secondary diffuse=roma"),
            ("df.", fields, "--secondary df"),
            ("dvf.renew", chosen.has(Method::Dvf) && self.motion.is_some(), "--secondary dvf and --motion"),
            ("dvf.", chosen.has(Method::Dvf), "--secondary dvf"),
            ("displacement.", chosen.has(Method::Displacement), "--secondary displacement"),
            ("fronts", matches!(self.schedule, Schedule::Chc | Schedule::Auto), "--schedule chc"),
        ];
        let idle = |entry: Entry| {
            let key = entry.key();
            let is_of = |name: &str| key == name || (name.ends_with('.') && key.starts_with(name));
            let &(_, has_effect, belongs) = needs.iter().find(|(name, ..)| is_of(name))?;
            let flag = entry.field.flag();
            (!has_effect).then(|| format!("--{flag} has no effect without {belongs}"))
        };
        self.chosen().into_iter().filter_map(idle).chain(self.idle_methods()).collect()
    }

    /// Says that no effect that is on has a method of those chosen.
    fn idle_methods(&self) -> Option<String> {
        let chosen = self.methods();
        let EffectMethods { ao, diffuse, shadow, .. } = chosen;
        let effects = self.effects;
        let is_on = [(ao, effects.ao && !effects.environment), (diffuse, effects.diffuse), (shadow, effects.shadow)];
        let is_idle = chosen.has_maps() && is_on.iter().all(|(method, on)| !on || *method == Method::Exact);
        let list = chosen.list().into_iter().filter(|(_, method)| *method != Method::Exact);
        let of: Vec<&str> = list.map(|(effect, _)| effect).collect();
        let hint = match effects.shadow {
            true => format!("; shadows are traced unless --secondary shadow={} asks", Method::Roma),
            false => String::new(),
        };
        let of = of.join(" or ");
        is_idle.then(|| format!("--secondary {chosen} has no effect without --effects {of}{hint}"))
    }

    /// The first option of those chosen that needs the whole picture at once: what it keeps, bounds or shows is that of
    /// all pixels, so that pictures are not rendered in bands.
    pub fn needs_whole_pictures(&self) -> Option<&'static str> {
        let needs = [
            (self.secondary != EffectMethods::EXACT, "--secondary"),
            (self.has_fronts(), "--fronts on"),
            (self.frame_budget().is_some(), "--frame-budget"),
            (!self.checkpoints.is_empty(), "--checkpoints"),
            (self.progressive, "--progressive"),
            (self.measure_error, "--measure-error"),
        ];
        needs.into_iter().find(|(is_on, _)| *is_on).map(|(_, option)| option)
    }

    /// Whether nodes are left out.
    pub fn hides(&self) -> bool {
        !self.hide.is_empty() || !self.only.is_empty()
    }

    /// What a frame may load.
    pub fn frame_budget(&self) -> Option<FrameBudget> {
        self.frame_budget.or(self.interactive.map(FrameBudget::Bytes))
    }

    /// Whether `chc` keeps query pairs from frame to frame.
    pub fn has_fronts(&self) -> bool {
        #[cfg(feature = "lab")]
        return self.fronts;
        #[cfg(not(feature = "lab"))]
        false
    }

    /// Which optimisations are on.
    pub fn optimisations(&self) -> Optimisations {
        let mut on = Optimisations::default();
        self.without.iter().for_each(|&which| on.set(which, false));
        on
    }

    /// Samples of a pixel: as many as were chosen, and as checkpoints need.
    pub fn samples(&self) -> u32 {
        self.checkpoints.iter().copied().fold(self.spp, u32::max)
    }

    /// Threads that read bricks, at least 1.
    pub fn worker_count(&self) -> usize {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        self.workers.map_or(cores.min(4), |n| n as usize)
    }

    /// The sun's brightness: what was chosen, or what suits the environment.
    pub fn sun_intensity(&self) -> f64 {
        let has_image = matches!(self.environment, Some(Environment::File(_)));
        self.sun_intensity.unwrap_or(if has_image { 0.0 } else { 2.4 })
    }

    /// What `--quality exact` stands for: a sample a pixel of the camera's and the sun's rays, shown as it is.
    pub fn exact() -> Self {
        let mut settings = Self::default();
        // What a preset sets are values, as a test shows.
        let _ = settings.set("quality", Quality::Exact.name());
        settings
    }

    /// Settings from options of the command line, words separated by spaces: what [`Group::options`] writes.
    ///
    /// # Errors
    /// There is no such option, or its value is none of the setting.
    pub fn from_options(text: &str) -> Result<Self, SettingsError> {
        let mut settings = Self::default();
        settings.set_options(text)?;
        Ok(settings)
    }

    /// Settings from the text of a settings file.
    ///
    /// # Errors
    /// It is no TOML; an unknown key; a value that is none of the setting.
    pub fn from_toml(text: &str) -> Result<Self, SettingsError> {
        let mut settings = Self::default();
        read_toml(&mut settings, text)?;
        Ok(settings)
    }

    /// The settings as a settings file, which [`Self::from_toml`] reads.
    pub fn to_toml(&self) -> String {
        to_toml(self)
    }

    /// What is not as it is by default, as a settings file: one that builds without the laboratory read as well.
    pub fn to_given_toml(&self) -> String {
        given_toml(self)
    }

    /// What does not count for `trace`, though it is not as it is by default.
    pub fn for_frames_alone(&self) -> Option<Entry> {
        self.chosen().into_iter().find(|entry| !TRACE.contains(&entry.key().as_str()))
    }
}

/// The settings that count where rays are given.
pub const TRACE: [&str; 13] = [
    "cache",
    "host_cache",
    "schedule",
    "tile",
    "workers",
    "evict",
    "requests_out",
    "count",
    "adapter",
    "opaque",
    "lod",
    "hide",
    "only",
];
