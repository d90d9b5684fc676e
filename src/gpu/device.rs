//! The adapter, its limits, and the device made from it.

use super::wgsl::Pages;
use crate::kernels::DeviceInfo;
use thiserror::Error;

/// Why there is no device to work with.
#[derive(Debug, Error)]
pub enum DeviceError {
    /// No adapter, or none of the given name.
    #[error("no Vulkan, Metal or DirectX 12 adapter{}; found: {found}; choose one of them, or install a driver (software Vulkan on Debian: apt-get install libvulkan1 mesa-vulkan-drivers), or render on the processor with --adapter cpu", .wanted.as_ref().map(|w| format!(" whose name contains {w:?}")).unwrap_or_default())]
    NoAdapter {
        /// The name asked for.
        wanted: Option<String>,
        /// Names of the adapters present.
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
    #[error("adapter {adapter:?} allows {found} {what}, {needed} are needed; choose another with --adapter")]
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
    /// What it allows.
    pub limits: wgpu::Limits,
    /// What it lacks without which nothing works.
    pub flaw: Option<String>,
}

impl Candidate {
    fn new(adapter: wgpu::Adapter) -> Self {
        let (info, limits) = (adapter.get_info(), adapter.limits());
        let flaw = check_limits(&info, &limits).err().map(|error| error.to_string());
        Self { adapter: Some(adapter), info, limits, flaw }
    }

    /// Whether it is more than a program on the processor.
    pub fn is_hardware(&self) -> bool {
        use wgpu::DeviceType::{DiscreteGpu, IntegratedGpu, VirtualGpu};
        matches!(self.info.device_type, DiscreteGpu | IntegratedGpu | VirtualGpu)
    }

    /// The lower, the better.
    pub fn rank(&self) -> u32 {
        rank(&self.info)
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
        Gpu::from_adapter(adapter)
    }
}

/// The adapters of Vulkan, Metal and DirectX 12. OpenGL is a fallback that must be asked for by name.
pub fn candidates() -> Vec<Candidate> {
    adapters(wgpu::Backends::PRIMARY).into_iter().map(Candidate::new).collect()
}

/// The lower, the better.
fn rank(info: &wgpu::AdapterInfo) -> u32 {
    match info.device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Cpu => 3,
        wgpu::DeviceType::Other => 4,
    }
}

/// Refuses what lacks something without which nothing works.
fn check_limits(info: &wgpu::AdapterInfo, limits: &wgpu::Limits) -> Result<(), DeviceError> {
    let found = limits.max_storage_buffers_per_shader_stage;
    if found < FIXED_STORAGE_BUFFERS + 4 {
        return Err(DeviceError::Limit {
            adapter: info.name.clone(),
            what: "storage buffers a kernel",
            found: found.into(),
            needed: (FIXED_STORAGE_BUFFERS + 4).into(),
        });
    }
    Ok(())
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
    pub fn open(wanted: Option<&str>) -> Result<Self, DeviceError> {
        // OpenGL is a fallback alone: merely asking for it makes its libraries talk on standard error.
        let mut adapters = adapters(wgpu::Backends::PRIMARY);
        if adapters.is_empty() {
            adapters = self::adapters(wgpu::Backends::GL);
        }
        let found = adapters.iter().map(|a| a.get_info().name).collect::<Vec<_>>().join(", ");
        if let Some(wanted) = wanted {
            let wanted = wanted.to_lowercase();
            adapters.retain(|a| a.get_info().name.to_lowercase().contains(&wanted));
        }
        let Some(adapter) = adapters.into_iter().min_by_key(|a| rank(&a.get_info())) else {
            let found = if found.is_empty() { "none".to_string() } else { found };
            return Err(DeviceError::NoAdapter { wanted: wanted.map(str::to_string), found });
        };
        Self::from_adapter(&adapter)
    }

    fn from_adapter(adapter: &wgpu::Adapter) -> Result<Self, DeviceError> {
        let info = adapter.get_info();
        let limits = adapter.limits();
        check_limits(&info, &limits)?;
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
        let host_memory = matches!(info.device_type, wgpu::DeviceType::Cpu | wgpu::DeviceType::IntegratedGpu);
        let forced = std::env::var("BRICKWALK_UPLOAD").is_ok_and(|v| v == "staged");
        let mapped = host_memory && features.contains(wgpu::Features::MAPPABLE_PRIMARY_BUFFERS) && !forced;
        let upload = if mapped { UploadPath::Mapped } else { UploadPath::Staged };
        let timestamps = features.contains(wgpu::Features::TIMESTAMP_QUERY);
        Ok(Self { device, queue, info, limits, timestamps, upload, local_memory: local_memory(adapter) })
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

    /// Most pages of cache beside so many pages of texels, and the table of opacity.
    pub fn max_cache_pages(&self, beside: Pages) -> usize {
        let taken = (SAMPLING_STORAGE_BUFFERS + beside.texels).max(FIXED_STORAGE_BUFFERS as usize)
            + usize::from(beside.opacity);
        let pages = (self.limits.max_storage_buffers_per_shader_stage as usize).saturating_sub(taken);
        // Kernels that light bind lamps in place of the cache.
        if pages < LAMP_STORAGE_BUFFERS { 0 } else { pages.min(64) }
    }
}
