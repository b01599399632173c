"""Processings: the job that turns a campaign's records into FRFs, and what it keeps."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING
from uuid import UUID

from sqlalchemy.orm import Session

from fecore.errors import InputError
from fecore.signal import Averages
from service.compute.processing import ProcessingInputs
from service.nouns.campaigns.operations import campaign_for
from service.nouns.frfs.operations import store_processed
from service.nouns.records.operations import block_rows
from service.nouns.records.processings import (
    decisions,
    hits_in,
    keep_document,
    load_records,
    new_processing,
    processing_for,
)
from service.nouns.records.schemas import ProcessingIn
from service.nouns.storage import require_room
from service.platform.access import User
from service.platform.queue.kinds import CORE_LIBRARIES
from service.platform.queue.resource import JobNoun
from service.tasks.process.compute import process_records
from service.tasks.task import BareTask

if TYPE_CHECKING:
    from service.nouns.records.processings import Processing


def _load(session: Session, row: Processing, workspace: Path) -> ProcessingInputs:
    inputs = load_records(
        session, row.campaign_id, workspace, ProcessingIn.model_validate(row.options)
    )
    if inputs is None:
        raise InputError("campaign", "has no time blocks; POST records first")
    return inputs


def _store(session: Session, row: Processing, items: Iterator[Averages | str]) -> None:
    keys: list[UUID] = []
    for item in items:
        if isinstance(item, Averages):
            keys += store_processed(session, row.campaign_id, row.id, item)
        else:
            keep_document(session, row, json.loads(item), keys)


PROCESSINGS = JobNoun(
    "processings", processing_for, _load, process_records, _store, libraries=CORE_LIBRARIES
)


def start_processing(
    session: Session, user: User, campaign_id: UUID, body: ProcessingIn
) -> Processing:
    """Queue a processing of a campaign's records, in the caller's transaction.

    Raises:
        InputError: the band is empty, or an overrule means no hit.
        QuotaExceeded: the project has no room for FRFs.
    """
    campaign = campaign_for(session, user, campaign_id, "editor")
    body.processing()  # a wrong choice is refused before it is queued
    if body.overrules:
        decisions(body.overrules, hits_in(block_rows(session, campaign.id).values()))
    require_room(session, campaign_for.project_of(session, campaign))
    return PROCESSINGS.start(session, user, new_processing(campaign.id, body))


TASK = BareTask(PROCESSINGS)
