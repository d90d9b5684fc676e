//! A peer in a process of its own, which speaks `benches/peer/protocol.h`.

use super::{Column, Measured, Peer};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Stdio};

pub struct Program {
    columns: Vec<Column>,
    rays: usize,
    child: Child,
    /// `None` once it is to end.
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
}

impl Program {
    /// Starts it, and waits until its trees are built. `rays` is how many a set has.
    pub fn new(program: &Path, dump: &Path, rays: usize) -> Self {
        let start = std::process::Command::new(program).arg(dump).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
        let mut child = start.unwrap_or_else(|error| panic!("{}: {error}", program.display()));
        let input = child.stdin.take();
        let mut output = BufReader::new(child.stdout.take().expect("piped"));
        let mut columns = Vec::new();
        loop {
            let line = line(&mut output);
            let mut words = line.trim_end().split('\t').map(String::from);
            match words.next() {
                Some(title) if !title.is_empty() => columns.push(Column { title, modes: words.collect() }),
                _ => break,
            }
        }
        assert!(!columns.is_empty(), "{} measures nothing", program.display());
        Self { columns, rays, child, input, output }
    }
}

fn line(output: &mut impl BufRead) -> String {
    let mut line = String::new();
    output.read_line(&mut line).expect("it answers");
    line
}

impl Peer for Program {
    fn columns(&self) -> &[Column] {
        &self.columns
    }

    fn measure(&mut self, mode: usize, set: usize, threads: usize) -> Measured {
        let input = self.input.as_mut().expect("it has not ended");
        writeln!(input, "{mode} {set} {threads}").expect("it listens");
        let line = line(&mut self.output);
        let numbers: Vec<f64> = line.split_whitespace().map(|x| x.parse().expect("a number")).collect();
        let [processor, wall] = numbers[..] else { panic!("two numbers, not {line:?}") };
        let mut distances = vec![0f32; self.rays];
        self.output.read_exact(bytemuck::cast_slice_mut(&mut distances)).expect("a distance for every ray");
        Measured { processor, wall, distances }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // It ends where its input does.
        self.input = None;
        if let Err(error) = self.child.wait() {
            eprintln!("peer: {error}");
        }
    }
}
