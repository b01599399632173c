"""What the uncertainty of each unknown is made of: noise, discrepancy, priors, coupons, and what is believed to be nothing.

The estimate is linear in data and prior means, so with G = H⁻¹SᵀW its error is Gε + Gδ + H⁻¹P₀(x₀ - x), whose parts are
independent and add up to H⁻¹ at the mean discrepancy and scatter; what the marginalised ones add is the discrepancy's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray
from fecore.updating.campaigns.fit import Fitted
from fecore.updating.campaigns.layout import is_scatter
from fecore.updating.excursions import Excursion, excursions

_SMALLEST_SHARE = 1e-4  # of the variance that is worth a line of the budget


@dataclass(frozen=True)
class Spread:
    """Of one unknown in its coordinate: standard deviations, reaches of its 95 % interval, and variance by source."""

    sd: float
    noise_sd: float
    below: float
    above: float
    variance: Mapping[str, float]

    def largest(self) -> list[tuple[str, float]]:
        """The largest sources, largest first."""
        rows = sorted(self.variance.items(), key=lambda row: -row[1])
        return [(name, part) for name, part in rows if part > _SMALLEST_SHARE * self.sd**2]


def spreads(fitted: Fitted) -> list[Spread]:
    """Of every unknown."""
    problem, layout = fitted.problem, fitted.layout
    _, inverse, _ = problem.solve(fitted.spread, fitted.scatter)
    variance = problem.noise + fitted.spread**2 * np.eye(problem.residual.size)
    gain = inverse @ np.linalg.solve(variance, problem.sensitivity).T
    parts: dict[str, FloatArray] = {
        "measurement noise": np.einsum("xi,ij,xj->x", gain, problem.noise, gain),
        "model discrepancy": np.sum(gain**2, axis=1) * fitted.spread**2,
    }
    if problem.other_hessian.any():
        parts["coupons"] = np.einsum("xi,ij,xj->x", inverse, problem.other_hessian, inverse)
    sd = layout.sd(fitted.scatter)
    for place, unknown in enumerate(layout.unknowns):
        name = "scatter between specimens" if is_scatter(unknown) else unknown.name
        name = f"prior of {name}" if unknown.owner is None else name
        parts[name] = parts.get(name, 0.0) + (inverse[:, place] / sd[place]) ** 2
    total = np.diag(fitted.mixture.total)
    parts["model discrepancy"] = parts["model discrepancy"] + np.maximum(total - sum(parts.values()), 0.0)
    pulled = _pulls(fitted, gain)
    found = []
    for place in range(len(layout.unknowns)):
        below, above = fitted.mixture.reach(np.eye(len(total))[place])
        own = {name: float(part[place]) for name, part in parts.items()}
        found.append(_with_excursions(own, (below, above), [(each, float(pull[place])) for each, pull in pulled]))
    return found


def _with_excursions(
    variance: dict[str, float], reach: tuple[float, float], pulled: Sequence[tuple[Excursion, float]]
) -> Spread:
    """Parts that lie on one side of the interval; reaches of independent parts add as squares."""
    squares = np.array(reach) ** 2
    for each, pull in pulled:
        variance[each.name] = variance.get(each.name, 0.0) + (each.rms * pull) ** 2
        sides = [True, True] if each.kind == "both" else [pull < 0, pull > 0]
        squares[sides] += (each.reach * pull) ** 2
    below, above = np.sqrt(squares)
    noise = float(np.sqrt(variance["measurement noise"]))
    return Spread(float(np.sqrt(sum(variance.values()))), noise, float(below), float(above), variance)


def _pulls(fitted: Fitted, gain: FloatArray) -> list[tuple[Excursion, FloatArray]]:
    """Sensors and fibres askew of every campaign, with the (X,) change of the unknowns by one standard deviation."""
    found: list[tuple[Excursion, FloatArray]] = []
    for number, campaign in enumerate(fitted.layout.campaigns):
        state, at = fitted.states[number], fitted.rows[number]
        columns = [column for _, column in fitted.pairings[number].pairs]
        seen = excursions(state, campaign.inputs, campaign.fixed_points)
        found += [(each, -gain[:, at] @ each.shift[columns]) for each in seen]
    return found
