"""What a figure costs the server: an FRF's overlay of three curves with its interval, from arrays to Plotly's JSON."""

from __future__ import annotations

import time

import numpy as np

from service.show.figures.frf import FrfCurves, Spread, frf_figure
from service.show.figures.printing import render

TARGET_MS = 30.0
REPEATS = 20


def main() -> None:
    """Print the least and the middle time of some sizes, and their ratio to the target."""
    print(f"{'lines':>8} {'least ms':>9} {'middle ms':>10} {'ratio to 30 ms':>15} {'kB':>6}")
    for lines in (1000, 1601, 6401, 100_000):
        hz = np.linspace(1, 1000, lines)
        values = sum(1e3 * hz**2 / (at**2 - hz**2 + 0.02j * at * hz) for at in (25.0, 160.0, 440.0, 870.0))
        noisy = values * (1 + 0.01 * np.random.default_rng(1).standard_normal(lines))
        models = {"initial": 0.9 * values, "updated": values}
        curves = FrfCurves("benchmark", "accelerance", hz, noisy, models=models, spread=Spread(hz / 1e4, hz / 1e4))
        times, size = [], 0
        for _ in range(REPEATS):
            began = time.perf_counter()
            size = len(render(frf_figure(curves), "plotly"))
            times.append(1e3 * (time.perf_counter() - began))
        middle = float(np.median(times))
        print(f"{lines:8d} {min(times):9.1f} {middle:10.1f} {middle / TARGET_MS:15.2f} {size / 1e3:6.0f}")
