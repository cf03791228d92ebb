"""Simulated trials."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from os import PathLike
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _biflag
from ._biflag import Robot
from ._quantities import Quantities
from ._table import Progress, Table, new_axes, shown

if TYPE_CHECKING:
    import pandas
    import xarray

Floats: TypeAlias = NDArray[np.float64]
Closure: TypeAlias = Literal["full", "lumped", "paper"]
Method: TypeAlias = Literal["trial", "steady"]
Speeds: TypeAlias = ArrayLike | Callable[[float], Sequence[float] | Floats]

AXES = ("x", "y", "z")


@dataclass(frozen=True, eq=False, kw_only=True)
class Steady(Quantities):
    """Steady state of a simulated trial: means over the angles of both flagella, from the second half of the run.

    >>> steady = biflag.simulate(biflag.Robot.physical(), (37.5, 12.5), 60).steady
    >>> bool(steady.force1_n[2] > steady.force2_n[2]), steady.bundling
    (True, 'apart')

    With the method "steady" everything is of one period of the motion. If it does not repeat, all but the means is of the
    last window.

    Forces and torques are those of the flagella on the base, in body axes; the thrust is the z component.
    """

    settled: bool
    """Whether twice the standard errors are within 0.1 degrees and 1 % of the larger thrust, 0.3 degrees and 3 % if the
    flagella touch."""
    bundling: str
    """The closest state of the flagella: apart, touching or bundled."""
    kind: str | None = None
    """With the method "steady": "steady" if the motion repeats, "beating" if it was not found to but its means are known,
    and "not_found" if they are not. With both methods "overturned" if the base turned over: its angles are NaN."""

    @classmethod
    def _of(cls, record: dict[str, Any]) -> Steady:
        del record["bundling_changes"]
        record["bundling"] = record["bundling"].lower()
        vectors = {name: np.array(value) for name, value in record.items() if isinstance(value, list)}
        return cls(**{**record, **vectors})


@dataclass(frozen=True, eq=False, repr=False)
class Trial:
    """A simulated trial. ``n`` is the number of samples; body axes: x from motor 2 to motor 1, z up along the robot.

    >>> trial = biflag.simulate(biflag.Robot.physical(), (37.5, 12.5), 5, shapes=True)
    >>> trial.forces.shape, trial.shapes.shape[:2], trial.to_xarray().yaw.attrs["units"]
    ((101, 2, 3), (101, 2), 'degree')

    In a notebook it shows itself as the page that ``biflag report`` writes.
    """

    time: Floats
    """Time in s, shape (n,)."""
    yaw: Floats
    """Yaw in degrees, unwrapped, positive counter-clockwise seen from above, shape (n,)."""
    pitch: Floats
    """Pitch about the y axis after the yaw, degrees, shape (n,)."""
    roll: Floats
    """Roll about the x axis after yaw and pitch, degrees, shape (n,)."""
    attitude: Floats
    """Quaternion [w, x, y, z] that turns body axes into world axes, shape (n, 4)."""
    rates: Floats
    """Angular velocity in body axes, degrees/s, shape (n, 3)."""
    speeds: Floats
    """Speeds of both motors, rpm, shape (n, 2)."""
    turns: Floats
    """Angles of both flagella in turns, those of ``phase_deg`` at the start, shape (n, 2)."""
    forces: Floats
    """Force of flagellum 1 and 2 on the base, N, body axes, contact included, shape (n, 2, 3)."""
    contact_forces: Floats
    """The part of ``forces`` that is contact, shape (n, 2, 3)."""
    torques: Floats
    """Reaction torques on the base about both shafts, N m, shape (n, 2)."""
    gap: Floats
    """Least distance of the flagella's surfaces since the sample before, m, negative if they overlap, shape (n,)."""
    winding: Floats
    """Number of times that the flagella wind round each other, shape (n,)."""
    shapes: Floats | None
    """Centre lines of both flagella from the shaft to the tip, body axes, m, shape (n, 2, nodes, 3); ``None`` unless
    asked for."""
    steady: Steady
    """Steady state."""
    robot: Robot
    """The robot."""
    _simulated: _biflag.Simulated

    def to_table(self) -> Table:
        """Returns a table with one row a sample; columns have the names that ``biflag export`` gives them."""
        return Table(self._simulated.columns())

    def to_pandas(self) -> pandas.DataFrame:
        """Returns a pandas table with the time in s as its index and the columns of :meth:`to_table`."""
        return self.to_table().to_pandas().set_index("time_s")

    def to_xarray(self) -> xarray.Dataset:
        """Returns an xarray data set with units."""
        import xarray

        flagellum = ("time", "flagellum")
        variables: dict[str, tuple[Any, ...]] = {
            "yaw": ("time", self.yaw, {"units": "degree"}),
            "pitch": ("time", self.pitch, {"units": "degree"}),
            "roll": ("time", self.roll, {"units": "degree"}),
            "attitude": (("time", "part"), self.attitude, {"units": "1"}),
            "rates": (("time", "axis"), self.rates, {"units": "degree/s"}),
            "speeds": (flagellum, self.speeds, {"units": "rpm"}),
            "turns": (flagellum, self.turns, {"units": "1"}),
            "forces": ((*flagellum, "axis"), self.forces, {"units": "N"}),
            "contact_forces": ((*flagellum, "axis"), self.contact_forces, {"units": "N"}),
            "torques": (flagellum, self.torques, {"units": "N m"}),
            "gap": ("time", self.gap, {"units": "m"}),
            "winding": ("time", self.winding, {"units": "1"}),
        }
        if self.shapes is not None:
            variables["shapes"] = ((*flagellum, "node", "axis"), self.shapes, {"units": "m"})
        coordinates = {
            "time": ("time", self.time, {"units": "s"}),
            "flagellum": [1, 2],
            "axis": list(AXES),
            "part": ["w", "x", "y", "z"],
        }
        return xarray.Dataset(variables, coords=coordinates)

    def save(self, path: str | PathLike[str]) -> None:
        """Writes the log of the trial, which must not exist; every command of ``biflag`` and :func:`read_log` read it.

        Its name ends with .mcap; ``to_table().save(path)`` writes a table.
        """
        _biflag.ending(path, ["mcap"])
        self._simulated.save(path)

    def plot(self, ax: NDArray[Any] | None = None) -> NDArray[Any]:
        """Draws yaw, pitch and roll over time with matplotlib, into three axes such as those of another trial; returns them."""
        names, table = ("yaw_deg", "pitch_deg", "roll_deg"), self.to_table()
        both = zip(new_axes(3) if ax is None else ax, names, strict=True)
        drawn = np.array([table.plot("time_s", name, ax=axes) for axes, name in both])
        for axes in drawn[:-1]:
            axes.set_xlabel("")
        return drawn

    def __repr__(self) -> str:
        steady = self.steady
        angles = f"yaw {steady.yaw_deg:.2f}°, pitch {steady.pitch_deg:.2f}°, roll {steady.roll_deg:.2f}°"
        settled = "" if steady.settled else ", not settled"
        return f"<biflag.Trial of {self.time[-1] - self.time[0]:g} s: {angles}{settled}>"

    def _repr_html_(self) -> str:
        return framed(self._simulated.html())


def framed(page: str) -> str:
    """Returns a page as a frame in a notebook."""
    return f'<iframe srcdoc="{escape(page)}" style="width: 100%; height: 720px; border: 0"></iframe>'


def simulate(
    robot: Robot,
    speeds: Speeds,
    duration: float | None = None,
    *,
    closure: Closure = "full",
    method: Method = "trial",
    rate_hz: float = 20.0,
    shapes: bool = False,
    phase_deg: tuple[float, float] = (0.0, 0.0),
) -> Trial:
    """Simulates a trial that starts upright and at rest.

    >>> trial = biflag.simulate(biflag.Robot.physical(), lambda time: (30 + 2 * time, 10), 5, rate_hz=10)
    >>> trial.time.size, bool(trial.yaw[-1] < 0)
    (51, True)

    Args:
        robot: The robot and its fluid.
        speeds: Speeds of motors 1 and 2 in rpm, at most 90, positive counter-clockwise seen from above: two numbers, reached within
            0.25 s; an array of shape (n, 2), evenly spaced over the duration; an array of shape (n, 3) with times in s
            in its first column; or a function from the time in s to two numbers, which is evaluated every 10 ms.
            Between given times the speeds change linearly.
        duration: Duration in s; left out if ``speeds`` has times.
        closure: How the flagella act on the base: "full", "lumped" or "paper".
        method: "trial" simulates the whole duration. "steady" solves for the motion that a trial at constant speeds ends
            in, and returns one period of it or, if none is found to repeat, the last window that was simulated.
        rate_hz: Samples a second.
        shapes: Whether the trial has the centre lines of the flagella.
        phase_deg: Angles of the motors at the start, degrees.

    Raises:
        ParameterError: An argument is impossible.
        Error: The solver fails.
    """
    simulated = _biflag.simulate(robot, speeds, duration, closure, method, rate_hz, shapes, phase_deg)
    arrays = simulated.arrays()
    lines = arrays.pop("shapes", None)
    steady = Steady._of(simulated.steady())
    return Trial(**arrays, shapes=lines, steady=steady, robot=robot, _simulated=simulated)


def simulate_batch(
    robot: Robot | Sequence[Robot],
    speeds: ArrayLike,
    duration: float = 120.0,
    *,
    closure: Closure = "full",
    method: Method = "trial",
    rate_hz: float = 20.0,
    phase_deg: tuple[float, float] = (0.0, 0.0),
    threads: int | None = None,
    progress: Progress = None,
) -> Table:
    """Simulates trials at constant speeds side by side, and returns a table with the steady state of each.

    The values are those of ``biflag simulate``. A trial that the solver cannot end has NaN in its row, and the reason in
    the column ``error``.

    >>> table = biflag.simulate_batch(biflag.Robot.physical(), [(50, 10), (10, 50)], method="steady")
    >>> bool((abs(table["yaw_deg"] + 67.6) < 0.2).all()), [round(float(pitch)) for pitch in table["pitch_deg"]]
    (True, [-4, 4])

    Args:
        robot: The robot and its fluid; or a robot a row, n of them.
        speeds: Speeds of motors 1 and 2 in rpm, shape (n, 2).
        duration: Duration of each trial in s.
        closure: How the flagella act on the base: "full", "lumped" or "paper".
        method: "trial" simulates the whole duration. "steady" solves for the motion that each trial ends in, in a fraction
            of the time; the column ``kind`` says what was found: "steady", a motion that repeats; or "beating" if the means
            over successive windows agree, and "not_found" if they do not. With both it is "overturned" if the base turned over.
        rate_hz: Samples a second in which the state of the flagella, ``bundling``, is looked at.
        phase_deg: Angles of the motors at the start, degrees.
        threads: Number of threads; all cores if left out.
        progress: Called now and then with the number of trials that are done and of all; its exceptions end the work.
            ``True`` shows them on stderr.

    Raises:
        ParameterError: An argument is impossible.
    """
    robots = [robot] if isinstance(robot, Robot) else list(robot)
    call = shown(progress)
    return Table(_biflag.simulate_batch(robots, speeds, duration, closure, method, rate_hz, phase_deg, threads, call))
