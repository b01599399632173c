"""Identification: bias, scatter and stated uncertainty over seeds.

The FRFs are the paper's cantilever (five modes in band, two above it) by closed forms, so truth is
known. Where sdypy-EMA is installed it identifies the same data by its own recipe (LSCF, poles
nearest to the true frequencies picked for it, which is more help than an unattended run would
have).
"""

import contextlib
import importlib
import io
import time

import numpy as np

from benchmarks.tables import Table
from fecore.correlation import mac
from fecore.modal import identify
from tests.support.beams import PAPER_HZ, PAPER_ZETA, cantilever_shapes, grid, paper_frfs


def identification(seeds: int = 30) -> None:
    """Bias and scatter of f and ζ at two levels of noise, beside sdypy-EMA."""
    for noise in (0.01, 0.05):
        _ours(noise, seeds)
        _peer(noise, min(seeds, 5))


def _ours(noise: float, seeds: int) -> None:
    true = cantilever_shapes(grid())[:5]
    rows, began = [], time.perf_counter()
    for seed in range(seeds):
        m = identify(paper_frfs(noise, seed)).modes
        if len(m) == 5 and np.all(np.abs(m.frequency_hz / PAPER_HZ - 1) <= 0.02):
            same = np.diag(mac(m.shapes.real, true))
            rows.append((m.frequency_hz, m.damping_ratio, m.frequency_sd_hz, m.damping_sd, same))
    each = (time.perf_counter() - began) / seeds
    print(f"\n33 FRFs x 1000 lines, {100 * noise:g} % noise, {each:.2f} s each")
    print(f"{seeds - len(rows)} of {seeds} seeds with a lost, repeated or swapped mode")
    of_f, of_zeta = (
        ("bias %:.4f", "sd/scatter:.2f"),
        ("bias %:.3f", "scatter %:.3f", "sd/scatter:.2f"),
    )
    table = Table("", "f true:8", *of_f, "ζ true %:.2f", *of_zeta, "worst MAC:.5f")
    for hz, ratio, found in zip(
        PAPER_HZ, PAPER_ZETA, np.moveaxis(np.array(rows), 2, 0), strict=True
    ):
        f, zeta, f_sd, zeta_sd, same = found.T
        scatter = zeta.std(ddof=1)
        seen = 100 * (f.mean() / hz - 1), f_sd.mean() / f.std(ddof=1)
        damped = 100 * (zeta.mean() / ratio - 1), 100 * scatter / ratio, zeta_sd.mean() / scatter
        table.row(hz, *seen, 100 * ratio, *damped, same.min())


def _peer(noise: float, seeds: int) -> None:
    """Bias of sdypy-EMA on some of the same seeds, where it is installed."""
    try:
        ema = importlib.import_module("sdypy.EMA")
    except ImportError:
        print("(sdypy-EMA is not installed: no peer beside this table)")
        return
    rows, began = [], time.perf_counter()
    for seed in range(seeds):
        frfs = paper_frfs(noise, seed)
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            model = ema.Model(
                frf=frfs.values, freq=frfs.frequency_hz, lower=5, upper=1000, pol_order_high=60
            )
            model.get_poles(show_progress=False)
            model.select_closest_poles(list(PAPER_HZ))
        rows.append((model.nat_freq, model.nat_xi))
    f, zeta = (np.array(v, dtype=float) for v in zip(*rows, strict=True))
    each = (time.perf_counter() - began) / seeds
    title = f"sdypy-EMA at the known frequencies, {seeds} seeds, {each:.2f} s each"
    table = Table(
        title, "f true:8", "bias %:.4f", "ζ true %:.2f", "bias %:.3f", "seeds with a wrong pole:d"
    )
    for k, (hz, ratio) in enumerate(zip(PAPER_HZ, PAPER_ZETA, strict=True)):
        bias, damped = 100 * (f[:, k].mean() / hz - 1), 100 * (zeta[:, k].mean() / ratio - 1)
        table.row(hz, bias, 100 * ratio, damped, np.sum(np.abs(f[:, k] / hz - 1) > 0.02))
