"""Speeds for an attitude."""

from __future__ import annotations

import pickle
from dataclasses import asdict
from pathlib import Path
from typing import Any

import biflag
import numpy as np
import pytest
from conftest import biflag_json

# As `biflag calibrate` writes it.
FITTED = """\
[fluid]
viscosity_pa_s = 0.95

[fit]
closure = "full"
fitted_to = "simulation"
is_described = true
degrees_of_freedom = 12.5
covariance = [[0.0004]]
scatter_covariance = [[0.0001]]

[[fit.parameters]]
name = "viscosity"
key = "fluid.viscosity_pa_s"
unit = "Pa s"
start = 1.0
value = 0.95
std_error = 0.02
interval_95 = [0.91, 0.99]
"""


def plain(value: Any) -> Any:
    """Returns a value with lists for tuples, as JSON has it."""
    if isinstance(value, dict):
        return {key: plain(inner) for key, inner in value.items()}
    return [plain(inner) for inner in value] if isinstance(value, (list, tuple)) else value


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("aim") / "robot.toml"
    path.write_text(FITTED)
    return path


@pytest.fixture(scope="module")
def aimed(robot: Path) -> biflag.Aimed:
    return biflag.aim(biflag.Robot.load(robot), yaw=-40, tilt=5)


def test_solutions_and_plan_are_those_of_the_command_line(robot: Path, aimed: biflag.Aimed) -> None:
    plan = robot.with_name("there.toml")
    theirs = biflag_json("aim", "--yaw=-40", "--tilt=5", "--robot", str(robot), "-o", str(plan))
    assert aimed.reachable and theirs["reachable"] and len(aimed.solutions) == len(theirs["solutions"])
    assert aimed.confidence == theirs["confidence"] == 0.95 and not aimed.doubts and not theirs["doubts"]
    for ours, other in zip(aimed.solutions, theirs["solutions"], strict=True):
        other["contact"] = other["contact"].lower()
        assert plain(asdict(ours)) == {"error_n": None, **other}
        assert ours.std_error_deg is not None and ours.std_error_deg[0] > 0.1, "the standard error of the file counts"
    text = plan.read_text()
    plan.unlink()
    aimed.save_plan(plan)
    assert plan.read_text() == text and not plan.with_name("there-robot.toml").exists()
    with pytest.raises(biflag.Error, match="already exists") as caught:
        aimed.save_plan(plan)
    assert caught.value.key == str(plan)


def test_an_answer_shows_itself(aimed: biflag.Aimed) -> None:
    best = aimed.solutions[0]
    page = aimed._repr_html_()
    assert "yaw -40°, tilt 5°: " in page and f"<td>{best.w1_rpm:.5g}</td>" in page and "solution" in repr(aimed)
    table = aimed.table()
    assert best.yaw_ci_deg is not None
    assert table.rows == len(aimed.solutions) and table["yaw_low_deg"][0] == best.yaw_ci_deg[0]


def test_a_robot_keeps_its_fit(robot: Path, aimed: biflag.Aimed, tmp_path: Path) -> None:
    changed = biflag.Robot.load(robot).replace({"base.mass_kg": 0.095})
    for kept in (changed, pickle.loads(pickle.dumps(changed)), biflag.Robot.from_toml(changed.to_toml())):
        assert kept == changed and hash(kept) == hash(changed) and "covariance = [[0.0004]]\n" in kept.to_toml()
    # A table of another robot proposes speeds; a robot that is in no file gets one beside the plan.
    speeds = [(w1, w2) for w1 in (25, 35, 45) for w2 in (-10, 0, 10)]
    batch = biflag.simulate_batch(biflag.Robot.physical(), speeds, 30, method="steady")
    table = biflag.Table({name: batch[name] for name in ("w1_rpm", "w2_rpm", "yaw_deg", "pitch_deg", "roll_deg", "error")})
    other = biflag.aim(changed, yaw=-40, tilt=5, table=table)
    errors = other.solutions[0].std_error_deg
    assert errors is not None and errors[0] > 0.1
    near = [max(abs(np.subtract(one.speeds, solution.speeds))) for one in other.solutions for solution in aimed.solutions]
    assert min(near) < 5
    other.save_plan(tmp_path / "plan.toml")
    assert biflag.Robot.load(tmp_path / "plan-robot.toml") == changed
    assert 'robot = "plan-robot.toml"' in (tmp_path / "plan.toml").read_text()


def test_what_was_not_computed_in_time_is_named(tmp_path: Path) -> None:
    aimed = biflag.aim(biflag.Robot.physical(), yaw=150, pitch=-1, seconds=0.01)
    assert not aimed.reachable and not aimed.solutions and "not found" in repr(aimed)
    with pytest.raises(biflag.Error, match="no speeds"):
        aimed.save_plan(tmp_path / "plan.toml")
    assert not list(tmp_path.iterdir())
    assert aimed.unfinished and abs(aimed.unfinished[0]["yaw_deg"] - 150) < 5
    assert aimed.table().rows == (aimed.nearest is not None)


def test_what_is_out_of_reach_has_a_nearest_attitude() -> None:
    # Four seconds are enough on a computer that is not busy.
    for seconds in (4, 30):
        aimed = biflag.aim(biflag.Robot.physical(), yaw=-40, tilt=60, seconds=seconds)
        if aimed.nearest is not None:
            break
    assert aimed.nearest is not None and not aimed.reachable and not aimed.solutions
    nearest = aimed.nearest
    assert 0 < nearest.tilt_deg < 60 and nearest.error_deg is not None and nearest.error_deg > 10
    table = aimed.table()
    assert (table.rows, table["w1_rpm"][0], table["tilt_deg"][0]) == (1, nearest.w1_rpm, nearest.tilt_deg)


@pytest.mark.parametrize(
    ("key", "arguments"),
    [
        ("", {"yaw": 60}),
        ("pitch", {"yaw": 60, "pitch": 91}),
        ("yaw", {"yaw": float("nan"), "tilt": 1}),
        ("table", {"yaw": 60, "pitch": 1, "table": "none.csv"}),
        ("table", {"yaw": 60, "pitch": 1, "table": biflag.Table({"w1_rpm": [1.0], "w2_rpm": [2.0]})}),
        ("seconds", {"yaw": 60, "pitch": 1, "seconds": 0}),
        ("threads", {"yaw": 60, "pitch": 1, "threads": 0}),
    ],
)
def test_mistakes_are_named(key: str, arguments: dict[str, Any]) -> None:
    with pytest.raises(biflag.ParameterError) as caught:
        biflag.aim(biflag.Robot.physical(), **arguments)
    assert caught.value.key == key and caught.value.reason
