"""Experiment against model: comparisons and fits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any, Literal, TypeAlias

import numpy as np

from . import _biflag
from ._biflag import Robot
from ._table import Table
from ._trial import Closure, Floats

Parameter: TypeAlias = Literal["tether", "righting", "drag", "viscosity", "young", "mount-yaw", "phase"]
Path: TypeAlias = str | PathLike[str]


@dataclass(frozen=True, eq=False)
class ComparedTrial:
    """A trial beside its model, or beside another trial at the same speeds. Errors are model minus measured.

    >>> trial = biflag.compare(recorded).trials[0]
    >>> trial.name, trial.measured.shape == trial.modelled.shape, "yaw" in trial.verdict
    ('001_w1+50_w2+10', True, True)
    """

    name: str
    time: Floats
    """Time from the start of the run, s, shape (n,)."""
    measured: Floats
    """Measured yaw, pitch and roll in degrees, shape (n, 3); NaN in a gap of the log."""
    modelled: Floats
    """The same of the model."""
    yaw_uncertainty: Floats
    """95 % uncertainty of the measured yaw, degrees, shape (n,)."""
    record: dict[str, Any]
    """Everything that ``biflag compare --json`` has of the trial: yaw_rmse_deg, steady_yaw_error_deg, findings and more.

    ``record["angles"]`` has the errors of yaw, pitch and roll with the parts of their uncertainty: noise, sensor, and the
    error of the model.
    """

    @property
    def agrees(self) -> bool:
        """Whether neither steady angles nor transients differ by more than their uncertainty."""
        return bool(self.record["agrees"])

    @property
    def verdict(self) -> str:
        """What differs, what agrees within what, and what limits it."""
        return str(self.record["verdict"])


@dataclass(frozen=True, eq=False)
class Comparison:
    """Trials beside their models.

    >>> comparison = biflag.compare(recorded)
    >>> comparison.table()["w1_rpm"].tolist()
    [50.0]
    """

    trials: list[ComparedTrial]
    record: dict[str, Any]
    """Everything that ``biflag compare --json`` has."""

    @property
    def verdict(self) -> str:
        """The findings of all trials."""
        return str(self.record["verdict"])

    @property
    def chance(self) -> dict[str, Any] | None:
        """How many differences chance explains: tests, alarms, expected_alarms, and the trials beyond; ``None`` between
        models."""
        chance: dict[str, Any] | None = self.record["chance"]
        return chance

    def table(self) -> Table:
        """Returns a table with one row a trial."""
        names = ("name", "w1_rpm", "w2_rpm", "yaw_rmse_deg", "pitch_rmse_deg", "roll_rmse_deg")
        errors = ("steady_yaw_error_deg", "steady_pitch_error_deg", "steady_roll_error_deg", "yaw_uncertainty_deg")
        numbers = {name: [trial.record[name] for trial in self.trials] for name in names}
        for name in errors:
            numbers[name] = [np.nan if trial.record[name] is None else trial.record[name] for trial in self.trials]
        return Table(numbers)


@dataclass(frozen=True, eq=False)
class Estimate:
    """A fitted parameter.

    >>> estimate = fitted.parameters["viscosity"]
    >>> estimate.key, estimate.unit, estimate.interval_95[0] < estimate.value < estimate.interval_95[1]
    ('fluid.viscosity_pa_s', 'Pa s', True)
    """

    name: str
    key: str | None
    """Key in the robot file; ``None`` for the mounting of the sensor."""
    unit: str
    start: float
    value: float
    std_error: float
    """Standard error from the noise of the measurement, the errors of the sensor and the solver."""
    model_error: float | None
    """By how much what the model leaves out may have changed the value; ``None`` for trials of a simulation."""
    interval_95: tuple[float, float]
    """With the error of the model."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """Parameters of a robot that were fitted to its trials.

    >>> fitted.rmse_after_deg < fitted.rmse_before_deg
    True
    >>> robot_file = (folder / "fitted.toml").write_text(fitted.text)
    """

    robot: Robot
    """The fitted robot."""
    parameters: dict[str, Estimate]
    """The fitted parameters by their names."""
    rmse_before_deg: float
    rmse_after_deg: float
    warnings: list[str]
    """What the trials cannot tell, residuals that the noise does not explain, and further warnings."""
    record: dict[str, Any]
    """Everything that ``biflag calibrate --json`` has."""
    text: str
    """The robot file that ``biflag calibrate`` writes, with the covariance of the fit."""


def compare(
    measured: Path,
    modelled: Path | None = None,
    *,
    robot: Robot | None = None,
    closure: Closure | None = None,
    anyway: bool = False,
    threads: int | None = None,
) -> Comparison:
    """Compares a log or a session with its replay in the model, or with another log or session.

    Replays are kept in a folder beside the session, where ``biflag compare`` finds them.

    >>> comparison = biflag.compare(recorded)
    >>> [angle["angle"] for angle in comparison.trials[0].record["angles"]]
    ['yaw', 'pitch', 'roll']

    Args:
        measured: The log or the session folder.
        modelled: The other one; its replay if left out.
        robot: The robot of the replay; that of the log if left out.
        closure: The closure of the replay; that of the log's model or "full" if left out.
        anyway: Whether trials of different robots, closures or speeds are compared.
        threads: Number of trials at a time; one for each core if left out.

    Raises:
        ParameterError: The trials do not match.
        Error: A log cannot be read or has no usable trial.
    """
    record, series = _biflag.compare(measured, modelled, robot, closure, anyway, threads)
    trials = [ComparedTrial(name=one["name"], record=one, **series[one["name"]]) for one in record["trials"]]
    return Comparison(trials, record)


def calibrate(
    logs: Path | Sequence[Path],
    fit: Sequence[Parameter] = (),
    *,
    robot: Robot | None = None,
    closure: Closure | None = None,
    threads: int | None = None,
) -> Calibration:
    """Fits parameters of a robot to recorded trials by least squares.

    >>> fitted = biflag.calibrate(recorded, ["viscosity"])
    >>> 0.4 < fitted.robot["fluid.viscosity_pa_s"] < 1.6
    True

    Args:
        logs: Logs or session folders.
        fit: The parameters; all but "young" and "phase" if left out.
        robot: The robot to start from; that of the first log if left out.
        closure: The closure; that of the first log's model or "full" if left out.
        threads: Number of simulations at a time; one for each core if left out.

    Raises:
        ParameterError: A parameter has no such name.
        Error: A trial cannot be used, or the fit does not converge.
    """
    paths = [logs] if isinstance(logs, (str, PathLike)) else list(logs)
    record, fitted, text = _biflag.calibrate(paths, fit, robot, closure, threads)
    estimates = {
        one["name"]: Estimate(**{**one, "interval_95": tuple(one["interval_95"])}) for one in record["parameters"]
    }
    return Calibration(
        robot=fitted,
        parameters=estimates,
        rmse_before_deg=record["rmse_before_deg"],
        rmse_after_deg=record["rmse_after_deg"],
        warnings=record["cannot_tell"] + record["misfits"] + record["warnings"],
        record=record,
        text=text,
    )
