//! The plans and robots in the repository.

use host::plan::Plan;
use host::plan::robot;
use host::sweep::SweepPlan;
use sim::params::Robot;
use std::path::{Path, PathBuf};

fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("plans").join(name)
}

/// Returns every key of `all` that is not in `some`.
fn missing(all: &toml::Table, some: &toml::Table) -> Vec<String> {
    let mut keys = Vec::new();
    for (key, value) in all {
        match (value, some.get(key)) {
            (_, None) => keys.push(key.clone()),
            (toml::Value::Table(all), Some(toml::Value::Table(some))) => {
                keys.extend(missing(all, some).into_iter().map(|inner| format!("{key}.{inner}")));
            }
            _ => {}
        }
    }
    keys
}

#[test]
fn published_robot_file_contains_every_parameter() {
    let text = std::fs::read_to_string(shipped("robot-published.toml")).unwrap();
    assert_eq!(robot::parse(&text, "robot-published.toml").unwrap(), Robot::published());
    let all = toml::Table::try_from(Robot::published()).unwrap();
    let missing = missing(&all, &toml::from_str(&text).unwrap());
    assert!(missing.is_empty(), "{missing:?}");
    let mixture = text.replace("# glycerol = ", "glycerol = ");
    assert!(robot::parse(&mixture, "robot-published.toml").unwrap().fluid.glycerol.is_some());
}

#[test]
fn shipped_plans_load_with_their_robots() {
    let mut plans = 0;
    for entry in std::fs::read_dir(shipped("")).unwrap() {
        let path = entry.unwrap().path();
        match path.file_name().unwrap().to_str().unwrap() {
            name if name.starts_with("robot-") => {}
            "groups.toml" => {
                assert_eq!(SweepPlan::load(&path).unwrap().points(), 3990);
                let error = Plan::load(&path).unwrap_err().to_string();
                assert!(error.ends_with("a plan with [vary] is that of a sweep"), "{error}");
            }
            _ => {
                Plan::load(&path).unwrap();
                plans += 1;
            }
        }
    }
    assert!(plans >= 3);
}

#[test]
fn published_map_has_190_points() {
    let plan = Plan::load(&shipped("published-map.toml")).unwrap();
    assert_eq!((plan.trials.len(), plan.trials.iter().map(|trial| trial.phases.total_s()).sum()), (190, 22_800.0));
    assert_eq!(Plan::load(&shipped("published-points.toml")).unwrap().trials.len(), 4);
}
