"""Trials that other instruments measured."""

from __future__ import annotations

from os import PathLike

import numpy as np
from numpy.typing import ArrayLike

from . import _biflag
from ._biflag import Robot
from ._errors import ParameterError
from ._recording import Recording, read_log


def from_arrays(
    path: str | PathLike[str],
    time: ArrayLike,
    attitude: ArrayLike,
    *,
    speeds: tuple[float, float] | None = None,
    motor_rpm: ArrayLike | None = None,
    motor_turns: ArrayLike | None = None,
    run: tuple[float, float] | None = None,
    robot: Robot | None = None,
    uncertainty: tuple[float, float] | None = None,
    temperature: float | None = None,
    note: str = "",
) -> Recording:
    """Writes a trial that other instruments measured as a log, and returns it: :func:`compare` and :func:`calibrate` take it.

    >>> import numpy as np
    >>> time = np.arange(0, 60, 0.05)
    >>> yaw = -1.2 * np.clip(time - 10, 0, 40) * np.exp(-np.clip(time - 50, 0, 10) / 10)
    >>> yaw += 0.5 * np.sin(2 * np.pi * 50 / 60 * time) * (np.abs(time - 30) < 20)  # it swings once a turn
    >>> attitude = np.stack([yaw, 0 * time, 0 * time], axis=1)
    >>> trial = biflag.from_arrays(
    ...     folder / "camera.mcap", time, attitude, speeds=(50, 10), run=(10, 50), uncertainty=(0.5, 0.2)
    ... )
    >>> round(trial.steady.yaw_deg), trial.steady.yaw_uncertainty_deg, trial.steady.settled
    (-41, 0.5, False)

    Args:
        path: The log to write, which must not exist.
        time: Times in s, shape (n,).
        attitude: Yaw, pitch and roll in degrees, shape (n, 3): the body is turned about z (up), then about the new y, then
            about the new x. A row with a NaN is left out. An angle with one value in all rows, such as 0, was not measured: it
            has no ±, and :func:`calibrate` refuses the trial.
        speeds: Target speeds of flagella 1 and 2 in rpm; by default those of ``motor_rpm`` or ``motor_turns``.
        motor_rpm: Measured speeds in rpm, shape (n, 2).
        motor_turns: Measured turns of the shafts, shape (n, 2).
        run: Start and end of the run in s; by default the time in which the measured motors turn, or the whole time.
        robot: The robot; by default :meth:`Robot.physical`.
        uncertainty: 95 % uncertainty of the yaw, and of pitch and roll, in degrees. :func:`calibrate` needs it.
        temperature: Temperature of the fluid in °C.
        note: Anything worth knowing later.

    Raises:
        ParameterError: The shapes do not match.
        Error: The values are impossible, or the log cannot be written.
    """
    if motor_rpm is not None and motor_turns is not None:
        raise ParameterError("motor_turns: the motion of the motors is given twice")
    motion = motor_rpm if motor_rpm is not None else motor_turns
    columns = [column(time, "time", None), column(attitude, "attitude", 3)]
    if motion is not None:
        columns.append(column(motion, "motor_rpm" if motor_rpm is not None else "motor_turns", 2))
    lengths = {len(values) for values in columns}
    if len(lengths) != 1:
        raise ParameterError(f"time, attitude and motors have different lengths: {sorted(lengths)}")
    kind = None if motion is None else "rpm" if motor_rpm is not None else "turns"
    known = {"speeds": speeds, "run": run, "uncertainty": uncertainty, "temperature": temperature, "note": note}
    _biflag.ending(path, ["mcap"])
    _biflag.write_states(path, np.hstack(columns), kind, robot or Robot.physical(), known)
    return read_log(path)


def column(values: ArrayLike, name: str, width: int | None) -> np.ndarray:
    array = np.asarray(values, "float64")
    if width is None and array.ndim == 1:
        return array[:, np.newaxis]
    if width is None or array.shape[1:] != (width,):
        shape = "(n,)" if width is None else f"(n, {width})"
        raise ParameterError(f"{name}: has the shape {array.shape}, not {shape}", name)
    return array
