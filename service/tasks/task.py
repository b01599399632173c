"""What a kind of job declares of itself. Routes, the scope of keys, headings of the documentation and
cards of pages are made of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from uuid import UUID

from sqlalchemy import JSON, ForeignKey
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.platform.access import User
from service.platform.queue.resource import JobNoun, JobOut
from service.platform.web import StrictModel


class Ordered:
    """Columns of a table of jobs: what was asked, and what was found when it was; its key is its
    job's.
    """

    id: Mapped[UUID] = mapped_column(ForeignKey("jobs.id", deferrable=True), primary_key=True)
    request: Mapped[dict[str, Any]]
    document: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))


@dataclass(frozen=True)
class Card:
    """How a kind of job stands on the page of its owner.

    Attributes:
        title: its heading.
        button: what starts one.
        rows: member of `found` that is a list, shown as a table; none where the task has a template
            of its own.
        columns: heading and member of each of its columns.
        template: its own, in its folder, in place of `task.html`.
    """

    title: str
    button: str
    rows: str = ""
    columns: tuple[tuple[str, str], ...] = ()
    template: str = "task.html"


@dataclass(frozen=True)
class BareTask:
    """A kind of job whose `routes.py` has all of its routes.

    Attributes:
        noun: its rows: inputs, computation, storage.
    """

    noun: JobNoun[Any]

    @property
    def kind(self) -> str:
        """What a person calls one."""
        return self.noun.find.kind

    @property
    def owner(self) -> str:
        """What it is of, such as a structure."""
        return self.noun.find.owner_key.removesuffix("_id")

    @property
    def folder(self) -> str:
        """The package that declares it."""
        return self.noun.kind.compute.__module__.rpartition(".")[0]


@dataclass(frozen=True)
class Task(BareTask):
    """A kind of job, whole: its routes, heading and card are made of what it declares.

    Attributes:
        about: heading of the documentation page, and its sentence.
        text: what `POST` does, for the documentation.
        request: body of `POST`.
        answer: how it is shown, with `found`.
        start: (session, user, key of the owner, body) -> the row.
        says: what its `GET` says besides how far it is.
        card: its place on a page.
    """

    about: tuple[str, str]
    text: str
    request: type[StrictModel]
    answer: type[JobOut]
    start: Callable[[Session, User, UUID, Any], Any]
    says: str
    card: Card
