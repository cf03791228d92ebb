//! The version of the model's results: a sweep reuses the results of an earlier one if their versions are equal.
//!
//! Points of different programs are the same if their inputs and this version are the same. A change of any result
//! requires a new version, which the test below enforces.

/// Version of the model's results.
pub const RESULTS: u32 = 5;

#[cfg(test)]
mod tests {
    use super::super::compute::Outcome;
    use super::super::{Sweep, SweepPlan};
    use super::*;
    use crate::plan::robot;
    use sim::steady::quantities::QUANTITIES;
    use sim::step::InversesAtRest;
    use std::path::Path;

    /// Points of every kind of result: robots, methods, speeds with and without a common period, phases, contact, mesh, groups and
    /// keys that vary, and a point that fails.
    const PLANS: [&str; 4] = [
        "[session]\nrobot = \"published\"\n[trial]\nrun = 24\nphases = 2\n[speeds]\n\
         pairs = [[50, 10], [0, 45], [37.3, -52.91], [90, 60]]\n",
        "[trial]\nrun = 24\n[speeds]\npairs = [[-90, 90], [12.5, -8.75], [70.38, 48.79], [-31.4, -22.6]]\n",
        "[trial]\nrun = 25\nmethod = \"trial\"\n[vary]\n\"group.stiffness\" = [1.9]\n\"group.spacing\" = [0.3, 1.1]\n\
         \"fluid.viscosity_pa_s\" = [1.37]\n[speeds]\npairs = [[61.4, 23.7]]\n",
        "[session]\nrobot = \"robot-tank\"\n[trial]\nrun = 24\n[speeds]\npairs = [[50, 10]]\n",
    ];

    /// Largest differences between processors, which round differently: degrees, N, N m, shares, m. Contact amplifies
    /// rounding errors.
    fn tolerance(unit: &str, value: f64, contact: bool) -> f64 {
        let least: f64 = match unit {
            "deg" => 1e-3,
            "N" => 1e-7,
            "N m" => 1e-8,
            "m" => 1e-7,
            _ => 1e-4,
        };
        let share = 1e-5 * value.abs();
        if contact { 100.0 * least.max(share) } else { least.max(share) }
    }

    /// Returns a line for each point: its speeds, kind and values, or the reason for its failure.
    fn results() -> Vec<String> {
        let mut lines = Vec::new();
        for text in PLANS {
            let plan = SweepPlan::parse(text, "plan", &|name| robot::load(Path::new(name))).unwrap();
            let sweep = Sweep::new(plan.clone(), RESULTS).unwrap();
            for index in 0..plan.points() {
                let point = sweep.point(index);
                let (outcome, _) = Outcome::of(&point, &plan, &InversesAtRest::default(), &|| true).unwrap();
                let [w1, w2] = point.speeds_rpm;
                lines.push(match outcome {
                    Outcome::Failed(reason) => format!("{w1},{w2},{reason}"),
                    Outcome::Ok(steady) => {
                        let values = steady.values.map(|value| format!(",{value:.9e}"));
                        format!("{w1},{w2},{}{}", steady.kind.name(), values.concat())
                    }
                });
            }
        }
        lines
    }

    fn is_same(now: &str, before: &str) -> bool {
        let [now, before] = [now, before].map(|line| line.split(',').collect::<Vec<_>>());
        let number = |word: &str| word.parse::<f64>().unwrap();
        if now.len() != before.len() || now.len() != 3 + QUANTITIES.len() {
            return now == before;
        }
        let at = QUANTITIES.iter().position(|quantity| quantity.name == "contact_share").unwrap();
        let contact = number(before[3 + at]) > 0.0;
        now[..3] == before[..3]
            && QUANTITIES.iter().enumerate().all(|(at, quantity)| {
                let [now, before] = [&now, &before].map(|words| number(words[3 + at]));
                (now - before).abs() <= tolerance(quantity.unit, before, contact)
            })
    }

    /// `BIFLAG_WRITE_GOLDEN=1 cargo test --release -p study --lib sweep::results` writes `results.csv` again.
    #[test]
    fn results_are_those_of_their_version() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/src/sweep/results.csv");
        let now = results();
        let before = std::fs::read_to_string(path).unwrap_or_default();
        let mut lines = before.lines();
        let version = lines.next().unwrap_or_default();
        let before: Vec<&str> = lines.skip(1).collect();
        let changed: Vec<_> = now.iter().zip(&before).filter(|(now, before)| !is_same(now, before)).collect();
        let wanted = format!("# version {RESULTS}");
        assert!(
            version != wanted || changed.is_empty(),
            "results have changed: increase RESULTS, so that sweeps do not take over those of before, and write results.csv \
             again with BIFLAG_WRITE_GOLDEN=1. Now and before: {changed:#?}"
        );
        if std::env::var_os("BIFLAG_WRITE_GOLDEN").is_some() {
            let names = QUANTITIES.map(|quantity| format!(",{}", quantity.name)).concat();
            std::fs::write(path, format!("{wanted}\nw1_rpm,w2_rpm,kind{names}\n{}\n", now.join("\n"))).unwrap();
            return;
        }
        assert_eq!(version, wanted, "write results.csv again with BIFLAG_WRITE_GOLDEN=1");
        assert_eq!(now.len(), before.len(), "write results.csv again with BIFLAG_WRITE_GOLDEN=1");
    }
}
