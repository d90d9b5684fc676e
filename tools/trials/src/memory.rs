//! An allocator that counts: what a trial took at most, and a limit beyond which there is no more.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

static LIVE: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(usize::MAX);

/// The system's allocator, with a count.
pub struct Counting;

/// Begins to count a peak; the bytes in use now.
pub fn begin() -> usize {
    let live = LIVE.load(Ordering::Relaxed);
    PEAK.store(live, Ordering::Relaxed);
    live
}

/// Most bytes in use since [`begin`].
pub fn peak() -> usize {
    PEAK.load(Ordering::Relaxed)
}

/// From now on no more than `bytes` are given out in all: who asks for more ends this process, as on a machine that has
/// no more.
pub fn limit(bytes: usize) {
    MOST.store(bytes, Ordering::Relaxed);
}

/// Counts `bytes` more; whether there are as many.
fn take(bytes: usize) -> bool {
    let live = LIVE.fetch_add(bytes, Ordering::Relaxed).saturating_add(bytes);
    let fits = live <= MOST.load(Ordering::Relaxed);
    if fits {
        PEAK.fetch_max(live, Ordering::Relaxed);
    } else {
        give(bytes);
    }
    fits
}

fn give(bytes: usize) {
    LIVE.fetch_sub(bytes, Ordering::Relaxed);
}

// SAFETY: requests go to the system's allocator as they are, or are refused by a null pointer.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if !take(layout.size()) {
            return std::ptr::null_mut();
        }
        // SAFETY: the caller's obligations are those of the system's allocator.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        give(layout.size());
        // SAFETY: the memory came from the system's allocator with this layout.
        unsafe { System.dealloc(memory, layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        if !take(layout.size()) {
            return std::ptr::null_mut();
        }
        // SAFETY: as in `alloc`.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        if !take(size) {
            return std::ptr::null_mut();
        }
        // SAFETY: as in `alloc` and `dealloc`.
        let moved = unsafe { System.realloc(memory, layout, size) };
        give(if moved.is_null() { size } else { layout.size() });
        moved
    }
}
