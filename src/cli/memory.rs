//! What happens where memory or space runs out: one line, nothing half-written, exit status 1.

use bricks::ending::{Temporary, can_fail};
use std::alloc::{GlobalAlloc, Layout, System};
use std::io::Write;
use std::sync::atomic::{AtomicBool, AtomicPtr, Ordering};

/// The system's allocator. Where it has no more and the one who asks cannot do without, the process ends.
pub struct Allocator;

// SAFETY: every call goes to the system's allocator as it is; what comes back null ends the process, or is handed on.
unsafe impl GlobalAlloc for Allocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's obligations are those of the system's allocator.
        found(unsafe { System.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above.
        found(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn realloc(&self, old: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: as above.
        found(unsafe { System.realloc(old, layout, size) }, size)
    }

    unsafe fn dealloc(&self, old: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(old, layout) }
    }
}

/// Memory for what is done at the end.
const RESERVE: Layout = Layout::new::<[u8; 1 << 20]>();
static RESERVED: AtomicPtr<u8> = AtomicPtr::new(std::ptr::null_mut());

fn found(memory: *mut u8, bytes: usize) -> *mut u8 {
    if memory.is_null() && !can_fail() {
        end(bytes);
    }
    memory
}

/// Ends the process for want of so many bytes.
#[cold]
fn end(bytes: usize) -> ! {
    static ENDS: AtomicBool = AtomicBool::new(false);
    if ENDS.swap(true, Ordering::SeqCst) {
        // Another thread tells, or this one while it does.
        std::thread::sleep(std::time::Duration::from_secs(1));
        exit();
    }
    let reserved = RESERVED.swap(std::ptr::null_mut(), Ordering::SeqCst);
    if !reserved.is_null() {
        // SAFETY: it was allocated with this layout, and is given back once.
        unsafe { System.dealloc(reserved, RESERVE) };
    }
    // On the stack; what does not fit is cut off.
    let mut text = [0; 256];
    let mut rest = &mut text[..];
    let _ = writeln!(
        rest,
        "brickwalk: out of memory: {:.1} MiB more are needed; give a smaller --size, --cache or --memory, fewer \
         --threads, or raise the limit of memory (ulimit -v)",
        bytes as f64 / f64::from(1 << 20)
    );
    let length = 256 - rest.len();
    let _ = std::io::stderr().write_all(&text[..length]);
    Temporary::remove_all();
    exit()
}

/// Ends without what is registered for the end: other threads go on meanwhile.
fn exit() -> ! {
    // SAFETY: it may be called at any time.
    #[cfg(unix)]
    unsafe {
        libc::_exit(1)
    }
    #[cfg(not(unix))]
    std::process::exit(1)
}

/// Sets memory aside for the end, and has files that grow beyond a limit (`ulimit -f`) fail as a full disk does, in
/// place of ending the process.
pub fn prepare() {
    // SAFETY: the layout is not empty.
    RESERVED.store(unsafe { System.alloc_zeroed(RESERVE) }, Ordering::SeqCst);
    // SAFETY: no handler runs; the call that exceeds the limit returns EFBIG.
    #[cfg(unix)]
    unsafe {
        libc::signal(libc::SIGXFSZ, libc::SIG_IGN);
    }
}
