//! The command `brickwalk`.

use std::process::ExitCode;

#[global_allocator]
static ALLOCATOR: brickwalk::cli::memory::Allocator = brickwalk::cli::memory::Allocator;

fn main() -> ExitCode {
    // Mesa's device-select layer only reorders adapters, which brickwalk does itself, and complains on standard error
    // where there is no desktop session. SAFETY: no other thread has been started yet.
    unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
    brickwalk::cli::main()
}
