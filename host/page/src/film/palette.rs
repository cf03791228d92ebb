//! The 255 colours of a film: shades of the few things in it, and their mixtures with the background at edges.

use super::render::{BACKGROUND, BASE, CHART, DIAL, FLAGELLA, Rgb};

/// Index of the pixels that a frame leaves as they are.
pub(super) const TRANSPARENT: u8 = 255;

/// Number of shades of lit surfaces.
const SHADES: usize = 36;

/// Number of shades at edges, each with three shares of background.
const EDGE_SHADES: usize = 12;

/// Bits of each component of a colour in the table of indices.
const BITS: u32 = 5;

/// The colours, and the index of the nearest one for every colour.
pub(super) struct Palette {
    colours: Vec<[u8; 3]>,
    nearest: Vec<u8>,
}

impl Palette {
    pub(super) fn new() -> Self {
        let mut colours = vec![bytes(BACKGROUND)];
        for lit in [FLAGELLA[0], FLAGELLA[1], BASE] {
            let shade =
                |i: usize, of: usize| lit.map(|part| part * (0.25 + 1.0 * i as f32 / (of - 1) as f32).min(1.25));
            colours.extend((0..SHADES).map(|i| bytes(shade(i, SHADES))));
            for share in [0.25, 0.5, 0.75] {
                colours.extend((0..EDGE_SHADES).map(|i| bytes(mixed(shade(i, EDGE_SHADES), share))));
            }
        }
        for flat in [DIAL, CHART] {
            colours.extend((0..12).map(|i| bytes(mixed(flat, i as f32 / 12.0))));
        }
        colours.truncate(usize::from(TRANSPARENT));
        let levels = 1 << BITS;
        let level = |i: usize| ((i * 255) as f32 / (levels - 1) as f32) as i32;
        let nearest = (0..levels * levels * levels).map(|i| {
            let wanted = [i / (levels * levels), i / levels % levels, i % levels].map(level);
            let distance = |colour: &[u8; 3]| -> i32 {
                colour.iter().zip(wanted).map(|(part, wanted)| (i32::from(*part) - wanted).pow(2)).sum()
            };
            (0..colours.len()).min_by_key(|index| distance(&colours[*index])).unwrap_or(0) as u8
        });
        Self { nearest: nearest.collect(), colours }
    }

    /// Returns the colours as the bytes of a GIF's palette.
    pub(super) fn colours(&self) -> &[u8] {
        self.colours.as_flattened()
    }

    /// Returns the indices of an image.
    pub(super) fn indices(&self, image: &[Rgb]) -> Vec<u8> {
        let index = |colour: &Rgb| {
            // The background, most of the image, has its own colour exactly.
            if *colour == BACKGROUND {
                return 0;
            }
            let part = |part: u8| usize::from(part) >> (8 - BITS);
            let [red, green, blue] = bytes(*colour).map(part);
            self.nearest[(red << (2 * BITS)) | (green << BITS) | blue]
        };
        image.iter().map(index).collect()
    }
}

/// Mixes a colour with this share of background.
fn mixed(colour: Rgb, background: f32) -> Rgb {
    std::array::from_fn(|k| colour[k] * (1.0 - background) + BACKGROUND[k] * background)
}

/// Returns red, green and blue of a colour, 0 to 255.
pub(super) fn bytes(colour: Rgb) -> [u8; 3] {
    colour.map(|part| (part * 255.0).round().clamp(0.0, 255.0) as u8)
}
