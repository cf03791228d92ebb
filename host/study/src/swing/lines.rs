//! Lines of two frequencies, their sums and differences, fitted to a motion.

use super::fit::{Complex, Fit, Line};
use super::motion::Motion;
use crate::attitude::Columns;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use sim::functions::{atan2, cos, sin_cos};
use std::f64::consts::TAU;

/// Integer combinations of the two frequencies, one of each pair of opposite ones.
pub const MIXED: [[i32; 2]; 12] =
    [[1, 0], [0, 1], [2, 0], [0, 2], [1, 1], [1, -1], [3, 0], [0, 3], [2, 1], [2, -1], [1, 2], [1, -2]];

/// Highest frequency searched for a motor in a trial, Hz.
pub const FASTEST_HZ: f64 = 1.75;

/// Largest share of a shaking's power outside its main phase. A swing turns, and has half of its power there.
const SHAKING_BESIDE: f64 = 0.001;

/// Speeds that wander are followed in windows of this length, s.
const FOLLOWED_S: f64 = 4.0;

/// Returns a number with its power reduced by `power`.
fn less(number: Complex, power: f64) -> Complex {
    number * (1.0 - power / (number.norm_sqr() + 1e-30)).max(0.0).sqrt()
}

/// Fits lines to one motion.
pub struct Fitter<'a> {
    pub motion: &'a Motion,
    /// Times on which each motor turns steadily.
    t: [Vec<f64>; 2],
    rates: DMatrix<f64>,
    slow: DMatrix<f64>,
    window: Vec<f64>,
    /// Sums of squares without the slow change.
    square: [f64; 3],
    /// Sum of squares that noise explains.
    noise: f64,
}

impl<'a> Fitter<'a> {
    /// Prepares fits.
    pub fn new(motion: &'a Motion) -> Self {
        let degree = if motion.length_s < 30.0 { 3 } else { 5 };
        let half = motion.length_s / 2.0;
        let slow = legendre(&motion.t.iter().map(|t| t / half).collect::<Vec<_>>(), degree);
        let count = motion.t.len() as f64;
        let noise = 2.0 * motion.angle_variance * count / (motion.interval_s * motion.interval_s);
        let rates = DMatrix::from_fn(motion.t.len(), 3, |i, axis| motion.rates[axis][i]);
        let hann = |i: usize| 1.0 - cos(TAU * (i as f64 + 0.5) / count);
        let window = (0..motion.t.len()).map(hann).collect();
        Self { motion, t: [motion.t.clone(), motion.t.clone()], rates, slow, window, square: [0.0; 3], noise }
            .with_squares()
    }

    /// Returns the root mean square of the swing about each axis, °/s, and whether it is more than noise; if not, its bound.
    pub fn axes_dps(&self) -> [(f64, bool); 3] {
        let count = self.motion.t.len() as f64;
        self.square.map(|square| {
            let swing = square - self.noise;
            ((swing.max(self.noise) / count).sqrt(), swing > self.noise)
        })
    }

    /// Returns the root mean square of the swing: in the plane, and about z, °/s.
    pub fn swing_dps(&self) -> [f64; 2] {
        self.swing_beside([self.noise; 3])
    }

    /// Returns the largest root mean square that the swing may have if the angles have unequal noise: in the plane, and about
    /// z, °/s. `known`: the share of the noise that is certain.
    pub fn largest_swing_dps(&self, known: f64) -> [f64; 2] {
        let Motion { variances, angle_variance, .. } = self.motion;
        self.swing_beside(variances.map(|variance| known * self.noise * (variance / angle_variance).min(1.0)))
    }

    /// Returns the root mean square of the swing beside these sums of squares of the noise about each axis.
    fn swing_beside(&self, noise: [f64; 3]) -> [f64; 2] {
        let count = self.motion.t.len() as f64;
        let [x, y, z] = [0, 1, 2].map(|axis| (self.square[axis] - noise[axis]).max(0.0) / count);
        [(x + y).sqrt(), z.sqrt()]
    }

    /// Returns the power at a frequency, at its opposite and about z, as shares of the swing.
    fn power(&self, hz: f64, rates: &DMatrix<f64>) -> [f64; 3] {
        let count = self.motion.t.len();
        let rates = rates.as_slice();
        let mut sums = [Complex::default(); 3];
        let (mut s, mut c) = sin_cos(TAU * hz * self.motion.t[0]);
        let (ds, dc) = sin_cos(TAU * hz * self.motion.interval_s);
        for (i, hann) in self.window.iter().enumerate() {
            let (hs, hc) = (hann * s, hann * c);
            for (axis, sum) in sums.iter_mut().enumerate() {
                sum.re += rates[axis * count + i] * hc;
                sum.im -= rates[axis * count + i] * hs;
            }
            (s, c) = (s * dc + c * ds, c * dc - s * ds);
        }
        let [x, y, z] = sums;
        let plus = Complex { re: x.re - y.im, im: x.im + y.re };
        let minus = Complex { re: x.re + y.im, im: y.re - x.im };
        let plane = count as f64 * (self.square[0] + self.square[1]) + 1e-12;
        [
            plus.norm_sqr() / plane,
            minus.norm_sqr() / plane,
            2.0 * z.norm_sqr() / (count as f64 * self.square[2] + 1e-12),
        ]
    }

    /// Returns the signed frequency with the most power within a reach of this one.
    pub fn strongest_near(&self, hz: f64, reach_hz: f64) -> f64 {
        let step = 0.25 / self.motion.length_s;
        let steps = (reach_hz / step).floor() as i32;
        let power = |f: f64| {
            let [plus, _, about_z] = self.power(f, &self.rates);
            plus + about_z
        };
        let all = (-steps..=steps).map(|k| hz + f64::from(k) * step);
        all.map(|f| (power(f), f)).max_by(|a, b| a.0.total_cmp(&b.0)).map_or(hz, |(_, f)| f)
    }

    /// Returns the frequencies of the strongest lines up to a motor's frequency, each found in the residuals of the stronger
    /// ones.
    pub fn strongest(&self, count: usize, fastest_hz: f64) -> Vec<f64> {
        let length_s = self.motion.length_s;
        let step = 0.35 / length_s;
        let grid: Vec<f64> = (2..(fastest_hz / step) as i32).map(|k| f64::from(k) * step).collect();
        let mut found: Vec<f64> = Vec::new();
        // A parabola interpolates between the points of the grid.
        let peak = |f: f64, residuals: &DMatrix<f64>| {
            let [a, b, c] = [f - step, f, f + step].map(|f| self.power(f, residuals).iter().sum::<f64>());
            let bend = a - 2.0 * b + c;
            if bend < 0.0 { f + step * (0.5 * (a - c) / bend).clamp(-0.5, 0.5) } else { f }
        };
        while let Some(solved) = self.solve(&steady(&found)).filter(|_| found.len() < count) {
            let power = |f: f64| self.power(f, &solved.residuals).iter().sum::<f64>();
            let far = grid.iter().filter(|f| found.iter().all(|other| (*f - other).abs() * length_s > 0.5));
            let Some((_, f)) = far.map(|f| (power(*f), *f)).max_by(|a, b| a.0.total_cmp(&b.0)) else { break };
            found.push(peak(f, &solved.residuals));
        }
        // Near lines pull each other's peak.
        for i in (0..found.len()).cycle().take(3 * found.len()) {
            let Some(solved) = self.solve(&steady(&found)) else { break };
            let own = solved.columns.columns(2 * i, 2) * solved.values.rows(2 * i, 2);
            found[i] = peak(found[i], &(own + solved.residuals));
        }
        found
    }

    /// Treats the lines in which all axes move to and fro together as slow change: a shaking, as a gear makes once a turn of its
    /// motor, is not a swing.
    pub fn without_shaking(mut self, found: &[f64]) -> Self {
        let Some(solved) = self.solve(&steady(found)) else { return self };
        for i in 0..found.len() {
            let of_axis = |axis: usize| (solved.values[(2 * i, axis)], solved.values[(2 * i + 1, axis)]);
            let all = [0, 1, 2].map(of_axis);
            let sum = |of: &dyn Fn(&(f64, f64)) -> f64| all.iter().map(of).sum::<f64>();
            let (cc, ss, cs) = (sum(&|v| v.0 * v.0), sum(&|v| v.1 * v.1), sum(&|v| v.0 * v.1));
            // Share of the power outside the best phase.
            let beside = (1.0 - ((cc - ss) * (cc - ss) + 4.0 * cs * cs).sqrt() / (cc + ss)) / 2.0;
            let [x, y, z] = all.map(|v| v.0 * v.0 + v.1 * v.1);
            if beside < SHAKING_BESIDE && z > 0.05 * (x + y) {
                let (from, count) = (2 * i, self.slow.ncols());
                self.slow = self.slow.insert_columns(count, 2, 0.0);
                self.slow.columns_mut(count, 2).copy_from(&solved.columns.columns(from, 2));
            }
        }
        self.with_squares()
    }

    fn with_squares(mut self) -> Self {
        if let Some(solved) = self.solve(&[]) {
            self.square = [0, 1, 2].map(|axis| solved.residuals.column(axis).norm_squared());
        }
        self
    }

    /// Fits lines of two frequencies, each within `reach_hz` of its start. A frequency of zero is a motor that stands.
    pub fn refined(&self, hz: [f64; 2], reach_hz: [f64; 2], steps: usize) -> Option<Fit> {
        let mut at = hz;
        let mut best: Option<(f64, Fit)> = None;
        for step in 0..=steps {
            let (lines, shares) = self.told_apart(at);
            let Some(solved) = self.solve(&shares) else { break };
            let fit = self.fit(at, &lines, &solved);
            let cost = fit.left[0] + fit.left[1];
            let moves = if step < steps { self.step(at, &lines, &solved) } else { [0.0; 2] };
            let is_worse = best.as_ref().is_some_and(|(least, _)| cost > *least * 1.02);
            if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, fit));
            }
            let before = at;
            let cap = 0.25 / self.motion.length_s;
            for motor in 0..2 {
                let limits = [hz[motor] - reach_hz[motor], hz[motor] + reach_hz[motor]];
                at[motor] = (at[motor] + moves[motor].clamp(-cap, cap)).clamp(limits[0], limits[1]);
            }
            if is_worse || (0..2).all(|motor| (at[motor] - before[motor]).abs() < 1e-6) {
                break;
            }
        }
        best.map(|(_, fit)| fit)
    }

    /// Returns the lines at distinct frequencies, simple ones first, with both motors' shares of each frequency.
    fn told_apart(&self, hz: [f64; 2]) -> (Vec<[i32; 2]>, Vec<[f64; 2]>) {
        let (mut lines, mut shares): (Vec<[i32; 2]>, Vec<[f64; 2]>) = Default::default();
        for of in MIXED {
            if (0..2).any(|motor| of[motor] != 0 && hz[motor] == 0.0) {
                continue;
            }
            let both = [0, 1].map(|motor| f64::from(of[motor]) * hz[motor]);
            let at = both[0] + both[1];
            let is_motor = of[0].abs() + of[1].abs() == 1;
            let apart = if is_motor { 0.5 } else { 0.35 } / self.motion.length_s;
            let is_in_reach = at.abs() > 0.7 / self.motion.length_s && at.abs() < 4.5;
            if is_in_reach && shares.iter().all(|[a, b]| (at.abs() - (a + b).abs()).abs() > apart) {
                lines.push(of);
                shares.push(both);
            }
        }
        (lines, shares)
    }

    fn solve(&self, hz: &[[f64; 2]]) -> Option<Solved> {
        let count = self.motion.t.len();
        let mut columns = Vec::with_capacity(count * (2 * hz.len() + self.slow.ncols()));
        for [one, other] in hz {
            let start = columns.len();
            columns.resize(start + 2 * count, 0.0);
            let (cosine, sine) = columns[start..].split_at_mut(count);
            for (k, (cosine, sine)) in cosine.iter_mut().zip(sine).enumerate() {
                (*sine, *cosine) = sin_cos(TAU * (one * self.t[0][k] + other * self.t[1][k]));
            }
        }
        columns.extend_from_slice(self.slow.as_slice());
        let columns = DMatrix::from_vec(count, 2 * hz.len() + self.slow.ncols(), columns);
        let mut normal = columns.transpose() * &columns;
        (0..normal.nrows()).for_each(|i| normal[(i, i)] *= 1.0 + 1e-4);
        let cholesky = normal.cholesky()?;
        let values = cholesky.solve(&columns.tr_mul(&self.rates));
        let residuals = &self.rates - &columns * &values;
        Some(Solved { columns, cholesky, values, residuals })
    }

    fn fit(&self, hz: [f64; 2], lines: &[[i32; 2]], solved: &Solved) -> Fit {
        // The noise of differentiated angles grows with the frequency, and would look like strong lines at sums of both speeds.
        let noise = |f: f64| 8.0 * self.motion.angle_variance * TAU * TAU * f * f / self.motion.t.len() as f64;
        let line = |(i, of): (usize, &[i32; 2])| {
            let f = f64::from(of[0]) * hz[0] + f64::from(of[1]) * hz[1];
            let of_axis =
                |axis: usize| Complex { re: solved.values[(2 * i, axis)], im: -solved.values[(2 * i + 1, axis)] };
            let [x, y, about_z] = [0, 1, 2].map(of_axis);
            let turns = Complex { re: (x.re - y.im) / 2.0, im: (x.im + y.re) / 2.0 };
            let opposite = Complex { re: (x.re + y.im) / 2.0, im: (y.re - x.im) / 2.0 };
            let is_motor = of[0].abs() + of[1].abs() == 1;
            let turns = if is_motor { turns } else { less(turns, noise(f)) };
            let is_shared = is_motor && (hz[0] + hz[1]).abs() * self.motion.length_s < 1.0;
            let opposite = if is_shared { opposite } else { less(opposite, noise(f)) };
            Line { of: *of, turns, opposite, about_z }
        };
        let [x, y, z] = [0, 1, 2].map(|axis| solved.residuals.column(axis).norm_squared());
        let share = |left: f64, all: f64, axes: f64| {
            // Less than the expected noise is subtracted: a fit may explain some of it by chance.
            let scatter = (3.0 * (2.0 / self.motion.t.len() as f64).sqrt()).min(1.0);
            let (noise, all_noise) = (axes * self.noise * (1.0 - scatter), axes * self.noise);
            let swing = (all - noise).max(1e-12);
            [(left - noise).max(0.0) / swing, all_noise * scatter / swing]
        };
        let [plane, about_z] = [share(x + y, self.square[0] + self.square[1], 2.0), share(z, self.square[2], 1.0)];
        let lines = lines.iter().enumerate().map(line).collect();
        Fit { hz, lines, left: [plane[0], about_z[0]], noise: [plane[1], about_z[1]] }
    }

    /// Returns a Gauss-Newton step of both frequencies, from the motors' own lines only: mixed lines would follow a shaking of
    /// the board.
    fn step(&self, hz: [f64; 2], lines: &[[i32; 2]], solved: &Solved) -> [f64; 2] {
        let mut normal = [[0.0; 2]; 2];
        let mut right = [0.0; 2];
        for axis in 0..3 {
            let weight = self.weight(axis);
            let derivative = |motor: usize| -> Option<DVector<f64>> {
                let i = lines.iter().position(|of| of[motor] == 1 && of[1 - motor] == 0)?;
                let (a, b) = (solved.values[(2 * i, axis)], solved.values[(2 * i + 1, axis)]);
                let (cosine, sine) = (solved.columns.column(2 * i), solved.columns.column(2 * i + 1));
                let along = |k: usize| TAU * self.t[motor][k] * (b * cosine[k] - a * sine[k]);
                let column = DVector::from_fn(self.motion.t.len(), |k, _| along(k));
                let held = solved.cholesky.solve(&solved.columns.tr_mul(&column));
                Some(column - &solved.columns * held)
            };
            let by = [0, 1].map(|motor| if hz[motor] == 0.0 { None } else { derivative(motor) });
            for i in 0..2 {
                let Some(own) = &by[i] else { continue };
                right[i] += weight * own.dot(&solved.residuals.column(axis));
                for j in 0..2 {
                    normal[i][j] += by[j].as_ref().map_or(0.0, |other| weight * own.dot(other));
                }
            }
        }
        let [[a, b], [_, d]] = normal;
        let determinant = a * d - b * b;
        if determinant > 1e-6 * a * d {
            [(d * right[0] - b * right[1]) / determinant, (a * right[1] - b * right[0]) / determinant]
        } else if a > 0.0 && d == 0.0 && hz[1] != 0.0 {
            // One line for both: they move together.
            let by = right[0] / a;
            [by, if hz[0] * hz[1] > 0.0 { by } else { -by }]
        } else {
            [if a > 0.0 { right[0] / a } else { 0.0 }, if d > 0.0 { right[1] / d } else { 0.0 }]
        }
    }

    /// Returns the lead of each motor's line over a fit in windows of equal length, s.
    pub fn ahead(&self, fit: &Fit, windows: usize) -> Option<Vec<[f64; 2]>> {
        let (lines, shares) = self.told_apart(fit.hz);
        let solved = self.solve(&shares)?;
        let count = self.motion.t.len();
        let of = |motor: usize| lines.iter().position(|of| of[motor] == 1 && of[1 - motor] == 0);
        let places = [of(0).or(of(1))?, of(1).or(of(0))?];
        let mut all: Vec<[f64; 2]> = Vec::new();
        for window in 0..windows {
            let mut turns = [0.0; 2];
            for motor in 0..2 {
                let i = 2 * places[motor];
                // Sums for the fitted line and for a line a quarter of a turn ahead: of squares, and of products with the
                // residuals.
                let (mut squares, mut products) = ([1e-30; 2], [0.0; 2]);
                for axis in 0..3 {
                    let (a, b) = (solved.values[(i, axis)], solved.values[(i + 1, axis)]);
                    for k in window * count / windows..(window + 1) * count / windows {
                        let (c, s) = (solved.columns[(k, i)], solved.columns[(k, i + 1)]);
                        for (j, value) in [a * c + b * s, b * c - a * s].into_iter().enumerate() {
                            squares[j] += self.weight(axis) * value * value;
                            products[j] += self.weight(axis) * value * solved.residuals[(k, axis)];
                        }
                    }
                }
                turns[motor] = atan2(products[1] / squares[1], 1.0 + products[0] / squares[0]) / TAU;
                if let Some(last) = all.last() {
                    turns[motor] -= (turns[motor] - last[motor]).round();
                }
            }
            all.push(turns);
        }
        let hz = places.map(|i| shares[i][0] + shares[i][1]);
        Some(all.iter().map(|turns| [0, 1].map(|motor| turns[motor] / hz[motor])).collect())
    }

    fn weight(&self, axis: usize) -> f64 {
        1.0 / (if axis < 2 { self.square[0] + self.square[1] } else { self.square[2] } + 1e-12)
    }

    /// Replaces the times by those at which motors with the constant speeds of a fit would have made the same turns.
    pub fn following(mut self, fit: &Fit) -> Self {
        let windows = (self.motion.length_s / FOLLOWED_S) as usize;
        let Some(ahead_s) = self.ahead(fit, windows) else { return self };
        let width = self.motion.t.len() as f64 / windows as f64;
        for (motor, t) in self.t.iter_mut().enumerate() {
            for (k, t) in t.iter_mut().enumerate() {
                let at = (k as f64 + 0.5) / width - 0.5;
                let i = (at.max(0.0) as usize).min(windows - 2);
                let [before, after] = [ahead_s[i][motor], ahead_s[i + 1][motor]];
                *t += before + (at - i as f64) * (after - before);
            }
        }
        self
    }

    /// Returns a fitter of a longer motion with the same end. Its earlier part takes the motors' rates from the start of this
    /// motion.
    pub fn longer<'b>(&self, motion: &'b Motion, found: &[f64]) -> Fitter<'b> {
        let mut longer = Fitter::new(motion).without_shaking(found);
        let before = motion.t.len() - self.motion.t.len();
        let window = (FOLLOWED_S / motion.interval_s) as usize;
        for (t, own) in longer.t.iter_mut().zip(&self.t) {
            let step = (own[window] - own[0]) / window as f64;
            let earlier = (1..=before).rev().map(|i| own[0] - i as f64 * step);
            *t = earlier.chain(own.iter().copied()).collect();
        }
        longer
    }

    /// Returns the speeds of the motors of a fit over the motion, which ends at `end_s`, rpm.
    pub fn speeds_rpm(&self, fit: &Fit, end_s: f64) -> Columns<2> {
        let middle_s = end_s - self.motion.t[self.motion.t.len() - 1] - self.motion.interval_s;
        let time_s = self.motion.t.windows(2).map(|t| middle_s + 0.5 * (t[0] + t[1])).collect();
        let rpm = |k: usize| {
            self.t[k].windows(2).map(|t| 60.0 * fit.hz[k] * (t[1] - t[0]) / self.motion.interval_s).collect()
        };
        Columns { time_s, values: [rpm(0), rpm(1)] }
    }

    /// Returns the mean rates of the times from [`Self::following`], relative to the clock.
    pub fn rates(&self) -> [f64; 2] {
        let length = |t: &[f64]| t[t.len() - 1] - t[0];
        self.t.each_ref().map(|t| length(t) / length(&self.motion.t))
    }
}

/// Returns lines at steady frequencies.
fn steady(hz: &[f64]) -> Vec<[f64; 2]> {
    hz.iter().map(|f| [*f, 0.0]).collect()
}

struct Solved {
    columns: DMatrix<f64>,
    cholesky: Cholesky<f64, Dyn>,
    /// A column is an axis, as in the residuals.
    values: DMatrix<f64>,
    residuals: DMatrix<f64>,
}

/// Returns Legendre polynomials up to a degree.
fn legendre(x: &[f64], degree: usize) -> DMatrix<f64> {
    let mut all = DMatrix::from_element(x.len(), degree + 1, 1.0);
    for (i, x) in x.iter().enumerate() {
        all[(i, 1)] = *x;
        for n in 1..degree {
            let k = n as f64;
            all[(i, n + 1)] = ((2.0 * k + 1.0) * x * all[(i, n)] - k * all[(i, n - 1)]) / (k + 1.0);
        }
    }
    all
}
