//! `biflag sensor poses`: the accelerometer, and the gyroscope's sensitivity to gravity, from six poses.

use super::super::options::within;
use super::bench::{Bench, Common, Measured, Told, finish, percent, row};
use crate::commands::answer::Answer;
use serde_json::json;
use study::sensor::{AXES, PoseStep, PosesResult, PosesWatch};

/// Measure accelerometer, mounting and sensitivity to gravity: lay the sensor still with each axis up and down.
#[derive(clap::Args, Debug)]
#[command(
    after_help = "Lay the board on each of its six sides on a flat, level table, in any order. No key is needed: the \
    program sees which axis points up, and says which poses are missing.\n\nExample: biflag sensor poses"
)]
pub struct Args {
    /// Time in each pose, s.
    #[arg(long, default_value_t = 20.0, value_parser = within("seconds", 5.0..=3600.0))]
    seconds: f64,
    /// Largest error of each pose, degrees.
    #[arg(long, value_name = "DEGREES", default_value_t = 1.0, value_parser = within("an angle in degrees", 0.01..=10.0))]
    placement: f64,
    #[command(flatten)]
    common: Common,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let mut bench = Bench::open(&args.common, "poses")?;
    let is_replay = bench.is_replay;
    let mut watch = PosesWatch::new(args.seconds);
    let (mut left, mut ordered) = (6, String::new());
    let followed = bench.follow(6.0, |reading, nano, progress| {
        let step = watch.push(reading)?;
        let now_left = watch.missing().len();
        if now_left < left {
            left = now_left;
            progress.end_trial(1.0);
        }
        // The emulated hand lays the sensor into the next pose once the one before is done.
        if let (PoseStep::Move { missing }, Some(nano), false) = (&step, nano, is_replay)
            && missing[0] != ordered
            && (left < 6 || reading.time_s > 2.0)
        {
            ordered.clone_from(&missing[0]);
            nano.pose(&ordered, 2.0)?;
        }
        let (instruction, figures) = told(&step);
        Ok(Told { instruction, figures, is_done: step == PoseStep::Done })
    })?;
    let result = watch.result(args.placement)?;
    result.enter(&mut bench.file);
    finish(&mut bench, described(&result), &followed)
}

fn told(step: &PoseStep) -> (String, String) {
    match step {
        PoseStep::Hold { up, left_s } => (format!("keep it still with {up} up"), format!("still, {left_s:.0} s to go")),
        PoseStep::Move { missing } => {
            let one_of = if missing.len() == 1 { "" } else { "one of " };
            (format!("lay it with {one_of}{} up", missing.join(", ")), String::new())
        }
        PoseStep::Askew { missing } => (
            format!("no axis points up; lay it on a side, with {} up", missing.join(" or ")),
            "still, but askew".to_owned(),
        ),
        PoseStep::Done => ("done".to_owned(), String::new()),
    }
}

fn described(result: &PosesResult) -> Measured {
    let mut text = row("scale of the accelerometer", &result.accel_scale, 100.0, 2, "%");
    text += &row("offset of the accelerometer", &result.accel_offset_g, 1000.0, 1, "mg");
    text += &row("mounting", &result.mounting_deg, 1.0, 2, "°");
    for (i, j) in [(0, 1), (0, 2), (1, 2)] {
        let [a, b] = [AXES[i], AXES[j]];
        text += &format!("share that {a} reads of {b}, and {b} of {a}: {}\n", percent(result.accel_cross[i][j]));
    }
    for (j, axis) in AXES.iter().enumerate() {
        let column = [result.gyro_g_dps[0][j], result.gyro_g_dps[1][j], result.gyro_g_dps[2][j]];
        text += &row(&format!("rates by gravity along {axis}"), &column, 1.0, 4, "°/s/g");
    }
    text += &format!("beside its warming, the bias changed by {:.4} °/s from pose to pose\n", result.drift_dps);
    Measured { text, json: json!({ "drift_dps": result.drift_dps }), warnings: Vec::new() }
}
