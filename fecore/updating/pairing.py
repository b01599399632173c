"""Which measured mode is which of the model's: by shape, or where shapes say nothing by order.

With fewer than three dofs the MAC of any two shapes is 1 or nearly so, and frequencies are all
there is. Modes keep their order when all frequencies of a model are off by a common factor, so
measured and model modes are laid side by side in their order, as sequences are aligned (Needleman
and Wunsch 1970): the factor e^c, which mode of the model was missed and which measured mode has no
partner are those of the least

    Σ_pairs (½ (ln f_e - ln f_n - c)²/σ² - ln p_k) - Σ_missed ln(1 - p_k) + ½ c²/σ_c² + L ·
    (measured modes alone),

p_k the probability that mode k is seen, which is small where the FRFs' points lie near its nodes.
Kinds of modes that swap their order as constants move are a matter for several starts
(`elastic_starts`): each constant moves its own kind. Partners that are held are named by their
kind, so that they stay the same where modes of two kinds cross.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.correlation import Pairing, pair_modes
from fecore.modes import MeasuredModes
from fecore.updating.forward import ForwardState

FEWEST_DOFS = 3
"""Dofs from which shapes distinguish modes."""

Partners = tuple[tuple[int, str, int], ...]
"""Measured modes with the kinds of their partners, and the partners' places among the model's modes
of their kind.
"""

_SCATTER = 0.06  # σ: of kinds of modes about the common factor, as the constants' ratios are off
_FACTOR_SD, _FACTORS = 0.15, np.linspace(-0.5, 0.5, 41)  # σ_c, and the c that are tried
_UNPAIRED = 8.0  # L: a measured mode without a partner is what an offset of four σ would cost
_NEAR_NODE = 0.1  # amplitude over the largest mode's at which a mode is as often missed as seen
_LEAST, _MOST = 0.05, 0.95  # p_k: nothing is sure
_SAME = 1e-9  # relative distance of frequencies that is round-off
# times the model's own error of a frequency: distance within which that error may mix modes
_MIXING = 3.0


def has_shapes(modes: MeasuredModes) -> bool:
    """Whether the modes have shapes that distinguish them."""
    return modes.shapes is not None and len(modes.dofs) >= FEWEST_DOFS


def pair_with(modes: MeasuredModes, state: ForwardState) -> Pairing:
    """Measured modes with those of a solved model, whose first points are those of the shapes."""
    dofs = len(modes.dofs)
    if has_shapes(modes):
        return pair_modes(
            modes.shapes,
            state.shapes[:, :dofs],
            modes.frequency_hz,
            state.frequency_hz,
            hidden=state.hidden,
            mixing=_MIXING * state.forward.specimen.model_error,
            highest_hz=modes.highest_hz,
        )
    seen = probability_seen(modes, state)
    shown = np.setdiff1d(np.arange(state.frequency_hz.size), state.hidden)
    return _among(
        shown,
        pair_in_order(
            modes.frequency_hz, state.frequency_hz[shown], seen[shown], unpaired_cost(modes)
        ),
    )


def pair_best_match(modes: MeasuredModes, state: ForwardState) -> Pairing:
    """The likest partners by shape, however unlike and far apart: for a comparison where no mode
    has a like one.
    """
    dofs = len(modes.dofs)
    return pair_modes(
        modes.shapes,
        state.shapes[:, :dofs],
        modes.frequency_hz,
        state.frequency_hz,
        minimum_mac=0.0,
        maximum_frequency_ratio=np.inf,
        hidden=state.hidden,
    )


def partners_of(pairing: Pairing, kinds: Sequence[str]) -> Partners:
    """Who is paired with whom, whatever other kinds lie between."""
    return tuple(
        (row, kinds[column], kinds[:column].count(kinds[column])) for row, column in pairing.pairs
    )


def exchanged(pairing: Pairing, kinds: Sequence[str]) -> list[Partners]:
    """The partners with one measured mode's other candidate, of another kind, in place of its
    own.
    """
    own = dict(pairing.pairs)
    changes = [
        {row: other} for row, _, other in pairing.ambiguous if kinds[other] != kinds[own[row]]
    ]
    return [
        partners_of(replace(pairing, pairs=tuple({**own, **change}.items())), kinds)
        for change in changes
    ]


def pair_fixed(modes: MeasuredModes, state: ForwardState, partners: Partners) -> Pairing:
    """The pairing with given partners at a solved model; those that the model does not have there
    are left out.
    """
    kinds = state.kinds
    numbers: dict[tuple[str, int], int] = {
        (kind, kinds[:column].count(kind)): column for column, kind in enumerate(kinds)
    }
    pairs = tuple(
        (row, numbers[kind, place]) for row, kind, place in partners if (kind, place) in numbers
    )
    seen = probability_seen(modes, state)
    seen[list(state.hidden)] = 0.0  # so that none of these is a rival, or was missed
    pairing = _described(pairs, modes.frequency_hz, state.frequency_hz, seen)
    return replace(pairing, mac=pair_best_match(modes, state).mac) if has_shapes(modes) else pairing


def _among(shown: IntArray, pairing: Pairing) -> Pairing:
    """A pairing with some of the model's modes, by these modes' numbers among all."""
    at = [int(number) for number in shown]
    return replace(
        pairing,
        pairs=tuple((i, at[j]) for i, j in pairing.pairs),
        unpaired_model=tuple(at[j] for j in pairing.unpaired_model),
        ambiguous=tuple((i, at[j], at[k]) for i, j, k in pairing.ambiguous),
    )


def probability_seen(modes: MeasuredModes, state: ForwardState) -> FloatArray:
    """(m,) p_k of the model's modes: by their amplitude at the shapes' points times that at the
    points that stood still.
    """
    dofs, points = len(modes.dofs), len(state.forward.points)
    amplitude = np.abs(state.shapes)
    if not dofs or not points:
        return np.full(state.frequency_hz.size, _MOST)
    height = amplitude[:, :dofs].max(axis=1) * np.prod(
        amplitude[:, dofs : min(points, dofs + 2)], axis=1
    )
    share = (height / max(float(height.max()), 1e-300) / _NEAR_NODE) ** 2
    return np.asarray(np.clip(share / (1 + share), _LEAST, _MOST))


def unpaired_cost(modes: MeasuredModes) -> FloatArray:
    """(n,) what each measured mode costs without a partner: L, less where it may be none, -ln(1 - P
    + P e^-L).
    """
    probability = np.ones(len(modes)) if modes.probability is None else modes.probability
    with np.errstate(divide="ignore"):
        return np.asarray(-np.logaddexp(np.log(1 - probability), np.log(probability) - _UNPAIRED))


def pair_in_order(
    measured_hz: FloatArray,
    model_hz: FloatArray,
    seen: FloatArray,
    unpaired_costs: FloatArray | None = None,
) -> Pairing:
    """Align ascending measured with ascending model frequencies (module docstring).

    Args:
        measured_hz: (n,).
        model_hz: (m,).
        seen: (m,) p_k.
        unpaired_costs: (n,) of a measured mode without a partner; L where nobody doubts the modes.
    """
    costs = np.full(measured_hz.size, _UNPAIRED) if unpaired_costs is None else unpaired_costs
    n, m = measured_hz.size, model_hz.size
    order = np.argsort(model_hz, kind="stable")
    pair, miss = -np.log(seen[order]), -np.log(1 - seen[order])
    off = np.log(measured_hz[:, None] / np.maximum(model_hz[order], 1e-9)[None, :])
    best = np.full((n + 1, m + 1, _FACTORS.size), np.inf)
    came = np.zeros((n + 1, m + 1, _FACTORS.size), dtype=np.int8)
    best[0] = np.concatenate([[0.0], np.cumsum(miss)])[:, None]
    for i in range(1, n + 1):
        best[i, 0] = best[i - 1, 0] + costs[i - 1]
        came[i, 0] = 1
        for j in range(1, m + 1):
            together = (
                best[i - 1, j - 1]
                + pair[j - 1]
                + ((off[i - 1, j - 1] - _FACTORS) / _SCATTER) ** 2 / 2
            )
            missed = best[i, j - 1] + miss[j - 1]
            unpaired = best[i - 1, j] + costs[i - 1]
            choice = np.stack([together, unpaired, missed])
            came[i, j] = choice.argmin(axis=0)
            best[i, j] = choice.min(axis=0)
    # modes above the last measured one cost nothing
    total = best[n].min(axis=0) + (_FACTORS / _FACTOR_SD) ** 2 / 2
    c = int(total.argmin())
    i, j = n, int(best[n, :, c].argmin())
    pairs: list[tuple[int, int]] = []
    while i > 0:
        step = int(came[i, j, c])
        if step == 0:
            pairs.append((i - 1, int(order[j - 1])))
        i, j = i - (step != 2), j - (step != 1)
    pairs.reverse()
    return _described(tuple(pairs), measured_hz, model_hz, seen)


def detection_cost(
    pairing: Pairing,
    seen: FloatArray,
    model_hz: FloatArray,
    unpaired_costs: FloatArray | None = None,
) -> float:
    """What a pairing in order says against itself, frequencies apart: modes that were missed, and
    seen near their nodes.
    """
    if not pairing.pairs:
        return float("inf")
    paired = np.array([column for _, column in pairing.pairs])
    below = np.setdiff1d(np.flatnonzero(model_hz < model_hz[paired].max() * (1 + _SAME)), paired)
    left = list(pairing.unpaired_measured)
    unpaired = (
        _UNPAIRED * len(left) if unpaired_costs is None else float(unpaired_costs[left].sum())
    )
    return float(-np.log(seen[paired]).sum() - np.log(1 - seen[below]).sum()) + unpaired


def _described(
    pairs: tuple[tuple[int, int], ...],
    measured_hz: FloatArray,
    model_hz: FloatArray,
    seen: FloatArray,
) -> Pairing:
    """The pairing with who stays alone; ambiguous where the next mode that may be seen is nearly as
    near.
    """
    taken = {j for _, j in pairs}
    rows = {i for i, _ in pairs}
    distance = np.abs(np.log(np.maximum(model_hz, 1e-9)[None, :] / measured_hz[:, None]))
    ambiguous = []
    for i, j in pairs:
        others = [
            k
            for k in range(model_hz.size)
            if k not in taken and seen[k] > 0.5 and distance[i, k] < _SCATTER
        ]
        if others:
            k = min(others, key=lambda k: float(distance[i, k]))
            if distance[i, k] < distance[i, j] + _SCATTER / 4:
                ambiguous.append((i, j, k))
    top = float(measured_hz.max())
    return Pairing(
        pairs=pairs,
        mac=None,
        unpaired_measured=tuple(i for i in range(measured_hz.size) if i not in rows),
        unpaired_model=tuple(
            j
            for j in range(model_hz.size)
            if j not in taken and model_hz[j] <= top and seen[j] > 0.5
        ),
        ambiguous=tuple(ambiguous),
    )
