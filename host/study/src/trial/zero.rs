//! The attitude of a trial relative to its zero (levelled, relative to the still phase before the run, with the drift
//! of the yaw removed), its steady end, and its uncertainty.

use super::angles::{Angles, Steady, swing_s};
use super::budget::{Budget, TO_COME, Term};
use super::data::Data;
use super::errors::{self, Errors};
use super::imported::Stated;
use super::over_time::OverTime;
use super::rest::AtRest;
use crate::attitude::{Columns, Drift, tilt_deg};
use crate::swing::SwingSpeeds;
use biflag_log::SteadyMeta;
use sim::functions::hypot;
use sim::trial::means::{CHANNELS, SteadyCollector};
use sim::trial::quantity::{SETTLE, Values, WINDOW};
use std::f64::consts::PI;
use std::ops::Range;
use std::sync::OnceLock;

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
    pub(super) known: Known,
    /// Whether a finding invalidates all uncertainties.
    pub(super) is_unsure: bool,
    /// Uncertainty of the yaw at every second; empty if it is unknown.
    pub(super) yaw_uncertainty_deg: Columns<1>,
}

/// The known errors of the angles.
#[derive(Clone, Debug, Default)]
pub(super) enum Known {
    /// A model has none.
    #[default]
    Exact,
    /// Errors of the board's sensor.
    Sensor(Box<Errors>),
    /// Errors that an import states; `None` if it states none.
    Stated(Option<Stated>),
}

impl Zeroed {
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
    pub(super) fn steady(&self, data: &Data) -> Option<Steady> {
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
        let mut to_come_deg = if self.is_model() { [0.0; 3] } else { collector.to_come().map(f64::to_degrees) };
        // An unsettled run has its own warning instead: its mean is not a steady value.
        if settled && !self.is_model() {
            let [yaw, pitch, roll] = std::mem::take(&mut to_come_deg);
            let to_come = [yaw, pitch, roll, hypot(pitch, roll)];
            budgets.iter_mut().zip(to_come).for_each(|(budget, u_deg)| {
                *budget = budget.take().map(|budget| budget.with(Term::of_trial(TO_COME, u_deg, f64::INFINITY)));
            });
        }
        Some(Steady {
            angles_deg,
            budgets,
            of_model: own.and_then(|own| uncertainties_of_model(&own.values)),
            to_come_deg,
            drift_deg: self.is_recorded().then(|| self.yaw_drift(middle)),
            window,
            settled,
            settle_s,
            swing_s: swing_s(data, &self.run),
            clock_95: if let Known::Sensor(errors) = &self.known { 1.96 * errors.clock.error.u } else { 0.0 },
            measured: match self.is_model() {
                true => OnceLock::from(SwingSpeeds::unknown("a model has the speeds of its trial")),
                false => OnceLock::new(),
            },
            modelled: OnceLock::new(),
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

    /// Returns the causes of uncertainty of steady pitch, roll and tilt over a time, without the clock, if all three are known.
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
        if let Known::Sensor(errors) = &self.known { errors.drift.as_ref() } else { None }
    }
}

/// Returns the 95 % uncertainties of yaw, pitch, roll and tilt that a model states, if it states all.
fn uncertainties_of_model(values: &Values) -> Option<[f64; 4]> {
    let ([_, pitch, roll], [of_yaw, of_pitch, of_roll]) = (values.angles_deg(), values.angle_uncertainties_deg());
    let [by_pitch, by_roll] = errors::tilt_gradient([pitch, roll]);
    Some([of_yaw?, of_pitch?, of_roll?, hypot(by_pitch * of_pitch?, by_roll * of_roll?)])
}
