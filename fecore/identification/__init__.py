"""FRFs to modes: natural frequencies, damping ratios and shapes, with their covariance.

`identify` does it all; `shapes_at_poles` finds shapes at poles that a user has typed in. The files in the order of
the data: arrangement, screening, noise, lscf, stabilisation, basis, linear, refinement, compression, error_model, gains,
search, learning, selection, sifting, drift, outliers, pole_search, subsets, guards, remarks, shapes, residues, result,
identify.
"""

from fecore.identification.arrangement import set_with_gaps
from fecore.identification.identify import Options, identify
from fecore.identification.residues import shapes_at_poles
from fecore.identification.result import Found, Identification, RefusedPole
from fecore.identification.screening import Refused
from fecore.identification.shapes import Shapes, phase_collinearity, turn_real
from fecore.identification.stabilisation import Stabilisation

__all__ = [
    "Found",
    "Identification",
    "Options",
    "Refused",
    "RefusedPole",
    "Shapes",
    "Stabilisation",
    "identify",
    "phase_collinearity",
    "set_with_gaps",
    "shapes_at_poles",
    "turn_real",
]
