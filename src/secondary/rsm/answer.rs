//! Diffuse rays that occupancy maps answer, and the reflective shadow maps that light what they meet: which maps, and
//! when they are made.

use super::maps::{LampView, RsmMaps};
use super::{LampViews, RsmSettings};
use crate::counters::Counters;
use crate::frame::{Engine, FrameRecords};
use crate::kernels::frame::Frame;
use crate::kernels::lamps::Emitter;
use crate::kernels::layout::{NONE, Params, Ray, RsmMap};
use crate::kernels::{Directions, View};
use crate::schedule::{self, ExecutorError, Lamp, Pass, Step, attributes};
use crate::secondary::occupancy::Cascades;
use bricks::Resident;
use glam::DVec3;
use serde_json::{Value, json};

/// The pass of the rays that lamps send.
pub const EFFECT: &str = "rsm";

/// How far before its rays a map of a distant light is said to be seen from, in its depth: so that texels' cones are
/// about as wide everywhere.
const FAR: f64 = 4096.0;

/// What a map was made of.
#[derive(Clone, Debug, PartialEq)]
struct Made {
    view: LampView,
    first: u32,
    /// What its rays are relative to.
    frame: Frame,
    /// Of the sun, or of the emitter.
    light: Result<[f32; 3], Emitter>,
}

/// The reflective shadow maps of the present frame.
#[derive(Default)]
pub struct Rsm {
    views: LampViews,
    /// What the executor has, map by map.
    made: Vec<Option<Made>>,
    /// How they lie.
    maps: RsmMaps,
    /// Maps that were made, frame by frame summed.
    count: u64,
}

impl Rsm {
    /// What summaries say; `None` where there are no maps.
    pub fn report(&self) -> Option<Value> {
        let LampViews { views, lamps, left_out, areas } = &self.views;
        let distant = views.iter().filter(|view| view.lamp == NONE).map(|view| view.x.length()).collect::<Vec<_>>();
        (!self.made.is_empty() || *left_out + *areas > 0).then(|| {
            json!({
                "maps": views.len(),
                "texels": self.maps.texels,
                "sun_texel": distant,
                "lamps": lamps,
                "lamps_left_out": left_out,
                "areas_left_out": areas,
                "maps_made": self.count,
            })
        })
    }

    /// Notes that instances have left and entered boxes: maps that see any of them are made anew.
    pub fn scene_has_moved(&mut self, boxes: &[[DVec3; 2]]) {
        let sees = |made: &Made| boxes.iter().any(|&[min, max]| made.view.meets(min, max));
        for made in &mut self.made {
            made.take_if(|made| sees(made));
        }
    }

    /// Emitters whose light diffuse rays do not see: points, spots and distant lights without a map, and areas.
    pub fn left_out(&self) -> [u32; 2] {
        [self.views.left_out, self.views.areas]
    }
}

/// The frame in which a map is made: its own, so that it does not depend on the camera's.
fn lamp_frame(resident: &Resident, lamp: &LampView) -> Frame {
    let middle = if lamp.is_perspective {
        lamp.corner
    } else {
        lamp.corner + 0.5 * (f64::from(lamp.width) * lamp.x + f64::from(lamp.height) * lamp.y)
    };
    Frame::near(resident, middle)
}

impl Rsm {
    /// Makes the maps of the frame that `view` has begun for what `cascades` cover, those that are not there yet.
    ///
    /// # Errors
    /// A brick that cannot be read, or the device's.
    pub fn prepare(
        &mut self,
        engine: &mut Engine,
        records: &mut FrameRecords,
        view: &View,
        settings: &RsmSettings,
        cascades: &Cascades,
    ) -> Result<(), ExecutorError> {
        let manifest = &engine.scene.resident().manifest;
        let bounds = [manifest.min, manifest.max].map(DVec3::from_array);
        let light = &engine.light;
        let sun = light.sun_color.iter().any(|&c| c > 0.0).then_some(light.sun_direction);
        let views = LampViews::new(settings, cascades, bounds, sun, &light.lamps);
        let maps = RsmMaps::new(&views.views, &view.frame);
        let resident = engine.scene.resident();
        let place = |(lamp, map): (&LampView, &RsmMap)| Made {
            view: *lamp,
            first: map.first,
            frame: lamp_frame(resident, lamp),
            light: light.lamps.emitters().get(lamp.lamp as usize).copied().map_or(Ok(light.sun_color), Err),
        };
        let wanted: Vec<Made> = views.views.iter().zip(&maps.maps).map(place).collect();
        if self.maps.texels != maps.texels {
            // The executor keeps texels only while there are as many.
            self.made.clear();
        }
        self.made.resize(wanted.len(), None);
        (self.views, self.maps) = (views, maps);
        self.maps.give(&mut *engine.executor)?;
        let missing: Vec<usize> = (0..wanted.len()).filter(|&i| self.made[i].as_ref() != Some(&wanted[i])).collect();
        if missing.is_empty() {
            return Ok(());
        }
        let frame = records.frame();
        records.work(engine, EFFECT, |engine, stats| {
            for index in missing {
                self.made[index] = None;
                make(engine, &self.maps, frame, index as u32, &wanted[index].view, stats)?;
                self.made[index] = Some(wanted[index].clone());
                self.count += 1;
            }
            engine.executor.begin_frame(view);
            Ok(())
        })
    }

    /// Lights what diffuse rays met.
    pub fn light(&self) -> Vec<Step> {
        vec![self.maps.light()]
    }
}

/// Makes one map in frame `number`, block by block of the size of the picture.
fn make(
    engine: &mut Engine,
    maps: &RsmMaps,
    number: u32,
    map: u32,
    lamp: &LampView,
    stats: &mut Counters,
) -> Result<(), ExecutorError> {
    let frame = lamp_frame(engine.scene.resident(), lamp);
    engine.executor.begin_frame(&lamp_view(engine, lamp, frame));
    let (width, height) = engine.size;
    for y in (0..lamp.height).step_by(height as usize) {
        for x in (0..lamp.width).step_by(width as usize) {
            let ray = |i: u32| {
                let (column, row) = (x + i % width, y + i / width);
                let ray = lamp.ray(&frame, column, row);
                let is_inside = column < lamp.width && row < lamp.height;
                if is_inside { ray } else { Ray { t_min: 1.0, t_max: 0.0, ..ray } }
            };
            let rows = height.min(lamp.height - y);
            let rays: Vec<Ray> = (0..width * rows).map(ray).collect();
            engine.executor.set_rays(Pass::Primary, &rays);
            // No brick is done with for these rays.
            engine.cache.begin_pass(EFFECT, number);
            trace_given(engine, stats)?;
            attributes::resolve(&mut *engine.executor, &mut engine.cache, Pass::Primary, stats)?;
            let write = maps.write(map, [x, y]);
            stats.add(engine.executor.run(Pass::Shadow(Lamp::Sun), &[write], &engine.cache.states)?);
        }
    }
    Ok(())
}

/// What the device gets to know of a lamp's picture: as of a camera's, with texels for pixels.
fn lamp_view(engine: &Engine, lamp: &LampView, frame: Frame) -> View {
    // A texel's width a unit of depth: of distant lights by a point far before the rays.
    let (point, angle) = if lamp.is_perspective {
        (lamp.corner, lamp.x.length())
    } else {
        let manifest = &engine.scene.resident().manifest;
        let diagonal = (DVec3::from_array(manifest.max) - DVec3::from_array(manifest.min)).length();
        let far = FAR * diagonal.max(lamp.x.length());
        (lamp.corner - far * lamp.axis, lamp.x.length() / far)
    };
    let [x, y, z] = frame.point(point);
    let [r, g, b] = engine.light.sun_color;
    let params = Params {
        origin: [x, y, z, 0.0],
        step_y: [0.0, 0.0, 0.0, angle as f32],
        sun: engine.light.sun_direction.as_vec3().extend(0.0).to_array(),
        sun_color: [r, g, b, 0.0],
        emitter_count: engine.light.lamps.emitters().len() as u32,
        seed: engine.settings.seed,
        ..Params::default()
    };
    View { frame, params, directions: Directions::default(), rays: None }
}

/// Traces rays that were given, which have nothing in common with the frame before.
fn trace_given(engine: &mut Engine, stats: &mut Counters) -> Result<(), ExecutorError> {
    let by = engine.settings.schedule;
    schedule::trace(&mut engine.tracer(Pass::Primary, &[], stats), by, &[Step::StartHits])
}
