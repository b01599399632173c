"""Which part each of the model's modes takes in stage 2: measured, unmeasured, or moving as a body on its suspension."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.errors import UpdatingError
from fecore.frf import FrfSet
from fecore.modes import MeasuredModes
from fecore.updating.elastic_result import ElasticResult

_FIRST_RATIO = 0.02  # of modes whose damping was not measured


@dataclass(frozen=True)
class ModeRoles:
    """Numbers of modes are among all of the model's, rigid-body modes first, where nothing else is said.

    Attributes:
        pairs: measured and elastic model modes with a resonance in the band: of others the FRFs show no damping.
        shifted: (s,) modes that were measured in the band: they carry a frequency shift.
        first_shift: (s,) measured over model frequency of these, relative.
        unmeasured: (u,) elastic modes without a measured partner in the band: their tails reach into it.
        suspended: (r,) modes that move as a body on its suspension, which damps them as it will.
        rows: n measured modes, by their own numbers, whose damping the law has to explain: not suspended.
        lawful: (n,) the partners of `rows`.
        first_ratio: (n,) damping ratios of `rows` as measured, 2 % where none was.
    """

    pairs: tuple[tuple[int, int], ...]
    shifted: IntArray
    first_shift: FloatArray
    unmeasured: IntArray
    suspended: IntArray
    rows: list[int]
    lawful: IntArray
    first_ratio: FloatArray


def assign_roles(frfs: FrfSet, elastic: ElasticResult, modes: MeasuredModes) -> ModeRoles:
    """The roles of the updated model's modes in a band of FRFs.

    Raises:
        UpdatingError: no paired mode lies in the band, or none of them strains the specimen.
    """
    updated = elastic.updated
    rigid, hz = updated.modes.rigid, modes.frequency_hz
    low, high = frfs.frequency_hz[[0, -1]]
    pairs = tuple((i, j) for i, j in elastic.pairing.pairs if low <= hz[i] <= high)
    if not pairs:
        raise UpdatingError(f"no paired mode lies in the band, {low:g} to {high:g} Hz; fit a wider one", {}, ())
    shifted = np.array([rigid + column for _, column in pairs])
    suspended = np.concatenate([np.arange(rigid), rigid + np.flatnonzero(updated.on_springs)])
    rows = [row for (row, _), mode in zip(pairs, shifted, strict=True) if mode not in suspended]
    if not rows:
        raise UpdatingError("no measured mode strains the specimen: all move on the springs", {}, ())
    ratio = np.nan_to_num(modes.damping_ratio[rows], nan=_FIRST_RATIO)
    return ModeRoles(
        pairs=pairs,
        shifted=shifted,
        first_shift=np.array([hz[i] / updated.frequency_hz[j] - 1 for i, j in pairs]),
        unmeasured=np.setdiff1d(np.arange(rigid, updated.modes.eigenvalue.size), shifted),
        suspended=suspended,
        rows=rows,
        lawful=shifted[~np.isin(shifted, suspended)],
        first_ratio=np.where(ratio > 0, ratio, _FIRST_RATIO),
    )
