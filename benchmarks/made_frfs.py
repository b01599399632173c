"""FRFs with the faults that measured ones have, and with known modes: what identification is
calibrated and judged on.

Each kind is drawn by seed:

aeroplane  2 sensors x 20 hammer points (3 x 74 at full size), every point a session whose
frequencies drift by 0.03 %, two
           close pairs, three suspension modes below 5 Hz (which may be lost), 1601 lines to 200 Hz
bridge     26 FRFs of one sensor to 8 Hz, six modes some of them a few lines apart, leakage that rises as 1/f²
softening  the same, each FRF the mean over five hits: the high ones open a joint, and some modes'
           frequencies fall. All FRFs show such a mode alike and not as one resonance, so that a fit
           has it twice with one shape
plate      one FRF with its coherence from five hits, an exponential window on the response, a comb of 1 Hz
wide       12 FRFs, damping of 0.1 to 16 % drawn anew for every mode, some modes one to three lines wide and low, where the
           floor of the noise changes tenfold
wing       18 FRFs of a roving sensor, the first mode two lines wide, low, in company, beside a floor that changes
beam       33 FRFs of a beam with Rayleigh damping, first mode 3 to 16 %, some modes weak at all points, noise of 1 to 5 %
loose      12 FRFs of a lightly damped body; in one of them a sensor or hammer rings on its own
quiet      1 to 12 FRFs of noise and hum
squared,   12 FRFs of a simulated equation of motion with a local spring of F = k₂y² or k₃y³ beside the linear structure,
cubed      half-sine hits of three heights: what answers at sums, differences and multiples of its frequencies is no mode

All but the last two have hits beside the point, slightly complex shapes, a smooth relative error of
the measuring chain (1.5 to 3 %), white noise, and hum of the mains. `harsh` multiplies these errors
by 1 to 6 and the noise by 0.5 to 4.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fecore.frf import Dof, FrfSet

_HITS = 5


@dataclass(frozen=True)
class Draw:
    """FRFs and the truth about them."""

    frfs: FrfSet  # (N, L) what was measured
    # frequency_hz, zeta: (n,) of the modes, `zeta` as the window shows it
    frequency_hz: np.ndarray
    zeta: np.ndarray
    residue: np.ndarray  # (n, N) of each mode in each FRF, of the form of `_accelerance`
    optional: np.ndarray  # (n,) modes that may be lost
    distortions: np.ndarray  # frequencies that look like modes and are none, Hz


@dataclass(frozen=True)
class Harsh:
    """How large the errors of the chain and the noise are, over those of a good laboratory."""

    errors: float = 1.0
    noise: float = 1.0

    @classmethod
    def drawn(cls, seed: int) -> Harsh:
        """Errors of 1 to 6 times, noise of 0.5 to 4 times."""
        rng = np.random.default_rng([9, seed])
        return cls(float(rng.uniform(1, 6)), float(np.exp(rng.uniform(np.log(0.5), np.log(4)))))


GOOD = Harsh()
NONE = np.empty(0)


def aeroplane(seed: int, harsh: Harsh = GOOD, points: int = 20, sensors: int = 2) -> Draw:
    """Accelerances in as many sessions that drift as there are points."""
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
        hit = phi[:, p] + 0.03 * harsh.errors * rng.standard_normal(f.size)
        drift = 1 + 0.0003 * rng.standard_normal()
        values[p] = _accelerance(hz, f * drift, zeta, hit[:, None] * psi)
    values = values.reshape(points * sensors, -1)
    level = np.median(np.abs(values[:, hz > 10]))
    leak = level * rng.uniform(1, 3) / np.maximum(hz, 0.06) ** 2
    values = _faults(rng, hz, values, 0.03 * level, leak, level * rng.uniform(0.5, 4), harsh)
    pairs = [(100 + j, 1 + p) for p in range(points) for j in range(sensors)]
    residue = (phi[:, :, None] * psi[:, None]).reshape(f.size, -1)
    return Draw(_set(hz, values, pairs=pairs), f, zeta, residue, f < 5, NONE)


def bridge(seed: int, harsh: Harsh = GOOD, points: int = 26) -> Draw:
    """26 accelerances in which leakage hides everything below the first mode."""
    return _hit_bridge(np.random.default_rng([2, seed]), harsh, points, np.zeros((1, 6)))


def softening(seed: int, harsh: Harsh = GOOD, points: int = 26) -> Draw:
    """A bridge with a joint that high hits open: half of its modes then fall by up to four half
    bandwidths.
    """
    rng = np.random.default_rng([13, seed])
    falls = rng.uniform(0, 4, 6) * (rng.random(6) < 0.5)
    return _hit_bridge(
        rng, harsh, points, falls * (np.arange(_HITS)[:, None] < rng.integers(1, _HITS))
    )


def _hit_bridge(rng: np.random.Generator, harsh: Harsh, points: int, falls: np.ndarray) -> Draw:
    """The mean over hits, at each of which the modes are so many (hits, 6) half bandwidths
    lower.
    """
    hz = np.arange(0, 8.001, 1 / 32)
    f = _spread(rng, 6, rng.uniform(2.2, 2.8), rng.uniform(4.2, 5), 0.025)
    zeta = rng.uniform(0.006, 0.014, 6)
    phi = _shapes(rng, 6, points)
    sensor = rng.choice([-1, 1], (6, 1)) * rng.uniform(0.4, 1.5, (6, 1))
    lowered = f * (1 - zeta * falls)
    each = np.array([_accelerance(hz, own, zeta, phi * sensor) for own in lowered])
    values, grown = each.mean(axis=0), growth(each, falls.max(axis=1))
    level = np.sqrt(np.mean(np.abs(values[:, (hz > 2) & (hz < 5)]) ** 2))
    leak = level * rng.uniform(0.3, 0.9) / np.maximum(hz, 0.03) ** 2
    values = _faults(rng, hz, values, 0.02 * level, leak, 0.0, harsh)
    frfs = replace(_set(hz, values, 22), growth=grown)
    return _drawn(frfs, np.median(lowered, axis=0), zeta, phi * sensor)


def plate(seed: int, harsh: Harsh = GOOD) -> Draw:
    """One accelerance and its coherence from five hits, with a window of one per second and a comb
    of interference.
    """
    rng = np.random.default_rng([3, seed])
    hz = np.arange(20.5, 600.01, 0.5)
    f = _spread(rng, int(rng.integers(8, 15)), rng.uniform(60, 110), 570, 0.012)
    zeta = rng.uniform(0.0035, 0.01, f.size)
    seen = zeta + 1 / (2 * np.pi * f)
    residue = _shapes(rng, f.size, 1)[:, 0] * rng.choice([-1, 1], f.size)
    residue = np.sign(residue.real) * np.maximum(np.abs(residue), 0.4)
    hits = []
    for _ in range(_HITS):
        beside = residue + 0.06 * harsh.errors * rng.standard_normal(f.size)
        hits.append(_accelerance(hz, f, seen, beside[:, None])[0])
    level = np.median(np.abs(hits[0]))
    chain = 1 + _smooth(rng, hz, 1, harsh.errors * rng.uniform(0.015, 0.03), rng.uniform(4, 16))[0]
    tones = np.zeros(hz.size, dtype=complex)
    for tone in (50.0, 100.0, 150.0, *(rng.integers(55, 180) + np.arange(rng.integers(3, 8)))):
        size = level * rng.uniform(0.05, 0.4)
        for beside, share in ((0, 1.0), (0.5, 0.15), (-0.5, 0.15)):
            tones[np.abs(hz - tone - beside) < 0.1] += size * share
    noise = harsh.noise * level * rng.uniform(0.003, 0.01) * (1 + (60 / hz) ** 2)
    each = np.array(
        [h * chain + _gauss(rng, hz.size) * noise + tones * _gauss(rng, 1) for h in hits]
    )
    mean, grown = (
        each.mean(axis=0),
        growth(each[:, None], np.random.default_rng(seed).normal(size=_HITS)),
    )
    coherence = np.abs(mean) ** 2 / np.mean(np.abs(each) ** 2, axis=0)
    variance = np.abs(mean) ** 2 * (1 - coherence) / (coherence * _HITS)
    frfs = replace(_set(hz, mean[None], 2, variance=variance[None]), growth=grown)
    return _drawn(frfs, f, seen, residue[:, None])


def wide(seed: int, harsh: Harsh = GOOD, points: int = 12) -> Draw:
    """Modes of any damping beside each other; low and narrow ones beside a step of the noise."""
    rng = np.random.default_rng([6, seed])
    hz = np.arange(1.25, 400.0, 0.3125)
    f = _spread(rng, int(rng.integers(6, 10)), 10, 370, 0.06)
    zeta = np.exp(rng.uniform(np.log(0.001), np.log(0.16), f.size))
    zeta = np.maximum(zeta, 0.5 * 0.3125 / f)  # no narrower than a line
    apart = np.minimum(np.diff(f, prepend=0), np.diff(f, append=500)) / f
    zeta = np.minimum(zeta, 0.5 * apart)
    phi, psi = _shapes(rng, f.size, points), _shapes(rng, f.size, 1)
    residue = phi * psi * np.sqrt(zeta)[:, None]
    values = _accelerance(hz, f, zeta, residue)
    level = float(np.median(np.abs(values)))
    floor = 0.02 * level * np.where(hz < rng.uniform(15, 60), rng.choice([0.3, 3.0]), 1.0)
    values = _faults(rng, hz, values, 0.0, harsh.noise * floor, 0.0, harsh)
    return _drawn(_set(hz, values), f, zeta, residue)


def wing(seed: int, harsh: Harsh = GOOD, points: int = 18) -> Draw:
    """A cantilever to 350 Hz whose first mode is two lines wide, low, and beside a floor that
    changes.

    The sensor roves: its mass pulls each mode down by the square of the shape there. The true
    frequency is that of the body with its sensor, the mean over the tests, as wherever a structure
    drifts: no FRF shows the bare body. Every record has noise of its own level, leakage rises
    towards 0 Hz, and humps of a support that is no part of the body stand beside the first mode.
    """
    rng = np.random.default_rng([10, seed])
    hz = np.arange(0.0, 400.1, 0.3125)
    f = np.append(rng.uniform(9, 18), _spread(rng, int(rng.integers(5, 8)), 40, 340, 0.05))
    zeta = np.append(rng.uniform(0.012, 0.025), rng.uniform(0.002, 0.012, f.size - 1))
    phi, psi = _shapes(rng, f.size, points), _shapes(rng, f.size, 1)
    lever = phi * np.where(np.abs(psi) < 0.3, 0.3 * psi / np.abs(psi), psi)
    lever[0] *= rng.uniform(0.1, 0.5)
    pulled = rng.uniform(0.02, 0.15) * zeta.min() * np.abs(phi) ** 2
    values = np.stack(
        [
            _accelerance(hz, f * (1 - pulled[:, p]), zeta, lever[:, p : p + 1])[0]
            for p in range(points)
        ]
    )
    humps = rng.uniform(0.5, 1.5, 2) * f[0]
    hump = _accelerance(
        hz,
        humps,
        rng.uniform(0.05, 0.2, 2),
        0.03 * lever[:2] * np.exp(1j * rng.uniform(0, 7, (2, 1))),
    )
    level = np.median(np.abs(values[:, hz > 5])) * np.exp(
        rng.uniform(np.log(0.3), np.log(3), (points, 1))
    )
    floor = 0.02 * level * np.exp(_smooth(rng, hz, 1, 1.0, 40).real) * (hz / 100 + 0.05)
    values = _faults(
        rng,
        hz,
        values + hump,
        0.0,
        harsh.noise * (floor + 0.002 * level / np.maximum(hz, 0.2)),
        0.0,
        harsh,
    )
    return _drawn(_set(hz, values), f * (1 - pulled.mean(axis=1)), zeta, lever)


def beam(seed: int, harsh: Harsh = GOOD, points: int = 33) -> Draw:
    """Accelerances to 1 kHz of modes with Rayleigh damping, whose heights differ by e either way at
    one standard deviation.
    """
    rng = np.random.default_rng([11, seed])
    hz = np.arange(1.0, 1000.1)
    f = _spread(rng, int(rng.integers(4, 8)), 15, 950, 0.15)
    zeta = rng.uniform(0.03, 0.16) * f[0] / f + rng.uniform(0.002, 0.03) * f / f[-1]
    residue = (
        _shapes(rng, f.size, points)
        * np.exp(rng.standard_normal((f.size, 1)))
        * np.sqrt(zeta / zeta[0])[:, None]
    )
    values = _accelerance(hz, f, zeta, residue)
    white = rng.uniform(0.01, 0.05) * np.sqrt(np.mean(np.abs(values) ** 2, axis=1, keepdims=True))
    values = _faults(
        rng, hz, values, harsh.noise * white, 0.0, 0.0, replace(harsh, errors=0.2 * harsh.errors)
    )
    return _drawn(_set(hz, values), f, zeta, residue)


_SECONDS, _RATE, _HEIGHTS = 8.0, 1600, (0.5, 1.0, 2.0)


def squared(seed: int, harsh: Harsh = GOOD) -> Draw:
    """A structure with a spring of F = k₂y² at one place."""
    return _sprung(seed, harsh, 2)


def cubed(seed: int, harsh: Harsh = GOOD) -> Draw:
    """A structure with a spring of F = k₃y³ at one place."""
    return _sprung(seed, harsh, 3)


def _sprung(seed: int, harsh: Harsh, power: int, points: int = 12) -> Draw:
    """q̈ + 2ζωq̇ + ω²q = φ_p f(t) - φ_s k yᵖ, y = φ_sᵀq, for a hit of three heights at each
    point.
    """
    rng = np.random.default_rng([7, power, seed])
    f = _spread(rng, int(rng.integers(4, 7)), 18, 90, 0.06)
    zeta = rng.uniform(0.008, 0.02, f.size)
    phi, at, sensor = (
        rng.standard_normal((f.size, points)),
        rng.standard_normal(f.size),
        rng.standard_normal(f.size),
    )
    w = 2 * np.pi * f
    usual = np.sqrt(np.sum((at / w) ** 2)) * 0.004  # of y after a hit of height 1 and 4 ms
    share = np.exp(rng.uniform(np.log(0.02), np.log(0.2)))
    k = share * np.median(w**2) / usual ** (power - 1) / np.sum(at**2)
    duration, steps = 0.004, int(_SECONDS * _RATE)
    t = np.arange(steps) / _RATE
    pulse = np.where(t < duration, np.sin(np.pi * t / duration), 0.0)
    lever = np.einsum("np,h->phn", phi, _HEIGHTS)
    q = _moved(w, zeta, pulse, lever, at, k, power)  # (steps, p, h, n)
    # F = k₂y² has no rest beyond a height: a softer one
    while not np.all(np.abs(q[-1]) < np.abs(q).max() / 10):
        k /= 2
        q = _moved(w, zeta, pulse, lever, at, k, power)
    hz = np.fft.rfftfreq(steps, 1 / _RATE)
    keep = (hz >= 2) & (hz <= 200) & (np.arange(hz.size) % 2 == 0)
    force = np.fft.rfft(pulse)[keep]
    motion = np.fft.rfft(q @ sensor, axis=0)[keep].transpose(1, 2, 0) * -(
        (2 * np.pi * hz[keep]) ** 2
    )
    height = np.array(_HEIGHTS)
    each = motion.transpose(1, 0, 2) / (height[:, None, None] * force)
    values = np.einsum("hpl,h->pl", each, height**2 / np.sum(height**2))
    grown = growth(each, np.log(height))
    white = 0.005 * harsh.noise * np.median(np.abs(values))
    values = values + white * _gauss(rng, *values.shape)
    signs = (
        [f[:, None] + f, np.abs(f[:, None] - f)]
        if power == 2
        else [
            np.abs(a * f[:, None, None] + b * f[:, None] + c * f)
            for a, b, c in ((1, 1, 1), (1, 1, -1))
        ]
    )
    false = np.unique(np.concatenate([each.ravel() for each in signs]))
    pairs = [(99, i + 1) for i in range(points)]
    frfs = replace(_set(hz[keep], values, pairs=pairs), growth=grown)
    return _drawn(frfs, f, zeta, phi * sensor[:, None], false[false > 2])


def _moved(
    w: np.ndarray,
    zeta: np.ndarray,
    pulse: np.ndarray,
    lever: np.ndarray,
    at: np.ndarray,
    k: float,
    power: int,
) -> np.ndarray:
    """(steps, ..., n) modal displacements, by the exact step of each oscillator for a force held
    over it (twice: the spring's is predicted, then taken as the mean of both ends).
    """
    dt = 1 / _RATE
    decay, turn = np.exp(-zeta * w * dt), w * np.sqrt(1 - zeta**2) * dt
    c, s = decay * np.cos(turn), decay * np.sin(turn) / (turn / dt)
    a = zeta * w
    q, v = np.zeros(lever.shape), np.zeros(lever.shape)
    out = np.empty((pulse.size, *lever.shape))
    most = 1e3 * np.abs(lever).max() / w.min()

    def spring(q: np.ndarray) -> np.ndarray:
        return np.asarray(k * (q @ at) ** power)[..., None] * at

    for step, force in enumerate(pulse):
        out[step] = q
        now = spring(q)
        for _ in range(2):
            mean = lever * force - now
            rest = mean / w**2
            new_q = rest + (q - rest) * (c + a * s) + v * s
            now = (spring(q) + spring(new_q)) / 2
        v = v * (c - a * s) - (q - rest) * w**2 * s
        q = new_q
        if not np.all(np.abs(q) < most):
            out[step:] = most
            break
    return out


def loose(seed: int, harsh: Harsh = GOOD, points: int = 12) -> Draw:
    """A structure, and a sensor or hammer that rings on its own in one FRF."""
    rng = np.random.default_rng([12, seed])
    hz = np.arange(4.0, 250.1, 0.25)
    f = _spread(rng, int(rng.integers(5, 9)), 15, 230, 0.04)
    zeta = rng.uniform(0.004, 0.02) * np.exp(0.2 * rng.standard_normal(f.size))
    residue = _shapes(rng, f.size, points) * np.exp(0.5 * rng.standard_normal((f.size, 1)))
    values = _accelerance(hz, f, zeta, residue)
    ringing = np.array([rng.uniform(20, 230)])
    size = np.exp(rng.uniform(np.log(0.1), np.log(2))) * rng.choice([-1, 1], (1, 1))
    values[rng.integers(points)] += _accelerance(hz, ringing, rng.uniform(0.003, 0.03, 1), size)[0]
    white = 0.01 * np.median(np.abs(values))
    values = _faults(rng, hz, values, harsh.noise * white, 0.0, 0.0, harsh)
    return _drawn(_set(hz, values), f, zeta, residue, ringing)


def quiet(seed: int, harsh: Harsh = GOOD) -> Draw:
    """Noise and hum alone, in one to twelve FRFs: there is no mode."""
    rng = np.random.default_rng([8, seed])
    hz, points = np.arange(1.0, 801.0), int(rng.integers(1, 13))
    values = harsh.noise * _gauss(rng, points, hz.size) * (1 + (rng.uniform(0, 100) / hz) ** 2)
    values[:, 49] += rng.uniform(0, 20) * _gauss(rng, 1)
    return _drawn(_set(hz, values), NONE, NONE, np.empty((0, points)))


_EVERY = (bridge, softening, plate, aeroplane, wide, wing, beam, loose, quiet, squared, cubed)
KINDS: dict[str, Callable[..., Draw]] = {each.__name__: each for each in _EVERY}


def _spread(
    rng: np.random.Generator, count: int, low: float, high: float, apart: float
) -> np.ndarray:
    """Ascending random frequencies, neighbours at least that share of a frequency apart."""
    while True:
        f = np.sort(np.exp(rng.uniform(np.log(low), np.log(high), count)))
        if np.all(np.diff(f) > apart * f[1:]):
            return f


def _shapes(rng: np.random.Generator, modes: int, points: int) -> np.ndarray:
    """(modes, points) random shapes, complex by a few degrees."""
    real = rng.standard_normal((modes, points))
    return np.asarray(real * np.exp(1j * np.deg2rad(4) * rng.standard_normal((modes, points))))


def growth(each: np.ndarray, height: np.ndarray) -> np.ndarray:
    """(N, L) of (h, N, L) FRFs of hits with a change of height by one standard deviation."""
    x = height - height.mean()
    x = x / np.sqrt(np.mean(x**2)) if x.any() else np.full(x.size, np.nan)
    return np.asarray(np.einsum("hnl,h->nl", each, x) / x.size)


def _accelerance(
    hz: np.ndarray, f: np.ndarray, zeta: np.ndarray, residue: np.ndarray
) -> np.ndarray:
    """(p, L) of residues (modes, p)."""
    s, w = 2j * np.pi * hz, 2 * np.pi * f[:, None]
    return np.asarray(residue.T @ (s**2 / (s**2 + 2 * zeta[:, None] * w * s + w**2)))


def _gauss(rng: np.random.Generator, *shape: int) -> np.ndarray:
    return np.asarray((rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) * np.sqrt(0.5))


def _smooth(
    rng: np.random.Generator, hz: np.ndarray, rows: int, size: float, length_hz: float
) -> np.ndarray:
    """(rows, L) complex random functions of that rms that change over `length_hz`."""
    nodes = np.arange(hz[0] - 3 * length_hz, hz[-1] + 3 * length_hz, length_hz / 2)
    kernel = np.exp(-0.5 * ((hz - nodes[:, None]) / (length_hz / 1.5)) ** 2)
    kernel /= np.sqrt(np.sum(kernel**2, axis=0))
    return np.asarray(size * _gauss(rng, rows, nodes.size) @ kernel)


def _faults(
    rng: np.random.Generator,
    hz: np.ndarray,
    values: np.ndarray,
    white: np.ndarray | float,
    leak: np.ndarray | float,
    hum: float,
    harsh: Harsh,
) -> np.ndarray:
    """The chain's smooth error, white noise, leakage, and hum with a phase of its own in every
    record.
    """
    rows = len(values)
    values = values * (
        1
        + _smooth(
            rng, hz, rows, harsh.errors * rng.uniform(0.015, 0.03), rng.uniform(0.02, 0.08) * hz[-1]
        )
    )
    values = values + _gauss(rng, *values.shape) * (harsh.noise * white + leak)
    for tone in (50.0, 100.0, 150.0):
        if tone < hz[-1]:
            values[:, np.argmin(np.abs(hz - tone))] += hum * _gauss(rng, rows)
    return np.asarray(values)


def _set(
    hz: np.ndarray,
    values: np.ndarray,
    reference: int = 1,
    pairs: Sequence[tuple[int, int]] = (),
    variance: np.ndarray | None = None,
) -> FrfSet:
    """Accelerances of points 1, 2, … to a reference, or of pairs of points."""
    ends = pairs or [(n, reference) for n in range(1, len(values) + 1)]
    responses, references = (tuple(Dof(each[side], 3) for each in ends) for side in (0, 1))
    return FrfSet(hz, values, responses, references, "accelerance", variance)


def _drawn(
    frfs: FrfSet,
    hz: np.ndarray,
    zeta: np.ndarray,
    residue: np.ndarray,
    distortions: np.ndarray = NONE,
) -> Draw:
    """A draw of which no mode may be lost."""
    return Draw(frfs, hz, zeta, residue, np.zeros(hz.size, dtype=bool), distortions)
