//! Distance fields made on the device: the same bits as [`DistanceField::new`], which is the kernels' twin.

use super::device::Gpu;
use super::kernels::source;
use super::pages::device_error;
use super::readback::Readback;
use super::wgsl::Pages;
use crate::schedule::ExecutorError;
use crate::visibility::bom::Bom;
use crate::visibility::distance_field::{DistanceField, LEVELS, NO_SEED};
use half::f16;
use std::time::{Duration, Instant};

/// The kernels of distance fields.
pub struct FloodKernels {
    layout: wgpu::BindGroupLayout,
    seeds: wgpu::ComputePipeline,
    flood: wgpu::ComputePipeline,
    distances: wgpu::ComputePipeline,
    halve: wgpu::ComputePipeline,
}

/// A field on the device.
pub struct DeviceField {
    /// Of each level the distances as of [`DistanceField::level`], two f16 in a word, the first lowest.
    pub levels: [wgpu::Buffer; LEVELS],
    /// Wall time from submission to the device's being done.
    pub time: Duration,
}

fn storage(gpu: &Gpu, label: &str, words: u32) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: u64::from(words) * 4,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

impl FloodKernels {
    /// Compiles them.
    pub fn new(gpu: &Gpu) -> Self {
        let device = &gpu.device;
        let kinds = [
            wgpu::BufferBindingType::Uniform,
            wgpu::BufferBindingType::Storage { read_only: true },
            wgpu::BufferBindingType::Storage { read_only: false },
        ];
        let entries: Vec<_> = (0..)
            .zip(kinds)
            .map(|(binding, ty)| wgpu::BindGroupLayoutEntry {
                binding,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
                count: None,
            })
            .collect();
        let descriptor = wgpu::BindGroupLayoutDescriptor { label: Some("flood"), entries: &entries };
        let layout = device.create_bind_group_layout(&descriptor);
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("flood"),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = |name: &str| {
            let text = source(name, Pages { cache: 1, texels: 1, opacity: false, gloss: false });
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(name),
                source: wgpu::ShaderSource::Wgsl(text.into()),
            });
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(name),
                layout: Some(&pipeline_layout),
                module: &module,
                entry_point: Some("main"),
                compilation_options: Default::default(),
                cache: None,
            })
        };
        let [seeds, flood, distances, halve] =
            ["flood_seeds", "jump_flood", "flood_distances", "halve_distances"].map(pipeline);
        Self { layout, seeds, flood, distances, halve }
    }

    /// Makes the field of a map, and waits for it.
    ///
    /// # Errors
    /// The device's.
    pub fn make(&self, gpu: &Gpu, map: &Bom) -> Result<DeviceField, ExecutorError> {
        let cells = map.cells();
        let bits = storage(gpu, "occupancy", map.words().len() as u32);
        gpu.queue.write_buffer(&bits, 0, bytemuck::cast_slice(map.words()));
        let mut nearest = ["nearest", "nearer"].map(|label| storage(gpu, label, cells.pow(3)));
        let levels = std::array::from_fn(|level| storage(gpu, "distances", (cells >> level).pow(3) / 2));
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        // Of z, 32 threads a group; where each has two cells, half as many.
        let mut dispatch =
            |kernel: &wgpu::ComputePipeline, [cells, step, width]: [u32; 3], buffers: [&wgpu::Buffer; 2]| {
                let params = gpu.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("flood params"),
                    size: 16,
                    usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                    mapped_at_creation: false,
                });
                gpu.queue.write_buffer(&params, 0, bytemuck::cast_slice(&[cells, step, NO_SEED, 0]));
                let bound = [&params, buffers[0], buffers[1]];
                let entries: Vec<_> = (0..)
                    .zip(bound)
                    .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
                    .collect();
                let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                    label: Some("flood"),
                    layout: &self.layout,
                    entries: &entries,
                });
                let mut pass = encoder.begin_compute_pass(&Default::default());
                pass.set_pipeline(kernel);
                pass.set_bind_group(0, &group, &[]);
                pass.dispatch_workgroups((cells / width).div_ceil(32), cells / 2, cells);
            };
        dispatch(&self.seeds, [cells, 0, 1], [&bits, &nearest[0]]);
        let mut step = cells.next_power_of_two() / 2;
        while step > 0 {
            dispatch(&self.flood, [cells, step, 1], [&nearest[0], &nearest[1]]);
            nearest.swap(0, 1);
            step /= 2;
        }
        dispatch(&self.distances, [cells, 0, 2], [&nearest[0], &levels[0]]);
        for level in 1..LEVELS {
            dispatch(&self.halve, [cells >> level, 0, 2], [&levels[level - 1], &levels[level]]);
        }
        let start = Instant::now();
        gpu.queue.submit([encoder.finish()]);
        gpu.device.poll(wgpu::PollType::wait_indefinitely()).map_err(device_error)?;
        Ok(DeviceField { levels, time: start.elapsed() })
    }
}

impl DeviceField {
    /// Reads the field of `map` back.
    ///
    /// # Errors
    /// The device's.
    pub fn read(&self, gpu: &Gpu, map: &Bom) -> Result<DistanceField, ExecutorError> {
        let mut levels = Vec::with_capacity(LEVELS);
        for buffer in &self.levels {
            let bytes = Readback::new(gpu, 0).read(gpu, buffer)?;
            let halves = bytes.as_chunks::<2>().0;
            levels.push(halves.iter().map(|&half| f16::from_le_bytes(half)).collect());
        }
        let levels = levels.try_into().map_err(|_| device_error("a level of the field is missing"))?;
        Ok(DistanceField::of_levels(map, levels))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A map with every n-th cell or so occupied; of no n none.
    fn map(cells: u32, every: Option<u32>) -> Bom {
        let mut map = Bom::new(cells, -2, [5, -70, 3]);
        let mut state = 0x2545_f491u32;
        let Some(every) = every else { return map };
        for _ in 0..cells.pow(3) / every {
            let mut next = || {
                state ^= state << 13;
                state ^= state >> 17;
                state ^= state << 5;
                (state >> 8) % cells
            };
            map.occupy([next(), next(), next()]);
        }
        map
    }

    #[test]
    fn fields_have_the_same_bits_as_their_twin() {
        let Ok(gpu) = Gpu::open(None) else {
            println!("skipped: no adapter");
            return;
        };
        let kernels = FloodKernels::new(&gpu);
        for (cells, every) in [(32, None), (32, Some(32_768)), (32, Some(20)), (64, Some(5000)), (96, Some(100))] {
            let map = map(cells, every);
            let field = kernels.make(&gpu, &map).unwrap();
            let found = field.read(&gpu, &map).unwrap();
            assert_eq!(found.has_seed(), every.is_some());
            let twin = DistanceField::new(&map);
            assert!(found == twin, "{cells} cells, {every:?}");
            println!("{cells}³, one in {every:?}: {:.1} ms on {}", field.time.as_secs_f64() * 1e3, gpu.info.name);
            // The control: one cell more is another field.
            let mut other = map.clone();
            other.occupy([1, 2, 3]);
            assert!(map == other || found != DistanceField::new(&other));
        }
    }
}
