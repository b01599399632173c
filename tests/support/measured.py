"""FRFs of files beside the project, read by a library that is not ours."""

from pathlib import Path

import numpy as np
import pyuff

from fecore.frf import Dof, FrfSet


def with_coherence(path: Path, averages: int = 5) -> FrfSet:
    """The FRFs of a UFF file, with the variance that their coherences state (Bendat and
    Piersol).
    """
    file = pyuff.UFF(str(path))
    sets = [file.read_sets(int(i)) for i in np.flatnonzero(np.asarray(file.get_set_types()) == 58)]
    frfs, coherences = ([s for s in sets if s["func_type"] == kind] for kind in (4, 6))
    values = np.array([s["data"] for s in frfs], dtype=complex)
    variance = None
    if coherences:
        gamma = np.clip(np.array([s["data"].real for s in coherences]), 1e-6, 1 - 1e-9)
        variance = np.abs(values) ** 2 * (1 - gamma) / (gamma * averages)
    dofs = [
        [Dof(int(s[f"{side}_node"]), int(s[f"{side}_dir"])) for s in frfs]
        for side in ("rsp", "ref")
    ]
    return FrfSet(
        np.asarray(frfs[0]["x"], float),
        values,
        tuple(dofs[0]),
        tuple(dofs[1]),
        "accelerance",
        variance,
    )
