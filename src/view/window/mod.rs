//! The window: events in, frames out. What is in it is the [`Desk`]'s affair, how it gets onto the screen a
//! [`Presenter`]'s.

pub mod desk;
pub mod panels;
pub mod present;
pub mod raster;
pub mod recent;
mod surface;

use super::studio::{Converter, Pace};
use super::viewer::Viewer;
use crate::session::Settings;
use anyhow::{Context, Result, anyhow, bail};
use desk::Desk;
use present::{Content, Presenter, presenter};
use recent::Recent;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::{StartCause, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
use winit::window::{Fullscreen, Window, WindowId};

/// Frames of the window come no sooner after one another: the processor's time is that of pictures.
const LEAST: Duration = Duration::from_millis(15);

/// A window that fails again within this time ends.
const PATIENCE: Duration = Duration::from_secs(5);

/// What the window is opened with.
pub struct Options {
    /// The scene or model that is opened first.
    pub scene: Option<PathBuf>,
    /// Settings; their size is the window's.
    pub settings: Settings,
    /// What time pictures have.
    pub pace: Pace,
    /// Where screenshots and paths go.
    pub folder: PathBuf,
}

/// The studio has news.
#[derive(Clone, Copy, Debug)]
struct News;

/// Opens a window and stays until it is closed.
///
/// # Errors
/// There is no display; the display's.
pub fn run(options: Options, converter: Converter) -> Result<()> {
    let no_display = "there is no display for a window; `brickwalk serve` shows the scene in a browser, \
                      `brickwalk walk` renders without one";
    let events = EventLoop::<News>::with_user_event().build().map_err(|error| anyhow!("{no_display}: {error}"))?;
    let mut app = App { options, converter, proxy: events.create_proxy(), open: None, failure: None };
    events.run_app(&mut app).context("the window")?;
    app.failure.map_or(Ok(()), Err)
}

/// A window that is open.
struct Open {
    window: Arc<Window>,
    presenter: Box<dyn Presenter>,
    context: egui::Context,
    input: egui_winit::State,
    desk: Desk,
    /// When the last frame was drawn, and when the next is wanted.
    drawn: Instant,
    wanted: Option<Instant>,
    title: String,
    /// When the presenter was last replaced.
    renewed: Option<Instant>,
}

struct App {
    options: Options,
    converter: Converter,
    proxy: EventLoopProxy<News>,
    open: Option<Open>,
    failure: Option<anyhow::Error>,
}

impl App {
    fn open(&self, events: &ActiveEventLoop) -> Result<Open> {
        let size = self.options.settings.size;
        let attributes = Window::default_attributes()
            .with_title("brickwalk")
            .with_inner_size(PhysicalSize::new(size.width, size.height))
            .with_min_inner_size(PhysicalSize::new(320, 200));
        let window = Arc::new(events.create_window(attributes).context("cannot open a window")?);
        let presenter = presenter(events.owned_display_handle(), &window)?;
        let context = egui::Context::default();
        let scale = window.scale_factor() as f32;
        let input = egui_winit::State::new(
            context.clone(),
            egui::ViewportId::ROOT,
            &*window,
            Some(scale),
            window.theme(),
            None,
        );
        let proxy = self.proxy.clone();
        // A window that is closed does not wait for news.
        let wake = Arc::new(move || {
            let _ = proxy.send_event(News);
        });
        let mut viewer = Viewer::new(&self.options.settings, self.options.pace, self.converter.clone(), wake)?;
        if let Some(scene) = &self.options.scene {
            viewer.open(scene);
        }
        let desk = Desk::new(viewer, Recent::load(), self.options.folder.clone());
        let (drawn, wanted, title) = (Instant::now(), Some(Instant::now()), String::new());
        Ok(Open { window, presenter, context, input, desk, drawn, wanted, title, renewed: None })
    }

    /// Whatever ends the window ends the program.
    fn fail(&mut self, events: &ActiveEventLoop, error: anyhow::Error) {
        self.failure = Some(error);
        self.open = None;
        events.exit();
    }
}

impl Open {
    /// A frame is wanted then, if none is sooner.
    fn want(&mut self, when: Instant) {
        let when = when.max(self.drawn + LEAST);
        self.wanted = Some(self.wanted.map_or(when, |own| own.min(when)));
    }

    /// Draws a frame.
    fn draw(&mut self) -> Result<desk::Asked> {
        let now = Instant::now();
        let seconds = now.duration_since(self.drawn).as_secs_f64();
        (self.drawn, self.wanted) = (now, None);
        let raw = self.input.take_egui_input(&self.window);
        let mut asked = desk::Asked::default();
        let Self { context, desk, .. } = self;
        let mut output = context.run_ui(raw, |ui| asked = desk.show(ui, seconds));
        self.input.handle_platform_output(&self.window, output.platform_output);
        let delay = output.viewport_output.get(&egui::ViewportId::ROOT).map(|viewport| viewport.repaint_delay);
        if let Some(when) = delay.filter(|delay| *delay < Duration::from_secs(60)).map(|delay| now + delay) {
            self.want(when);
        }
        let scale = output.pixels_per_point;
        let panels = self.context.tessellate(output.shapes, scale);
        let size = self.window.inner_size();
        if size.width > 0 && size.height > 0 {
            let shown = self.desk.viewer.shown.clone();
            self.presenter.present(Content {
                size: (size.width, size.height),
                picture: shown.as_deref().map(|shown| (shown, self.desk.picture)),
                panels: &panels,
                textures: &mut output.textures_delta,
                pixels_per_point: scale,
            })?;
        }
        let name = self.desk.viewer.scene.as_ref().map(|scene| title_of(&scene.path));
        let title = name.unwrap_or_else(|| "brickwalk".into());
        if title != self.title {
            self.window.set_title(&title);
            self.title = title;
        }
        Ok(asked)
    }

    /// Another presenter in the place of one that failed; once in a while.
    fn present_anew(&mut self, events: &ActiveEventLoop) -> Result<()> {
        if self.renewed.is_some_and(|renewed| renewed.elapsed() < PATIENCE) {
            bail!("the window cannot be drawn");
        }
        self.renewed = Some(Instant::now());
        self.presenter = presenter(events.owned_display_handle(), &self.window)?;
        // A new one knows no textures: all of them come again with a new context's first frame.
        self.context = egui::Context::default();
        let scale = self.window.scale_factor() as f32;
        let (theme, root) = (self.window.theme(), egui::ViewportId::ROOT);
        self.input = egui_winit::State::new(self.context.clone(), root, &*self.window, Some(scale), theme, None);
        self.desk.state = panels::State::default();
        self.want(Instant::now());
        Ok(())
    }

    fn change_screen(&self) {
        let is_full = self.window.fullscreen().is_some();
        self.window.set_fullscreen((!is_full).then_some(Fullscreen::Borderless(None)));
    }
}

/// The window's title with a scene in it.
fn title_of(scene: &Path) -> String {
    format!("brickwalk: {}", scene.file_name().unwrap_or_default().to_string_lossy())
}

impl ApplicationHandler<News> for App {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.open.is_none() {
            match self.open(events) {
                Ok(open) => self.open = Some(open),
                Err(error) => self.fail(events, error),
            }
        }
    }

    fn new_events(&mut self, _: &ActiveEventLoop, cause: StartCause) {
        if let (StartCause::ResumeTimeReached { .. }, Some(open)) = (cause, &mut self.open) {
            open.window.request_redraw();
        }
    }

    fn user_event(&mut self, _: &ActiveEventLoop, _: News) {
        if let Some(open) = &mut self.open {
            open.want(Instant::now());
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(open) = &mut self.open else { return };
        match event {
            WindowEvent::CloseRequested => events.exit(),
            WindowEvent::RedrawRequested => match open.draw() {
                Ok(desk::Asked { quit: true, .. }) => events.exit(),
                Ok(asked) => {
                    if asked.full_screen {
                        open.change_screen();
                    }
                }
                // Another device, or without one the processor, goes on.
                Err(error) => match open.present_anew(events) {
                    Ok(()) => open.desk.viewer.say(&format!("{error:#}; the window goes on"), true),
                    Err(_) => self.fail(events, error),
                },
            },
            event => {
                let response = open.input.on_window_event(&open.window, &event);
                if response.repaint || matches!(event, WindowEvent::Resized(_)) {
                    open.want(Instant::now());
                }
            }
        }
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        let wanted = self.open.as_ref().and_then(|open| open.wanted);
        events.set_control_flow(wanted.map_or(ControlFlow::Wait, ControlFlow::WaitUntil));
    }

    fn exiting(&mut self, _: &ActiveEventLoop) {
        // The studio ends before the display goes.
        self.open = None;
    }
}
