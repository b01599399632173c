"""The whole job on FRFs of the core's own, and on the independent sets where they are."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from fecore.body.constants import Parameter
from fecore.body.specimen import Specimen
from fecore.errors import InputError, UpdatingError
from fecore.frf import Dof
from fecore.modal import set_with_gaps
from fecore.updating.damping_data import DampingData
from fecore.updating.damping_stage import ReferenceFit, fit_reference
from fecore.updating.measurement import DEFAULT_LAWS, HoldOut, Measurement, Recipe
from fecore.updating.pipeline import _Damping, update
from fecore.updating.result import UpdateResult
from fecore.updating.sampling import run_chain
from tests.support.draws import BEAM, Drawn, beam
from tests.support.fits import COARSE
from tests.support.lengths import long

JOINT = Recipe(method="joint", damping_models=("rayleigh",))
PARAMETERS = ("Ex", "Ey", "Gxy", "Gxz", "a0", "a1")


def inside(result: UpdateResult, true: dict[str, float]) -> dict[str, bool]:
    """Whether each parameter's 95 % interval holds the truth."""
    found = {row.name: row.interval_95 for row in result.parameters}
    return {name: found[name][0] <= true[name] <= found[name][1] for name in PARAMETERS}


@pytest.mark.parametrize(
    "bodies",
    [
        [],
        long([BEAM, COARSE, COARSE]),  # the first on the mesh that an update chooses
    ],
)
def test_intervals_hold_the_truth_as_often_as_they_say(
    drawn: Drawn, result: UpdateResult, bodies: list[Specimen]
) -> None:
    """Sets with a wrong model; 88 % of 6 or 24 intervals must hold."""
    held = list(inside(result, drawn.true).values())
    for seed, body in enumerate(bodies, start=1):
        other = beam(seed)
        held += list(inside(update(other.measurement, body), other.true).values())
    assert len(held) == (1 + len(bodies)) * len(PARAMETERS)
    assert np.mean(held) >= 0.88


def test_every_eighth_frf_is_held_out_and_predicted_with_its_interval(result: UpdateResult) -> None:
    held = result.correlation.held_out_frfs
    assert held is not None
    assert held.points == (5, 13, 21, 29)
    assert held.agreement.sac.min() > 0.98
    assert 0.9 <= held.coverage_95 <= 1.0
    assert result.correlation.updated.sac.size == 29


@pytest.mark.long
def test_directions_that_are_typed_negative_change_nothing(
    drawn: Drawn, result: UpdateResult
) -> None:
    """A sensor mounted upside down, and hits from below at every third point. In short shapes and
    FRFs have their sense in `test_structures.py`.
    """
    frfs = drawn.measurement.frfs
    assert frfs is not None
    below = np.array([-1 if dof.point % 3 == 0 else 1 for dof in frfs.references])
    turned = replace(
        frfs,
        values=frfs.values * -below[:, None],
        responses=tuple(Dof(dof.point, -dof.direction) for dof in frfs.responses),
        references=tuple(
            Dof(dof.point, s * dof.direction)
            for s, dof in zip(below.tolist(), frfs.references, strict=True)
        ),
    )
    other = update(replace(drawn.measurement, frfs=turned), COARSE)
    for one, its in zip(result.parameters, other.parameters, strict=True):
        assert (its.estimate, its.standard_deviation) == pytest.approx(
            (one.estimate, one.standard_deviation), rel=1e-6
        )
    one, its = result.correlation, other.correlation
    np.testing.assert_allclose(its.mac_matrix, one.mac_matrix, atol=1e-6)
    np.testing.assert_allclose(its.updated.frac, one.updated.frac, atol=1e-6)
    assert [each.text for each in other.findings] == [each.text for each in result.findings]


def test_held_out_points_and_band_are_not_seen_by_the_fit(drawn: Drawn) -> None:
    """Spoiling what is held out must leave every estimate as it was, to the bit."""
    measurement = replace(
        drawn.measurement, frfs=drawn.measurement.frfs.select(list(range(0, 33, 3)))
    )
    held = HoldOut(points=(4, 7), band_hz=(500.0, 600.0))
    recipe = Recipe(hold_out=held, damping_models=("rayleigh",))
    spoilt = measurement.frfs.values.copy()
    rows = [i for i, dof in enumerate(measurement.frfs.references) if dof.point in (4, 7)]
    spoilt[rows] *= 3
    changed = replace(measurement, frfs=replace(measurement.frfs, values=spoilt))
    one, other = update(measurement, COARSE, recipe), update(changed, COARSE, recipe)
    assert [p.estimate for p in one.parameters] == [p.estimate for p in other.parameters]
    assert one.correlation.held_out_frfs is not None
    assert other.correlation.held_out_frfs is not None
    assert other.correlation.held_out_frfs.coverage_95 < one.correlation.held_out_frfs.coverage_95
    assert one.correlation.held_out_band is not None
    assert one.correlation.held_out_band.band_hz == (500.0, 600.0)


def test_a_tied_constant_has_the_doubt_of_its_tie(identified: Measurement) -> None:
    def gyz(prior_sd: float | None) -> tuple[float, float, dict[str, float]]:
        tied = Parameter("Gyz", prior_sd=prior_sd, tied_to="Gxz")
        parameters = (*(Parameter(name) for name in ("Ex", "Ey", "Gxy", "Gxz")), tied)
        found = {
            p.name: p
            for p in update(
                replace(identified, frfs=None),
                COARSE,
                Recipe(parameters=parameters, damping_models=("rayleigh",)),
            ).parameters
        }
        low, high = np.log(found["Gyz"].interval_95)
        master_low, master_high = np.log(found["Gxz"].interval_95)
        assert found["Gyz"].tied_to == "Gxz"
        budget = {entry.source: entry.share for entry in found["Gyz"].budget}
        return (
            (high - low) ** 2 - (master_high - master_low) ** 2,
            found["Gyz"].prior_sd or 0.0,
            budget,
        )

    wider, _, budget = gyz(None)
    assert np.sqrt(wider) == pytest.approx(2 * 1.96 * np.sqrt(np.log1p(0.3**2)), rel=1e-3)
    assert 0 < budget["tie to Gxz"] < 1
    sure, prior_sd, _ = gyz(1e-6 * COARSE.material.Gyz)
    assert sure == pytest.approx(0.0, abs=1e-6)
    assert prior_sd == pytest.approx(0.3 * COARSE.material.Gyz, rel=1e-6)


def _not_converging(monkeypatch: pytest.MonkeyPatch, above_hz: float) -> None:
    """A reference fit that fails where lines above this frequency are in the band."""

    def failing(data: DampingData) -> ReferenceFit:
        if data.frfs.frequency_hz[-1] > above_hz:
            raise UpdatingError("the modal fit did not converge", {"a0": 1.0}, (1.0,))
        return fit_reference(data)

    monkeypatch.setattr("fecore.updating.pipeline.fit_reference", failing)


def test_damping_of_fewer_modes_takes_the_place_of_a_fit_that_does_not_converge(
    identified: Measurement, drawn: Drawn, result: UpdateResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert identified.modes is not None
    _not_converging(monkeypatch, float(identified.modes.frequency_hz[-1]))
    found = update(identified, COARSE)
    said = next(f for f in found.findings if f.kind == "damping_narrowed")
    assert "did not converge" in said.text
    one, other = ({p.name: p for p in each.parameters} for each in (result, found))
    assert other["a0"].estimate == pytest.approx(
        drawn.true["a0"], abs=4 * other["a0"].standard_deviation
    )
    assert other["a1"].standard_deviation > one["a1"].standard_deviation  # fewer modes say less


def test_a_band_is_narrower_by_a_mode_while_two_are_left() -> None:
    hz = np.array([100.0, 400.0, 900.0])
    for count, bands in ((3, [(2.0, 600.0), (200.0, 1000.0)]), (2, [])):
        pairing = SimpleNamespace(pairs=tuple((n, n) for n in range(count)))
        elastic = SimpleNamespace(pairing=pairing, updated=SimpleNamespace(frequency_hz=hz))
        stage = cast(_Damping, SimpleNamespace(elastic=elastic))
        assert list(_Damping._narrower(stage, (2.0, 1000.0))) == bands


def test_damping_ratios_take_the_place_of_frfs_that_no_fit_converges_on(
    identified: Measurement, drawn: Drawn, monkeypatch: pytest.MonkeyPatch
) -> None:
    _not_converging(monkeypatch, 0.0)
    found = update(identified, COARSE)
    assert any(f.kind == "damping_of_ratios" for f in found.findings)
    a0 = next(p for p in found.parameters if p.name == "a0")
    assert a0.estimate == pytest.approx(drawn.true["a0"], abs=4 * a0.standard_deviation)


def test_a_rayleigh_body_has_one_optimum_and_is_called_adequate(result: UpdateResult) -> None:
    assert result.damping_fit.starts >= 4
    assert len(result.damping_fit.optima) == 1
    laws = {law.name: law for law in result.damping_models}
    assert set(laws) == set(DEFAULT_LAWS)
    assert laws["rayleigh"].preferred
    assert not any("inadequate" in warning for warning in result.warnings)


@pytest.fixture(scope="module")
def few(drawn: Drawn) -> Measurement:
    """Every eighth FRF with a gap in one, for the joint update."""
    frfs = drawn.measurement.frfs.select(list(range(0, 33, 8)))
    values = frfs.values.copy()
    values[3, 40:60] = np.nan
    holed = set_with_gaps(frfs.frequency_hz, values, frfs.responses, frfs.references)
    return replace(drawn.measurement, frfs=holed)


@pytest.fixture(scope="module")
def joint(few: Measurement, _few_draws: None) -> UpdateResult:
    return update(few, COARSE, JOINT)


def test_joint_update_needs_no_modes(drawn: Drawn, joint: UpdateResult) -> None:
    true = drawn.true
    assert joint.identification is None
    found = {p.name: p for p in joint.parameters}
    # six intervals of one set: three standard deviations, which one in 60 sets misses
    for name in PARAMETERS:
        assert abs(found[name].estimate - true[name]) < 3 * found[name].standard_deviation, name
    assert found["Ex"].estimate == pytest.approx(true["Ex"], rel=0.01)
    assert found["a0"].estimate == pytest.approx(true["a0"], rel=0.05)


@pytest.mark.long
def test_joint_update_takes_gaps_for_no_data(drawn: Drawn, joint: UpdateResult) -> None:
    """In short the truth lies as near to the joint update of FRFs with a gap, above."""
    whole = drawn.measurement.frfs.select(list(range(0, 33, 8)))
    result = update(replace(drawn.measurement, frfs=whole), COARSE, JOINT)
    for one, other in zip(result.parameters, joint.parameters, strict=True):
        assert abs(one.estimate - other.estimate) < 0.1 * other.standard_deviation, one.name
        assert one.standard_deviation == pytest.approx(other.standard_deviation, rel=0.1), one.name


@pytest.mark.long
@pytest.mark.usefixtures("_few_draws")
def test_joint_update_searches_with_the_law_asked_for(drawn: Drawn, few: Measurement) -> None:
    """In short with Rayleigh's, above."""
    true = drawn.true
    joint = update(few, COARSE, Recipe(method="joint", damping_models=("generalised",)))
    assert joint.damping_models[0].name == "generalised"
    found = {p.name: p for p in joint.parameters}
    for name in ("Ex", "Gxy", "Gxz"):
        assert abs(found[name].estimate - true[name]) < 3 * found[name].standard_deviation, name
    omega = 2 * np.pi * np.array([mode.measured_hz for mode in joint.modes])
    ratio = np.array([mode.predicted_damping for mode in joint.modes], dtype=float)
    assert ratio.size == 5
    # The body lies off its Rayleigh law by 2 % (one standard deviation) a mode.
    np.testing.assert_allclose(ratio, (true["a0"] / omega + true["a1"] * omega) / 2, rtol=0.06)


def test_joint_update_refuses_an_unknown_law_before_it_searches(drawn: Drawn) -> None:
    reported: list[float] = []
    recipe = Recipe(method="joint", damping_models=("coulomb",))
    with pytest.raises(InputError) as caught:
        update(drawn.measurement, COARSE, recipe, lambda _, share: reported.append(share))
    assert caught.value.field == "damping_models.0"
    assert max(reported) <= 0.4  # the share at which the search begins


def test_shapes_tell_what_frequencies_do(
    drawn: Drawn, identified: Measurement, result: UpdateResult
) -> None:
    true = drawn.true
    shaped = update(
        replace(identified, frfs=None),
        COARSE,
        Recipe(use_shapes=True, damping_models=("rayleigh",)),
    )
    assert all(inside(shaped, true)[name] for name in ("Ex", "Gxy", "Gxz"))
    # As shares of the estimates: their coordinates are logarithms.
    one = {p.name: p.standard_deviation / p.estimate for p in result.parameters}
    for parameter in shaped.parameters[:5]:
        assert parameter.standard_deviation / parameter.estimate <= one[parameter.name] * 1.01


def test_progress_names_stages_and_a_raise_in_it_stops_the_job(few: Measurement) -> None:
    class StopError(Exception):
        pass

    reported: list[tuple[str, float]] = []

    def progress(stage: str, share: float) -> None:
        reported.append((stage, share))
        if stage == "updating the damping":
            raise StopError

    with pytest.raises(StopError):
        update(few, COARSE, progress=progress)
    assert [share for _, share in reported] == sorted(share for _, share in reported)
    assert reported[0][0] == "identifying the modes"


class Kept:
    """Keeps every state of a chain."""

    def __init__(self, restored: bytes | None = None) -> None:
        self.restored, self.all = restored, list[bytes]()

    def checkpoint(self, data: bytes) -> None:
        self.all.append(data)


def test_a_chain_taken_up_again_ends_with_the_same_bits() -> None:
    covariance = np.array([[4.0, 1.0], [1.0, 1.0]])
    inverse = np.linalg.inv(covariance)

    def chain(kept: Kept) -> np.ndarray:
        return run_chain(
            density=lambda x: -np.einsum("wi,ij,wj->w", x, inverse, x) / 2,
            start=np.zeros(2),
            covariance=covariance,
            seed=np.random.SeedSequence(1),
            target=8_000,
            progress=lambda _: None,
            names=("a", "b"),
            checkpoint=kept,
        ).samples

    whole = Kept()
    samples = chain(whole)
    late = Kept(restored=whole.all[len(whole.all) // 2])
    np.testing.assert_array_equal(chain(late), samples)
    assert 0 < len(late.all) < len(whole.all)
    assert late.all[-1] == whole.all[-1]
    np.testing.assert_allclose(np.cov(samples.T), covariance, rtol=0.2)
