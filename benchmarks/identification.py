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
from collections.abc import Callable
from functools import partial

import numpy as np
import scipy

from benchmarks.clock import least, timed
from benchmarks.plain_plscf import HIGHEST, plain_poles
from benchmarks.tables import Table, load
from fecore.correlation import mac
from fecore.frf import Dof, FrfSet
from fecore.modal import identify
from tests.support.beams import (
    PAPER_HZ,
    PAPER_ZETA,
    cantilever_shapes,
    grid,
    paper_frfs,
    read_uff,
)
from tests.support.places import SHARED


def identification(seeds: int = 30) -> None:
    """Bias and scatter of f and ζ at two levels of noise, beside sdypy-EMA; processor time beside
    that of a plain p-LSCF.
    """
    _speed()
    for noise in (0.01, 0.05):
        _ours(noise, seeds)
        _peer(noise, min(seeds, 5))


def _file(name: str) -> FrfSet:
    path = SHARED / name
    if not path.exists():
        raise FileNotFoundError(path)
    return read_uff(path)


def _made(count: int, lines: int, modes: int) -> FrfSet:
    """Accelerances of many points with 1 % of noise."""
    rng = np.random.default_rng(1)
    hz = 0.5 * np.arange(1, lines + 1)
    f, zeta = np.sort(rng.uniform(20, 0.96 * hz[-1], modes)), rng.uniform(0.003, 0.012, modes)
    residue = rng.standard_normal((modes, count)) * rng.uniform(0.5, 1.5, (modes, 1))
    s, w = 2j * np.pi * hz, 2 * np.pi * f[:, None]
    values = residue.T @ (s**2 / (s**2 + 2 * zeta[:, None] * w * s + w**2))
    noise = rng.standard_normal((2, *values.shape))
    values = values + 0.01 * np.abs(values).mean() * (noise[0] + 1j * noise[1])
    points = tuple(Dof(number, 3) for number in range(1, count + 1))
    return FrfSet(hz, values, points, (Dof(count + 1, 3),) * count)


def _ruler(highest_hz: float) -> FrfSet:
    """A steel ruler as somebody measured it, ten FRFs; sensor and quantity are not stated."""
    spectra = scipy.io.loadmat(SHARED / "measured" / "ruler.mat")["yspec"]
    hz = np.linspace(0, 10_000, len(spectra))
    use = hz <= highest_hz
    points = tuple(Dof(number, 3) for number in range(1, 11))
    return FrfSet(hz[use], spectra[use].T.astype(complex), points, (Dof(100, 3),) * 10)


SETS: dict[str, Callable[[], FrfSet]] = {
    "real-like-aeroplane": lambda: _file("blind-open/real-like-aeroplane.uff"),
    "measured aeroplane": lambda: _file("measured/aeroplane.uff"),
    "dam0": lambda: _file("measured/dam0.unv"),
    "ruler to 2 kHz": lambda: _ruler(2000),
    "ruler": lambda: _ruler(np.inf),
    "1,000 made FRFs": lambda: _made(1000, 3200, 40),
    "33 made FRFs": lambda: paper_frfs(0.05, 0, 3200),
}
"""FRFs whose identification is timed; those of others where they are at hand."""


def _speed() -> None:
    """Processor time of all sets beside the peer's in the same run."""
    columns = ("FRFs:d", "lines:d", "modes:d", "uncertain:d", "CPU s:.2f", "plain:.3f", "times:.1f")
    table = Table(f"beside a plain p-LSCF, orders to {HIGHEST}, {load()}", "set:20", *columns)
    for name, read in SETS.items():
        try:
            frfs = read()
        except FileNotFoundError:
            print(f"  ({name} is not at hand)")
            continue
        found, (_, own) = timed(partial(identify, frfs))
        _, (_, plain) = least(partial(plain_poles, frfs))
        sure = sum(why is None for why in found.found.doubt)
        size = frfs.values.shape
        table.row(name, *size, sure, len(found.found.doubt) - sure, own, plain, own / plain)


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
