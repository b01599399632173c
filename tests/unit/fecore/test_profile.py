"""Steps, tapers and added masses against closed forms of beams."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from fecore.body.generators import Piece
from fecore.body.kinds import mode_kinds
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.specimen import LayeredSpecimen, Specimen
from fecore.body.supports import PointMass, Spring
from fecore.frf import Dof
from fecore.modes import MeasuredModes
from fecore.updating.inputs import Inputs
from fecore.updating.measurement import Measurement, Recipe
from fecore.updating.pipeline import update
from fecore.updating.result import UpdateResult
from tests.support.bodies import modes, pencil
from tests.support.lengths import long

E, RHO, L, B, T = 70e9, 2700.0, 0.5, 0.01, 0.002
NARROW = Specimen(
    L, B, T, OrthotropicMaterial(E, E, E / 2, E / 2, E / 2, 0.0, RHO), divisions=(20, 2)
)
"""A slender strip without Poisson's effect: Euler and Bernoulli's beam within 0.1 %."""


def bending_hz(body: Specimen | LayeredSpecimen, count: int) -> np.ndarray:
    found = modes(body, count + 3)
    bending = [kind == "bending" for kind in mode_kinds(body.model, found.shapes)]
    return found.frequency_hz[bending][:count]


def beam_hz(
    sections: list[tuple[float, float]], tip: tuple[float, float], count: int
) -> np.ndarray:
    """Frequencies of a cantilever of (length, thickness) sections with a tip's mass and rotary
    inertia, by transfer matrices: the state (w, w', M, V) is carried along by the exponential of
    the beam's equation.
    """

    def determinant(omega: float) -> float:
        carried = np.eye(4)
        for length, t in sections:
            EI, mass = E * B * t**3 / 12, RHO * B * t
            along = np.zeros((4, 4))
            along[0, 1], along[1, 2], along[2, 3], along[3, 0] = 1, 1 / EI, 1, mass * omega**2
            carried = expm(along * length) @ carried
        # At the tip M = J ω² w' and V = -m ω² w.
        ends = (
            np.array([[0, -tip[1] * omega**2, 1, 0], [tip[0] * omega**2, 0, 0, 1]]) @ carried[:, 2:]
        )
        return float(np.linalg.det(ends))

    return roots(determinant, count)


def roots(function: Callable[[float], float], count: int) -> np.ndarray:
    grid = 2 * np.pi * np.geomspace(1.0, 500.0, 400)
    values = [function(omega) for omega in grid]
    found = [
        brentq(function, a, b)
        for a, b, u, v in zip(grid[:-1], grid[1:], values[:-1], values[1:], strict=True)
        if u * v < 0
    ]
    return np.array(found[:count]) / (2 * np.pi)


def test_a_stepped_beam_with_a_tip_mass_of_rotary_inertia() -> None:
    step = replace(
        NARROW,
        pieces=(Piece(0.0, 0.173, 0.003, 0.003),),
        masses=(PointMass(L, 0.0, 0.01, 2e-6, weighed=True),),
    )
    expected = beam_hz([(0.173, 0.003), (L - 0.173, T)], (0.01, 2e-6), 3)
    # 0.2 %: shear and rotary inertia of the sections, which the closed form leaves out.
    np.testing.assert_allclose(bending_hz(step, 3), expected, rtol=2e-3)
    # The rotary inertia counts: without it the third mode is more than a percent higher.
    bare = replace(step, masses=(PointMass(L, 0.0, 0.01),))
    assert bending_hz(bare, 3)[2] > 1.01 * bending_hz(step, 3)[2]


def test_a_tapered_beam_has_the_published_frequencies() -> None:
    """A wedge whose tip is half as deep as its root: λ = 3.82379, 18.3173, 47.2648 (Downs, J. Appl.
    Mech. 44, 1977).
    """
    taper = replace(NARROW, pieces=(Piece(0.0, L, T, T / 2),))
    scale = np.sqrt(E * T**2 / 12 / RHO) / L**2 / (2 * np.pi)
    np.testing.assert_allclose(
        bending_hz(taper, 3), np.array([3.82379, 18.3173, 47.2648]) * scale, rtol=2e-3
    )


@pytest.mark.parametrize("angles", [(0,), (45, -45)])
def test_a_piece_all_along_is_another_thickness(angles) -> None:
    carbon = OrthotropicMaterial(130e9, 9e9, 5e9, 5e9, 3.5e9, 0.3, 1600.0)
    plies = tuple(Ply(carbon, T / len(angles), angle) for angle in angles)
    body = LayeredSpecimen(0.3, 0.1, T, plies, 1600.0, divisions=(10, 4))
    thick = replace(body, thickness=1.5 * T)
    piece = replace(
        body, pieces=(Piece(0.0, 0.12, 1.5 * T, 1.5 * T), Piece(0.12, 0.3, 1.5 * T, 1.5 * T))
    )
    assert 0.12 in piece.model.mesh.nodes[:, 0]
    # 1e-8: the same matrices by sums in another order, through an eigenproblem.
    np.testing.assert_allclose(bending_hz(piece, 4), bending_hz(thick, 4), rtol=1e-8)


def test_zones_of_a_stepped_body_each_scale_their_own_stiffness() -> None:
    body = replace(NARROW, pieces=(Piece(0.0, 0.1, T, T / 2),))
    zoned = replace(body, zones=(L / 2,))
    parts = np.array(list(zoned.nominal.values()))
    places = [list(zoned.nominal).index(f"zone_{k}") for k in (1, 2)]
    halves = []
    for factors in ((1.0, 1.0), (0.8, 1.0), (1.0, 0.8)):
        parts[places] = factors
        halves.append(pencil(zoned, parts)[0].toarray())
    K = pencil(body)[0].toarray()
    np.testing.assert_allclose(halves[0], K, rtol=1e-9, atol=1e-9 * np.abs(K).max())
    np.testing.assert_allclose(
        halves[1] + halves[2], 1.8 * K, rtol=1e-9, atol=1e-9 * np.abs(K).max()
    )


@pytest.mark.parametrize("edge", ["start", "end", "lower", "upper"])
def test_a_spring_along_an_edge_weighs_its_length(edge) -> None:
    """Pushed all along by a unit field, and by one that is linear along it: ∫1 ds and ∫s ds."""
    body = replace(
        NARROW, divisions=(4, 2), boundary="free", springs=(Spring("k", 1.0, 3, edge=edge),)
    )
    model = body.model
    K = model.stiffness.term(model.stiffness.names.index("k"))
    w, x, y = np.zeros((3, len(model.mesh.nodes), 3))
    w[:, 0], x[:, 0], y[:, 0] = 1, model.mesh.nodes[:, 0], model.mesh.nodes[:, 1]
    w, x, y = (field[model.free] for field in (w, x, y))
    along_x = edge in ("lower", "upper")
    length = L if along_x else NARROW.width
    assert w @ K @ w == pytest.approx(length, rel=1e-12)
    assert w @ K @ x == pytest.approx(
        length * (L / 2 if along_x else L * (edge == "end")), rel=1e-12, abs=1e-15
    )
    assert w @ K @ y == pytest.approx(
        length * (0.5 if edge == "upper" else -0.5) * B if along_x else 0.0, abs=1e-15
    )


LINES = tuple(float(x) for x in np.linspace(0, L, 7)[1:-1])  # of six zones


def updated_in_zones(damaged: tuple[float, float], factor: float) -> UpdateResult:
    """A cantilever that has lost stiffness between two x, from eight frequencies with 0.02 % noise,
    moduli updated too.
    """
    material = OrthotropicMaterial(33e9, 32e9, 5.7e9, 4.5e9, 4.5e9, 0.15, 2012.0)
    body = Specimen(L, 0.04, 0.010, material, divisions=(12, 2), zones=LINES)
    true = replace(body, zones=damaged, divisions=(30, 2))
    truth = np.array(list({**true.nominal, "Ex": 31e9, "zone_2": factor}.values()))
    exact = modes(true, 8, truth)
    hz = exact.frequency_hz * (1 + 2e-4 * np.random.default_rng(3).standard_normal(8))
    x = np.linspace(0.05, 0.98, 11) * L
    places = np.array([(a, b) for a in x for b in (-0.019, 0.019)])
    at = np.column_stack([places, np.zeros(len(places))])
    shapes = (true.model.observe(at, np.tile([0.0, 0, 1], (len(at), 1))) @ exact.shapes).T
    points = {n: (float(a), float(b), 0.0) for n, (a, b) in enumerate(places, start=1)}
    covariance = np.diag(np.concatenate([(2e-4 * hz) ** 2, np.full(8, 1e-8)]))
    measured = MeasuredModes(
        hz, np.full(8, 0.01), shapes + 0j, tuple(Dof(n, 3) for n in points), covariance
    )
    recipe = Recipe(
        parameters=tuple(p for p in body.default_parameters() if p.name not in ("Ey", "Gyz")),
        damping_models=("rayleigh",),
    )
    return update(Measurement(None, points, measured, 0.0, Inputs.exact()), body, recipe)


@pytest.mark.parametrize("damaged", [(0.26, 0.30), long((0.40, 0.46))])
def test_damage_that_no_line_fits_is_in_its_own_zones_alone(damaged) -> None:
    """Within a zone, or across a line: a zone's factor is its mean, 1/s = ∫ dx/s(x)/L, and the
    finding says where.
    """
    factor, ends = 0.7, np.array([0.0, *LINES, L])
    result = updated_in_zones(damaged, factor)
    found = {p.name: p for p in result.parameters}
    share = np.clip(damaged[1], ends[:-1], ends[1:]) - np.clip(damaged[0], ends[:-1], ends[1:])
    means = 1 / (1 + share / np.diff(ends) * (1 / factor - 1))
    for number, mean in enumerate(means, start=1):
        low, high = found[f"zone_{number}"].interval_95
        assert low <= mean <= high
        if mean == 1:
            assert found[f"zone_{number}"].estimate == pytest.approx(1, abs=0.015)
    assert any(
        found[f"zone_{number + 1}"].interval_95[1] < 1 for number in np.flatnonzero(means < 1)
    )
    (said,) = [each.text for each in result.findings if each.kind == "stiffness_changed"]
    begin, end, least, most = map(
        float, re.findall(r"x = ([\d.]+) and ([\d.]+) mm, over ([\d.]+) to ([\d.]+) mm", said)[0]
    )
    assert begin == pytest.approx(1e3 * damaged[0], abs=25)  # 1.5 parts of 16.7 mm
    assert end == pytest.approx(1e3 * damaged[1], abs=25)
    assert least <= 1e3 * (damaged[1] - damaged[0]) <= most


@pytest.mark.long
def test_no_zone_has_changed_where_nothing_is_damaged() -> None:
    """In short the zones beside the damaged one say so above."""
    result = updated_in_zones((LINES[2], LINES[3]), 1.0)
    found = {p.name: p for p in result.parameters}
    assert all(abs(found[f"zone_{k}"].estimate - 1) < 0.002 for k in range(1, 7))
