//! Findings about the averaging window of the steady angles.

use super::{REPEAT, Rule, Section};
use crate::text::decimal;
use crate::trial::angles::Steady;
use crate::trial::data::Data;
use crate::trial::finding::FindingKind::Window;
use crate::trial::usable::OVERTURNED;
use crate::trial::zero::Zeroed;
use protocol::units::CentiRpm;
use std::ops::Range;

/// Smallest share of the averaging time that must have telemetry.
const LEAST_SHARE: f64 = 0.9;

/// Time between readings above which telemetry counts as missing, s: ten frames of a board.
const GAP_S: f64 = 0.05;

pub(super) const SECTION: Section = Section { is_judged: |_| true, rules: RULES };

static RULES: &[Rule] = &[
    Rule::warning(Window, OVERTURNED, |data, _| data.upright().err().map(|error| error.reason)),
    Rule::loss(Window, "give the trial a longer run, unless a motor stopped before its end", |data, zeroed| {
        zeroed.steady.as_ref().and_then(|steady| unsettled(data, steady))
    }),
    Rule::warning(Window, REPEAT, |data, zeroed| {
        zeroed.steady.as_ref().and_then(|steady| missing(data, zeroed, &steady.window))
    }),
];

fn unsettled(data: &Data, steady: &Steady) -> Option<String> {
    if steady.settled || data.speeds() == [CentiRpm(0); 2] {
        return None;
    }
    let window_s = steady.window.end - steady.window.start;
    Some(if let Some(known) = steady.of_model {
        let largest = decimal(known[..3].iter().copied().fold(0.0, f64::max), 2);
        format!(
            "not settled: the attitude still changes slowly at the end of the run, where it is known to ± {largest}° (the largest \
             of yaw, pitch and roll)"
        )
    } else if window_s > 0.0 {
        format!("not settled: the angles are means over the last {window_s:.1} s, not steady values")
    } else {
        "not settled: the run ends as a motor reverses, and the angles are those of its end".to_owned()
    })
}

/// Returns the share of the window with readings, in words, if it is too small.
fn missing(data: &Data, zeroed: &Zeroed, window: &Range<f64>) -> Option<String> {
    let window_s = window.end - window.start;
    if data.is_model() || window_s <= 0.0 {
        return None;
    }
    let longest_s = zeroed.angles_deg.longest_step_s().unwrap_or_default();
    let gap_s = if data.is_recorded() { GAP_S } else { longest_s };
    let inside = zeroed.angles_deg.time_s.iter().filter(|time| window.contains(time)).copied();
    let ends = std::iter::once(window.start).chain(inside).chain([window.end]);
    let missing_s: f64 = ends.clone().zip(ends.skip(1)).map(|(from, to)| to - from).filter(|s| *s > gap_s).sum();
    let (share, [what, _]) = (1.0 - missing_s / window_s, data.lacking());
    (share < LEAST_SHARE).then(|| format!("only {:.0} % of the last {window_s:.1} s have {what}", 100.0 * share))
}
