"""Plots by matplotlib, and the program's figures."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import biflag
import numpy as np
import pytest
from conftest import biflag_json

ROBOT = biflag.Robot.published()


def without_command(svg: str) -> str:
    head, rest = svg.split("<desc>")
    return head + rest.split("</desc>")[1]


def test_a_trial_and_a_table_are_plotted() -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    trials = [biflag.simulate(ROBOT, speeds, 2) for speeds in ((50, 10), (10, 50))]
    axes = trials[0].plot()
    assert trials[1].plot(axes).tolist() == axes.tolist()
    for axis, name in zip(axes, ("yaw", "pitch", "roll"), strict=True):
        drawn = [line.get_ydata().tolist() for line in axis.lines]
        assert drawn == [getattr(trial, name).tolist() for trial in trials] and axis.get_ylabel() == f"{name}_deg"
    assert [axis.get_xlabel() for axis in axes] == ["", "", "time_s"]
    with pytest.raises(ValueError, match="zip"):
        trials[0].plot(axes[:2])
    table = biflag.Table({"w1_rpm": [20.0, 10.0, 10.0], "tilt_deg": [3.0, 1.0, 2.0], "kind": ["a", "a", "b"]})
    curves = table.plot(y="tilt_deg", by="kind").lines
    assert [str(line.get_label()) for line in curves] == ["a", "b"]
    assert [np.asarray(line.get_xydata()).tolist() for line in curves] == [[[10.0, 1.0], [20.0, 3.0]], [[10.0, 2.0]]]


def test_without_matplotlib_a_plot_says_what_to_install() -> None:
    code = """
import sys
sys.modules["matplotlib"] = None
import biflag
biflag.Table({"w1_rpm": [1.0], "yaw_deg": [2.0]}).plot()
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.returncode == 1 and "ImportError: a plot needs matplotlib: pip install biflag[plot]" in run.stderr


# A short trial has not settled.
@pytest.mark.filterwarnings("ignore:.*not settled")
def test_figures_are_those_of_the_program(recorded: Path, tmp_path: Path) -> None:
    session = biflag.read_session(recorded)
    for name, subject, *words, options in (
        ("of-a-log.svg", "trial", str(session.logs["001_w1+50_w2+10"]), {"time": (0, 20)}),
        ("of-a-session.svg", "trial", str(recorded), "1", {"number": 1, "width_mm": 120}),
    ):
        given = ["--time=0,20"] if "time" in options else ["--width-mm=120"]
        biflag_json("figure", subject, *words, *given, "-o", str(tmp_path / name))
        figure = biflag.figure(subject, session if "number" in options else words[0], **options)
        theirs = (tmp_path / name).read_text()
        assert without_command(figure.svg) == without_command(theirs) == figure._repr_svg_()
    for suffix, begins in ((".svg", b"<svg"), (".pdf", b"%PDF"), (".png", b"\x89PNG")):
        figure.save(tmp_path / f"figure{suffix}")
        assert (tmp_path / f"figure{suffix}").read_bytes().startswith(begins)
    with pytest.raises(biflag.ParameterError, match=".svg, .pdf or .png"):
        figure.save(tmp_path / "figure.jpg")


@pytest.mark.filterwarnings("ignore:.*not settled")
def test_simulated_trials_are_drawn_without_a_file() -> None:
    trials = [biflag.simulate(robot, (50, 10), 12) for robot in (ROBOT, biflag.Robot.physical())]
    with pytest.warns(UserWarning, match="not settled"):
        alone = biflag.figure("trial", trials[0])
    assert "\nlog unsaved/w1+50_w2+10.mcap" in alone.svg
    with pytest.raises(biflag.Error, match="robots differ"):
        biflag.figure("trial", trials[0], against=trials[1])
    with pytest.warns(UserWarning, match="robots differ"):
        both = biflag.figure("trial", trials[0], against=trials[1], anyway=True)
    assert len(both.svg) > len(alone.svg)
    assert "<path" in biflag.figure("forces", trials[0]).svg


@pytest.mark.parametrize(
    ("key", "arguments", "options"),
    [
        ("subject", ("pie", "log.mcap"), {}),
        ("moments", ("trial", "log.mcap"), {"moments": 3}),
        ("colour", ("fit", "robot.toml"), {"colour": "red"}),
        ("sources", ("trial",), {}),
        ("width_mm, moments", ("trial", "log.mcap"), {"width_mm": 5}),
        ("sources", ("trial", "a.mcap", "b.mcap"), {}),
        ("sources", ("scatter", "session"), {}),
    ],
)
def test_mistakes_are_named(key: str, arguments: tuple[str, ...], options: dict[str, object]) -> None:
    with pytest.raises(biflag.ParameterError) as caught:
        biflag.figure(*arguments, **options)  # type: ignore[arg-type]
    assert caught.value.key == key and caught.value.reason
