//! Frames onto the screen by a GPU. It has a device of its own: the one that renders pictures is busy with them, and a
//! window whose device is lost starts another one.

use super::present::{Content, GROUND, Presenter};
use anyhow::{Context, Result, bail};
use egui::epaint::textures::TexturesDelta;
use egui::epaint::{ClippedPrimitive, ImageDelta, Mesh, Primitive};
use egui::{Color32, ColorImage, Rect, TextureId, TextureOptions, pos2};
use egui_wgpu::{Renderer, RendererOptions, ScreenDescriptor};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use wgpu::CurrentSurfaceTexture;
use winit::event_loop::OwnedDisplayHandle;
use winit::window::Window;

/// The texture that pictures are put into; egui counts its own from 0.
const PICTURE: TextureId = TextureId::Managed(u64::MAX);

/// A surface, its device, and what draws egui's triangles on it.
pub struct Surface {
    surface: wgpu::Surface<'static>,
    device: wgpu::Device,
    queue: wgpu::Queue,
    config: wgpu::SurfaceConfiguration,
    renderer: Renderer,
    /// The number of the picture that is in the texture.
    shown: u64,
    is_lost: Arc<AtomicBool>,
}

impl Surface {
    /// On `window`. `software`: adapters that are programs of the processor count, too.
    ///
    /// # Errors
    /// There is no adapter for this window, or it gives no device.
    pub fn new(display: OwnedDisplayHandle, window: Arc<Window>, software: bool) -> Result<Self> {
        let mut descriptor = wgpu::InstanceDescriptor::new_with_display_handle(Box::new(display));
        descriptor.backends = wgpu::Backends::PRIMARY;
        let size = window.inner_size();
        let instance = wgpu::Instance::new(descriptor);
        let surface = instance.create_surface(window).context("no surface")?;
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::LowPower,
            compatible_surface: Some(&surface),
            ..Default::default()
        };
        let adapter = pollster::block_on(instance.request_adapter(&options)).context("no adapter for the window")?;
        let info = adapter.get_info();
        if info.device_type == wgpu::DeviceType::Cpu && !software {
            bail!("{} is a program of the processor", info.name);
        }
        let wanted = wgpu::DeviceDescriptor {
            label: Some("window"),
            required_limits: wgpu::Limits::downlevel_defaults().using_resolution(adapter.limits()),
            ..Default::default()
        };
        let (device, queue) =
            pollster::block_on(adapter.request_device(&wanted)).context("no device for the window")?;
        let is_lost = Arc::new(AtomicBool::new(false));
        let lost = is_lost.clone();
        device.set_device_lost_callback(move |_, _| lost.store(true, Ordering::Relaxed));
        let capabilities = surface.get_capabilities(&adapter);
        let config = surface.get_default_config(&adapter, size.width.max(1), size.height.max(1));
        let mut config = config.context("the adapter cannot show this window")?;
        // Colours are blended as they are, as egui means them.
        let plain = capabilities.formats.iter().copied().find(|format| !format.is_srgb());
        config.format = plain.unwrap_or(config.format);
        // The latest frame counts.
        if capabilities.present_modes.contains(&wgpu::PresentMode::Mailbox) {
            config.present_mode = wgpu::PresentMode::Mailbox;
        }
        surface.configure(&device, &config);
        let renderer = Renderer::new(&device, config.format, RendererOptions::default());
        Ok(Self { surface, device, queue, config, renderer, shown: 0, is_lost })
    }

    fn update(&mut self, textures: &mut TexturesDelta) {
        for (id, deltas) in textures.set.drain() {
            deltas.iter().for_each(|delta| self.renderer.update_texture(&self.device, &self.queue, id, delta));
        }
    }

    /// The picture as a rectangle of two triangles.
    fn picture(&mut self, content: &Content) -> Option<ClippedPrimitive> {
        let (shown, rect) = content.picture?;
        if shown.number != self.shown {
            let pixels = shown.pixels.iter().map(|&[r, g, b]| Color32::from_rgb(r, g, b)).collect();
            let image = ColorImage::new([shown.size.0 as usize, shown.size.1 as usize], pixels);
            let delta = ImageDelta::full(image, TextureOptions::LINEAR);
            self.renderer.update_texture(&self.device, &self.queue, PICTURE, &delta);
            self.shown = shown.number;
        }
        let mut mesh = Mesh::with_texture(PICTURE);
        mesh.add_rect_with_uv(rect, Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0)), Color32::WHITE);
        Some(ClippedPrimitive { clip_rect: rect, primitive: Primitive::Mesh(mesh) })
    }

    /// The texture of the next frame; `None`: none can be had now.
    ///
    /// # Errors
    /// The surface, or its device, is gone.
    fn next(&mut self) -> Result<Option<wgpu::SurfaceTexture>> {
        for _ in 0..2 {
            match self.surface.get_current_texture() {
                CurrentSurfaceTexture::Success(texture) => return Ok(Some(texture)),
                CurrentSurfaceTexture::Timeout | CurrentSurfaceTexture::Occluded => return Ok(None),
                CurrentSurfaceTexture::Suboptimal(texture) => drop(texture),
                CurrentSurfaceTexture::Outdated => {}
                CurrentSurfaceTexture::Lost | CurrentSurfaceTexture::Validation => {
                    bail!("the window's surface is lost")
                }
            }
            self.surface.configure(&self.device, &self.config);
        }
        Ok(None)
    }
}

impl Presenter for Surface {
    fn present(&mut self, content: Content) -> Result<()> {
        if self.is_lost.load(Ordering::Relaxed) {
            bail!("the window's device is lost");
        }
        let (width, height) = content.size;
        if (width, height) != (self.config.width, self.config.height) {
            (self.config.width, self.config.height) = (width, height);
            self.surface.configure(&self.device, &self.config);
        }
        let picture = self.picture(&content);
        let Content { panels, textures, pixels_per_point, .. } = content;
        self.update(textures);
        let screen = ScreenDescriptor { size_in_pixels: [width, height], pixels_per_point };
        let all: Vec<ClippedPrimitive> = picture.into_iter().chain(panels.iter().cloned()).collect();
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let before = self.renderer.update_buffers(&self.device, &self.queue, &mut encoder, &all, &screen);
        let Some(frame) = self.next()? else { return Ok(()) };
        let view = frame.texture.create_view(&Default::default());
        let [r, g, b] = GROUND.map(|byte| f64::from(byte) / 255.0);
        {
            let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("window"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a: 1.0 }),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                ..Default::default()
            });
            self.renderer.render(&mut pass.forget_lifetime(), &all, &screen);
        }
        self.queue.submit(before.into_iter().chain([encoder.finish()]));
        self.queue.present(frame);
        textures.free.drain().for_each(|id| self.renderer.free_texture(&id));
        Ok(())
    }
}
