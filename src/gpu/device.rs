//! The adapter, its limits, and the device made from it.

use super::wgsl::Pages;
use crate::kernels::DeviceInfo;
use bricks::one_line;
use bricks::planted::{self, Defect};
use std::sync::{Arc, Mutex, PoisonError};
use thiserror::Error;

/// Why there is no device to work with.
#[derive(Debug, Error)]
pub enum DeviceError {
    /// No adapter, or none of the given name.
    #[error(
        "no adapter{} can be used; {found}; render on the processor with --adapter cpu, or install a Vulkan driver (in \
         software, on Debian: apt-get install libvulkan1 mesa-vulkan-drivers)",
        .wanted.as_ref().map(|w| format!(" whose name contains {w:?}")).unwrap_or_default()
    )]
    NoAdapter {
        /// The name asked for.
        wanted: Option<String>,
        /// The adapters present, those that cannot be used apart.
        found: String,
    },
    /// The driver refused.
    #[error("adapter {adapter:?} gives no device: {reason}; update its driver or choose another with --adapter")]
    NoDevice {
        /// Adapter name.
        adapter: String,
        /// The driver's words.
        reason: String,
    },
    /// The adapter lacks something without which nothing works.
    #[error("adapter {adapter:?} allows {found} {what}, {needed} are needed; `brickwalk adapters` lists others")]
    Limit {
        /// Adapter name.
        adapter: String,
        /// The limit.
        what: &'static str,
        /// What it allows.
        found: u64,
        /// What is needed.
        needed: u64,
    },
}

/// How payloads reach the cache pages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UploadPath {
    /// Pages are mapped and written in place: integrated and software adapters, where device memory is host memory.
    Mapped,
    /// A reused staging buffer is mapped, written, and copied on the device.
    Staged,
}

impl UploadPath {
    /// The name that reports use.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mapped => "mapped pages",
            Self::Staged => "staging buffer",
        }
    }
}

/// A device with everything of it that the executor asks about. Clones share the device.
#[derive(Clone)]
pub struct Gpu {
    /// The device.
    pub device: wgpu::Device,
    /// Its one queue.
    pub queue: wgpu::Queue,
    /// Name, driver, backend.
    pub info: wgpu::AdapterInfo,
    /// Limits in force: those of the adapter.
    pub limits: wgpu::Limits,
    /// Whether passes are timed on the device.
    pub timestamps: bool,
    /// How payloads reach the cache.
    pub upload: UploadPath,
    /// Bytes of the device's own memory, where the driver states them.
    pub local_memory: Option<u64>,
    /// The first that the device said of what nobody waits for, and nobody asked about since.
    complaint: Arc<Mutex<Option<String>>>,
}

/// Adapters of the given backends.
fn adapters(backends: wgpu::Backends) -> Vec<wgpu::Adapter> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = backends;
    pollster::block_on(wgpu::Instance::new(descriptor).enumerate_adapters(backends))
}

/// Storage buffers a kernel needs besides cache pages: 7 of the scene, 5 of the rays, 8 of the tiles of rays or of
/// shading.
const FIXED_STORAGE_BUFFERS: u32 = 20;
/// Storage buffers of the lamps, in place of pages of the cache.
const LAMP_STORAGE_BUFFERS: usize = 4;

/// Those that texture lookups need besides cache and texel pages: 7 of the scene, 5 of the rays, 5 of their own.
const SAMPLING_STORAGE_BUFFERS: usize = 17;

/// An adapter that there is.
pub struct Candidate {
    adapter: Option<wgpu::Adapter>,
    /// Name, driver, backend.
    pub info: wgpu::AdapterInfo,
    /// What it allows. A device is opened with these, which may be lowered before.
    pub limits: wgpu::Limits,
    /// What it lacks without which nothing works.
    pub flaw: Option<String>,
}

impl Candidate {
    fn new(adapter: wgpu::Adapter) -> Self {
        let (info, limits) = (adapter.get_info(), adapter.limits());
        let flaw = missing(&limits).map(|(what, found, needed)| format!("{found} {what}, {needed} are needed"));
        Self { adapter: Some(adapter), info, limits, flaw }
    }

    /// Whether it is more than a program on the processor.
    pub fn is_hardware(&self) -> bool {
        use wgpu::DeviceType::{DiscreteGpu, IntegratedGpu, VirtualGpu};
        matches!(self.info.device_type, DiscreteGpu | IntegratedGpu | VirtualGpu)
    }

    /// The lower, the better.
    pub fn rank(&self) -> u32 {
        match self.info.device_type {
            wgpu::DeviceType::DiscreteGpu => 0,
            wgpu::DeviceType::IntegratedGpu => 1,
            wgpu::DeviceType::VirtualGpu => 2,
            wgpu::DeviceType::Cpu => 3,
            wgpu::DeviceType::Other => 4,
        }
    }

    /// What it is, in words.
    pub fn kind(&self) -> &'static str {
        match self.info.device_type {
            wgpu::DeviceType::DiscreteGpu => "discrete GPU",
            wgpu::DeviceType::IntegratedGpu => "integrated GPU",
            wgpu::DeviceType::VirtualGpu => "virtual GPU",
            wgpu::DeviceType::Cpu => "software",
            wgpu::DeviceType::Other => "other",
        }
    }

    /// Largest number of bytes of one page of the cache or of the texels.
    pub fn page_bytes(&self) -> u64 {
        page_bytes(&self.limits)
    }

    /// One that cannot be opened, sound or not.
    #[cfg(test)]
    pub fn for_tests(device_type: wgpu::DeviceType, is_sound: bool) -> Self {
        let info = wgpu::AdapterInfo::new(device_type, wgpu::Backend::Vulkan);
        let flaw = (!is_sound).then(|| "it is a test".into());
        Self { adapter: None, info, limits: wgpu::Limits::default(), flaw }
    }

    /// Opens it.
    ///
    /// # Errors
    /// It gives no device, or lacks something.
    pub fn open(&self) -> Result<Gpu, DeviceError> {
        let adapter = self
            .adapter
            .as_ref()
            .ok_or_else(|| DeviceError::NoAdapter { wanted: Some(self.info.name.clone()), found: "none".into() })?;
        Gpu::from_adapter(adapter, &self.limits)
    }
}

/// The adapters of Vulkan, Metal and DirectX 12.
pub fn candidates() -> Vec<Candidate> {
    adapters(wgpu::Backends::PRIMARY).into_iter().map(Candidate::new).collect()
}

/// The same, or where there are none those of OpenGL: a fallback that must be asked for by name. Merely asking for it
/// makes its libraries talk on standard error.
pub fn candidates_by_name() -> Vec<Candidate> {
    let found = candidates();
    if found.is_empty() { adapters(wgpu::Backends::GL).into_iter().map(Candidate::new).collect() } else { found }
}

/// The best of `candidates` that can be used, with `wanted` of those whose name contains it, in any case.
///
/// # Errors
/// None of them can be: which can, and what others lack.
fn choose(candidates: Vec<Candidate>, wanted: Option<&str>) -> Result<Candidate, DeviceError> {
    let names = |is_usable: bool| {
        let all = candidates.iter().filter(|c| c.flaw.is_none() == is_usable);
        let names = all.map(|c| match &c.flaw {
            Some(flaw) => format!("{} ({flaw})", c.info.name),
            None => c.info.name.clone(),
        });
        let names = names.collect::<Vec<_>>().join(", ");
        if names.is_empty() { "none".to_string() } else { names }
    };
    let mut found = format!("usable: {}", names(true));
    if candidates.iter().any(|c| c.flaw.is_some()) {
        found += &format!("; not usable: {}", names(false));
    }
    let is_meant = |c: &Candidate| {
        let has = |wanted: &str| c.info.name.to_lowercase().contains(&wanted.to_lowercase());
        c.flaw.is_none() && wanted.is_none_or(has)
    };
    let best = candidates.into_iter().filter(is_meant).min_by_key(Candidate::rank);
    best.ok_or_else(|| DeviceError::NoAdapter { wanted: wanted.map(str::to_string), found })
}

/// What limits are short of without which nothing works: its name, how much there is, how much is needed.
fn missing(limits: &wgpu::Limits) -> Option<(&'static str, u64, u64)> {
    // What kernels have; all but the first is what WebGPU wants of every device.
    let all = [
        ("storage buffers a kernel", limits.max_storage_buffers_per_shader_stage, FIXED_STORAGE_BUFFERS + 4),
        ("uniform buffers a kernel", limits.max_uniform_buffers_per_shader_stage, 2),
        ("uniform buffers with offsets", limits.max_dynamic_uniform_buffers_per_pipeline_layout, 2),
        ("groups of bindings", limits.max_bind_groups, 4),
        ("invocations a workgroup", limits.max_compute_invocations_per_workgroup, 256),
        ("invocations of a workgroup along x", limits.max_compute_workgroup_size_x, 256),
        ("invocations of a workgroup along y", limits.max_compute_workgroup_size_y, 8),
        ("invocations of a workgroup along z", limits.max_compute_workgroup_size_z, 1),
        ("bytes that a workgroup shares", limits.max_compute_workgroup_storage_size, 16_384),
        ("workgroups along an axis", limits.max_compute_workgroups_per_dimension, 65_535),
    ];
    let lacks = |&(_, found, needed): &(&str, u32, u32)| found < needed;
    all.into_iter().find(lacks).map(|(what, found, needed)| (what, found.into(), needed.into()))
}

/// Whether an adapter's memory is the host's: integrated and software adapters.
pub fn is_host_memory(info: &wgpu::AdapterInfo) -> bool {
    matches!(info.device_type, wgpu::DeviceType::Cpu | wgpu::DeviceType::IntegratedGpu)
}

/// Keeps the first complaint.
fn note(complaint: &Mutex<Option<String>>, text: &str) {
    complaint.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_with(|| one_line(text));
}

/// Bytes of the largest heap of an adapter's own memory; `None` where its backend does not tell.
fn local_memory(adapter: &wgpu::Adapter) -> Option<u64> {
    const DEVICE_LOCAL: u32 = 1;
    // SAFETY: nothing is done with the adapter but ask it; it is not destroyed.
    let adapter = unsafe { adapter.as_hal::<wgpu::hal::api::Vulkan>() }?;
    let instance = adapter.shared_instance().raw_instance();
    // SAFETY: the physical device is one of this instance.
    let memory = unsafe { instance.get_physical_device_memory_properties(adapter.raw_physical_device()) };
    let heaps = memory.memory_heaps.iter().take(memory.memory_heap_count as usize);
    heaps.filter(|heap| heap.flags.as_raw() & DEVICE_LOCAL != 0).map(|heap| heap.size).max()
}

/// Largest number of bytes of one page of the cache or of the texels.
fn page_bytes(limits: &wgpu::Limits) -> u64 {
    let binding = limits.max_storage_buffer_binding_size;
    // Offsets within a page are u32 words, and 1 GiB keeps an allocation within what drivers give in one piece.
    binding.min(limits.max_buffer_size).min(1 << 30) / 256 * 256
}

impl Gpu {
    /// Opens the adapter whose name contains `wanted` (any case), or by itself a discrete GPU, else an integrated one,
    /// else whatever there is. `BRICKWALK_UPLOAD=staged` forces the staging buffer where pages could be mapped.
    ///
    /// # Errors
    /// There is none; it cannot be used, or gives no device.
    pub fn open(wanted: Option<&str>) -> Result<Self, DeviceError> {
        choose(candidates_by_name(), wanted)?.open()
    }

    fn from_adapter(adapter: &wgpu::Adapter, limits: &wgpu::Limits) -> Result<Self, DeviceError> {
        let info = adapter.get_info();
        let limits = limits.clone();
        if let Some((what, found, needed)) = missing(&limits) {
            return Err(DeviceError::Limit { adapter: info.name, what, found, needed });
        }
        let wanted = wgpu::Features::TIMESTAMP_QUERY | wgpu::Features::MAPPABLE_PRIMARY_BUFFERS;
        let features = adapter.features() & wanted;
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("brickwalk"),
            required_features: features,
            required_limits: limits.clone(),
            memory_hints: wgpu::MemoryHints::Performance,
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|e| DeviceError::NoDevice { adapter: info.name.clone(), reason: e.to_string() })?;
        let complaint = Arc::<Mutex<Option<String>>>::default();
        let (wrong, lost) = (complaint.clone(), complaint.clone());
        // Instead of a panic wherever something was asked for last.
        if !planted::is(Defect::DeviceRefusal) {
            device.on_uncaptured_error(Arc::new(move |error| note(&wrong, &error.to_string())));
        }
        device.set_device_lost_callback(move |_, text| {
            note(&lost, &format!("the driver lost it ({text}); start again, or render with --adapter cpu"));
        });
        let forced = std::env::var("BRICKWALK_UPLOAD").is_ok_and(|v| v == "staged");
        let mapped = is_host_memory(&info) && features.contains(wgpu::Features::MAPPABLE_PRIMARY_BUFFERS) && !forced;
        let upload = if mapped { UploadPath::Mapped } else { UploadPath::Staged };
        let timestamps = features.contains(wgpu::Features::TIMESTAMP_QUERY);
        let local_memory = local_memory(adapter);
        Ok(Self { device, queue, info, limits, timestamps, upload, local_memory, complaint })
    }

    /// What the device said since this was asked last, of what nobody waits for: it was lost, or something that it was
    /// asked for was refused.
    pub fn complaint(&self) -> Option<String> {
        self.complaint.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// A buffer of so many bytes.
    pub fn buffer(&self, label: &str, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
        let label = Some(label);
        self.device.create_buffer(&wgpu::BufferDescriptor { label, size, usage, mapped_at_creation: false })
    }

    /// What summaries say of it.
    pub fn device_info(&self) -> DeviceInfo {
        DeviceInfo {
            name: self.info.name.clone(),
            driver: self.info.driver.clone(),
            driver_info: self.info.driver_info.clone(),
            backend: self.info.backend.to_string(),
            upload: self.upload.name(),
            timestamps: self.timestamps,
        }
    }

    /// Largest number of bytes of one page of the cache or of the texels.
    pub fn page_bytes(&self) -> u64 {
        page_bytes(&self.limits)
    }

    /// Most pages of cache beside so many pages of texels, and what else kernels ask for.
    pub fn max_cache_pages(&self, beside: Pages) -> usize {
        let taken = (SAMPLING_STORAGE_BUFFERS + beside.texels).max(FIXED_STORAGE_BUFFERS as usize) + beside.of_scene();
        let pages = (self.limits.max_storage_buffers_per_shader_stage as usize).saturating_sub(taken);
        // Kernels that light bind lamps in place of the cache.
        if pages < LAMP_STORAGE_BUFFERS { 0 } else { pages.min(64) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wgpu::DeviceType::{Cpu, DiscreteGpu};

    fn named(name: &str, kind: wgpu::DeviceType, is_sound: bool) -> Candidate {
        let mut candidate = Candidate::for_tests(kind, is_sound);
        candidate.info.name = name.into();
        candidate
    }

    #[test]
    fn what_cannot_be_used_is_not_proposed() {
        let all =
            || vec![named("llvmpipe", Cpu, false), named("Software", Cpu, true), named("GeForce", DiscreteGpu, true)];
        let name = |wanted| choose(all(), wanted).map(|c| c.info.name);
        assert_eq!(name(None).unwrap(), "GeForce");
        assert_eq!(name(Some("soft")).unwrap(), "Software");
        for wanted in ["nvidia", "llvm"] {
            let says = name(Some(wanted)).unwrap_err().to_string();
            assert!(says.contains("usable: Software, GeForce; not usable: llvmpipe (it is a test)"), "{says}");
            assert!(says.contains(wanted) && says.contains("--adapter cpu"), "{says}");
        }
        let says = choose(vec![named("llvmpipe", Cpu, false)], None).err().unwrap().to_string();
        assert!(says.contains("usable: none; not usable: llvmpipe"), "{says}");
    }

    #[test]
    fn too_few_buffers_are_a_flaw() {
        let limits = |n| wgpu::Limits { max_storage_buffers_per_shader_stage: n, ..wgpu::Limits::default() };
        assert_eq!(missing(&limits(24)), None);
        assert_eq!(missing(&limits(16)), Some(("storage buffers a kernel", 16, 24)));
        let narrow = wgpu::Limits { max_compute_invocations_per_workgroup: 64, ..limits(24) };
        assert_eq!(missing(&narrow), Some(("invocations a workgroup", 64, 256)));
    }
}
