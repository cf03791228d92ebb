//! `[vary]` of a sweep's plan: the keys, their values, and the way to combine them.

use super::axis::{Axis, Range, Scale, Values};
use super::design::{Design, MAX_POINTS};
use super::key::{self, Group, Key};
use super::sobol;
use crate::plan::source::{self, Source, number};
use crate::plan::{PlanError, RobotFile};
use biflag_log::similar::suggest;
use protocol::units::CentiRpm;
use sim::groups::Groups;
use sim::params::Robot;
use std::collections::BTreeMap;
use std::ops;
use toml::{Spanned, Value};

/// The forms of the values of a key.
pub(super) const VALUES: &str =
    "give a list such as [0.8, 1.0], or a range such as { from = 0.5, to = 2.0, count = 7, scale = \"log\" }";

/// The forms of a design.
pub(super) const DESIGN: &str = "give \"all combinations\", \"one at a time\" or { sobol = 10000, seed = 7 }";

/// A value of `[vary]` with its name and its span.
struct Entry<'a> {
    name: String,
    value: &'a Value,
    span: ops::Range<usize>,
}

/// Reads `[vary]`: the design, and the axes in alphabetical order. `file` is the robot that varies.
pub(super) fn vary(
    table: &BTreeMap<String, Spanned<Value>>,
    file: &RobotFile,
    source: &Source,
) -> Result<(Design, Vec<Axis>), PlanError> {
    let robot = file.parse()?;
    // Numbers, flags, names and short lists all have a form in TOML.
    let robot_value = Value::try_from(&robot).unwrap_or(Value::Table(toml::Table::new()));
    let design = table.get("design").map_or(Ok(Design::AllCombinations), |value| design(value, source))?;
    let mut entries = Vec::new();
    for (name, value) in table.iter().filter(|(name, _)| *name != "design") {
        flatten(name, value.get_ref(), &value.span(), &mut entries);
    }
    let axes = entries.iter().map(|entry| axis(entry, &design, &robot, &robot_value, source));
    let axes = axes.collect::<Result<Vec<_>, _>>()?;
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
    let is_sobol = matches!(design, Design::Sobol { .. });
    if is_whole && (is_sobol || values.all().any(|value| value.fract() != 0.0)) {
        let cure = "give a list of whole numbers, in another design than Sobol";
        return wrong(format!("{name} takes whole numbers alone"), cure);
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
            let least = values.bounds().into_iter().fold(f64::INFINITY, f64::min);
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
            if let Some(speed) = values.bounds().into_iter().find(|speed| speed.abs() > limit) {
                let what = format!("{} rpm is beyond ±{limit} rpm", number(speed));
                return wrong(what, &format!("give -{limit} to {limit} rpm"));
            }
        }
    }
    if *design == Design::OneAtATime {
        let own = own_value(&key, robot, robot_value);
        let is_own = |value: f64| (value - own).abs() <= 1e-9 * own.abs();
        if let Some(value) = values.all().find(|value| is_own(*value)) {
            let what = format!("{name} = {} is the robot's own value, which has a point already", number(value));
            return wrong(what, "leave it out");
        }
    }
    Ok(Axis { key, values })
}

/// Returns the value of a key in the unchanged robot: for a group, as a multiple; for a speed, NaN.
fn own_value(key: &Key, robot: &Robot, robot_value: &Value) -> f64 {
    match key {
        Key::Robot(name) => key::number(robot_value, name).unwrap_or(f64::NAN),
        Key::Group(group) => group.of(&Groups::of(robot)) / group.of(&Groups::of(&Robot::published())),
        Key::Speed(_) => f64::NAN,
    }
}

/// Describes an unknown key, and the correction.
fn unknown(name: &str, robot: &Value) -> (String, String) {
    if let Some(value) = key::value(robot, name).filter(|value| !value.is_table()) {
        let what = format!("{name} is not a number but {value}");
        return (what, "vary numbers alone, and give each other value a plan of its own".to_owned());
    }
    let table = name.split('.').next().unwrap_or_default();
    let keys = match table {
        "group" => Group::ALL.map(|group| group.name().to_owned()).to_vec(),
        "speeds" => key::SPEEDS.map(str::to_owned).to_vec(),
        table => key::numbers(robot).into_iter().filter(|key| key.split('.').next() == Some(table)).collect(),
    };
    let cure = match keys.as_slice() {
        [] => "write a key of the robot's file, such as \"fluid.viscosity_pa_s\", a group, such as \"group.stiffness\", or \
               design"
            .to_owned(),
        keys => format!("write one of {}", keys.join(", ")),
    };
    let all = key::numbers(robot).into_iter().chain(Group::ALL.map(|group| group.name().to_owned()));
    (format!("unknown key `{name}`"), suggest(name, all, &cure))
}

fn values(entry: &Entry, design: &Design, source: &Source) -> Result<Values, PlanError> {
    let Entry { name, value, span } = entry;
    let wrong = |what: String, cure: &str| Err(source.error(span.clone(), what, cure));
    let real = |value: &Value| source::real(value).filter(|number| number.is_finite());
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
                    let what = format!("{name} has a count in a Sobol design, which has its own");
                    return wrong(what, "leave count out");
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
            let Some(group) = groups.find(|group| group.moves(key)).map(Group::name) else { return Ok(()) };
            wrong(format!("{name} follows from {group}"), format!("vary either {name} or {group}"))
        }
        Key::Speed(motor) if !axes.iter().any(|axis| axis.key == Key::Speed(1 - motor)) => {
            let other = Key::Speed(1 - motor);
            wrong(format!("{name} varies alone"), format!("vary {} too, or give the speeds in [speeds]", other.name()))
        }
        _ => Ok(()),
    }
}
