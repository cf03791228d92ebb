//! The EEPROM, byte by byte.

/// A non-volatile memory of bytes.
pub trait Storage {
    /// Reads the byte at `address`, after waiting for the end of a write.
    fn read(&mut self, address: u16) -> u8;

    /// Begins to write a byte, after waiting for the end of the write before. A write takes less than a tick.
    fn write(&mut self, address: u16, byte: u8);
}

/// Writes the first of the bytes from `address` on that differs from `wanted`; returns false if none does. One call a tick
/// writes all of them without waiting, and has read all of them back when it returns false.
#[inline(never)]
pub fn write_first_difference(storage: &mut impl Storage, address: u16, wanted: &[u8]) -> bool {
    match (address..).zip(wanted).find(|(address, byte)| storage.read(*address) != **byte) {
        Some((address, byte)) => {
            storage.write(address, *byte);
            true
        }
        None => false,
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::Storage;
    use std::cell::RefCell;
    use std::rc::Rc;

    /// A memory that counts the writes of each byte; the byte at `stuck` cannot be written.
    #[derive(Clone)]
    pub(crate) struct Memory {
        pub(crate) bytes: Rc<RefCell<[u8; 1024]>>,
        pub(crate) writes: Rc<RefCell<[u32; 1024]>>,
        pub(crate) stuck: Option<u16>,
    }

    impl Memory {
        pub(crate) fn blank() -> Self {
            Self { bytes: Rc::new(RefCell::new([0xFF; 1024])), writes: Rc::new(RefCell::new([0; 1024])), stuck: None }
        }
    }

    impl Storage for Memory {
        fn read(&mut self, address: u16) -> u8 {
            self.bytes.borrow()[usize::from(address)]
        }

        fn write(&mut self, address: u16, byte: u8) {
            self.writes.borrow_mut()[usize::from(address)] += 1;
            if self.stuck != Some(address) {
                self.bytes.borrow_mut()[usize::from(address)] = byte;
            }
        }
    }
}
