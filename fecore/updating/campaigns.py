"""Updating several campaigns of one material together: the entry point, and how the campaigns are
laid out.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fecore.body.constants import Parameter
from fecore.errors import InputError
from fecore.findings import Finding, Level
from fecore.updating.amounts import plus_minus
from fecore.updating.campaign_layout import (
    MATERIAL,
    MATERIAL_PARAMETERS,
    Campaign,
    as_updated,
    check_material,
    lay_out,
    usual_parameters,
    yielding,
)
from fecore.updating.conflicts import CampaignAgreement, Conflict
from fecore.updating.contradictions import compare_sources
from fecore.updating.curves import check_temperatures, curve_of
from fecore.updating.elastic_findings import (
    USUAL_MISS,
    contradiction,
    mesh_findings,
    mesh_on_trust,
    pairing_findings,
    points_beyond,
    undetermined,
)
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.elastic_starts import update_from_several_starts, update_on_finest_mesh
from fecore.updating.estimates import constant_estimates, own_estimates
from fecore.updating.findings import finding, judge, modes_of, ordered, warnings
from fecore.updating.laws import common_damping
from fecore.updating.layout import Coupon
from fecore.updating.posterior import SCATTER
from fecore.updating.result import (
    CommonLaw,
    CommonResult,
    ModeComparison,
    ParameterEstimate,
    PosteriorSummary,
)
from fecore.updating.temperature import (
    TEMPERATURE,
    UNKNOWN_TEMPERATURE_SD,
    constant_of,
    damping_per_k,
)

__all__ = [
    "MATERIAL",
    "MATERIAL_PARAMETERS",
    "Campaign",
    "CampaignsRecipe",
    "CampaignsResult",
    "Coupon",
    "as_updated",
    "check_material",
    "lay_out",
    "update_campaigns",
    "usual_parameters",
    "yielding",
]


@dataclass(frozen=True)
class CampaignsRecipe:
    """How several campaigns are updated together."""

    parameters: tuple[Parameter, ...] = MATERIAL_PARAMETERS  # the material's, with their priors
    # scale of the moduli's relative deviations between specimens; 0: all specimens are of exactly
    # one material
    scatter: float = SCATTER
    # temperature at which the constants are asked for, °C; None for the campaigns' own where that
    # is one, else 23
    reference_temperature_c: float | None = None

    def __post_init__(self) -> None:
        if not (np.isfinite(self.scatter) and 0 <= self.scatter <= 1):
            raise InputError("scatter", f"is {self.scatter}, expected a share from 0 to 1")


@dataclass(frozen=True)
class CampaignEstimate:
    """What one campaign says of a constant by itself."""

    estimate: float
    """SI"""
    standard_deviation: float
    """SI"""
    z: float
    """difference from all together, in its standard deviations"""


@dataclass(frozen=True)
class CampaignPart:
    """What one campaign has to do with a joint result; in a document with the ids of what it was
    made of.
    """

    name: str
    """structure and campaign"""
    specimen: str
    """campaigns of one specimen share its dimensions"""
    predictive_p: float | None
    """of its frequencies, given the other campaigns; null of a single campaign"""
    contradicts: bool
    """whether it or one of its inputs is the likeliest cause of a conflict"""
    alone: Mapping[str, CampaignEstimate]
    """the constants by this campaign alone"""
    own: tuple[ParameterEstimate, ...]
    """its own unknowns and its specimen's; the specimen's scatter as ratios to the material"""
    modes: tuple[ModeComparison, ...]
    """measured modes beside the model's"""


@dataclass(frozen=True)
class JointDiscrepancy:
    """Relative standard deviations of what is not the same in all."""

    frequency: float
    """error of the model's frequencies"""
    scatter: float | None
    """of a modulus between specimens, root of its posterior mean; null where it is not modelled"""


@dataclass(frozen=True, kw_only=True)
class CampaignsResult(CommonResult):
    """One material from several campaigns, in its own axes."""

    campaigns: tuple[CampaignPart, ...]
    """what each campaign has to do with it"""
    odd_one_out: str | None
    """the campaign in which the first conflict's causes lie; null: none"""
    conflicts: tuple[Conflict, ...] = ()
    """data that contradict each other"""
    damping_models: tuple[CommonLaw, ...] = ()
    """damping laws of the material, ranked; none where no mode has a damping ratio"""
    discrepancy: JointDiscrepancy
    """relative: of a frequency, and of a modulus between specimens"""


def update_campaigns(
    campaigns: Sequence[Campaign],
    recipe: CampaignsRecipe | None = None,
    coupons: Sequence[Coupon] = (),
    progress: Callable[[str, float], None] = lambda *_: None,
) -> CampaignsResult:
    """One posterior of a material from several campaigns of its specimens.

    Args:
        campaigns: tests of specimens of the material, with their modes.
        recipe: the material's parameters and whether specimens scatter.
        coupons: what static tests say of its constants.
        progress: called with the stage and the share of the whole that is done; raise from it to
            cancel.

    Raises:
        InputError: campaigns, parameters or coupons contradict themselves.
        UpdatingError: a campaign has nothing in common with its model, or the estimate does not
            come to rest.
    """
    recipe = recipe or CampaignsRecipe()
    progress("laying out the campaigns", 0.0)
    ready = as_updated(campaigns)
    temperatures, stated = [each.temperature_c for each in ready], recipe.reference_temperature_c
    layout = lay_out(ready, recipe.parameters, recipe.scatter, coupons, stated)
    reference = check_temperatures(recipe.parameters, ready[0].body, temperatures, stated)

    def shown(share: float) -> None:
        progress("updating the material", 0.1 + 0.6 * share)

    elastic = update_on_finest_mesh(layout, lambda at: update_from_several_starts(at, shown))
    progress("comparing the campaigns", 0.7)
    against, agreements = compare_sources(elastic)
    progress("making intervals", 0.9)
    parameters = tuple(constant_estimates(elastic, None))
    causes = {conflict.cause.owner for conflict in against} - {""}
    parts = tuple(
        _part(elastic, number, each, agreements[number], causes)
        for number, each in enumerate(ready)
    )
    findings = [
        *map(contradiction, against),
        *_findings(elastic, parts),
        *undetermined(parameters, None),
    ]
    for model, campaign in zip(layout.campaigns, ready, strict=True):
        findings += [
            *points_beyond(model.forward, campaign.inputs, campaign.name),
            *mesh_on_trust(model.forward),
        ]
    laws = common_damping(elastic, damping_per_k(recipe.parameters))
    findings += _unknown_temperatures(elastic, parts)
    total = elastic.mixture.total[: len(layout.shared), : len(layout.shared)]
    sd = np.sqrt(np.diag(total))
    progress("done", 1.0)
    return CampaignsResult(
        verdict=judge(findings, parameters),
        parameters=parameters,
        posterior=PosteriorSummary(
            "laplace", names=layout.shared, correlation=total / np.outer(sd, sd)
        ),
        campaigns=parts,
        odd_one_out=_odd_one_out(against, ready),
        discrepancy=JointDiscrepancy(
            elastic.discrepancy, elastic.scatter if layout.specimens_scatter else None
        ),
        warnings=warnings(findings),
        findings=ordered(findings),
        conflicts=against,
        damping_models=laws,
        reference_temperature_c=temperatures[0] if reference is None else reference,
        curve=curve_of(elastic, laws),
    )


def _unknown_temperatures(elastic: ElasticResult, parts: Sequence[CampaignPart]) -> list[Finding]:
    """Campaigns of which nobody stated the temperature, among others at one."""
    findings = []
    for part, campaign in zip(parts, elastic.layout.campaigns, strict=True):
        warmth = campaign.prior.warmth
        for own in part.own:
            if own.name == TEMPERATURE and warmth is not None:
                assumed = plus_minus(TEMPERATURE, warmth.reference, UNKNOWN_TEMPERATURE_SD)
                now = plus_minus(TEMPERATURE, own.estimate, own.standard_deviation)
                findings.append(
                    finding("temperature_unknown", name=part.name, assumed=assumed, now=now)
                )
    return findings


def _part(
    elastic: ElasticResult,
    number: int,
    campaign: Campaign,
    agreement: CampaignAgreement,
    causes: set[str],
) -> CampaignPart:
    layout = elastic.layout
    values = layout.material(agreement.own)
    sds = agreement.own_sd * np.where(layout.prior.logarithmic[: values.size], np.abs(values), 1.0)
    rows = zip(
        layout.shared, map(float, values), map(float, sds), map(float, agreement.z), strict=True
    )
    constants = [row for row in rows if constant_of(row[0]) is None]
    return CampaignPart(
        name=campaign.name,
        specimen=campaign.specimen,
        modes=elastic.compared_modes(number, campaign.modes),
        own=tuple(own_estimates(elastic, number)),
        alone={name: CampaignEstimate(value, sd, z) for name, value, sd, z in constants},
        predictive_p=agreement.predictive_p,
        contradicts=not causes.isdisjoint(_owners(campaign)),
    )


def _owners(campaign: Campaign) -> set[str]:
    """What a campaign's own unknowns belong to."""
    return {f"campaign {campaign.name}", f"specimen {campaign.specimen}"}


def _odd_one_out(against: Sequence[Conflict], campaigns: Sequence[Campaign]) -> str | None:
    """The one campaign to which the first conflict's cause and all its rivals belong."""
    if not against:
        return None
    owners = {each.owner for each in (against[0].cause, *against[0].rivals)}
    odd = [campaign.name for campaign in campaigns if owners <= _owners(campaign)]
    return odd[0] if len(odd) == 1 else None


def _findings(elastic: ElasticResult, parts: Sequence[CampaignPart]) -> list[Finding]:
    findings = [*pairing_findings(elastic), *mesh_findings(elastic)]
    for part, at, pairing in zip(parts, elastic.rows, elastic.pairings, strict=True):
        unpaired, count = len(pairing.unpaired_measured), len(part.modes)
        if unpaired:
            level: Level | None = "do_not_use" if 2 * unpaired > count else None
            findings.append(
                finding(
                    "campaign_modes_alone",
                    level=level,
                    name=part.name,
                    unpaired=modes_of(unpaired, count),
                )
            )
        miss = elastic.rms_residual(at)
        if miss > USUAL_MISS:
            findings.append(finding("campaign_missed", name=part.name, percent=100 * miss))
    return findings
