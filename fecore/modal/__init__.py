"""FRFs to modes: natural frequencies, damping ratios and shapes, with their covariance and
probability.

In the order of the data:

- `findings`: all that can be said of FRFs and of their modes, one table.
- `arrangement`: FRFs on one axis, in positive directions, a roving side and a fixed side; the
  octaves of a band; linear estimates of poles.
- `prepare`: what can be used of them, and how noisy each value is.
- `series`: the modal series, its coefficients in all FRFs by linear least squares, and which more
  poles lower the misfit.
- `judge`: what speaks for a pole being a mode, and one probability of that.
- `errors`: how far poles may be off: errors that last over lines, and tests that differ.
- `refine`: fits at given poles and at the poles of least misfit, with their errors; which poles may
  be modes.
- `search`: the few combinations of many FRFs; which poles these need, and how the structure
  drifted between the tests.
- `shapes`: residues to shapes; two modes under one pole.
- `result`: what an identification hands on, and what a user should know of it.
- `identify`: `identify`, all of it in numbered steps, and `shapes_at_poles` for known poles.
- `recordings`: modes of responses to loads that nobody measured, and of FRFs of any measured load,
  with errors from blocks of the recording.
"""

from fecore.modal.arrangement import set_with_gaps
from fecore.modal.identify import Options, StatedPole, identify, shapes_at_poles
from fecore.modal.judge import Feature, RefusedPole
from fecore.modal.prepare import Refused
from fecore.modal.recordings import OutputOnly, identify_measured_loads, identify_output_only
from fecore.modal.result import Identification, IdentifiedPoles, Stabilisation
from fecore.modal.shapes import Shapes, phase_collinearity, turn_real

__all__ = [
    "Feature",
    "Identification",
    "IdentifiedPoles",
    "Options",
    "OutputOnly",
    "Refused",
    "RefusedPole",
    "Shapes",
    "Stabilisation",
    "StatedPole",
    "identify",
    "identify_measured_loads",
    "identify_output_only",
    "phase_collinearity",
    "set_with_gaps",
    "shapes_at_poles",
    "turn_real",
]
