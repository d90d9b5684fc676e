//! Bind group layouts and pipelines: one pipeline a kernel, named as its file.

use super::device::Gpu;
use super::wgsl;
use super::wgsl::Pages;
use std::collections::HashMap;

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));

/// The text of kernel `name` with everything it includes.
pub fn source(name: &str, pages: Pages) -> String {
    source_with(name, pages, &|_| None)
}

/// [`source`] with the files that `generated` gives in place of the shipped ones.
pub(crate) fn source_with(name: &str, pages: Pages, generated: &dyn Fn(&str) -> Option<String>) -> String {
    let shipped = |name: &str| FILES.iter().find(|f| f.0 == name).map(|f| f.1.to_string());
    let file = |name: &str| generated(name).or_else(|| shipped(name));
    // The build has assembled every kernel from the same table.
    let stem = |path: &str| path.rsplit('/').next().and_then(|file| file.strip_suffix(".wgsl")) == Some(name);
    let path = FILES.iter().map(|f| f.0).find(|path| stem(path)).unwrap_or_default();
    wgsl::assemble(path, pages, &file).unwrap_or_default()
}

/// What a binding of a layout is.
#[derive(Clone, Copy)]
enum Bound {
    Read,
    Write,
    Params,
}

/// Groups that a kernel binds beside 0 (scene) and 1 (rays).
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Groups {
    /// 3: tiles.
    Tiles,
    /// 2: cache, 3: tiles.
    CacheTiles,
    /// 2: lamps, 3: shading.
    Shading,
    /// 2: cache, 3: shading.
    CacheShading,
    /// 2: cache, 3: texture lookups.
    Sampling,
}

/// All pipelines and the layouts of their groups.
pub struct Kernels {
    /// Numbers of pages that they bind.
    pub pages: Pages,
    /// Group 0: the resident part of the scene.
    pub scene: wgpu::BindGroupLayout,
    /// Group 1: parameters and rays.
    pub rays: wgpu::BindGroupLayout,
    /// Group 2: pages of the cache.
    pub cache: wgpu::BindGroupLayout,
    /// Group 2 of shading kernels that do not read the cache: the lamps.
    pub lamps: wgpu::BindGroupLayout,
    /// Group 3 of tile kernels.
    pub tiles: wgpu::BindGroupLayout,
    /// Group 3 of shading kernels.
    pub shading: wgpu::BindGroupLayout,
    /// Group 3 of texture lookups.
    pub sampling: wgpu::BindGroupLayout,
    /// A group of nothing.
    pub none: wgpu::BindGroupLayout,
    pipelines: HashMap<&'static str, wgpu::ComputePipeline>,
}

/// Kernel, groups, override constants, and the name of the specialisation.
type Specialisation = (&'static str, &'static str, Groups, &'static [(&'static str, f64)]);

const SPECIALISATIONS: &[Specialisation] = &[
    ("generate_primary", "generate_primary", Groups::Tiles, &[]),
    ("generate_shadow", "generate_shadow", Groups::Shading, &[]),
    ("generate_around", "generate_occlusion", Groups::Shading, &[("LIMITED", 1.0)]),
    ("generate_around", "generate_diffuse", Groups::Shading, &[("LIMITED", 0.0)]),
    ("generate_glossy", "generate_glossy", Groups::Shading, &[]),
    ("start_hits", "start_hits", Groups::Tiles, &[]),
    ("clear_gbuffer", "clear_gbuffer", Groups::Shading, &[]),
    ("hit_demand", "hit_demand", Groups::Tiles, &[]),
    ("resolve", "resolve", Groups::CacheShading, &[]),
    ("sample", "sample", Groups::Sampling, &[]),
    ("shade", "shade", Groups::Shading, &[]),
    ("add_light", "add_light", Groups::Shading, &[]),
    ("add_occlusion", "add_occlusion", Groups::Shading, &[]),
    ("dvf_light", "dvf_light", Groups::Shading, &[]),
    ("tile_bounds", "tile_bounds", Groups::Tiles, &[]),
    ("tile_walk", "tile_walk_count", Groups::Tiles, &[("WRITE", 0.0)]),
    ("tile_walk", "tile_walk_write", Groups::Tiles, &[("WRITE", 1.0)]),
    ("tile_scan", "tile_scan", Groups::Tiles, &[]),
    ("tile_select", "tile_select", Groups::Tiles, &[("INTERSECT", 0.0)]),
    ("tile_select", "tile_select_intersect", Groups::Tiles, &[("INTERSECT", 1.0)]),
    ("tile_choose", "tile_choose", Groups::Tiles, &[]),
    ("tile_sort", "tile_sort_number", Groups::Tiles, &[("NEAR", 0.0)]),
    ("tile_sort", "tile_sort_near", Groups::Tiles, &[("NEAR", 1.0)]),
    ("query", "query", Groups::Tiles, &[]),
    ("query_pairs", "query_pairs", Groups::Tiles, &[]),
    ("query_reduce", "query_reduce", Groups::Tiles, &[]),
    ("intersect_list", "intersect_list", Groups::CacheTiles, &[("COUNT", 0.0)]),
    ("intersect_all", "intersect_all", Groups::CacheTiles, &[("COUNT", 0.0), ("SELECT", 0.0)]),
    ("intersect_all", "intersect_selected", Groups::CacheTiles, &[("COUNT", 0.0), ("SELECT", 1.0)]),
    ("intersect_all", "intersect_from_root", Groups::CacheTiles, &[("COUNT", 0.0), ("SELECT", 1.0), ("OF_TILES", 1.0)]),
    (
        "intersect_all",
        "intersect_from_root_all",
        Groups::CacheTiles,
        &[("COUNT", 0.0), ("SELECT", 0.0), ("OF_TILES", 1.0)],
    ),
    ("query_all", "query_all", Groups::Tiles, &[]),
    ("query_all", "query_from_root", Groups::Tiles, &[("OF_TILES", 1.0)]),
    ("query_all", "count_pairs", Groups::Tiles, &[("COUNT", 1.0)]),
];

/// The names of all specialisations.
#[cfg(test)]
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    SPECIALISATIONS.iter().map(|specialisation| specialisation.1)
}

/// Specialisations that count nodes and triangles, made only when counting is asked for.
const COUNTING: &[Specialisation] = &[
    ("intersect_list", "intersect_list", Groups::CacheTiles, &[("COUNT", 1.0)]),
    ("intersect_all", "intersect_all", Groups::CacheTiles, &[("COUNT", 1.0), ("SELECT", 0.0)]),
    ("intersect_all", "intersect_selected", Groups::CacheTiles, &[("COUNT", 1.0), ("SELECT", 1.0)]),
    ("intersect_all", "intersect_from_root", Groups::CacheTiles, &[("COUNT", 1.0), ("SELECT", 1.0), ("OF_TILES", 1.0)]),
    (
        "intersect_all",
        "intersect_from_root_all",
        Groups::CacheTiles,
        &[("COUNT", 1.0), ("SELECT", 0.0), ("OF_TILES", 1.0)],
    ),
];

impl Kernels {
    /// Compiles every kernel for `pages`. `count` makes intersection kernels count nodes and triangles.
    pub fn new(gpu: &Gpu, pages: Pages, count: bool) -> Self {
        Self::from_sources(gpu, pages, count, &|kernel| source(kernel, pages))
    }

    /// [`Self::new`] from the texts that `source` gives for the names of kernels.
    pub fn from_sources(gpu: &Gpu, pages: Pages, count: bool, source: &dyn Fn(&str) -> String) -> Self {
        use Bound::{Params, Read, Write};
        let device = &gpu.device;
        let scene = layout(device, "scene", &[Read; 8][..7 + usize::from(pages.opacity)]);
        let rays = layout(device, "rays", &[Params, Write, Write, Write, Write, Write]);
        let cache = layout(device, "cache", &vec![Read; pages.cache]);
        let tiles = layout(device, "tiles", &[Write, Write, Write, Write, Write, Read, Write, Read]);
        let shading = layout(device, "shading", &[Read, Write, Write, Write, Write, Write, Write, Write]);
        let fixed = [Read, Read, Read, Write, Write];
        let sampling = layout(device, "sampling", &[&fixed[..], &vec![Read; pages.texels]].concat());
        let lamps = layout(device, "lamps", &[Read; 4]);
        let none = layout(device, "none", &[]);
        let mut pipelines = HashMap::new();
        let mut layouts = HashMap::new();
        // Scenes without textures have no kernel that looks them up.
        let made = SPECIALISATIONS.iter().filter(|made| made.2 != Groups::Sampling || pages.texels > 0);
        for &(kernel, name, groups, constants) in made {
            let constants = COUNTING.iter().find(|c| count && c.1 == name).map_or(constants, |c| c.3);
            let layout = layouts.entry(groups).or_insert_with(|| {
                let (second, third) = match groups {
                    Groups::Tiles => (&none, &tiles),
                    Groups::CacheTiles => (&cache, &tiles),
                    Groups::Shading => (&lamps, &shading),
                    Groups::CacheShading => (&cache, &shading),
                    Groups::Sampling => (&cache, &sampling),
                };
                device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                    label: Some(name),
                    bind_group_layouts: &[Some(&scene), Some(&rays), Some(second), Some(third)],
                    immediate_size: 0,
                })
            });
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(kernel),
                source: wgpu::ShaderSource::Wgsl(source(kernel).into()),
            });
            let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(name),
                layout: Some(layout),
                module: &module,
                entry_point: Some("main"),
                compilation_options: wgpu::PipelineCompilationOptions { constants, ..Default::default() },
                cache: None,
            });
            pipelines.insert(name, pipeline);
        }
        Self { pages, scene, rays, cache, lamps, tiles, shading, sampling, none, pipelines }
    }

    /// The pipeline of a specialisation of the table above.
    pub fn pipeline(&self, name: &'static str) -> &wgpu::ComputePipeline {
        &self.pipelines[name]
    }
}

fn entry(binding: u32, bound: Bound) -> wgpu::BindGroupLayoutEntry {
    let ty = match bound {
        Bound::Params => wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Uniform,
            has_dynamic_offset: true,
            min_binding_size: None,
        },
        Bound::Read | Bound::Write => wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Storage { read_only: matches!(bound, Bound::Read) },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
    };
    wgpu::BindGroupLayoutEntry { binding, visibility: wgpu::ShaderStages::COMPUTE, ty, count: None }
}

fn layout(device: &wgpu::Device, label: &str, bindings: &[Bound]) -> wgpu::BindGroupLayout {
    let entries: Vec<_> = bindings.iter().enumerate().map(|(i, &b)| entry(i as u32, b)).collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
}

/// The layout of group 2 of kernels over occupancy maps.
pub fn roma_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    layout(device, "roma", &[Bound::Read, Bound::Read, Bound::Read, Bound::Write])
}

/// The layout of group 2 of kernels over distance fields.
pub fn field_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    layout(device, "field", &[Bound::Read, Bound::Read, Bound::Write, Bound::Write])
}

/// The layout of group 2 of kernels over reflective shadow maps: the lamps, the maps and their texels.
pub fn rsm_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    use Bound::{Read, Write};
    layout(device, "rsm", &[Read, Read, Read, Read, Read, Write])
}

/// The layout of group 2 of kernels over discrete visibility fields.
pub fn dvf_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    use Bound::{Read, Write};
    layout(device, "dvf", &[Read, Write, Write, Read, Write, Read, Write, Read, Write])
}

/// The layout of a group of `count` storage buffers that are read.
pub fn read_layout(device: &wgpu::Device, label: &str, count: usize) -> wgpu::BindGroupLayout {
    layout(device, label, &vec![Bound::Read; count])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::panic::AssertUnwindSafe;

    /// The device checks the limit when pipelines are made, and panics where no one asked for its errors.
    #[test]
    fn as_many_pages_as_are_promised_can_be_bound() {
        let gpu = Gpu::open(None).unwrap();
        let pages = |cache| Pages { cache, texels: 1, opacity: true, gloss: true };
        let cache = gpu.max_cache_pages(pages(0));
        assert!(cache > 1, "{cache} pages");
        Kernels::new(&gpu, pages(cache), false);
        let is_at_the_limit = cache < 64;
        let refused =
            std::panic::catch_unwind(AssertUnwindSafe(|| Kernels::new(&gpu, pages(cache + 1), false))).is_err();
        assert_eq!(refused, is_at_the_limit, "one page more than {cache}");
    }
}
