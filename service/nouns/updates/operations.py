"""Updates as rows: which there are, and the result of one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any
from uuid import UUID

from sqlalchemy import Select, Text, cast, func, select
from sqlalchemy.orm import Session

from service.nouns.campaigns.operations import campaign_for, campaigns_in
from service.nouns.structures.operations import structure_for, structures_in
from service.nouns.updates.document import StoredArrays, is_current, require_current
from service.nouns.updates.result_schemas import CONSTANTS
from service.nouns.updates.tables import UpdateJob, UpdateResult
from service.platform.access import Lookup, User, project_for, projects_of
from service.platform.access.metadata_schema import require_metadata
from service.platform.errors import Conflict
from service.platform.queue.resource import JobState, require_result
from service.platform.queue.tables import Job
from service.platform.web import shown_as
from service.platform.web.bodies import Labels


def keep_result(
    session: Session, job: UpdateJob, document: dict[str, Any], prediction: bytes
) -> None:
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


def new_update(**stated: Any) -> UpdateJob:
    """A row to be."""
    return UpdateJob(**stated)


def updates_seen(
    session: Session,
    user: User,
    *,
    project: UUID | None,
    structure: UUID | None,
    campaign: UUID | None,
    states: Sequence[JobState] | None,
) -> Select[UpdateJob]:
    """The query of one's updates of one campaign each; those of deleted structures are left out."""
    query = select(UpdateJob).where(
        UpdateJob.campaign_id.in_(campaigns_in(structures_in(projects_of(user))))
    )
    if project is not None:
        query = query.where(UpdateJob.project_id == project_for(session, user, project).id)
    if structure is not None:
        query = query.where(
            UpdateJob.campaign_id.in_(campaigns_in([structure_for(session, user, structure).id]))
        )
    if campaign is not None:
        query = query.where(
            UpdateJob.campaign_id == campaign_for(session, user, campaign, deleted=True).id
        )
    if states is not None:
        query = query.join(Job, Job.id == UpdateJob.id).where(Job.state.in_(states))
    return query


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
    find = joint_update_for if row.joint else update_job_for
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
