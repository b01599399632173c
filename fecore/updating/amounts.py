"""Constants and their errors as sentences have them."""

import numpy as np

from fecore.quantities import WRITTEN, quantity_of


def amount(name: str, value: float) -> str:
    """A constant's value as a laboratory writes it, or another number; to three digits.

    >>> amount("Ex", 33.05e9), amount("density", 2012), amount("", 0.16)
    ('33.1 GPa', '2010 kg/m³', '0.16')
    """
    factor, unit = _written(name)
    # without an exponent where there need be none
    return f"{float(f'{factor * value:.3g}'):g}{unit}"


def plus_minus(name: str, value: float, sd: float) -> str:
    """A constant's value with its standard deviation, to the digits that this leaves.

    >>> plus_minus("length", 0.2912, 0.0016), plus_minus("nu_xy", 0.3, 0.05)
    ('291.2 ± 1.6 mm', '0.3 ± 0.05')
    """
    factor, unit = _written(name)
    digits = 1 - int(np.floor(np.log10(factor * sd)))
    rounded, error = round(factor * value, digits), round(factor * sd, digits)
    return f"{rounded:.12g} ± {error:.12g}{unit}"


def _written(name: str) -> tuple[float, str]:
    quantity = quantity_of(name)
    factor, unit = (
        WRITTEN["1"] if quantity is None else WRITTEN.get(quantity.unit, (1.0, quantity.unit))
    )
    return factor, unit if unit in ("", "°") else f" {unit}"
