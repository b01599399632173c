"""What shear theory misses of shells, and what a laminate that is not the same everywhere misses of
itself.

What is left of theory goes with the strain energy in transverse shear, of which mode k has the
share U_k, so an error of κ = 5/6 moves every mode alike,

    δf_k/f_k = ½ U_k δκ/κ,

and is one unknown of 2 %. Where a body lies in space its walls grow thinner where they are
stretched (`fecore.body.laminate.along_normal`), and waves are met to 0.02 % where they are twelve
thicknesses long; the unknown stands for Poisson's ratios through the thickness, 0.25 ± 0.1, which
are 0.5 to 1.3 % of κ, and for the layer along free edges, where twist asks for 0.7 % more
(Reissner's plate has a torsional stiffness of 1 - 0.6325 t/b, St-Venant's bar 1 - 0.6302 t/b). Of
strips and plates that only bend it stands for all of it: bending of a strip asks for νG/3E of κ, 1
to 2 %, much as twist does. Against solids of another code (`tests.support.blind_beams`: cantilevers
and free beams, constants and sizes drawn at random, all modes to 1.6 kHz, two bricks through the
thickness, which are 1 % too stiff in shear themselves) they are off by 0.04 to 0.08 % of a
frequency (rms), torsion most. Without the unknown 0.002 % is left of free beams, and 0.006 % of
clamped ones, whose root a solid keeps from growing thinner too, what the mesh misses included.

Beside theory there is the body. Laminates that vary by 1.2 % in thickness over their area
(`fecore.updating.inputs`) miss the frequencies of an even body by 0.1 % (`DISCREPANCY`). A
laboratory that knows its thickness better has a body that varies less, so this part follows the
thickness's standard deviation; the modes may say otherwise (`fecore.updating.posterior`).
"""

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.constants import Body
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


def by_shear_correction(state: ForwardState) -> FloatArray:
    """(n,) relative change of the elastic frequencies by one standard deviation of κ of the body's
    shells; 0 without.
    """
    if not state.forward.specimen.has_elements:
        return np.zeros(state.frequency_hz.size)
    return SHEAR_CORRECTION_SD / 2 * state.shear


def discrepancy_scale(body: Body, inputs: Inputs) -> float:
    """Prior scale s₀ of the model's independent errors in natural frequencies, as shares of
    them.
    """
    if (thickness := body.even_thickness) is None:
        return DISCREPANCY
    usual, _ = TOLERANCES["thickness"]
    uneven = min(inputs.standard_deviation("thickness", thickness) / (usual * thickness), 1.0)
    return float(np.hypot(OF_THEORY, uneven * np.sqrt(DISCREPANCY**2 - OF_THEORY**2)))
