"""What shear theory misses of solids, intervals where all inputs are exact, and what a result then
says of itself.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fecore.body.constants import DEFAULT_PARAMETERS, Parameter
from fecore.updating.elastic_findings import undetermined
from fecore.updating.estimates import Spread
from fecore.updating.inputs import (
    OF_THEORY,
    SHEAR_CORRECTION_SD,
    Inputs,
    SystematicEffect,
    by_shear_correction,
    discrepancy_scale,
)
from fecore.updating.pipeline import update
from fecore.updating.posterior import DISCREPANCY
from fecore.updating.result import Comparable, ParameterEstimate, UpdateResult, judge
from tests.support.blind_beams import Beam, stored
from tests.support.draws import solved
from tests.support.lengths import long

BEAMS = stored()[:6]


@pytest.fixture(scope="module", params=[2, long(6)])
def exact(request: pytest.FixtureRequest) -> list[tuple[Beam, UpdateResult]]:
    return [
        (beam, update(beam.measurement(Inputs.exact()), beam.stated))
        for beam in BEAMS[: request.param]
    ]


def test_what_theory_misses_of_solids_is_one_factor_of_shear() -> None:
    for beam in BEAMS[:4]:
        state = solved(beam.as_it_is, beam.points, beam.hz.size + 6)
        hz, by = state.frequency_hz[: beam.hz.size], by_shear_correction(state)[: beam.hz.size]
        # the two without a neighbour that stands in another order
        like = np.abs(hz / beam.hz - 1) < 0.002
        missed, by = np.log(beam.hz / hz)[like], by[like]
        size = float(missed @ by / (by @ by))
        assert 0.5 < size < 1.5, "about one standard deviation of κ"
        assert np.sqrt(np.mean(missed**2)) > 3e-4
        assert np.sqrt(np.mean((missed - size * by) ** 2)) < 1.5e-4


def test_intervals_of_exact_inputs_are_as_wide_as_the_errors(
    exact: list[tuple[Beam, UpdateResult]],
) -> None:
    """What shear theory misses is in the intervals, and they are no wider than it asks for."""
    z: dict[str, list[float]] = {"Ex": [], "Gxy": [], "Gxz": []}
    for beam, result in exact:
        known = {p.name: p for p in result.parameters}
        for name, each in z.items():
            p = known[name]
            assert p.identifiable, (name, beam.size)
            each.append((p.estimate - beam.true[name]) / p.standard_deviation)
        assert known["Gxz"].standard_deviation < 0.05 * known["Gxz"].estimate
        assert known["Gxy"].standard_deviation < 0.01 * known["Gxy"].estimate
    rms = {name: np.sqrt(np.mean(np.square(each))) for name, each in z.items()}
    assert max(np.abs(each).max() for each in z.values()) < 3.0
    assert rms["Gxz"] > 0.5, rms
    assert rms["Gxy"] > 0.4, rms
    assert max(rms.values()) < 1.3, rms


def test_shares_of_a_budget_add_up_to_one(exact: list[tuple[Beam, UpdateResult]]) -> None:
    as_stated = [update(beam.measurement(Inputs()), beam.stated) for beam in BEAMS[:1]]
    for result in (*(each for _, each in exact), *as_stated):
        for p in result.parameters:
            if p.prior_sd is not None:
                assert sum(entry.share for entry in p.budget) == pytest.approx(1, abs=1e-3), p.name
                parts = np.sqrt(sum(entry.standard_deviation**2 for entry in p.budget))
                assert parts == pytest.approx(p.standard_deviation, rel=1e-3), p.name


def test_a_tied_constant_that_the_tie_decides_is_not_identifiable(
    exact: list[tuple[Beam, UpdateResult]],
) -> None:
    for _, result in exact:
        tied = next(p for p in result.parameters if p.name == "Gyz")
        assert max(tied.budget, key=lambda entry: entry.share).source == "tie to Gxz"
        assert not tied.identifiable


positive = st.floats(0.01, 10.0)


@given(
    st.lists(positive, min_size=1, max_size=4),
    positive,
    positive,
    positive,
    st.floats(-3, 3),
    st.integers(0, 2**32 - 1),
)
def test_sources_add_up_whatever_is_added(
    parts: list[float], wider: float, narrower: float, tie: float, pull: float, seed: int
) -> None:
    sd = float(np.sqrt(sum(parts)))
    whole = Spread(
        sd, 0.0, 2 * sd, 2 * sd, {str(number): part for number, part in enumerate(parts)}
    )
    one_sided = SystematicEffect("clamp", np.zeros(1), "one-sided", True, "")
    samples = np.random.default_rng(seed).standard_normal(50) + 0.3
    for each in (
        whole.widened(wider * sd, 1.0, 1.0, "partners").widened(narrower * sd, 1.0, 1.0, "real"),
        whole.tied("Ex", tie),
        whole.sampled(samples).with_systematic_effects([one_sided], np.array([pull])),
    ):
        assert sum(each.variance.values()) == pytest.approx(each.sd**2, rel=1e-9)
        assert min(each.variance.values()) >= 0


def test_an_even_body_has_a_smaller_discrepancy() -> None:
    body = BEAMS[0].stated
    scales = [
        discrepancy_scale(body, replace(Inputs(), thickness_sd=share * body.thickness))
        for share in (0, 0.003, 1)
    ]
    assert scales == sorted(scales)
    assert (scales[0], scales[-1], discrepancy_scale(body, Inputs())) == pytest.approx(
        (OF_THEORY, *[DISCREPANCY] * 2)
    )
    assert 0 < SHEAR_CORRECTION_SD < 0.05


def estimate(
    name: str, *, identifiable: bool, low: float = 26.0, tied_to: str | None = None
) -> ParameterEstimate:
    return ParameterEstimate(
        *(
            name,
            "Pa",
            25.0,
            27.0,
            0.5,
            0.1,
            (low, 28.0),
            identifiable,
            25.0,
            7.0,
            Comparable(27.0, 0.1),
        ),
        tied_to=tied_to,
    )


def test_a_level_follows_what_is_asked_for_or_determined() -> None:
    known = [estimate("Ex", identifiable=True), estimate("Ey", identifiable=False)]
    assert undetermined(known, None, DEFAULT_PARAMETERS) == []
    assert undetermined(known, DEFAULT_PARAMETERS, DEFAULT_PARAMETERS) == [], (
        "the usual ones, whoever names them"
    )
    assert (
        undetermined(known, [Parameter("Ex"), Parameter("Ey", tied_to="Ex")], DEFAULT_PARAMETERS)
        == []
    )
    (asked,) = undetermined(known, [Parameter("Ex"), Parameter("Ey")], DEFAULT_PARAMETERS)
    assert (asked.level, "Ey" in asked.text, "Ex" in asked.text) == ("with_care", True, False)
    (none,) = undetermined(known[1:], None, DEFAULT_PARAMETERS)
    assert none.level == "with_care"


def test_an_interval_that_is_not_about_its_middle_has_two_sides() -> None:
    skewed = judge([], [estimate("Ex", identifiable=True, low=20.0)]).sentence
    assert "Ex to +1.9 −13 %" in skewed
    assert "Ex to 1.9 %" in judge([], [estimate("Ex", identifiable=True)]).sentence
