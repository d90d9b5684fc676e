//! The command `brickwalk`.

use std::process::ExitCode;

fn main() -> ExitCode {
    brickwalk::app::main()
}
