"""From stored rows to a joint update: every campaign's body with one material, in the material's own axes."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any
from uuid import UUID

from sqlalchemy.orm import Session

from fecore.body.laminate import OrthotropicMaterial
from fecore.body.oriented import OrientedSpecimen
from fecore.body.specimen import Specimen
from fecore.errors import InputError
from fecore.updating.campaigns import MATERIAL_PARAMETERS, CampaignsRecipe, Coupon
from fecore.updating.measurement import Measurement
from fecore.updating.parameters import Parameter
from fecore.updating.posterior import SCATTER
from service.compute.joint_updating import JointCampaign, JointInputs
from service.jobs.child import PURGED
from service.jobs.process import ChildEnded
from service.store.campaigns.operations import campaign_of, campaigns_of, frame_of
from service.store.coupons.operations import batch_prior
from service.store.frfs.measured_campaign import MeasuredCampaign, load_measured_campaign
from service.store.modes.operations import load_modes
from service.store.structures.operations import describe_version, version_of
from service.store.structures.schemas import Laminate, Material, StructureIn
from service.store.updating.batches import BatchJobIn, UpdateBatchIn
from service.store.updating.bodies import nominal_specimen
from service.store.updating.loading import modes_in_frame, roving_mass, specimen_of
from service.store.updating.schemas import RecipeIn
from service.store.updating.tables import JointUpdate


def load_joint(session: Session, job_id: UUID, _workspace: Path) -> JointInputs:
    """Everything that a queued joint update needs.

    Raises:
        InputError: a campaign has nothing to update with, or cannot be taken together with the others.
        ChildEnded: a campaign was purged since.
    """
    row = session.get_one(JointUpdate, job_id)
    request = UpdateBatchIn.model_validate(row.request)
    if len(campaigns_of(session, {job.campaign_id for job in request.jobs})) < len(request.jobs):
        raise ChildEnded(PURGED)
    versions = [UUID(each["structure_version_id"]) for each in row.campaigns]
    common = request.recipe or RecipeIn.model_validate({})
    loaded = [
        _as_of(session, load_measured_campaign(session, job.campaign_id), version)
        for job, version in zip(request.jobs, versions, strict=True)
    ]
    material, _ = material_of(loaded[0].structure, 0)
    names = _names(session, loaded)
    specimens = _specimens(session, loaded)
    campaigns = tuple(
        _campaign(
            session,
            number,
            job,
            campaign,
            name=names[number],
            specimen=specimens[number],
            common=common,
            material=material,
        )
        for number, (job, campaign) in enumerate(zip(request.jobs, loaded, strict=True))
    )
    scatter = SCATTER if request.scatter is None else request.scatter
    coupons, warnings = _coupons(session, request, scatter=scatter > 0)
    return JointInputs(
        campaigns=campaigns,
        recipe=CampaignsRecipe(parameters_of(common), scatter),
        coupons=coupons,
        warnings=warnings,
        provenance={"joint_update": str(row.id), "request": row.request},
    )


def parameters_of(recipe: RecipeIn) -> tuple[Parameter, ...]:
    """The recipe's parameters, or all constants of the material."""
    return MATERIAL_PARAMETERS if recipe.parameters is None else recipe.to_core().parameters


def material_of(structure: StructureIn, number: int) -> tuple[OrthotropicMaterial, float]:
    """A structure's material in its own axes, and the angle in degrees at which the specimen was cut.

    A laminate whose plies are alike in all but thickness is one material at the plies' angle. Any other section is
    homogenised in the specimen's axes.

    Raises:
        InputError: the structure lacks what a model needs.
    """
    laminate = structure.laminate
    if laminate is not None and _is_one_material(laminate):
        ply = laminate.plies[0]
        return ply.material(structure.density_kg_m3 or ply.density_kg_m3 or 0.0), ply.angle_deg
    if laminate is not None and any(ply.angle_deg % 90 for ply in laminate.plies):
        raise InputError(
            f"jobs.{number}.campaign_id",
            "has a laminate of plies at several angles; a joint update takes one material: plies that lie alike",
        )
    return nominal_specimen(structure, "free").material, 0.0


def of_its_material(structure: StructureIn, number: int) -> StructureIn:
    """The structure with its material in the material's own axes in place of its laminate.

    Raises:
        InputError: as of `material_of`.
    """
    m, _ = material_of(structure, number)
    own = Material(Ex_Pa=m.Ex, Ey_Pa=m.Ey, Gxy_Pa=m.Gxy, Gxz_Pa=m.Gxz, Gyz_Pa=m.Gyz, nu_xy=m.nu_xy)
    return structure.model_copy(update={"laminate": None, "material": own})


def _is_one_material(laminate: Laminate) -> bool:
    first = laminate.plies[0]
    alike = {"thickness_m": first.thickness_m}
    return all(ply.model_copy(update=alike) == first for ply in laminate.plies)


def _as_of(session: Session, campaign: MeasuredCampaign, version_id: UUID) -> MeasuredCampaign:
    """The campaign with the structure as it was when the job was queued."""
    version = version_of(session, version_id)
    described = describe_version(version, campaign.structure.name)
    return replace(campaign, structure=described, structure_version_id=version.id, structure_version=version.number)


def _names(session: Session, campaigns: list[MeasuredCampaign]) -> list[str]:
    """Names that distinguish the campaigns: their own, with a number where two have the same."""
    own = [f"{each.structure.name}, {campaign_of(session, each.campaign_id).name}" for each in campaigns]
    return [name if own.count(name) == 1 else f"{name} ({number})" for number, name in enumerate(own, start=1)]


def _specimens(session: Session, campaigns: list[MeasuredCampaign]) -> list[str]:
    """A name of each campaign's specimen: that of its structure, with the structure's id where two structures share it."""
    keys = [campaign_of(session, each.campaign_id).structure_id for each in campaigns]
    named: dict[str, set[UUID]] = {}
    for key, each in zip(keys, campaigns, strict=True):
        named.setdefault(each.structure.name, set()).add(key)
    return [
        each.structure.name if len(named[each.structure.name]) == 1 else f"{each.structure.name} {key}"
        for key, each in zip(keys, campaigns, strict=True)
    ]


def _campaign(
    session: Session,
    number: int,
    job: BatchJobIn,
    campaign: MeasuredCampaign,
    *,
    name: str,
    specimen: str,
    common: RecipeIn,
    material: OrthotropicMaterial,
) -> JointCampaign:
    recipe = job.recipe or common
    mode_set = None if job.recipe is None else job.recipe.mode_set
    at = f"jobs.{number}"
    if not campaign.frf_sets and mode_set is None:
        raise InputError(f"{at}.campaign_id", "has no FRFs; import some, or name a mode set in this job's recipe")
    if roving_mass(campaign) and mode_set is None:
        raise InputError(
            f"{at}.campaign_id",
            "had a sensor that moved, so its FRFs have no common modes; name a mode set in its recipe",
        )
    plain = specimen_of(replace(campaign, structure=of_its_material(campaign.structure, number)))
    _, own_angle = material_of(campaign.structure, number)
    angle = own_angle if job.angle_deg is None else job.angle_deg
    modes = None
    if mode_set is not None:
        modes = modes_in_frame(load_modes(session, mode_set), frame_of(campaign_of(session, campaign.campaign_id)))
    used = campaign.frf_sets[0] if campaign.frf_sets else None
    frfs = None if used is None else used.frfs
    window_rate = None if used is None else used.window_rate
    inputs = recipe.inputs.or_as_stated(campaign.structure.inputs, campaign.inputs, window_rate)
    return JointCampaign(
        name=name,
        specimen=job.specimen or specimen,
        body=_body(plain, material, angle),
        measurement=Measurement(frfs, campaign.points, modes, 0.0, inputs.to_core()),
        recipe=recipe.to_core(),
        provenance={
            "campaign_id": str(campaign.campaign_id),
            "structure_version_id": str(campaign.structure_version_id),
            "mode_set": None if mode_set is None else str(mode_set),
            "angle_deg": angle,
            "inputs": inputs.model_dump(mode="json"),
        },
        warnings=campaign.warnings,
    )


def _body(plain: Specimen, material: OrthotropicMaterial, angle_deg: float) -> OrientedSpecimen:
    """The specimen with the material of all campaigns; its density is its own."""
    return OrientedSpecimen(
        plain.length,
        plain.width,
        plain.thickness,
        replace(material, density=plain.material.density),
        plain.boundary,
        masses=plain.masses,
        pieces=plain.pieces,
        fibre_angle=math.radians(angle_deg),
    )


def _coupons(session: Session, request: UpdateBatchIn, *, scatter: bool) -> tuple[tuple[Coupon, ...], tuple[str, ...]]:
    """Each batch's constants that are updated: the mean of its panel, or of one more piece where pieces are all alike."""
    wanted = {
        p.name for p in parameters_of(request.recipe or RecipeIn.model_validate({})) if not p.fixed and not p.tied_to
    }
    found, warnings = [], []
    for key in request.coupon_batches:
        summary: Any = batch_prior(session, key)
        warnings += [f"coupons: {text}" for text in summary.warnings]
        for name, prior in summary.priors.items():
            if name in wanted:
                pieces = (summary.constants[name].n or 1) if scatter else 0
                found.append(Coupon(name, prior.mean, prior.standard_deviation / math.sqrt(pieces + 1)))
    return tuple(found), tuple(warnings)
