//! A film of a trial as an animated GIF or as WebM: the moving robot over its yaw, drawn without a browser or a graphics card.

mod gif;
mod moving;
mod palette;
mod picture;
mod render;
mod scene;
mod webm;

pub(crate) use moving::Moving;
pub use picture::Picture;
pub(crate) use picture::Seen;

use crate::PageError;
use rayon::prelude::*;
use render::Rgb;
use scene::Scene;
use serde::Serialize;
use std::io::{self, ErrorKind};
use std::ops::Range;
use std::path::Path;
use study::output::{self, OutputError};
use study::session::Attempt;
use study::trial::{Judged, LogFinding, Want, Zeroed};

/// Time between two frames, s: the least that all browsers show of a GIF, and a whole number of its hundredths.
const FRAME_S: f64 = 0.04;

/// Most frames of a film: at 25 frames a second, four minutes.
const MAX_FRAMES: usize = 6000;

/// Number of frames that are drawn in parallel.
const AT_ONCE: usize = 64;

/// Options of a film.
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
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct Film {
    /// Number of frames.
    pub frames: usize,
    /// Duration of the film, s.
    pub duration_s: f64,
    /// Whether the shapes of the flagella are in the log; otherwise rigid helices turn with the motors.
    #[serde(rename = "shapes")]
    pub has_shapes: bool,
    /// Findings about the log.
    pub findings: Vec<LogFinding>,
}

/// The frames of a film: the scene at each time.
struct Frames<'a> {
    scene: Scene,
    times: Vec<f64>,
    drawn: &'a dyn Fn(usize, usize),
}

impl Frames<'_> {
    /// Draws all frames in their order, a few in parallel. `convert` converts the drawn pixels to the input of `write`.
    fn each<T: Send>(
        &self,
        convert: impl Fn(&[Rgb]) -> T + Sync,
        mut write: impl FnMut(T) -> io::Result<()>,
    ) -> io::Result<()> {
        let Self { scene, times, drawn } = self;
        let mut count = 0;
        drawn(count, times.len());
        for some in times.chunks(AT_ONCE) {
            let images: Vec<T> = some.par_iter().map(|time| convert(&scene.draw(*time))).collect();
            images.into_iter().try_for_each(&mut write)?;
            count += some.len();
            drawn(count, times.len());
        }
        Ok(())
    }
}

/// Writes the film of a log. `drawn` is called with the numbers of drawn frames and of all frames, first before any is drawn;
/// never if nothing can be written.
///
/// # Errors
/// [`PageError`].
pub fn write(log: &Path, out: &Path, options: &Options, drawn: &dyn Fn(usize, usize)) -> Result<Film, PageError> {
    let is_webm = output::ending(out, &["gif", "webm"])? == 1;
    let trial = Attempt::of_log(log).read(Want { shapes: usize::MAX, ..Want::default() })?;
    let Judged { data, angles: zeroed, .. } = &trial;
    let help = "name a time within the trial, counted from the start of its run";
    let nothing = || PageError::wrong_use(log, "nothing to film in this time", help);
    let span = shown(zeroed, options.time_s).ok_or_else(nothing)?;
    let count = ((span.end - span.start) / (options.speed * FRAME_S)).ceil().max(1.0);
    if count > MAX_FRAMES as f64 {
        let help = "show less with --time, or faster with --speed".to_owned();
        let what = format!("the film would have {} frames, more than {MAX_FRAMES}", count as usize);
        return Err(PageError::WrongUse { what, help });
    }
    let count = count as usize;
    let frames = Frames {
        scene: Scene::new(data, zeroed, span.clone(), options.width)?,
        times: (0..count).map(|i| span.start + i as f64 * options.speed * FRAME_S).collect(),
        drawn,
    };
    let written = output::replace(out, |file| match is_webm {
        true => webm::encode(&frames, file.get_ref()),
        false => gif::encode(&frames, file),
    });
    written.map_err(|error| match error {
        OutputError::Write { path, source } if is_webm && source.kind() == ErrorKind::Unsupported => {
            PageError::NoEncoder { path, program: webm::ENCODER }
        }
        other => PageError::Output(other),
    })?;
    let (duration_s, has_shapes) = (count as f64 * FRAME_S, !data.shapes.is_empty());
    Ok(Film { frames: count, duration_s, has_shapes, findings: trial.log_findings() })
}

/// Returns the time to show on the trial's clock, within its attitude; `None` if there is none.
pub(crate) fn shown(zeroed: &Zeroed, time_s: Option<[f64; 2]>) -> Option<Range<f64>> {
    let all = zeroed.angles_deg.span();
    let wanted = time_s.map_or_else(|| zeroed.run.clone(), |[from, to]| zeroed.run.start + from..zeroed.run.start + to);
    let shown = wanted.start.max(all.start)..wanted.end.min(all.end);
    (shown.end > shown.start).then_some(shown)
}
