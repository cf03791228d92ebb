//! Options shared by several commands.

use crate::output::{OutputError, ending, has_ending};
use crate::plan::{self, MAX_PHASE_S, MIN_RUN_S};
use crate::sweep::Shard;
use biflag_log::Method;
use clap::builder::{PathBufValueParser, PossibleValuesParser, TypedValueParser};
use protocol::units::CentiRpm;
use serde::de::DeserializeOwned;
use sim::body::closure::Closure;
use std::ops::RangeInclusive;
use std::path::PathBuf;

/// Reads the name of a closure.
pub fn closure() -> impl TypedValueParser<Value = Closure> {
    PossibleValuesParser::new(["full", "lumped", "paper"]).try_map(of_name)
}

/// Reads the name of a method.
pub fn method() -> impl TypedValueParser<Value = Method> {
    PossibleValuesParser::new(["trial", "steady"]).try_map(of_name)
}

fn of_name<T: DeserializeOwned>(name: String) -> serde_json::Result<T> {
    serde_json::from_value(name.into())
}

/// Parses two values with a comma between them, each with `one`. `form`: the error for text of another form.
pub fn pair<T, E: From<&'static str>>(
    text: &str,
    form: &'static str,
    one: impl Fn(&str) -> Result<T, E>,
) -> Result<[T; 2], E> {
    let (first, second) = text.split_once(',').filter(|(_, second)| !second.contains(',')).ok_or(form)?;
    Ok([one(first.trim())?, one(second.trim())?])
}

/// Reads the speeds of both flagella in rpm.
pub fn speeds(text: &str) -> Result<[CentiRpm; 2], String> {
    let one = |text: &str| {
        let rpm: f64 = text.parse().map_err(|_| format!("{text:?} is not a speed"))?;
        plan::board_speed(rpm).map_err(|(what, cure)| format!("{what}; {cure}"))
    };
    pair(text, "give two speeds in rpm, such as 50,10 or 37.55,-12.25; a plan has several pairs: `biflag new`", one)
}

/// Returns a parser of the name of a file that is written, which has one of these endings or none.
pub fn written_as(endings: &'static [&'static str]) -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| if has_ending(&path) { named(path, endings) } else { Ok(path) })
}

/// Returns a path that has one of these endings, or what is wrong with it.
pub fn named(path: PathBuf, endings: &[&str]) -> Result<PathBuf, String> {
    ending(&path, endings).map(|_| path).map_err(|error| match error {
        // The line of the argument names the file.
        OutputError::Ending { endings, .. } => format!("the name must end with {endings}"),
        other => other.to_string(),
    })
}

/// Returns a parser of numbers within a range. `what` names them with their unit.
pub fn within(what: &'static str, range: RangeInclusive<f64>) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text: &str| {
        let value = text.parse().ok().filter(|value| range.contains(value));
        value.ok_or_else(|| format!("give {what}, {} to {}", range.start(), range.end()))
    }
}

/// Reads the duration of a run in seconds.
pub fn duration(text: &str) -> Result<f64, String> {
    within("seconds", MIN_RUN_S..=MAX_PHASE_S)(text)
}

/// Reads a supply voltage.
pub fn volts(text: &str) -> Result<f64, String> {
    within("the reading of a meter in volts", 4.0..=6.0)(text)
}

/// Reads a range of time in seconds.
pub fn span(text: &str) -> Result<[f64; 2], String> {
    let form = "give two times in seconds, the earlier one first, such as 50,56";
    let one = |text: &str| text.parse::<f64>().ok().filter(|time| time.is_finite()).ok_or_else(|| form.to_owned());
    pair(text, form, one).and_then(|[from, to]| if from < to { Ok([from, to]) } else { Err(form.to_owned()) })
}

/// Reads a shard, which is counted from 1.
pub fn shard(text: &str) -> Result<Shard, String> {
    let form = "give the number of the shard and the number of shards, such as 1/8";
    let (number, of) = text.split_once('/').ok_or(form)?;
    let (number, of): (u64, u64) = (number.parse().map_err(|_| form)?, of.parse().map_err(|_| form)?);
    if (1..=of).contains(&number) { Ok(Shard { index: number - 1, of }) } else { Err(form.into()) }
}

/// Returns the default number of parallel trials.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}
