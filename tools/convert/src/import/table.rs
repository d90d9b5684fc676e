//! Tables of rows of equal size, in bytes that are read on demand.

use super::bytes::{BLOCK, Bytes, Reader, Spool};
use std::io;

/// Unwanted bytes that are read along rather than skipped by a read of its own.
const GAP: u64 = 16 << 10;

/// Rows, each of the same size.
#[derive(Clone, Debug)]
pub(super) struct Table {
    /// Pieces of `rows_a_piece` rows each, the last of fewer.
    pieces: Vec<Bytes>,
    rows_a_piece: u64,
    count: u64,
    stride: u64,
    row: usize,
}

impl Table {
    /// `count` rows of `row` bytes, `stride` apart, the first at byte 0 of `bytes`; `None` if they do not fit.
    pub fn new(bytes: Bytes, count: u64, stride: u64, row: usize) -> Option<Self> {
        let span = match count {
            0 => 0,
            n => (n - 1).checked_mul(stride)?.checked_add(row as u64)?,
        };
        // A row is read as a whole, and windows of rows are bounded by bytes: see `window`.
        (row > 0 && stride >= row as u64 && span <= bytes.len()).then(|| Self {
            pieces: vec![bytes],
            rows_a_piece: count.max(1),
            count,
            stride,
            row,
        })
    }

    /// Number of rows.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Piece and byte of row `i`, below the count, and the number of rows from it to the end of its piece.
    fn locate(&self, i: u64) -> (usize, u64, u64) {
        let (piece, within) = (i / self.rows_a_piece, i % self.rows_a_piece);
        let left = (self.rows_a_piece - within).min(self.count - i);
        (piece as usize, within * self.stride, left)
    }

    /// Calls `take` with the rows `wanted`, which ascend, and their positions in that list.
    pub fn gather(&self, wanted: &[u64], mut take: impl FnMut(usize, &[u8])) -> io::Result<()> {
        let Some(&last) = wanted.last() else { return Ok(()) };
        if last >= self.count {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        let mut open = Open::default();
        let mut block = Vec::new();
        let mut k = 0;
        while k < wanted.len() {
            let first = wanted[k];
            let (piece, at, left) = self.locate(first);
            let (mut end, mut until) = (k + 1, first);
            while let Some(&next) = wanted.get(end) {
                // The rows fit the bytes, so no product overflows.
                let fits = next - first < left
                    && (next - first) * self.stride + self.row as u64 <= BLOCK as u64
                    && (next - until) * self.stride <= GAP.max(self.stride);
                if !fits {
                    break;
                }
                (until, end) = (next, end + 1);
            }
            block.resize(((until - first) * self.stride) as usize + self.row, 0);
            open.piece(self, piece)?.read_at(at, &mut block)?;
            for (position, row) in (k..).zip(&wanted[k..end]) {
                let at = ((row - first) * self.stride) as usize;
                take(position, &block[at..at + self.row]);
            }
            k = end;
        }
        Ok(())
    }

    /// Calls `take` with rows `start` to `end` in order, until it says not to go on.
    pub fn run(&self, start: u64, end: u64, mut take: impl FnMut(u64, &[u8]) -> bool) -> io::Result<()> {
        if end > self.count {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        let mut open = Open::default();
        let mut block = Vec::new();
        let mut i = start;
        while i < end {
            let (piece, at, left) = self.locate(i);
            let rows = left.min(end - i).min((BLOCK as u64 / self.stride).max(1));
            block.resize(((rows - 1) * self.stride) as usize + self.row, 0);
            open.piece(self, piece)?.read_at(at, &mut block)?;
            for k in 0..rows {
                let at = (k * self.stride) as usize;
                if !take(i + k, &block[at..at + self.row]) {
                    return Ok(());
                }
            }
            i += rows;
        }
        Ok(())
    }

    /// The first row of those for which `is_before` does not hold; it must hold for none behind that.
    pub fn partition_point(&self, mut is_before: impl FnMut(&[u8]) -> bool) -> io::Result<u64> {
        let mut open = Open::default();
        let mut row = vec![0; self.row];
        let (mut low, mut high) = (0, self.count);
        while low < high {
            let middle = low + (high - low) / 2;
            let (piece, at, _) = self.locate(middle);
            open.piece(self, piece)?.read_at(at, &mut row)?;
            if is_before(&row) { low = middle + 1 } else { high = middle }
        }
        Ok(low)
    }
}

/// The piece that was read last.
#[derive(Default)]
struct Open(Option<(usize, Reader)>);

impl Open {
    fn piece(&mut self, table: &Table, piece: usize) -> io::Result<&Reader> {
        if self.0.as_ref().is_none_or(|(open, _)| *open != piece) {
            self.0 = None;
        }
        match &mut self.0 {
            Some((_, reader)) => Ok(reader),
            empty => {
                let (_, reader) = empty.insert((piece, table.pieces[piece].open()?));
                Ok(reader)
            }
        }
    }
}

/// Writes a table row by row.
#[derive(Debug)]
pub(super) struct TableWriter<'a> {
    spool: &'a Spool,
    table: Table,
    /// Rows that are not yet in the spool: less than a piece.
    pending: Vec<u8>,
}

impl<'a> TableWriter<'a> {
    /// An empty table of rows of `row` bytes.
    pub fn new(spool: &'a Spool, row: usize) -> Self {
        let rows_a_piece = (BLOCK / row) as u64;
        let table = Table { pieces: Vec::new(), rows_a_piece, count: 0, stride: row as u64, row };
        Self { spool, table, pending: Vec::new() }
    }

    /// Number of rows so far.
    pub fn count(&self) -> u64 {
        self.table.count
    }

    /// Appends a row.
    pub fn push(&mut self, row: &[u8]) -> Result<(), String> {
        debug_assert_eq!(row.len(), self.table.row);
        self.pending.extend_from_slice(row);
        self.table.count += 1;
        if self.table.count.is_multiple_of(self.table.rows_a_piece) {
            self.flush()?;
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<(), String> {
        self.table.pieces.push(self.spool.add(&self.pending)?);
        self.pending.clear();
        Ok(())
    }

    /// The table.
    pub fn finish(mut self) -> Result<Table, String> {
        if !self.pending.is_empty() {
            self.flush()?;
        }
        Ok(self.table)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Row `i` holds `i` in 4 bytes.
    fn value(row: &[u8]) -> u64 {
        u64::from(u32::from_le_bytes([row[0], row[1], row[2], row[3]]))
    }

    fn written(spool: &Spool, rows: u32) -> Table {
        let mut writer = TableWriter::new(spool, 4);
        for i in 0..rows {
            writer.push(&i.to_le_bytes()).unwrap();
        }
        writer.finish().unwrap()
    }

    #[test]
    fn rows_come_back_from_every_piece() {
        let spool = Spool::default();
        let a_piece = (BLOCK / 4) as u32;
        for rows in [0, 1, a_piece - 1, a_piece, a_piece + 1, 3 * a_piece + 5] {
            let table = written(&spool, rows);
            assert_eq!(table.count(), u64::from(rows));
            let mut next = 0;
            table
                .run(0, u64::from(rows), |i, row| {
                    assert_eq!((i, value(row)), (next, next));
                    next += 1;
                    true
                })
                .unwrap();
            assert_eq!(next, u64::from(rows));
            // Dense, sparse, repeated.
            for step in [1u64, 7, 5000, 300_000] {
                let wanted: Vec<u64> = (0..u64::from(rows)).step_by(step as usize).flat_map(|i| [i, i]).collect();
                let mut seen = 0;
                table
                    .gather(&wanted, |k, row| {
                        assert_eq!((k, value(row)), (seen, wanted[k]));
                        seen += 1;
                    })
                    .unwrap();
                assert_eq!(seen, wanted.len());
            }
            assert!(table.gather(&[u64::from(rows)], |_, _| ()).is_err());
            for limit in [0, 1, u64::from(rows) / 2, u64::from(rows)] {
                assert_eq!(table.partition_point(|row| value(row) < limit).unwrap(), limit.min(u64::from(rows)));
            }
        }
    }

    #[test]
    fn rows_must_fit_their_bytes() {
        let bytes = Spool::default().add(&[0; 100]).unwrap();
        let fits = |count, stride, row| Table::new(bytes.clone(), count, stride, row).is_some();
        assert!(fits(25, 4, 4) && fits(13, 8, 4) && fits(1, u64::MAX, 100) && fits(0, u64::MAX, 4));
        assert!(!fits(26, 4, 4) && !fits(14, 8, 4) && !fits(1, 101, 101) && !fits(2, u64::MAX, 4) && !fits(1, 3, 4));
        assert!(!fits(u64::MAX, 4, 4) && !fits(u64::MAX, u64::MAX, 4));
    }
}
