//! The bootloaders that Arduino Nanos come with, from Debian's package `arduino-core-avr`.

use crate::image::{Image, ImageError};
use crate::mcu::FLASH_BYTES;
use std::path::{Path, PathBuf};

/// A bootloader.
#[derive(clap::ValueEnum, Clone, Copy, PartialEq, Eq, Debug)]
pub enum Bootloader {
    /// Since 2018: 115200 bit/s, 512 bytes at 0x7E00.
    #[value(help = "115200 bit/s")]
    Optiboot,
    /// Before, and on many clones: ATmegaBOOT, 57600 bit/s, at 0x7800.
    #[value(help = "57600 bit/s")]
    Old,
}

/// Why a bootloader is not available.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum BootloaderError {
    /// Not installed.
    #[error("no {name} in {folder}; install Debian's package arduino-core-avr")]
    Missing { name: &'static str, folder: PathBuf },
    /// Damaged.
    #[error(transparent)]
    Image(#[from] ImageError),
}

/// The package's folder of bootloaders.
const FOLDER: &str = "/usr/share/arduino/hardware/arduino/avr/bootloaders";

/// Debian builds optiboot with a newer compiler than Arduino did, and its last 20 bytes lie past the end of flash: a
/// real chip could not start a program from it. The emulated chip has more flash to hold them.
const ROOM: u32 = FLASH_BYTES + 64;

impl Bootloader {
    /// Returns the bootloader's speed, bit/s.
    pub fn baud(self) -> u32 {
        match self {
            Self::Optiboot => 115_200,
            Self::Old => 57_600,
        }
    }

    /// Reads the bootloader's file.
    pub fn load(self) -> Result<Image, BootloaderError> {
        self.load_from(Path::new(FOLDER))
    }

    fn load_from(self, folder: &Path) -> Result<Image, BootloaderError> {
        let name = match self {
            Self::Optiboot => "optiboot/optiboot_atmega328.hex",
            Self::Old => "atmega/ATmegaBOOT_168_atmega328.hex",
        };
        let path = folder.join(name);
        if !path.exists() {
            return Err(BootloaderError::Missing { name, folder: folder.into() });
        }
        Ok(Image::from_hex(&path, ROOM)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_start_where_the_fuses_point() {
        assert_eq!(Bootloader::Optiboot.load().unwrap().start(), 0x7E00);
        assert_eq!(Bootloader::Old.load().unwrap().start(), 0x7800);
    }

    #[test]
    fn a_missing_package_is_named() {
        let error = Bootloader::Old.load_from(Path::new("/nowhere")).unwrap_err();
        assert!(error.to_string().contains("arduino-core-avr"), "{error}");
    }
}
