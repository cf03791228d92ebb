//! The mean of a motion over both motor angles, with its standard error, from a stretch of a trial.
//!
//! At constant speeds w1, w2 the motion that a robot ends in is a function of the two motor angles a1, a2: a double Fourier
//! series in exp(i (m a1 + n a2)), whose constant term is the mean. A motor angle is a speed times the time, so a term is a
//! line of the spectrum at the frequency m w1 + n w2 (quasi-periodic motion: Broer and Sevryuk 2010, *Handbook of Dynamical
//! Systems* 3, 249). The series is fitted to means over short cells by least squares, with the exact mean of each term over
//! a cell. A mean over a window has an error if the window cuts off a part of a beat; the constant term does not.
//!
//! - Terms: |m|, |n| <= 0, 1, 2 or 3, at most 49. Terms that the stretch cannot distinguish from one with smaller m and n, or
//!   from the constant, are left out. If the turns of the motors have a simple ratio, the constant term is the mean for this
//!   starting phase.
//! - Slow approach: none, one or two decaying exponentials, with the same time constants in all channels. The mean is the
//!   value approached.
//! - Which terms and time constants: the mean of all choices, weighted by the Bayesian information criterion B as exp(-B/2)
//!   (Schwarz 1978, Ann. Stat. 6, 461; Raftery 1995, Sociol. Methodol. 25, 111). Neighbouring cells are nearly equal, so each
//!   half turn of the faster motor counts as one datum.
//! - Standard error, of three independent parts: the long-run variance of the residual, by the initial positive sequence of
//!   its autocovariances (Geyer 1992, Stat. Sci. 7, 473), times the first diagonal entry of the inverse normal matrix; the
//!   variance of the mean over the choices; half of the remaining approach, since it need not end as it went on.
//! - A slow beat of which the stretch holds only a part looks like an approach, and the mean lacks the unseen part. A fit
//!   with the beat as a term gives the constant of the whole beat; the difference of this constant from the mean, and its
//!   standard error, are two more parts. The constant does not replace the mean, since it is extrapolated. Where the flagella
//!   touch, beats of larger m and n count, too ([`ratio::slipped`]).

use super::CHANNELS;
use super::ratio::{self, SLOWEST_BEAT};
use crate::functions::{exp, ln, powi, sin, sin_cos};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// Largest m and n.
const ORDER: i32 = 3;
/// Lines of the spectrum nearer than this, in turns over the stretch, count as one.
const RESOLVED: f64 = 0.8;
/// Least number of data per fitted term.
const DATA_PER_TERM: f64 = 1.0;
/// Number of time constants of an approach, relative to the stretch, ...
const APPROACHES: usize = 10;
/// ... from this one on, ...
const FASTEST: f64 = 0.06;
/// ... each times this.
const RATIO: f64 = 1.5;
/// A choice with a smaller weight, relative to the best one, does not count.
const NEGLIGIBLE: f64 = 1e-3;
/// A column depends on others if less than this share of its square is left.
const SINGULAR: f64 = 1e-9;
/// Standard error of an extrapolation, as a share of it.
const EXTRAPOLATED: f64 = 0.5;
/// A residual below this part of a channel's sum of squares is rounding.
const ROUNDING: f64 = 1e-14;

/// Mean values over a cell of time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// Middle of the cell, s.
    pub time: f64,
    /// Means over the cell.
    pub values: [f64; CHANNELS],
    /// Whether the flagella touched in it.
    pub touched: bool,
}

/// Mean of a channel over the torus.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mean {
    /// The mean after the end of a slow approach.
    pub mean: f64,
    /// Standard error of the mean.
    pub standard_error: f64,
    /// The remaining approach at the end of the stretch: the mean less the value reached.
    pub to_come: f64,
}

/// Returns the means of all channels from cells of equal length `cell` (s), for motors of these speeds (rad/s). `None` for
/// fewer than two cells.
pub fn means(cells: &[Cell], cell: f64, speeds: [f64; 2]) -> Option<[Mean; CHANNELS]> {
    let (first, last) = (cells.first()?, cells.last().filter(|_| cells.len() > 1)?);
    let length = last.time - first.time + cell;
    let fastest = speeds[0].abs().max(speeds[1].abs());
    // Without a turn of a motor, each cell counts as one datum.
    let data = if fastest * length > TAU { fastest * length / PI } else { cells.len() as f64 };
    let of = |terms: &Terms| {
        let problem = Problem::new(cells, cell, terms, first.time, length);
        problem.mean_of(&problem.choices(data))
    };
    let touches = cells.iter().any(|cell| cell.touched);
    let [resolved, with_beat] = [RESOLVED, SLOWEST_BEAT].map(|slowest| terms(speeds, cell, length, slowest, touches));
    let means = of(&resolved);
    if with_beat == resolved {
        return Some(means);
    }
    let others = of(&with_beat);
    Some(std::array::from_fn(|k| {
        let (mean, other) = (means[k], others[k]);
        let squares = powi(mean.standard_error, 2) + powi(other.standard_error, 2) + powi(other.mean - mean.mean, 2);
        Mean { standard_error: squares.sqrt(), ..mean }
    }))
}

/// The terms of the series.
#[derive(PartialEq)]
struct Terms {
    /// Frequencies in the sequence of their order, rad/s.
    frequencies: Vec<f64>,
    /// Number of columns up to each order.
    columns: Vec<usize>,
}

/// Which terms and which approaches a fit has.
#[derive(Clone, Debug)]
struct Choice {
    order: usize,
    approaches: Vec<usize>,
}

/// The normal equations of an order, with the series eliminated from those of the approaches.
struct Order {
    /// Number of the columns of the series.
    columns: usize,
    /// Cholesky factor of their normal matrix.
    factor: DMatrix<f64>,
    /// Its inverse times the products with the values, the columns of the approaches, and the first unit vector.
    values: DMatrix<f64>,
    approaches: DMatrix<f64>,
    first: DVector<f64>,
    /// The reduced equations of the approaches: normal matrix, products with the values and with the constant.
    normal: DMatrix<f64>,
    products: DMatrix<f64>,
    constant: DVector<f64>,
}

/// A fit of all channels.
struct Problem {
    /// The constant, the harmonics by their order, the approaches.
    columns: DMatrix<f64>,
    values: DMatrix<f64>,
    centre: [f64; CHANNELS],
    squares: [f64; CHANNELS],
    orders: Vec<Order>,
    /// Number of columns before the approaches.
    harmonics: usize,
    normal: DMatrix<f64>,
    /// Values of the approaches at the end of the stretch.
    at_end: [f64; APPROACHES],
}

impl Order {
    /// Returns `None` if the stretch cannot distinguish the terms.
    fn new(normal: &DMatrix<f64>, products: &DMatrix<f64>, columns: usize, harmonics: usize) -> Option<Self> {
        let factor = normal.view((0, 0), (columns, columns)).into_owned().cholesky()?.unpack();
        let values = factor.solve_lower_triangular(&products.rows(0, columns).into_owned())?;
        let approaches =
            factor.solve_lower_triangular(&normal.view((0, harmonics), (columns, APPROACHES)).into_owned())?;
        let mut unit = DVector::zeros(columns);
        unit[0] = 1.0;
        let first = factor.solve_lower_triangular(&unit)?;
        let across = approaches.transpose();
        Some(Self {
            columns,
            normal: normal.view((harmonics, harmonics), (APPROACHES, APPROACHES)) - &across * &approaches,
            products: products.rows(harmonics, APPROACHES) - &across * &values,
            constant: &across * &first,
            factor,
            values,
            approaches,
            first,
        })
    }

    /// Returns the inverse normal matrix of some approaches; `None` where they cannot be distinguished from the series or
    /// each other.
    fn inverse(&self, approaches: &[usize], whole: &DMatrix<f64>, harmonics: usize) -> Option<DMatrix<f64>> {
        let count = approaches.len();
        let own = DMatrix::from_fn(count, count, |i, j| self.normal[(approaches[i], approaches[j])]);
        let factor = own.cholesky()?;
        let pivots = factor.l_dirty().diagonal();
        let is_told = |(i, pivot): (usize, &f64)| {
            let index = harmonics + approaches[i];
            pivot * pivot > SINGULAR * whole[(index, index)]
        };
        pivots.iter().enumerate().all(is_told).then(|| factor.inverse())
    }
}

impl Problem {
    fn new(cells: &[Cell], cell: f64, terms: &Terms, start: f64, length: f64) -> Self {
        let Terms { frequencies, columns: orders } = terms;
        let harmonics = 1 + 2 * frequencies.len();
        let taus: [f64; APPROACHES] = std::array::from_fn(|j| length * FASTEST * powi(RATIO, j as i32));
        let mut columns = DMatrix::zeros(cells.len(), harmonics + APPROACHES);
        for (i, c) in cells.iter().enumerate() {
            let t = c.time - start;
            columns[(i, 0)] = 1.0;
            for (j, w) in frequencies.iter().enumerate() {
                // The mean of the term over the cell.
                let half = 0.5 * w * cell;
                let share = sin(half) / half;
                let (sine, cosine) = sin_cos(w * t);
                columns[(i, 1 + 2 * j)] = share * cosine;
                columns[(i, 2 + 2 * j)] = share * sine;
            }
            for (j, tau) in taus.iter().enumerate() {
                columns[(i, harmonics + j)] = exp(-t / tau);
            }
        }
        let centre = std::array::from_fn(|k| cells.iter().map(|c| c.values[k]).sum::<f64>() / cells.len() as f64);
        let values = DMatrix::from_fn(cells.len(), CHANNELS, |i, k| cells[i].values[k] - centre[k]);
        let across = columns.transpose();
        let (normal, products) = (&across * &columns, &across * &values);
        let orders = orders.iter().map_while(|count| Order::new(&normal, &products, *count, harmonics)).collect();
        let squares = std::array::from_fn(|k| values.column(k).norm_squared());
        let at_end = taus.map(|tau| exp(-(length - 0.5 * cell) / tau));
        Self { columns, values, centre, squares, orders, harmonics, at_end, normal }
    }

    /// Returns the coefficients of the approaches, by channels, and the inverse of their normal matrix.
    fn approaches(&self, choice: &Choice) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
        let order = &self.orders[choice.order];
        let inverse = order.inverse(&choice.approaches, &self.normal, self.harmonics)?;
        let products = order.products.select_rows(&choice.approaches);
        Some((&inverse * products, inverse))
    }

    /// Returns the information criterion of a choice with this many data.
    fn criterion(&self, choice: &Choice, data: f64) -> Option<f64> {
        let (coefficients, _) = self.approaches(choice)?;
        let order = &self.orders[choice.order];
        let count = order.columns + choice.approaches.len();
        let mut sum = 0.0;
        for k in (0..CHANNELS).filter(|k| self.squares[*k] > 0.0) {
            let approach = choice.approaches.iter().enumerate();
            let explained = order.values.column(k).norm_squared()
                + approach.map(|(i, j)| coefficients[(i, k)] * order.products[(*j, k)]).sum::<f64>();
            let left = (self.squares[k] - explained).max(0.0) / self.squares[k] + ROUNDING;
            sum += data * ln(left) + count as f64 * ln(data);
        }
        Some(sum + choice.approaches.len() as f64 * ln(data))
    }

    /// Returns the choices that count, with their weights.
    fn choices(&self, data: f64) -> Vec<(f64, Choice)> {
        let most = (data / DATA_PER_TERM).max(1.0) as usize;
        let mut approaches = vec![Vec::new()];
        for one in 0..APPROACHES {
            approaches.push(vec![one]);
            approaches.extend((one + 1..APPROACHES).map(|other| vec![one, other]));
        }
        let orders = (0..self.orders.len()).filter(|o| self.orders[*o].columns <= most);
        // An order without terms of its own equals the order before it.
        let orders = orders.filter(|o| *o == 0 || self.orders[*o].columns > self.orders[o - 1].columns);
        let all = orders.flat_map(|order| {
            approaches.iter().map(move |approaches| Choice { order, approaches: approaches.clone() })
        });
        let judged: Vec<(f64, Choice)> =
            all.filter_map(|choice| Some((self.criterion(&choice, data)?, choice))).collect();
        let best = judged.iter().map(|(value, _)| *value).fold(f64::INFINITY, f64::min);
        let weighted = judged.into_iter().map(|(value, choice)| (exp(0.5 * (best - value)), choice));
        weighted.filter(|(weight, _)| *weight > NEGLIGIBLE).collect()
    }

    /// Returns the weighted means of some choices.
    fn mean_of(&self, choices: &[(f64, Choice)]) -> [Mean; CHANNELS] {
        let means: Vec<(f64, [Mean; CHANNELS])> =
            choices.iter().filter_map(|(weight, choice)| Some((*weight, self.means(choice)?))).collect();
        let total: f64 = means.iter().map(|(weight, _)| weight).sum();
        std::array::from_fn(|k| {
            let of = |value: &dyn Fn(&Mean) -> f64| {
                means.iter().map(|(weight, means)| weight * value(&means[k])).sum::<f64>() / total
            };
            let mean = of(&|m| m.mean);
            let to_come = of(&|m| m.to_come);
            let spread = of(&|m| powi(m.standard_error, 2) + powi(m.mean - mean, 2));
            let standard_error = (spread + powi(EXTRAPOLATED * to_come, 2)).sqrt();
            Mean { mean, standard_error, to_come }
        })
    }

    fn means(&self, choice: &Choice) -> Option<[Mean; CHANNELS]> {
        let (approaches, inverse) = self.approaches(choice)?;
        let order = &self.orders[choice.order];
        let right = &order.values - order.approaches.select_columns(&choice.approaches) * &approaches;
        let series = order.factor.transpose().solve_upper_triangular(&right)?;
        let of_series = self.columns.columns(0, order.columns) * &series;
        let indices: Vec<usize> = choice.approaches.iter().map(|j| self.harmonics + j).collect();
        let residual = &self.values - of_series - self.columns.select_columns(&indices) * &approaches;
        let constant = order.constant.select_rows(&choice.approaches);
        let variance = order.first.norm_squared() + (constant.transpose() * inverse * &constant)[(0, 0)];
        let (cells, terms) = (residual.nrows() as f64, (order.columns + indices.len()) as f64);
        Some(std::array::from_fn(|k| {
            let long_run = long_run_variance(&residual.column(k).into_owned()) * cells / (cells - terms).max(1.0);
            let left = choice.approaches.iter().enumerate().map(|(i, j)| approaches[(i, k)] * self.at_end[*j]);
            Mean {
                mean: self.centre[k] + series[(0, k)],
                standard_error: (long_run * variance).sqrt(),
                to_come: -left.sum::<f64>(),
            }
        }))
    }
}

/// Returns the terms. `cell` and `length`: lengths of a cell and of the stretch, s; `slowest`: least frequency of a term, in
/// turns over the stretch; `touches`: whether the flagella touch.
fn terms(speeds: [f64; 2], cell: f64, length: f64, slowest: f64, touches: bool) -> Terms {
    let (apart, slowest) = (RESOLVED * TAU / length, slowest * TAU / length);
    let mut found: Vec<f64> = Vec::new();
    if touches {
        // Slow beats of simple ratios that have larger m or n.
        let beats = ratio::slipped(speeds, length, touches).map(|turns| turns * TAU / length);
        found.extend(beats.filter(|beat| (slowest..apart).contains(beat)).take(1));
    }
    let mut orders = vec![1];
    for order in 1..=ORDER {
        for m in 0..=order {
            for n in -order..=order {
                if m.max(n.abs()) < order || (m == 0 && n < 0) {
                    continue;
                }
                let frequency = (f64::from(m) * speeds[0] + f64::from(n) * speeds[1]).abs();
                let is_new = found.iter().all(|other| (other - frequency).abs() > apart);
                // Above half a turn per cell, little of a term is left in the means of cells.
                if frequency > slowest && is_new && frequency * cell < 1.01 * PI {
                    found.push(frequency);
                }
            }
        }
        orders.push(1 + 2 * found.len());
    }
    Terms { frequencies: found, columns: orders }
}

/// Returns the variance of the mean of a sequence times its length: the sum of all autocovariances, up to the first pair of
/// neighbours whose sum is not positive.
fn long_run_variance(values: &DVector<f64>) -> f64 {
    let count = values.len();
    let covariance = |lag: usize| values.rows(lag, count - lag).dot(&values.rows(0, count - lag)) / count as f64;
    let mut sum = -covariance(0);
    for pair in 0..count / 2 {
        let two = covariance(2 * pair) + covariance(2 * pair + 1);
        if two <= 0.0 {
            break;
        }
        sum += 2.0 * two;
    }
    sum.max(covariance(0) / count as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::split_mix::uniform;

    const CELL: f64 = 0.05;

    fn cells(length: f64, value: impl Fn(f64) -> f64) -> Vec<Cell> {
        let count = (length / CELL) as usize;
        let of = |i: usize| {
            let time = CELL * (i as f64 + 0.5);
            // Simpson's rule over the cell.
            let mean = (value(time - 0.5 * CELL) + 4.0 * value(time) + value(time + 0.5 * CELL)) / 6.0;
            let mut values = [0.0; CHANNELS];
            values[0] = mean;
            Cell { time, values, touched: false }
        };
        (0..count).map(of).collect()
    }

    /// Returns random numbers of mean 0 and variance 1: sums of twelve uniform ones.
    fn noise(seed: u64) -> impl FnMut() -> f64 {
        let mut places = 1..;
        move || places.by_ref().take(12).map(|place| uniform(seed, place)).sum::<f64>() - 6.0
    }

    /// The stretch holds no whole number of beats: a plain mean over it is off by a thirtieth of their amplitude.
    #[test]
    fn the_mean_of_a_motion_of_two_angles_is_its_constant_term() {
        let speeds = [-4.813, 6.674];
        let motion = |t: f64| {
            let [a, b] = speeds.map(|w| w * t + 0.3);
            0.7 + 0.1 * a.cos() + 0.05 * (b - 1.0).sin() + 0.08 * (a + b).cos() + 0.02 * (2.0 * a + b).sin()
        };
        let cells = cells(22.2, motion);
        let plain = cells.iter().map(|c| c.values[0]).sum::<f64>() / cells.len() as f64;
        let fitted = means(&cells, CELL, speeds).expect("a mean")[0];
        assert!((plain - 0.7).abs() > 2e-3, "{plain}");
        assert!((fitted.mean - 0.7).abs() < 1e-6 && fitted.standard_error < 1e-5, "{fitted:?}");
    }

    #[test]
    fn a_slow_approach_is_seen_and_its_end_is_the_mean() {
        let speeds = [2.9, -6.4];
        for tau in [8.0, 20.0, 55.0] {
            let cells = cells(60.0, |t| 1.0 - (-t / tau).exp() + 0.1 * (speeds[0] * t).cos());
            let fitted = means(&cells, CELL, speeds).expect("a mean")[0];
            let left = (-60f64 / tau).exp();
            assert!((fitted.mean - 1.0).abs() < 2.0 * fitted.standard_error + 1e-6, "{tau}: {fitted:?}");
            assert!(fitted.standard_error < 0.6 * left + 1e-6, "{tau}: {fitted:?}");
            assert!((fitted.to_come - left).abs() < 2.0 * fitted.standard_error + 1e-6, "{tau}: {fitted:?}");
        }
    }

    /// Beats of 300 s; the stretch has a fifth of one.
    #[test]
    fn the_standard_error_has_the_part_of_a_slow_beat_that_is_not_seen() {
        let speeds = [-60.1, 60.3].map(|rpm| rpm * PI / 30.0);
        for phase in [0.0, 0.8, 1.6, 2.4, 3.2] {
            let slow = |t: f64| 0.01 * ((speeds[0] + speeds[1]) * t + phase).cos();
            let cells = cells(60.0, |t| 0.7 + slow(t) + 0.1 * (speeds[0] * t).cos());
            let fitted = means(&cells, CELL, speeds).expect("a mean")[0];
            assert!((fitted.mean - 0.7).abs() < 2.0 * fitted.standard_error, "{phase}: {fitted:?}");
        }
    }

    /// Beats of 7:1, of which the stretch has a third, count where the flagella touch: the series has no term for them.
    #[test]
    fn the_standard_error_has_the_unseen_part_of_a_beat_of_higher_order() {
        let speeds = [70.3, 10.0].map(|rpm| rpm * PI / 30.0);
        let within = |touched: bool, phase: f64| {
            let slow = |t: f64| 0.01 * ((speeds[0] - 7.0 * speeds[1]) * t + phase).cos();
            let mut cells = cells(60.0, |t| 0.7 + slow(t) + 0.1 * (speeds[0] * t).cos());
            cells.iter_mut().for_each(|cell| cell.touched = touched);
            let fitted = means(&cells, CELL, speeds).expect("a mean")[0];
            println!("{phase}, {touched}: {fitted:?}");
            (fitted.mean - 0.7).abs() < 2.0 * fitted.standard_error
        };
        let phases = [0.0, 0.8, 1.6, 2.4, 3.2];
        assert!(phases.iter().all(|phase| within(true, *phase)));
        assert!(!phases.iter().all(|phase| within(false, *phase)), "the term is not needed");
    }

    /// Noise that stays similar for 0.5 s, over runs of 40 s.
    #[test]
    fn the_standard_error_is_that_of_correlated_noise() {
        let kept = (-CELL / 0.5f64).exp();
        let (mut within, mut errors) = (0, Vec::new());
        for seed in 0..300 {
            let mut draw = noise(seed);
            let mut value = draw();
            let mut cells = cells(40.0, |_| 0.0);
            for cell in &mut cells {
                value = kept * value + (1.0 - kept * kept).sqrt() * draw();
                cell.values[0] = value;
            }
            let fitted = means(&cells, CELL, [5.1, 8.3]).expect("a mean")[0];
            within += usize::from(fitted.mean.abs() < 2.0 * fitted.standard_error);
            errors.push(fitted.standard_error);
        }
        // 95 % of normal errors are within; fits of spurious approaches raise this share.
        assert!(within >= 280, "{within} of 300");
        // Most errors are at most twice the standard deviation of a mean of such noise: it may hide approaches.
        errors.sort_by(f64::total_cmp);
        let median = errors[errors.len() / 2] / (2.0 * 0.5f64 / 40.0).sqrt();
        assert!((0.8..2.5).contains(&median), "{median}");
    }
}
