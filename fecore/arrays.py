"""Names for the array types that the core's signatures use, and the product of a real and a complex
one.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.floating[Any]]
ComplexArray = NDArray[np.complexfloating[Any, Any]]
IntArray = NDArray[np.integer[Any]]
BoolArray = NDArray[np.bool_]


def real_times(real: FloatArray, rows: ComplexArray) -> ComplexArray:
    """(…, n, L) A Z of real (…, n, q) A and complex (q, L) Z, as one real product: half the work of
    a complex one.
    """
    product: ComplexArray = (real @ np.ascontiguousarray(rows).view(np.float64)).view(np.complex128)
    return product
