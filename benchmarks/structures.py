"""Structures of shells in space: elements on published shells, joint model against solids, size,
and updates.

The solids are quadratic bricks by another code, with true dimensions and constants
(`shared/blind-open/structures`).
"""

import json
import resource
import time
from pathlib import Path

import numpy as np

from benchmarks.clock import timed
from benchmarks.tables import Off, Table, print_beside
from fecore.body.generators import panel
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.sections import ShellSection
from fecore.body.structure import Structure
from fecore.updating.measurement import Measurement, Recipe
from fecore.updating.pipeline import update
from modalbase.formats.models.inp import read_inp
from modalbase.formats.models.units import in_si
from service.compute.models.bodies import body_of_model
from tests.support.shells import KINDS, cylinder, hemisphere, roof, twisted_beam
from tests.support.stored_solids import OPEN, body, frequencies, stated

BODIES = ("i", "box", "channel", "angle", "panel")
DECK_TO_RESULT = 30.0
"""Seconds of the processor that a user's deck and its FRFs may take to a result."""


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
    """Section 19's table: 20 modes against the stored solids, naive and with the joint model, on
    two meshes.
    """
    columns = (
        f"{of} {part}:.2f"
        for of in ("naive, 6:", "joints, 6:", "joints, 4:")
        for part in ("rms", "worst")
    )
    table = Table("20 modes against solids, %", "body:10", *columns, "6 to 4, worst:.2f")
    for kind in kinds:
        truth = json.loads((OPEN / f"{kind}-1.truth.json").read_text())
        solid = np.array([mode["f_hz"] for mode in truth["modes"]])[:20]
        found = [
            frequencies(body(truth, n, on), len(solid))
            for n, on in ((6, False), (6, True), (4, True))
        ]
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
        structure = Structure(
            mesh, {name: ShellSection((Ply(material, 0.006),)) for name in ("plate", "rib")}
        )
        dofs = structure.model.stiffness.size
        built = time.process_time()
        frequencies(structure, 20)
        solved = time.process_time()
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
        table.row(dofs, built - start, solved - built, peak)


def updates(*kinds: str) -> None:
    """Constants of the stored solids from their FRFs with an empty recipe, from what a user
    knows.
    """
    for kind in kinds:
        update_printed(kind, *stated(json.loads((OPEN / f"{kind}-1.truth.json").read_text()), 4))


def update_printed(
    name: str, body: Structure, measurement: Measurement, true: dict[str, float]
) -> list[Off]:
    """The identifiable constants beside the true ones after an empty recipe."""
    start = time.process_time()
    result = update(measurement, body, Recipe(damping_models=("rayleigh",)))
    print(f"  {name}: {body.model.stiffness.size} dofs, {time.process_time() - start:.0f} s CPU")
    return [off for off in print_beside(result, true) if off.identifiable]


def decks(*kinds: str) -> None:
    """CPU seconds from each stored deck and its FRFs to the result of an empty recipe, and over
    those allowed.
    """
    table = Table(
        "deck to result, by the processor",
        "deck:10",
        "dofs:8",
        "s:.1f",
        f"over {DECK_TO_RESULT:g} s:.2f",
    )
    for kind in kinds:
        _, measurement, _ = stated(json.loads((OPEN / f"{kind}-1.truth.json").read_text()), 4)

        def to_result(kind: str = kind, measurement: Measurement = measurement) -> Structure:
            body = body_of_model(in_si(read_inp((OPEN / f"{kind}-1.inp").read_bytes()), "m-N-kg"))
            update(measurement, body)
            return body

        body, seconds = timed(to_result)
        table.row(kind, body.model.stiffness.size, seconds[1], seconds[1] / DECK_TO_RESULT)


def structures(part: str = "all", *kinds: str) -> None:
    """Shells in space: `elements`, published ones; `joints`, against solids; `size`; `updates`;
    `decks`, their time.
    """
    if not Path(OPEN).exists():
        print("  (the stored solids are absent)")
        kinds, part = (), "elements" if part == "all" else part
    if part in ("all", "elements"):
        elements()
    if part in ("all", "joints"):
        joints(*(kinds or BODIES))
    if part in ("all", "size"):
        size()
    if part in ("all", "updates"):
        updates(*(kinds or BODIES))
    if part in ("all", "decks"):
        decks(*(kinds or BODIES))
