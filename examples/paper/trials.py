"""Stage 2 from stated starts, as the paper tests it (Figs. 3 and 11): do all of them reach one
point?
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fecore.correlation import sac
from fecore.dynamics.damping_laws import RAYLEIGH, damping_rate
from fecore.dynamics.synthesis import ModalFrfModel
from fecore.frf import FrfSet
from fecore.updating.frf_fits import Nuisance, fit_law
from fecore.updating.misfit import FrfMisfit, Weighting


@dataclass(frozen=True)
class Trials:
    """Fits of Rayleigh's law from several starts.

    Attributes:
        starts: (n, 2) a0 in 1/s and a1 in s.
        found: (n, 2) where each ended.
        iterations: (n,) accepted steps.
        sac_before: (n,) mean SAC of the FRFs with the start's damping; sac_after: (n,) with the
            found one.
    """

    starts: np.ndarray
    found: np.ndarray
    iterations: tuple[int, ...]
    sac_before: np.ndarray
    sac_after: np.ndarray

    @property
    def spread(self) -> float:
        """Largest relative distance between two ends."""
        return float(np.max(np.ptp(self.found, axis=0) / np.abs(self.found.mean(axis=0))))


def run(
    frfs: FrfSet,
    model: ModalFrfModel,
    starts: Sequence[tuple[float, float]],
    weighting: Weighting = "linear",
) -> Trials:
    """Fit from each start with the model's natural frequencies as they are; `linear` is Eq. 11 with
    w = 1.
    """
    none = Nuisance.of_exact_law(np.arange(0), np.zeros(0))
    misfit = FrfMisfit(frfs, model, weighting, np.ones(frfs.values.shape))
    fits = [fit_law(misfit, RAYLEIGH, np.array(start), none) for start in starts]

    def mean_sac(coefficients: np.ndarray) -> float:
        rate = damping_rate(RAYLEIGH, coefficients, model.omega)
        return float(np.mean(sac(frfs.values, misfit.predict(model.eigenvalue, rate))))

    return Trials(
        starts=np.array(starts),
        found=np.array([fit.coefficients for fit in fits]),
        iterations=tuple(len(fit.history) - 1 for fit in fits),
        sac_before=np.array([mean_sac(np.array(start)) for start in starts]),
        sac_after=np.array([mean_sac(fit.coefficients) for fit in fits]),
    )
