//! Names of the Python package: what classes have, with their types, and the columns of tables.

use super::recording;
use std::process::Command;
use tests::golden::hold;
use tests::python::{command, newest_python};
use tests::{Bench, repository};

const PLAN: &str = "[session]\nname = \"golden\"\n[trial]\ncalibrate = 2\npreroll = 12\nrun = 12\ndecay = 0\n\
                    [speeds]\npairs = [[50, 10]]\n";

/// Prints all public names.
const NAMES: &str = r##"
import dataclasses, inspect, sys
import biflag
from biflag import _biflag

def signature(value):
    try:
        return str(inspect.signature(value))
    except (TypeError, ValueError):
        return "(...)"

def members(of):
    print(f"# {of.__module__}.{of.__name__}")
    if dataclasses.is_dataclass(of):
        for field in dataclasses.fields(of):
            default = "" if field.default is dataclasses.MISSING else f" = {field.default!r}"
            print(f"{field.name}: {field.type}{default}")
    given = {name for base in (object, BaseException, tuple) for name in dir(base)} if not issubclass(of, dict) else set()
    names = [field.name for field in dataclasses.fields(of)] if dataclasses.is_dataclass(of) else []
    for name in dir(of):
        if name.startswith("_") or name in given or name in names:
            continue
        value = inspect.getattr_static(of, name)
        if isinstance(value, property) or not callable(getattr(of, name)):
            print(name)
        else:
            print(name + signature(getattr(of, name)))

for module in (biflag, _biflag):
    print(f"# {module.__name__}")
    for name in sorted(module.__all__):
        value = getattr(module, name)
        print(name + (signature(value) if callable(value) and not inspect.isclass(value) else ""))
for module in (biflag, _biflag):
    for name in sorted(module.__all__):
        value = getattr(module, name)
        if inspect.isclass(value) and value.__module__ == module.__name__ or module is biflag and inspect.isclass(value):
            members(value)

def table(name, table):
    print(f"# columns of {name}")
    for column in table:
        print(f"{column}: {table[column].dtype.kind}: {table.about.get(column, '')}")

def record(name, value):
    print(f"# keys of {name}")
    def keys(path, value):
        if isinstance(value, dict):
            for key in value:
                keys(f"{path}.{key}" if path else key, value[key])
        else:
            print(f"{path}: {type(value).__name__}")
    keys("", value)

trial = biflag.simulate(biflag.Robot.physical(), (50, 10), 26)
steady = biflag.simulate(biflag.Robot.physical(), (50, 10), 26, method="steady")
session = biflag.read_session("s")
recording = session["001_w1+50_w2+10"]
table("a recording", recording.table)
table("a session", session.table())
table("a batch", biflag.simulate_batch(biflag.Robot.physical(), [(50, 10)], 2))
record("a recording's records", recording.records)
record("a recording's link", recording.link)
print("# keys of a recording's budget")
print(*sorted({key for term in recording.steady.budget for key in term}))
print("# parameters of a robot")
for key, about in biflag.Robot.keys().items():
    print(f"{key}: {about}")
for name, simulated in (("trial", trial), ("steady", steady)):
    print(f"# types in a {name}")
    for of in (simulated, simulated.steady):
        for field in dataclasses.fields(of):
            value = getattr(of, field.name)
            print(f"{field.name}: {type(value).__name__}", *getattr(value, "shape", ())[1:])
simulator = biflag.Simulator(biflag.Robot.physical())
record("a state", dataclasses.asdict(simulator.step((50, 10), 0.05)))
"##;

#[test]
fn names_of_the_package_are_the_golden_ones() {
    let bench = Bench::new();
    recording::sessions(&bench, PLAN, "model", "s");
    let packages = bench.path().join("packages");
    let laid = Command::new("sh").arg(repository().join("host/python/lay.sh")).arg(&packages).status().unwrap();
    assert!(laid.success());
    let mut python = command(&newest_python());
    let output = python.args(["-c", NAMES]).current_dir(bench.path()).env("PYTHONPATH", &packages).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    hold("python", &String::from_utf8(output.stdout).unwrap());
}
