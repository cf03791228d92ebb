"""Comparisons and fits."""

from __future__ import annotations

from pathlib import Path

import biflag
import pytest
from conftest import biflag_json


def test_comparison_is_that_of_the_command_line(recorded: Path) -> None:
    comparison = biflag.compare(recorded)
    theirs = biflag_json("compare", str(recorded))
    assert len(comparison.trials) == 1
    for ours, other in zip(comparison.record["trials"], theirs["trials"], strict=True):
        # The program makes a replay of its own unless it is of the same commit.
        assert {**ours, "modelled": None} == {**other, "modelled": None}
    trial = comparison.trials[0]
    assert trial.measured.shape == trial.modelled.shape == (len(trial.time), 3)
    late = (trial.time > 12) & (trial.time < 24)
    error = (trial.modelled - trial.measured)[late, 0].mean()
    assert error == pytest.approx(trial.record["steady_yaw_error_deg"], abs=0.3)
    assert comparison.table()["yaw_rmse_deg"][0] == trial.record["yaw_rmse_deg"]


def test_another_robot_disagrees(recorded: Path) -> None:
    log = biflag.read_session(recorded).logs["001_w1+50_w2+10"]
    same = biflag.compare(log)
    other = biflag.compare(log, robot=biflag.Robot.physical())
    assert not same.trials[0].record["differences"], same.verdict
    assert "yaw" in {difference["angle"] for difference in other.trials[0].record["differences"]}


def test_a_fit_finds_the_hidden_robot(fitted: biflag.Calibration) -> None:
    hidden = {"viscosity": 0.8, "tether": 6e-4}
    for name, value in hidden.items():
        estimate = fitted.parameters[name]
        assert abs(estimate.value - value) < 3 * estimate.std_error + 0.01 * value, (name, estimate)
        assert estimate.interval_95[0] < estimate.value < estimate.interval_95[1]
        assert estimate.key is not None and fitted.robot[estimate.key] == pytest.approx(estimate.value)
    assert fitted.rmse_after_deg < fitted.rmse_before_deg
    assert biflag.Robot.from_toml(fitted.text) == fitted.robot


def test_mistakes_are_named(recorded: Path, tmp_path: Path) -> None:
    with pytest.raises(biflag.ParameterError) as caught:
        biflag.calibrate(recorded, ["colour"])  # type: ignore[list-item]
    assert caught.value.key == "fit" and "tether" in caught.value.reason
    with pytest.raises(biflag.Error, match="none"):
        biflag.compare(tmp_path / "none")
    with pytest.raises(biflag.ParameterError, match="robot"):
        biflag.compare(recorded, recorded, robot=biflag.Robot.physical())
