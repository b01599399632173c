"""Rows that print as a table, show in a notebook, and become a DataFrame where pandas is installed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from io import StringIO
from typing import Any

from modalbase.client.errors import ClientError, Exit


class Table(Sequence[Mapping[str, Any]]):
    """Rows of named values, SI in full; printing shows them in a laboratory's units where the table has some.

    `table[0]` is a row, `table["Ex"]` the row of that name, `table.column("estimate")` a column, `len(table)` the number
    of rows, `table.to_pandas()` a DataFrame.

    Attributes:
        rows: the values.
        key: the column that names a row.
    """

    def __init__(
        self,
        rows: Sequence[Mapping[str, Any]],
        key: str = "name",
        shown: tuple[Sequence[str], Sequence[Sequence[Any]]] | None = None,
    ) -> None:
        self.rows = list(rows)
        self.key = key
        self._shown = shown

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[Mapping[str, Any]]:
        return iter(self.rows)

    def __getitem__(self, which: Any) -> Any:
        if not isinstance(which, str):
            return self.rows[which]
        for row in self.rows:
            if row.get(self.key) == which:
                return row
        raise KeyError(f"{which!r}; there is {', '.join(str(row.get(self.key)) for row in self.rows)}")

    def column(self, name: str) -> list[Any]:
        """The values of a column, None where a row has none."""
        return [row.get(name) for row in self.rows]

    def to_pandas(self) -> Any:
        """A `pandas.DataFrame`, SI in full.

        Raises:
            ClientError: pandas is not installed.
        """
        try:
            import pandas as pd
        except ModuleNotFoundError:
            raise ClientError("pandas is not installed: pip install pandas", Exit.USAGE) from None
        return pd.DataFrame(self.rows)

    def __str__(self) -> str:
        from rich.console import Console

        from modalbase.client.display import PLAIN_WIDTH, print_table

        text = StringIO()
        print_table("", *self._cells(), Console(file=text, width=PLAIN_WIDTH))
        return "\n".join(line.rstrip() for line in text.getvalue().splitlines())

    __repr__ = __str__

    def _repr_html_(self) -> str:
        columns, rows = self._cells()
        head = "".join(f"<th>{escape(name)}</th>" for name in columns)
        body = "".join(f"<tr>{''.join(f'<td>{_html(cell)}</td>' for cell in row)}</tr>" for row in rows)
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"

    def _cells(self) -> tuple[Sequence[str], Sequence[Sequence[Any]]]:
        if self._shown is not None:
            return self._shown
        columns = list(dict.fromkeys(name for row in self.rows for name in row))
        return columns, [[row.get(name) for name in columns] for row in self.rows]


def _html(value: Any) -> str:
    from modalbase.client.display import cell

    return escape(cell(value))
