//! The plan of a sweep in rows: what varies, at which speeds, how each point was computed, by which robot and program.

use super::parameters;
use super::scroll::scrolled;
use super::text::{clip, plain};
use maud::{Markup, html};
use std::path::Path;
use study::statistics::distinct;
use study::sweep::{
    Axis, Design, Folder, Key, Scale, SweepError, SweepPlan, Values, csv_path, is_folder, parquet_path,
};
use study::text::word;

/// Largest number of values or pairs of speeds that are named one by one.
const FEW: usize = 12;

/// The longest file that is shown, in characters.
const LONGEST_FILE: usize = 20_000;

/// Returns the plan of a table in the folder of its sweep; empty for another table.
pub(super) fn section(table: &Path) -> Markup {
    let parent = table.parent().map(|parent| if parent.as_os_str().is_empty() { Path::new(".") } else { parent });
    let is_in = |folder: &&Path| {
        is_folder(folder)
            && [parquet_path(folder), csv_path(folder)].iter().any(|path| path.file_name() == table.file_name())
    };
    let Some(folder) = parent.filter(is_in) else { return html! {} };
    let read = Folder::open(folder).and_then(|folder| Ok((programs(&folder)?, folder)));
    html! {
        section.plan {
            h2 { "Plan" }
            @match read {
                Ok((programs, Folder { sweep, .. })) => { (of_plan(&sweep.plan, sweep.results, &programs)) }
                Err(error) => { p { "The plan cannot be read: " (clip(&error.to_string(), 300)) } }
            }
        }
    }
}

/// Returns version and commit of each program that computed points.
fn programs(folder: &Folder) -> Result<Vec<String>, SweepError> {
    let mut programs: Vec<String> = Vec::new();
    folder.read(|origin, _| {
        if programs.last() != Some(&origin.program) && !programs.contains(&origin.program) {
            programs.push(origin.program.clone());
        }
        Ok(())
    })?;
    Ok(programs)
}

fn of_plan(plan: &SweepPlan, results: u32, programs: &[String]) -> Markup {
    let robot = &plan.robot;
    let parameters = robot.parse().ok().and_then(|robot| toml::to_string(&robot).ok()).unwrap_or_default();
    html! {
        (varies(plan))
        table.facts { @for (name, value) in facts(plan, results, programs) { tr { th scope="row" { (name) } td { (clip(&value, 600)) } } } }
        details {
            summary { "Robot " (clip(&robot.name, 200)) ": what differs from the built-in robot" }
            (parameters::table(&parameters, &robot.name, &robot.text))
            @if !robot.text.is_empty() { pre { (clip(&robot.text, LONGEST_FILE)) } }
        }
        details { summary { "Plan file" } pre { (clip(&plan.text, LONGEST_FILE)) } }
    }
}

/// Returns what varies, with the meanings of the robot's keys.
fn varies(plan: &SweepPlan) -> Markup {
    let meanings = parameters::meanings();
    let meaning = |axis: &Axis| match &axis.key {
        Key::Robot(key) => meanings.get(key).cloned().unwrap_or_default(),
        Key::Group(_) => "Group over that of the robot published.".to_owned(),
        Key::Speed(motor) => format!("Speed of flagellum {}, rpm.", motor + 1),
    };
    html! {
        @if !plan.axes.is_empty() {
            (scrolled("What varies", &["Varies", "Values", "Meaning"], &html! { @for axis in &plan.axes {
                tr { td { (clip(axis.key.name(), 100)) } td { (values(&axis.values)) } td { (meaning(axis)) } }
            } }))
        }
    }
}

fn facts(plan: &SweepPlan, results: u32, programs: &[String]) -> Vec<(&'static str, String)> {
    let speeds = speeds(&plan.speeds_rpm);
    let combined = match plan.design {
        _ if plan.axes.is_empty() => String::new(),
        Design::AllCombinations => "all combinations".to_owned(),
        Design::OneAtATime => "one at a time, from the values of the robot".to_owned(),
        Design::Sobol { count, seed } => format!("{count} points of a Sobol sequence, seed {seed}"),
    };
    let phases = match plan.phases {
        1 => "one".to_owned(),
        phases => format!("{phases}, where the ratio of the speeds makes them matter"),
    };
    let facts = [
        ("Speeds", speeds),
        ("Design", combined),
        ("Points", plan.points().to_string()),
        ("Method", format!("{}, at most {} s a point", word(&plan.method), plain(plan.run_s))),
        ("Starting phases", phases),
        ("Robot", plan.robot.name.clone()),
        ("Computed by", programs.iter().map(|program| format!("biflag {program}")).collect::<Vec<_>>().join(", ")),
        ("Version of the results", results.to_string()),
    ];
    facts.into_iter().filter(|(_, value)| !value.is_empty()).collect()
}

/// Returns the values of an axis in words: each of a few, or the ends of a range.
fn values(values: &Values) -> String {
    match values {
        Values::List(list) => listed(list),
        // A Sobol design chooses its own values.
        Values::Range(range) => {
            let count = if range.count == 0 { String::new() } else { format!(", {} values", range.count) };
            let scale = if range.scale == Scale::Log { ", by equal ratios" } else { "" };
            format!("{} to {}{count}{scale}", number(range.from), number(range.to))
        }
    }
}

/// Formats a number of a robot's file, of any magnitude.
fn number(value: f64) -> String {
    let size = value.abs();
    let text = if size != 0.0 && !(1e-3..1e6).contains(&size) { format!("{value:e}") } else { value.to_string() };
    text.replace('-', "−")
}

fn listed(values: &[f64]) -> String {
    match values {
        [first, .., last] if values.len() > FEW => {
            format!("{} values, {} to {}", values.len(), number(*first), number(*last))
        }
        few => few.iter().map(|value| number(*value)).collect::<Vec<_>>().join(", "),
    }
}

/// Returns pairs of speeds in words: the values of both if all combinations occur, or each of a few pairs.
fn speeds(pairs: &[[f64; 2]]) -> String {
    let [w1, w2] = [0, 1].map(|k| distinct(pairs.iter().map(|pair| pair[k])));
    if w1.len() > 1 && w2.len() > 1 && w1.len() * w2.len() == pairs.len() {
        return format!("every pair of w1 = {} and w2 = {} rpm", stepped(&w1), stepped(&w2));
    }
    let pair = |[w1, w2]: &[f64; 2]| format!("({}, {})", number(*w1), number(*w2));
    match pairs {
        [] => String::new(),
        [first, .., last] if pairs.len() > FEW => {
            format!("{} pairs, {} to {} rpm", pairs.len(), pair(first), pair(last))
        }
        few => format!("{} rpm", few.iter().map(pair).collect::<Vec<_>>().join(", ")),
    }
}

/// Returns the ends and the step of sorted values if they are evenly spaced, otherwise all values, in words.
fn stepped(values: &[f64]) -> String {
    let step = values[1] - values[0];
    let is_even = values.windows(2).all(|pair| (pair[1] - pair[0] - step).abs() < 1e-9);
    match values {
        [first, _, _, .., last] if is_even => format!("{} to {} by {}", number(*first), number(*last), number(step)),
        other => listed(other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use study::plan::RobotFile;

    fn plan(text: &str, robot: &RobotFile) -> SweepPlan {
        SweepPlan::parse(text, "plan.toml", &|_| Ok(robot.clone())).unwrap()
    }

    #[test]
    fn a_plan_is_told_in_rows() {
        let robot = RobotFile { name: "mine.toml".to_owned(), text: "[fluid]\nviscosity_pa_s = 1.5\n".to_owned() };
        let text = "[session]\nname = \"softer\"\nrobot = \"mine.toml\"\n[vary]\n\"fluid.viscosity_pa_s\" = [0.8, 1.25]\n\
                    \"group.stiffness\" = { from = 0.5, to = 2.0, count = 7, scale = \"log\" }\n[trial]\nphases = 4\n\
                    [speeds]\ngrid = { w1 = [-90, 90, 30], w2 = [0, 45, 45] }\n";
        let plan_of = plan(text, &robot);
        let shown = of_plan(&plan_of, 7, &["0.1.0 abc".to_owned()]).into_string();
        for expected in [
            "<td>fluid.viscosity_pa_s</td><td>0.8, 1.25</td><td>Dynamic viscosity, Pa s (publication).</td>",
            "<td>group.stiffness</td><td>0.5 to 2, 7 values, by equal ratios</td>",
            ">Speeds</th><td>every pair of w1 = −90 to 90 by 30 and w2 = 0, 45 rpm</td>",
            ">Design</th><td>all combinations</td>",
            ">Points</th><td>196</td>",
            ">Method</th><td>steady, at most 120 s a point</td>",
            ">Starting phases</th><td>4, where",
            ">Robot</th><td>mine.toml</td>",
            ">Computed by</th><td>biflag 0.1.0 abc</td>",
            "<td>fluid.viscosity_pa_s</td><td>1.5</td><td>mine.toml</td>",
            "[session]\nname = &quot;softer&quot;",
        ] {
            assert!(shown.contains(expected), "{expected} in {shown}");
        }
        let sobol = "[vary]\n\"flagellum.young_pa\" = { from = 0.8e6, to = 1.6e6 }\ndesign = { sobol = 64, seed = 7 }\n[speeds]\npairs = [[50, 10], [0, -45]]\n";
        let shown = of_plan(&plan(sobol, &RobotFile::built_in("physical")), 7, &[]).into_string();
        for expected in [
            "<td>800000 to 1.6e6</td>",
            "(50, 10), (0, −45) rpm",
            "64 points of a Sobol sequence, seed 7",
            "All parameters are those",
        ] {
            assert!(shown.contains(expected), "{expected} in {shown}");
        }
        assert!(!shown.contains("Computed by"), "{shown}");
    }
}
