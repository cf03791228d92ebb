//! A file with the errors of a sensor, TOML. [`EXAMPLE`] has every key with its meaning.

use super::errors::Errors;
use serde_json::{Map, Value, json};
use std::path::Path;

/// A file with every key; `vnano --sensor help` prints it.
pub const EXAMPLE: &str = include_str!("sensor.toml");

/// A key.
struct Key {
    name: &'static str,
    /// Least and largest value: far beyond the data sheet, as a file may describe a broken part.
    range: [f64; 2],
    /// Its numbers in an [`Errors`]: one, three by axis, or nine in rows.
    place: fn(&mut Errors) -> &mut [f64],
}

const fn key(name: &'static str, limit: f64, place: fn(&mut Errors) -> &mut [f64]) -> Key {
    Key { name, range: [-limit, limit], place }
}

const fn positive(name: &'static str, limit: f64, place: fn(&mut Errors) -> &mut [f64]) -> Key {
    Key { name, range: [0.0, limit], place }
}

fn one(x: &mut f64) -> &mut [f64] {
    std::slice::from_mut(x)
}

const KEYS: [Key; 18] = [
    key("gyro_scale", 0.5, |e| &mut e.gyro_scale),
    key("gyro_cross", 0.5, |e| e.gyro_cross.as_flattened_mut()),
    key("gyro_g_dps", 10.0, |e| e.gyro_g_dps.as_flattened_mut()),
    key("gyro_bias_dps", 100.0, |e| &mut e.gyro_bias_dps),
    key("gyro_drift_dps_per_c", 10.0, |e| &mut e.gyro_drift_dps_per_c),
    positive("gyro_noise_dps_per_rt_hz", 1.0, |e| one(&mut e.gyro_noise_dps_per_rt_hz)),
    positive("gyro_walk_dps_per_rt_s", 0.1, |e| one(&mut e.gyro_walk_dps_per_rt_s)),
    positive("gyro_flicker_dps", 1.0, |e| &mut e.gyro_flicker_dps),
    key("accel_scale", 0.5, |e| &mut e.accel_scale),
    key("accel_cross", 0.5, |e| e.accel_cross.as_flattened_mut()),
    key("accel_bias_g", 1.0, |e| &mut e.accel_bias_g),
    key("accel_drift_g_per_c", 0.1, |e| &mut e.accel_drift_g_per_c),
    positive("accel_noise_g_per_rt_hz", 0.1, |e| one(&mut e.accel_noise_g_per_rt_hz)),
    key("mounting_deg", 180.0, |e| &mut e.mounting_deg),
    key("warming_c", 50.0, |e| one(&mut e.warming_c)),
    positive("thermometer_lag_s", 1000.0, |e| one(&mut e.thermometer_lag_s)),
    key("sample_clock_error", 0.2, |e| one(&mut e.sample_clock_error)),
    key("board_clock_error", 0.05, |e| one(&mut e.board_clock_error)),
];

/// Reads a file.
///
/// # Errors
/// A file that cannot be read, and the errors of [`parse`].
pub fn read(path: &Path) -> Result<Errors, String> {
    let named = |problem: String| format!("{}: {problem}", path.display());
    let text = std::fs::read_to_string(path).map_err(|error| named(error.to_string()))?;
    parse(&text).map_err(named)
}

/// Reads the text of a file.
///
/// # Errors
/// A line that is not TOML, or a key that is unknown or has a wrong value.
pub fn parse(text: &str) -> Result<Errors, String> {
    let table: toml::Table = text.parse().map_err(|error: toml::de::Error| {
        let message = error.message().lines().collect::<Vec<_>>().join(", ");
        let before = text.get(..error.span().map_or(0, |span| span.start)).unwrap_or_default();
        format!("line {}: {message}", 1 + before.matches('\n').count())
    })?;
    let mut errors = Errors::white();
    for (name, value) in &table {
        let Some(key) = KEYS.iter().find(|key| key.name == name) else {
            let names: Vec<&str> = KEYS.iter().map(|key| key.name).collect();
            return Err(format!("unknown key {name}; the keys are {}", names.join(", ")));
        };
        key.read(value, &mut errors).map_err(|problem| format!("{name} {problem}"))?;
    }
    Ok(errors)
}

/// Returns the errors by their keys.
pub fn to_json(errors: &Errors) -> Map<String, Value> {
    let mut errors = errors.clone();
    let value = |numbers: &[f64]| match numbers {
        [one] => json!(one),
        [_, _, _] => json!(numbers),
        matrix => json!(matrix.chunks(3).collect::<Vec<_>>()),
    };
    KEYS.iter().map(|key| (key.name.to_owned(), value((key.place)(&mut errors)))).collect()
}

impl Key {
    fn read(&self, value: &toml::Value, errors: &mut Errors) -> Result<(), String> {
        let place = (self.place)(errors);
        let (given, form) = match place.len() {
            1 => (Some(vec![value]), "a number"),
            3 => (three(value), "a list of three numbers, such as [0.0, 0.0, 0.0]"),
            _ => {
                let rows = three(value).and_then(|rows| rows.into_iter().map(three).collect::<Option<Vec<_>>>());
                (
                    rows.map(|rows| rows.concat()),
                    "three lists of three numbers, such as [[0, 0, 0], [0, 0, 0], [0, 0, 0]]",
                )
            }
        };
        let numbers = given.and_then(|given| given.into_iter().map(number).collect::<Option<Vec<_>>>());
        let numbers = numbers.ok_or_else(|| format!("must be {form}"))?;
        let [low, high] = self.range;
        if let Some(wrong) = numbers.iter().find(|number| !(low..=high).contains(*number)) {
            return Err(format!("must be from {low} to {high}, not {wrong}"));
        }
        if let Some((sensor, _)) = self.name.split_once("_cross")
            && numbers.iter().step_by(4).any(|own| *own != 0.0)
        {
            return Err(format!("must have zeros on its diagonal; {sensor}_scale is for these"));
        }
        place.copy_from_slice(&numbers);
        Ok(())
    }
}

fn three(value: &toml::Value) -> Option<Vec<&toml::Value>> {
    value.as_array().filter(|list| list.len() == 3).map(|list| list.iter().collect())
}

fn number(value: &toml::Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_reads_what_it_wrote() {
        for errors in [Errors::typical(4), Errors::ideal(5), Errors::white()] {
            let text = to_json(&errors).iter().map(|(key, value)| format!("{key} = {value}\n")).collect::<String>();
            assert_eq!(parse(&text), Ok(errors));
        }
        assert_eq!(parse(""), Ok(Errors::white()));
    }

    #[test]
    fn the_example_has_every_key_and_other_values_than_the_defaults() {
        let (errors, defaults) = (to_json(&parse(EXAMPLE).unwrap()), to_json(&Errors::white()));
        for (key, default) in defaults {
            assert!(EXAMPLE.contains(&format!("\n{key} = ")), "{key}");
            assert!(errors[&key] != default || key.contains("noise"), "{key}");
        }
        assert_eq!(errors["gyro_cross"][0], json!([0.0, 0.007, -0.01]));
    }

    #[test]
    fn what_is_wrong_is_said_with_its_key() {
        for (text, message) in [
            ("gyro_scale = 0.02", "gyro_scale must be a list of three numbers, such as [0.0, 0.0, 0.0]"),
            ("gyro_scale = [0.02, 0.1]", "gyro_scale must be a list of three numbers"),
            ("gyro_scale = [0.02, 0.1, 2]", "gyro_scale must be from -0.5 to 0.5, not 2"),
            ("accel_bias_g = [nan, 0, 0]", "accel_bias_g must be from -1 to 1, not NaN"),
            ("gyro_noise_dps_per_rt_hz = -1e-3", "gyro_noise_dps_per_rt_hz must be from 0 to 1, not -0.001"),
            ("warming_c = \"2\"", "warming_c must be a number"),
            ("gyro_g_dps = [0, 0, 0]", "gyro_g_dps must be three lists of three numbers"),
            ("accel_cross = [[0, 0, 0], [0, 0, 0], [0, 0, 0.01]]", "diagonal; accel_scale is for these"),
            ("gyro_bias = [0, 0, 0]", "unknown key gyro_bias; the keys are gyro_scale, gyro_cross"),
            ("warming_c = 1.0\nwarming_c = 2.0", "line 2: duplicate key"),
            ("# axes\n\ngyro_scale = [0,0 0]", "line 3: "),
        ] {
            let problem = parse(text).unwrap_err();
            assert!(problem.contains(message) && !problem.contains('\n'), "{problem:?}");
        }
        assert!(read(Path::new("/nowhere.toml")).unwrap_err().starts_with("/nowhere.toml: "));
    }
}
