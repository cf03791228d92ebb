//! The true motion of a trial.

use super::TICK_S;
use biflag_log::schema::biflag::event::Kind;
use biflag_log::schema::biflag::{Motor, Telemetry, Truth};
use biflag_log::{End, Identity, ModelMeta, Origin, Summary, TrialMeta};
use host::plan::Phases;
use host::trial::{Collector, Data, Records, Want};
use sim::body::closure::Closure;
use sim::params::Robot;
use sim::profile::SpeedProfile;
use sim::trial::{Options, Trial};

/// Frames of the board for each sample of a model's log.
const TICKS_A_SAMPLE: usize = 10;

/// Yaw, pitch and roll of a robot at the board's rate, from the start of its run, radians.
#[derive(Debug)]
pub struct Motion {
    angles: Vec<[f64; 3]>,
    /// Speeds of the run.
    pub rpm: [f64; 2],
    /// The phases of the trial.
    pub phases: Phases,
    parameters: String,
}

impl Motion {
    /// Computes the motion of a robot.
    pub fn of(robot: &Robot, rpm: [f64; 2], phases: Phases) -> Self {
        let (still, run_s) = ([0.0; 2], phases.run_s);
        let points = [(0.0, still), (0.5, rpm), (run_s, rpm), (run_s + 0.5, still), (run_s + phases.decay_s, still)];
        let profile = SpeedProfile::from_points(&points).expect("a profile");
        let options = Options { rate_hz: 1.0 / TICK_S, shapes: false };
        let trial = Trial::new(robot, Closure::Full, profile, options).expect("a robot");
        let angles = trial.map(|sample| sample.expect("a step")).map(|s| [s.yaw_rad, s.pitch_rad, s.roll_rad]);
        let parameters = toml::to_string(robot).expect("parameters");
        Self { angles: angles.collect(), rpm, phases, parameters }
    }

    /// Returns the angles at a time since the start of the run. `late_s`: time since the end of an earlier run like this one
    /// at which the calibration began; infinite if the robot was at rest.
    pub fn at(&self, time_s: f64, late_s: f64) -> [f64; 3] {
        let index = |t: f64| ((t / TICK_S).round().max(0.0) as usize).min(self.angles.len() - 1);
        let own = if time_s > 0.0 { self.angles[index(time_s)] } else { [0.0; 3] };
        if late_s.is_infinite() {
            return own;
        }
        // What is left of the earlier motion is added.
        let since = self.phases.run_s + late_s + time_s - self.start_s();
        let left = if index(since) + 1 < self.angles.len() { self.angles[index(since)] } else { [0.0; 3] };
        [0, 1, 2].map(|k| own[k] + left[k])
    }

    /// Returns the start of the trial, counted from the start of the run, s.
    pub fn start_s(&self) -> f64 {
        -self.phases.calibrate_s - self.phases.preroll_s
    }

    /// Returns the record of the trial.
    pub(super) fn trial(&self) -> TrialMeta {
        let Phases { calibrate_s, preroll_s, run_s, decay_s, .. } = self.phases;
        let [w1_rpm, w2_rpm] = self.rpm;
        TrialMeta { w1_rpm, w2_rpm, calibrate_s, preroll_s, run_s, decay_s, ..TrialMeta::default() }
    }

    /// Returns the state of a motor that reaches its speed at once. `time_s`: since the start of the run.
    pub(super) fn motor(&self, motor: usize, time_s: f64) -> Motor {
        let rpm = self.rpm[motor];
        let turns = rpm / 60.0 * time_s.clamp(0.0, self.phases.run_s);
        let speed_rpm = if (0.0..self.phases.run_s).contains(&time_s) { rpm } else { 0.0 };
        Motor { target_rpm: speed_rpm, speed_rpm, turns, ..Motor::default() }
    }

    /// Returns the trial as the model's log has it.
    pub fn model(&self) -> Data {
        let mut collector = Collector::new(Want::default(), 2);
        let Phases { preroll_s, run_s, decay_s, .. } = self.phases;
        for (name, time_s) in [("preroll", 0.0), ("run", preroll_s), ("decay", preroll_s + run_s)] {
            collector.event(time_s, Kind::Phase, name);
        }
        for tick in (0..=((preroll_s + run_s + decay_s) / TICK_S) as usize).step_by(TICKS_A_SAMPLE) {
            let clock_s = tick as f64 * TICK_S;
            let time_s = clock_s - preroll_s;
            let [yaw_deg, pitch_deg, roll_deg] = self.at(time_s, f64::INFINITY).map(f64::to_degrees);
            collector.truth(&Truth { time_s: clock_s, yaw_deg, pitch_deg, roll_deg, ..Truth::default() });
            let [motor1, motor2] = [0, 1].map(|motor| Some(self.motor(motor, time_s)));
            collector.telemetry(&Telemetry { time_s: clock_s, motor1, motor2, ..Telemetry::default() });
        }
        collector.event(preroll_s + run_s + decay_s, Kind::Phase, "end");
        let records = Records {
            identity: Some(Identity { format: 2, origin: Origin::Model, ..Identity::default() }),
            trial: Some(TrialMeta { calibrate_s: 0.0, ..self.trial() }),
            model: Some(ModelMeta { rate_hz: 20.0, parameters: self.parameters.clone(), ..ModelMeta::default() }),
            summary: Some(Summary { end: End::Complete, ..Summary::default() }),
            ..Records::default()
        };
        collector.finish("model".as_ref(), records)
    }
}
