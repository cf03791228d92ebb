//! How often the stated 95 % intervals of yaw, pitch and roll contain the truth, for sensors whose errors lie within the
//! data sheet.
//!
//! `cargo run --release -p tests --example coverage -- 200`: sensors per line; a name after it prints the lines whose names
//! contain it.
//!
//! The motion is that of the model at a point, with its return to rest; the sensor, and the bench on which the commands
//! `biflag sensor` measure it, are those of [`tests::synthetic_rig`]. What follows is what reads every log. A trial after a
//! rest that was cut short begins with the wait of `record`, or, as `rest_at_most = 0` has it, without.

use biflag_log::MeasuredSensorMeta;
use host::plan::Phases;
use host::trial::Judged;
use sim::params::Robot;
use std::time::Instant;
use tests::synthetic_rig::{Lot, Motion, Part, Random, Rig, Start, each};

/// The published points, and speeds that nothing was adjusted to.
const POINTS: [[f64; 2]; 6] = [[50.0, 10.0], [-90.0, 90.0], [90.0, 90.0], [0.0, 45.0], [37.3, -61.7], [-23.45, 71.6]];

#[derive(Clone, Copy)]
struct Case {
    name: &'static str,
    lot: Lot,
    is_measured: bool,
    decay_s: f64,
    start: Start,
}

/// The error of an angle and its ±, degrees; `None` without a ±.
type Stated = Option<[f64; 2]>;

/// Returns the results for yaw, pitch and roll.
fn trial(motion: &Motion, case: &Case, (part, measured): &(Part, MeasuredSensorMeta), seed: u64) -> [Stated; 3] {
    let rig = Rig {
        part: part.clone(),
        measured: case.is_measured.then(|| measured.clone()),
        phases: Phases { decay_s: case.decay_s, ..Phases::default() },
        start: case.start,
    };
    let recording = rig.record(motion, &mut Random(seed ^ 0x7472_6961_6c00));
    let zeroed = Judged::of(recording.data.clone()).angles;
    let (Some(steady), Some(angles)) = (&zeroed.steady, zeroed.angles()) else { return [None; 3] };
    let truth = recording.truth_deg(&steady.window);
    let stated = [angles.yaw_uncertainty_deg, angles.pitch_uncertainty_deg, angles.roll_uncertainty_deg];
    std::array::from_fn(|k| Some([steady.angles_deg[k] - truth[k], stated[k]?]))
}

/// Returns the share of intervals that contain the truth, the mean ± and the median of |error| over ±.
fn cell(known: &[[f64; 2]]) -> String {
    if known.is_empty() {
        return "no ±".to_owned();
    }
    let mut ratios: Vec<f64> = known.iter().map(|[error, stated]| (error / stated).abs()).collect();
    ratios.sort_by(f64::total_cmp);
    let covered = 100.0 * ratios.partition_point(|ratio| *ratio <= 1.0) as f64 / ratios.len() as f64;
    format!("{covered:.0} %, {:.2}°, {:.2}", mean(known), ratios[ratios.len() / 2])
}

fn mean(known: &[[f64; 2]]) -> f64 {
    known.iter().map(|[_, stated]| stated).sum::<f64>() / known.len() as f64
}

fn main() {
    let begun = Instant::now();
    let sensors: usize = std::env::args().nth(1).and_then(|count| count.parse().ok()).unwrap_or(20);
    let only = std::env::args().nth(2).unwrap_or_default();
    let ideal = Case { name: "ideal", lot: Lot::Ideal, is_measured: true, decay_s: 30.0, start: Start::AtRest };
    let typical = Case { name: "typical", lot: Lot::Typical, is_measured: false, ..ideal };
    let edge = Case { name: "edge", lot: Lot::Edge, ..typical };
    let measured = Case { name: "typical, measured", is_measured: true, ..typical };
    let late = |name, late_s, waits| Case { name, start: Start::Late { late_s, waits }, ..measured };
    let cases = [
        ideal,
        typical,
        measured,
        edge,
        Case { name: "edge, measured", is_measured: true, ..edge },
        Case { name: "decay of 20 s", decay_s: 20.0, ..measured },
        Case { name: "decay of 10 s", decay_s: 10.0, ..measured },
        Case { name: "no decay", decay_s: 0.5, ..measured },
        late("rest cut short, 3 s", 3.0, true),
        late("rest cut short, 10 s", 10.0, true),
        late("rest cut short, 3 s, without a wait", 3.0, false),
    ];
    let cases: Vec<Case> = cases.into_iter().filter(|case| case.name.contains(&only)).collect();
    // A sensor is measured once, for all trials.
    let drawn = |lot| {
        each(sensors, |seed| {
            let mut random = Random(1000 + seed as u64);
            let part = Part::of(lot, &mut random);
            let measured = part.measured(&mut random);
            (part, measured)
        })
    };
    let lots: Vec<_> = [Lot::Ideal, Lot::Typical, Lot::Edge]
        .into_iter()
        .filter(|lot| cases.iter().any(|case| case.lot == *lot))
        .map(|lot| (lot, drawn(lot)))
        .collect();
    println!("{sensors} sensors; share of intervals that contain the truth, mean ±, median of |error| over ±\n");
    println!("| sensor and plan | rpm | yaw | pitch | roll | without ± |\n| --- | --- | --- | --- | --- | --- |");
    let mut gains = Vec::new();
    for rpm @ [w1, w2] in POINTS {
        let motion = Motion::of(&Robot::default(), rpm, Phases::default().run_s);
        let mut yaws = [None; 2];
        for case in &cases {
            let (_, sensors) = lots.iter().find(|(lot, _)| *lot == case.lot).expect("every lot");
            let all = each(sensors.len(), |seed| trial(&motion, case, &sensors[seed], 1000 + seed as u64));
            let known = [0, 1, 2].map(|k| all.iter().filter_map(|angles| angles[k]).collect::<Vec<_>>());
            let [yaw, pitch, roll] = known.each_ref().map(|known| cell(known));
            let empty = all.iter().filter(|angles| angles.contains(&None)).count();
            let empty = 100.0 * empty as f64 / all.len() as f64;
            println!("| {} | ({w1}, {w2}) | {yaw} | {pitch} | {roll} | {empty:.1} % |", case.name);
            for (yaw, name) in yaws.iter_mut().zip([typical.name, measured.name]) {
                if case.name == name {
                    *yaw = Some(mean(&known[0]));
                }
            }
        }
        if let [Some(typical), Some(measured)] = yaws {
            let ratio = typical / measured;
            gains.push(format!(
                "({w1}, {w2}) rpm: yaw ±{typical:.2}°, measured ±{measured:.2}°: {ratio:.1} times smaller"
            ));
        }
    }
    println!("\nMean ± of the yaw of a typical sensor");
    gains.iter().for_each(|line| println!("{line}"));
    println!("\n{:.0} s", begun.elapsed().as_secs_f64());
}
