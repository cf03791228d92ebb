//! The firmware image inside this program.

use crate::run::rig::{Image, ImageError, commit_of_image, repository};
use std::io::Write;

/// The image; empty if the program was built without one.
const EMBEDDED: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/firmware.elf"));

/// Returns the image that belongs to this program: that of its repository, which is built first if a source is newer, or the
/// one inside the program if it is elsewhere.
///
/// # Errors
/// As [`Image::build`] and [`Image::extract`].
pub fn of_program() -> Result<Image, ImageError> {
    let Some(root) = repository() else {
        return if EMBEDDED.is_empty() { Err(ImageError::NoSource) } else { Image::extract(EMBEDDED) };
    };
    if let Some(image) = Image::built(&root) {
        return Ok(image);
    }
    // It takes a minute at first.
    let _ = writeln!(std::io::stderr(), "building the firmware: its source is newer than its image");
    Image::build(&root)
}

/// Returns the commit of the image inside the program.
pub fn embedded_commit() -> Option<String> {
    commit_of_image(EMBEDDED)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_image_inside_the_program_is_a_file_while_it_is_used() {
        let commit = embedded_commit().expect("an image, which `make build` puts into the program");
        let image = Image::extract(EMBEDDED).unwrap();
        let elf = image.elf.clone();
        assert_eq!(image.commit, commit);
        assert_eq!(Image::read(&elf).unwrap().commit, image.commit);
        drop(image);
        assert!(!elf.exists());
    }
}
