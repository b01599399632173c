"""A structure of walls goes through the same updating: rows along any direction, common priors, the
joints' error.
"""

from dataclasses import replace

import numpy as np
import pytest

from fecore.arrays import FloatArray
from fecore.body.constants import Parameter
from fecore.body.generators import profile
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.sections import ShellSection
from fecore.body.structure import Structure
from fecore.body.supports import of_boundary
from fecore.dynamics.bodies import body_modes
from fecore.errors import InputError
from fecore.frf import Dof
from fecore.modes import MeasuredModes
from fecore.updating import mesh
from fecore.updating.campaigns import Campaign, CampaignsRecipe, update_campaigns
from fecore.updating.elastic_starts import update_from_several_starts
from fecore.updating.forward import ForwardModel
from fecore.updating.inputs import Inputs, systematic_effects
from fecore.updating.layout import Layout, yielding
from fecore.updating.measurement import Measurement, Recipe
from fecore.updating.parameters import parametrise
from fecore.updating.pipeline import update
from tests.support.fits import COARSE, at_prior, forward_model
from tests.support.lengths import long

GFRP = OrthotropicMaterial(23e9, 8.5e9, 3e9, 3e9, 2.4e9, 0.27, 1850.0)
WALLS = {name: ShellSection((Ply(GFRP, 0.006),)) for name in ("flange", "web")}
BEAM = Structure(profile("i", 0.9, 0.12, 0.06, 0.006, 0.006, elements=1), WALLS)
MODES = 8


@pytest.fixture(autouse=True)
def _on_trust(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is measured comes from the same mesh; `test_mesh_error.py` has what a mesh misses."""
    monkeypatch.setattr(mesh, "MOST_DOFS", 0)


def measured(
    truth: dict[str, float], direction: FloatArray, body: Structure = BEAM
) -> tuple[MeasuredModes, dict[int, tuple[float, ...]]]:
    """Modes of the model with other constants, at points on the faces of flange and web: normal to
    these, or along one.
    """
    x = np.linspace(0.05, 0.85, 7)
    top, side = ([(u, 0.02, 0.06) for u in x], [(u, 0.003, 0.01) for u in x])
    points = {n: tuple(map(float, place)) for n, place in enumerate([*top, *side], start=1)}
    dofs = tuple(Dof(n, 3 if n <= x.size else 2) for n in points)
    own = dict.fromkeys(points, direction) if direction.size else {}
    prior = parametrise(body, [Parameter(name, prior_mean=value) for name, value in truth.items()])
    forward = ForwardModel(body, prior, dofs, np.array(list(points.values())), MODES + 10, axes=own)
    state = forward.solve(prior.prior_mean)
    hz = state.frequency_hz[:MODES]
    covariance = np.diag(np.concatenate([(1e-4 * hz) ** 2, np.full(MODES, 1e-8)]))
    return (
        MeasuredModes(hz, np.full(MODES, 0.01), state.shapes[:MODES] + 0j, dofs, covariance),
        points,
    )


def test_constants_of_each_wall_come_back_from_rows_along_any_direction() -> None:
    c, s = np.cos(0.5), np.sin(0.5)
    axes = np.array([[1.0, 0, 0], [0, c, s], [0, -s, c]])
    truth = {"flange.E1": 25e9, "web.E1": 22e9, "flange.G12": 2.7e9, "web.G12": 3.3e9}
    modes, points = measured(truth, axes)
    data = Measurement(None, points, modes, inputs=Inputs.exact(), axes=dict.fromkeys(points, axes))
    found = update(
        data,
        BEAM,
        Recipe(parameters=tuple(Parameter(name) for name in truth), damping_models=("rayleigh",)),
    )
    assert [mode.mac is not None and mode.mac > 0.99 for mode in found.modes] == [True] * MODES
    for each in found.parameters:
        if each.name in truth:
            assert each.interval_95[0] < truth[each.name] < each.interval_95[1]
            sources = {entry.source for entry in each.budget}
            assert {"model of the joints", "common material of the sets"} <= sources
    flange = next(each for each in found.parameters if each.name == "flange.E1")
    assert flange.identifiable
    assert flange.estimate == pytest.approx(25e9, rel=0.02)


@pytest.mark.long
def test_a_basis_is_verified_where_a_fit_ends() -> None:
    """In short the constants come back by such a basis, above."""
    modes, points = measured({"flange.E1": 31e9, "web.E1": 17e9, "web.G12": 4e9}, np.zeros((0, 3)))
    prior = parametrise(BEAM, BEAM.default_parameters())
    forward = ForwardModel.of_dofs(prior, modes.dofs, points, float(modes.frequency_hz[-1]), MODES)
    assert forward.basis.full_solves == 1
    found = update_from_several_starts(Layout.of_one(forward, modes))
    assert found.layout.campaigns[0].forward.verified
    assert 1 < forward.basis.full_solves <= 3
    c = found.states[0].coefficients
    K, M = BEAM.model.stiffness.at(c.stiffness), BEAM.model.mass.at(c.mass)
    exact = body_modes(BEAM.model, K, M, MODES).frequency_hz
    assert forward.basis.modes(c.stiffness, c.mass).frequency_hz[: exact.size] == pytest.approx(
        exact, rel=5e-4
    )
    assert found.states[0].basis is forward.basis.basis


def test_modes_have_shares_of_their_motion_and_of_the_energy_of_each_set() -> None:
    state = at_prior(forward_model(BEAM, MODES, "web.E1", "flange.factor"))
    energy = state.energy
    for fractions in (state.motion, energy):
        np.testing.assert_allclose(np.sum(list(fractions.values()), axis=0), 1, atol=1e-9)
    # ∂ ln λ / ∂ ln of a factor of all stiffness of a set is its share of the strain energy
    slope = 2 * state.frequency_jacobian[:, 1] / state.frequency_hz
    np.testing.assert_allclose(energy["flange"], slope, rtol=1e-6)
    # about the axis in which the web lies, the flanges alone bend
    mode = state.kinds.index("bending y")
    assert state.fractions(mode)["energy"]["flange"] > 0.9
    assert state.fractions(mode)["motion"]["bending y"] == max(
        state.fractions(mode)["motion"].values()
    )


def test_sets_of_one_material_have_what_they_share_and_their_own() -> None:
    names = [each.name for each in BEAM.default_parameters()]
    assert names == [
        f"{s}.{c}" for s in ("flange", "web") for c in ("E1", "E2", "G12", "G13", "G23")
    ]
    forward = forward_model(BEAM, 3, "flange.E1", "web.E1", "web.G12")
    layout = Layout.of_one(forward, MeasuredModes(np.ones(1), np.ones(1) / 9))
    for scatter in (0.15, 0.3):
        covariance = np.linalg.inv(layout.precision(scatter))
        shared = np.log1p(0.3**2)
        whole = shared + np.log1p(scatter**2)
        np.testing.assert_allclose(
            covariance, [[whole, shared, 0], [shared, whole, 0], [0, 0, shared]], atol=1e-12
        )
        np.testing.assert_allclose(
            layout.marginal_sd(scatter) ** 2, np.diag(covariance), rtol=1e-12
        )
    stated = parametrise(BEAM, [Parameter("flange.E1", prior_sd=1e9), Parameter("web.E1")])
    assert stated.common == ()


@pytest.mark.parametrize("count", [2, long(4)])
def test_a_set_that_has_lost_stiffness_is_found_among_others(count: int) -> None:
    """The web in sets along the beam, the last but one at 80 %: factors of all sets, most of which
    are 1.
    """
    sets = {f"web_{k + 1}": WALLS["web"] for k in range(count)}
    weak = f"web_{count - 1}.factor"
    blocks = [block for block in BEAM.mesh.blocks if block.set == "flange"]
    for block in BEAM.mesh.blocks:
        part = np.minimum(
            (count * BEAM.mesh.nodes[block.nodes][..., 0].mean(axis=1) / 0.9).astype(int), count - 1
        )
        if block.set == "web":
            blocks += [
                replace(block, nodes=block.nodes[part == k], set=f"web_{k + 1}")
                for k in range(count)
            ]
    walls, held = replace(BEAM.mesh, blocks=tuple(blocks)), of_boundary("cantilever")
    body = Structure(walls, {"flange": WALLS["flange"], **sets}, held)
    modes, points = measured({weak: 0.8}, np.zeros((0, 3)), body)
    names = [f"{name}.factor" for name in body.mesh.sets]
    found = update(
        Measurement(None, points, modes, inputs=Inputs.exact()),
        body,
        Recipe(parameters=tuple(map(Parameter, names)), damping_models=("rayleigh",)),
    )
    factors = {each.name: each for each in found.parameters if each.name in names}
    assert factors[weak].interval_95[0] < 0.8 < factors[weak].interval_95[1]
    assert factors[weak].estimate == pytest.approx(0.8, abs=0.02)
    assert all(abs(factors[name].estimate - 1) < 0.01 for name in set(names) - {weak})


def test_a_clamp_that_yields_moves_the_frequencies_as_a_block_on_springs_does() -> None:
    clamped = replace(BEAM, supports=of_boundary("cantilever"))
    state = at_prior(forward_model(clamped, MODES, "web.E1", reduced=False))
    (found,) = systematic_effects(state, replace(Inputs.exact(), clamp_compliance_sd=0.01), ())
    assert (found.name, found.kind) == ("clamp", "one-sided")
    assert found.shift[0] == pytest.approx(-0.02)
    assert systematic_effects(state, Inputs.exact(), ()) == ()
    on_springs = yielding(clamped, replace(Inputs.exact(), clamp_compliance_sd=1e-3 / 0.6745))
    moved = at_prior(forward_model(on_springs, MODES, "web.E1", reduced=False))
    exact = moved.frequency_hz[:MODES] / state.frequency_hz[:MODES] - 1
    assert exact[0] == pytest.approx(-0.002, rel=0.01)  # little enough for the first order
    np.testing.assert_allclose(
        found.shift[:MODES] / found.shift[0], exact / exact[0], rtol=0.02, atol=2e-3
    )


@pytest.mark.long
def test_the_clamp_of_a_body_that_was_tested_free_too_is_found() -> None:
    """In short that of the paper's bar is, in `tests/golden`."""
    truth = {"flange.E1": 25e9, "web.E1": 22e9, "flange.G12": 2.7e9, "web.G12": 3.3e9}
    held = replace(BEAM, supports=of_boundary("cantilever"))
    soft = yielding(held, replace(Inputs.exact(), clamp_compliance_sd=0.012 / 0.6745))
    campaigns = []
    for body, real, scale in ((BEAM, BEAM, 0.0), (held, soft, 0.0075)):
        modes, points = measured(truth, np.zeros(0), real)
        inputs = replace(Inputs.exact(), clamp_compliance_sd=scale)
        campaigns.append(
            Campaign(of_what := f"clamp {scale}", of_what, body, modes, points, inputs)
        )
    found = update_campaigns(campaigns, CampaignsRecipe(parameters=tuple(map(Parameter, truth))))
    assert found.verdict.level == "usable"
    constants = {each.name: each for each in found.parameters}
    assert all(
        abs(constants[name].estimate - value) < 0.5 * constants[name].standard_deviation
        for name, value in truth.items()
    )
    (clamp,) = [
        each for part in found.campaigns for each in part.own if each.name == "clamp_compliance"
    ]
    assert clamp.estimate == pytest.approx(0.012, abs=0.5 * clamp.standard_deviation)
    assert clamp.standard_deviation < 0.003


def test_rows_that_a_body_does_not_move_along_are_named() -> None:
    forward = ForwardModel(
        BEAM,
        parametrise(BEAM, [Parameter("web.E1")]),
        (Dof(1, 2),),
        np.array([[0.1, 0.003, 0.0]]),
        3,
    )
    assert forward.rows([Dof(1, -2)])[1].tolist() == [-1.0]
    assert replace(forward, dofs=(Dof(1, -2),)).rows([Dof(1, -2), Dof(1, 2)])[1].tolist() == [
        1.0,
        -1.0,
    ]
    with pytest.raises(InputError, match="direction: 3 at point 1 is none of the model's rows"):
        forward.rows([Dof(1, 3)])
    with pytest.raises(InputError, match="off the specimen, which spans x 0"):
        _ = replace(forward, places=np.array([[0.1, 0.02, 0.0]])).observation


def test_shapes_and_frfs_have_the_sense_of_directions_that_are_typed_negative() -> None:
    """As of sensors that were mounted upside down: every comparison of shapes is of these rows."""
    places = np.array([[0.1, 0.0], [0.25, 0.02], [0.5, -0.02]])
    dofs, signed = ((Dof(1, 3), Dof(2, 3), Dof(3, 3)), (Dof(1, 3), Dof(2, -3), Dof(3, -3)))
    prior, sign = parametrise(COARSE), np.array([1.0, -1.0, -1.0])
    plain, other = (
        at_prior(ForwardModel(COARSE, prior, rows, places, 6)) for rows in (dofs, signed)
    )
    np.testing.assert_allclose(
        other.shapes, plain.shapes * sign, atol=1e-9 * np.abs(plain.shapes).max()
    )
    first, second = (each.frf_model(signed, dofs[:1] * 3).residues for each in (plain, other))
    turned = other.frf_model(dofs, (Dof(1, -3),) * 3).residues
    np.testing.assert_allclose(second, first, atol=1e-9 * np.abs(first).max())
    np.testing.assert_allclose(turned, -sign[:, None] * first, atol=1e-9 * np.abs(first).max())
