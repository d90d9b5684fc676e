//! Binary trees of all bricks on the device, for the baseline `plain-bvh2`: nodes in pages of their own, beside the
//! cache.

use super::device::Gpu;
use super::groups::numbered;
use super::kernels::{Kernels, Pipeline};
use super::rays::storage;
use super::readback::device_error;
use super::{kernels, wgsl};
use crate::kernels::layout::BinaryNode;
use crate::kernels::table::{self, names};
use crate::kernels::trace::binary_tree::{Tree, top_height, tree_of};
use crate::schedule::ExecutorError;
use bricks::SceneFile;
use rayon::prelude::*;
use std::sync::Arc;

/// Bricks whose trees are made at a time, a thread.
const AT_A_TIME: usize = 8;
/// Bytes that are copied to the device at a time.
const UPLOAD_BYTES: usize = 64 << 20;
/// Storage buffers that the kernel binds beside the pages of nodes and of the cache: the scene's, the rays', the roots.
const OTHER_BUFFERS: usize = 7 + 5 + 1;

/// Binary trees of all bricks, and the pipeline over them.
pub struct BinaryTrees {
    /// Group 3 of the kernel.
    pub group: wgpu::BindGroup,
    /// The kernel.
    pub pipeline: Pipeline,
}

impl BinaryTrees {
    /// Makes the trees of all bricks of `scene` from their geometry, and a pipeline for as many pages of the cache as
    /// `kernels` have. The host holds one page of nodes at a time.
    ///
    /// # Errors
    /// A brick that cannot be read; nodes beyond what the device holds, with how much is needed.
    pub fn new(gpu: &Gpu, scene: &SceneFile, kernels: &Kernels) -> Result<Self, ExecutorError> {
        let count = scene.resident().bricks.len();
        let bound = OTHER_BUFFERS + kernels.pages.cache + kernels.pages.of_scene();
        let most = (gpu.limits.max_storage_buffers_per_shader_stage as usize).saturating_sub(bound);
        let mut pages = Pages { gpu, most, buffers: Vec::new(), filling: Vec::new(), count: 0, bytes: 0 };
        let mut roots = Vec::with_capacity(count);
        let mut height = 0;
        let at_a_time = AT_A_TIME * rayon::current_num_threads();
        for first in (0..count).step_by(at_a_time) {
            let bricks = first..count.min(first + at_a_time);
            let trees: Vec<Tree> =
                bricks.into_par_iter().map(|brick| tree_of(scene, brick)).collect::<Result<_, _>>()?;
            for tree in trees {
                height = height.max(tree.height);
                roots.push(pages.push(&tree.nodes)?);
            }
        }
        let pages = pages.finish()?;
        let root_buffer = storage(gpu, "binary roots", count, size_of::<[u32; 2]>());
        gpu.queue.write_buffer(&root_buffer, 0, bytemuck::cast_slice(&roots));
        let (layout, pipeline) = pipeline(gpu, kernels, pages.len(), height + top_height(scene.resident()))?;
        let entries = numbered(std::iter::once(&root_buffer).chain(&pages), 0);
        let descriptor = wgpu::BindGroupDescriptor { label: Some("binary"), layout: &layout, entries: &entries };
        Ok(Self { group: gpu.device.create_bind_group(&descriptor), pipeline })
    }
}

/// Pages of nodes, filled one after the other; no brick's nodes lie in two.
struct Pages<'a> {
    gpu: &'a Gpu,
    /// Most pages that the kernel can bind. Those beyond it are counted and not kept.
    most: usize,
    buffers: Vec<wgpu::Buffer>,
    /// Nodes of the page that is being filled.
    filling: Vec<BinaryNode>,
    /// Pages finished.
    count: usize,
    /// Bytes of their nodes.
    bytes: u64,
}

impl Pages<'_> {
    /// Adds the nodes of a brick; returns page and index of the first.
    fn push(&mut self, nodes: &[BinaryNode]) -> Result<[u32; 2], ExecutorError> {
        let most = self.gpu.page_bytes() as usize / size_of::<BinaryNode>();
        if nodes.len() > most {
            let bytes = size_of_val(nodes);
            return Err(ExecutorError::Device(format!(
                "cannot bind {bytes} bytes, the binary nodes of one brick; convert the scene with fewer \
                 --brick-triangles"
            )));
        }
        if self.filling.len() + nodes.len() > most {
            self.finish_page()?;
        }
        let place = [self.count as u32, self.filling.len() as u32];
        self.filling.extend_from_slice(nodes);
        Ok(place)
    }

    /// Copies what has been filled to the device.
    fn finish_page(&mut self) -> Result<(), ExecutorError> {
        let bytes: &[u8] = bytemuck::cast_slice(&self.filling);
        self.count += 1;
        self.bytes += bytes.len() as u64;
        if self.count <= self.most {
            let scope = self.gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
            let buffer = storage(self.gpu, "binary nodes", self.filling.len(), size_of::<BinaryNode>());
            if let Some(error) = pollster::block_on(scope.pop()) {
                return Err(ExecutorError::Device(format!(
                    "has no room for {} bytes of binary nodes beside the cache ({error}); use --schedule plain",
                    self.bytes
                )));
            }
            for (i, part) in bytes.chunks(UPLOAD_BYTES).enumerate() {
                self.gpu.queue.write_buffer(&buffer, (i * UPLOAD_BYTES) as u64, part);
                // Pending writes hold a copy each: they are flushed before the next.
                self.gpu.queue.submit([]);
                self.gpu.device.poll(wgpu::PollType::wait_indefinitely()).map_err(device_error)?;
            }
            self.buffers.push(buffer);
        }
        self.filling.clear();
        Ok(())
    }

    /// Finishes the last page.
    fn finish(mut self) -> Result<Vec<wgpu::Buffer>, ExecutorError> {
        // A scene of nothing has a page, too, so that there is something to bind.
        if !self.filling.is_empty() || self.count == 0 {
            self.finish_page()?;
        }
        if self.count > self.most {
            return Err(ExecutorError::Device(format!(
                "binds at most {} pages of {} bytes beside the cache, and the binary nodes of this scene take {} bytes \
                 in {} pages; use --schedule plain",
                self.most,
                self.gpu.page_bytes(),
                self.bytes,
                self.count
            )));
        }
        Ok(self.buffers)
    }
}

/// Layout of group 3 and the pipeline, for so many pages of nodes and a stack of so many entries.
fn pipeline(
    gpu: &Gpu,
    kernels: &Kernels,
    pages: usize,
    stack: u32,
) -> Result<(wgpu::BindGroupLayout, Pipeline), ExecutorError> {
    let binary = |name: &str| (name == "trace/binary.wgsl").then(|| wgsl::binary_accessors(pages, stack.max(1)));
    let device = &gpu.device;
    let group = kernels::read_layout(device, "binary", 1 + pages);
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(names::intersect_binary),
        bind_group_layouts: &[Some(&kernels.scene), Some(&kernels.rays), Some(&kernels.cache), Some(&group)],
        immediate_size: 0,
    });
    let kernel = table::kernel(names::intersect_binary)
        .ok_or_else(|| ExecutorError::Device("has no kernel over binary trees; this is a bug in brickwalk".into()))?;
    let text = kernels::source_with(kernel.file, kernels.pages, &binary);
    let pipeline = kernels.pipeline_of(gpu, kernel, layout, Some(Arc::new(move |_| text.clone())));
    Ok((group, pipeline))
}
