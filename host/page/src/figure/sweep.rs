//! Figures of a sweep's table: a result over one input, and the steady angles of a map.

use super::lines::{Curve, MOST, Point, draw};
use super::provenance::Provenance;
use super::{Figure, Remarks};
use crate::PageError;
use crate::swept::{self, MOST_SPREAD_DEG, Swept};
use biflag_log::similar::did_you_mean;
use sim::body::closure::Closure;
use std::path::{Path, PathBuf};
use study::statistics::student_95;
use study::sweep::{Folder, is_folder};
use study::trial::AtSpeeds;
use study::twin::Maker;

/// The result of a sweep to draw, and its inputs.
#[derive(Clone, Copy, Debug)]
pub struct Lines<'a> {
    /// The result, such as `yaw_deg`.
    pub value: &'a str,
    /// The input along the axis.
    pub over: &'a str,
    /// The input that distinguishes the curves; `None` for one curve.
    pub by: Option<&'a str>,
    /// Values of the other inputs; by default the values that most points have.
    pub at: &'a [(String, f64)],
}

/// Draws a result of a sweep over an input, a curve for each value of another. Bands are 95 % intervals of the mean where the
/// table has its standard error.
///
/// # Errors
/// [`PageError`].
pub fn lines(sweep: &Path, lines: Lines, width_mm: f64) -> Result<Figure, PageError> {
    let (table, swept) = read_sweep(sweep)?;
    let wrong = |reason: String| wrong_lines(&table, reason, &swept);
    let missing = |name: &str, what: &str| wrong(format!("{name} is no {what} of the sweep"));
    let input =
        |name: &str| swept.inputs.iter().find(|column| column.name == name).ok_or_else(|| missing(name, "input"));
    let (over, by) = (input(lines.over)?, lines.by.map(input).transpose()?);
    if lines.by == Some(lines.over) {
        return Err(wrong(format!("{} cannot be the axis and tell the curves apart", lines.over)));
    }
    let value = swept.results.iter().find(|column| column.name == lines.value);
    let value = value.ok_or_else(|| missing(lines.value, "result"))?;
    let free: Vec<&str> = std::iter::once(lines.over).chain(lines.by).collect();
    let (mut rows, fixed) = swept.slice(&free, lines.at).map_err(wrong)?;
    rows.retain(|i| value.values[*i].is_finite());
    let key = |i: usize| by.map_or(0.0, |by| by.values[i]);
    rows.sort_by(|a, b| key(*a).total_cmp(&key(*b)).then(over.values[*a].total_cmp(&over.values[*b])));
    // The standard error of a result has the result's name and unit: yaw_se_deg of yaw_deg.
    let error = lines.value.rsplit_once('_').and_then(|(name, unit)| swept.column(&format!("{name}_se_{unit}")));
    let quantile = student_95(f64::INFINITY);
    let point = |i: &usize| Point {
        x: over.values[*i],
        y: value.values[*i],
        half: error.map_or(f64::NAN, |error| quantile * error.values[*i]),
        is_steady: swept.states[*i] <= 0,
    };
    let curves: Vec<Curve> = rows
        .chunk_by(|a, b| swept::is_same(key(*a), key(*b)))
        .map(|rows| Curve { name: short_number(key(rows[0])), points: rows.iter().map(point).collect() })
        .collect();
    if curves.is_empty() {
        return Err(wrong(format!("no point has a value of {}", lines.value)));
    }
    if curves.len() > MOST {
        return Err(wrong(format!(
            "{} has {} values, and at most {} curves are legible",
            lines.by.unwrap_or_default(),
            curves.len(),
            MOST
        )));
    }
    let mut under = in_words(&swept, &fixed);
    if curves.iter().flat_map(|curve| &curve.points).any(|point| !point.is_steady) {
        under.push("Open: not steady".to_owned());
    }
    let by = by.map_or_else(String::new, swept::Column::label);
    let svg = draw(&curves, [&over.label(), &value.label()], &by, &under, width_mm);
    let provenance =
        Provenance::new(format!("{} over {}", value.label(), over.label()), [Provenance::file("table", &table)]);
    let mut warnings = Vec::new();
    if let Some(by) = lines.by.and_then(|name| swept.column(name)) {
        let is_drawn = |value: f64| curves.iter().any(|curve| curve.name == short_number(value));
        let mut missing: Vec<String> =
            by.values.iter().filter(|value| !is_drawn(**value)).map(|value| short_number(*value)).collect();
        missing.sort();
        missing.dedup();
        if !missing.is_empty() {
            warnings.push(format!("no curve for {} = {}: no point there has a value", by.name, missing.join(", ")));
        }
    }
    let notes = note_on_chosen(&fixed, lines.at).into_iter().collect();
    Ok(Figure { svg, provenance, remarks: Remarks { findings: Vec::new(), warnings, notes } })
}

/// Returns the values of inputs in words, one line each.
fn in_words(swept: &Swept, fixed: &[swept::At]) -> Vec<String> {
    let said = |(name, value): &swept::At| {
        let label = swept.column(name).map_or_else(|| name.clone(), swept::Column::label);
        let (words, unit) = label.split_once(", ").unwrap_or((&label, ""));
        format!("{words} {} {unit}", short_number(*value)).trim_end().to_owned()
    };
    fixed.iter().map(said).collect()
}

/// Returns the values of inputs as `--at` takes them.
fn in_columns(fixed: &[swept::At]) -> String {
    fixed.iter().map(|(name, value)| format!("{name}={value}")).collect::<Vec<_>>().join(", ")
}

/// Returns a note on the values that the user did not choose.
fn note_on_chosen(fixed: &[swept::At], at: &[(String, f64)]) -> Option<String> {
    let is_chosen = |(name, _): &swept::At| at.iter().any(|(given, _)| given == name);
    let chosen: Vec<_> = fixed.iter().filter(|one| !is_chosen(one)).cloned().collect();
    (!chosen.is_empty())
        .then(|| format!("drawn at {}, which most points have: --at chooses another", in_columns(&chosen)))
}

/// Returns a number with four digits.
fn short_number(value: f64) -> String {
    let digits = if value == 0.0 { 0 } else { (3 - value.abs().log10().floor() as i32).max(0) };
    let scale = 10_f64.powi(digits);
    format!("{}", (value * scale).round() / scale).replace('-', "−")
}

fn read_sweep(path: &Path) -> Result<(PathBuf, Swept), PageError> {
    let help = || did_you_mean(path, "name the folder of a sweep, or its table.parquet or table.csv");
    let wrong = |reason: String| PageError::wrong_use(path, reason, help());
    let table = swept::table_of(path).ok_or_else(|| wrong("is no sweep".to_owned()))?;
    let swept = Swept::read(&table).map_err(wrong)?;
    Ok((table, swept))
}

fn wrong_lines(table: &Path, reason: String, swept: &Swept) -> PageError {
    let names =
        |columns: &[swept::Column]| columns.iter().map(|column| column.name.as_str()).collect::<Vec<_>>().join(", ");
    let help = format!("inputs: {}; results: {}", names(&swept.inputs), names(&swept.results));
    PageError::wrong_use(table, reason, help)
}

/// The content of a map.
#[derive(Clone, Debug, Default)]
pub(super) struct Steady {
    /// The steady angles, at different speeds.
    pub known: Vec<AtSpeeds<()>>,
    /// The speeds at which not even the means are known.
    pub unknown: Vec<[f64; 2]>,
    /// Whether they are of a single starting phase at speeds where it matters.
    pub one_phase: bool,
    /// Their source, unless it is the model.
    pub measured: Option<&'static str>,
    /// The robot, if it is known.
    pub maker: Option<Maker>,
    /// The values at which it is drawn, if a sweep has several robots.
    pub varied: Option<String>,
}

/// Returns the steady angles at the speeds of a sweep, for the other inputs that `at` names or that most points have.
pub(super) fn steady(
    path: &Path,
    at: &[(String, f64)],
    (remarks, logs, under): (&mut Remarks, &mut Vec<String>, &mut Vec<String>),
) -> Result<Steady, PageError> {
    let (table, swept) = read_sweep(path)?;
    let wrong = |reason: String| wrong_lines(&table, reason, &swept);
    let column =
        |name: &str| swept.column(name).ok_or_else(|| wrong(format!("has no column {name}, or it does not vary")));
    let [w1, w2] = [column("w1_rpm")?, column("w2_rpm")?];
    let [yaw, pitch, roll, tilt] = [column("yaw_deg")?, column("pitch_deg")?, column("roll_deg")?, column("tilt_deg")?];
    let spreads = ["yaw_spread_deg", "tilt_spread_deg"].map(|name| swept.column(name));
    let spreads: Vec<_> = spreads.into_iter().flatten().collect();
    let (mut rows, fixed) = swept.slice(&["w1_rpm", "w2_rpm"], at).map_err(wrong)?;
    remarks.notes.extend(note_on_chosen(&fixed, at));
    logs.push(Provenance::file("table", &table));
    for line in in_words(&swept, &fixed) {
        if !under.contains(&line) {
            under.push(line);
        }
    }
    let all = rows.len();
    let unknown = rows.iter().filter(|i| swept.is_unknown(**i)).map(|i| [w1.values[*i], w2.values[*i]]).collect();
    rows.retain(|i| yaw.values[*i].is_finite() && !swept.is_unknown(*i));
    if rows.len() < all {
        let left_out = all - rows.len();
        remarks.warnings.push(format!("{left_out} of {all} points are left out: their means are not known"));
    }
    let point = |i: usize| AtSpeeds {
        speeds_rpm: [w1.values[i], w2.values[i]],
        angles_deg: [yaw, pitch, roll].map(|angle| angle.values[i]),
        tilt_deg: tilt.values[i],
        trials: 1,
        is_settled: !spreads.iter().any(|spread| spread.values[i] > MOST_SPREAD_DEG),
        first: (),
    };
    let one_phase = swept.of_one_phase() > 0;
    // If the robot varies, the line below the axes states which of its values are drawn.
    let folder = table.parent().filter(|folder| fixed.is_empty() && is_folder(folder)).map(Folder::open).transpose();
    let folder = folder.map_err(|error| wrong(error.to_string()))?;
    let robot = folder.and_then(|folder| folder.sweep.point(0).robot.ok());
    let maker = robot.map(|robot| Maker { robot, closure: Some(Closure::Full) });
    let varied = (!fixed.is_empty()).then(|| in_columns(&fixed));
    Ok(Steady { known: rows.into_iter().map(point).collect(), unknown, one_phase, measured: None, maker, varied })
}
