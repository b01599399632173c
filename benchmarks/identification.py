"""Identification: bias, scatter and stated uncertainty over seeds.

The FRFs are the paper's cantilever (five modes in band, two above it) by closed
forms, so truth is known. Where sdypy-EMA is installed it identifies the same data by its own recipe (LSCF, poles nearest to the
true frequencies picked for it, which is more help than an unattended run would have).
"""

import contextlib
import importlib
import io
import time
from dataclasses import dataclass

import numpy as np

from benchmarks.tables import Table
from fecore.correlation import mac
from fecore.modal import identify
from tests.support.beams import PAPER_HZ, PAPER_ZETA, cantilever_shapes, grid, paper_frfs


@dataclass
class Tally:
    """Estimates of all seeds at one noise level."""

    frequency: np.ndarray
    damping: np.ndarray
    frequency_sd: np.ndarray
    damping_sd: np.ndarray
    worst_mac: np.ndarray
    faults: int
    seconds: float


def identification(seeds: int = 30) -> None:
    """Bias and scatter of f and ζ at two levels of noise, beside sdypy-EMA."""
    for noise in (0.01, 0.05):
        _print(noise, _run(noise, seeds))
        _print_peer(noise, min(seeds, 5))


def _run(noise: float, seeds: int) -> Tally:
    true = cantilever_shapes(grid())[:5]
    rows, macs, faults, began = [], [], 0, time.perf_counter()
    for seed in range(seeds):
        found = identify(paper_frfs(noise, seed)).modes
        if len(found) != 5 or np.any(np.abs(found.frequency_hz / PAPER_HZ - 1) > 0.02):
            faults += 1
            continue
        rows.append((found.frequency_hz, found.damping_ratio, found.frequency_sd_hz, found.damping_sd))
        macs.append(np.diag(mac(found.shapes.real, true)))
    f, zeta, f_sd, zeta_sd = (np.array(v) for v in zip(*rows, strict=True))
    return Tally(f, zeta, f_sd, zeta_sd, np.min(macs, axis=0), faults, (time.perf_counter() - began) / seeds)


def _print(noise: float, tally: Tally) -> None:
    print(f"\n33 FRFs x 1000 lines, {100 * noise:g} % noise, {tally.seconds:.2f} s each")
    print(f"{tally.faults} of {tally.faults + len(tally.damping)} seeds with a lost, repeated or swapped mode")
    of_f, of_zeta = ("bias %:.4f", "sd/scatter:.2f"), ("bias %:.3f", "scatter %:.3f", "sd/scatter:.2f")
    table = Table("", "f true:8", *of_f, "ζ true %:.2f", *of_zeta, "worst MAC:.5f")
    for k in range(5):
        f, zeta = tally.frequency[:, k], tally.damping[:, k]
        hz, ratio, scatter = PAPER_HZ[k], PAPER_ZETA[k], zeta.std(ddof=1)
        seen = 100 * (f.mean() / hz - 1), tally.frequency_sd[:, k].mean() / f.std(ddof=1)
        damped = 100 * (zeta.mean() / ratio - 1), 100 * scatter / ratio, tally.damping_sd[:, k].mean() / scatter
        table.row(hz, *seen, 100 * ratio, *damped, tally.worst_mac[k])


def _print_peer(noise: float, seeds: int) -> None:
    """Bias of sdypy-EMA on some of the same seeds, where it is installed."""
    try:
        ema = importlib.import_module("sdypy.EMA")
    except ImportError:
        print("(sdypy-EMA is not installed: no peer beside this table)")
        return
    rows = []
    began = time.perf_counter()
    for seed in range(seeds):
        frfs = paper_frfs(noise, seed)
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            model = ema.Model(frf=frfs.values, freq=frfs.frequency_hz, lower=5, upper=1000, pol_order_high=60)
            model.get_poles(show_progress=False)
            model.select_closest_poles(list(PAPER_HZ))
        rows.append((model.nat_freq, model.nat_xi))
    f, zeta = (np.array(v, dtype=float) for v in zip(*rows, strict=True))
    title = (
        f"sdypy-EMA at the known frequencies, {len(rows)} seeds, {(time.perf_counter() - began) / len(rows):.2f} s each"
    )
    table = Table(title, "f true:8", "bias %:.4f", "ζ true %:.2f", "bias %:.3f", "seeds with a wrong pole:d")
    for k, (hz, ratio) in enumerate(zip(PAPER_HZ, PAPER_ZETA, strict=True)):
        bias, damped = 100 * (f[:, k].mean() / hz - 1), 100 * (zeta[:, k].mean() / ratio - 1)
        table.row(hz, bias, 100 * ratio, damped, np.sum(np.abs(f[:, k] / hz - 1) > 0.02))
