"""What shear theory misses of a strip or plate, and what a laminate that is not the same everywhere
misses of itself.

Against solids of another code (`tests.support.blind_beams`: cantilevers and free beams, constants
and sizes drawn at random, all modes to 1.6 kHz) the model with the true constants is off by 0.04 to
0.08 % of a frequency (rms), torsion most. All
of it is transverse shear: κ = 5/6 is that of a parabolic stress in a wide plate, and shear
correction factors of the literature reach from π²/12 = 0.822 (Mindlin 1951) to 5(1 + ν)/(6 + 5ν) =
0.85 (Timoshenko) and 0.87 (Cowper 1966). With U_k the share of mode k's strain energy in transverse
shear an error of κ moves every mode alike,

    δf_k/f_k = ½ U_k δκ/κ,

so it is one unknown of 2 %, and no independent error of each mode. Without it 0.002 % is left of
free beams, and 0.006 % of clamped ones, whose root a solid keeps from growing thinner too, what the
mesh misses included.

Beside theory there is the body. Laminates that vary by 1.2 % in thickness over their area
(`fecore.updating.inputs`) miss the frequencies of an even body by 0.1 % (`DISCREPANCY`). A
laboratory that knows its thickness better has a body that varies less, so this part follows the
thickness's standard deviation; the modes may say otherwise (`fecore.updating.posterior`).
"""

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.constants import Body, kind_of
from fecore.body.mechanisms import mechanism_names
from fecore.body.specimen import FlatBody
from fecore.updating.forward import ForwardState
from fecore.updating.inputs import TOLERANCES, Inputs
from fecore.updating.posterior import DISCREPANCY

SHEAR_CORRECTION = "shear correction"
"""The budget's source for the factor of transverse shear."""

SHEAR_CORRECTION_SD = 0.02
"""Relative standard deviation of κ."""

OF_THEORY = 2e-5
"""Prior scale of what theory misses of a frequency beside κ, as a share of it: what is left against
free solids. What a clamp's root adds lies between it and what laminates vary by, as half of the
prior does (`fecore.updating.posterior`).
"""

_TRANSVERSE = ("Gxz", "Gyz", "G13", "G23")


def by_shear_correction(state: ForwardState) -> FloatArray:
    """(n,) relative change of a strip's or plate's elastic frequencies by one standard deviation of
    κ; 0 of other bodies.
    """
    body = state.forward.specimen
    if not isinstance(body, FlatBody):
        return np.zeros(state.frequency_hz.size)
    across = [kind_of(name) in _TRANSVERSE for name in mechanism_names(body)]
    shift: FloatArray = (
        SHEAR_CORRECTION_SD / 2 * state.strain[state.modes.rigid :, across].sum(axis=1)
    )
    return shift


def discrepancy_scale(body: Body, inputs: Inputs) -> float:
    """Prior scale s₀ of the model's independent errors in natural frequencies, as shares of
    them.
    """
    if not isinstance(body, FlatBody):
        return DISCREPANCY
    usual, _ = TOLERANCES["thickness"]
    uneven = min(
        inputs.standard_deviation("thickness", body.thickness) / (usual * body.thickness), 1.0
    )
    return float(np.hypot(OF_THEORY, uneven * np.sqrt(DISCREPANCY**2 - OF_THEORY**2)))
