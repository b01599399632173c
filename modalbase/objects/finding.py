"""Ids by name: an id, a name, names from the project down with `/` between, or `latest`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from difflib import get_close_matches
from http import HTTPStatus
from reprlib import repr as shorten
from typing import TYPE_CHECKING, Any
from uuid import UUID

from modalbase.client.errors import ClientError, Exit

if TYPE_CHECKING:
    from modalbase.client.connection import Connection

LATEST = "latest"
MOST_NAMED = 8


@dataclass(frozen=True)
class Kind:
    """A noun whose things are listed below another noun's.

    Attributes:
        word: how a message calls one.
        path: of one, with `{}` for its id.
        below: the list of them, with `{}` for the id of the one above.
        above: the noun that it belongs to, where things are found by name; None of a project.
        made_by: the command that makes one.
    """

    word: str
    path: str
    below: str
    above: Kind | None = None
    made_by: str = ""


PROJECT = Kind("project", "projects/{}", "projects", None, "projects --new NAME")
STRUCTURE = Kind(
    "structure", "structures/{}", "projects/{}/structures", PROJECT, "structures --new NAME …"
)
CAMPAIGN = Kind(
    "campaign",
    "campaigns/{}",
    "structures/{}/campaigns",
    STRUCTURE,
    "campaigns --new NAME --boundary …",
)
MODE_SET = Kind(
    "mode set", "mode-sets/{}", "campaigns/{}/mode-sets", CAMPAIGN, "modes CAMPAIGN --identify"
)
BATCH = Kind(
    "coupon batch",
    "coupon-batches/{}",
    "structures/{}/coupon-batches",
    STRUCTURE,
    "coupons NAME --new STRUCTURE …",
)
MONITOR = Kind("monitor", "monitors/{}", "structures/{}/monitors", STRUCTURE, "monitors --new NAME")


def find(service: Connection, kind: Kind, text: str, within: str | None = None) -> dict[str, Any]:
    """The one thing that a text means.

    Args:
        service: the connection.
        kind: of the thing.
        text: an id; a name; names from further up with `/` between, such as `bridge/beam/March`; or
            `latest`.
        within: id of the one above, where only what belongs to that is meant.

    Raises:
        ClientError: nothing has that name, or several things have; the message lists what there is.
    """
    if (id_ := uuid_of(text)) is not None:
        return service.get(kind.path.format(id_))
    there = list(
        all_of(service, kind) if within is None else service.pages(kind.below.format(within))
    )
    if text == LATEST and there:
        return max(there, key=lambda one: str(one["created_at"]))
    one = _only(kind, text, [one for one in there if text in _names(one)])
    if one is None:
        raise ClientError(_nothing(kind, text, there), Exit.USAGE)
    return one


def find_or_make(
    service: Connection,
    kind: Kind,
    body: Mapping[str, Any],
    within: str | None = None,
    **query: Any,
) -> dict[str, Any]:
    """The one thing that has a body's name, made of the body where there is none.

    Args:
        service: the connection.
        kind: of the thing.
        body: as REST takes it, with `name`.
        within: id of the one above.
        query: of the request that makes it.

    Raises:
        ClientError: several things have the name; the one that has it is not as the body states; or
            the service refuses.
    """
    path, name = kind.below.format(within), str(body["name"])
    existing = _only(kind, name, [one for one in service.pages(path) if one["name"] == name])
    if existing is None:
        answer = service.request("POST", path, params={**query, "unless_named": True}, json=body)
        made: dict[str, Any] = answer.json()
        if answer.status_code != HTTPStatus.OK:
            return made
        existing = made  # somebody else has made it since
    if other := list(_differences(body, existing)):
        raise ClientError(
            f"the {kind.word} {name!r} is there already, and is not as stated:"
            f" {'; '.join(other[:MOST_NAMED])}. State what it has, change it, or give the new one"
            " another name",
            Exit.USAGE,
        )
    return existing


def find_id(service: Connection, kind: Kind, text: str, within: str | None = None) -> str:
    """The id of the one thing that a text means; an id is taken as it is, and the service judges
    it.

    Args:
        service: the connection.
        kind: of the thing.
        text: as `find` takes it.
        within: id of the one above, where only what belongs to that is meant.

    Raises:
        ClientError: as `find`.
    """
    return uuid_of(text) or str(find(service, kind, text, within)["id"])


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
            f"{text!r} is no id, expected one such as 0198c6a2-… or latest; `modalbase jobs` lists"
            " them",
            Exit.USAGE,
        )
    newest = next(service.pages("update-jobs", 1, **narrowed), None)
    if newest is None:
        raise ClientError(
            "there is no update job yet; `modalbase update CAMPAIGN --wait` makes one", Exit.USAGE
        )
    return str(newest["id"])


def uuid_of(text: str) -> str | None:
    """A UUID in the form that a path takes; None where the text is none, such as `../projects`,
    another path.
    """
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


def _only(kind: Kind, text: str, matching: Sequence[dict[str, Any]]) -> dict[str, Any] | None:
    """The one thing that matches a text; None where nothing does."""
    if len(matching) > 1:
        ids = ", ".join(one["id"] for one in matching[:MOST_NAMED])
        raise ClientError(
            f"{len(matching)} {kind.word}s are named {text!r}; state the id: {ids}", Exit.USAGE
        )
    return next(iter(matching), None)


def _differences(stated: Any, existing: Any, name: str = "") -> Iterator[str]:
    """What a thing has otherwise than stated; members and items that are not stated do not
    count.
    """
    if isinstance(stated, Mapping) and isinstance(existing, Mapping):
        for member, value in stated.items():
            yield from _differences(
                value, existing.get(member), f"{name}.{member}" if name else str(member)
            )
    elif (
        isinstance(stated, list | tuple)
        and isinstance(existing, list)
        and len(stated) == len(existing)
    ):
        for number, (one, other) in enumerate(zip(stated, existing, strict=True)):
            yield from _differences(one, other, f"{name}[{number}]")
    elif stated != existing and not _same_time(stated, existing):
        yield f"{name} is {shorten(existing)}, not {shorten(stated)}"


def _same_time(stated: Any, existing: Any) -> bool:
    """Whether two texts are one moment, which ISO 8601 writes in several ways."""
    try:
        return datetime.fromisoformat(stated) == datetime.fromisoformat(existing)
    except (TypeError, ValueError):
        return False


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
    return (
        f"{text!r} is no id, and no {kind.word} has that name; there is"
        f" {', '.join(repr(name) for name in close)}"
    )
