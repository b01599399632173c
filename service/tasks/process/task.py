"""Processings: the job that turns a campaign's hits into FRFs and its recordings of responses into
half spectra, and what it keeps.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from uuid import UUID

from sqlalchemy.orm import Session

from fecore.errors import InputError
from fecore.signal import Averages
from service.compute.responses import EncodedSpectra
from service.nouns.campaigns.operations import campaign_for
from service.nouns.frfs.operations import store_processed
from service.nouns.recordings.operations import (
    has_loads,
    keep_spectra,
    load_recordings,
    recordings_of,
    require_files,
)
from service.nouns.records.operations import block_rows, emptied_at, has_records
from service.nouns.records.processings import (
    decisions,
    hits_in,
    keep_document,
    load_records,
    new_processing,
    processing_for,
)
from service.nouns.records.schemas import CampaignProcessingIn
from service.nouns.storage import require_room
from service.platform.access import User
from service.platform.errors import Conflict, deleted_by_rule
from service.platform.queue.kinds import CORE_LIBRARIES
from service.platform.queue.resource import JobNoun
from service.tasks.process.compute import Measured, process_campaign
from service.tasks.task import BareTask

if TYPE_CHECKING:
    from service.nouns.records.processings import Processing


def _load(session: Session, row: Processing, workspace: Path) -> Measured:
    options = CampaignProcessingIn.model_validate(row.options)
    hits = load_records(session, row.campaign_id, workspace, options)
    responses = load_recordings(session, row.campaign_id, workspace, options)
    if hits is None and responses is None:
        raise InputError(
            "campaign",
            "has neither time blocks of hits nor recordings of responses; import some first",
        )
    undriven = [not each.loads for each in responses.recordings] if responses else []
    _require_used(options, hits is not None, undriven)
    return Measured(hits, responses)


def _require_used(options: CampaignProcessingIn, hits: bool, undriven: Sequence[bool]) -> None:
    """Refuse what is stated and not used.

    Args:
        options: what is stated.
        hits: whether the campaign has such.
        undriven: of each recording, whether it is of responses alone.

    Raises:
        InputError: it is of hits, or of responses, and the campaign has none; or references are
            stated, and every recording has its loads.
    """
    for stated, there, what in (
        (options.of_hits, hits, "hits"),
        (options.of_responses, undriven, "recordings of responses"),
    ):
        if stated and not there:
            raise InputError(stated[0], f"is of {what}, and the campaign has none; leave it out")
    if options.references is not None and not any(undriven):
        raise InputError(
            "references",
            "are of recordings of responses alone, and every recording of the campaign has its"
            " loads, which are the references; leave it out",
        )


def _store(
    session: Session, row: Processing, items: Iterator[Averages | EncodedSpectra | str]
) -> None:
    keys: list[UUID] = []
    for item in items:
        if isinstance(item, Averages):
            keys += store_processed(session, row.campaign_id, row.id, item)
        elif isinstance(item, EncodedSpectra):
            keep_spectra(session, row.campaign_id, row.id, item)
        else:
            keep_document(session, row, json.loads(item), keys)


PROCESSINGS = JobNoun(
    "processings", processing_for, _load, process_campaign, _store, libraries=CORE_LIBRARIES
)


def start_processing(
    session: Session, user: User, campaign_id: UUID, body: CampaignProcessingIn
) -> Processing:
    """Queue a processing of a campaign's hits and recordings, in the caller's transaction.

    Raises:
        InputError: the band is empty, an overrule means no hit, or what is stated is not used.
        QuotaExceeded: the project has no room for FRFs.
    """
    campaign = campaign_for(session, user, campaign_id, "editor")
    body.processing()  # a wrong choice is refused before it is queued
    if body.overrules:
        decisions(body.overrules, hits_in(block_rows(session, campaign.id).values()))
    recordings = recordings_of(session, campaign.id)
    require_files(recordings)
    if (gone := emptied_at(session, campaign.id)) is not None:
        why = deleted_by_rule("time blocks", gone)
        raise Conflict(f"the hits cannot be processed anew: {why}; their FRFs stay")
    hits = has_records(session, campaign.id)
    undriven = [not has_loads(row) for row in recordings]
    if hits or undriven:  # else an import may be on its way; the job says so
        _require_used(body, hits, undriven)
    require_room(session, campaign_for.project_of(session, campaign))
    return PROCESSINGS.start(session, user, new_processing(campaign.id, body))


TASK = BareTask(PROCESSINGS)
