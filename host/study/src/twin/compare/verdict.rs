//! A comparison as a sentence: the differences, the bounds of the agreement, and their limits.
//!
//! Trials agree if both their steady states and their transients do.

use super::comparison::{AngleComparison, Comparison, Difference, Limit, ROUNDING_DEG};
use crate::text::{capitalised, listed};

/// Returns the verdict.
pub(super) fn verdict(comparison: &Comparison) -> String {
    let angles = &comparison.angles;
    let unknown: Vec<_> = angles.iter().filter(|angle| angle.uncertainty.is_none()).map(|angle| angle.angle).collect();
    let agreeing: Vec<_> =
        (angles.iter()).filter(|angle| angle.uncertainty.is_some() && angle.difference().is_none()).collect();
    let mut clauses: Vec<String> = comparison.differences.iter().map(difference).collect();
    clauses.extend(agreement(comparison, &agreeing));
    clauses.extend(transients(comparison, unknown.len() < angles.len()));
    clauses.extend(limits(&agreeing));
    clauses.extend(cannot_refute(angles));
    if !unknown.is_empty() {
        clauses.push(format!("the uncertainty of {} is unknown", listed(&unknown)));
    }
    capitalised(&clauses.join("; "))
}

fn difference(difference: &Difference) -> String {
    let Difference { angle, error_deg, allowed_deg, model_error_deg } = difference;
    let mut text = format!("{angle} differs by {error_deg:+.2}°");
    if *allowed_deg > ROUNDING_DEG {
        text += &format!(", {:.1} times the measured ±{allowed_deg:.2}°", error_deg.abs() / allowed_deg);
    }
    text + &beside_model(error_deg.abs(), *model_error_deg)
}

fn beside_model(error_deg: f64, model_error_deg: Option<f64>) -> String {
    match model_error_deg {
        Some(model) if error_deg <= model => format!(", within the model's own error of {model:.1}°"),
        Some(model) => format!(", beyond the model's own error of {model:.1}°"),
        None => String::new(),
    }
}

fn agreement(comparison: &Comparison, agreeing: &[&AngleComparison]) -> Option<String> {
    if agreeing.is_empty() {
        return None;
    }
    let total_deg = |angle: &AngleComparison| angle.uncertainty.map_or(0.0, |uncertainty| uncertainty.total_deg);
    let is_exact = agreeing.iter().all(|angle| total_deg(angle) <= ROUNDING_DEG);
    let within = |of: fn(&str) -> String| match is_exact {
        true => format!("{ROUNDING_DEG}°"),
        false => {
            listed(&agreeing.iter().map(|one| format!("±{:.2}°{}", total_deg(one), of(one.angle))).collect::<Vec<_>>())
        }
    };
    if !comparison.differences.is_empty() {
        let names: Vec<_> = agreeing.iter().map(|angle| angle.angle).collect();
        let verb = if names.len() == 1 { "agrees" } else { "agree" };
        return Some(format!("{} {verb} within {}", listed(&names), within(|_| String::new())));
    }
    let is_whole = comparison.transients_agree() && comparison.judges_transients();
    let subject = if is_whole { comparison.sides.text().to_owned() } else { "the steady states".to_owned() };
    let smallest = if is_exact { "" } else { ", the smallest differences that this trial could show" };
    Some(format!("{subject} agree within {}{smallest}", within(|angle| format!(" of {angle}"))))
}

fn transients(comparison: &Comparison, is_known: bool) -> Option<String> {
    if !comparison.judges_transients() {
        return comparison.unjudged.filter(|_| is_known).map(|why| why.text().to_owned());
    }
    if comparison.transients_agree() {
        return (!comparison.differences.is_empty()).then(|| "the transients agree otherwise".to_owned());
    }
    let of_angle = |angle: &AngleComparison| {
        let transient = angle.transient.filter(|transient| transient.differs())?;
        let (residual, allowed) = (transient.residual_deg, transient.allowed_deg);
        let beside = beside_model(residual, transient.model_error_deg);
        Some(format!(
            "{} by {residual:.2}° RMS, {:.1} times the allowed {allowed:.2}°{beside}",
            angle.angle,
            residual / allowed
        ))
    };
    let mut parts: Vec<String> = comparison.angles.iter().filter_map(of_angle).collect();
    if comparison.settling.differs {
        let ratio = comparison.settling.ratio.map_or_else(String::new, |ratio| format!(", ratio {ratio:.2}"));
        parts.push(format!("in the settling time{ratio}"));
    }
    Some(format!("the transients differ: {}", parts.join(", ")))
}

/// Returns the limits that keep the trial from showing smaller differences. The model's own error has a separate
/// clause.
fn limits(agreeing: &[&AngleComparison]) -> Option<String> {
    let limited = |by: Limit, what: &str| {
        let names: Vec<_> =
            agreeing.iter().filter(|angle| angle.limited_by == Some(by)).map(|angle| angle.angle).collect();
        (!names.is_empty()).then(|| format!("{what} limits {}", listed(&names)))
    };
    let parts = [limited(Limit::Noise, "noise"), limited(Limit::Sensor, "the sensor")];
    let parts: Vec<String> = parts.into_iter().flatten().collect();
    (!parts.is_empty()).then(|| parts.join(", "))
}

fn cannot_refute(angles: &[AngleComparison]) -> Option<String> {
    let such: Vec<_> = angles.iter().filter(|angle| angle.cannot_refute).collect();
    let names: Vec<_> = such.iter().map(|angle| angle.angle).collect();
    let errors: Vec<_> = such.iter().filter_map(|angle| Some(format!("{:.1}°", angle.model_error_deg?))).collect();
    (!such.is_empty())
        .then(|| format!("{} cannot refute this model, whose own error is {}", listed(&names), listed(&errors)))
}

#[cfg(test)]
mod tests {
    use super::super::comparison::{Settling, Transient, Uncertainty, Unjudged};
    use super::super::sides::Sides;
    use super::*;

    fn angle(name: &'static str, error_deg: f64, noise_deg: f64, sensor_deg: f64) -> AngleComparison {
        let total_deg = noise_deg.hypot(sensor_deg);
        let uncertainty = Uncertainty {
            noise_deg,
            sensor_deg,
            total_deg,
            u_deg: total_deg / 1.96,
            degrees_of_freedom: f64::INFINITY,
        };
        let transient = Some(Transient { residual_deg: 0.1, allowed_deg: 0.4, ..Transient::default() });
        AngleComparison {
            angle: name,
            error_deg,
            uncertainty: Some(uncertainty),
            transient,
            ..AngleComparison::default()
        }
    }

    fn of(angles: [AngleComparison; 3], sides: Sides) -> Comparison {
        let angles = angles.map(AngleComparison::judged);
        let differences = angles.iter().filter_map(AngleComparison::difference).collect();
        Comparison { angles, differences, sides, ..Comparison::default() }
    }

    fn agreeing() -> [AngleComparison; 3] {
        [angle("yaw", 0.3, 0.3, 0.4), angle("pitch", 0.0, 0.10, 0.02), angle("roll", 0.0, 0.09, 0.02)]
    }

    #[test]
    fn agreement_says_within_what_and_what_limits_it() {
        assert_eq!(
            verdict(&of(agreeing(), Sides::MeasurementAndModel)),
            "Model and measurement agree within ±0.50° of yaw, ±0.10° of pitch and ±0.09° of roll, the smallest differences \
             that this trial could show; noise limits pitch and roll, the sensor limits yaw"
        );
        let models = || ["yaw", "pitch", "roll"].map(|name| angle(name, 0.001, 0.0, 0.0));
        assert_eq!(verdict(&of(models(), Sides::Models)), "The two models agree within 0.01°");
        let [_, pitch, roll] = models();
        let apart = of([angle("yaw", 0.5, 0.0, 0.0), pitch, roll], Sides::Models);
        assert_eq!(
            verdict(&apart),
            "Yaw differs by +0.50°; pitch and roll agree within 0.01°; the transients agree otherwise"
        );
    }

    #[test]
    fn steady_states_that_agree_are_no_agreement_of_transients() {
        let mut comparison = of(agreeing(), Sides::Recordings);
        comparison.angles[0].transient =
            Some(Transient { residual_deg: 2.6, allowed_deg: 0.4, model_error_deg: Some(3.2), ..Transient::default() });
        comparison.settling = Settling { ratio: Some(1.35), differs: true, ..Settling::default() };
        assert!(!comparison.agrees());
        let said = verdict(&comparison);
        assert!(said.starts_with("The steady states agree within ±0.50° of yaw, "), "{said}");
        assert!(
            said.contains(
                "; the transients differ: yaw by 2.60° RMS, 6.5 times the allowed 0.40°, within the model's own error of \
                 3.2°, in the settling time, ratio 1.35; "
            ),
            "{said}"
        );
        for (why, part) in [
            (Unjudged::Short, "the run is too short to judge"),
            (Unjudged::Gaps, "gaps leave too little"),
            (Unjudged::SteadyState, "no transient"),
            (Unjudged::NoEncoders, "without encoders"),
        ] {
            let without = agreeing().map(|angle| AngleComparison { transient: None, ..angle });
            let said = verdict(&Comparison { unjudged: Some(why), ..of(without, Sides::Recordings) });
            assert!(said.starts_with("The steady states agree") && said.contains(part), "{said}");
        }
    }

    #[test]
    fn difference_stands_beside_the_models_own_error() {
        let [mut yaw, mut pitch, mut roll] =
            [angle("yaw", 3.0, 0.6, 0.8), angle("pitch", 0.9, 0.06, 0.08), angle("roll", 0.05, 0.06, 0.08)];
        (yaw.model_error_deg, pitch.model_error_deg, roll.model_error_deg) = (Some(5.0), Some(0.5), Some(1.7));
        let said = verdict(&of([yaw, pitch, roll], Sides::MeasurementAndModel));
        assert_eq!(
            said,
            "Yaw differs by +3.00°, 3.0 times the measured ±1.00°, within the model's own error of 5.0°; \
             pitch differs by +0.90°, 9.0 times the measured ±0.10°, beyond the model's own error of 0.5°; \
             roll agrees within ±0.10°; the transients agree otherwise; \
             yaw and roll cannot refute this model, whose own error is 5.0° and 1.7°"
        );
    }

    #[test]
    fn unknown_uncertainty_is_no_agreement() {
        let [yaw, pitch, roll] = agreeing();
        let unknown = |angle: AngleComparison| AngleComparison { uncertainty: None, transient: None, ..angle };
        let said = verdict(&of([unknown(yaw.clone()), pitch.clone(), roll.clone()], Sides::default()));
        assert!(said.ends_with("; the uncertainty of yaw is unknown"), "{said}");
        let said = verdict(&of([yaw, pitch, roll].map(unknown), Sides::default()));
        assert_eq!(said, "The uncertainty of yaw, pitch and roll is unknown");
    }
}
