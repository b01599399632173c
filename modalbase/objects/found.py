"""What a search found, fetched as it is needed: rows, tables of pandas and polars, spectra as arrays."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any

from modalbase.client.errors import ClientError, Exit
from modalbase.client.files import fetch_file
from modalbase.objects.thing import Access, Table, library

SHOWN = 10
"""Rows that printing shows."""


class Found:
    """Rows of one noun that a search found; nothing is fetched before it is asked for.

        hot = lab.find("campaigns", "temperature_c > 25 AND structure.name LIKE 'bridge%'")
        hot.count, hot.facets
        for row in hot: ...
        hot.to_pandas()

    Attributes:
        lab: where it is searched.
        noun: `structures`, `campaigns`, `frfs`, `modes`, `results`, `coupons`, `records` or `monitors`.
        query: what is searched for, as REST has it.
    """

    def __init__(self, lab: Access, noun: str, query: Mapping[str, Any]) -> None:
        self.lab, self.noun = lab, noun
        self.query = {name: value for name, value in query.items() if value is not None}
        self._first: dict[str, Any] | None = None

    @property
    def address(self) -> str:
        """Its path below `/api/v1/`."""
        return f"search/{self.noun}"

    @property
    def count(self) -> int:
        """How many rows there are, as far as the service counts: `more` says whether there are others."""
        return int(self._head()["count"])

    @property
    def more(self) -> bool:
        """Whether there are more rows than `count`."""
        return bool(self._head()["more"])

    @property
    def facets(self) -> dict[str, dict[str, int]]:
        """By field: its values and how many of the counted rows have each."""
        found: dict[str, dict[str, int]] = self._head()["facets"]
        return found

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return self.lab.connection.pages(self.address, **self.query)

    def head(self, most: int = SHOWN) -> Table:
        """The first rows as a table."""
        return Table(list(islice(self.lab.connection.pages(self.address, most, **self.query), most)), key="id")

    def to_pandas(self) -> Any:
        """All rows as a `pandas.DataFrame`, SI in full, times as times.

        Raises:
            ClientError: pandas is not installed, or there are more rows than a file has.
        """
        return library("pandas").read_csv(io.BytesIO(self._file("csv")), parse_dates=self._times())

    def to_polars(self) -> Any:
        """All rows as a `polars.DataFrame`, SI in full.

        Raises:
            ClientError: polars is not installed, or there are more rows than a file has.
        """
        return library("polars").read_ipc_stream(self._file("arrow"))

    def archive(self, file: str | Path) -> Path:
        """Write all campaigns that were found, with structures, modes and results, to a zip that others read.

        Raises:
            ClientError: it is no search for campaigns, or it finds none, or more than an archive has.
        """
        if self.noun != "campaigns":
            raise ClientError(f"an archive is of campaigns; search for those whose {self.noun} are meant", Exit.USAGE)
        query = {name: value for name, value in self.query.items() if name in ("filter", "q")}
        fetch_file(self.lab.connection, f"{self.address}/archive", Path(file), **query)
        return Path(file)

    def arrays(self, **cut: Any) -> dict[str, Any]:
        """The spectra of all FRFs found, as arrays by name, in one stream: `values` is (N, lines), `frequency_hz` (lines,).

        Args:
            cut: `fmin` and `fmax`, Hz; `stride`.

        Raises:
            ClientError: it is no search for FRFs, or they are not of one quantity on one frequency axis.
        """
        import numpy as np

        if self.noun != "frfs":
            raise ClientError(f"{self.noun} have no spectra; search for frfs", Exit.USAGE)
        query = {name: value for name, value in self.query.items() if name in ("filter", "q")}
        content = self.lab.connection.call("GET", "search/frfs/data", params={**query, **cut, "format": "npz"})
        with np.load(io.BytesIO(content)) as archive:
            return dict(archive)

    def __repr__(self) -> str:
        about = f"{self.count:,}{'+' if self.more else ''} {self.noun}"
        return f"{about}\n{self.head()}" if self.count else about

    def _repr_html_(self) -> str:
        about = f"<p>{self.count:,}{'+' if self.more else ''} {self.noun}</p>"
        return about + self.head()._repr_html_()

    def _head(self) -> dict[str, Any]:
        if self._first is None:
            self._first = self.lab.connection.get(self.address, limit=SHOWN, **self.query)
        return self._first

    def _times(self) -> list[str]:
        row: dict[str, Any] = next(iter(self._head()["items"]), {})
        return [name for name in row if name.rpartition(".")[2].endswith(("_at", "_since"))]

    def _file(self, form: str) -> bytes:
        content: bytes = self.lab.connection.call("GET", self.address, params={**self.query, "format": form})
        return content
