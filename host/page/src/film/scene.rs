//! The robot at a time of its trial, in front of the camera, over a chart of its yaw.

use super::moving::Moving;
use super::render::{BACKGROUND, CHART, DIAL, Rgb};
use crate::PageError;
use std::ops::Range;
use study::statistics::extremes;
use study::trial::{Data, Zeroed};

/// The robot over a trial, and the chart.
pub(super) struct Scene {
    moving: Moving,
    /// Height of the chart below the robot, pixels.
    chart_height: usize,
    /// The yaw in each column of the chart, pixels from its upper edge.
    curve: Vec<f64>,
    shown: Range<f64>,
}

impl Scene {
    pub(super) fn new(data: &Data, zeroed: &Zeroed, shown: Range<f64>, width: u16) -> Result<Self, PageError> {
        let moving = Moving::new(data, zeroed, width)?;
        let [width, _] = moving.picture.size;
        let chart_height = width / 6;
        let yaw = zeroed.angles_deg.track(0);
        let columns = (0..width).map(|x| shown.start + (shown.end - shown.start) * x as f64 / (width - 1) as f64);
        let yaws: Vec<f64> = columns.map(|time| yaw.at(time).unwrap_or(0.0)).collect();
        Ok(Self { moving, curve: curve(&yaws, chart_height), chart_height, shown })
    }

    /// Returns width and height of the film, pixels.
    pub(super) fn size(&self) -> [u16; 2] {
        let [width, height] = self.moving.picture.size;
        [width as u16, (height + self.chart_height) as u16]
    }

    /// Draws the scene at a time of the trial.
    pub(super) fn draw(&self, time_s: f64) -> Vec<Rgb> {
        let mut image = self.moving.draw(time_s);
        image.extend(self.chart(time_s));
        image
    }

    /// Draws the yaw over the film's time: dark up to now, light after it, and a point at it.
    fn chart(&self, time_s: f64) -> Vec<Rgb> {
        let [width, _] = self.moving.picture.size;
        let now =
            ((time_s - self.shown.start) / (self.shown.end - self.shown.start)).clamp(0.0, 1.0) * (width - 1) as f64;
        let here = self.curve[now as usize];
        let thickness = width as f64 / 400.0;
        let pixels = (0..self.chart_height).flat_map(|y| (0..width).map(move |x| (x, y)));
        pixels
            .map(|(x, y)| {
                let neighbours = [x.saturating_sub(1), x, (x + 1).min(width - 1)].map(|x| self.curve[x]);
                let [low, high] = extremes(neighbours);
                let away = (low - y as f64).max(y as f64 - high).max(0.0) + 0.5 * (high - low).min(1.0);
                let point = (x as f64 - now).hypot(y as f64 - here);
                let (ink, colour) = match point < 4.0 * thickness + 0.5 {
                    true => (4.0 * thickness + 0.5 - point, CHART),
                    false => (thickness + 0.5 - away, if x as f64 <= now { CHART } else { DIAL }),
                };
                let ink = ink.clamp(0.0, 1.0) as f32;
                std::array::from_fn(|k| {
                    let background = BACKGROUND[k];
                    if ink == 0.0 { background } else { background + (colour[k] - background) * ink }
                })
            })
            .collect()
    }
}

/// Returns the heights of a curve within a chart of `height` pixels.
fn curve(values: &[f64], height: usize) -> Vec<f64> {
    let [low, high] = extremes(values.iter().copied());
    // A yaw that does not change is a line in the middle.
    let range = (high - low).max(1.0);
    let middle = 0.5 * (low + high);
    values.iter().map(|value| height as f64 * (0.5 - 0.7 * (value - middle) / range)).collect()
}
