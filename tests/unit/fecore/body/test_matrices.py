"""Matrices of strains, their terms and projections; and matrices as a body: those of our own
models, set by set.
"""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from fecore.body import affine
from fecore.body.generators import profile
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.matrices import MatrixBody
from fecore.body.sections import ShellSection
from fecore.body.structure import Structure
from fecore.body.supports import Mass, Spring
from fecore.errors import InputError
from service.nouns.structures.schemas import StructureIn
from service.nouns.updates.bodies import nominal_body
from tests.support.bodies import hz
from tests.support.matrices import matrices_of_sets
from tests.support.profiles import ANGLE

NODE = (0.4, -0.028, 0.04)


def both(boundary: str = "free") -> tuple[Structure, MatrixBody]:
    body = nominal_body(StructureIn.model_validate(ANGLE), boundary)
    dofs, stiffness, mass = matrices_of_sets(body)
    turned = np.random.default_rng(0).permutation(len(dofs))  # a solver orders rows as it likes
    shuffled = [
        {n: scipy.sparse.csc_array(m[turned][:, turned]) for n, m in each.items()}
        for each in (stiffness, mass)
    ]
    return body, MatrixBody(body.mesh.nodes, dofs[turned], *shuffled)


def changed(body: Structure | MatrixBody, **constants: float) -> np.ndarray:
    return hz(body, 8, np.array(list({**body.nominal, **constants}.values())))


@pytest.mark.parametrize("boundary", ["free", "cantilever"])
def test_matrices_vibrate_as_the_model_that_they_are_of(boundary: str) -> None:
    body, matrices = both(boundary)
    assert matrices.model.rigid_modes.shape[1] == (6 if boundary == "free" else 0)
    assert list(matrices.nominal) == ["flange.factor", "web.factor"]
    np.testing.assert_allclose(hz(matrices, 8), hz(body, 8), rtol=1e-7)
    moduli = {f"web.{c}": 1.2 * body.nominal[f"web.{c}"] for c in ("E1", "E2", "G12", "G13", "G23")}
    np.testing.assert_allclose(
        changed(matrices, **{"web.factor": 1.2}), changed(body, **moduli), rtol=1e-7
    )


def test_springs_and_masses_act_at_the_nearest_node() -> None:
    body, matrices = both()
    spring, mass = Spring("k", 2e4, 3, point=NODE), Mass(0.05, NODE)
    ours, theirs = (replace(each, springs=(spring,), masses=(mass,)) for each in (matrices, body))
    assert ours.model.rigid_modes.shape[1] == theirs.model.rigid_modes.shape[1] == 5
    np.testing.assert_allclose(hz(ours, 8), hz(theirs, 8), rtol=1e-6)
    assert abs(hz(ours)[0] / hz(matrices)[0] - 1) > 0.05
    with pytest.raises(InputError, match="off the specimen"):
        _ = replace(matrices, masses=(Mass(0.05, (0.2, 0.0, 0.0)),)).model


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
    assert (
        abs(whole - sum(ck * term for ck, term in zip(c, terms, strict=True))).max()
        < 1e-12 * abs(whole).max()
    )
    assert abs(whole - whole.T).max() < 1e-12 * abs(whole).max()
    random = np.random.default_rng(2).standard_normal((matrix.size, 5))
    forms = matrix.project(random, slice(2, None))
    for form, term in zip(forms, terms, strict=True):
        np.testing.assert_allclose(
            form, random.T @ (term @ random[:, 2:]), rtol=1e-9, atol=1e-9 * np.abs(form).max()
        )


def test_many_vectors_are_projected_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(affine, "_STRAINS", 20_000)
    matrix = CHANNEL.model.stiffness
    parts = list(matrix.groups[0].parts(20))
    assert len(parts) > 1
    np.testing.assert_array_equal(
        np.concatenate([part.nodes for part in parts]), matrix.groups[0].nodes
    )
    left = np.random.default_rng(4).standard_normal((matrix.size, 20))
    whole, few = matrix.project(left, slice(2)), matrix.project(left[:, :2], slice(None))
    np.testing.assert_allclose(whole[:, :2], few, rtol=1e-9, atol=1e-9 * np.abs(few).max())


def test_congruent_elements_share_an_operator() -> None:
    first = CHANNEL.model.stiffness.groups[0]
    assert len(first.operators) < len(first.nodes) / 2
