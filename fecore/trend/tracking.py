"""Which modes of several campaigns are the same: tracks, one a mode, from campaign to campaign.

The modes of each campaign are paired with those that the tracks had last, as one assignment
(`fecore.correlation.pair_modes`): by MAC at the degrees of freedom that all of them share, and by
frequency. Without shapes that can be compared, frequency alone decides. A mode that no track
continues begins one; a track that a campaign misses waits for the next.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from fecore.arrays import ComplexArray
from fecore.correlation import pair_modes

Shape = Mapping[tuple[int, int], complex]
"""(grid point, axis 1 to 6) to the value of a mode shape along the positive axis."""

# relative change of frequency from one campaign to the next up to which two modes may be the same
SAME_MODE = 0.15
LEAST_MAC = 0.5  # MAC below which two modes are others, as of pairs with a model
FEWEST_DOFS = 3
"""Shared degrees of freedom from which on shapes are compared: any two shapes at one of them have a
MAC of 1.
"""


@dataclass(frozen=True)
class TrackedMode:
    """A mode of a campaign."""

    frequency_hz: float  # natural frequency, above 0
    shape: Shape = field(default_factory=dict)  # empty where it is not known


def track(campaigns: Sequence[Sequence[TrackedMode]]) -> list[list[int]]:
    """The number of the track of each mode of each campaign, from 0, in the order in which tracks
    begin.

    Args:
        campaigns: in time order, the modes of each in ascending frequency.

    Raises:
        InputError: a frequency is not positive, or a shape not finite.
    """
    latest: list[TrackedMode] = []
    numbers = []
    for modes in campaigns:
        continued = same_modes(modes, latest)
        for place, mode in enumerate(modes):
            if place in continued:
                latest[continued[place]] = mode
            else:
                continued[place] = len(latest)
                latest.append(mode)
        numbers.append([continued[place] for place in range(len(modes))])
    return numbers


def same_modes(modes: Sequence[TrackedMode], others: Sequence[TrackedMode]) -> dict[int, int]:
    """By the place of a mode, that of the other set's mode which it is.

    Args:
        modes: of one set.
        others: of another one.

    Raises:
        InputError: a frequency is not positive, or a shape not finite.
    """
    if not modes or not others:
        return {}
    dofs = sorted(set.intersection(*(set(mode.shape) for mode in (*modes, *others))))
    compared = len(dofs) >= FEWEST_DOFS
    paired = pair_modes(
        _values(modes, dofs) if compared else None,
        _values(others, dofs) if compared else None,
        np.array([mode.frequency_hz for mode in modes]),
        np.array([mode.frequency_hz for mode in others]),
        minimum_mac=LEAST_MAC,
        maximum_frequency_ratio=1 + SAME_MODE,
    )
    return dict(paired.pairs)


def _values(modes: Sequence[TrackedMode], dofs: Sequence[tuple[int, int]]) -> ComplexArray:
    return np.array([[mode.shape[dof] for dof in dofs] for mode in modes])
