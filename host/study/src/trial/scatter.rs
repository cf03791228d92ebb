//! Compares the scatter of repeats with their budget: trials at the same speeds should differ by as much as their
//! uncertainties state.
//!
//! Errors common to all trials of a sensor do not scatter, so only the trial's own part of the budget is compared.

use super::budget::{Budget, CommonTo, TO_COME};
use super::judged::Judged;
use crate::statistics::{effective_freedom, variance_ratio};
use serde::Serialize;
use sim::functions::powi;

/// Quantiles that bound the scatter by chance.
const CHANCE: [f64; 2] = [0.025, 0.975];

/// A measured trial as one of several at its speeds.
#[derive(Clone, PartialEq, Debug)]
pub struct Repeat {
    /// Name of the trial.
    pub name: String,
    speeds_rpm: [f64; 2],
    /// The reversing motor, and the time.
    reverse: Option<(u8, f64)>,
    /// Steady yaw, pitch and roll, degrees.
    angles_deg: [f64; 3],
    /// The trial's own causes of their uncertainty; `None` if they are unknown.
    own: [Option<Budget>; 3],
}

impl Repeat {
    /// Returns the steady angles of a trial; `None` for a model, whose repeats are equal, and for a trial that is not
    /// complete.
    pub fn new(trial: &Judged) -> Option<Self> {
        let Judged { data, angles: zeroed, .. } = trial;
        let steady = zeroed.steady.as_ref().filter(|_| !data.is_model() && data.is_complete())?;
        // The rest of a slow approach is the same in all repeats.
        let own = |k: usize| Some(steady.budgets[k].as_ref()?.common_to(CommonTo::Trial).without(TO_COME));
        let trial = data.trial();
        Some(Self {
            name: trial.name,
            speeds_rpm: [trial.w1_rpm, trial.w2_rpm],
            reverse: data.reverse(),
            angles_deg: steady.angles_deg,
            own: [0, 1, 2].map(own),
        })
    }
}

/// Trials at the same speeds.
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct Repeats {
    /// Speed of flagellum 1.
    pub w1_rpm: f64,
    /// Speed of flagellum 2.
    pub w2_rpm: f64,
    /// The motor that reverses, and the time of the reversal, s from the start of the run.
    pub reverse: Option<(u8, f64)>,
    /// Names of the trials.
    pub trials: Vec<String>,
    /// The scatter of yaw, pitch and roll, without angles whose uncertainty is unknown in any trial.
    pub angles: Vec<Scatter>,
}

/// The scatter of an angle between repeats, beside its budget.
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct Scatter {
    /// `yaw`, `pitch` or `roll`.
    pub angle: &'static str,
    /// Standard deviation of the steady angle between the trials.
    pub scatter_deg: f64,
    /// Standard uncertainty of the steady angle in one trial, without errors common to all trials of the sensor.
    pub budget_deg: f64,
    /// Range of the scatter of this many repeats in 95 of 100 sets, if the budget is right.
    pub by_chance_deg: [f64; 2],
    /// The judgement.
    pub judgement: Judgement,
}

/// Judgement of the scatter of repeats.
#[derive(Serialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(rename_all = "snake_case")]
pub enum Judgement {
    /// As large as the budget.
    AsBudget,
    /// Larger: something changes between the trials that the budget does not contain.
    More,
    /// Smaller: the budget is too large.
    Less,
}

/// Returns the scatter at each pair of speeds that has repeats, in the order of the first trials.
pub fn scatter_of_repeats<'a>(trials: impl Iterator<Item = &'a Repeat>) -> Vec<Repeats> {
    let mut sets: Vec<Vec<&Repeat>> = Vec::new();
    for trial in trials {
        let is_same =
            |set: &&mut Vec<&Repeat>| (set[0].speeds_rpm, set[0].reverse) == (trial.speeds_rpm, trial.reverse);
        match sets.iter_mut().find(is_same) {
            Some(set) => set.push(trial),
            None => sets.push(vec![trial]),
        }
    }
    sets.iter().filter(|set| set.len() > 1).map(|set| repeats(set)).collect()
}

fn repeats(set: &[&Repeat]) -> Repeats {
    let Repeat { speeds_rpm: [w1_rpm, w2_rpm], reverse, .. } = *set[0];
    let angles = ["yaw", "pitch", "roll"].into_iter().enumerate().filter_map(|(k, angle)| scatter(set, k, angle));
    let trials = set.iter().map(|trial| trial.name.clone()).collect();
    Repeats { w1_rpm, w2_rpm, reverse, trials, angles: angles.collect() }
}

fn scatter(set: &[&Repeat], k: usize, angle: &'static str) -> Option<Scatter> {
    let own: Vec<&Budget> = set.iter().map(|trial| trial.own[k].as_ref()).collect::<Option<_>>()?;
    let (count, freedom) = (set.len() as f64, set.len() as f64 - 1.0);
    let mean = set.iter().map(|trial| trial.angles_deg[k]).sum::<f64>() / count;
    let variance = set.iter().map(|trial| powi(trial.angles_deg[k] - mean, 2)).sum::<f64>() / freedom;
    let parts = own.iter().map(|budget| (powi(budget.u_deg(), 2), budget.degrees_of_freedom()));
    let sum: f64 = parts.clone().map(|(variance, _)| variance).sum();
    let known_with = effective_freedom(sum, parts);
    let (scatter_deg, budget_deg) = (variance.sqrt(), (sum / count).sqrt());
    let by_chance_deg = CHANCE.map(|p| budget_deg * variance_ratio(p, freedom, known_with).sqrt());
    let judgement = match scatter_deg {
        scatter if scatter > by_chance_deg[1] => Judgement::More,
        scatter if scatter < by_chance_deg[0] => Judgement::Less,
        _ => Judgement::AsBudget,
    };
    Some(Scatter { angle, scatter_deg, budget_deg, by_chance_deg, judgement })
}

impl Repeats {
    /// Returns the speeds, and the reversal if there is one.
    pub fn speeds(&self) -> String {
        let reverse = self
            .reverse
            .map_or_else(String::new, |(motor, after_s)| format!(", motor {motor} reversed after {after_s} s"));
        format!("{} and {} rpm{reverse}", self.w1_rpm, self.w2_rpm)
    }
}

impl Scatter {
    /// Returns the judgement as a sentence about the angle; `None` if the scatter agrees with the budget.
    pub fn remark(&self) -> Option<String> {
        let [low, high] = self.by_chance_deg;
        let angle = self.angle;
        match self.judgement {
            Judgement::AsBudget => None,
            Judgement::More => Some(format!(
                "{angle} scatters by more than the {high:.2}° that its budget explains: something else changes between the \
                 trials, such as a temperature, or the speeds of motors without encoders"
            )),
            Judgement::Less => Some(format!(
                "{angle} scatters by less than the {low:.2}° that its budget explains: the budget is too large"
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::Term;

    fn repeat(name: &str, speeds_rpm: [f64; 2], yaw_deg: f64, noise_deg: f64) -> Repeat {
        let budget = Budget::new([
            Term::of_trial("noise", noise_deg, f64::INFINITY),
            Term::new("scale", CommonTo::Sensor, [(2.0, f64::INFINITY)]),
        ]);
        let own = Some(budget.common_to(CommonTo::Trial));
        let own = [own.clone(), None, own];
        Repeat { name: name.to_owned(), speeds_rpm, reverse: None, angles_deg: [yaw_deg, 0.0, 0.0], own }
    }

    #[test]
    fn scatter_is_compared_with_the_trials_own_part_of_the_budget() {
        let at = |w1: f64, yaws: [f64; 3]| yaws.map(|yaw| repeat(&format!("{w1} {yaw}"), [w1, 10.5], yaw, 0.6));
        let trials = [at(50.0, [-70.0, -69.2, -70.8]), at(60.0, [1.0, 5.0, -3.0])].concat();
        let found = scatter_of_repeats(trials.iter().chain([&repeat("alone", [1.0, 1.0], 0.0, 0.1)]));
        assert_eq!(found.len(), 2);
        let [yaw, roll] = found[0].angles.as_slice() else { panic!("{found:?}") };
        assert!((yaw.scatter_deg - 0.8).abs() < 1e-9 && (yaw.budget_deg - 0.6).abs() < 1e-9, "{yaw:?}");
        // Chi squared of 2 degrees of freedom: 0.0506 and 7.378.
        let [low, high] = yaw.by_chance_deg;
        assert!((low - 0.6 * 0.0253f64.sqrt()).abs() < 1e-3 && (high - 0.6 * 3.689f64.sqrt()).abs() < 1e-3, "{yaw:?}");
        assert_eq!((yaw.judgement, yaw.remark()), (Judgement::AsBudget, None));
        assert_eq!((roll.angle, roll.judgement), ("roll", Judgement::Less));
        assert_eq!(found[1].angles[0].judgement, Judgement::More);
        assert!(found[1].angles[0].remark().unwrap().starts_with("yaw scatters by more than the 1.15°"));
    }

    #[test]
    fn budget_that_is_hardly_known_explains_more() {
        let mut trials = [repeat("a", [1.0; 2], 0.0, 0.6), repeat("b", [1.0; 2], 2.2, 0.6)];
        let judged = |trials: &[Repeat]| scatter_of_repeats(trials.iter())[0].angles[0].judgement;
        assert_eq!(judged(&trials), Judgement::More);
        let hardly = Some(Budget::new([Term::of_trial("noise", 0.6, 2.0)]));
        trials.iter_mut().for_each(|trial| trial.own[0].clone_from(&hardly));
        assert_eq!(judged(&trials), Judgement::AsBudget);
        trials[1].reverse = Some((2, 30.0));
        assert!(scatter_of_repeats(trials.iter()).is_empty(), "a reversal is another trial");
    }
}
