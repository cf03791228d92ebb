//! The EEPROM, byte by byte, and stretches of it that end in their CRC.

use protocol::frame::crc16;

/// A non-volatile memory of bytes.
pub trait Storage {
    /// Reads the byte at `address`, after waiting for the end of a write.
    fn read(&mut self, address: u16) -> u8;

    /// Begins to write a byte, after waiting for the end of the write before. A write takes less than a tick.
    fn write(&mut self, address: u16, byte: u8);
}

/// Returns the address of the first of the bytes from `address` on that differs from `wanted`, and the byte wanted there.
#[inline(never)]
pub fn first_difference(storage: &mut impl Storage, address: u16, wanted: &[u8]) -> Option<(u16, u8)> {
    let mut bytes = (address..).zip(wanted.iter().copied());
    bytes.find(|(address, byte)| storage.read(*address) != *byte)
}

/// Writes the byte of [`first_difference`]; returns false if there is none. One call a tick writes all of them without
/// waiting, and has read all of them back when it returns false.
#[inline(never)]
pub fn write_first_difference(storage: &mut impl Storage, address: u16, wanted: &[u8]) -> bool {
    let difference = first_difference(storage, address, wanted);
    if let Some((address, byte)) = difference {
        storage.write(address, byte);
    }
    difference.is_some()
}

/// Reads bytes that end in the CRC-16 of the others, little-endian; returns whether it matches.
#[inline(never)]
pub fn read_checked(storage: &mut impl Storage, address: u16, bytes: &mut [u8]) -> bool {
    for (address, byte) in (address..).zip(bytes.iter_mut()) {
        *byte = storage.read(address);
    }
    bytes.split_last_chunk().is_some_and(|(content, crc)| crc16(content).to_le_bytes() == *crc)
}

/// Puts the CRC-16 of the bytes before them into the last two.
#[inline(never)]
pub fn add_crc(bytes: &mut [u8]) {
    if let Some((content, crc)) = bytes.split_last_chunk_mut() {
        *crc = crc16(content).to_le_bytes();
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::Storage;
    use std::cell::{Cell, RefCell};
    use std::rc::Rc;

    /// A memory that counts the writes of each byte; the byte at `stuck` cannot be written.
    #[derive(Clone)]
    pub(crate) struct Memory {
        pub(crate) bytes: Rc<RefCell<[u8; 1024]>>,
        pub(crate) writes: Rc<RefCell<[u32; 1024]>>,
        pub(crate) stuck: Option<u16>,
        pub(crate) power: Option<Rc<Cell<Power>>>,
    }

    /// Power for this many more writes.
    #[derive(Clone, Copy)]
    pub(crate) struct Power {
        pub(crate) writes: u32,
        pub(crate) end: End,
    }

    /// The fate of the byte that is being written when the power ends.
    #[derive(Clone, Copy, PartialEq, Debug)]
    pub(crate) enum End {
        /// It stays as it was.
        Untouched,
        /// These of its bits, and those that were ones, are ones.
        HalfErased(u8),
        /// These of its bits, and those that will be ones, are ones.
        HalfWritten(u8),
    }

    impl End {
        /// Ends with none, some and all of the bits erased.
        pub(crate) const ALL: [Self; 6] = [
            Self::Untouched,
            Self::HalfErased(0x0F),
            Self::HalfErased(0xAA),
            Self::HalfErased(0xFF),
            Self::HalfWritten(0xF0),
            Self::HalfWritten(0x55),
        ];
    }

    impl Memory {
        pub(crate) fn blank() -> Self {
            let (bytes, writes) = (Rc::new(RefCell::new([0xFF; 1024])), Rc::new(RefCell::new([0; 1024])));
            Self { bytes, writes, stuck: None, power: None }
        }

        /// Returns the same memory, with power for this many writes only.
        pub(crate) fn cut_after(&self, writes: u32, end: End) -> Self {
            Self { power: Some(Rc::new(Cell::new(Power { writes, end }))), ..self.clone() }
        }
    }

    impl Storage for Memory {
        fn read(&mut self, address: u16) -> u8 {
            self.bytes.borrow()[usize::from(address)]
        }

        fn write(&mut self, address: u16, mut byte: u8) {
            if let Some(power) = &self.power {
                let Power { writes, end } = power.get();
                let before = self.bytes.borrow()[usize::from(address)];
                if writes == 0 {
                    byte = match end {
                        End::Untouched => before,
                        End::HalfErased(bits) => before | bits,
                        End::HalfWritten(bits) => byte | bits,
                    };
                }
                // After its end nothing changes any more.
                power.set(Power {
                    writes: writes.saturating_sub(1),
                    end: if writes == 0 { End::Untouched } else { end },
                });
            }
            self.writes.borrow_mut()[usize::from(address)] += 1;
            if self.stuck != Some(address) {
                self.bytes.borrow_mut()[usize::from(address)] = byte;
            }
        }
    }
}
