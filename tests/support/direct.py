"""FRFs without modes: (K - ω²M + iωC) x = f solved at every line. Slow, and the reference for
everything faster.
"""

from __future__ import annotations

import numpy as np
import scipy

from fecore.arrays import ComplexArray, FloatArray
from fecore.frf import Quantity, convert


def direct_frf(
    stiffness: scipy.sparse.csc_array,
    mass: scipy.sparse.csc_array,
    damping: scipy.sparse.csc_array,
    responses: scipy.sparse.csr_array,
    load: FloatArray,
    frequency_hz: FloatArray,
    quantity: Quantity = "receptance",
) -> ComplexArray:
    """(N, L) FRFs of N response rows under one (dofs,) unit load, at (L,) frequencies in Hz."""
    omega = 2 * np.pi * frequency_hz
    columns = []
    for line in omega:
        dynamic = scipy.sparse.csc_matrix(stiffness - line**2 * mass + 1j * line * damping)
        columns.append(
            responses
            @ scipy.sparse.linalg.splu(dynamic, permc_spec="MMD_AT_PLUS_A").solve(
                load.astype(complex)
            )
        )
    found: ComplexArray = np.array(columns).T * convert(omega, quantity)
    return found
