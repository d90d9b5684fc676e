//! Bytes that a caller brings: what is announced, and wrong ones that are read again.

use crate::common::written_with_all;
use bricks::{ByteSource, Error, Payload, SceneFile};
use std::io;
use std::ops::Range;
use std::sync::{Arc, Mutex};

/// A file far away, of which some reads come with a wrong bit.
struct Far {
    bytes: Vec<u8>,
    /// Reads until the next wrong one; none: no more wrong ones.
    until_wrong: Mutex<Option<u32>>,
    every: u32,
    is_patient: bool,
    announced: Mutex<Vec<Vec<Range<u64>>>>,
    read: Mutex<Vec<Range<u64>>>,
}

impl Far {
    fn new(bytes: Vec<u8>, every: u32, is_patient: bool) -> Arc<Self> {
        let (announced, read) = Default::default();
        Arc::new(Self { bytes, until_wrong: Mutex::new(None), every, is_patient, announced, read })
    }
}

impl ByteSource for Far {
    fn length(&self) -> io::Result<u64> {
        Ok(self.bytes.len() as u64)
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let (start, end) = (offset as usize, offset as usize + out.len());
        out.copy_from_slice(self.bytes.get(start..end).ok_or(io::ErrorKind::UnexpectedEof)?);
        self.read.lock().unwrap().push(offset..end as u64);
        let mut until = self.until_wrong.lock().unwrap();
        if let Some(left) = &mut *until {
            *left = left.checked_sub(1).unwrap_or(self.every);
            if *left == 0 && !out.is_empty() {
                out[out.len() / 2] ^= 4;
            }
        }
        Ok(())
    }

    fn announce(&self, spans: &[Range<u64>]) {
        self.announced.lock().unwrap().push(spans.to_vec());
    }

    fn announced_bytes(&self) -> Option<u64> {
        Some(3000)
    }

    fn distrust(&self, _: Range<u64>, times: u32) -> bool {
        self.is_patient && times < 3
    }

    fn is_file(&self) -> bool {
        false
    }
}

/// Every payload in parts, as what went wrong first.
fn copy_all(file: &SceneFile) -> Result<(), Error> {
    let payloads: Vec<Payload> = file.resident().payloads().map(|(payload, _)| payload).collect();
    for payload in file.in_parts(&payloads).flatten() {
        file.copy(*payload, &mut vec![0; file.loaded_bytes(*payload) as usize])?;
    }
    Ok(())
}

#[test]
fn what_is_read_was_announced() {
    let (_folder, path, _) = written_with_all();
    let far = Far::new(std::fs::read(&path).unwrap(), 0, true);
    let file = SceneFile::from_source("far", far.clone()).unwrap();
    let resident = far.announced.lock().unwrap().pop().unwrap();
    assert_eq!(resident[0].end, file.file_bytes());
    assert!(far.read.lock().unwrap().drain(..).all(|read| read.end <= 4096 || resident[0].start <= read.start));
    copy_all(&file).unwrap();
    let announced: Vec<_> = far.announced.lock().unwrap().drain(..).collect();
    assert!(announced.len() > 3, "{announced:?}");
    let bytes = |part: &Vec<Range<u64>>| part.iter().map(|span| span.end - span.start).sum::<u64>();
    assert!(announced.iter().all(|part| part.len() == 1 || bytes(part) <= 3000));
    let read: Vec<_> = far.read.lock().unwrap().drain(..).filter(|read| !read.is_empty()).collect();
    assert_eq!(announced.concat(), read);
    // Every byte that `verify` reads as well, padding included, but the header.
    assert!(file.verify(&mut |_, _| ()).unwrap().is_ok());
    let (announced, read) = (far.announced.lock().unwrap().concat(), far.read.lock().unwrap().clone());
    let has = |read: &Range<u64>| announced.iter().any(|span| span.start <= read.start && read.end <= span.end);
    assert!(read.iter().skip(1).all(has));
    // A file is not told.
    let local = SceneFile::open(&path).unwrap();
    assert!(local.announced_bytes().is_none() && copy_all(&local).is_ok());
}

#[test]
fn wrong_bytes_are_read_again_where_that_helps() {
    let (_folder, path, _) = written_with_all();
    let bytes = std::fs::read(&path).unwrap();
    for every in [2, 3, 5] {
        let far = Far::new(bytes.clone(), every, true);
        *far.until_wrong.lock().unwrap() = Some(every);
        let file = SceneFile::from_source("far", far.clone()).unwrap();
        copy_all(&file).unwrap();
        let report = file.verify(&mut |_, _| ()).unwrap();
        assert!(report.is_ok(), "{:?}", report.problems);
    }
    // The control: whoever reads once gets them.
    let far = Far::new(bytes.clone(), 3, false);
    let file = SceneFile::from_source("far", far.clone()).unwrap();
    *far.until_wrong.lock().unwrap() = Some(3);
    assert!(matches!(copy_all(&file).unwrap_err().cause(), Error::Corrupt { .. }));
    assert!(!file.verify(&mut |_, _| ()).unwrap().is_ok());
    // And bytes that stay wrong end.
    let far = Far::new(bytes, 0, true);
    let file = SceneFile::from_source("far", far.clone()).unwrap();
    *far.until_wrong.lock().unwrap() = Some(0);
    assert!(matches!(copy_all(&file).unwrap_err().cause(), Error::Corrupt { .. }));
}
