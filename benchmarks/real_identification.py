"""Identification on FRFs with the faults that measured ones have: modes lost, invented, doubtful; coverage; time.

Run as `python -m benchmarks real_identification`. Four kinds are drawn by seed, each from a random modal model with known
poles:

aeroplane  3 sensors x 74 hammer points, every point a session whose frequencies drift by 0.03 %, two close pairs, three
           suspension modes below 5 Hz (which may be lost), 1601 lines to 200 Hz
bridge     26 FRFs of one sensor to 8 Hz, six modes some of them a few lines apart, leakage that rises as 1/f²
jointed    the bridge to 12.5 Hz, which answers weakly at sums of its frequencies as well: these are no modes
plate      one FRF with its coherence from five hits, an exponential window on the response, a comb of 1 Hz

All have hits beside the point, slightly complex shapes, a smooth relative error of the measuring chain (1.5 to 3 %), white
noise, and hum of the mains.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fecore.errors import IdentificationError
from fecore.frf import Dof, FrfSet
from fecore.identification import identify

SEEDS = int(os.environ.get("IDENTIFICATION_SEEDS", "30"))
_FREQUENCY, _DAMPING = 0.002, 0.10  # tolerances of a mode that counts as right
_HITS = 5


@dataclass(frozen=True)
class Draw:
    """FRFs and the truth about them: `zeta` as the window shows it; `optional` modes may be lost."""

    frfs: FrfSet
    frequency_hz: np.ndarray
    zeta: np.ndarray
    optional: np.ndarray


def aeroplane(seed: int, points: int = 74, sensors: int = 3) -> Draw:
    """222 accelerances in 74 sessions that drift."""
    rng = np.random.default_rng([1, seed])
    hz = np.arange(0, 200.01, 0.125)
    elastic = _spread(rng, int(rng.integers(9, 14)), 15, 185, 0.02)
    for place in rng.choice(elastic.size, 2, replace=False):  # close pairs
        elastic = np.append(elastic, elastic[place] * (1 + rng.uniform(0.005, 0.015)))
    f = np.sort(np.concatenate([rng.uniform(3, 4.5, 3), elastic]))
    zeta = np.where(f < 5, rng.uniform(0.03, 0.06, f.size), rng.uniform(0.001, 0.005, f.size))
    phi, psi = (_shapes(rng, f.size, n) for n in (points, sensors))
    values = np.empty((points, sensors, hz.size), dtype=complex)
    for p in range(points):
        hit = phi[:, p] + 0.03 * rng.standard_normal(f.size)
        drift = 1 + 0.0003 * rng.standard_normal()
        values[p] = _accelerance(hz, f * drift, zeta, hit[:, None] * psi)
    values = values.reshape(points * sensors, -1)
    level = np.median(np.abs(values[:, hz > 10]))
    leak = level * rng.uniform(1, 3) / np.maximum(hz, 0.06) ** 2
    values = _faults(rng, hz, values, 0.03 * level, leak, level * rng.uniform(0.5, 4))
    pairs = [(Dof(100 + j, 3), Dof(1 + p, 3)) for p in range(points) for j in range(sensors)]
    return Draw(_set(hz, values, pairs), f, zeta, f < 5)


def bridge(seed: int, points: int = 26) -> Draw:
    """26 accelerances in which leakage hides everything below the first mode."""
    rng = np.random.default_rng([2, seed])
    hz = np.arange(0, 8.001, 1 / 32)
    f = _spread(rng, 6, rng.uniform(2.2, 2.8), rng.uniform(4.2, 5), 0.025)
    zeta = rng.uniform(0.006, 0.014, 6)
    phi = _shapes(rng, 6, points)
    sensor = rng.choice([-1, 1], (6, 1)) * rng.uniform(0.4, 1.5, (6, 1))
    values = _accelerance(hz, f, zeta, phi * sensor)
    level = np.sqrt(np.mean(np.abs(values[:, (hz > 2) & (hz < 5)]) ** 2))
    leak = level * rng.uniform(0.3, 0.9) / np.maximum(hz, 0.03) ** 2
    values = _faults(rng, hz, values, 0.02 * level, leak, 0.0)
    return Draw(_set(hz, values, [(Dof(i + 1, 3), Dof(22, 3)) for i in range(points)]), f, zeta, f < 0)


def plate(seed: int) -> Draw:
    """One accelerance and its coherence from five hits, with a window of one per second and a comb of interference."""
    rng = np.random.default_rng([3, seed])
    hz = np.arange(20.5, 600.01, 0.5)
    f = _spread(rng, int(rng.integers(8, 15)), rng.uniform(60, 110), 570, 0.012)
    zeta = rng.uniform(0.0035, 0.01, f.size)
    seen = zeta + 1 / (2 * np.pi * f)
    residue = _shapes(rng, f.size, 1)[:, 0] * rng.choice([-1, 1], f.size)
    residue = np.sign(residue.real) * np.maximum(np.abs(residue), 0.4)
    hits = []
    for _ in range(_HITS):
        beside = residue + 0.06 * rng.standard_normal(f.size)
        hits.append(_accelerance(hz, f, seen, beside[:, None])[0])
    level = np.median(np.abs(hits[0]))
    chain = 1 + _smooth(rng, hz, 1, rng.uniform(0.015, 0.03), rng.uniform(4, 16))[0]
    tones = np.zeros(hz.size, dtype=complex)
    for tone in (50.0, 100.0, 150.0, *(rng.integers(55, 180) + np.arange(rng.integers(3, 8)))):
        size = level * rng.uniform(0.05, 0.4)
        for beside, share in ((0, 1.0), (0.5, 0.15), (-0.5, 0.15)):
            tones[np.abs(hz - tone - beside) < 0.1] += size * share
    noise = level * rng.uniform(0.003, 0.01) * (1 + (60 / hz) ** 2)
    each = np.array([h * chain + _gauss(rng, hz.size) * noise + tones * _gauss(rng, 1) for h in hits])
    mean = each.mean(axis=0)
    coherence = np.abs(mean) ** 2 / np.mean(np.abs(each) ** 2, axis=0)
    variance = np.abs(mean) ** 2 * (1 - coherence) / (coherence * _HITS)
    return Draw(_set(hz, mean[None], [(Dof(1, 3), Dof(2, 3))], variance[None]), f, seen, f < 0)


def jointed(seed: int, points: int = 26) -> Draw:
    """A bridge whose joints and bearings work: beside its modes it answers weakly at sums and doubles of their frequencies.

    A weak quadratic spring of 3 to 12 % distortion answers two modes at f_i + f_j, with the product of their shapes and their
    bandwidths together (Worden and Tomlinson 2001, Nonlinearity in Structural Dynamics, 3.2). Such a peak is like a mode in all
    but what it is; no such peak is a mode here.
    """
    rng = np.random.default_rng([5, seed])
    hz = np.arange(0, 12.501, 1 / 32)
    f = _spread(rng, 6, rng.uniform(2.2, 2.8), rng.uniform(4.2, 5), 0.025)
    zeta = rng.uniform(0.006, 0.014, 6)
    residue = _shapes(rng, 6, points) * rng.choice([-1, 1], (6, 1)) * rng.uniform(0.4, 1.5, (6, 1))
    values = _accelerance(hz, f, zeta, residue)
    height = np.linalg.norm(residue, axis=1) / zeta
    for _ in range(4):
        i, j = rng.integers(0, 6, 2)
        both, wide = f[i] + f[j], (zeta[i] * f[i] + zeta[j] * f[j]) / (f[i] + f[j])
        shape = residue[i] * residue[j]
        size = rng.uniform(0.03, 0.12) * height.max() * wide / np.linalg.norm(shape)
        values = values + _accelerance(hz, np.array([both]), np.array([wide]), size * shape[None])
    level = np.sqrt(np.mean(np.abs(values[:, (hz > 2) & (hz < 5)]) ** 2))
    leak = level * rng.uniform(0.3, 0.9) / np.maximum(hz, 0.03) ** 2
    values = _faults(rng, hz, values, 0.02 * level, leak, 0.0)
    return Draw(_set(hz, values, [(Dof(i + 1, 3), Dof(22, 3)) for i in range(points)]), f, zeta, f < 0)


KINDS: dict[str, Callable[[int], Draw]] = {"bridge": bridge, "jointed": jointed, "plate": plate, "aeroplane": aeroplane}


def _spread(rng: np.random.Generator, count: int, low: float, high: float, apart: float) -> np.ndarray:
    """Ascending random frequencies, neighbours at least that share of a frequency apart."""
    while True:
        f = np.sort(np.exp(rng.uniform(np.log(low), np.log(high), count)))
        if np.all(np.diff(f) > apart * f[1:]):
            return f


def _shapes(rng: np.random.Generator, modes: int, points: int) -> np.ndarray:
    """(modes, points) random shapes, complex by a few degrees."""
    real = rng.standard_normal((modes, points))
    return np.asarray(real * np.exp(1j * np.deg2rad(4) * rng.standard_normal((modes, points))))


def _accelerance(hz: np.ndarray, f: np.ndarray, zeta: np.ndarray, residue: np.ndarray) -> np.ndarray:
    """(p, L) of residues (modes, p)."""
    s, w = 2j * np.pi * hz, 2 * np.pi * f[:, None]
    return np.asarray(residue.T @ (s**2 / (s**2 + 2 * zeta[:, None] * w * s + w**2)))


def _gauss(rng: np.random.Generator, *shape: int) -> np.ndarray:
    return np.asarray((rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) * np.sqrt(0.5))


def _smooth(rng: np.random.Generator, hz: np.ndarray, rows: int, size: float, length_hz: float) -> np.ndarray:
    """(rows, L) complex random functions of that rms that change over `length_hz`."""
    nodes = np.arange(hz[0] - 3 * length_hz, hz[-1] + 3 * length_hz, length_hz / 2)
    kernel = np.exp(-0.5 * ((hz - nodes[:, None]) / (length_hz / 1.5)) ** 2)
    kernel /= np.sqrt(np.sum(kernel**2, axis=0))
    return np.asarray(size * _gauss(rng, rows, nodes.size) @ kernel)


def _faults(
    rng: np.random.Generator, hz: np.ndarray, values: np.ndarray, white: float, leak: np.ndarray, hum: float
) -> np.ndarray:
    """The chain's smooth error, white noise, leakage, and hum with a phase of its own in every record."""
    rows = len(values)
    values = values * (1 + _smooth(rng, hz, rows, rng.uniform(0.015, 0.03), rng.uniform(0.02, 0.08) * hz[-1]))
    values = values + _gauss(rng, *values.shape) * (white + leak)
    for tone in (50.0, 100.0, 150.0):
        if tone < hz[-1]:
            values[:, np.argmin(np.abs(hz - tone))] += hum * _gauss(rng, rows)
    return np.asarray(values)


def _set(
    hz: np.ndarray, values: np.ndarray, pairs: list[tuple[Dof, Dof]], variance: np.ndarray | None = None
) -> FrfSet:
    return FrfSet(hz, values, tuple(a for a, _ in pairs), tuple(b for _, b in pairs), "accelerance", variance)


@dataclass
class Tally:
    """What came of the draws of one kind."""

    lost: int = 0
    doubted: int = 0
    invented: int = 0
    doubtful: int = 0
    wrong: int = 0
    modes: int = 0
    inside: int = 0
    intervals: int = 0
    seconds: float = 0.0
    slowest: float = 0.0


def score(draw: Draw, tally: Tally) -> str:
    """Identify a draw with default options and add to the tally; a line about what went wrong."""
    began = time.process_time()
    try:
        found = identify(draw.frfs).found
    except IdentificationError as why:
        tally.lost += int(np.sum(~draw.optional))
        return str(why)[:200]
    seconds = time.process_time() - began
    tally.seconds += seconds
    tally.slowest = max(tally.slowest, seconds)
    f, zeta = found.modes.frequency_hz, found.modes.damping_ratio
    sd_f, sd_zeta = found.modes.frequency_sd_hz, found.modes.damping_sd
    assert sd_f is not None
    assert sd_zeta is not None
    words, taken = [], set()
    for true, ratio, optional in zip(draw.frequency_hz, draw.zeta, draw.optional, strict=True):
        near = [k for k in range(f.size) if k not in taken and abs(f[k] / true - 1) < 3 * _FREQUENCY]
        if not near:
            if not optional:
                tally.lost += 1
                words.append(f"lost {true:.2f}")
            continue
        k = min(near, key=lambda j: abs(f[j] - true))
        taken.add(k)
        if optional:
            continue
        tally.modes += 1
        if found.doubt[k] is not None:
            tally.doubted += 1
            words.append(f"doubts {true:.2f} ({found.doubt[k]})")
        inside = (abs(f[k] - true) < 1.96 * sd_f[k], abs(zeta[k] - ratio) < 1.96 * sd_zeta[k])
        tally.intervals += 2
        tally.inside += int(inside[0]) + int(inside[1])
        if abs(f[k] / true - 1) > _FREQUENCY or not (abs(zeta[k] / ratio - 1) < _DAMPING or inside[1]):
            tally.wrong += 1
            words.append(
                f"wrong {true:.2f}: f {100 * (f[k] / true - 1):+.2f} %, zeta {100 * (zeta[k] / ratio - 1):+.0f} %"
            )
    for k in set(range(f.size)) - taken:
        if np.min(np.abs(f[k] / draw.frequency_hz[draw.optional] - 1), initial=1.0) < 0.2:
            continue  # one of the suspension modes, which the drift has moved
        if found.doubt[k] is None:
            tally.invented += 1
            words.append(f"invented {f[k]:.2f} ({100 * zeta[k]:.2f} %)")
        else:
            tally.doubtful += 1
    return "; ".join(words)


def main() -> None:
    """Print the table."""
    first = int(os.environ.get("IDENTIFICATION_FIRST_SEED", "1000"))
    print(f"{SEEDS} draws of each kind from seed {first}; default options")
    print(
        "kind        modes  lost  invented  doubted  doubtful beside  wrong  in 95 % interval  mean s  most s (processor)"
    )
    wanted = os.environ.get("IDENTIFICATION_KINDS", ",".join(KINDS)).split(",")
    for kind, drawn in ((kind, KINDS[kind]) for kind in wanted):
        tally, words = Tally(), []
        for seed in range(first, first + SEEDS):
            said = score(drawn(seed), tally)
            if said:
                words.append(f"    seed {seed}: {said}")
        print(
            f"{kind:10} {tally.modes:6} {tally.lost:5} {tally.invented:9} {tally.doubted:8} {tally.doubtful:16} {tally.wrong:6}"
            f" {100 * tally.inside / max(tally.intervals, 1):16.0f}% {tally.seconds / SEEDS:7.1f} {tally.slowest:7.1f}"
        )
        print("\n".join(words), flush=True)


if __name__ == "__main__":
    main()
