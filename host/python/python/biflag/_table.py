"""Tables: columns with names and units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas

ROWS_SHOWN = 10


class Table(Mapping[str, NDArray[Any]]):
    """Columns of equal length by their names, which end with their units.

    Libraries for tables take it as it is: ``polars.DataFrame(dict(table))``.
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
