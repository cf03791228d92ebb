//! `biflag sensor still`: the gyroscope's noise, by a long rest.

use super::super::options::within;
use super::bench::{Bench, Common, Measured, Told, finish, row};
use crate::commands::answer::Answer;
use serde_json::{Map, json};
use study::sensor::{AXES, Estimate, StillResult, StillWatch};

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
    finish(&mut bench, described(&result), &followed)
}

fn described(result: &StillResult) -> Measured {
    let mut text = String::new();
    let mut allan = Map::new();
    for (name, noise) in AXES.iter().zip(&result.axes) {
        let with_u = |one: Estimate, places: usize| format!("{:.places$} ± {:.places$}", one.value, 1.96 * one.u);
        let [walk, instability] = [noise.walk_of_angle, noise.instability_dps].map(|one| with_u(one, 5));
        text += &format!("{name}: angle random walk {walk} °/√s, bias instability {instability} °/s, ");
        text += &format!("walk of the bias {} °/s/√s (95 %)\n", with_u(noise.walk_of_bias, 6));
        let points: Vec<_> = noise
            .allan
            .iter()
            .map(|(tau_s, at)| json!({ "tau_s": tau_s, "deviation_dps": at.value, "u_dps": at.u }))
            .collect();
        allan.insert((*name).to_owned(), json!(points));
    }
    match &result.warming {
        Some(warming) => text += &row("bias by temperature", warming, 1.0, 4, "°/s/K"),
        None => text += "the temperature hardly changed: its effect on the bias is not known\n",
    }
    Measured { text, json: json!({ "allan": allan }), warnings: Vec::new() }
}
