"""What is stated of a file beside it: when it was recorded, and covariates."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, tzinfo
from pathlib import Path
from typing import Literal
from zoneinfo import ZoneInfo

from modalbase.client.errors import ClientError, Exit
from modalbase.watch.headings import covariate_of

_DIRECTIVES = {
    "%Y": r"\d{4}", "%m": r"\d{2}", "%d": r"\d{2}", "%H": r"\d{2}", "%M": r"\d{2}", "%S": r"\d{2}",
    "%y": r"\d{2}", "%j": r"\d{3}", "%f": r"\d{1,6}", "%z": r"(?:Z|[+-]\d{2}:?\d{2})", "%%": "%",
}  # fmt: skip


class NotStatedYetError(Exception):
    """A file's covariates are not there yet; it waits for them."""


class StatementError(Exception):
    """What is stated of a file cannot be read; its text names the place."""


def zone_of(name: str) -> tzinfo:
    """A time zone by its name, such as `Europe/Zurich` or `UTC`.

    Raises:
        ClientError: there is none of that name.
    """
    try:
        return UTC if name.upper() == "UTC" else ZoneInfo(name)
    except (KeyError, ValueError, OSError):
        why = f"--zone {name!r} is no time zone, such as UTC or Europe/Zurich"
        raise ClientError(why, Exit.USAGE) from None


@dataclass(frozen=True)
class TimeInName:
    """The time in a file's name, by a pattern such as `%Y%m%d_%H%M%S`, wherever it stands in it.

    Attributes:
        pattern: of `strptime`, with numbers alone.
        zone: that times without an offset are in.
    """

    pattern: str
    zone: tzinfo | None

    def __post_init__(self) -> None:
        """Refuse what says no time.

        Raises:
            ClientError: a directive is unknown, a date lacks, or the zone.
        """
        parts = re.findall(r"%.?", self.pattern)
        if unknown := [part for part in parts if part not in _DIRECTIVES]:
            known = " ".join(_DIRECTIVES)
            raise ClientError(f"--time has {unknown[0]!r}; it may have {known}", Exit.USAGE)
        dated = {"%Y", "%y"} & set(parts) and ("%j" in parts or {"%m", "%d"} <= set(parts))
        if not dated or "%H" not in parts:
            why = f"--time {self.pattern!r} lacks year, month and day, or the hour"
            raise ClientError(why, Exit.USAGE)
        if self.zone is None and "%z" not in parts:
            why = "--zone is missing: names of files do not say in which zone their time is"
            raise ClientError(why, Exit.USAGE)

    def of(self, path: Path) -> datetime:
        """When a file was recorded.

        Raises:
            StatementError: its name has no such time, or several.
        """
        text = re.split(r"(%.)", self.pattern)
        form = "".join(_DIRECTIVES.get(part) or re.escape(part) for part in text)
        times = re.findall(f"(?<!\\d){form}(?!\\d)", path.stem)
        if len(times) != 1:
            why = f"its name has {len(times)} times of the form {self.pattern}, expected one"
            raise StatementError(why)
        try:
            return _in_zone(datetime.strptime(times[0], self.pattern), self.zone)
        except ValueError as error:
            raise StatementError(f"its name has no time: {error}") from None


def _in_zone(time: datetime, zone: tzinfo | None) -> datetime:
    return time if time.tzinfo is not None else time.replace(tzinfo=zone)


@dataclass(frozen=True)
class Covariates:
    """Covariates of files, from tables of CSV: columns are named as covariates are, with their
    unit at the end or in brackets; `file` names a recording, `performed_at` is its time.

    Attributes:
        table: of all files, by their names or by time; None: each has a table of its own beside it,
            `NAME.csv`, of one row.
        zone: that times without an offset are in.
        within: of a table by time, how far a row may lie from a recording.
    """

    table: Path | None
    zone: tzinfo | None
    within: timedelta | None

    def source(self, path: Path) -> Path:
        """The table that a file's covariates stand in."""
        return path.with_suffix(".csv") if self.table is None else self.table

    def is_beside(self, path: Path, names: frozenset[str]) -> bool:
        """Whether a file is the table of another one, and no recording."""
        if path == self.table:
            return True
        beside = {name for name in names if Path(name).stem == path.stem} - {path.name}
        return self.table is None and path.suffix.lower() == ".csv" and bool(beside)

    def of(self, path: Path, time: datetime | None) -> tuple[dict[str, float], datetime | None]:
        """A file's covariates, and its time where a row states one.

        Args:
            path: of the file.
            time: of the file, where that is known.

        Raises:
            NotStatedYetError: the table or its row is not there.
            StatementError: the table cannot be read so.
        """
        source = self.source(path)
        if not source.exists():
            raise NotStatedYetError(f"{source.name} is not there")
        rows = _rows(source)
        if self.table is None and len(rows) != 1:
            raise StatementError(f"{source.name} has {len(rows)} rows, expected one")
        row = rows[0] if self.table is None else self._row(rows, path, time)
        stated = _time(row["performed_at"], self.zone) if row.get("performed_at") else None
        values = dict[str, float]()
        for heading, cell in row.items():
            if heading in ("file", "performed_at") or not cell:
                continue
            name, factor = _covariate(source, heading)
            if name in values:
                raise StatementError(f"{source.name} has {name} twice, again as {heading!r}")
            values[name] = factor * _number(cell, f"{source.name}, {heading}")
        return values, stated if self.table is None or "file" in row else None

    def _row(
        self, rows: Sequence[Mapping[str, str]], path: Path, time: datetime | None
    ) -> Mapping[str, str]:
        """The row of a file: by its name where there is a column `file`, else by its time."""
        if any("file" in row for row in rows):
            own = [row for row in rows if row.get("file") in (path.name, path.stem)]
            if len(own) > 1:
                raise StatementError(f"{self.source(path).name} has {len(own)} rows of it")
            if not own:
                raise NotStatedYetError(f"{self.source(path).name} has no row of it")
            return own[0]
        if time is None or self.within is None:
            need = "a table by time needs --within, and a --time that is known here"
            raise StatementError(f"{self.source(path).name} has no column `file`, and {need}")
        rows_by_distance = [
            (abs(_time(row.get("performed_at", ""), self.zone) - time), row) for row in rows
        ]
        nearest = min(rows_by_distance, key=lambda one: one[0], default=None)
        if nearest is None or nearest[0] > self.within:
            raise NotStatedYetError(f"{self.source(path).name} has no row near {time.isoformat()}")
        return nearest[1]


def _rows(source: Path) -> list[dict[str, str]]:
    """The rows of a table of text by the names of its columns.

    Raises:
        StatementError: it cannot be read, or a row is longer or shorter than its head.
    """
    try:
        text = source.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise StatementError(f"{source.name} cannot be read: {error}") from None
    head = text.partition("\n")[0]
    between = next((each for each in (";", "\t") if each in head), ",")
    lines = [line for line in csv.reader(text.splitlines(), delimiter=between) if any(line)]
    if not lines:
        raise StatementError(f"{source.name} is empty")
    names = [name.strip() for name in lines[0]]
    for number, line in enumerate(lines[1:], start=2):
        if len(line) != len(names):
            why = f"has {len(line)} cells, and the head {len(names)}"
            raise StatementError(f"{source.name}, line {number} {why}")
    return [dict(zip(names, map(str.strip, line), strict=True)) for line in lines[1:]]


def _covariate(source: Path, heading: str) -> tuple[str, float]:
    try:
        return covariate_of(heading)
    except ValueError as error:
        raise StatementError(f"{source.name}: {error}") from None


def _number(cell: str, place: str) -> float:
    try:
        # a comma within a cell is a decimal one: between cells stands another sign then
        return float(cell.replace(",", "."))
    except ValueError:
        raise StatementError(f"{place} is {cell!r}, expected a number") from None


def _time(cell: str, zone: tzinfo | None) -> datetime:
    try:
        time = _in_zone(datetime.fromisoformat(cell), zone)
    except ValueError:
        raise StatementError(
            f"performed_at is {cell!r}, expected such as 2026-03-02T09:30Z"
        ) from None
    if time.tzinfo is None:
        raise StatementError(f"performed_at is {cell!r} without an offset; state --zone")
    return time


@dataclass(frozen=True)
class Statements:
    """What is stated of each file.

    Attributes:
        campaign: what all campaigns have: `boundary`, `instruments` and so on.
        how: `mapping`, `kind` and `quantity` of the files.
        time: where a file's time is from: its name, the `csv` of covariates, its time of
            modification, or its content, which the service reads.
        covariates: where they are; None where there are none but those of the mapping.
    """

    campaign: Mapping[str, object]
    how: Mapping[str, object]
    time: TimeInName | Literal["file", "csv", "modified"]
    covariates: Covariates | None

    def of(self, path: Path) -> dict[str, object]:
        """What the campaign of a file is.

        Raises:
            NotStatedYetError: covariates are not there yet.
            StatementError: something cannot be read.
        """
        time: datetime | None = None
        if isinstance(self.time, TimeInName):
            time = self.time.of(path)
        elif self.time == "modified":
            time = datetime.fromtimestamp(path.stat().st_mtime, UTC)
        stated: dict[str, object] = {**self.campaign, "name": path.stem}
        if self.covariates is not None:
            values, own = self.covariates.of(path, time)
            stated["covariates"] = values
            if self.time == "csv":
                time = own
        if self.time == "csv" and time is None:
            raise StatementError("its row has no performed_at")
        return stated if time is None else {**stated, "performed_at": time.isoformat()}
