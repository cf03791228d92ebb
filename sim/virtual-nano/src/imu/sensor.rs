//! The choice of the board's sensor.

use super::errors::Errors;
use super::sensor_file;
use std::fmt::{self, Display, Formatter};
use std::path::Path;
use std::str::FromStr;

/// The choice of a sensor's errors.
#[derive(Clone, PartialEq, Debug, Default)]
pub enum Sensor {
    /// The errors of [`Errors::ideal`].
    Ideal,
    /// The errors of [`Errors::typical`].
    #[default]
    Typical,
    /// The errors of a file.
    Given(Box<Errors>),
}

impl Sensor {
    /// Returns the errors. The seed is used for drawn ones.
    pub fn errors(&self, seed: u64) -> Errors {
        match self {
            Self::Ideal => Errors::ideal(seed),
            Self::Typical => Errors::typical(seed),
            Self::Given(errors) => Errors::clone(errors),
        }
    }
}

impl Display for Sensor {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Ideal => "ideal",
            Self::Typical => "typical",
            Self::Given(_) => "file",
        })
    }
}

impl FromStr for Sensor {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "ideal" => Ok(Self::Ideal),
            "typical" => Ok(Self::Typical),
            path => sensor_file::read(Path::new(path)).map(|errors| Self::Given(Box::new(errors))).map_err(|problem| {
                let is_alike = |name: &&str| path.starts_with(&name[..1]) && !path.contains('.');
                let alike = ["ideal", "typical"].into_iter().find(is_alike);
                problem + &alike.map_or_else(String::new, |name| format!("; did you mean {name}?"))
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sensor_is_a_name_or_a_file() {
        assert_eq!("typical".parse(), Ok(Sensor::Typical));
        assert_eq!("ideal".parse(), Ok(Sensor::Ideal));
        assert!("idael".parse::<Sensor>().is_err_and(|problem| problem.ends_with("; did you mean ideal?")));
        assert!("/nowhere.toml".parse::<Sensor>().is_err_and(|problem| problem.starts_with("/nowhere.toml: ")));
    }
}
