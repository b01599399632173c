"""FRFs to modes: natural frequencies, damping ratios and shapes, with their covariance and
probability.

`identify` does it all; `shapes_at_poles` finds shapes at poles that a user has typed in. The files
in the order of the data: arrangement, screening, leakage, causality, noise, preparation,
compression, lscf, diagram, basis, linear, refinement, error_model, growth, drift, evidence,
local_pair, weights, probability, fitting, parting, shapes, residues, findings, remarks, result,
identify.
"""

from fecore.modal.arrangement import set_with_gaps
from fecore.modal.diagram import Stabilisation
from fecore.modal.identify import Options, identify
from fecore.modal.probability import Feature
from fecore.modal.residues import shapes_at_poles
from fecore.modal.result import Found, Identification, RefusedPole
from fecore.modal.screening import Refused
from fecore.modal.shapes import Shapes, phase_collinearity, turn_real

__all__ = [
    "Feature",
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
