"""What a result is as JSON: one declaration for what is stored, for the OpenAPI document and for
who reads it elsewhere.

The worker makes a document of the core's dataclasses by these models (`fecore.updating.result`);
their arrays become lists, and what is not finite null. A stored document is brought up to date when
it is read (`service.store.updating.document`).
"""

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, create_model

from fecore.correlation import CRITERIA, Of


def _listed(values: Any) -> Any:
    """Numbers of an array of any shape as lists, None for what is not finite."""
    if isinstance(values, np.ndarray):
        return [_listed(each) for each in values]
    return None if isinstance(values, float | np.floating) and not np.isfinite(values) else values


def _short(values: Any) -> Any:
    """Numbers of a curve that is only drawn, to five digits."""
    listed = _listed(values)
    return (
        [None if value is None else float(f"{value:.5g}") for value in listed]
        if isinstance(listed, list)
        else values
    )


Number = Annotated[float | None, BeforeValidator(_listed)]
Numbers = Annotated[list[Number], BeforeValidator(_listed)]
Table = Annotated[list[Numbers], BeforeValidator(_listed)]
Curve = Annotated[list[Number], BeforeValidator(_short)]

CONSTANTS = {**dict.fromkeys(("Ex", "Ey", "Gxy", "Gxz", "Gyz"), "Pa"), "a0": "1/s", "a1": "s"}
"""Names of the constants by which results are found, with their units."""

Level = Literal["usable", "with_care", "do_not_use"]


class Part(BaseModel):
    """A part of a result, made of the core's dataclass of the same members."""

    model_config = ConfigDict(extra="allow", from_attributes=True)


class VerdictOut(Part):
    """Whether the result may be used."""

    level: Level = Field(description="may it be used?")
    sentence: str = Field(description="the same in one sentence")
    reasons: list[str] = Field(description="the decisive ones, the gravest first")


class FindingOut(Part):
    """Something that a user must know."""

    kind: str = Field(description="its id, the same in every result")
    level: Literal["with_care", "do_not_use"] | None = Field(
        description="what it means for the use of the result"
    )
    text: str = Field(description="what was found and what to do")


class OutcomeOut(Part):
    """How a stage ended; stages fail alone."""

    stage: str = Field(description="`elastic` or `damping`")
    status: Literal["succeeded", "failed", "skipped"] = Field(
        description="skipped: there was nothing to work on"
    )
    message: str = Field(description="why, where it did not succeed")


class BudgetOut(Part):
    """One source's part in a parameter's uncertainty."""

    source: str = Field(description="noise, discrepancy, a prior, or an input of the laboratory")
    standard_deviation: float = Field(
        description="that it alone would give, in the parameter's unit"
    )
    share: float = Field(description="of the parameter's variance, 0 to 1")
    provenance: str = Field(description="where the source's own standard deviation comes from")


class ComparableOut(Part):
    """A parameter with every input held at what was stated, to compare with other tests of the same
    body.
    """

    estimate: float = Field(description="in the parameter's unit")
    standard_deviation: float = Field(
        description="by measurement noise alone, in the parameter's unit"
    )


class ParameterOut(Part):
    """An updated parameter."""

    name: str = Field(description="Ex Ey Gxy Gxz Gyz a0 a1 …")
    unit: str = Field(description="Pa, 1/s, s, or the unit of a spring")
    initial: Number = Field(description="value of the model before, in its unit; null for damping")
    estimate: float = Field(description="value after, in its unit")
    standard_deviation: float = Field(description="everything included, in its unit")
    noise_standard_deviation: float = Field(
        description="under measurement noise alone, in its unit"
    )
    interval_95: tuple[float, float] = Field(
        description="95 % interval, everything included, in its unit"
    )
    identifiable: bool = Field(
        description=(
            "whether the data say more than half of what is known of it; of a tied one, of what it"
            " is tied to"
        )
    )
    prior_mean: Number = Field(description="in its unit; null without a prior")
    prior_sd: Number = Field(description="in its unit; null without a prior")
    comparable: ComparableOut | None = Field(
        None, description="what to compare with other tests of the same body"
    )
    budget: list[BudgetOut] = Field(description="what its variance is made of, the largest first")
    confounded_with: list[str] = Field(
        description="parameters with which it moves where the data see nothing"
    )
    tied_to: str | None = Field(
        None,
        description=(
            "the parameter whose ratio to it the recipe fixes; null where it is estimated itself"
        ),
    )


class ModeComparisonOut(Part):
    """A measured mode beside the model's; null where there is no partner or nothing was
    measured.
    """

    number: int = Field(description="of the measured mode, from 1")
    kind: str | None = Field(description="the model's motion: bending or torsion")
    measured_hz: float = Field(description="measured natural frequency, Hz")
    initial_hz: Number = Field(description="of the initial model, Hz")
    updated_hz: Number = Field(description="of the updated model, Hz")
    error_percent: Number = Field(description="of the updated frequency, % of the measured one")
    mac: Number = Field(description="of measured and updated shape, 0 to 1")
    measured_damping: Number = Field(None, description="measured damping ratio ζ, not per cent")
    predicted_damping: Number = Field(None, description="of the updated model, not per cent")
    measured_damping_sd: Number = Field(
        None, description="standard deviation of the measured ratio"
    )
    motion: dict[str, float] | None = Field(
        None, description="shares of the updated model's motion, by kind, 0 to 1"
    )
    energy: dict[str, float] | None = Field(
        None, description="shares of its strain energy, by set and spring, 0 to 1"
    )
    own_mesh_hz: Number = Field(
        None,
        description=(
            "of the updated model on the structure's own mesh, Hz; null where a finer one was not"
            " needed"
        ),
    )


def _criteria(of: Of) -> Any:
    """A model with a member for each criterion of FRFs or of shapes."""
    members: dict[str, Any] = {
        each.member: (Number if each.is_mean else Numbers, Field(description=each.sentence))
        for each in CRITERIA.values()
        if each.of == of
    }
    return create_model(f"CriteriaOf{of.title()}", __base__=Part, **members)


class AgreementOut(_criteria("FRFs")):  # type: ignore[misc]
    """Agreement of measured and predicted FRFs, 0 to 1."""


class HeldOutAgreementOut(AgreementOut):
    """Agreement on data that no fit has seen."""

    points: list[int] = Field(description="points of held-out FRFs; empty for a held-out band")
    band_hz: tuple[float, float] = Field(description="lines compared, Hz")
    coverage_95: Number = Field(
        description="share of the values inside their 95 % prediction intervals, 0 to 1"
    )


class HeldOutOut(Part):
    """Validation on data that no fit has seen; null where nothing was held out."""

    frfs: HeldOutAgreementOut | None = Field(description="FRFs kept from the fit")
    band: HeldOutAgreementOut | None = Field(description="lines kept from the fit")


class CorrelationOut(_criteria("shapes"), AgreementOut):  # type: ignore[misc]
    """Agreement of the updated model, and beside it of the initial one."""

    initial: AgreementOut = Field(description="of the initial model")
    held_out: HeldOutOut = Field(description="on data that no fit has seen")
    mac_matrix: Table | None = Field(
        description="rows measured, columns updated model; null without shapes"
    )


class CurveOut(Part):
    """A damping law over the range of the modes."""

    frequency_hz: Curve = Field(description="Hz; of a law by mechanism those of the model's modes")
    damping_ratio: Curve = Field(description="of the law there")


class DampingLawOut(Part):
    """A damping law of the recipe."""

    name: str = Field(description="rayleigh caughey3 caughey4 generalised modal")
    coefficients: dict[str, float] = Field(description="by name, SI")
    bic: Number = Field(description="Bayesian information criterion; the least is preferred")
    preferred: bool = Field(description="whether it has the least of all")
    missed: Numbers = Field(description="relative miss of the ratio of each paired mode")
    standard_deviations: dict[str, float] | None = Field(
        None, description="of the coefficients, by name, SI"
    )
    curve: CurveOut | None = Field(
        None, description="its damping ratios over the range of the modes"
    )
    by_mechanism: bool | None = Field(
        None, description="whether it damps the shares of strain energy"
    )


class CommonLawOut(Part):
    """A damping law with one set of coefficients for all campaigns."""

    name: str = Field(description="of the law")
    coefficients: dict[str, float] = Field(description="by name, SI")
    standard_deviations: dict[str, float] = Field(description="of the coefficients, by name, SI")
    bic: Number = Field(description="Bayesian information criterion; the least is preferred")
    preferred: bool = Field(description="whether it has the least of all")
    missed_by: dict[str, float] = Field(
        description="root mean square of the misses of each campaign's ratios"
    )


class OverTemperatureOut(Part):
    """A constant, or a coefficient of a damping law, over temperature."""

    name: str = Field(description="of the constant or the coefficient")
    unit: str = Field(description="SI")
    estimate: Curve = Field(description="at each temperature")
    low: Curve = Field(description="lower end of its 95 % interval")
    high: Curve = Field(description="upper end of its 95 % interval")
    law: str | None = Field(
        None, description="whose coefficient it is; null of an elastic constant"
    )


class TemperatureCurveOut(Part):
    """Constants and damping between the temperatures of the tests, and a little beyond."""

    reference_c: float = Field(description="temperature at which the parameters are given, °C")
    temperature_c: Curve = Field(description="°C")
    constants: list[OverTemperatureOut] = Field(description="of each that changes with temperature")


class ConvergenceStepOut(Part):
    """An iterate of stage 1."""

    parameters: dict[str, float] = Field(description="by name, SI")
    frequency_hz: Numbers = Field(description="of the measured modes' partners, Hz")
    cost: float = Field(description="of the fit, without unit")


class StartOut(Part):
    """A start of stage 1, iterate by iterate."""

    chosen: bool = Field(description="whether the result is its end")
    failure: Annotated[str | None, BeforeValidator(lambda text: text or None)] = Field(
        description="null: it converged"
    )
    cost: list[float] = Field(description="of each iterate")
    parameters: dict[str, Numbers] = Field(description="by name, of each iterate, SI")


class PartnerOut(Part):
    """A measured mode and its partner among the model's."""

    measured: int = Field(description="number of the measured mode, from 1")
    model: int = Field(description="number of the model's elastic mode, from 1")
    frequency_hz: float = Field(description="of the model's mode, Hz")
    kind: str = Field(description="its motion: bending or torsion")


class RivalPairingOut(Part):
    """Other partners, at the best point that a start came to with them."""

    partners: list[PartnerOut] = Field(description="of the measured modes")
    parameters: dict[str, float] = Field(description="at that point, by name, SI")
    log_evidence: float = Field(
        description="logarithm of how much more the chosen pairing is supported"
    )


class PairingOut(Part):
    """Which measured mode is which of the model's."""

    by: Literal["shapes", "order"] = Field(
        description="what decided: `order` with fewer than three dofs, or no shapes"
    )
    partners: list[PartnerOut] = Field(
        description="of the measured modes; one that is not named has none"
    )
    rival: RivalPairingOut | None = Field(
        description="the next best pairing that was found; null: none"
    )


class PosteriorOut(Part):
    """How the posterior was had, and how the parameters correlate."""

    method: str = Field("laplace", description="laplace or mcmc")
    names: list[str] = Field(
        default_factory=list, description="rows and columns of the correlation"
    )
    correlation: Table | None = Field(None, description="of these parameters")


class ResultOut(Part):
    """A result: the verdict and the warnings first."""

    verdict: VerdictOut = Field(description="whether the result may be used")
    warnings: list[str] = Field(description="in words; read them first")
    findings: list[FindingOut] = Field(
        default_factory=list, description="the update's warnings, each with its id"
    )
    outcomes: list[OutcomeOut] = Field(description="how each stage ended")
    parameters: list[ParameterOut] = Field(description="updated parameters, SI")
    modes: list[ModeComparisonOut] = Field(description="measured modes beside the model's")
    correlation: CorrelationOut = Field(description="agreement of FRFs and shapes")
    damping_models: list[DampingLawOut] = Field(description="damping laws, ranked")
    damping_fit: dict[str, Any] = Field(description="starts, optima and history of stage 2")
    convergence: list[ConvergenceStepOut] | None = Field(
        None, description="iterates of stage 1; with `?include=convergence` only"
    )
    starts: list[StartOut] | None = Field(None, description="every start of stage 1 that was tried")
    pairing: PairingOut | None = Field(
        None, description="which measured mode is which of the model's, and the rival pairing"
    )
    model_modes: list[dict[str, Any]] | None = Field(
        None, description="number, frequency, kind and shares of the model's modes"
    )
    identifiability: dict[str, Any] = Field(description="directions that the data do not see")
    discrepancy: dict[str, Any] = Field(
        description="relative standard deviation of what the model cannot say"
    )
    reference_temperature_c: float | None = Field(
        None,
        description="temperature at which the parameters are given, °C; null: nobody stated one",
    )
    curve: TemperatureCurveOut | None = Field(
        None,
        description="constants over temperature, where the reference is not the campaign's own",
    )
    band_hz: tuple[float, float] | None = Field(description="lines of the damping update, Hz")
    channel_delay_s: Number = Field(description="lag of the response that was found, s")
    identification: dict[str, Any] | None = Field(
        description=(
            "how the modes were found; its `stabilisation` with `?include=stabilisation` only"
        )
    )
    posterior: PosteriorOut = Field(description="how the posterior was had")
    provenance: dict[str, Any] = Field(
        description="inputs with their SHA-256, recipe, versions, host, durations"
    )
    version: int = Field(
        description=(
            "of this document's form; results of earlier versions are shown in the present one"
        )
    )


class AloneOut(Part):
    """What one campaign says of a constant by itself."""

    estimate: float = Field(description="SI")
    standard_deviation: float = Field(description="SI")
    z: float = Field(description="difference from all together, in its standard deviations")


class CampaignPartOut(Part):
    """What one campaign has to do with a joint result; beside this the ids of what it was made
    of.
    """

    name: str = Field(description="structure and campaign")
    specimen: str = Field(description="campaigns of one specimen share its dimensions")
    predictive_p: Number = Field(description="of its frequencies, given the other campaigns")
    contradicts: bool = Field(
        description="whether it or one of its inputs is the likeliest cause of a conflict"
    )
    alone: dict[str, AloneOut] = Field(description="the constants by this campaign alone")
    own: list[ParameterOut] = Field(description="its own unknowns and its specimen's")
    modes: list[ModeComparisonOut] = Field(description="measured modes beside the model's")


class SaidOut(Part):
    """What a source says of one constant, and what the other data say of it, SI."""

    constant: str = Field(description="its name; empty for the scatter between specimens, a share")
    stated: float = Field(description="by the source")
    stated_sd: float = Field(description="standard deviation of that")
    rest: float = Field(description="by the other data")
    rest_sd: float = Field(description="standard deviation of that")


class CauseOut(Part):
    """A source of data that may be wrong."""

    kind: Literal[
        "input", "coupons", "campaign", "mass", "foot", "support", "stiffness", "scatter"
    ] = Field(
        description="what it is; a mass, a foot and a support that gives way are those of a body"
    )
    name: str = Field(description="of the source")
    p: float = Field(
        description=(
            "probability of a larger difference from the other data, if it is as good as stated"
        )
    )
    evidence: float = Field(
        description="logarithm of how much likelier the data are if it is wrong"
    )
    owner: str = Field(description="the campaign or specimen that it belongs to; empty: all")
    said: list[SaidOut] = Field(description="what it says, constant by constant")


class ConflictOut(Part):
    """Data that contradict each other."""

    cause: CauseOut = Field(description="the likeliest")
    rivals: list[CauseOut] = Field(
        description="other causes that are not ruled out, the likeliest first"
    )
    cleared: list[str] = Field(
        description="what no longer contradicts the rest once the cause is allowed for"
    )
    moved: float = Field(
        description="how far a constant then moves at most, in its standard deviations"
    )
    odds: Number = Field(
        default=None,
        description="logarithm of how much likelier the cause is than the next explanation",
    )


class JointResultOut(Part):
    """One material from several campaigns."""

    verdict: VerdictOut = Field(description="whether the result may be used")
    warnings: list[str] = Field(description="in words; read them first")
    findings: list[FindingOut] = Field(
        default_factory=list, description="the update's warnings, each with its id"
    )
    parameters: list[ParameterOut] = Field(
        description="the material's constants in its own axes, SI"
    )
    posterior: PosteriorOut = Field(description="how the constants correlate")
    campaigns: list[CampaignPartOut] = Field(description="what each campaign has to do with it")
    odd_one_out: str | None = Field(
        description="the campaign in which the first conflict's causes lie; null: none"
    )
    conflicts: list[ConflictOut] = Field(
        default_factory=list, description="data that contradict each other"
    )
    damping_models: list[CommonLawOut] = Field(description="damping laws of the material, ranked")
    reference_temperature_c: float | None = Field(
        None,
        description="temperature at which the parameters are given, °C; null: nobody stated one",
    )
    curve: TemperatureCurveOut | None = Field(
        None,
        description="constants and damping over temperature; null where all campaigns are at one",
    )
    discrepancy: dict[str, Any] = Field(
        description="relative: of a frequency, and of a modulus between specimens"
    )
    provenance: dict[str, Any] = Field(description="the request, versions, host")
