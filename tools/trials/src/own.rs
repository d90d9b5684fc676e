//! Kinds that misbehave on purpose, each in one trial of four: with them the frame is tested, and nothing else.

use crate::kind::{Fault, Kind, Limits, Outcome, Trial};

/// What a kind does wrong.
#[derive(Clone, Copy, Debug)]
pub enum Own {
    /// It says that it found something.
    Fault,
    /// It panics.
    Panic,
    /// It never ends.
    Hang,
    /// It ends the process.
    Abort,
    /// It takes more memory than it may.
    Memory,
    /// It takes more memory than there is.
    AllMemory,
    /// It overflows the stack.
    Stack,
}

/// All of them.
pub static ALL: [Own; 7] = [Own::Fault, Own::Panic, Own::Hang, Own::Abort, Own::Memory, Own::AllMemory, Own::Stack];

/// Bytes that a trial may take.
const MOST_BYTES: u64 = 1 << 20;

impl Kind for Own {
    fn name(&self) -> &'static str {
        match self {
            Self::Fault => "own/fault",
            Self::Panic => "own/panic",
            Self::Hang => "own/hang",
            Self::Abort => "own/abort",
            Self::Memory => "own/memory",
            Self::AllMemory => "own/all-memory",
            Self::Stack => "own/stack",
        }
    }

    fn about(&self) -> &'static str {
        "Misbehaves on purpose"
    }

    fn limits(&self) -> Limits {
        Limits { seconds: if matches!(self, Self::Hang) { 1.0 } else { 60.0 }, bytes: MOST_BYTES }
    }

    fn trial(&self, trial: &Trial) -> Result<Outcome, Fault> {
        if trial.seed % 4 != 2 {
            return Ok(if trial.seed.is_multiple_of(2) { Outcome::Passed } else { Outcome::Stopped });
        }
        match self {
            Self::Fault => return Err(Fault::new("a fault", "made on purpose")),
            Self::Panic => std::panic::panic_any("made on purpose"),
            Self::Hang => loop {
                std::thread::sleep(std::time::Duration::from_secs(1));
            },
            Self::Abort => std::process::abort(),
            Self::Memory => drop(std::hint::black_box(vec![1u8; 2 * MOST_BYTES as usize])),
            Self::AllMemory => drop(std::hint::black_box(vec![1u8; 1 << 40])),
            Self::Stack => {
                std::hint::black_box(deeper(1));
            }
        }
        Ok(Outcome::Passed)
    }
}

/// Calls itself until there is no room.
fn deeper(depth: u64) -> u64 {
    let room = std::hint::black_box([depth; 256]);
    if std::hint::black_box(depth) == 0 { 0 } else { deeper(depth + 1) + room[3] }
}
