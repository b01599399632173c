"""Many campaigns in one call: their updates are queued together or none of them is; or they are one
joint update.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from sqlalchemy.orm import Session

from fecore.body.constants import Body
from fecore.errors import FecoreError, InputError
from fecore.updating.campaigns import check_material, check_temperatures
from fecore.updating.parameters import parametrise
from service.nouns.campaigns.operations import campaign_for
from service.nouns.coupons.operations import batch_for
from service.nouns.modes.operations import check_mode_set
from service.nouns.storage import require_room
from service.nouns.structures.operations import present_structure
from service.nouns.updates.bodies import coupon_constants, joint_body
from service.nouns.updates.operations import new_update
from service.nouns.updates.schemas import USUAL, UpdateBatchIn
from service.platform.access import User
from service.platform.errors import Fault, Invalid, NotFound, ServiceError, pointer
from service.tasks.update.loading import parameters_of
from service.tasks.update.task import JOINT_UPDATES, member_of, require_used, start_update

if TYPE_CHECKING:
    from service.nouns.updates.tables import UpdateJob


def start_batch(
    session: Session, user: User, batch: UpdateBatchIn, priority: int
) -> list[UpdateJob]:
    """Queue every update of a batch, in the caller's transaction.

    Raises:
        Invalid: some of them cannot be; each fault with its pointer into the batch.
    """
    _refuse_what_is_joint(batch)
    common = batch.recipe or USUAL
    rows: list[UpdateJob] = []
    faults: list[Fault] = []
    for index, job in enumerate(batch.jobs):
        try:
            if job.recipe is not None:
                require_used(session, user, job.campaign_id, job.recipe)
            rows.append(
                start_update(session, user, job.campaign_id, job.recipe or common, priority)
            )
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


_SINGLE_ONLY = (
    "springs",
    "zones_m",
    "damping_models",
    "hold_out",
    "posterior",
    "prior_from_coupon_batch",
    "method",
)
"""Members of a recipe that a joint update has no use for: they must be left at their defaults."""


def start_joint(session: Session, user: User, request: UpdateBatchIn, priority: int) -> UpdateJob:
    """Queue one update of several campaigns together, in the caller's transaction.

    Raises:
        Invalid: the request contradicts itself or names what is not the user's, each fault with its
            pointer.
    """
    faults: list[Fault] = []
    campaigns, projects, bodies, specimens, temperatures = [], set(), [], set(), []
    common = request.recipe or USUAL
    for number, job in enumerate(request.jobs):
        with pointing(faults, f"/jobs/{number}/campaign_id"):
            campaign = campaign_for(session, user, job.campaign_id, "editor")
            projects.add(campaign_for.project_of(session, campaign))
            specimens.add(job.specimen or campaign.structure_id)
            temperatures.append(campaign.temperature_c)
            version, structure = present_structure(session, campaign.structure_id)
            campaigns.append(member_of(campaign.id, version.id))
            bodies.append(joint_body(session, structure, campaign.boundary, common))
    if faults:
        raise Invalid(faults)
    faults += [
        *_faults(session, user, request, bodies[0]),
        *_faults_of_bodies(request, bodies, temperatures),
    ]
    if request.scatter and len(specimens) == 1:
        why = (
            "is between specimens, and all campaigns are of one; name the specimen of each job, or"
            " leave scatter out"
        )
        faults.append(Fault("/scatter", why))
    if len(projects) > 1:
        faults.append(
            Fault("/jobs", "belong to several projects; a joint update takes campaigns of one")
        )
    if faults:
        raise Invalid(faults)
    (project_id,) = projects
    row = new_update(
        project_id=project_id,
        recipe=common.model_dump(mode="json"),
        request=request.model_dump(mode="json"),
        campaigns=campaigns,
    )
    require_room(session, project_id)
    return JOINT_UPDATES.start(session, user, row, priority=priority)


def _faults(session: Session, user: User, request: UpdateBatchIn, body: Body) -> list[Fault]:
    """What is wrong with a request whose campaigns are the user's."""
    faults: list[Fault] = []
    if len(request.jobs) < 2:
        faults.append(Fault("/jobs", "has one campaign; a joint update takes two at least"))
    if len({job.campaign_id for job in request.jobs}) < len(request.jobs):
        faults.append(Fault("/jobs", "names a campaign twice"))
    if len(set(request.coupon_batches)) < len(request.coupon_batches):
        faults.append(Fault("/coupon_batches", "names a batch twice"))
    for number, key in enumerate(request.coupon_batches):
        with pointing(faults, f"/coupon_batches/{number}"):
            coupon_constants(
                body, batch_for.named(session, user, key, f"/coupon_batches/{number}").sets
            )
    recipes = [("/recipe", request.recipe)] + [
        (f"/jobs/{n}/recipe", job.recipe) for n, job in enumerate(request.jobs)
    ]
    for at, recipe in recipes:
        if recipe is None:
            continue
        with pointing(faults, at):
            recipe.inputs.to_core()
        faults += [
            Fault(f"{at}/{name}", "has no meaning in a joint update; leave it out")
            for name in _SINGLE_ONLY
            if getattr(recipe, name) != getattr(USUAL, name)
        ]
        faults += [
            Fault(f"{at}/{name}", "belong to the material: state them in the common `recipe`")
            for name in ("parameters", "junctions", "reference_temperature_c")
            if at != "/recipe" and getattr(recipe, name) != getattr(USUAL, name)
        ]
    for number, job in enumerate(request.jobs):
        if job.recipe is not None and job.recipe.mode_set is not None:
            at = f"/jobs/{number}/recipe/mode_set"
            with pointing(faults, at):
                check_mode_set(session, user, job.recipe.mode_set, job.campaign_id, at)
        if job.recipe is not None:
            try:
                require_used(session, user, job.campaign_id, job.recipe)
            except Invalid as error:
                faults += _placed(error, number)
    if request.recipe is not None and request.recipe.mode_set is not None:
        faults.append(
            Fault("/recipe/mode_set", "belongs to one campaign: state it in that job's recipe")
        )
    return faults


def _faults_of_bodies(
    request: UpdateBatchIn, bodies: Sequence[Body], temperatures: Sequence[float | None]
) -> list[Fault]:
    """Parameters that a body has not, temperatures that a reference needs, and what is asked of
    bodies in space that strips and plates alone have.
    """
    faults: list[Fault] = []
    recipe = request.recipe or USUAL
    parameters = parameters_of(recipe, bodies[0])
    with pointing(faults, "/recipe"):
        check_material(bodies[0], parameters)
        check_temperatures(parameters, bodies[0], temperatures, recipe.reference_temperature_c)
    for number, body in enumerate(bodies):
        if number and not faults:
            with pointing(faults, f"/jobs/{number}/campaign_id"):
                parametrise(body, parameters)
        if not body.shares_material and request.jobs[number].angle_deg is not None:
            faults.append(
                Fault(
                    f"/jobs/{number}/angle_deg",
                    "is of strips and plates; a body in space lies as it is stated",
                )
            )
    return faults


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
