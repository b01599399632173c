"""An update without the service: a UFF file, the core, and the result as plain Python.

    python examples/core.py [FILE]

The file must have grid points (set 15 or 2411) and accelerances on one frequency axis (set 58) of
the beam below; by default it is that of the demonstration.
"""

import sys

import numpy as np

from fecore import (
    Dof,
    FrfSet,
    HoldOut,
    Measurement,
    OrthotropicMaterial,
    Parameter,
    Recipe,
    Specimen,
    update,
)
from modalbase import read_uff
from modalbase.formats import uff

content = list(
    read_uff(sys.argv[1] if len(sys.argv) > 1 else "service/pages/static/paper_beam.uff")
)
for report in content:
    if isinstance(report, uff.DatasetReport) and report.outcome == "refused":
        print(f"dataset {report.number} (type {report.type}): {report.reason}", file=sys.stderr)
frfs = [item for item in content if isinstance(item, uff.Frf)]
measurement = Measurement(
    frfs=FrfSet(
        frequency_hz=frfs[0].frequency.points(),
        values=np.array([frf.values for frf in frfs]),
        responses=tuple(Dof(frf.response_point, frf.response_direction) for frf in frfs),
        references=tuple(Dof(frf.reference_point, frf.reference_direction) for frf in frfs),
        quantity=frfs[0].quantity,
    ),
    points={item.number: item.xyz_m for item in content if isinstance(item, uff.GridPoint)},
)
beam = Specimen(
    length=0.5,
    width=0.04,
    thickness=0.010,
    boundary="cantilever",
    material=OrthotropicMaterial(
        Ex=33.05e9, Ey=31.80e9, Gxy=5.73e9, Gxz=4.5e9, Gyz=4.5e9, nu_xy=0.15, density=2012.0
    ),
)
recipe = Recipe(
    parameters=(
        Parameter("Ex"),
        Parameter("Ey", fixed=True),
        Parameter("Gxy"),
        Parameter("Gxz"),
        Parameter("Gyz", tied_to="Gxz"),
    ),
    hold_out=HoldOut(points=(5, 17, 29)),
)


def progress(stage: str, share: float) -> None:
    """Called between iterations; an exception raised here cancels the update."""
    print(f"\r{100 * share:3.0f} % {stage:40}", end="", file=sys.stderr)


result = update(measurement, beam, recipe, progress)
print(file=sys.stderr)
for row in result.parameters:
    low, high = row.interval_95
    remark = "" if row.identifiable else "  the prior, not the data"
    print(
        f"{row.name:4} {row.estimate:10.4g} {row.unit:4} 95 %: {low:10.4g} to {high:10.4g}{remark}"
    )
for mode in result.modes:
    print(
        f"mode {mode.number} ({mode.kind}): {mode.measured_hz:.2f} Hz, model {mode.updated_hz:.2f}"
        f" Hz, MAC {mode.mac:.4f}"
    )
held = result.correlation.held_out_frfs
print(
    f"held-out points {held.points}: SAC {held.agreement.sac.round(4)},"
    f" {100 * held.coverage_95:.0f} % in their intervals"
)
for warning in result.warnings:
    print("warning:", warning)
