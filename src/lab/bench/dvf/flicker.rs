//! Flicker of scenes in which something moves: what pictures by a field of visibility change from frame to frame that
//! exact rays do not (Günay, Akyüz 2025, section 4.4: an object that moves changes the labels of cells, and with them
//! how their light is found).
//!
//! *Measure.* The camera rests and the rays are the same in every frame. Pixels are looked at that show the same
//! triangle of what rests as the frame before and have the same bits by brute force, which traces all the rays that the
//! mode has: none of those that light them changed its answer. What such a pixel changes by, the greatest over the
//! channels, is flicker ([`flicker()`]). It is compared with noise: the difference of two pictures by brute force of
//! one scene by other rays. A pixel *jumps* where it changes by more than 99 of 100 pixels differ by noise. The paper's
//! mode draws rays otherwise than exact ones are, so it has a brute force of its own.

use super::args::{Measurement, Way};
use super::{Picture, View};
use crate::kernels::layout::NONE;
use crate::lab::bench::store::Values;
use crate::metrics::{Change, Image, PIXELS_PER_DEGREE, flicker, flip_ldr};
use crate::scene::motion::{Motion, Movers};
use crate::secondary::dvf::prepare::renewal;
use crate::secondary::dvf::{Dvf, DvfField, DvfUse, Options, Shape, mask};
use anyhow::{Context, Result};
use bricks::SceneFile;
use glam::DVec3;
use std::ops::Range;
use std::sync::Arc;

/// Frames.
pub const FRAMES: u32 = 16;

/// Time from one to the next, that of camera paths: the Cornell box's mover goes round once in 12 of them.
const STEP: f64 = 0.75;

/// Pictures of a motion by brute force.
pub struct Truth {
    movers: Movers,
    /// The scene as it was opened.
    still: Arc<SceneFile>,
    frames: Vec<Brute>,
    /// Of the first frame's pixels that show something: how two pictures by other rays differ.
    noise: Change,
}

/// A frame.
struct Brute {
    picture: Picture,
    /// Pixels whose rays' answers are those of the frame before.
    unchanged: Vec<bool>,
}

impl Truth {
    /// By the rays of a mode.
    ///
    /// # Errors
    /// The motion cannot be read or does not fit the scene; those of rendering.
    fn of(view: &mut View, how: DvfUse) -> Result<Self> {
        let file = view.place.motion.as_ref().context("nothing moves")?;
        let still = view.renderer.scene.clone();
        let movers = Motion::read(file)?.bind(still.resident())?;
        let ids: Vec<Range<u32>> = movers.at(0.0).iter().map(|(instance, _)| ids(&still, *instance)).collect();
        let mut frames: Vec<Brute> = Vec::new();
        for frame in 0..FRAMES {
            view.renderer.place(&still, &movers.at(time(frame)))?;
            // After what has moved, which it is not to be told.
            view.renderer.methods.set(brute_force(&still, how));
            let picture = view.picture(0)?;
            let is_unchanged = |i: usize, before: &Picture| {
                let (id, bits) = (picture.ids[i], picture.image.rgb[i].map(f32::to_bits));
                let rests = id != NONE && !ids.iter().any(|ids| ids.contains(&id));
                rests && before.ids[i] == id && before.image.rgb[i].map(f32::to_bits) == bits
            };
            let unchanged = frames.last().map_or(Vec::new(), |before| {
                (0..picture.ids.len()).map(|i| is_unchanged(i, &before.picture)).collect()
            });
            frames.push(Brute { picture, unchanged });
        }
        view.renderer.place(&still, &movers.at(0.0))?;
        view.renderer.methods.set(brute_force(&still, how));
        let other = view.picture(1)?.image;
        let first = &frames[0].picture;
        let shown: Vec<bool> = first.ids.iter().map(|&id| id != NONE).collect();
        let black = Image { rgb: vec![[0.0; 3]; other.rgb.len()], ..other };
        let noise = flicker([&black, &black], [&other, &first.image], &shown, 0.0)?;
        Ok(Self { movers, still, frames, noise })
    }
}

/// What has all rays of a mode traced: nothing, or, as the paper adds light, cells that are occluded and have ways out
/// everywhere.
fn brute_force(scene: &SceneFile, how: DvfUse) -> Dvf {
    if !how.paper {
        return Dvf::default();
    }
    let [min, max] = [scene.resident().manifest.min, scene.resident().manifest.max].map(DVec3::from_array);
    let mut field = DvfField::unknown(Shape::new(min, max, 1, 8));
    field.masks.fill(u32::MAX);
    field.labels.fill(mask::OCCLUDED);
    Dvf::new(Arc::new(field), how)
}

/// Ids of the triangles of an instance.
fn ids(scene: &SceneFile, instance: u32) -> Range<u32> {
    let resident = scene.resident();
    let record = &resident.instances[instance as usize];
    record.base..record.base + resident.objects[record.object as usize].triangle_ids
}

/// The time of a frame.
fn time(frame: u32) -> f64 {
    STEP * f64::from(frame)
}

/// The flicker of a field, and which rays are traced.
///
/// # Errors
/// As of [`Truth`], and those of making fields.
pub fn measure(view: &mut View, own: &Measurement) -> Result<Values> {
    let (way, options) = (own.way, &own.options);
    let of_mode = usize::from(options.how().paper);
    let truth = match view.truth[of_mode].take() {
        Some(truth) => truth,
        None => Truth::of(view, options.how())?,
    };
    let values = of_truth(view, options, way, &truth);
    view.renderer.place(&truth.still, &truth.movers.at(0.0))?;
    view.renderer.methods.remove::<Dvf>();
    view.truth[of_mode] = Some(truth);
    values
}

fn of_truth(view: &mut View, options: &Options, way: Way, truth: &Truth) -> Result<Values> {
    let how = options.how();
    let noise = truth.noise.p99;
    let mut values = Values::from([("noise_p99".into(), noise), ("noise_mean".into(), truth.noise.mean)]);
    // Of all frames together.
    let (mut rays, mut traced, mut of_fields, mut cells, mut flip) = (0.0, 0.0, 0.0, 0.0, 0.0);
    let (mut jumps, mut greatest, mut mean) = (0.0f64, 0.0f64, 0.0);
    let mut before: Option<(Picture, &Brute)> = None;
    for (frame, brute) in (0..FRAMES).zip(&truth.frames) {
        view.renderer.place(&truth.still, &truth.movers.at(time(frame)))?;
        if way == Way::Anew || frame == 0 {
            view.renderer.methods.remove::<Dvf>();
            let region = view.region(options)?;
            let (made, _) = view.make(options)?;
            let longest = made.field.shape.size.into_iter().max().unwrap_or(0);
            values.extend([("points".into(), made.points as f64), ("longest".into(), f64::from(longest))]);
            let mut dvf = Dvf::new(Arc::new(made.field), how);
            match way {
                Way::Anew => of_fields += made.record.rays() as f64,
                Way::Renewed => dvf = dvf.renewed_by(renewal(options, Arc::new(made.kept), region)),
                Way::Told => {}
            }
            view.renderer.methods.set(dvf);
        }
        let picture = view.picture(0)?;
        (rays, traced) = (rays + brute.picture.traced, traced + picture.traced);
        (of_fields, cells) = (of_fields + picture.renewal[0], cells + picture.renewal[1]);
        flip += flip_ldr(&picture.image, &brute.picture.image, PIXELS_PER_DEGREE)?.mean();
        if let Some((before, brute_before)) = &before {
            let pictures = [[&before.image, &brute_before.picture.image], [&picture.image, &brute.picture.image]];
            let change = flicker(pictures[0], pictures[1], &brute.unchanged, noise)?;
            (jumps, greatest, mean) = (jumps.max(change.above), greatest.max(change.greatest), mean + change.mean);
            let own = [
                ("pixels", change.pixels as f64),
                ("change_mean", change.mean),
                ("change_p99", change.p99),
                ("change_greatest", change.greatest),
                ("jumps", change.above),
            ];
            values.extend(own.map(|(name, value)| (format!("{name} at {frame}"), value)));
        }
        before = Some((picture, brute));
    }
    values.extend([
        ("rays".into(), rays),
        ("traced".into(), traced),
        ("fewer".into(), rays / traced.max(1.0)),
        ("of_fields".into(), of_fields),
        ("fewer_with_fields".into(), rays / (traced + of_fields).max(1.0)),
        ("cells_renewed".into(), cells),
        ("flip".into(), flip / f64::from(FRAMES)),
        ("jumps".into(), jumps),
        ("greatest_to_noise".into(), greatest / noise.max(f64::MIN_POSITIVE)),
        ("mean_to_noise".into(), mean / f64::from(FRAMES - 1) / truth.noise.mean.max(f64::MIN_POSITIVE)),
    ]);
    Ok(values)
}
