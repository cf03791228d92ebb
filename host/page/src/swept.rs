//! The table of a sweep for pages and figures: the inputs that vary, and the results at each point.
//!
//! Inputs are the speeds, and the keys of the robot's file or the groups that vary. In other tables, an input is a column of
//! numbers before the first result, unless it follows from the inputs before it, as lengths follow from groups.

use sim::steady::Kind as Motion;
use sim::steady::phase::Ratio;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use study::export::table::{Table, Values};
use study::sweep;

/// The first column of results; all numbers before it may be inputs.
const FIRST_RESULT: &str = "yaw_deg";

/// Largest difference of an angle between starting phases that a map does not mark, degrees: twice the ± of solutions with
/// contact.
pub(crate) const MOST_SPREAD_DEG: f64 = 0.3;

/// Least number of values of each input of a map with contours, which would show the grid between fewer.
pub(crate) const CONTOUR_NODES: usize = 8;

/// A column of numbers; NaN is a missing value.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Column {
    pub name: String,
    unit: String,
    pub about: String,
    pub values: Vec<f64>,
}

impl Column {
    /// Returns the quantity in words, with its unit: `speed of flagellum 1 (w1), rpm`.
    pub fn label(&self) -> String {
        let words = match self.name.as_str() {
            "w1_rpm" => "speed of flagellum 1 (w1)".to_owned(),
            "w2_rpm" => "speed of flagellum 2 (w2)".to_owned(),
            name => without_unit(name).replace('_', " ").replace("young", "Young's modulus"),
        };
        let unit = match self.unit.as_str() {
            "deg" => "°",
            "N m" => "N·m",
            unit => unit,
        };
        if unit.is_empty() || unit == "1" { words } else { format!("{words}, {unit}") }
    }
}

/// Returns the name of a column without the unit at its end.
fn without_unit(name: &str) -> &str {
    let units = ["_deg", "_rpm", "_nm_per_rad", "_nm2", "_nm", "_pa_s", "_pa", "_n", "_m", "_s", "_w"];
    units.iter().find_map(|unit| name.strip_suffix(unit)).unwrap_or(name)
}

/// The kinds of motions, from the steadiest. Pages and figures read the index.
pub(crate) const MOTIONS: [Motion; 4] = [Motion::Steady, Motion::Beating, Motion::NotFound, Motion::Overturned];

/// Returns the table of a sweep: the file itself, or the table in the folder of a sweep; `None` for anything else.
pub(crate) fn table_of(path: &Path) -> Option<PathBuf> {
    let is_table = path.extension().is_some_and(|extension| extension == "parquet" || extension == "csv");
    match path.is_dir() {
        true => sweep::is_folder(path).then(|| sweep::parquet_path(path)),
        false => is_table.then(|| path.to_owned()),
    }
}

/// A sweep's table.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Swept {
    /// Lines about the whole table.
    pub header: Vec<String>,
    /// The quantities that vary by themselves.
    pub inputs: Vec<Column>,
    /// The results of the model.
    pub results: Vec<Column>,
    /// The index in [`MOTIONS`] of each row's steady state; -1 if the point failed or the table does not state it.
    pub states: Vec<i64>,
}

/// A name of an input, and its value.
pub(crate) type At = (String, f64);

impl Swept {
    /// Reads a table.
    ///
    /// # Errors
    /// Why it is not a sweep's table: it cannot be read, has no results, or has less than two inputs.
    pub fn read(path: &Path) -> Result<Self, String> {
        let table = sweep::columns_of(path)?;
        let (header, states) = (table.header.clone(), states(&table));
        let mut before = numeric(table);
        let at = before.iter().position(|column| column.name == FIRST_RESULT);
        let results = before.split_off(at.ok_or_else(|| format!("it has no column {FIRST_RESULT}"))?);
        let inputs: Vec<Column> = inputs(&before).into_iter().cloned().collect();
        if inputs.len() < 2 {
            return Err("fewer than two inputs vary".to_owned());
        }
        Ok(Self { header, inputs, results, states })
    }

    /// Returns whether not even the means of a point are known.
    pub fn is_unknown(&self, row: usize) -> bool {
        usize::try_from(self.states[row]).is_ok_and(|state| MOTIONS[state] >= Motion::NotFound)
    }

    /// Returns the number of points with a single starting phase of the flagella at speeds where other phases may give other
    /// values.
    pub fn of_one_phase(&self) -> usize {
        let [Some(w1), Some(w2), Some(phases)] = ["w1_rpm", "w2_rpm", "phases"].map(|name| self.column(name)) else {
            return 0;
        };
        // A point that failed has no phases.
        let has_more = phases.values.iter().any(|number| *number > 1.0);
        let is_one = |i: &usize| phases.values[*i] <= 1.0 && Ratio::of([w1.values[*i], w2.values[*i]]).is_some();
        if has_more { 0 } else { (0..self.rows()).filter(is_one).count() }
    }

    /// Returns the number of points.
    pub fn rows(&self) -> usize {
        self.states.len()
    }

    /// Returns the input or the result with this name.
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.inputs.iter().chain(&self.results).find(|column| column.name == name)
    }

    /// Returns the rows in which every input outside `free` has its value in `fixed`, or else the value that most of the
    /// remaining points have; and these values.
    ///
    /// # Errors
    /// Why there are none.
    pub fn slice(&self, free: &[&str], fixed: &[At]) -> Result<(Vec<usize>, Vec<At>), String> {
        let names = || self.inputs.iter().map(|input| input.name.as_str()).collect::<Vec<_>>().join(", ");
        if let Some((name, _)) = fixed.iter().find(|(name, _)| !self.inputs.iter().any(|input| input.name == *name)) {
            return Err(format!("{name} is no input of the sweep: {}", names()));
        }
        if let Some((name, _)) = fixed.iter().find(|(name, _)| free.contains(&name.as_str())) {
            return Err(format!("{name} has no single value: it is drawn"));
        }
        if let Some((name, _)) =
            fixed.iter().enumerate().find_map(|(i, at)| fixed[..i].iter().any(|other| other.0 == at.0).then_some(at))
        {
            return Err(format!("{name} is given twice"));
        }
        let others: Vec<&Column> = self.inputs.iter().filter(|input| !free.contains(&input.name.as_str())).collect();
        let given = |input: &Column| fixed.iter().find(|(name, _)| *name == input.name).map(|(_, value)| *value);
        let mut rows: Vec<usize> = (0..self.rows()).collect();
        let mut said = Vec::new();
        for input in &others {
            let Some(value) = given(input) else { continue };
            let before = std::mem::take(&mut rows);
            rows = before.iter().copied().filter(|i| is_same(input.values[*i], value)).collect();
            if rows.is_empty() {
                let has: Vec<f64> = before.iter().map(|i| input.values[*i]).collect();
                return Err(format!("no point has {} = {value}; the sweep has {}", input.name, few(&has)));
            }
        }
        // Each other input has the value that most of these points have.
        for input in &others {
            let value = match given(input) {
                Some(value) => value,
                None => {
                    let (value, count) = commonest(rows.iter().map(|i| input.values[*i]));
                    if count == 1 && rows.len() > MOST_SCATTERED {
                        return Err(format!(
                            "{} has another value at each point, so that none can be drawn alone",
                            input.name
                        ));
                    }
                    rows.retain(|i| is_same(input.values[*i], value));
                    value
                }
            };
            said.push((input.name.clone(), value));
        }
        Ok((rows, said))
    }
}

/// Returns the distinct values, or the first and the last of many.
fn few(values: &[f64]) -> String {
    const FEW: usize = 12;
    let mut sorted: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup_by(|a, b| is_same(*a, *b));
    match sorted.as_slice() {
        [first, .., last] if sorted.len() > FEW => format!("{} values from {first} to {last}", sorted.len()),
        all => all.iter().map(f64::to_string).collect::<Vec<_>>().join(", "),
    }
}

/// Compares seven digits: results of the same inputs may differ in the others.
pub(crate) fn is_same(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-6 * a.abs().max(b.abs())
}

/// More points than this without a common value are scattered.
const MOST_SCATTERED: usize = 6;

/// Returns the most frequent value and its number of points; of equally frequent values the middle one. In a sweep of one input
/// at a time, it is the robot's.
fn commonest(values: impl Iterator<Item = f64>) -> (f64, usize) {
    let mut sorted: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let groups: Vec<&[f64]> = sorted.chunk_by(|a, b| is_same(*a, *b)).collect();
    let most = groups.iter().map(|group| group.len()).max().unwrap_or(0);
    let best: Vec<f64> = groups.iter().filter(|group| group.len() == most).map(|group| group[0]).collect();
    (best.get(best.len() / 2).copied().unwrap_or(f64::NAN), most)
}

/// Returns the state of each row.
fn states(table: &Table) -> Vec<i64> {
    let kinds = table.columns.iter().find(|column| column.name == "kind").map(|column| &column.values);
    let index = |kind: &String| MOTIONS.iter().position(|motion| motion.name() == kind).map_or(-1, |i| i as i64);
    if let Some(Values::Text(kinds)) = kinds { kinds.iter().map(index).collect() } else { vec![-1; table.rows()] }
}

/// Returns the inputs, in the order of the columns. If each point of a design has distinct values, a single column distinguishes
/// all points, so the axes of a sweep come first.
fn inputs(columns: &[Column]) -> Vec<&Column> {
    // Seven digits: inputs that are computed, such as groups, may differ in the last ones.
    let distinct = |chosen: &[usize]| {
        let rows = columns.first().map_or(0, |column| column.values.len());
        let point = |i: usize| chosen.iter().map(|k| (columns[*k].values[i] as f32).to_bits()).collect::<Vec<_>>();
        (0..rows).map(point).collect::<HashSet<_>>().len()
    };
    let varying = |is: fn(&Column) -> bool| -> Vec<usize> {
        (0..columns.len()).filter(|k| is(&columns[*k]) && distinct(&[*k]) > 1).collect()
    };
    // A key of the robot's file that varies may be a speed, too.
    let is_key = |column: &Column| column.about == sweep::VARIES;
    let speeds = varying(|column| column.about != sweep::VARIES && ["w1_rpm", "w2_rpm"].contains(&&*column.name));
    let keys = varying(is_key);
    // If a key varies, the groups follow from it. A group is relative to that of the robot `published`.
    let groups = || varying(|column| column.name.starts_with("group_") && column.name.ends_with("_relative"));
    let mut chosen = [speeds, if keys.is_empty() { groups() } else { keys }].concat();
    let mut told = distinct(&chosen).max(1);
    for k in 0..columns.len() {
        let with: Vec<usize> = chosen.iter().copied().chain([k]).collect();
        let tells = distinct(&with);
        if tells > told {
            (told, chosen) = (tells, with);
        }
    }
    chosen.sort_unstable();
    chosen.into_iter().map(|k| &columns[k]).collect()
}

/// Returns the columns of numbers. A text that is not a number becomes NaN, and a column of texts is left out.
fn numeric(table: Table) -> Vec<Column> {
    let finite = |value: f64| if value.is_finite() { value } else { f64::NAN };
    let columns = table.columns.into_iter().map(|column| Column {
        values: column.values.numbers().into_iter().map(finite).collect(),
        name: column.name.into_owned(),
        unit: column.unit.into_owned(),
        about: column.about.into_owned(),
    });
    columns.filter(|column| column.values.iter().any(|value| value.is_finite())).collect()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Two speeds, a length, and a group that follows from the length.
    pub(crate) const TABLE: &str = "# biflag: sweep\npoint,w1_rpm,w2_rpm,length_m,group,same,yaw_deg,tilt_deg,status\n\
                         a,0,10,0.1,1,3,5,1,ok\nb,10,10,0.1,1,3,6,2,ok\nc,0,20,0.1,1,3,7,3,ok\nd,10,20,0.1,1,3,,,failed\n\
                         e,0,10,0.2,2,3,8,1,ok\nf,10,10,0.2,2,3,9,2,ok\ng,0,20,0.2,2,3,7,3,ok\nh,10,20,0.2,2,3,<i>,4,ok\n";

    #[test]
    fn inputs_are_what_varies_by_itself() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sweep.csv");
        std::fs::write(&path, TABLE).unwrap();
        let swept = Swept::read(&path).unwrap();
        let names = |columns: &[Column]| columns.iter().map(|column| column.name.clone()).collect::<Vec<_>>();
        assert_eq!(names(&swept.inputs), ["w1_rpm", "w2_rpm", "length_m"]);
        assert_eq!(names(&swept.results), ["yaw_deg", "tilt_deg"]);
        let yaw = &swept.results[0].values;
        assert!(yaw[3].is_nan() && yaw[7].is_nan());
        // The longer flagella are the middle one of equals.
        let (rows, at) = swept.slice(&["w1_rpm", "w2_rpm"], &[]).unwrap();
        assert_eq!((rows, at), (vec![4, 5, 6, 7], vec![("length_m".to_owned(), 0.2)]));
        let (rows, _) = swept.slice(&["w1_rpm"], &[("length_m".to_owned(), 0.1), ("w2_rpm".to_owned(), 20.0)]).unwrap();
        assert_eq!(rows, [2, 3]);
        let refused = |name: &str, value| swept.slice(&["w1_rpm"], &[(name.to_owned(), value)]).unwrap_err();
        assert_eq!(refused("width", 1.0), "width is no input of the sweep: w1_rpm, w2_rpm, length_m");
        assert_eq!(refused("length_m", 3.0), "no point has length_m = 3; the sweep has 0.1, 0.2");
        assert_eq!(refused("w1_rpm", 0.0), "w1_rpm has no single value: it is drawn");
    }
}
