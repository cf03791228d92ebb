//! A sweep's plan: the TOML file that says what varies, and how each point is computed.
//!
//! ```
//! let plan = host::sweep::SweepPlan::parse(
//!     "[vary]\n\"group.stiffness\" = [0.5, 1, 2]\n[speeds]\npairs = [[50, 10], [0, 45]]",
//!     "plan.toml",
//!     &|name| Ok(host::plan::RobotFile::built_in(name)),
//! )?;
//! assert_eq!(plan.points(), 6);
//! # Ok::<(), host::plan::PlanError>(())
//! ```

use super::axis::{Axis, Range, Scale, Values};
use super::design::Design;
use super::key::{self, Group, Key};
use super::sobol;
use crate::plan::expand::{SpeedsTable, speeds};
use crate::plan::source::{FileKind, Source, number};
use crate::plan::{MAX_PHASE_S, MIN_RUN_S, PHYSICAL, PlanError, RobotFile, file, robot};
use biflag_log::Method;
use protocol::units::CentiRpm;
use serde::Deserialize;
use sim::groups::Groups;
use sim::params::{BUILT_IN, Robot};
use std::collections::BTreeMap;
use std::ops;
use std::path::Path;
use toml::{Spanned, Value};

/// An example of a plan.
pub const EXAMPLE: &str = r#"[session]
name = "softer"
robot = "physical"       # or "published", or a robot file

[vary]                   # numbers of the robot's file, or groups as multiples of their published values
"fluid.viscosity_pa_s" = [0.8, 1.0, 1.2]
"group.stiffness" = { from = 0.5, to = 2.0, count = 7, scale = "log" }
# design = "one at a time", or { sobol = 10000, seed = 7 }, instead of all combinations

[trial]
run = 120                # seconds, at most
method = "steady"        # solves for the steady state; "trial" runs every point that long
phases = 4               # starting phases of the flagella, where the ratio of the speeds makes them matter

[speeds]                 # rpm; every robot runs at each pair
grid = { w1 = [-90, 90, 10], w2 = [0, 90, 10] }
"#;

/// The most points of a sweep.
pub const MAX_POINTS: u64 = 10_000_000;

/// A sweep's plan, checked.
#[derive(Clone, PartialEq, Debug)]
pub struct SweepPlan {
    /// `[session] name`; the name of the sweep's folder unless the user says otherwise.
    pub name: String,
    /// The robot that varies.
    pub robot: RobotFile,
    /// Duration of a trial, s; with the method `steady`, of the longest simulation if no repeating motion is found.
    pub run_s: f64,
    /// How each point is computed.
    pub method: Method,
    /// Number of starting phases where they matter.
    pub phases: usize,
    /// Pairs of speeds at which every robot runs, rpm; empty if the axes have the speeds.
    pub speeds_rpm: Vec<[f64; 2]>,
    /// What varies, in alphabetical order.
    pub axes: Vec<Axis>,
    /// How the values of the axes are combined.
    pub design: Design,
    /// The content of the file.
    pub text: String,
}

const KIND: FileKind = FileKind {
    noun: "plan",
    example: "`biflag sweep --help` shows one",
    tables: &["session", "trial", "speeds", "vary", "grid"],
    help,
};

const VALUES: &str =
    "give a list such as [0.8, 1.0], or a range such as { from = 0.5, to = 2.0, count = 7, scale = \"log\" }";

const DESIGN: &str = "give \"all combinations\", \"one at a time\" or { sobol = 10000, seed = 7 }";

fn help(key: &str) -> Option<&'static str> {
    Some(match key {
        "method" => "give \"steady\" or \"trial\"",
        "phases" => "give a whole number from 1 to 360: at how many starting phases a point runs where they matter",
        "run" => "give seconds as a plain number, such as run = 120",
        "vary" => "write it as a table: [vary]",
        "design" => DESIGN,
        "sobol" => "give the number of robots as a whole number from 1 to 10000000",
        "from" | "to" | "count" | "scale" => VALUES,
        _ => return (file::KIND.help)(key),
    })
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SweepFile {
    #[serde(default)]
    session: SessionTable,
    #[serde(default)]
    trial: TrialTable,
    speeds: Option<Spanned<SpeedsTable>>,
    #[serde(default)]
    vary: BTreeMap<String, Spanned<Value>>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
struct SessionTable {
    name: Option<Spanned<String>>,
    robot: Option<Spanned<String>>,
    #[serde(rename = "note")]
    _note: String,
    #[serde(rename = "operator")]
    _operator: String,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
struct TrialTable {
    run: Option<Spanned<f64>>,
    method: Option<Spanned<Method>>,
    phases: Option<Spanned<i64>>,
}

/// A value of `[vary]` with its name and its place.
struct Entry<'a> {
    name: String,
    value: &'a Value,
    span: ops::Range<usize>,
}

impl SweepPlan {
    /// Reads and checks a plan and the robot file that it names.
    ///
    /// # Errors
    /// [`PlanError`].
    pub fn load(path: &Path) -> Result<Self, PlanError> {
        let text = KIND.read(path)?;
        Self::parse(&text, &path.display().to_string(), &|name| {
            if BUILT_IN.contains(&name) {
                return Ok(RobotFile::built_in(name));
            }
            Ok(RobotFile { name: name.to_owned(), text: robot::load(&robot::named_by(path, name))?.text })
        })
    }

    /// Reads a plan from its text; errors call the file `name`. `robot` gives the robot of a name in the plan.
    ///
    /// # Errors
    /// [`PlanError`].
    pub fn parse(
        text: &str,
        name: &str,
        robot: &dyn Fn(&str) -> Result<RobotFile, PlanError>,
    ) -> Result<Self, PlanError> {
        let source = Source { kind: &KIND, text, name };
        let file: SweepFile = source.read()?;
        let session = file.session;
        if let Some(name) = session.name.as_ref().filter(|name| name.get_ref().trim().is_empty()) {
            return Err(source.error(name.span(), "the name of the session is empty", "give it a name"));
        }
        let robot_file = robot(session.robot.as_ref().map_or(PHYSICAL, |robot| robot.get_ref()))?;
        let (run_s, phases) = (run_s(&file.trial, &source)?, phases(&file.trial, &source)?);
        let (design, axes) = vary(&file.vary, &robot_file, &source)?;
        let in_axes = axes.iter().any(|axis| matches!(axis.key, Key::Speed(_)));
        let speeds_rpm = match &file.speeds {
            Some(table) if in_axes => {
                let what = "the speeds stand in [speeds] and in [vary]";
                return Err(source.error(table.span(), what, "leave one of them out"));
            }
            None if in_axes => Vec::new(),
            table => {
                let none = Spanned::new(0..0, SpeedsTable::default());
                let pairs = speeds(table.as_ref().unwrap_or(&none), &source)?;
                pairs.into_iter().map(|pair| pair.map(CentiRpm::rpm)).collect()
            }
        };
        let plan = Self {
            name: session.name.map_or("sweep".to_owned(), |name| name.into_inner().trim().to_owned()),
            robot: robot_file,
            run_s,
            method: file.trial.method.map_or(Method::Steady, Spanned::into_inner),
            phases,
            speeds_rpm,
            axes,
            design,
            text: text.to_owned(),
        };
        let points = plan.design.count(&plan.axes) * plan.speeds_rpm.len().max(1) as f64;
        if points > MAX_POINTS as f64 {
            let first = file.vary.values().next().map_or(0..0, Spanned::span);
            let what = format!("the plan has {} points, more than {MAX_POINTS}", number(points));
            return Err(source.error(first, what, "give fewer values, or take a Sobol design: { sobol = 10000 }"));
        }
        Ok(plan)
    }

    /// Returns the number of points.
    pub fn points(&self) -> u64 {
        // At most MAX_POINTS.
        self.design.count(&self.axes) as u64 * self.speeds_rpm.len().max(1) as u64
    }
}

fn run_s(table: &TrialTable, source: &Source) -> Result<f64, PlanError> {
    match &table.run {
        None => Ok(120.0),
        Some(run) if (MIN_RUN_S..=MAX_PHASE_S).contains(run.get_ref()) => Ok(*run.get_ref()),
        Some(run) => Err(source.out_of_range(run.span(), "run", number(*run.get_ref()))),
    }
}

fn phases(table: &TrialTable, source: &Source) -> Result<usize, PlanError> {
    match &table.phases {
        None => Ok(1),
        Some(phases) if (1..=360).contains(phases.get_ref()) => Ok(*phases.get_ref() as usize),
        Some(phases) => Err(source.out_of_range(phases.span(), "phases", phases.get_ref())),
    }
}

/// Reads `[vary]`.
fn vary(
    table: &BTreeMap<String, Spanned<Value>>,
    file: &RobotFile,
    source: &Source,
) -> Result<(Design, Vec<Axis>), PlanError> {
    let robot = file.parse()?;
    // Numbers, flags, names and short lists all have a form in TOML.
    let robot_value = Value::try_from(&robot).unwrap_or(Value::Table(toml::Table::new()));
    let design = match table.get("design") {
        Some(value) => design(value, source)?,
        None => Design::AllCombinations,
    };
    let mut entries = Vec::new();
    for (name, value) in table.iter().filter(|(name, _)| *name != "design") {
        flatten(name, value.get_ref(), &value.span(), &mut entries);
    }
    let mut axes = Vec::new();
    for entry in &entries {
        axes.push(axis(entry, &design, &robot, &robot_value, source)?);
    }
    for (entry, axis) in entries.iter().zip(&axes) {
        check_alone(entry, axis, &axes, source)?;
    }
    if let Some(entry) = entries.get(sobol::DIMENSIONS).filter(|_| matches!(design, Design::Sobol { .. })) {
        let what = format!("a Sobol design has at most {} keys", sobol::DIMENSIONS);
        return Err(source.error(entry.span.clone(), what, "leave this one out"));
    }
    Ok((design, axes))
}

/// Collects the entries below a key. A dotted key without quotes is a table in TOML.
fn flatten<'a>(name: &str, value: &'a Value, span: &ops::Range<usize>, entries: &mut Vec<Entry<'a>>) {
    let is_range = |table: &toml::Table| table.values().all(|value| !value.is_table() && !value.is_array());
    match value {
        Value::Table(table) if !is_range(table) => {
            for (part, value) in table {
                flatten(&format!("{name}.{part}"), value, span, entries);
            }
        }
        value => entries.push(Entry { name: name.to_owned(), value, span: span.clone() }),
    }
}

fn design(value: &Spanned<Value>, source: &Source) -> Result<Design, PlanError> {
    let wrong = || source.error(value.span(), "the design is not known", DESIGN);
    match value.get_ref() {
        Value::String(name) if name == "all combinations" => Ok(Design::AllCombinations),
        Value::String(name) if name == "one at a time" => Ok(Design::OneAtATime),
        Value::Table(table) if table.keys().all(|key| ["sobol", "seed"].contains(&key.as_str())) => {
            let count = match table.get("sobol").ok_or_else(wrong)? {
                Value::Integer(count @ 1..) if *count as u64 <= MAX_POINTS => *count as u32,
                other => return Err(source.out_of_range(value.span(), "sobol", other)),
            };
            let seed = match table.get("seed") {
                None => 0,
                Some(Value::Integer(seed @ 0..)) => *seed as u64,
                Some(other) => return Err(source.out_of_range(value.span(), "seed", other)),
            };
            Ok(Design::Sobol { count, seed })
        }
        _ => Err(wrong()),
    }
}

fn axis(
    entry: &Entry,
    design: &Design,
    robot: &Robot,
    robot_value: &Value,
    source: &Source,
) -> Result<Axis, PlanError> {
    let name = &entry.name;
    let wrong = |what: String, cure: &str| Err(source.error(entry.span.clone(), what, cure));
    let Some(key) = Key::parse(name, robot_value) else {
        let (what, cure) = unknown(name, robot_value);
        return wrong(what, &cure);
    };
    let values = values(entry, design, source)?;
    let is_whole = matches!(key::value(robot_value, name), Some(Value::Integer(_)));
    if is_whole
        && (matches!(design, Design::Sobol { .. }) || (0..values.count()).any(|i| values.value(i).fract() != 0.0))
    {
        return wrong(
            format!("{name} takes whole numbers alone"),
            "give a list of whole numbers, in another design than Sobol",
        );
    }
    match &key {
        Key::Robot(_) => {
            let without_effect = match name.as_str() {
                "fluid.viscosity_pa_s" | "fluid.density_kg_m3" if robot.fluid.glycerol.is_some() => {
                    Some("the robot's file gives a mixture of glycerol instead; vary fluid.glycerol.temperature_c")
                }
                "joint.tether_lumped_nm_per_rad" => {
                    Some("a sweep uses the closure `full`; vary joint.tether_full_nm_per_rad")
                }
                _ => None,
            };
            if let Some(cure) = without_effect {
                return wrong(format!("{name} has no effect"), cure);
            }
        }
        Key::Group(_) => {
            let least = match &values {
                Values::List(values) => values.iter().copied().fold(f64::INFINITY, f64::min),
                Values::Range(range) => range.from,
            };
            if least <= 0.0 {
                let cure = "give multiples of the published value, above 0";
                return wrong(format!("{name} cannot be {}", number(least)), cure);
            }
        }
        Key::Speed(_) => {
            if *design == Design::OneAtATime {
                return wrong(format!("{name} cannot vary one at a time"), "give the speeds in [speeds]");
            }
            let limit = CentiRpm::LIMIT.rpm();
            let ends = match &values {
                Values::List(values) => values.clone(),
                Values::Range(range) => vec![range.from, range.to],
            };
            if let Some(speed) = ends.into_iter().find(|speed| speed.abs() > limit) {
                let what = format!("{} rpm is beyond ±{limit} rpm", number(speed));
                return wrong(what, &format!("give -{limit} to {limit} rpm"));
            }
        }
    }
    if *design == Design::OneAtATime {
        let own = own_value(&key, robot, robot_value);
        let is_own = |value: f64| (value - own).abs() <= 1e-9 * own.abs();
        if let Some(value) = (0..values.count()).map(|i| values.value(i)).find(|value| is_own(*value)) {
            let what = format!("{name} = {} is the robot's own value, which has a point already", number(value));
            return wrong(what, "leave it out");
        }
    }
    Ok(Axis { key, values })
}

/// Returns the value of a key in the unchanged robot: of a group as a multiple; `None` for a speed.
fn own_value(key: &Key, robot: &Robot, robot_value: &Value) -> f64 {
    match key {
        Key::Robot(name) => key::number(robot_value, name).unwrap_or(f64::NAN),
        Key::Group(group) => group.of(&Groups::of(robot)) / group.of(&Groups::of(&Robot::published())),
        Key::Speed(_) => f64::NAN,
    }
}

/// Describes a key that a sweep does not know, and what to write instead.
fn unknown(name: &str, robot: &Value) -> (String, String) {
    if let Some(value) = key::value(robot, name).filter(|value| !value.is_table()) {
        let what = format!("{name} is not a number but {value}");
        return (what, "vary numbers alone, and give each other value a plan of its own".to_owned());
    }
    let table = name.split('.').next().unwrap_or_default();
    let keys = match table {
        "group" => Group::ALL.map(|group| group.name().to_owned()).to_vec(),
        "speeds" => vec!["speeds.w1_rpm".to_owned(), "speeds.w2_rpm".to_owned()],
        table => key::numbers(robot).into_iter().filter(|key| key.split('.').next() == Some(table)).collect(),
    };
    let cure = match keys.as_slice() {
        [] => "write a key of the robot's file, such as \"fluid.viscosity_pa_s\", a group, such as \"group.stiffness\", or \
               design"
            .to_owned(),
        keys => format!("write one of {}", keys.join(", ")),
    };
    (format!("unknown key `{name}`"), cure)
}

fn values(entry: &Entry, design: &Design, source: &Source) -> Result<Values, PlanError> {
    let Entry { name, value, span } = entry;
    let wrong = |what: String, cure: &str| Err(source.error(span.clone(), what, cure));
    let real = |value: &Value| match value {
        Value::Float(number) => Some(*number).filter(|number| number.is_finite()),
        Value::Integer(number) => Some(*number as f64),
        _ => None,
    };
    let is_sobol = matches!(design, Design::Sobol { .. });
    match value {
        Value::Array(_) if is_sobol => {
            wrong(format!("{name} cannot be a list in a Sobol design"), "give a range such as { from = 0.5, to = 2.0 }")
        }
        Value::Array(list) if list.is_empty() => wrong(format!("{name} has no values"), VALUES),
        Value::Array(list) => {
            let mut numbers = Vec::new();
            for item in list {
                let Some(number) = real(item) else { return wrong(format!("{name} cannot hold {item}"), VALUES) };
                numbers.push(number);
            }
            let mut sorted = numbers.clone();
            sorted.sort_by(f64::total_cmp);
            match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
                Some(pair) => wrong(format!("{name} has {} twice", number(pair[0])), "leave one of them out"),
                None => Ok(Values::List(numbers)),
            }
        }
        Value::Table(table) => {
            if let Some(key) = table.keys().find(|key| !["from", "to", "count", "scale"].contains(&key.as_str())) {
                return wrong(format!("unknown key `{key}` in {name}"), VALUES);
            }
            let end = |key: &str| table.get(key).and_then(real);
            let (Some(from), Some(to)) = (end("from"), end("to")) else {
                return wrong(format!("{name} needs from and to"), VALUES);
            };
            let scale = match table.get("scale").map(Value::as_str) {
                None | Some(Some("linear")) => Scale::Linear,
                Some(Some("log")) => Scale::Log,
                Some(_) => return wrong(format!("the scale of {name} is not known"), "give \"linear\" or \"log\""),
            };
            // Values that differ in the first nine digits differ after rounding.
            if to - from <= 1e-9 * from.abs().max(to.abs()) {
                let what = format!("the range of {name} from {} to {} is empty", number(from), number(to));
                return wrong(what, "give the smaller value as from and a larger one as to");
            }
            if scale == Scale::Log && from <= 0.0 {
                let what = format!("the range of {name} from {} has no logarithm", number(from));
                return wrong(what, "give a range above 0, or scale = \"linear\"");
            }
            let count = match table.get("count") {
                Some(_) if is_sobol => {
                    return wrong(
                        format!("{name} has a count in a Sobol design, which has its own"),
                        "leave count out",
                    );
                }
                None if is_sobol => 0,
                None => return wrong(format!("{name} needs a count"), VALUES),
                Some(Value::Integer(count @ 2..)) => *count as u64,
                Some(other) => return wrong(format!("the count of {name} cannot be {other}"), "give 2 or more"),
            };
            Ok(Values::Range(Range { from, to, count, scale }))
        }
        other => wrong(format!("{name} cannot be {other}"), VALUES),
    }
}

/// Refuses two axes that set the same quantity, and one speed without the other.
fn check_alone(entry: &Entry, axis: &Axis, axes: &[Axis], source: &Source) -> Result<(), PlanError> {
    let wrong = |what: String, cure: String| Err(source.error(entry.span.clone(), what, cure));
    let name = &entry.name;
    match &axis.key {
        Key::Robot(key) => {
            let mut groups = axes.iter().filter_map(|axis| axis.key.group());
            match groups.find(|group| group.moves(key)) {
                Some(group) => {
                    let group = group.name();
                    wrong(format!("{name} follows from {group}"), format!("vary either {name} or {group}"))
                }
                None => Ok(()),
            }
        }
        Key::Speed(motor) if !axes.iter().any(|axis| axis.key == Key::Speed(1 - motor)) => {
            let other = Key::Speed(1 - motor);
            wrong(format!("{name} varies alone"), format!("vary {} too, or give the speeds in [speeds]", other.name()))
        }
        _ => Ok(()),
    }
}
