"""Recorded trials: what logs and sessions hold."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from . import _biflag
from ._biflag import Robot
from ._table import Table
from ._trial import Floats, framed

if TYPE_CHECKING:
    import pandas


class Event(NamedTuple):
    """An event of a trial.

    >>> event = biflag.read_session(recorded)["001_w1+50_w2+10"].events[0]
    >>> event.kind in ("phase", "state", "note", "calibration", "clock", "warning", "retry", "fault")
    True
    """

    time: float
    """Time from the start of the run, s."""
    kind: str
    """phase, state, fault, retry, calibration, clock, warning or note."""
    text: str


@dataclass(frozen=True, eq=False)
class Angles:
    """Steady attitude of a recorded trial, as every command and page states it.

    >>> angles = biflag.read_session(recorded)["001_w1+50_w2+10"].steady
    >>> largest = max((term for term in angles.budget if term["angle"] == "yaw"), key=lambda term: term["share"])
    >>> angles.yaw_uncertainty_deg > largest["u_deg"]
    True
    """

    yaw_deg: float
    """Relative to the rest before the run, corrected for drift."""
    pitch_deg: float
    roll_deg: float
    yaw_uncertainty_deg: float | None
    """95 % uncertainty of the yaw by its budget, or as a model states it; ``None`` where it is unknown."""
    pitch_uncertainty_deg: float | None
    """95 % uncertainty of the pitch."""
    roll_uncertainty_deg: float | None
    """95 % uncertainty of the roll."""
    tilt_deg: float
    """Angle between the robot's axis and the vertical."""
    tilt_uncertainty_deg: float | None
    """95 % uncertainty of the tilt."""
    drift_deg: float | None
    """The drift that was removed from the yaw; ``None`` for a model."""
    settled: bool
    settle_s: float | None
    """Time from the start of the run after which yaw and pitch had settled; ``None`` if they had not."""
    steady_s: float
    """Time over which the angles are averaged."""
    still_after_s: float | None
    """Time for which the robot was still after the run; ``None`` for a model."""
    turned_deg: tuple[float, float, float]
    """Angle turned about each body axis over the whole trial."""
    measured_w1_rpm: float | None
    """Speed of flagellum 1 by the swing of the robot, whatever the trial states; ``None`` where it cannot be told."""
    measured_w1_uncertainty_rpm: float | None
    """95 % uncertainty of it."""
    measured_w2_rpm: float | None
    """Speed of flagellum 2."""
    measured_w2_uncertainty_rpm: float | None
    """95 % uncertainty of it."""
    not_measured: str | None
    """Why these speeds cannot be told; ``None`` if they are."""
    budget: list[dict[str, Any]]
    """Causes of the uncertainties: angle, name, type (A or B), u_deg, sensitivity, share and common_to."""


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """A trial that was read from its log, corrected as in all commands and pages. Times count from the start of the run.

    In a notebook it shows itself as the page that ``biflag report`` writes.

    >>> recording = biflag.read_session(recorded)["001_w1+50_w2+10"]
    >>> recording.speeds_rpm, recording.origin, recording.time.shape == recording.yaw.shape
    ((50.0, 10.0), 'emulated', True)
    """

    path: Path
    name: str
    speeds_rpm: tuple[float, float]
    """Target speeds of flagella 1 and 2."""
    origin: str
    """rig, emulated, model or import."""
    complete: bool
    """Whether the trial ended as planned and its log is intact."""
    steady: Angles | None
    """The steady attitude; ``None`` without an attitude in the run."""
    table: Table
    """One row a reading of the sensor, or a sample of the model: what ``biflag export`` writes."""
    notes: list[str]
    """What was corrected."""
    findings: list[dict[str, Any]]
    """What is to be said about the trial: kind, text, cure, and whether it is grave, so that the numbers may be wrong."""
    warnings: list[str]
    """The findings as text."""
    not_judged: list[str]
    """Why some findings could not be looked for, as in a trial without a rest; they are no warnings."""
    events: list[Event]
    phases: dict[str, tuple[float, float]]
    """Start and end of preroll, run and decay, s."""
    link: dict[str, int]
    """Statistics of the link: samples, lost, crc_errors, retries and more."""
    robot: Robot | None
    """The robot of the model or the plan; ``None`` if the log's is invalid."""
    records: dict[str, Any]
    """Further records of the log: plan, board, calibration, summary and more."""
    shapes: Floats | None
    """Centre lines of both flagella, body axes, m, shape (m, 2, nodes, 3), where the log has them."""
    shape_times: Floats | None
    """Their times, s, shape (m,)."""

    @property
    def time(self) -> Floats:
        """Time from the start of the run, s."""
        return self.table["time_s"]

    @property
    def yaw(self) -> Floats:
        """Yaw in degrees, unwrapped, offset and drift removed; NaN before the gyroscope was calibrated."""
        return self.table["yaw_deg"]

    @property
    def pitch(self) -> Floats:
        """Pitch in degrees, offset removed."""
        return self.table["pitch_deg"]

    @property
    def roll(self) -> Floats:
        """Roll in degrees, offset removed."""
        return self.table["roll_deg"]

    def to_pandas(self) -> pandas.DataFrame:
        """Returns a pandas table with the time from the start of the run in s as its index."""
        return self.table.to_pandas().set_index("time_s")

    def __repr__(self) -> str:
        one, two = self.speeds_rpm
        return f"<biflag.Recording {self.name} at {one:g} and {two:g} rpm, {self.table.rows} rows, {self.origin}>"

    def _repr_html_(self) -> str:
        return framed(_biflag.html(self.path))


def read_log(path: str | PathLike[str]) -> Recording:
    """Reads the log of a trial, even a damaged one.

    >>> recording = biflag.read_log(recorded / "001_w1+50_w2+10.mcap")
    >>> round(recording.phases["run"][1])
    24

    Raises:
        Error: The file cannot be read, or is not a log.
    """
    held = _biflag.read_log(path)
    columns, about, steady = held.pop("columns"), held.pop("about"), held.pop("steady")
    if steady is not None:
        steady["turned_deg"] = tuple(steady["turned_deg"])
    held["events"] = [Event(*event) for event in held["events"]]
    held["phases"] = dict(held["phases"])
    return Recording(
        path=Path(os.fspath(path)),
        table=Table(columns, dict(about)),
        steady=steady and Angles(**steady),
        shapes=held.pop("shapes", None),
        shape_times=held.pop("shape_times", None),
        **held,
    )


class Session(Mapping[str, Recording]):
    """The trials of a session folder by their names. A log is read when its trial is asked for.

    A trial has several logs if it was repeated after an interruption; the last complete one counts.

    >>> session = biflag.read_session(recorded)
    >>> list(session), session.missing
    (['001_w1+50_w2+10'], [])
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        held = _biflag.read_session(path)
        self.path = Path(os.fspath(path))
        self.name: str = held["name"]
        self.plan: str = held["plan"]
        """The text of the plan."""
        logs: dict[str, tuple[str, bool]] = {name: log for name, log in held["trials"].items() if log}
        self.logs = {name: Path(log) for name, (log, _) in logs.items()}
        """The log of each trial that has one."""
        self.missing = [name for name in held["trials"] if name not in logs]
        """The trials without a log."""
        self.left_out: list[dict[str, Any]] = held["left_out"]
        """Findings about logs in the folder that are none of the session's: log, kind, text, cure, grave."""
        self.incomplete = [name for name, (_, complete) in logs.items() if not complete]
        """The trials whose log is not complete."""

    def __getitem__(self, name: str) -> Recording:
        return read_log(self.logs[name])

    def __iter__(self) -> Iterator[str]:
        return iter(self.logs)

    def __len__(self) -> int:
        return len(self.logs)

    def table(self) -> Table:
        """Returns a table with one row a trial and its steady attitude: what ``biflag export`` writes."""
        columns, about = _biflag.session_table(self.path)
        return Table(columns, dict(about))

    def repeats(self) -> list[dict[str, Any]]:
        """Returns the scatter of trials at the same speeds beside their budget: what ``biflag info --json`` has as repeats."""
        repeats: list[dict[str, Any]] = _biflag.session_repeats(self.path)
        return repeats

    def __repr__(self) -> str:
        return f"<biflag.Session {self.name} of {len(self.logs) + len(self.missing)} trials, {len(self.logs)} with a log>"


def read_session(path: str | PathLike[str]) -> Session:
    """Reads a session folder.

    >>> biflag.read_session(recorded).table()["w1_rpm"].tolist()
    [50.0]

    Raises:
        Error: The folder holds no session, or cannot be read.
    """
    return Session(path)
