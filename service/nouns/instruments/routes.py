"""Instruments: the table, what clients see of it, and the routes.

A campaign names an instrument by kind and serial number, as `instruments.sensor.serial`: one that
is registered later is that of earlier campaigns too. The calibration that counts for a campaign is
the last one before it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import datetime
from typing import Any, Literal
from uuid import UUID

from pydantic import Field, field_validator, model_validator
from sqlalchemy import ForeignKey, UniqueConstraint, func
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.platform.access import Lookup, User, api_router, project_for
from service.platform.access.nouns import NounRoutes
from service.platform.db.base import Base, Identified
from service.platform.errors import Conflict
from service.platform.web import Day, Name, RequestModel, Text, example, not_null, shown_as, wrong

router = api_router(tags=["instruments"])
Kind = Literal["hammer", "sensor", "analyser"]


class Instrument(Identified, Base):
    """An instrument with its calibrations, oldest first."""

    __tablename__ = "instruments"
    __table_args__ = (UniqueConstraint("project_id", "kind", "serial"),)

    project_id: Mapped[UUID] = mapped_column(ForeignKey("projects.id", ondelete="CASCADE"))
    kind: Mapped[str]
    serial: Mapped[str]
    model: Mapped[str]
    notes: Mapped[str]
    calibrations: Mapped[list[Any]]
    updated_at: Mapped[datetime] = mapped_column(server_default=func.now(), onupdate=func.now())
    deleted_at: Mapped[datetime | None]


class Calibration(RequestModel):
    """One calibration."""

    performed_on: Day
    valid_until: Day | None = Field(
        None, description="last day on which it counts; null where none is stated"
    )
    sensitivity: float | None = Field(None, description="in `unit`; null where it is not stated")
    unit: str = Field("", max_length=50, description="of the sensitivity, such as mV/N")
    certificate: str = Field("", max_length=200, description="its number, or where it lies")

    @field_validator("sensitivity")
    @classmethod
    def _of_something(cls, value: float | None) -> float | None:
        if value == 0:
            raise wrong("is 0; leave it out where it is not known")
        return value

    @model_validator(mode="after")
    def _in_order(self) -> Calibration:
        if self.valid_until is not None and self.valid_until < self.performed_on:
            raise wrong("valid_until is before performed_on")
        return self


class InstrumentIn(RequestModel):
    """An instrument as a client describes it."""

    model_config = example(
        kind="sensor",
        serial="30517",
        model="4507",
        calibrations=[{"performed_on": "2026-01-15", "valid_until": "2027-01-14"}],
    )

    kind: Kind
    serial: Name
    model: str = Field("", max_length=200)
    notes: Text = ""
    calibrations: list[Calibration] = Field([], max_length=200)


class InstrumentPatch(RequestModel):
    """Members to change; `calibrations` replaces the history, which the audit trail keeps."""

    model_config = example(notes="dropped in May")

    serial: Name | None = None
    model: str | None = Field(None, max_length=200)
    notes: Text | None = None
    calibrations: list[Calibration] | None = Field(None, max_length=200)

    _never_null = not_null("serial", "model", "notes", "calibrations")


class InstrumentOut(InstrumentIn):
    """An instrument."""

    id: UUID
    project_id: UUID
    created_at: datetime
    updated_at: datetime
    deleted_at: datetime | None


instrument_for = Lookup(Instrument, "instrument", "project_id")


def _describe(_: Session, rows: Sequence[Instrument]) -> Iterable[InstrumentOut]:
    return [shown_as(InstrumentOut, row) for row in rows]


nouns = NounRoutes(router, instrument_for, InstrumentOut, _describe, "instruments", "instrument_id")


def _create(session: Session, user: User, project_id: UUID, body: InstrumentIn) -> Instrument:
    row = Instrument(project_id=project_for(session, user, project_id, "editor").id)
    _state(session, user, row, "create", body.model_dump(mode="json"))
    return row


def _change(session: Session, user: User, row: Instrument, body: InstrumentPatch) -> None:
    _state(session, user, row, "change", body.model_dump(mode="json", exclude_unset=True))


def _state(session: Session, user: User, row: Instrument, act: str, stated: dict[str, Any]) -> None:
    """Give a row what is stated.

    Raises:
        Conflict: the project has another instrument of this kind and serial number.
    """
    if "calibrations" in stated:
        stated["calibrations"].sort(key=lambda one: one["performed_on"])
    try:
        with session.begin_nested():
            for name, value in stated.items():
                setattr(row, name, value)
            session.add(row)
    except IntegrityError:
        named = f"{stated.get('kind', row.kind)} {stated['serial']!r}"
        raise Conflict(
            f"the project has the {named} already; change that one, or restore it if it is deleted"
        ) from None
    session.refresh(row)
    instrument_for.note(session, user, row, act, **stated)


nouns.creating(
    "create_instrument",
    "Register a hammer, sensor or analyser. Campaigns that state its kind and serial number"
    " name it.",
    InstrumentIn,
    _create,
)
nouns.listing("list_instruments", "Instruments of a project, with their calibrations.", hides=True)
nouns.getting("get_instrument", "An instrument with its calibrations, oldest first.", tagged=True)
nouns.changing(
    "change_instrument",
    "Change an instrument: notes, serial number, a new calibration.",
    InstrumentPatch,
    _change,
)
nouns.deleting(
    "delete_instrument",
    "Hide an instrument: campaigns no longer name it. It stays stored and can be restored.",
)
nouns.restoring("restore_instrument", "Bring a deleted instrument back.")
