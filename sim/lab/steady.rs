//! Steady states that are solved for, against trials of 120 s.
//!
//! `cargo run --release -p sim --example steady -- physical 2` (robot, threads): all points of the published map, w1 in
//! -90..90 rpm, w2 in 0..90 rpm, step 10. Pairs of speeds after it select others, `sobol` 100 points of a Sobol sequence over the
//! square of -90..90 rpm, and `generic` 100 random speeds with decimals at which the flagella do not touch in the trial. Times
//! are those of the processor, of both in one run, so that other load does not count.

use rayon::prelude::*;
use sim::body::closure::Closure;
use sim::contact::bundling::Bundling;
use sim::params::Robot;
use sim::split_mix;
use sim::steady::{self, Kind, Periodic, Problem};
use sim::trial::profile::SpeedProfile;
use sim::trial::sample::Sample;
use sim::trial::{Options, Summary, Trial};

/// Duration of a trial, s.
const TRIAL_S: f64 = 120.0;
/// Difference above which a point is listed, deg.
const ALLOWED_DEG: f64 = 0.1;

struct Row {
    rpm: [f64; 2],
    solved: Periodic,
    trial: Summary,
    /// Processor's time of the two, s.
    used_s: [f64; 2],
}

impl Row {
    /// Differences of yaw and tilt, deg.
    fn differences(&self) -> [f64; 2] {
        let [yaw, pitch, roll] = [0, 1, 2]
            .map(|i| (self.solved.summary.steady.attitude[i].mean - self.trial.steady.attitude[i].mean).to_degrees());
        [yaw.abs(), pitch.hypot(roll)]
    }
}

/// Returns the processor's time of this thread, s.
fn processor_s() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").expect("the kernel's statistics of this thread");
    text.split_whitespace().next().and_then(|field| field.parse::<f64>().ok()).expect("a time") * 1e-9
}

fn row(robot: &Robot, rpm: [f64; 2]) -> Row {
    let start = processor_s();
    let (closure, start_rad) = (Closure::Full, [0.0; 2]);
    let problem = Problem { robot, closure, rpm, start_rad, longest_s: TRIAL_S, output: None, at_rest: None };
    let solved = steady::solve(&problem, &|_| true).expect("a steady state");
    let middle = processor_s();
    let profile = SpeedProfile::constant(rpm, TRIAL_S).expect("a profile");
    let mut trial = Trial::new(robot, Closure::Full, profile, Options::default()).expect("parameters");
    let trial = trial.finish().expect("a run");
    Row { rpm, solved, trial, used_s: [middle - start, processor_s() - middle] }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let robot = Robot::built_in(arguments.first().map_or("physical", String::as_str)).expect("physical or published");
    let threads: usize = arguments.get(1).map_or(2, |count| count.parse().expect("a number of threads"));
    let points: Vec<[f64; 2]> = match arguments.get(2).map(String::as_str) {
        None => (-9..=9).flat_map(|i| (0..=9).map(move |j| [10.0 * f64::from(i), 10.0 * f64::from(j)])).collect(),
        Some("sobol") => (1..=COUNT).map(|i| sobol(i).map(speed)).collect(),
        Some("generic") => generic(&robot),
        Some(_) => arguments.iter().skip(2).map(|text| point(text)).collect(),
    };
    println!(
        "w1_rpm,w2_rpm,kind,simulated_s,period_s,yaw_deg,pitch_deg,roll_deg,contact_share,trial_settled,trial_settle_s,trial_contact_share,yaw_difference_deg,tilt_difference_deg,solve_s,trial_s"
    );
    let one = |rpm: &[f64; 2]| {
        let row = row(&robot, *rpm);
        print(&row);
        row
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    let rows: Vec<Row> = pool.install(|| points.par_iter().with_max_len(1).map(one).collect());
    summarise(&rows);
}

fn print(row: &Row) {
    let Row { rpm: [w1, w2], solved, trial, used_s: [solve_s, trial_s] } = row;
    let [yaw, pitch, roll] = solved.summary.steady.attitude.map(|level| level.mean.to_degrees());
    let [yaw_difference, tilt_difference] = row.differences();
    println!(
        "{w1},{w2},{:?},{:.1},{:.3},{yaw:.3},{pitch:.3},{roll:.3},{:.3},{},{:.1},{:.3},{yaw_difference:.3},{tilt_difference:.3},{solve_s:.3},{trial_s:.3}",
        solved.kind,
        solved.simulated_s,
        if solved.kind == Kind::Steady { solved.duration_s } else { f64::NAN },
        solved.summary.contact_share,
        trial.steady.settled,
        trial.steady.settle_s,
        trial.contact_share,
    );
}

fn summarise(rows: &[Row]) {
    let used = |of: &[&Row]| [0, 1].map(|which| of.iter().map(|row| row.used_s[which]).sum::<f64>());
    let ([solve, trial], count) = (used(&rows.iter().collect::<Vec<_>>()), rows.len());
    let times = trial / solve;
    eprintln!(
        "{count} points; processor's time {solve:.1} s for steady states, {trial:.1} s for trials: {times:.2} times"
    );
    for (name, touches, found) in [
        ("steady, no contact", false, true),
        ("steady, contact", true, true),
        ("others, no contact", false, false),
        ("others, contact", true, false),
    ] {
        let of: Vec<&Row> = (rows.iter())
            .filter(|row| (row.trial.contact_share > 0.0) == touches && (row.solved.kind == Kind::Steady) == found)
            .collect();
        let [solve, trial] = used(&of);
        eprintln!("  {name}: {} points, {solve:.1} s, {trial:.1} s, {:.2} times", of.len(), trial / solve);
    }
    let slower = rows.iter().filter(|row| row.used_s[0] > row.used_s[1]).count();
    let worst = rows.iter().map(|row| row.used_s[0] / row.used_s[1]).fold(0.0, f64::max);
    eprintln!("  {slower} of them slower than their trial, by {worst:.2} at most");
    let settled = rows.iter().filter(|row| row.trial.steady.settled).count();
    let off: Vec<&Row> = rows.iter().filter(|row| row.differences().into_iter().any(|d| d > ALLOWED_DEG)).collect();
    eprintln!("{settled} trials settled; {} points differ by more than {ALLOWED_DEG} deg:", off.len());
    for row in off {
        let [yaw, tilt] = row.differences();
        let (rpm, kind, settled) = (row.rpm, row.solved.kind, row.trial.steady.settled);
        eprintln!("  {rpm:?}: yaw {yaw:.3}, tilt {tilt:.3} deg, {kind:?}, trial settled {settled}");
    }
}

/// Points of the sets that are drawn.
const COUNT: u32 = 100;

/// Returns the speed at a place in 0..1 of its range, in hundredths of a rpm.
fn speed(place: f64) -> f64 {
    ((180.0 * place - 90.0) * 100.0).round() / 100.0
}

/// Returns a point of the Sobol sequence in two dimensions (Bratley and Fox 1988, ACM Trans. Math. Softw. 14, 88).
fn sobol(index: u32) -> [f64; 2] {
    let bits = (0..32u32).filter(|bit| index >> bit & 1 == 1);
    // The direction numbers of the second dimension: m, each from the one before.
    let second = |bit: u32| (0..bit).fold(1u64, |m, _| (m << 1) ^ m) << (31 - bit);
    let [x, y] = bits.fold([0, 0], |[x, y], bit| [x ^ 1u64 << (31 - bit), y ^ second(bit)]);
    [x, y].map(|value| value as f64 / f64::from(2u32).powi(32))
}

/// Returns random speeds at which the flagella do not touch in a trial.
fn generic(robot: &Robot) -> Vec<[f64; 2]> {
    let mut places = 1..;
    let mut random = || split_mix::uniform(20_261_125, places.next().expect("a place"));
    std::iter::from_fn(|| Some([speed(random()), speed(random())]))
        .filter(|rpm| {
            let profile = SpeedProfile::constant(*rpm, TRIAL_S).expect("a profile");
            let mut trial = Trial::new(robot, Closure::Full, profile, Options::default()).expect("parameters");
            let is_apart = |sample: &Sample| sample.bundling == Bundling::Apart;
            let has_ended = trial.by_ref().take_while(|sample| sample.as_ref().is_ok_and(is_apart)).count();
            has_ended > 0 && trial.done() == 1.0
        })
        .take(COUNT as usize)
        .collect()
}

/// Returns the speeds of `50,10`, rpm.
fn point(text: &str) -> [f64; 2] {
    let speed = |text: &str| text.parse().expect("a speed in rpm");
    text.split_once(',').map(|(w1, w2)| [speed(w1), speed(w2)]).expect("two speeds in rpm, such as 50,10")
}
