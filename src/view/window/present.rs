//! How a frame of the window gets onto the screen.

use super::raster::{Canvas, Painter};
use super::surface::Surface;
use crate::view::studio::Shown;
use anyhow::{Context, Result, anyhow, bail};
use egui::epaint::ClippedPrimitive;
use egui::epaint::textures::TexturesDelta;
use egui::{Pos2, Rect};
use std::num::NonZeroU32;
use std::sync::Arc;
use tracing::info;
use winit::event_loop::OwnedDisplayHandle;
use winit::window::Window;

/// The ground behind everything.
pub const GROUND: [u8; 3] = [27, 27, 27];

/// What a frame of the window consists of.
pub struct Content<'a> {
    /// Width and height of the window in pixels, at least 1.
    pub size: (u32, u32),
    /// The picture, and where it goes, in points.
    pub picture: Option<(&'a Shown, Rect)>,
    /// The panels.
    pub panels: &'a [ClippedPrimitive],
    /// Textures that are new or gone.
    pub textures: &'a mut TexturesDelta,
    /// Pixels of a point.
    pub pixels_per_point: f32,
}

/// Chooses who brings frames onto the screen: `gpu` or `soft`. Without it a GPU does, if it is one.
pub const VARIABLE: &str = "BRICKWALK_PRESENT";

/// What brings the frames of `window` onto the screen.
///
/// # Errors
/// Nothing does, or what was asked for by name does not.
pub fn presenter(display: OwnedDisplayHandle, window: &Arc<Window>) -> Result<Box<dyn Presenter>> {
    let soft = |display| -> Result<Box<dyn Presenter>> { Ok(Box::new(Soft::new(display, window.clone())?)) };
    match std::env::var(VARIABLE).as_deref() {
        Ok("soft") => soft(display),
        Ok("gpu") => Ok(Box::new(Surface::new(display, window.clone(), true)?)),
        Ok(other) if !other.is_empty() => bail!("{VARIABLE}={other}: it must be gpu or soft"),
        _ => match Surface::new(display.clone(), window.clone(), false) {
            Ok(surface) => Ok(Box::new(surface)),
            Err(error) => {
                info!("window: drawn by the processor: {error:#}");
                soft(display)
            }
        },
    }
}

/// Brings frames onto the screen.
pub trait Presenter {
    /// Shows a frame.
    ///
    /// # Errors
    /// The display's, or the device's.
    fn present(&mut self, content: Content) -> Result<()>;
}

/// Draws a frame on `canvas`.
pub fn draw(painter: &mut Painter, canvas: &mut Canvas, content: Content) {
    let Content { picture, panels, textures, pixels_per_point, .. } = content;
    painter.update(textures);
    canvas.clear(GROUND);
    if let Some((shown, rect)) = picture {
        let of = |at: Pos2| [at.x, at.y].map(|x| (x * pixels_per_point).round().max(0.0) as usize);
        canvas.picture(of(rect.min), of(rect.max), shown.size, &shown.pixels);
    }
    painter.paint(canvas, panels, pixels_per_point);
    painter.free(textures);
}

/// On the processor, into the window's own memory: works wherever there is a window.
pub struct Soft {
    surface: softbuffer::Surface<OwnedDisplayHandle, Arc<Window>>,
    painter: Painter,
}

impl Soft {
    /// Into `window`.
    ///
    /// # Errors
    /// The display's.
    pub fn new(display: OwnedDisplayHandle, window: Arc<Window>) -> Result<Self> {
        let context = softbuffer::Context::new(display).map_err(display_error)?;
        let surface = softbuffer::Surface::new(&context, window).map_err(display_error)?;
        Ok(Self { surface, painter: Painter::default() })
    }
}

fn display_error(error: softbuffer::SoftBufferError) -> anyhow::Error {
    anyhow!("the display: {error}")
}

impl Presenter for Soft {
    fn present(&mut self, content: Content) -> Result<()> {
        let (width, height) = content.size;
        let size = NonZeroU32::new(width).zip(NonZeroU32::new(height)).context("the window has no size")?;
        self.surface.resize(size.0, size.1).map_err(display_error)?;
        let mut buffer = self.surface.buffer_mut().map_err(display_error)?;
        let mut canvas = Canvas { width: width as usize, height: height as usize, pixels: &mut buffer };
        draw(&mut self.painter, &mut canvas, content);
        buffer.present().map_err(display_error)
    }
}
