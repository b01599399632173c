"""What a search found, fetched as it is needed: rows, tables of pandas and polars, spectra as
arrays.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from math import floor, log10
from pathlib import Path
from typing import Any

from modalbase.client.errors import ClientError, Exit
from modalbase.objects.files import FIGURES, ROWS, TRENDS, format_of, save_file
from modalbase.objects.thing import Access, Addressed, Figure, Table, library

SHOWN = 10
"""Rows that printing shows."""


class SearchResults(Addressed):
    """Rows of one noun that a search found; nothing is fetched before it is asked for.

        hot = lab.find("campaigns", "temperature_c > 25 AND structure.name LIKE 'bridge%'")
        hot.count, hot.facets for row in hot: ... hot.to_pandas()

    Attributes:
        lab: where it is searched.
        noun: `structures`, `campaigns`, `frfs`, `modes`, `results`, `coupons`, `records` or
            `monitors`.
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
        """How many rows there are, as far as the service counts: `more` says whether there are
        others.
        """
        return int(self._head()["count"])

    @property
    def more(self) -> bool:
        """Whether there are more rows than `count`."""
        return bool(self._head()["more"])

    @property
    def facets(self) -> dict[str, dict[str, int]]:
        """By field: its values and how many of the counted rows have each."""
        facets: dict[str, dict[str, int]] = self._head()["facets"]
        return facets

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return self.lab.connection.pages(self.address, **self.query)

    def head(self, most: int = SHOWN) -> Table:
        """The first rows as a table."""
        return Table(self._pages("", most, **self.query)[:most], key="id")

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

    def save(self, file: str | Path) -> Path:
        """Write all rows to a file: `.csv`, `.jsonl`, `.arrows` or `.parquet`.

        Raises:
            ClientError: the name says none of these, or there are more rows than a file has.
        """
        return self._save("", file, ROWS, **self.query)

    def archive(self, file: str | Path) -> Path:
        """Write all campaigns that were found, with structures, modes and results, to a zip that
        others read.

        Raises:
            ClientError: it is no search for campaigns, or it finds none, or more than an archive
                has.
        """
        if self.noun != "campaigns":
            raise ClientError(
                f"an archive is of campaigns; search for those whose {self.noun} are meant",
                Exit.USAGE,
            )
        return self._save("archive", file, **self._what())

    def arrays(self, **cut: Any) -> dict[str, Any]:
        """The spectra of all FRFs found, as arrays by name, in one stream: `values` is (N, lines),
        `frequency_hz` (lines,).

        Args:
            cut: `fmin` and `fmax`, Hz; `stride`.

        Raises:
            ClientError: it is no search for FRFs, or they are not of one quantity on one frequency
                axis.
        """
        import numpy as np

        self._require("spectra", "frfs")
        query = {**self._what(), **cut, "format": "npz"}
        content = self.lab.connection.call("GET", "search/frfs/data", params=query)
        with np.load(io.BytesIO(content)) as archive:
            return dict(archive)

    def trend(self, value: str | None = None, covariates: str = "temperature_c") -> Trend:
        """A constant of the results found, or the modes found, over time and temperature.

            bridge = lab.find("results", "structure.name = 'footbridge'") print(bridge.trend("Ex"))
            lab.find("modes", "frequency_hz < 20").trend().figure().save("modes.pdf")

        Modes are followed from campaign to campaign by MAC and frequency. Each campaign counts
        once, with its newest result or mode set.

        Args:
            value: name of the constant, such as `Ex` or `flange.E1`; of modes `frequency_hz` or
                `damping_ratio`.
            covariates: what is fitted beside time, with commas between: conditions such as
                `temperature_c`, and others that campaigns state, such as `wind_m_s`.

        Raises:
            ClientError: it is no search for results or modes, or nothing found has such a value.
        """
        self._require("trend", "results", "modes")
        query = {**self._what(), "value": value, "covariates": covariates}
        return Trend(self.lab, self._at("trend"), {k: v for k, v in query.items() if v is not None})

    def figure(self) -> Figure:
        """The results found beside one another, with 95 % intervals.

        Raises:
            ClientError: it is no search for results.
        """
        self._require("figure", "results")
        sort = {"sort": self.query["sort"]} if "sort" in self.query else {}
        return Figure(self.lab, self._at("figure"), {**self._what(), **sort})

    def _require(self, what: str, *nouns: str) -> None:
        if self.noun not in nouns:
            raise ClientError(
                f"{self.noun} have no {what}; search for {' or '.join(nouns)}", Exit.USAGE
            )

    def _what(self) -> dict[str, Any]:
        """What is searched for, whatever is shown of it."""
        return {name: value for name, value in self.query.items() if name in ("filter", "q")}

    def __repr__(self) -> str:
        about = f"{self.count:,}{'+' if self.more else ''} {self.noun}"
        return f"{about}\n{self.head()}" if self.count else about

    def _repr_html_(self) -> str:
        about = f"<p>{self.count:,}{'+' if self.more else ''} {self.noun}</p>"
        return about + self.head()._repr_html_()

    def _head(self) -> dict[str, Any]:
        if self._first is None:
            self._first = self._get(limit=SHOWN, **self.query)
        return self._first

    def _times(self) -> list[str]:
        row: dict[str, Any] = next(iter(self._head()["items"]), {})
        return [name for name in row if name.rpartition(".")[2].endswith(("_at", "_since"))]

    def _file(self, form: str) -> bytes:
        content: bytes = self._call("GET", params={**self.query, "format": form})
        return content


class Trend:
    """What a search found over time: a series for each structure, of modes for each mode of a
    structure.

    Attributes:
        lab: where it is searched.
        address: its path below `/api/v1/`.
        query: of which search, and of what.
        fields: the answer, as REST has it.
    """

    def __init__(self, lab: Access, address: str, query: dict[str, Any]) -> None:
        self.lab, self.address, self.query = lab, address, query
        self.fields: dict[str, Any] = lab.connection.get(address, **query)

    @property
    def series(self) -> list[dict[str, Any]]:
        """Points, lines and notes of each series."""
        series: list[dict[str, Any]] = self.fields["series"]
        return series

    def table(self) -> Table:
        """A row for each series: campaigns, change by the hour, day or year as a share of the mean,
        alone and with the covariates.
        """
        return Table(_rate_rows(self.fields), key="series")

    def to_pandas(self) -> Any:
        """All points as a `pandas.DataFrame`, SI in full, with the value corrected for the
        covariates.

        Raises:
            ClientError: pandas is not installed.
        """
        content = self.lab.connection.call(
            "GET", self.address, params={**self.query, "format": "csv"}
        )
        return library("pandas").read_csv(io.BytesIO(content), parse_dates=["performed_at"])

    def figure(self) -> Figure:
        """Values over time and over temperature, with intervals and lines."""
        return Figure(self.lab, f"{self.address}/figure", self.query)

    def save(self, file: str | Path) -> Path:
        """Write its points to a `.csv` or `.parquet`, or its figure: `.svg`, `.png`, `.pdf`, or `.json` for
        Plotly.

        Raises:
            ClientError: the name says none of these.
        """
        if format_of(Path(file), TRENDS) in FIGURES.values():
            return self.figure().save(file)
        return save_file(self.lab.connection, self.address, file, TRENDS, **self.query)

    @property
    def notes(self) -> list[str]:
        """What to know of it and of its series, once each."""
        each = [self.fields, *self.series]
        return list(dict.fromkeys(note for one in each for note in one["notes"]))

    def __repr__(self) -> str:
        return "\n".join([str(self.table()), *self.fields["notes"]])


def _rate_rows(trend: Mapping[str, Any]) -> list[dict[str, Any]]:
    """A row for each series of a trend: the change by the unit of time that suits it, in per cent of
    the mean, by time alone and beside the covariates.
    """
    headings = dict.fromkeys(
        _rate_heading(one, line) for one in trend["series"] for line in one["lines"]
    )
    return [
        {
            "structure": one["structure_name"],
            "series": one["name"],
            "campaigns": len(one["points"]),
            **dict.fromkeys(headings, "–"),
            **{
                _rate_heading(one, line): _rate(line, one["time_unit_years"])
                for line in one["lines"]
            },
        }
        for one in trend["series"]
    ]


def _rate_heading(series: Mapping[str, Any], line: Mapping[str, Any]) -> str:
    beside = ", ".join(name.split("_")[0] for name in line["covariates"])
    return f"% per {series['time_unit']}" + (f" beside {beside}" if beside else "")


def _rate(line: Mapping[str, Any], years: float) -> str:
    """A change by a unit of time with its interval, to the second digit of the interval's length."""
    low, high = (years * end for end in line["relative_interval_95"])
    places = min(6, max(0, 1 - floor(log10(100 * (high - low))))) if high > low else 2
    middle, low, high = (
        f"{100 * value:+.{places}f}" for value in (years * line["relative_per_year"], low, high)
    )
    return f"{middle} ({low} to {high})"
