"""Modes that may be others, as without shapes: what is tried beside the likeliest partners, and
what the intervals span.
"""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from fecore.body.constants import Parameter
from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import Specimen
from fecore.body.supports import Spring
from fecore.correlation import Pairing
from fecore.frf import Dof, along_z
from fecore.modes import MeasuredModes
from fecore.updating.elastic import Unsettled, fit_elastic
from fecore.updating.elastic_findings import pairing_findings
from fecore.updating.elastic_result import REFUTED, ElasticResult
from fecore.updating.elastic_starts import (
    _behind,
    evidence,
    is_doubtful,
    update_from_several_starts,
)
from fecore.updating.estimates import OTHER_PARTNERS, constant_estimates
from fecore.updating.forward import ForwardModel, ForwardState, exchanged, pair_fixed, partners_of
from fecore.updating.inputs import Inputs
from fecore.updating.layout import Layout
from fecore.updating.measurement import Measurement, Recipe
from fecore.updating.pipeline import update
from fecore.updating.posterior import DISCREPANCY, DISCREPANCY_DOF
from fecore.updating.result import ParameterEstimate, UpdateResult
from tests.support.fits import at_prior, forward_model
from tests.support.plates import PAPER

STATED = OrthotropicMaterial(
    Ex=30e9, Ey=30e9, Gxy=11e9, Gxz=11e9, Gyz=11e9, nu_xy=0.3, density=2000.0
)
STRIP = Specimen(0.5, 0.04, 0.010, STATED, "free", divisions=(20, 2))


FIVE = (166.74, 458.13, 893.78, 1467.90, 2175.15)


def typed(*hz: float) -> MeasuredModes:
    """Modes as a line of points on the axis shows them, typed in without shapes."""
    return MeasuredModes(np.array(hz), np.full(len(hz), 0.01))


def updated(*hz: float) -> tuple[UpdateResult, dict[str, ParameterEstimate]]:
    few = Recipe(
        parameters=tuple(map(Parameter, ("Ex", "Gxy", "Gxz"))), damping_models=("rayleigh",)
    )
    result = update(Measurement(None, {}, typed(*hz)), replace(STRIP, divisions=(14, 2)), few)
    return result, {each.name: each for each in result.parameters}


@pytest.mark.long
def test_exact_beam_frequencies_come_to_an_end_between_two_pairings() -> None:
    """A beam without shear flexibility: the fit raises Gxy until torsion meets the fourth bending
    mode, and creeps there. In short those of close modes do, below.
    """
    result, found = updated(159.24468273, 438.96409467, 860.54508139, 1422.52459239)
    assert found["Ex"].interval_95[0] < 30e9 < found["Ex"].interval_95[1]
    assert not found["Gxy"].identifiable
    assert any(
        "measured mode 4 (1422.52 Hz) alternated during the fit" in text for text in result.warnings
    )
    assert any(start.failure and "changes to and fro" in start.failure for start in result.starts)


@pytest.fixture(scope="module")
def elastic() -> ElasticResult:
    """Five bending modes of a strip with Ex 33, Gxy 9 and Gxz 8 GPa; torsion at 940 and 1890 Hz was
    not measured.
    """
    layout = Layout.of_one(forward_model(STRIP, 12), typed(*FIVE))
    shares: list[float] = []
    found = update_from_several_starts(layout, shares.append, use_shapes=False, seed=0)
    assert sorted(shares) == shares
    assert (shares[0], shares[-1]) == pytest.approx((0, 1), abs=0.1)
    return found


def test_intervals_span_the_pairings_that_are_not_ruled_out(elastic: ElasticResult) -> None:
    column = elastic.updated.forward.parametrisation.names.index("Gxy")
    assert elastic.admissible_rivals
    assert all(rival.evidence <= REFUTED for rival in elastic.admissible_rivals)
    share = np.exp([0.0, *(-rival.evidence for rival in elastic.admissible_rivals)])
    away = [rival.other.x - elastic.x for rival in elastic.admissible_rivals]
    expected = elastic.mixture.total[column, column]
    for part, rival, d in zip(share[1:], elastic.admissible_rivals, away, strict=True):
        mixture = rival.other.mixture
        moved = mixture.weight @ (d[column] + mixture.shift[:, column]) ** 2
        expected += part * (mixture.weight @ mixture.covariance[:, column, column] + moved)
    assert elastic.model_averaged_posterior.weight.sum() == pytest.approx(1, rel=1e-12)
    assert elastic.model_averaged_posterior.total[column, column] == pytest.approx(
        expected / share.sum(), rel=1e-9
    )
    found = {each.name: each for each in constant_estimates(elastic, Inputs(), None)}
    assert found["Gxy"].interval_95[0] < 9e9 < found["Gxy"].interval_95[1]
    assert not found["Gxy"].identifiable
    assert found["Ex"].identifiable
    for each in found.values():
        assert sum(entry.share for entry in each.budget) == pytest.approx(1, abs=1e-3)
    wider = np.diag(
        elastic.model_averaged_posterior.total - elastic.mixture.total
    ) > 1e-4 * np.diag(elastic.model_averaged_posterior.total)
    for place, name in enumerate(elastic.updated.forward.parametrisation.reported):
        assert any(entry.source == OTHER_PARTNERS for entry in found[name].budget) == wider[place]


def test_a_pairing_that_tunes_a_constant_more_finely_has_less_evidence(
    elastic: ElasticResult,
) -> None:
    tuned = replace(elastic)
    vars(tuned)["inverse"] = elastic.inverse / 4
    less = elastic.theta.size * np.log(2)  # of each coordinate half of the prior meets the data
    assert evidence(tuned)[1] - evidence(elastic)[1] == pytest.approx(less, rel=1e-9)


def test_what_residuals_and_modes_without_a_partner_cost(elastic: ElasticResult) -> None:
    residual = elastic.problem.residual
    exact = replace(elastic, problem=replace(elastic.problem, residual=np.zeros(5)))
    squares = 1 + float(residual @ residual) / DISCREPANCY**2 / DISCREPANCY_DOF
    more = (DISCREPANCY_DOF + 5) / 2 * np.log(squares)
    assert evidence(elastic)[1] - evidence(exact)[1] == pytest.approx(more, rel=1e-9)
    believed = replace(elastic, x=np.zeros_like(elastic.x))
    more = np.sum((elastic.x / elastic.prior.xi_sd) ** 2) / 2
    assert evidence(elastic)[1] - evidence(believed)[1] == pytest.approx(more, rel=1e-6)
    assert _behind((1, 12.0), (0, 10.0)) == 10.0
    assert _behind((1, 12.0), (1, 10.0)) == 2.0


def test_a_result_is_doubtful_where_another_start_may_do_better(elastic: ElasticResult) -> None:
    sd = elastic.prior.xi_sd

    def doubtful(misfit: float, sds: float, alone: tuple[int, ...] = ()) -> bool:
        x = sds * sd * (np.arange(sd.size) == 0)
        pairing = replace(elastic.pairing, unpaired_measured=alone)
        problem = replace(elastic.problem, residual=np.full(5, misfit * DISCREPANCY))
        return is_doubtful(replace(elastic, problem=problem, x=x, pairings=(pairing,)))

    assert not doubtful(4.99, 1.49)
    assert doubtful(5.01, 0)
    assert doubtful(0, 1.51)
    assert doubtful(0, -1.51)
    assert doubtful(0, 0, (3,))


def state(hz: list[float], kinds: list[str], hidden: tuple[int, ...] = ()) -> ForwardState:
    values = SimpleNamespace(
        frequency_hz=np.array(hz),
        kinds=tuple(kinds),
        hidden=hidden,
        shapes=np.zeros((len(hz), 0)),
        forward=SimpleNamespace(points=()),
    )
    return cast(ForwardState, values)


def test_held_partners_stay_the_same_where_kinds_cross() -> None:
    before, after = ["bending", "torsion", "bending"], ["bending", "bending", "torsion"]
    fixed_pairing = partners_of(Pairing(((0, 0), (1, 2)), None, (), (), ()), before)
    assert fixed_pairing == ((0, "bending", 0), (1, "bending", 1))
    modes = typed(100.0, 200.0)
    assert pair_fixed(modes, state([100.0, 150.0, 200.0], before), fixed_pairing).pairs == (
        (0, 0),
        (1, 2),
    )
    crossed = pair_fixed(modes, state([100.0, 200.0, 201.0], after), fixed_pairing)
    assert crossed.pairs == ((0, 0), (1, 1))
    assert crossed.ambiguous == ((1, 1, 2),)
    assert exchanged(crossed, after) == [((0, "bending", 0), (1, "torsion", 0))]
    assert exchanged(crossed, ["bending"] * 3) == []  # two of one kind do not cross
    hidden = pair_fixed(
        modes, state([100.0, 200.0, 201.0], [*after[:2], "in-plane"], (2,)), fixed_pairing
    )
    assert hidden.ambiguous == ()
    missed = pair_fixed(modes, state([100.0, 150.0], before[:2]), fixed_pairing)
    assert (missed.pairs, missed.unpaired_measured, missed.unpaired_model) == (
        ((0, 0),),
        (1,),
        (1,),
    )


def test_close_modes_that_exchange_their_partners_for_ever_are_fitted_with_each_pairing_held() -> (
    None
):
    """Fibres at -8° make bending and torsion veer 1 % apart; the shapes are those of fibres along,
    in the other order.
    """
    material = replace(PAPER, Ey=10e9, nu_xy=0.2)
    points = dict(
        enumerate((float(x), y) for x in np.linspace(0.1, 0.5, 5) for y in (-0.018, 0.018))
    )

    def strip(angle: float) -> ForwardModel:
        body = Specimen(0.5, 0.04, 0.01, material, divisions=(20, 2), fibre_angle=angle)
        return forward_model(body, 9, points=points)

    forward = strip(-np.radians(8))
    truth = forward.parametrisation.prior_mean * np.array([1, 1, 1.2, 1])
    solved, along = forward.solve(truth), at_prior(strip(0.0))
    shapes = solved.shapes[:5].astype(complex)
    shapes[2], shapes[3] = along.shapes[3], along.shapes[2]
    dofs = tuple(Dof(point, 3) for point in forward.points)
    measured = MeasuredModes(solved.frequency_hz[:5], np.full(5, 0.01), shapes, dofs)
    layout = Layout.of_one(forward, measured)
    swings = fit_elastic(layout)
    assert isinstance(swings, Unsettled)
    assert set(swings.oscillating_modes) >= {(0, 2), (0, 3)}
    assert len(swings.history) < 50  # it ends where it has come round once; 30 turns have 77
    result = update_from_several_starts(layout)
    assert result.oscillating_modes == swings.oscillating_modes
    (said,) = [e.text for e in pairing_findings(result) if e.kind == "partners_swing"]
    assert said.startswith("the partner of measured mode 3 (")
    assert result.fixed_pairing is not None
    assert result.pairing.mac is not None
    # All orders were fitted, and the frequencies decide.
    fitted = {result.partners, *(rival.other.partners for rival in result.rivals)}
    assert fitted == {partners for partners, _ in swings.between}
    assert result.rivals[0].evidence > REFUTED
    assert result.admissible_rivals == ()
    np.testing.assert_allclose(result.theta[[0, 2]], truth[[0, 2]], rtol=2e-3)
    # At equal evidence both stand, and the intervals span them.
    even = replace(result, rivals=(replace(result.rivals[0], evidence=0.0),))
    assert "rival_pairing" in {each.kind for each in pairing_findings(even)}
    assert even.model_averaged_posterior.total[2, 2] > result.model_averaged_posterior.total[2, 2]


HUNG = replace(
    STRIP,
    divisions=(10, 2),
    springs=(
        Spring("left", 1.2e4, 3, point=(0.05, 0.0)),
        Spring("right", 1.25e4, 3, point=(0.45, 0.0)),
    ),
)
"""A symmetric body whose frequencies are the same with its springs exchanged."""
TRUE = {"left": 1.5e4, "right": 1.05e4}
ALONG = {1: (0.0, 0.0), 2: (0.1, 0.01), 3: (0.25, 0.02), 4: (0.35, -0.01), 5: (0.5, 0.0)}


def hung(*, with_shapes: bool) -> ElasticResult:
    """An update of both springs by five modes that the body has with the true ones."""
    forward = forward_model(HUNG, 6, "Ex", *TRUE, points=ALONG)
    state = forward.solve(np.array([HUNG.material.Ex, *TRUE.values()]))
    modes = typed(*state.frequency_hz)
    if with_shapes:
        modes = replace(modes, shapes=state.shapes.astype(complex), dofs=along_z(ALONG))
    return update_from_several_starts(Layout.of_one(forward, modes))


def test_shapes_say_which_of_two_springs_is_the_stiffer() -> None:
    """The fit from the prior means ends with them exchanged, where all shapes are alike enough to
    be paired.
    """
    found = hung(with_shapes=True)
    theta = dict(zip(found.layout.shared, found.theta, strict=False))
    assert {name: theta[name] for name in TRUE} == pytest.approx(TRUE, rel=0.01)
    (wrong,) = found.rivals
    assert wrong.evidence > REFUTED
    assert wrong.other.misfit < DISCREPANCY


def test_intervals_span_springs_that_frequencies_alone_may_exchange() -> None:
    found = hung(with_shapes=False)
    assert found.admissible_rivals
    for each in constant_estimates(found, Inputs(), None):
        if each.name in TRUE:
            low, high = each.interval_95
            assert all(low < value < high for value in TRUE.values())
            assert not each.identifiable
