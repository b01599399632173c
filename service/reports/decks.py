"""The updated model as a deck of a finite element program, and the user's own deck with the numbers
of a result.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from hashlib import sha256
from typing import TYPE_CHECKING, Any, Literal
from uuid import UUID

import numpy as np
from sqlalchemy.orm import Session

from fecore import __version__
from fecore.dynamics.laws import LAWS
from fecore.updating.parameters import parametrise
from modalbase.formats.decks import Deck, Mass, write_nastran, write_shells, write_solids
from modalbase.formats.models.matrices import MatrixModel
from modalbase.formats.models.write import WRITTEN
from service.compute.models.decks import DeckOrder
from service.nouns.campaigns.operations import campaign_of
from service.nouns.campaigns.schemas import Instruments
from service.nouns.frfs.data import specimen_points
from service.nouns.frfs.operations import frfs_of
from service.nouns.structures.models import deck_of, load_model, model_for
from service.nouns.structures.operations import describe_version, version_of
from service.nouns.updates.bodies import body_of, recipe_parameters
from service.nouns.updates.operations import result_document
from service.nouns.updates.schemas import RecipeIn
from service.platform.errors import Conflict, Invalid

if TYPE_CHECKING:
    from service.nouns.updates.tables import UpdateJob

Program = Literal["calculix", "abaqus", "nastran"]
Element = Literal["solid", "shell"]

SPARE = 12
"""Modes beyond twice those of the result: rigid motions, and motions in the plane, which an update
does not know.
"""

WRITERS: dict[tuple[Program, Element], Callable[[Deck], str]] = {
    ("calculix", "solid"): write_solids,
    ("calculix", "shell"): lambda deck: write_shells(deck, corrected=True),
    ("abaqus", "solid"): write_solids,
    ("abaqus", "shell"): write_shells,
    ("nastran", "shell"): write_nastran,
}
USUAL: dict[Program, Element] = {"calculix": "solid", "abaqus": "shell", "nastran": "shell"}
SUFFIXES: dict[Program, str] = {"calculix": "inp", "abaqus": "inp", "nastran": "bdf"}


NO_DECK_OF_A_SHAPE = (
    "this body in space is a shape, of which no deck is written: its mesh is at GET"
    " /structures/{id}/model/mesh?format=uff (or vtu), and the constants of its walls are the"
    " result's parameters"
)


def written_deck(
    session: Session, job: UpdateJob, program: Program, element: Element | None
) -> str:
    """The deck of a job's updated model, as text.

    Raises:
        Conflict: the job has no result, or none that a deck can hold.
        Invalid: the program has no deck of such elements here.
    """
    writer = WRITERS.get((program, element or USUAL[program]))
    if writer is None:
        raise Invalid(
            "element",
            f"there is no {program} deck of {element}s; there is one of {USUAL[program]}s",
        )
    return writer(updated_deck(session, job))


def updated_deck(session: Session, job: UpdateJob) -> Deck:
    """What a deck says of a job's updated model: the structure as it was when the job was queued,
    with its estimates.

    Raises:
        Conflict: the job has no result, no elastic constants, or elastic supports.
    """
    document = result_document(session, job)
    recipe = RecipeIn.model_validate(job.recipe)
    if recipe.springs:
        names = ", ".join(spring.name for spring in recipe.springs)
        raise Conflict(
            f"a deck cannot hold the recipe's elastic supports ({names}); update without them, and"
            " add them by hand"
        )
    if recipe.zones_m:
        raise Conflict(
            "a deck cannot hold the recipe's zones of other stiffness; update without them"
        )
    campaign = campaign_of(session, job.campaign_id)
    structure = describe_version(version_of(session, job.structure_version_id), "")
    if structure.model is not None:
        raise Conflict(
            "this body in space is a deck that was sent: GET /update-jobs/{id}/deck is it with the"
            " updated numbers"
        )
    if structure.shape is not None:
        raise Conflict(NO_DECK_OF_A_SHAPE)
    specimen = body_of(structure, campaign.boundary, recipe).one_layer
    if specimen is None:
        raise Conflict(
            "a deck describes one homogenised layer of one thickness; this structure has constants"
            " of plies, plies of unlike density, or pieces"
        )
    estimates = {row["name"]: row["estimate"] for row in document["parameters"]}
    parametrisation = parametrise(specimen, recipe_parameters(session, recipe, specimen)[0])
    if lacking := [name for name in parametrisation.names if estimates.get(name) is None]:
        names = ", ".join(lacking)
        raise Conflict(f"the result has no {names}: no elastic constants were estimated")
    theta = np.array([estimates[name] for name in parametrisation.names])
    constants = map(float, parametrisation.constants(theta))
    c = dict(zip(parametrisation.constant_names, constants, strict=True))
    sensor, remark = _sensor(session, job, document)
    added = Instruments.model_validate(campaign.instruments).added_masses
    masses = (*sensor, *(Mass(each.x_m, each.y_m, each.mass_kg) for each in added))
    alpha_beta = _alpha_beta(document)
    axes = "SI units: m, kg, s, N, Pa; x along the length from the first edge, z out of plane"
    job_line, digest, *verdict = origin(job, document)
    remarks = [job_line, digest, axes, *verdict, *([] if remark is None else [remark])]
    if any(each.rotary_inertia_kg_m2 for each in added):
        remarks.append("the added masses are points: their rotary inertia is not in the deck")
    if alpha_beta is None:
        remarks.append(f"no {_STATED} damping: the result has another law, or none")
    return Deck(
        length=c["length"],
        width=c["width"],
        thickness=c["thickness"],
        moduli=(c["Ex"], c["Ey"], c["Gxy"], c["Gxz"], c["Gyz"]),
        nu_xy=c["nu_xy"],
        density=c["density"],
        boundary=campaign.boundary,
        modes=2 * len(document["modes"]) + SPARE,
        alpha_beta=alpha_beta,
        masses=masses,
        remarks=tuple(remarks),
    )


def origin(job: UpdateJob, document: dict[str, Any]) -> list[str]:
    """Where a deck comes from, and what is said of its result."""
    digest = sha256(json.dumps(document, sort_keys=True).encode()).hexdigest()
    verdict = document.get("verdict") or {}
    return [
        f"modalbase {__version__}: the updated model of update job {job.id}",
        f"result SHA-256 {digest}",
        *([str(verdict["sentence"])] if "sentence" in verdict else []),
    ]


_STATED = " or ".join(name.capitalize() for name, row in LAWS.items() if row.alpha_beta)
"""The laws that a deck can state."""


def _alpha_beta(document: dict[str, Any]) -> tuple[float, float] | None:
    """ALPHA and BETA of the first law that a deck can state."""
    stated = (
        LAWS[law["name"]].in_deck(law["coefficients"])
        for law in document["damping_models"]
        if law["name"] in LAWS
    )
    return next((pair for pair in stated if pair is not None), None)


def _sensor(
    session: Session, job: UpdateJob, document: dict[str, Any]
) -> tuple[tuple[Mass, ...], str | None]:
    """The sensor where it stayed at a point, as the update had it; and a remark where it moved."""
    campaign = campaign_of(session, job.campaign_id)
    instruments = Instruments.model_validate(campaign.instruments)
    if not instruments.sensor_mass_kg:
        return (), None
    point = instruments.sensor_point
    if point is None:
        used = frfs_of(session, [UUID(frf["id"]) for frf in document["provenance"]["frfs"]])
        points = {frf.response_point for frf in used}
        if len(points) != 1:
            return (), "the sensor moved with the response: its mass is not in the deck"
        point = points.pop()
    x, y, _ = specimen_points(session, campaign)[point]
    return (Mass(x, y, instruments.sensor_mass_kg),), None


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
            "no deck was sent as this structure's model: GET /update-jobs/{id}/cards writes one of"
            " a strip or plate"
        )
    document = result_document(session, job)
    constants = _constants(document)
    if not constants:
        raise Conflict("the result has no elastic constants, so the deck stays as it is")
    model, row = load_model(session, key), model_for.row(session, key)
    if isinstance(model, MatrixModel):
        raise Conflict(
            "the structure is matrices, which stay as they are: multiply each by its factor of the"
            " result"
        )
    if model.format not in WRITTEN or row.units is None:
        raise Conflict(
            f"{row.filename} is a mesh without properties, which has no numbers to update: the"
            " result has them"
        )
    return DeckOrder(
        content=deck_of(session, row),
        filename=row.filename,
        units=row.units,
        boundary=campaign_of(session, job.campaign_id).boundary,
        constants=constants,
        modes=min(len(document["modes"]), MOST_MODES),
        with_joints=job.recipe.get("junctions") != "off",
        remarks=(
            *origin(job, document),
            f"numbers in {row.units}; each that was updated has a comment",
        ),
    )


def _constants(document: dict[str, Any]) -> dict[str, float]:
    """Estimates by name, SI: those of the recipe, and of the inputs that moved with them."""
    steps = document["convergence"]
    inputs = steps[-1]["parameters"] if steps else {}
    values = {row["name"]: row["estimate"] for row in document["parameters"] if "." in row["name"]}
    return {**inputs, **values} if values else {}
