//! Pictures of many samples, kept on disk and not made twice.

use super::Options;
use brickwalk::Settings;
use brickwalk::frame::Renderer;
use brickwalk::output::atomic;
use brickwalk::scene::Camera;
use brickwalk::session::opened::{Opened, open_scene};
use brickwalk::session::renderer;
use brickwalk::settings::{Adapter, CacheSize, Group, ImageSize, Schedule};
use std::io::Write;
use std::path::{Path, PathBuf};

/// A picture: linear radiance by rows.
pub type Picture = Vec<[f32; 3]>;

/// Seeds of the two halves of a picture's samples.
const SEEDS: [u32; 2] = [101, 202];

/// Renders the scene with the options of `walk` in `words`.
pub fn renderer(options: &Options, words: &str) -> Renderer {
    let (width, height) = options.size();
    let mut settings = Settings {
        size: ImageSize { width, height },
        tile: 32,
        cache: CacheSize::Percent(100.0),
        schedule: Schedule::Plain,
        adapter: Adapter::Cpu,
        ..Settings::exact()
    };
    settings.set_options(words).expect("options of walk");
    let scene = open_scene(&options.scene).expect("the scene");
    let engine = Opened::open(scene, &options.scene, &settings).expect("a session");
    renderer::renderer(engine, &options.scene, &settings).expect("lamps")
}

/// The pictures of one setting.
pub struct References {
    renderer: Renderer,
    folder: PathBuf,
}

impl References {
    /// Of the light that `words` say, in a folder of their own.
    pub fn new(options: &Options, words: &str) -> Self {
        let (half, rays) = (options.spp / 2, options.reference_rays);
        let words = format!("{words} --spp {half} --diffuse-rays {rays}");
        let mut renderer = renderer(options, &words);
        // Every sample has directions of its own: those of the sequence alone go with the place in the pixel.
        renderer.settings.guides = true;
        let path = std::fs::read_to_string(&options.path).expect("the path");
        let camera = format!("{path}{} {}", options.start, options.fps);
        let scene = std::fs::metadata(&options.scene).expect("the scene").len();
        let text = format!("{words} --size {}\nscene of {scene} bytes\n{camera}\n", options.size);
        let name = format!("{:016x}", xxhash_rust::xxh3::xxh3_64(text.as_bytes()));
        let folder = options.references.join(name);
        atomic::create_folder(&folder).expect("a folder");
        atomic::write(&folder.join("settings.txt"), text.as_bytes()).expect("the settings");
        Self { renderer, folder }
    }

    /// Both halves of the samples of frame `frame`, rendered where they are not on disk.
    pub fn halves(&mut self, frame: u32, camera: &Camera) -> [Picture; 2] {
        [0, 1].map(|half| {
            let file = self.folder.join(format!("{frame:04}-{half}.f32"));
            read(&file).unwrap_or_else(|| {
                let begin = std::time::Instant::now();
                self.renderer.settings.seed = SEEDS[half];
                let picture = self.renderer.frame(frame, camera).expect("a frame").pixels.radiance;
                atomic::write(&file, bytemuck::cast_slice(&picture)).expect("the picture");
                let _ = writeln!(std::io::stderr(), "{}: {:.0} s", file.display(), begin.elapsed().as_secs_f64());
                picture
            })
        })
    }

    /// Frame `frame` by all its samples.
    pub fn picture(&mut self, frame: u32, camera: &Camera) -> Picture {
        let [a, b] = self.halves(frame, camera);
        mean(&a, &b)
    }
}

/// The mean of two pictures.
pub fn mean(a: &[[f32; 3]], b: &[[f32; 3]]) -> Picture {
    a.iter().zip(b).map(|(a, b)| [0, 1, 2].map(|k| 0.5 * (a[k] + b[k]))).collect()
}

fn read(file: &Path) -> Option<Picture> {
    let bytes = std::fs::read(file).ok()?;
    Some(bytemuck::pod_collect_to_vec(&bytes))
}
