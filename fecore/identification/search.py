"""Where poles are searched: combinations of FRFs, the errors that they have, and what their data are worth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray
from fecore.identification.arrangement import Arrangement
from fecore.identification.compression import Compressed
from fecore.identification.error_model import ErrorModel, memory
from fecore.identification.gains import Worth, in_band
from fecore.identification.refinement import Fit, frequency_slope

_LONGEST_MEMORY = 5.0  # lines, while poles are missing: their peaks look like memory


@dataclass(frozen=True)
class Search:
    """Combinations of FRFs and the errors that they have."""

    small: Compressed
    errors: ErrorModel

    @property
    def arrangement(self) -> Arrangement:
        """The combinations."""
        return self.small.arrangement

    def scale(self, fit: Fit) -> Worth:
        """What the data are worth, as far as it can be seen while poles may be missing."""
        tau = memory(fit.residual, fit.variance, self.arrangement.measured)
        return Worth(len(self.small.source.pairs), min(tau, _LONGEST_MEMORY))

    def slope(self, fit: Fit) -> FloatArray:
        """(r, L) mean squares of ∂H/∂ln ω of the combinations, by the resonances of a fit."""
        inside = in_band(self.arrangement, fit.terms.frequency_hz)
        slope = np.abs(self.small.expand(frequency_slope(self.arrangement, fit, inside))) ** 2
        return self.small.squares(slope)

    def variance(self, fit: Fit | None) -> FloatArray:
        """(r, L) of the combinations, with the drift that a fit's resonances imply."""
        return self.errors.variance(np.zeros_like(self.errors.noise) if fit is None else self.slope(fit))
