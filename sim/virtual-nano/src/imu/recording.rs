//! A recording of an MPU6050's raw counts, from a CSV file.
//!
//! Lines that begin with `#` describe its origin. They include the ranges, as `accel full scale +-8 g` and
//! `gyro full scale +-250 deg/s`, and, if known, the gyroscope's reading at rest, as `gyro at rest 592,7,147` (counts).
//! The column names `t_s,ax,ay,az,gx,gy,gz,temp_c` follow, and then a line a sample: seconds from the beginning,
//! counts, degrees Celsius.

use super::scale::{self, Range};
use std::path::Path;

const COLUMNS: &str = "t_s,ax,ay,az,gx,gy,gz,temp_c";

/// Time at the start and at the end that shows the sensor's attitude, s.
const REST_S: f64 = 0.5;

/// Readings that vary less than this are from a sensor that lies still: three times the data sheet's noise of all axes
/// together, at ±250 °/s.
const STILL_COUNTS: f64 = 60.0;

/// A sample.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Sample {
    /// Seconds from the beginning of the recording.
    pub time_s: f64,
    /// Acceleration, counts.
    pub accel: [f64; 3],
    /// Rate of turn, counts.
    pub gyro: [f64; 3],
    /// Temperature, counts.
    pub temperature: f64,
}

/// A recording with at least two samples, in the order of time.
#[derive(Clone, PartialEq, Debug)]
pub struct Recording {
    /// The accelerometer's range.
    pub accel_range: Range,
    /// The gyroscope's range.
    pub gyro_range: Range,
    samples: Vec<Sample>,
    gyro_at_rest: [f64; 3],
}

impl Recording {
    /// Reads a file.
    pub fn read(path: &Path) -> Result<Self, String> {
        let text = std::fs::read_to_string(path).map_err(|error| format!("cannot read {}: {error}", path.display()))?;
        Self::parse(&text, path)
    }

    fn parse(text: &str, path: &Path) -> Result<Self, String> {
        let incomplete = |problem: &str| format!("{}: {problem}", path.display());
        let (mut accel_range, mut gyro_range, mut gyro_at_rest) = (None, None, None);
        let mut samples: Vec<Sample> = Vec::new();
        let mut columns_seen = false;
        for (index, line) in text.lines().map(str::trim).enumerate() {
            let wrong = |problem: String| format!("{}, line {}: {problem}", path.display(), index + 1);
            if let Some(comment) = line.strip_prefix('#') {
                accel_range = accel_range.or(range_in(comment, "accel full scale +-", scale::ACCEL));
                gyro_range = gyro_range.or(range_in(comment, "gyro full scale +-", scale::GYRO));
                gyro_at_rest = gyro_at_rest.or(rest_in(comment));
            } else if line.is_empty() {
            } else if !columns_seen {
                if line != COLUMNS {
                    return Err(wrong(format!("expected the columns {COLUMNS}")));
                }
                columns_seen = true;
            } else {
                let sample = parse_sample(line).map_err(&wrong)?;
                if samples.last().is_some_and(|last| last.time_s >= sample.time_s) {
                    return Err(wrong("time does not go forward".into()));
                }
                samples.push(sample);
            }
        }
        if samples.len() < 2 {
            return Err(incomplete("fewer than two samples"));
        }
        let gyro_at_rest = gyro_at_rest.unwrap_or_else(|| bias(&samples));
        let accel_range =
            accel_range.ok_or_else(|| incomplete("no comment `accel full scale +-N g` with 2, 4, 8 or 16"))?;
        let gyro_range = gyro_range
            .ok_or_else(|| incomplete("no comment `gyro full scale +-N deg/s` with 250, 500, 1000 or 2000"))?;
        Ok(Self { accel_range, gyro_range, samples, gyro_at_rest })
    }

    /// Returns the seconds from the first sample to the last.
    pub fn duration_s(&self) -> f64 {
        self.last().time_s - self.first().time_s
    }

    /// Returns the reading `seconds` after the first sample, interpolated; beyond the end the last one.
    ///
    /// The integral of the rates then equals the recording's by the trapezoidal rule. If samples were held, their uneven
    /// times would turn the sensor at random.
    pub fn at(&self, seconds: f64) -> Sample {
        let time_s = self.first().time_s + seconds;
        let next = self.samples.partition_point(|sample| sample.time_s <= time_s);
        let before = &self.samples[next.saturating_sub(1)];
        let Some(after) = self.samples.get(next) else { return *before };
        let part = ((time_s - before.time_s) / (after.time_s - before.time_s)).clamp(0.0, 1.0);
        let mix = |a: f64, b: f64| a + part * (b - a);
        let mix3 = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|axis| mix(a[axis], b[axis]));
        Sample {
            time_s,
            accel: mix3(before.accel, after.accel),
            gyro: mix3(before.gyro, after.gyro),
            temperature: mix(before.temperature, after.temperature),
        }
    }

    /// Returns the sample of a sensor that lies still as at the start.
    pub fn rest_before(&self) -> Sample {
        let end = self.first().time_s + REST_S;
        self.at_rest(self.samples.iter().take_while(|sample| sample.time_s <= end))
    }

    /// Returns the sample of a sensor that lies still as at the end.
    pub fn rest_after(&self) -> Sample {
        let start = self.last().time_s - REST_S;
        self.at_rest(self.samples.iter().rev().take_while(|sample| sample.time_s >= start))
    }

    /// Returns the sample at rest. The hands that moved the sensor were not quite still at either end: the mean gives gravity
    /// and temperature, but not the rates.
    fn at_rest<'a>(&self, samples: impl Iterator<Item = &'a Sample>) -> Sample {
        Sample { gyro: self.gyro_at_rest, ..mean(samples) }
    }

    fn first(&self) -> &Sample {
        &self.samples[0]
    }

    fn last(&self) -> &Sample {
        &self.samples[self.samples.len() - 1]
    }
}

fn parse_sample(line: &str) -> Result<Sample, String> {
    let fields: Vec<&str> = line.split(',').map(str::trim).collect();
    let [time, ax, ay, az, gx, gy, gz, temperature] = fields[..] else {
        return Err(format!("{} columns instead of 8", fields.len()));
    };
    let real = |field: &str| match field.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(format!("{field:?} is not a number")),
    };
    let count =
        |field: &str| field.parse::<i16>().map(f64::from).map_err(|_| format!("{field:?} is not a 16-bit count"));
    Ok(Sample {
        time_s: real(time)?,
        accel: [count(ax)?, count(ay)?, count(az)?],
        gyro: [count(gx)?, count(gy)?, count(gz)?],
        temperature: scale::counts(scale::temperature_counts(real(temperature)?)).into(),
    })
}

/// Returns the range whose full scale follows `key`.
fn range_in(comment: &str, key: &str, all: [Range; 4]) -> Option<Range> {
    let (_, rest) = comment.split_once(key)?;
    let digits = rest.split(|c: char| !c.is_ascii_digit()).next()?;
    let value: u16 = digits.parse().ok()?;
    all.into_iter().find(|range| range.full_scale == f64::from(value))
}

/// Returns the three numbers after `gyro at rest`.
fn rest_in(comment: &str) -> Option<[f64; 3]> {
    let (_, rest) = comment.split_once("gyro at rest ")?;
    let numbers: Vec<f64> = rest
        .split(|c: char| !(c.is_ascii_digit() || matches!(c, '-' | '.')))
        .filter(|word| !word.is_empty())
        .map_while(|word| word.trim_end_matches('.').parse().ok())
        .take(3)
        .collect();
    numbers.try_into().ok()
}

fn mean<'a>(samples: impl Iterator<Item = &'a Sample>) -> Sample {
    let mut sum = Sample::default();
    let mut count = 0.0;
    for sample in samples {
        count += 1.0;
        for axis in 0..3 {
            sum.accel[axis] += sample.accel[axis];
            sum.gyro[axis] += sample.gyro[axis];
        }
        sum.temperature += sample.temperature;
    }
    Sample {
        time_s: 0.0,
        accel: sum.accel.map(|x| x / count),
        gyro: sum.gyro.map(|x| x / count),
        temperature: sum.temperature / count,
    }
}

/// Returns the best guess of the gyroscope's bias from a recording: the mean over the beginning, as long as the sensor
/// lies still; else over the stretch of [`REST_S`] with the least variation, if the sensor lies still in it; else zero.
fn bias(samples: &[Sample]) -> [f64; 3] {
    let stretch = |start: usize, length_s: f64| {
        let end_s = samples[start].time_s + length_s;
        &samples[start..samples.partition_point(|sample| sample.time_s < end_s)]
    };
    let still = |window: &&[Sample]| window.len() > 10 && spread(window) < STILL_COUNTS;
    let beginnings = (1..=20).map(|halves| stretch(0, f64::from(halves) * REST_S));
    if let Some(beginning) = beginnings.take_while(still).last() {
        return mean(beginning.iter()).gyro;
    }
    let windows = (0..samples.len()).step_by(5).map(|start| stretch(start, REST_S)).filter(still);
    let best = windows.min_by(|a, b| spread(a).total_cmp(&spread(b)));
    best.map_or([0.0; 3], |window| mean(window.iter()).gyro)
}

/// Returns the standard deviation of the gyroscope's readings, counts, all axes together.
fn spread(window: &[Sample]) -> f64 {
    let mean = mean(window.iter()).gyro;
    let square = |sample: &Sample| (0..3).map(|axis| (sample.gyro[axis] - mean[axis]).powi(2)).sum::<f64>();
    (window.iter().map(square).sum::<f64>() / window.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "# accel full scale +-8 g (4096 LSB/g), gyro full scale +-500 deg/s\n";

    fn parse(body: &str) -> Result<Recording, String> {
        Recording::parse(&format!("{HEADER}{COLUMNS}\n{body}"), Path::new("x.csv"))
    }

    #[test]
    fn readings_between_samples_are_interpolated() {
        let recording = parse("0.5,0,0,0,10,0,0,20\n0.51,0,0,0,20,0,0,20\n0.71,0,0,0,40,0,0,20\n").unwrap();
        assert_eq!((recording.accel_range, recording.gyro_range), (scale::ACCEL[2], scale::GYRO[1]));
        assert_eq!(recording.at(0.0).gyro[0], 10.0);
        assert!((recording.at(0.005).gyro[0] - 15.0).abs() < 1e-9);
        assert!((recording.at(0.11).gyro[0] - 30.0).abs() < 1e-9);
        assert_eq!(recording.at(9.0).gyro[0], 40.0);
    }

    #[test]
    fn a_bad_line_is_named() {
        let error = |body: &str| parse(body).unwrap_err();
        assert_eq!(error("0,1,2\n"), "x.csv, line 3: 3 columns instead of 8");
        assert_eq!(error("0,1,2,3,4,5,99999,7\n"), "x.csv, line 3: \"99999\" is not a 16-bit count");
        assert_eq!(error("0,1,2,3,4,5,6,nan\n"), "x.csv, line 3: \"nan\" is not a number");
        assert_eq!(error("1,1,2,3,4,5,6,7\n1,1,2,3,4,5,6,7\n"), "x.csv, line 4: time does not go forward");
        assert_eq!(error("1,1,2,3,4,5,6,7\n"), "x.csv: fewer than two samples");
        let no_header = Recording::parse(&format!("{COLUMNS}\n0,1,2,3,4,5,6,7\n1,1,2,3,4,5,6,7"), Path::new("x.csv"));
        assert!(no_header.unwrap_err().contains("accel full scale"));
    }

    #[test]
    fn the_bias_is_the_mean_of_a_still_beginning() {
        let sample =
            |i: usize, rate: f64| Sample { time_s: i as f64 * 0.01, gyro: [rate, 0.0, 0.0], ..Sample::default() };
        let noise = |i: usize| if i.is_multiple_of(2) { 10.0 } else { -10.0 };
        let turns = |i: usize| 3000.0 * (i as f64 * 0.01).sin();
        let still_first: Vec<Sample> =
            (0..800).map(|i| sample(i, 40.0 + noise(i) + if i < 400 { 0.0 } else { turns(i) })).collect();
        assert!((bias(&still_first)[0] - 40.0).abs() < 1.0);
        let still_last: Vec<Sample> =
            (0..800).map(|i| sample(i, 40.0 + noise(i) + if i > 400 { 0.0 } else { turns(i) })).collect();
        assert!((bias(&still_last)[0] - 40.0).abs() < 1.0);
        let never_still: Vec<Sample> = (0..800).map(|i| sample(i, 40.0 + 100.0 * noise(i))).collect();
        assert_eq!(bias(&never_still), [0.0; 3]);
    }

    #[test]
    fn the_bias_may_stand_in_the_header() {
        assert_eq!(rest_in(" gyro at rest 592, -7,147.5 counts."), Some([592.0, -7.0, 147.5]));
        assert_eq!(rest_in(" gyro at rest unknown"), None);
    }
}
