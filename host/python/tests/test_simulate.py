"""Simulated trials."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import biflag
import numpy as np
import pytest
from conftest import PROGRAM, biflag_json

ROBOT = biflag.Robot.published()


@pytest.fixture(scope="module")
def trial() -> biflag.Trial:
    return biflag.simulate(ROBOT, (50, 10), 20, shapes=True)


def test_values_are_those_of_the_command_line(trial: biflag.Trial, tmp_path: Path) -> None:
    arguments = ("--speeds=50,10", "--duration", "20", "--robot", "published", "--out", str(tmp_path / "session"))
    theirs = biflag_json("simulate", *arguments)["trials"][0]
    for name in ("yaw_deg", "pitch_deg", "roll_deg", "settled", "settle_s", "min_gap_m", "contact_share", "simulated_s"):
        assert getattr(trial.steady, name) == theirs[name], name
    for name in ("force1_n", "force2_n", "axial_torque_nm"):
        assert getattr(trial.steady, name).tolist() == theirs[name]


def test_a_period_is_that_of_the_command_line(tmp_path: Path) -> None:
    session = tmp_path / "session"
    arguments = ("--speeds=50,10", "--duration", "60", "--robot", "published", "--method", "steady")
    theirs = biflag_json("simulate", *arguments, "--out", str(session))["trials"][0]
    period = biflag.simulate(ROBOT, (50, 10), 60, method="steady")
    assert period.steady.kind == theirs["kind"] == "steady" and theirs["settled"] and period.steady.settled
    for name in ("yaw_deg", "pitch_deg", "window_s", "min_gap_m", "simulated_s"):
        assert getattr(period.steady, name) == theirs[name], name
    assert period.time[0] == 0 and period.time[-1] == pytest.approx(6), "the common period of 50 and 10 rpm is 6 s"
    period.save(tmp_path / "period.mcap")
    kept, command = biflag.read_log(tmp_path / "period.mcap"), biflag.read_log(theirs["log"])
    for name in ("time_s", "phase", "yaw_deg", "force1_z_n", "winding_turns"):
        assert kept.table[name].tolist() == command.table[name].tolist(), name
    assert kept.records["model"]["method"] == command.records["model"]["method"] == "steady"
    assert biflag.simulate(ROBOT, (50, 10), 1).steady.kind is None


def test_arrays_fit_together(trial: biflag.Trial) -> None:
    n = 20 * 20 + 1
    assert trial.time.shape == (n,) and trial.forces.shape == (n, 2, 3) and trial.torques.shape == (n, 2)
    assert trial.shapes is not None and trial.shapes.shape == (n, 2, 50, 3)
    w, x, y, z = trial.attitude.T
    yaw = np.degrees(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y**2 + z**2)))
    assert np.allclose(yaw, trial.yaw, atol=1e-9)
    assert np.allclose(np.degrees(np.arcsin(2 * (w * y - z * x))), trial.pitch, atol=1e-9)
    assert trial.turns[-1] == pytest.approx([50 * 20 / 60, 10 * 20 / 60], abs=0.2)
    assert trial.gap.min() == trial.steady.min_gap_m


def test_tables_hold_the_arrays(trial: biflag.Trial) -> None:
    pytest.importorskip("pandas")
    frame = trial.to_pandas()
    assert frame.index.name == "time_s" and (frame["force2_z_n"].to_numpy() == trial.forces[:, 1, 2]).all()
    pytest.importorskip("xarray")
    data = trial.to_xarray()
    assert data.forces.sel(flagellum=2, axis="z").to_numpy().tolist() == trial.forces[:, 1, 2].tolist()
    assert data.yaw.attrs["units"] == "degree" and data.sizes["node"] == 50


def test_speeds_may_be_an_array_or_a_function() -> None:
    times = np.linspace(0, 4, 401)
    speeds = np.column_stack([50 * np.sin(times), 10 * times])
    of = biflag.simulate(ROBOT, lambda t: (50 * np.sin(t), 10 * t), 4)
    even = biflag.simulate(ROBOT, speeds, 4)
    timed = biflag.simulate(ROBOT, np.column_stack([times + 3, speeds]))
    assert np.allclose(of.yaw, even.yaw, atol=1e-6) and np.allclose(of.yaw, timed.yaw, atol=1e-6)
    # Samples are at multiples of 50 ms, where the array has points.
    assert np.allclose(even.speeds, speeds[::5], atol=1e-9)


@pytest.mark.parametrize(
    ("key", "arguments"),
    [
        ("duration", {"speeds": (50, 10)}),
        ("duration", {"speeds": (50, 10), "duration": -1}),
        ("duration", {"speeds": np.zeros((5, 3)), "duration": 1}),
        ("speeds", {"speeds": (50, 10, 3), "duration": 1}),
        ("speeds", {"speeds": (50, np.nan), "duration": 1}),
        ("speeds", {"speeds": (50, 90.1), "duration": 1}),
        ("speeds", {"speeds": lambda t: (50 + 100 * t, 0), "duration": 1}),
        ("speeds", {"speeds": "fast", "duration": 1}),
        ("speeds", {"speeds": lambda t: t, "duration": 1}),
        ("rate_hz", {"speeds": (50, 10), "duration": 1, "rate_hz": 0}),
        ("closure", {"speeds": (50, 10), "duration": 1, "closure": "half"}),
        ("method", {"speeds": (50, 10), "duration": 1, "method": "fast"}),
        ("method", {"speeds": np.zeros((5, 2)), "duration": 1, "method": "steady"}),
        ("rate_hz", {"speeds": (50, 10), "duration": 1, "method": "steady", "rate_hz": 0}),
    ],
)
def test_impossible_arguments_are_named(key: str, arguments: dict[str, object]) -> None:
    with pytest.raises(biflag.ParameterError) as caught:
        biflag.simulate(ROBOT, **arguments)  # type: ignore[arg-type]
    assert caught.value.key == key and caught.value.reason


def test_speeds_are_refused_with_the_words_of_the_program() -> None:
    run = subprocess.run([PROGRAM, "simulate", "--speeds=500,10", "--duration=1"], capture_output=True, text=True, check=False)
    with pytest.raises(biflag.ParameterError) as caught:
        biflag.simulate(ROBOT, (500, 10), 1)
    assert "500 rpm is beyond ±90 rpm; give -90 to 90 rpm" in caught.value.reason and caught.value.reason in run.stderr
    assert biflag.MAX_SPEED_RPM == 90
    # Between two speeds of the board, and at the limit.
    biflag.simulate(ROBOT, (50.12345, -90.0), 0.1)


def test_exceptions_of_a_function_pass_through() -> None:
    with pytest.raises(ZeroDivisionError):
        biflag.simulate(ROBOT, lambda t: (1 / 0, 0), 1)


def test_failures_of_the_solver_say_what_to_do() -> None:
    fragile = ROBOT.replace({"solver.halvings": 0, "solver.sweeps": 2})
    with pytest.raises(biflag.Error, match="solver.halvings") as caught:
        biflag.simulate(fragile, (50, 10), 5)
    assert caught.value.key == "solver" and not isinstance(caught.value, ValueError)


def test_a_saved_trial_reads_back_the_same(trial: biflag.Trial, tmp_path: Path) -> None:
    path = tmp_path / "trial.mcap"
    trial.save(path)
    recording = biflag.read_log(path)
    assert recording.origin == "model" and recording.complete and recording.robot == ROBOT
    assert recording.steady is not None and recording.steady.yaw_deg == trial.steady.yaw_deg
    assert recording.yaw.tolist() == trial.yaw.tolist()
    assert recording.table["force1_z_n"].tolist() == trial.forces[:, 0, 2].tolist()
    with pytest.raises(biflag.Error, match="trial.mcap"):
        trial.save(path)
    for name in ("trial.csv", "trial"):
        with pytest.raises(biflag.ParameterError, match=f"{name}: the name must end with .mcap") as caught:
            trial.save(tmp_path / name)
        assert caught.value.key == str(tmp_path / name) and list(tmp_path.iterdir()) == [path]


def test_a_trial_shows_itself_in_a_notebook(trial: biflag.Trial) -> None:
    page = trial._repr_html_()
    assert page.startswith("<iframe srcdoc=") and page.count("<") == 2, "the page ends its own frame"
    assert "Content-Security-Policy" in page and len(page) < 1_500_000


def test_the_lock_is_released_and_ctrl_c_ends_a_trial() -> None:
    counted = 0
    done = threading.Event()

    def count() -> None:
        nonlocal counted
        while not done.wait(0.001):
            counted += 1

    counter = threading.Thread(target=count)
    counter.start()
    biflag.simulate(ROBOT, (50, 10), 60)
    done.set()
    counter.join()
    assert counted > 10, "other threads stood still"

    # A shell that starts the tests in the background lets them ignore Ctrl-C.
    code = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); import biflag; "
    code += "print('on', flush=True); biflag.simulate(biflag.Robot.published(), (-90, -90), 1e5)"
    child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert child.stdout is not None and child.stdout.readline() == "on\n"
    time.sleep(0.5)
    child.send_signal(signal.SIGINT)
    _, errors = child.communicate(timeout=30)
    assert "KeyboardInterrupt" in errors and child.returncode != 0
