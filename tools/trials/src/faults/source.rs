//! Bytes of a scene that are not always read as they are.

use crate::random::Random;
use bricks::ByteSource;
use std::borrow::Cow;
use std::io::{self, ErrorKind};
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

/// What goes wrong.
#[derive(Clone, Copy, Debug)]
enum Way {
    /// Reading is refused.
    Refused(ErrorKind),
    /// The device fails: EIO.
    Device,
    /// The first half is read, then no more.
    Short,
    /// A bit is another.
    Flip,
    /// All is zero.
    Zeros,
    /// It is what stands elsewhere.
    Elsewhere,
    /// It takes some milliseconds.
    Slow,
    /// The file ends in its middle.
    Shrunk,
}

/// A scene in memory with a schedule of faults.
pub struct Faulty {
    bytes: Arc<Cow<'static, [u8]>>,
    way: Way,
    /// Reads before the first fault.
    from: u64,
    /// Reads that go wrong.
    count: u64,
    /// Of those, one in so many does.
    each: u64,
    /// Whether it says that reading once more may help.
    is_remote: bool,
    seed: u64,
    reads: AtomicU64,
    struck: AtomicU64,
    is_over: AtomicBool,
}

impl Faulty {
    /// A schedule.
    pub fn new(bytes: Arc<Cow<'static, [u8]>>, random: &mut Random) -> Self {
        let kinds = [
            ErrorKind::Other,
            ErrorKind::TimedOut,
            ErrorKind::PermissionDenied,
            ErrorKind::NotFound,
            ErrorKind::UnexpectedEof,
            ErrorKind::OutOfMemory,
            ErrorKind::Interrupted,
        ];
        let way = match random.below(8) {
            0 => Way::Refused(random.pick(kinds)),
            1 => Way::Device,
            2 => Way::Short,
            3 => Way::Flip,
            4 => Way::Zeros,
            5 => Way::Elsewhere,
            6 => Way::Slow,
            _ => Way::Shrunk,
        };
        // Opening reads some tens of times.
        let most = random.pick([4, 40, 200]);
        Self {
            bytes,
            way,
            from: random.below(most) as u64,
            count: random.pick([1, 2, 5, 50, u64::MAX >> 1]),
            each: random.pick([1, 1, 3]),
            is_remote: random.chance(30),
            seed: random.word(),
            reads: AtomicU64::new(0),
            struck: AtomicU64::new(0),
            is_over: AtomicBool::new(false),
        }
    }

    /// From now on nothing goes wrong.
    pub fn end(&self) {
        self.is_over.store(true, Ordering::Relaxed);
    }

    /// How many reads went wrong.
    pub fn struck(&self) -> u64 {
        self.struck.load(Ordering::Relaxed)
    }

    /// The faults, in words.
    pub fn told(&self) -> String {
        let Self { way, from, count, each, is_remote, .. } = self;
        format!("{way:?} from read {from}, {count} reads, each {each}th, remote: {is_remote}")
    }

    /// Whether this read goes wrong.
    fn strikes(&self) -> bool {
        let read = self.reads.fetch_add(1, Ordering::Relaxed);
        let strikes = !self.is_over.load(Ordering::Relaxed)
            && read >= self.from
            && read - self.from < self.count
            && (read - self.from).is_multiple_of(self.each);
        if strikes {
            self.struck.fetch_add(1, Ordering::Relaxed);
        }
        strikes
    }

    fn middle(&self) -> u64 {
        self.bytes.len() as u64 / 2
    }
}

impl ByteSource for Faulty {
    fn length(&self) -> io::Result<u64> {
        let is_shrunk = matches!(self.way, Way::Shrunk) && self.struck() > 0 && !self.is_over.load(Ordering::Relaxed);
        if is_shrunk { Ok(self.middle()) } else { self.bytes.length() }
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let strikes = self.strikes();
        if strikes && matches!(self.way, Way::Shrunk) && offset + out.len() as u64 > self.middle() {
            return Err(ErrorKind::UnexpectedEof.into());
        }
        self.bytes.read_at(offset, out)?;
        if !strikes {
            return Ok(());
        }
        let mut random = Random::new("fault", self.seed ^ offset);
        match self.way {
            Way::Refused(kind) => return Err(kind.into()),
            // EIO.
            Way::Device => return Err(io::Error::from_raw_os_error(5)),
            Way::Short => {
                let half = out.len() / 2;
                out[half..].fill(0);
                return Err(ErrorKind::UnexpectedEof.into());
            }
            Way::Flip if !out.is_empty() => {
                let at = random.below(out.len());
                out[at] ^= 1 << random.below(8);
            }
            Way::Zeros => out.fill(0),
            Way::Elsewhere => {
                let at = random.below(self.bytes.len().saturating_sub(out.len()));
                return self.bytes.read_at(at as u64, out);
            }
            Way::Slow => std::thread::sleep(Duration::from_millis(random.within(1, 5) as u64)),
            Way::Flip | Way::Shrunk => {}
        }
        Ok(())
    }

    fn distrust(&self, _: Range<u64>, times: u32) -> bool {
        self.is_remote && times < 3
    }

    fn is_file(&self) -> bool {
        !self.is_remote
    }
}
