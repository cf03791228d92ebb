//! The bootloaders that Arduino Nanos come with, from Debian's package `arduino-core-avr`.

use crate::image::Image;
use crate::mcu::FLASH_BYTES;
use std::path::Path;

/// A bootloader.
#[derive(clap::ValueEnum, Clone, Copy, PartialEq, Eq, Debug)]
pub enum Bootloader {
    /// Since 2018: 115200 bit/s, 512 bytes at 0x7E00.
    #[value(help = "115200 bit/s")]
    Optiboot,
    /// The same with the signature of an ATmega328PB, which simavr does not have.
    #[value(name = "optiboot-328pb", help = "the same, of an ATmega328PB")]
    Optiboot328pb,
    /// Before 2018, and on many clones: ATmegaBOOT, 57600 bit/s, at 0x7800.
    #[value(help = "57600 bit/s")]
    Old,
}

/// The package's folder of bootloaders.
const FOLDER: &str = "/usr/share/arduino/hardware/arduino/avr/bootloaders";

/// Debian builds optiboot with a newer compiler than Arduino did, and its last 20 bytes lie past the end of flash: a
/// real chip could not start a program from it. The emulated chip has more flash to hold them.
const ROOM: u32 = FLASH_BYTES + 64;

/// The only instruction that loads the last byte of the signature: `ldi r24, 0x0F`, and `ldi r24, 0x16` of an ATmega328PB
/// (data sheets, section "Signature Bytes").
const LAST_OF_328P: [u8; 2] = [0x8F, 0xE0];
const LAST_OF_328PB: [u8; 2] = [0x86, 0xE1];

impl Bootloader {
    /// Returns the bootloader's speed, bit/s.
    pub fn baud(self) -> u32 {
        match self {
            Self::Optiboot | Self::Optiboot328pb => 115_200,
            Self::Old => 57_600,
        }
    }

    /// Reads the bootloader's file.
    pub fn load(self) -> Result<Image, String> {
        self.load_from(Path::new(FOLDER))
    }

    fn load_from(self, folder: &Path) -> Result<Image, String> {
        let name = match self {
            Self::Optiboot | Self::Optiboot328pb => "optiboot/optiboot_atmega328.hex",
            Self::Old => "atmega/ATmegaBOOT_168_atmega328.hex",
        };
        let path = folder.join(name);
        if !path.exists() {
            return Err(format!("no {name} in {}; install Debian's package arduino-core-avr", folder.display()));
        }
        let mut image = Image::from_hex(&path, ROOM)?;
        if self == Self::Optiboot328pb {
            let mut lines = image.segments.iter_mut().flat_map(|(_, bytes)| bytes.as_chunks_mut().0);
            *lines.find(|line| **line == LAST_OF_328P).ok_or("its signature is not found")? = LAST_OF_328PB;
        }
        Ok(image)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_start_where_the_fuses_point() {
        assert_eq!(Bootloader::Optiboot.load().unwrap().start(), 0x7E00);
        assert_eq!(Bootloader::Old.load().unwrap().start(), 0x7800);
        let [of_328p, of_328pb] =
            [Bootloader::Optiboot, Bootloader::Optiboot328pb].map(|one| one.load().unwrap().segments);
        let bytes =
            |segments: Vec<(u32, Vec<u8>)>| segments.into_iter().flat_map(|(_, bytes)| bytes).collect::<Vec<_>>();
        let (one, other) = (bytes(of_328p), bytes(of_328pb));
        assert_eq!(one.iter().zip(&other).filter(|(one, other)| one != other).count(), 2, "one instruction");
    }

    #[test]
    fn a_missing_package_is_named() {
        let error = Bootloader::Old.load_from(Path::new("/nowhere")).unwrap_err();
        assert!(error.to_string().contains("arduino-core-avr"), "{error}");
    }
}
