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


def main(seeds: int = 30) -> None:
    """Print the tables."""
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
    print("   f true   f bias %  sd/scatter   ζ true %   ζ bias %   ζ scatter % sd/scatter   worst MAC")
    for k in range(5):
        f, zeta = tally.frequency[:, k], tally.damping[:, k]
        f_ratio = tally.frequency_sd[:, k].mean() / f.std(ddof=1)
        zeta_ratio = tally.damping_sd[:, k].mean() / zeta.std(ddof=1)
        print(
            f"{PAPER_HZ[k]:9.2f} {100 * (f.mean() / PAPER_HZ[k] - 1):10.4f} {f_ratio:10.2f}"
            f" {100 * PAPER_ZETA[k]:11.2f} {100 * (zeta.mean() / PAPER_ZETA[k] - 1):10.3f}"
            f" {100 * zeta.std(ddof=1) / PAPER_ZETA[k]:13.3f} {zeta_ratio:10.2f} {tally.worst_mac[k]:11.5f}"
        )


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
    print(
        f"sdypy-EMA at the known frequencies ({len(rows)} seeds, {(time.perf_counter() - began) / len(rows):.2f} s each):"
    )
    for k in range(5):
        off = np.abs(f[:, k] / PAPER_HZ[k] - 1) > 0.02
        print(
            f"{PAPER_HZ[k]:9.2f} {100 * (f[:, k].mean() / PAPER_HZ[k] - 1):10.4f} {'':10}"
            f" {100 * PAPER_ZETA[k]:11.2f} {100 * (zeta[:, k].mean() / PAPER_ZETA[k] - 1):10.3f}"
            f"   {'wrong pole in ' + str(int(off.sum())) + ' seeds' if off.any() else ''}"
        )
