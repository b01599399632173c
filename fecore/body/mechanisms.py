"""Where a body's strain energy sits: the share of each elastic constant in each mode.

The stiffness is linear in the moduli taken together, so by Euler's theorem on homogeneous functions
the energy of a mode is the sum over moduli q of q ∂/∂q of it:

    U_qk = q φ_kᵀ(∂K/∂q)φ_k / λ_k,        Σ_q U_qk = 1 with the springs of the supports among the q.

For a shell whose constants are Ex, Ey, Gxy, Gxz and Gyz these are bending along and across, twist,
and transverse shear (Ungar and Kerwin, J. Acoust. Soc. Am. 34, 1962; Adams and Bacon, J. Compos.
Mater. 7, 1973). Poisson's ratio has no share of its own: it couples bending along and across. An
isotropic beam has E and G, which its constants E and ν stand for.
"""

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.beam_specimen import BeamSpecimen
from fecore.body.constants import Body
from fecore.quantities import kind_of

SUPPORTS = "supports"
"""The springs of the supports, all together."""

_STEP = 1e-30  # of a logarithm: a complex step has no cancellation


def mechanism_names(body: Body) -> tuple[str, ...]:
    """The q moduli that store a body's strain energy, and `supports` where it stands on springs."""
    moduli = (
        ("E", "G")
        if isinstance(body, BeamSpecimen)
        else tuple(n for n in body.nominal if kind_of(n)[0] in "EG")
    )
    moduli = moduli or tuple(name for name in body.nominal if kind_of(name) == "factor")
    return (*moduli, SUPPORTS) if body.springs else moduli


def mechanism_weights(body: Body, constants: FloatArray, springs: FloatArray) -> FloatArray:
    """(q, k + s) parts of the coefficients of the stiffness that each mechanism holds: ∂c/∂ln q;
    their sum is c.

    Args:
        body: whose.
        constants: (c,) in the order of `body.nominal`.
        springs: (s,) stiffnesses of its springs, the model's last coefficients.
    """
    names = list(body.nominal)
    rows = []
    for name in mechanism_names(body):
        if name == SUPPORTS:
            continue
        stepped = constants.astype(complex)
        if isinstance(body, BeamSpecimen):
            # E at fixed G = E / 2(1 + ν), and G at fixed E: ν follows.
            nu = names.index("nu")
            along = 1.0 if name == "E" else -1.0
            stepped[nu] += 1j * _STEP * along * (1 + constants[nu])
            if name == "E":
                stepped[names.index("E")] *= 1 + 1j * _STEP
        else:
            stepped[names.index(name)] *= 1 + 1j * _STEP
        rows.append(body.stiffness_coefficients(stepped).imag / _STEP)
    weights = np.array(rows)
    if not springs.size:
        return weights
    held = np.zeros((len(rows) + 1, weights.shape[1] + springs.size))
    held[:-1, : weights.shape[1]] = weights
    held[-1, weights.shape[1] :] = springs
    return held
