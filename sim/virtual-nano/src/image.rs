//! Program files: the ELF of the firmware's build, and the Intel HEX files of bootloaders.

use object::elf::{EM_AVR, FileHeader32, PT_LOAD};
use object::read::elf::{FileHeader, ProgramHeader};
use object::{Endianness, Object, ObjectSection};
use std::path::Path;

use crate::mcu::FLASH_BYTES;

/// The content of flash, and the SRAM that it needs.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Image {
    /// Bytes and the flash addresses where they belong.
    pub segments: Vec<(u32, Vec<u8>)>,
    /// Bytes of SRAM that static data take.
    pub static_bytes: u16,
}

impl Image {
    /// Returns the number of bytes in flash.
    pub fn flash_bytes(&self) -> usize {
        self.segments.iter().map(|(_, bytes)| bytes.len()).sum()
    }

    /// Returns the first address after the highest byte.
    pub fn end(&self) -> u32 {
        self.segments.iter().map(|(address, bytes)| address + bytes.len() as u32).max().unwrap_or(0)
    }

    /// Returns the address of the lowest byte.
    pub fn start(&self) -> u32 {
        self.segments.iter().map(|(address, _)| *address).min().unwrap_or(0)
    }

    /// Reads an ELF file of avr-gcc's linker.
    pub fn from_elf(path: &Path) -> Result<Self, String> {
        let bytes = read(path)?;
        let not_elf = |reason: object::Error| format!("{} is not an ELF file: {reason}", path.display());
        let header = FileHeader32::<Endianness>::parse(&*bytes).map_err(not_elf)?;
        let endian = header.endian().map_err(not_elf)?;
        let machine = header.e_machine(endian);
        if machine != EM_AVR {
            return Err(format!(
                "{} is not for the AVR (ELF machine {machine}); build it with `sh firmware/build.sh`",
                path.display()
            ));
        }
        let mut image = Self::default();
        for segment in header.program_headers(endian, &*bytes).map_err(not_elf)? {
            // Initial values of variables are loaded from flash too: the physical address says where. Above flash,
            // avr-gcc numbers the other memories (EEPROM at 0x810000), which are not loaded here.
            let address = segment.p_paddr(endian);
            let content = segment.data(endian, &*bytes).unwrap_or_default();
            if segment.p_type(endian) != PT_LOAD || content.is_empty() || address >= 0x80_0000 {
                continue;
            }
            image.push(address, content, FLASH_BYTES, path)?;
        }
        let file = object::File::parse(&*bytes).map_err(not_elf)?;
        let in_sram = |address| (0x80_0100..0x80_0900).contains(&address);
        let end = file.sections().filter(|section| in_sram(section.address()) && section.size() > 0);
        let end = end.map(|section| section.address() + section.size()).max().unwrap_or(0x80_0100);
        image.static_bytes = (end - 0x80_0100).min(0x800) as u16;
        image.checked(path)
    }

    /// Reads an Intel HEX file of a chip with `room` bytes of flash.
    pub fn from_hex(path: &Path, room: u32) -> Result<Self, String> {
        let bytes = read(path)?;
        let text = String::from_utf8_lossy(&bytes);
        let mut image = Self::default();
        for (index, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
            let record = parse_hex(line.trim());
            match record.ok_or_else(|| format!("{}, line {}: not Intel HEX", path.display(), index + 1))? {
                (0, address, bytes) => image.push(address.into(), &bytes, room, path)?,
                (1, ..) => break,
                // Extended addresses of files for larger chips, start addresses: nothing to load.
                _ => {}
            }
        }
        image.checked(path)
    }

    fn push(&mut self, address: u32, bytes: &[u8], room: u32, path: &Path) -> Result<(), String> {
        let end = u64::from(address) + bytes.len() as u64;
        if end > u64::from(room) {
            return Err(format!("{} does not fit: it needs flash up to {end:#x}", path.display()));
        }
        self.segments.push((address, bytes.to_vec()));
        Ok(())
    }

    fn checked(self, path: &Path) -> Result<Self, String> {
        if self.segments.is_empty() { Err(format!("{} holds no program", path.display())) } else { Ok(self) }
    }
}

fn read(path: &Path) -> Result<Vec<u8>, String> {
    std::fs::read(path).map_err(|error| format!("cannot read {}: {error}", path.display()))
}

/// Parses bytes in hexadecimal.
pub(crate) fn hex(digits: &str) -> Option<Vec<u8>> {
    let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok();
    digits.as_bytes().chunks(2).map(byte).collect::<Option<_>>().filter(|_| digits.len().is_multiple_of(2))
}

/// Parses one line: `:` count, address, kind, bytes, and a checksum that makes the sum of all bytes zero. Returns kind,
/// address and bytes.
fn parse_hex(line: &str) -> Option<(u8, u16, Vec<u8>)> {
    let bytes = hex(line.strip_prefix(':')?)?;
    let [count, high, low, kind, data @ .., _sum] = &bytes[..] else { return None };
    if data.len() != usize::from(*count) || bytes.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte)) != 0 {
        return None;
    }
    Some((*kind, u16::from_be_bytes([*high, *low]), data.to_vec()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hex_line_is_data_only_with_its_sum() {
        assert_eq!(parse_hex(":0400300002F502F8DB"), Some((0, 0x30, vec![0x02, 0xF5, 0x02, 0xF8])));
        assert_eq!(parse_hex(":00000001FF"), Some((1, 0, Vec::new())));
        for wrong in [":0400300002F502F8DC", ":0400300002F502F8", "0400300002F502F8DB", ":04003", ":zz"] {
            assert!(parse_hex(wrong).is_none(), "{wrong}");
        }
    }
}
