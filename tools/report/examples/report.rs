//! Writes the report of a walk's folder anew: `cargo run --release -p brickwalk-report --example report -- DIR`.

use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let Some(dir) = std::env::args_os().nth(1) else {
        eprintln!("give the folder that a walk has written");
        return ExitCode::from(2);
    };
    match brickwalk_report::write(Path::new(&dir), &[]) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
