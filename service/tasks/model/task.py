"""Models that users send: a deck is kept as it came, a job reads it, and the structure's next
version is that model.
"""

from __future__ import annotations

from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING
from uuid import UUID

from sqlalchemy.orm import Session

from modalbase.formats.models.units import units_of
from service.compute.models.reading import faults_of, require_deck
from service.nouns.storage import book
from service.nouns.storage.originals import keep_original, write_original
from service.nouns.structures.models import model_for, same_model
from service.nouns.structures.operations import structure_for, take_model
from service.platform.access import User
from service.platform.errors import Invalid
from service.platform.queue.kinds import CORE_LIBRARIES
from service.platform.queue.resource import JobNoun
from service.tasks.model.compute import DeckInputs, DeckOutput, read_deck
from service.tasks.task import BareTask

if TYPE_CHECKING:
    from service.nouns.structures.operations import StructureModel
    from service.platform.web.uploads import Spooled


def _load(session: Session, row: StructureModel, workspace: Path) -> DeckInputs:
    """Put the deck on the worker's disk."""
    path = workspace / "deck"
    write_original(session, row.sha256, path)
    return DeckInputs(path, row.filename, row.units, tuple(row.accepted), row.sections)


def _store(session: Session, row: StructureModel, items: Iterator[DeckOutput]) -> None:
    """Keep what was read, and make it the structure's next version."""
    for output in items:
        structure = structure_for.row(session, row.structure_id)
        book(session, structure_for, structure, "files", len(output.arrays))
        row.document, row.arrays, row.arrays_sha256 = (
            output.document,
            output.arrays,
            sha256(output.arrays).digest(),
        )
        session.flush()
        take_model(session, structure.id, row.id)


MODELS = JobNoun("models", model_for, _load, read_deck, _store, libraries=CORE_LIBRARIES)


def start_model(
    session: Session, user: User, structure_id: UUID, file: Spooled, draft: StructureModel
) -> tuple[StructureModel, bool]:
    """Keep a deck and queue its reading, in one transaction.

    Where the structure is this model already, or is about to be, it is not read again.

    Returns:
        The model, and whether it is a new one.

    Raises:
        Invalid: there is no file, it has no name or one whose end says no deck, or its units are
            none.
        QuotaExceeded: the project has no room for the file.
    """
    structure = structure_for(session, user, structure_id, "editor", lock=True)
    if file.size == 0:
        raise Invalid("", "the body is empty, expected a deck")
    if not draft.filename:
        raise Invalid("filename", "is missing: its end says which kind of deck it is")
    require_deck(draft.filename)
    if (units := draft.units) is not None:
        faults_of(lambda: units_of(units))
    draft.structure_id, draft.sha256 = structure.id, file.sha256
    if (known := same_model(session, structure, draft)) is not None:
        return known, False
    book(session, structure_for, structure, "files", file.size)
    keep_original(session, file)
    return MODELS.start(session, user, draft, sha256=file.sha256.hex()), True


TASK = BareTask(MODELS)
