"""Records a session for tests and notebooks on the emulated board. `make build` builds what this needs.

A folder that BIFLAG_TEST_FOLDER names is kept, and its session used again. BIFLAG_SESSION names a session to use in its place.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import biflag
import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
PROGRAM = Path(os.environ.get("BIFLAG_BIN", REPOSITORY / "target/release/biflag"))

PLAN = """
[session]
name = "tank"
robot = "hidden.toml"
[board]
deadline_ms = 5000
[trial]
calibrate = 2
preroll = 12
run = 24
decay = 6
[speeds]
pairs = [[50, 10]]
"""

folder = Path(os.environ.get("BIFLAG_TEST_FOLDER") or tempfile.mkdtemp(prefix="biflag-"))


def biflag_json(*arguments: str) -> Any:
    """Runs the program and returns its answer. Exit code 3 is done with warnings."""
    run = subprocess.run([PROGRAM, *arguments, "--json"], cwd=folder, capture_output=True, text=True, check=False)
    assert run.returncode in (0, 3), run.stderr
    return json.loads(run.stdout)


def pytest_sessionstart() -> None:
    if "BIFLAG_SESSION" in os.environ:
        return
    os.environ["BIFLAG_SESSION"] = str(folder / "tank")
    if (folder / "tank").exists():
        return
    hidden = biflag.Robot.physical().replace({"fluid.viscosity_pa_s": 0.8, "joint.tether_full_nm_per_rad": 6e-4})
    (folder / "hidden.toml").write_text(hidden.to_toml())
    (folder / "plan.toml").write_text(PLAN)
    biflag_json("record", "plan.toml", "--virtual", "--seed", "7", "--out", "tank")


def pytest_sessionfinish() -> None:
    if "BIFLAG_TEST_FOLDER" not in os.environ:
        shutil.rmtree(folder)


@pytest.fixture(autouse=True)
def names_of_examples(request: pytest.FixtureRequest, doctest_namespace: dict[str, Any], tmp_path: Path) -> None:
    """What the examples in docstrings take for given: the package, a recorded session, its fit, and an empty folder."""
    if isinstance(request.node, pytest.DoctestItem):
        results = {name: request.getfixturevalue(name) for name in ("recorded", "fitted")}
        doctest_namespace.update(biflag=biflag, folder=tmp_path, **results)


@pytest.fixture(scope="session")
def recorded() -> Path:
    """The folder of the recorded session."""
    return Path(os.environ["BIFLAG_SESSION"])


@pytest.fixture(scope="session")
def fitted(recorded: Path) -> biflag.Calibration:
    """The fit of the recorded session."""
    return biflag.calibrate(recorded, ["viscosity", "tether"], robot=biflag.Robot.physical())
