//! The version of the model's results: a sweep reuses the results of an earlier one if their versions are equal.
//!
//! Points computed by different programs are equal if their inputs and this version are equal. A change of any result requires a
//! new version, which the test below enforces.

/// Version of the model's results.
pub const RESULTS: u32 = 13;

#[cfg(test)]
mod tests {
    use super::super::compute::compute;
    use super::super::{Sweep, SweepPlan};
    use super::*;
    use crate::plan::robot;
    use rayon::prelude::*;
    use sim::step::InversesAtRest;
    use sim::trial::quantity::{Column, FLAGELLA, Place, columns};
    use std::path::Path;

    /// Plans whose points have every kind of result: robots, methods, speeds with and without a common period, phases, contact,
    /// mesh, groups and keys that vary, and a point that fails.
    const PLANS: [&str; 4] = [
        "[session]\nrobot = \"published\"\n[trial]\nrun = 24\nphases = 2\n[speeds]\n\
         pairs = [[50, 10], [0, 45], [37.3, -52.91], [90, 60]]\n",
        "[trial]\nrun = 24\n[speeds]\npairs = [[-90, 90], [12.5, -8.75], [70.38, 48.79], [-31.4, -22.6]]\n",
        "[trial]\nrun = 25\nmethod = \"trial\"\n[vary]\n\"group.stiffness\" = [1.9]\n\"group.spacing\" = [0.3, 1.1]\n\
         \"fluid.viscosity_pa_s\" = [1.37]\n[speeds]\npairs = [[61.4, 23.7]]\n",
        "[session]\nrobot = \"robot-tank\"\n[trial]\nrun = 24\n[speeds]\npairs = [[50, 10]]\n",
    ];

    /// Returns a line for each point of a plan: its speeds, kind and values, or the reason for its failure. A number has all
    /// its digits.
    fn results(text: &str, threads: usize) -> Vec<String> {
        let plan = SweepPlan::parse(text, "plan", &|name| robot::load(Path::new(name))).unwrap();
        let sweep = Sweep::new(plan.clone(), RESULTS).unwrap();
        let at_rest = InversesAtRest::default();
        let line = |index| {
            let point = sweep.point(index);
            let (outcome, _) = compute(&point, &plan, &at_rest, &|| true).unwrap();
            let [w1, w2] = point.speeds_rpm;
            match outcome {
                Err(reason) => format!("{w1},{w2},{reason}"),
                Ok(steady) => {
                    // The sign of a zero may depend on the processor.
                    let values = quantities().map(|column| format!(",{:e}", steady.values[column.index()] + 0.0));
                    format!("{w1},{w2},{}{}", steady.kind.name(), values.collect::<String>())
                }
            }
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| (0..plan.points()).into_par_iter().map(line).collect())
    }

    fn quantities() -> impl Iterator<Item = Column> {
        columns(FLAGELLA).filter(|column| column.is_in(Place::Sweep))
    }

    #[test]
    fn threads_do_not_change_results() {
        let text = "[trial]\nrun = 12\nmethod = \"trial\"\n[speeds]\n\
                    pairs = [[50, 10], [0, 45], [37.3, -52.91], [90, 60], [-31.4, -22.6], [12.5, 80], [-70, 5]]\n";
        let one = results(text, 1);
        for threads in [2, 7] {
            assert_eq!(results(text, threads), one, "{threads} threads");
        }
    }

    /// `BIFLAG_WRITE_GOLDEN=1 cargo test --release -p study --lib sweep::results` writes `results.csv` again.
    #[test]
    fn results_are_those_of_their_version() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/src/sweep/results.csv");
        let now = PLANS.map(|text| results(text, 2)).concat();
        let before = std::fs::read_to_string(path).unwrap_or_default();
        let mut lines = before.lines();
        let version = lines.next().unwrap_or_default();
        // Parts of a sweep store values by their place in the list, so the list has this version as well.
        let names =
            |of: &mut dyn Iterator<Item = Column>| of.map(|column| format!(",{}", column.name)).collect::<String>();
        let stored = format!("# stored{}", names(&mut columns(FLAGELLA)));
        let heads = [stored, format!("w1_rpm,w2_rpm,kind{}", names(&mut quantities()))];
        let now: Vec<String> = heads.into_iter().chain(now).collect();
        let before: Vec<&str> = lines.collect();
        let changed: Vec<_> = now.iter().zip(&before).filter(|(now, before)| now.as_str() != **before).collect();
        let wanted = format!("# version {RESULTS}");
        assert!(
            version != wanted || changed.is_empty(),
            "results have changed: increase RESULTS, so that sweeps do not take over those of before, and write results.csv \
             again with BIFLAG_WRITE_GOLDEN=1. Now and before: {changed:#?}"
        );
        if std::env::var_os("BIFLAG_WRITE_GOLDEN").is_some() {
            std::fs::write(path, format!("{wanted}\n{}\n", now.join("\n"))).unwrap();
            return;
        }
        assert_eq!(version, wanted, "write results.csv again with BIFLAG_WRITE_GOLDEN=1");
        assert_eq!(now.len(), before.len(), "write results.csv again with BIFLAG_WRITE_GOLDEN=1");
    }
}
