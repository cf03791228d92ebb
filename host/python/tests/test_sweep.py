"""Sweeps."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import biflag
import numpy as np
import pytest
from conftest import biflag_json

PLAN = """
[session]
name = "thicker"
[vary]
"fluid.viscosity_pa_s" = [0.9, 1.1]
[trial]
run = 120
phases = 2
[speeds]
pairs = [[50, 10], [0, 45]]
"""

TRIALS = """
[vary]
"fluid.viscosity_pa_s" = { from = 0.8, to = 1.2, count = 12 }
[trial]
method = "trial"
run = 40
[speeds]
pairs = [[50, 10]]
"""


def same(ours: biflag.Table, theirs: biflag.Table) -> None:
    """Asserts that two tables have the same rows."""
    assert list(ours) == list(theirs) and ours.about == theirs.about

    def order(table: biflag.Table) -> list[int]:
        return [int(row) for row in np.lexsort([table["w1_rpm"], table["viscosity_pa_s"]])]

    for name in ours:
        one, other = ours[name][order(ours)], theirs[name][order(theirs)]
        assert one.astype(str).tolist() == other.astype(str).tolist(), name


def test_the_table_is_that_of_the_command_line(tmp_path: Path) -> None:
    plan = tmp_path / "plan.toml"
    plan.write_text(PLAN)
    counted: list[tuple[int, int]] = []
    ours = biflag.sweep(plan, tmp_path / "ours", progress=lambda done, points: counted.append((done, points)))
    theirs = biflag_json("sweep", str(plan), "--out", str(tmp_path / "theirs"))
    assert ours.rows == theirs["points"] == 4 and counted[0][0] < 4 and counted[-1] == (4, 4)
    same(ours, biflag.read_sweep(theirs["table"]))
    same(ours, biflag.read_sweep(tmp_path / "theirs"))
    own = biflag.read_sweep(tmp_path / "ours" / "table.parquet")
    assert {name: own[name].tolist() for name in own} == {name: ours[name].tolist() for name in ours}
    text = biflag.read_sweep(tmp_path / "ours" / "table.csv")
    assert {name: text[name].tolist() for name in text} == {name: ours[name].tolist() for name in ours}
    assert "steady" in ours["kind"] and ours["phases"].dtype.kind == "i" and (ours["status"] == "ok").all()
    assert ours.about["viscosity_pa_s"] == "dynamic viscosity, mu"


def test_a_plan_may_be_a_text_and_a_failed_point_is_a_row(tmp_path: Path) -> None:
    text = '[vary]\n"base.motor_distance_m" = [0.01, 0.05]\n[trial]\nrun = 12\n[speeds]\npairs = [[0, 45]]\n'
    table = biflag.sweep(text, tmp_path / "sweep", threads=1)
    failed = int(np.flatnonzero(table["status"] == "failed")[0])
    assert table.rows == 2 and np.isnan(table["yaw_deg"]).tolist().count(True) == 1
    assert "touch" in table["reason"][failed] and table["reason"][1 - failed] == ""


def test_ctrl_c_keeps_what_is_done(tmp_path: Path) -> None:
    plan, folder = tmp_path / "plan.toml", tmp_path / "sweep"
    plan.write_text(TRIALS)
    # A shell that starts the tests in the background lets them ignore Ctrl-C.
    code = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); import biflag; "
    code += f"biflag.sweep({str(plan)!r}, {str(folder)!r}, progress=lambda *n: print(*n, flush=True))"
    child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert child.stdout is not None
    while int(child.stdout.readline().split()[0]) < 2:
        pass
    child.send_signal(signal.SIGINT)
    _, errors = child.communicate(timeout=30)
    assert "KeyboardInterrupt" in errors and child.returncode != 0

    with pytest.warns(UserWarning, match="of 12 points are done"):
        before = biflag.read_sweep(folder)
    assert 2 <= before.rows < 12 and not (folder / "table.parquet").exists()
    counted: list[int] = []
    table = biflag.sweep(plan, folder, progress=lambda done, points: counted.append(done))
    assert counted[0] >= before.rows and table.rows == 12 and (table["status"] == "ok").all()
    whole = {point: yaw for point, yaw in zip(table["point"], table["yaw_deg"], strict=True)}
    assert all(whole[point] == yaw for point, yaw in zip(before["point"], before["yaw_deg"], strict=True))
    counted.clear()
    again = biflag.sweep(plan, folder, progress=lambda done, points: counted.append(done))
    assert again["yaw_deg"].tolist() == table["yaw_deg"].tolist() and set(counted) == {12}


def test_mistakes_are_named(tmp_path: Path) -> None:
    text = "[trial]\nrun = 1\n[speeds]\npairs = [[0, 0]]\n"
    biflag.sweep(text, tmp_path / "sweep")
    with pytest.raises(biflag.ParameterError, match="another plan") as caught:
        biflag.sweep(text.replace("run = 1", "run = 2"), tmp_path / "sweep")
    assert caught.value.key == "out" and "--" not in caught.value.help
    with pytest.raises(biflag.ParameterError, match="methods") as caught:
        biflag.sweep(text.replace("run", "methods"), tmp_path / "other")
    assert caught.value.key == "plan:2:1" and not (tmp_path / "other").exists()
    with pytest.raises(biflag.ParameterError, match="none.toml"):
        biflag.sweep(tmp_path / "none.toml", tmp_path / "other")
    with pytest.raises(biflag.ParameterError, match="threads"):
        biflag.sweep(text, tmp_path / "other", threads=0)
    with pytest.raises(ZeroDivisionError):
        biflag.sweep(text, tmp_path / "other", progress=lambda done, points: 1 / 0)
    (tmp_path / "table.csv").write_text("a,b\n1,2\n")
    for path in (tmp_path, tmp_path / "none", tmp_path / "table.csv"):
        with pytest.raises(biflag.ParameterError) as caught:
            biflag.read_sweep(path)
        assert caught.value.key == str(path)
