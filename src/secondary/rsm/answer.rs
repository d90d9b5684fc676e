//! Diffuse rays that occupancy maps answer, and the reflective shadow maps that light what they meet: which maps, and
//! when they are made.

use super::LampViews;
use super::maps::{LampView, RsmMaps};
use crate::frame::Renderer;
use crate::frame::pass_record::FrameRecords;
use crate::frame::render::{RenderError, Schedule};
use crate::kernels::frame::Frame;
use crate::kernels::lamps::Emitter;
use crate::kernels::layout::{NONE, Params, Ray, RsmMap};
use crate::kernels::{Directions, View};
use crate::schedule::{ExecutorError, Lamp, Pass, PassStats, RomaPart, Shading, Step, attributes, chc, demand, plain};
use crate::secondary::roma::RomaPass;
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
    texels: u32,
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
                "texels": self.texels,
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

impl Renderer {
    /// Makes the reflective shadow maps of the frame that `view` has begun, those that are not there yet.
    ///
    /// # Errors
    /// A brick that cannot be read, or the device's.
    pub(crate) fn prepare_rsm(&mut self, records: &mut FrameRecords, view: &View) -> Result<(), RenderError> {
        let Some((settings, diffuse)) = self.settings.roma.and_then(|roma| Some((roma.rsm, roma.diffuse?))) else {
            return Ok(());
        };
        let cascades = self.roma.assemble(&self.scene, diffuse.grid.size, diffuse.grid.base_cells())?;
        let manifest = &self.scene.resident().manifest;
        let bounds = [manifest.min, manifest.max].map(DVec3::from_array);
        let light = &self.light;
        let sun = light.sun_color.iter().any(|&c| c > 0.0).then_some(light.sun_direction);
        let views = LampViews::new(&settings, cascades, bounds, sun, &light.lamps);
        let maps = RsmMaps::new(&views.views, &view.frame);
        let resident = self.scene.resident();
        let place = |(lamp, map): (&LampView, &RsmMap)| Made {
            view: *lamp,
            first: map.first,
            frame: lamp_frame(resident, lamp),
            light: light.lamps.emitters().get(lamp.lamp as usize).copied().map_or(Ok(light.sun_color), Err),
        };
        let wanted: Vec<Made> = views.views.iter().zip(&maps.maps).map(place).collect();
        if self.rsm.texels != maps.texels {
            // The executor keeps texels only while there are as many.
            self.rsm.made.clear();
        }
        self.rsm.made.resize(wanted.len(), None);
        (self.rsm.views, self.rsm.texels) = (views, maps.texels);
        self.executor.set_rsm(&maps)?;
        let missing: Vec<usize> =
            (0..wanted.len()).filter(|&i| self.rsm.made[i].as_ref() != Some(&wanted[i])).collect();
        if missing.is_empty() {
            return Ok(());
        }
        let frame = records.frame();
        records.pass(self, EFFECT, |r, stats| {
            for index in missing {
                r.rsm.made[index] = None;
                r.make_rsm(frame, index as u32, &wanted[index].view, stats)?;
                r.rsm.made[index] = Some(wanted[index].clone());
                r.rsm.count += 1;
            }
            r.executor.begin_frame(view);
            Ok(())
        })?;
        Ok(())
    }

    /// Makes one map in frame `number`, block by block of the size of the picture.
    fn make_rsm(&mut self, number: u32, map: u32, lamp: &LampView, stats: &mut PassStats) -> Result<(), ExecutorError> {
        let frame = lamp_frame(self.scene.resident(), lamp);
        self.executor.begin_frame(&self.lamp_view(lamp, frame));
        let (width, height) = self.size;
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
                self.executor.set_rays(Pass::Primary, &rays);
                // No brick is done with for these rays.
                self.cache.begin_pass(EFFECT, number);
                self.trace_given(stats)?;
                attributes::resolve(&mut *self.executor, &mut self.cache, Pass::Primary, stats)?;
                let write = Step::RsmWrite { map, corner: [x, y] };
                stats.add(self.executor.run(Pass::Shadow(Lamp::Sun), &[write], &self.cache.states)?);
            }
        }
        Ok(())
    }

    /// What the device gets to know of a lamp's picture: as of a camera's, with texels for pixels.
    fn lamp_view(&self, lamp: &LampView, frame: Frame) -> View {
        // A texel's width a unit of depth: of distant lights by a point far before the rays.
        let (point, angle) = if lamp.is_perspective {
            (lamp.corner, lamp.x.length())
        } else {
            let manifest = &self.scene.resident().manifest;
            let diagonal = (DVec3::from_array(manifest.max) - DVec3::from_array(manifest.min)).length();
            let far = FAR * diagonal.max(lamp.x.length());
            (lamp.corner - far * lamp.axis, lamp.x.length() / far)
        };
        let [x, y, z] = frame.point(point);
        let [r, g, b] = self.light.sun_color;
        let params = Params {
            origin: [x, y, z, 0.0],
            step_y: [0.0, 0.0, 0.0, angle as f32],
            sun: self.light.sun_direction.as_vec3().extend(0.0).to_array(),
            sun_color: [r, g, b, 0.0],
            emitter_count: self.light.lamps.emitters().len() as u32,
            seed: self.settings.seed,
            ..Params::default()
        };
        View { frame, params, directions: Directions::default() }
    }

    /// Traces rays that were given, which have nothing in common with the frame before.
    fn trace_given(&mut self, stats: &mut PassStats) -> Result<(), ExecutorError> {
        let trace = match self.settings.schedule {
            Schedule::Chc => chc::trace,
            Schedule::Demand | Schedule::Auto => demand::trace,
            Schedule::Plain => plain::trace,
            Schedule::PlainBinary => plain::trace_binary,
        };
        let (executor, cache) = (&mut *self.executor, &mut self.cache);
        trace(executor, cache, Pass::Primary, &[Step::StartHits], &self.settings.tracing, stats)
    }

    /// Diffuse rays in direction `index` around primary hits by occupancy maps: what misses shows the background, as
    /// exact ones do, and what is met shows what it reflects of the lamps that have maps. Counts for the first of
    /// `names`, but the light of lamps for the second, as exact rays to them do.
    pub(crate) fn gather(
        &mut self,
        records: &mut FrameRecords,
        names: [&'static str; 3],
        index: u32,
        roma: RomaPass,
    ) -> Result<(), ExecutorError> {
        records.pass(self, names[0], |r, stats| {
            let rotate = r.roma.prepare(&mut *r.executor, &r.scene, roma, f64::INFINITY)?;
            let pass = Pass::Diffuse(index);
            let trace = Step::RomaTrace { steps: roma.steps, part: RomaPart::answering(pass, roma.steps, true) };
            let steps: Vec<Step> = std::iter::once(Step::Generate).chain(rotate).chain([trace]).collect();
            stats.add(r.executor.run(pass, &steps, &r.cache.states)?);
            let shading = Shading { miss: true, environment: r.draws_environment(), ..Shading::default() };
            r.shade(Pass::BounceShadow(Lamp::Sun), shading, stats)
        })?;
        records.pass(self, names[1], |r, stats| {
            stats.add(r.executor.run(Pass::BounceShadow(Lamp::Sun), &[Step::RsmLight], &r.cache.states)?);
            Ok(())
        })
    }
}
