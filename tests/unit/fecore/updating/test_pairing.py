"""Which mode is which where there are no shapes: by order, from several starts, with the rival in
the result.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import Specimen
from fecore.correlation import Pairing
from fecore.frf import Dof
from fecore.modes import MeasuredModes
from fecore.updating import forward
from fecore.updating.forward import (
    ForwardState,
    detection_cost,
    pair_best_match,
    pair_in_order,
    pair_with,
    probability_seen,
)
from fecore.updating.inputs import Inputs
from fecore.updating.measurement import Measurement
from fecore.updating.pipeline import update
from tests.support import draws
from tests.support.fits import at_prior, forward_model

SPRUCE = OrthotropicMaterial(
    Ex=12e9, Ey=0.9e9, Gxy=0.75e9, Gxz=0.7e9, Gyz=0.06e9, nu_xy=0.37, density=420.0
)
SEEN = 0.05  # of the largest amplitude at the FRF's point


def test_what_a_common_factor_costs() -> None:
    """One measured mode lies e^0.3 above the model's first and e^0.1 above the second, both seen
    with probability p.

    With the factor integrated out an offset d costs d²/2 / (0.06² + 0.15²), so the second is 1.53
    cheaper, and passing over the first costs -ln(1 - p): as much at p = 0.784.
    """
    model = 100.0 / np.exp([0.3, 0.1])
    assert [pair_in_order(np.array([100.0]), model, np.full(2, p)).pairs for p in (0.77, 0.8)] == [
        ((0, 1),),
        ((0, 0),),
    ]


def alignments(n: int, m: int) -> Iterator[tuple[tuple[int, int], ...]]:
    """All pairings in order of some of n measured modes with some of m of the model."""
    for count in range(min(n, m) + 1):
        for rows in combinations(range(n), count):
            for columns in combinations(range(m), count):
                yield tuple(zip(rows, columns, strict=True))


def cost(
    pairs: tuple[tuple[int, int], ...], measured: np.ndarray, model: np.ndarray, seen: np.ndarray
) -> float:
    """The sum of the module's docstring, at the best factor; modes above the last paired one cost
    nothing.
    """
    columns = [j for _, j in pairs]
    missed = [j for j in range(max(columns, default=-1)) if j not in columns]
    fixed = (
        forward.UNPAIRED * (measured.size - len(pairs))
        - np.log(1 - seen[missed]).sum()
        - np.log(seen[columns]).sum()
    )
    off = np.array([np.log(measured[i] / model[j]) for i, j in pairs])
    factors = forward._FACTORS[:, None]
    scatter = ((off - factors) ** 2).sum(axis=1) / forward._SCATTER**2 / 2
    return float(fixed + (scatter + (factors[:, 0] / forward._FACTOR_SD) ** 2 / 2).min())


@pytest.mark.parametrize(
    ("n", "m"), [(3, 5), (4, 3)], ids=["more of the model", "more measured ones"]
)
def test_no_other_alignment_costs_less(n: int, m: int) -> None:
    """All alignments of n measured with m modes of a model, tried one by one; the model's come in
    any order.
    """
    for seed in range(12):
        random = np.random.default_rng(seed)
        most = np.cumsum(random.uniform(1, 30, max(n, m))) + 20
        few = np.sort(
            random.choice(most, min(n, m), replace=False) * random.uniform(0.9, 1.1, min(n, m))
        )
        measured, model = (random.uniform(0.8, 1.25) * few, most) if n < m else (most, few)
        seen, order = random.uniform(0.05, 0.95, m), random.permutation(m)
        found = pair_in_order(measured, model, seen)
        best = min(cost(pairs, measured, model, seen) for pairs in alignments(n, m))
        assert cost(found.pairs, measured, model, seen) == pytest.approx(best, rel=1e-12)
        assert sorted((*found.unpaired_measured, *(i for i, _ in found.pairs))) == list(range(n))
        turned = pair_in_order(measured, model[order], seen[order])
        assert [(i, order[j]) for i, j in turned.pairs] == list(found.pairs)
        assert found.mac is None


def solved(
    hz: list[float],
    shapes: list[list[float]],
    *,
    points: int = 0,
    hidden: tuple[int, ...] = (),
    model_error: float = 0.0,
) -> ForwardState:
    """What pairing asks of a solved model."""
    specimen = SimpleNamespace(model_error=model_error)
    forward = SimpleNamespace(points=tuple(range(points)), specimen=specimen)
    state = SimpleNamespace(
        frequency_hz=np.array(hz), shapes=np.array(shapes), forward=forward, hidden=hidden
    )
    return cast(ForwardState, state)


def measured(hz: list[float], shapes: list[list[float]] | None, dofs: int) -> MeasuredModes:
    return MeasuredModes(
        np.array(hz),
        np.full(len(hz), 0.01),
        None if shapes is None else np.array(shapes, dtype=complex),
        tuple(Dof(point + 1, 3) for point in range(dofs)),
    )


def test_a_rival_is_one_that_may_be_seen_and_is_nearly_as_near() -> None:
    one = np.array([101.0])

    def rivals(
        second: float, seen: float, model: float = 100.0
    ) -> tuple[tuple[int, int, int], ...]:
        return pair_in_order(
            one, np.array([model, second, 300.0]), np.array([0.95, seen, 0.95])
        ).ambiguous

    # ln 103.4/101 is 0.0235, ln 101/100 0.0100, and a quarter of σ 0.015
    assert rivals(103.4, 0.6) == ((0, 0, 1),)
    assert rivals(103.6, 0.6) == ()  # 0.0254
    assert rivals(103.4, 0.5) == ()
    assert rivals(103.0, 0.6, model=0.0) == ()  # 0 Hz is no partner and no fault either
    wide = pair_in_order(one, np.array([95.5, 107.5]), np.array([0.95, 0.94]))
    assert (wide.pairs, wide.ambiguous) == (((0, 0),), ())  # 0.0624 is beyond σ
    three = pair_in_order(one, np.array([100.0, 102.5, 102.0]), np.full(3, 0.95))
    assert three.ambiguous == ((0, 0, 2),)  # the nearest of several


def test_a_mode_of_the_model_is_missed_below_the_last_measured_one() -> None:
    model = np.array([100.0, 130.0, 150.0, 199.0, 205.0, 260.0])
    found = pair_in_order(
        np.array([100.0, 200.0]), model, np.array([0.95, 0.51, 0.5, 0.95, 0.95, 0.95])
    )
    assert found.pairs == ((0, 0), (1, 3))
    assert found.unpaired_model == (1,)  # 150 Hz may as well not be seen, the others lie above
    twins = pair_in_order(
        np.array([100.0, 200.0]), np.array([100.0, 200.0, 200.0]), np.full(3, 0.95)
    )
    # at the last measured one counts as below
    assert (twins.pairs, twins.unpaired_model) == (((0, 0), (1, 1)), (2,))


def test_how_likely_a_mode_is_seen() -> None:
    """By its amplitude where shapes were measured times that at the two points that stood still."""
    hz, one = [10.0, 20.0, 30.0, 40.0], measured([10.0], [[1.0]], 1)
    shapes = [
        [2.0, 1.0, -1.0, 9.0],
        [-0.2, 1.0, 1.0, 3.0],
        [1.0, 0.1, 1.0, 5.0],
        [0.0, 1.0, 1.0, 7.0],
    ]  # a third stood still
    share = (np.array([2.0, 0.2, 0.1, 0.0]) / 2.0 / 0.1) ** 2
    expected = np.clip(share / (1 + share), 0.05, 0.95)
    assert expected.tolist() == [0.95, 0.5, pytest.approx(0.2), 0.05]
    np.testing.assert_allclose(
        probability_seen(one, solved(hz, shapes, points=4)), expected, rtol=1e-12
    )
    # amplitudes fall with a body's mass
    heavy = [[1e-3 * height for height in row] for row in shapes]
    np.testing.assert_allclose(
        probability_seen(one, solved(hz, heavy, points=4)), expected, rtol=1e-12
    )
    shapes = [
        [2.0, 1.0, -1.0, 9.0],
        [-0.2, 1.0, 1.0, 9.0],
        [1.0, 0.1, 0.5, 2.0],
        [0.0, 1.0, 1.0, 9.0],
    ]
    # the larger of two amplitudes, times that at the third and fourth point
    two = measured([10.0], [[1.0, 1.0]], 2)
    height = np.array([2.0 * 1.0 * 9.0, 1.0 * 9.0, 1.0 * 0.5 * 2.0, 1.0 * 9.0]) / 18.0
    share = (height / 0.1) ** 2
    np.testing.assert_allclose(
        probability_seen(two, solved(hz, shapes, points=4)),
        np.clip(share / (1 + share), 0.05, 0.95),
        rtol=1e-12,
    )
    nodes = [[0.0, 0.0]] * 4
    assert probability_seen(one, solved(hz, nodes, points=2)).tolist() == [0.05] * 4
    for known, points in ((measured([10.0], None, 0), 4), (one, 0)):
        assert probability_seen(known, solved(hz, shapes, points=points)).tolist() == [0.95] * 4


def test_what_a_pairing_says_against_itself() -> None:
    seen = np.array([0.9, 0.2, 0.6, 0.7, 0.8])
    model = np.array([10.0, 20.0, 30.0, 30.0, 40.0])
    found = Pairing(((0, 0), (2, 2)), None, unpaired_measured=(1,), unpaired_model=(), ambiguous=())
    # 20 and the other 30 Hz were missed, one is alone
    expected = -np.log(0.9 * 0.6) - np.log(0.8 * 0.3) + 8.0
    assert detection_cost(found, seen, model) == pytest.approx(expected, rel=1e-12)
    both = replace(found, unpaired_measured=(1, 3))
    assert detection_cost(both, seen, model) == pytest.approx(expected + 8.0, rel=1e-12)
    assert detection_cost(replace(found, pairs=()), seen, model) == np.inf


def test_shapes_decide_from_three_dofs_on() -> None:
    hz = [100.0, 110.0, 200.0]
    shapes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    model = solved(hz, [[*row, 5.0] for row in (shapes[1], shapes[0], shapes[2])], points=3)
    by_shape = pair_with(measured(hz, shapes, 3), model)
    assert by_shape.pairs == ((0, 1), (1, 0), (2, 2))
    assert by_shape.mac is not None
    hidden = replace_hidden(model, 2)
    assert pair_with(measured(hz, shapes, 3), hidden).pairs == ((0, 1), (1, 0))
    two = measured(hz, [row[:2] for row in shapes], 2)
    for modes in (two, measured(hz, None, 0)):
        by_order = pair_with(modes, model)
        assert (by_order.pairs, by_order.mac) == (((0, 0), (1, 1), (2, 2)), None)


def replace_hidden(state: ForwardState, *hidden: int) -> ForwardState:
    return cast(ForwardState, SimpleNamespace(**{**vars(state), "hidden": hidden}))


def test_where_the_model_may_mix_two_modes_a_measured_one_is_compared_with_both() -> None:
    """One of a double root was measured, with a shape between the two: it has a partner where the
    model is that inexact.
    """
    dofs, rng = 24, np.random.default_rng(0)
    shapes = np.linalg.qr(rng.standard_normal((dofs, 3)))[0].T
    mixed = np.cos(1.0) * shapes[0] + np.sin(1.0) * shapes[1] + 1e-3 * rng.standard_normal(dofs)
    modes = measured([244.0, 310.0], [mixed.tolist(), shapes[2].tolist()], dofs)
    exact, inexact = (
        solved([243.3, 244.4, 309.0], shapes.tolist(), model_error=e) for e in (0.0, 0.003)
    )
    alone, found = pair_with(modes, exact), pair_with(modes, inexact)
    assert alone.pairs == found.pairs == ((0, 1), (1, 2))
    assert alone.mac is not None
    assert found.mac is not None
    assert alone.mac[0, 1] == pytest.approx(np.sin(1.0) ** 2, abs=0.01)
    assert found.mac[0, 1] > 0.99
    far = solved([243.3, 250.0, 309.0], shapes.tolist(), model_error=0.003)
    assert pair_with(modes, far).mac == pytest.approx(alone.mac)
    even = (shapes[0] + shapes[1] + 0.3 * shapes[2] + 0.1).tolist()
    even_modes = measured([244.0], [even], dofs)
    assert not pair_with(even_modes, exact).pairs
    assert len(pair_with(even_modes, inexact).pairs) == 1


def test_the_likest_are_partners_however_unlike() -> None:
    modes = measured([100.0, 200.0], [[1.0, 0.1, 0.0], [0.1, 1.0, 0.2]], 3)
    model = solved([1000.0, 10.0, 2.0], [[0.1, 1.0, 3.0], [1.0, 0.0, 3.0], [1.0, 0.1, 0.0]])
    assert pair_with(modes, replace_hidden(model, 2)).pairs == ()
    assert pair_best_match(modes, replace_hidden(model, 2)).pairs == ((0, 1), (1, 0))


def test_one_frf_and_priors_a_third_off() -> None:
    """A free plate hit near a corner: every modulus of the prior is 34 % off, and the modes come
    back with their partners.
    """
    body = Specimen(0.4, 0.25, 0.003, SPRUCE, "free", divisions=(8, 6))
    place = {7: (0.015, -0.11, 0.0)}
    state = at_prior(forward_model(body, 12, points=place, reduced=False))
    height = np.abs(state.shapes[:8, 0])
    visible = np.flatnonzero(height > SEEN * height.max())
    hz = state.frequency_hz[visible] * (
        1 + 0.001 * np.random.default_rng(3).standard_normal(visible.size)
    )
    shapes = state.shapes[visible].astype(complex)
    modes = MeasuredModes(hz, np.full(hz.size, 0.006), shapes, (Dof(7, 3),))
    off = {name: getattr(SPRUCE, name) / 1.34 for name in ("Ex", "Ey", "Gxy", "Gxz", "Gyz")}
    stated = replace(body, material=replace(SPRUCE, **off))
    measurement = Measurement(None, place, modes, inputs=Inputs.exact())
    result = update(measurement, stated)
    assert result.pairing.by == "order"
    assert [partner.model - 1 for partner in result.pairing.partners] == list(visible)
    assert all(mode.mac is None for mode in result.modes)
    found = {p.name: p.estimate for p in result.parameters}
    for name in ("Ex", "Ey", "Gxy"):  # the frequencies are off by 0.1 %
        assert found[name] == pytest.approx(getattr(SPRUCE, name), rel=0.02)
    if result.pairing.rival is not None:
        assert result.pairing.rival.log_evidence > 0
        assert result.pairing.rival.partners != result.pairing.partners


@pytest.mark.long
def test_a_wooden_plate_from_handbook_constants() -> None:
    """Ey is far above what the handbook says, and modes stand in another order than in the model.
    In short the one above, whose priors are a third off.
    """
    drawn = draws.plate(3)["25 points"]
    result = update(drawn.measurement, drawn.stated)
    found = {p.name: p for p in result.parameters}
    for name, true in drawn.true.items():
        assert found[name].estimate == pytest.approx(true, rel=0.03)
        assert found[name].interval_95[0] < true < found[name].interval_95[1]
