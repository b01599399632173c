"""Shapes at typed-in poles."""

import numpy as np
import pytest

from fecore.correlation import mac
from fecore.frf import Dof, FrfSet
from fecore.modal import shapes_at_poles
from tests.support.beams import (
    ABOVE_HZ,
    ABOVE_ZETA,
    PAPER_HZ,
    PAPER_ZETA,
    cantilever_shapes,
    grid,
    paper_frfs,
    receptance,
)

ALL_HZ, ALL_ZETA = np.append(PAPER_HZ, ABOVE_HZ), np.append(PAPER_ZETA, ABOVE_ZETA)


@pytest.mark.parametrize("quantity", ["accelerance", "mobility", "receptance"])
def test_clean_frfs_give_back_exact_shapes_and_modal_mass(quantity: str) -> None:
    frfs = paper_frfs(0.0).to_quantity(quantity)  # type: ignore[arg-type]
    modes, shapes = shapes_at_poles(frfs, ALL_HZ, ALL_ZETA)
    true = cantilever_shapes(grid()) / np.sqrt(0.407)
    assert modes.dofs == tuple(Dof(p, 3) for p in range(1, 34))
    assert np.allclose(np.diag(mac(modes.shapes, true)), 1, atol=1e-12)
    assert shapes.mass_normalised is not None
    sign = np.sign(np.sum(shapes.mass_normalised * true, axis=1))
    assert np.allclose(shapes.mass_normalised, sign[:, None] * true, atol=1e-8 * np.abs(true).max())
    assert np.allclose(shapes.collinearity, 1, atol=1e-12)


def test_shape_standard_deviations_match_the_scatter() -> None:
    errors, stated = [], []
    true = cantilever_shapes(grid())[:5]
    for seed in range(12):
        modes, shapes = shapes_at_poles(paper_frfs(0.02, seed), ALL_HZ, ALL_ZETA, exponents=(-2, 0))
        assert modes.shapes is not None
        for k in range(5):
            reference = true[k] / true[k, np.argmax(np.abs(modes.shapes[k]))]
            errors.append(np.mean(np.abs(modes.shapes[k] - reference) ** 2))
            stated.append(np.mean(shapes.sd[k] ** 2))
    assert np.sqrt(np.mean(errors) / np.mean(stated)) == pytest.approx(1, abs=0.25)


def test_two_references_with_missing_pairs_fit_one_shape() -> None:
    points = grid()
    shapes = cantilever_shapes(points)[:5]
    frequency = np.arange(1.0, 1001.0)
    omega = 2 * np.pi * frequency
    pairs = [(i, 32) for i in range(33) if i not in (3, 4)] + [
        (i, 30) for i in range(33) if i != 20
    ]
    values = np.array(
        [
            (receptance(omega, PAPER_HZ, PAPER_ZETA, shapes[:, [i]], shapes[:, j]))[0] * -(omega**2)
            for i, j in pairs
        ]
    )
    frfs = FrfSet(
        frequency,
        values,
        tuple(Dof(i + 1, 3) for i, _ in pairs),
        tuple(Dof(j + 1, 3) for _, j in pairs),
    )
    modes, _ = shapes_at_poles(frfs, PAPER_HZ, PAPER_ZETA)
    assert len(modes.dofs) == 33
    assert np.allclose(np.diag(mac(modes.shapes, shapes)), 1, atol=1e-9)


def test_a_dof_that_only_a_reference_at_a_node_sees_is_unknown_and_not_the_largest() -> None:
    shape = np.append(np.linspace(-1.0, 0.9, 20), [0.5, 0.7, 1e-6])  # the last dof lies at a node
    seen_from_both = [(i, j) for i in range(20) for j in (0, 22)]
    pairs = [*seen_from_both, (20, 22), (21, 22), (22, 22)]
    hz, zeta = 100.0, 0.01
    frequency = np.linspace(80, 120, 400)
    omega, own = 2 * np.pi * frequency, 2 * np.pi * hz
    receptances = 1 / (own**2 - omega**2 + 2j * zeta * own * omega)
    values = np.array([shape[i] * shape[j] for i, j in pairs])[:, None] * receptances
    rng = np.random.default_rng(5)
    noise = 1e-3 * np.abs(receptances).max()
    values += noise * (rng.standard_normal(values.shape) + 1j * rng.standard_normal(values.shape))
    responses, references = (tuple(Dof(pair[side] + 1, 3) for pair in pairs) for side in (1, 0))
    frfs = FrfSet(frequency, values, responses, references, "receptance")
    modes, shapes = shapes_at_poles(frfs, np.array([hz]), np.array([zeta]), exponents=())
    order = [dof.point - 1 for dof in modes.dofs]
    assert order[int(np.argmax(np.abs(shapes.real[0])))] == 0
    assert mac(shapes.real, shape[order])[0, 0] > 0.9
    unknown = [order.index(20), order.index(21)]
    assert np.all(shapes.sd[0, unknown] > 5 * np.median(shapes.sd[0]))
