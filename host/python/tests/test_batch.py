"""Many trials side by side."""

from __future__ import annotations

from pathlib import Path

import biflag
import numpy as np
import pytest
from conftest import biflag_json

ROBOT = biflag.Robot.published()
PAIRS = [(w1, w2) for w1 in (-90.0, 0.0, 60.0) for w2 in (0.0, 45.0, 90.0)]
PLAN = """
[session]
name = "map"
robot = "published"
[trial]
calibrate = 0
preroll = 0
run = 15
decay = 0
[speeds]
pairs = {pairs}
"""


def test_values_are_those_of_the_command_line(tmp_path: Path) -> None:
    plan = tmp_path / "map.toml"
    plan.write_text(PLAN.format(pairs=[list(pair) for pair in PAIRS]))
    theirs = biflag_json("simulate", str(plan), "--out", str(tmp_path / "map"))["trials"]
    table = biflag.simulate_batch(ROBOT, PAIRS, 15)
    assert table.rows == len(theirs) == len(PAIRS)
    for i, row in enumerate(theirs):
        assert (table["w1_rpm"][i], table["w2_rpm"][i]) == (row["w1_rpm"], row["w2_rpm"])
        for name in ("yaw_deg", "pitch_deg", "roll_deg", "settled", "min_gap_m", "contact_share", "sweeps"):
            assert table[name][i] == row[name], (name, row["name"])
        assert table["force2_x_n"][i] == row["force2_n"][0]
        assert table["axial_torque1_nm"][i] == row["axial_torque_nm"][0]
        assert table["bundling"][i] == row["bundling"].lower()
    assert "yaw_deg" in table._repr_html_()


def test_steady_states_are_those_of_the_command_line(tmp_path: Path) -> None:
    pairs = [(50.0, 10.0), (0.0, 45.0), (37.0, 53.0)]
    plan = tmp_path / "map.toml"
    plan.write_text(PLAN.format(pairs=[list(pair) for pair in pairs]))
    theirs = biflag_json("simulate", str(plan), "--method", "steady", "--out", str(tmp_path / "map"))["trials"]
    table = biflag.simulate_batch(ROBOT, pairs, 15, method="steady")
    for i, row in enumerate(theirs):
        for name in ("kind", "yaw_deg", "roll_deg", "settled", "settle_s", "window_s", "sweeps", "simulated_s"):
            assert table[name][i] == row[name], (name, row["name"])
        assert table["force1_z_n"][i] == row["force1_n"][2]
    assert table["kind"].tolist() == ["steady", "steady", "not_found"]
    light = ROBOT.replace({"base.mass_centre_below_joint_m": -0.02})
    trials = biflag.simulate_batch([ROBOT, light], [(50, 10)] * 2, 12)
    assert trials["kind"].tolist() == ["", "overturned"] and np.isnan(trials["yaw_deg"]).tolist() == [False, True]


def test_each_row_may_have_a_robot_of_its_own() -> None:
    thinner = ROBOT.replace({"fluid.viscosity_pa_s": 0.8})
    counted: list[tuple[int, int]] = []
    table = biflag.simulate_batch([ROBOT, thinner], PAIRS[:2], 5, progress=lambda *counts: counted.append(counts))
    for i, robot in enumerate([ROBOT, thinner]):
        assert table["yaw_deg"][i] == biflag.simulate(robot, PAIRS[i], 5).steady.yaw_deg
    assert counted[-1] == (2, 2) and len(set(counted)) == len(counted)
    with pytest.raises(biflag.ParameterError, match="2 robots for 3 rows") as caught:
        biflag.simulate_batch([ROBOT, thinner], PAIRS[:3], 5)
    assert caught.value.key == "robot"
    with pytest.raises(ZeroDivisionError):
        biflag.simulate_batch(ROBOT, PAIRS, 5, progress=lambda done, trials: 1 / 0)


def test_progress_may_be_shown(capsys: pytest.CaptureFixture[str]) -> None:
    biflag.simulate_batch(ROBOT, PAIRS[:2], 0.1, progress=True)
    assert capsys.readouterr().err.endswith("\r2 of 2\n")


def test_threads_change_nothing() -> None:
    one, two = (biflag.simulate_batch(ROBOT, PAIRS[:3], 5, threads=threads) for threads in (1, 2))
    for name in one:
        assert one[name].tolist() == two[name].tolist(), name
    for threads in (0, -1):
        with pytest.raises((biflag.ParameterError, OverflowError)):
            biflag.simulate_batch(ROBOT, PAIRS, 5, threads=threads)


def test_a_failed_trial_is_a_row_with_its_reason() -> None:
    fragile = ROBOT.replace({"solver.halvings": 1, "solver.sweeps": 6})
    table = biflag.simulate_batch(fragile, [(5, 5), (-90, -90)], 5)
    assert table["error"][0] == "" and np.isfinite(table["yaw_deg"][0])
    assert "no step" in table["error"][1] and np.isnan(table["yaw_deg"][1]) and not table["settled"][1]


def test_wrong_shapes_are_refused() -> None:
    for speeds in ((50, 10), [(1, 2, 3)], [], [(1, 500)]):
        with pytest.raises(biflag.ParameterError, match="speeds"):
            biflag.simulate_batch(ROBOT, speeds, 5)
    with pytest.raises(biflag.ParameterError, match="method"):
        biflag.simulate_batch(ROBOT, PAIRS, 5, method="fast")  # type: ignore[arg-type]
