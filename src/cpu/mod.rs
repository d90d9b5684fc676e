//! The executor that needs no graphics device: a twin of every kernel, run by rayon over bands of rays and over tiles.
//!
//! A twin has the name of its kernel in `shaders/` and the same operations in the same order, in f32; what the WGSL
//! guards with `barrier` rounds as it stands here, because Rust neither contracts nor reassociates. So both executors
//! find the same hits, bit for bit, where rays are the same. Rays differ where they depend on functions that WGSL
//! leaves some ulps (sine, cosine, inverse square root): those of soft shadows, occlusion, diffuse and glossy light.
//!
//! Intersection kernels take rays of one octant together (`packet.rs`): they meet children in the same order, so that
//! each has the hits, uses and counts that it has alone.
//!
//! Geometry and attributes of resident bricks are the verified bytes that a worker read, shared with the host cache: a
//! brick is traversed where it lies. Slots only say what the budget holds.

pub mod cache;
pub mod executor;

pub use executor::CpuExecutor;

use crate::kernels::DeviceInfo;
use crate::kernels::simd::isa::Best;

/// Rays that are tested together at most.
pub fn lanes() -> u32 {
    Best::detect().describe().1
}

/// What summaries say of the processor.
pub fn device_info() -> DeviceInfo {
    DeviceInfo {
        name: "cpu".into(),
        driver: "brickwalk".into(),
        driver_info: format!("{} threads, {}", rayon::current_num_threads(), Best::detect().describe().0),
        backend: "cpu".into(),
        upload: "in place",
        timestamps: true,
    }
}

/// Bytes of memory that can be had without swapping, also of the control group that the process runs in and of the
/// address space that it may use (`ulimit -v`); `None` where the system does not tell.
pub fn available_memory() -> Option<u64> {
    let mut system = sysinfo::System::new();
    system.refresh_memory();
    [free_memory(&system), free_addresses()].into_iter().flatten().min()
}

/// What of the address space of a process is free, where that is limited; Linux tells.
fn free_addresses() -> Option<u64> {
    let number = |file: &str, name: &str| -> Option<u64> {
        let text = std::fs::read_to_string(file).ok()?;
        let line = text.lines().find_map(|line| line.strip_prefix(name))?;
        line.split_whitespace().next()?.parse().ok()
    };
    let limit = number("/proc/self/limits", "Max address space")?;
    let used = number("/proc/self/status", "VmSize:")? * 1024;
    Some(limit.saturating_sub(used))
}

/// What of a system's memory is free; sysinfo knows a control group only where it knows the machine.
fn free_memory(system: &sysinfo::System) -> Option<u64> {
    let machine = Some(system.available_memory()).filter(|&bytes| bytes > 0 && system.total_memory() > 0)?;
    let group = system.cgroup_limits().map(|limits| limits.free_memory);
    Some(group.map_or(machine, |group| group.min(machine)))
}

#[cfg(test)]
mod tests {
    #[test]
    fn memory_that_is_not_told_is_unknown() {
        assert_eq!(super::free_memory(&sysinfo::System::new()), None);
        assert!(super::available_memory().is_none_or(|bytes| bytes > 0));
    }
}
