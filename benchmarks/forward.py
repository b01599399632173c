"""The forward model beside scikit-fem, pyfe3d and CalculiX: assembly with ten modes, re-solves, FRFs, growth.

The peers are optional: `pip install -e '.[bench]'`, and `ccx` where it is installed. One thread of BLAS for everyone.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import time
from collections.abc import Callable
from unittest.mock import patch

import numpy as np

from benchmarks import forward_peers
from fecore.body.laminate import OrthotropicMaterial, Ply, section
from fecore.body.mesh import rectangle
from fecore.body.model import PlateModel, plate
from fecore.body.specimen import Specimen
from fecore.body.supports import PointMass, Supports
from fecore.dynamics.damping_laws import RAYLEIGH, damping_rate
from fecore.dynamics.eigen import normal_modes
from fecore.frf import Dof
from fecore.updating.forward import ForwardModel, ForwardState
from fecore.updating.parameters import parametrise

PAPER = OrthotropicMaterial(31.66e9, 31.80e9, 6.30e9, 5.37e9, 5.37e9, 0.15, 2012.0)
SPECIMEN = Specimen(0.5, 0.04, 0.01, PAPER)


def median_ms(call: Callable[[], object], repeats: int) -> float:
    """Median time of a call in ms, after one that warms up."""
    call()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(1e3 * (time.perf_counter() - start))
    return float(np.median(times))


def ten_modes(nx: int = 40, ny: int = 4) -> np.ndarray:
    """Assembly and ten modes of the paper's cantilever."""
    model = plate(rectangle(0.5, 0.04, nx, ny), Supports.of("cantilever"))
    return _solve(model)


def _solve(model: PlateModel) -> np.ndarray:
    laminate = section([Ply(PAPER, 0.01)])
    K = model.stiffness.at(model.stiffness_coefficients(laminate))
    M = model.mass.at(model.mass_coefficients(laminate))
    return normal_modes(K, M, 10, model.rigid_modes).frequency_hz


def _unproven() -> np.ndarray:
    """The same modes, as the peers give them: without the count that proves that none is missing."""
    with patch("fecore.dynamics.eigen._missing", lambda *_: 0):
        return ten_modes()


def against_peers() -> None:
    """Assembly + 10 modes at 40 × 4: medians, ratios, and errors against a fine mesh.

    Each figure is from the mesh to the frequencies: mesh, assembly, factorisation, modes; CalculiX as a process, its
    input written and its output read. Ours proves that no mode is missing, which no peer does; so there is a row without.
    """
    reference = ten_modes(120, 12)
    rounds: list[tuple[str, Callable[[], np.ndarray]]] = [("modalbase", ten_modes), ("  without its proof", _unproven)]
    if importlib.util.find_spec("skfem"):
        rounds.append(("scikit-fem", lambda: forward_peers.scikit_fem(SPECIMEN)))
    if importlib.util.find_spec("pyfe3d"):
        rounds.append(("pyfe3d Quad4R", lambda: forward_peers.pyfe3d(SPECIMEN)))
    if shutil.which("ccx"):
        rounds.append(("CalculiX S8R", lambda: forward_peers.calculix(SPECIMEN)))
    print("assembly + 10 modes, 40 x 4     median ms   ratio      CPU ms   bending 1   torsion 1 (error %)")
    times: dict[str, list[tuple[float, float]]] = {name: [] for name, _ in rounds}
    found = {name: call() for name, call in rounds}
    random = np.random.default_rng(0)
    # In turn, so that a busy machine is busy for all; in no order, as each leaves the caches to the next.
    for _ in range(25):
        for name, call in (rounds[i] for i in random.permutation(len(rounds))):
            start, busy = time.perf_counter(), sum(os.times()[:4])
            used = time.process_time()
            call()
            wall = time.perf_counter() - start
            child = sum(os.times()[:4]) - busy  # a process of its own is not in process_time
            cpu = child if "CalculiX" in name else time.process_time() - used
            times[name].append((1e3 * wall, 1e3 * cpu))
    own = float(np.median([wall for wall, _ in times["modalbase"]]))
    for name, _ in rounds:
        errors = [100 * (found[name][np.argmin(np.abs(found[name] - f))] / f - 1) for f in reference[[0, 2]]]
        wall, cpu = np.median(times[name], axis=0)
        print(f"  {name:28s} {wall:9.2f} {wall / own:7.2f} {cpu:11.2f}   {errors[0]:+9.4f}   {errors[1]:+9.4f}")
    if len(rounds) < 5:
        print("  (peers that are not installed are left out)")


def resolves() -> None:
    """A new θ: full and reduced, with all that stage 1 needs."""
    specimen = Specimen(0.5, 0.04, 0.01, PAPER, masses=(PointMass(0.49, 0.015, 0.0048),))
    places = np.array([(x, y) for x in np.linspace(0.05, 0.5, 11) for y in (-0.018, 0.0, 0.018)])
    parametrisation = parametrise(specimen)
    random = np.random.default_rng(0)
    draws = parametrisation.prior_mean * (1 + 0.02 * random.uniform(-1, 1, (200, len(parametrisation.names))))
    full, forward = (
        ForwardModel(specimen, parametrisation, tuple(range(33)), places, 8, reduced) for reduced in (False, True)
    )
    for theta in draws:
        forward.solve(theta)
    calls: dict[str, tuple[ForwardModel, int, Callable[[ForwardState], object]]] = {
        "frequencies": (full, 1, lambda state: state.frequency_hz),
        "reduced frequencies": (forward, 15, lambda state: state.frequency_hz),
        "derivatives": (full, 1, lambda state: state.frequency_jacobian),
        "reduced derivatives": (forward, 15, lambda state: state.frequency_jacobian),
    }
    rounds = []
    for start in range(0, 200, 8):  # in turn, so that a busy machine is busy for all
        some = iter(np.roll(draws, start, axis=0))
        rounds.append([median_ms(lambda m=m, of=of: of(m.solve(next(some))), n) for m, n, of in calls.values()])  # noqa: B023
    took = dict(zip(calls, np.median(rounds, axis=0), strict=True))
    build = median_ms(lambda: ForwardModel(specimen, parametrisation, (0,), places[:1], 8).basis.system, 5)
    size, full_solves = forward.basis.basis.shape[1], forward.basis.full_solves
    print(f"re-solve for new parameters, 8 modes     full ms   reduced ms ({size} vectors)   full/reduced")
    for name in ("frequencies", "derivatives"):
        whole, small = took[name], took[f"reduced {name}"]
        text = "natural frequencies" if name == "frequencies" else "and their derivatives"
        print(f"  {text:36s} {whole:9.2f} {small:12.3f} {whole / small:26.1f}")
    print(f"  making the basis                     {build:9.1f}   ({full_solves} full solves in 200 draws of +-2 %)")


def frfs() -> None:
    """33 FRFs of 3200 lines from a solved state."""
    places = np.array([(x, y) for x in np.linspace(0.05, 0.5, 11) for y in (-0.018, 0.0, 0.018)])
    forward = ForwardModel(SPECIMEN, parametrise(SPECIMEN), tuple(range(33)), places, 10)
    state = forward.solve(forward.parametrisation.prior_mean)
    dofs, frequency = [Dof(point, 3) for point in range(33)], np.linspace(0.3125, 1000, 3200)
    model = state.frf_model([dofs[32]] * 33, dofs)
    rate = damping_rate(RAYLEIGH, np.array([42.25, 1.1e-5]), model.omega)
    took = median_ms(lambda: model.synthesise(frequency, rate), 15)
    copy = np.zeros((33, 3200), dtype=complex)
    limit = median_ms(copy.copy, 50)
    print(f"FRFs 33 x 3200: {took:.2f} ms; {took / limit:.0f} times copying them")


def growth() -> None:
    """Time of a solve (10 modes, factorisation and count included) over the number of dofs."""
    sizes, times = [], []
    print("growth of the solve     dofs   median s   assembly s")
    for nx, ny in ((40, 4), (80, 8), (140, 14), (220, 22), (330, 33)):
        model = plate(rectangle(0.5, 0.04, nx, ny), Supports.of("cantilever"))
        start = time.perf_counter()
        model = plate(rectangle(0.5, 0.04, nx, ny), Supports.of("cantilever"))
        assembly = time.perf_counter() - start
        took = median_ms(lambda model=model: _solve(model), 9 if nx < 100 else 3) / 1e3
        sizes.append(model.stiffness.size)
        times.append(took)
        print(f"  {nx:4d} x {ny:<3d}        {sizes[-1]:9d} {took:10.3f} {assembly:11.3f}")
    exponent = np.polyfit(np.log(sizes), np.log(times), 1)[0]
    print(f"  fitted exponent {exponent:.2f} (target 1.3)")


def main() -> None:
    """Print all tables.

    glibc hands freed memory back at once until a process has freed one large block, as each that has read FRFs has; until then
    page faults take a quarter of a small solve. So one is freed first, for us and for the peers.
    """
    np.empty(4_000_000)
    print(f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores; ratios within this run are what counts")
    against_peers()
    resolves()
    frfs()
    growth()
