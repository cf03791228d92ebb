//! Bounds on the time and memory of reading, for any content of the file.

use super::rewritten::{Rewriting, rewrite};
use super::*;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    /// The largest allocation of this thread.
    static LONGEST: Cell<usize> = const { Cell::new(0) };
}

/// The system's allocator, with a record of the largest request.
struct Watched;

fn note(size: usize) {
    // An ending thread no longer has the cell.
    let _ = LONGEST.try_with(|longest| longest.set(longest.get().max(size)));
}

// SAFETY: every call is passed on unchanged to the system's allocator.
unsafe impl GlobalAlloc for Watched {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        note(layout.size());
        // SAFETY: the caller's promises are those of the system's allocator.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        note(layout.size());
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        note(size);
        // SAFETY: as above.
        unsafe { System.realloc(memory, layout, size) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static MEMORY: Watched = Watched;

/// A file that counts the bytes read from it.
struct Counting {
    content: Cursor<Vec<u8>>,
    read: u64,
    longest: usize,
}

impl std::io::Read for Counting {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.longest = self.longest.max(buffer.len());
        let count = std::io::Read::read(&mut self.content, buffer)?;
        self.read += count as u64;
        Ok(count)
    }
}

impl std::io::Seek for Counting {
    fn seek(&mut self, to: std::io::SeekFrom) -> std::io::Result<u64> {
        self.content.seek(to)
    }
}

/// Reads a file to its end; returns the number of bytes read and the longest buffer requested.
fn effort(content: Vec<u8>) -> (u64, usize) {
    let mut scanner = Scanner::new(Counting { content: Cursor::new(content), read: 0, longest: 0 }).unwrap();
    while scanner.next().unwrap().is_some() {}
    let Counting { read, longest, .. } = scanner.source;
    (read, longest)
}

/// Many false beginnings of long but possible records take time in proportion to the file.
#[test]
fn search_for_records_is_linear() {
    let log = bytes_of_log(4);
    let count = 200_000u64;
    let mut content = log[..log.len() - 200].to_vec();
    let end = content.len() as u64 + count * 49;
    for _ in 0..count {
        let length = end - content.len() as u64 - 9;
        let sizes = [0, 0, 1 << 20].map(u64::to_le_bytes).concat();
        content.push(mcap::records::op::CHUNK);
        content.extend([&length.to_le_bytes()[..], &sizes, &1u32.to_le_bytes(), &0u32.to_le_bytes()].concat());
        content.extend((length - 40).to_le_bytes());
    }
    assert_eq!(content.len() as u64, end);
    let (read, _) = effort(content);
    println!("{read} of {end} bytes read");
    assert!(read < 12 * end + 8 * (64 << 20), "{read} bytes of {end} are read");
}

/// Every stated length is compared with the actual bytes before memory is allocated.
#[test]
fn stated_lengths_allocate_nothing() {
    let log = bytes_of_log(4);
    for length in [u64::MAX, 1 << 62, 1 << 40, 255 << 20, u64::from(u32::MAX)] {
        for at in (8..log.len() - 8).step_by(31) {
            let mut broken = log.clone();
            broken[at..at + 8].copy_from_slice(&length.to_le_bytes());
            let (_, longest) = effort(broken);
            assert!(longest <= log.len(), "{length} at {at}: a buffer of {longest} bytes");
        }
    }
}

/// The length of a text or a table in a record is compared with the record before memory is allocated.
#[test]
fn stated_lengths_of_texts_allocate_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    write(&path, 4);
    let plain = Rewriting { chunks: false, crcs: false, index: true, lz4: false };
    for log in [std::fs::read(&path).unwrap(), rewrite(&path, plain)] {
        LONGEST.set(0);
        effort(log.clone());
        let usual = LONGEST.get();
        // Every length that precedes a text, and some numbers that only look like lengths.
        let is_length = |at: &usize| {
            let (length, rest) = log[*at..].split_first_chunk().unwrap();
            let text = rest.get(..u32::from_le_bytes(*length) as usize);
            text.is_some_and(|text| !text.is_empty() && text.iter().all(u8::is_ascii_graphic))
        };
        let places: Vec<usize> = (mcap::MAGIC.len()..log.len() - 4).filter(is_length).collect();
        assert!(places.len() > 50, "{} places", places.len());
        for at in places {
            let mut broken = log.clone();
            broken[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
            LONGEST.set(0);
            let _ = scan::last_table(Cursor::new(&broken), Summary::NAME).unwrap();
            effort(broken);
            let longest = LONGEST.get();
            assert!(longest <= usual.max(1 << 20), "a text at {at} of {}: {longest} bytes of memory", log.len());
        }
    }
}
