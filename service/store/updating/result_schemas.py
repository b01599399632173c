"""What a result is as JSON: for what is stored, for the OpenAPI document and for who reads it
elsewhere.

The core's dataclasses say what there is (`fecore.updating.result`): their members, in their order
and with their words, are those of the models here. This module says what only the service knows:
the names of schemas, members that documents of earlier builds lack, and where JSON has something
otherwise: arrays are lists, and what is not finite is null.
"""

import ast
import inspect
import sys
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from itertools import pairwise
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, create_model

from fecore.updating import campaigns, conflicts
from fecore.updating import result as core


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


def _members(part: Any) -> Any:
    """Members of a dataclass that has no schema of its own."""
    if not is_dataclass(part):
        return part
    return {
        name: value.tolist() if isinstance(value, np.ndarray) else value
        for name, value in vars(part).items()
    }


Number = Annotated[float | None, BeforeValidator(_listed)]
Numbers = Annotated[list[Number], BeforeValidator(_listed)]
Table = Annotated[list[Numbers], BeforeValidator(_listed)]
Curve = Annotated[list[Number], BeforeValidator(_short)]
AnyObject = Annotated[dict[str, Any], BeforeValidator(_members)]

CONSTANTS = {**dict.fromkeys(("Ex", "Ey", "Gxy", "Gxz", "Gyz"), "Pa"), "a0": "1/s", "a1": "s"}
"""Names of the constants by which results are found, with their units."""

Level = Literal["usable", "with_care", "do_not_use"]


class Part(BaseModel):
    """A part of a result, made of the core's dataclass of the same members."""

    model_config = ConfigDict(extra="allow", from_attributes=True)


_MODELS: dict[type, type[Part]] = {}


def part_of(shown: type, name: str, lacking: str = "", **otherwise: Any) -> Any:
    """The model of a dataclass of the core.

    Args:
        shown: the dataclass; its docstrings become descriptions, and what it has `BESIDE` is none
            of the document's.
        name: of the schema.
        lacking: members that documents of earlier builds lack: they may be absent, and null unless
            the core's are empty without being stated.
        otherwise: types of members that JSON has otherwise than the core.
    """
    types, said = get_type_hints(shown), described(shown)
    members: dict[str, Any] = {}
    for each in fields(shown):
        if each.metadata != core.BESIDE:
            kind = otherwise.get(each.name) or _as_json(types[each.name])
            stated: dict[str, Any] = {"description": said[each.name]}
            if each.name in lacking.split() and each.default == ():
                stated["default_factory"] = list
            elif each.name in lacking.split():
                kind, stated["default"] = kind | None, None
            members[each.name] = (kind, Field(**stated))
    made = create_model(name, __base__=Part, __doc__=inspect.getdoc(shown), **members)
    return _MODELS.setdefault(shown, made)


def described(shown: type) -> dict[str, str]:
    """What a dataclass's docstrings say of its members, by name."""
    body = _classes(shown.__module__)[shown.__name__].body
    return {
        member.target.id: " ".join(text.value.value.split())
        for member, text in pairwise(body)
        if isinstance(member, ast.AnnAssign)
        and isinstance(member.target, ast.Name)
        and isinstance(text, ast.Expr)
        and isinstance(text.value, ast.Constant)
        and isinstance(text.value.value, str)
    }


@cache
def _classes(module: str) -> dict[str, ast.ClassDef]:
    tree = ast.parse(inspect.getsource(sys.modules[module]))
    return {node.name: node for node in tree.body if isinstance(node, ast.ClassDef)}


def _as_json(kind: Any) -> Any:
    """The type in JSON of a member of the core."""
    origin, inner = get_origin(kind), get_args(kind)
    if is_dataclass(kind):
        return _MODELS.get(kind, AnyObject)  # type: ignore[arg-type]
    if origin is np.ndarray:
        return Numbers
    if type(None) in inner:
        (first,) = (_as_json(each) for each in inner if each is not type(None))
        return Number if first is float else first | None
    if origin is tuple and inner[-1] is ...:
        return list[_as_json(inner[0])]  # type: ignore[misc]
    if origin in (dict, Mapping):
        return dict[str, _as_json(inner[1])]  # type: ignore[misc]
    return kind


class AgreementOut(Part):
    """Agreement of measured and predicted FRFs, 0 to 1."""

    sac: Numbers = Field(description="spectral assurance criterion of each FRF")
    frac: Numbers = Field(description="frequency response assurance criterion of each FRF")
    csac_mean: Number = Field(
        description="mean over the lines of the cross signature assurance criterion"
    )
    csf_mean: Number = Field(description="mean over the lines of the cross signature scale factor")


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


class CorrelationOut(AgreementOut):
    """Agreement of the updated model, and beside it of the initial one."""

    initial: AgreementOut = Field(description="of the initial model")
    held_out: HeldOutOut = Field(description="on data that no fit has seen")
    mac_matrix: Table | None = Field(
        description="rows measured, columns updated model; null without shapes"
    )


VerdictOut = part_of(core.Verdict, "VerdictOut")
FindingOut = part_of(core.Finding, "FindingOut")
OutcomeOut = part_of(core.StageOutcome, "OutcomeOut", stage=str)
BudgetOut = part_of(core.BudgetEntry, "BudgetOut")
ComparableOut = part_of(core.Comparable, "ComparableOut")
ParameterOut = part_of(core.ParameterEstimate, "ParameterOut", "comparable tied_to")
ModeComparisonOut = part_of(
    core.ModeComparison,
    "ModeComparisonOut",
    "measured_damping predicted_damping measured_damping_sd motion energy own_mesh_hz",
)
CurveOut = part_of(core.LawCurve, "CurveOut", frequency_hz=Curve, damping_ratio=Curve)
DampingLawOut = part_of(
    core.DampingModelFit, "DampingLawOut", "standard_deviations curve by_mechanism", bic=Number
)
CommonLawOut = part_of(core.CommonLaw, "CommonLawOut", bic=Number)
OverTemperatureOut = part_of(
    core.CurveOf, "OverTemperatureOut", "law", estimate=Curve, low=Curve, high=Curve
)
TemperatureCurveOut = part_of(core.Curve, "TemperatureCurveOut", temperature_c=Curve)
ConvergenceStepOut = part_of(core.ConvergenceStep, "ConvergenceStepOut")
StartOut = part_of(core.StartHistory, "StartOut")
PartnerOut = part_of(core.Partner, "PartnerOut")
RivalPairingOut = part_of(core.RivalPairing, "RivalPairingOut")
PairingOut = part_of(core.PairingSummary, "PairingOut")
PosteriorOut = part_of(
    core.PosteriorSummary,
    "PosteriorOut",
    "correlation",
    method=Annotated[str, Field(default="laplace")],
    names=Annotated[list[str], Field(default_factory=list)],
    correlation=Table,
)
_OF_RESULT = part_of(
    core.UpdateResult,
    "_OfResult",
    "findings convergence starts pairing model_modes reference_temperature_c curve",
    correlation=CorrelationOut,
    model_modes=list[AnyObject],
    identification=dict[str, Any] | None,
)


class ResultOut(_OF_RESULT):  # type: ignore[misc, valid-type]
    """A result: the verdict and the warnings first."""

    provenance: dict[str, Any] = Field(
        description="inputs with their SHA-256, recipe, versions, host, durations"
    )
    version: int = Field(
        description="of this document's form; results of earlier forms are to be computed again"
    )


AloneOut = part_of(campaigns.CampaignEstimate, "AloneOut")
CampaignPartOut = part_of(campaigns.CampaignPart, "CampaignPartOut")
SaidOut = part_of(conflicts.SourceStatement, "SaidOut")
CauseOut = part_of(
    conflicts.Check,
    "CauseOut",
    kind=Literal["input", "coupons", "campaign", "mass", "foot", "support", "stiffness", "scatter"],
)
ConflictOut = part_of(conflicts.Conflict, "ConflictOut", "odds")
_OF_CAMPAIGNS = part_of(
    campaigns.CampaignsResult,
    "_OfCampaigns",
    "findings conflicts reference_temperature_c curve",
)


class JointResultOut(_OF_CAMPAIGNS):  # type: ignore[misc, valid-type]
    """One material from several campaigns."""

    provenance: dict[str, Any] = Field(description="the request, versions, host")
