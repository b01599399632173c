"""Identifications: what a client may ask, the job that finds the modes of a campaign in its FRFs or
half spectra, and what it keeps.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from uuid import UUID

from pydantic import Field
from sqlalchemy import JSON, ForeignKey, Index
from sqlalchemy.orm import Mapped, Session, mapped_column

from fecore.errors import InputError
from fecore.modal import Options, StatedPole
from service.nouns.campaigns.operations import campaign_for
from service.nouns.frfs.data import load_measured_campaign
from service.nouns.frfs.operations import any_sent
from service.nouns.modes.operations import keep_identified
from service.nouns.modes.schemas import PolesIn
from service.nouns.recordings.operations import (
    beside_frfs,
    load_spectra,
    recordings_of,
)
from service.nouns.records.operations import has_records
from service.nouns.storage import require_room
from service.platform.access import Lookup, User
from service.platform.db.base import Base
from service.platform.queue.kinds import CORE_LIBRARIES
from service.platform.queue.resource import JobNoun
from service.platform.web import Name, RequestModel, example
from service.tasks.identify.compute import (
    IdentificationInputs,
    IdentificationOutput,
    find_modes,
)
from service.tasks.task import BareTask


class Identification(Base):
    """One identification of modes from a campaign's FRFs or half spectra; its key is its job's. Its
    mode set names it as `job_id`.
    """

    __tablename__ = "identifications"
    __table_args__ = (Index(None, "campaign_id", "id"),)

    id: Mapped[UUID] = mapped_column(ForeignKey("jobs.id", deferrable=True), primary_key=True)
    campaign_id: Mapped[UUID] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"))
    options: Mapped[dict[str, Any]]
    document: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))


class StatedPoleIn(RequestModel):
    """A pole to fit that a person sees in the FRFs."""

    frequency_hz: float = Field(gt=0, le=1e7, description="where the fit of it starts")
    damping_ratio: float | None = Field(
        None, gt=0, lt=1, description="where its fit starts; default: a line's width"
    )
    reason: str = Field(min_length=1, max_length=2000, description="why it is a mode")


class IdentificationIn(PolesIn, RequestModel):
    """How to identify; `{}` will do."""

    model_config = example()

    name: Name = "identified"
    include_doubtful: bool = Field(
        False, description="keep the uncertain poles, from probability 0.1 on, in the mode set too"
    )
    poles: list[StatedPoleIn] = Field(
        [],
        max_length=100,
        description="to fit beside those that the search finds; each is a mode of the set, whatever"
        " its probability",
    )

    def options(self) -> Options:
        """The core's options, the poles included."""
        stated = tuple(StatedPole(each.frequency_hz, each.damping_ratio) for each in self.poles)
        return replace(super().options(), poles=stated)


def _load(session: Session, row: Identification, _workspace: Path) -> IdentificationInputs:
    campaign = load_measured_campaign(session, row.campaign_id)
    spectra, loads = load_spectra(session, row.campaign_id)
    left = list[str]()
    if campaign.frf_sets:
        left = beside_frfs(spectra)
        others = has_records(session, row.campaign_id) or any_sent(session, row.campaign_id)
        spectra, loads = (), () if others else loads
    if not (campaign.frf_sets or spectra):
        raise InputError("campaign", campaign.without_frfs(_without_any(session, row.campaign_id)))
    request = IdentificationIn.model_validate(row.options)
    frfs = tuple(used.frfs for used in campaign.frf_sets)
    windows = [remark for used in campaign.frf_sets if not loads for remark in used.window_remark]
    return IdentificationInputs(
        frfs,
        spectra,
        loads,
        request.options(),
        request.include_doubtful,
        (*campaign.warnings, *left, *dict.fromkeys(windows)),
    )


def _without_any(session: Session, campaign_id: UUID) -> str:
    """What a campaign lacks that has neither FRFs nor half spectra."""
    if recordings_of(session, campaign_id):
        return "has recordings of responses without half spectra; process them first"
    return "has no FRFs; import some, or process its hits"


def _store(session: Session, row: Identification, items: Iterator[IdentificationOutput]) -> None:
    name = IdentificationIn.model_validate(row.options).name
    for output in items:
        row.document = output.document
        how: dict[str, Any] = {"job_id": row.id, "settings": row.options}
        if "poles" in row.options:
            how["decisions"] = [
                {"frequency_hz": hz, "keep": True, "reason": pole["reason"]}
                for hz, pole in zip(output.document["stated"], row.options["poles"], strict=True)
            ]
        keep_identified(session, row.campaign_id, name, output.modes, output.document, **how)


identification_for = Lookup(Identification, "identification", "campaign_id", campaign_for)
IDENTIFICATIONS = JobNoun(
    "identifications", identification_for, _load, find_modes, _store, libraries=CORE_LIBRARIES
)


def start_identification(
    session: Session, user: User, campaign_id: UUID, body: IdentificationIn
) -> Identification:
    """Queue an identification of a campaign's modes, in the caller's transaction.

    Raises:
        InputError: the band is empty.
        QuotaExceeded: the project has no room for modes.
    """
    campaign = campaign_for(session, user, campaign_id, "editor")
    body.options()  # a wrong band is refused before it is queued
    require_room(session, campaign_for.project_of(session, campaign))
    # without poles the settings are those of before there were any: the set takes an older's place
    options = body.model_dump(mode="json", exclude=None if body.poles else {"poles"})
    row = Identification(campaign_id=campaign.id, options=options)
    return IDENTIFICATIONS.start(session, user, row)


TASK = BareTask(IDENTIFICATIONS)
