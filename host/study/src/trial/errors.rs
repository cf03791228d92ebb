//! The errors of a trial's angles: drift and noise from its still phases, and the sensor's errors.

use super::budget::{Budget, CommonTo, Evaluation, Term};
use super::clock::{self, ClockRate};
use super::data::Data;
use super::over_time::{OverTime, SENSOR_ERRORS};
use super::sensitivity::{Sensitivities, Sensitivity, tilts_by_bias};
use super::tilt_zero::TiltZero;
use crate::attitude::{BiasNoise, Columns, Drift, Track, WARMING_DPS_PER_C};
use crate::sensor::{GROUPS, PARAMETERS};
use nalgebra::{DMatrix, RowDVector};
use sim::functions::{acos, cos, hypot, sin};
use std::f64::consts::FRAC_1_SQRT_2;
use std::ops::Range;

/// Half length of the window over which a tilt is averaged, s, because the robot wobbles with its flagella.
const AROUND_S: f64 = 2.0;

/// The derivatives of pitch and of roll with respect to pitch and roll.
const PITCH: [f64; 2] = [1.0, 0.0];
const ROLL: [f64; 2] = [0.0, 1.0];

/// The errors of a measured trial.
#[derive(Clone, Debug)]
pub(super) struct Errors {
    /// `None` without a still phase.
    pub drift: Option<Drift>,
    /// `None` without a still phase.
    pub tilt_zero: Option<TiltZero>,
    sensitivities: Sensitivities,
    temperature_c: Columns<1>,
    zero_c: f64,
    filter_s: f64,
    /// See [`crate::sensor::Sensor::independent_errors`].
    independent: DMatrix<f64>,
    /// See [`crate::sensor::Sensor::shares_of_readings`].
    shares: [f64; PARAMETERS],
    bias_noise: [BiasNoise; 3],
    from_s: f64,
    pub clock: ClockRate,
}

impl Errors {
    /// Collects the known errors. The angles are zero at `from_s`.
    pub fn new(
        data: &Data,
        sensitivities: Sensitivities,
        temperature_c: Track,
        from_s: f64,
        filter_s: f64,
        drift: Option<Drift>,
        tilt_zero: Option<TiltZero>,
    ) -> Self {
        let sensor = data.sensor();
        Self {
            drift,
            tilt_zero,
            sensitivities: sensitivities.with_zero_at(from_s),
            temperature_c: Columns { time_s: temperature_c.time_s.to_vec(), values: [temperature_c.value.to_vec()] },
            zero_c: zero_c(temperature_c, from_s),
            filter_s,
            independent: sensor.independent_errors(),
            shares: sensor.shares_of_readings(),
            bias_noise: sensor.bias_noise,
            from_s,
            clock: clock::rate(data.records.clock.as_ref(), data.duration_s),
        }
    }

    /// Returns the averaging window around a time, within the trial.
    fn around(&self, time_s: f64) -> Range<f64> {
        let span = self.sensitivities.span();
        (time_s - AROUND_S).max(span.start)..(time_s + AROUND_S).min(span.end)
    }

    /// Subtracts the zero and the drift of the yaw, and the known errors of the sensor and of the clock.
    pub fn correct(&self, angles: &mut Columns<3>, yaw_zero: f64) {
        for (time, yaw) in angles.time_s.iter().zip(&mut angles.values[0]) {
            *yaw -= yaw_zero + self.drift.as_ref().map_or(0.0, |drift| drift.at(*time));
        }
        let clock = self.clock.error.value;
        if clock == 0.0 && self.shares.iter().all(|share| *share == 0.0) {
            return;
        }
        let mut wrong = Columns::<3>::default();
        for (row, time) in self.sensitivities.times_s().iter().enumerate() {
            let sum = |of: [f64; SENSOR_ERRORS]| of.iter().zip(&self.shares).map(|(of, share)| of * share).sum::<f64>();
            let [yaw, pitch, roll] = self.sensitivities.at(row);
            wrong.push(*time, [sum(yaw) + yaw[PARAMETERS] * clock, sum(pitch), sum(roll)]);
        }
        for (k, column) in angles.values.iter_mut().enumerate() {
            let track = wrong.track(k);
            for (time, angle) in angles.time_s.iter().zip(column) {
                *angle -= track.at(*time).unwrap_or_default();
            }
        }
    }

    /// Returns the causes of uncertainty of the yaw at a time; `None` if the drift is unknown.
    pub fn yaw(&self, time_s: f64) -> Option<Budget> {
        let drift = self.drift.as_ref()?;
        let noise = Term::of_trial("gyroscope noise", drift.noise_variance(time_s).sqrt(), drift.degrees_of_freedom);
        let bias = Term::of_trial("gyroscope bias", drift.variance(time_s)?.sqrt(), f64::INFINITY);
        let [of_yaw, ..] = self.sensitivities.mean(&self.around(time_s));
        Some(Budget::new([noise, bias].into_iter().chain(self.of_sensor(&of_yaw)).chain([self.clock_term(&of_yaw)])))
    }

    /// Returns the causes of uncertainty of mean pitch, roll and tilt over a time; `None` if their zero is unknown. The clock has
    /// no effect on them if the trial has measured its rate.
    pub fn tilts(&self, angles: &Columns<3>, over: &Range<f64>) -> Option<[Budget; 3]> {
        let zero = self.tilt_zero.as_ref()?;
        let [_, of_pitch, of_roll] = self.sensitivities.mean(over);
        Some([PITCH, ROLL, tilt_gradient(mean_tilt_deg(angles, over))].map(|gradient| {
            let own = zero.terms(gradient, over.end - over.start);
            let sensitivity = std::array::from_fn(|i| gradient[0] * of_pitch[i] + gradient[1] * of_roll[i]);
            let bias = self.bias_term(angles, over, gradient);
            let clock = (!self.clock.is_measured).then(|| self.clock_term(&sensitivity));
            Budget::new(own.into_iter().chain([bias]).chain(self.of_sensor(&sensitivity)).chain(clock))
        }))
    }

    /// Returns the uncertainty of pitch, roll or tilt due to the bias's change since the zero. `gradient`: the
    /// derivatives of the angle with respect to pitch and roll.
    fn bias_term(&self, angles: &Columns<3>, over: &Range<f64>, gradient: [f64; 2]) -> Term {
        let warming_c = self.temperature_c.track(0).mean(over.clone()).unwrap_or_default() - self.zero_c;
        let zero = self.from_s - AROUND_S..self.from_s + AROUND_S;
        let bias_dps = self.bias_noise.map(|noise| hypot(noise.change_dps(&zero, over), WARMING_DPS_PER_C * warming_c));
        let [of_pitch, of_roll] = tilts_by_bias(mean_tilt_deg(angles, over), self.filter_s);
        let by_axis = |i: usize| (gradient[0] * of_pitch[i] + gradient[1] * of_roll[i]) * bias_dps[i];
        Term::new("gyroscope bias", CommonTo::Trial, [0, 1, 2].map(|i| (by_axis(i), f64::INFINITY)))
    }

    /// Returns the uncertainty of mean yaw, pitch and roll over blocks of length `block_s` around times; `None` for the
    /// yaw without a still phase or a known bias, and for the others without a zero of the tilt.
    pub fn over_time(&self, angles: &Columns<3>, times: &[f64], block_s: f64) -> [Option<OverTime>; 3] {
        let drift = self.drift.as_ref().and_then(|drift| drift.covariance(times));
        let zero = self.tilt_zero.as_ref();
        let constant = |tilt: usize| Some(DMatrix::from_element(times.len(), times.len(), zero?.variance(tilt)));
        let mut own = [drift, constant(0), constant(1)];
        let blocks: Vec<_> = times.iter().map(|time| time - 0.5 * block_s..time + 0.5 * block_s).collect();
        let sensitivities: Vec<Sensitivity> = blocks.iter().map(|block| self.sensitivities.mean(block)).collect();
        // If the trial has measured the clock's rate, the remaining error is the trial's own.
        let [own_clock_u, clock_u] =
            if self.clock.is_measured { [self.clock.error.u, 0.0] } else { [0.0, self.clock.error.u] };
        let of_trial = |(block, of): (&Range<f64>, &Sensitivity)| {
            let [pitch, roll] = [PITCH, ROLL].map(|gradient| self.bias_term(angles, block, gradient).u_deg);
            [of[0][PARAMETERS] * own_clock_u, pitch, roll]
        };
        let wholly: Vec<_> = blocks.iter().zip(&sensitivities).map(of_trial).collect();
        let block_variance = |tilt: usize| zero.map_or(0.0, |zero| zero.block_variance(tilt));
        let block_variances = [0.0, block_variance(0), block_variance(1)];
        [0, 1, 2].map(|angle| {
            let mut own = own[angle].take()?;
            let mut effects = DMatrix::zeros(times.len(), SENSOR_ERRORS);
            for i in 0..times.len() {
                for j in 0..times.len() {
                    own[(i, j)] += wholly[i][angle] * wholly[j][angle];
                }
                let of = &sensitivities[i][angle];
                effects.view_mut((i, 0), (1, PARAMETERS)).copy_from(&self.of_each(of));
                effects[(i, PARAMETERS)] = of[PARAMETERS] * clock_u;
            }
            Some(OverTime { own, effects, block_variance: block_variances[angle] })
        })
    }

    /// Returns the effect of the board's clock on an angle.
    fn clock_term(&self, sensitivity: &[f64; SENSOR_ERRORS]) -> Term {
        let rotation_deg = sensitivity[PARAMETERS];
        let common_to = if self.clock.is_measured { CommonTo::Trial } else { CommonTo::Sensor };
        Term {
            evaluation: Evaluation::B,
            sensitivity: Some(rotation_deg.abs()),
            ..Term::new("clock", common_to, [(rotation_deg * self.clock.error.u, f64::INFINITY)])
        }
    }

    /// Returns the effect of each independent sensor error on an angle, degrees.
    fn of_each(&self, sensitivity: &[f64; SENSOR_ERRORS]) -> RowDVector<f64> {
        RowDVector::from_row_slice(&sensitivity[..PARAMETERS]) * &self.independent
    }

    /// Returns the causes in the sensor; `sensitivity`: the derivatives of the angle with respect to each of its
    /// errors.
    fn of_sensor(&self, sensitivity: &[f64; SENSOR_ERRORS]) -> impl Iterator<Item = Term> {
        let each = self.of_each(sensitivity);
        GROUPS.iter().map(move |group| Term {
            sensitivity: Some(sensitivity[group.range.clone()].iter().copied().fold(0.0, hypot)),
            ..Term::new(group.name, CommonTo::Sensor, group.range.clone().map(|i| (each[i], f64::INFINITY)))
        })
    }
}

/// Returns the temperature at which the angles are zero, °C.
pub(super) fn zero_c(temperature_c: Track, from_s: f64) -> f64 {
    temperature_c.mean(from_s - AROUND_S..from_s + AROUND_S).unwrap_or_default()
}

/// Returns mean pitch and roll over a time, degrees.
fn mean_tilt_deg(angles: &Columns<3>, over: &Range<f64>) -> [f64; 2] {
    [1, 2].map(|k| angles.track(k).mean(over.clone()).unwrap_or_default())
}

/// Returns the derivatives of the tilt ([`crate::attitude::tilt_deg`]) with respect to pitch and roll.
pub(super) fn tilt_gradient(tilt_deg: [f64; 2]) -> [f64; 2] {
    let [pitch, roll] = tilt_deg.map(f64::to_radians);
    let sine = sin(acos(cos(pitch) * cos(roll)));
    // Upright, all directions are equivalent.
    if sine == 0.0 { [FRAC_1_SQRT_2; 2] } else { [sin(pitch) * cos(roll) / sine, cos(pitch) * sin(roll) / sine] }
}
