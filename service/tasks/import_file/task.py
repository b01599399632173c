"""Imports: a file is kept as it came, a job reads it, and what it holds goes into its campaign."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING
from uuid import UUID

from sqlalchemy.orm import Session

from service.nouns.campaigns.operations import campaign_for, create_campaign, describe_anew
from service.nouns.frfs.operations import any_sent, quantities_of, writing_frfs
from service.nouns.imports.operations import (
    has_file,
    import_for,
    known_bytes,
    left_unread,
    same_bytes,
)
from service.nouns.modes.operations import newest_stated
from service.nouns.monitors.operations import note_complete
from service.nouns.records.operations import RecordIntake, has_records
from service.nouns.storage import book
from service.nouns.storage.originals import keep_original, original_sizes, write_original
from service.nouns.structures.operations import structure_for
from service.platform.access import User
from service.platform.db.base import one_at_a_time
from service.platform.errors import Conflict, Invalid
from service.platform.queue.kinds import REQUESTS
from service.platform.queue.resource import JobNoun
from service.tasks.import_file.compute import Kept, ReadingInputs, read_upload
from service.tasks.import_file.intake import Intake
from service.tasks.task import BareTask

if TYPE_CHECKING:
    from service.nouns.campaigns.schemas import CampaignIn
    from service.nouns.imports.operations import Import
    from service.platform.web.uploads import Spooled


def _load(session: Session, row: Import, workspace: Path) -> ReadingInputs:
    """Put the original on the worker's disk."""
    path = workspace / "original"
    write_original(session, row.sha256, path)
    stated = (row.quantity, row.filename, row.format, row.kind, row.mapping, row.dry_run)
    return ReadingInputs(path, *stated)  # type: ignore[arg-type]  # the columns hold what the route let in


def _store(session: Session, row: Import, items: Iterator[Kept]) -> None:
    """Take in a file. A dry run goes the same way and writes the report alone.

    Raises:
        Conflict: a grid point of the file lies elsewhere than the campaign has it.
        QuotaExceeded: the project has no room for what is in the file.
        PayloadTooLarge: more is in the file than one import may bring.
        Invalid: nothing at all of the file could be read.
    """
    # Imports into one campaign are stored one after the other, so that each sees the points of the
    # one before.
    one_at_a_time(session, str(row.campaign_id))
    size = original_sizes(session, [row.sha256])[row.sha256]
    with RecordIntake() as records:
        intake = Intake(session, row, size, records)
        with writing_frfs(session) as write_frf:
            for item in items:
                intake.take(item, write_frf)
        intake.finish()


IMPORTS = JobNoun("imports", import_for, _load, read_upload, _store)


def start_import(
    session: Session,
    user: User,
    campaign_id: UUID,
    file: Spooled,
    draft: Import,
    *,
    urgent: bool = False,
) -> tuple[Import, bool]:
    """Store the file and queue its reading, in one transaction.

    The same bytes are not read into a campaign twice: the import that has them, or is about to, is
    returned instead. Bytes that the campaign has as another quantity or kind are refused.

    Args:
        session: the request's transaction.
        user: who asks; an editor of the project at least.
        campaign_id: the campaign that takes the file.
        file: where it lies, with its SHA-256.
        draft: the row to be: what the client calls the file, and what to do with it.
        urgent: a request waits for it: it has a queue of its own, and is read also where the
            campaign has these bytes already.

    Returns:
        The import, and whether it is a new one.

    Raises:
        Conflict: the campaign has these bytes as another quantity or kind.
        QuotaExceeded: the project has no room for the file.
    """
    campaign = campaign_for(session, user, campaign_id, "editor", lock=True)
    draft.campaign_id, draft.sha256 = campaign.id, file.sha256
    if not draft.dry_run and (known := same_bytes(session, draft)) is not None:
        _require_alike(session, known, draft)
        if not urgent:
            return known, False
    if not has_file(session, campaign, file.sha256):
        book(session, campaign_for, campaign, "files", file.size)
    keep_original(session, file)
    queue = REQUESTS if urgent else None
    return IMPORTS.start(session, user, draft, queue=queue, sha256=file.sha256.hex()), True


def import_campaign(
    session: Session,
    user: User,
    structure_id: UUID,
    body: CampaignIn,
    file: Spooled,
    draft: Import,
    *,
    complete: bool,
) -> tuple[Import, bool]:
    """Make a campaign of a file alone and queue the file's reading, in one transaction.

    Bytes that a campaign of the structure has already make no second one: the import that has them
    is returned, also where it failed. A campaign of this name that a file of this name left empty, as
    it could not be read, takes the file and what is stated now.

    Args:
        session: the request's transaction.
        user: who asks; an editor of the project at least.
        structure_id: what was measured.
        body: the campaign.
        file: where it lies, with its SHA-256.
        draft: the import's row to be.
        complete: the file is all of the campaign, so that monitors need not wait for more.

    Returns:
        The import, and whether it is a new one.

    Raises:
        Invalid: neither the campaign nor the mapping states when it was performed.
        Conflict: a deleted campaign has these bytes.
        QuotaExceeded: the project has no room for the file.
    """
    structure = structure_for(session, user, structure_id, "editor", lock=True)
    if (known := known_bytes(session, structure.id, file.sha256)) is not None:
        return known, False
    recording = (draft.mapping or {}).get("recording")
    dated_by_file = isinstance(recording, dict) and recording.get("performed_at") is not None
    if body.performed_at is None and not dated_by_file:
        why = "is missing: state it, or mapping.recording.performed_at where the file states it"
        raise Invalid("campaign/performed_at", why)
    left = _left_empty(session, structure.id, body.name, draft.filename)
    campaign = (
        create_campaign(session, user, structure.id, body)
        if left is None
        else describe_anew(session, user, left, body)
    )
    if complete:
        note_complete(session, user, campaign, dated_by_file=dated_by_file)
    return start_import(session, user, campaign.id, file, draft)


def _left_empty(session: Session, structure_id: UUID, name: str, filename: str) -> UUID | None:
    """The campaign that a file that could not be read has left empty; None where there is none."""
    key = left_unread(session, structure_id, name, filename)
    if key is None or any_sent(session, key) or has_records(session, key):
        return None
    return None if newest_stated(session, [key]) else key


def _require_alike(session: Session, known: Import, draft: Import) -> None:
    """Refuse bytes that an import has read as something else than is stated now.

    Raises:
        Conflict: it has; names both, and the import.
    """
    quantities = [known.quantity] if known.quantity else quantities_of(session, known.id)
    for name, read in (("quantity", quantities), ("kind", [known.kind] if known.kind else [])):
        stated = getattr(draft, name)
        if stated is None or read == [stated]:
            continue
        state = (
            f"has read it as {' and '.join(read)}"
            if read
            else f"reads it without a stated {name}, or found none"
        )
        raise Conflict(
            f"{name} is {stated}, and import {known.id} ({known.filename}) {state}; where that is"
            f" wrong, DELETE /imports/{known.id} first, then send the file again"
        )


TASK = BareTask(IMPORTS)
