"""The picture of the README: one accelerance of the paper's beam, measured and before and after the
update.

    python -m examples.picture [FILE.svg]

The paper prints no FRFs; these are made from its updated constants and damping, with noise
(`examples/paper/synthesis.py`).
"""

import sys

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from examples.paper.published import (
    CANTILEVER_CONVERGED,
    TABLE_4_COUPONS,
    TABLE_4_UPDATED,
    cantilever,
)
from examples.paper.synthesis import SENSOR, grid, rayleigh_body
from fecore.updating.measurement import Measurement
from fecore.updating.pipeline import update
from fecore.updating.result import Prediction
from service.figures.colors import INITIAL, MEASURED, UPDATED

LINES_HZ = np.arange(2.0, 1001.0, 1.0)
CURVES = (
    ("measured", MEASURED, "-", 0.8),
    ("initial", INITIAL, ":", 1.5),
    ("updated", UPDATED, "--", 1.5),
)


def prediction() -> Prediction:
    """All FRFs of a default update that starts from the coupons."""
    beam = cantilever(TABLE_4_UPDATED)
    measured = Measurement(rayleigh_body(beam, CANTILEVER_CONVERGED, 1, LINES_HZ), grid(beam))
    return update(measured, cantilever(TABLE_4_COUPONS)).prediction


def draw(frfs: Prediction) -> Figure:
    """The drive point at the free corner."""
    row = [dof.point for dof in frfs.responses].index(SENSOR)
    figure = Figure(figsize=(8.0, 3.2), layout="constrained")
    FigureCanvasSVG(figure)
    axes = figure.subplots()
    for name, color, dash, width in CURVES:
        magnitude = np.abs(getattr(frfs, name)[row])
        axes.semilogy(frfs.frequency_hz, magnitude, dash, color=color, label=name, linewidth=width)
    axes.set(
        xlabel="frequency, Hz",
        ylabel="accelerance, m/s²/N",
        xlim=(0, LINES_HZ[-1]),
        ylim=(0.05, 100),
    )
    axes.grid(visible=True, color="#dddddd", linewidth=0.5)
    axes.legend(frameon=False, ncols=3, loc="lower right")
    return figure


def main(file: str = "docs/images/beam.svg") -> None:
    """Write the picture; the same bytes each time."""
    with rc_context({"svg.hashsalt": "modalbase", "path.simplify_threshold": 0.3, "font.size": 9}):
        draw(prediction()).savefig(file, metadata={"Date": None})


if __name__ == "__main__":
    main(*sys.argv[1:])
