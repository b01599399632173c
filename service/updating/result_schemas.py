"""What `GET /update-jobs/{id}/result` answers, for the OpenAPI document and for who reads a result in another language.

These models describe a result and do not filter it: it is stored as it was computed, and brought up to date when it is read
(`service.updating.versions`).
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

Number = float | None


class _Part(BaseModel):
    model_config = ConfigDict(extra="allow")


class VerdictOut(_Part):
    """Whether the result may be used."""

    level: Literal["usable", "with_care", "do_not_use"] = Field(description="may it be used?")
    sentence: str = Field(description="the same in one sentence")
    reasons: list[str] = Field(description="the decisive ones, the gravest first")


class OutcomeOut(_Part):
    """How a stage ended; stages fail alone."""

    stage: str = Field(description="`elastic` or `damping`")
    status: Literal["succeeded", "failed", "skipped"] = Field(description="skipped: there was nothing to work on")
    message: str = Field(description="why, where it did not succeed")


class BudgetOut(_Part):
    """One source's part in a parameter's uncertainty."""

    source: str = Field(description="noise, discrepancy, a prior, or an input of the laboratory")
    standard_deviation: float = Field(description="that it alone would give, in the parameter's unit")
    share: float = Field(description="of the parameter's variance, 0 to 1")
    provenance: str = Field(description="where the source's own standard deviation comes from")


class ParameterOut(_Part):
    """An updated parameter."""

    name: str = Field(description="Ex Ey Gxy Gxz Gyz a0 a1 …")
    unit: str = Field(description="Pa, 1/s, s, or the unit of a spring")
    initial: Number = Field(description="value of the model before, in its unit; null for damping")
    estimate: float = Field(description="value after, in its unit")
    standard_deviation: float = Field(description="everything included, in its unit")
    noise_standard_deviation: float = Field(description="under measurement noise alone, in its unit")
    interval_95: tuple[float, float] = Field(description="95 % interval, everything included, in its unit")
    identifiable: bool = Field(
        description="whether the data say more than half of what is known of it; of a tied one, of what it is tied to"
    )
    tied_to: str | None = Field(
        None, description="the parameter whose ratio to it the recipe fixes; null where it is estimated itself"
    )
    prior_mean: Number = Field(description="in its unit; null without a prior")
    prior_sd: Number = Field(description="in its unit; null without a prior")
    budget: list[BudgetOut] = Field(description="what its variance is made of, the largest first")
    confounded_with: list[str] = Field(description="parameters with which it moves where the data see nothing")
    comparable: dict[str, float] | None = Field(
        None, description="estimate and standard deviation, in its unit, to compare with other tests of the same body"
    )


class ModeComparisonOut(_Part):
    """A measured mode beside the model's; null where there is no partner or nothing was measured."""

    number: int = Field(description="of the measured mode, from 1")
    kind: str | None = Field(description="the model's motion: bending or torsion")
    measured_hz: float = Field(description="measured natural frequency, Hz")
    initial_hz: Number = Field(description="of the initial model, Hz")
    updated_hz: Number = Field(description="of the updated model, Hz")
    error_percent: Number = Field(description="of the updated frequency, % of the measured one")
    mac: Number = Field(description="of measured and updated shape, 0 to 1")
    measured_damping: Number = Field(description="measured damping ratio ζ, not per cent")
    predicted_damping: Number = Field(description="of the updated model, not per cent")


class AgreementOut(_Part):
    """Agreement of measured and predicted FRFs, 0 to 1."""

    sac: list[Number] = Field(description="spectral assurance criterion of each FRF")
    frac: list[Number] = Field(description="frequency response assurance criterion of each FRF")
    csac_mean: Number = Field(description="mean over the lines of the cross signature assurance criterion")
    csf_mean: Number = Field(description="mean over the lines of the cross signature scale factor")


class HeldOutAgreementOut(AgreementOut):
    """Agreement on data that no fit has seen."""

    points: list[int] = Field(description="points of held-out FRFs; empty for a held-out band")
    band_hz: tuple[float, float] = Field(description="lines compared, Hz")
    coverage_95: Number = Field(description="share of the values inside their 95 % prediction intervals, 0 to 1")


class HeldOutOut(_Part):
    """Validation on data that no fit has seen; null where nothing was held out."""

    frfs: HeldOutAgreementOut | None = Field(description="FRFs kept from the fit")
    band: HeldOutAgreementOut | None = Field(description="lines kept from the fit")


class CorrelationOut(AgreementOut):
    """Agreement of the updated model, and beside it of the initial one."""

    initial: AgreementOut = Field(description="of the initial model")
    held_out: HeldOutOut = Field(description="on data that no fit has seen")
    mac_matrix: list[list[Number]] | None = Field(
        description="rows measured, columns updated model; null without shapes"
    )


class DampingLawOut(_Part):
    """A damping law of the recipe."""

    name: str = Field(description="rayleigh caughey3 caughey4 generalised modal")
    coefficients: dict[str, float] = Field(description="by name, SI")
    bic: Number = Field(description="Bayesian information criterion; the least is preferred")
    preferred: bool = Field(description="whether it has the least of all")
    missed: list[Number] = Field(description="relative miss of the ratio of each paired mode")


class ConvergenceStepOut(_Part):
    """An iterate of stage 1."""

    parameters: dict[str, float] = Field(description="by name, SI")
    frequency_hz: list[Number] = Field(description="of the measured modes' partners, Hz")
    cost: float = Field(description="of the fit, without unit")


class PartnerOut(_Part):
    """A measured mode and its partner among the model's."""

    measured: int = Field(description="number of the measured mode, from 1")
    model: int = Field(description="number of the model's elastic mode, from 1")
    frequency_hz: float = Field(description="of the model's mode, Hz")
    kind: str = Field(description="its motion: bending or torsion")


class RivalPairingOut(_Part):
    """Other partners, at the best point that a start came to with them."""

    partners: list[PartnerOut] = Field(description="of the measured modes")
    parameters: dict[str, float] = Field(description="at that point, by name, SI")
    log_evidence: float = Field(description="logarithm of how much more the chosen pairing is supported")


class PairingOut(_Part):
    """Which measured mode is which of the model's."""

    by: Literal["shapes", "order"] = Field(description="what decided: `order` with fewer than three dofs, or no shapes")
    partners: list[PartnerOut] = Field(description="of the measured modes; one that is not named has none")
    rival: RivalPairingOut | None = Field(description="the next best pairing that was found; null: none")


class ResultOut(_Part):
    """A result: the verdict and the warnings first."""

    verdict: VerdictOut = Field(description="whether the result may be used")
    warnings: list[str] = Field(description="in words; read them first")
    outcomes: list[OutcomeOut] = Field(description="how each stage ended")
    parameters: list[ParameterOut] = Field(description="updated parameters, SI")
    modes: list[ModeComparisonOut] = Field(description="measured modes beside the model's")
    correlation: CorrelationOut = Field(description="agreement of FRFs and shapes")
    damping_models: list[DampingLawOut] = Field(description="damping laws, ranked")
    damping_fit: dict[str, Any] = Field(description="starts, optima and history of stage 2")
    convergence: list[ConvergenceStepOut] | None = Field(
        None, description="iterates of stage 1; with `?include=convergence` only"
    )
    pairing: PairingOut | None = Field(
        None, description="which measured mode is which of the model's, and the rival pairing"
    )
    identifiability: dict[str, Any] = Field(description="directions that the data do not see")
    discrepancy: dict[str, Any] = Field(description="relative standard deviation of what the model cannot say")
    band_hz: tuple[float, float] | None = Field(description="lines of the damping update, Hz")
    channel_delay_s: Number = Field(description="lag of the response that was found, s")
    identification: dict[str, Any] | None = Field(
        description="how the modes were found; its `stabilisation` with `?include=stabilisation` only"
    )
    posterior: dict[str, Any] = Field(description="how the posterior was had")
    version: int = Field(
        description="of this document's form; results of earlier versions are shown in the present one"
    )
    provenance: dict[str, Any] = Field(description="inputs with their SHA-256, recipe, versions, host, durations")
