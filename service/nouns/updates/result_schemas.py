"""What a result is as JSON: one declaration for what is stored, for the OpenAPI document and for
who reads it elsewhere.

The worker makes a document of the core's dataclasses by these models (`fecore.updating.result`);
their arrays become lists, and what is not finite null.
"""

from dataclasses import is_dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, create_model

from fecore.arrays import FloatArray, Listed, Numbers
from fecore.correlation import CRITERIA, Of
from fecore.findings import Place
from fecore.updating.result import (
    ConvergenceStep,
    Curve,
    DampingModelFit,
    ModeComparison,
    PairingSummary,
    ParameterEstimate,
    StageOutcome,
    StartHistory,
    Verdict,
)


def _members(part: Any) -> Any:
    """Members of a dataclass that has no schema of its own."""
    if not is_dataclass(part):
        return part
    return {
        name: value.tolist() if isinstance(value, np.ndarray) else value
        for name, value in vars(part).items()
    }


Number = Annotated[float | None, Listed(0)]
Table = Annotated[FloatArray, Listed(2)]
AnyObject = Annotated[dict[str, Any], BeforeValidator(_members)]

CONSTANTS = {**dict.fromkeys(("Ex", "Ey", "Gxy", "Gxz", "Gyz"), "Pa"), "a0": "1/s", "a1": "s"}
"""Names of the constants by which results are found, with their units."""

Level = Literal["usable", "with_care", "do_not_use"]


class Part(BaseModel):
    """A part of a result, made of the core's dataclass of the same members."""

    model_config = ConfigDict(extra="allow", from_attributes=True)


class FindingOut(Part):
    """Something that a user must know."""

    kind: str = Field(description="its id, the same in every result")
    level: Literal["with_care", "do_not_use"] | None = Field(
        description="what it means for the use of the result"
    )
    text: str = Field(description="what was found and what to do")
    sentence: str = Field(description="what was found, without what to do")
    advice: str = Field(description="what to do; empty where there is nothing to do")
    link: Place | None = Field(description="where that is done")
    subject: str | None = Field(description="what it is about, such as a mode or a campaign")
    remark: str | None = Field(
        description="for `measurement` and `pairing`, the id of the remark that is passed on"
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


class PosteriorOut(Part):
    """How the posterior was had, and how the parameters correlate."""

    method: str = Field("laplace", description="laplace or mcmc")
    names: list[str] = Field(
        default_factory=list, description="rows and columns of the correlation"
    )
    correlation: Table | None = Field(None, description="of these parameters")


class CommonOut(Part):
    """A result, of one campaign or of several: the verdict and the warnings first."""

    verdict: Verdict = Field(description="whether the result may be used")
    warnings: list[str] = Field(description="in words; read them first")
    findings: list[FindingOut] = Field(
        default_factory=list, description="the update's warnings, each with its id"
    )
    parameters: list[ParameterEstimate] = Field(
        description="updated parameters, SI; of several campaigns in the material's own axes"
    )
    posterior: PosteriorOut = Field(description="how the posterior was had")
    reference_temperature_c: float | None = Field(
        None,
        description="temperature at which the parameters are given, °C; null: nobody stated one",
    )
    curve: Curve | None = Field(
        None,
        description=(
            "constants over temperature, where the reference is not the campaign's own, and of"
            " several campaigns damping too; null where all are at one"
        ),
    )
    provenance: dict[str, Any] = Field(
        description="inputs with their SHA-256, recipe or request, versions, host, durations"
    )
    version: int = Field(
        description="of this document's form; results of earlier forms are to be computed again"
    )


class ResultOut(CommonOut):
    """A result of one campaign."""

    outcomes: list[StageOutcome] = Field(description="how each stage ended")
    modes: list[ModeComparison] = Field(description="measured modes beside the model's")
    correlation: CorrelationOut = Field(description="agreement of FRFs and shapes")
    damping_models: list[DampingModelFit] = Field(description="damping laws, ranked")
    damping_fit: AnyObject = Field(description="starts, optima and history of stage 2")
    convergence: list[ConvergenceStep] | None = Field(
        None, description="iterates of stage 1; with `?include=convergence` only"
    )
    starts: list[StartHistory] | None = Field(
        None, description="every start of stage 1 that was tried"
    )
    pairing: PairingSummary | None = Field(
        None, description="which measured mode is which of the model's, and the rival pairing"
    )
    model_modes: list[AnyObject] | None = Field(
        None, description="number, frequency, kind and shares of the model's modes"
    )
    identifiability: AnyObject = Field(description="directions that the data do not see")
    discrepancy: AnyObject = Field(
        description="relative standard deviation of what the model cannot say"
    )
    band_hz: tuple[float, float] | None = Field(description="lines of the damping update, Hz")
    channel_delay_s: Number = Field(description="lag of the response that was found, s")
    identification: dict[str, Any] | None = Field(
        description=(
            "how the modes were found; its `stabilisation` with `?include=stabilisation` only"
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
    own: list[ParameterEstimate] = Field(description="its own unknowns and its specimen's")
    modes: list[ModeComparison] = Field(description="measured modes beside the model's")


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


class JointResultOut(CommonOut):
    """One material from several campaigns."""

    campaigns: list[CampaignPartOut] = Field(description="what each campaign has to do with it")
    odd_one_out: str | None = Field(
        description="the campaign in which the first conflict's causes lie; null: none"
    )
    conflicts: list[ConflictOut] = Field(
        default_factory=list, description="data that contradict each other"
    )
    damping_models: list[CommonLawOut] = Field(description="damping laws of the material, ranked")
    discrepancy: AnyObject = Field(
        description="relative: of a frequency, and of a modulus between specimens"
    )
