//! A table of numbers, and the states of the robot in its rows.

use super::mapping::{Place, Value};
use super::{ImportError, Mapping, Quantity};
use crate::attitude::{Unwrap, euler_deg, rotation};
use crate::text::hex;
use biflag_log::ImportMeta;
use sha2::{Digest, Sha256};
use std::path::Path;

/// Cells that mean a missing value.
const EMPTY: [&str; 5] = ["", "nan", "na", "null", "none"];

/// Largest deviation of a quaternion's length from one.
const QUATERNION: f64 = 0.05;

/// Fastest shaft, rpm. A faster change is an angle that wraps after a turn.
const FASTEST_RPM: f64 = 200.0;

/// The state of the robot at a time.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct State {
    /// Time, s.
    pub time_s: f64,
    /// Yaw (unwrapped), pitch and roll.
    pub angles_deg: [f64; 3],
    /// Speeds of the flagella, if they were measured.
    pub speed_rpm: Option<[f64; 2]>,
    /// Turns of the shafts, if they were measured.
    pub turns: Option<[f64; 2]>,
}

/// The states in the rows of a table, in the order of time.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct States {
    /// The states.
    pub rows: Vec<State>,
    /// The log's record of the table. Its constants are the quantities given as constants, and angles with the same value in all
    /// rows, because programs that do not measure an angle write such columns.
    pub about: ImportMeta,
}

impl States {
    /// Checks states in order of time and unwraps their yaw. For errors, `place` names the row of an index, and `table`
    /// the table.
    ///
    /// # Errors
    /// [`ImportError::Table`] if values are impossible.
    pub fn new(mut rows: Vec<State>, table: &str, place: impl Fn(usize) -> String) -> Result<Self, ImportError> {
        let wrong = |row: usize, reason: String, help| {
            Err(ImportError::table(&format!("{table}, {}", place(row)), reason, help))
        };
        let mut unwrap = Unwrap::default();
        for i in 0..rows.len() {
            let State { time_s, angles_deg: [yaw, pitch, roll], turns, speed_rpm } = rows[i];
            let motors = [turns, speed_rpm].into_iter().flatten().flatten();
            if ![time_s, yaw, pitch, roll].into_iter().chain(motors).all(f64::is_finite) {
                return wrong(i, "a value is not finite".to_owned(), "leave a missing value empty");
            }
            if pitch.abs() > 90.0 || roll.abs() > 180.0 {
                let reason = format!("pitch {pitch}° and roll {roll}° are no z-y'-x'' angles");
                let folded = |deg: f64, most| (0.0..=360.0).contains(&deg) && (deg - 180.0).abs() >= 180.0 - most;
                let help = match folded(pitch, 90.0) && folded(roll, 180.0) {
                    true => "angles from 0 to 360 are folded: subtract 360 from each pitch and roll above 180",
                    false => "check the units; for another order of angles, give a quaternion: qw, qx, qy, qz",
                };
                return wrong(i, reason, help);
            }
            rows[i].angles_deg[0] = unwrap.next(yaw);
            let Some(before) = i.checked_sub(1).map(|before| rows[before]) else { continue };
            if time_s <= before.time_s {
                let reason = format!("the time {time_s} s follows {} s", before.time_s);
                return wrong(i, reason, "sort the rows by time, each time once");
            }
            if let (Some(turns), Some(last)) = (turns, before.turns)
                && let Some(k) = [0, 1]
                    .into_iter()
                    .find(|k| (turns[*k] - last[*k]).abs() / (time_s - before.time_s) > FASTEST_RPM / 60.0)
            {
                let reason = format!("turns{} goes from {:.3} to {:.3} turns", k + 1, last[k], turns[k]);
                return wrong(i, reason, "check the unit; angles of shafts must go on after a full turn");
            }
        }
        if rows.len() < 2 {
            let reason = format!("has {} rows with all values", rows.len());
            return Err(ImportError::table(table, reason, "name another table"));
        }
        let is_constant = |k: &usize| rows.iter().all(|row| row.angles_deg[*k] == rows[0].angles_deg[*k]);
        let constant = (0..3).filter(is_constant).map(|k| ["yaw", "pitch", "roll"][k].to_owned()).collect();
        let is_next = |k: usize| rows.iter().all(|row| row.angles_deg[k] == row.angles_deg[(k + 1) % 3]);
        if (0..3).any(|k| !is_constant(&k) && is_next(k)) {
            return Err(ImportError::table(table, "two of its angles are the same in all rows", "name another column"));
        }
        let has_motors = rows.iter().all(|row| row.turns.is_some() || row.speed_rpm.is_some());
        Ok(Self { rows, about: ImportMeta { constant, has_motors, ..ImportMeta::default() } })
    }
}

/// A table of numbers as text.
#[derive(Clone, Debug)]
pub struct Table {
    name: String,
    /// Names of the columns; empty if the table has none.
    pub header: Vec<String>,
    /// Line and cells of each row.
    rows: Vec<(u64, Vec<String>)>,
    sha256: String,
}

impl Table {
    /// Reads a file with a comma, semicolon or tab between the cells. Lines that begin with `#` are comments. The first line
    /// holds the names of the columns, unless all its cells are numbers. Column numbers, which programs write instead of names,
    /// count as names, too. `skip`: number of lines before the table.
    ///
    /// # Errors
    /// [`ImportError::Read`], [`ImportError::Table`].
    pub fn read(path: &Path, skip: usize) -> Result<Self, ImportError> {
        let bytes = std::fs::read(path).map_err(|source| ImportError::Read { path: path.to_owned(), source })?;
        let name = path.display().to_string();
        let text = std::str::from_utf8(&bytes).map_err(|_| {
            ImportError::table(&name, "is no text in UTF-8", "write the table as CSV in UTF-8, which every program can")
        })?;
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        // Empty lines in place of the skipped ones keep the line numbers right.
        let text = "\n".repeat(skip) + text.splitn(skip + 1, '\n').nth(skip).unwrap_or_default();
        let mut rows = Vec::new();
        let mut format = csv::ReaderBuilder::new();
        let mut reader =
            format.delimiter(delimiter(&text)).comment(Some(b'#')).has_headers(false).from_reader(text.as_bytes());
        for record in reader.records() {
            let help = "decimal commas? write points, or separate columns with ;. Lines before the table? --skip leaves them out";
            let record = record.map_err(|error| ImportError::table(&name, error.to_string(), help))?;
            let line = record.position().map_or(0, |position| line_of(text.as_bytes(), position));
            rows.push((line, record.iter().map(|cell| cell.trim().to_owned()).collect::<Vec<_>>()));
        }
        if rows.is_empty() {
            return Err(ImportError::table(&name, "is empty", "name a table in the format CSV"));
        }
        // Numbers with decimal commas are not names, although they cannot be read.
        let is_number = |cell: &String| is_empty(cell) || cell.replace(',', ".").parse::<f64>().is_ok();
        let header = match rows.first() {
            Some((_, cells)) if !cells.iter().all(is_number) || is_numbering(cells) => rows.remove(0).1,
            _ => Vec::new(),
        };
        Ok(Self { name, header, rows, sha256: hex(&Sha256::digest(&bytes)) })
    }

    /// Returns the states of the rows. A row without a value is left out.
    ///
    /// # Errors
    /// [`ImportError::Columns`] if a column is missing, [`ImportError::Table`] if a cell is not a number or a value is
    /// impossible.
    pub fn states(&self, mapping: &Mapping) -> Result<States, ImportError> {
        let columns = mapping.values.iter().map(|value| self.column(value)).collect::<Result<Vec<_>, _>>()?;
        let (mut states, mut lines) = (Vec::new(), Vec::new());
        for (line, cells) in &self.rows {
            let mut values = Vec::with_capacity(columns.len());
            for (value, column) in mapping.values.iter().zip(&columns) {
                values.push(self.value(value, *column, *line, cells)?);
            }
            let of = |quantity: Quantity| {
                let at = mapping.values.iter().position(|value| value.quantity == quantity);
                at.and_then(|at| values[at])
            };
            if values.iter().all(Option::is_some) {
                states.push(self.state(*line, of)?);
                lines.push(*line);
            }
        }
        let left_out = (self.rows.len() - states.len()) as u64;
        let States { rows, about } = States::new(states, &self.name, |row| format!("line {}", lines[row]))?;
        let source = Path::new(&self.name).file_name().map_or_else(String::new, |name| name.to_string_lossy().into());
        let columns = mapping.to_string();
        let given = mapping.constants().into_iter().filter(|name| !about.constant.contains(name));
        let constant = [about.constant.clone(), given.collect()].concat();
        let source_sha256 = self.sha256.clone();
        Ok(States { rows, about: ImportMeta { left_out, constant, columns, source, source_sha256, ..about } })
    }

    fn state(&self, line: u64, of: impl Fn(Quantity) -> Option<f64>) -> Result<State, ImportError> {
        let both = |of: [Option<f64>; 2]| of[0].zip(of[1]).map(|(one, two)| [one, two]);
        let angles_deg = match [0, 1, 2, 3].map(|part| of(Quantity::Quaternion(part))) {
            [Some(w), Some(x), Some(y), Some(z)] => {
                let length = [w, x, y, z].into_iter().map(|part| part * part).sum::<f64>().sqrt();
                if (length - 1.0).abs() > QUATERNION {
                    let reason = format!("a quaternion of length {length:.3} is no attitude");
                    let help = "check the columns qw, qx, qy, qz";
                    return Err(ImportError::table(&format!("{}, line {line}", self.name), reason, help));
                }
                euler_deg(&rotation([w, x, y, z]))
            }
            _ => [0, 1, 2].map(|angle| of(Quantity::Angle(angle)).unwrap_or(f64::NAN)),
        };
        Ok(State {
            time_s: of(Quantity::Time).unwrap_or(f64::NAN),
            angles_deg,
            speed_rpm: both([0, 1].map(|k| of(Quantity::Speed(k)))),
            turns: both([0, 1].map(|k| of(Quantity::Turns(k)))),
        })
    }

    /// Returns the number of a value's column; `None` for a constant.
    fn column(&self, value: &Value) -> Result<Option<usize>, ImportError> {
        let name = match &value.from {
            Place::Constant(_) => return Ok(None),
            Place::Number(number) => return Ok(Some(*number)),
            Place::Named(name) => name,
        };
        let named: Vec<usize> = (0..self.header.len()).filter(|i| self.header[*i] == *name).collect();
        let (what, help) = match named.as_slice() {
            [one] => return Ok(Some(*one)),
            [] if self.header.is_empty() => {
                ("no names of columns".to_owned(), "name the columns by their numbers: time=#1".to_owned())
            }
            [] => (format!("no column {name}"), format!("its columns are {}", self.header.join(", "))),
            all => (format!("{} columns {name}", all.len()), "name the column by its number: time=#1".to_owned()),
        };
        Err(ImportError::columns(format!("{} has {what}", self.name), help))
    }

    /// Returns a value in the quantity's first unit; `None` if the cell is empty.
    fn value(
        &self,
        value: &Value,
        column: Option<usize>,
        line: u64,
        cells: &[String],
    ) -> Result<Option<f64>, ImportError> {
        let Some(column) = column else {
            let Place::Constant(constant) = value.from else { return Ok(None) };
            return Ok(Some(constant * value.factor));
        };
        let (reason, help) = match cells.get(column).map(|cell| (cell, cell.parse::<f64>())) {
            Some((cell, _)) if is_empty(cell) => return Ok(None),
            Some((_, Ok(number))) => return Ok(Some(number * value.factor)),
            Some((cell, Err(_))) => (
                format!("{cell:?} for {} is not a number", value.name),
                "write numbers with a decimal point; leave a missing value empty",
            ),
            None => (
                format!("has {} columns, so no column {} for {}", cells.len(), column + 1, value.name),
                "check the numbers of the columns",
            ),
        };
        Err(ImportError::table(&format!("{}, line {line}", self.name), reason, help))
    }
}

/// Returns the line of the record at a position, which may be before the end of the last line, and before comments and empty
/// lines.
fn line_of(text: &[u8], position: &csv::Position) -> u64 {
    let mut line = position.line();
    let mut rest = text.get(position.byte() as usize..).unwrap_or_default();
    while let Some(skipped) = match rest.first() {
        Some(b'#') => rest.iter().position(|byte| *byte == b'\n'),
        Some(b'\n' | b'\r') => Some(0),
        _ => None,
    } {
        line += u64::from(rest[skipped] == b'\n');
        rest = &rest[skipped + 1..];
    }
    line
}

/// Returns whether the cells number the columns, from 0 or 1.
fn is_numbering(cells: &[String]) -> bool {
    let counts = |from: usize| cells.iter().enumerate().all(|(i, cell)| *cell == (i + from).to_string());
    cells.len() > 1 && (counts(0) || counts(1))
}

fn is_empty(cell: &str) -> bool {
    EMPTY.contains(&cell.to_lowercase().as_str())
}

/// Returns the separator: tab, semicolon or comma, whichever comes first with equal counts in the first two lines; otherwise
/// the most frequent one of the first line. A comma may be a decimal sign, and a semicolon may be part of a name.
fn delimiter(text: &str) -> u8 {
    let is_content = |line: &&str| !line.trim().is_empty() && !line.starts_with('#');
    let mut lines = text.lines().filter(is_content);
    let [first, second] = [lines.next(), lines.next()].map(Option::unwrap_or_default);
    let times = |line: &str, separator: char| {
        let unquoted = line.split('"').step_by(2);
        unquoted.flat_map(str::chars).filter(|one| *one == separator).count()
    };
    let is_regular = |separator: &char| {
        let count = times(first, *separator);
        count > 0 && (second.is_empty() || times(second, *separator) == count)
    };
    let regular = ['\t', ';', ','].into_iter().find(is_regular);
    // On a tie, the last one: the comma.
    let frequent = || ['\t', ';', ','].into_iter().max_by_key(|separator| times(first, *separator));
    regular.or_else(frequent).map_or(b',', |separator| separator as u8)
}
