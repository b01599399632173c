"""`modalbase watch`: files that appear in folders become campaigns of a structure."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from threading import Event
from typing import Annotated, Any, Literal

import typer

from modalbase import objects
from modalbase.client.errors import ClientError, Exit
from modalbase.commands.options import NAMED, AsJson, Url, json_file, laboratory_at, names_of
from modalbase.objects.finding import LATEST, STRUCTURE, uuid_of
from modalbase.objects.thing import library

BESIDE = "beside"
_KEPT = ("boundary", "instruments", "frame", "inputs")


def watch(
    folders: Annotated[
        list[Path],
        typer.Argument(help="Folders in which files appear", exists=True, file_okay=False),
    ],
    structure: Annotated[
        str,
        typer.Option(help=f"Structure: {NAMED}", autocompletion=names_of(STRUCTURE)),
    ],
    pattern: Annotated[
        list[str] | None,
        typer.Option(help="Of file names, such as '*.tdms'; several may be stated"),
    ] = None,
    mapping: Annotated[
        Path | None,
        typer.Option(help="JSON or YAML that says which variable is what", exists=True),
    ] = None,
    like: Annotated[
        str | None,
        typer.Option(
            help="An earlier import by its id, or a campaign of this structure or else of any,"
            " such as project/structure/campaign: mapping, kind and quantity of its newest import,"
            " its boundary, frame and instruments"
        ),
    ] = None,
    boundary: Annotated[
        str | None, typer.Option(help="Of the campaigns, such as as_modelled or free")
    ] = None,
    time: Annotated[
        str | None,
        typer.Option(
            help="Where a file's time is: a pattern such as '%Y%m%d_%H%M%S' of its name; `file`,"
            " which states it; `csv`, column performed_at of --covariates; `modified`, its time of"
            " modification"
        ),
    ] = None,
    zone: Annotated[
        str | None, typer.Option(help="Of times without an offset, such as UTC or Europe/Zurich")
    ] = None,
    covariates: Annotated[
        str | None,
        typer.Option(
            help="`beside`: NAME.csv beside each file; or one CSV with rows by `file` or"
            " `performed_at`; a file waits for its row"
        ),
    ] = None,
    within: Annotated[
        float | None,
        typer.Option(help="s: how far a row of a table by time may lie from a file's time", min=0),
    ] = None,
    kind: Annotated[
        Literal["hits", "frfs", "responses", "loads"] | None,
        typer.Option(help="What the files hold, where neither they nor the mapping say"),
    ] = None,
    quantity: Annotated[
        Literal["accelerance", "mobility", "receptance"] | None,
        typer.Option(help="What FRFs are whose file does not say"),
    ] = None,
    rest: Annotated[
        float,
        typer.Option(
            help="s for which size and time of a file stay until it is whole; 0 where files arrive"
            " by rename",
            min=0,
        ),
    ] = 10.0,
    every: Annotated[float, typer.Option(help="s between two looks", min=0.05)] = 5.0,
    once: Annotated[
        bool, typer.Option("--once", help="Send what is there, wait until it is read, and end")
    ] = False,
    retry: Annotated[
        bool, typer.Option("--retry", help="Send failed files again, with the mapping of now")
    ] = False,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Send each file that appears as a campaign of its own; processing and monitors follow by
    themselves. Nothing is sent twice: the service is asked for its SHA-256.

    A line for each file says what became of it. Exit 4 where one could not be read.
    """
    from modalbase.watch.folders import Folders
    from modalbase.watch.watching import Happening, Watch, events_of, through_outages

    stop, how = Event(), {"kind": kind, "quantity": quantity}
    with laboratory_at(url) as lab, _ended_by_signals(stop):

        def first_answers() -> tuple[objects.Structure, tuple[dict[str, Any], dict[str, Any]]]:
            of = lab.structure(structure)
            return of, _stated(lab, of, mapping, like, boundary, how)

        note = lambda text: _print(vars(Happening("", "outage", text)), as_json)  # noqa: E731
        there = first_answers() if once else through_outages(first_answers, stop, note)
        if there is None:
            return
        of, stated = there
        seen = Folders(folders, pattern or ["*"], rest)
        watching = Watch(
            of,
            seen,
            _statements(*stated, time, zone, covariates, within),
            lambda happening: _print(vars(happening), as_json),
            again=retry,
        )
        if once:
            watching.run_once(stop)
        else:
            watching.run(every, stop)
    waiting = f", {watching.waiting} wait for covariates" if watching.waiting else ""
    typer.echo(", ".join(events_of(watching.counts)) + waiting, err=True)
    if watching.counts["failed"]:
        raise ClientError(f"{watching.counts['failed']} files could not be read", Exit.FAILED)


@contextmanager
def _ended_by_signals(stop: Event) -> Iterator[None]:
    """What runs ends after the file that it is at, where the process is asked to end."""
    endings = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(each, lambda *_: stop.set()) for each in endings]
    try:
        yield
    finally:
        for each, handler in zip(endings, before, strict=True):
            signal.signal(each, handler)


def _print(happening: dict[str, Any], as_json: bool) -> None:
    at = f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}"
    if as_json:
        typer.echo(json.dumps({"at": at, **happening}, ensure_ascii=False))
    else:
        words = (at, happening["outcome"], happening["file"], happening["detail"])
        typer.echo(" ".join(filter(None, words)))


def _stated(
    lab: objects.Laboratory,
    structure: objects.Structure,
    mapping: Path | None,
    like: str | None,
    boundary: str | None,
    how: Mapping[str, Any],
) -> tuple[dict[str, Any], dict[str, Any]]:
    """What all campaigns have, and how the files are read.

    Raises:
        ClientError: the boundary is missing, or `like` names nothing.
    """
    campaign, taken = ({}, {}) if like is None else _as_before(lab, structure, like)
    if boundary is not None:
        campaign["boundary"] = boundary
    if "boundary" not in campaign:
        raise ClientError("--boundary is missing, or --like CAMPAIGN, which has one", Exit.USAGE)
    if mapping is not None:
        taken["mapping"] = _document(mapping)
    taken |= {name: value for name, value in how.items() if value is not None}
    return campaign, {name: value for name, value in taken.items() if value is not None}


def _as_before(
    lab: objects.Laboratory, structure: objects.Structure, like: str
) -> tuple[dict[str, Any], dict[str, Any]]:
    """What an earlier campaign has, and how its newest import that succeeded, or this one, was
    read.
    """
    before = None if uuid_of(like) is None else _import(lab, like)
    named = like if before is None else str(before["campaign_id"])
    own = named == LATEST or any(one.fields["name"] == named for one in structure.campaigns())
    # else one of another structure, such as the same deck's before it was described anew
    campaign = structure.campaign(named) if own else lab.campaign(named)
    if before is None:
        done = [one.fields for one in campaign.imports() if one.succeeded and not one.dry_run]
        if not done:
            raise ClientError(f"no file was read into campaign {like!r}", Exit.USAGE)
        before = done[-1]
    how = {name: before[name] for name in ("mapping", "kind", "quantity")}
    if how["mapping"] is not None:
        how["kind"] = None  # a mapping says what it is of
    return {name: campaign.fields[name] for name in _KEPT}, how


def _import(lab: objects.Laboratory, key: str) -> dict[str, Any] | None:
    try:
        before = lab.named(objects.Import, key).refresh().fields
    except ClientError as error:
        if error.status != 404:
            raise
        return None
    return before


def _document(file: Path) -> dict[str, Any]:
    """The object in a file of JSON or YAML.

    Raises:
        ClientError: it holds none.
    """
    if file.suffix.lower() not in (".yaml", ".yml"):
        return json_file(file)
    yaml = library("yaml")
    try:
        value = yaml.safe_load(file.read_text(encoding="utf-8-sig"))
    except (yaml.YAMLError, OSError, UnicodeDecodeError) as error:
        raise ClientError(f"{file} is not YAML: {error}", Exit.USAGE) from None
    if not isinstance(value, dict):
        raise ClientError(f"{file} holds no object", Exit.USAGE)
    return value


def _statements(
    campaign: dict[str, Any],
    how: dict[str, Any],
    time: str | None,
    zone: str | None,
    covariates: str | None,
    within: float | None,
) -> Any:
    """What is stated of each file.

    Raises:
        ClientError: it is not said where a file's time is from, or what is said does not go
            together.
    """
    from modalbase.watch.statements import Covariates, Statements, TimeInName, zone_of

    mapping = how.get("mapping")
    recording = mapping.get("recording") if isinstance(mapping, dict) else None
    dated = isinstance(recording, dict) and recording.get("performed_at") is not None
    if time is None and not dated:
        why = "--time is missing: a pattern of the names, file, csv or modified"
        raise ClientError(why, Exit.USAGE)
    own = None if zone is None else zone_of(zone)
    chosen: Any = "file" if time is None else time
    if "%" in str(time):
        chosen = TimeInName(str(time), own)
    elif chosen not in ("file", "csv", "modified"):
        why = f"--time is {time!r}, expected a pattern with %Y and so on, file, csv or modified"
        raise ClientError(why, Exit.USAGE)
    if chosen == "csv" and covariates is None:
        raise ClientError("--time csv needs --covariates", Exit.USAGE)
    if chosen == "file" and not dated:
        if not isinstance(recording, dict):
            why = "--time file needs a --mapping of a recording"
            raise ClientError(why, Exit.USAGE)
        dating = {**recording, "performed_at": "file"}
        how = {**how, "mapping": {**(mapping or {}), "recording": dating}}
    table = None if covariates in (None, BESIDE) else Path(str(covariates))
    near = None if within is None else timedelta(seconds=within)
    beside = None if covariates is None else Covariates(table, own, near)
    return Statements(campaign, how, chosen, beside)
