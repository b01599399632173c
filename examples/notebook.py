"""An update without the service: a UFF file read with pyuff, the core, and the result as plain Python.

    python examples/notebook.py [FILE]

The file must have grid points (set 2411) and accelerances (set 58), in SI, of the beam below; by default it is that of the
demonstration.
"""

import sys

import numpy as np
import pyuff

from fecore.frf import Dof, FrfSet
from fecore.laminate import OrthotropicMaterial
from fecore.specimen import Specimen
from fecore.updating.measurement import Measurement
from fecore.updating.parameters import Parameter
from fecore.updating.pipeline import update
from fecore.updating.recipe import HoldOut, Recipe

file = sys.argv[1] if len(sys.argv) > 1 else "service/demo/paper_beam.uff"
sets = pyuff.UFF(file).read_sets()
nodes = next(entry for entry in sets if entry["type"] == 2411)
frfs = [entry for entry in sets if entry["type"] == 58]
measurement = Measurement(
    frfs=FrfSet(
        frequency_hz=np.array(frfs[0]["x"]),
        values=np.array([entry["data"] for entry in frfs]),
        responses=tuple(Dof(int(entry["rsp_node"]), int(entry["rsp_dir"])) for entry in frfs),
        references=tuple(Dof(int(entry["ref_node"]), int(entry["ref_dir"])) for entry in frfs),
    ),
    points={int(n): place for n, *place in zip(nodes["node_nums"], nodes["x"], nodes["y"], nodes["z"], strict=True)},
)
beam = Specimen(
    length=0.5,
    width=0.04,
    thickness=0.010,
    boundary="cantilever",
    material=OrthotropicMaterial(Ex=33.05e9, Ey=31.80e9, Gxy=5.73e9, Gxz=4.5e9, Gyz=4.5e9, nu_xy=0.15, density=2012.0),
)
recipe = Recipe(
    parameters=(
        Parameter("Ex", prior_sd=2e9),
        Parameter("Ey", fixed=True),
        Parameter("Gxy"),
        Parameter("Gxz"),
        Parameter("Gyz", tied_to="Gxz"),
    ),
    hold_out=HoldOut(points=(5, 17, 29)),
)


def progress(stage: str, share: float) -> None:
    """Told between iterations; an exception raised here cancels the update."""
    print(f"\r{100 * share:3.0f} % {stage:40}", end="", file=sys.stderr)


result = update(measurement, beam, recipe, progress)
print(file=sys.stderr)
for row in result.parameters:
    low, high = row.interval_95
    told = "" if row.identifiable else "  the prior, not the data"
    print(f"{row.name:4} {row.estimate:10.4g} {row.unit:4} 95 %: {low:10.4g} to {high:10.4g}{told}")
for mode in result.modes:
    print(
        f"mode {mode.number} ({mode.kind}): {mode.measured_hz:.2f} Hz, model {mode.updated_hz:.2f} Hz, MAC {mode.mac:.4f}"
    )
held = result.correlation.held_out_frfs
print(
    f"held-out points {held.points}: SAC {held.agreement.sac.round(4)}, {100 * held.coverage_95:.0f} % in their intervals"
)
for warning in result.warnings:
    print("warning:", warning)
