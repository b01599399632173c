"""Names for the array types that the core's signatures use, the product of a real and a complex one,
and a sum by logarithms.
"""

from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.floating[Any]]
ComplexArray = NDArray[np.complexfloating[Any, Any]]
IntArray = NDArray[np.integer[Any]]
BoolArray = NDArray[np.bool_]

ROUND_OFF = 1e-9
"""Relative difference of numbers that are one but for rounding."""


class Listed:
    """How an array stands in JSON, for pydantic, which reads this of an annotation and which the core
    does not import: lists of as many levels as the array has axes; what is not finite is null.

        Annotated[FloatArray, Listed(1)]
    """

    def __init__(self, axes: int, digits: int | None = None) -> None:
        """Of an array of so many axes; digits are those of numbers that are only drawn."""
        self._axes, self._digits = axes, digits

    def __get_pydantic_core_schema__(self, _source: object, _handler: object) -> dict[str, Any]:
        schema: dict[str, Any] = {"type": "nullable", "schema": {"type": "float"}}
        for _ in range(self._axes):
            schema = {"type": "list", "items_schema": schema}
        written = {"type": "function-plain", "function": self._lists, "return_schema": schema}
        read = {"type": "no-info", "function": self._lists}
        return {
            "type": "function-before",
            "function": read,
            "schema": schema,
            "serialization": written,
        }

    def _lists(self, values: Any) -> Any:
        if isinstance(values, np.ndarray | list | tuple):
            return [self._lists(value) for value in values]
        if values is None or not np.isfinite(values):
            return None
        return float(values) if self._digits is None else float(f"{values:.{self._digits}g}")


Numbers = Annotated[FloatArray, Listed(1)]
"""(n,) array of a result."""

Drawn = Annotated[FloatArray, Listed(1, digits=5)]
"""(n,) array of a result of which only a curve is made."""

Unbounded = Annotated[float, Listed(0)]
"""A number that may be infinite."""


def log_sum(logs: FloatArray, axis: int | None = None) -> FloatArray:
    """(…) ln Σ exp l over an axis, or over all: `scipy.special.logsumexp` takes eight times as long.
    The largest is finite.
    """
    largest = np.max(logs, axis=axis, keepdims=True)
    parts = logs - largest
    total = np.log(np.sum(np.exp(parts, out=parts), axis=axis))
    return np.asarray(total + np.squeeze(largest, axis))


def real_times(real: FloatArray, rows: ComplexArray) -> ComplexArray:
    """(…, n, L) A Z of real (…, n, q) A and complex (q, L) Z, as one real product: half the work of
    a complex one.
    """
    product: ComplexArray = (real @ np.ascontiguousarray(rows).view(np.float64)).view(np.complex128)
    return product
