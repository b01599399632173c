"""Updates of one campaign or of several: what a request may ask, the job, and what is stored of it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any
from uuid import UUID

from sqlalchemy.orm import Session

from fecore.errors import InputError
from fecore.updating.campaigns import check_temperatures
from service.nouns.campaigns.operations import campaign_for, campaign_of
from service.nouns.frfs.operations import frf_extents
from service.nouns.modes.operations import check_mode_set, keep_identified
from service.nouns.recordings.operations import recordings_of
from service.nouns.records.operations import has_records
from service.nouns.records.processings import keep_processing
from service.nouns.storage import book, require_room
from service.nouns.structures.operations import present_structure
from service.nouns.updates.bodies import (
    body_for,
    check_prior_batch,
    recipe_parameters,
    require_inputs,
)
from service.nouns.updates.document import describe
from service.nouns.updates.operations import (
    joint_update_for,
    keep_result,
    new_update,
    update_job_for,
)
from service.nouns.updates.schemas import USUAL, RecipeIn
from service.platform.access import User
from service.platform.errors import Invalid
from service.platform.queue.kinds import CORE_LIBRARIES
from service.platform.queue.resource import JobNoun
from service.tasks.task import BareTask
from service.tasks.update.compute import UpdateOutput, compute_update
from service.tasks.update.loading import load_update

if TYPE_CHECKING:
    from service.nouns.campaigns.operations import Campaign
    from service.nouns.structures.schemas import StructureIn
    from service.nouns.updates.tables import UpdateJob


def _store(session: Session, row: UpdateJob, items: Iterator[UpdateOutput]) -> None:
    for output in items:
        document = describe(
            output.result,
            output.warnings,
            output.provenance,
            identification=output.identification,
            sources=output.sources,
        )
        if output.processing is not None and not frf_extents(session, row.campaign_id):
            options = RecipeIn.model_validate(row.recipe).processing
            done = keep_processing(session, row.id, row.campaign_id, options, output.processing)
            document["provenance"]["processing"] = str(row.id)
            document["provenance"]["frfs"] = [
                {"id": frf["id"], "records": frf["records"]} for frf in done["frfs"]
            ]
        if output.identified is not None:
            identification = document["identification"]
            settings = {part: row.recipe.get(part) for part in ("identification", "band_hz")}
            how: dict[str, Any] = {"job_id": row.id, "settings": settings}
            kept = keep_identified(
                session,
                row.campaign_id,
                "identified by an update",
                output.identified,
                identification,
                **how,
            )
            document["provenance"]["mode_set"] = str(kept.id)
        size = len(output.prediction) + len(json.dumps(document))
        if row.joint:
            book(session, joint_update_for, row, "results", size)
        else:
            book(session, campaign_for, campaign_of(session, row.campaign_id), "results", size)
        keep_result(session, row, document, output.prediction)


UPDATES = JobNoun(
    "update-jobs",
    update_job_for,
    load_update,
    compute_update,
    _store,
    "update",
    libraries=CORE_LIBRARIES,
)
JOINT_UPDATES = UPDATES.seen_at("joint-updates", joint_update_for)


def start_update(
    session: Session,
    user: User,
    campaign_id: UUID,
    recipe: RecipeIn,
    priority: int = 0,
) -> UpdateJob:
    """Queue an update, in the caller's transaction.

    Args:
        session: the request's transaction.
        user: who asks; an editor of the project at least.
        campaign_id: the campaign whose FRFs are fitted.
        recipe: all choices; `RecipeIn()` will do.
        priority: −100 to 100, among the waiting jobs of the project.

    Raises:
        Invalid: the recipe contradicts itself or names what is not this campaign's.
        InputError: the core does not take the recipe's parameters or band.
        QuotaExceeded: the project has no room for a result.
    """
    campaign = campaign_for(session, user, campaign_id, "editor")
    project_id = campaign_for.project_of(session, campaign)
    version, structure = present_structure(session, campaign.structure_id)
    _check(session, user, campaign, recipe)
    _check_parameters(session, recipe, structure, campaign)
    _check_data(session, recipe, campaign)
    require_room(session, project_id)
    row = new_update(
        project_id=project_id,
        campaign_id=campaign.id,
        structure_version_id=version.id,
        recipe=recipe.model_dump(mode="json"),
        campaigns=[member_of(campaign.id, version.id)],
    )
    return UPDATES.start(session, user, row, priority=priority)


def member_of(campaign_id: UUID, structure_version_id: UUID) -> dict[str, str]:
    """A campaign of an update, with the structure's version that it is computed with."""
    return {"campaign_id": str(campaign_id), "structure_version_id": str(structure_version_id)}


def _check(session: Session, user: User, campaign: Campaign, recipe: RecipeIn) -> None:
    """What the recipe names must be the user's and this campaign's."""
    if recipe.mode_set is not None:
        check_mode_set(session, user, recipe.mode_set, campaign.id, "/mode_set")
    check_prior_batch(session, user, recipe, campaign.structure_id, "/prior_from_coupon_batch")


def require_used(session: Session, user: User, campaign_id: UUID, recipe: RecipeIn) -> None:
    """Refuse what a request's recipe states and an update of the campaign does not use. A monitor's
    recipe is of campaigns to come, so this is asked of requests alone.

    Raises:
        Invalid: how time blocks become FRFs is stated, and the campaign has FRFs; or how modes are
            identified, beside the modes.
    """
    campaign = campaign_for(session, user, campaign_id, "editor")
    if recipe.processing != USUAL.processing and frf_extents(session, campaign.id):
        raise Invalid(
            "/processing",
            "is of campaigns with time blocks and no FRFs; this one has FRFs: leave it out",
        )
    if (
        recipe.processing != USUAL.processing
        and recordings_of(session, campaign.id)
        and not has_records(session, campaign.id)
    ):
        raise Invalid(
            "/processing",
            "is of campaigns with time blocks; this one has recordings of responses, which a"
            " processing of its own takes: leave it out",
        )
    if recipe.mode_set is not None and recipe.identification != USUAL.identification:
        raise Invalid(
            "/identification",
            "is of updates that find their modes; `mode_set` gives them: leave one out",
        )


def _check_parameters(
    session: Session, recipe: RecipeIn, structure: StructureIn, campaign: Campaign
) -> None:
    """A recipe that contradicts itself is refused before it is queued, with the core's message."""
    recipe.inputs.to_core()
    body = body_for(session, structure, campaign.boundary, recipe)
    require_inputs(recipe.inputs, body)
    parameters = recipe_parameters(session, recipe, body)[0]
    check_temperatures(parameters, body, [campaign.temperature_c], recipe.reference_temperature_c)
    if recipe.band_hz is not None and not recipe.band_hz[0] < recipe.band_hz[1]:
        raise InputError("band_hz", "expected its low end below its high end")
    if len(set(recipe.damping_models)) < len(recipe.damping_models):
        raise InputError("damping_models", "names a law twice")


def _check_data(session: Session, recipe: RecipeIn, campaign: Campaign) -> None:
    """What the recipe keeps of the FRFs must leave something to fit. Looks at axes and points,
    never at a spectrum.
    """
    rows = frf_extents(session, campaign.id)
    if not rows:
        return  # an import may be on its way; the job says so if nothing has come by then
    low, high = min(row.start_hz for row in rows), max(row.end_hz for row in rows)
    axes = f"the campaign's FRFs have lines from {low:g} to {high:g} Hz"
    first, last = recipe.band_hz or (low, high)
    if first > high or last < low:
        raise Invalid("/band_hz", f"{first:g} to {last:g} Hz holds no line; {axes}")
    if recipe.hold_out.band_hz is not None:
        from_hz, to_hz = recipe.hold_out.band_hz
        if from_hz <= max(first, low) and to_hz >= min(last, high):
            raise Invalid("/hold_out/band_hz", f"holds out every line that would be fitted; {axes}")
    if recipe.hold_out.points:
        points = set(recipe.hold_out.points)
        used = {point for row in rows for point in (row.response_point, row.reference_point)}
        if unknown := sorted(points - used):
            raise Invalid(
                "/hold_out/points", f"{', '.join(map(str, unknown))} have no FRF in this campaign"
            )
        if all(row.response_point in points or row.reference_point in points for row in rows):
            fixed = set.intersection(*({row.response_point, row.reference_point} for row in rows))
            if not fixed or points >= used:
                raise Invalid("/hold_out/points", "holds out every FRF, so nothing is left to fit")


TASK = BareTask(UPDATES)
