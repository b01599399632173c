"""Stacks of unlike layers: mass where the plies have it, FRFs of coupled laminates, inputs that
nobody stated, lengths.

The truths are solids by another code (`tests.support.stacks`); stage 1 alone is run, without the
search over starts.
"""

from dataclasses import replace

import numpy as np
import pytest

from fecore.body.sections import homogenise, section
from fecore.body.specimen import LayeredSpecimen, Specimen
from fecore.body.supports import PointMass
from fecore.correlation import frac
from fecore.errors import InputError
from fecore.frf import along_z
from fecore.modes import MeasuredModes
from fecore.updating.elastic import fit_elastic, settled
from fecore.updating.elastic_findings import elastic_findings
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.estimates import constant_estimates
from fecore.updating.forward import ForwardModel
from fecore.updating.inputs import Inputs
from fecore.updating.layout import Layout
from fecore.updating.parameters import parametrise
from fecore.updating.result import ParameterEstimate
from tests.support import stacks
from tests.support.draws import modes_at, solved

Body = Specimen | LayeredSpecimen
Estimates = dict[str, ParameterEstimate]
BARE = replace(Inputs.exact(), sensor_mass_sd=None)  # all is known but whether a sensor was there


def updated(
    body: Body,
    modes: MeasuredModes,
    points: dict[int, tuple[float, float, float]],
    inputs: Inputs,
    sensor: tuple[int, ...] = (),
) -> tuple[ElasticResult, Estimates]:
    prior = parametrise(body, body.default_parameters()).with_inputs(
        inputs.standard_deviations(body.nominal)
    )
    forward = ForwardModel.of_dofs(
        prior, along_z(points), points, 1.05 * modes.frequency_hz[-1], len(modes)
    )
    elastic = settled(fit_elastic(Layout.of_one(forward, modes, inputs, sensor)))
    return elastic, {each.name: each for each in constant_estimates(elastic, inputs)}


def assert_right(found: Estimates, true: dict[str, float], *names: str) -> None:
    for name in names:
        each = found[name]
        assert abs(each.estimate - true[name]) < 2 * each.standard_deviation, name


def one_layer(boundary: str, factor: float) -> Specimen:
    """The sandwich as an empty recipe has it, its moduli off by a factor."""
    (length, width), _ = stacks.STACKS["sandwich"]
    plies = stacks.plies("sandwich", factor)
    layers = tuple((ply.thickness, ply.material.density) for ply in plies)
    size, material = (
        (length, width, sum(ply.thickness for ply in plies)),
        homogenise(section(plies)),
    )
    return Specimen(*size, material, boundary, divisions=(14, 2), layers=layers)  # type: ignore[arg-type]


def of_plies(kind: str, boundary: str, factor: float) -> LayeredSpecimen:
    (length, width), _ = stacks.STACKS[kind]
    plies = stacks.plies(kind, factor)
    size = length, width, sum(ply.thickness for ply in plies)
    return LayeredSpecimen(*size, plies, stacks.density(kind), boundary, divisions=(24, 2))  # type: ignore[arg-type]


@pytest.mark.parametrize("boundary", stacks.BOUNDARIES)
def test_a_sandwich_of_one_layer_has_its_mass_in_the_faces(boundary: str) -> None:
    body, modes, points = (
        one_layer(boundary, 0.85),
        stacks.measured("sandwich", boundary),
        stacks.points("sandwich"),
    )
    m = homogenise(section(stacks.plies("sandwich")))
    true = {name: getattr(m, name) for name in ("Ex", "Gxy", "Gxz")}
    _, found = updated(body, modes, points, Inputs())
    assert_right(found, true, "Ex", "Gxy")
    assert found["Gxy"].identifiable
    assert found["Gxy"].estimate == pytest.approx(true["Gxy"], rel=0.035)
    if boundary == "free":
        _, even = updated(replace(body, layers=()), modes, points, Inputs())
        # evenly spread the mass turns too easily
        assert even["Gxy"].estimate < 0.96 * found["Gxy"].estimate


def test_layers_that_are_heavier_on_one_side_are_no_single_layer() -> None:
    with pytest.raises(InputError, match=r"layers.*heavier on one side"):
        replace(one_layer("free", 1.0), layers=((0.002, 1850.0), (0.009, 150.0)))


def test_plies_of_an_unsymmetric_laminate() -> None:
    body, modes = (
        of_plies("unsymmetric", "cantilever", 0.9),
        stacks.measured("unsymmetric", "cantilever"),
    )
    inputs = replace(Inputs.exact(), thickness_sd=3e-5, density_sd=15.0)
    _, found = updated(body, modes, stacks.points("unsymmetric"), inputs)
    assert_right(found, stacks.MATERIALS["carbon"], "E1", "E2", "G12", "G13")
    assert found["G12"].identifiable


@pytest.mark.parametrize("reduced", [False, True])
def test_frfs_of_a_coupled_laminate_keep_the_third_residual_term(reduced: bool) -> None:
    """26 modes and the series of those left out against 60 modes, to above the band: FRAC was 0.3,
    and 0.01.
    """
    plies = stacks.plies("unsymmetric")
    body = LayeredSpecimen(0.5, 0.03, 0.0015, plies, 1580.0, "cantilever", divisions=(30, 2))
    points = {1: (0.2, 0.015, 0.0), 2: (0.35, 0.0, 0.0), 3: (0.5, 0.015, 0.0)}
    prior, dofs = parametrise(body, body.default_parameters()), along_z(points)
    lines, synthesised = np.linspace(2.0, 1700.0, 300), []
    for count, on_basis in ((26, reduced), (60, False)):
        forward = ForwardModel(body, prior, dofs, np.array(list(points.values())), count, on_basis)
        model = forward.solve(1.05 * prior.prior_mean).frf_model(
            dofs, (dofs[2],) * 3, with_strain=False
        )
        synthesised.append(model.synthesise(lines, 0.02 * model.omega))
    assert np.all(frac(*synthesised) > 0.999)


def coupon(mass: float) -> tuple[ElasticResult, Estimates]:
    """A small coupon with a sensor of some mass that nobody stated, its moduli off."""
    points = {k: (0.2 * x, 0.025 * y, 0.0) for k, (x, y) in enumerate(stacks.SHARES, start=1)}
    nominal, true = (
        LayeredSpecimen(
            0.2,
            0.025,
            0.0021,
            stacks.plies("unsymmetric", factor),
            1580.0,
            "cantilever",
            divisions=(12, 2),
        )
        for factor in (0.95, 1.0)
    )
    true = true.carrying((PointMass(0.2, 0.0125, mass),))
    prior = parametrise(true, true.default_parameters())
    places = np.array(list(points.values()))
    state = ForwardModel(true, prior, along_z(points), places, 12, reduced=False).solve(
        prior.prior_mean
    )
    noise = 1 + 3e-4 * np.random.default_rng(1).standard_normal(8)
    modes = modes_at(points, state.frequency_hz[:8] * noise, state.shapes[:8], 3e-4)
    return updated(nominal, modes, points, BARE, (15,))


def test_a_sensor_that_nobody_stated_moves_constants_no_further_than_their_priors() -> None:
    """In a straight line one gram would move G13 of a coupon of 17 g by its own value, called
    identifiable.
    """
    elastic, found = coupon(0.0)
    (sensor,) = elastic.all_systematic_effects
    assert (sensor.name, sensor.kind) == ("sensor_mass", "one-sided")
    assert sensor.reach < 0.2  # the frequencies refute a gram
    for each in found.values():
        assert each.prior_sd is not None
        assert each.standard_deviation < 1.2 * each.prior_sd
        assert not each.identifiable or each.standard_deviation < 0.8 * each.prior_sd
    elastic, found = coupon(1e-3)
    (sensor,) = elastic.all_systematic_effects
    assert sensor.centre == pytest.approx(1.0, abs=2 * sensor.width)
    assert sensor.reach > 1.0
    for name in ("E1", "E2", "G12"):
        low, high = found[name].interval_95
        assert low < stacks.MATERIALS["carbon"][name] < high, name


def test_what_a_length_that_the_modes_do_not_show_would_move() -> None:
    material = stacks.plies("unsymmetric")[0].material
    body = Specimen(0.5, 0.04, 0.01, material, "free", divisions=(14, 2))
    points = {number: (0.1 * number, 0.02 * (number % 3 - 1), 0.0) for number in range(6)}
    state = solved(body, points, 12)
    modes = modes_at(points, state.frequency_hz[:6], state.shapes[:6], 3e-4)
    elastic, found = updated(replace(body, length=0.515), modes, points, Inputs())
    (said,) = (
        each.text for each in elastic_findings(elastic, modes) if each.kind == "length_moves"
    )
    assert "a length 1 % longer than stated would change Ex by +4" in said
    off = np.log(found["Ex"].estimate / material.Ex)
    assert off == pytest.approx(4 * np.log(1.03), rel=0.1)  # as the finding says, for 3 %
    known, _ = updated(body, modes, points, replace(Inputs(), length_sd=0.0))
    assert all(each.kind != "length_moves" for each in elastic_findings(known, modes))
