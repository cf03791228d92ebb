//! Expands pairs, a grid, repeats and a seed into the list of trials.

use super::source::{Exactly, Source, number};
use super::{MAX_TRIALS, Phases, PlanError, Reverse, Trial};
use protocol::units::CentiRpm;
use serde::Deserialize;
use sim::split_mix::split_mix;
use std::collections::HashSet;
use std::ops::Range;
use toml::Spanned;

/// `[speeds]`.
#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct SpeedsTable {
    pairs: Vec<Spanned<Exactly<f64, 2>>>,
    grid: Option<GridTable>,
}

/// Each axis as first, last, step.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GridTable {
    w1: Spanned<Exactly<f64, 3>>,
    w2: Spanned<Exactly<f64, 3>>,
}

/// The input of [`expand`].
pub(super) struct TrialList<'a> {
    pub speeds: Option<&'a Spanned<SpeedsTable>>,
    pub repeats: u32,
    pub seed: Option<u64>,
    pub phases: Phases,
    pub reverse: Option<Reverse>,
    pub start: Start,
}

/// The flagella's starting angles in a model.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Start {
    /// The plan does not say.
    Unset,
    /// At these angles of the motors, degrees.
    At([f64; 2]),
    /// Each pair of speeds at this many starting phases.
    Phases(usize),
}

impl Start {
    /// Returns the starting angles of the trials at a pair of speeds.
    fn angles(self, speeds: [CentiRpm; 2]) -> Vec<Option<[f64; 2]>> {
        match self {
            Self::Unset => vec![None],
            Self::At(angles) => vec![Some(angles)],
            Self::Phases(count) => {
                sim::steady::phase::starts(speeds.map(CentiRpm::rpm), count).into_iter().map(Some).collect()
            }
        }
    }

    /// Returns the number of trials at each pair of speeds.
    fn count(self) -> usize {
        if let Self::Phases(count) = self { count } else { 1 }
    }
}

/// Returns the trials in the order in which they run.
pub(super) fn expand(list: &TrialList, source: &Source) -> Result<Vec<Trial>, PlanError> {
    let trials_per_pair = (list.repeats as usize).saturating_mul(list.start.count());
    let pairs = pairs(list.speeds, trials_per_pair, list.reverse, source)?;
    let mut order: Vec<([CentiRpm; 2], u32)> =
        (1..=list.repeats).flat_map(|repeat| pairs.iter().map(move |speeds| (*speeds, repeat))).collect();
    if let Some(seed) = list.seed {
        shuffle(&mut order, seed);
    }
    let digits = (order.len() * list.start.count()).to_string().len().max(3);
    let mut trials = Vec::new();
    for (speeds, repeat) in order {
        for (i, phase_deg) in list.start.angles(speeds).into_iter().enumerate() {
            let [w1, w2] = speeds.map(|speed| speed.rpm());
            let (index, number) = (trials.len(), trials.len() + 1);
            let mut name = format!("{number:0digits$}_w1{w1:+}_w2{w2:+}");
            if list.repeats > 1 {
                name += &format!("_r{repeat}");
            }
            if let Start::Phases(_) = list.start {
                name += &format!("_p{}", i + 1);
            }
            trials.push(Trial { name, index, repeat, speeds, phases: list.phases, reverse: list.reverse, phase_deg });
        }
    }
    Ok(trials)
}

/// Returns every pair of speeds in a table once, in the order of the file. `trials_per_pair` counts towards the limit
/// of trials.
pub(crate) fn pairs(
    speeds: Option<&Spanned<SpeedsTable>>,
    trials_per_pair: usize,
    reverse: Option<Reverse>,
    source: &Source,
) -> Result<Vec<[CentiRpm; 2]>, PlanError> {
    let none = Spanned::new(0..0, SpeedsTable::default());
    let speeds = speeds.unwrap_or(&none);
    let table = speeds.get_ref();
    let mut pairs = Vec::new();
    for pair in &table.pairs {
        let Exactly([w1, w2]) = *pair.get_ref();
        pairs.push(([speed(w1, pair.span(), source)?, speed(w2, pair.span(), source)?], pair.span()));
    }
    if let Some(grid) = &table.grid {
        let (w1, w2) = (Axis::new(&grid.w1, "w1", source)?, Axis::new(&grid.w2, "w2", source)?);
        let count = w1.count.saturating_mul(w2.count);
        if count > MAX_TRIALS {
            return Err(too_many(count, grid.w1.span(), source));
        }
        let second: Vec<_> = w2.speeds(source).collect::<Result<_, _>>()?;
        // A listed pair that is also a point of the grid runs once.
        let listed: HashSet<_> = pairs.iter().map(|(pair, _)| *pair).collect();
        for first in w1.speeds(source) {
            let first = first?;
            let points = second.iter().map(|second| [first, *second]).filter(|point| !listed.contains(point));
            pairs.extend(points.map(|point| (point, grid.w1.span())));
        }
    }
    if pairs.is_empty() {
        let cure = "give speeds, such as [speeds] pairs = [[50, 10]]";
        return Err(source.error(speeds.span(), "the plan has no trials", cure));
    }
    let count = pairs.len().saturating_mul(trials_per_pair);
    if count > MAX_TRIALS {
        return Err(too_many(count, speeds.span(), source));
    }
    let mut seen = HashSet::new();
    for (pair, span) in &pairs {
        let [w1, w2] = pair.map(CentiRpm::rpm);
        if let Some(Reverse { motor, .. }) = reverse.filter(|reverse| reverse.of(*pair) == *pair) {
            let what = format!("motor {motor} does not turn at {w1}, {w2} rpm, so it cannot reverse");
            return Err(source.error(span.clone(), what, "leave these speeds out, or reverse the other motor"));
        }
        if !seen.insert(*pair) {
            let cure = "leave one out; to run every pair several times, set repeats";
            return Err(source.error(span.clone(), format!("the speeds {w1}, {w2} are listed twice"), cure));
        }
    }
    Ok(pairs.into_iter().map(|(pair, _)| pair).collect())
}

fn too_many(count: usize, span: Range<usize>, source: &Source) -> PlanError {
    let what = format!("the plan has {count} trials, more than {MAX_TRIALS}");
    source.error(span, what, "take larger steps or fewer repeats, or split the plan")
}

/// The form of an axis of the grid.
pub(super) const GRID_AXIS: &str = "give [first, last, step] in rpm, such as [-90, 90, 10]";

/// One axis of the grid.
struct Axis<'a> {
    table: &'a Spanned<Exactly<f64, 3>>,
    count: usize,
}

impl<'a> Axis<'a> {
    fn new(table: &'a Spanned<Exactly<f64, 3>>, name: &str, source: &Source) -> Result<Self, PlanError> {
        let Exactly([first, last, step]) = *table.get_ref();
        let wrong = |what: String| Err(source.error(table.span(), what, GRID_AXIS));
        for end in [first, last] {
            speed(end, table.span(), source)?;
        }
        if !step.is_finite() || step == 0.0 {
            return wrong(format!("the step of {name} cannot be {step}"));
        }
        if (last - first) * step < 0.0 {
            let step = number(step);
            return wrong(format!("{name} does not get from {first} to {last} in steps of {step}"));
        }
        let steps = steps(table.get_ref());
        if steps >= MAX_TRIALS as f64 {
            let step = number(step);
            return wrong(format!("the step {step} gives {name} more than {MAX_TRIALS} speeds"));
        }
        Ok(Self { table, count: steps as usize + 1 })
    }

    fn speeds(&self, source: &'a Source) -> impl Iterator<Item = Result<CentiRpm, PlanError>> {
        let Exactly([first, _, step]) = *self.table.get_ref();
        (0..self.count).map(move |i| speed(first + step * i as f64, self.table.span(), source))
    }
}

/// Returns the number of steps of an axis. A step that divides the range must reach the last speed despite rounding; other
/// steps stop short of it.
fn steps(Exactly([first, last, step]): &Exactly<f64, 3>) -> f64 {
    ((last - first) / step + 1e-6).floor()
}

/// Returns a note for the user if the grid of a plan ends before its last speeds.
pub fn note_on_grid(plan: &str) -> Option<String> {
    #[derive(Deserialize)]
    struct Part {
        speeds: SpeedsTable,
    }
    let grid = toml::from_str::<Part>(plan).ok()?.speeds.grid?;
    let short = |(name, axis): (&str, Spanned<Exactly<f64, 3>>)| {
        let Exactly([first, last, step]) = *axis.get_ref();
        let end = first + step * steps(axis.get_ref());
        ((end - last).abs() > 1e-6).then(|| format!("{name} at {} rpm, not {}", number(end), number(last)))
    };
    let ends: Vec<_> = [("w1", grid.w1), ("w2", grid.w2)].into_iter().filter_map(short).collect();
    (!ends.is_empty()).then(|| format!("the steps of the grid end {}", ends.join(", and ")))
}

fn speed(rpm: f64, span: Range<usize>, source: &Source) -> Result<CentiRpm, PlanError> {
    board_speed(rpm).map_err(|(what, cure)| source.error(span, what, cure))
}

/// Returns a speed in the board's unit, or the error and its correction.
///
/// # Errors
/// The speed is beyond [`CentiRpm::LIMIT`], finer than its resolution, or not a number.
pub fn board_speed(rpm: f64) -> Result<CentiRpm, (String, String)> {
    let limit = CentiRpm::LIMIT.rpm();
    let range = format!("give -{limit} to {limit} rpm");
    if !rpm.is_finite() {
        return Err((format!("a speed cannot be {rpm}"), range));
    }
    if rpm.abs() > limit + 1e-6 {
        return Err((format!("{} rpm is beyond ±{limit} rpm", number(rpm)), range));
    }
    let speed = CentiRpm::from_rpm(rpm);
    if (speed.rpm() - rpm).abs() > 1e-6 {
        let what = format!("{} rpm is finer than the board's resolution", number(rpm));
        return Err((what, "round it to 0.01 rpm".to_owned()));
    }
    Ok(speed)
}

/// Fisher-Yates shuffle. The names of a session's files depend on the order, so it must never change.
fn shuffle<T>(items: &mut [T], seed: u64) {
    for (end, place) in (1..items.len()).rev().zip(1..) {
        // The bias of the remainder is below 1e-15 for lists this short.
        items.swap(end, (split_mix(seed, place) % (end as u64 + 1)) as usize);
    }
}
