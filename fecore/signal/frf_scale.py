"""FRFs that are too high or too low as a whole: a wrong sensitivity, unit or range of a channel.

Three things are known of heights before any model is fitted:

- a linear body answers alike both ways: the FRF from p to q is that from q to p (Maxwell, Betti);
- the geometric mean of a body's mobility over a band lies near that of the infinite body without
  ends (Skudrzyk's mean value method, J. Acoust. Soc. Am. 67 (1980) 1105), for a strip in bending

      |Y| = √2 / (4 m' c),     c = √ω (EI/m')^(1/4),

  m' the mass per length. Over 26 simulated and two other strips the mean over all FRFs was 0.85 to
  4.0 times that, mostly 2 to 3, for sensors sit at free ends. EI enters by its fourth root alone,
  so a prior of it is enough;
- of points of one body, hit in one session, none is several times as high as the median of all.
  Lower ones there are, near a clamp.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray
from fecore.errors import InputError
from fecore.findings import Finding
from fecore.frf import Dof, FrfSet, convert
from fecore.signal.findings import finding

_USUAL = 2.2
"""Geometric mean of a strip's mobility over that of the infinite strip."""
_WHOLE = 3.5
"""Factor off it from which a campaign's FRFs have a wrong height: √10 and what the usual one
scatters by.
"""
_HIGHEST = 5.0
"""Of a point, over the median of all points."""
_RECIPROCAL = 3.0
"""Ratio of an FRF to that of the opposite way; noise and hits beside their points change it by tens
of per cent.
"""
_FEWEST = 4  # points that have a median
_FEWEST_LINES = 16  # that a level is the mean of
_LOWEST_HZ = 8.0  # above soft suspensions

Pair = tuple[Dof, Dof]
"""Response and force of an FRF."""


@dataclass(frozen=True)
class Strip:
    """What is known of a strip before it is measured."""

    mass_per_length: float  # kg/m
    bending_stiffness: float  # EI in its thickness' direction, N m²

    def __post_init__(self) -> None:
        for name in ("mass_per_length", "bending_stiffness"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise InputError(name, f"is {getattr(self, name)}, expected a positive number")

    def mobility(self, omega: FloatArray) -> FloatArray:
        """(L,) magnitude of the drive-point mobility of the strip without ends, m/(N s)."""
        speed = np.sqrt(omega) * (self.bending_stiffness / self.mass_per_length) ** 0.25
        magnitude: FloatArray = np.sqrt(2) / (4 * self.mass_per_length * speed)
        return magnitude


class FrfScale:
    """The heights of FRFs that come in parts, on one axis of lines, and what is wrong with them.

    Args:
        frequency_hz: (L,) their lines.
        highest_hz: to which the hammer excites the body well.
    """

    def __init__(self, frequency_hz: FloatArray, highest_hz: float) -> None:
        band = np.flatnonzero((frequency_hz >= _LOWEST_HZ) & (frequency_hz <= highest_hz))
        self._band = slice(int(band[0]), int(band[-1]) + 1) if band.size >= _FEWEST_LINES else None
        self._frequency = frequency_hz
        self._responses: list[Dof] = []
        self._references: list[Dof] = []
        self._levels: list[float] = []

    def add(self, frfs: FrfSet) -> None:
        """The next FRFs."""
        if self._band is None:
            return
        omega = 2 * np.pi * self._frequency[self._band]
        to_mobility = omega / np.abs(convert(omega, frfs.quantity))
        for values in frfs.values[:, self._band]:
            self._levels.append(
                float(np.mean(np.log(np.maximum(np.abs(values) * to_mobility, 1e-300))))
            )
        self._responses += frfs.responses
        self._references += frfs.references

    def wrong(self, strip: Strip | None, damped: str | None = None) -> list[Finding]:
        """What is said of every height that cannot be right.

        Args:
            strip: the body, where it is a strip; what is measured across it (z) bends it. None
                leaves the absolute height open.
            damped: the window that lowers the FRFs of any body, in words; None: there is none.
        """
        if self._band is None:
            return []
        level, pairs = (
            np.array(self._levels),
            list(zip(self._responses, self._references, strict=True)),
        )
        faults = _one_way(pairs, level)
        faults += _above_the_rest(pairs, level)
        across = [abs(response.direction) == abs(force.direction) == 3 for response, force in pairs]
        if strip is not None and any(across):
            usual = np.mean(np.log(strip.mobility(2 * np.pi * self._frequency[self._band])))
            ratio = float(np.exp(np.mean(level[across] - usual))) / _USUAL
            if not 1 / _WHOLE <= ratio <= _WHOLE:
                kind = "strip_height" if damped is None or ratio > 1 else "strip_damped"
                faults.append(finding(kind, times=_times(ratio), window=damped))
        return faults


def _times(ratio: float) -> str:
    return f"{ratio:.2g} times as high as" if ratio > 1 else f"{1 / ratio:.2g} times lower than"


def _one_way(pairs: Sequence[Pair], level: FloatArray) -> list[Finding]:
    """Pairs of points that were measured both ways, with unlike heights."""
    known = {(force, response): i for i, (response, force) in enumerate(pairs)}
    faults = []
    for (force, response), i in known.items():
        back = known.get((response, force))
        if back is None or not i < back:
            continue
        ratio = float(np.exp(level[i] - level[back]))
        if not 1 / _RECIPROCAL <= ratio <= _RECIPROCAL:
            faults.append(
                finding(
                    "one_way",
                    response=response.point,
                    force=force.point,
                    times=_times(ratio),
                )
            )
    return faults


def _above_the_rest(pairs: Sequence[Pair], level: FloatArray) -> list[Finding]:
    """Points that are far higher than the median of the points of the same sensor."""
    faults = []
    by_sensor: dict[Dof, list[int]] = {}
    for i, (response, _) in enumerate(pairs):
        by_sensor.setdefault(response, []).append(i)
    for own in by_sensor.values():
        if len(own) < _FEWEST:
            continue
        ratios = np.exp(level[own] - np.median(level[own]))
        high = [(pairs[i][1].point, r) for i, r in zip(own, ratios, strict=True) if r > _HIGHEST]
        if high:
            places, most = (
                ", ".join(str(point) for point, _ in high),
                max(ratio for _, ratio in high),
            )
            faults.append(finding("above_the_rest", points=places, times=most))
    return faults
