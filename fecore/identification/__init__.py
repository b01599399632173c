"""FRFs to modes: natural frequencies, damping ratios and shapes, with their covariance."""

from fecore.identification.arrangement import set_with_gaps
from fecore.identification.residues import shapes_at_poles
from fecore.identification.shapes import Shapes, phase_collinearity, turn_real

__all__ = ["Shapes", "phase_collinearity", "set_with_gaps", "shapes_at_poles", "turn_real"]
