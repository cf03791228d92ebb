//! The attitude of a trial relative to its zero (levelled, relative to the still phase before the run, with the drift
//! of the yaw removed), and its uncertainty.
//!
//! A measured attitude is levelled by the accelerometer's vertical at rest ([`crate::attitude::Level`]), expressed
//! relative to the mean attitude of the still phase, and corrected for the gyroscope's drift ([`Drift`]). The sensor's
//! filter delays the attitude, so its times are moved back by that delay. A modelled attitude is exact: the robot
//! starts upright with a yaw of zero, and there is no gyroscope to drift. An imported attitude is also relative to its
//! rest; the import states its errors.

use super::angles::{Angles, Steady, swing_s};
use super::back_at_zero;
use super::budget::{Budget, TO_COME, Term};
use super::data::Data;
use super::errors::{self, Errors};
use super::import_rest;
use super::imported::Stated;
use super::over_time::OverTime;
use super::rest::{AtRest, START_S};
use super::rest_fit::end_of;
use super::righting::{left_deg, righting_s, time_constants};
use super::sensitivity::Sensitivities;
use super::tilt_zero::TiltZero;
use crate::attitude::{Columns, Drift, Euler, Level, Leveller, Reading, Rest, Series, rotation, tilt_deg};
use crate::swing::SwingSpeeds;
use biflag_log::{Origin, SteadyMeta};
use nalgebra::{UnitQuaternion, Vector3};
use protocol::units::LOW_PASS;
use sim::body::attitude::of_euler_zyx;
use sim::functions::hypot;
use sim::trial::means::{CHANNELS, SteadyCollector};
use sim::trial::quantity::{SETTLE, Values, WINDOW};
use std::f64::consts::PI;
use std::ops::Range;
use std::sync::OnceLock;

/// Smallest gain of the board's filter distinguished from zero, 1/s.
const MIN_GAIN: f64 = 0.01;

/// Longest gap in the readings at the start of the run that hides no motion, s.
const MAX_GAP_S: f64 = 0.05;

/// Time in which a motor stops and turns the other way, s.
const REVERSAL_S: f64 = 1.0;

/// The attitude of a trial relative to its zero. Times are on the log's clock.
#[derive(Clone, Debug, Default)]
pub struct Zeroed {
    /// Yaw (unwrapped), pitch, roll, degrees.
    pub angles_deg: Columns<3>,
    /// The subtracted zero: yaw, pitch, roll, degrees. All zero for a model.
    pub zero_deg: [f64; 3],
    /// Time range of the run, s.
    pub run: Range<f64>,
    /// Time at which the yaw is zero, s.
    pub from_s: f64,
    /// Angle turned about each body axis since the gyroscope was calibrated, degrees.
    pub turned_deg: [f64; 3],
    /// The steady end of the run; `None` if there is no attitude in the run.
    pub steady: Option<Steady>,
    pub(super) rest: AtRest,
    known: Known,
    /// Whether a finding invalidates all uncertainties.
    is_unsure: bool,
    /// Uncertainty of the yaw at every second; empty if it is unknown.
    yaw_uncertainty_deg: Columns<1>,
}

/// The known errors of the angles.
#[derive(Clone, Debug, Default)]
enum Known {
    /// A model has none.
    #[default]
    Exact,
    /// Errors of the board's sensor.
    Sensor(Box<Errors>),
    /// Errors that an import states; `None` if it states none.
    Stated(Option<Stated>),
}

impl Zeroed {
    /// Computes the attitude of a trial. `after` is the time range in which the robot may be still again.
    pub(super) fn with_end(data: &Data, after: Range<f64>) -> Self {
        let mut zeroed = match data.origin() {
            Origin::Model => Self::modelled(data),
            Origin::Imported => Self::imported(data),
            Origin::Rig | Origin::VirtualRig => Self::measured(data, after),
        };
        zeroed.steady = zeroed.steady(data);
        zeroed
    }

    /// Removes all uncertainties, or computes the yaw's uncertainty over time.
    pub(super) fn judge(&mut self, is_unsure: bool) {
        self.is_unsure = is_unsure;
        if is_unsure {
            self.steady.iter_mut().for_each(|steady| (steady.budgets, steady.of_model) = Default::default());
            return;
        }
        let span = self.span();
        for second in 0..=(span.end - span.start).ceil() as usize {
            let time = (span.start + second as f64).min(span.end);
            if let Some(budget) = self.yaw_budget(time) {
                self.yaw_uncertainty_deg.push(time, [budget.uncertainty_deg()]);
            }
        }
    }

    fn modelled(data: &Data) -> Self {
        let [yaw, pitch, roll, ..] = data.truth.values.clone();
        let mut series = Series::default();
        data.readings.iter().for_each(|(time, reading)| series.push(*time, reading));
        Self {
            angles_deg: Columns { time_s: data.truth.time_s.clone(), values: [yaw, pitch, roll] },
            run: data.times.run.clone(),
            from_s: data.times.run.start,
            turned_deg: series.turned_deg(),
            ..Self::default()
        }
    }

    fn measured(data: &Data, after: Range<f64>) -> Self {
        let run = data.times.run.clone();
        let readings = levelled(data);
        let first = readings.first().map_or(0.0, |(time, _)| *time);
        // If readings are lost around the start of the run, the still phase ends with the last one before the gap: the
        // robot moves during the gap, and the zero must not include this motion.
        let started = gap_at(&readings, run.start).filter(|gap| gap.end - gap.start > MAX_GAP_S);
        let rest_end = started.as_ref().map_or(run.start, |gap| gap.start);
        let still = data.times.preroll.start.max(first).min(rest_end)..rest_end;
        let has_still = still.end - still.start >= START_S;
        let settled = end_of(&still);
        let (mean_over, tilt_over) = if has_still {
            (still.clone(), settled.start.max(0.5 * (still.start + still.end))..still.end)
        } else {
            (run.start..run.start, run.start - 0.1..run.start + 0.1)
        };
        let tilt = if data.times.has_run() { mean(&readings, &tilt_over) } else { None };
        let zero = Euler::of(&tilt.unwrap_or_default());
        // The sensor is mounted askew in the body: measured = true * askew. The zero of the yaw is not part of `askew`.
        let askew = of_euler_zyx([0.0, zero.pitch_deg.to_radians(), zero.roll_deg.to_radians()]);
        let mut series = Series::new(data.settings().is_some_and(|settings| settings.attitude_ki != 0.0));
        for (time, reading) in &readings {
            let q = (rotation(reading.attitude) * askew.inverse()).into_inner();
            series.push(*time, &Reading { attitude: [q.w, q.i, q.j, q.k], ..*reading });
        }
        // A calibration during which the board moved is not used.
        let is_calibrated = data.records.calibration.as_ref().is_none_or(|calibration| calibration.still);
        let calibrate_s = if is_calibrated { data.trial().calibrate_s } else { 0.0 };
        let start = (mean_over.end - START_S).max(mean_over.start)..mean_over.end;
        let from_s = 0.5 * (start.start + start.end);
        let filter_s = data.settings().map_or(1.0, |settings| 1.0 / f64::from(settings.attitude_kp).max(MIN_GAIN));
        let sensor = data.sensor();
        let constants = time_constants(data);
        let phases = Rest {
            before: still,
            after,
            calibrate_s,
            filter_s,
            bias_noise: sensor.bias_noise,
            angle_walk: sensor.angle_walk(),
            time_constant_s: constants.map(|constants| constants.yaw_s).filter(|yaw_s| yaw_s.is_finite()),
        };
        let drift = if data.times.has_run() { Drift::estimate(&series, &phases, from_s) } else { None };
        let yaw_zero = if data.times.has_run() { series.yaw().mean(start).unwrap_or(0.0) } else { 0.0 };
        let tilts = [series.pitch(), series.roll()];
        let righting_s = righting_s(constants);
        let waited_deg = left_deg(data.records.rest.as_ref(), righting_s, &tilt_over);
        let tilt_zero = || TiltZero::of(tilts, &phases.before, &tilt_over, [filter_s, righting_s], waited_deg);
        let tilt_zero = if has_still { tilt_zero() } else { None };
        let mut rest = AtRest::new(data, &series, &phases, has_still, drift.as_ref());
        rest.lost = started.filter(|_| data.times.has_run());
        let levelled_away = level_of(data).map_or([0.0; 2], |level| level.angles_deg());
        let turned_deg = series.turned_deg();
        let mut sensitivities = Sensitivities::new(filter_s, sensor.mounting());
        let zero_c = errors::zero_c(series.temperature(), from_s);
        for (time, reading) in &readings {
            let attitude = rotation(reading.attitude) * askew.inverse();
            sensitivities.push(*time, attitude, reading.temperature_c - zero_c);
        }
        let errors = Errors::new(data, sensitivities, series.temperature(), from_s, filter_s, drift, tilt_zero);
        let mut angles_deg = series.angles_deg;
        errors.correct(&mut angles_deg, yaw_zero);
        if let Some(budget) = errors.yaw(angles_deg.span().end) {
            let yaw_s = constants.map_or(f64::INFINITY, |constants| constants.yaw_s);
            let yaw = ("yaw", angles_deg.track(0), budget.uncertainty_deg(), yaw_s);
            rest.not_back = back_at_zero::not_back(data, [yaw]);
        }
        Self {
            angles_deg,
            zero_deg: [yaw_zero, zero.pitch_deg + levelled_away[0], zero.roll_deg + levelled_away[1]],
            run,
            from_s,
            turned_deg,
            rest,
            known: Known::Sensor(Box::new(errors)),
            ..Self::default()
        }
    }

    /// The zero is the mean attitude of the last second before the run. Without it, the yaw is zero at the start of the
    /// run, and pitch and roll are the table's.
    fn imported(data: &Data) -> Self {
        let run = data.times.run.clone();
        let still = data.times.preroll.start.max(run.start - START_S)..run.start;
        let has_still = still.end - still.start > 0.5 * START_S;
        let zero = mean(&data.readings, &still).filter(|_| has_still && data.times.has_run());
        let Euler { yaw_deg, pitch_deg, roll_deg } = Euler::of(&zero.unwrap_or_default());
        let askew = of_euler_zyx([0.0, pitch_deg.to_radians(), roll_deg.to_radians()]);
        let mut series = Series::default();
        for (time, reading) in &data.readings {
            let q = (rotation(reading.attitude) * askew.inverse()).into_inner();
            series.push(*time, &Reading { attitude: [q.w, q.i, q.j, q.k], ..*reading });
        }
        let from_s = if zero.is_some() { 0.5 * (still.start + still.end) } else { run.start };
        let yaw_zero = if zero.is_some() { series.yaw().mean(still) } else { series.yaw().at(run.start) };
        let yaw_zero = yaw_zero.unwrap_or(yaw_deg);
        let turned_deg = series.turned_deg();
        let mut angles_deg = series.angles_deg;
        let motion = import_rest::moved(angles_deg.tracks(), &data.times.preroll);
        angles_deg.values[0].iter_mut().for_each(|yaw| *yaw -= yaw_zero);
        // Without a rest before the run, nobody knows the zero as well as the instrument its angles.
        let stated = Stated::of(data.records.import.as_ref()).filter(|_| zero.is_some());
        let not_back = |_| {
            let constants = time_constants(data);
            let angles = [0, 1, 2].map(|k| {
                let stated_deg =
                    stated.and_then(|stated| stated.budget(k)).map_or(0.0, |budget| budget.uncertainty_deg());
                let constant_s = constants.map_or(f64::INFINITY, |of| if k == 0 { of.yaw_s } else { of.tilt_s });
                (["yaw", "pitch", "roll"][k], angles_deg.track(k), stated_deg, constant_s)
            });
            back_at_zero::not_back(data, angles)
        };
        let rest = AtRest {
            is_missing: zero.is_none() && data.times.has_run(),
            not_back: zero.and_then(not_back),
            motion,
            ..AtRest::default()
        };
        Self {
            angles_deg,
            zero_deg: [yaw_zero, pitch_deg, roll_deg],
            run,
            from_s,
            turned_deg,
            rest,
            known: Known::Stated(stated),
            ..Self::default()
        }
    }

    fn is_model(&self) -> bool {
        matches!(self.known, Known::Exact)
    }

    fn is_recorded(&self) -> bool {
        matches!(self.known, Known::Sensor(_))
    }

    /// Returns the time range of the angles.
    pub fn span(&self) -> Range<f64> {
        self.angles_deg.span()
    }

    /// Returns yaw, pitch and roll at a time, degrees.
    pub fn at(&self, time_s: f64) -> [f64; 3] {
        self.angles_deg.at(time_s)
    }

    /// Returns the part of the run with angles.
    pub fn seen_run(&self) -> Range<f64> {
        let span = self.span();
        self.run.start.max(span.start)..self.run.end.min(span.end)
    }

    /// Returns the steady angles; `None` if there is no attitude in the run.
    pub fn angles(&self) -> Option<Angles> {
        let steady = self.steady.as_ref()?;
        let [yaw_deg, pitch_deg, roll_deg] = steady.angles_deg;
        let after = self.drift().into_iter().flat_map(|drift| &drift.still).find(|still| still.start >= self.run.end);
        let known = |k: usize| match self.is_model() {
            true => steady.of_model.map(|known| known[k]),
            false => steady.budgets[k].as_ref().map(Budget::uncertainty_deg),
        };
        Some(Angles {
            yaw_deg,
            yaw_uncertainty_deg: known(0),
            pitch_deg,
            pitch_uncertainty_deg: known(1),
            roll_deg,
            roll_uncertainty_deg: known(2),
            tilt_deg: tilt_deg(pitch_deg, roll_deg),
            tilt_uncertainty_deg: known(3),
            drift_deg: steady.drift_deg,
            still_after_s: self.is_recorded().then(|| after.map_or(0.0, |still| still.end - still.start)),
            steady_s: steady.window.end - steady.window.start,
            settled: steady.settled,
            turned_deg: self.turned_deg,
            measured: steady.measured(&self.angles_deg).clone(),
            budget: steady.budget(),
        })
    }

    /// Returns the steady end of the run. For a model, the solver has computed it from every step; a robot that overturned has
    /// none.
    fn steady(&self, data: &Data) -> Option<Steady> {
        let run = self.seen_run();
        if run.end <= run.start || data.upright().is_err() {
            return None;
        }
        let speeds = data.speeds().map(|speed| speed.rpm() * PI / 30.0);
        let reversed_s = data.reverse().map_or(run.start, |(_, after_s)| self.run.start + after_s + REVERSAL_S);
        let mut collector = SteadyCollector::after_reversal(run.start, reversed_s, run.end, speeds);
        let times = &self.angles_deg.time_s;
        let inside = times.partition_point(|t| *t <= run.start)..times.partition_point(|t| *t < run.end);
        let ends = [run.start, run.end].map(|time| (time, self.at(time)));
        let rows = inside.map(|i| (times[i], self.angles_deg.row(i)));
        for (time, angles) in std::iter::once(ends[0]).chain(rows).chain(std::iter::once(ends[1])) {
            let mut values = [0.0; CHANNELS];
            values[..3].copy_from_slice(&angles.map(f64::to_radians));
            collector.push(time, values, false);
        }
        let steady = collector.window();
        let window = run.end - steady.window_s..run.end;
        let middle = 0.5 * (window.start + window.end);
        let own = data.records.steady.as_ref().filter(|_| self.is_model());
        let (angles_deg, settled, settle_s, window) = match own {
            Some(SteadyMeta { values, settled, kind, .. }) => {
                // With the method `steady`, the log contains the last part of the averaging window.
                let window = (self.run.end - values.get(&WINDOW)).max(self.run.start)..self.run.end;
                let settle_s = (*settled && kind.is_none()).then_some(values.get(&SETTLE));
                (values.angles_deg(), *settled, settle_s, window)
            }
            None => {
                let angles = steady.attitude.map(|level| level.mean.to_degrees());
                (angles, steady.settled, steady.settled.then_some(steady.settle_s), window)
            }
        };
        let [pitch, roll, tilt] = self.steady_tilts(&window).map_or([None, None, None], |tilts| tilts.map(Some));
        let mut budgets = [self.yaw_budget(middle), pitch, roll, tilt];
        // The mean of a run that has not settled is said to be no steady value.
        if settled && !self.is_model() {
            let [yaw, pitch, roll] = collector.to_come().map(f64::to_degrees);
            let to_come = [yaw, pitch, roll, hypot(pitch, roll)];
            budgets.iter_mut().zip(to_come).for_each(|(budget, u_deg)| {
                *budget = budget.take().map(|budget| budget.with(Term::of_trial(TO_COME, u_deg, f64::INFINITY)));
            });
        }
        Some(Steady {
            angles_deg,
            budgets,
            of_model: own.and_then(|own| uncertainties_of_model(&own.values)),
            drift_deg: self.is_recorded().then(|| self.yaw_drift(middle)),
            window,
            settled,
            settle_s,
            swing_s: swing_s(data, &self.run),
            measured: match self.is_model() {
                true => OnceLock::from(SwingSpeeds::unknown("a model has the speeds of its trial")),
                false => OnceLock::new(),
            },
        })
    }

    /// Returns the causes of uncertainty of the yaw at a time; empty for a model, `None` without a still phase or a
    /// known bias, or if a finding invalidates it.
    pub fn yaw_budget(&self, time_s: f64) -> Option<Budget> {
        match &self.known {
            _ if self.is_unsure => None,
            Known::Exact => Some(Budget::default()),
            Known::Sensor(errors) => errors.yaw(time_s),
            Known::Stated(stated) => stated.and_then(|stated| stated.budget(0)),
        }
    }

    /// Returns the causes of uncertainty of mean pitch, roll and tilt over a time, like [`Self::yaw_budget`].
    fn tilt_budgets(&self, over: &Range<f64>) -> [Option<Budget>; 3] {
        match &self.known {
            // For instance, no uncertainty can be stated for a zero without a rest.
            _ if self.is_unsure => [None, None, None],
            Known::Exact => std::array::from_fn(|_| Some(Budget::default())),
            Known::Sensor(errors) => errors.tilts(&self.angles_deg, over).map_or([None, None, None], |of| of.map(Some)),
            Known::Stated(stated) => {
                let [pitch, roll] = [1, 2].map(|angle| stated.and_then(|stated| stated.budget(angle)));
                let tilt = pitch.clone().filter(|_| roll.is_some());
                [pitch, roll, tilt]
            }
        }
    }

    /// Returns the causes of uncertainty of steady pitch, roll and tilt over a time, if all three are known. The clock is none
    /// of them.
    fn steady_tilts(&self, over: &Range<f64>) -> Option<[Budget; 3]> {
        let [Some(pitch), Some(roll), Some(tilt)] = self.tilt_budgets(over) else { return None };
        Some([pitch, roll, tilt].map(|budget| budget.without("clock")))
    }

    /// Returns the 95 % uncertainty of the yaw at a time, degrees, interpolated between seconds for curves; 0 for a
    /// model, `None` if [`Self::yaw_budget`] is `None`.
    pub fn yaw_uncertainty(&self, time_s: f64) -> Option<f64> {
        self.yaw_uncertainty_deg.track(0).at(time_s)
    }

    /// Returns the 95 % uncertainty of mean pitch and roll over a time, degrees, like [`Self::yaw_uncertainty`].
    pub fn tilt_uncertainty(&self, over: &Range<f64>) -> Option<[f64; 2]> {
        let [pitch, roll, _] = self.steady_tilts(over)?;
        Some([pitch.uncertainty_deg(), roll.uncertainty_deg()])
    }

    /// Returns the causes of uncertainty of mean yaw, pitch and roll over a time; none for a model, `None` as for
    /// [`Self::yaw_budget`].
    pub(crate) fn budgets(&self, over: &Range<f64>) -> [Option<Budget>; 3] {
        let [pitch, roll, _] = self.tilt_budgets(over);
        [self.yaw_budget(0.5 * (over.start + over.end)), pitch, roll]
    }

    /// Returns the uncertainty of mean yaw, pitch and roll over blocks of length `block_s` around times; exact for a model, `None` as
    /// for [`Self::yaw_budget`].
    pub(crate) fn over_time(&self, times: &[f64], block_s: f64) -> [Option<OverTime>; 3] {
        let unknown = [const { None }; 3];
        match &self.known {
            _ if self.is_unsure => unknown,
            Known::Exact => std::array::from_fn(|_| Some(OverTime::exact(times.len()))),
            Known::Sensor(errors) => errors.over_time(&self.angles_deg, times, block_s),
            Known::Stated(stated) => stated.map_or(unknown, |stated| stated.over_time(times.len())),
        }
    }

    /// Returns the drift removed from the yaw at a time, degrees.
    pub fn yaw_drift(&self, time_s: f64) -> f64 {
        self.drift().map_or(0.0, |drift| drift.at(time_s))
    }

    /// Returns the drift of the yaw; `None` without a still phase, or for a model.
    pub fn drift(&self) -> Option<&Drift> {
        match &self.known {
            Known::Sensor(errors) => errors.drift.as_ref(),
            _ => None,
        }
    }
}

/// Returns the 95 % uncertainties of yaw, pitch, roll and tilt that a model states, if it states all.
fn uncertainties_of_model(values: &Values) -> Option<[f64; 4]> {
    let ([_, pitch, roll], [of_yaw, of_pitch, of_roll]) = (values.angles_deg(), values.angle_uncertainties_deg());
    let [by_pitch, by_roll] = errors::tilt_gradient([pitch, roll]);
    Some([of_yaw?, of_pitch?, of_roll?, hypot(by_pitch * of_pitch?, by_roll * of_roll?)])
}

/// Returns the readings since the calibration, levelled, with the delay of the sensor's filter removed from their
/// times.
fn levelled(data: &Data) -> Vec<(f64, Reading)> {
    let settings = data.settings();
    let delay_s = settings.map_or(0.0, |settings| LOW_PASS[usize::from(settings.low_pass).min(LOW_PASS.len() - 1)].1);
    let mut readings = data.readings[data.calibrated..].to_vec();
    // The known mounting turns with the body; the filter does not follow it.
    let mounting = data.sensor().mounting();
    let level = level_of(data).map(|level| level.turned(mounting));
    let begun = data.phases.iter().find(|(name, _)| name == "run").map(|(_, start)| *start);
    let run_s = begun.or(data.times.has_run().then_some(data.times.run.start)).unwrap_or(f64::INFINITY);
    let mut leveller = level.map(|level| Leveller::new(&level, settings.unwrap_or_default().attitude_kp.into()));
    for (time, reading) in &mut readings {
        let attitude = rotation(reading.attitude) * mounting.inverse();
        // At rest the filter has settled on the bias.
        let is_moving = *time > run_s - 1e-6;
        let q = match (&mut leveller, &level) {
            (Some(leveller), _) if is_moving => leveller.levelled(attitude, *time),
            (_, Some(level)) => level.levelled(attitude),
            _ => attitude,
        };
        reading.attitude = [q.w, q.i, q.j, q.k];
    }
    // The sensor's filter delays the attitude; the encoders have no delay.
    readings.iter_mut().for_each(|(time, _)| *time -= delay_s);
    readings
}

/// Returns the level removed from the attitude, if there is one.
fn level_of(data: &Data) -> Option<Level> {
    let level = data.records.level.as_ref().filter(|level| level.used)?;
    Some(Level { up: Vector3::from(level.up), force_g: level.force_g })
}

/// Returns the interval between the readings around a time, or from the last reading to that time.
fn gap_at(readings: &[(f64, Reading)], time_s: f64) -> Option<Range<f64>> {
    let after = readings.partition_point(|(time, _)| *time <= time_s);
    let last = readings[..after].last()?.0;
    Some(last..readings.get(after).map_or(time_s, |(time, _)| *time))
}

/// Returns the mean attitude over a range of time. The attitudes must be within a few degrees of each other.
pub(super) fn mean(readings: &[(f64, Reading)], range: &Range<f64>) -> Option<UnitQuaternion<f64>> {
    let mut inside = readings.iter().filter(|(time, _)| range.contains(time)).map(|(_, r)| rotation(r.attitude));
    let first = inside.next()?;
    let sum =
        inside.fold(
            *first.quaternion(),
            |sum, q| {
                if q.dot(&first) < 0.0 { sum - q.into_inner() } else { sum + q.into_inner() }
            },
        );
    Some(UnitQuaternion::from_quaternion(sum))
}
