"""Constants and damping over temperature, E(T) and ζ(T) by constant, from campaigns at several
temperatures.

At T the constant is c (1 + k (T - T_ref)). Its coordinate ln c + ln(1 + k (T - T_ref)) is a
combination of unknowns, so its interval is that of any other: narrow between the tests, wider
beyond them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.constants import Body, Parameter
from fecore.errors import InputError
from fecore.normal import Z_95
from fecore.temperatures import temperatures_between
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.estimates import spread_along
from fecore.updating.laws import common_laws
from fecore.updating.parameters import parametrise
from fecore.updating.result import CommonLaw, Curve, CurveOf
from fecore.updating.temperature import (
    AT_ONE_TEMPERATURE,
    PER_K,
    damping_per_k,
    reference_of,
    with_temperature,
)


def check_temperatures(
    parameters: Sequence[Parameter],
    body: Body,
    temperatures: Sequence[float | None],
    stated: float | None,
) -> float | None:
    """The reference of campaigns with these temperatures, as of `reference_of`, °C.

    Raises:
        InputError: there is none where one is needed, or a coefficient of temperature is stated
            that nothing has.
    """
    reference, of_damping = reference_of(temperatures, stated), damping_per_k(parameters)
    with_temperature(parametrise(body, parameters), reference, temperatures[0], reported=False)
    if of_damping and reference is None:
        raise InputError("parameters", AT_ONE_TEMPERATURE.format(names=", ".join(of_damping)))
    known = sorted({name + PER_K for law in common_laws(body) for name in law.coefficient_names})
    for name in of_damping:
        if name not in known:
            raise InputError(
                "parameters",
                f"{name!r} is of no law's coefficient, expected one of {', '.join(known)}",
            )
    return reference


def curve_of(elastic: ElasticResult, laws: tuple[CommonLaw, ...]) -> Curve | None:
    """Of the constants that change with temperature and the preferred law's coefficients; None
    where all is at one.
    """
    layout = elastic.layout
    warmths = [campaign.prior.warmth for campaign in layout.campaigns]
    first = warmths[0]
    if first is None:
        return None
    known = [
        warmth.temperature
        for warmth in warmths
        if warmth is not None and warmth.temperature is not None
    ]
    temperature = temperatures_between(
        min([*known, first.reference]), max([*known, first.reference])
    )
    above = temperature - first.reference
    prior, theta, constants = layout.prior, layout.material(elastic.x), []
    for number, column, fixed in zip(first.changing, first.columns, first.known, strict=True):
        k = float(fixed) if column < 0 else float(prior.prior_mean[column] + elastic.x[column])
        rows = []
        for warmer in above:
            along = np.eye(elastic.x.size)[number]
            if column >= 0:
                along[column] += warmer / (1 + k * warmer)
            spread = spread_along(elastic, along)
            rows.append(
                np.array([1.0, np.exp(-spread.below), np.exp(spread.above)]) * (1 + k * warmer)
            )
        name = prior.names[number]
        estimate, low, high = float(theta[number]) * np.array(rows).T
        constants.append(CurveOf(name, prior.unit_of(name), estimate, low, high))
    preferred = next((law for law in laws if law.preferred), None)
    damping = () if preferred is None else _of_law(preferred, above)
    return Curve(first.reference, temperature, (*constants, *damping))


def _of_law(law: CommonLaw, above: FloatArray) -> tuple[CurveOf, ...]:
    """A law's coefficients over (n,) temperatures above the reference, K."""
    assert law.joint is not None, "campaigns have several temperatures"
    names, curves = list(law.coefficients), []
    values, count = np.array(list(law.coefficients.values())), len(law.units)
    for j, unit in enumerate(law.units):
        a, k = values[j], values[count + j]
        by = np.stack([1 + k * above, a * above])
        sd = np.sqrt(
            np.einsum("in,ij,jn->n", by, law.joint[np.ix_([j, count + j], [j, count + j])], by)
        )
        estimate = a * (1 + k * above)
        curves.append(
            CurveOf(names[j], unit, estimate, estimate - Z_95 * sd, estimate + Z_95 * sd, law.name)
        )
    return tuple(curves)
