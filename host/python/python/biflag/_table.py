"""Tables: columns with names and units."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterator, Mapping
from html import escape
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ._errors import ParameterError

if TYPE_CHECKING:
    import pandas
    import xarray

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
        suffix = os.path.splitext(os.fspath(path))[1]
        if suffix == ".parquet":
            self.to_pandas().to_parquet(path)
        elif suffix == ".csv":
            with open(path, "w", newline="", encoding="utf-8") as file:
                writer = csv.writer(file, lineterminator="\n")
                writer.writerow(self)
                writer.writerows(zip(*(column.tolist() for column in self._columns.values()), strict=True))
        else:
            raise ParameterError(f"{os.fspath(path)}: a table is saved as .csv or .parquet", "path")

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
