//! The differences of a session's trials as a sentence.

use super::comparison::{Chance, SessionAngle};
use crate::text::{capitalised, count, listed};
use crate::twin::{Comparison, Sides, Unjudged};

const ANGLES: [&str; 3] = ["yaw", "pitch", "roll"];

/// Returns the verdict.
pub(super) fn verdict(trials: &[Comparison], angles: &[SessionAngle], chance: Option<&Chance>) -> String {
    let is_unknown = |trial: &&Comparison| trial.angles.iter().any(|angle| angle.uncertainty.is_none());
    let unknown = trials.iter().filter(is_unknown).count();
    let all = count(trials.len(), "trial");
    let what = match unknown_angles(trials).as_slice() {
        names if names.len() == ANGLES.len() => "the uncertainty".to_owned(),
        names => format!("the uncertainty of {}", listed(names)),
    };
    // A measured angle may differ although another one was not measured.
    if unknown == trials.len() && trials.iter().all(Comparison::agrees) {
        return format!("{} is unknown in all of {all}", capitalised(&what));
    }
    let mut clauses = vec![differing(trials)];
    clauses.extend(together(angles));
    clauses.extend(chance.and_then(by_chance));
    if unknown > 0 {
        clauses.push(format!("{what} is unknown in {unknown} of {all}"));
    }
    capitalised(&clauses.join("; "))
}

/// Returns the angles whose uncertainty is unknown in a trial.
fn unknown_angles(trials: &[Comparison]) -> Vec<&'static str> {
    let is_unknown = |k: &usize| trials.iter().any(|trial| trial.angles[*k].uncertainty.is_none());
    (0..ANGLES.len()).filter(is_unknown).map(|k| ANGLES[k]).collect()
}

fn differing(trials: &[Comparison]) -> String {
    let all = count(trials.len(), "trial");
    let steady = trials.iter().filter(|trial| !trial.differences.is_empty()).count();
    let transient = trials.iter().filter(|trial| !trial.transients_agree()).count();
    if steady == 0 {
        let is_known = |trial: &Comparison| trial.angles.iter().all(|angle| angle.uncertainty.is_some());
        let known = trials.iter().filter(|trial| is_known(trial)).count();
        let number = if known == trials.len() { format!("all of {all}") } else { format!("{known} of {all}") };
        let smallest = smallest(trials);
        let unjudged = |why: Unjudged| {
            let of_it = |trial: &&Comparison| is_known(trial) && trial.unjudged == Some(why);
            let found = trials.iter().filter(of_it).count();
            (found > 0).then(|| format!("; {} in {found} of {all}", why.text()))
        };
        let unjudged: String = Unjudged::ALL.into_iter().filter_map(unjudged).collect();
        let steady = format!("the steady states agree in {number}{smallest}");
        return match transient {
            0 if unjudged.is_empty() => format!("{} agree in {number}{smallest}", Sides::of_all(trials)),
            0 => format!("{steady}{unjudged}"),
            _ => format!("{steady}; the transients differ in {transient} of {all}"),
        };
    }
    let mut text = format!("{steady} of {all} differ by more than the measured ±");
    for angle in ANGLES {
        let found: Vec<_> = trials.iter().flat_map(|trial| &trial.differences).filter(|f| f.angle == angle).collect();
        if let Some(worst) = found.iter().max_by(|a, b| a.error_deg.abs().total_cmp(&b.error_deg.abs())) {
            let (found, worst) = (count(found.len(), "trial"), worst.error_deg.abs());
            text += &format!(", {angle} in {found} by at most {worst:.2}°");
        }
    }
    if transient > 0 {
        text += &format!("; the transients differ in {transient} of {all}");
    }
    text
}

/// Returns the smallest differences that the trials could show.
fn smallest(trials: &[Comparison]) -> String {
    let of_angle = |k: usize| {
        let each = trials.iter().filter_map(|trial| trial.angles[k].uncertainty.filter(|all| all.total_deg > 0.0));
        let [low, high] =
            each.fold([f64::INFINITY, 0.0], |[low, high], all| [low.min(all.total_deg), high.max(all.total_deg)]);
        let range = if format!("{low:.2}") == format!("{high:.2}") {
            format!("±{low:.2}°")
        } else {
            format!("±{low:.2}° to ±{high:.2}°")
        };
        (high > 0.0).then(|| format!("{range} of {}", ANGLES[k]))
    };
    let parts: Vec<String> = [0, 1, 2].into_iter().filter_map(of_angle).collect();
    if parts.is_empty() {
        String::new()
    } else {
        format!(" within {}, the smallest differences that they could show", listed(&parts))
    }
}

/// Returns the differences of all trials together.
fn together(angles: &[SessionAngle]) -> Option<String> {
    let one = |angle: &SessionAngle| {
        let SessionAngle { angle: name, mean_error_deg, mean_uncertainty_deg, rms_error_deg, rms_allowed_deg, .. } =
            angle;
        match (mean_error_deg.abs() > *mean_uncertainty_deg, rms_error_deg > rms_allowed_deg) {
            (true, _) => Some(format!("{name} by {mean_error_deg:+.2}° ± {mean_uncertainty_deg:.2}° on average")),
            (false, true) => {
                Some(format!("{name} by {rms_error_deg:.2}° RMS, where {rms_allowed_deg:.2}° are allowed"))
            }
            _ => None,
        }
    };
    // A single trial has its own verdict.
    let found: Vec<String> = angles.iter().filter(|angle| angle.trials > 1).filter_map(one).collect();
    (!found.is_empty()).then(|| format!("all trials together differ in {}", listed(&found)))
}

fn by_chance(chance: &Chance) -> Option<String> {
    let Chance { tests, alarms, expected_alarms, beyond } = chance;
    let all = format!("of {tests} tests, {expected_alarms:.1} alarms are expected by chance");
    match (alarms, beyond.len()) {
        (0, _) => None,
        (_, 0) => Some(format!("{all}, {alarms} found, none beyond chance")),
        (_, flagged) => Some(format!("{all}, {alarms} found, beyond chance in {}", count(flagged, "trial"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::{AngleComparison, Difference, Transient, Uncertainty};

    fn trial(total_deg: f64) -> Comparison {
        let angle = |angle: &'static str| AngleComparison {
            angle,
            uncertainty: Some(Uncertainty { total_deg, ..Uncertainty::default() }),
            transient: Some(Transient::default()),
            ..AngleComparison::default()
        };
        Comparison { angles: ANGLES.map(angle), ..Comparison::default() }
    }

    fn said(trials: &[Comparison]) -> String {
        verdict(trials, &[], None)
    }

    #[test]
    fn agreement_is_claimed_only_where_the_uncertainty_is_known() {
        let (known, wide) = (trial(0.5), trial(1.5));
        let mut unknown = trial(0.5);
        unknown.angles[0].uncertainty = None;
        assert_eq!(
            said(&[known.clone(), wide]),
            "Model and measurement agree in all of 2 trials within ±0.50° to ±1.50° of yaw, ±0.50° to ±1.50° of pitch and \
             ±0.50° to ±1.50° of roll, the smallest differences that they could show"
        );
        assert_eq!(said(&[unknown.clone(), unknown.clone()]), "The uncertainty of yaw is unknown in all of 2 trials");
        let mut nothing = unknown.clone();
        (nothing.angles[1].uncertainty, nothing.angles[2].uncertainty) = (None, None);
        assert_eq!(said(&[nothing.clone(), nothing]), "The uncertainty is unknown in all of 2 trials");
        // Differences are stated even if another angle is unknown.
        let mut apart = unknown.clone();
        apart.differences = vec![Difference { angle: "pitch", error_deg: 2.0, ..Difference::default() }];
        let apart = said(&[apart, unknown.clone()]);
        assert!(apart.starts_with("1 of 2 trials differ by more than the measured ±, pitch in 1 trial"), "{apart}");
        assert!(apart.ends_with("; the uncertainty of yaw is unknown in 2 of 2 trials"), "{apart}");
        let model = Comparison { sides: Sides::Models, ..trial(0.0) };
        assert_eq!(said(&[model.clone(), model.clone()]), "The two models agree in all of 2 trials");
        assert!(said(&[model, trial(0.0)]).starts_with("Both sides agree"));
        assert!(said(&[known.clone(), unknown]).ends_with("; the uncertainty of yaw is unknown in 1 of 2 trials"));
        let mut short = trial(0.5);
        short.angles.iter_mut().for_each(|angle| angle.transient = None);
        short.unjudged = Some(Unjudged::Short);
        let short = said(&[known, short]);
        assert!(short.starts_with("The steady states agree in all of 2 trials"), "{short}");
        assert!(short.ends_with("; the run is too short to judge the transients in 1 of 2 trials"), "{short}");
    }

    #[test]
    fn verdict_says_what_differs_in_how_many_trials() {
        let mut steady = trial(0.5);
        steady.differences = vec![Difference { angle: "yaw", error_deg: -3.0, ..Difference::default() }];
        let mut transient = trial(0.5);
        transient.angles[1].transient = Some(Transient { residual_deg: 2.0, allowed_deg: 0.3, ..Transient::default() });
        let agreeing = said(&[trial(0.5), transient.clone()]);
        assert!(agreeing.starts_with("The steady states agree in all of 2 trials within"), "{agreeing}");
        assert!(agreeing.ends_with("; the transients differ in 1 of 2 trials"), "{agreeing}");
        let chance = Chance { tests: 9, alarms: 1, expected_alarms: 0.45, beyond: vec!["a".to_owned()] };
        let yaw = SessionAngle {
            angle: "yaw",
            trials: 3,
            mean_error_deg: -1.0,
            mean_uncertainty_deg: 0.4,
            ..SessionAngle::default()
        };
        assert_eq!(
            verdict(&[steady, transient, trial(0.5)], &[yaw], Some(&chance)),
            "1 of 3 trials differ by more than the measured ±, yaw in 1 trial by at most 3.00°; the transients differ in 1 of \
             3 trials; all trials together differ in yaw by -1.00° ± 0.40° on average; of 9 tests, 0.5 alarms are expected by \
             chance, 1 found, beyond chance in 1 trial"
        );
    }
}
