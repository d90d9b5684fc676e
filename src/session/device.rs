//! Which device renders: a graphics adapter, or the processor itself. Nothing but this module tells them apart.

use super::passed;
use crate::cpu;
use crate::cpu::CpuExecutor;
use crate::gpu::device::{Candidate, Gpu, candidates, is_host_memory};
use crate::gpu::executor::GpuExecutor;
use crate::gpu::probe;
use crate::gpu::rays::most_rays;
use crate::kernels::{DeviceInfo, FrameExecutor, Setup};
use crate::settings::Adapter;
use crate::stream::{HostCache, Workers};
use anyhow::{Result, bail};
use bricks::SceneFile;
use std::sync::Arc;
use std::time::Instant;
use tracing::info;

/// What was chosen, and why.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Choice {
    /// The candidate of this number; `None`: the processor.
    pub candidate: Option<usize>,
    /// In words.
    pub why: &'static str,
}

/// What `auto` takes of `candidates`.
pub fn automatic(candidates: &[Candidate]) -> Choice {
    // OpenGL must be asked for by name.
    let is_gl = |c: &Candidate| c.info.backend == wgpu::Backend::Gl;
    let hardware = |c: &&(usize, &Candidate)| c.1.is_hardware() && c.1.flaw.is_none() && !is_gl(c.1);
    match candidates.iter().enumerate().filter(|c| hardware(&c)).min_by_key(|(_, c)| c.rank()) {
        Some((number, _)) => Choice { candidate: Some(number), why: "the best hardware GPU that has what is needed" },
        None if candidates.iter().any(Candidate::is_hardware) => {
            Choice { candidate: None, why: "no hardware GPU has what is needed" }
        }
        None => Choice { candidate: None, why: "there is no hardware GPU" },
    }
}

/// Room for a cache where a driver does not state the memory of its device.
const USUAL_ROOM: u64 = 1 << 30;

/// A device that has been chosen. Clones share it.
#[derive(Clone)]
pub enum Device {
    /// The processor.
    Cpu,
    /// A graphics adapter.
    Gpu(Box<Gpu>),
}

impl Device {
    /// Opens what `adapter` asks for.
    ///
    /// # Errors
    /// No such adapter, or one that gives no device or lacks what is needed.
    pub fn open(adapter: &Adapter) -> Result<Self> {
        let (device, why) = match adapter {
            Adapter::Cpu => (Self::Cpu, "asked for"),
            Adapter::Named(name) => (Self::Gpu(Box::new(Gpu::open(Some(name))?)), "asked for"),
            Adapter::Auto => {
                let candidates = candidates();
                let Choice { candidate, why } = automatic(&candidates);
                match candidate {
                    Some(number) => (Self::Gpu(Box::new(candidates[number].open()?)), why),
                    None => (Self::Cpu, why),
                }
            }
        };
        let DeviceInfo { name, driver, driver_info, backend, .. } = device.info();
        info!("adapter: {name} ({backend}, {driver} {driver_info}): {why}");
        Ok(device)
    }

    /// What summaries say of it.
    pub fn info(&self) -> DeviceInfo {
        match self {
            Self::Cpu => cpu::device_info(),
            Self::Gpu(gpu) => gpu.device_info(),
        }
    }

    /// Largest number of bytes of one page of the cache.
    pub fn page_bytes(&self) -> u64 {
        match self {
            Self::Cpu => CpuExecutor::PAGE_BYTES,
            Self::Gpu(gpu) => gpu.page_bytes(),
        }
    }

    /// Bytes of a cache that there is room for: three quarters of the device's own memory where the driver states it;
    /// of the processor half of the memory that is available.
    pub fn room(&self) -> u64 {
        match self {
            Self::Cpu => cpu::available_memory().map_or(USUAL_ROOM, |bytes| bytes / 2),
            Self::Gpu(gpu) => gpu.local_memory.map_or(USUAL_ROOM, |bytes| bytes / 4 * 3),
        }
    }

    /// Bytes of its own memory, or of the memory that it takes of the host's; `None` where nobody tells.
    pub fn local_memory(&self) -> Option<u64> {
        match self {
            Self::Cpu => cpu::available_memory(),
            Self::Gpu(gpu) => gpu.local_memory,
        }
    }

    /// Whether its memory is the host's.
    pub fn is_host_memory(&self) -> bool {
        match self {
            Self::Cpu => true,
            Self::Gpu(gpu) => is_host_memory(&gpu.info),
        }
    }

    /// Most rays that it holds at a time.
    pub fn most_rays(&self) -> u64 {
        match self {
            Self::Cpu => u64::from(u32::MAX),
            Self::Gpu(gpu) => most_rays(gpu),
        }
    }

    /// The executor of `scene`, with a cache of pages of the given sizes.
    ///
    /// # Errors
    /// A device that fails the start-up probe; textures that cannot be read; a picture or a cache beyond the device's
    /// limits.
    pub fn executor(
        self,
        scene: Arc<SceneFile>,
        host: Arc<HostCache>,
        threads: usize,
        page_sizes: &[u64],
        setup: Setup,
    ) -> Result<Box<dyn FrameExecutor>> {
        let start = Instant::now();
        let executor: Box<dyn FrameExecutor> = match self {
            Self::Cpu => {
                let workers = Workers::new(scene.clone(), host, threads)?;
                Box::new(CpuExecutor::new(scene, workers, setup)?)
            }
            Self::Gpu(gpu) => {
                require(&gpu, &probe::run(&gpu).checks)?;
                let workers = Workers::new(scene.clone(), host, threads)?;
                let executor = GpuExecutor::new(*gpu, scene, workers, page_sizes, setup)?;
                let mark = passed::mark(executor.gpu(), executor.kernels().pages, executor.kernels().count);
                if !mark.as_deref().is_some_and(passed::is_valid) {
                    require(executor.gpu(), &probe::compare_pipelines(&executor))?;
                    mark.as_deref().inspect(|mark| passed::leave(mark));
                }
                Box::new(executor)
            }
        };
        info!("kernels: built and tested in {:.0} ms; {threads} loader threads", start.elapsed().as_secs_f64() * 1e3);
        Ok(executor)
    }
}

/// Refuses a device with a failed check.
fn require(gpu: &Gpu, checks: &[probe::Check]) -> Result<()> {
    let failures = probe::failures(checks);
    if failures.is_empty() {
        return Ok(());
    }
    bail!(
        "{} fails the start-up test that exact rendering needs: {}; choose another with --adapter",
        gpu.info.name,
        failures.join(", ")
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use wgpu::DeviceType::{Cpu, DiscreteGpu, IntegratedGpu};

    fn found(kinds: &[(wgpu::DeviceType, bool)]) -> Vec<Candidate> {
        kinds.iter().map(|&(kind, is_sound)| Candidate::for_tests(kind, is_sound)).collect()
    }

    #[test]
    fn hardware_comes_first_and_software_vulkan_never_by_itself() {
        let chosen = |kinds: &[_]| automatic(&found(kinds)).candidate;
        assert_eq!(chosen(&[]), None);
        assert_eq!(chosen(&[(Cpu, true)]), None);
        assert_eq!(chosen(&[(Cpu, true), (IntegratedGpu, true)]), Some(1));
        assert_eq!(chosen(&[(IntegratedGpu, true), (DiscreteGpu, true), (Cpu, true)]), Some(1));
        // One that lacks something is passed over.
        assert_eq!(chosen(&[(IntegratedGpu, true), (DiscreteGpu, false)]), Some(0));
        assert_eq!(chosen(&[(DiscreteGpu, false), (Cpu, true)]), None);
        assert_ne!(automatic(&found(&[(DiscreteGpu, false)])).why, automatic(&[]).why);
    }
}
