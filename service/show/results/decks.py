"""The user's own deck with the numbers of a result."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sqlalchemy.orm import Session

from modalbase.formats.models.matrices import MatrixModel
from service.compute.models.decks import WRITERS, DeckOrder
from service.errors import Conflict
from service.show.results.cards import NO_DECK_OF_A_SHAPE, origin
from service.store.campaigns.operations import campaign_of
from service.store.structures.models import deck_of, load_model
from service.store.structures.operations import version_of
from service.store.updating.operations import result_document

if TYPE_CHECKING:
    from service.store.updating.tables import UpdateJob

MOST_MODES = 40  # that are listed in a deck's head


def deck_order(session: Session, job: UpdateJob) -> DeckOrder:
    """What the deck of a job's result is to say.

    Raises:
        Conflict: the structure is no model that was sent, or the result has no elastic constants.
    """
    version = version_of(session, job.structure_version_id)
    key = version.model
    if key is None and version.shape is not None:
        raise Conflict(NO_DECK_OF_A_SHAPE)
    if key is None:
        raise Conflict(
            "no deck was sent as this structure's model: GET /update-jobs/{id}/cards writes one of a strip or plate"
        )
    document = result_document(session, job)
    constants = _constants(document)
    if not constants:
        raise Conflict("the result has no elastic constants, so the deck stays as it is")
    model, (filename, units, content) = load_model(session, key), deck_of(session, key)
    if isinstance(model, MatrixModel):
        raise Conflict("the structure is matrices, which stay as they are: multiply each by its factor of the result")
    if model.format not in WRITERS or units is None:
        raise Conflict(f"{filename} is a mesh without properties, which has no numbers to update: the result has them")
    return DeckOrder(
        content=content,
        filename=filename,
        units=units,
        boundary=campaign_of(session, job.campaign_id).boundary,
        constants=constants,
        modes=min(len(document["modes"]), MOST_MODES),
        with_joints=job.recipe.get("junctions") != "off",
        remarks=(*origin(job, document), f"numbers in {units}; each that was updated has a comment"),
    )


def _constants(document: dict[str, Any]) -> dict[str, float]:
    """Estimates by name, SI: those of the recipe, and of the inputs that moved with them."""
    steps = document["convergence"]
    inputs = steps[-1]["parameters"] if steps else {}
    found = {row["name"]: row["estimate"] for row in document["parameters"] if "." in row["name"]}
    return {**inputs, **found} if found else {}
