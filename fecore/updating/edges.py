"""Points that the grid has beyond the specimen's edges: a tape, a drawing and a calliper differ by millimetres.

The model has such a point on its edge, within `fecore.body.mesh.BEYOND_EDGE`. Where it lies further out than the dimension is
known to, the dimension or the point is wrong.
"""

from __future__ import annotations

import numpy as np

from fecore.body.mesh import EDGE_ROUNDING
from fecore.updating.findings import found, listed
from fecore.updating.forward import ForwardModel
from fecore.updating.inputs import Inputs
from fecore.updating.result import Finding

_DOUBTED = 2.0  # standard deviations of a dimension from which a point beyond it contradicts it
_NAMED = 4  # points named in one sentence


def points_beyond(forward: ForwardModel, inputs: Inputs, campaign: str = "") -> list[Finding]:
    """Which points contradict the length or the width; of a campaign that is named where there are several."""
    nominal, (x, y) = forward.specimen.nominal, forward.places.T
    where, findings = f"campaign {campaign}: " if campaign else "", []
    for name, out in (
        ("length", np.maximum(-x, x - nominal["length"])),
        ("width", np.abs(y) - nominal["width"] / 2),
    ):
        size = nominal[name]
        limit = max(_DOUBTED * inputs.standard_deviation(name, size), EDGE_ROUNDING * size)
        if (rows := np.flatnonzero(out > limit)).size:
            points = listed([forward.points[row] for row in rows], _NAMED)
            values = {"points": points, "name": name, "size": 1e3 * size, "out": 1e3 * out.max()}
            findings.append(found("points_beyond", where=where, **values))
    return findings
