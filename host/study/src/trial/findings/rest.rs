//! Findings about the still phases from which zero and drift are estimated.

use super::{Rule, Section};
use crate::attitude::Motion;
use crate::trial::back_at_zero::{self, NotBack};
use crate::trial::data::Data;
use crate::trial::finding::FindingKind::{Rest, Return};
use crate::trial::rest::{AtRest, Unknown};
use crate::trial::zero::Zeroed;
use biflag_log::RestMeta;
use protocol::units::CentiRpm;

/// Bound on the motion before a run, relative to the limits of a still robot. Below it the numbers are right within their
/// uncertainty, because the fit of the return to rest covers the motion after a wait.
const GRAVE: f64 = 4.0;

const WAIT: &str = "let the robot come to rest, or give the plan a longer rest_at_most";
const LONG_PREROLL: &str = "give the plan a pre-roll of 20 s";
const LONG_REST: &str = "give the plan a calibration of 5 s, or a pre-roll of 20 s";
const AT_MOST: &str = "let the robot come to rest before the trial: see rest_at_most in the plan";
const LONGER: &str = "let the robot rest longer before the run, or name an earlier start with --run";

pub(super) const SECTION: Section = Section { is_judged: |_| true, rules: RULES };

static RULES: &[Rule] = &[
    Rule::warning(Rest, WAIT, |data, _| waited(data, true)),
    Rule::note(Rest, WAIT, |data, _| waited(data, false)),
    Rule::note(Rest, WAIT, |data, _| {
        let rest = not_still(data).filter(|rest| motion(rest).is_none())?;
        let waited_s = rest.waited_s;
        Some(format!("the wait of {waited_s:.1} s was too short to tell whether the robot was still"))
    }),
    Rule::warning(Rest, LONG_REST, |_, zeroed| match zeroed.rest {
        AtRest { unknown: Some(Unknown::Bias(dps)), still_s, .. } => Some(format!(
            "the gyroscope turns the yaw by {dps:.2} °/s of its own: it was not calibrated, and the still phase of {still_s:.1} \
             s before the run is too short to remove its bias"
        )),
        _ => None,
    }),
    Rule::warning(Rest, LONG_REST, |_, zeroed| {
        (zeroed.rest.unknown == Some(Unknown::NoRest)).then(|| {
            "there is neither a calibration nor a still phase before the run: the gyroscope's bias is in the yaw, and nothing \
             shows how large it is"
                .to_owned()
        })
    }),
    Rule::note(Rest, LONG_PREROLL, |_, zeroed| {
        (zeroed.rest.unknown == Some(Unknown::NoStill)).then(|| {
            "there is no still phase before the run: the zero is the attitude at its start, and the uncertainty of the yaw is \
             unknown"
                .to_owned()
        })
    }),
    Rule::note(Rest, LONG_PREROLL, |_, zeroed| match zeroed.rest {
        AtRest { unknown: Some(Unknown::Short(dps)), still_s, .. } => {
            let rate = dps.map_or_else(String::new, |dps| format!(" of about {dps:.2} °/s"));
            Some(format!(
                "the still phase of {still_s:.1} s before the run is too short to show drift and noise: the drift{rate} is not \
                 removed, and the uncertainties are unknown"
            ))
        }
        _ => None,
    }),
    Rule::note(Rest, "give the plan a calibration of 5 s", |_, zeroed| {
        (zeroed.rest.unknown == Some(Unknown::Lateral)).then(|| {
            "the gyroscope was not calibrated, and the still phases are too short to show its bias about the body's x and y: \
             the uncertainty of the yaw is unknown"
                .to_owned()
        })
    }),
    Rule::warning(Rest, LONG_REST, |_, zeroed| match zeroed.rest.tilt_changed {
        Some((deg, true)) => Some(format!(
            "the board's filter had not settled before the run: the tilt that it states changed by {deg:.1} degrees"
        )),
        _ => None,
    }),
    Rule::warning(Rest, "let it hang for longer before the trial", |_, zeroed| match zeroed.rest.tilt_changed {
        Some((deg, false)) => {
            Some(format!("the robot was not still before the run: its tilt changed by {deg:.1} degrees"))
        }
        _ => None,
    }),
    Rule::warning(Rest, AT_MOST, |_, zeroed| {
        let dps = zeroed.rest.turned_dps?;
        Some(format!(
            "the robot was not still during the calibration or after it: the yaw turned at {dps:.2} °/s at rest"
        ))
    }),
    Rule::warning(Rest, AT_MOST, |_, zeroed| {
        let dps = zeroed.rest.turning_dps?;
        Some(format!("the yaw still turned at {dps:.2} °/s when the run began"))
    }),
    Rule::note(Rest, "", |data, zeroed| {
        let ([what, verb], lost) = (data.lacking(), zeroed.rest.lost.as_ref()?);
        let [start, end] = [lost.start, lost.end].map(|time_s| data.by_table_s(time_s));
        Some(format!(
            "{what} {verb} missing from {start:.2} s to {end:.2} s, where the run starts: yaw, pitch and roll are relative to \
             the rest before {start:.2} s"
        ))
    }),
    Rule::law(Return, "check how robot and sensor are fastened, and repeat the trial", not_back),
    Rule::note(
        Rest,
        "import a table that begins a second before the motors start, or name the run with --run",
        |_, zeroed| {
            let text = "no rest before the run: pitch and roll are those of the table, the yaw is relative to the start of the run, and \
                        how far they are from those relative to a rest is unknown";
            zeroed.rest.is_missing.then(|| text.to_owned())
        },
    ),
    Rule::warning(Rest, LONGER, |_, zeroed| moved(zeroed, true)),
    Rule::note(Rest, LONGER, |_, zeroed| moved(zeroed, false)),
];

fn not_back(data: &Data, zeroed: &Zeroed) -> Result<Option<String>, &'static str> {
    let is_of_robot = data.times.has_run() && data.speeds() != [CentiRpm(0); 2];
    if is_of_robot && back_at_zero::is_short(&(data.times.decay.start..data.times.decay.end.min(zeroed.span().end))) {
        return Err("no rest after the run");
    }
    let sensor = match data.is_recorded() {
        true => "sensor has moved, or the gyroscope's bias has changed",
        false => "instrument has moved",
    };
    Ok(zeroed.rest.not_back.map(|NotBack { angle, after_s, end_deg, nearest_deg }| {
        format!(
            "the {angle} does not come back: {after_s:.1} s after the run it is {end_deg:.1} degrees, where at most \
             {nearest_deg:.1} can be left; the zero or the {sensor}"
        )
    }))
}

fn not_still(data: &Data) -> Option<&RestMeta> {
    data.records.rest.as_ref().filter(|rest| !rest.still)
}

fn motion(rest: &RestMeta) -> Option<Motion> {
    Some(Motion { yaw_dps: rest.yaw_dps?, tilt_dps: rest.tilt_dps? })
}

/// Describes the motion of the robot after the recorder's wait for its rest, either a grave or a slight one.
fn waited(data: &Data, is_grave: bool) -> Option<String> {
    let rest = not_still(data)?;
    let Motion { yaw_dps, tilt_dps } = motion(rest).filter(|motion| (motion.relative() > GRAVE) == is_grave)?;
    let waited_s = rest.waited_s;
    Some(format!(
        "the robot was not still after a wait of {waited_s:.1} s: its yaw turned at up to {yaw_dps:.2} °/s, its tilt at up to \
         {tilt_dps:.2} °/s"
    ))
}

/// Describes the motion of an imported robot before its run, either a grave or a slight one.
fn moved(zeroed: &Zeroed, is_grave: bool) -> Option<String> {
    let motion = zeroed.rest.motion.filter(|motion| (motion.relative() > GRAVE) == is_grave)?;
    let [yaw, tilt] = [Motion { tilt_dps: 0.0, ..motion }, Motion { yaw_dps: 0.0, ..motion }];
    let moved: Vec<String> = [("yaw", yaw, motion.yaw_dps), ("tilt", tilt, motion.tilt_dps)]
        .iter()
        .filter(|(_, alone, _)| alone.relative() > 1.0)
        .map(|(name, _, dps)| format!("its {name} turned at {dps:.2} °/s or more"))
        .collect();
    Some(format!("the robot was not still before the run: {}", moved.join(", ")))
}
