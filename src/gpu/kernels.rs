//! Bind group layouts and pipelines: one pipeline a kernel, named as its file.

use super::device::Gpu;
use super::wgsl;
use super::wgsl::Pages;
use crate::kernels::table::{Bindings, Family, KERNELS, Kernel};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));

/// The text of a kernel's file with everything it includes.
pub fn source(file: &str, pages: Pages) -> String {
    source_with(file, pages, &|_| None)
}

/// [`source`] with the files that `generated` gives in place of the shipped ones.
pub(crate) fn source_with(file: &str, pages: Pages, generated: &dyn Fn(&str) -> Option<String>) -> String {
    let shipped = |name: &str| FILES.iter().find(|f| f.0 == name).map(|f| f.1.to_string());
    let text = |name: &str| generated(name).or_else(|| shipped(name));
    // The build has assembled every kernel from the same table.
    wgsl::assemble(&format!("{file}.wgsl"), pages, &text).unwrap_or_default()
}

/// What a binding of a layout is.
#[derive(Clone, Copy)]
enum Bound {
    Read,
    Write,
    Params,
}

/// The text of a kernel's file, with everything it includes.
type Source = Arc<dyn Fn(&str) -> String + Send + Sync>;

/// A pipeline, which is compiled when it is first wanted: few frames run all kernels.
pub struct Pipeline {
    device: wgpu::Device,
    kernel: &'static Kernel,
    layout: wgpu::PipelineLayout,
    count: bool,
    source: Source,
    made: OnceLock<wgpu::ComputePipeline>,
}

impl Pipeline {
    /// The pipeline.
    pub fn get(&self) -> &wgpu::ComputePipeline {
        self.made.get_or_init(|| self.compile())
    }

    fn compile(&self) -> wgpu::ComputePipeline {
        let kernel = self.kernel;
        let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(kernel.file),
            source: wgpu::ShaderSource::Wgsl((self.source)(kernel.file).into()),
        });
        let counted = |&(name, value): &(&'static str, f64)| {
            let is_counting = self.count && name == "COUNT";
            (name, if is_counting { 1.0 } else { value })
        };
        let constants: Vec<(&str, f64)> = kernel.overrides.iter().map(counted).collect();
        self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(kernel.name),
            layout: Some(&self.layout),
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() },
            cache: None,
        })
    }
}

/// Pipelines of a family, and the layout of group 2.
pub struct FamilyPipelines {
    /// Group 2 of its kernels.
    pub layout: wgpu::BindGroupLayout,
    pipelines: Vec<(&'static str, Pipeline)>,
}

impl FamilyPipelines {
    /// The pipeline of a kernel, if it is one of these.
    pub fn pipeline(&self, name: &str) -> Option<&wgpu::ComputePipeline> {
        self.pipelines.iter().find(|(own, _)| *own == name).map(|(_, pipeline)| pipeline.get())
    }
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
    /// Whether intersection kernels count nodes and triangles.
    pub count: bool,
    source: Source,
    pipelines: HashMap<&'static str, Pipeline>,
    /// Those of families that an executor has asked for.
    families: Mutex<Vec<(&'static Family, Arc<FamilyPipelines>)>>,
}

impl Kernels {
    /// Every kernel for `pages`. `count` makes intersection kernels count nodes and triangles.
    pub fn new(gpu: &Gpu, pages: Pages, count: bool) -> Self {
        Self::from_sources(gpu, pages, count, move |file| source(file, pages))
    }

    /// [`Self::new`] from the texts that `source` gives for the files of kernels.
    pub fn from_sources(
        gpu: &Gpu,
        pages: Pages,
        count: bool,
        source: impl Fn(&str) -> String + Send + Sync + 'static,
    ) -> Self {
        use Bound::{Params, Read, Write};
        let device = &gpu.device;
        let opacity = pages.opacity.then_some(wgsl::OPACITY_BINDING);
        let levels = (wgsl::LEVEL_BINDING..wgsl::LEVEL_BINDING + 2).filter(|_| pages.levels);
        let hidden = pages.hides.then_some(wgsl::HIDDEN_BINDING);
        let of_scene = (0..7).chain(opacity).chain(levels).chain(hidden).map(|binding| entry(binding, Read));
        let scene = layout_of(device, "scene", &of_scene.collect::<Vec<_>>());
        let rays = layout(device, "rays", &[Params, Write, Write, Write, Write, Write, Params]);
        let cache = layout(device, "cache", &vec![Read; pages.cache]);
        let tiles = layout(device, "tiles", &[Write, Write, Write, Write, Write, Read, Write, Read]);
        let shading = layout(device, "shading", &[Read, Write, Write, Write, Write, Write, Write, Write]);
        let fixed = [Read, Read, Read, Write, Write];
        let sampling = layout(device, "sampling", &[&fixed[..], &vec![Read; pages.texels]].concat());
        let lamps = layout(device, "lamps", &[Read; 4]);
        let none = layout(device, "none", &[]);
        let (source, pipelines): (Source, _) = (Arc::new(source), HashMap::new());
        let families = Mutex::default();
        let mut all = Self {
            pages,
            scene,
            rays,
            cache,
            lamps,
            tiles,
            shading,
            sampling,
            none,
            count,
            source,
            pipelines,
            families,
        };
        // Scenes without textures have no kernel that looks them up, and those without binary trees none over them.
        let is_made = |kernel: &&Kernel| match kernel.bindings {
            Bindings::Sampling => pages.texels > 0,
            Bindings::Binary => false,
            _ => true,
        };
        let layout = |bindings| all.pipeline_layout(gpu, bindings, None);
        let mut layouts = HashMap::new();
        let mut pipelines = HashMap::new();
        for kernel in KERNELS.iter().filter(is_made) {
            let layout = layouts.entry(kernel.bindings).or_insert_with(|| layout(kernel.bindings));
            pipelines.insert(kernel.name, all.pipeline_of(gpu, kernel, layout.clone(), None));
        }
        all.pipelines = pipelines;
        all
    }

    /// The layout of kernels that bind so; `own`: group 2 of those of a family.
    pub fn pipeline_layout(
        &self,
        gpu: &Gpu,
        bindings: Bindings,
        own: Option<&wgpu::BindGroupLayout>,
    ) -> wgpu::PipelineLayout {
        let (second, third) = match bindings {
            Bindings::Tiles => (&self.none, &self.tiles),
            Bindings::CacheTiles | Bindings::Binary => (&self.cache, &self.tiles),
            Bindings::Shading => (&self.lamps, &self.shading),
            Bindings::CacheShading => (&self.cache, &self.shading),
            Bindings::Sampling => (&self.cache, &self.sampling),
            Bindings::Own => (own.unwrap_or(&self.none), &self.shading),
        };
        gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &[Some(&self.scene), Some(&self.rays), Some(second), Some(third)],
            immediate_size: 0,
        })
    }

    /// The pipeline of a kernel; `source` gives the text of its file where that is not as for all.
    pub fn pipeline_of(
        &self,
        gpu: &Gpu,
        kernel: &'static Kernel,
        layout: wgpu::PipelineLayout,
        source: Option<Source>,
    ) -> Pipeline {
        let source = source.unwrap_or_else(|| self.source.clone());
        Pipeline { device: gpu.device.clone(), kernel, layout, count: self.count, source, made: OnceLock::new() }
    }

    /// The pipelines of a family, which all executors with these kernels share.
    pub fn family(&self, gpu: &Gpu, family: &'static Family) -> Arc<FamilyPipelines> {
        let mut families = self.families.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, made)) = families.iter().find(|(own, _)| std::ptr::eq(*own, family)) {
            return made.clone();
        }
        let layout = family_layout(&gpu.device, family);
        let pipelines = family.kernels.iter().map(|kernel| {
            let own = (kernel.bindings == Bindings::Own).then_some(&layout);
            let pipeline_layout = self.pipeline_layout(gpu, kernel.bindings, own);
            (kernel.name, self.pipeline_of(gpu, kernel, pipeline_layout, None))
        });
        let pipelines = pipelines.collect();
        let made = Arc::new(FamilyPipelines { layout, pipelines });
        families.push((family, made.clone()));
        made
    }

    /// The pipeline of a kernel of [`KERNELS`], if there is one.
    pub fn pipeline(&self, name: &str) -> Option<&wgpu::ComputePipeline> {
        self.pipelines.get(name).map(Pipeline::get)
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
    layout_of(device, label, &bindings.iter().enumerate().map(|(i, &b)| entry(i as u32, b)).collect::<Vec<_>>())
}

fn layout_of(device: &wgpu::Device, label: &str, entries: &[wgpu::BindGroupLayoutEntry]) -> wgpu::BindGroupLayout {
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries })
}

/// The layout of group 2 of the kernels of a family.
pub fn family_layout(device: &wgpu::Device, family: &Family) -> wgpu::BindGroupLayout {
    let lamps = if family.has_lamps { &[Bound::Read; 4][..] } else { &[] };
    let own = family.buffers.iter().map(|buffer| if buffer.is_written { Bound::Write } else { Bound::Read });
    layout(device, family.name, &lamps.iter().copied().chain(own).collect::<Vec<_>>())
}

/// The layout of a group of `count` storage buffers that are read.
pub fn read_layout(device: &wgpu::Device, label: &str, count: usize) -> wgpu::BindGroupLayout {
    layout(device, label, &vec![Bound::Read; count])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where no ray can take a level, kernels have nothing of levels or of the widths of cones.
    #[test]
    fn without_levels_nothing_of_them_is_in_kernels() {
        let has = |levels: bool| -> Vec<&str> {
            let pages = Pages { cache: 1, texels: 1, opacity: true, gloss: true, layers: true, levels, hides: true };
            let of_levels = |file: &str| {
                let text = source(file, pages);
                ["params.levels", "level_leaves", "pending >>", "workgroup> spreads"]
                    .iter()
                    .any(|part| text.contains(part))
            };
            KERNELS.iter().filter(|kernel| of_levels(kernel.file)).map(|kernel| kernel.name).collect()
        };
        assert_eq!(has(false), Vec::<&str>::new());
        let with = has(true);
        for name in ["intersect_all", "query", "tile_bounds", "generate_glossy"] {
            assert!(with.contains(&name), "{name} is not in {with:?}");
        }
    }

    /// Where no material has sheen, anisotropy or a film, kernels have nothing of them.
    #[test]
    fn without_layers_nothing_of_them_is_in_kernels() {
        let has = |layers: bool| -> Vec<&str> {
            let pages = Pages { cache: 1, texels: 1, opacity: true, gloss: true, layers, levels: true, hides: true };
            let of_layers = |file: &str| {
                let text = source(file, pages);
                ["SHEENS + ", "film_index", "alpha_along", "STRETCHED + ", "sheen_masking"]
                    .iter()
                    .any(|part| text.contains(part))
            };
            KERNELS.iter().filter(|kernel| of_layers(kernel.file)).map(|kernel| kernel.name).collect()
        };
        assert_eq!(has(false), Vec::<&str>::new());
        let with = has(true);
        for name in ["shade", "add_light", "generate_glossy", "generate_path"] {
            assert!(with.contains(&name), "{name} is not in {with:?}");
        }
    }

    /// The device checks the limit when pipelines are made, and complains.
    #[test]
    fn as_many_pages_as_are_promised_can_be_bound() {
        let gpu = Gpu::open(None).unwrap();
        let pages =
            |cache| Pages { cache, texels: 1, opacity: true, gloss: true, layers: true, levels: true, hides: true };
        let cache = gpu.max_cache_pages(pages(0));
        assert!(cache > 1, "{cache} pages");
        Kernels::new(&gpu, pages(cache), false);
        assert_eq!(gpu.complaint(), None, "{cache} pages");
        let is_at_the_limit = cache < 64;
        Kernels::new(&gpu, pages(cache + 1), false);
        assert_eq!(gpu.complaint().is_some(), is_at_the_limit, "one page more than {cache}");
    }
}
