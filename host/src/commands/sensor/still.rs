//! `biflag sensor still`: the gyroscope's noise, by a long rest.

use super::super::options::within;
use super::bench::{Bench, Common, Told};
use super::measured::{Measured, finish};
use crate::commands::answer::Answer;
use serde_json::{Map, json};
use study::sensor::{AXES, StillResult, StillWatch};
use study::text::signed;

/// Measure the gyroscope's noise, the instability and walk of its bias, and its change with temperature: let it lie still.
#[derive(clap::Args, Debug)]
#[command(
    after_help = "Let it warm up for five minutes first, or not, to measure how the bias changes with temperature.\n\n\
    Example: biflag sensor still 3600"
)]
pub struct Args {
    /// Length of the rest, s.
    #[arg(default_value_t = 600.0, value_parser = within("seconds", 30.0..=200_000.0))]
    seconds: f64,
    #[command(flatten)]
    common: Common,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let mut bench = Bench::open(&args.common, "still")?;
    let mut is_started = !bench.is_replay;
    let mut watch = StillWatch::new(args.seconds);
    let mut first_c = None;
    let followed = bench.follow(args.seconds, |reading, nano, progress| {
        if let (false, Some(nano)) = (is_started, nano) {
            nano.control("play")?;
            is_started = true;
        }
        let left_s = watch.push(reading)?;
        progress.within(args.seconds - left_s);
        let [x, y, z] = reading.rate_dps;
        let warming_c = reading.temperature_c - *first_c.get_or_insert(reading.temperature_c);
        let figures = format!("{left_s:.0} s to go; {x:.2}, {y:.2}, {z:.2} °/s, {warming_c:+.2} °C");
        Ok(Told { instruction: "let it lie still".to_owned(), figures, is_done: left_s <= 0.0 })
    })?;
    let result = watch.result()?;
    result.enter(&mut bench.file);
    let measured = described(&result);
    finish(&mut bench, measured, &followed)
}

fn described(result: &StillResult) -> Measured {
    let mut text = String::new();
    let mut allan = Map::new();
    for (name, noise) in AXES.iter().zip(&result.axes) {
        let [walk, instability, drift] = [noise.walk_of_angle, noise.instability_dps, noise.walk_of_bias];
        text += &format!(
            "{name}: angle random walk {:.5} ± {:.5} °/√s, bias instability {:.5} ± {:.5} °/s, walk of the bias \
             {:.6} ± {:.6} °/s/√s (95 %)\n",
            walk.value,
            1.96 * walk.u,
            instability.value,
            1.96 * instability.u,
            drift.value,
            1.96 * drift.u
        );
        let points: Vec<_> = noise
            .allan
            .iter()
            .map(|(tau_s, at)| json!({ "tau_s": tau_s, "deviation_dps": at.value, "u_dps": at.u }))
            .collect();
        allan.insert((*name).to_owned(), json!(points));
    }
    match &result.warming {
        Some(warming) => {
            let cells: Vec<_> = AXES
                .iter()
                .zip(warming)
                .map(|(name, one)| format!("{name} {} ± {:.4}", signed(one.value, 4), 1.96 * one.u))
                .collect();
            text += &format!("bias by temperature: {} °/s/K (95 %)\n", cells.join(", "));
        }
        None => text += "the temperature hardly changed: its effect on the bias is not known\n",
    }
    let json = [("allan".to_owned(), json!(allan))].into_iter().collect();
    Measured { text, json, warnings: Vec::new() }
}
