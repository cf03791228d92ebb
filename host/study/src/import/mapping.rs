//! Maps columns of a table to quantities, with their units and signs.

use super::ImportError;
use std::f64::consts::TAU;
use std::fmt;
use std::str::FromStr;

/// A quantity of a trial.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Quantity {
    /// Time.
    Time,
    /// Yaw, pitch and roll (0 to 2): z-y'-x'' angles of the body in the world.
    Angle(usize),
    /// Part w, x, y or z (0 to 3) of the unit quaternion that rotates body axes into world axes.
    Quaternion(usize),
    /// Speed of flagellum 1 or 2 (0, 1).
    Speed(usize),
    /// Turns of shaft 1 or 2 (0, 1) from any starting point.
    Turns(usize),
}

/// Units of a quantity, each with its factor to the first unit.
type Units = &'static [(&'static str, f64)];

/// Name, quantity and units.
const QUANTITIES: [(&str, Quantity, Units); 12] = [
    ("time", Quantity::Time, TIME),
    ("yaw", Quantity::Angle(0), ANGLE),
    ("pitch", Quantity::Angle(1), ANGLE),
    ("roll", Quantity::Angle(2), ANGLE),
    ("qw", Quantity::Quaternion(0), NUMBER),
    ("qx", Quantity::Quaternion(1), NUMBER),
    ("qy", Quantity::Quaternion(2), NUMBER),
    ("qz", Quantity::Quaternion(3), NUMBER),
    ("w1", Quantity::Speed(0), SPEED),
    ("w2", Quantity::Speed(1), SPEED),
    ("turns1", Quantity::Turns(0), TURNS),
    ("turns2", Quantity::Turns(1), TURNS),
];

const TIME: Units = &[("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("min", 60.0)];
const ANGLE: Units = &[("deg", 1.0), ("rad", 360.0 / TAU)];
const NUMBER: Units = &[("1", 1.0)];
const SPEED: Units = &[("rpm", 1.0), ("rps", 60.0), ("deg/s", 1.0 / 6.0), ("rad/s", 60.0 / TAU)];
const TURNS: Units = &[("turns", 1.0), ("deg", 1.0 / 360.0), ("rad", 1.0 / TAU)];

/// The source of a quantity's value.
#[derive(Clone, PartialEq, Debug)]
pub(super) enum Place {
    /// A column with this name.
    Named(String),
    /// A column by its number, from 0.
    Number(usize),
    /// The same value in every row.
    Constant(f64),
}

/// The value of a quantity: its source, sign and unit.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Value {
    pub quantity: Quantity,
    pub name: &'static str,
    pub from: Place,
    /// Factor that converts the table's value to the quantity's first unit.
    pub factor: f64,
    unit: &'static str,
}

/// The mapping of columns to quantities: `time=t,yaw=-psi:rad,pitch=theta,roll=#4,w1=speed1`.
///
/// A minus reverses the sign. A unit follows a colon; without it, times are in s, angles in degrees, speeds in rpm and
/// angles of shafts in turns. `#4` is the fourth column, and a number is a constant for all rows.
#[derive(Clone, PartialEq, Debug)]
pub struct Mapping {
    pub(super) values: Vec<Value>,
}

impl FromStr for Mapping {
    type Err = ImportError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let mut values: Vec<Value> = Vec::new();
        for part in text.split(',') {
            let value: Value = part.trim().parse()?;
            if values.iter().any(|other| other.quantity == value.quantity) {
                return Err(ImportError::columns(format!("{} is named twice", value.name), "name each quantity once"));
            }
            values.push(value);
        }
        let mapping = Self { values };
        mapping.check()?;
        Ok(mapping)
    }
}

impl Mapping {
    pub(super) fn has(&self, quantity: Quantity) -> bool {
        self.values.iter().any(|value| value.quantity == quantity)
    }

    fn check(&self) -> Result<(), ImportError> {
        let missing = |quantity: Quantity| !self.has(quantity);
        let wrong = |reason: String, help: &str| Err(ImportError::columns(reason, help));
        let (angles, quaternion) = ([0, 1, 2].map(Quantity::Angle), [0, 1, 2, 3].map(Quantity::Quaternion));
        let has_quaternion = !quaternion.iter().all(|part| missing(*part));
        if has_quaternion && !missing(Quantity::Time) && !angles.iter().all(|angle| missing(*angle)) {
            let help = "name either yaw, pitch and roll, or qw, qx, qy and qz";
            return wrong("the attitude is given twice".to_owned(), help);
        }
        let parts = if has_quaternion { &quaternion[..] } else { &angles[..] };
        if let Some(quantity) = [Quantity::Time].iter().chain(parts).find(|part| missing(**part)) {
            let help = "for example time=t,yaw=yaw,pitch=pitch,roll=roll; an angle that was not measured is given as a number: \
                        roll=0";
            return wrong(format!("{} is missing", name_of(*quantity)), help);
        }
        for k in [0, 1] {
            for of in [Quantity::Speed as fn(usize) -> Quantity, Quantity::Turns] {
                if !missing(of(k)) && missing(of(1 - k)) {
                    let [given, partner] = [of(k), of(1 - k)].map(name_of);
                    let help = format!("name both, or give {partner} as a number");
                    return wrong(format!("{given} is given without {partner}"), &help);
                }
            }
        }
        if !missing(Quantity::Speed(0)) && !missing(Quantity::Turns(0)) {
            let help = "name w1 and w2, or turns1 and turns2";
            return wrong("the motion of the motors is given twice".to_owned(), help);
        }
        Ok(())
    }

    /// Returns the quantities that have the same value in every row.
    pub(super) fn constants(&self) -> Vec<String> {
        let is_constant = |value: &&Value| matches!(value.from, Place::Constant(_));
        self.values.iter().filter(is_constant).map(|value| value.name.to_owned()).collect()
    }
}

impl FromStr for Value {
    type Err = ImportError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let wrong = |reason: String, help: &str| Err(ImportError::columns(reason, help));
        let names = || QUANTITIES.map(|(name, ..)| name).join(", ");
        let Some((name, source)) = text.split_once('=') else {
            let help = format!("write QUANTITY=COLUMN for each; the quantities are {}", names());
            return wrong(format!("{text:?} names no column"), &help);
        };
        let found = QUANTITIES.into_iter().find(|(known, ..)| *known == name.trim());
        let Some((name, quantity, units)) = found else {
            return wrong(format!("{:?} is no quantity", name.trim()), &format!("one of {}", names()));
        };
        let source = source.trim();
        let (sign, column) = source.strip_prefix('-').map_or((1.0, source), |rest| (-1.0, rest));
        let (column, (unit, factor)) = match column.rsplit_once(':') {
            Some((column, unit)) => match units.iter().find(|(known, _)| *known == unit.trim()) {
                Some(unit) => (column.trim(), *unit),
                None => {
                    let known: Vec<_> = units.iter().map(|(name, _)| *name).collect();
                    return wrong(format!("{unit:?} is no unit of {name}"), &format!("one of {}", known.join(", ")));
                }
            },
            None => (column, units[0]),
        };
        let from = if let Ok(value) = column.parse::<f64>() {
            if !value.is_finite() || quantity == Quantity::Time {
                return wrong(format!("{name} cannot be {value}"), "name its column");
            }
            Place::Constant(value)
        } else if let Some(number) = column.strip_prefix('#') {
            match number.parse::<usize>() {
                Ok(number) if number > 0 => Place::Number(number - 1),
                _ => return wrong(format!("{column:?} is no column"), "the first column is #1"),
            }
        } else if column.is_empty() {
            return wrong(format!("{name} names no column"), "write the name of the column after =");
        } else {
            Place::Named(column.to_owned())
        };
        Ok(Self { quantity, name, from, factor: sign * factor, unit })
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sign = if self.factor < 0.0 { "-" } else { "" };
        write!(f, "{}={sign}", self.name)?;
        match &self.from {
            Place::Named(name) => f.write_str(name)?,
            Place::Number(number) => write!(f, "#{}", number + 1)?,
            Place::Constant(value) => write!(f, "{value}")?,
        }
        if self.unit == "1" { Ok(()) } else { write!(f, ":{}", self.unit) }
    }
}

/// The mapping with all units.
impl fmt::Display for Mapping {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let values: Vec<String> = self.values.iter().map(ToString::to_string).collect();
        f.write_str(&values.join(","))
    }
}

fn name_of(quantity: Quantity) -> &'static str {
    QUANTITIES.iter().find(|(_, known, _)| *known == quantity).map_or("", |(name, ..)| name)
}
