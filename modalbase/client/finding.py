"""Ids by name: an id, a name, names from the project down with `/` between, or `latest`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any
from uuid import UUID

from modalbase.client.connection import Connection
from modalbase.client.errors import ClientError, Exit

LATEST = "latest"
MOST_NAMED = 8


@dataclass(frozen=True)
class Kind:
    """A noun whose things have names and are listed below another noun's.

    Attributes:
        word: how a message calls one.
        path: of one, with `{}` for its id.
        above: the noun that it belongs to; None of a project.
        below: its list below `above`, with `{}` for the id of that.
        made_by: the command that makes one.
    """

    word: str
    path: str
    above: Kind | None
    below: str
    made_by: str


PROJECT = Kind("project", "projects/{}", None, "projects", "projects --new NAME")
STRUCTURE = Kind("structure", "structures/{}", PROJECT, "projects/{}/structures", "structures --new NAME …")
CAMPAIGN = Kind("campaign", "campaigns/{}", STRUCTURE, "structures/{}/campaigns", "campaigns --new NAME --boundary …")
MODE_SET = Kind("mode set", "mode-sets/{}", CAMPAIGN, "campaigns/{}/mode-sets", "modes CAMPAIGN --identify")
BATCH = Kind(
    "coupon batch", "coupon-batches/{}", STRUCTURE, "structures/{}/coupon-batches", "coupons NAME --new STRUCTURE …"
)
MONITOR = Kind("monitor", "monitors/{}", STRUCTURE, "structures/{}/monitors", "monitors --new NAME")


def find(service: Connection, kind: Kind, text: str, within: str | None = None) -> dict[str, Any]:
    """The one thing that a text means.

    Args:
        service: the connection.
        kind: of the thing.
        text: an id; a name; names from further up with `/` between, such as `bridge/beam/March`; or `latest`.
        within: id of the one above, where only what belongs to that is meant.

    Raises:
        ClientError: nothing has that name, or several things have; the message lists what there is.
    """
    if (id_ := uuid_of(text)) is not None:
        found: dict[str, Any] = service.get(kind.path.format(id_))
        return found
    there = list(all_of(service, kind) if within is None else service.pages(kind.below.format(within)))
    if text == LATEST and there:
        return max(there, key=lambda one: str(one["created_at"]))
    matching = [one for one in there if text in _names(one)]
    if len(matching) == 1:
        return matching[0]
    if matching:
        ids = ", ".join(one["id"] for one in matching[:MOST_NAMED])
        raise ClientError(f"{len(matching)} {kind.word}s are named {text!r}; state the id: {ids}", Exit.USAGE)
    raise ClientError(_nothing(kind, text, there), Exit.USAGE)


def find_id(service: Connection, kind: Kind, text: str) -> str:
    """The id of the one thing that a text means; an id is taken as it is, and the service judges it.

    Raises:
        ClientError: as `find`.
    """
    return uuid_of(text) or str(find(service, kind, text)["id"])


def find_job(service: Connection, text: str, **narrowed: Any) -> str:
    """The id of an update job: an id, or `latest`, the one that was queued last.

    Args:
        service: the connection.
        text: what is stated.
        narrowed: to a project, structure or campaign, by id.

    Raises:
        ClientError: it is neither, or there is no job.
    """
    if (id_ := uuid_of(text)) is not None:
        return id_
    if text != LATEST:
        raise ClientError(
            f"{text!r} is no id, expected one such as 0198c6a2-… or latest; `modalbase jobs` lists them", Exit.USAGE
        )
    newest = next(service.pages("update-jobs", 1, **narrowed), None)
    if newest is None:
        raise ClientError("there is no update job yet; `modalbase update CAMPAIGN --wait` makes one", Exit.USAGE)
    return str(newest["id"])


def uuid_of(text: str) -> str | None:
    """A UUID in the form that a path takes; None where the text is none, such as `../projects`, another path."""
    try:
        return str(UUID(text))
    except ValueError:
        return None


def all_of(service: Connection, kind: Kind) -> Iterator[dict[str, Any]]:
    """Everything of a kind that one may see, each with the things above it under `above`."""
    if kind.above is None:
        yield from service.pages(kind.below)
        return
    for parent in all_of(service, kind.above):
        for one in service.pages(kind.below.format(parent["id"])):
            yield {**one, "above": parent}


def _names(one: Mapping[str, Any]) -> Iterator[str]:
    """The name, and longer ones with the names above it in front, `/` between."""
    name = str(one["name"])
    yield name
    above = one.get("above")
    while above is not None:
        name = f"{above['name']}/{name}"
        yield name
        above = above.get("above")


def _nothing(kind: Kind, text: str, there: Sequence[Mapping[str, Any]]) -> str:
    names = list(dict.fromkeys(str(one["name"]) for one in there))
    if not names:
        return f"there is no {kind.word} yet; `modalbase {kind.made_by}` makes one"
    close = get_close_matches(text, names, MOST_NAMED, 0.5) or names[:MOST_NAMED]
    return f"{text!r} is no id, and no {kind.word} has that name; there is {', '.join(repr(name) for name in close)}"
