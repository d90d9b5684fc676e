//! How a command is ended.

use super::Run;
use crate::kind::Fault;
use crate::random::Random;
use std::fmt::{Display, Formatter};
use std::io::Read;
use std::os::unix::process::CommandExt;
use std::process::Command;
use std::time::{Duration, Instant};

/// Seconds that a command has that nobody ends, or that was asked to end.
const PATIENCE: Duration = Duration::from_secs(300);

/// Bytes of address space that commands get which run out of it.
const ADDRESSES: [u64; 2] = [120 << 20, 1400 << 20];

/// How a command is ended.
#[derive(Clone, Copy, Debug)]
pub enum End {
    /// Not at all.
    None,
    /// Killed.
    Kill(Duration),
    /// Asked to end.
    Terminate(Duration),
    /// No file may grow beyond so many bytes: a full disk. SIGXFSZ comes with it.
    Full(u64),
    /// No more than so many bytes of addresses.
    Memory(u64),
}

impl Display for End {
    fn fmt(&self, f: &mut Formatter) -> std::fmt::Result {
        match self {
            Self::None => write!(f, "not ended"),
            Self::Kill(after) => write!(f, "SIGKILL after {} ms", after.as_millis()),
            Self::Terminate(after) => write!(f, "SIGTERM after {} ms", after.as_millis()),
            Self::Full(bytes) => write!(f, "files of at most {bytes} bytes"),
            Self::Memory(bytes) => write!(f, "{bytes} bytes of address space"),
        }
    }
}

impl End {
    /// Of a command that takes `duration` and writes files of up to `largest` bytes.
    pub fn random(random: &mut Random, duration: Duration, largest: u64) -> Self {
        let moment = duration.mul_f64(1.1 * random.share());
        match random.below(100) {
            0..55 => Self::Kill(moment),
            55..75 => Self::Terminate(moment),
            75..90 => Self::Full((largest as f64 * 1.05 * random.share()) as u64),
            _ => Self::Memory(ADDRESSES[0] + ((ADDRESSES[1] - ADDRESSES[0]) as f64 * random.share()) as u64),
        }
    }

    /// Whether a signal may end it.
    pub fn is_signal(&self) -> bool {
        matches!(self, Self::Kill(_) | Self::Terminate(_))
    }

    /// Whether it ends by itself, and says why.
    pub fn is_told(&self) -> bool {
        !matches!(self, Self::None | Self::Kill(_))
    }

    /// Whether the command can take away what it made.
    pub fn leaves_nothing(&self) -> bool {
        matches!(self, Self::None | Self::Full(_) | Self::Memory(_))
    }

    /// Whether the C library ended the process, in its own words: it does where there is no memory to note what a new
    /// thread has to take away, and asks nobody.
    pub fn is_cut(&self, run: &Run) -> bool {
        matches!(self, Self::Memory(_)) && run.said.starts_with("Fatal glibc error: failed to register TLS destructor")
    }

    /// Runs a command to this end.
    ///
    /// # Errors
    /// It cannot be started, or hangs.
    pub fn run(&self, mut command: Command) -> Result<Run, Fault> {
        let limit = match *self {
            Self::Full(bytes) => Some((libc::RLIMIT_FSIZE, bytes)),
            Self::Memory(bytes) => Some((libc::RLIMIT_AS, bytes)),
            _ => None,
        };
        // SAFETY: the closure makes system calls alone, which may be made between fork and exec.
        unsafe {
            command.pre_exec(move || {
                #[cfg(target_os = "linux")]
                libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL);
                if let Some((which, bytes)) = limit {
                    let both = libc::rlimit { rlim_cur: bytes, rlim_max: bytes };
                    libc::setrlimit(which, &raw const both);
                }
                Ok(())
            });
        }
        let failed = |error: std::io::Error| Fault::new("a command cannot be run", error.to_string());
        let mut child = command.spawn().map_err(failed)?;
        let err = child.stderr.take();
        let said = std::thread::spawn(move || {
            let mut text = Vec::new();
            if let Some(mut err) = err {
                let _ = err.read_to_end(&mut text);
            }
            String::from_utf8_lossy(&text).into_owned()
        });
        let start = Instant::now();
        let mut is_sent = false;
        let status = loop {
            if let Some(status) = child.try_wait().map_err(failed)? {
                break status;
            }
            match *self {
                Self::Kill(after) if start.elapsed() >= after => child.kill().map_err(failed)?,
                Self::Terminate(after) if start.elapsed() >= after && !is_sent => {
                    is_sent = true;
                    // SAFETY: a plain call; the process is a child that has not been waited for.
                    unsafe { libc::kill(child.id() as i32, libc::SIGTERM) };
                }
                _ => {}
            }
            if start.elapsed() > PATIENCE {
                child.kill().map_err(failed)?;
                child.wait().map_err(failed)?;
                return Err(Fault::new("a command hangs", format!("{self}: {}", said.join().unwrap_or_default())));
            }
            std::thread::sleep(Duration::from_millis(1));
        };
        Ok(Run { status: status.code(), said: said.join().unwrap_or_default() })
    }
}
