"""Recipes: how a measurement is to be used. Data only, so the same recipe can be run again years
later.
"""

from dataclasses import dataclass, field
from typing import Literal

from fecore.body.constants import Parameter
from fecore.dynamics.laws import DEFAULT_LAWS
from fecore.modal import Options
from fecore.updating.misfit import Weighting


@dataclass(frozen=True)
class HoldOut:
    """What is kept from the fits and predicted afterwards."""

    # grid points whose FRFs are held out; None holds out those of every eighth point and direction,
    # () none
    points: tuple[int, ...] | None = None
    # lines that are held out, Hz; lines above the fitted band always are
    band_hz: tuple[float, float] | None = None


@dataclass(frozen=True)
class Recipe:
    """All choices of one update; the defaults suit a first look."""

    # "two_stage", or "joint": constants and damping together from the FRFs, without modes
    method: Literal["two_stage", "joint"] = "two_stage"
    # elastic parameters with their priors; None for `default_parameters` of the body
    parameters: tuple[Parameter, ...] | None = None
    use_shapes: bool = False  # fit the mode shapes too, not the frequencies alone
    # names of the damping laws to rank; the first is reported as parameters
    damping_models: tuple[str, ...] = DEFAULT_LAWS
    weighting: Weighting = "noise"  # residual of the damping update
    # lines for the damping update; by default up to half-way past the highest measured mode
    band_hz: tuple[float, float] | None = None
    hold_out: HoldOut = field(default_factory=HoldOut)  # data kept for validation
    posterior: Literal["laplace", "mcmc"] = "laplace"  # "laplace", or "mcmc" to sample it
    seed: int = 0  # of everything random
    # how modes are identified where none are handed in
    identification: Options = field(default_factory=Options)
    # temperature at which the constants are asked for, °C; None for that of the measurement
    reference_temperature_c: float | None = None
    include_doubtful: bool = True  # use the uncertain poles of the identification too
