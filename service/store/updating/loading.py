"""From stored rows to what the core takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from uuid import UUID

from sqlalchemy.orm import Session

from fecore.body.model import PointMass
from fecore.body.specimen import Body, Specimen
from fecore.errors import InputError
from fecore.modes import MeasuredModes
from fecore.updating.measurement import Measurement
from fecore.updating.parameters import Parameter
from service.compute.frame import Frame
from service.compute.processing import ProcessingInputs
from service.compute.updating import Hits, UpdateInputs
from service.store.campaigns.operations import campaign_of, frame_of
from service.store.coupons.operations import batch_prior
from service.store.frfs.measured_campaign import MeasuredCampaign, MeasuredFrfs, load_measured_campaign
from service.store.modes.operations import load_modes
from service.store.records.processings import load_records
from service.store.structures.operations import describe_version, version_of
from service.store.updating.bodies import body_of, nominal_specimen
from service.store.updating.schemas import RecipeIn
from service.store.updating.tables import UpdateJob


def load_update(session: Session, job_id: UUID, workspace: Path) -> UpdateInputs:
    """Everything that a queued update needs.

    Raises:
        InputError: the campaign has neither FRFs nor time blocks, or its contents do not fit together.
    """
    job = session.get_one(UpdateJob, job_id)
    recipe = RecipeIn.model_validate(job.recipe)
    campaign = _as_of(session, job, load_measured_campaign(session, job.campaign_id))
    records = None
    if not campaign.frf_sets and recipe.mode_set is None:
        records = load_records(session, job.campaign_id, workspace, recipe.processing)
        if records is None:
            raise InputError(
                "campaign",
                "has no FRFs and no time blocks; import a UFF file or POST records first, or name a mode set in the recipe",
            )
        campaign = _with_sensor_of(campaign, records)
    frame = frame_of(campaign_of(session, job.campaign_id))
    modes = None if recipe.mode_set is None else modes_in_frame(load_modes(session, recipe.mode_set), frame)
    used = campaign.frf_sets[0] if campaign.frf_sets else None
    frfs = None if used is None else used.frfs
    specimen = body_of(campaign.structure, campaign.boundary, recipe, carried_masses(campaign))
    parameters, prior_warnings = recipe_parameters(session, recipe, specimen)
    window_rate = None if used is None else used.window_rate
    inputs = recipe.inputs.or_as_stated(campaign.structure.inputs, campaign.inputs, window_rate)
    core = inputs.to_core()
    left_in = used.window_remark if used is not None and core.window_rate is None else []
    measured = None if records else Measurement(frfs, campaign.points, modes, roving_mass(campaign), core)
    return UpdateInputs(
        measurement=measured,
        hits=None if records is None else Hits(records, campaign.points, frame, _roving_over(campaign), core),
        specimen=specimen,
        recipe=replace(recipe.to_core(), parameters=parameters),
        warnings=(
            *campaign.warnings,
            *_left_out(campaign),
            *left_in,
            *prior_warnings,
        ),
        provenance=_provenance(job, campaign, used) | {"inputs": inputs.model_dump(mode="json")},
    )


def _as_of(session: Session, job: UpdateJob, campaign: MeasuredCampaign) -> MeasuredCampaign:
    """The campaign with the structure as it was when the job was queued, whatever became of it since."""
    version = version_of(session, job.structure_version_id)
    described = describe_version(version, campaign.structure.name)
    return replace(campaign, structure=described, structure_version_id=version.id, structure_version=version.number)


def _with_sensor_of(campaign: MeasuredCampaign, records: ProcessingInputs) -> MeasuredCampaign:
    """The campaign with the sensor where all time blocks of responses were recorded, as it would have it of its FRFs."""
    points = {row.point for file in records.points for row in file.rows if row.quantity != "force"}
    if campaign.sensor_point is not None or len(points) != 1:
        return campaign
    return replace(campaign, sensor_point=points.pop())


def carried_masses(campaign: MeasuredCampaign) -> tuple[PointMass, ...]:
    """What the specimen carried: masses that were added, and its sensor where one sat at a point.

    Raises:
        InputError: the sensor's point is not a grid point.
    """
    point = _sensor_point(campaign)
    added = tuple(
        PointMass(each.x_m, each.y_m, each.mass_kg, each.rotary_inertia_kg_m2, weighed=True)
        for each in campaign.added_masses
    )
    if not campaign.sensor_mass_kg or point is None:
        return added
    if point not in campaign.points:
        raise InputError("instruments.sensor_point", f"{point} is not a grid point of the campaign")
    x, y, _ = campaign.points[point]
    return (PointMass(x, y, campaign.sensor_mass_kg), *added)


def specimen_of(campaign: MeasuredCampaign) -> Specimen:
    """The specimen that was measured, of one homogenised layer, with what it carried.

    Raises:
        InputError: the sensor's point is not a grid point, or the structure has no equivalent single layer.
    """
    return nominal_specimen(campaign.structure, campaign.boundary, carried_masses(campaign))


def roving_mass(campaign: MeasuredCampaign) -> float:
    """Mass in kg of a sensor that moved with the response; 0 where it has none or sat at a point."""
    return campaign.sensor_mass_kg if campaign.frf_sets and _sensor_point(campaign) is None else 0.0


def _roving_over(campaign: MeasuredCampaign) -> float:
    """The same for a campaign of time blocks, whose sensor's point is known where it stood still."""
    return campaign.sensor_mass_kg if campaign.sensor_point is None else 0.0


def _sensor_point(campaign: MeasuredCampaign) -> int | None:
    """Where the sensor sat: where the campaign says, or where all responses were measured; None where it moved."""
    if campaign.sensor_point is not None or not campaign.frf_sets:
        return campaign.sensor_point
    points = {dof.point for dof in campaign.frf_sets[0].frfs.responses}
    return points.pop() if len(points) == 1 else None


def modes_in_frame(modes: MeasuredModes, frame: Frame) -> MeasuredModes:
    """Modes of a file with the directions of their shapes in the specimen's frame."""
    return replace(modes, dofs=tuple(frame.dof(dof) for dof in modes.dofs))


def recipe_parameters(session: Session, recipe: RecipeIn, body: Body) -> tuple[tuple[Parameter, ...], list[str]]:
    """The recipe's parameters, with a coupon batch's mean and scatter where the recipe states none, and warnings."""
    parameters: Sequence[Parameter] = recipe.parameters_of(body)
    if recipe.prior_from_coupon_batch is None:
        return tuple(parameters), []
    summary = batch_prior(session, recipe.prior_from_coupon_batch)
    warnings = [f"coupons: {warning}" for warning in summary.warnings]
    filled, without_scatter = [], []
    for parameter in parameters:
        known = summary.priors.get(parameter.name)  # type: ignore[call-overload]
        if known is None:
            filled.append(parameter)
            continue
        mean = known.mean if parameter.prior_mean is None else parameter.prior_mean
        free = not parameter.fixed and parameter.tied_to is None
        scattered = summary.constants[parameter.name].standard_deviation is not None  # type: ignore[index]
        spread = known.standard_deviation if parameter.prior_sd is None and free and scattered else parameter.prior_sd
        if free and spread is None:
            without_scatter.append(parameter.name)
        filled.append(replace(parameter, prior_mean=mean, prior_sd=spread))
    if without_scatter:
        names = ", ".join(without_scatter)
        warnings.append(f"{names}: the coupon batch states no scatter, so the prior is its mean ± 30 %")
    return tuple(filled), warnings


def _left_out(campaign: MeasuredCampaign) -> list[str]:
    return [
        f"{len(other.ids)} FRFs ({other.frfs.quantity}, {other.frfs.frequency_hz.size} lines) lie on another frequency axis "
        "or are of another quantity than the largest set, and were not used"
        for other in campaign.frf_sets[1:]
    ]


def _provenance(job: UpdateJob, campaign: MeasuredCampaign, used: MeasuredFrfs | None) -> dict[str, Any]:
    return {
        "update_job": str(job.id),
        "campaign": str(campaign.campaign_id),
        "structure_version": str(campaign.structure_version_id),
        "frfs": []
        if used is None
        else [{"id": str(key), "sha256": digest} for key, digest in zip(used.ids, used.sha256s, strict=True)],
        "mode_set": job.recipe["mode_set"],
        "recipe": job.recipe,
    }
