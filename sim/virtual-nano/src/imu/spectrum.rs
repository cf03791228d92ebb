//! Noise with a given spectral density, at any times: the part's white noise behind its low-pass filter, and flicker.
//!
//! Both are linear systems driven by white noise. They advance exactly by any interval, so that the density depends neither
//! on the rate of the readings nor on their regularity. A density is one-sided: white noise of the density n (per √Hz),
//! integrated over a time T, has the standard deviation n √(T / 2).

use super::noise::Noise;
use std::f64::consts::{FRAC_1_SQRT_2, LN_2, TAU};

/// White noise of density 1 behind a second-order Butterworth filter: its density is 1 far below the cutoff, and its
/// variance 1.11 times the cutoff in Hz.
///
/// The filter is x'' + √2 ω x' + ω² (x - w) = 0 with the white noise w. Here v stands for x' / ω.
#[derive(Clone, Debug, Default)]
pub struct LowPassed {
    hz: f64,
    time_s: f64,
    x: f64,
    v: f64,
}

impl LowPassed {
    /// Returns the noise at a time, s, for a cutoff in Hz. Times must not decrease; a new cutoff restarts the filter.
    pub fn at(&mut self, time_s: f64, hz: f64, noise: &mut Noise) -> f64 {
        // Variance of x and of v, which are uncorrelated: density² / 2 times ω / (4 ζ), with ζ = 1/√2.
        let variance = 0.5 * TAU * hz * FRAC_1_SQRT_2 / 2.0;
        let elapsed = if self.hz == hz { (time_s - self.time_s).max(0.0) } else { f64::INFINITY };
        (self.hz, self.time_s) = (hz, time_s);
        let phase = TAU * hz * FRAC_1_SQRT_2 * elapsed;
        // For longer intervals, nothing of the old state is left.
        let [[xx, xv], [vx, vv]] = if phase < 40.0 { transition(phase) } else { [[0.0; 2]; 2] };
        // Covariance from the noise of the interval: the stationary covariance less the old state's share.
        let added_xx = variance * (1.0 - xx * xx - xv * xv).max(0.0);
        let added_xv = -variance * (xx * vx + xv * vv);
        let added_vv = variance * (1.0 - vx * vx - vv * vv).max(0.0);
        let along = added_xx.sqrt();
        let shared = if along > 0.0 { added_xv / along } else { 0.0 };
        let own = (added_vv - shared * shared).max(0.0).sqrt();
        let [a, b] = [noise.normal(), noise.normal()];
        (self.x, self.v) = (xx * self.x + xv * self.v + along * a, vx * self.x + vv * self.v + shared * a + own * b);
        self.x
    }
}

/// Returns the matrix that advances (x, v) without noise by the time t with ω t / √2 = `phase`.
fn transition(phase: f64) -> [[f64; 2]; 2] {
    let (sin, cos) = phase.sin_cos();
    let root = std::f64::consts::SQRT_2 * sin;
    [[cos + sin, root], [-root, cos - sin]].map(|row| row.map(|entry| entry * (-phase).exp()))
}

/// Time constants of the parts of [`Flicker`]: from far below the white noise to more than half an hour, s.
const SHORTEST_S: f64 = 0.02;
const RATIO: f64 = 4.0;
const PARTS: usize = 9;

/// Flicker noise (density squared proportional to 1/f between 1/7000 and 5 Hz) whose Allan deviation has a floor of 1.
///
/// A sum of first-order processes of equal variance whose time constants are a geometric series.
#[derive(Clone, Debug, Default)]
pub struct Flicker {
    /// `None` before the first reading.
    time_s: Option<f64>,
    parts: [f64; PARTS],
}

impl Flicker {
    /// Returns the noise at a time, s. Times must not decrease.
    pub fn at(&mut self, time_s: f64, noise: &mut Noise) -> f64 {
        // The floor is √(2 ln 2 h) for a density squared of h / f, and h = variance / ln ratio of the time constants.
        let variance = RATIO.ln() / (2.0 * LN_2);
        let elapsed = self.time_s.map_or(f64::INFINITY, |before_s| (time_s - before_s).max(0.0));
        self.time_s = Some(time_s);
        let mut constant_s = SHORTEST_S;
        for part in &mut self.parts {
            let kept = (-elapsed / constant_s).exp();
            *part = kept * *part + (variance * (1.0 - kept * kept)).sqrt() * noise.normal();
            constant_s *= RATIO;
        }
        self.parts.iter().sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the Allan deviation of readings for a number of them in a mean.
    fn allan(readings: &[f64], length: usize) -> f64 {
        let means: Vec<f64> =
            readings.chunks_exact(length).map(|part| part.iter().sum::<f64>() / length as f64).collect();
        let squares: f64 = means.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum();
        (0.5 * squares / (means.len() - 1) as f64).sqrt()
    }

    /// Returns the density squared of readings at a frequency (Hz), one-sided: the mean over windows of `length` readings.
    fn density_squared(readings: &[f64], rate_hz: f64, length: usize, hz: f64) -> f64 {
        let mut sum = 0.0;
        let windows = readings.chunks_exact(length);
        let count = windows.len() as f64;
        for window in windows {
            let (mut re, mut im, mut weights) = (0.0, 0.0, 0.0);
            for (i, x) in window.iter().enumerate() {
                let weight = (std::f64::consts::PI * (i as f64 + 0.5) / length as f64).sin().powi(2);
                let (sin, cos) = (TAU * hz * i as f64 / rate_hz).sin_cos();
                (re, im, weights) = (re + weight * x * cos, im + weight * x * sin, weights + weight * weight);
            }
            sum += 2.0 * (re * re + im * im) / (weights * rate_hz);
        }
        sum / count
    }

    #[test]
    fn behind_the_filter_the_noise_has_its_density() {
        const HZ: f64 = 42.0;
        for rate_hz in [200.0, 1000.0, 173.0] {
            let (mut filter, mut noise) = (LowPassed::default(), Noise::new(9));
            let readings: Vec<f64> = (0..400_000).map(|i| filter.at(f64::from(i) / rate_hz, HZ, &mut noise)).collect();
            let variance = readings.iter().map(|x| x * x).sum::<f64>() / 4e5;
            assert!((variance / (1.1107 * HZ) - 1.0).abs() < 0.02, "{rate_hz}: {variance}");
            // The walk of the integral: the Allan deviation over a second is density / √2.
            let walk = allan(&readings, rate_hz as usize);
            assert!((walk / FRAC_1_SQRT_2 - 1.0).abs() < 0.05, "{rate_hz}: {walk}");
            if rate_hz == 1000.0 {
                for (hz, expected) in [(2.0, 1.0), (10.0, 1.0), (42.0, 0.5), (84.0, 1.0 / 17.0)] {
                    let density = density_squared(&readings, rate_hz, 1000, hz);
                    assert!((density / expected - 1.0).abs() < 0.15, "{density} at {hz} Hz");
                }
            }
        }
    }

    #[test]
    fn irregular_readings_do_not_change_the_noise() {
        let (mut filter, mut noise, mut times) = (LowPassed::default(), Noise::new(2), Noise::new(3));
        let (mut time_s, mut products, mut squares) = (0.0, 0.0, 0.0);
        for _ in 0..200_000 {
            // The correlation after 4 ms does not depend on readings before or in between.
            time_s += 0.02 * times.uniform();
            let first = filter.at(time_s, 42.0, &mut noise);
            filter.at(time_s + 0.001, 42.0, &mut noise);
            time_s += 0.004;
            products += first * filter.at(time_s, 42.0, &mut noise);
            squares += first * first;
        }
        let phase = TAU * 42.0 * FRAC_1_SQRT_2 * 0.004;
        let expected = (-phase).exp() * (phase.cos() + phase.sin());
        assert!((products / squares - expected).abs() < 0.01, "{} not {expected}", products / squares);
    }

    #[test]
    fn flicker_has_its_floor_over_three_decades() {
        const RATE_HZ: f64 = 50.0;
        let mut sums = [0.0; 4];
        const LENGTHS: [usize; 4] = [25, 250, 2500, 12_500];
        for seed in 0..8 {
            let (mut flicker, mut noise) = (Flicker::default(), Noise::new(seed));
            let readings: Vec<f64> = (0..250_000).map(|i| flicker.at(f64::from(i) / RATE_HZ, &mut noise)).collect();
            for (sum, length) in sums.iter_mut().zip(LENGTHS) {
                *sum += allan(&readings, length).powi(2) / 8.0;
            }
        }
        let floors = sums.map(f64::sqrt);
        println!("Allan deviation of flicker after 0.5, 5, 50, 250 s: {floors:.3?}");
        assert!(floors.iter().all(|floor| (floor - 1.0).abs() < 0.12), "{floors:?}");
    }
}
