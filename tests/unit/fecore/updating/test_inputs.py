"""What a laboratory does not know exactly: inputs, clamps, windows, delays, and how each reaches
the intervals.
"""

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from fecore.body.beam_specimen import BeamSpecimen
from fecore.body.constants import Parameter
from fecore.body.specimen import Specimen
from fecore.body.supports import Spring, edges
from fecore.errors import InputError
from fecore.frf import Dof
from fecore.modes import MeasuredModes
from fecore.updating.damping_stage import looks_windowed
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.inputs import Inputs, SystematicEffect, systematic_effects
from fecore.updating.measurement import Measurement, Recipe, prepare
from fecore.updating.mesh import DISCRETISATION, discretise
from fecore.updating.pipeline import update
from fecore.updating.result import UpdateResult
from tests.support.cantilever import MEASURED_HZ, PARAMETERS
from tests.support.draws import Drawn
from tests.support.fits import COARSE, at_prior, forward_model, update_elastic
from tests.support.lengths import long

RAYLEIGH = Recipe(damping_models=("rayleigh",))


@pytest.fixture(scope="module")
def exact(identified: Measurement) -> UpdateResult:
    """In a laboratory that knows all that it states, a window of none included."""
    return update(replace(identified, inputs=Inputs.exact()), COARSE, RAYLEIGH)


def frequencies(specimen: Specimen | BeamSpecimen, count: int = 12) -> np.ndarray:
    return at_prior(forward_model(specimen, count, next(iter(specimen.nominal)))).frequency_hz


def test_a_clamps_rotation_is_that_of_a_spring(nominal: Specimen) -> None:
    """The reaction's work is the derivative by the compliance: a spring of EI/kL = 10⁻⁴ lowers
    every mode as it says.
    """
    share = 1e-4
    EI = nominal.material.Ex * nominal.width * nominal.thickness**3 / 12
    per_metre = EI / (share * nominal.length) / nominal.width
    held = replace(nominal, supports=edges(start="clamped"))
    sprung = replace(
        nominal,
        supports=edges(start="simply_supported"),
        springs=(Spring("root", per_metre, 5, edge="start"),),
    )
    state = at_prior(forward_model(nominal, 12))
    (rotation,) = [
        each
        for each in systematic_effects(
            state, replace(Inputs.exact(), clamp_compliance_sd=share), ()
        )
        if each.name == "clamp_rotation"
    ]
    exact = frequencies(sprung)[:8] / frequencies(held)[:8] - 1
    # Bending alone: springs along the edge let it warp, a clamp as a rigid jaw does not. Second
    # order in the compliance, and the mass of the clamped row, which the reaction leaves out, are
    # some parts in a thousand of the effect.
    bending = [0, 1, 3, 4, 6]
    np.testing.assert_allclose(rotation.shift[bending], exact[bending], rtol=0.005)


def result_with(
    nominal: Specimen, parameters: tuple[Parameter, ...], inputs: dict[str, float]
) -> ElasticResult:
    forward = forward_model(nominal, 12, *parameters)
    forward = replace(forward, parametrisation=forward.parametrisation.with_inputs(inputs))
    return update_elastic(forward, MeasuredModes(MEASURED_HZ, np.full(5, np.nan)))


def test_the_budget_adds_up_and_thickness_counts_twice(nominal: Specimen) -> None:
    result = result_with(nominal, PARAMETERS, {"thickness": 0.01 * nominal.thickness})
    total = sum(part @ part.T for part in result.sources.values())
    # Frequencies go with t √E, so E's own share of a thickness known to 1 % is 2 %: shear and
    # priors take a little of it.
    assert np.linalg.norm(result.sources["thickness"][0]) == pytest.approx(0.02, rel=0.03)
    weight = np.linalg.inv(result.problem.noise + result.discrepancy**2 * np.eye(5))
    S = result.problem.sensitivity
    hessian = S.T @ weight @ S + np.diag(result.prior.xi_sd**-2)
    np.testing.assert_allclose(total, np.linalg.inv(hessian), rtol=1e-8, atol=1e-12)


def test_constants_with_a_common_scale_are_not_identifiable(nominal: Specimen) -> None:
    parameters = (*PARAMETERS, Parameter("density"))
    found = {each.name: each for each in result_with(nominal, parameters, {}).identifiability}
    for name in ("Ex", "Gxy", "density"):
        assert not found[name].identifiable
        assert set(found[name].confounded_with) & {"Ex", "Gxy", "density"}


def test_what_is_not_stated_widens_and_what_is_known_does_not(
    drawn: Drawn, result: UpdateResult, exact: UpdateResult
) -> None:
    true = drawn.true
    wide, narrow = ({p.name: p for p in each.parameters} for each in (result, exact))
    assert wide["Ex"].standard_deviation > 5 * narrow["Ex"].standard_deviation
    below, above = (abs(end - wide["Ex"].estimate) for end in wide["Ex"].interval_95)
    assert above > 1.3 * below  # a clamp can only be softer than the model's
    shares = {entry.source: entry.share for entry in wide["Ex"].budget}
    assert list(shares)[:2] == ["clamp_rotation", "thickness"]
    assert sum(shares.values()) == pytest.approx(1, abs=1e-2)
    assert exact.verdict.level == "usable"
    assert result.verdict.level == "usable"
    assert "does not say whether the response had an exponential window" in result.warnings[-1]
    for name in ("Ex", "Gxy", "Gxz", "a0", "a1"):
        assert narrow[name].interval_95[0] < true[name] < narrow[name].interval_95[1]


def _half_widths(result: UpdateResult) -> dict[str, float]:
    return {p.name: (p.interval_95[1] - p.interval_95[0]) / 2 for p in result.parameters}


def test_a_stated_window_is_taken_off_the_damping(
    identified: Measurement, exact: UpdateResult
) -> None:
    # 1/τ = 4 1/s on top of what the body has: a0 comes out 8 1/s lower, and nothing else moves.
    seen = {p.name: p.estimate for p in exact.parameters}
    windowed = replace(identified, inputs=replace(Inputs.exact(), window_rate=4.0))
    stated = update(windowed, COARSE, RAYLEIGH)
    found = {p.name: p.estimate for p in stated.parameters}
    assert found["a0"] == pytest.approx(seen["a0"] - 8, abs=0.25)
    assert found["a1"] == pytest.approx(seen["a1"], rel=0.01)
    assert found["Ex"] == pytest.approx(seen["Ex"], rel=1e-4)
    rough = _half_widths(
        update(
            replace(windowed, inputs=replace(windowed.inputs, window_rate_sd=0.5)), COARSE, RAYLEIGH
        )
    )
    sure = _half_widths(stated)
    # a0 has twice the window's rate
    assert rough["a0"] == pytest.approx(np.hypot(sure["a0"], 1.96 * 2 * 0.5), rel=0.1)
    assert rough["Ex"] == pytest.approx(sure["Ex"])
    unknown = replace(windowed.inputs, window_rate_sd=None)
    unsure = update(replace(windowed, inputs=unknown), COARSE, RAYLEIGH)
    assert _half_widths(unsure)["a0"] > 1.5 * sure["a0"]
    window = "the response seems to have had an exponential window that is not stated"
    assert any(window in warning for warning in unsure.warnings)
    with pytest.raises(InputError, match="more than measured mode 1 decays by"):
        update(replace(identified, inputs=replace(Inputs.exact(), window_rate=40.0)), COARSE)


def test_frfs_that_look_windowed_are_used_with_care_until_somebody_says() -> None:
    """A record of half a second, ended at 5 %: 1/τ = 6 1/s. The body itself has next to no constant
    part.
    """
    omega = 2 * np.pi * np.array([26.0, 160.0, 400.0, 450.0])
    own = 0.5e-5 * omega
    assert looks_windowed(omega, own, 0.5) is None
    assert looks_windowed(omega, own + 6 / omega, 0.5) == pytest.approx(6.0)
    # no window is as short as a fifteenth of the record
    assert looks_windowed(omega, own + 30 / omega, 0.5) is None
    assert looks_windowed(omega[:2], own[:2] + 6 / omega[:2], 0.5) is None


def test_a_delay_between_channels_is_found_and_leaves_the_damping_alone(
    drawn: Drawn, identified: Measurement
) -> None:
    inputs = Inputs(window_rate=0.0)
    assert drawn.measurement.frfs is not None
    delay, frfs = -80e-6, drawn.measurement.frfs.select(list(range(0, 33, 2)))
    late = replace(frfs, values=frfs.values * np.exp(-1j * frfs.omega * delay))
    clean = update(replace(identified, frfs=frfs, inputs=inputs), COARSE, RAYLEIGH)
    result = update(replace(drawn.measurement, frfs=late, inputs=inputs), COARSE, RAYLEIGH)
    assert result.channel_delay_s == pytest.approx(delay, abs=1e-6)
    for one, other in zip(result.parameters[-2:], clean.parameters[-2:], strict=True):
        assert one.estimate == pytest.approx(other.estimate, rel=0.005), one.name


def test_modes_without_frfs_give_constants_and_a_law(nominal: Specimen) -> None:
    ratio, nominal = (
        np.array([0.1556, 0.0284, 0.0243, 0.0147, 0.0126]),
        replace(nominal, divisions=(12, 2)),
    )
    result = update(Measurement(None, {}, MeasuredModes(MEASURED_HZ, ratio)), nominal)
    assert [(o.stage, o.status) for o in result.outcomes] == [
        ("elastic", "succeeded"),
        ("damping", "succeeded"),
    ]
    found = {p.name: p.estimate for p in result.parameters}
    assert found["Ex"] == pytest.approx(31.66e9, rel=0.005)
    # By hand: a0/ω + a1 ω = 2ζ by generalised least squares of the relative errors, 2 % each and 2
    # % for the law.
    omega = 2 * np.pi * MEASURED_HZ
    rows = np.column_stack([1 / omega, omega]) / (2 * ratio)[:, None]
    a0, a1 = np.linalg.lstsq(rows, np.ones(5), rcond=None)[0]
    assert (found["a0"], found["a1"]) == pytest.approx((a0, a1), rel=1e-6)
    assert result.prediction is None
    assert result.correlation.updated is None
    unknown = Measurement(None, {}, MeasuredModes(MEASURED_HZ, np.full(5, np.nan)))
    joint = update(unknown, nominal, replace(RAYLEIGH, method="joint"))
    assert joint.outcomes[1].status == "skipped"
    assert joint.parameters == result.parameters[: len(joint.parameters)]
    assert set(joint.warnings) - set(result.warnings) == {
        "the method joint needs FRFs, and the campaign has none: the constants were estimated from"
        " the modes, as the method two_stage does"
    }
    one = MeasuredModes(MEASURED_HZ, np.where(np.arange(5) == 0, ratio, np.nan))
    alone = update(Measurement(None, {}, one), nominal, RAYLEIGH).outcomes[1]
    assert (alone.status, alone.message) == (
        "skipped",
        "1 damping ratios cannot fix any of the laws asked for",
    )
    elsewhere = MeasuredModes(MEASURED_HZ, ratio, np.ones((5, 1), complex), (Dof(8, 3),))
    paired = prepare(Measurement(None, {7: (0.1, 0.0, 0.0)}, elsewhere), nominal, Recipe())
    assert paired.modes is not None
    assert paired.modes.shapes is None
    assert paired.warnings == (
        "modes were paired by frequency: their shapes have no out-of-plane value at a known point",
    )
    with pytest.raises(InputError, match="neither FRFs nor modes"):
        Measurement(None, {})


@pytest.mark.parametrize("size", [(0.5, 0.04, 0.01, 1000), long((0.2, 0.3, 0.004, 900))])
def test_the_mesh_is_as_good_as_it_says(
    nominal: Specimen, size: tuple[float, float, float, float]
) -> None:
    length, width, thickness, highest = size
    body = replace(nominal, length=length, width=width, thickness=thickness)
    found = discretise(body, highest)
    assert found.error.max() < DISCRETISATION
    nx, ny = found.divisions
    chosen, finer = (
        frequencies(replace(body, divisions=d), found.error.size)
        for d in ((nx, ny), (2 * nx, 2 * ny))
    )
    assert np.abs(chosen / finer - 1).max() < DISCRETISATION


@pytest.mark.parametrize("kind", ["one-sided", "square", "both"])
def test_an_excursion_has_the_moments_of_its_draws(
    kind: Literal["one-sided", "square", "both"],
) -> None:
    each = SystematicEffect("sensor", np.zeros(0), kind, stated=True, amount="1 g")
    draws = each.draws(np.random.default_rng(1), 200_000)
    assert (each.sd, each.rms) == pytest.approx(
        (np.std(draws), np.sqrt(np.mean(draws**2))), rel=0.01
    )
