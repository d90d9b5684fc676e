//! A web server of one object, with the latency, the bandwidth and the faults that a test asks for.

use crate::math::random::Rng;
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// How a server answers.
#[derive(Clone)]
pub struct Manner {
    /// Before the first byte of an answer.
    pub latency: Duration,
    /// Bytes a second, of all connections together.
    pub bandwidth: f64,
    pub has_etag: bool,
    pub has_ranges: bool,
    /// Share of requests that go wrong, each in one of these ways.
    pub faults: f64,
    pub ways: &'static [Fault],
    /// The object is another after so many requests.
    pub replaced_after: u64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    Busy,
    Silence,
    Cut,
    Flip,
}

pub const ALL_FAULTS: [Fault; 4] = [Fault::Busy, Fault::Silence, Fault::Cut, Fault::Flip];

impl Default for Manner {
    fn default() -> Self {
        Self {
            latency: Duration::ZERO,
            bandwidth: f64::INFINITY,
            has_etag: true,
            has_ranges: true,
            faults: 0.0,
            ways: &ALL_FAULTS,
            replaced_after: u64::MAX,
        }
    }
}

#[derive(Default)]
pub struct Counts {
    pub requests: AtomicU64,
    pub bytes: AtomicU64,
    pub faults: AtomicU64,
}

struct Shared {
    object: Vec<u8>,
    manner: Manner,
    counts: Arc<Counts>,
    /// When the link is free again.
    free: Mutex<Instant>,
    ends: AtomicBool,
}

/// A server; it ends when dropped.
pub struct Server {
    pub url: String,
    pub counts: Arc<Counts>,
    shared: Arc<Shared>,
}

impl Drop for Server {
    fn drop(&mut self) {
        self.shared.ends.store(true, Ordering::Relaxed);
        let _ = TcpStream::connect(self.url.trim_start_matches("http://").split('/').next().unwrap());
    }
}

impl Server {
    pub fn new(object: Vec<u8>, manner: Manner) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let url = format!("http://{}/scenes/a.bricks", listener.local_addr().unwrap());
        let counts = Arc::<Counts>::default();
        let (free, ends) = (Mutex::new(Instant::now()), AtomicBool::new(false));
        let shared = Arc::new(Shared { object, manner, counts: counts.clone(), free, ends });
        let own = shared.clone();
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                if own.ends.load(Ordering::Relaxed) {
                    break;
                }
                let own = own.clone();
                std::thread::spawn(move || own.serve(stream));
            }
        });
        Self { url, counts, shared }
    }
}

impl Shared {
    fn serve(&self, mut stream: TcpStream) -> Option<()> {
        let _ = stream.set_nodelay(true);
        let mut reader = BufReader::new(stream.try_clone().ok()?);
        loop {
            let (mut range, mut condition, mut line) = (None, None, String::new());
            loop {
                line.clear();
                if reader.read_line(&mut line).ok()? == 0 {
                    return None;
                }
                if line.trim().is_empty() {
                    break;
                }
                let (name, value) = line.split_once(':').unwrap_or_default();
                match name.to_ascii_lowercase().as_str() {
                    "range" => range = Some(value.trim().trim_start_matches("bytes=").to_owned()),
                    "if-match" => condition = Some(value.trim().to_owned()),
                    _ => {}
                }
            }
            self.answer(&mut stream, range, condition)?;
        }
    }

    /// `None`: the connection is closed.
    fn answer(&self, stream: &mut TcpStream, range: Option<String>, condition: Option<String>) -> Option<()> {
        let number = self.counts.requests.fetch_add(1, Ordering::Relaxed);
        std::thread::sleep(self.manner.latency);
        let mut rng = Rng(0x9e37_79b9 * (number + 1));
        let fault = ((rng.below(1000) as f64) < 1000.0 * self.manner.faults).then(|| {
            self.counts.faults.fetch_add(1, Ordering::Relaxed);
            self.manner.ways[rng.below(self.manner.ways.len() as u64) as usize]
        });
        let is_new = number >= self.manner.replaced_after;
        let etag = if is_new { "\"two\"" } else { "\"one\"" };
        let length = self.object.len();
        let refused = |stream: &mut TcpStream, status: &str| {
            stream.write_all(format!("HTTP/1.1 {status}\r\nContent-Length: 0\r\n\r\n").as_bytes()).ok()
        };
        match fault {
            Some(Fault::Busy) => return refused(stream, "503 Slow Down"),
            Some(Fault::Silence) => {
                std::thread::sleep(Duration::from_millis(700));
                return None;
            }
            _ => {}
        }
        if self.manner.has_etag && condition.is_some_and(|condition| condition != etag) {
            return refused(stream, "412 Precondition Failed");
        }
        let (mut status, mut start, mut end) = ("200 OK", 0, length);
        if let Some((from, to)) = range.as_ref().and_then(|range| range.split_once('-'))
            && self.manner.has_ranges
        {
            (start, end) = (from.parse().unwrap(), length.min(to.parse::<usize>().unwrap() + 1));
            status = "206 Partial Content";
        }
        let mut head = format!("HTTP/1.1 {status}\r\nContent-Length: {}\r\n", end - start);
        if status.starts_with("206") {
            head += &format!("Content-Range: bytes {start}-{}/{length}\r\n", end - 1);
        }
        if self.manner.has_etag {
            head += &format!("ETag: {etag}\r\n");
        }
        let day = if is_new { "Fri, 02" } else { "Thu, 01" };
        head += &format!("Last-Modified: {day} Jan 2026 00:00:00 GMT\r\n\r\n");
        stream.write_all(head.as_bytes()).ok()?;
        let mut body = self.object[start..end].to_vec();
        if is_new || fault == Some(Fault::Flip) {
            let middle = body.len() / 2;
            body[middle] ^= 0x10;
        }
        let sent = if fault == Some(Fault::Cut) { body.len() / 2 } else { body.len() };
        for chunk in body[..sent].chunks(16 << 10) {
            let seconds = chunk.len() as f64 / self.manner.bandwidth;
            let until = {
                let mut free = self.free.lock().unwrap();
                *free = (*free).max(Instant::now()) + Duration::from_secs_f64(seconds);
                *free
            };
            std::thread::sleep(until.saturating_duration_since(Instant::now()));
            stream.write_all(chunk).ok()?;
            self.counts.bytes.fetch_add(chunk.len() as u64, Ordering::Relaxed);
        }
        (sent == body.len()).then_some(())
    }
}
