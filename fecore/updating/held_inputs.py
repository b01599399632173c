"""Constants with the laboratory's inputs held at what it stated: what tests of one body are compared by.

Two tests of one body share its thickness, length and density, however wrong these are. The errors move both estimates alike,
and say nothing about a change between them; but each test's own noise moves its estimate of the inputs, and with it the
constants. With the inputs held, the estimate of the reported coordinates ξ_p given the inputs ξ_n at their prior means ν is

    ξ_p + T_n (ξ_n - ν),     T_n = H_pp⁻¹H_pn,     and its noise that of ξ times T = [1, T_n],

from the Hessian H of stage 1 (Gelman et al., Bayesian Data Analysis, 3rd ed., A.1): exact where the misfit is a square.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray
from fecore.updating.elastic_result import ElasticResult


@dataclass(frozen=True)
class HeldInputs:
    """Attributes:
    theta: (q,) the reported parameters, SI.
    noise_standard_deviation: (q,) of θ under measurement noise alone.
    """

    theta: FloatArray
    noise_standard_deviation: FloatArray


def hold_inputs(elastic: ElasticResult) -> HeldInputs:
    """The reported parameters with every input at its stated value."""
    prior, coordinates = elastic.updated.forward.parametrisation, elastic.coordinates
    count, xi = len(prior.reported), coordinates.of(elastic.theta)
    hessian = np.linalg.inv(sum(part @ part.T for part in elastic.sources.values()))
    turn = np.hstack([np.eye(count), np.linalg.solve(hessian[:count, :count], hessian[:count, count:])])
    away = np.concatenate([xi[:count], (xi - coordinates.mean)[count:]])
    theta = coordinates.values(np.concatenate([turn @ away, coordinates.mean[count:]]))
    noise = turn @ elastic.sources["measurement noise"]
    return HeldInputs(theta[:count], coordinates.slope(theta)[:count] * np.sqrt(np.sum(noise**2, axis=1)))
