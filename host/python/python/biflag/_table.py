"""Tables: columns with names and units."""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable, Iterator, Mapping
from html import escape
from os import PathLike
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from . import _biflag

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes

Progress: TypeAlias = Callable[[int, int], object] | bool | None

ROWS_SHOWN = 10


class Table(Mapping[str, NDArray[Any]]):
    """Columns of equal length by their names, which end with their units.

    Libraries for tables take it as it is: ``polars.DataFrame(dict(table))``.

    >>> table = biflag.Table({"w1_rpm": [50.0, 37.5], "kind": ["steady", "beating"]})
    >>> table.rows, float(table["w1_rpm"].mean())
    (2, 43.75)
    >>> table.save(folder / "table.csv")
    >>> print((folder / "table.csv").read_text(), end="")
    w1_rpm,kind
    50.0,steady
    37.5,beating
    """

    def __init__(self, columns: Mapping[str, Any], about: Mapping[str, str] | None = None) -> None:
        self._columns = {name: np.asarray(values) for name, values in columns.items()}
        self.about: dict[str, str] = dict(about or {})
        """What each column holds."""

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self._columns[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(next(iter(self._columns.values()), ()))

    def to_pandas(self) -> pandas.DataFrame:
        """Returns a pandas table."""
        import pandas

        return pandas.DataFrame(self._columns)

    def to_xarray(self) -> xarray.Dataset:
        """Returns an xarray data set with the dimension ``row``, and what each column holds as ``long_name``."""
        import xarray

        about = {name: {"long_name": self.about[name]} if name in self.about else {} for name in self}
        return xarray.Dataset({name: ("row", column, about[name]) for name, column in self.items()})

    def save(self, path: str | PathLike[str]) -> None:
        """Writes a CSV file with all digits, or a Parquet file by pandas and pyarrow; the suffix decides.

        Raises:
            ParameterError: The suffix is another one.
        """
        if _biflag.ending(path, ["csv", "parquet"]) == 1:
            self.to_pandas().to_parquet(path)
        else:
            with open(path, "w", newline="", encoding="utf-8") as file:
                writer = csv.writer(file, lineterminator="\n")
                writer.writerow(self)
                writer.writerows(zip(*(column.tolist() for column in self._columns.values()), strict=True))

    def plot(self, x: str | None = None, y: str = "yaw_deg", *, by: str | None = None, ax: Axes | None = None) -> Axes:
        """Draws the column ``y`` over ``x``, by default the time or the speed of motor 1, with matplotlib.

        Returns the axes: ``ax``, or new ones. There is a curve for each value of the column ``by``.

        Raises:
            ImportError: matplotlib is missing: ``pip install biflag[plot]``.
        """
        x = x or next((name for name in ("time_s", "w1_rpm") if name in self), next(iter(self)))
        axes: Axes = new_axes(1)[0] if ax is None else ax
        for value in [None] if by is None else np.unique(self[by]):
            rows = np.flatnonzero(self[by] == value) if by is not None else np.arange(self.rows)
            rows = rows[np.argsort(self[x][rows], kind="stable")]
            axes.plot(self[x][rows], self[y][rows], "-" if x == "time_s" else ".-", label=None if by is None else str(value))
        axes.set(xlabel=x, ylabel=y)
        if by is not None:
            axes.legend(title=by)
        return axes

    def __repr__(self) -> str:
        return f"<biflag.Table of {self.rows} rows: {', '.join(self)}>"

    def _repr_html_(self) -> str:
        def cell(value: Any) -> str:
            return f"<td>{escape(f'{value:.5g}' if isinstance(value, float) else str(value))}</td>"

        head = "".join(f'<th title="{escape(self.about.get(name, ""))}">{escape(name)}</th>' for name in self)
        shown = min(self.rows, ROWS_SHOWN)
        body = ("".join(cell(column[i]) for column in self._columns.values()) for i in range(shown))
        rest = f"<p>{self.rows} rows, the first {shown} shown</p>" if shown < self.rows else ""
        return f"<table><tr>{head}</tr><tr>{'</tr><tr>'.join(body)}</tr></table>{rest}"


def new_axes(rows: int) -> NDArray[Any]:
    """Returns axes one below the other, shape (rows,)."""
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise ImportError("a plot needs matplotlib: pip install biflag[plot]") from error
    axes: NDArray[Any] = pyplot.subplots(rows, sharex=True, squeeze=False, layout="constrained")[1]
    return axes[:, 0]


def shown(progress: Progress) -> Callable[[int, int], object] | None:
    """Returns what is called with the number of points that are done and of all; ``True`` writes them to stderr."""

    def write(done: int, points: int) -> None:
        print(f"\r{done} of {points}", end="\n" if done == points else "", file=sys.stderr, flush=True)

    return write if progress is True else progress or None
