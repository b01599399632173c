"""Models that users send: a deck is kept as it came, a job reads it, and the structure's next version is that model."""

from __future__ import annotations

from collections.abc import Iterator
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import UUID

from sqlalchemy import Select, select
from sqlalchemy.orm import Session

from modalbase.formats.models.units import units_of
from service.access import Lookup, User
from service.compute.models.keeping import model_of
from service.compute.models.reading import DeckInputs, DeckOutput, faults_of, read_deck, require_deck
from service.errors import Conflict, Damaged, Invalid
from service.jobs.kinds import CORE_LIBRARIES
from service.jobs.resource import JobNoun
from service.store.storage import book
from service.store.storage.originals import copy_original, keep_original, write_original
from service.store.structures.operations import (
    Structure,
    StructureModel,
    StructureVersion,
    current_version,
    structure_for,
    take_model,
)

if TYPE_CHECKING:
    from modalbase.formats.models.matrices import MatrixModel
    from modalbase.formats.models.model import FiniteElementModel
    from service.web.uploads import Spooled


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
        row.document, row.arrays, row.arrays_sha256 = output.document, output.arrays, sha256(output.arrays).digest()
        session.flush()
        take_model(session, structure.id, row.id)


model_for = Lookup(StructureModel, "model", "structure_id", structure_for)
MODELS = JobNoun("models", model_for, _load, read_deck, _store, libraries=CORE_LIBRARIES)


def start_model(
    session: Session, user: User, structure_id: UUID, file: Spooled, wanted: StructureModel
) -> StructureModel:
    """Keep a deck and queue its reading, in one transaction.

    Raises:
        Invalid: there is no file, it has no name or one whose end says no deck, or its units are none.
        QuotaExceeded: the project has no room for the file.
    """
    structure = structure_for(session, user, structure_id, "editor", lock=True)
    if file.size == 0:
        raise Invalid("", "the body is empty, expected a deck")
    if not wanted.filename:
        raise Invalid("filename", "is missing: its end says which kind of deck it is")
    require_deck(wanted.filename)
    if (units := wanted.units) is not None:
        faults_of(lambda: units_of(units))
    wanted.structure_id, wanted.sha256 = structure.id, file.sha256
    book(session, structure_for, structure, "files", file.size)
    keep_original(session, file)
    return MODELS.start(session, user, wanted, sha256=file.sha256.hex())


def model_of_structure(session: Session, structure: Structure) -> StructureModel:
    """The model that a structure is in its current version.

    Raises:
        Conflict: it is none.
    """
    key = current_version(session, structure).model
    if key is None:
        raise Conflict("the structure is no model: POST /structures/{id}/model sends a deck")
    return session.get_one(StructureModel, key)


def load_model(session: Session, key: UUID) -> FiniteElementModel | MatrixModel:
    """A model in SI, of elements or of matrices, whoever asks.

    Raises:
        Damaged: what was stored is not what was read.
    """
    row = session.get_one(StructureModel, key)
    assert row.arrays is not None, "a version refers to a model that was read"
    assert row.arrays_sha256 is not None, "arrays are stored with their digest"
    if sha256(row.arrays).digest() != row.arrays_sha256:
        raise Damaged("model", row.arrays_sha256)
    return model_of(row.arrays)


def deck_of(session: Session, key: UUID) -> tuple[str, str | None, bytes]:
    """Name, units and bytes of a model's deck, whoever asks; a mesh may state its units itself.

    Raises:
        Damaged: what was stored is not what was sent.
    """
    row = session.get_one(StructureModel, key)
    buffer = BytesIO()
    copy_original(session, row.sha256, buffer)
    return row.filename, row.units, buffer.getvalue()


def said_of_deck(session: Session, key: UUID) -> dict[str, Any]:
    """What was said of a model's deck beside its units, whoever asks: cards that may be left out, and sections of a mesh."""
    row = session.get_one(StructureModel, key)
    return {"accepted": list(row.accepted), "sections": row.sections}


def model_in_short(session: Session, key: UUID) -> dict[str, Any]:
    """The file of a model, and its sets, whoever asks."""
    row = session.get_one(StructureModel, key)
    assert row.document is not None, "a version refers to a model that was read"
    return {"filename": row.filename, "sets": row.document["sets"]}


def sets_of(session: Session, structure: Structure) -> list[str]:
    """Names of a structure's sets, whoever asks; a strip or plate has none."""
    version = current_version(session, structure)
    if version.model is not None:
        return [each["name"] for each in model_in_short(session, version.model)["sets"]]
    return sorted((version.shape or {}).get("walls", ()))


def versions_of_models(session: Session, keys: list[UUID]) -> dict[UUID, int]:
    """Numbers of the first versions that are these models."""
    query = select(StructureVersion.model, StructureVersion.number).where(StructureVersion.model.in_(keys))
    latest_first = session.execute(query.order_by(StructureVersion.number.desc()))
    return {key: number for key, number in latest_first if key is not None}


def models_files() -> Select[bytes]:
    """SHA-256 of the decks of all models, as part of a query."""
    return select(StructureModel.sha256)
