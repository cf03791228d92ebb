//! Time and memory that reading takes, whatever the file states.

use super::*;

/// A file that counts what is read of it.
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

/// Reads a file to its end; returns the bytes read and the longest buffer asked for.
fn effort(content: Vec<u8>) -> (u64, usize) {
    let mut scanner = Scanner::new(Counting { content: Cursor::new(content), read: 0, longest: 0 }).unwrap();
    while scanner.next().unwrap().is_some() {}
    let Counting { read, longest, .. } = scanner.source_mut();
    (*read, *longest)
}

/// Many false beginnings of records, each of which states a long but possible record, take time in proportion to the file.
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

/// Every length in a file is compared with what is there before memory is asked for.
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
