"""What an identification hands on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fecore.arrays import ComplexArray, FloatArray, IntArray
from fecore.errors import IdentificationError
from fecore.findings import Finding, texts
from fecore.frf import Quantity
from fecore.modal.basis import Terms
from fecore.modal.diagram import Stabilisation
from fecore.modal.probability import Feature
from fecore.modal.screening import Refused
from fecore.modal.shapes import Shapes
from fecore.modes import MeasuredModes


@dataclass(frozen=True)
class RefusedPole:
    """A pole that the fit needed, and that is not a mode."""

    frequency_hz: float  # its natural frequency
    damping_ratio: float  # its damping ratio
    reason: str  # why it is not a mode, in words
    probability: float = 0.0  # that it is one all the same
    # the reasons for and against it, those that weigh most first
    features: tuple[Feature, ...] = ()


@dataclass(frozen=True)
class Found:
    """Poles with shapes: modes and uncertain ones, in ascending frequency."""

    # frequencies, damping, complex shapes at the roving dofs (positive directions), the
    # covariance of frequency and damping
    modes: MeasuredModes
    # the same shapes in full: realised, mass normalised, standard deviations, modal phase
    # collinearity
    shapes: Shapes
    # (n,) what χ² would rise by without the pole, in units of the price of its unknowns: 1 is just
    # worth it
    significance: FloatArray
    # n tuples of the reasons for and against, those that weigh most first
    features: tuple[tuple[Feature, ...], ...]
    doubt: tuple[str | None, ...]  # n reasons in words why a pole is uncertain; None for modes

    @property
    def probability(self) -> FloatArray:
        """(n,) that each pole is a mode."""
        assert self.modes.probability is not None, "an identification gives it"
        return self.modes.probability

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
                None if modes.probability is None else modes.probability[which],
            ),
            shapes.select(which),
            self.significance[which],
            tuple(self.features[int(k)] for k in which),
            tuple(self.doubt[int(k)] for k in which),
        )


@dataclass(frozen=True)
class Identification:
    """Modes identified from FRFs, and everything that a reader needs to judge them."""

    found: Found  # modes and uncertain poles
    terms: Terms  # the whole fitted series, with the poles out of band and the residual terms
    stabilisation: Stabilisation  # data of the stabilisation diagram
    used: tuple[str, ...]  # labels of the FRFs that were used, response first
    rows: IntArray  # (N,) their numbers among those handed in
    refused: tuple[Refused, ...]  # the FRFs that were not, with reasons
    refused_poles: tuple[RefusedPole, ...]  # in-band poles that are not modes, with reasons
    notes: tuple[Finding, ...]  # what a user should know
    frequency_hz: FloatArray  # (L,) lines of the fit
    quantity: Quantity  # what kind of FRF `measured` and `predicted` are
    # (N, L) the FRFs as used (signs turned to positive directions), NaN where not measured or
    # damaged
    measured: ComplexArray
    predicted: ComplexArray  # (N, L) the fitted FRFs
    noise_variance: FloatArray  # (N, L) variance E|n|² of each value, as handed in or estimated
    # mean weighted square of the residual over the noise variance: 1 where the model explains all
    # but noise. Exactly 1 by construction where the variance was estimated from the residual.
    noise_ratio: float
    # standard deviation of the relative error of the FRFs that lasts over several lines
    model_error: float
    drift: float  # standard deviation of the relative drift of the frequencies between the FRFs
    delay: float  # of the responses behind the forces, as the phases of the strong modes show it, s
    # number of lines that count as one independent line, by the correlation of the residual
    memory_lines: float
    seconds: dict[str, float]  # time of each step

    def chosen(self, *, include_doubtful: bool = False) -> Found:
        """The modes, with the uncertain poles where they are asked for.

        Raises:
            IdentificationError: all are uncertain, and they are not asked for.
        """
        which = np.array(
            [k for k, why in enumerate(self.found.doubt) if include_doubtful or why is None],
            dtype=np.int64,
        )
        if not which.size:
            f = self.found.modes.frequency_hz
            seen = "; ".join(
                f"{hz:.2f} Hz: {why}" for hz, why in zip(f, self.found.doubt, strict=True)
            )
            raise IdentificationError(
                f"all modes that the FRFs show are uncertain ({seen}); include_doubtful or a lower"
                " threshold takes them"
            )
        return self.found.select(which)

    @property
    def warnings(self) -> tuple[str, ...]:
        """The notes, in words."""
        return texts(self.notes)

    @property
    def modes(self) -> MeasuredModes:
        """The poles whose probability reaches the threshold."""
        return self.chosen().modes

    @property
    def shapes(self) -> Shapes:
        """Their shapes in full."""
        return self.chosen().shapes

    @property
    def doubtful(self) -> Found | None:
        """The uncertain poles, with the reason of each."""
        which = np.array(
            [k for k, why in enumerate(self.found.doubt) if why is not None], dtype=np.int64
        )
        return self.found.select(which) if which.size else None
