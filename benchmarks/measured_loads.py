"""Modes of made recordings with their loads: what is lost, and whether intervals hold, by kind of
load;
"""

import time

import numpy as np
import scipy

from benchmarks.output_only import OVER, RATE, oscillator
from benchmarks.tables import Table
from fecore.arrays import FloatArray
from fecore.frf import along_z
from fecore.modal import identify_measured_loads
from fecore.signal import frfs_of_loads

SECONDS, SETTLED, SENSORS, LOADS = 120.0, 20.0, 6, 2
NOISE = 0.01
KINDS = ("random", "burst", "chirp", "pulses")


def _loads(kind: str, rng: np.random.Generator) -> FloatArray:
    """(2, n) loads, OVER times as often as sampled; random ones coloured and alike in part."""
    samples = int((SECONDS + SETTLED) * RATE * OVER)
    at = np.arange(samples) / (RATE * OVER)
    if kind == "chirp":
        return np.stack([scipy.signal.chirp(at % t, 1, t, 110) for t in (11.0, 14.3)])
    loads = np.zeros((LOADS, samples))
    if kind == "pulses":
        pulse = np.hanning(3 * OVER)
        for row in loads:
            for begin in rng.choice(samples - pulse.size, int(samples / RATE / OVER / 2)):
                row[begin : begin + pulse.size] += rng.uniform(0.5, 2) * pulse
        return loads
    loads = rng.standard_normal(loads.shape)
    loads[1] += 0.5 * loads[0]
    loads = scipy.signal.lfilter([0.3], [1, -0.7], loads)
    return loads * (at % 8 < 4) if kind == "burst" else np.asarray(loads)


def _recording(kind: str, seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(8, n) accelerations of 6 sensors and below them loads; f and ζ of the modes."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(4, 8))
    f = np.sort(np.exp(rng.uniform(np.log(5.0), np.log(85.0), count)))
    zeta = np.clip(np.exp(rng.normal(np.log(0.008), 0.5, count)), 0.002, 0.04)
    shapes = rng.standard_normal((SENSORS, count))
    loads = _loads(kind, rng)
    modal = shapes[:LOADS].T @ loads
    x = shapes @ [oscillator(*each) for each in zip(f, zeta, modal, strict=True)]
    x += NOISE * x.std() * rng.standard_normal(x.shape)
    seen = scipy.signal.decimate(loads, OVER, ftype="fir")[:, int(SETTLED * RATE) :]
    return np.concatenate([x, seen[:, : x.shape[1]]]), f, zeta


def measured_loads(sets: int = 10, first: int = 300) -> list[str]:
    """Modes of made two-minute recordings of six sensors and two loads of each kind: lost, false,
    coverage of 95 % intervals, processor time.

    Args:
        sets: how many recordings of each kind.
        first: seed of the first.
    """
    table, faults = Table("", "of:24", "modes:8", "lost:6", "false:6", "inside:16", "time:8"), []
    for kind in KINDS:
        modes = lost = false = 0
        used, z = 0.0, list[FloatArray]()
        for seed in range(first, first + sets):
            x, f, zeta = _recording(kind, seed)
            began = time.process_time()
            frfs = frfs_of_loads(lambda x=x: [x], RATE, along_z(range(1, 7)), along_z((1, 2)))
            poles = identify_measured_loads(frfs).found.modes
            used += time.process_time() - began
            assert poles.frequency_sd_hz is not None
            assert poles.damping_sd is not None
            pairs = {
                int(np.argmin(abs(f - hz))): k
                for k, hz in enumerate(poles.frequency_hz)
                if np.any(abs(f - hz) < f * zeta + 3 * poles.frequency_sd_hz[k])
            }
            modes, lost = modes + f.size, lost + f.size - len(pairs)
            false += len(poles) - len(pairs)
            z += [
                np.array(
                    [
                        (poles.frequency_hz[k] - f[own]) / poles.frequency_sd_hz[k],
                        (poles.damping_ratio[k] - zeta[own]) / poles.damping_sd[k],
                    ]
                )
                for own, k in pairs.items()
            ]
        inside = np.mean(np.abs(z) < 1.96, axis=0)
        table.row(
            kind,
            str(modes),
            str(lost),
            str(false),
            f"{inside[0]:.2f}, {inside[1]:.2f}",
            f"{used / sets:.2f}",
        )
        if lost + false > 0.1 * modes:
            faults.append(f"{kind}: {lost} of {modes} modes are lost, {false} are false")
    return faults
