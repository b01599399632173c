"""Structures of shells in space: elements on published shells, joint model against solids, size, and CalculiX's S8R.

The solids are quadratic bricks by another code, with true dimensions and constants (`shared/blind-open/structures`).
"""

from __future__ import annotations

import json
import resource
import shutil
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks import calculix
from benchmarks.tables import Off, Table, print_beside
from fecore.body.generators import panel, profile
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.mesh import Mesh
from fecore.body.sections import ShellSection
from fecore.body.structure import Structure
from fecore.body.supports import of_boundary
from fecore.dynamics.bodies import body_modes
from fecore.frf import FrfSet
from fecore.updating.inputs import Inputs
from fecore.updating.measurement import Measurement
from fecore.updating.pipeline import update
from fecore.updating.recipe import Recipe
from modalbase.formats.models.inp import read_inp
from modalbase.formats.models.units import in_si
from service.compute.models.bodies import body_of_model
from tests.support.measured import with_coherence
from tests.support.places import ROOT
from tests.support.shells import KINDS, cylinder, hemisphere, roof, twisted_beam

OPEN = ROOT.parent / "shared" / "blind-open" / "structures"
BODIES = ("i", "box", "channel", "angle", "panel")
CONSTANTS = ("E1", "E2", "G12", "G13", "G23")
RIBS = (-0.25, 0.25)  # of the width


def frequencies(structure: Structure, count: int) -> np.ndarray:
    """The lowest elastic natural frequencies at nominal constants, Hz."""
    q, model = np.array(list(structure.nominal.values())), structure.model
    K = model.stiffness.at(structure.stiffness_coefficients(q))
    M = model.mass.at(structure.mass_coefficients(q))
    modes = body_modes(model, K, M, count)
    return modes.frequency_hz[modes.rigid :]


def _mesh(kind: str, d: dict[str, float], elements: int) -> tuple[Mesh, tuple[str, str]]:
    """The mesh of a profile or panel, so many elements across, and the names of its sets: of flange or plate, web or rib."""
    if kind == "panel":
        ribs = [share * d["b"] for share in RIBS]
        return panel(d["L"], d["b"], d["h"], d["tf"], d["tw"], ribs, 3 * elements), ("plate", "rib")
    return profile(kind, d["L"], d["h"], d["b"], d["tf"], d["tw"], elements), ("flange", "web")


def body(truth: dict, elements: int, with_joints: bool) -> Structure:
    """A stored solid's dimensions and constants as a structure of shells."""
    d = truth["true_dims"]
    mesh, names = _mesh(truth["kind"], d, elements)
    sections = {}
    for name, wall, t in zip(names, ("flange", "web"), (d["tf"], d["tw"]), strict=True):
        w = truth["walls"][wall]
        material = OrthotropicMaterial(w["E1"], w["E2"], w["G12"], w["G13"], w["G23"], w["nu12"], w["rho"])
        sections[name] = ShellSection((Ply(material, t),))
    return Structure(mesh, sections, with_joints=with_joints)


def elements() -> None:
    """Section 18's table of published shells."""
    table = Table("", "deflection / published:27", *(f"{kind}:.3f" for kind in KINDS))
    for name, problem, n in (
        ("Scordelis-Lo roof, 16", roof, 16),
        ("pinched cylinder, 32", cylinder, 32),
        ("hemisphere, 16", hemisphere, 16),
        ("twisted beam, thin, 2 × 12", twisted_beam, 2),
    ):
        table.row(name, *(problem(kind, n) for kind in KINDS))


def joints(*kinds: str) -> None:
    """Section 19's table: 20 modes against the stored solids, naive and with the joint model, on two meshes."""
    columns = (f"{of} {part}:.2f" for of in ("naive, 6:", "joints, 6:", "joints, 4:") for part in ("rms", "worst"))
    table = Table("20 modes against solids, %", "body:10", *columns, "6 to 4, worst:.2f")
    for kind in kinds:
        truth = json.loads((OPEN / f"{kind}-1.truth.json").read_text())
        solid = np.array([mode["f_hz"] for mode in truth["modes"]])[:20]
        found = [frequencies(body(truth, n, on), len(solid)) for n, on in ((6, False), (6, True), (4, True))]
        errors = [100 * (f / solid - 1) for f in found]
        shown = [part for error in errors for part in rms_and_worst(error)]
        table.row(kind, *shown, 100 * np.abs(found[2] / found[1] - 1).max())


def rms_and_worst(error: np.ndarray) -> tuple[float, float]:
    """Root mean square and greatest magnitude."""
    return float(np.sqrt(np.mean(error**2))), float(np.abs(error).max())


def size() -> None:
    """A ribbed panel of growing size: dofs, CPU seconds of set-up, of 26 modes, and peak memory."""
    material = OrthotropicMaterial(25e9, 9e9, 3e9, 3e9, 2.4e9, 0.27, 1850.0)
    table = Table("by the processor", "dofs:8", "set-up s:.2f", "26 modes s:.2f", "peak GB:.2f")
    for n in (20, 33, 47):
        start = time.process_time()
        mesh = panel(1.0, 0.5, 0.05, 0.006, 0.006, (-0.125, 0.125), n)
        structure = Structure(mesh, {name: ShellSection((Ply(material, 0.006),)) for name in ("plate", "rib")})
        dofs = structure.model.stiffness.size
        built = time.process_time()
        frequencies(structure, 20)
        solved = time.process_time()
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
        table.row(dofs, built - start, solved - built, peak)


def s8r(kind: str) -> None:
    """A user's deck by CalculiX and by our shells without joints, on the same nodes and elements."""
    text = (OPEN / f"{kind}-1.inp").read_text()
    structure = replace(body_of_model(in_si(read_inp(text.encode()), "m-N-kg")), with_joints=False)
    ours = frequencies(structure, 12)
    theirs = calculix.frequencies(calculix.ccx(text.replace("*NODE PRINT,NSET=NALL\nU\n", "").splitlines()))[6:18]
    ratio = 100 * (ours[: len(theirs)] / theirs - 1)
    print(f"  {kind}: ours by S8R, % of each of {len(theirs)} modes: {np.array2string(ratio, precision=2)}")


def stated(truth: dict, elements: int, frfs: FrfSet | None = None) -> tuple[Structure, Measurement, dict[str, float]]:
    """What a user knows of a body, its FRFs (by default the stored ones), and the true constants by name."""
    d, m, kind = truth["stated"]["dims"], truth["stated"]["material"], truth["kind"]
    material = OrthotropicMaterial(m["E1"], m["E2"], m["G12"], m["G12"], 0.8 * m["G12"], m["nu12"], m["rho"])
    mesh, names = _mesh(kind, d, elements)
    walls = {name: ShellSection((Ply(material, d[t]),)) for name, t in zip(names, ("tf", "tw"), strict=True)}
    size = d["L"], d["b"], d["h"]
    tolerances = dict(zip(("length_sd", "width_sd", "height_sd"), np.array([5e-4, 2e-3, 2e-3]) * size, strict=True))
    inputs = replace(Inputs.exact(), **tolerances, thickness_sd=0.015 * d["tf"], nu_xy_sd=0.05)
    points = {point["number"]: tuple(point["xyz"]) for point in truth["points"]}
    supports = of_boundary("free" if truth["bc"] == "free" else "cantilever")
    true = {f"{n}.{c}": truth["walls"][w][c] for n, w in zip(names, ("flange", "web"), strict=True) for c in CONSTANTS}
    frfs = with_coherence(OPEN / f"{kind}-1.uff") if frfs is None else frfs
    measurement = Measurement(frfs, points, inputs=inputs)
    return Structure(mesh, walls, supports, size=size), measurement, true | truth["rayleigh"]


def updates(*kinds: str) -> None:
    """Constants of the stored solids from their FRFs with an empty recipe, from what a user knows."""
    for kind in kinds:
        update_printed(kind, *stated(json.loads((OPEN / f"{kind}-1.truth.json").read_text()), 4))


def update_printed(name: str, body: Structure, measurement: Measurement, true: dict[str, float]) -> list[Off]:
    """The identifiable constants beside the true ones after an empty recipe."""
    start = time.process_time()
    result = update(measurement, body, Recipe(damping_models=("rayleigh",)))
    print(f"  {name}: {body.model.stiffness.size} dofs, {time.process_time() - start:.0f} s CPU")
    return [off for off in print_beside(result, true) if off.identifiable]


def structures(part: str = "all", *kinds: str) -> None:
    """Shells in space: `elements`, published ones; `joints`, against solids; `size`; `s8r`, beside CalculiX; `updates`."""
    if not Path(OPEN).exists():
        print("  (the stored solids are absent)")
        kinds, part = (), "elements" if part == "all" else part
    if part in ("all", "elements"):
        elements()
    if part in ("all", "joints"):
        joints(*(kinds or BODIES))
    if part in ("all", "size"):
        size()
    if part in ("all", "s8r") and shutil.which("ccx"):
        for kind in kinds or ("panel", "channel"):
            s8r(kind)
    if part in ("all", "updates"):
        updates(*(kinds or BODIES))
