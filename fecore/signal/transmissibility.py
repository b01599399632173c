"""Transmissibilities of responses where no load was measured.

Of N responses x and R of them, the references r, with their power spectra by segments (Bendat and
Piersol, Random Data, 4th ed., ch. 7),

    T = S_xr S_rr⁻¹,    γ² = T S_xrᴴ/S_xx    (multiple coherence),
    E|δT|² = (1 - γ²) S_xx (S_rr⁻¹)_rr/(n_d - R),

n_d as many segments as were independent. T is a property of the structure alone where as many loads
act as there are references, at places that stay; with more of them it holds for these loads, and γ²
falls below 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from fecore.arrays import ComplexArray, FloatArray
from fecore.errors import InputError
from fecore.findings import Finding, listed, make, remark
from fecore.frf import Dof
from fecore.signal.block_spectra import channel_of
from fecore.signal.half_spectra import SEGMENTS, HalfSpectra
from fecore.signal.measured_loads import separated

_OVERLAP = 1 + 4 / 3 / 36
"""Hann segments over the independent ones: three of a block overlap by half, and the spectra of two
neighbours have a correlation of 1/36.
"""

finding = partial(
    make,
    {
        "references_alike": remark(
            "the references at points {points} are alike at {lines} of {all} lines, which are left"
            " out",
            "take one of them alone",
        )
    },
)


@dataclass(frozen=True)
class Transmissibilities:
    """What N responses do for each unit of R references."""

    frequency_hz: FloatArray  # (L,)
    values: ComplexArray  # (N, R, L), without a unit: all are of the highest derivative
    variance: FloatArray  # (N, R, L) E|δT|², half of it in the real and half in the imaginary part
    coherence: FloatArray  # (N, L) multiple coherence, 0 to 1
    responses: tuple[Dof, ...]  # N
    references: tuple[Dof, ...]  # R
    averages: float  # n_d
    notes: tuple[Finding, ...] = ()


def transmissibilities(
    spectra: HalfSpectra, references: Sequence[Dof] | None = None
) -> Transmissibilities:
    """Transmissibilities by the power spectra of a recording.

    Args:
        spectra: of the recording.
        references: some of the spectra's; the first one, in which most of the responses is seen,
            where not stated.

    Raises:
        InputError: a reference is none of the spectra's, stands there twice, or references are alike
            at all lines.
    """
    own = tuple(references) if references else spectra.references[:1]
    columns = [channel_of(dof, spectra.references, "references") for dof in own]
    if len(set(columns)) < len(columns):
        raise InputError("references", "name one sensor twice")
    rows = [spectra.responses.index(dof) for dof in own]
    cross = spectra.crosses[:, columns]
    inverse, known = separated(cross[rows])
    lines = np.flatnonzero(known.all(axis=0))
    points = listed([dof.point for dof in own], 4)
    if not lines.size:
        raise InputError(
            "references", f"those at points {points} are alike at all lines; take one of them"
        )
    values = np.einsum("nrl,rsl->nsl", cross, inverse)[..., lines]
    values[rows] = np.eye(len(own))[..., None]  # without round-off
    power = spectra.autos[:, lines]
    shared = np.einsum("nrl,nrl->nl", values, cross[..., lines].conj()).real
    coherence = np.clip(shared / np.maximum(power, np.finfo(float).tiny), 0, 1)
    coherence[rows] = 1.0
    blocks = spectra.length_s / (2 * spectra.lag_s)
    averages = SEGMENTS * blocks / _OVERLAP
    own_inverse = np.einsum("rrl->rl", inverse).real[:, lines]
    noise = (1 - coherence) * power / (averages - len(own))
    left_out = known.shape[1] - lines.size
    note = finding("references_alike", points=points, lines=left_out, all=known.shape[1])
    return Transmissibilities(
        frequency_hz=spectra.frequency_hz[lines],
        values=values,
        variance=noise[:, None] * own_inverse,
        coherence=coherence,
        responses=spectra.responses,
        references=own,
        averages=float(averages),
        notes=(note,) if left_out else (),
    )
