//! The plan's file: its tables, with a check of every value.

use super::board::{self, BoardSettings};
use super::expand::{GRID_AXIS, SpeedsTable, Start, TrialList, expand};
use super::source::{Exactly, FileKind, Source, number};
use super::{HandTurn, MAX_TRIALS, PHYSICAL, Phases, Plan, PlanError, Reverse, RobotFile};
use biflag_log::{MeasuredSensorMeta, Method};
use serde::Deserialize;
use toml::Spanned;

/// The longest phase of a trial, seconds: a day.
pub const MAX_PHASE_S: f64 = 86_400.0;

/// The shortest run, seconds: one tick of the board.
pub const MIN_RUN_S: f64 = 1.0 / protocol::TICK_HZ as f64;

/// Most starting phases of a pair of speeds.
const MAX_PHASES: i64 = 360;

pub(crate) const KIND: FileKind = FileKind {
    noun: "plan",
    example: "`biflag record --help` shows one",
    tables: &["session", "trial", "speeds", "board", "reverse", "hand_turn", "grid"],
    help,
};

/// Returns the range and the meaning of a key.
fn help(key: &str) -> Option<&'static str> {
    Some(match key {
        "name" | "operator" | "note" => "give text in quotes",
        "robot" => "give \"physical\", \"published\", or the path of a robot file in quotes",
        "sensor" => "give the path of a sensor file in quotes, such as \"sensor.toml\"; `biflag sensor` writes it",
        "seed" => "give a whole number from 0 to 9223372036854775807",
        "repeats" => "give a whole number from 1 to 10000: how often each pair of speeds runs",
        "calibrate" => "give seconds as a plain number: 0.1 to 60, or 0 to keep the bias that the board has",
        "preroll" => "give seconds as a plain number, such as preroll = 20",
        "rest_at_most" => {
            "give seconds as a plain number, such as rest_at_most = 300: the longest wait for a still robot; 0 for none"
        }
        "run" => "give seconds as a plain number, such as run = 60",
        "decay" => "give seconds as a plain number, such as decay = 30",
        "reverse" => {
            "give the motor and the seconds after the start of the run, such as reverse = { motor = 2, after = 35 }"
        }
        "hand_turn" => "give the axis and the angle, such as hand_turn = { axis = \"z\", degrees = 720 }",
        "axis" => "give \"x\", \"y\" or \"z\"",
        "degrees" => "give the angle in degrees as a plain number, not 0",
        "phase_deg" => {
            "give the starting angles of motors 1 and 2 in degrees, -360 to 360, such as phase_deg = [0, 90]"
        }
        "phases" => "give a whole number from 1 to 360: at how many starting phases each pair of speeds runs",
        "method" => "give \"trial\", or \"steady\" to solve for the steady state of a model",
        "motor" => "give 1 or 2",
        "after" => "give seconds after the start of the run as a plain number",
        "pairs" => "give a list of pairs in rpm, such as pairs = [[50, 10]]",
        "grid" => "give both axes, such as grid = { w1 = [-90, 90, 10], w2 = [0, 90, 10] }",
        "w1" | "w2" => GRID_AXIS,
        _ => return board::help(key),
    })
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlanFile {
    #[serde(default)]
    session: SessionTable,
    #[serde(default)]
    trial: TrialTable,
    speeds: Option<Spanned<SpeedsTable>>,
    #[serde(default)]
    board: BoardSettings,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct SessionTable {
    pub name: Option<Spanned<String>>,
    pub operator: String,
    pub note: String,
    pub robot: Option<Spanned<String>>,
    pub sensor: Option<Spanned<String>>,
    pub seed: Option<Spanned<i64>>,
    pub repeats: Option<Spanned<i64>>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct TrialTable {
    pub calibrate: Option<Spanned<f64>>,
    pub preroll: Option<Spanned<f64>>,
    pub run: Option<Spanned<f64>>,
    pub decay: Option<Spanned<f64>>,
    pub rest_at_most: Option<Spanned<f64>>,
    pub reverse: Option<Spanned<ReverseTable>>,
    pub hand_turn: Option<Spanned<HandTurn>>,
    pub phase_deg: Option<Spanned<Exactly<f64, 2>>>,
    pub phases: Option<Spanned<i64>>,
    pub method: Option<Spanned<Method>>,
}

/// The motor that reverses, and the time in seconds after the start of the run.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ReverseTable {
    motor: i64,
    after: f64,
}

impl Plan {
    /// Reads a plan from its text; errors call the file `name`. The robot and sensor files are not read.
    ///
    /// # Errors
    /// [`PlanError::Invalid`].
    pub fn parse(text: &str, name: &str) -> Result<Self, PlanError> {
        let source = Source { kind: &KIND, text, name };
        let file: PlanFile = source.read().map_err(|error| of_sweep(&source).unwrap_or(error))?;
        let phases = phases(&file.trial, &source)?;
        let reverse = reverse(&file.trial, phases.run_s, &source)?;
        let hand_turn = hand_turn(&file.trial, &source)?;
        let start = start(&file.trial, &source)?;
        let method = method(&file.trial, &source)?;
        let session = file.session;

        let name = source.session_name(session.name, "session")?;
        if let Some(robot) = session.robot.as_ref().filter(|robot| robot.get_ref().is_empty()) {
            let cure = "give \"physical\", \"published\", or the path of a robot file";
            return Err(source.error(robot.span(), "the name of the robot is empty", cure));
        }
        if let Some(sensor) = session.sensor.as_ref().filter(|sensor| sensor.get_ref().is_empty()) {
            let cure = help("sensor").unwrap_or_default();
            return Err(source.error(sensor.span(), "the name of the sensor's file is empty", cure));
        }
        let possible = |repeats: &i64| (1..=MAX_TRIALS as i64).contains(repeats).then_some(*repeats as u32);
        let repeats = source.checked(&session.repeats, "repeats", possible)?.unwrap_or(1);
        let seed = source.checked(&session.seed, "seed", |seed| u64::try_from(*seed).ok())?;
        file.board.check(&source, &["board"])?;
        for (key, value) in [("bridge", &file.board.bridge), ("speed_from", &file.board.speed_from)] {
            if value.is_some() {
                let cure =
                    "leave it out: it says how the board is wired, so it is set once, by `biflag settings --write`";
                return Err(source.error_at(["board", key], format!("{key} is no setting of a plan"), cure));
            }
        }

        let list = TrialList { speeds: file.speeds.as_ref(), repeats, seed, phases, reverse, start };
        Ok(Self {
            name,
            operator: session.operator,
            note: session.note,
            robot: RobotFile::built_in(session.robot.as_ref().map_or(PHYSICAL, |robot| robot.get_ref())),
            sensor: session.sensor.map(|name| MeasuredSensorMeta { name: name.into_inner(), text: String::new() }),
            seed,
            trials: expand(&list, &source)?,
            board: file.board,
            method,
            hand_turn,
            text: text.to_owned(),
        })
    }

    /// Returns whether the plan sets the angles at which flagella start.
    pub fn has_phases(&self) -> bool {
        self.trials.iter().any(|trial| trial.phase_deg.is_some())
    }
}

/// Returns the error for a sweep's plan, if the file is one.
fn of_sweep(source: &Source) -> Option<PlanError> {
    source.text.parse::<toml::Table>().ok()?.get("vary")?;
    let at = source.text.find("[vary").unwrap_or_default();
    let cure = "run it with `biflag sweep`, or leave [vary] out";
    Some(source.error(at..at, "a plan with [vary] is that of a sweep", cure))
}

fn phases(table: &TrialTable, source: &Source) -> Result<Phases, PlanError> {
    let default = Phases::default();
    let check = |value: &Option<Spanned<f64>>, name: &str, default_s: f64| {
        let Some(value) = value else { return Ok(default_s) };
        let seconds = *value.get_ref();
        let wrong = match seconds {
            s if !s.is_finite() => "is not a duration",
            s if s < 0.0 => "is negative",
            s if s > MAX_PHASE_S => "is longer than a day",
            seconds => return Ok(seconds),
        };
        let cure = help(name).unwrap_or_default();
        Err(source.error(value.span(), format!("{name} = {} {wrong}", number(seconds)), cure))
    };
    let phases = Phases {
        rest_at_most_s: check(&table.rest_at_most, "rest_at_most", default.rest_at_most_s)?,
        calibrate_s: check(&table.calibrate, "calibrate", default.calibrate_s)?,
        preroll_s: check(&table.preroll, "preroll", default.preroll_s)?,
        run_s: check(&table.run, "run", default.run_s)?,
        decay_s: check(&table.decay, "decay", default.decay_s)?,
    };
    let is_possible = |calibrate_s: &f64| *calibrate_s == 0.0 || (0.1..=60.0).contains(calibrate_s);
    if let Some(calibrate) = table.calibrate.as_ref().filter(|value| !is_possible(value.get_ref())) {
        return Err(source.out_of_range(calibrate.span(), "calibrate", number(phases.calibrate_s)));
    }
    if let Some(run) = table.run.as_ref().filter(|run| *run.get_ref() < MIN_RUN_S) {
        let what = format!("run = {} is shorter than a tick of the board", number(phases.run_s));
        let cure = format!("give at least {MIN_RUN_S} s; for a trial at rest, give the speeds [0, 0]");
        return Err(source.error(run.span(), what, cure));
    }
    Ok(phases)
}

fn hand_turn(table: &TrialTable, source: &Source) -> Result<Option<HandTurn>, PlanError> {
    let Some(spanned) = &table.hand_turn else { return Ok(None) };
    let turn = *spanned.get_ref();
    if !turn.degrees.is_finite() || turn.degrees == 0.0 {
        return Err(source.out_of_range(spanned.span(), "degrees", number(turn.degrees)));
    }
    Ok(Some(turn))
}

fn method(table: &TrialTable, source: &Source) -> Result<Method, PlanError> {
    let Some(method) = &table.method else { return Ok(Method::Trial) };
    if *method.get_ref() == Method::Steady && table.reverse.is_some() {
        let what = "the method `steady` cannot compute a reversal";
        return Err(source.error(method.span(), what, "leave out reverse, or method"));
    }
    Ok(*method.get_ref())
}

fn start(table: &TrialTable, source: &Source) -> Result<Start, PlanError> {
    match (&table.phase_deg, &table.phases) {
        (Some(angles), Some(_)) => {
            let cure = "give one starting phase or the number of phases, and leave the other out";
            Err(source.error(angles.span(), "phase_deg and phases cannot both be set", cure))
        }
        (Some(spanned), None) => {
            let Exactly(angles) = *spanned.get_ref();
            match angles.into_iter().find(|deg| !(-360.0..=360.0).contains(deg)) {
                Some(deg) => Err(source.out_of_range(spanned.span(), "phase_deg", number(deg))),
                None => Ok(Start::At(angles)),
            }
        }
        (None, phases) => Ok(count_of_phases(phases, source)?.map_or(Start::Unset, Start::Phases)),
    }
}

/// Returns the number of starting phases, if the plan sets it.
pub(crate) fn count_of_phases(phases: &Option<Spanned<i64>>, source: &Source) -> Result<Option<usize>, PlanError> {
    source.checked(phases, "phases", |count| (1..=MAX_PHASES).contains(count).then_some(*count as usize))
}

fn reverse(table: &TrialTable, run_s: f64, source: &Source) -> Result<Option<Reverse>, PlanError> {
    let Some(spanned) = &table.reverse else { return Ok(None) };
    let ReverseTable { motor, after } = *spanned.get_ref();
    let Some(motor) = u8::try_from(motor).ok().filter(|motor| (1..=2).contains(motor)) else {
        return Err(source.out_of_range(spanned.span(), "motor", motor));
    };
    if !(after > 0.0 && after < run_s) {
        let what = format!("after = {} is not within the run of {} s", number(after), number(run_s));
        return Err(source.error(spanned.span(), what, format!("give seconds between 0 and {}", number(run_s))));
    }
    Ok(Some(Reverse { motor, after_s: after }))
}
