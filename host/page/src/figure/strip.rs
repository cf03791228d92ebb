//! A film strip: the robot at some moments of a trial, side by side.

use super::sheet::{FONT_PT, MM, Sheet};
use crate::PageError;
use crate::film::{Moving, Seen, shown};
use study::text::decimal;
use study::trial::Judged;

/// Gap between two pictures.
const GAP_MM: f64 = 1.0;

/// Width of a picture for the camera, pixels, which sets the scale of its coordinates.
const CAMERA_PX: u16 = 300;

/// The pictures' largest height.
const MOST_HEIGHT_MM: f64 = 80.0;

/// Height of a line of text.
const LINE_PT: f64 = 1.15 * FONT_PT;

/// Share of white in the colour of the farthest parts.
const HAZE: f64 = 0.45;

/// Draws the robot at `moments` times of a trial, the first and the last at the ends of the time.
///
/// # Errors
/// [`PageError::Nothing`] if no sample lies in the time; [`PageError::Plan`] if the log's robot is wrong.
pub(super) fn draw(
    trial: &Judged,
    time_s: Option<[f64; 2]>,
    moments: usize,
    width_mm: f64,
) -> Result<String, PageError> {
    let Judged { data, angles: zeroed, .. } = trial;
    let span = shown(zeroed, time_s).ok_or_else(|| PageError::Nothing { path: data.path.clone() })?;
    let moving = Moving::new(data, zeroed, CAMERA_PX)?;
    let share = |i: usize| i as f64 / (moments - 1).max(1) as f64;
    let times: Vec<f64> = (0..moments).map(|i| span.start + (span.end - span.start) * share(i)).collect();
    let pictures: Vec<Vec<Seen>> = times.iter().map(|time_s| moving.seen(*time_s)).collect();
    let [[x1, x2], [y1, y2]] = bounds(pictures.iter().flatten());
    let mut sheet = Sheet::new(width_mm);
    let cell = (sheet.width - (moments - 1) as f64 * GAP_MM * MM) / moments as f64;
    let scale = (cell / (x2 - x1)).min(MOST_HEIGHT_MM * MM / (y2 - y1));
    let (top, height) = (1.0 * MM, (y2 - y1) * scale);
    for (i, (picture, time_s)) in pictures.iter().zip(&times).enumerate() {
        let middle = i as f64 * (cell + GAP_MM * MM) + 0.5 * cell;
        let at = |[x, y]: [f64; 2]| [middle + (x - 0.5 * (x1 + x2)) * scale, top + (y - y1) * scale];
        let [near, far] = [picture.last(), picture.first()].map(|seen| seen.map_or(0.0, |seen| seen.away_m));
        for solid in picture {
            let haze = HAZE * (solid.away_m - near) / (far - near).max(f64::MIN_POSITIVE);
            let thickness = 2.0 * solid.radius * scale;
            let colour = solid.colour.map(|part| (f64::from(part) + (255.0 - f64::from(part)) * haze).round() as u8);
            sheet.rod([at(solid.from), at(solid.to)], thickness, solid.is_round, colour);
        }
        let [yaw, pitch, _] = moving.angles_deg(*time_s);
        let texts = [format!("{} s", decimal(time_s - zeroed.run.start, 1))];
        let angles = [("ψ", yaw), ("θ", pitch)].map(|(name, angle)| format!("{name} {}°", decimal(angle, 1)));
        for (line, text) in texts.iter().chain(&angles).enumerate() {
            let y = top + height + (line as f64 + 1.2) * LINE_PT;
            sheet.text(middle, y, "middle", &text.replace('-', "−"));
        }
    }
    Ok(sheet.svg(top + height + 3.9 * LINE_PT))
}

/// Returns the smallest rectangle around all solids: x, then y, each from and to, pixels.
fn bounds<'a>(all: impl Iterator<Item = &'a Seen>) -> [[f64; 2]; 2] {
    let mut bounds = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for seen in all {
        for (bound, k) in bounds.iter_mut().zip(0..) {
            bound[0] = bound[0].min(seen.from[k].min(seen.to[k]) - seen.radius);
            bound[1] = bound[1].max(seen.from[k].max(seen.to[k]) + seen.radius);
        }
    }
    bounds
}
