"""What can be done with joint updates: start, look at, cancel, read the result."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from uuid import UUID

from sqlalchemy import select
from sqlalchemy.orm import Session

from fecore.errors import InputError
from fecore.updating.campaigns import check_material
from fecore.updating.parameters import parametrise
from service.access import Lookup, User, audit, project_for
from service.compute.joint_updating import JointOutput, compute_joint
from service.errors import Conflict, Fault, Invalid, NotFound, pointer
from service.jobs.kinds import CORE_LIBRARIES, JobKind
from service.jobs.queue import enqueue, one_at_a_time, request_cancel
from service.jobs.state import job_state, why_no_result
from service.jobs.tables import Job
from service.store.campaigns.operations import campaign_for
from service.store.coupons.operations import batch_for
from service.store.modes.operations import mode_set_for
from service.store.storage import StorageOwner, book, require_room
from service.store.structures.operations import present_structure
from service.store.updating.batches import UpdateBatchIn
from service.store.updating.bodies import nominal_specimen
from service.store.updating.document import describe_joint as describe_result
from service.store.updating.joint_loading import load_joint, of_its_material, parameters_of
from service.store.updating.joint_schemas import JointUpdateOut
from service.store.updating.schemas import RecipeIn
from service.store.updating.tables import JointUpdate


def _store(session: Session, job_id: UUID, items: Iterator[JointOutput]) -> None:
    row = session.get_one(JointUpdate, job_id)
    for output in items:
        document = describe_result(output.result, output.warnings, output.sources, output.provenance)
        book(session, StorageOwner(row.project_id), "results", len(json.dumps(document)))
        row.document = document


JOINT_UPDATE = JobKind("joint_update", load=load_joint, compute=compute_joint, store=_store, libraries=CORE_LIBRARIES)

_SINGLE_ONLY = ("springs", "zones_m", "damping_models", "hold_out", "posterior", "prior_from_coupon_batch", "method")
"""Members of a recipe that a joint update has no use for: they must be left at their defaults."""


def start_joint(
    session: Session, user: User, request: UpdateBatchIn, idempotency_key: str | None, priority: int
) -> JointUpdate:
    """Queue one update of several campaigns together, in the caller's transaction.

    Raises:
        Invalid: the request contradicts itself or names what is not the user's, each fault with its pointer; or the key came
            with another request.
        NotFound: there is no such campaign, or it is other people's.
        Forbidden: the user's role is too low.
    """
    sent = request.model_dump(mode="json")
    faults: list[Fault] = []
    campaigns, projects = [], set()
    for number, job in enumerate(request.jobs):
        with pointing(faults, f"/jobs/{number}/campaign_id"):
            campaign = campaign_for(session, user, job.campaign_id, "editor")
            projects.add(campaign_for.project_of(session, campaign))
            version, structure = present_structure(session, campaign.structure_id)
            campaigns.append({"campaign_id": str(campaign.id), "structure_version_id": str(version.id)})
            nominal_specimen(of_its_material(structure, number), campaign.boundary)
    if faults:
        raise Invalid(faults)
    faults += _faults(session, user, request)
    if len(projects) > 1:
        faults.append(Fault("/jobs", "belong to several projects; a joint update takes campaigns of one"))
    if faults:
        raise Invalid(faults)
    (project_id,) = projects
    if idempotency_key is not None:
        one_at_a_time(session, f"{project_id} joint {idempotency_key}")
        query = select(JointUpdate).where(
            JointUpdate.project_id == project_id, JointUpdate.idempotency_key == idempotency_key
        )
        if (known := session.scalars(query).one_or_none()) is not None:
            if UpdateBatchIn.model_validate(known.request).model_dump(mode="json") != sent:
                raise Invalid("Idempotency-Key", "was used for another request; use a new key for a new job")
            return known
    require_room(session, project_id)
    queued = enqueue(session, kind=JOINT_UPDATE, project_id=project_id, priority=priority)
    row = JointUpdate(
        id=queued.id, project_id=project_id, request=sent, campaigns=campaigns, idempotency_key=idempotency_key
    )
    session.add(row)
    session.flush()
    audit(session, user, "joint_update.create", "joint_update", row.id, project_id)
    return row


def _faults(session: Session, user: User, request: UpdateBatchIn) -> list[Fault]:
    """What is wrong with a request whose campaigns are the user's."""
    faults: list[Fault] = []
    if len(request.jobs) < 2:
        faults.append(Fault("/jobs", "has one campaign; a joint update takes two at least"))
    if len({job.campaign_id for job in request.jobs}) < len(request.jobs):
        faults.append(Fault("/jobs", "names a campaign twice"))
    for number, key in enumerate(request.coupon_batches):
        with pointing(faults, f"/coupon_batches/{number}"):
            batch_for.named(session, user, key, f"/coupon_batches/{number}")
    recipes = [("/recipe", request.recipe)] + [(f"/jobs/{n}/recipe", job.recipe) for n, job in enumerate(request.jobs)]
    default = RecipeIn.model_validate({})
    for at, recipe in recipes:
        if recipe is None:
            continue
        with pointing(faults, at):
            recipe.inputs.to_core()
        faults += [
            Fault(f"{at}/{name}", "has no meaning in a joint update; leave it out")
            for name in _SINGLE_ONLY
            if getattr(recipe, name) != getattr(default, name)
        ]
        if at != "/recipe" and recipe.parameters is not None:
            faults.append(Fault(f"{at}/parameters", "belong to the material: state them in the common `recipe`"))
    for number, job in enumerate(request.jobs):
        if job.recipe is not None and job.recipe.mode_set is not None:
            at = f"/jobs/{number}/recipe/mode_set"
            with pointing(faults, at):
                if mode_set_for.named(session, user, job.recipe.mode_set, at).campaign_id != job.campaign_id:
                    raise Invalid(at, f"{job.recipe.mode_set} belongs to another campaign")
    if request.recipe is not None and request.recipe.mode_set is not None:
        faults.append(Fault("/recipe/mode_set", "belongs to one campaign: state it in that job's recipe"))
    with pointing(faults, "/recipe"):
        _check_parameters(session, user, request)
    return faults


def _check_parameters(session: Session, user: User, request: UpdateBatchIn) -> None:
    parameters = parameters_of(request.recipe or RecipeIn.model_validate({}))
    check_material(parameters)
    first = campaign_for(session, user, request.jobs[0].campaign_id)
    structure = of_its_material(present_structure(session, first.structure_id)[1], 0)
    parametrise(nominal_specimen(structure, "free"), parameters)


@contextmanager
def pointing(faults: list[Fault], at: str) -> Iterator[None]:
    """Collect what is wrong with one part of the request as faults at its pointer."""
    try:
        yield
    except NotFound as error:
        faults.append(Fault(at, str(error)))
    except Invalid as error:
        faults += error.faults
    except InputError as error:
        inside = "" if at.endswith("campaign_id") else pointer(error.field.split("."))
        faults.append(Fault(f"{at}{inside}", error.message))


joint_update_for = Lookup(JointUpdate, "joint update", "project_id")
"""The joint update, if the user has at least a role in its project."""


def cancel_joint(session: Session, user: User, row: JointUpdate) -> None:
    """Ask for a joint update's end; one that has ended stays as it is.

    Raises:
        Forbidden: the user's role is too low.
    """
    project_for(session, user, row.project_id, "editor")
    request_cancel(session, row.id)
    audit(session, user, "joint_update.cancel", "joint_update", row.id, row.project_id)


def describe_joint(session: Session, row: JointUpdate) -> JointUpdateOut:
    """A joint update as clients see it, with the state of its job as it is now."""
    job = session.get_one(Job, row.id, populate_existing=True)
    return JointUpdateOut(
        **job_state(job), priority=job.priority, project_id=row.project_id, campaigns=row.campaigns, request=row.request
    )


def joint_document(session: Session, row: JointUpdate) -> dict[str, Any]:
    """The result of a joint update: the JSON document of `docs/campaigns-together.md`.

    Raises:
        Conflict: the job has none, yet or ever; the message says which.
    """
    if row.document is None:
        job = session.get_one(Job, row.id, populate_existing=True)
        raise Conflict(why_no_result("joint update", job))
    return row.document
