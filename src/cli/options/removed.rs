//! What is said where an option is gone.

use crate::settings::removed::removed;
use clap::error::{ContextKind, ContextValue, ErrorKind};

/// `error`, or where it refuses an option that is gone, what stands in its place. The exit status stays.
pub fn explained(error: clap::Error) -> clap::Error {
    let name = match error.get(ContextKind::InvalidArg) {
        Some(ContextValue::String(text)) if error.kind() == ErrorKind::UnknownArgument => text,
        _ => return error,
    };
    match removed(name) {
        Some(message) => clap::Error::raw(ErrorKind::UnknownArgument, format!("{message}\n")),
        None => error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::options::args::Cli;
    use crate::settings::removed::REMOVED;
    use clap::Parser;

    /// A walk that uses what is gone.
    fn words(name: &str) -> String {
        match name {
            "leaf-cache" => "--without leaf-cache".into(),
            "mirror" => "--effects mirror".into(),
            option => format!("{option} 1"),
        }
    }

    #[test]
    fn what_is_gone_is_refused_with_what_stands_in_its_place() {
        for (name, instead) in REMOVED {
            let line = format!("brickwalk walk s.bricks -o out {}", words(name));
            let error = explained(Cli::try_parse_from(line.split_whitespace()).unwrap_err());
            let message = error.to_string();
            assert!(message.contains(&format!("{name} was removed: {instead}")), "{message}");
            assert_eq!(error.exit_code(), 2, "{message}");
        }
    }

    #[test]
    fn other_errors_stay_as_they_are() {
        for line in ["brickwalk walk s.bricks -o out --nonsense", "brickwalk walk s.bricks -o out --without haste"] {
            let error = || Cli::try_parse_from(line.split_whitespace()).unwrap_err();
            assert_eq!(explained(error()).to_string(), error().to_string());
            assert!(!error().to_string().contains("was removed"));
        }
    }
}
