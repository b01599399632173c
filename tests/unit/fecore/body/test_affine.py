"""Matrices of strains: the sum of their terms, projections, shared operators."""

from __future__ import annotations

import numpy as np
import pytest

from fecore.body.affine import distinct
from fecore.body.generators import profile
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.sections import ShellSection
from fecore.body.structure import Structure

GFRP = OrthotropicMaterial(25e9, 9e9, 3e9, 3e9, 2.4e9, 0.27, 1850.0)
CHANNEL = Structure(
    profile("channel", 0.3, 0.06, 0.04, 0.005, 0.004, elements=2),
    {"flange": ShellSection((Ply(GFRP, 0.005),)), "web": ShellSection((Ply(GFRP, 0.004, 10.0),))},
)


@pytest.mark.parametrize("name", ["stiffness", "mass"])
def test_the_matrix_is_the_sum_of_its_terms(name) -> None:
    matrix = getattr(CHANNEL.model, name)
    c = np.random.default_rng(1).uniform(1, 2, len(matrix.names))
    terms = [matrix.term(k) for k in range(len(c))]
    whole = matrix.at(c)
    assert abs(whole - sum(ck * term for ck, term in zip(c, terms, strict=True))).max() < 1e-12 * abs(whole).max()
    assert abs(whole - whole.T).max() < 1e-12 * abs(whole).max()
    random = np.random.default_rng(2).standard_normal((matrix.size, 5))
    forms = matrix.project(random, slice(2, None))
    for form, term in zip(forms, terms, strict=True):
        np.testing.assert_allclose(form, random.T @ (term @ random[:, 2:]), rtol=1e-9, atol=1e-9 * np.abs(form).max())


def test_many_vectors_are_projected_in_parts() -> None:
    matrix = CHANNEL.model.stiffness
    parts = list(matrix.groups[0].parts(10_000))
    assert len(parts) > 1
    np.testing.assert_array_equal(np.concatenate([part.nodes for part in parts]), matrix.groups[0].nodes)
    left = np.random.default_rng(4).standard_normal((matrix.size, 10_000))
    whole, few = matrix.project(left, slice(2)), matrix.project(left[:, :2], slice(None))
    np.testing.assert_allclose(whole[:, :2], few, rtol=1e-9, atol=1e-9 * np.abs(few).max())


def test_congruent_elements_share_an_operator() -> None:
    first = CHANNEL.model.stiffness.groups[0]
    assert len(first.operators) < len(first.nodes) / 2


def test_alike_items_are_found() -> None:
    items = np.random.default_rng(3).standard_normal((3, 4))[[0, 1, 0, 2, 1]]
    chosen, which = distinct(items + 1e-15)
    assert len(chosen) == 3
    np.testing.assert_allclose(items[chosen[which]], items)


def test_blocks_bound_the_stiffness() -> None:
    # K(c) ≥ α K(c₀) with α the smallest ratio of the blocks' coefficients: here of c = c₀ it is 1.
    q = np.array(list(CHANNEL.nominal.values()))
    c = CHANNEL.stiffness_coefficients(q)
    matrix = CHANNEL.model.stiffness
    covered = np.unique(np.concatenate([block.ravel() for block in matrix.blocks]))
    np.testing.assert_array_equal(covered, np.arange(len(c)))
    for block in matrix.blocks:
        assert np.linalg.eigvalsh(c[block]).min() > 0
