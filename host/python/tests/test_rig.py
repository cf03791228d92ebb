"""The emulated board stepped as a simulator is."""

from __future__ import annotations

from pathlib import Path

import biflag
import numpy as np
import pytest
from conftest import PROGRAM


def rig(folder: Path) -> biflag.Rig:
    return biflag.Rig(virtual=True, rest=0.0, out=folder, program=PROGRAM)


def test_rig_and_simulator_have_one_interface_and_agree(tmp_path: Path) -> None:
    with biflag.Simulator(biflag.Robot.physical(), like_rig=True) as simulator, rig(tmp_path) as board:
        assert simulator.reset().time == 0.0
        assert board.reset().time == 0.0
        for _ in range(4):
            speeds = (50.0, 10.0)
            measured, modelled = board.step(speeds, 0.5), simulator.step(speeds, 0.5)
        assert measured.time == pytest.approx(modelled.time, abs=0.01)
        # Without a rest the bias of the gyroscope, some degrees per second, is in the yaw.
        assert measured.yaw == pytest.approx(modelled.yaw, abs=8.0)
        assert measured.pitch == pytest.approx(modelled.pitch, abs=1.0)
        assert measured.turns == pytest.approx(modelled.turns, abs=0.03)
        assert measured.attitude == pytest.approx(modelled.attitude, abs=0.08)
        assert np.isnan(measured.forces).all()
    assert board.log is not None and biflag.read_log(board.log).speeds_rpm is not None


def test_run_ends_with_an_impossible_speed_and_can_begin_again(tmp_path: Path) -> None:
    board = rig(tmp_path)
    with pytest.raises(biflag.Error, match="reset it first"):
        board.step((1.0, 1.0), 0.1)
    board.reset()
    with pytest.raises(biflag.Error, match="500"):
        board.step((500.0, 0.0), 0.1)
    with pytest.raises(biflag.ParameterError):
        board.step((float("nan"), 0.0), 0.1)
    first = board.log
    assert board.reset().time == 0.0
    board.close()
    assert first is not None and board.log is not None and board.log != first
