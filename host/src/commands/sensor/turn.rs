//! `biflag sensor turn`: the gyroscope's scale about an axis, by turns of the hand.

use super::super::options::within;
use super::bench::{Bench, Common, Measured, Told, finish, percent};
use crate::commands::answer::{Answer, wrong_use};
use crate::run::rig::{VirtualError, VirtualNano};
use serde_json::json;
use study::plan::Axis;
use study::sensor::{AXES, TurnPlan, TurnResult, TurnStep, TurnWatch};

/// Mean speed at which the emulated hand turns, °/s.
const HAND_DPS: f64 = 60.0;

/// Measure the gyroscope's scale: turn the sensor by hand about a vertical axis, forwards and back.
#[derive(clap::Args, Debug)]
#[command(
    after_help = "Lay a straight edge of the sensor's board against a fixed edge on a flat table, with the axis \
    vertical. Turn it by whole turns, back against the edge, and let it rest; then turn it back. No key is needed: the \
    program sees when it rests and when it turns.\n\nExample: biflag sensor turn z --repeats 5"
)]
pub struct Args {
    /// The body axis that is vertical.
    #[arg(value_parser = parse_axis)]
    axis: Axis,
    /// Angle of each turn, degrees.
    #[arg(default_value_t = 720.0, value_parser = within("an angle in degrees", 0.01..=36_000.0))]
    degrees: f64,
    /// Times to turn forwards and back.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u16).range(1..=100))]
    repeats: u16,
    /// Largest error of the angle between the marks, degrees.
    #[arg(long, value_name = "DEGREES", default_value_t = 1.0, value_parser = within("an angle in degrees", 0.01..=36_000.0))]
    reference: f64,
    #[command(flatten)]
    common: Common,
}

fn parse_axis(text: &str) -> Result<Axis, String> {
    let axes = AXES.into_iter().zip([Axis::X, Axis::Y, Axis::Z]);
    axes.into_iter().find_map(|(name, axis)| (name == text).then_some(axis)).ok_or_else(|| "give x, y or z".to_owned())
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let axis = args.axis as usize;
    if args.degrees < 90.0 {
        return Err(wrong_use(format!("{}° are too few", args.degrees), "turn by 360° or more"));
    }
    let plan = TurnPlan { axis, degrees: args.degrees, turns: 2 * usize::from(args.repeats) };
    let mut bench = Bench::open(&args.common, &format!("turn {}", AXES[axis]))?;
    let mut watch = TurnWatch::new(plan);
    let mut hand = Hand { plan, ordered: 0, is_replay: bench.is_replay };
    if let Some(nano) = bench.nano.as_mut().filter(|_| axis != 2) {
        nano.pose(&format!("+{}", AXES[axis]), 2.0)?;
        // The emulated hand reaches the pose before the first rest.
    }
    let followed = bench.follow(plan.turns as f64, |reading, nano, progress| {
        let before = watch.count();
        let step = watch.push(reading)?;
        if watch.count() > before {
            progress.end_trial(1.0);
        }
        if let Some(nano) = nano {
            hand.follow(step, watch.count(), nano)?;
        }
        let instruction = instruction(step, &plan, watch.count());
        Ok(Told { instruction, figures: figures(step), is_done: step == TurnStep::Done })
    })?;
    // The emulated board runs at its own speed, so the error of its clock cannot be measured. It would otherwise be part of the
    // sensor's scale, and a trial in real time would correct it a second time.
    let of_emulated = bench.nano.as_ref().map(|nano| nano.sensor.board_clock_error);
    let clock_error = followed.clock_error.or(of_emulated).unwrap_or(0.0);
    let result = watch.result(args.reference, &bench.file, clock_error)?;
    result.enter(axis, &mut bench.file);
    finish(&mut bench, described(&result, &plan), &followed)
}

fn instruction(step: TurnStep, plan: &TurnPlan, count: usize) -> String {
    let number = format!("turn {} of {}", count + 1, plan.turns);
    let degrees = plan.degrees;
    let way = match (count, count % 2) {
        (0, _) => "counter-clockwise, seen from above",
        (_, 1) => "back",
        _ => "forwards",
    };
    match step {
        TurnStep::Rest { .. } => "keep it still against the edge".to_owned(),
        TurnStep::Ready => format!("{number}: turn it by {degrees}° {way}, and let it rest against the edge"),
        TurnStep::Turning { .. } => format!("{number}: it turns; go on to {degrees}°"),
        TurnStep::Stopped { angle_deg } => format!("{number}: it stopped at {angle_deg:.0}°; go on to {degrees}°"),
        TurnStep::Done => "done".to_owned(),
    }
}

fn figures(step: TurnStep) -> String {
    match step {
        TurnStep::Rest { left_s } => format!("still, {left_s:.1} s to go"),
        TurnStep::Ready => "still: ready to turn".to_owned(),
        TurnStep::Turning { angle_deg } => format!("turning: {angle_deg:.1}°"),
        TurnStep::Stopped { angle_deg } => format!("still at {angle_deg:.1}°"),
        TurnStep::Done => String::new(),
    }
}

/// Describes the result.
fn described(result: &TurnResult, plan: &TurnPlan) -> Measured {
    let axis = AXES[plan.axis];
    let mut text = format!("scale of the gyroscope about {axis}: {} (95 %)\n", percent(result.scale));
    let turned: Vec<_> = result.turned_deg.iter().map(|angle| study::text::signed(*angle, 2)).collect();
    text += &format!("  turned {}° as read\n", turned.join(", "));
    match (result.scatter_u, result.stops_deg) {
        (Some(u), Some(stops)) => {
            text += &format!(
                "  the stops scatter by {stops:.2}°: ± {:.3} %, by Student's distribution with {} degrees of freedom\n",
                196.0 * u,
                result.freedom
            );
        }
        _ => text += "  one turn alone has no scatter: how well it stopped at the mark is not known\n",
    }
    text += &format!("  the angle between the marks: ± {:.3} %\n", 196.0 * result.reference_u);
    for (i, cross) in result.cross.iter().enumerate() {
        if let Some(cross) = cross {
            text += &format!("share of the rate about {axis} that {} reads: {}\n", AXES[i], percent(*cross));
        }
    }
    let mut warnings = Vec::new();
    if result.turned_deg.len() < plan.turns {
        warnings.push(format!("{} of {} turns were made", result.turned_deg.len(), plan.turns));
    }
    if !result.is_consistent {
        warnings.push(
            "the first turn was clockwise, seen from above, or the settings gyro_axes and accel_axes contradict each other; \
             the shares of the other axes are not known"
                .to_owned(),
        );
    }
    let turns = json!({
        "turned_deg": result.turned_deg,
        "scatter_u": result.scatter_u,
        "freedom": result.freedom,
        "stops_deg": result.stops_deg,
        "reference_u": result.reference_u,
    });
    Measured { text, json: json!({ "turns": turns }), warnings }
}

/// The hand of the emulated board.
struct Hand {
    plan: TurnPlan,
    /// Turns ordered so far.
    ordered: usize,
    is_replay: bool,
}

impl Hand {
    /// Turns the emulated sensor when the program asks for it.
    fn follow(&mut self, step: TurnStep, count: usize, nano: &mut VirtualNano) -> Result<(), VirtualError> {
        if step != TurnStep::Ready || self.ordered > count || (self.is_replay && self.ordered > 0) {
            return Ok(());
        }
        self.ordered += 1;
        if self.is_replay {
            return nano.control("play").map(drop);
        }
        let TurnPlan { axis, degrees, .. } = self.plan;
        let sign = if count.is_multiple_of(2) { 1.0 } else { -1.0 };
        let name = AXES[axis].chars().next().unwrap_or('z');
        nano.turn(name, sign * degrees, degrees / HAND_DPS).map(drop)
    }
}
