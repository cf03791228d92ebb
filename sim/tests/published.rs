//! The published operating points: 120 s, published robot, one constant calibrated (the tether, at (90, 90)).

use crate::common::prove;
use sim::body::closure::Closure;
use sim::params::{Robot, Tank};
use sim::trial::profile::SpeedProfile;
use sim::trial::sample::Sample;
use sim::trial::{Options, Summary, Trial};

const POINTS: [[f64; 2]; 4] = [[50.0, 10.0], [0.0, 45.0], [90.0, 90.0], [-90.0, 90.0]];

fn run(closure: Closure, rpm: [f64; 2]) -> Summary {
    let profile = SpeedProfile::constant(rpm, 120.0).expect("a profile");
    let mut trial = Trial::new(&Robot::published(), closure, profile, Options::default()).expect("parameters");
    trial.finish().expect("a run")
}

/// |yaw|, |pitch|, |roll| and the tilt of the axis in degrees.
fn angles(closure: Closure) -> [[f64; 4]; 4] {
    POINTS.map(|rpm| {
        let summary = run(closure, rpm);
        let steady = &summary.steady;
        let [yaw, pitch, roll] = steady.attitude.map(|l| l.mean);
        let tilt = (pitch.cos() * roll.cos()).acos();
        let degrees = [yaw.abs(), pitch.abs(), roll.abs(), tilt].map(f64::to_degrees);
        println!(
            "{closure:?} ({}, {}): |yaw| {:.2} |pitch| {:.2} |roll| {:.2} tilt {:.2} deg; swing {:.2} {:.2} {:.2} deg; settled {} after {:.0} s; least gap {:.1} mm",
            rpm[0], rpm[1], degrees[0], degrees[1], degrees[2], degrees[3],
            steady.attitude[0].amplitude.to_degrees(), steady.attitude[1].amplitude.to_degrees(), steady.attitude[2].amplitude.to_degrees(),
            steady.settled, steady.settle_s, summary.min_gap_m * 1e3
        );
        degrees
    })
}

/// Distance of a value from an interval widened by a share, over that width.
fn outside(value: f64, low: f64, high: f64, share: f64) -> f64 {
    let (least, most) = (low * (1.0 - share), high * (1.0 + share));
    if value < least {
        1.0 + (least - value) / least
    } else if value > most {
        value / most
    } else {
        0.99 * (value - 0.5 * (least + most)).abs() / (0.5 * (most - least))
    }
}

#[test]
fn lumped_meets_the_published_simulation() {
    let [a, b, c, d] = angles(Closure::Lumped);
    prove("lumped (90, 90): |yaw| calibrated to 180 deg, relative", (c[0] / 180.0 - 1.0).abs(), 0.01);
    prove("lumped (50, 10): |yaw| 60.76 to 67.95 deg within 20 %", outside(a[0], 60.76, 67.95, 0.2), 1.0);
    prove("lumped (50, 10): |pitch| against 3.29 deg", (a[1] / 3.29 - 1.0).abs(), 0.2);
    prove("lumped (0, 45): |yaw| against 56.22 deg", (b[0] / 56.22 - 1.0).abs(), 0.2);
    prove("lumped (0, 45): |pitch| against 3.45 deg", (b[1] / 3.45 - 1.0).abs(), 0.2);
    prove("lumped (-90, 90): |pitch| against 16 deg", (d[1] / 16.0 - 1.0).abs(), 0.2);
}

#[test]
fn full_lies_near_the_experiment() {
    let [a, b, c, d] = angles(Closure::Full);
    prove("full (90, 90): |yaw| calibrated to 180 deg, relative", (c[0] / 180.0 - 1.0).abs(), 0.01);
    prove("full (50, 10): |yaw| against the measured 67.95 deg", (a[0] / 67.95 - 1.0).abs(), 0.2);
    prove("full (50, 10): |pitch| 3.29 to 4.96 deg within 20 %", outside(a[1], 3.29, 4.96, 0.2), 1.0);
    prove("full (0, 45): |yaw| against 56.22 deg", (b[0] / 56.22 - 1.0).abs(), 0.25);
    prove("full (-90, 90): tilt of the axis against 16 deg", (d[3] / 16.0 - 1.0).abs(), 0.25);
}

/// The one printed measurement, by the robot that has nothing fitted to it: its tether is calibrated at (90, 90) rpm.
#[test]
fn physical_lies_at_the_experiment() {
    let in_tank = Robot { tank: Some(Tank::published()), ..Robot::default() };
    for (name, robot, pitch_bound) in [("physical", Robot::default(), 0.15), ("physical in the tank", in_tank, 0.1)] {
        let profile = SpeedProfile::constant([50.0, 10.0], 120.0).expect("a profile");
        let mut trial = Trial::new(&robot, Closure::Full, profile, Options::default()).expect("parameters");
        let [yaw, pitch, _] = trial.finish().expect("a run").steady.attitude.map(|level| level.mean.abs().to_degrees());
        println!("{name} at (50, 10): yaw {yaw:.2}, pitch {pitch:.2} deg");
        prove(&format!("{name} (50, 10): yaw against the experiment"), (yaw / 67.95 - 1.0).abs(), 0.05);
        prove(&format!("{name} (50, 10): pitch against the experiment"), (pitch / 4.96 - 1.0).abs(), pitch_bound);
    }
}

#[test]
fn steps_are_short_enough_for_steady_angles() {
    // Of opposite senses: the flagella pass each other faster than either turns.
    let published = [[90.0, -90.0]];
    let physical = [[43.68, -81.73], [-82.92, 74.28]];
    // `physical` has touched there, or has slow modes, and is not settled before.
    for (robot, pairs, run_s) in [(Robot::published(), &published[..], 120.0), (Robot::default(), &physical, 160.0)] {
        for &rpm in pairs {
            let angles = |robot: &Robot| {
                let profile = SpeedProfile::constant(rpm, run_s).expect("a profile");
                let mut trial = Trial::new(robot, Closure::Full, profile, Options::default()).expect("parameters");
                trial.finish().expect("a run").steady.attitude.map(|level| level.mean.to_degrees())
            };
            let mut fine = robot.clone();
            (fine.solver.step_rad, fine.solver.step_error, fine.solver.tolerance) = (0.1, 1e-4, 2.5e-3);
            let (usual, fine) = (angles(&robot), angles(&fine));
            for (name, (usual, fine)) in ["yaw", "pitch", "roll"].into_iter().zip(usual.into_iter().zip(fine)) {
                let check = format!("full ({}, {}): {name} against short steps, degrees", rpm[0], rpm[1]);
                prove(&check, (usual - fine).abs(), 0.1);
            }
        }
    }
}

#[test]
fn steps_resolve_the_snaps_of_meshing_flagella() {
    // `cargo run --release -p sim --example steps` has more points and a finer reference.
    let rpm = [-80.0, -20.0];
    let means = |robot: &Robot| {
        let profile = SpeedProfile::constant(rpm, 60.0).expect("a profile");
        let options = Options { rate_hz: 200.0, shapes: false };
        let trial = Trial::new(robot, Closure::Full, profile, options).expect("parameters");
        let samples = trial.collect::<Result<Vec<_>, _>>().expect("a run");
        let last: Vec<_> = samples.iter().filter(|s| s.time_s > 24.0).collect();
        let mean = |value: fn(&Sample) -> f64| last.iter().map(|s| value(s)).sum::<f64>() / last.len() as f64;
        let thrusts = [mean(|s| s.force_n[0][2]), mean(|s| s.force_n[1][2])];
        (thrusts, [mean(|s| s.yaw_rad), mean(|s| s.pitch_rad), mean(|s| s.roll_rad)].map(f64::to_degrees))
    };
    let mut fine = Robot::published();
    (fine.solver.step_rad, fine.solver.step_error, fine.solver.tolerance) = (0.15, 2e-4, 0.01);
    let (usual, fine) = (means(&Robot::published()), means(&fine));
    let check = |name: &str, measured: f64, bound: f64| {
        prove(&format!("full ({}, {}), contact: {name} against short steps", rpm[0], rpm[1]), measured, bound);
    };
    let scale = fine.0[0].abs().max(fine.0[1].abs());
    let thrust = (0..2).map(|k| (usual.0[k] - fine.0[k]).abs()).fold(0.0, f64::max);
    check("mean thrust, relative", thrust / scale, 0.01);
    for (c, name) in ["yaw", "pitch", "roll"].into_iter().enumerate() {
        check(&format!("{name}, degrees"), (usual.1[c] - fine.1[c]).abs(), 0.1);
    }
}

#[test]
fn paper_never_settles() {
    // The printed equations have nothing that stops a constant yaw moment but the base's drag: the rate
    // about z_B becomes that moment over the drag.
    let robot = Robot::published();
    let profile = SpeedProfile::constant([50.0, 10.0], 60.0).expect("a profile");
    let options = Options { rate_hz: 200.0, shapes: false };
    let mut trial = Trial::new(&robot, Closure::Paper, profile, options).expect("parameters");
    let samples = trial.by_ref().collect::<Result<Vec<_>, _>>().expect("a run");
    let steady = trial.summary().steady;
    println!("paper (50, 10): yaw {:.0} deg and turning after 60 s", steady.attitude[0].mean.to_degrees());
    assert!(!steady.settled);
    assert!(steady.attitude[0].mean.abs() > std::f64::consts::TAU);
    let last: Vec<_> = samples.iter().filter(|s| s.time_s > 48.0).collect();
    let mean = |sum: f64| sum / last.len() as f64;
    let rate = mean(last.iter().map(|s| s.rate_rad_s[2]).sum());
    let couple =
        mean(last.iter().map(|s| (s.force_n[0][1] - s.force_n[1][1]) * 0.5 * robot.base.motor_distance_m).sum());
    prove(
        "paper: rate about z_B against the mean couple over the drag, relative",
        (rate * robot.base_drag() / couple - 1.0).abs(),
        0.02,
    );
}

#[test]
fn valleys_of_the_published_map() {
    // From equal angles |pitch| is least where both speeds are equal; |yaw| near opposite speeds, not on them: of a
    // right-handed pair at (-w, w) one pulls and one pushes, which is not symmetric.
    let steady = |rpm: [f64; 2]| {
        let profile = SpeedProfile::constant(rpm, 60.0).expect("a profile");
        let mut trial =
            Trial::new(&Robot::published(), Closure::Full, profile, Options::default()).expect("parameters");
        let steady = trial.finish().expect("a run").steady;
        steady.attitude.map(|l| l.mean.to_degrees())
    };
    let pitch = [30.0, 40.0, 50.0].map(|w| steady([w, 40.0])[1]);
    println!("pitch at (30, 40), (40, 40), (50, 40): {pitch:.2?} deg");
    prove("map: |pitch| on w2 = w1 over its neighbours", pitch[1].abs() / pitch[0].abs().min(pitch[2].abs()), 0.1);
    let speeds = [20.0, 30.0, 40.0, 50.0, 60.0];
    let yaw = speeds.map(|w| steady([-40.0, w])[0]);
    println!("yaw at (-40, {speeds:?}): {yaw:.2?} deg");
    let crossing = (1..5).find(|&i| yaw[i - 1] * yaw[i] <= 0.0).expect("the yaw changes its sign");
    let share = yaw[crossing - 1] / (yaw[crossing - 1] - yaw[crossing]);
    let least = speeds[crossing - 1] + share * (speeds[crossing] - speeds[crossing - 1]);
    println!("no yaw at (-40, {least:.1})");
    prove("map: valley of |yaw| from w2 = -w1, rpm", (least - 40.0).abs(), 10.0);
}
