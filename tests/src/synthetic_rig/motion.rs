//! The true motion of a trial.

use super::TICK_S;
use biflag_log::schema::biflag::event::Kind;
use biflag_log::schema::biflag::{Motor, Telemetry, Truth};
use biflag_log::{End, Identity, ModelMeta, Origin, Summary, TrialMeta};
use host::plan::Phases;
use host::trial::{Collector, Data, Records, Want};
use sim::body::closure::Closure;
use sim::params::Robot;
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Trial};

/// Frames of the board for each sample of a model's log.
const TICKS_A_SAMPLE: usize = 10;

/// Time after the end of a run at which the robot is at rest, s.
const RETURN_S: f64 = 120.0;

/// Yaw, pitch and roll of a robot at the board's rate, from the start of its run, radians.
#[derive(Debug)]
pub struct Motion {
    angles: Vec<[f64; 3]>,
    rpm: [f64; 2],
    run_s: f64,
    parameters: String,
}

impl Motion {
    /// Computes the motion of a robot.
    pub fn of(robot: &Robot, rpm: [f64; 2], run_s: f64) -> Self {
        let still = [0.0; 2];
        let points = [(0.0, still), (0.5, rpm), (run_s, rpm), (run_s + 0.5, still), (run_s + RETURN_S, still)];
        let profile = SpeedProfile::from_points(&points).expect("a profile");
        let options = Options { rate_hz: 1.0 / TICK_S, shapes: false };
        let trial = Trial::new(robot, Closure::Full, profile, options).expect("a robot");
        let angles = trial.map(|sample| sample.expect("a step")).map(|s| [s.yaw_rad, s.pitch_rad, s.roll_rad]);
        let parameters = toml::to_string(robot).expect("parameters");
        Self { angles: angles.collect(), rpm, run_s, parameters }
    }

    /// Returns yaw, pitch and roll at a time since the start of the run.
    pub(super) fn at(&self, time_s: f64) -> [f64; 3] {
        if time_s > 0.0 { self.angles[self.index(time_s)] } else { [0.0; 3] }
    }

    /// Returns the rest of these angles at a time after the end of the run.
    pub(super) fn left(&self, since_s: f64) -> [f64; 3] {
        let index = self.index(self.run_s + since_s);
        if index + 1 < self.angles.len() { self.angles[index] } else { [0.0; 3] }
    }

    fn index(&self, time_s: f64) -> usize {
        ((time_s / TICK_S).round().max(0.0) as usize).min(self.angles.len() - 1)
    }

    /// Returns the record of the trial.
    pub(super) fn trial(&self, phases: &Phases) -> TrialMeta {
        let Phases { calibrate_s, preroll_s, run_s, decay_s, .. } = *phases;
        let [w1_rpm, w2_rpm] = self.rpm;
        TrialMeta { w1_rpm, w2_rpm, calibrate_s, preroll_s, run_s, decay_s, ..TrialMeta::default() }
    }

    /// Returns the state of a motor that reaches its speed at once. `time_s`: since the start of the run.
    pub(super) fn motor(&self, motor: usize, time_s: f64) -> Motor {
        let rpm = self.rpm[motor];
        let turns = rpm / 60.0 * time_s.clamp(0.0, self.run_s);
        let speed_rpm = if (0.0..self.run_s).contains(&time_s) { rpm } else { 0.0 };
        Motor { target_rpm: speed_rpm, speed_rpm, turns, ..Motor::default() }
    }

    /// Returns the trial as read from the model's log.
    pub fn model(&self, phases: &Phases) -> Data {
        let mut collector = Collector::new(Want::default(), 2);
        let Phases { preroll_s, run_s, decay_s, .. } = *phases;
        for (name, time_s) in [("preroll", 0.0), ("run", preroll_s), ("decay", preroll_s + run_s)] {
            collector.event(time_s, Kind::Phase, name);
        }
        for tick in (0..=((preroll_s + run_s + decay_s) / TICK_S) as usize).step_by(TICKS_A_SAMPLE) {
            let clock_s = tick as f64 * TICK_S;
            let time_s = clock_s - preroll_s;
            let [yaw_deg, pitch_deg, roll_deg] = self.at(time_s).map(f64::to_degrees);
            collector.truth(&Truth { time_s: clock_s, yaw_deg, pitch_deg, roll_deg, ..Truth::default() });
            let [motor1, motor2] = [0, 1].map(|motor| Some(self.motor(motor, time_s)));
            collector.telemetry(&Telemetry { time_s: clock_s, motor1, motor2, ..Telemetry::default() });
        }
        collector.event(preroll_s + run_s + decay_s, Kind::Phase, "end");
        let records = Records {
            identity: Some(Identity { format: 2, origin: Origin::Model, ..Identity::default() }),
            trial: Some(TrialMeta { calibrate_s: 0.0, ..self.trial(phases) }),
            model: Some(ModelMeta { rate_hz: 20.0, parameters: self.parameters.clone(), ..ModelMeta::default() }),
            summary: Some(Summary { end: End::Complete, ..Summary::default() }),
            ..Records::default()
        };
        collector.finish("model".as_ref(), records)
    }
}
