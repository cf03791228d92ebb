//! How often `compare` finds a difference where there is none, and how often it finds one of the fluid's viscosity; and how
//! often repeats scatter as their budget says.
//!
//! `cargo run --release -p tests --example false_alarms -- 100`: trials per point; `model`, `viscosity`, `recordings` or
//! `repeats` after it prints one of the tables. Every trial has another sensor with errors within the data sheet, measured by
//! the three commands `biflag sensor`.

use biflag_log::BoardMeta;
use host::plan::Phases;
use host::trial::{Judged, Judgement, Repeat, scatter_of_repeats};
use host::twin::{Comparison, OnMismatch, compare};
use sim::params::Robot;
use std::time::Instant;
use tests::synthetic_rig::{Lot, Motion, Part, Random, Rig, Start, each};

/// The published points, and speeds as motors and fits have them.
const POINTS: [[f64; 2]; 6] = [[50.0, 10.0], [-90.0, 90.0], [90.0, 90.0], [0.0, 45.0], [37.3, 52.9], [-45.96, 63.73]];

/// Changes of the viscosity that are looked for.
const CHANGES: [f64; 3] = [0.01, 0.02, 0.05];

/// Repeats of a set.
const REPEATS: usize = 3;

fn motion(rpm: [f64; 2], viscosity: f64) -> Motion {
    let mut robot = Robot::default();
    robot.fluid.viscosity_pa_s *= 1.0 + viscosity;
    Motion::of(&robot, rpm, Phases::default().run_s)
}

/// Draws and measures a sensor.
fn rig(seed: usize) -> Rig {
    let mut random = Random(7000 + seed as u64);
    let part = Part::of(Lot::Typical, &mut random);
    let measured = Some(part.measured(&mut random));
    Rig { part, measured, phases: Phases::default(), start: Start::AtRest }
}

fn against_model(rigs: &[Rig], truth: &Motion, model: &Motion) -> Vec<Comparison> {
    let model = Judged::of(model.model(&Phases::default()));
    each(rigs.len(), |i| {
        let recording = rigs[i].record(truth, &mut Random(17_000 + i as u64));
        compare(&Judged::of(recording.data), &model, OnMismatch::Warn).expect("comparable trials").comparison
    })
}

/// Compares two recordings by one sensor, or by each sensor and the next one, none of which was measured.
fn against_each_other(rigs: &[Rig], truth: &Motion, is_one_sensor: bool) -> Vec<Comparison> {
    each(rigs.len(), |i| {
        let mut random = Random(27_000 + i as u64);
        let other = if is_one_sensor { i } else { (i + 1) % rigs.len() };
        let [one, other] = [i, other].map(|rig| {
            let mut log = Rig { measured: None, ..rigs[rig].clone() }.record(truth, &mut random).data;
            log.records.board = Some(BoardMeta { board_id: rig as u16 + 1, ..BoardMeta::default() });
            Judged::of(log)
        });
        compare(&one, &other, OnMismatch::Warn).expect("comparable trials").comparison
    })
}

fn percent(all: &[Comparison], of: impl Fn(&Comparison) -> bool) -> f64 {
    100.0 * all.iter().filter(|one| of(one)).count() as f64 / all.len() as f64
}

/// Shares of trials whose steady yaw, pitch and roll differ, mean ±, and the share of trials with an angle without ±.
fn steady(all: &[Comparison]) -> String {
    let cell = |k: usize| {
        let differs = |one: &Comparison| {
            let name = one.angles[k].angle;
            one.differences.iter().any(|difference| difference.angle == name)
        };
        let known: Vec<f64> = all.iter().filter_map(|one| Some(one.angles[k].uncertainty?.total_deg)).collect();
        let mean = known.iter().sum::<f64>() / known.len() as f64;
        format!("{:.0} %, ±{mean:.2}°", percent(all, differs))
    };
    let empty = percent(all, |one| one.angles.iter().any(|angle| angle.uncertainty.is_none()));
    format!("{} | {} | {} | {empty:.0} %", cell(0), cell(1), cell(2))
}

/// Shares of trials whose transients differ.
fn transients(all: &[Comparison]) -> String {
    let cell = |k: usize| {
        let of = |one: &Comparison| one.angles[k].transient;
        let mut residuals: Vec<f64> = all.iter().filter_map(|one| Some(of(one)?.residual_deg)).collect();
        let allowed = all.iter().filter_map(|one| Some(of(one)?.allowed_deg)).sum::<f64>() / all.len() as f64;
        residuals.sort_by(f64::total_cmp);
        let median = residuals.get(residuals.len() / 2).copied().unwrap_or(f64::NAN);
        let differs = percent(all, |one| of(one).is_some_and(|transient| transient.differs()));
        format!("{differs:.0} %, {median:.2} of {allowed:.2}°")
    };
    let settling = percent(all, |one| one.settling.differs);
    format!("{} | {} | {} | {settling:.0} %", cell(0), cell(1), cell(2))
}

/// Shares of sets of repeats whose yaw, pitch and roll scatter as their budget says.
fn scatter(rigs: &[Rig], truth: &Motion) -> String {
    let judged = each(rigs.len(), |i| {
        let mut random = Random(37_000 + i as u64);
        let repeat = |_| Repeat::new(&Judged::of(rigs[i].record(truth, &mut random).data)).expect("a measured trial");
        let trials: Vec<Repeat> = (0..REPEATS).map(repeat).collect();
        let [set] = scatter_of_repeats(trials.iter()).try_into().expect("one set");
        set.angles
    });
    let cell = |k: usize| {
        let share = |judgement: Judgement| {
            100.0 * judged.iter().filter(|set| set[k].judgement == judgement).count() as f64 / judged.len() as f64
        };
        format!("{:.0} % more, {:.0} % less", share(Judgement::More), share(Judgement::Less))
    };
    format!("{} | {} | {}", cell(0), cell(1), cell(2))
}

fn main() {
    let argument = |i: usize| std::env::args().nth(i);
    let trials: usize = argument(1).and_then(|count| count.parse().ok()).unwrap_or(20);
    let only = argument(2);
    let is_wanted = |part: &str| only.as_deref().is_none_or(|only| only == part);
    let begun = Instant::now();
    let rigs = each(trials, rig);
    let motions = POINTS.map(|rpm| (format!("({}, {})", rpm[0], rpm[1]), motion(rpm, 0.0)));
    if is_wanted("model") {
        println!(
            "{trials} trials a point, each with another measured sensor; share that differs, mean ± of an angle\n"
        );
        println!("| compared with | rpm | yaw | pitch | roll | without ± |\n| --- | --- | --- | --- | --- | --- |");
        let mut rows = Vec::new();
        for (point, truth) in &motions {
            let same = against_model(&rigs, truth, truth);
            println!("| its own model | {point} | {} |", steady(&same));
            rows.push(format!("| {point} | {} |", transients(&same)));
        }
        println!("\nTheir transients: share that differs, median error of the allowed\n");
        println!("| rpm | yaw | pitch | roll | settling time |\n| --- | --- | --- | --- | --- |");
        rows.iter().for_each(|row| println!("{row}"));
    }
    if is_wanted("viscosity") {
        println!("\nShare that differs where the model has less viscosity, in any angle; mean ± of an angle\n");
        println!(
            "| less viscosity | rpm | yaw | pitch | roll | without ± | any |\n| --- | --- | --- | --- | --- | --- | --- |"
        );
        for ((point, model), rpm) in motions.iter().zip(POINTS) {
            for change in CHANGES {
                let all = against_model(&rigs, &motion(rpm, change), model);
                let any = percent(&all, |one| !one.differences.is_empty());
                println!("| {:.0} % | {point} | {} | {any:.0} % |", 100.0 * change, steady(&all));
            }
        }
    }
    if is_wanted("recordings") {
        println!("\nTwo recordings of one motion; the sensors were not measured\n");
        println!("| recorded by | rpm | yaw | pitch | roll | without ± |\n| --- | --- | --- | --- | --- | --- |");
        for (point, truth) in &motions {
            for (name, is_one_sensor) in [("one sensor", true), ("two sensors", false)] {
                println!("| {name} | {point} | {} |", steady(&against_each_other(&rigs, truth, is_one_sensor)));
            }
        }
    }
    if is_wanted("repeats") {
        println!("\nScatter of {REPEATS} repeats: share beyond the interval of the budget\n");
        println!("| rpm | yaw | pitch | roll |\n| --- | --- | --- | --- |");
        for (point, truth) in &motions {
            println!("| {point} | {} |", scatter(&rigs, truth));
        }
    }
    println!("\n{:.0} s", begun.elapsed().as_secs_f64());
}
