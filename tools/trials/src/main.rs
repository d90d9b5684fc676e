//! The command `brickwalk-trials`.

#[cfg(unix)]
#[global_allocator]
static ALLOCATOR: brickwalk_trials::memory::Counting = brickwalk_trials::memory::Counting;

#[cfg(unix)]
fn main() -> std::process::ExitCode {
    brickwalk_trials::command::main()
}

#[cfg(not(unix))]
fn main() -> std::process::ExitCode {
    eprintln!("brickwalk-trials: trials need signals and limits of Unix");
    std::process::ExitCode::from(2)
}
