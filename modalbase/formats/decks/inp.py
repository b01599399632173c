"""Decks of CalculiX and Abaqus, which have one language: `.inp`.

An updated model has the shear correction κ = 5/6 of a rectangular section. Two quadratic bricks through the thickness show
that shear by themselves, and Abaqus' shells know κ. CalculiX makes one brick of a shell, whose shear strain is the same over
the thickness (κ = 1); there the transverse shear moduli of the card are 5/6 of the material's.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from modalbase.formats.decks.deck import Deck, IntArray, Mesh, shells, solids

PER_LINE = 12
SHEAR_CORRECTION = 5 / 6
"""κ of a homogeneous rectangular section (Reissner 1945)."""


def write_solids(deck: Deck) -> str:
    """A deck of C3D20R bricks.

    A clamped edge holds x and y through the thickness and z on the middle surface: the section may contract there, as in
    the theory of plates that the update used.
    """
    mesh = solids(deck)
    section = ["*SOLID SECTION, ELSET=BODY, MATERIAL=UPDATED"]
    return _written(deck, mesh, "C3D20R", section, _held_solid(deck, mesh))


def write_shells(deck: Deck, *, corrected: bool = False) -> str:
    """A deck of S8R shells; x of the material is x of the strip.

    Args:
        deck: what it says.
        corrected: multiply the transverse shear moduli by κ, for CalculiX, whose shells do not.
    """
    if corrected:
        Ex, Ey, Gxy, Gxz, Gyz = deck.moduli
        remark = "G13 and G23 are 5/6 of the material's: CalculiX does not correct the shear of its shells"
        moduli = (Ex, Ey, Gxy, SHEAR_CORRECTION * Gxz, SHEAR_CORRECTION * Gyz)
        deck = replace(deck, moduli=moduli, remarks=(*deck.remarks, remark))
    mesh = shells(deck)
    section = ["*SHELL SECTION, ELSET=BODY, MATERIAL=UPDATED", f"{deck.thickness:.9g}"]
    return _written(deck, mesh, "S8R", section, _held_shell(deck, mesh))


def _written(deck: Deck, mesh: Mesh, element: str, section: list[str], held: list[str]) -> str:
    lines = [f"** {remark}" for remark in deck.remarks]
    lines += ["*NODE, NSET=ALL"]
    lines += [f"{n},{x:.12g},{y:.12g},{z:.12g}" for n, (x, y, z) in enumerate(mesh.nodes.tolist(), start=1)]
    lines += [f"*ELEMENT, TYPE={element}, ELSET=BODY"]
    for number, nodes in enumerate(mesh.elements.tolist(), start=1):
        lines += _wrapped([number, *nodes])
    for number, mass in enumerate(deck.masses, start=1):
        lines += [f"*ELEMENT, TYPE=MASS, ELSET=MASS{number}"]
        lines += [f"{len(mesh.elements) + number},{mesh.nearest(mass.x, mass.y)}"]
        lines += [f"*MASS, ELSET=MASS{number}", f"{mass.mass:.9g}"]
    lines += [*_material(deck), *section, *held]
    lines += ["*STEP", "*FREQUENCY", str(deck.modes), "*NODE FILE", "U", "*END STEP"]
    return "\n".join(lines) + "\n"


def _material(deck: Deck) -> list[str]:
    Ex, Ey, Gxy, Gxz, Gyz = deck.moduli
    nu = deck.nu_xy
    lines = [
        "** E1, E2, E3, nu12, nu13, nu23, G12, G13 and G23; E3, nu13 and nu23 are not updated and hardly matter here"
    ]
    lines += ["*MATERIAL, NAME=UPDATED", "*ELASTIC, TYPE=ENGINEERING CONSTANTS"]
    lines += [f"{Ex:.9g},{Ey:.9g},{Ey:.9g},{nu:.9g},{nu:.9g},{nu:.9g},{Gxy:.9g},{Gxz:.9g}", f"{Gyz:.9g}"]
    lines += ["*DENSITY", f"{deck.density:.9g}"]
    if deck.rayleigh is not None:
        lines += [f"*DAMPING, ALPHA={deck.rayleigh[0]:.9g}, BETA={deck.rayleigh[1]:.9g}"]
    return lines


def _held_solid(deck: Deck, mesh: Mesh) -> list[str]:
    """An edge's whole section and its middle line, as far as the boundary holds them."""
    lines = []
    for name, x, first in _edges(deck):
        edge = mesh.at(0, x)
        middle = edge[np.isin(edge, mesh.at(2, 0.0))]
        lines += [*_set(name, edge), *_set(f"{name}LINE", middle)]
        lines += ["*BOUNDARY", f"{name},{first},2", f"{name}LINE,3,3"]
    return lines


def _held_shell(deck: Deck, mesh: Mesh) -> list[str]:
    """A clamp holds all; a hard simple support y, z and the rotation about x."""
    lines = []
    for name, x, first in _edges(deck):
        lines += [*_set(name, mesh.at(0, x)), "*BOUNDARY"]
        lines += [f"{name},1,6"] if first == 1 else [f"{name},2,4"]
    return lines


def _edges(deck: Deck) -> list[tuple[str, float, int]]:
    """Name, x and first direction held of each edge that is held."""
    if deck.boundary == "cantilever":
        return [("ROOT", 0.0, 1)]
    if deck.boundary == "simply_supported":
        return [("START", 0.0, 2), ("END", deck.length, 2)]
    return []


def _set(name: str, nodes: IntArray) -> list[str]:
    return [f"*NSET, NSET={name}", *_wrapped(nodes.tolist())]


def _wrapped(numbers: list[int]) -> Iterable[str]:
    rows = [numbers[i : i + PER_LINE] for i in range(0, len(numbers), PER_LINE)]
    return [",".join(map(str, row)) + ("," if row is not rows[-1] else "") for row in rows]
