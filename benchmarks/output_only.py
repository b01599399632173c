"""Modes of made recordings of responses: what is found, what is lost, and whether intervals hold.

The loads are none that the method assumes: at all of 33 points, coloured, in gusts that multiply
them by up to some ten, in part the same everywhere. Sensors have noise, hum, drift and 16 bits.
Every third structure has a machine at one point. Modes are drawn without regard to their distance.
"""

import time

import numpy as np
import scipy
from scipy.signal import lfilter

from benchmarks.tables import Table
from fecore.arrays import FloatArray
from fecore.frf import along_z
from fecore.modal import identify_output_only
from fecore.signal import half_spectra

RATE, SECONDS, OVER, POINTS, SENSORS = 256.0, 600.0, 4, 33, 8
TOP = 0.98 * RATE / 2.56
NOISE, HUM, DRIFT, BITS = 0.02, 0.01, 0.05, 16
_NO_PAIR = 1e3  # cost of a mode and a pole that is not it
STRONG = 0.01  # share of the power from which a mode has to be found


def recording(seed: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, float | None]:
    """A made recording: (8, n) accelerations; f, ζ and shares of the power of the modes; the machine's frequency."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(5, 11))
    f = np.sort(np.exp(rng.uniform(np.log(1.5), np.log(1.15 * RATE / 2.56), count)))
    zeta = np.clip(np.exp(rng.normal(np.log(0.009), 0.45, count)), 0.002, 0.04)
    place = rng.uniform(size=(POINTS, 2))
    shapes = np.zeros((POINTS, count))
    for k in range(count):
        for _ in range(3):
            waves = np.pi * rng.integers(0, k + 2, 2)
            along = np.cos(waves[0] * place[:, 0] + rng.uniform(0, 6))
            shapes[:, k] += rng.normal() * along * np.cos(waves[1] * place[:, 1])
    shapes /= np.sqrt(np.mean(shapes**2, axis=0))
    machine = float(rng.uniform(5, 90)) if seed % 3 == 0 else None
    modal = _modal_loads(shapes, machine, rng)
    accelerations = np.array(
        [oscillator(*each) for each in zip(f, zeta, modal, strict=True)], dtype=float
    )
    rows = rng.choice(POINTS, SENSORS, replace=False)
    share = np.square(shapes[rows]).sum(axis=0) * accelerations.var(axis=1)
    return _sensed(shapes[rows] @ accelerations, rng), f, zeta, share / share.sum(), machine


def _modal_loads(shapes: FloatArray, machine: float | None, rng: np.random.Generator) -> FloatArray:
    """(n, N) loads on the modes, OVER times as often as sampled, with 20 s before the recording."""
    step, samples = 1 / RATE / OVER, int((SECONDS + 20) * RATE * OVER)
    everywhere = rng.normal(size=samples)
    colour = np.exp(-2 * np.pi * rng.uniform(20, 200) * step)
    slow = lfilter([1], [1, -np.exp(-step / 8)], rng.normal(size=samples))
    gust = np.exp(0.5 * slow * np.sqrt(1 - np.exp(-2 * step / 8)))
    modal = np.zeros((shapes.shape[1], samples))
    for shape in shapes:
        white = rng.normal(size=samples) + 0.3 * everywhere
        load = gust * (lfilter([1 - colour], [1, -colour], white) + 0.2 * white)
        modal += shape[:, None] * load
    if machine is not None:
        size = rng.uniform(0.1, 1.0) * np.std(modal)
        sine = size * np.sin(2 * np.pi * machine * step * np.arange(samples) + 0.3)
        modal += shapes[rng.integers(POINTS)][:, None] * sine
    return modal


def oscillator(f: float, zeta: float, load: FloatArray) -> FloatArray:
    """Acceleration of q̈ + 2ζωq̇ + ω²q = p, exact for loads linear between samples, decimated."""
    omega, step = 2 * np.pi * f, 1 / RATE / OVER
    state = np.array([[0.0, 1.0], [-(omega**2), -2 * zeta * omega]])
    system = state, np.array([[0.0], [1.0]]), state[1:2], np.array([[1.0]])
    up, down = scipy.signal.ss2tf(*scipy.signal.cont2discrete(system, step, "foh")[:4])
    response = scipy.signal.decimate(lfilter(up[0], down, load), OVER, ftype="fir")
    return np.asarray(response[int(20 * RATE) :])


def _sensed(x: FloatArray, rng: np.random.Generator) -> FloatArray:
    """With noise, hum, drift and a converter."""
    own = x.std(axis=1, keepdims=True)
    time_s = np.arange(x.shape[1]) / RATE
    hum = np.sin(2 * np.pi * 50 * time_s + rng.uniform(0, 6, (len(x), 1)))
    x = x + own.mean() * (NOISE * rng.normal(size=x.shape) + HUM * hum)
    x += DRIFT * own * np.cumsum(rng.normal(size=x.shape), axis=1) / np.sqrt(x.shape[1])
    bit = 6 * np.abs(x).max() / 2**BITS
    return np.asarray(bit * np.round(x / bit))


def output_only(sets: int = 40, first: int = 1000) -> list[str]:
    """Modes of made ten-minute recordings of eight sensors: lost, false, harmonics named, coverage
    of 95 % intervals, processor time.

    Args:
        sets: how many recordings.
        first: seed of the first.
    """
    strong = lost = close = false = machines = named = 0
    z: list[tuple[float, float]] = []
    used = 0.0
    for seed in range(first, first + sets):
        x, f, zeta, share, machine = recording(seed)
        began = time.process_time()
        found = identify_output_only(half_spectra(lambda x=x: [x], RATE, along_z(range(1, 9))))
        used += time.process_time() - began
        modes = found.identification.modes
        assert modes.frequency_sd_hz is not None
        assert modes.damping_sd is not None
        off = np.abs(f[:, None] - modes.frequency_hz)
        off /= 3 * modes.frequency_sd_hz + (f * zeta)[:, None]
        pairs = scipy.optimize.linear_sum_assignment(np.where(off < 1, off, _NO_PAIR))
        own = {int(n): int(k) for n, k in zip(*pairs, strict=True) if off[n, k] < 1}
        false += len(modes) - len(own)
        for n, k in own.items():
            if not _close(f, zeta, n):
                errors = modes.frequency_hz[k] - f[n], modes.damping_ratio[k] - zeta[n]
                z.append((errors[0] / modes.frequency_sd_hz[k], errors[1] / modes.damping_sd[k]))
        wanted = [k for k in range(f.size) if f[k] < TOP and share[k] > STRONG]
        unsure = found.identification.doubtful
        near = np.empty(0) if unsure is None else unsure.modes.frequency_hz
        missed = [
            k
            for k in wanted
            if k not in own and not np.any(np.abs(near - f[k]) < 2 * f[k] * zeta[k])
        ]
        strong, lost = strong + len(wanted), lost + len(missed)
        close += sum(_close(f, zeta, k) for k in missed)
        machines += machine is not None
        named += machine is not None and any(abs(h - machine) < 0.05 for h in found.harmonics_hz)
    errors = np.array(z)
    rms, inside = np.sqrt(np.mean(errors**2, axis=0)), np.mean(np.abs(errors) < 1.96, axis=0)
    table = Table("", "of:58", "figure:14", "goal:24")
    table.row("modes with 1 % of the power", str(strong), "")
    table.row("lost (of them within two half bandwidths of another)", f"{lost} ({close})", "0")
    table.row("false", str(false), "0")
    table.row("machines named", f"{named} of {machines}", "all that are seen")
    table.row(
        "f: 95 % intervals that hold, rms z", f"{inside[0]:.3f}, {rms[0]:.2f}", "0.93-0.97, 0.8-1.2"
    )
    table.row(
        "ζ: 95 % intervals that hold, rms z", f"{inside[1]:.3f}, {rms[1]:.2f}", "0.93-0.97, 0.8-1.2"
    )
    table.row("processor time of a recording, s", f"{used / sets:.2f}", "2")
    return [f"{lost - close} of {strong} modes are lost"] if lost - close > 0.02 * strong else []


def _close(f: FloatArray, zeta: FloatArray, k: int) -> bool:
    """Whether another mode lies within two half bandwidths."""
    return bool(np.min(np.abs(np.delete(f, k) - f[k])) < 2 * f[k] * zeta[k])
