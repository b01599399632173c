"""What laboratories get wrong: each fault is left out with a warning, or refused with what to do; none is fitted in silence."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from benchmarks import coverage, laboratories
from benchmarks.coverage import draw
from benchmarks.laboratories import Laboratory
from fecore.body.specimen import Specimen
from fecore.body.supports import Boundary
from fecore.dynamics.damping_laws import RAYLEIGH, beyond, damping_rate
from fecore.errors import InputError, UpdatingError
from fecore.frf import Dof, FrfSet
from fecore.modal import set_with_gaps
from fecore.modes import MeasuredModes
from fecore.updating.elastic import _no_rest
from fecore.updating.forward import ForwardModel
from fecore.updating.inputs import Inputs
from fecore.updating.layout import CampaignModel, Layout
from fecore.updating.measurement import Measurement, prepare
from fecore.updating.parameters import Parameter, parametrise
from fecore.updating.pipeline import update
from fecore.updating.recipe import Recipe
from fecore.updating.result import UpdateResult

# A coarse mesh, whose bias is far below what the sets are drawn with, makes an update three times as fast.
BEAM = replace(coverage.BEAM, divisions=(20, 2))


@pytest.fixture(scope="module")
def measured() -> Measurement:
    """A laboratory that states that the response had no window."""
    given = draw(0)[0]
    return replace(given, inputs=replace(given.inputs, window_rate=0.0))


@pytest.fixture(scope="module")
def clean(measured: Measurement) -> UpdateResult:
    return update(measured, BEAM)


@pytest.fixture(scope="module")
def identified(measured: Measurement) -> Measurement:
    """The same with its modes handed in, for faults that identification does not see: the results keep their bits."""
    return replace(measured, modes=prepare(measured, BEAM, Recipe()).modes)


def scaled(measurement: Measurement, factor: float) -> Measurement:
    return replace(measurement, frfs=replace(measurement.frfs, values=factor * measurement.frfs.values))


def estimates(result: UpdateResult) -> np.ndarray:
    return np.array([row.estimate for row in result.parameters])


def deviations(result: UpdateResult) -> np.ndarray:
    return np.array([row.standard_deviation for row in result.parameters])


def assert_same(result: UpdateResult, clean: UpdateResult) -> None:
    """Estimates within a tenth of their standard deviations, and these within a tenth."""
    assert np.all(np.abs(estimates(result) - estimates(clean)) < 0.1 * deviations(clean))
    np.testing.assert_allclose(deviations(result), deviations(clean), rtol=0.1)


def test_honest_frfs_raise_no_doubt(clean: UpdateResult, identified: Measurement) -> None:
    assert clean.warnings == ()
    assert estimates(update(identified, BEAM)).tolist() == estimates(clean).tolist()


# --- values and FRFs that cannot be used -----------------------------------------------------------------------------


def test_conjugates_give_the_same_constants_and_damping(measured: Measurement, clean: UpdateResult) -> None:
    """FRFs as exp(-iωt) or a swapped cross spectrum gives them: turned in every stage, not in the identification alone."""
    assert measured.frfs is not None
    turned = update(replace(measured, frfs=measured.frfs.conjugated()), BEAM)
    assert_same(turned, clean)
    assert any("the FRFs are conjugates" in warning for warning in turned.warnings)


def test_what_cannot_be_used_is_left_out_of_everything(measured: Measurement, clean: UpdateResult) -> None:
    """Six faults in one campaign, each of which was once left out of the identification alone.

    A dead channel (fitted in stage 2, without a SAC), an FRF and its negative copy, a hit on the clamp (its FRF is 0 in the
    model, its static deflection was 0/0), overloads, a tone of random phase in every FRF (it doubled the standard deviation of
    a0), and gaps (0 with an infinite variance, which stage 2 took for a stated noise).
    """
    frfs = measured.frfs
    level = np.sqrt(np.mean(np.abs(frfs.values) ** 2))
    values = np.vstack([frfs.values, -frfs.values[:1], 1e-3 * frfs.values[:1]])
    values[3] = 0
    values[7, 100] += 50 * level
    values[9, 13] += 30 * level
    values[:, 25] += 10 * level * np.exp(2j * np.pi * np.random.default_rng(3).random(len(values)))
    values[5, 40:60] = np.nan
    values[:, 110] = np.nan
    holed = set_with_gaps(
        frfs.frequency_hz,
        values,
        (*frfs.responses, frfs.responses[0], frfs.responses[0]),
        (*frfs.references, frfs.references[0], Dof(40, 3)),
    )
    result = update(replace(measured, frfs=holed, points={**measured.points, 40: (0.0, 0.01, 0.005)}), BEAM)
    assert_same(result, clean)
    assert len(result.prediction.responses) == 31
    assert result.identification is not None
    assert {"33Z/4Z", "33Z/1Z"} == {refused.frf for refused in result.identification.refused}
    assert result.correlation.updated.sac.min() > 0.98
    assert result.correlation.held_out_frfs is not None
    assert result.correlation.held_out_frfs.coverage_95 > 0.9
    assert any("33Z/4Z was not used" in warning for warning in result.warnings)
    assert any("point 40 lies on a support" in warning for warning in result.warnings)
    assert any("interference at 52 Hz: left out" in warning for warning in result.warnings)
    (warning,) = (text for text in result.warnings if "overload" in text)  # one of two alike
    assert "line at 28 Hz" in warning
    assert "line at 202 Hz" in warning


@pytest.mark.parametrize("weighting", ["relative", "log"])
def test_gaps_are_no_data_to_other_weightings(identified: Measurement, weighting: str) -> None:
    frfs = identified.frfs.select(list(range(0, 33, 2)))
    values = frfs.values.copy()
    values[5, 40:60] = np.nan
    values[:, 100] = np.nan
    holed = set_with_gaps(frfs.frequency_hz, values, frfs.responses, frfs.references)
    recipe = Recipe(weighting=weighting)  # type: ignore[arg-type]
    with_gaps, whole = (update(replace(identified, frfs=each), BEAM, recipe) for each in (holed, frfs))
    assert_same(with_gaps, whole)
    assert with_gaps.correlation.updated.sac.min() > 0.98


def test_a_boundary_that_holds_the_sensor_is_refused(measured: Measurement) -> None:
    with pytest.raises(InputError, match="points 31, 32, 33 lie on a support") as caught:
        update(measured, replace(BEAM, boundary="simply_supported"))
    assert caught.value.field == "boundary"


# --- a measurement that is not the model's ---------------------------------------------------------------------------


def test_wrong_signs_factors_and_points_are_told(measured: Measurement, clean: UpdateResult) -> None:
    """One FRF of the opposite sign, one twice as large, two points swapped, and all in units of a thousand times the stated."""
    values, points = 1e-3 * measured.frfs.values, dict(measured.points)
    values[3] *= -1
    values[7] *= 2
    points[5], points[20] = points[20], points[5]
    result = update(replace(measured, frfs=replace(measured.frfs, values=values), points=points), BEAM)
    for sentence in (
        "the FRFs are 0.001 times as large as the model's",
        r"FRF 33Z/4Z \(-(0.99|1.0\d)\) has the opposite sign of the model's",
        r"FRF 33Z/8Z \(\+(1.99|2.0\d)\) has another height than the rest",
        r"FRFs? .*33Z/20Z.* a wrong point",
    ):
        assert any(re.match(sentence, warning) for warning in result.warnings), (sentence, result.warnings)
    # Frequencies do not know of it.
    np.testing.assert_allclose(estimates(result)[:5], estimates(clean)[:5], rtol=1e-3)


def without_damping(result: UpdateResult) -> str:
    """Why a result's damping failed; its constants stand."""
    outcomes = {outcome.stage: outcome for outcome in result.outcomes}
    assert outcomes["elastic"].status == "succeeded"
    assert outcomes["damping"].status == "failed"
    assert [p.name for p in result.parameters][:1] == ["Ex"]
    assert "a0" not in [p.name for p in result.parameters]
    assert result.verdict.level != "usable"
    return outcomes["damping"].message


@pytest.mark.parametrize(
    ("factor", "warnings"),
    [
        (-1.0, ["most FRFs have the opposite sign"]),
        (1 / 9.80665, ["the FRFs are 0.102 times as large as the model's (as acceleration in g is, for m/s²): check"]),
        (-2.5, ["most FRFs have the opposite sign", "the FRFs are 2.5 times as large as the model's: check"]),
    ],
)
def test_damping_does_not_depend_on_the_height_and_sign_of_the_frfs(
    measured: Measurement, clean: UpdateResult, factor: float, warnings: list[str]
) -> None:
    """A hammer that nobody calibrated, g for m/s², a sensor upside down: damping is in the shape of the peaks."""
    result = update(scaled(measured, factor), BEAM)
    assert result.verdict.level == "with_care"
    assert len(result.verdict.reasons) == len(warnings)
    assert all(text.startswith(word) for text, word in zip(result.verdict.reasons, warnings, strict=True))
    np.testing.assert_allclose(estimates(result), estimates(clean), rtol=1e-3)


def test_of_turned_frfs_the_one_that_is_not_is_named(measured: Measurement) -> None:
    values = -measured.frfs.values
    values[3] *= -1
    result = update(replace(measured, frfs=replace(measured.frfs, values=values)), BEAM)
    odd = r"FRF 33Z/4Z \(-(0.99|1.0\d)\) has the opposite sign of the rest's"
    assert any(re.match(odd, text) for text in result.warnings), result.warnings


@pytest.mark.parametrize(
    ("specimen", "height"),
    [
        (replace(BEAM, thickness=0.011), "1.1"),
        (replace(BEAM, material=replace(BEAM.material, density=1811.0)), "0.9"),
    ],
)
def test_a_wrong_mass_shows_in_the_height_of_the_frfs(identified: Measurement, specimen: Specimen, height: str) -> None:
    """Elastic constants take up a wrong thickness or density: frequencies and intervals look as good as before."""
    warned = [
        warning for warning in update(identified, specimen).warnings if "times as large as the model's" in warning
    ]
    assert len(warned) == 1
    assert f"the FRFs are {height}" in warned[0]


def test_a_wrong_boundary_is_told(identified: Measurement) -> None:
    result = update(replace(identified, frfs=identified.frfs.band(2.0, 500.0)), replace(BEAM, boundary="free"))
    assert any("most FRFs are unlike the model's" in warning for warning in result.warnings)
    assert any("measured mode 2" in warning and "has only MAC" in warning for warning in result.warnings)


@pytest.mark.parametrize(
    ("boundary", "reason"),
    [
        ("free", "no measured mode is like any mode of the model"),
        ("cantilever", "most measured shapes are unlike the model's"),
    ],
)
def test_a_second_beam_s_file_in_the_campaign_is_not_to_be_used(
    measured: Measurement, boundary: Boundary, reason: str
) -> None:
    """Another beam, numbered along its length and not across, so that the points are not these: few modes pair, or none."""
    points, other = measured.points, replace(BEAM, length=0.32, width=0.06, thickness=0.006, boundary=boundary)
    places = [(0.32 * (column + 1) / 11, 0.03 * side) for side in (-1, 0, 1) for column in range(11)]
    own = dict(zip(sorted(points), places, strict=True))
    known = parametrise(other)
    state = ForwardModel(other, known, tuple(own), np.array(places), 14).solve(known.prior_mean)
    sensor, hammer = measured.frfs.responses, measured.frfs.references
    model = state.frf_model(sensor, hammer)
    lines = measured.frfs.frequency_hz
    rate = damping_rate(RAYLEIGH, np.array([20.0, 1e-5]), model.omega)
    values = model.synthesise(lines, rate, beyond=beyond(RAYLEIGH, np.array([20.0, 1e-5]), float(model.omega[-1])))
    noise = 0.01 * np.sqrt(np.mean(np.abs(values) ** 2)) * np.random.default_rng(1).standard_normal(values.shape)
    ratio = rate[state.modes.rigid :] / (4 * np.pi * state.frequency_hz)
    seen = np.flatnonzero(state.frequency_hz < lines[-1])
    dofs = tuple(Dof(point, 3) for point in own)
    modes = MeasuredModes(state.frequency_hz[seen], ratio[seen], state.shapes[seen] + 0j, dofs)
    result = update(replace(measured, frfs=FrfSet(lines, values + noise, sensor, hammer), modes=modes), BEAM)
    assert result.verdict.level == "do_not_use"
    assert reason in " ".join(result.verdict.reasons)
    assert any(each.stage == "damping" and each.status == "failed" for each in result.outcomes)


def test_halves_of_a_mode_that_moved_in_the_test_are_named(measured: Measurement, clean: UpdateResult) -> None:
    """Temperature or a sensor that moves shifts a mode between the FRFs: it is found twice, in shapes that are not its own."""
    assert clean.shapes is not None
    hz = np.array([mode.measured_hz for mode in clean.modes])
    ratio = np.array([mode.measured_damping for mode in clean.modes])
    points = sorted({dof.point for dof in measured.frfs.references})
    at = [clean.shapes.points.index(point) for point in points]
    shapes = np.array([clean.shapes.updated[partner.model - 1, at] for partner in clean.pairing.partners]) + 0j
    half = shapes[1] * np.random.default_rng(5).choice([1.0, 0.1], shapes.shape[1])
    twice = np.insert(hz, 2, hz[1] * 1.002), np.insert(ratio, 2, ratio[1]), np.insert(shapes, 2, half, axis=0)
    modes = MeasuredModes(*twice, tuple(Dof(point, 3) for point in points))
    verdict = update(replace(measured, modes=modes), BEAM).verdict
    assert verdict.level == "with_care"
    assert verdict.reasons[0].startswith(f"measured modes 2 and 3 ({hz[1]:.2f} and {hz[1] * 1.002:.2f} Hz) lie within")


def test_a_mode_that_the_update_cannot_reach_is_refused(measured: Measurement, clean: UpdateResult) -> None:
    """A typing error: 220 in place of 165 Hz."""
    hz = np.array([mode.measured_hz for mode in clean.modes])
    hz[1] *= 4 / 3
    modes = MeasuredModes(hz, np.full(hz.size, np.nan))
    result = update(replace(measured, frfs=measured.frfs.select(list(range(0, 33, 4))), modes=modes), BEAM)
    assert result.verdict.level == "do_not_use"
    assert "most FRFs are unlike the model's" in " ".join(result.verdict.reasons)


@pytest.mark.parametrize(("mean", "where"), [(25e9, "above"), (45e9, "below")])
def test_an_estimate_far_from_its_prior_is_told(identified: Measurement, mean: float, where: str) -> None:
    result = update(
        replace(identified, frfs=None),
        BEAM,
        Recipe(parameters=(Parameter("Ex", prior_mean=mean, prior_sd=3e9), Parameter("Gxy"))),
    )
    assert [re.sub(r"[\d.]+ prior.*", where, text) for text in result.warnings if "prior mean" in text] == [
        f"Ex ended {where}"
    ]
    assert all(where in text for text in result.warnings if "prior mean" in text)


def test_frequencies_that_a_sure_prior_keeps_the_model_from_are_told(identified: Measurement) -> None:
    truth = draw(0)[1]["Ex"]
    sure = Recipe(parameters=(Parameter("Ex", prior_mean=1.05 * truth, prior_sd=1e-4 * truth), Parameter("Gxy")))
    exact = replace(identified, frfs=None, inputs=Inputs.exact())
    warned = [text for text in update(exact, BEAM, sure).warnings if "misses the measured frequencies by" in text]
    assert len(warned) == 1
    percent = float(re.findall(r"by ([\d.]+) %", warned[0])[0])
    assert percent == pytest.approx(2.0, abs=1.0)  # half of 5 %, fewer where Gxy helps


def test_one_mode_needs_a_law_of_one_coefficient(measured: Measurement) -> None:
    """The next law of the default that one mode can determine takes Rayleigh's place and says so; Rayleigh alone fails."""
    low = replace(measured, frfs=measured.frfs.band(2.0, 70.0), inputs=Inputs(window_rate=0.0))
    message = without_damping(update(low, BEAM, Recipe(damping_models=("rayleigh",))))
    assert re.search(r"1 measured mode cannot fix the 2 coefficients .* put `modal` first", message)
    result = update(low, BEAM)
    assert [row.name for row in result.parameters if row.identifiable] == ["Ex", "zeta1"]
    assert [text for text in result.warnings if text.startswith("one measured mode cannot fix the 2 coefficients")]
    ratio = result.modes[0]
    assert ratio.predicted_damping == pytest.approx(ratio.measured_damping, rel=0.02)


def test_a_failure_of_stage_2_says_what_looked_wrong_before(measured: Measurement) -> None:
    low = replace(measured, frfs=measured.frfs.band(2.0, 70.0))
    result = update(scaled(low, 1.5), BEAM, Recipe(damping_models=("rayleigh",)))
    assert "cannot fix the 2 coefficients" in without_damping(result)
    (factor,) = re.findall(r"the FRFs are ([\d.]+) times as large", " ".join(result.warnings))
    assert float(factor) == pytest.approx(1.5, rel=0.02)  # one mode, of 8 % damping, shows it to a per cent


def test_screening_names_the_rows_that_may_be_used() -> None:
    hz = np.linspace(10, 100, 200)
    values = np.vstack([1 / (50.0**2 - hz**2 + 2j * hz), np.zeros(200)]).astype(complex)
    frfs = FrfSet(hz, values, (Dof(1, 3), Dof(2, 3)), (Dof(1, 3), Dof(1, 3)))
    assert frfs.measured.all()
    holed = frfs.unmeasured_at(np.abs(frfs.values) == 0)
    assert holed.measured.sum(axis=1).tolist() == [200, 0]


# --- laboratories of the benchmark in which a fit once failed, or warned as numpy does --------------------------------


def thinned(laboratory: Laboratory, step: int) -> Laboratory:
    """The laboratory with one line in so many."""
    frfs = laboratory.measurement.frfs
    few = replace(
        frfs,
        frequency_hz=frfs.frequency_hz[::step],
        values=frfs.values[:, ::step],
        measured=frfs.measured[:, ::step],
    )
    return replace(laboratory, measurement=replace(laboratory.measurement, frfs=few))


@pytest.mark.parametrize(
    ("seed", "step"),
    [
        (7, 1),  # two modes of a modal law shifted into the reach of one knot
        (146, 2),  # few modes, a curved valley
        (219, 4),  # a start that would damp an unmeasured mode negatively
    ],
)
def test_fits_come_to_rest(seed: int, step: int) -> None:
    """Without the damping of the steps none does."""
    outcome = laboratories.judge(thinned(laboratories.draw(seed), step))
    assert not outcome.error
    assert outcome.held
    assert not [warning for warning in outcome.warnings if "could not be updated" in warning]


def test_pairs_that_go_round_in_a_circle_are_named() -> None:
    modes = MeasuredModes(np.array([10.0, 144.52]), np.array([0.01, 0.01]))
    one = CampaignModel("", ForwardModel(BEAM, parametrise(BEAM), (), np.zeros((0, 2)), 3), modes, np.eye(4))
    alone, two = Layout((one,), ()), Layout((one, replace(one, name="b")), ())
    assert "partner of measured mode 2 (144.52 Hz) changes to and fro" in _no_rest(alone, {(0, 1)})
    assert "partner of measured mode 2 (144.52 Hz) of campaign b changes to and fro" in _no_rest(two, {(1, 1)})
    assert "turns of 6 steps; check geometry, density, boundary and priors" in _no_rest(alone, set())
    assert "update each campaign by itself" in _no_rest(two, set())


@pytest.mark.parametrize("law", ["rayleigh", "modal"])
def test_modes_beyond_the_band_leave_stage_2_alone(identified: Measurement, clean: UpdateResult, law: str) -> None:
    """Each had a shift and a ratio of its own of which the lines said nothing, and no fit converged."""
    recipe = Recipe(band_hz=(100.0, 440.0), damping_models=(law, "modal"))
    result = update(identified, BEAM, recipe)
    for mode, other in zip(result.modes[1:3], clean.modes[1:3], strict=True):
        assert mode.predicted_damping == pytest.approx(other.measured_damping, rel=0.01)


def test_a_band_without_a_mode_is_refused(identified: Measurement) -> None:
    result = update(identified, BEAM, Recipe(band_hz=(60.0, 90.0)))
    assert "no paired mode lies in the band, 60 to 90 Hz" in without_damping(result)


def test_modes_typed_without_damping_raise_no_doubt(measured: Measurement, clean: UpdateResult) -> None:
    hz = np.array([mode.measured_hz for mode in clean.modes])
    result = update(replace(measured, modes=MeasuredModes(hz, np.full(hz.size, np.nan))), BEAM)
    assert [text for text in result.warnings if "as large as" in text or "unlike" in text or "likeness" in text] == []


@pytest.mark.parametrize(
    ("step", "recipe"),
    [
        (1, Recipe(damping_models=("caughey3", "rayleigh"))),  # one start led to a singular matrix
        (2, Recipe(method="joint")),  # the noise's share of a variance came out negative
    ],
)
def test_damping_that_the_lines_do_not_resolve_ends_in_words_or_finite_numbers(step: int, recipe: Recipe) -> None:
    laboratory = thinned(laboratories.draw(305), step)
    try:
        result = update(laboratory.measurement, laboratory.stated, recipe)
    except UpdatingError as error:
        assert "did not converge" in error.message or "beyond the critical" in error.message  # noqa: PT017
        return
    assert np.all(np.isfinite(deviations(result)))
    # Which of these it is depends on the last bits of the machine's linear algebra.
    words = ("half-power", "inadequate", "the damping could not be updated: ")
    assert any(word in text for text in result.warnings for word in words)
