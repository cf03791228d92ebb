//! The plan's file: its tables, and the check of every value.

use super::board::{self, BoardSettings};
use super::expand::{GRID_AXIS, SpeedList, SpeedsTable, Start, expand};
use super::source::{Exactly, FileKind, Source, number};
use super::{HandTurn, MAX_TRIALS, PHYSICAL, Phases, Plan, PlanError, Reverse, RobotFile};
use biflag_log::Method;
use serde::Deserialize;
use std::ops::Range;
use toml::Spanned;

/// The longest phase of a trial, seconds: a day.
pub const MAX_PHASE_S: f64 = 86_400.0;

/// The shortest run, seconds: one tick of the board.
pub const MIN_RUN_S: f64 = 1.0 / protocol::TICK_HZ as f64;

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
        "seed" => "give a whole number from 0 to 9223372036854775807",
        "repeats" => "give a whole number from 1 to 10000: how often each pair of speeds runs",
        "calibrate" => "give seconds as a plain number: 0.1 to 60, or 0 to keep the bias that the board has",
        "preroll" => "give seconds as a plain number, such as preroll = 20",
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
    #[serde(default = "no_span_default")]
    speeds: Spanned<SpeedsTable>,
    #[serde(default)]
    board: BoardSettings,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, default)]
struct SessionTable {
    name: Spanned<String>,
    operator: String,
    note: String,
    robot: Spanned<String>,
    seed: Option<Spanned<i64>>,
    repeats: Spanned<i64>,
}

impl Default for SessionTable {
    fn default() -> Self {
        Self {
            name: no_span("session".to_owned()),
            operator: String::new(),
            note: String::new(),
            robot: no_span(PHYSICAL.to_owned()),
            seed: None,
            repeats: no_span(1),
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, default)]
struct TrialTable {
    calibrate: Spanned<f64>,
    preroll: Spanned<f64>,
    run: Spanned<f64>,
    decay: Spanned<f64>,
    reverse: Option<Spanned<ReverseTable>>,
    hand_turn: Option<Spanned<HandTurn>>,
    phase_deg: Option<Spanned<Exactly<f64, 2>>>,
    phases: Option<Spanned<i64>>,
    method: Spanned<Method>,
}

/// The motor that reverses, and the time in seconds after the start of the run.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ReverseTable {
    motor: i64,
    after: f64,
}

impl Default for TrialTable {
    fn default() -> Self {
        let Phases { calibrate_s, preroll_s, run_s, decay_s } = Phases::default();
        let [calibrate, preroll, run, decay] = [calibrate_s, preroll_s, run_s, decay_s].map(no_span);
        Self {
            calibrate,
            preroll,
            run,
            decay,
            reverse: None,
            hand_turn: None,
            phase_deg: None,
            phases: None,
            method: no_span(Method::Trial),
        }
    }
}

/// A default: a value without a source location. It is never wrong.
fn no_span<T>(value: T) -> Spanned<T> {
    Spanned::new(0..0, value)
}

fn no_span_default<T: Default>() -> Spanned<T> {
    no_span(T::default())
}

pub(super) fn parse(text: &str, name: &str) -> Result<Plan, PlanError> {
    let source = Source { kind: &KIND, text, name };
    let file: PlanFile = source.read().map_err(|error| if is_of_sweep(text) { sweep_only(&source) } else { error })?;
    let phases = phases(&file.trial, &source)?;
    let reverse = reverse(&file.trial, &source)?;
    let hand_turn = hand_turn(&file.trial, &source)?;
    let start = start(&file.trial, &source)?;
    let method = method(&file.trial, &source)?;
    let session = file.session;
    let wrong = |span: Range<usize>, what: &str, cure: &str| Err(source.error(span, what, cure));

    if session.name.get_ref().trim().is_empty() {
        return wrong(session.name.span(), "the name of the session is empty", "give it a name, or leave the key out");
    }
    let robot = session.robot.get_ref();
    if robot.is_empty() {
        let cure = "give \"physical\", \"published\", or the path of a robot file";
        return wrong(session.robot.span(), "the name of the robot is empty", cure);
    }
    let repeats = *session.repeats.get_ref();
    let repeats = u32::try_from(repeats).ok().filter(|repeats| (1..=MAX_TRIALS).contains(&(*repeats as usize)));
    let Some(repeats) = repeats else {
        return Err(source.out_of_range(session.repeats.span(), "repeats", session.repeats.get_ref()));
    };
    let seed = match &session.seed {
        None => None,
        Some(seed) => match u64::try_from(*seed.get_ref()) {
            Ok(value) => Some(value),
            Err(_) => return Err(source.out_of_range(seed.span(), "seed", seed.get_ref())),
        },
    };
    file.board.check(&source, &["board"])?;

    let list =
        SpeedList { table: file.speeds.get_ref(), span: file.speeds.span(), repeats, seed, phases, reverse, start };
    Ok(Plan {
        name: session.name.get_ref().trim().to_owned(),
        operator: session.operator,
        note: session.note,
        robot: RobotFile::built_in(robot),
        seed,
        trials: expand(&list, &source)?,
        board: file.board,
        method,
        hand_turn,
        text: text.to_owned(),
    })
}

/// Returns whether this is the plan of a sweep.
fn is_of_sweep(text: &str) -> bool {
    toml::from_str::<toml::Table>(text).is_ok_and(|table| table.contains_key("vary"))
}

fn sweep_only(source: &Source) -> PlanError {
    let at = source.text.find("[vary").unwrap_or_default();
    source.error(at..at, "a plan with [vary] is that of a sweep", "run it with `biflag sweep`, or leave [vary] out")
}

fn phases(table: &TrialTable, source: &Source) -> Result<Phases, PlanError> {
    let check = |value: &Spanned<f64>, name: &str| {
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
        calibrate_s: check(&table.calibrate, "calibrate")?,
        preroll_s: check(&table.preroll, "preroll")?,
        run_s: check(&table.run, "run")?,
        decay_s: check(&table.decay, "decay")?,
    };
    if phases.calibrate_s != 0.0 && !(0.1..=60.0).contains(&phases.calibrate_s) {
        return Err(source.out_of_range(table.calibrate.span(), "calibrate", number(phases.calibrate_s)));
    }
    if phases.run_s < MIN_RUN_S {
        let what = format!("run = {} is shorter than a tick of the board", number(phases.run_s));
        let cure = format!("give at least {MIN_RUN_S} s; for a trial at rest, give the speeds [0, 0]");
        return Err(source.error(table.run.span(), what, cure));
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
    let method = *table.method.get_ref();
    if method == Method::Steady && table.reverse.is_some() {
        let what = "the method `steady` cannot compute a reversal";
        return Err(source.error(table.method.span(), what, "leave out reverse, or method"));
    }
    Ok(method)
}

/// Most starting phases of a pair of speeds.
const MAX_PHASES: i64 = 360;

fn start(table: &TrialTable, source: &Source) -> Result<Start, PlanError> {
    match (&table.phase_deg, &table.phases) {
        (Some(angles), Some(_)) => {
            let what = "phase_deg and phases cannot both be set";
            Err(source.error(
                angles.span(),
                what,
                "give one starting phase or the number of phases, and leave the other out",
            ))
        }
        (Some(spanned), None) => {
            let Exactly(angles) = *spanned.get_ref();
            match angles.into_iter().find(|deg| !(-360.0..=360.0).contains(deg)) {
                Some(deg) => Err(source.out_of_range(spanned.span(), "phase_deg", number(deg))),
                None => Ok(Start::At(angles)),
            }
        }
        (None, Some(spanned)) => match *spanned.get_ref() {
            count @ 1..=MAX_PHASES => Ok(Start::Phases(count as usize)),
            count => Err(source.out_of_range(spanned.span(), "phases", count)),
        },
        (None, None) => Ok(Start::Unset),
    }
}

/// Refuses a plan with starting phases: motors of a rig are where they were left.
pub(super) fn check_for_rig(plan: &Plan, name: &str) -> Result<(), PlanError> {
    if plan.trials.iter().all(|trial| trial.phase_deg.is_none()) {
        return Ok(());
    }
    let source = Source { kind: &KIND, text: &plan.text, name };
    let table = plan.text.parse::<toml::Table>().ok();
    let has_phases = table.and_then(|table| table.get("trial")?.get("phases").map(|_| ())).is_some();
    let key = if has_phases { "phases" } else { "phase_deg" };
    let what = format!("{key} cannot be set on a rig, where the flagella start as they stand");
    let cure = "leave it out, or run the plan with `biflag simulate`; a replay of the recording starts at the angles of the \
                encoders";
    Err(source.error_at(["trial", key], what, cure))
}

fn reverse(table: &TrialTable, source: &Source) -> Result<Option<Reverse>, PlanError> {
    let Some(spanned) = &table.reverse else { return Ok(None) };
    let ReverseTable { motor, after } = *spanned.get_ref();
    let run = *table.run.get_ref();
    let Some(motor) = u8::try_from(motor).ok().filter(|motor| (1..=2).contains(motor)) else {
        return Err(source.out_of_range(spanned.span(), "motor", motor));
    };
    if !(after > 0.0 && after < run) {
        let what = format!("after = {} is not within the run of {} s", number(after), number(run));
        return Err(source.error(spanned.span(), what, format!("give seconds between 0 and {}", number(run))));
    }
    Ok(Some(Reverse { motor, after_s: after }))
}
