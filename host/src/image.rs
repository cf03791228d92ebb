//! The firmware image inside this program.

use crate::run::rig::{Image, ImageError, commit_of_image, repository};

/// The image; empty if the program was built without one.
const EMBEDDED: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/firmware.elf"));

/// Returns the image that belongs to this program: in its repository the image of the source, elsewhere the one inside the
/// program.
///
/// # Errors
/// As [`Image::of_source`] and [`Image::extract`].
pub fn of_program() -> Result<Image, ImageError> {
    match repository() {
        Some(root) => Image::of_source(&root, EMBEDDED),
        None if EMBEDDED.is_empty() => Err(ImageError::NoSource),
        None => Image::extract(EMBEDDED),
    }
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
