"""Recipes: how a measurement is to be used. Data only, so the same recipe can be run again years later."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from fecore.modal import Options
from fecore.updating.misfit import Weighting
from fecore.updating.parameters import Parameter

DEFAULT_LAWS = ("rayleigh", "caughey3", "caughey4", "generalised", "mechanism", "mechanism_viscous", "modal")
"""The ladder of damping laws that is ranked where a recipe names none; the first is fitted."""


@dataclass(frozen=True)
class HoldOut:
    """What is kept from the fits and predicted afterwards.

    Attributes:
        points: grid points whose FRFs are held out; None holds out those of every eighth point and direction, () none.
        band_hz: lines that are held out, Hz; lines above the fitted band always are.
    """

    points: tuple[int, ...] | None = None
    band_hz: tuple[float, float] | None = None


@dataclass(frozen=True)
class Recipe:
    """All choices of one update; the defaults suit a first look.

    Attributes:
        method: "two_stage", or "joint": constants and damping together from the FRFs, without modes.
        parameters: elastic parameters with their priors; None for `default_parameters` of the body.
        use_shapes: fit the mode shapes too, not the frequencies alone.
        damping_models: names of the damping laws to rank; the first is reported as parameters.
        weighting: residual of the damping update.
        band_hz: lines for the damping update; by default up to half-way past the highest measured mode.
        hold_out: data kept for validation.
        posterior: "laplace", or "mcmc" to sample it.
        seed: of everything random.
        identification: how modes are identified where none are handed in.
        include_doubtful: use the uncertain poles of the identification too.
    """

    method: Literal["two_stage", "joint"] = "two_stage"
    parameters: tuple[Parameter, ...] | None = None
    use_shapes: bool = False
    damping_models: tuple[str, ...] = DEFAULT_LAWS
    weighting: Weighting = "noise"
    band_hz: tuple[float, float] | None = None
    hold_out: HoldOut = field(default_factory=HoldOut)
    posterior: Literal["laplace", "mcmc"] = "laplace"
    seed: int = 0
    identification: Options = field(default_factory=Options)
    include_doubtful: bool = True
