//! What a window feels like: a minute of flying through a scene, by the thread that renders for it.
//!
//!     cargo bench --bench window -- S.bricks [PATH.json] [OPTIONS]
//!
//! Wishes come 60 times a second, as from keys that are held. Told are the time from opening to the first picture, the
//! times of pictures and from a wish to its picture, bytes a picture, and how long a camera at rest takes to be exact.
//! OPTIONS are those of `walk`; by default `--size 640x360 --cache 5%`.

use brickwalk::Settings;
use brickwalk::scene::CameraPath;
use brickwalk::settings::Group as _;
use brickwalk::view::studio::{Ask, Converter, News, Overlay, Pace, Shown, Stage, Studio, Wish};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How long the flight is.
const FLIGHT: Duration = Duration::from_secs(60);
/// From one wish to the next.
const EVERY: Duration = Duration::from_micros(16_667);

/// The `share` quantile of values.
fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(((values.len() - 1) as f64 * share) as usize).copied().unwrap_or(f64::NAN)
}

fn main() -> anyhow::Result<()> {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let Some(scene) = words.first().cloned() else {
        println!("give a scene: cargo bench --bench window -- S.bricks [PATH.json] [OPTIONS]");
        return Ok(());
    };
    let path = words.get(1).filter(|word| word.ends_with(".json")).cloned();
    let options = words[1 + usize::from(path.is_some())..].join(" ");
    let mut settings = Settings::from_options("--size 640x360 --cache 5%")?;
    settings.set_options(&options)?;
    let converter: Converter = Arc::new(|path, _| Ok(path.into()));
    let start = Instant::now();
    let studio = Studio::start(&settings, Pace::default(), converter, Arc::new(|| ()))?;
    studio.ask(Ask::Open(scene.into()));
    let opened = loop {
        match studio.news() {
            Some(News::Opened(opened)) => break opened,
            Some(News::Failed(text)) => anyhow::bail!(text),
            _ => std::thread::sleep(Duration::from_millis(1)),
        }
    };
    let path = path.map_or(Ok(opened.way.clone()), |file| CameraPath::read(Path::new(&file)))?;
    let wish = |camera| Wish { camera, settings: settings.clone(), overlay: Overlay::None };
    studio.wish(wish(path.frame(0, 2)));
    let next = || -> anyhow::Result<Option<Arc<Shown>>> {
        match studio.news() {
            Some(News::Shown(shown)) => Ok(Some(shown)),
            Some(News::Failed(text)) => anyhow::bail!(text),
            Some(_) => Ok(None),
            None => {
                std::thread::sleep(Duration::from_micros(200));
                Ok(None)
            }
        }
    };
    while next()?.is_none() {}
    println!("first picture after {:.0} ms", start.elapsed().as_secs_f64() * 1e3);
    let mut sent = Vec::new();
    let (mut ms, mut waits, mut gaps, mut bytes, mut exact, mut pixels) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let (start, mut last) = (Instant::now(), Instant::now());
    let steps = (FLIGHT.as_secs_f64() / EVERY.as_secs_f64()) as u32;
    let mut step = 0;
    while start.elapsed() < FLIGHT {
        if start.elapsed() >= EVERY * step {
            let camera = path.frame(step, steps);
            sent.push((camera, Instant::now()));
            studio.wish(wish(camera));
            step += 1;
        }
        let Some(shown) = next()? else { continue };
        let Some((_, when)) = sent.iter().rev().find(|(camera, _)| *camera == shown.camera) else { continue };
        waits.push(when.elapsed().as_secs_f64() * 1e3);
        gaps.push(last.elapsed().as_secs_f64() * 1e3);
        last = Instant::now();
        ms.push(shown.ms);
        bytes.push(shown.loaded_bytes() as f64);
        let all: u64 = shown.states.iter().sum();
        exact.push(shown.states[0] as f64 / all as f64 * 100.0);
        pixels.push(f64::from(shown.size.0));
    }
    println!("{} pictures in {:.0} s", ms.len(), start.elapsed().as_secs_f64());
    println!("| moving | p5 | p50 | p95 | most |\n| --- | --- | --- | --- | --- |");
    for (name, values) in [
        ("ms a picture", &mut ms),
        ("ms from one to the next", &mut gaps),
        ("ms from input to picture", &mut waits),
        ("bytes loaded", &mut bytes),
        ("exact pixels, %", &mut exact),
        ("width, pixels", &mut pixels),
    ] {
        let [a, b, c, d] = [0.05, 0.5, 0.95, 1.0].map(|share| quantile(values, share));
        println!("| {name} | {a:.1} | {b:.1} | {c:.1} | {d:.1} |");
    }
    let rest = Instant::now();
    let camera = path.frame(0, 2);
    studio.wish(wish(camera));
    let mut all_exact = None;
    loop {
        let Some(shown) = next()? else { continue };
        if shown.camera != camera {
            continue;
        }
        let is_full = (shown.size.0, shown.size.1) == (settings.size.width, settings.size.height);
        if shown.is_exact() && is_full && all_exact.is_none() {
            all_exact = Some(rest.elapsed().as_secs_f64());
        }
        if shown.stage == Stage::Done {
            break;
        }
    }
    let done = rest.elapsed().as_secs_f64();
    println!(
        "at rest: all pixels exact after {:.2} s, {} samples after {done:.2} s",
        all_exact.unwrap_or(done),
        settings.spp
    );
    Ok(())
}
