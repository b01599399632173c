"""Campaigns at several temperatures: constants at one, and how they change."""

from dataclasses import replace

import numpy as np
import pytest

from fecore.body.constants import Parameter
from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import OrientedSpecimen
from fecore.dynamics.damping_laws import RAYLEIGH
from fecore.errors import InputError
from fecore.quantities import CONSTANTS
from fecore.updating.campaigns import CampaignsRecipe, CampaignsResult, lay_out, update_campaigns
from fecore.updating.elastic import fit_elastic, settled
from fecore.updating.estimates import own_estimates
from fecore.updating.laws import rank_laws
from fecore.updating.measured_ratios import MeasuredRatios
from fecore.updating.measurement import Measurement
from fecore.updating.parameters import parametrise
from fecore.updating.pipeline import update
from fecore.updating.recipe import Recipe
from fecore.updating.temperature import prior_per_k, reference_of, usual_per_k, with_temperature
from tests.support.warm import campaign, constants, per_k

THREE = (Parameter("Ex"), Parameter("Gxy"), Parameter("Gxz"))


@pytest.fixture(scope="module")
def together() -> CampaignsResult:
    random = np.random.default_rng(4)
    return update_campaigns(
        [campaign(t, random, stated=t) for t in (20.0, 50.0)], CampaignsRecipe(THREE)
    )


def test_a_bar_of_solids_at_20_and_50_degrees_is_one_material(together: CampaignsResult) -> None:
    assert (together.verdict.level, together.reference_temperature_c) == ("usable", 23.0)
    assert together.conflicts == ()
    found, true = {p.name: p for p in together.parameters}, constants(23.0)
    for name in ("Ex", "Gxy"):
        low, high = found[name].interval_95
        assert low < true[name] < high
        slope = found[f"{name}.per_K"]
        assert abs(slope.estimate - per_k(name)) < 2 * slope.standard_deviation
        assert slope.unit == "1/K"
    assert found["Gxy.per_K"].identifiable
    assert found["Gxy.per_K"].standard_deviation < 0.0005  # a third of the prior's
    assert "per_K" not in together.verdict.sentence


def test_the_curve_has_every_constant_and_the_damping_between_the_tests(
    together: CampaignsResult,
) -> None:
    curve = together.curve
    assert curve is not None
    assert curve.temperature_c[0] < 20 < 50 < curve.temperature_c[-1]
    by_name = {each.name: each for each in curve.constants}
    shear = by_name["Gxy"]
    true = np.array([constants(at)["Gxy"] for at in curve.temperature_c])
    assert np.all((shear.low < true) & (true < shear.high))
    estimate = next(p for p in together.parameters if p.name == "Gxy")
    np.testing.assert_allclose(
        np.interp(23.0, curve.temperature_c, shear.estimate), estimate.estimate, rtol=1e-3
    )
    law = next(each for each in together.damping_models if each.preferred)
    assert {each.name for each in curve.constants if each.law == law.name} == set(
        list(law.coefficients)[: len(law.units)]
    )


def test_the_damping_changes_by_kelvin_too(together: CampaignsResult) -> None:
    rayleigh = next(law for law in together.damping_models if law.name == "rayleigh")
    true = 0.01 / (1 + 0.3 * 3 / 30)
    for name in ("a0.per_K", "a1.per_K"):
        assert abs(rayleigh.coefficients[name] - true) < 2 * rayleigh.standard_deviations[name]
        assert rayleigh.standard_deviations[name] < 0.007  # the prior's is 0.01


def test_a_campaign_without_a_temperature_among_others_finds_its_own() -> None:
    random = np.random.default_rng(5)
    known = [
        Parameter(f"{name}.per_K", prior_mean=per_k(name), prior_sd=1e-5)
        for name in ("Ex", "Gxy", "Gxz")
    ]
    rows = [campaign(20.0, random, stated=20.0, modes=4), campaign(50.0, random, modes=4)]
    elastic = settled(fit_elastic(lay_out(rows, (*THREE, *known), 0.0, reference_c=20.0)))
    (own,) = [each for each in own_estimates(elastic, 1) if each.name == "temperature"]
    assert (own.initial, own.prior_sd, own.unit) == (20.0, 10.0, "°C")
    assert abs(own.estimate - 50) < 2 * own.standard_deviation
    assert own.estimate > 35
    assert not any(each.name == "temperature" for each in own_estimates(elastic, 0))


def test_at_one_temperature_nothing_changes() -> None:
    rows = [campaign(20.0, np.random.default_rng(seed), stated=None) for seed in (0, 1)]
    rows[1] = replace(rows[1], name="again")
    warm = [replace(each, temperature_c=31.0) for each in rows]
    plain, same = (lay_out(each, THREE, 0.0) for each in (rows, warm))
    assert same.labels == plain.labels
    assert same.shared == ("Ex", "Gxy", "Gxz")
    x = np.linspace(-0.02, 0.02, len(same.unknowns))
    for one, other in zip(plain.campaigns, same.campaigns, strict=True):
        assert other.prior.warmth is None
        np.testing.assert_array_equal(one.theta(x), other.theta(x))  # to the digit
        np.testing.assert_array_equal(one.prior.constants_by(one.theta(x)), one.prior.spread)


def test_one_campaign_alone_is_brought_to_a_reference_by_what_is_known_beforehand() -> None:
    warm = campaign(50.0, np.random.default_rng(2), modes=4)
    measurement = Measurement(None, warm.points, warm.modes, temperature_c=50.0)
    result = update(measurement, warm.body, Recipe(parameters=THREE, reference_temperature_c=23.0))
    assert (result.reference_temperature_c, result.verdict.level) == (23.0, "usable")
    assert result.curve is not None
    found = {p.name: p for p in result.parameters}
    # coefficients are inputs here, not asked for
    assert list(found) == ["Ex", "Gxy", "Gxz", "a0", "a1"]
    for name in ("Ex", "Gxy"):
        low, high = found[name].interval_95
        assert low < constants(23.0)[name] < high
        curve = next(each for each in result.curve.constants if each.name == name)
        at_own = [
            float(np.interp(50.0, result.curve.temperature_c, part))
            for part in (curve.low, curve.high)
        ]
        assert at_own[0] < constants(50.0)[name] < at_own[1]
    doubt = {each.source: each for each in found["Gxy"].budget}["Gxy.per_K"]
    assert doubt.standard_deviation / found["Gxy"].estimate == pytest.approx(
        0.0015 * 27 / (1 - 0.002 * 27), rel=0.1
    )
    assert doubt.standard_deviation < found["Gxy"].standard_deviation
    of_damping = {each.source: each for each in found["a1"].budget}["a1.per_K"]
    assert of_damping.standard_deviation == pytest.approx(0.27 * found["a1"].estimate)


@pytest.mark.parametrize(
    ("temperatures", "stated", "expected"),
    [
        ([None, None], None, None),
        ([20.0, 20.0], None, None),
        ([20.0, 20.0], 20.0, None),
        ([20.0, 20.0], 23.0, 23.0),
        ([20.0, 50.0], None, 23.0),
        ([20.0, 50.0], 40.0, 40.0),
        ([20.0, None], None, 20.0),
        ([21.5], None, None),
    ],
)
def test_the_reference_is_stated_or_that_of_all_or_23(
    temperatures: list[float | None], stated: float | None, expected: float | None
) -> None:
    assert reference_of(temperatures, stated) == expected


def test_what_is_stated_is_used_or_refused_by_name() -> None:
    rows = [campaign(t, np.random.default_rng(0), stated=t) for t in (20.0, 50.0)]
    with pytest.raises(InputError, match="no campaign states its temperature_c"):
        reference_of([None, None], 23.0)
    with pytest.raises(InputError, match=r"Gxy\.per_K: all is at one temperature"):
        lay_out(rows[:1], (*THREE, Parameter("Gxy.per_K")), 0.0)
    with pytest.raises(InputError, match=r"'Ey\.per_K', expected one of"):
        lay_out(rows, (*THREE, Parameter("Ey.per_K")), 0.0)
    with pytest.raises(InputError, match="coefficient of temperature"):
        lay_out(rows, (*THREE, Parameter("Gxz.per_K", tied_to="Gxy")), 0.0)
    with pytest.raises(InputError, match=r"'a9\.per_K' is of no law's coefficient"):
        update_campaigns(rows, CampaignsRecipe((*THREE, Parameter("a9.per_K", prior_mean=0.01))))
    exact = lay_out(rows, (*THREE, Parameter("Gxy.per_K", prior_mean=-0.003, fixed=True)), 0.0)
    assert exact.shared == ("Ex", "Gxy", "Gxz", "Ex.per_K", "Gxz.per_K")
    warm = exact.campaigns[1]
    name = warm.prior.constant_names.index("Gxy")
    prior = rows[0].body.nominal["Gxy"]
    assert warm.prior.constants(warm.theta(np.zeros(len(exact.unknowns))))[name] == pytest.approx(
        prior * (1 - 0.081)
    )


def test_the_derivative_is_that_of_the_constants() -> None:
    body = campaign(20.0, np.random.default_rng(0)).body
    for temperature in (50.0, None):
        prior = with_temperature(parametrise(body, THREE), 23.0, temperature, reported=True)
        theta = prior.prior_mean.copy()
        theta[-1] += 4.0 if temperature is None else 0.0
        steps = np.diag(1e-6 * np.abs(theta))
        by = [
            (prior.constants(theta + h) - prior.constants(theta - h)) / (2 * h.sum()) for h in steps
        ]
        np.testing.assert_allclose(
            prior.constants_by(theta), np.transpose(by), rtol=1e-6, atol=1e-9
        )


def test_priors_know_matrix_fibres_and_isotropic_materials() -> None:
    strip = campaign(20.0, np.random.default_rng(0)).body
    fibres, matrix = (-0.0005, 0.0005), (-0.002, 0.0015)
    metal = OrthotropicMaterial(70e9, 70e9, 70e9 / 2.6, 70e9 / 2.6, 70e9 / 2.6, 0.3, 2700.0)
    of_metal = OrientedSpecimen(0.3, 0.03, 0.005, metal, "free", divisions=(4, 2)).nominal
    assert [
        prior_per_k(name, strip.nominal) for name in ("Ex", "Ey", "Gxz", "nu_xy", "density")
    ] == [*(fibres, matrix, matrix, None, None)]
    assert [prior_per_k(name, of_metal) for name in ("Ex", "Ey", "Gxy")] == [fibres] * 3
    beam = {"web.E": 210e9, "web.G": 81e9, "web.factor": 1.0}
    assert [prior_per_k(name, beam) for name in beam] == [
        fibres,
        fibres,
        pytest.approx((-0.00125, 0.001346), rel=1e-3),
    ]
    stated = {"Ex.per_K": (-0.001, None), "a0.per_K": (0.002, 0.001)}
    assert usual_per_k("Ex", strip.nominal, stated) == (-0.001, 0.0005)
    assert usual_per_k("a0", strip.nominal, stated) == (0.002, 0.001)
    assert usual_per_k("damping_ratio_2", strip.nominal, stated) == (0.0, 0.01)
    assert usual_per_k("frequency_1", strip.nominal, stated) == pytest.approx(
        (-0.000625, 0.000673), rel=1e-3
    )
    assert usual_per_k("density", strip.nominal, stated) is None
    assert CONSTANTS["per_K"].unit == "1/K"


def test_a_law_of_one_temperature_has_no_coefficient_of_it() -> None:
    omega = 2 * np.pi * np.array([50.0, 150.0, 300.0])
    ratio = (4 / omega + 1e-5 * omega) / 2
    cold = MeasuredRatios(omega, ratio, np.eye(3) * 1e-4)
    both = MeasuredRatios(
        *(np.tile(omega, 2), np.concatenate([ratio, 1.2 * ratio]), np.eye(6) * 1e-4),
        warmer=np.repeat([0.0, 20.0], 3),
    )
    law = [RAYLEIGH]
    (alone,), (warm,) = (
        rank_laws(cold, [0, 1, 2], law).laws,
        rank_laws(both, list(range(6)), law).laws,
    )
    assert list(alone.described["coefficients"]) == ["a0", "a1"]
    assert alone.coefficients == pytest.approx([4, 1e-5], rel=1e-6)
    sds = warm.described["standard_deviations"]
    for name, true in {"a0": 4.0, "a1": 1e-5, "a0.per_K": 0.01, "a1.per_K": 0.01}.items():
        assert abs(warm.described["coefficients"][name] - true) < 2 * sds[name]
