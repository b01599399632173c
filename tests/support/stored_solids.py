"""Profiles and a panel of solids that another code solved, beside the project, as structures of
shells.
"""

from dataclasses import replace

import numpy as np

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
from tests.support.measured import with_coherence
from tests.support.places import SHARED

OPEN = SHARED / "blind-open" / "structures"
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
    """The mesh of a profile or panel, so many elements across, and the names of its sets: of flange
    or plate, web or rib.
    """
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
        material = OrthotropicMaterial(
            w["E1"], w["E2"], w["G12"], w["G13"], w["G23"], w["nu12"], w["rho"]
        )
        sections[name] = ShellSection((Ply(material, t),))
    return Structure(mesh, sections, with_joints=with_joints)


def stated(
    truth: dict, elements: int, frfs: FrfSet | None = None
) -> tuple[Structure, Measurement, dict[str, float]]:
    """What a user knows of a body, its FRFs (by default the stored ones), and the true constants by
    name.
    """
    d, m, kind = truth["stated"]["dims"], truth["stated"]["material"], truth["kind"]
    material = OrthotropicMaterial(
        m["E1"], m["E2"], m["G12"], m["G12"], 0.8 * m["G12"], m["nu12"], m["rho"]
    )
    mesh, names = _mesh(kind, d, elements)
    walls = {
        name: ShellSection((Ply(material, d[t]),))
        for name, t in zip(names, ("tf", "tw"), strict=True)
    }
    size = d["L"], d["b"], d["h"]
    tolerances = dict(
        zip(
            ("length_sd", "width_sd", "height_sd"), np.array([5e-4, 2e-3, 2e-3]) * size, strict=True
        )
    )
    inputs = replace(Inputs.exact(), **tolerances, thickness_sd=0.015 * d["tf"], nu_xy_sd=0.05)
    points = {point["number"]: tuple(point["xyz"]) for point in truth["points"]}
    supports = of_boundary("free" if truth["bc"] == "free" else "cantilever")
    true = {
        f"{n}.{c}": truth["walls"][w][c]
        for n, w in zip(names, ("flange", "web"), strict=True)
        for c in CONSTANTS
    }
    frfs = with_coherence(OPEN / f"{kind}-1.uff") if frfs is None else frfs
    measurement = Measurement(frfs, points, inputs=inputs)
    return Structure(mesh, walls, supports, size=size), measurement, true | truth["rayleigh"]
