"""Matrices as a body: those of our own models, set by set, and what is read of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy

from fecore.body.matrices import MatrixBody
from fecore.body.structure import Structure
from fecore.body.supports import Mass, Spring
from fecore.dynamics.eigen import normal_modes
from fecore.errors import InputError
from fecore.updating.forecasts import ForecastOrder, forecast
from service.store.structures.schemas import StructureIn
from service.store.updating.bodies import nominal_body
from tests.support.matrices import matrices_of_sets
from tests.support.profiles import ANGLE

NODE = (0.4, -0.028, 0.04)


def both(boundary: str = "free") -> tuple[Structure, MatrixBody]:
    body = nominal_body(StructureIn.model_validate(ANGLE), boundary)
    dofs, stiffness, mass = matrices_of_sets(body)
    turned = np.random.default_rng(0).permutation(len(dofs))  # a solver orders rows as it likes
    shuffled = [
        {n: scipy.sparse.csc_array(m[turned][:, turned]) for n, m in each.items()} for each in (stiffness, mass)
    ]
    return body, MatrixBody(body.mesh.nodes, dofs[turned], *shuffled)


def hz(body: Structure | MatrixBody, count: int = 8, **changed: float) -> np.ndarray:
    q = np.array(list({**body.nominal, **changed}.values()))
    springs = [spring.stiffness for spring in body.springs]
    K = body.model.stiffness.at(np.concatenate([body.stiffness_coefficients(q), springs]))
    rigid = body.model.rigid_modes
    modes = normal_modes(K, body.model.mass.at(body.mass_coefficients(q)), count + rigid.shape[1], rigid)
    return modes.frequency_hz[rigid.shape[1] :]


@pytest.mark.parametrize("boundary", ["free", "cantilever"])
def test_matrices_vibrate_as_the_model_that_they_are_of(boundary: str) -> None:
    body, matrices = both(boundary)
    assert matrices.model.rigid_modes.shape[1] == (6 if boundary == "free" else 0)
    assert list(matrices.nominal) == ["flange.factor", "web.factor"]
    np.testing.assert_allclose(hz(matrices), hz(body), rtol=1e-7)
    moduli = {f"web.{c}": 1.2 * body.nominal[f"web.{c}"] for c in ("E1", "E2", "G12", "G13", "G23")}
    np.testing.assert_allclose(hz(matrices, **{"web.factor": 1.2}), hz(body, **moduli), rtol=1e-7)


def test_springs_and_masses_act_at_the_nearest_node() -> None:
    body, matrices = both()
    spring, mass = Spring("k", 2e4, 3, point=NODE), Mass(0.05, NODE)
    ours, theirs = (replace(each, springs=(spring,), masses=(mass,)) for each in (matrices, body))
    assert ours.model.rigid_modes.shape[1] == theirs.model.rigid_modes.shape[1] == 5
    np.testing.assert_allclose(hz(ours), hz(theirs), rtol=1e-6)
    assert abs(hz(ours)[0] / hz(matrices)[0] - 1) > 0.05
    with pytest.raises(InputError, match="off the specimen"):
        _ = replace(matrices, masses=(Mass(0.05, (0.2, 0.0, 0.0)),)).model


def test_a_forecast_of_matrices_chooses_nodes() -> None:
    body, matrices = both()
    found, expected = (
        forecast(each, ForecastOrder(modes=6, damping_ratio=0.01, spacing_hz=1.0)) for each in (matrices, body)
    )
    np.testing.assert_allclose(found.frequency_hz, expected.frequency_hz, rtol=1e-7)
    assert found.kinds == expected.kinds
    assert found.seen[:, found.references].min() == pytest.approx(expected.seen[:, expected.references].min(), rel=0.05)
    assert np.isfinite(found.frfs).all()
