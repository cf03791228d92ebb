"""Sweeps: steady states over speeds, parameters of the robot and groups, in one table."""

from __future__ import annotations

import warnings
from typing import Any

from . import _biflag
from ._table import Progress, Table, shown
from ._twin import Path


def sweep(
    plan: Path,
    out: Path,
    *,
    threads: int | None = None,
    progress: Progress = None,
) -> Table:
    """Computes the points of a sweep's plan into a folder, and returns their table; as ``biflag sweep``.

    A folder that has points of this plan is continued. Ctrl-C keeps what is done. A point that cannot be computed is a row
    with NaN, and its reason in the column ``reason``.

    >>> plan = '''
    ... [session]
    ... name = "viscosities"
    ... [vary]
    ... "fluid.viscosity_pa_s" = [0.8, 1.2]
    ... [trial]
    ... method = "steady"
    ... [speeds]
    ... pairs = [[50, 15]]
    ... '''
    >>> table = biflag.sweep(plan, folder / "viscosities")
    >>> table.rows
    2

    Args:
        plan: The path of a plan, or the name of one inside biflag, such as "groups"; a text of several lines is the plan
            itself, in TOML, which names robot files relative to the current folder.
        out: The folder, in which the table is also written as ``table.parquet`` and ``table.csv``.
        threads: Number of points that are computed at the same time; one for each core if left out.
        progress: Called now and then with the number of points that are done and of all; its exceptions end the sweep.
            ``True`` shows them on stderr.

    Raises:
        ParameterError: The plan is wrong, or the folder has the sweep of another plan, robot or version of the
            model's results.
        Error: The folder cannot be used.
    """
    return _table(*_biflag.sweep(plan, out, threads, shown(progress)))


def read_sweep(path: Path) -> Table:
    """Returns the table of a sweep, as :func:`sweep` does: ``biflag.read_sweep("viscosities")``.

    Args:
        path: The folder of a sweep, also of one that is not finished, whose rows are the points that are done; or its
            ``table.parquet`` or ``table.csv``. Of a CSV all numbers are floats.

    Raises:
        ParameterError: It is neither.
    """
    return _table(*_biflag.read_sweep(path))


def _table(columns: dict[str, Any], about: list[tuple[str, str]], notes: list[str]) -> Table:
    for note in notes:
        warnings.warn(note, stacklevel=3)
    return Table(columns, dict(about))
