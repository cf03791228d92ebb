"""Simulators that are stepped."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import biflag
import numpy as np
import pytest

ROBOT = biflag.Robot.published()
COURSE = [((60, -20), 0.5), ((-90, 90), 0.3), ((10, 10), 0.05), ((90, 90), 2.0)]


def followed(simulator: biflag.Simulator) -> list[float]:
    states = [simulator.step(speeds, dt) for speeds, dt in COURSE]
    return [number for state in states for number in (state.yaw, state.pitch, state.gap, *state.forces.flat)]


def test_a_restored_simulator_goes_on_bit_for_bit(tmp_path: Path) -> None:
    simulator = biflag.Simulator(ROBOT)
    simulator.reset(seed=3)
    simulator.step((50, 10), 1.0)
    saved = simulator.save()
    first = followed(simulator)
    state = simulator.restore(saved)
    assert state.time == 1.0 and followed(simulator) == first
    code = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
import biflag
from test_simulator import ROBOT, followed
simulator = biflag.Simulator(ROBOT)
simulator.restore(open({str(tmp_path / "saved")!r}, "rb").read())
print([number.hex() for number in map(float, followed(simulator))])
"""
    (tmp_path / "saved").write_bytes(saved)
    other = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert other.stdout.strip() == str([float(number).hex() for number in first])


def test_the_state_of_another_simulator_is_refused() -> None:
    simulator = biflag.Simulator(ROBOT, like_rig=True)
    saved = simulator.save()
    softer = ROBOT.replace({"flagellum.young_pa": 9e5})
    others = (
        biflag.Simulator(softer, like_rig=True),
        biflag.Simulator(ROBOT, like_rig=True, closure="lumped"),
        biflag.Simulator(ROBOT),
    )
    for other in others:
        before = other.save()
        with pytest.raises(biflag.ParameterError, match="another robot, closure or like_rig") as caught:
            other.restore(saved)
        assert caught.value.key == "saved" and other.save() == before
    assert biflag.Simulator(ROBOT, like_rig=True).restore(saved).time == 0


def test_a_seed_decides_where_the_flagella_start() -> None:
    simulator = biflag.Simulator(ROBOT)
    one, other, again = (simulator.reset(seed).shapes for seed in (1, 2, 1))
    assert (one == again).all() and not np.allclose(one, other)
    assert (simulator.reset().shapes == biflag.Simulator(ROBOT).state.shapes).all()
    assert simulator.state.time == 0 and simulator.state.turns.tolist() == [0, 0]


def test_steps_follow_a_trial_at_the_same_speeds() -> None:
    trial = biflag.simulate(ROBOT, (50, 10), 10)
    simulator = biflag.Simulator(ROBOT)
    for i in range(20):
        state = simulator.step((50, 10), 0.5)
        assert state.yaw == pytest.approx(trial.yaw[10 * i + 10], abs=0.1)
        assert state.speeds == pytest.approx([50, 10])
    assert state.time == pytest.approx(10) and state.turns == pytest.approx(trial.turns[-1], abs=1e-6)


@pytest.mark.parametrize(("speeds", "dt", "key"), [((1, 2), 0, "dt"), ((1, 2), 1e3, "dt"), ((1, 2, 3), 1, "speeds")])
def test_impossible_steps_are_refused(speeds: tuple[float, ...], dt: float, key: str) -> None:
    simulator = biflag.Simulator(ROBOT)
    before = simulator.save()
    with pytest.raises(biflag.ParameterError, match=key):
        simulator.step(speeds, dt)
    with pytest.raises(biflag.ParameterError, match="speeds"):
        simulator.step((1e6, 0), 1)
    with pytest.raises(biflag.ParameterError, match="saved"):
        simulator.restore(b"nothing")
    assert simulator.save() == before
