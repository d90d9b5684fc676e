//! The resident part of a scene on the device, relative to the reference point of the frame.

use super::device::Gpu;
use super::readback::device_error;
use super::wgsl::{HIDDEN_BINDING, LEVEL_BINDING, OPACITY_BINDING, Pages};
use crate::kernels::frame::{Frame, Placement, brick_record};
use crate::kernels::levels::LevelTable;
use crate::kernels::{layout, opacity};
use crate::schedule::ExecutorError;
use bricks::{NONE, Resident, SceneFile};
use std::sync::Arc;
use wgpu::BufferUsages;

/// The buffers of group 0.
pub struct SceneBuffers {
    top8: wgpu::Buffer,
    top2: wgpu::Buffer,
    leaves: wgpu::Buffer,
    instances: wgpu::Buffer,
    bricks: wgpu::Buffer,
    roots: wgpu::Buffer,
    opacity: wgpu::Buffer,
    /// Leaves and nodes of [`LevelTable`], where kernels ask for them.
    levels: Option<[wgpu::Buffer; 2]>,
    table: LevelTable,
    hidden: wgpu::Buffer,
    marks: Arc<[bool]>,
    /// Slots and states, written before every submission.
    pub slots: wgpu::Buffer,
    frame: Option<Frame>,
    /// Relative padding of top-level boxes for the rounding of instance rays.
    pub instance_pad: f32,
}

impl SceneBuffers {
    /// Allocates buffers for a scene and fills what does not depend on the frame. `levels`: whether kernels select
    /// levels of detail.
    ///
    /// # Errors
    /// Opacity maps that cannot be read, or that are larger than a buffer of the device.
    pub fn new(gpu: &Gpu, scene: &SceneFile, levels: bool) -> Result<Self, ExecutorError> {
        let resident = scene.resident();
        let table = opacity::table(scene).map_err(device_error)?;
        let bytes = size_of_val(table.as_slice()) as u64;
        if bytes > gpu.page_bytes() {
            let most = gpu.page_bytes();
            let text = format!(
                "holds opacity maps of at most {most} bytes, this scene has {bytes}; scale its images with alpha down"
            );
            return Err(ExecutorError::Device(text));
        }
        let buffer = |label: &str, count: usize, stride: usize| {
            gpu.buffer(label, (count.max(1) * stride) as u64, BufferUsages::STORAGE | BufferUsages::COPY_DST)
        };
        let count = resident.bricks.len();
        let buffers = Self {
            top8: buffer("top8", resident.top8.len(), size_of::<bricks::Node>()),
            top2: buffer("top2", resident.top2.len(), size_of::<layout::TopNode2>()),
            leaves: buffer("leaves", resident.leaves.len(), size_of::<layout::Leaf>()),
            instances: buffer("instances", resident.instances.len(), size_of::<layout::Instance>()),
            bricks: buffer("bricks", count, size_of::<layout::Brick>()),
            roots: buffer("roots", count, size_of::<bricks::Node>()),
            slots: buffer("slots", count, size_of::<layout::Slot>()),
            opacity: buffer("opacity", table.len(), size_of::<[u32; 4]>()),
            levels: levels.then(|| {
                let nodes = resident.top2.len() + resident.top8.len();
                [
                    buffer("level_leaves", resident.leaves.len(), size_of::<layout::LevelLeaf>()),
                    buffer("level_nodes", nodes, size_of::<u32>()),
                ]
            }),
            table: LevelTable::default(),
            hidden: hidden_buffer(gpu, &[]),
            marks: Arc::new([]),
            frame: None,
            instance_pad: 0.0,
        };
        let records: Vec<layout::Brick> = resident.bricks.iter().map(brick_record).collect();
        let roots: Vec<bricks::Node> = resident.bricks.iter().map(|b| b.root).collect();
        gpu.queue.write_buffer(&buffers.bricks, 0, bytemuck::cast_slice(&records));
        gpu.queue.write_buffer(&buffers.roots, 0, bytemuck::cast_slice(&roots));
        gpu.queue.write_buffer(&buffers.opacity, 0, bytemuck::cast_slice(&table));
        Ok(buffers)
    }

    /// All of them by their bindings, those that kernels for `pages` ask for.
    pub fn buffers(&self, pages: Pages) -> Vec<(u32, &wgpu::Buffer)> {
        let Self { top8, top2, leaves, instances, bricks, roots, slots, opacity, levels, hidden, .. } = self;
        let always = (0..).zip([top8, top2, leaves, instances, bricks, roots, slots]);
        let opacity = pages.opacity.then_some((OPACITY_BINDING, opacity));
        let levels = (LEVEL_BINDING..).zip(levels.iter().flatten()).filter(|_| pages.levels);
        let hidden = pages.hides.then_some((HIDDEN_BINDING, hidden));
        always.chain(opacity).chain(levels).chain(hidden).collect()
    }

    /// Hides triangles: [`crate::kernels::FrameExecutor::set_hidden`]. Groups are to be made anew.
    pub fn set_hidden(&mut self, gpu: &Gpu, bounds: &[u32]) {
        self.hidden = hidden_buffer(gpu, bounds);
    }

    /// Has the next frame place everything anew.
    pub fn forget_frame(&mut self) {
        self.frame = None;
    }

    /// Moves everything to `frame`, if it is not there yet.
    pub fn rebase(&mut self, gpu: &Gpu, resident: &Resident, frame: Frame) {
        if self.frame == Some(frame) {
            return;
        }
        self.frame = Some(frame);
        let Placement { instances, leaves, top2, top8, instance_pad } = Placement::new(resident, &frame);
        self.instance_pad = instance_pad;
        gpu.queue.write_buffer(&self.top8, 0, bytemuck::cast_slice(&top8));
        gpu.queue.write_buffer(&self.top2, 0, bytemuck::cast_slice(&top2));
        gpu.queue.write_buffer(&self.leaves, 0, bytemuck::cast_slice(&leaves));
        gpu.queue.write_buffer(&self.instances, 0, bytemuck::cast_slice(&instances));
        if let Some([_, of_nodes]) = &self.levels {
            self.table = LevelTable::new(resident, &frame);
            gpu.queue.write_buffer(of_nodes, 0, bytemuck::cast_slice(&self.table.nodes));
            let marks = self.marks.clone();
            self.mark_leaves(gpu, &marks);
        }
    }

    /// Marks leaves: [`crate::schedule::Executor::mark_leaves`].
    pub fn mark_leaves(&mut self, gpu: &Gpu, marks: &Arc<[bool]>) {
        self.marks = marks.clone();
        if let Some([of_leaves, _]) = &self.levels {
            self.table.mark(marks);
            gpu.queue.write_buffer(of_leaves, 0, bytemuck::cast_slice(&self.table.leaves));
        }
    }
}

/// Ids at which hiding begins and ends. A buffer has an element at least: where nothing is hidden an id that no
/// triangle has.
fn hidden_buffer(gpu: &Gpu, bounds: &[u32]) -> wgpu::Buffer {
    let bounds = if bounds.is_empty() { &[NONE] } else { bounds };
    let bytes: &[u8] = bytemuck::cast_slice(bounds);
    let buffer = gpu.buffer("hidden", bytes.len() as u64, BufferUsages::STORAGE | BufferUsages::COPY_DST);
    gpu.queue.write_buffer(&buffer, 0, bytes);
    buffer
}
