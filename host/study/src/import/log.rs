//! Writes the log of an imported trial.

use super::run::Run;
use super::{ImportError, States};
use crate::plan::{MAX_PHASE_S, MIN_RUN_S, Phase, Plan, RobotFile};
use crate::trial::Data;
use crate::{output, run};
use biflag_log::schema::biflag::{Quaternion, Truth};
use biflag_log::{End, EventKind, ImportMeta, LinkStats, Origin, Summary, Writer};
use protocol::units::CentiRpm;
use sim::body::attitude::of_euler_zyx;
use std::ops::Range;
use std::path::Path;
use std::time::SystemTime;

/// Conditions of a trial that its table does not contain.
#[derive(Clone, PartialEq, Debug)]
pub struct Conditions {
    /// Speeds of flagella 1 and 2; `None`: the table's speeds.
    pub speeds: Option<[CentiRpm; 2]>,
    /// Time in which the motors turn, by the clock of the table, s; `None`: when the table's motors turn, or all the
    /// time.
    pub run_s: Option<Range<f64>>,
    /// The motor that reverses, and the time of the reversal, s from the start of the run.
    pub reverse: Option<(u8, f64)>,
    /// The robot.
    pub robot: RobotFile,
    /// 95 % uncertainty of the instrument's yaw, and of its pitch and roll, degrees.
    pub uncertainty_deg: Option<[f64; 2]>,
    /// Temperature of the fluid, °C.
    pub temperature_c: Option<f64>,
    /// A free note.
    pub note: String,
}

impl Conditions {
    /// Returns the conditions with speeds, run, reversal and robot of a recording. The states must be on the
    /// recording's clock. If the table ends during the run, the run is cut there.
    ///
    /// # Errors
    /// [`ImportError::Table`] if the states begin in the run.
    pub fn of_recording(self, recording: &Data, states: &States, table: &str) -> Result<Self, ImportError> {
        let run = recording.times.run.clone();
        let (first, last) =
            states.rows.first().zip(states.rows.last()).map_or((0.0, 0.0), |(a, b)| (a.time_s, b.time_s));
        if first > run.start {
            let reason = format!("begins {:.2} s after the start of the run", first - run.start);
            let help = "name a table that begins before the run: its zero is the rest";
            return Err(ImportError::table(table, reason, help));
        }
        let trial = recording.records.trial.as_ref();
        Ok(Self {
            // Motors without encoders do not turn as commanded: the speeds are then those of the states.
            speeds: (!recording.is_blind()).then(|| recording.speeds()),
            run_s: Some(run.start..run.end.min(last)),
            reverse: trial.and_then(|trial| trial.reverse_motor.zip(trial.reverse_after_s)),
            robot: RobotFile::of_log(recording.records.robot.clone()),
            ..self
        })
    }
}

/// An imported trial.
#[derive(Clone, PartialEq, Debug)]
pub struct Imported {
    /// Speeds of flagella 1 and 2.
    pub speeds: [CentiRpm; 2],
    /// The run, by the clock of the table, s.
    pub run_s: Range<f64>,
    /// Number of states.
    pub samples: usize,
}

/// Writes the log of a trial with these states to `path`, which must not exist. `table` is the table's name in errors.
///
/// # Errors
/// [`ImportError`]; nothing is written then.
pub fn write(states: &States, conditions: &Conditions, table: &str, path: &Path) -> Result<Imported, ImportError> {
    let Run { run, speeds, turns } = Run::of(states, conditions.speeds, conditions.run_s.clone(), table)?;
    let rows = &states.rows;
    let (start, end) = (rows[0].time_s, rows[rows.len() - 1].time_s);
    if end - start > MAX_PHASE_S {
        let reason = format!("lasts {:.0} s, longer than a day", end - start);
        return Err(ImportError::table(table, reason, "check the unit of the time: `time=t:ms` for milliseconds"));
    }
    if run.end - run.start < MIN_RUN_S {
        let reason = format!("the run lasts {} s, less than {MIN_RUN_S} s", run.end - run.start);
        return Err(ImportError::table(table, reason, "check the unit of the time, and the run"));
    }
    // Differences of the table's times.
    let rounded = |s: f64| (s * 1e6).round() / 1e6;
    let [preroll, lasts, decay] = [run.start - start, run.end - run.start, end - run.end].map(rounded);
    let reverse = conditions.reverse.filter(|(_, after_s)| *after_s < run.end - run.start);
    let reverse = reverse
        .map_or_else(String::new, |(motor, after_s)| format!("\nreverse = {{ motor = {motor}, after = {after_s} }}"));
    let lines = format!("calibrate = 0\npreroll = {preroll}\nrun = {lasts}\ndecay = {decay}{reverse}");
    let plan = Plan::of_speeds(speeds, &lines, "")?;
    let plan = Plan { robot: conditions.robot.clone(), note: conditions.note.clone(), ..plan };
    output::check_new(path)?;
    let epoch = SystemTime::UNIX_EPOCH;
    let first = run::start(&plan, &plan.trials[0], 1, Origin::Imported, None, epoch);
    let mut log = Writer::create(path, &first, epoch)?;
    log.meta(&ImportMeta {
        start_s: start,
        yaw_uncertainty_deg: conditions.uncertainty_deg.map(|[yaw, _]| yaw),
        tilt_uncertainty_deg: conditions.uncertainty_deg.map(|[_, tilt]| tilt),
        temperature_c: conditions.temperature_c,
        ..states.about.clone()
    })?;
    let phases = [(Phase::Preroll, start), (Phase::Run, run.start), (Phase::Decay, run.end), (Phase::End, end)];
    let mut phases = phases.into_iter().peekable();
    for (i, (state, turns)) in rows.iter().zip(&turns).enumerate() {
        while let Some((phase, time_s)) = phases.next_if(|(_, time_s)| *time_s <= state.time_s) {
            log.at(time_s - start);
            log.event(EventKind::Phase, phase.name(), epoch)?;
        }
        log.at(state.time_s - start);
        log.message(&truth(states, i, *turns, start), epoch)?;
    }
    let link = LinkStats { samples: rows.len() as u64, ..LinkStats::default() };
    log.finish(&Summary { end: End::Complete, link, ..Summary::default() })?;
    Ok(Imported { speeds, run_s: run, samples: rows.len() })
}

fn truth(states: &States, i: usize, [motor1_turns, motor2_turns]: [f64; 2], start_s: f64) -> Truth {
    let state = &states.rows[i];
    let [yaw_deg, pitch_deg, roll_deg] = state.angles_deg;
    let q = of_euler_zyx(state.angles_deg.map(f64::to_radians));
    let [motor1_rpm, motor2_rpm] = state.speed_rpm.unwrap_or_default();
    Truth {
        time_s: state.time_s - start_s,
        attitude: Some(Quaternion { w: q.w, x: q.i, y: q.j, z: q.k }),
        yaw_deg,
        pitch_deg,
        roll_deg,
        angular_velocity_dps: None,
        motor1_turns,
        motor2_turns,
        motor1_rpm,
        motor2_rpm,
    }
}
