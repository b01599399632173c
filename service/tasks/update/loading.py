"""From stored rows to what the core takes: one campaign, or several of one material."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import UUID

from sqlalchemy.orm import Session

from fecore.body.constants import Body, Parameter
from fecore.body.supports import PointMass
from fecore.errors import InputError, within
from fecore.modal.recordings import without_window
from fecore.modes import MeasuredModes
from fecore.signal import HalfSpectra
from fecore.updating.campaigns import CampaignsRecipe, Coupon, usual_parameters
from fecore.updating.inputs import Inputs
from fecore.updating.measurement import Measurement
from fecore.updating.posterior import SCATTER
from service.compute.frame import Frame
from service.compute.processing import ProcessingInputs
from service.nouns.campaigns.operations import (
    campaign_of,
    campaigns_of,
    describe,
    of_the_test,
)
from service.nouns.coupons.operations import batch_for, summarise
from service.nouns.frfs.data import MeasuredCampaign, MeasuredFrfs, load_measured_campaign
from service.nouns.modes.operations import load_modes, loads_measured, window_taken_out
from service.nouns.recordings.operations import load_spectra, recordings_of
from service.nouns.records.processings import load_records
from service.nouns.structures.operations import describe_version, version_of
from service.nouns.structures.schemas import StructureIn
from service.nouns.updates.bodies import (
    body_for,
    coupon_constants,
    is_in_space,
    joint_body,
    recipe_parameters,
)
from service.nouns.updates.schemas import USUAL, BatchJobIn, InputsIn, RecipeIn, UpdateBatchIn
from service.platform.queue.child import PURGED
from service.platform.queue.process import ChildEnded
from service.tasks.update.compute import Hits, LoadedCampaign, Together, UpdateInputs

if TYPE_CHECKING:
    from service.nouns.updates.tables import UpdateJob


def load_update(session: Session, job: UpdateJob, workspace: Path) -> UpdateInputs:
    """Everything that a queued update needs.

    Raises:
        InputError: the campaign has neither FRFs nor time blocks, or its contents do not fit
            together; one of several cannot be taken together with the others.
        ChildEnded: one of several campaigns was purged since.
    """
    if job.request is not None:
        return _load_together(session, job, UpdateBatchIn.model_validate(job.request))
    recipe = RecipeIn.model_validate(job.recipe)
    campaign = _as_of(session, job.campaign_id, job.structure_version_id)
    records, spectra = None, tuple[HalfSpectra, ...]()
    if not campaign.frf_sets and recipe.mode_set is None:
        records = load_records(session, job.campaign_id, workspace, recipe.processing)
        if records is None:
            spectra, _ = load_spectra(session, job.campaign_id)
        else:
            campaign = _with_sensor_of(campaign, records)
        if records is None and not spectra:
            raise InputError("campaign", campaign.without_frfs(_without_any(session, campaign)))
    used, modes, inputs = _measured(session, campaign, recipe)
    body = body_for(
        session, campaign.structure, campaign.boundary, recipe, carried_masses(campaign)
    )
    parameters, prior_warnings = recipe_parameters(session, recipe, body)
    core = inputs.to_core()
    left_in = used.window_remark if used is not None and core.window_rate is None else []
    hits = None
    if records is not None:
        roving, warm = _roving_over(campaign), campaign.temperature_c
        hits = Hits(records, campaign.points, campaign.frame, roving, core, warm)
    loaded = LoadedCampaign(
        body=body,
        measurement=(
            _measurement(
                campaign,
                used,
                modes,
                core,
                roving_mass(campaign),
                spectra=spectra,
                loads_measured=recipe.mode_set is None or loads_measured(session, recipe.mode_set),
            )
            if records is None
            else None
        ),
        hits=hits,
        recipe=replace(recipe.to_core(), parameters=parameters),
        warnings=(*campaign.warnings, *_left_out(campaign), *left_in, *prior_warnings),
        provenance=_provenance(job, campaign, used)
        | {
            "inputs": inputs.model_dump(mode="json"),
            "test": of_the_test(describe(campaign_of(session, job.campaign_id))),
        },
    )
    return UpdateInputs((loaded,))


def _without_any(session: Session, campaign: MeasuredCampaign) -> str:
    """What a campaign lacks that has neither FRFs, time blocks nor half spectra."""
    if recordings_of(session, campaign.campaign_id):
        return (
            "has recordings of responses that are not processed; POST a processing first, or name a"
            " mode set in the recipe"
        )
    return (
        "has no FRFs and no time blocks; import a UFF file or POST records first, or name a mode set"
        " in the recipe"
    )


def _measurement(
    campaign: MeasuredCampaign,
    used: MeasuredFrfs | None,
    modes: MeasuredModes | None,
    inputs: Inputs,
    roving: float = 0.0,
    **of_responses: Any,
) -> Measurement:
    return Measurement(
        None if used is None else used.frfs,
        campaign.points,
        modes,
        roving,
        inputs,
        campaign.frame.point_axes(campaign.points),
        temperature_c=campaign.temperature_c,
        **of_responses,
    )


def _load_together(session: Session, row: UpdateJob, request: UpdateBatchIn) -> UpdateInputs:
    if len(campaigns_of(session, {job.campaign_id for job in request.jobs})) < len(request.jobs):
        raise ChildEnded(PURGED)
    versions = [UUID(each["structure_version_id"]) for each in row.campaigns]
    common = request.recipe or USUAL
    loaded = [
        _as_of(session, job.campaign_id, version)
        for job, version in zip(request.jobs, versions, strict=True)
    ]
    campaigns = []
    for number, (job, campaign, names) in enumerate(
        zip(request.jobs, loaded, _names(session, loaded), strict=True)
    ):
        with within(f"jobs.{number}"):
            campaigns.append(_campaign(session, job, common, campaign, names, loaded[0].structure))
    scatter = SCATTER if request.scatter is None else request.scatter
    parameters = parameters_of(common, campaigns[0].body)
    coupons, warnings = _coupons(session, request, parameters, campaigns[0].body)
    recipe = CampaignsRecipe(parameters, scatter, common.reference_temperature_c)
    provenance = {"joint_update": str(row.id), "request": row.request}
    return UpdateInputs(tuple(campaigns), Together(recipe, coupons, warnings, provenance))


def _as_of(session: Session, campaign_id: UUID, version_id: UUID) -> MeasuredCampaign:
    """The campaign with the structure as it was when the job was queued, whatever became of it
    since.
    """
    campaign, version = (
        load_measured_campaign(session, campaign_id),
        version_of(session, version_id),
    )
    described = describe_version(version, campaign.structure.name)
    return replace(
        campaign,
        structure=described,
        structure_version_id=version.id,
        structure_version=version.number,
    )


def _measured(
    session: Session, campaign: MeasuredCampaign, recipe: RecipeIn
) -> tuple[MeasuredFrfs | None, MeasuredModes | None, InputsIn]:
    """The largest set of FRFs, the recipe's modes in the specimen's frame, and how well the inputs
    are known.
    """
    used, modes = campaign.frf_sets[0] if campaign.frf_sets else None, None
    if recipe.mode_set is not None:
        modes = modes_in_frame(load_modes(session, recipe.mode_set), campaign.frame)
        if used is not None:
            modes = as_in_frfs(modes, window_taken_out(session, recipe.mode_set))
    window = (None, None) if used is None else used.window
    return (
        used,
        modes,
        recipe.inputs.or_as_stated(campaign.structure.inputs, campaign.inputs, window),
    )


def _with_sensor_of(campaign: MeasuredCampaign, records: ProcessingInputs) -> MeasuredCampaign:
    """The campaign with the sensor where all time blocks of responses were recorded, as it would
    have it of its FRFs.
    """
    points = {row.point for file in records.points for row in file.rows if row.quantity != "force"}
    if campaign.sensor_point is not None or len(points) != 1:
        return campaign
    return replace(campaign, sensor_point=points.pop())


def carried_masses(campaign: MeasuredCampaign) -> tuple[PointMass, ...]:
    """What the specimen carried: masses that were added, and its sensor where one sat at a point.

    Raises:
        InputError: the sensor's point is not a grid point.
    """
    point, flat = _sensor_point(campaign), not is_in_space(campaign.structure)
    added = tuple(
        PointMass(
            each.x_m,
            each.y_m,
            each.mass_kg,
            each.rotary_inertia_kg_m2,
            weighed=True,
            z=0.0 if flat else each.z_m,
        )
        for each in campaign.added_masses
    )
    if not campaign.sensor_mass_kg or point is None:
        return added
    if point not in campaign.points:
        raise InputError("instruments.sensor_point", f"{point} is not a grid point of the campaign")
    x, y, z = campaign.points[point]
    return (PointMass(x, y, campaign.sensor_mass_kg, z=0.0 if flat else z), *added)


def roving_mass(campaign: MeasuredCampaign) -> float:
    """Mass in kg of a sensor that moved with the response; 0 where it has none or sat at a
    point.
    """
    return campaign.sensor_mass_kg if campaign.frf_sets and _sensor_point(campaign) is None else 0.0


def _roving_over(campaign: MeasuredCampaign) -> float:
    """The same for a campaign of time blocks, whose sensor's point is known where it stood
    still.
    """
    return campaign.sensor_mass_kg if campaign.sensor_point is None else 0.0


def _sensor_point(campaign: MeasuredCampaign) -> int | None:
    """Where the sensor sat: where the campaign says, or where all responses were measured; None
    where it moved.
    """
    if campaign.sensor_point is not None or not campaign.frf_sets:
        return campaign.sensor_point
    points = {dof.point for dof in campaign.frf_sets[0].frfs.responses}
    return points.pop() if len(points) == 1 else None


def modes_in_frame(modes: MeasuredModes, frame: Frame) -> MeasuredModes:
    """Modes of a file with the directions of their shapes in the specimen's frame."""
    return replace(modes, dofs=tuple(frame.dof(dof) for dof in modes.dofs))


def as_in_frfs(modes: MeasuredModes, rate_per_s: float) -> MeasuredModes:
    """Modes with the window's rate that an identification took out of them, as the FRFs have it:
    the update takes it out of both.
    """
    return modes if not rate_per_s else without_window(modes, modes.covariance, -rate_per_s)


def _left_out(campaign: MeasuredCampaign) -> list[str]:
    return [
        f"{len(other.ids)} FRFs ({other.frfs.quantity}, {other.frfs.frequency_hz.size} lines) lie"
        " on another frequency axis or are of another quantity than the largest set, and were not"
        " used"
        for other in campaign.frf_sets[1:]
    ]


def _provenance(
    job: UpdateJob, campaign: MeasuredCampaign, used: MeasuredFrfs | None
) -> dict[str, Any]:
    return {
        "update_job": str(job.id),
        "campaign": str(campaign.campaign_id),
        "structure_version": str(campaign.structure_version_id),
        "frfs": (
            []
            if used is None
            else [
                {"id": str(key), "sha256": digest}
                for key, digest in zip(used.ids, used.sha256s, strict=True)
            ]
        ),
        "mode_set": job.recipe["mode_set"],
        "recipe": job.recipe,
    }


def parameters_of(recipe: RecipeIn, body: Body) -> tuple[Parameter, ...]:
    """The parameters of a joint update: the recipe's, or all constants of the material, of the
    sets, or factors.
    """
    return recipe.to_core().parameters or usual_parameters(body)


def _names(session: Session, campaigns: list[MeasuredCampaign]) -> list[tuple[str, str]]:
    """Names that distinguish the campaigns, with a number where two have the same; and those of
    their specimens.

    A specimen has its structure's name, with the structure's id where two structures share it.
    """
    rows = [campaign_of(session, each.campaign_id) for each in campaigns]
    own = [f"{each.structure.name}, {row.name}" for each, row in zip(campaigns, rows, strict=True)]
    numbered = [
        name if own.count(name) == 1 else f"{name} ({number})"
        for number, name in enumerate(own, start=1)
    ]
    named: dict[str, set[UUID]] = {}
    for row, each in zip(rows, campaigns, strict=True):
        named.setdefault(each.structure.name, set()).add(row.structure_id)
    specimens = [
        (
            each.structure.name
            if len(named[each.structure.name]) == 1
            else f"{each.structure.name} {row.structure_id}"
        )
        for row, each in zip(rows, campaigns, strict=True)
    ]
    return list(zip(numbered, specimens, strict=True))


def _campaign(
    session: Session,
    job: BatchJobIn,
    common: RecipeIn,
    campaign: MeasuredCampaign,
    names: tuple[str, str],
    first: StructureIn,
) -> LoadedCampaign:
    """One of several campaigns; `names` are its own and its specimen's, `first` the first
    campaign's structure.
    """
    recipe = job.recipe or common
    if not campaign.frf_sets and recipe.mode_set is None:
        none = "has no FRFs; import some, or name a mode set in this job's recipe"
        raise InputError("campaign_id", campaign.without_frfs(none))
    if roving_mass(campaign) and recipe.mode_set is None:
        raise InputError(
            "campaign_id",
            "had a sensor that moved, so its FRFs have no common modes; name a mode set in its"
            " recipe",
        )
    body = joint_body(
        session,
        campaign.structure,
        campaign.boundary,
        common,
        masses=carried_masses(campaign),
        first=first,
        angle_deg=job.angle_deg,
    )
    used, modes, inputs = _measured(session, campaign, recipe)
    return LoadedCampaign(
        name=names[0],
        specimen=job.specimen or names[1],
        body=body,
        measurement=_measurement(campaign, used, modes, inputs.to_core()),
        recipe=recipe.to_core(),
        provenance={
            "campaign_id": str(campaign.campaign_id),
            "structure_version_id": str(campaign.structure_version_id),
            "mode_set": None if recipe.mode_set is None else str(recipe.mode_set),
            "angle_deg": (
                math.degrees(body.nominal["fibre_angle"]) if body.shares_material else None
            ),
            "inputs": inputs.model_dump(mode="json"),
        },
        warnings=campaign.warnings,
    )


def _coupons(
    session: Session, request: UpdateBatchIn, parameters: Sequence[Parameter], body: Body
) -> tuple[tuple[Coupon, ...], tuple[str, ...]]:
    """Each batch's constants that are updated."""
    free = {p.name for p in parameters if not p.fixed and not p.tied_to}
    coupons, warnings = [], []
    for key in request.coupon_batches:
        batch = batch_for.row(session, key)
        summary = summarise(session, batch)
        warnings += [f"coupons: {text}" for text in summary.warnings]
        of_body = coupon_constants(body, batch.sets)
        for name, prior in summary.priors.items():
            measured = (
                prior.mean,
                prior.standard_deviation,
                f"coupon batch {batch.name}",
                summary.constants[name].n or 1,
            )
            owns = free.intersection(of_body.get(name, ()))
            coupons += [Coupon(own, *measured) for own in sorted(owns)]
    return tuple(coupons), tuple(warnings)
