//! Means and spreads of modelled trials over their starting phases, and a note about phases for the user.

use crate::plan::Trial;
use crate::text::{count, decimal};
use biflag_log::SteadyMeta;
use protocol::units::CentiRpm;
use serde::Serialize;
use sim::steady::phase::Ratio;
use sim::trial::quantity::Values;
use std::fmt;

/// The steady state of a pair of speeds over its starting phases.
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct PhaseMeans {
    /// The speeds, and the repeat if there are several, such as `w1+90_w2+90`.
    pub name: String,
    /// Speed of flagellum 1.
    pub w1_rpm: f64,
    /// Speed of flagellum 2.
    pub w2_rpm: f64,
    /// Number of starting phases.
    pub phases: usize,
    /// The steady state that stands for all phases.
    #[serde(flatten)]
    pub steady: SteadyMeta,
    /// Largest minus smallest yaw, pitch and roll.
    pub phase_spread_deg: [f64; 3],
}

impl PhaseMeans {
    /// Returns the means over the steady states of a trial's starting phases. There must be at least one.
    pub fn new(trial: &Trial, phases: &[SteadyMeta]) -> Self {
        let [w1_rpm, w2_rpm] = trial.speeds.map(CentiRpm::rpm);
        let end = trial.name.rfind("_p").unwrap_or(trial.name.len());
        let name = trial.name[..end].split_once('_').map_or("", |(_, name)| name).to_owned();
        let values: Vec<Values> = phases.iter().map(|phase| phase.values.clone()).collect();
        let spreads = Values::spreads(&values);
        let phase_spread_deg = [0, 1, 2].map(|angle| spreads[angle]);
        let steady = SteadyMeta::over_phases(phases);
        Self { name, w1_rpm, w2_rpm, phases: phases.len(), steady, phase_spread_deg }
    }
}

impl fmt::Display for PhaseMeans {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let means = self.steady.values.angles_deg().map(|deg| decimal(deg, 2));
        let spreads = self.phase_spread_deg.map(|deg| decimal(deg, 2));
        let phases = count(self.phases, "phase");
        if self.steady.is_overturned() {
            return write!(f, "{}: overturned, at one of {phases} or more", self.name);
        }
        write!(f, "{}: mean and spread over {phases}: yaw {}° ({}°)", self.name, means[0], spreads[0])?;
        write!(f, ", pitch {}° ({}°), roll {}° ({}°)", means[1], spreads[1], means[2], spreads[2])?;
        if self.steady.settled { Ok(()) } else { write!(f, ", not settled") }
    }
}

/// Returns a note for the user on the starting phases of modelled trials: their effect if it was computed, otherwise
/// the trials that depend on them.
pub fn note_on_phases<'a>(trials: &[Trial], means: impl Iterator<Item = &'a PhaseMeans>) -> Option<String> {
    let widest = |mean: &PhaseMeans| mean.phase_spread_deg.into_iter().fold(0.0, f64::max);
    if let Some(mean) = means.max_by(|a, b| widest(a).total_cmp(&widest(b))) {
        let [yaw, pitch, roll] = mean.phase_spread_deg.map(|deg| decimal(deg, 2));
        return Some(format!(
            "the starting phase of the flagella changes yaw by {yaw}°, pitch by {pitch}° and roll by {roll}° at {} and {} \
             rpm, where it matters most",
            mean.w1_rpm, mean.w2_rpm
        ));
    }
    // The means of trials at several phases are not complete yet.
    if has_phases(trials) {
        return None;
    }
    let (why, which) = depending(trials)?;
    let cure = "`phases = 8` in [trial] gives means and spreads";
    Some(match which {
        None => format!("{why}, so these values hold for one starting phase of the flagella; {cure}"),
        Some(which) => format!("the values of {which} hold for one starting phase of the flagella; {cure}"),
    })
}

/// Returns whether trials differ in their starting phases alone.
pub fn has_phases(trials: &[Trial]) -> bool {
    trials.windows(2).any(|pair| pair[0].is_at_the_phases_of(&pair[1]))
}

/// Returns a note for the user if recorded trials depend on the flagella's starting angles and the board does not know
/// them.
pub fn note_on_unknown_angles(trials: &[Trial]) -> Option<String> {
    let (why, which) = depending(trials)?;
    let cure = "which a board with encoders knows after `biflag align`; then `phases = 8` in [trial] measures means and spreads";
    Some(match which {
        None => format!("{why}, so the trial depends on their starting angles, {cure}"),
        Some(which) => format!("{which} depend on the starting angles of the flagella, {cure}"),
    })
}

/// Describes why the steady state of some trials depends on the starting phase, and which of several trials do; `None` if none
/// does.
fn depending(trials: &[Trial]) -> Option<(String, Option<String>)> {
    let speeds_rpm = trials.iter().map(|trial| trial.speeds.map(CentiRpm::rpm));
    let mut simple = speeds_rpm.filter_map(|rpm| Some((rpm, Ratio::of(rpm)?)));
    let ([w1, w2], ratio) = simple.next()?;
    let why = match ratio.standing() {
        Some(number) => format!("flagellum {number} stands"),
        None => format!("the flagella turn at {ratio}"),
    };
    let (some, all) = (1 + simple.count(), trials.len());
    let which = || format!("{some} of {all} trials, such as those at {w1} and {w2} rpm, where {why},");
    let which = (all > 1).then(which);
    Some((why, which))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::Plan;

    #[test]
    fn trials_from_unknown_angles_are_told_where_they_depend_on_them() {
        let note = |pairs: &str| {
            let plan = format!("[session]\nname = \"a\"\n[trial]\nrun = 9\n[speeds]\npairs = {pairs}\n");
            note_on_unknown_angles(&Plan::parse(&plan, "a").unwrap().trials).unwrap_or_default()
        };
        assert!(
            note("[[90, 90]]").starts_with("the flagella turn at 1:1, so the trial depends on their starting angles")
        );
        let two = note("[[50, 10], [0, 45], [90, 90]]");
        assert!(two.starts_with("2 of 3 trials, such as those at 0 and 45 rpm, where flagellum 1 stands"), "{two}");
        assert_eq!(note("[[50, 10]]"), "");
    }
}
