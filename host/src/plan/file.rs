//! The plan as it is written, and the checks of every value where it stands.

use super::expand::{SpeedList, expand};
use super::{MAX_TRIALS, Phases, Plan, PlanError, Reverse, Robot};
use crate::board_settings::BoardSettings;
use crate::exactly::Exactly;
use serde::Deserialize;
use std::ops::Range;
use toml::Spanned;

/// The robot whose parameters need no file.
pub const PUBLISHED: &str = "published";

/// The longest phase: a day.
const MAX_PHASE_S: f64 = 86_400.0;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlanFile {
    #[serde(default)]
    session: SessionTable,
    #[serde(default)]
    trial: TrialTable,
    #[serde(default = "nowhere_default")]
    speeds: Spanned<SpeedsTable>,
    #[serde(default = "nowhere_default")]
    board: Spanned<BoardSettings>,
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
            name: nowhere("session".to_owned()),
            operator: String::new(),
            note: String::new(),
            robot: nowhere(PUBLISHED.to_owned()),
            seed: None,
            repeats: nowhere(1),
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
}

/// Which motor turns the other way, and how many seconds after the start of the run.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ReverseTable {
    motor: i64,
    after: f64,
}

impl Default for TrialTable {
    fn default() -> Self {
        let Phases { calibrate_s, preroll_s, run_s, decay_s } = Phases::default();
        let [calibrate, preroll, run, decay] = [calibrate_s, preroll_s, run_s, decay_s].map(nowhere);
        Self { calibrate, preroll, run, decay, reverse: None }
    }
}

/// `[speeds]`.
#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
pub(super) struct SpeedsTable {
    pub pairs: Vec<Spanned<Exactly<f64, 2>>>,
    pub grid: Option<GridTable>,
}

/// Each axis as first, last, step.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GridTable {
    pub w1: Spanned<Exactly<f64, 3>>,
    pub w2: Spanned<Exactly<f64, 3>>,
}

/// A default stands nowhere in the file, and is never wrong.
fn nowhere<T>(value: T) -> Spanned<T> {
    Spanned::new(0..0, value)
}

fn nowhere_default<T: Default>() -> Spanned<T> {
    nowhere(T::default())
}

/// Turns offsets into places that an editor can go to.
pub(super) struct Source<'a> {
    pub text: &'a str,
    pub name: &'a str,
}

impl Source<'_> {
    /// An error at `span`.
    pub fn error(&self, span: Range<usize>, what: impl Into<String>, cure: impl Into<String>) -> PlanError {
        let before = &self.text[..self.text.floor_char_boundary(span.start)];
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
        PlanError::Invalid { place: format!("{}:{line}:{column}", self.name), what: what.into(), cure: cure.into() }
    }

    fn toml_error(&self, error: &toml::de::Error) -> PlanError {
        let what = error.message().trim().replace('\n', "; ");
        let cure = if what.starts_with("unknown field") {
            "correct the key, or leave it out; the tables are [session], [trial], [speeds] and [board]"
        } else {
            "write it as in the plan that `biflag record --help` shows"
        };
        self.error(error.span().unwrap_or(0..0), what, cure)
    }
}

pub(super) fn parse(text: &str, name: &str) -> Result<Plan, PlanError> {
    let source = Source { text, name };
    let file: PlanFile = toml::from_str(text).map_err(|error| source.toml_error(&error))?;
    let phases = phases(&file.trial, &source)?;
    let reverse = reverse(&file.trial, &source)?;
    let session = file.session;
    let wrong = |span: Range<usize>, what: &str, cure: &str| Err(source.error(span, what, cure));

    if session.name.get_ref().trim().is_empty() {
        return wrong(session.name.span(), "the session has an empty name", "give it a name, or leave the key out");
    }
    let robot = session.robot.get_ref();
    if robot.is_empty() {
        return wrong(session.robot.span(), "no robot is named", "write \"published\", or the path of a file");
    }
    let repeats = match *session.repeats.get_ref() {
        ..=0 => {
            return wrong(session.repeats.span(), "repeats must be 1 or more", "give how often each pair is to run");
        }
        repeats => u32::try_from(repeats).ok().filter(|repeats| *repeats as usize <= MAX_TRIALS).ok_or_else(|| {
            let what = format!("repeats = {repeats} alone makes more than {MAX_TRIALS} trials");
            source.error(session.repeats.span(), what, "take fewer repeats, or make several plans")
        })?,
    };
    let seed = match &session.seed {
        None => None,
        Some(seed) => match u64::try_from(*seed.get_ref()) {
            Ok(value) => Some(value),
            Err(_) => return wrong(seed.span(), "a seed cannot be negative", "give a whole number from 0 up"),
        },
    };
    file.board
        .get_ref()
        .apply(protocol::Settings::DEFAULT)
        .map_err(|error| source.error(file.board.span(), format!("[board] {error}"), error.cure))?;

    let list = SpeedList { table: file.speeds.get_ref(), span: file.speeds.span(), repeats, seed, phases, reverse };
    Ok(Plan {
        name: session.name.get_ref().trim().to_owned(),
        operator: session.operator,
        note: session.note,
        robot: Robot { name: robot.clone(), text: String::new() },
        seed,
        trials: expand(&list, &source)?,
        board: file.board.into_inner(),
        text: text.to_owned(),
    })
}

fn phases(table: &TrialTable, source: &Source) -> Result<Phases, PlanError> {
    let check = |value: &Spanned<f64>, name: &str| {
        let seconds = *value.get_ref();
        let cure = "give seconds";
        if !seconds.is_finite() {
            return Err(source.error(value.span(), format!("{name} = {seconds} is no duration"), cure));
        }
        if seconds < 0.0 {
            return Err(source.error(value.span(), format!("{name} = {seconds} is negative"), cure));
        }
        if seconds > MAX_PHASE_S {
            return Err(source.error(value.span(), format!("{name} = {seconds} is longer than a day"), cure));
        }
        Ok(seconds)
    };
    let phases = Phases {
        calibrate_s: check(&table.calibrate, "calibrate")?,
        preroll_s: check(&table.preroll, "preroll")?,
        run_s: check(&table.run, "run")?,
        decay_s: check(&table.decay, "decay")?,
    };
    if phases.calibrate_s != 0.0 && !(0.1..=60.0).contains(&phases.calibrate_s) {
        let what = format!("calibrate = {} is not within what the board can average", phases.calibrate_s);
        let cure = "give 0.1 to 60 seconds, or 0 to keep the bias that the board has";
        return Err(source.error(table.calibrate.span(), what, cure));
    }
    if phases.run_s == 0.0 {
        let cure = "give the seconds that the motors are to turn; a trial at rest has the speeds [0, 0]";
        return Err(source.error(table.run.span(), "run = 0 is no trial", cure));
    }
    Ok(phases)
}

fn reverse(table: &TrialTable, source: &Source) -> Result<Option<Reverse>, PlanError> {
    let Some(spanned) = &table.reverse else { return Ok(None) };
    let ReverseTable { motor, after } = *spanned.get_ref();
    let run = *table.run.get_ref();
    let Some(motor) = u8::try_from(motor).ok().filter(|motor| (1..=2).contains(motor)) else {
        return Err(source.error(spanned.span(), format!("there is no motor {motor}"), "reverse motor 1 or 2"));
    };
    if !(after > 0.0 && after < run) {
        let what = format!("the motor cannot reverse {after} s after the start of a run of {run} s");
        return Err(source.error(spanned.span(), what, "give a time within the run"));
    }
    Ok(Some(Reverse { motor, after_s: after }))
}
