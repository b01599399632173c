"""ASTM D3518: in-plane shear response from a tensile test of a ±45° laminate.

τ = P / 2A,  γ = ε_x − ε_y
G = Δτ / Δγ                  over 4000 ± 200 µε, starting between 1500 and 2500 µε
offset strength              where the line τ = G (γ − 0.2 %) meets the curve
τ_max                        the largest τ at or below γ = 5 %; beyond it fibres have turned too far
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray
from fecore.coupons.curves import (
    Curve,
    Ends,
    Reduced,
    chord,
    mean_dimension,
    single_run,
    without_jump,
)
from fecore.errors import InputError

START_RANGE = (1500e-6, 2500e-6)  # γ at which the chord may start
CHORD_LENGTH = 4000e-6  # length of the chord in γ
CHORD_TOLERANCE = 200e-6  # how much the length between measured points may differ
OFFSET = 0.002  # γ by which the modulus line is moved
LARGEST_STRAIN = 0.05  # γ at which the test ends


@dataclass(frozen=True)
class ShearResult(Reduced):
    """What D3518 reports of a specimen, SI."""

    # offset_strength_pa, offset_strain: where the 0.2 % line meets the curve; None where it failed
    # before
    offset_strength_pa: float | None
    offset_strain: float | None
    # maximum_stress_pa, maximum_stress_strain: τ_max and its γ
    maximum_stress_pa: float
    maximum_stress_strain: float
    reached_limit: bool  # whether the test was cut at γ = 5 %


def reduce(
    curve: Curve,
    width_m: Sequence[float],
    thickness_m: Sequence[float],
    chord_start: float = 2000e-6,
    ends: Ends = "nearest",
) -> ShearResult:
    """Reduce one specimen.

    Args:
        curve: a single run with a transverse strain.
        width_m: readings along the gauge section, m; three by the standard.
        thickness_m: the same for the thickness.
        chord_start: γ at which the chord starts; the middle of what the standard allows by default.
        ends: `nearest` measured points, as the standard says, or `interpolated`.

    Raises:
        InputError: readings, a curve or a range that cannot be reduced; says which and where.
    """
    if not START_RANGE[0] <= chord_start <= START_RANGE[1]:
        raise InputError("chord_start", f"is {chord_start * 1e6:.0f} µε, expected 1500 to 2500")
    width, thickness = (
        mean_dimension("width_m", width_m),
        mean_dimension("thickness_m", thickness_m),
    )
    warnings: list[str] = []
    run = without_jump(single_run(curve), warnings)
    if run.transverse_strain is None:
        raise InputError("transverse_strain", "is missing; γ = ε_x − ε_y needs it")
    gamma = run.mean_strain - run.transverse_strain
    tau = run.force_n / (2 * width * thickness)
    known = np.isfinite(gamma)
    if not known.all():
        warnings.append(
            "a strain was lost before the maximum force; stresses after it are left out"
        )
    gamma, tau = gamma[known], tau[known]
    across = run.transverse_strain[known]
    if np.dot(tau - tau.mean(), across - across.mean()) > 0:
        raise InputError(
            "transverse_strain", "grows with the force, and is negative in tension: turn its sign"
        )
    line = chord(gamma, chord_start, chord_start + CHORD_LENGTH, ends, field="shear_strain")
    if (
        not START_RANGE[0] <= line.start <= START_RANGE[1]
        or abs(line.stop - line.start - CHORD_LENGTH) > CHORD_TOLERANCE
    ):
        raise InputError(
            "shear_strain",
            f"the closest points span {line.start * 1e6:.0f}–{line.stop * 1e6:.0f} µε, expected"
            " 4000 ± 200 µε from a start between 1500 and 2500; move chord_start or ask for"
            " interpolated ends",
        )
    modulus = line.slope(tau)
    if modulus <= 0:
        raise InputError(
            "curve", "the force falls over the chord range; are force and strains of one test?"
        )
    allowed = gamma <= LARGEST_STRAIN
    at = int(np.argmax(np.where(allowed, tau, -np.inf)))
    offset = _offset_strength(gamma, tau, modulus)
    if offset is None:
        warnings.append("failed before the 0.2 % offset line: no offset strength")
    return ShearResult(
        width_m=width,
        thickness_m=thickness,
        area_m2=width * thickness,
        modulus_pa=modulus,
        regression_modulus_pa=line.regression_slope(gamma, tau),
        chord_range=(line.start, line.stop),
        offset_strength_pa=None if offset is None else offset[1],
        offset_strain=None if offset is None else offset[0],
        maximum_stress_pa=float(tau[at]),
        maximum_stress_strain=float(gamma[at]),
        reached_limit=bool(not allowed.all()),
        warnings=tuple(warnings),
    )


def _offset_strength(
    gamma: FloatArray, tau: FloatArray, modulus: float
) -> tuple[float, float] | None:
    """(γ, τ) of the first crossing of τ = G (γ − offset), linear between points."""
    above = tau - modulus * (gamma - OFFSET)
    beyond = np.flatnonzero((gamma > OFFSET) & (above <= 0))
    if beyond.size == 0 or beyond[0] == 0:
        return None
    i = int(beyond[0])
    share = above[i - 1] / (above[i - 1] - above[i])
    return float(gamma[i - 1] + share * (gamma[i] - gamma[i - 1])), float(
        tau[i - 1] + share * (tau[i] - tau[i - 1])
    )
