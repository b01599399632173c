"""What can be done with update jobs and joint updates: start, look at, cancel, read the result."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any
from uuid import UUID

from sqlalchemy import Text, cast, func, select
from sqlalchemy.orm import Session

from fecore.errors import InputError
from fecore.updating.campaigns import check_temperatures
from service.compute.updating import UpdateOutput, compute_update
from service.nouns.campaigns.operations import campaign_for, campaign_of
from service.nouns.coupons.operations import batch_for
from service.nouns.frfs.operations import frf_extents
from service.nouns.modes.operations import keep_identified, mode_set_for
from service.nouns.records.processings import keep_processing
from service.nouns.storage import book, require_room
from service.nouns.structures.operations import present_structure
from service.nouns.structures.schemas import StructureIn
from service.nouns.updating.bodies import require_inputs
from service.nouns.updating.document import StoredArrays, is_current, require_current
from service.nouns.updating.document import describe as describe_result
from service.nouns.updating.loading import body_for, load_update, recipe_parameters
from service.nouns.updating.result_schemas import CONSTANTS
from service.nouns.updating.schemas import USUAL, RecipeIn
from service.nouns.updating.tables import UpdateJob, UpdateResult
from service.platform.access import Lookup, User
from service.platform.access.metadata_schema import require_metadata
from service.platform.errors import Conflict, Invalid
from service.platform.queue.kinds import CORE_LIBRARIES
from service.platform.queue.resource import JobNoun, require_result
from service.platform.queue.tables import Job
from service.platform.web import shown_as
from service.platform.web.bodies import Labels

if TYPE_CHECKING:
    from service.nouns.campaigns.operations import Campaign


def _store(session: Session, row: UpdateJob, items: Iterator[UpdateOutput]) -> None:
    for output in items:
        document = describe_result(
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
        if row.request is not None:
            book(session, joint_update_for, row, "results", size)
        else:
            book(session, campaign_for, campaign_of(session, row.campaign_id), "results", size)
        _keep(session, row, document, output.prediction)


def _keep(session: Session, job: UpdateJob, document: dict[str, Any], prediction: bytes) -> None:
    """Store a result, and what it is found by."""
    columns: dict[str, float | None] = {}
    others: dict[str, dict[str, float | None]] = {}
    for one in document["parameters"]:
        name, (low, high) = one["name"], one["interval_95"] or (None, None)
        values = {
            "estimate": one["estimate"],
            "sd": one["standard_deviation"],
            "low": low,
            "high": high,
        }
        if name in CONSTANTS:
            columns |= {
                f"{name}_{end}".lower().removesuffix("_estimate"): value
                for end, value in values.items()
            }
        else:
            others[name] = values
    stored = {
        "document": document,
        "prediction": prediction,
        "verdict": document["verdict"]["level"],
        **columns,
    }
    session.add(UpdateResult(id=job.id, campaign_id=job.campaign_id, constants=others, **stored))


update_job_for = Lookup(UpdateJob, "update job", "campaign_id", campaign_for, deleted_owner=True)
"""A job outlives its campaign's deletion."""
joint_update_for = Lookup(
    UpdateJob, "joint update", "project_id", among=UpdateJob.campaign_id.is_(None)
)
"""An update of several campaigns, which belongs to their project."""
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
    row = UpdateJob(
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
    if recipe.mode_set is not None and recipe.identification != USUAL.identification:
        raise Invalid(
            "/identification",
            "is of updates that find their modes; `mode_set` gives them: leave one out",
        )


def check_mode_set(
    session: Session, user: User, key: UUID, campaign_id: UUID, pointer: str
) -> None:
    """A mode set that a request names must be the user's and of the campaign.

    Raises:
        Invalid: it is not; the pointer says where it is named.
    """
    if mode_set_for.named(session, user, key, pointer).campaign_id != campaign_id:
        raise Invalid(pointer, f"{key} belongs to another campaign")


def check_prior_batch(
    session: Session, user: User, recipe: RecipeIn, structure_id: UUID, pointer: str
) -> None:
    """The coupon batch that a recipe takes its priors from must be the user's and of the
    structure's material.

    Raises:
        Invalid: it is not; the pointer says where the batch is named.
    """
    if recipe.prior_from_coupon_batch is not None:
        batch = batch_for.named(session, user, recipe.prior_from_coupon_batch, pointer)
        if batch.structure_id != structure_id:
            raise Invalid(pointer, f"{batch.id} belongs to another structure")


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


def require_no_update(session: Session, campaign_id: UUID, since: UUID) -> None:
    """Refuse what an update of a campaign may rest on.

    Args:
        session: the request's transaction.
        campaign_id: of the campaign.
        since: key of the job whose outcome later updates may have used.

    Raises:
        Conflict: names the first such update.
    """
    later = (
        select(Job.id)
        .join(UpdateJob, UpdateJob.id == Job.id)
        .where(
            Job.id > since,
            Job.state.in_(("queued", "running", "succeeded")),
            cast(UpdateJob.campaigns, Text).contains(str(campaign_id)),
        )
    )
    if (update := session.scalars(later.order_by(Job.id).limit(1)).first()) is not None:
        raise Conflict(
            f"update {update} of the campaign may rest on what the import brought; "
            "send the file to a campaign of its own, where it is read anew"
        )


def result_document(session: Session, row: UpdateJob) -> dict[str, Any]:
    """The result of an update: the JSON document of `docs/results.md`, of several campaigns that of
    `docs/campaigns-together.md`.

    Raises:
        Conflict: the job has none, yet or ever, or one that an earlier version stored; the message
            says which.
    """
    return require_current(_result(session, row).document)


def result_labels(session: Session, row: UpdateJob) -> Labels:
    """Tags and metadata of a result.

    Raises:
        Conflict: the job has none, yet or ever; the message says which.
    """
    return shown_as(Labels, _result(session, row))


def label_result(session: Session, user: User, row: UpdateJob, labels: Labels) -> None:
    """Give a result these tags and metadata in place of its own.

    Raises:
        Conflict: the job has no result.
        Invalid: they are not what the project demands.
    """
    result, stated = _result(session, row), labels.model_dump()
    require_metadata(session, row.project_id, "result", stated)
    result.tags, result.meta = labels.tags, labels.meta
    update_job_for.note(session, user, row, "label", **stated)


def _result(session: Session, row: UpdateJob) -> UpdateResult:
    find = update_job_for if row.request is None else joint_update_for
    return require_result(session, find, row, session.get(UpdateResult, row.id))


def result_arrays(session: Session, row: UpdateJob) -> StoredArrays:
    """The arrays that were stored beside a result: predicted FRFs and what belongs to them, each
    read when it is asked for.

    Raises:
        Conflict: the job has none, yet or ever; the message says which.
    """
    return require_result(session, update_job_for, row, arrays_of(session, row.id))


def arrays_of(session: Session, key: UUID) -> StoredArrays | None:
    """The same of an update job by its key; None where it has no result."""
    size = session.scalars(
        select(func.length(UpdateResult.prediction)).filter_by(id=key)
    ).one_or_none()
    return None if size is None else StoredArrays(session, key, size)


def result_documents(session: Session, keys: Sequence[UUID]) -> dict[UUID, dict[str, Any]]:
    """Results by update job; jobs without one of today's form are left out."""
    query = select(UpdateResult.id, UpdateResult.document).where(UpdateResult.id.in_(keys))
    return {key: document for key, document in session.execute(query) if is_current(document)}


def labelled_results(
    session: Session, campaign_id: UUID
) -> Iterator[tuple[UUID, dict[str, Any], dict[str, Any]]]:
    """The results of a campaign, oldest first: key of the update job, document as it was stored,
    tags and metadata.
    """
    query = (
        select(UpdateResult)
        .where(UpdateResult.campaign_id == campaign_id)
        .order_by(UpdateResult.id)
    )
    for row in session.scalars(query):
        yield row.id, row.document, {"tags": row.tags, "meta": row.meta}


def result_parts(
    session: Session, keys: Sequence[UUID], parts: Sequence[str]
) -> dict[UUID, dict[str, Any]]:
    """Members of results by update job, without reading the rest of the documents; jobs without a
    result of today's form are left out.
    """
    columns = [UpdateResult.document[part] for part in ("version", *parts)]
    rows = session.execute(select(UpdateResult.id, *columns).where(UpdateResult.id.in_(keys)))
    return {
        key: dict(zip(parts, values, strict=True))
        for key, version, *values in rows
        if is_current({"version": version})
    }
