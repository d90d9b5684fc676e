//! What the kernels of a method of visibility share: pipelines, and group 2, buffers of their own. Made when a walk
//! first asks for the method.

use super::device::Gpu;
use super::groups::numbered;
use super::kernels;
use super::kernels::Kernels;
use super::rays::storage;
use crate::schedule::ExecutorError;

/// The pipelines of a method, and the layout of its group.
pub struct Method {
    label: &'static str,
    layout: wgpu::BindGroupLayout,
    pipelines: Vec<(&'static str, wgpu::ComputePipeline)>,
}

impl Method {
    /// Of kernels that read the scene, rays and what shading keeps beside `layout`.
    pub fn new(
        gpu: &Gpu,
        kernels: &Kernels,
        label: &'static str,
        layout: wgpu::BindGroupLayout,
        names: &[&'static str],
    ) -> Self {
        let groups = [Some(&kernels.scene), Some(&kernels.rays), Some(&layout), Some(&kernels.shading)];
        let pipeline_layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(label),
            bind_group_layouts: &groups,
            immediate_size: 0,
        });
        let pipeline = |name: &str| {
            let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(name),
                source: wgpu::ShaderSource::Wgsl(kernels::source(name, kernels.pages).into()),
            });
            gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(name),
                layout: Some(&pipeline_layout),
                module: &module,
                entry_point: Some("main"),
                compilation_options: Default::default(),
                cache: None,
            })
        };
        let pipelines = names.iter().map(|&name| (name, pipeline(name))).collect();
        Self { label, layout, pipelines }
    }

    /// The pipeline of a kernel, if it is one of these.
    pub fn pipeline(&self, name: &str) -> Option<&wgpu::ComputePipeline> {
        self.pipelines.iter().find(|(own, _)| *own == name).map(|(_, pipeline)| pipeline)
    }

    /// Its group over buffers, in the order of the bindings.
    pub fn group<'a>(&self, gpu: &Gpu, buffers: impl IntoIterator<Item = &'a wgpu::Buffer>) -> wgpu::BindGroup {
        let entries = numbered(buffers, 0);
        let Self { label, layout, .. } = self;
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries })
    }
}

/// Makes room for `count` elements; whether the buffer is a new one.
pub fn grow(gpu: &Gpu, buffer: &mut wgpu::Buffer, label: &str, count: usize, stride: usize) -> bool {
    let grows = buffer.size() < (count * stride) as u64;
    if grows {
        *buffer = storage(gpu, label, count, stride);
    }
    grows
}

/// Most bytes of a buffer that a kernel reads or writes.
pub fn most_bytes(gpu: &Gpu) -> u64 {
    gpu.limits.max_storage_buffer_binding_size.min(gpu.limits.max_buffer_size)
}

/// Refuses more bytes of `what` than a buffer holds, and says what to give.
///
/// # Errors
/// There are more.
pub fn check_bytes(gpu: &Gpu, bytes: u64, what: &str, remedy: &str) -> Result<(), ExecutorError> {
    let most = most_bytes(gpu);
    if bytes <= most {
        return Ok(());
    }
    let name = &gpu.info.name;
    Err(ExecutorError::Device(format!("{name:?} holds {what} of at most {most} bytes, this takes {bytes}; {remedy}")))
}

/// Refuses `what` where its kernels need more storage buffers than the device binds: `own`, those of the scene, rays
/// and shading among them, and one more with opacity.
///
/// # Errors
/// It binds fewer.
pub fn check_bindings(gpu: &Gpu, kernels: &Kernels, own: u32, what: &str) -> Result<(), ExecutorError> {
    let (most, needed) = (gpu.limits.max_storage_buffers_per_shader_stage, own + u32::from(kernels.pages.opacity));
    if most >= needed {
        return Ok(());
    }
    Err(ExecutorError::Device(format!(
        "{:?} binds {most} buffers a kernel, {what} needs {needed}; use --secondary exact, or another --adapter",
        gpu.info.name
    )))
}
