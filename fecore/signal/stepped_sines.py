"""Recordings whose loads repeat, as steady sines of a frequency each, joined to one set of FRFs.

A stepped sine is a recording for each frequency, or for a few. Each gives FRFs at the lines of its
own load, without a window. Those between the same sensors and loads are one set over all lines.
Where M recordings have the same line, their values are averaged by their variances v, pair by pair,

    H = Σ_m a_m H_m,    a_m = v_m⁻¹/Σ v⁻¹,    B² = Σ_m |H_m - H|²/v_m/(M - 1)    (mean of the pairs),

and where they differ by more than these say, B > 1, all deviations of the line are B times as large
(Birge, Phys. Rev. 40, 1932).

Errors of different recordings are independent, so that a group of blocks of the set holds the
deviations of one group of each: Σ_g of their products is that of each recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from fecore.arrays import ComplexArray, FloatArray, IntArray
from fecore.findings import Finding, listed, make, remark
from fecore.frf import Dof
from fecore.signal.measured_loads import LoadFrfs

# of a turn that two sines part by within the shorter recording, up to which they have one frequency
_ONE_LINE = 0.05
_CLEAR, _ALIKE = 5.0, 0.05  # B, and relative difference, from which repeats contradict each other
_EXACT = 1e-6  # of a value, the least deviation that is believed
_NAMED = 6  # contradictions that are said

finding = partial(
    make,
    {
        "steps_joined": remark(
            "the loads of {count} recordings repeat: their FRFs are one set of {lines} lines, {low:.4g}"
            " to {high:.4g} Hz"
        ),
        "steps_differ": remark(
            "the FRFs of {files} at {hz:.4g} Hz differ by {percent:.0f} %, {times:.2g} times what"
            " their scatter says: their mean is taken, with the difference as its error",
            "measure that line again, with the same level of the load",
        ),
        "more_steps_differ": remark("{count} more lines that were measured again differ"),
    },
)


def with_steps_joined(
    recordings: Sequence[LoadFrfs], names: Sequence[str] | None = None
) -> list[LoadFrfs]:
    """FRFs of recordings with measured loads, those of loads that repeat joined where they have the
    same sensors and loads; the others as they are.

    Args:
        recordings: of one structure.
        names: of each recording, in messages.
    """
    names = names or [f"recording {number}" for number in range(1, len(recordings) + 1)]
    sets = dict[object, list[int]]()
    for number, each in enumerate(recordings):
        windowed = number if each.window_rate_per_s else None
        both = (_axes(each.responses), _axes(each.references))
        sets.setdefault(
            (windowed, each.quantity, *(tuple(sorted(dofs)) for dofs in both)), []
        ).append(number)
    return [
        recordings[own[0]]
        if len(own) == 1
        else _joined([recordings[k] for k in own], [names[k] for k in own])
        for own in sets.values()
    ]


def _axes(dofs: Sequence[Dof]) -> list[Dof]:
    return [Dof(dof.point, dof.axis) for dof in dofs]


def _joined(recordings: list[LoadFrfs], names: list[str]) -> LoadFrfs:
    """One set of FRFs of recordings with the same sensors and loads, in the order of the first.

    1. Channels: of each recording in the order and the directions of the first.
    2. Lines: those of all recordings, each once.
    3. Values: of each line by its recordings, with their contradictions.
    4. Groups: the deviations of each line in the groups of its recordings.
    """
    first, count = recordings[0], max(each.weights.size for each in recordings)
    # 1. Channels.
    alike = [_ordered(each, first) for each in recordings]
    # 2. Lines.
    member = np.concatenate([np.full(e.frequency_hz.size, k) for k, e in enumerate(alike)])
    place = np.concatenate([np.arange(each.frequency_hz.size) for each in alike])
    hz = np.concatenate([each.frequency_hz for each in alike])
    order = np.argsort(hz, kind="stable")
    length = np.array([each.length_s for each in alike])[member[order]]
    reach = _ONE_LINE / np.minimum(length[1:], length[:-1])
    new = np.diff(hz[order]) > reach
    lines = np.split(order, np.flatnonzero(new) + 1)
    # 3. Values.
    shape = (len(first.responses), len(first.references), len(lines))
    mean, coherence = np.zeros(shape, dtype=complex), np.zeros((shape[0], shape[2]))
    separable = np.zeros(shape[1:], dtype=bool)
    blocks = np.zeros((count, *shape), dtype=complex)
    axis, notes = np.zeros(len(lines)), list[Finding]()
    own_means, variances = ([getattr(e, name) for e in alike] for name in ("mean", "variance"))
    into = _groups_of(alike, count)
    for line, entries in enumerate(lines):
        pairs = [(int(member[k]), int(place[k])) for k in entries]
        known = np.array([alike[m].separable[:, at] for m, at in pairs])
        values = np.array([own_means[m][..., at] for m, at in pairs])
        variance = np.array([variances[m][..., at] for m, at in pairs])
        variance = np.maximum(variance, _EXACT**2 * np.abs(values) ** 2 + _NOTHING)
        weight = known[:, None] / variance
        weight /= np.maximum(weight.sum(axis=0), _TINY)
        mean[..., line] = np.sum(weight * values, axis=0)
        share = weight.mean(axis=(1, 2)) / max(float(weight.mean(axis=(1, 2)).sum()), _TINY)
        axis[line] = share @ hz[entries] if share.any() else hz[entries[0]]
        coherence[:, line] = sum(
            s * alike[m].coherence[:, at] for s, (m, at) in zip(share, pairs, strict=True)
        )
        separable[:, line] = known.any(axis=0)
        birge, note = _contradiction(values, weight, variance, mean[..., line])
        if note is not None:
            files = listed([names[m] for m in sorted({m for m, _ in pairs})], 4)
            percent, times = note
            at_hz = axis[line]
            notes.append(
                finding("steps_differ", files=files, hz=at_hz, percent=percent, times=times)
            )
        # 4. Groups.
        for own, (m, at) in zip(weight, pairs, strict=True):
            off, (groups, factor) = alike[m].blocks[..., at] - own_means[m][..., at], into[m]
            blocks[groups, ..., line] += birge * own * factor[:, None, None] * off
    fewest = min(alike, key=lambda each: each.length_s / each.lag_s)
    more = [finding("more_steps_differ", count=len(notes) - _NAMED)] * (len(notes) > _NAMED)
    joined = finding("steps_joined", count=len(alike), lines=len(lines), low=axis[0], high=axis[-1])
    return replace(
        first,
        frequency_hz=axis,
        blocks=mean + blocks,
        weights=np.full(count, 1 / count),
        lag_s=fewest.lag_s,
        length_s=fewest.length_s,
        coherence=coherence,
        separable=separable,
        notes=(joined, *notes[:_NAMED], *more),
    )


_TINY, _NOTHING = float(np.finfo(float).tiny), 1e-200  # of which the inverse is finite


def _ordered(each: LoadFrfs, first: LoadFrfs) -> LoadFrfs:
    """The same with sensors and loads in the order and along the directions of the first."""
    rows, columns = (
        [_axes(own).index(dof) for dof in _axes(theirs)]
        for own, theirs in (
            (each.responses, first.responses),
            (each.references, first.references),
        )
    )
    of_rows, of_columns = (
        np.array([own[k].sign * dof.sign for k, dof in zip(at, theirs, strict=True)])
        for own, theirs, at in (
            (each.responses, first.responses, rows),
            (each.references, first.references, columns),
        )
    )
    turned = (of_rows[:, None] * of_columns)[..., None]
    return replace(
        each,
        blocks=each.blocks[:, rows][:, :, columns] * turned,
        coherence=each.coherence[rows],
        separable=each.separable[columns],
        responses=first.responses,
        references=first.references,
    )


def _groups_of(recordings: Sequence[LoadFrfs], count: int) -> list[tuple[IntArray, FloatArray]]:
    """Which of so many groups the groups of each recording come into, and (G,) the factor of their
    deviations there: each weighs as before, and few groups scatter as little as they do by chance.
    """
    begin, into = 0, list[tuple[IntArray, FloatArray]]()
    for each in recordings:
        own = each.weights.size
        few = own / max(own - 1, 1) * (count - 1) / count
        into.append(((begin + np.arange(own)) % count, count * each.weights * np.sqrt(few)))
        begin += own
    return into


def _contradiction(
    values: ComplexArray, weight: FloatArray, variance: FloatArray, mean: ComplexArray
) -> tuple[float, tuple[float, float] | None]:
    """B of the (M, N, R) values of a line, at least 1; and where they contradict each other, the
    percent that they differ by and B.
    """
    freedom = np.sum(weight > 0, axis=0).clip(1) - 1
    if not freedom.any():
        return 1.0, None
    square, known = np.abs(values - mean) ** 2, weight > 0
    birge = float(np.sqrt(np.sum(known * square / variance) / freedom.sum()))
    others = np.abs(values[:, None] - values) ** 2 * (known[:, None] & known)
    size = max(float(np.sum(np.abs(mean) ** 2)), _TINY)
    apart = float(np.max(np.sum(others, axis=(2, 3)))) / size
    note = 100 * float(np.sqrt(apart)), birge
    return max(birge, 1.0), note if birge > _CLEAR and apart > _ALIKE**2 else None
