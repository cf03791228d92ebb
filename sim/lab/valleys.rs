//! Where the valleys of the published map lie: of |yaw| against w2 = -w1, of |pitch| against w2 = w1.
//!
//! `cargo run --release -p sim --example valleys > sim/docs/valleys.svg`: the map of 190 points as colours and the floors
//! of both valleys, found by search between the grid's points; the same as a table on stderr.

use rayon::prelude::*;
use sim::body::closure::Closure;
use sim::params::Robot;
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Trial};
use std::fmt::Write;

/// Result of a trial of 120 s.
#[derive(Clone, Copy)]
struct Point {
    yaw_deg: f64,
    pitch_deg: f64,
    thrust_mn: [f64; 2],
    /// Parts of the yaw moment about the joint: reaction torques about the shafts, and the rest.
    reaction_nm: f64,
}

fn run([w1, w2]: [f64; 2]) -> Point {
    let profile = SpeedProfile::constant([w1, w2], 120.0).expect("a profile");
    let mut trial =
        Trial::new(&Robot::published(), Closure::Full, profile, Options::default()).expect("the published robot");
    let steady = trial.finish().expect("a run").steady;
    let [yaw_deg, pitch_deg, _] = steady.attitude.map(|level| level.mean.to_degrees());
    Point {
        yaw_deg,
        pitch_deg,
        thrust_mn: [0, 1].map(|k| steady.force[k][2].mean * 1e3),
        reaction_nm: steady.axial_torque[0].mean + steady.axial_torque[1].mean,
    }
}

/// The speed of motor 2 between `low` and `high` at which `value` changes its sign (secant held within the bracket), rpm;
/// NaN where it does not.
fn zero(low: f64, high: f64, value: impl Fn(f64) -> f64) -> f64 {
    let (mut a, mut b) = ((low, value(low)), (high, value(high)));
    if a.1 == 0.0 {
        return a.0;
    }
    if a.1 * b.1 > 0.0 {
        return f64::NAN;
    }
    while (b.0 - a.0).abs() > 0.05 {
        let secant = (a.0 * b.1 - b.0 * a.1) / (b.1 - a.1);
        let margin = 0.1 * (b.0 - a.0);
        let middle = secant.clamp(a.0 + margin, b.0 - margin);
        let new = (middle, value(middle));
        if new.1 * a.1 > 0.0 { a = new } else { b = new }
    }
    (a.0 * b.1 - b.0 * a.1) / (b.1 - a.1)
}

fn main() {
    let grid: Vec<[f64; 2]> =
        (-9..=9).flat_map(|i| (0..=9).map(move |j| [10.0 * f64::from(i), 10.0 * f64::from(j)])).collect();
    let points = grid.par_iter().map(|rpm| run(*rpm)).collect::<Vec<_>>();

    let speeds: Vec<f64> = (1..=9).map(|i| 10.0 * f64::from(i)).collect();
    let yaw: Vec<f64> = speeds.par_iter().map(|w| zero(0.5 * w, 1.5 * w, |w2| run([-w, w2]).yaw_deg)).collect();
    // Nearly equal speeds beat for longer than the means are taken over: the floor is where the line between the points
    // at w - 10 and w + 10 crosses zero.
    let at_pitch = |w: &f64| {
        let [a, b] = [w - 10.0, w + 10.0].map(|w2| run([*w, w2]).pitch_deg);
        w - 10.0 + 20.0 * a / (a - b)
    };
    let pitch: Vec<f64> = speeds.par_iter().map(at_pitch).collect();
    eprintln!(
        "| w1 rpm | least abs(yaw) at w2 rpm | off w2 = -w1 by | at (w1, -w1): yaw deg | thrusts mN | reaction torques on the base mN m |"
    );
    eprintln!("| --- | --- | --- | --- | --- | --- |");
    for (w, w2) in speeds.iter().zip(&yaw) {
        let at = grid.iter().position(|g| *g == [-w, *w]).expect("a point of the grid");
        let Point { yaw_deg, thrust_mn: [f1, f2], reaction_nm, .. } = points[at];
        eprintln!("| {} | {w2:.2} | {:+.2} | {yaw_deg:.2} | {f1:.2}, {f2:.2} | {:.4} |", -w, w2 - w, reaction_nm * 1e3);
    }
    eprintln!(
        "\n| w1 rpm | least abs(pitch) at w2 rpm | off w2 = w1 by | at (w1, w1): pitch deg |\n| --- | --- | --- | --- |"
    );
    for (w, w2) in speeds.iter().zip(&pitch) {
        let at = grid.iter().position(|g| *g == [*w, *w]).expect("a point of the grid");
        eprintln!("| {w} | {w2:.2} | {:+.2} | {:.3} |", w2 - w, points[at].pitch_deg);
    }
    let panel = |label, line, floor: &[f64], sign: f64, value: fn(&Point) -> f64| Panel {
        label,
        line,
        floor: speeds.iter().map(|w| sign * w).zip(floor.iter().copied()).filter(|p| p.1.is_finite()).collect(),
        values: grid.iter().zip(&points).map(|(at, p)| (*at, value(p).abs())).collect(),
    };
    let panels = [
        panel("|yaw|, deg", [[-90.0, 90.0], [0.0, 0.0]], &yaw, -1.0, |p| p.yaw_deg),
        panel("|pitch|, deg", [[0.0, 0.0], [90.0, 90.0]], &pitch, 1.0, |p| p.pitch_deg),
    ];
    print!("{}", svg(&panels));
}

struct Panel {
    label: &'static str,
    /// The line that the publication names.
    line: [[f64; 2]; 2],
    /// Where the valley's floor was found.
    floor: Vec<(f64, f64)>,
    values: Vec<([f64; 2], f64)>,
}

/// Side of a cell of 10 rpm in the drawing.
const CELL: f64 = 24.0;

/// Largest speed of motor 2 within a panel, rpm: the upper edge of its last cells.
const TOP_RPM: f64 = 95.0;

/// Returns the part of a floor (w1, w2) that lies within the panel, up to the edge where it leaves it.
fn within_panel(floor: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut inside: Vec<(f64, f64)> = floor.iter().copied().take_while(|(_, w2)| *w2 <= TOP_RPM).collect();
    if let Some(pair) = floor.windows(2).find(|pair| pair[0].1 <= TOP_RPM && pair[1].1 > TOP_RPM) {
        let [(x0, y0), (x1, y1)] = [pair[0], pair[1]];
        inside.push((x0 + (x1 - x0) * (TOP_RPM - y0) / (y1 - y0), TOP_RPM));
    }
    inside
}

/// Place of a pair of speeds in a panel.
fn place(w1: f64, w2: f64) -> (f64, f64) {
    (50.0 + (w1 + 95.0) * CELL / 10.0, 34.0 + (TOP_RPM - w2) * CELL / 10.0)
}

fn svg(panels: &[Panel]) -> String {
    let (width, height) = (50.0 + 19.0 * CELL + 80.0, 34.0 + 10.0 * CELL + 50.0);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {}\" font-family=\"sans-serif\" font-size=\"11\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n",
        height * panels.len() as f64
    );
    for (i, panel) in panels.iter().enumerate() {
        let _ = writeln!(out, "<g transform=\"translate(0 {})\">", height * i as f64);
        draw(panel, &mut out);
        out += "</g>\n";
    }
    out + "</svg>\n"
}

fn draw(panel: &Panel, out: &mut String) {
    // Large values would hide the valley.
    let mut sorted: Vec<f64> = panel.values.iter().map(|v| v.1).collect();
    sorted.sort_by(f64::total_cmp);
    let top = sorted[sorted.len() * 9 / 10];
    let _ = writeln!(out, "<text x=\"50\" y=\"20\" font-size=\"13\">{}</text>", panel.label);
    for ([w1, w2], value) in &panel.values {
        let (x, y) = place(w1 - 5.0, w2 + 5.0);
        let _ = writeln!(
            out,
            "<rect x=\"{x:.0}\" y=\"{y:.0}\" width=\"{CELL}\" height=\"{CELL}\" fill=\"{}\"><title>({w1}, {w2}) rpm: {value:.2}</title></rect>",
            colour(value / top)
        );
    }
    for w in (-9..=9).map(|i| 10.0 * f64::from(i)) {
        let (x, y) = place(w, -9.0);
        let _ = writeln!(out, "<text x=\"{x:.0}\" y=\"{y:.0}\" text-anchor=\"middle\">{w}</text>");
        if w >= 0.0 {
            let (x, y) = place(-97.0, w - 1.5);
            let _ = writeln!(out, "<text x=\"{x:.0}\" y=\"{y:.0}\" text-anchor=\"end\">{w}</text>");
        }
    }
    let (x, y) = place(0.0, -17.0);
    let _ = writeln!(out, "<text x=\"{x:.0}\" y=\"{y:.0}\" text-anchor=\"middle\">w1, rpm</text>");
    let (x, y) = place(-110.0, 45.0);
    let _ =
        writeln!(out, "<text transform=\"translate({x:.0} {y:.0}) rotate(-90)\" text-anchor=\"middle\">w2, rpm</text>");
    let [(x1, y1), (x2, y2)] = panel.line.map(|[w1, w2]| place(w1, w2));
    let _ = writeln!(
        out,
        "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"#222\" stroke-dasharray=\"5 4\"/>"
    );
    let text = |(w1, w2): &(f64, f64)| {
        let (x, y) = place(*w1, *w2);
        format!("{x:.1},{y:.1}")
    };
    let floor: Vec<String> = within_panel(&panel.floor).iter().map(text).collect();
    let _ =
        writeln!(out, "<polyline points=\"{}\" fill=\"none\" stroke=\"#d7301f\" stroke-width=\"2\"/>", floor.join(" "));
    for (w1, w2) in panel.floor.iter().filter(|(_, w2)| *w2 <= TOP_RPM) {
        let (x, y) = place(*w1, *w2);
        let _ = writeln!(out, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\" fill=\"#d7301f\"/>");
    }
    for (i, share) in [0.0, 0.25, 0.5, 0.75, 1.0].into_iter().enumerate() {
        let (x, y) = place(102.0, 15.0 + 20.0 * i as f64);
        let _ =
            writeln!(out, "<rect x=\"{x:.0}\" y=\"{y:.0}\" width=\"18\" height=\"18\" fill=\"{}\"/>", colour(share));
        let more = if share == 1.0 { "+" } else { "" };
        let _ = writeln!(out, "<text x=\"{:.0}\" y=\"{:.0}\">{:.0}{more}</text>", x + 23.0, y + 13.0, share * top);
    }
}

/// White to blue.
fn colour(share: f64) -> String {
    let s = share.clamp(0.0, 1.0);
    let mix = |from: f64, to: f64| (from + (to - from) * s).round() as u8;
    format!("#{:02x}{:02x}{:02x}", mix(255.0, 8.0), mix(255.0, 64.0), mix(240.0, 129.0))
}
