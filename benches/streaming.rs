//! Streaming of a warm file into device pages against one thread's memcpy + xxh3 of the same map into an equally mapped
//! buffer: the physical limit of a verified copy by one thread. The upload path is named. The indices in a payload are
//! checked when it is loaded for the first time, which is in the warm-up.

mod common;

use brickwalk::Settings;
use brickwalk::gpu::device::Gpu;
use brickwalk::schedule::Load;
use brickwalk::session::opened::{Opened, open_scene};
use brickwalk::settings::{CacheSize, HostCacheSize, ImageSize};
use brickwalk::stream::{Item, PayloadSource, Slot};
use criterion::{BenchmarkId, Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use std::path::PathBuf;
use std::time::Duration;

/// A city of 6M triangles, made once.
fn scene() -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("streaming-6M.bricks");
    if !path.exists() {
        common::city("6M", &path);
    }
    path
}

fn streaming(c: &mut Criterion) {
    let path = scene();
    let file = open_scene(&path).expect("the scene");
    let mut group = c.benchmark_group("streaming");
    group.sampling_mode(SamplingMode::Flat).sample_size(20).measurement_time(Duration::from_secs(8));
    let bricks = file.sizes().bricks;
    let total: u64 = bricks.iter().map(|brick| brick.0).sum();
    group.throughput(Throughput::Bytes(total));

    // The limit: the same bytes of the same map, hashed and copied once by one thread into mapped device memory.
    let raw = std::fs::File::open(&path).expect("the file");
    // SAFETY: the file was just made by this process and nothing truncates it while the bench runs.
    let map = unsafe { memmap2::Mmap::map(&raw) }.expect("a map");
    let gpu = Gpu::open(None).expect("a device");
    let mapped = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("limit"),
        size: total.next_multiple_of(8),
        usage: wgpu::BufferUsages::MAP_WRITE | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: true,
    });
    let spans: Vec<bricks::Span> = file.resident().bricks.iter().map(|b| b.geometry).collect();
    {
        let mut view = mapped.get_mapped_range_mut(..).expect("mapped at creation");
        group.bench_function("memcpy + xxh3, one thread", |b| {
            b.iter(|| {
                let mut at = 0;
                for span in &spans {
                    let bytes = &map[span.offset as usize..(span.offset + span.bytes) as usize];
                    assert_eq!(xxhash_rust::xxh3::xxh3_64(bytes), span.checksum);
                    view.slice(at..at + bytes.len()).copy_from_slice(bytes);
                    at += bytes.len();
                }
            });
        });
    }
    mapped.unmap();

    for (name, host_cache) in [("file", 0), ("host cache", 4 << 30)] {
        let host_cache = HostCacheSize::Bytes(host_cache);
        let size = ImageSize { width: 64, height: 64 };
        let settings = Settings { cache: CacheSize::Percent(100.0), host_cache, size, ..Settings::exact() };
        let mut session = Opened::open(file.clone(), &path, &settings).expect("a session");
        let upload = session.executor.device().upload;
        let loads = place(&session, &bricks);
        group.bench_function(BenchmarkId::new(format!("brickwalk from the {name}"), upload), |b| {
            b.iter(|| {
                // As a walk loads: a few bricks at a time.
                for batch in loads.chunks(8) {
                    session.executor.load(batch).expect("a load");
                }
            });
        });
    }
    group.finish();
}

/// All geometry one after the other in the pages of an empty cache.
fn place(session: &Opened, bricks: &[(u64, u64)]) -> Vec<Load> {
    let pages: Vec<u64> = session.cache.residency.page_sizes().collect();
    let (mut page, mut offset) = (0usize, 0u64);
    let mut loads = Vec::new();
    for (brick, &(bytes, _)) in bricks.iter().enumerate() {
        if offset + bytes > pages[page] {
            page += 1;
            offset = 0;
        }
        let slot = Slot { page: page as u32, offset: offset as u32 };
        loads.push(Load { item: Item::geometry(brick as u32), slot });
        offset += bytes;
    }
    loads
}

criterion_group!(benches, streaming);
criterion_main!(benches);
