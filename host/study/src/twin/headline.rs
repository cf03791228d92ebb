//! A comparison in one plain sentence. The numbers of the statistical test are in the verdict.

use super::{AngleComparison, Chance, Comparison, SessionAngle, Sides};
use crate::text::{capitalised, decimal};

/// Returns the sentence about a trial, or about the trials of a session.
pub(super) fn headline(trials: &[Comparison], angles: &[SessionAngle], chance: Option<&Chance>) -> String {
    let together = trials.len() > 1 && angles.iter().any(SessionAngle::differs);
    let at = |trial: &Comparison| format!("at ({}, {}) rpm", trial.w1_rpm, trial.w2_rpm);
    let both = capitalised(Sides::of_all(trials));
    let worst = worst(trials);
    let by_chance = trials.len() > 1 && chance.is_some_and(|chance| chance.beyond.is_empty());
    if let Some((trial, angle)) = worst.filter(|_| !by_chance) {
        return format!("{} {}.", capitalised(&apart(angle, trial.sides)), at(trial));
    }
    let excess = |trial: &&Comparison| {
        let transients = trial.angles.iter().filter_map(|angle| angle.transient);
        transients.map(|of| of.residual_deg / of.allowed_deg).fold(0.0, f64::max)
    };
    let apart_on_the_way = trials.iter().filter(|trial| !trial.transients_agree());
    if let Some(trial) = apart_on_the_way.max_by(|a, b| excess(a).total_cmp(&excess(b))) {
        let state = if worst.is_some() { "differ no more than by chance" } else { "agree" };
        return format!("{both} {state} in the steady state, but not on the way there {}.", at(trial));
    }
    if together {
        return format!("{both} differ in all trials together, though in none by itself.");
    }
    if worst.is_some() {
        return format!("{both} differ no more than by chance.");
    }
    let known = || trials.iter().flat_map(|trial| &trial.angles).filter_map(|angle| angle.uncertainty);
    let within = if known().all(|uncertainty| uncertainty.total_deg == 0.0) { "0.01°" } else { "their ±" };
    match known().count() {
        0 => "No uncertainty is known, so nothing is judged.".to_owned(),
        count => {
            let where_known = if count == 3 * trials.len() { "" } else { ", where it is known" };
            let is_judged = trials.iter().all(Comparison::judges_transients);
            let [state, way] =
                if is_judged { [""; 2] } else { [" in the steady state", "; the way there is not judged"] };
            format!("{both} agree{state} within {within}{where_known}{way}.")
        }
    }
}

/// Returns the angle with the largest difference, and its trial; only trials beyond chance, if there are any.
fn worst(trials: &[Comparison]) -> Option<(&Comparison, &AngleComparison)> {
    let differing = |trial: &Comparison, angle: &str| trial.differences.iter().any(|found| found.angle == angle);
    let all = trials.iter().flat_map(|trial| trial.angles.iter().map(move |angle| (trial, angle)));
    let beyond = trials.iter().any(|trial| trial.is_beyond_chance);
    let found = all.filter(|(trial, of)| differing(trial, of.angle) && (trial.is_beyond_chance || !beyond));
    found.max_by(|a, b| a.1.error_deg.abs().total_cmp(&b.1.error_deg.abs()))
}

/// Describes how the second side differs from the first in an angle.
fn apart(angle: &AngleComparison, sides: Sides) -> String {
    let verb = match angle.angle {
        "yaw" => "turns",
        "pitch" => "pitches",
        _ => "rolls",
    };
    let [first, second] = sides.names().map(|name| if name == "measured" { "measurement" } else { name });
    let AngleComparison { measured_deg: from, modelled_deg: to, error_deg, .. } = *angle;
    let least = from.abs().min(to.abs());
    let decimals = if error_deg.abs() < 1.0 { 2 } else { usize::from(error_deg.abs() < 10.0) };
    let [by, from_text, to_text] = [error_deg.abs(), from, to].map(|deg| decimal(deg, decimals));
    // Near zero, the sign is not informative.
    let text = match (from * to < 0.0 && least > 0.1 * error_deg.abs(), sides, to.abs() > from.abs()) {
        (true, ..) => format!("the {second} {verb} by {to_text}°, the {first} by {from_text}°"),
        (_, Sides::MeasurementAndModel, true) => format!("the model {verb} {by}° too far"),
        (_, Sides::MeasurementAndModel, false) => format!("the model {verb} {by}° too little"),
        (.., true) => format!("the {second} {verb} {by}° further than the {first}"),
        (.., false) => format!("the {second} {verb} {by}° less than the {first}"),
    };
    match angle.model_error_deg {
        Some(of_model) if error_deg.abs() <= of_model => text + ", within the model's own error,",
        _ => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::{Transient, Uncertainty};

    /// A trial whose yaw is `yaw[0]` measured and `yaw[1]` modelled; 0.5° are allowed.
    fn trial(yaw: [f64; 2], sides: Sides) -> Comparison {
        let angle = |angle, [measured_deg, modelled_deg]: [f64; 2]| AngleComparison {
            angle,
            measured_deg,
            modelled_deg,
            error_deg: modelled_deg - measured_deg,
            uncertainty: Some(Uncertainty { total_deg: 0.5, ..Uncertainty::default() }),
            transient: Some(Transient::default()),
            ..AngleComparison::default()
        };
        let angles = [angle("yaw", yaw), angle("pitch", [0.0; 2]), angle("roll", [0.0; 2])];
        let differences = Vec::from_iter(angles[0].difference());
        Comparison { w1_rpm: 50.0, w2_rpm: 10.0, angles, sides, differences, ..Comparison::default() }
    }

    #[test]
    fn a_difference_is_said_in_plain_words() {
        use Sides::{MeasurementAndModel, ModelAndMeasurement, Models, Recordings};
        for (yaw, sides, said) in [
            ([-48.5, -67.4], MeasurementAndModel, "The model turns 19° too far at (50, 10) rpm."),
            ([48.5, 43.2], MeasurementAndModel, "The model turns 5.3° too little at (50, 10) rpm."),
            ([-20.0, 10.0], MeasurementAndModel, "The model turns by 10°, the measurement by -20° at (50, 10) rpm."),
            ([-0.05, 0.8], Models, "The second model turns 0.85° further than the first model at (50, 10) rpm."),
            ([9.0, 8.0], ModelAndMeasurement, "The measurement turns 1.0° less than the model at (50, 10) rpm."),
            ([9.0, 9.1], Recordings, "The two recordings agree within their ±."),
        ] {
            assert_eq!(trial(yaw, sides).headline(), said);
        }
        let [worse, better] = [-67.4, -49.6].map(|yaw| trial([-48.5, yaw], MeasurementAndModel));
        let chance =
            |beyond: &[&str]| Chance { beyond: beyond.iter().map(|&name| name.into()).collect(), ..Chance::default() };
        let session = |beyond: &[&str], trials: &[Comparison]| headline(trials, &[], Some(&chance(beyond)));
        assert!(session(&["a"], &[better.clone(), worse]).starts_with("The model turns 19° too far"));
        assert_eq!(session(&[], &[better.clone(), better]), "Model and measurement differ no more than by chance.");
    }

    #[test]
    fn agreement_is_said_only_as_far_as_it_is_known() {
        let mut one = trial([9.0, 9.1], Sides::MeasurementAndModel);
        let known = one.angles[0].uncertainty.take();
        assert_eq!(one.headline(), "Model and measurement agree within their ±, where it is known.");
        (one.angles[1].uncertainty, one.angles[2].uncertainty) = (None, None);
        assert_eq!(one.headline(), "No uncertainty is known, so nothing is judged.");
        one.angles[0].uncertainty = known;
        let mut short = one.clone();
        for angle in &mut short.angles {
            angle.transient = None;
        }
        assert!(short.headline().ends_with("where it is known; the way there is not judged."), "{}", short.headline());
        one.settling.differs = true;
        let said = "Model and measurement agree in the steady state, but not on the way there at (50, 10) rpm.";
        assert_eq!(one.headline(), said);
    }
}
