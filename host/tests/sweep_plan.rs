//! Plans of sweeps: what they mean, and their errors.

use biflag_log::Method;
use host::plan::{PlanError, RobotFile};
use host::sweep::SweepPlan;
use std::path::Path;

fn parse(text: &str) -> Result<SweepPlan, PlanError> {
    SweepPlan::parse(text, "plan.toml", &|name| Ok(RobotFile::built_in(name)))
}

#[test]
fn plan_of_the_help_is_valid() {
    let plan = parse(host::sweep::EXAMPLE).unwrap();
    assert_eq!((plan.points(), plan.phases, plan.run_s, plan.method), (3 * 7 * 190, 4, 120.0, Method::Steady));
    let dotted =
        parse("[vary]\nfluid.viscosity_pa_s = [1, 2]\ngroup.pitch = [0.9]\n[speeds]\npairs = [[1, 2]]").unwrap();
    assert_eq!(dotted.points(), 2, "keys without quotes");
}

#[test]
fn every_mistake_is_named_with_its_cure() {
    let many = "\"group.pitch\" = { from = 1, to = 2, count = 1000000 }\n\"group.radius\" = { from = 1, to = 2, count = 1000000 }";
    for (vary, what, cure) in [
        ("\"fluid.viscosity\" = [1]", "2:21: unknown key `fluid.viscosity`", "fluid.viscosity_pa_s"),
        ("\"group.size\" = [1]", "2:16: unknown key `group.size`", "write one of group.stiffness"),
        ("viscosity = [1]", "unknown key `viscosity`", "a key of the robot's file, such as \"fluid.viscosity_pa_s\""),
        ("\"head.shape\" = [\"local\"]", "head.shape is not a number but \"cylinder\"", "a plan of its own"),
        ("\"tank.length_m\" = [1]", "unknown key `tank.length_m`", "write a key"),
        ("\"group.pitch\" = []", "group.pitch has no values", "give a list such as"),
        ("\"group.pitch\" = [1, \"2\"]", "group.pitch cannot hold \"2\"", "give a list"),
        ("\"group.pitch\" = [1, 2, 1.0]", "group.pitch has 1 twice", "leave one"),
        ("\"group.pitch\" = [1, nan]", "group.pitch cannot hold nan", "give a list"),
        ("\"group.pitch\" = [0]", "group.pitch cannot be 0", "above 0"),
        ("\"group.pitch\" = 1", "group.pitch cannot be 1", "give a list"),
        ("\"group.pitch\" = { from = 1, to = 2 }", "group.pitch needs a count", "count = 7"),
        ("\"group.pitch\" = { from = 1, count = 2 }", "group.pitch needs from and to", "give a list"),
        (
            "\"group.pitch\" = { from = 2, to = 2, count = 3 }",
            "the range of group.pitch from 2 to 2 is empty",
            "smaller",
        ),
        (
            "\"group.pitch\" = { from = 2, to = 1, count = 3 }",
            "the range of group.pitch from 2 to 1 is empty",
            "smaller",
        ),
        ("\"group.pitch\" = { from = 1, to = 2, count = 1 }", "the count of group.pitch cannot be 1", "2 or more"),
        ("\"group.pitch\" = { from = 1, to = 2, step = 1 }", "unknown key `step` in group.pitch", "give a list"),
        ("\"group.pitch\" = { from = 1, to = 2, count = 2, scale = \"cubic\" }", "the scale of group.pitch", "\"log\""),
        ("\"head.centre_m\" = [1]", "head.centre_m is not a number but [0.0, 0.0, -0.01425]", "vary numbers alone"),
        (
            "\"base.mass_centre_below_joint_m\" = { from = -1, to = 2, count = 2, scale = \"log\" }",
            "the range of base.mass_centre_below_joint_m from -1 has no logarithm",
            "above 0",
        ),
        ("\"solver.sweeps\" = [20, 25.5]", "solver.sweeps takes whole numbers alone", "whole numbers"),
        (
            "\"group.stiffness\" = [2]\n\"flagellum.young_pa\" = [1e6]",
            "flagellum.young_pa follows from group.stiffness",
            "vary either flagellum.young_pa or group.stiffness",
        ),
        (
            "\"group.radius\" = [2]\n\"joint.tether_full_nm_per_rad\" = [1e-4]",
            "joint.tether_full_nm_per_rad follows from group.radius",
            "vary either",
        ),
        ("\"joint.tether_lumped_nm_per_rad\" = [1e-4]", "has no effect", "joint.tether_full_nm_per_rad"),
        (many, "the plan has 1e12 points, more than 10000000", "fewer values"),
        ("design = \"all\"", "the design is not known", "\"one at a time\""),
        ("design = { sobol = 0 }", "sobol cannot be 0", "from 1 to 10000000"),
        ("design = { sobol = 10, seeds = 1 }", "the design is not known", "seed = 7"),
        (
            "design = { sobol = 10 }\n\"group.pitch\" = [1]",
            "group.pitch cannot be a list in a Sobol design",
            "from = 0.5",
        ),
        (
            "design = { sobol = 10 }\n\"group.pitch\" = { from = 1, to = 2, count = 3 }",
            "group.pitch has a count in a Sobol design",
            "leave count out",
        ),
        (
            "design = { sobol = 10 }\n\"solver.sweeps\" = { from = 20, to = 30 }",
            "solver.sweeps takes whole numbers",
            "another design",
        ),
        (
            "design = \"one at a time\"\n\"group.pitch\" = [0.5, 1]",
            "group.pitch = 1 is the robot's own value",
            "leave it out",
        ),
        (
            "\"speeds.w1_rpm\" = [1]\n\"speeds.w2_rpm\" = [1]",
            "the speeds stand in [speeds] and in [vary]",
            "leave one of them out",
        ),
    ] {
        let text = format!("[vary]\n{vary}\n[speeds]\npairs = [[50, 10]]\n");
        let Err(PlanError::Invalid { place, what: found, cure: fix }) = parse(&text) else {
            panic!("{vary} is accepted")
        };
        let message = format!("{place}: {found}");
        assert!(message.contains(what) && fix.contains(cure), "{vary}: {message}; {fix}");
    }
    for (text, what, cure) in [
        ("[vary]\n\"speeds.w1_rpm\" = [1, 2]\n", "speeds.w1_rpm varies alone", "vary speeds.w2_rpm too"),
        ("[vary]\n\"group.pitch\" = [1]\n", "the plan has no trials", "pairs = [[50, 10]]"),
        (
            "[vary]\n\"speeds.w1_rpm\" = [100]\n\"speeds.w2_rpm\" = [1]\n",
            "100 rpm is beyond ±90 rpm",
            "give -90 to 90 rpm",
        ),
        ("[trial]\nphases = 0\n[speeds]\npairs = [[1, 2]]\n", "phases cannot be 0", "from 1 to 360"),
        ("[trial]\nrun = 0\n[speeds]\npairs = [[1, 2]]\n", "run cannot be 0", "plain number"),
        ("[trial]\nmethod = \"fast\"\n[speeds]\npairs = [[1, 2]]\n", "method cannot be \"fast\"", "\"trial\""),
        ("[trial]\nrolls = 5\n[speeds]\npairs = [[1, 2]]\n", "unknown key `rolls`", "`run`"),
        ("[trial]\nphase_deg = [0, 90]\n[speeds]\npairs = [[1, 2]]\n", "a sweep has no phase_deg", "phases = 4"),
        ("vary = 3\n[speeds]\npairs = [[1, 2]]\n", "vary cannot be 3", "[vary]"),
        ("[speeds]\npairs = [[1, 2, 3]]\n", "pairs cannot be [[1, 2, 3]]", "pairs = [[50, 10]]"),
    ] {
        let Err(PlanError::Invalid { place, what: found, cure: fix }) = parse(text) else {
            panic!("{text} is accepted")
        };
        let message = format!("{place}: {found}");
        assert!(message.contains(what) && fix.contains(cure), "{text}: {message}; {fix}");
    }
    let mixture = "[vary]\n\"fluid.viscosity_pa_s\" = [1]\n[speeds]\npairs = [[1, 2]]\n";
    let glycerol = "[fluid]\nglycerol = { mass_fraction = 0.99, temperature_c = 22 }\n";
    let robot = |name: &str| Ok(RobotFile { name: name.to_owned(), text: glycerol.to_owned() });
    let robot_is = format!("[session]\nrobot = \"mine.toml\"\n{mixture}");
    let error = SweepPlan::parse(&robot_is, "plan.toml", &robot).unwrap_err().to_string();
    assert!(error.ends_with("fluid.viscosity_pa_s has no effect"), "{error}");
}

/// A plan for trials is a sweep over its speeds, unless they change in the run.
#[test]
fn plans_for_trials_are_sweeps() {
    for (name, wanted) in [
        ("published-map", Ok(190)),
        ("published-points", Ok(4)),
        ("demo", Ok(2)),
        ("bundling", Err("a sweep has no reverse")),
        ("hand-turn-z", Err("a sweep has no hand_turn")),
    ] {
        let found = SweepPlan::load(Path::new(name)).map(|plan| plan.points());
        match (found, wanted) {
            (Ok(points), Ok(wanted)) => assert_eq!(points, wanted, "{name}"),
            (Err(error), Err(wanted)) => assert!(error.to_string().ends_with(wanted), "{error}"),
            (found, wanted) => panic!("{name}: {found:?}, not {wanted:?}"),
        }
    }
    let trials = "[session]\nseed = 7\nrepeats = 3\nsensor = \"s.toml\"\n[trial]\nrest_at_most = 9\nrun = 60\n\
                  [board]\ngyro_range_dps = 250\n[speeds]\npairs = [[50, 10], [37.3, -52.91]]\n";
    let plan = parse(trials).unwrap();
    assert_eq!((plan.points(), plan.method, plan.run_s), (2, Method::Steady, 60.0), "a repeat has the same state");
    let error = parse(&trials.replace("rest_at_most = 9", "preroll = \"9\"")).unwrap_err().to_string();
    assert!(error.contains("preroll cannot be \"9\""), "{error}");
}
