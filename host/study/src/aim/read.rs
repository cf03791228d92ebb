//! Reads tables of steady states: the shipped map, and tables of `biflag sweep`.

use super::error::AimError;
use super::quantity::Attitude;
use super::table::{Row, Table};
use crate::{export, sweep};
use sim::functions::{ln, powi};
use sim::params::Robot;
use std::path::Path;

/// The map of the robot `physical` as CSV; its first lines say which command wrote it.
pub const MAP: &str = include_str!("map.csv");

/// Columns of a sweep's robots that follow from other columns. They do not count in the distance between two robots.
const DERIVED: [&str; 2] = ["contour_length_m", "bend_nm2"];

/// Robots are the same, except for rounding, if their distances differ by no more than this.
const SAME: f64 = 1e-6;

/// Returns the shipped map of the robot `physical`.
///
/// # Errors
/// None in a release: a test reads the map.
pub fn shipped() -> Result<Table, AimError> {
    let rows = sweep::of_csv(MAP).and_then(|map| rows(&numbers(&map), &Robot::default()));
    of_rows(rows, Path::new("map.csv"))
}

/// Reads a table, CSV or Parquet. From a table with several robots it takes the states of the one nearest to `robot`,
/// by the sum of the squared logarithms of the parameters' ratios.
///
/// # Errors
/// [`AimError::Table`] and [`AimError::TooSmall`].
pub fn load(path: &Path, robot: &Robot) -> Result<Table, AimError> {
    of_rows(sweep::columns_of(path).and_then(|table| rows(&numbers(&table), robot)), path)
}

/// Returns the table of columns that are already in memory, such as the columns of a sweep; see [`load`].
///
/// # Errors
/// [`AimError::Table`] and [`AimError::TooSmall`].
pub fn of_columns(columns: &Columns, robot: &Robot) -> Result<Table, AimError> {
    of_rows(rows(columns, robot), Path::new("table"))
}

/// Returns the table of these rows of the file `path`, or the error that explains why there are none.
fn of_rows(rows: Result<Vec<Row>, String>, path: &Path) -> Result<Table, AimError> {
    Table::new(rows.map_err(|reason| AimError::Table { path: path.to_owned(), reason })?)
}

/// Columns of numbers with their names, of equal length. A missing value is NaN.
pub type Columns = Vec<(String, Vec<f64>)>;

fn numbers(table: &export::table::Table) -> Columns {
    table.columns.iter().map(|column| (column.name.to_string(), column.values.numbers())).collect()
}

/// Returns the rows of the nearest robot, without those whose attitude is missing.
fn rows(columns: &Columns, robot: &Robot) -> Result<Vec<Row>, String> {
    let column = |name: &str| columns.iter().find(|(other, _)| other == name).map(|(_, values)| values);
    let needed = |name: &str| column(name).ok_or_else(|| format!("it has no column {name}"));
    let needed = [needed("w1_rpm")?, needed("w2_rpm")?, needed("yaw_deg")?, needed("pitch_deg")?, needed("roll_deg")?];
    let [force1, force2, contact] = ["force1_z_n", "force2_z_n", "contact_share"].map(column);
    let robots: Vec<(&Vec<f64>, f64)> = (sweep::ROBOT.iter())
        .filter(|(name, ..)| !DERIVED.contains(name))
        .filter_map(|(name, .., value)| Some((column(name)?, value(robot))))
        .collect();
    let unlike = |i: usize| -> f64 {
        let ratios = robots.iter().map(|(values, own)| powi(ln(values[i] / own), 2));
        ratios.filter(|square| square.is_finite()).sum()
    };
    let whole = (0..needed[0].len()).filter(|i| needed.iter().all(|values| values[*i].is_finite()));
    let found: Vec<(f64, Row)> = whole
        .map(|i| {
            let [w1, w2, yaw_deg, pitch_deg, roll_deg] = needed.map(|values| values[i]);
            let thrust_n = [force1, force2].into_iter().flatten().map(|values| values[i]).sum();
            let contact_share = contact.map(|values| values[i]).filter(|share| share.is_finite());
            let attitude = Attitude { yaw_deg, pitch_deg, roll_deg, thrust_n };
            (unlike(i), Row { rpm: [w1, w2], attitude, contact_share })
        })
        .collect();
    let nearest = found.iter().map(|(unlike, _)| *unlike).fold(f64::INFINITY, f64::min);
    Ok(found.into_iter().filter(|(unlike, _)| *unlike <= nearest + SAME).map(|(_, row)| row).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aim::quantity::Quantity;
    use crate::aim::target::Target;

    #[test]
    fn the_shipped_map_is_whole_and_mirrored() {
        let table = shipped().unwrap();
        let at = |w1: f64, w2: f64| table.rows.iter().find(|row| row.rpm == [w1, w2]).unwrap().attitude;
        let (one, other) = (at(50.0, 10.0), at(10.0, 50.0));
        assert!(one.pitch_deg < -3.0 && one.yaw_deg < -60.0, "{one:?}");
        assert_eq!(
            (one.yaw_deg, one.pitch_deg, one.roll_deg, one.thrust_n),
            (other.yaw_deg, -other.pitch_deg, -other.roll_deg, other.thrust_n)
        );
        assert!(table.rows.iter().any(|row| row.touches() == Some(true)));
        // Values are right between the rows, too.
        let between = table.about([35.0, 5.0]).at([35.0, 5.0]);
        let rows = [at(30.0, 0.0), at(30.0, 10.0), at(40.0, 0.0), at(40.0, 10.0)];
        let mean = rows.iter().map(|row| row.yaw_deg).sum::<f64>() / 4.0;
        assert!((between.yaw_deg - mean).abs() < 0.5, "{between:?}, {mean}");
    }

    #[test]
    fn of_several_robots_the_nearest_counts() {
        let mut text = "# a sweep\nw1_rpm,w2_rpm,viscosity_pa_s,yaw_deg,pitch_deg,roll_deg,status\n".to_owned();
        for (viscosity, yaw) in [(1.0, 1.0), (1.2, 2.0)] {
            for (w1, w2) in (0..4).flat_map(|i| (0..4).map(move |j| (10.0 * f64::from(i), 10.0 * f64::from(j)))) {
                text += &format!("{w1},{w2},{viscosity},{},{},0,ok\n", yaw * (w1 + w2), w1 - w2);
            }
        }
        text += "90,90,1.0,,,,failed\n";
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table.csv");
        std::fs::write(&path, text).unwrap();
        let mut robot = Robot::default();
        robot.fluid.viscosity_pa_s = 1.15;
        let table = load(&path, &robot).unwrap();
        assert_eq!(table.rows.len(), 16);
        let target = Target { wanted: vec![(Quantity::Yaw, 61.0), (Quantity::Pitch, 9.0)] };
        assert_eq!(table.nearest(&target)[0].rpm, [20.0, 10.0]);
        let local = table.about([20.0, 10.0]);
        let [dw1, dw2] = [0, 1].map(|k| local.derivatives(&target, 1.0)[(0, k)]);
        assert!((dw1 - 2.0).abs() < 1e-6 && (dw2 - 2.0).abs() < 1e-6, "{dw1} {dw2}");
    }

    #[test]
    fn what_is_no_table_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in [("a.csv", "w1_rpm,w2_rpm\n1,2\n"), ("a.parquet", "no"), ("b.csv", "")] {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            assert!(matches!(load(&path, &Robot::default()), Err(AimError::Table { .. })), "{name}");
        }
        let path = folder.path().join("c.csv");
        std::fs::write(&path, "w1_rpm,w2_rpm,yaw_deg,pitch_deg,roll_deg\n1,2,3,4,5\n").unwrap();
        assert!(matches!(load(&path, &Robot::default()), Err(AimError::TooSmall { rows: 2 })));
    }
}
