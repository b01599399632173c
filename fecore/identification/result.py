"""What an identification hands on."""

from __future__ import annotations

from dataclasses import dataclass

from fecore.arrays import ComplexArray, FloatArray, IntArray
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
class Identification:
    """Modes identified from FRFs, and everything that a reader needs to judge them.

    Attributes:
        modes: frequencies, damping, complex shapes at the roving dofs (positive directions), covariance of (f, ζ).
        shapes: the same shapes in full: realised, mass normalised, standard deviations, modal phase collinearity.
        significance: (n,) what χ² rises by without the mode, in units of the Bayesian criterion's price: 1 is just
        worth it.
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
        seconds: time of each step.
    """

    modes: MeasuredModes
    shapes: Shapes
    significance: FloatArray
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
    seconds: dict[str, float]
