"""What an identification hands on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fecore.arrays import ComplexArray, FloatArray, IntArray
from fecore.errors import IdentificationError
from fecore.frf import Quantity
from fecore.identification.basis import Terms
from fecore.identification.screening import Refused
from fecore.identification.shapes import Shapes
from fecore.identification.stabilisation import Stabilisation
from fecore.modes import MeasuredModes


@dataclass(frozen=True)
class RefusedPole:
    """A pole that the fit needed or the linear stage offered, and that is not reported as a mode.

    Attributes:
        frequency_hz: its natural frequency.
        damping_ratio: its damping ratio.
        reason: why it is not a mode, in words.
    """

    frequency_hz: float
    damping_ratio: float
    reason: str


@dataclass(frozen=True)
class Found:
    """Poles with shapes: modes and doubtful ones, in ascending frequency.

    Attributes:
        modes: frequencies, damping, complex shapes at the roving dofs (positive directions), covariance of (f, ζ).
        shapes: the same shapes in full: realised, mass normalised, standard deviations, modal phase collinearity.
        significance: (n,) evidence for the mode (twice the logarithm of the likelihood ratio against the series without it,
            refined anew), in units of its price: 1 is just worth it.
        doubt: n reasons in words why a mode is doubtful; None for those that are not.
    """

    modes: MeasuredModes
    shapes: Shapes
    significance: FloatArray
    doubt: tuple[str | None, ...]

    def select(self, which: IntArray) -> Found:
        """Some of them, at least one."""
        modes, shapes, n = self.modes, self.shapes, len(self.modes)
        both = np.concatenate([which, n + which])
        return Found(
            MeasuredModes(
                modes.frequency_hz[which],
                modes.damping_ratio[which],
                None if modes.shapes is None else modes.shapes[which],
                modes.dofs,
                None if modes.covariance is None else modes.covariance[np.ix_(both, both)],
            ),
            shapes.select(which),
            self.significance[which],
            tuple(self.doubt[int(k)] for k in which),
        )


@dataclass(frozen=True)
class Identification:
    """Modes identified from FRFs, and everything that a reader needs to judge them.

    Attributes:
        found: modes and doubtful modes.
        terms: the whole fitted series, with the poles out of band and the residual terms.
        stabilisation: data of the stabilisation diagram.
        used: labels of the FRFs that were used, response first; rows: (N,) their numbers among those handed in.
        refused: the FRFs that were not, with reasons.
        refused_poles: in-band poles that are not modes, with reasons.
        warnings: what a user should know, in words.
        frequency_hz: (L,) lines of the fit.
        quantity: what kind of FRF `measured` and `predicted` are.
        measured: (N, L) the FRFs as used (signs turned to positive directions), NaN where not measured or spoilt.
        predicted: (N, L) the fitted FRFs.
        noise_variance: (N, L) variance E|n|² of each value, as handed in or estimated.
        noise_ratio: mean weighted square of the residual over the noise variance: 1 where the model explains all but
            noise. Exactly 1 by construction where the variance was estimated from the residual.
        model_error: standard deviation of the relative error of the FRFs that lasts over several lines.
        drift: standard deviation of the relative drift of the frequencies between the FRFs.
        memory_lines: number of lines that are worth one, by the correlation of the residual.
        seconds: time of each step.
    """

    found: Found
    terms: Terms
    stabilisation: Stabilisation
    used: tuple[str, ...]
    rows: IntArray
    refused: tuple[Refused, ...]
    refused_poles: tuple[RefusedPole, ...]
    warnings: tuple[str, ...]
    frequency_hz: FloatArray
    quantity: Quantity
    measured: ComplexArray
    predicted: ComplexArray
    noise_variance: FloatArray
    noise_ratio: float
    model_error: float
    drift: float
    memory_lines: float
    seconds: dict[str, float]

    def chosen(self, *, include_doubtful: bool = False) -> Found:
        """The modes, with the doubtful ones where they are asked for.

        Raises:
            IdentificationError: all are doubtful, and they are not asked for.
        """
        which = np.array(
            [k for k, why in enumerate(self.found.doubt) if include_doubtful or why is None], dtype=np.int64
        )
        if not which.size:
            f = self.found.modes.frequency_hz
            seen = "; ".join(f"{hz:.2f} Hz: {why}" for hz, why in zip(f, self.found.doubt, strict=True))
            raise IdentificationError(
                f"all modes that the FRFs show are doubtful ({seen}); include_doubtful takes them"
            )
        return self.found.select(which)

    @property
    def modes(self) -> MeasuredModes:
        """The modes that are not doubtful."""
        return self.chosen().modes

    @property
    def shapes(self) -> Shapes:
        """Their shapes in full."""
        return self.chosen().shapes

    @property
    def doubtful(self) -> Found | None:
        """The modes that are doubtful, with the reason of each."""
        which = np.array([k for k, why in enumerate(self.found.doubt) if why is not None], dtype=np.int64)
        return self.found.select(which) if which.size else None
