"""Names for the types that the formats' signatures use."""

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.floating[Any]]
ComplexArray = NDArray[np.complexfloating[Any, Any]]
IntArray = NDArray[np.integer[Any]]

Quantity = Literal["accelerance", "mobility", "receptance"]
"""Displacement, velocity or acceleration per force."""
