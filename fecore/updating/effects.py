"""What would move the measured frequencies: parameters, stiffness, the support, a mass at a point.

A monitor explains its alarms by it; it also shows which modes each parameter moves.
"""

from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.locate import evenly_spread
from fecore.quantities import CLAMP, is_of_stiffness
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.forward import ForwardState
from fecore.updating.result import Prediction

_SITES = 200  # nodes at which a mass is tried, at most


@dataclass(frozen=True)
class FrequencyEffects:
    """Derivatives of the logarithms of n measured frequencies at the updated model; NaN where a
    mode has no partner.
    """

    # (n,) by name of a constant that was updated, the change of ln f by one prior standard
    # deviation of it
    parameter: dict[str, FloatArray]
    stiffness: dict[str, FloatArray]  # (n,) by name of a stiffness θ, ∂ln f/∂ln θ
    # (n,) by name of an input of the support, the change of ln f by one prior standard deviation of
    # it
    support: dict[str, FloatArray]
    sites: FloatArray  # (P, 3) nodes at which a mass is tried, m
    # (n, P) change of ln f by a mass at each of them, -φ²/2 with the mass-normalised displacement
    # φ, 1/kg
    mass: FloatArray
    # median ratio of the measured FRFs' magnitudes to the model's; None without FRFs
    frf_scale: float | None


def frequency_effects(elastic: ElasticResult, prediction: Prediction | None) -> FrequencyEffects:
    """The effects at the estimate of one campaign."""
    prior, forward, slopes = elastic.prior, elastic.updated.forward, elastic.problem.sensitivity
    rows, columns = (np.array(each, dtype=int) for each in zip(*elastic.pairing.pairs, strict=True))

    def of_measured(values: FloatArray) -> FloatArray:
        whole = np.full((len(elastic.only.modes), *values.shape[1:]), np.nan)
        whole[rows] = values
        return whole

    free = dict(enumerate(prior.names))
    at_support = {spring.name for spring in forward.specimen.springs} | {CLAMP}
    held = bool(elastic.updated.modes.rigid == 0)
    support = {
        each.name: each.shift[columns]
        for each in elastic.all_systematic_effects
        if each.name.startswith("clamp")
    }
    by_one_sd = {
        name: slopes[:, place] * elastic.layout.unknowns[place].sd for place, name in free.items()
    }
    support |= {
        name: by_one_sd[name]
        for name in by_one_sd
        if name in at_support or (held and name == "length")
    }
    stiffness = {
        name: slopes[:, place]
        for place, name in free.items()
        if name in prior.reported
        and name not in at_support
        and prior.logarithmic[place]
        and _is_stiffness(name)
    }
    sites, moved = motion_at_sites(elastic.updated)
    return FrequencyEffects(
        parameter={
            name: of_measured(each) for name, each in by_one_sd.items() if name in prior.reported
        },
        stiffness={name: of_measured(each) for name, each in stiffness.items()},
        support={name: of_measured(each) for name, each in support.items()},
        sites=sites,
        mass=of_measured(-np.sum(moved[elastic.updated.modes.rigid + columns] ** 2, axis=2) / 2),
        frf_scale=None if prediction is None else _scale(prediction),
    )


def motion_at_sites(state: ForwardState) -> tuple[FloatArray, FloatArray]:
    """(P, 3) some nodes, evenly spread, and (m, P, 3) their mass-normalised displacements in all
    modes, held ones 0.
    """
    model, shapes = state.forward.specimen.model, state.modes.shapes
    moved = model.at_nodes(shapes if state.basis is None else state.basis @ shapes)
    nodes = np.flatnonzero(model.free[:, [dof < 3 for dof in model.dofs]].any(axis=1))
    chosen = nodes[evenly_spread(model.mesh.nodes[nodes], _SITES)]
    return model.mesh.nodes[chosen], moved[:, chosen]


def _is_stiffness(name: str) -> bool:
    return is_of_stiffness(name)


def _scale(prediction: Prediction) -> float | None:
    """Median of |H measured / H updated| over the fitted FRFs."""
    fitted = list(prediction.fitted)
    measured, updated = np.abs(prediction.measured[fitted]), np.abs(prediction.updated[fitted])
    seen = (measured > 0) & (updated > 0)
    return float(np.exp(np.median(np.log(measured[seen] / updated[seen])))) if seen.any() else None
