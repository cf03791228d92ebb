//! The published map: w1 in -90..90 rpm, w2 in 0..90 rpm, step 10, 120 s each.
//!
//! `cargo run --release -p sim --example map -- full 2 > map.csv` (closure, threads): one line a point
//! on stdout, totals on stderr.

use sim::body::closure::Closure;
use sim::params::Robot;
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Trial};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let closure = match arguments.first().map(String::as_str) {
        Some("lumped") => Closure::Lumped,
        Some("paper") => Closure::Paper,
        Some("held") => Closure::Held,
        _ => Closure::Full,
    };
    let threads: usize = arguments.get(1).and_then(|a| a.parse().ok()).unwrap_or(2);
    let every: usize = arguments.get(2).and_then(|a| a.parse().ok()).unwrap_or(1);
    let points: Vec<[f64; 2]> =
        (-9..=9).flat_map(|i| (0..=9).map(move |j| [10.0 * i as f64, 10.0 * j as f64])).step_by(every).collect();
    println!(
        "w1_rpm,w2_rpm,yaw_deg,pitch_deg,roll_deg,settled,settle_s,contact_share,first_contact_s,min_gap_mm,largest_contact_mn,bundling,real_time_factor,error"
    );
    let robot = Robot::published();
    let (next, failed) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let start = Instant::now();
    let work = || {
        while let Some(rpm) = points.get(next.fetch_add(1, Ordering::Relaxed)) {
            let profile = SpeedProfile::constant(*rpm, 120.0).expect("a profile");
            let began = Instant::now();
            let mut trial = Trial::new(&robot, closure, profile, Options::default()).expect("parameters");
            let error = trial.finish().err().map(|e| e.to_string()).unwrap_or_default();
            failed.fetch_add(usize::from(!error.is_empty()), Ordering::Relaxed);
            let s = trial.summary();
            let [yaw, pitch, roll] = s.steady.attitude.map(|l| l.mean.to_degrees());
            println!(
                "{},{},{yaw:.3},{pitch:.3},{roll:.3},{},{:.1},{:.3},{:.2},{:.4},{:.2},{:?},{:.0},{error}",
                rpm[0],
                rpm[1],
                s.steady.settled,
                s.steady.settle_s,
                s.contact_share,
                s.first_contact_s.unwrap_or(f64::NAN),
                s.min_gap_m * 1e3,
                s.largest_contact_n * 1e3,
                s.bundling,
                s.simulated_s / began.elapsed().as_secs_f64(),
            );
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(work);
        }
    });
    let wall = start.elapsed().as_secs_f64();
    let simulated = 120.0 * points.len() as f64;
    eprintln!("{} points in {wall:.1} s: {:.0} x, {} failed", points.len(), simulated / wall, failed.into_inner());
}
