//! Pictures: settings by their names in settings files, a camera, and what pixels show.

use crate::errors::{exception, wrong};
use crate::held::{Held, Options, lock};
use crate::worker::{Desk, Progress, Task};
use anyhow::{Result, anyhow};
use bricks::SceneFile;
use brickwalk::frame::{Accumulation, FrameWatch};
use brickwalk::scene::{Camera, Picture as Shape};
use brickwalk::secondary::Method;
use brickwalk::session::{Frame, Watch, viewpoint};
use brickwalk::{Session, Settings};
use glam::DVec3;
use numpy::{PyArray1, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;

/// Position, target, direction up, and vertical field of view in degrees.
pub type CameraArguments = ([f64; 3], [f64; 3], [f64; 3], f64);

fn camera((position, target, up, fov): CameraArguments) -> PyResult<Camera> {
    let [position, target, up] = [position, target, up].map(DVec3::from_array);
    let camera = Camera { position, target, up, fov_y: fov.to_radians() };
    camera.check().map_err(|error| wrong(format!("camera: {error}")))?;
    Ok(camera)
}

/// Rays through the centres of a picture's pixels: float64 of shape (height, width, 6).
#[pyfunction]
pub fn pinhole<'py>(
    py: Python<'py>,
    arguments: CameraArguments,
    width: u32,
    height: u32,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let camera = camera(arguments)?;
    let basis = camera.ray_basis(width, height);
    let mut rays = Vec::new();
    let numbers = (width as usize).checked_mul(height as usize).and_then(|pixels| pixels.checked_mul(6));
    let numbers = numbers.filter(|&numbers| rays.try_reserve_exact(numbers).is_ok());
    numbers.ok_or_else(|| wrong(format!("a picture of {width} x {height} pixels does not fit in memory")))?;
    for y in 0..height {
        py.check_signals()?;
        for x in 0..width {
            let direction = basis.direction(f64::from(x) + 0.5, f64::from(y) + 0.5);
            rays.extend(camera.position.to_array());
            rays.extend(direction.to_array());
        }
    }
    PyArray1::from_vec(py, rays).reshape([height as usize, width as usize, 6])
}

/// Tells how far a picture is, and stops it when nobody waits for it.
pub struct Watching<'a>(pub &'a Arc<Task>);

impl FrameWatch for Watching<'_> {
    fn passes(&mut self, done: u32, about: u32) -> bool {
        self.0.note(done.into(), about.into());
        !self.0.is_stopped()
    }

    fn samples(&mut self, _finished: u32, _sum: &Accumulation) -> bool {
        !self.0.is_stopped()
    }
}

impl Watch for Watching<'_> {
    fn field(&mut self, rays: u64, about: u64) -> bool {
        self.0.note(rays, about);
        !self.0.is_stopped()
    }
}

/// The view that a scene is shown from where nobody chooses one: the first of a walk's own path.
fn own_view(scene: &SceneFile, settings: &Settings) -> Result<Camera> {
    let aspect = f64::from(settings.size.width) / f64::from(settings.size.height);
    let path = viewpoint::path(scene, Shape { aspect, fov_y_degrees: settings.fov });
    let path = match settings.fov {
        Some(fov) => path.with_fov_y_degrees(fov)?,
        None => path,
    };
    Ok(path.frame(0, 1))
}

/// Pixels, and what a person should know.
struct Picture {
    frame: Frame,
    picture: Vec<[u8; 3]>,
    warnings: Vec<String>,
}

impl Held {
    fn render(&mut self, settings: &Settings, camera: Option<Camera>, task: &Arc<Task>) -> Result<Picture> {
        let session = match self.session.take().filter(|session| !session.needs_opening(settings)) {
            Some(mut session) => {
                let set = session.set(settings);
                let session = self.session.insert(session);
                set?;
                session
            }
            None => self.session.insert(Session::open(&self.options.path, settings)?),
        };
        let camera = camera.map_or_else(|| own_view(&self.scene, settings), Ok)?;
        session.prepare(&mut Watching(task))?;
        let frame = session.picture(&camera, &mut Watching(task))?.ok_or_else(|| anyhow!("interrupted"))?;
        let (picture, warnings, device) = (frame.picture(), session.take_warnings(), session.device());
        let mut done = lock(&self.done);
        done.device = Some(device);
        done.pictures += 1;
        frame.records.iter().for_each(|record| done.rendered.add(&**record));
        Ok(Picture { frame, picture, warnings })
    }
}

/// Renders a picture on the scene's thread.
///
/// # Errors
/// Settings that do not go together, by their names; as of a session.
pub fn render<'py>(
    py: Python<'py>,
    desk: &Desk<Held>,
    options: &Options,
    toml: &str,
    chosen: &[String],
    arguments: Option<CameraArguments>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<(Bound<'py, PyDict>, Vec<String>)> {
    let mut settings = Settings::from_toml(toml).map_err(|error| exception(&error.into()))?;
    if settings.secondary.has(Method::Auto) {
        return Err(wrong("secondary: auto chooses along a walk; name a method for one picture"));
    }
    let is_chosen = |name: &str| chosen.iter().any(|chosen| chosen == name);
    if !is_chosen("cache") {
        settings.cache = options.cache;
    }
    if !is_chosen("adapter") {
        settings.adapter = options.adapter.clone();
    }
    settings.frames = 1;
    settings.aov = !settings.taa;
    if arguments.is_some() && settings.fov.is_some() {
        return Err(wrong("fov: the camera has its own"));
    }
    let camera = arguments.map(camera).transpose()?;
    let work = move |held: &mut Held, task: &Arc<Task>| held.render(&settings, camera, task);
    let Picture { frame, picture, warnings } = desk.run(py, &mut Progress::new(progress, 0), work)?;
    let (width, height) = (frame.size.0 as usize, frame.size.1 as usize);
    let dict = PyDict::new(py);
    let three = |values: Vec<[f32; 3]>| PyArray1::from_vec(py, values.into_flattened()).reshape([height, width, 3]);
    let pixels = frame.pixels;
    dict.set_item("radiance", three(pixels.radiance)?)?;
    if !pixels.depth.is_empty() {
        dict.set_item("depth", PyArray1::from_vec(py, pixels.depth).reshape([height, width])?)?;
        dict.set_item("normal", three(pixels.normal)?)?;
        dict.set_item("triangle", PyArray1::from_vec(py, pixels.id).reshape([height, width])?)?;
        dict.set_item("albedo", three(pixels.albedo)?)?;
    }
    if !pixels.state.is_empty() {
        let state = pixels.state.iter().map(|&state| state as u8).collect();
        dict.set_item("state", PyArray1::from_vec(py, state).reshape([height, width])?)?;
    }
    dict.set_item("picture", PyArray1::from_vec(py, picture.into_flattened()).reshape([height, width, 3])?)?;
    Ok((dict, warnings))
}
