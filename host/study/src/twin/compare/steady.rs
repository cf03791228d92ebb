//! The steady angles of both trials, and the uncertainty of their difference.

use super::aligned::Aligned;
use super::comparison::Uncertainty;
use super::pair::{Pair, Side};
use crate::statistics::student_95;
use crate::trial::{Budget, CommonTo, TO_COME, Term};
use std::ops::Range;

/// Steady yaw, pitch and roll of both trials, averaged over the same time.
pub(super) struct SteadyPair {
    /// The averaging window, from the start of the run, s.
    pub window: Range<f64>,
    pub measured_deg: [f64; 3],
    pub modelled_deg: [f64; 3],
}

impl SteadyPair {
    /// Returns the steady angles of each trial, as every command reports them. For runs of different lengths, the window is at
    /// the end of the shorter one. A model beside a measurement has the measurement's window, because its own means over both
    /// motor angles would differ by part of a beat; a steady state has only its own means. The order of the trials does not
    /// matter.
    pub fn new(pair: &Pair, aligned: &Aligned) -> Self {
        let Pair { measured, modelled } = pair;
        let is_same_kind = measured.data.is_model() == modelled.data.is_model();
        let has_window = |side: &Side| is_same_kind || !side.data.is_model();
        let (with, shift_s) = if has_window(measured) { (measured, 0.0) } else { (modelled, aligned.shift_s) };
        let Range { start, end } = with.steady.window;
        let common_s = aligned.common_s;
        let is_same_run = aligned.lengths_s.is_none();
        let is_own = |side: &Side| is_same_run && (has_window(side) || side.data.is_steady_state());
        let window = if is_same_run {
            let run_s = with.start_s - shift_s;
            start - run_s..end - run_s
        } else {
            common_s - (end - start).min(common_s)..common_s
        };
        let of = |side: &Side, is_own: bool, shift_s: f64| {
            if is_own {
                return side.steady.angles_deg;
            }
            let over = side.on_clock(&(window.start - shift_s..window.end - shift_s));
            side.zeroed.angles_deg.tracks().map(|track| track.mean(over.clone()).unwrap_or_default())
        };
        let measured_deg = of(measured, is_own(measured), 0.0);
        let modelled_deg = of(modelled, is_own(modelled), aligned.shift_s);
        Self { measured_deg, modelled_deg, window }
    }

    /// Returns the modelled minus the measured angles.
    pub fn error_deg(&self) -> [f64; 3] {
        [0, 1, 2].map(|k| self.modelled_deg[k] - self.measured_deg[k])
    }

    /// Returns the whole turns by which the yaws differ due to a gap in a log; 0 without long gaps.
    pub fn missing_turns(&self, pair: &Pair) -> f64 {
        let has_long_gap = pair.measured.data.has_long_gap() || pair.modelled.data.has_long_gap();
        if has_long_gap { (self.error_deg()[0] / 360.0).round() } else { 0.0 }
    }

    /// Returns the causes of uncertainty of the errors of yaw, pitch and roll, and the standard uncertainty from the second
    /// trial's own errors; `None` for an angle whose causes are unknown.
    pub fn budgets(&self, pair: &Pair) -> [Option<(Budget, f64)>; 3] {
        let is_same = pair.is_of_one_sensor();
        // Without encoders the motors of both trials start at other angles, so their slow approaches do not cancel.
        let of = |side: &Side| match side.steady.of_model.unwrap_or_default() {
            deg if pair.is_blind() => [0, 1, 2].map(|k| {
                let u_deg = 0.5 * deg[k] + side.steady.to_come_deg[k];
                Some(side.steady.budgets[k].clone()?.with(Term::of_trial(TO_COME, u_deg, f64::INFINITY)))
            }),
            _ => side.zeroed.budgets(&side.on_clock(&self.window)),
        };
        let (measured, modelled) = (of(&pair.measured), of(&pair.modelled));
        [0, 1, 2].map(|k| {
            let (one, other) = (measured[k].as_ref()?, modelled[k].as_ref()?);
            Some((other.minus(one, is_same), other.common_to(CommonTo::Trial).u_deg()))
        })
    }
}

impl Uncertainty {
    /// Returns the parts of a budget.
    pub(super) fn of(budget: &Budget) -> Self {
        Self {
            noise_deg: budget.common_to(CommonTo::Trial).uncertainty_deg(),
            sensor_deg: student_95(f64::INFINITY) * budget.common_to(CommonTo::Sensor).u_deg(),
            total_deg: budget.uncertainty_deg(),
            u_deg: budget.u_deg(),
            degrees_of_freedom: budget.degrees_of_freedom(),
        }
    }
}
