"""Speeds for an attitude."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np

from . import _biflag
from ._biflag import Robot
from ._table import Table
from ._twin import Path


@dataclass(frozen=True)
class ContactChange:
    """The nearest speeds at which the flagella begin or cease to touch.

    >>> biflag.ContactChange(rpm=4.5, at_rpm=(52.5, 14.0)).at_rpm
    (52.5, 14.0)
    """

    rpm: float
    """Distance in the plane of both speeds, to within 2 rpm."""
    at_rpm: tuple[float, float]
    """The speeds there."""


@dataclass(frozen=True)
class Solution:
    """Speeds, and the steady state of the model at them.

    >>> solution = biflag.aim(biflag.Robot.physical(), yaw=-67, pitch=-4).solutions[0]
    >>> abs(solution.yaw_deg + 67) < 0.2, abs(solution.pitch_deg + 4) < 0.2, solution.contact
    (True, True, 'apart')
    """

    w1_rpm: float
    w2_rpm: float
    yaw_deg: float
    """Mean yaw, unwrapped."""
    pitch_deg: float
    roll_deg: float
    tilt_deg: float
    """Angle between the robot's axis and the vertical."""
    thrust_n: float
    """Thrust of both flagella along the robot's axis."""
    kind: str
    """"steady" if the motion repeats, "beating" if it was not found to but its means are known, and "not_found" if they
    are not."""
    yaw_ci_deg: tuple[float, float] | None
    """Interval from the covariance of the robot's fit, the starting phase, the error of the model and the solver;
    :attr:`Aimed.confidence` says whether it is a 95 % interval. ``None`` if the time was over before."""
    pitch_ci_deg: tuple[float, float] | None
    roll_ci_deg: tuple[float, float] | None
    phase_spread_deg: tuple[float, float, float] | None
    """Largest less smallest yaw, pitch and roll of the starting phases."""
    std_error_deg: tuple[float, float, float] | None
    """Standard errors of yaw, pitch and roll from those of the robot's file."""
    model_error_deg: tuple[float, float, float] | None
    """What the model leaves out, in yaw, pitch and roll; ``None`` if the robot was fitted to a simulation."""
    contact: str
    """Whether the flagella are apart, touching or bundled."""
    contact_share: float
    """Share of the time in which they touch."""
    contact_by_phase: bool | None
    """Whether they touch at some starting phases only."""
    contact_change: ContactChange | None
    """The nearest change of contact; ``None`` if none was found, or if it is :attr:`unknown`."""
    min_gap_m: float
    """Least gap between their surfaces, negative if they overlap."""
    error_deg: float
    """Largest miss of the angles that were asked for."""
    unknown: tuple[str, ...]
    """What the model has not answered in time: "intervals", "contact_change"."""
    error_n: float | None = None
    """Miss of the thrust, if it was asked for."""

    @property
    def speeds(self) -> tuple[float, float]:
        """Both speeds in rpm, as :func:`simulate` takes them."""
        return (self.w1_rpm, self.w2_rpm)

    @classmethod
    def _of(cls, record: dict[str, Any]) -> Solution:
        tuples = {name: tuple(value) for name, value in record.items() if isinstance(value, list)}
        change = record["contact_change"]
        change = ContactChange(change["rpm"], tuple(change["at_rpm"])) if change else None
        return cls(**{**record, **tuples, "contact": record["contact"].lower(), "contact_change": change})


@dataclass(frozen=True)
class Doubt:
    """Why the intervals have no stated confidence.

    >>> biflag.Doubt(reason="the robot was never fitted", is_grave=False).reason
    'the robot was never fitted'
    """

    reason: str
    is_grave: bool
    """Whether something should be done about it."""


@dataclass(frozen=True, eq=False, repr=False)
class Aimed:
    """Speeds at which a robot takes an attitude. In a notebook it shows itself as a table.

    >>> aimed = biflag.aim(biflag.Robot.physical(), yaw=-67, pitch=-4)
    >>> aimed.target, aimed.reachable, aimed.table().rows == len(aimed.solutions)
    ('yaw -67°, pitch -4°', True, True)
    """

    reachable: bool
    """Whether solutions were found. If not, other speeds may still reach the attitude."""
    solutions: list[Solution]
    """Speeds at which the target is met, the nearest first."""
    nearest: Solution | None
    """The nearest attitude that was found, if there is no solution."""
    unfinished: list[dict[str, float]]
    """Speeds for which the time was too short, with the attitude of the table: whether the target is met near them is
    unknown."""
    confidence: float | None
    """Confidence of the intervals, 0.95; ``None`` where it cannot be stated."""
    doubts: list[Doubt]
    """Why it cannot."""
    target: str
    """What was asked for."""
    robot: Robot
    """The robot."""
    _answer: _biflag.Answer

    def table(self) -> Table:
        """Returns a table with one row a solution, or with the nearest attitude."""
        rows = [*self.solutions, *([self.nearest] if self.nearest else [])]
        numbers = ("w1_rpm", "w2_rpm", "yaw_deg", "pitch_deg", "roll_deg", "tilt_deg", "thrust_n", "error_deg")
        columns: dict[str, Any] = {name: [getattr(row, name) for row in rows] for name in numbers}
        for name in ("yaw", "pitch", "roll"):
            intervals = np.array([getattr(row, f"{name}_ci_deg") or (np.nan, np.nan) for row in rows])
            columns[f"{name}_low_deg"], columns[f"{name}_high_deg"] = intervals.reshape(-1, 2).T
        columns["contact"] = [row.contact for row in rows]
        columns["contact_change_rpm"] = [row.contact_change.rpm if row.contact_change else np.nan for row in rows]
        return Table(columns, ABOUT)

    def save_plan(self, path: Path) -> None:
        """Writes a plan with a trial at each solution, which must not exist; ``biflag record`` runs it.

        It is the plan that ``biflag aim -o`` writes. If the robot is in no file, as one that was changed or fitted, its file
        is written beside the plan.

        Raises:
            ParameterError: The file exists, or its folder does not exist or is not writable.
            Error: There is no solution, or the file cannot be written.
        """
        self._answer.save_plan(path)

    def _title(self) -> str:
        count = len(self.solutions)
        found = f"{count} solution{'s' if count > 1 else ''}" if self.reachable else "not found, the nearest attitude"
        return f"{self.target}: {found}, robot {self.robot.name}"

    def __repr__(self) -> str:
        rows = [*self.solutions, *([self.nearest] if self.nearest else [])]
        speeds = "; ".join(f"{row.w1_rpm:g}, {row.w2_rpm:g} rpm" for row in rows)
        return f"<biflag.Aimed at {self._title()}: {speeds}>"

    def _repr_html_(self) -> str:
        return f"<p>{escape(self._title())}</p>{self.table()._repr_html_()}"


ABOUT = {
    "tilt_deg": "angle between the robot's axis and the vertical",
    "thrust_n": "thrust of both flagella along the robot's axis",
    "error_deg": "largest miss of the angles that were asked for",
    "yaw_low_deg": "lower end of the interval",
    "yaw_high_deg": "upper end of the interval",
    "contact": "whether the flagella are apart, touching or bundled",
    "contact_change_rpm": "distance to the nearest speeds with another contact",
}


def aim(
    robot: Robot,
    *,
    yaw: float | None = None,
    pitch: float | None = None,
    roll: float | None = None,
    tilt: float | None = None,
    thrust: float | None = None,
    table: Table | Path | None = None,
    seconds: float = 60.0,
    threads: int | None = None,
) -> Aimed:
    """Finds the speeds at which a robot takes an attitude, each verified by the model; as ``biflag aim``.

    Two speeds give two quantities: name two of them, or more that agree.

    Args:
        robot: The robot. 95 % intervals need one that was fitted, or its file.
        yaw: Steady yaw in degrees; it is met modulo 360.
        pitch: Steady pitch in degrees.
        roll: Steady roll in degrees.
        tilt: Angle between the robot's axis and the vertical, degrees.
        thrust: Thrust of both flagella along the robot's axis, N.
        table: The table that proposes speeds, of :func:`simulate_batch` or :func:`sweep`, or its file; the map of the robot
            ``physical`` if left out. A table of another robot costs time, not truth.
        seconds: Longest time. The answer is what is known by then, and names what is not.
        threads: Number of threads; all cores if left out.

    Raises:
        ParameterError: Fewer than two quantities, an impossible value, or a table that cannot be read.
        Error: The model fails wherever it was tried.
    """
    proposals = _numbers(table) if isinstance(table, Table) else table
    answer = _biflag.aim(robot, yaw, pitch, roll, tilt, thrust, proposals, seconds, threads)
    record = answer.record()
    nearest = record.get("nearest")
    return Aimed(
        reachable=record["reachable"],
        solutions=[Solution._of(one) for one in record["solutions"]],
        nearest=Solution._of(nearest) if nearest else None,
        unfinished=record["unfinished"],
        confidence=record["confidence"],
        doubts=[Doubt(**doubt) for doubt in record["doubts"]],
        target=answer.target(),
        robot=robot,
        _answer=answer,
    )


def _numbers(table: Table) -> list[tuple[str, list[float]]]:
    """Returns the columns of a table that hold numbers."""
    return [(name, column.astype(float).tolist()) for name, column in table.items() if column.dtype.kind in "fiub"]
