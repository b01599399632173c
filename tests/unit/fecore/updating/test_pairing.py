"""Which mode is which where there are no shapes: by order, from several starts, with the rival in the result."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from benchmarks import wooden_plates
from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import Specimen
from fecore.frf import Dof
from fecore.modes import MeasuredModes
from fecore.updating import pairing
from fecore.updating.forward import ForwardModel
from fecore.updating.inputs import Inputs
from fecore.updating.measurement import Measurement
from fecore.updating.pairing import pair_in_order
from fecore.updating.parameters import parametrise
from fecore.updating.pipeline import update

HZ = np.array([24.1, 61.0, 66.5, 118.0, 160.2, 171.0, 240.5])
SPRUCE = OrthotropicMaterial(Ex=12e9, Ey=0.9e9, Gxy=0.75e9, Gxz=0.7e9, Gyz=0.06e9, nu_xy=0.37, density=420.0)
SEEN = 0.05  # of the largest amplitude at the FRF's point


def test_a_common_factor_does_not_move_modes_to_their_neighbours() -> None:
    found = pair_in_order(1.16 * HZ, HZ, np.full(HZ.size, 0.95))  # moduli 34 % higher
    assert found.pairs == tuple((k, k) for k in range(HZ.size))


def test_modes_with_a_node_at_the_point_are_passed_over() -> None:
    seen = np.array([0.95, 0.05, 0.95, 0.95, 0.05, 0.95, 0.95])
    found = pair_in_order(0.86 * HZ[seen > 0.5], HZ, seen)
    assert [column for _, column in found.pairs] == list(np.flatnonzero(seen > 0.5))
    assert found.unpaired_model == ()


def test_a_measured_mode_that_the_model_has_not_stays_alone() -> None:
    measured = np.sort(np.append(HZ, 90.0))
    found = pair_in_order(measured, HZ, np.full(HZ.size, 0.95))
    assert found.unpaired_measured == (3,)
    assert len(found.pairs) == HZ.size


def alignments(n: int, m: int) -> Iterator[tuple[tuple[int, int], ...]]:
    """All pairings in order of some of n measured modes with some of m of the model."""
    for count in range(min(n, m) + 1):
        for rows in combinations(range(n), count):
            for columns in combinations(range(m), count):
                yield tuple(zip(rows, columns, strict=True))


def cost(pairs: tuple[tuple[int, int], ...], measured: np.ndarray, model: np.ndarray, seen: np.ndarray) -> float:
    """The sum of the module's docstring, at the best factor; modes above the last paired one cost nothing."""
    columns = [j for _, j in pairs]
    missed = [j for j in range(max(columns, default=-1)) if j not in columns]
    fixed = pairing._ALONE * (measured.size - len(pairs)) - np.log(1 - seen[missed]).sum() - np.log(seen[columns]).sum()
    off = np.array([np.log(measured[i] / model[j]) for i, j in pairs])
    factors = pairing._FACTORS[:, None]
    scatter = ((off - factors) ** 2).sum(axis=1) / pairing._SCATTER**2 / 2
    return float(fixed + (scatter + (factors[:, 0] / pairing._FACTOR_SD) ** 2 / 2).min())


@pytest.mark.parametrize("seed", range(12))
def test_no_other_alignment_costs_less(seed: int) -> None:
    """All alignments of three measured with five modes of a model, tried one by one."""
    random = np.random.default_rng(seed)
    model = np.cumsum(random.uniform(1, 30, 5)) + 20
    measured = np.sort(random.choice(model, 3, replace=False) * random.uniform(0.8, 1.25) * random.uniform(0.9, 1.1, 3))
    seen = random.uniform(0.05, 0.95, 5)
    found = pair_in_order(measured, model, seen).pairs
    best = min(cost(pairs, measured, model, seen) for pairs in alignments(3, 5))
    assert cost(found, measured, model, seen) == pytest.approx(best, rel=1e-12)


def test_one_frf_and_priors_a_third_off() -> None:
    """A free plate hit near a corner: every modulus of the prior is 34 % off, and the modes come back with their partners."""
    body = Specimen(0.4, 0.25, 0.003, SPRUCE, "free", divisions=(8, 6))
    known = parametrise(body)
    place = np.array([[0.015, -0.11]])
    state = ForwardModel(body, known, (7,), place, 12, reduced=False).solve(known.prior_mean)
    height = np.abs(state.shapes[:8, 0])
    visible = np.flatnonzero(height > SEEN * height.max())
    hz = state.frequency_hz[visible] * (1 + 0.001 * np.random.default_rng(3).standard_normal(visible.size))
    shapes = state.shapes[visible].astype(complex)
    modes = MeasuredModes(hz, np.full(hz.size, 0.006), shapes, (Dof(7, 3),))
    off = {name: getattr(SPRUCE, name) / 1.34 for name in ("Ex", "Ey", "Gxy", "Gxz", "Gyz")}
    stated = replace(body, material=replace(SPRUCE, **off))
    measurement = Measurement(None, {7: (0.015, -0.11, 0.0)}, modes, inputs=Inputs.exact())
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


def test_a_wooden_plate_from_handbook_constants() -> None:
    """Ey is far above what the handbook says, and modes stand in another order than in the model."""
    drawn = wooden_plates.plate(3)
    result = update(drawn.measured["25 points"], drawn.stated)
    found = {p.name: p for p in result.parameters}
    for name, true in drawn.truth.items():
        assert found[name].estimate == pytest.approx(true, rel=0.03)
        assert found[name].interval_95[0] < true < found[name].interval_95[1]
