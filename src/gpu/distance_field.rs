//! Distance fields made and traced on the device. The kernels' twins are [`DistanceField::new`], which gives the same bits, and
//! [`DistanceField::trace_local`], which may differ by the quotients with which a ray is cut at the field's faces.

use super::device::Gpu;
use super::kernels::source;
use super::pages::device_error;
use super::readback::Readback;
use super::wgsl::Pages;
use crate::schedule::ExecutorError;
use crate::visibility::bom::Bom;
use crate::visibility::distance_field::{DistanceField, LEVELS, LocalRay, LocalTraced, NO_SEED, Tracing};
use half::f16;
use std::time::{Duration, Instant};

/// The kernels of distance fields.
pub struct FieldKernels {
    flood_layout: wgpu::BindGroupLayout,
    trace_layout: wgpu::BindGroupLayout,
    seeds: wgpu::ComputePipeline,
    flood: wgpu::ComputePipeline,
    distances: wgpu::ComputePipeline,
    halve: wgpu::ComputePipeline,
    trace: wgpu::ComputePipeline,
}

/// A field on the device.
pub struct DeviceField {
    /// Of each level the distances as of [`DistanceField::level`], two f16 in a word, the first lowest.
    pub levels: [wgpu::Buffer; LEVELS],
    /// Wall time from submission to the device's being done.
    pub time: Duration,
    /// Cells of the finest level on each axis.
    cells: u32,
    has_seed: bool,
}

/// What rays met on the device.
pub struct DeviceTraced {
    /// Of each ray.
    pub rays: Vec<LocalTraced>,
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

/// A buffer with parameters.
fn uniform(gpu: &Gpu, words: &[u32]) -> wgpu::Buffer {
    let params = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("field params"),
        size: words.len() as u64 * 4,
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    gpu.queue.write_buffer(&params, 0, bytemuck::cast_slice(words));
    params
}

/// A group of whole buffers.
fn group(gpu: &Gpu, layout: &wgpu::BindGroupLayout, buffers: &[&wgpu::Buffer]) -> wgpu::BindGroup {
    let entries: Vec<_> = (0..)
        .zip(buffers)
        .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
        .collect();
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("field"), layout, entries: &entries })
}

/// The layouts of a group of buffers and of pipelines that bind it alone.
fn layouts(
    device: &wgpu::Device,
    label: &str,
    kinds: &[wgpu::BufferBindingType],
) -> (wgpu::BindGroupLayout, wgpu::PipelineLayout) {
    let entries: Vec<_> = (0..)
        .zip(kinds)
        .map(|(binding, &ty)| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
            count: None,
        })
        .collect();
    let descriptor = wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries };
    let group = device.create_bind_group_layout(&descriptor);
    let pipelines = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(label),
        bind_group_layouts: &[Some(&group)],
        immediate_size: 0,
    });
    (group, pipelines)
}

/// Submits, waits, and says how long that took.
fn finish(gpu: &Gpu, encoder: wgpu::CommandEncoder) -> Result<Duration, ExecutorError> {
    let start = Instant::now();
    gpu.queue.submit([encoder.finish()]);
    gpu.device.poll(wgpu::PollType::wait_indefinitely()).map_err(device_error)?;
    Ok(start.elapsed())
}

impl FieldKernels {
    /// Compiles them.
    pub fn new(gpu: &Gpu) -> Self {
        let device = &gpu.device;
        let params = wgpu::BufferBindingType::Uniform;
        let [read, write] = [true, false].map(|read_only| wgpu::BufferBindingType::Storage { read_only });
        let (flood_layout, flood_pipelines) = layouts(device, "flood", &[params, read, write]);
        let (trace_layout, trace_pipelines) = layouts(device, "trace_field", &[params, read, read, read, read, write]);
        let pipeline = |name: &str, layout: &wgpu::PipelineLayout| {
            let text = source(name, Pages { cache: 1, texels: 1, opacity: false, gloss: false });
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(name),
                source: wgpu::ShaderSource::Wgsl(text.into()),
            });
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(name),
                layout: Some(layout),
                module: &module,
                entry_point: Some("main"),
                compilation_options: Default::default(),
                cache: None,
            })
        };
        let [seeds, flood, distances, halve] = ["flood_seeds", "jump_flood", "flood_distances", "halve_distances"]
            .map(|name| pipeline(name, &flood_pipelines));
        let trace = pipeline("trace_field", &trace_pipelines);
        Self { flood_layout, trace_layout, seeds, flood, distances, halve, trace }
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
            |kernel: &wgpu::ComputePipeline, [cells, step, width]: [u32; 3], [given, results]: [&wgpu::Buffer; 2]| {
                let params = uniform(gpu, &[cells, step, NO_SEED, 0]);
                let group = group(gpu, &self.flood_layout, &[&params, given, results]);
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
        let time = finish(gpu, encoder)?;
        Ok(DeviceField { levels, time, cells, has_seed: map.occupied() > 0 })
    }

    /// Traces rays through a field, as [`DistanceField::trace_local`] does, at most 2^20 at a time.
    ///
    /// # Errors
    /// The device's.
    pub fn trace(
        &self,
        gpu: &Gpu,
        field: &DeviceField,
        tracing: &Tracing,
        rays: &[LocalRay],
    ) -> Result<DeviceTraced, ExecutorError> {
        let mut traced = DeviceTraced { rays: Vec::with_capacity(rays.len()), time: Duration::ZERO };
        for rays in rays.chunks(1 << 20) {
            let given = storage(gpu, "field rays", (rays.len() * 8) as u32);
            gpu.queue.write_buffer(&given, 0, bytemuck::cast_slice(rays));
            let results = storage(gpu, "field hits", (rays.len() * 2) as u32);
            let Tracing { iterations, hit, least_step } = *tracing;
            let counts = [field.cells, rays.len() as u32, iterations, 0];
            let limits = [hit.to_bits(), least_step.to_bits(), field.has_seed.into(), 0];
            let params = uniform(gpu, &[counts, limits].concat());
            let [finest, halved, quartered] = &field.levels;
            let bound = [&params, finest, halved, quartered, &given, &results];
            let group = group(gpu, &self.trace_layout, &bound);
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            {
                let mut pass = encoder.begin_compute_pass(&Default::default());
                pass.set_pipeline(&self.trace);
                pass.set_bind_group(0, &group, &[]);
                pass.dispatch_workgroups(rays.len().div_ceil(64) as u32, 1, 1);
            }
            traced.time += finish(gpu, encoder)?;
            let bytes = Readback::new(gpu, 0).read(gpu, &results)?;
            let words = bytes.as_chunks::<4>().0.iter().map(|&word| u32::from_le_bytes(word));
            let words: Vec<u32> = words.collect();
            traced.rays.extend(words.as_chunks::<2>().0.iter().map(|&[t, count]| LocalTraced {
                t: (t != u32::MAX).then_some(f32::from_bits(t)),
                iterations: count & 0x7fff_ffff,
                is_capped: count >> 31 != 0,
            }));
        }
        Ok(traced)
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

    /// Rays from inside and outside of a field, some along axes.
    fn rays(cells: u32, count: u32) -> Vec<LocalRay> {
        let mut state = 77u32;
        let mut unit = || {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let ray = |number: u32| {
            let origin = [(); 3].map(|()| (unit() * 1.4 - 0.2) * cells as f32);
            let d = [(); 3].map(|()| unit() - 0.5);
            let length = d.iter().map(|x| x * x).sum::<f32>().sqrt().max(1e-3);
            let direction = if number.is_multiple_of(16) { [0.0, -1.0, 0.0] } else { d.map(|x| x / length) };
            LocalRay { origin, t_min: 0.0, direction, t_max: if number.is_multiple_of(5) { 12.0 } else { 1e9 } }
        };
        (0..count).map(ray).collect()
    }

    #[test]
    fn fields_and_rays_are_those_of_their_twins() {
        let Ok(gpu) = Gpu::open(None) else {
            println!("skipped: no adapter");
            return;
        };
        let kernels = FieldKernels::new(&gpu);
        for (cells, every) in [(32, None), (32, Some(32_768)), (32, Some(20)), (64, Some(50)), (96, Some(100))] {
            let map = map(cells, every);
            let field = kernels.make(&gpu, &map).unwrap();
            let found = field.read(&gpu, &map).unwrap();
            assert_eq!(found.has_seed(), every.is_some());
            let twin = DistanceField::new(&map);
            assert!(found == twin, "{cells} cells, {every:?}");
            println!("{cells}³, one in {every:?}: {:.1} ms on {}", field.time.as_secs_f64() * 1e3, gpu.info.name);
            let rays = rays(cells, 3000);
            for tracing in [Tracing::default(), Tracing { iterations: 16, hit: 1.0, least_step: 0.25 }] {
                let traced = kernels.trace(&gpu, &field, &tracing, &rays).unwrap();
                // Only the quotients by which a ray is cut at the field's faces may be off, by 2.5 units in the last place.
                let is_near = |a: Option<f32>, b: Option<f32>| match (a, b) {
                    (Some(a), Some(b)) => (a - b).abs() < 1e-3,
                    (a, b) => a.is_some() == b.is_some(),
                };
                let twin = |ray: &LocalRay| found.trace_local(&tracing, ray);
                let (mut same, mut hits, mut aside) = (0, 0, 0);
                for (ray, of_device) in rays.iter().zip(&traced.rays) {
                    let of_twin = twin(ray);
                    same += u32::from(is_near(of_device.t, of_twin.t) && of_device.is_capped == of_twin.is_capped);
                    hits += u32::from(of_device.t.is_some());
                    let moved = LocalRay { origin: ray.origin.map(|x| x + 1.5), ..*ray };
                    aside += u32::from(is_near(of_device.t, twin(&moved).t));
                }
                println!("{hits} hits, {same} same, {aside} as from aside, {:.1} ms", traced.time.as_secs_f64() * 1e3);
                let is_dense = every.is_some_and(|every| every < 10_000);
                let has_hits = if is_dense { hits > 100 } else { every.is_some() || hits == 0 };
                assert!(same >= 2997 && has_hits, "{cells}, {every:?}: {same} of 3000");
                // The control: from another place it is another ray.
                assert!(!is_dense || aside < 2970);
            }
            // The control: one cell more is another field.
            let mut other = map.clone();
            other.occupy([1, 2, 3]);
            assert!(map == other || found != DistanceField::new(&other));
        }
    }
}
