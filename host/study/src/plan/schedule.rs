//! The schedule of a trial, the same on the rig and in the model.

use super::line::{Lines, OffTheLine};
use super::{Phases, Reverse, Trial};
use protocol::units::CentiRpm;
use protocol::{SetPoint, State, TICK_HZ};

/// Length of the board's tick, µs.
pub const TICK_US: u64 = 1_000_000 / TICK_HZ as u64;

/// Name in a log of the wait for a still robot before a trial's first phase.
pub const WAIT: &str = "wait";

/// A phase of a trial.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Phase {
    /// Calibration of the gyroscope at rest.
    Calibrate,
    /// At rest before the run.
    Preroll,
    /// The motors turn.
    Run,
    /// The motors are off.
    Decay,
    /// End of the trial.
    End,
}

impl Phase {
    /// All phases in their order.
    pub const ALL: [Self; 5] = [Self::Calibrate, Self::Preroll, Self::Run, Self::Decay, Self::End];

    /// Returns its name in a log.
    pub fn name(self) -> &'static str {
        match self {
            Self::Calibrate => "calibrate",
            Self::Preroll => "preroll",
            Self::Run => "run",
            Self::Decay => "decay",
            Self::End => "end",
        }
    }

    /// Returns its number in the board's schedule and telemetry. The calibration, before the schedule, has 0.
    pub fn number(self) -> u8 {
        self as u8
    }

    /// Returns the phase of a name in a log.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|phase| phase.name() == name)
    }
}

/// The board's target speeds, and its state while they are in force.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Setpoint {
    /// The state.
    pub state: State,
    /// Speeds of both motors.
    pub target: [CentiRpm; 2],
}

/// A change in the schedule.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Change {
    /// A phase.
    Phase(Phase),
    /// A motor turns the other way.
    Reversal(Reverse),
}

/// An event of the schedule. It gives the board a new set-point.
#[derive(Clone, PartialEq, Debug)]
pub struct ScheduledEvent {
    /// Time of the event on the trial's clock, s.
    pub start_s: f64,
    /// The change.
    pub change: Change,
    /// The set-point from then on.
    pub setpoint: Setpoint,
}

impl ScheduledEvent {
    /// Returns the start of a phase; `speeds` are the speeds of the run.
    fn phase(phase: Phase, start_s: f64, speeds: [CentiRpm; 2]) -> Self {
        let still = [CentiRpm(0); 2];
        let (state, target) = match phase {
            Phase::Calibrate => (State::Calibrating, still),
            Phase::Run => (State::Running, speeds),
            Phase::Preroll | Phase::Decay | Phase::End => (State::Idle, still),
        };
        Self { start_s, change: Change::Phase(phase), setpoint: Setpoint { state, target } }
    }

    fn reversal(reverse: Reverse, run_start_s: f64, speeds: [CentiRpm; 2]) -> Self {
        let setpoint = Setpoint { state: State::Running, target: reverse.of(speeds) };
        Self { start_s: run_start_s + reverse.after_s, change: Change::Reversal(reverse), setpoint }
    }
}

/// The events of a trial in the order of time; the last one is its end.
#[derive(Clone, PartialEq, Debug)]
pub struct Schedule {
    /// The events.
    pub events: Vec<ScheduledEvent>,
}

impl Schedule {
    /// Returns the planned schedule of a trial. Phases without a duration are left out.
    pub fn planned(trial: &Trial) -> Self {
        let Phases { calibrate_s, preroll_s, run_s, decay_s, .. } = trial.phases;
        let mut start_s = 0.0;
        let mut phases = Vec::new();
        let lengths = [calibrate_s, preroll_s, run_s, decay_s];
        for (phase, length_s) in Phase::ALL.into_iter().zip(lengths) {
            if length_s > 0.0 {
                phases.push((phase, start_s));
            }
            start_s += length_s;
        }
        phases.push((Phase::End, start_s));
        Self::of_phases(phases, trial)
    }

    /// Returns the schedule of a trial whose phases began at these times.
    pub fn of_phases(phases: impl IntoIterator<Item = (Phase, f64)>, trial: &Trial) -> Self {
        let mut events = Vec::new();
        for (phase, start_s) in phases {
            events.push(ScheduledEvent::phase(phase, start_s, trial.speeds));
            if let Some(reverse) = trial.reverse.filter(|_| phase == Phase::Run) {
                events.push(ScheduledEvent::reversal(reverse, start_s, trial.speeds));
            }
        }
        events.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
        Self { events }
    }

    /// Returns the events that the board runs by itself: all after the calibration, each with its tick from the end of
    /// the calibration.
    pub fn ticks(&self) -> impl Iterator<Item = (u32, &ScheduledEvent)> {
        let timed = || self.events.iter().filter(|event| event.change != Change::Phase(Phase::Calibrate));
        let first_s = timed().next().map_or(0.0, |event| event.start_s);
        timed().map(move |event| (((event.start_s - first_s) * f64::from(TICK_HZ)).round() as u32, event))
    }

    /// Returns the set-points to send to the board, with duties if the motors have `lines`. Of two events in one tick, only the
    /// later is sent.
    ///
    /// # Errors
    /// [`OffTheLine`] if a motor does not reach a speed.
    pub fn set_points(&self, lines: Option<&Lines>) -> Result<Vec<SetPoint>, OffTheLine> {
        let mut points: Vec<SetPoint> = Vec::new();
        let mut number = 0;
        for (tick, event) in self.ticks() {
            if let Change::Phase(phase) = event.change {
                number = phase.number();
            }
            points.pop_if(|before| before.tick == tick);
            let speeds = event.setpoint.target;
            let duties = lines.map_or(Ok([0; 2]), |lines| lines.duties(speeds))?;
            points.push(SetPoint { tick, speeds, duties, phase: number });
        }
        Ok(points)
    }

    /// Returns the end of the trial, s.
    pub fn end_s(&self) -> f64 {
        self.events.last().map_or(0.0, |event| event.start_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::Plan;

    #[test]
    fn a_schedule_has_the_phases_with_a_length_and_the_reversal() {
        let plan = "[trial]\ncalibrate = 0\npreroll = 2\nrun = 10\ndecay = 3\nreverse = { motor = 2, after = 4 }\n\
                    [speeds]\npairs = [[50, 10]]";
        let plan = Plan::parse(plan, "p.toml").unwrap();
        let schedule = Schedule::planned(&plan.trials[0]);
        let events: Vec<_> =
            schedule.events.iter().map(|event| (event.start_s, event.setpoint.target.map(CentiRpm::rpm))).collect();
        let still = [0.0, 0.0];
        assert_eq!(events, [(0.0, still), (2.0, [50.0, 10.0]), (6.0, [50.0, -10.0]), (12.0, still), (15.0, still)]);
        assert_eq!(schedule.end_s(), 15.0);
        assert!(Phase::ALL.into_iter().all(|phase| Phase::of_name(phase.name()) == Some(phase)));
    }

    fn set_points(trial: &str) -> Vec<(u32, [f64; 2], u8)> {
        let plan = Plan::parse(&format!("[trial]\n{trial}\n[speeds]\npairs = [[50, 10]]"), "p.toml").unwrap();
        let points = Schedule::planned(&plan.trials[0]).set_points(None).unwrap();
        points.into_iter().map(|point| (point.tick, point.speeds.map(CentiRpm::rpm), point.phase)).collect()
    }

    #[test]
    fn set_points_are_in_ticks_from_the_end_of_the_calibration() {
        let reverse = "reverse = { motor = 1, after = 4 }";
        let points = set_points(&format!("calibrate = 5\npreroll = 2\nrun = 10\ndecay = 3\n{reverse}"));
        let (still, forward, backward) = ([0.0, 0.0], [50.0, 10.0], [-50.0, 10.0]);
        let expected = [(0, still, 1), (400, forward, 2), (1200, backward, 2), (2400, still, 3), (3000, still, 4)];
        assert_eq!(points, expected);
        let points = set_points("calibrate = 0\npreroll = 0\nrun = 0.01\ndecay = 0");
        assert_eq!(points, [(0, forward, 2), (2, still, 4)]);
        let points = set_points("calibrate = 0\npreroll = 0.001\nrun = 86400\ndecay = 0.001");
        assert_eq!(points, [(0, forward, 2), (17_280_000, still, 4)], "a phase within a tick is left out");
    }
}
