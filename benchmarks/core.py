"""The speed of the core beside peers in the same run, and decks of it beside CalculiX.

The peers are optional: `pip install -e '.[bench]'`, and `ccx` where it is installed. One thread of
BLAS for everyone. Ratios come from one run; a busy machine stretches wall clock, so processor time
stands beside it.
"""

import importlib.util
import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from typing import Any
from unittest.mock import patch

import numpy as np

from benchmarks import peers
from benchmarks.clock import least, median_ms, now, timed
from benchmarks.tables import Table, load
from examples.paper.published import (
    CANTILEVER_CONVERGED,
    TABLE_4_COUPONS,
    TABLE_4_UPDATED,
    cantilever,
)
from examples.paper.synthesis import grid, rayleigh_body
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.sections import section
from fecore.body.specimen import Specimen
from fecore.body.structure import Structure
from fecore.body.supports import PointMass, of_boundary
from fecore.dynamics.damping_laws import RAYLEIGH, damping_rate
from fecore.frf import Dof, along_z
from fecore.modal import identify
from fecore.updating.damping_data import damping_data
from fecore.updating.damping_stage import DampingResult, fit_damping, fit_reference
from fecore.updating.elastic import fit_elastic, settled
from fecore.updating.forward import ForwardModel
from fecore.updating.layout import Layout
from fecore.updating.measurement import Measurement
from fecore.updating.parameters import parametrise
from fecore.updating.pipeline import update
from fecore.updating.recipe import Recipe
from fecore.updating.result import UpdateResult
from modalbase.formats.decks import Deck, write_shells, write_solids
from tests.support import calculix
from tests.support.plates import plate, solve
from tests.support.stored_solids import frequencies

PAPER = OrthotropicMaterial(31.66e9, 31.80e9, 6.30e9, 5.37e9, 5.37e9, 0.15, 2012.0)
SPECIMEN = Specimen(0.5, 0.04, 0.01, PAPER)
PLACES = np.array([(x, y) for x in np.linspace(0.05, 0.5, 11) for y in (-0.018, 0.0, 0.018)])


# --- forward ------------------------------------------------------------------------------------------------------------


def forward(rounds: int = 25) -> None:
    """The forward model: assembly with ten modes, re-solves, FRFs, growth; beside scikit-fem,
    pyfe3d and CalculiX.

    glibc hands freed memory back at once until a process has freed one large block, as each that
    has read FRFs has; until then page faults take a quarter of a small solve. So one is freed
    first, for us and for the peers.
    """
    np.empty(4_000_000)
    print(f"{load()}; ratios within this run are what counts")
    _against_peers(rounds)
    _resolves(rounds)
    _frfs()
    _growth(5 if rounds >= 25 else 3)


def _ten_modes(nx: int = 40, ny: int = 4) -> np.ndarray:
    return _solve(plate((0.5, 0.04), (nx, ny), of_boundary("cantilever")))


def _solve(body: Structure) -> np.ndarray:
    return solve(body, section([Ply(PAPER, 0.01)]), 10).frequency_hz


def _unproven() -> np.ndarray:
    """The same modes, as the peers give them: without the count that proves that none is
    missing.
    """
    with patch("fecore.dynamics.eigen._missing", lambda *_: 0):
        return _ten_modes()


def _against_peers(rounds: int) -> None:
    """From the mesh to the frequencies: medians, ratios, and errors against a fine mesh; CalculiX
    with its files.
    """
    reference = _ten_modes(120, 12)
    calls: dict[str, Callable[[], np.ndarray]] = {
        "modalbase": _ten_modes,
        "  without its proof": _unproven,
    }
    if importlib.util.find_spec("skfem"):
        calls["scikit-fem"] = lambda: peers.scikit_fem(SPECIMEN)
    if importlib.util.find_spec("pyfe3d"):
        calls["pyfe3d Quad4R"] = lambda: peers.pyfe3d(SPECIMEN)
    if shutil.which("ccx"):
        calls["CalculiX S8R"] = lambda: peers.calculix(SPECIMEN)
    columns = (
        "median ms:.2f",
        "ratio:.2f",
        "CPU ms:.2f",
        "bending 1, error %:+.4f",
        "torsion 1, error %:+.4f",
    )
    table = Table("", "assembly + 10 modes, 40 x 4:28", *columns)
    found, times = (
        {name: call() for name, call in calls.items()},
        {name: list[np.ndarray]() for name in calls},
    )
    random = np.random.default_rng(0)
    # In turn, so that a busy machine is busy for all; in no order, as each leaves the caches to the
    # next.
    for _ in range(rounds):
        for name in random.permutation(list(calls)):
            times[name].append(timed(calls[name])[1])
    own = float(np.median([wall for wall, _ in times["modalbase"]]))
    for name in calls:
        errors = [
            100 * (found[name][np.argmin(np.abs(found[name] - f))] / f - 1)
            for f in reference[[0, 2]]
        ]
        wall, cpu = np.median(times[name], axis=0)
        table.row(name, 1e3 * wall, wall / own, 1e3 * cpu, *errors)
    if len(calls) < 5:
        print("  (peers that are not installed are left out)")


def _resolves(rounds: int) -> None:
    """A new θ: full and reduced, with all that stage 1 needs."""
    specimen = replace(SPECIMEN, masses=(PointMass(0.49, 0.015, 0.0048),))
    known = parametrise(specimen)
    draws = known.prior_mean * (
        1 + 0.02 * np.random.default_rng(0).uniform(-1, 1, (200, len(known.names)))
    )
    full, reduced = (
        ForwardModel(specimen, known, along_z(range(33)), PLACES, 8, small)
        for small in (False, True)
    )
    for theta in draws:
        reduced.solve(theta)
    columns = [
        (m, n, of)
        for of in ("frequency_hz", "frequency_jacobian")
        for m, n in ((full, 1), (reduced, 15))
    ]
    rows = []
    for start in range(0, 8 * rounds, 8):  # in turn, so that a busy machine is busy for all
        some = iter(np.roll(draws, start, axis=0))
        rows.append(
            [
                median_ms(lambda m=m, of=of, some=some: getattr(m.solve(next(some)), of), n)
                for m, n, of in columns
            ]
        )
    took = np.median(rows, axis=0).reshape(2, 2)
    build = median_ms(
        lambda: ForwardModel(specimen, known, along_z((0,)), PLACES[:1], 8).basis.system, 5
    )
    size, solves = reduced.basis.basis.shape[1], reduced.basis.full_solves
    table = Table(
        f"re-solve for new parameters, 8 modes, {size} vectors",
        "of:28",
        "full ms:.2f",
        "reduced ms:.3f",
        "ratio:.1f",
    )
    for name, (whole, small) in zip(
        ("natural frequencies", "and their derivatives"), took, strict=True
    ):
        table.row(name, whole, small, whole / small)
    print(f"  making the basis: {build:.1f} ms, {solves} full solves in 200 draws of +-2 %")


def _frfs() -> None:
    """33 FRFs of 3200 lines from a solved state."""
    model = ForwardModel(SPECIMEN, parametrise(SPECIMEN), along_z(range(33)), PLACES, 10)
    state = model.solve(model.parametrisation.prior_mean)
    dofs, frequency = [Dof(point, 3) for point in range(33)], np.linspace(0.3125, 1000, 3200)
    frfs = state.frf_model([dofs[32]] * 33, dofs)
    rate = damping_rate(RAYLEIGH, np.array([42.25, 1.1e-5]), frfs.omega)
    print(f"FRFs 33 x 3200: {median_ms(lambda: frfs.synthesise(frequency, rate), 15):.2f} ms")


def _growth(sizes: int) -> None:
    """Time of a solve (10 modes, factorisation and count included) over the number of dofs."""
    dofs, times = [], []
    table = Table("growth of the solve", "mesh:10", "dofs:d", "median s:.3f", "assembly s:.3f")
    for nx, ny in ((40, 4), (80, 8), (140, 14), (220, 22), (330, 33))[:sizes]:
        body, (assembly, _) = timed(
            lambda nx=nx, ny=ny: plate((0.5, 0.04), (nx, ny), of_boundary("cantilever"))
        )
        model, (assembled, _) = timed(lambda body=body: body.model)
        assembly += assembled
        times.append(median_ms(lambda body=body: _solve(body), 9 if nx < 100 else 3) / 1e3)
        dofs.append(model.stiffness.size)
        table.row(f"{nx} x {ny}", dofs[-1], times[-1], assembly)
    print(f"  fitted exponent {np.polyfit(np.log(dofs), np.log(times), 1)[0]:.2f} (target 1.3)")


# --- updating -----------------------------------------------------------------------------------------------------------

LINES_HZ = np.linspace(0.3125, 1000.0, 3200)


def updating(lines: int = 3200) -> None:
    """The default update by step, samples beside the Gaussian posterior, both stages beside scipy's
    `least_squares`.
    """
    print(f"{load()}; OPENBLAS_NUM_THREADS={os.environ.get('OPENBLAS_NUM_THREADS', 'not set')}\n")
    body = cantilever(TABLE_4_UPDATED)
    data = Measurement(
        rayleigh_body(body, CANTILEVER_CONVERGED, 5, LINES_HZ[:: 3200 // lines]), grid(body)
    )
    laplace, laps = min(
        (_by_stage(data) for _ in range(3)), key=lambda run: float(sum(run[1].values())[1])
    )
    whole = sum(laps.values(), np.zeros(2))
    table = Table(
        f"default job, 33 FRFs x {lines} lines",
        "stage:40",
        "wall s:.2f",
        "processor s:.2f",
        "share:.0%",
    )
    for stage, lap in {**laps, "together (target: under 4 s)": whole}.items():
        table.row(stage, *lap, lap[1] / whole[1])
    _sampling(data, laplace)
    _against_least_squares(data)


def _by_stage(
    data: Measurement, recipe: Recipe | None = None
) -> tuple[UpdateResult, dict[str, np.ndarray]]:
    """A job, and wall clock and processor time of each stage that it reports."""
    marks: list[tuple[str, np.ndarray]] = []
    result = update(
        data,
        cantilever(TABLE_4_COUPONS),
        recipe or Recipe(),
        lambda stage, _: marks.append((stage, now())),
    )
    laps: dict[str, np.ndarray] = {}
    for (stage, start), (_, end) in zip(marks, [*marks[1:], ("", now())], strict=True):
        laps[stage] = laps.get(stage, np.zeros(2)) + end - start
    return result, laps


def _sampling(data: Measurement, laplace: UpdateResult) -> None:
    """Standard deviations of samples over those of the Gaussian posterior."""
    sampled, laps = _by_stage(data, Recipe(posterior="mcmc", seed=1))
    lap = laps["sampling the posterior"]
    (effective,) = sampled.posterior.effective_samples
    table = Table("\nMCMC beside Laplace (target: within 10 %)", "parameter:10", "sd ratio:.3f")
    for a, b in zip(sampled.parameters, laplace.parameters, strict=True):
        table.row(a.name, a.standard_deviation / b.standard_deviation)
    apart = np.subtract(sampled.posterior.correlation, laplace.posterior.correlation)
    print(f"  largest difference of a correlation: {np.abs(apart).max():.3f}")
    print(f"  effective samples: {effective:.0f}; {lap[0]:.1f} s wall, {lap[1]:.1f} s processor")
    print("  (target: 5,000 in under 20 s)")


def _against_least_squares(data: Measurement) -> None:
    """Both stages by us and by `least_squares`: the same misfits, unknowns, priors and five
    starts.
    """
    specimen, modes = cantilever(TABLE_4_COUPONS), identify(data.frfs).modes
    labels = list(dict.fromkeys([*(dof.point for dof in modes.dofs), *data.points]))
    places = np.array([data.points[label][:2] for label in labels])
    model = ForwardModel(specimen, parametrise(specimen), along_z(labels), places, 12)

    def second() -> DampingResult:
        given = damping_data(data.frfs, elastic, modes, "noise")
        return fit_damping(given, fit_reference(given), RAYLEIGH)

    elastic, first = least(lambda: settled(fit_elastic(Layout.of_one(replace(model), modes))))
    damping, after = least(second)
    nuisance = damping_data(data.frfs, elastic, modes, "noise").nuisance(damping.discrepancy)
    # The peer knows of no common gain, nor of what a driving point has for itself, so neither does
    # ours here.
    misfit, found = damping.reference.misfit, damping.fit
    own = misfit.without_driving(found.eigenvalue, found.rate)
    misfit = replace(misfit, frfs=own, driving=(), common_gain_sd=0.0)
    elastic_peer = peers.ElasticByDifferences(replace(model, reduced=False), modes, elastic)
    theirs_1, peer_1 = timed(elastic_peer.fit)
    damping_peer = peers.DampingByDifferences(misfit, nuisance, damping.start)
    fits = [timed(lambda k=k: damping_peer.fit(damping.start * k)) for k in (1, 5, 0.2, 2, 0.5)]
    peer_2 = sum((lap for _, lap in fits), np.zeros(2))
    table = Table("", "two stages:56", "wall s:.2f", "processor s:.2f")
    for name, lap in (
        ("ours, stage 1: basis made anew, intervals, verdicts", first),
        (f"least_squares, stage 1: {elastic_peer.solves} full solutions", peer_1),
        ("ours, stage 2: noise, modal fit, 5 starts, intervals", after),
        (f"least_squares, stage 2: 5 starts, {damping_peer.syntheses} syntheses", peer_2),
        ("ours, both stages (target: under 1 s)", first + after),
        ("least_squares, both stages", peer_1 + peer_2),
    ):
        table.row(name, *lap)
    ratio = (peer_1 + peer_2) / (first + after)
    print(f"  least_squares over ours (target: 10), processor time: {ratio[1]:.1f}")
    mine = np.concatenate([elastic.theta, damping.fit.coefficients])
    theirs = np.concatenate([theirs_1.x, fits[0][0].x[:2] * damping_peer.unit])
    names = ("Ex", "Ey", "Gxy", "Gxz", "a0", "a1")
    away = ", ".join(
        f"{name} {100 * (b / a - 1):+.4f} %" for name, a, b in zip(names, mine, theirs, strict=True)
    )
    print(f"  least_squares' estimates from ours: {away}")
    _calculix(float((first + after)[0]), elastic_peer.solves, float(peer_2[0]))


def _calculix(own: float, solves: int, second: float) -> None:
    """One solution timed, and multiplied: nobody has to wait for all of them."""
    if shutil.which("ccx") is None:
        print("  (ccx is not installed: no CalculiX)")
        return
    body = cantilever(TABLE_4_UPDATED)
    one = min(timed(lambda: peers.calculix(body))[1][0] for _ in range(3))
    total = one * (solves + 1) + second
    print(
        f"  around CalculiX S8R, reckoned: {solves + 1} eigenvalue solutions of {one:.2f} s, its"
        f" modes superposed by us in stage 2: {total:.0f} s, ratio {total / own:.0f}"
    )


# --- cards --------------------------------------------------------------------------------------------------------------


def cards(draws: int = 40, seed: int = 7, modes: int = 6) -> None:
    """Frequencies of decks as `modalbase cards` writes them, by CalculiX: of strips and plates
    drawn at random.
    """
    rng, worst = np.random.default_rng(seed), {"solid": list[float](), "shell": list[float]()}
    table = Table("", "boundary:16", "mm:28", "solid, %:.3f", "shell, %:.3f")
    for _ in range(draws):
        specimen = _specimen(rng)
        m, size = specimen.material, (specimen.length, specimen.width, specimen.thickness)
        ours = frequencies(specimen, modes)[:modes]
        moduli: Any = (m.Ex, m.Ey, m.Gxy, m.Gxz, m.Gyz)
        deck = Deck(*size, moduli, m.nu_xy, m.density, specimen.boundary, 2 * modes + 12)
        for name, text in (
            ("solid", write_solids(deck)),
            ("shell", write_shells(deck, corrected=True)),
        ):
            found = calculix.frequencies(calculix.ccx(text.splitlines()))
            worst[name].append(float(np.abs(found[:, None] / ours - 1).min(axis=0).max()))
        millimetres = " x ".join(f"{1e3 * side:.3g}" for side in size)
        table.row(specimen.boundary, millimetres, *(100 * errors[-1] for errors in worst.values()))
    for name, errors in worst.items():
        print(
            f"  {name}: median {100 * np.median(errors):.3f} %, worst {100 * max(errors):.3f} % of"
            f" {draws}"
        )


def _specimen(rng: np.random.Generator) -> Specimen:
    """A specimen of 0.2 to 1 m, 4 to 20 times as long as thick or more, constants within 30 % of
    usual ones.
    """
    length = rng.uniform(0.2, 1.0)
    width = length * rng.uniform(0.06, 0.5)
    thickness = min(length / rng.uniform(30, 100), width / 4)
    moduli = np.array([30e9, 15e9, 5e9, 4e9, 3.5e9]) * rng.uniform(0.7, 1.3, 5)
    material = OrthotropicMaterial(
        *map(float, moduli), nu_xy=float(rng.uniform(0.1, 0.3)), density=1900.0
    )
    boundary = str(rng.choice(["cantilever", "free", "simply_supported"]))
    return Specimen(length, width, thickness, material, boundary, divisions=(40, 8))  # type: ignore[arg-type]
