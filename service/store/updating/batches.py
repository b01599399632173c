"""Many updates in one call: a Friday evening's campaigns are queued together, or none of them is."""

from __future__ import annotations

from uuid import UUID

from pydantic import Field
from sqlalchemy import func, select
from sqlalchemy.orm import Session

from fecore.errors import FecoreError, InputError
from service.access import User
from service.errors import Fault, Invalid, NotFound, ServiceError, pointer
from service.jobs.queue import one_at_a_time
from service.store.updating.joint_schemas import JointUpdateOut
from service.store.updating.operations import start_update
from service.store.updating.schemas import RecipeIn, UpdateJobOut
from service.store.updating.tables import UpdateJob
from service.web import Name, StrictModel

SEPARATOR = "\x1f"  # cannot stand in a header, so a batch's keys never meet those of single jobs


class BatchJobIn(StrictModel):
    """One update of a batch."""

    campaign_id: UUID
    recipe: RecipeIn | None = Field(None, description="default: the batch's recipe")
    specimen: Name | None = Field(
        None, description="of a joint update: campaigns of one specimen share its dimensions; default: the structure"
    )
    angle_deg: float | None = Field(
        None,
        ge=-360,
        le=360,
        description="of a joint update: of the material's x axis from the specimen's; default: that of a laminate whose plies "
        "lie alike, else 0",
    )


class UpdateBatchIn(StrictModel):
    """Updates to queue together, or one joint update of campaigns of one material."""

    recipe: RecipeIn | None = Field(None, description="of the jobs that have none of their own; default: {}")
    jobs: list[BatchJobIn] = Field(min_length=1, max_length=1000)
    joint: bool = Field(
        False,
        description="one posterior of the material from all campaigns: its constants are shared; geometry, density and angle "
        "are each specimen's own, the length and the clamp each campaign's",
    )
    scatter: float | None = Field(
        None,
        ge=0,
        le=1,
        description="of a joint update: scale of the moduli's scatter between specimens; default 0.02; 0: none",
    )
    coupon_batches: list[UUID] = Field(
        default_factory=list, max_length=20, description="of a joint update: coupons of the same material, as data"
    )


class UpdateBatchOut(StrictModel):
    """The jobs of a batch, in its order; or the joint update, and no items."""

    items: list[UpdateJobOut]
    joint: JointUpdateOut | None = None


def start_batch(
    session: Session, user: User, batch: UpdateBatchIn, idempotency_key: str | None, priority: int
) -> list[UpdateJob]:
    """Queue every update of a batch, in the caller's transaction. The same key and body again: the jobs that are there.

    Raises:
        Invalid: some of them cannot be; each fault with its pointer into the batch. Or the key came with another body.
    """
    _refuse_what_is_joint(batch)
    common = batch.recipe or RecipeIn.model_validate({})
    wanted = [(job.campaign_id, job.recipe or common) for job in batch.jobs]
    if idempotency_key is not None:
        one_at_a_time(session, f"{user.id} {idempotency_key}")
        if known := _known(session, _prefix(user, idempotency_key)):
            sent = [(campaign_id, recipe.model_dump(mode="json")) for campaign_id, recipe in wanted]
            if [(row.campaign_id, row.recipe) for row in known] != sent:
                raise Invalid("Idempotency-Key", "was used for another request; use a new key for a new batch")
            return known
    rows: list[UpdateJob] = []
    faults: list[Fault] = []
    for index, (campaign_id, recipe) in enumerate(wanted):
        key = None if idempotency_key is None else f"{_prefix(user, idempotency_key)}{index:04}"
        try:
            rows.append(start_update(session, user, campaign_id, recipe, key, priority))
        except (ServiceError, FecoreError) as error:
            faults += _placed(error, index)
    if faults:
        raise Invalid(faults)
    return rows


def _refuse_what_is_joint(batch: UpdateBatchIn) -> None:
    """Members that only a joint update knows are not left out in silence."""
    faults = [
        Fault(f"/jobs/{n}/{name}", "belongs to a joint update; state `joint` too")
        for n, job in enumerate(batch.jobs)
        for name in ("specimen", "angle_deg")
        if getattr(job, name) is not None
    ]
    faults += [
        Fault(f"/{name}", "belongs to a joint update; state `joint` too")
        for name in ("scatter", "coupon_batches")
        if getattr(batch, name) not in (None, [])
    ]
    if faults:
        raise Invalid(faults)


def _prefix(user: User, key: str) -> str:
    return f"{user.id}{SEPARATOR}{key}{SEPARATOR}"


def _known(session: Session, prefix: str) -> list[UpdateJob]:
    query = select(UpdateJob).where(func.starts_with(UpdateJob.idempotency_key, prefix))
    return list(session.scalars(query.order_by(UpdateJob.idempotency_key)))


def _placed(error: ServiceError | FecoreError, index: int) -> list[Fault]:
    """The faults of one job, with pointers into the batch."""
    at = f"/jobs/{index}"
    if isinstance(error, NotFound):
        return [Fault(f"{at}/campaign_id", str(error))]
    if isinstance(error, Invalid):
        return [Fault(f"{at}/recipe{fault.pointer}", fault.detail) for fault in error.faults]
    if isinstance(error, InputError):
        return [Fault(f"{at}/recipe{pointer(error.field.split('.'))}", error.message)]
    return [Fault(at, str(error))]
