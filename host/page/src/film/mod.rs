//! A film of a trial as an animated GIF: the moving robot over its yaw, drawn without a browser or a graphics card.

mod moving;
mod palette;
mod picture;
mod render;
mod scene;

pub(crate) use moving::Moving;
pub use picture::Picture;
pub(crate) use picture::Seen;

use biflag_log::LogError;
use gif::{DisposalMethod, Encoder, Frame, Repeat};
use miette::Diagnostic;
use palette::{Palette, TRANSPARENT};
use rayon::prelude::*;
use scene::Scene;
use std::borrow::Cow;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use study::output::{self, OutputError};
use study::plan::PlanError;
use study::session::Attempt;
use study::trial::{LogFinding, Want, Zeroed, findings};
use thiserror::Error;

/// Time between two frames, s: the least that all browsers show, and a whole number of a GIF's hundredths.
const FRAME_S: f64 = 0.04;

/// Most frames of a film: at 25 frames a second, four minutes.
const MAX_FRAMES: usize = 6000;

/// Frames that are drawn at the same time.
const AT_ONCE: usize = 64;

/// What is filmed, and how.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Options {
    /// The time to show, s from the start of the run; `None`: the run.
    pub time_s: Option<[f64; 2]>,
    /// Seconds of the trial in a second of the film.
    pub speed: f64,
    /// Width of the film, pixels. Its height is one and a half times that.
    pub width: u16,
}

/// A written film.
#[derive(Clone, PartialEq, Debug)]
pub struct Film {
    /// Number of frames.
    pub frames: usize,
    /// Duration of the film, s.
    pub duration_s: f64,
    /// Whether the shapes of the flagella are in the log; otherwise rigid helices turn with the motors.
    pub has_shapes: bool,
    /// Findings about the log.
    pub findings: Vec<LogFinding>,
}

/// Why a film was not written.
#[derive(Error, Diagnostic, Debug)]
pub enum FilmError {
    /// The file's name has no known ending.
    #[error("{}: a film is written as .gif", path.display())]
    #[diagnostic(
        code(wrong_use),
        help("end the file's name with .gif; the page of `biflag report` films its view as WebM in the browser")
    )]
    Format {
        /// The file.
        path: PathBuf,
    },
    /// The trial has no data in the time range.
    #[error("{}: nothing to film in this time", path.display())]
    #[diagnostic(code(wrong_use), help("name a time within the trial, counted from the start of its run"))]
    Nothing {
        /// The log.
        path: PathBuf,
    },
    /// The film would be too long.
    #[error("the film would have {frames} frames, more than {MAX_FRAMES}")]
    #[diagnostic(code(wrong_use), help("show less with --time, or faster with --speed"))]
    Long {
        /// Its frames.
        frames: usize,
    },
    /// The film cannot be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Output(#[from] OutputError),
    /// The log cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Log(#[from] LogError),
    /// Its robot is wrong.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Plan(#[from] PlanError),
}

/// Writes the film of a log. `drawn` is called with the number of frames that are drawn and of all.
///
/// # Errors
/// [`FilmError`].
pub fn write(log: &Path, out: &Path, options: &Options, drawn: &dyn Fn(usize, usize)) -> Result<Film, FilmError> {
    if !out.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("gif")) {
        return Err(FilmError::Format { path: out.to_owned() });
    }
    let data = Attempt::of_log(log).read(Want { shapes: usize::MAX, ..Want::default() })?;
    let zeroed = Zeroed::new(&data);
    let nothing = || FilmError::Nothing { path: log.to_owned() };
    let span = shown(&zeroed, options.time_s).ok_or_else(nothing)?;
    let frames = ((span.end - span.start) / (options.speed * FRAME_S)).ceil().max(1.0);
    if frames > MAX_FRAMES as f64 {
        return Err(FilmError::Long { frames: frames as usize });
    }
    let frames = frames as usize;
    let scene = Scene::new(&data, &zeroed, span.clone(), options.width)?;
    let times: Vec<f64> = (0..frames).map(|i| span.start + i as f64 * options.speed * FRAME_S).collect();
    output::replace(out, |file| {
        let palette = Palette::new();
        let [width, height] = scene.size();
        let mut encoder = Encoder::new(file, width, height, palette.colours()).map_err(io::Error::other)?;
        encoder.set_repeat(Repeat::Infinite).map_err(io::Error::other)?;
        let mut before = Vec::new();
        let mut count = 0;
        for some in times.chunks(AT_ONCE) {
            let images: Vec<Vec<u8>> = some.par_iter().map(|time| palette.indices(&scene.draw(*time))).collect();
            for image in images {
                encoder.write_frame(&frame(&image, &before, width)).map_err(io::Error::other)?;
                before = image;
            }
            count += some.len();
            drawn(count, frames);
        }
        Ok(())
    })?;
    Ok(Film {
        frames,
        duration_s: frames as f64 * FRAME_S,
        has_shapes: !data.shapes.is_empty(),
        findings: LogFinding::all_of(&data.path, findings(&data, &zeroed)),
    })
}

/// Returns the time to show on the trial's clock, within its attitude; `None` if there is none.
pub(crate) fn shown(zeroed: &Zeroed, time_s: Option<[f64; 2]>) -> Option<Range<f64>> {
    let all = zeroed.angles_deg.span();
    let wanted = match time_s {
        Some([from, to]) => zeroed.run.start + from..zeroed.run.start + to,
        None => zeroed.run.clone(),
    };
    let shown = wanted.start.max(all.start)..wanted.end.min(all.end);
    (shown.end > shown.start).then_some(shown)
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
