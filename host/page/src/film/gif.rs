//! A film as an animated GIF. Each frame contains only the part that differs from the frame before.

use super::palette::{Palette, TRANSPARENT};
use super::{FRAME_S, Frames};
use gif::{DisposalMethod, Encoder, Frame, Repeat};
use std::borrow::Cow;
use std::io::{self, Write};

/// Writes the frames to a file.
pub(super) fn encode(frames: &Frames, file: &mut impl Write) -> io::Result<()> {
    let palette = Palette::new();
    let [width, height] = frames.scene.size();
    let mut encoder = Encoder::new(file, width, height, palette.colours()).map_err(io::Error::other)?;
    encoder.set_repeat(Repeat::Infinite).map_err(io::Error::other)?;
    let mut before = Vec::new();
    frames.each(
        |image| palette.indices(image),
        |image| {
            encoder.write_frame(&frame(&image, &before, width)).map_err(io::Error::other)?;
            before = image;
            Ok(())
        },
    )
}

/// Returns a frame with the smallest rectangle in which the image differs from the one before.
fn frame<'a>(image: &[u8], before: &[u8], width: u16) -> Frame<'a> {
    let width = usize::from(width);
    let differs = |i: &usize| before.get(*i) != Some(&image[*i]);
    let (mut left, mut right, mut top, mut bottom) = (width, 0, image.len() / width, 0);
    for i in (0..image.len()).filter(differs) {
        let (x, y) = (i % width, i / width);
        (left, right, top, bottom) = (left.min(x), right.max(x), top.min(y), bottom.max(y));
    }
    if left > right {
        // A frame has one pixel at least.
        (left, right, top, bottom) = (0, 0, 0, 0);
    }
    let rows = (top..=bottom).flat_map(|y| (left..=right).map(move |x| y * width + x));
    let buffer: Vec<u8> = rows.map(|i| if differs(&i) { image[i] } else { TRANSPARENT }).collect();
    Frame {
        delay: (FRAME_S * 100.0).round() as u16,
        dispose: DisposalMethod::Keep,
        transparent: Some(TRANSPARENT),
        left: left as u16,
        top: top as u16,
        width: (right + 1 - left) as u16,
        height: (bottom + 1 - top) as u16,
        buffer: Cow::Owned(buffer),
        ..Frame::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_holds_what_has_changed() {
        let before = [1, 1, 1, 1, 2, 1, 1, 1, 1, 1, 1, 1];
        let mut image = before;
        image[4] = 7;
        image[6] = 8;
        let frame = frame(&image, &before, 4);
        assert_eq!((frame.left, frame.top, frame.width, frame.height), (0, 1, 3, 1));
        assert_eq!(*frame.buffer, [7, TRANSPARENT, 8]);
        let whole = super::frame(&image, &[], 4);
        assert_eq!((whole.width, whole.height, whole.buffer.as_ref()), (4, 3, &image[..]));
        let none = super::frame(&image, &image, 4);
        assert_eq!((none.width, none.height, none.buffer.as_ref()), (1, 1, &[TRANSPARENT][..]));
    }
}
