//! The command: parses, dispatches, and turns whatever happens into an exit status: 0 done, 1 the input is bad (one
//! line on standard error), 2 wrong usage.

pub mod adapters;
pub mod bake_displacement;
pub mod cached;
pub mod calibrate;
pub mod compare;
pub mod convert;
pub mod demo;
pub mod info;
pub mod interrupt;
pub mod jobs;
#[cfg(feature = "lab")]
pub mod lab;
pub mod man;
pub mod memory;
pub mod options;
pub mod output;
pub mod part;
pub mod query;
pub mod repair;
pub mod replay;
pub mod scene;
#[cfg(feature = "serve")]
pub mod serve;
pub mod trace;
pub mod verify;
#[cfg(feature = "viewer")]
pub mod view;
pub mod walk;
pub mod watcher;

use crate::remote;
use bricks::one_line;
use clap::{CommandFactory, Parser};
use options::args::{Cli, Command};
use options::removed;
use output::{ClosedPipe, Usage, print};
use std::ffi::OsString;
use std::io::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

/// Exit status for bad input.
const BAD_INPUT: u8 = 1;

/// Runs the command line of this process.
pub fn main() -> ExitCode {
    memory::prepare();
    install_panic_hook();
    let words: Vec<_> = std::env::args_os().collect();
    if words.iter().any(|word| word == "--help-all") {
        return match print(&help_all(&words)) {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => report(&error),
        };
    }
    let cli = match Cli::try_parse_from(words).map_err(removed::explained) {
        Ok(cli) => cli,
        Err(error) => {
            // A closed pipe is no reason to fail, and there is nobody to tell.
            let _ = error.print();
            return ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2));
        }
    };
    cli.verbosity.set();
    remote::keep_on_disk(cli.disk_cache.clone());
    // Whatever is half done is dropped with the call: a panic leaves nothing behind that is used afterwards.
    let done = catch_unwind(AssertUnwindSafe(|| run(&cli.command)));
    output::warn(remote::take_warnings());
    match done {
        Ok(Ok(())) => ExitCode::SUCCESS,
        Ok(Err(error)) => report(&error),
        Err(_) => ExitCode::from(BAD_INPUT),
    }
}

/// Runs a subcommand.
///
/// # Errors
/// Its input is bad, or ([`Usage`]) its options do not go together.
pub fn run(command: &Command) -> anyhow::Result<()> {
    match command {
        Command::Demo(args) => demo::run(args),
        Command::Convert(args) => convert::run(args),
        Command::Scene(args) => scene::run(args),
        Command::Info(args) => info::run(args),
        Command::Verify(args) => verify::run(args),
        Command::Repair(args) => repair::run(args),
        Command::BakeDisplacement(args) => bake_displacement::run(args),
        Command::Walk(args) => walk::run(args),
        Command::Jobs(args) => jobs::run(args),
        #[cfg(feature = "viewer")]
        Command::View(args) => view::run(args),
        #[cfg(feature = "serve")]
        Command::Serve(args) => serve::run(args),
        Command::Trace(args) => trace::run(args),
        Command::Query(args) => query::run(args),
        Command::Replay(args) => replay::run(args),
        Command::Compare(args) => compare::run(args),
        #[cfg(feature = "lab")]
        Command::Bench(args) => lab::bench::run(args),
        #[cfg(feature = "lab")]
        Command::Study(args) => lab::study::run(args),
        Command::Calibrate(args) => calibrate::run(args),
        Command::Adapters(args) => adapters::run(args),
        Command::Completions(args) => man::completions(args),
        Command::Man(args) => man::run(args),
        #[cfg(feature = "lab")]
        Command::Selftest(args) => lab::bench::test(args),
    }
}

/// The help of the command that `words` name, with all its options.
fn help_all(words: &[OsString]) -> String {
    let mut command = Cli::command();
    command.build();
    for word in words.iter().skip(1) {
        if let Some(below) = word.to_str().and_then(|word| command.find_subcommand(word)) {
            command = below.clone();
        }
    }
    command.mut_args(|argument| argument.hide_long_help(false)).render_long_help().to_string()
}

/// Prints an error as one line and chooses the exit status.
fn report(error: &anyhow::Error) -> ExitCode {
    if is_closed_pipe(error) {
        return ExitCode::SUCCESS;
    }
    let _ = writeln!(std::io::stderr(), "brickwalk: {}", one_line(&chain(error)));
    if error.is::<Usage>() { ExitCode::from(2) } else { ExitCode::from(BAD_INPUT) }
}

/// The messages of an error and its causes, outermost first. Many error types repeat the message of their source, or
/// name the same file first; what has already been said is left out.
fn chain(error: &anyhow::Error) -> String {
    let mut text = String::new();
    for cause in error.chain() {
        let message = cause.to_string();
        if text.is_empty() {
            text = message;
        } else if !text.contains(&message) {
            // The file that both are about is named once.
            let name = text.split(": ").next().unwrap_or_default();
            let rest = message.strip_prefix(name).and_then(|rest| rest.strip_prefix(": ")).unwrap_or(&message);
            text += &format!(": {rest}");
        }
    }
    text
}

/// Whether the reader of standard output went away, as in `brickwalk info S.bricks | head -1`.
fn is_closed_pipe(error: &anyhow::Error) -> bool {
    error.downcast_ref::<ClosedPipe>().is_some()
}

/// Makes a panic, which is a defect of the program, one line on standard error; [`main`] turns it into exit status 1.
/// Only the first one speaks: those of other threads follow from it.
fn install_panic_hook() {
    static SPOKEN: AtomicBool = AtomicBool::new(false);
    std::panic::set_hook(Box::new(|info| {
        // A decoder that gave up on a damaged input: the importer tells.
        if brickwalk_convert::import::catches_panics() {
            return;
        }
        if SPOKEN.swap(true, Ordering::Relaxed) {
            return;
        }
        let message = info.payload_as_str().unwrap_or("unknown");
        let place = info.location().map_or(String::new(), |at| format!(" at {}:{}", at.file(), at.line()));
        let _ = writeln!(
            std::io::stderr(),
            "brickwalk: internal error{place}: {}; this is a bug in brickwalk; please report it with the command line",
            one_line(message)
        );
    }));
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::Context;

    #[test]
    fn errors_are_one_line_without_repetition() {
        let inner = std::io::Error::other("disk\nfull\t!");
        let error = Err::<(), _>(inner).context("a.bricks: cannot write").unwrap_err();
        assert_eq!(one_line(&chain(&error)), "a.bricks: cannot write: disk full !");
        let repeated = anyhow::anyhow!("full").context("a.bricks: full; free some space");
        assert_eq!(chain(&repeated), "a.bricks: full; free some space");
        let named = anyhow::anyhow!("a.bricks: brick 7 is damaged").context("a.bricks");
        assert_eq!(chain(&named), "a.bricks: brick 7 is damaged");
    }

    #[test]
    fn closed_pipes_are_told_from_other_errors() {
        assert!(is_closed_pipe(&ClosedPipe.into()));
        assert!(is_closed_pipe(&anyhow::Error::from(ClosedPipe).context("while printing")));
        assert!(!is_closed_pipe(&anyhow::anyhow!("other")));
    }
}
