"""Decks of Nastran: CQUAD8 shells with a MAT8, SOL 103."""

from __future__ import annotations

from modalbase.formats.decks.deck import Deck, Mesh, shells

SHEAR = 5 / 6
"""TS/T of a homogeneous rectangular section."""


def write_nastran(deck: Deck) -> str:
    """A deck for SOL 103; fields stand free between commas, long ones in 16 columns."""
    mesh = shells(deck)
    lines = [f"$ {remark}" for remark in deck.remarks]
    lines += ["SOL 103", "CEND", "METHOD = 1", *(["SPC = 1"] if deck.boundary != "free" else []), "DISPLACEMENT = ALL"]
    lines += ["BEGIN BULK", f"EIGRL,1,,,{deck.modes}", "PARAM,AUTOSPC,YES", "PARAM,COUPMASS,1"]
    if deck.rayleigh is not None:
        lines += [f"PARAM,ALPHA1,{_real(deck.rayleigh[0])}", f"PARAM,ALPHA2,{_real(deck.rayleigh[1])}"]
    lines += _material(deck)
    lines += _mesh(deck, mesh)
    lines += _held(deck, mesh)
    return "\n".join([*lines, "ENDDATA"]) + "\n"


def _material(deck: Deck) -> list[str]:
    Ex, Ey, Gxy, Gxz, Gyz = deck.moduli
    long = [1, Ex, Ey, deck.nu_xy, Gxy, Gxz, Gyz, deck.density]
    fields = [str(long[0]), *(_real(value) for value in long[1:])]
    return [
        "MAT8*," + ",".join(fields[:4]),
        "*," + ",".join(fields[4:]),
        f"PSHELL*,1,1,{_real(deck.thickness)},1",  # eight columns would round the thickness, whose cube bends
        f"*,1.0,1,{SHEAR:.9f}",
    ]


def _mesh(deck: Deck, mesh: Mesh) -> list[str]:
    lines = []
    for number, (x, y, z) in enumerate(mesh.nodes.tolist(), start=1):
        lines += [f"GRID*,{number},,{_real(x)},{_real(y)}", f"*,{_real(z)}"]
    for number, nodes in enumerate(mesh.elements.tolist(), start=1):
        lines += [f"CQUAD8,{number},1,{','.join(map(str, nodes[:6]))}", f",{nodes[6]},{nodes[7]},,,,,0.0"]
    for number, mass in enumerate(deck.masses, start=len(mesh.elements) + 1):
        lines += [f"CONM2,{number},{mesh.nearest(mass.x, mass.y)},0,{_real(mass.mass)}"]
    return lines


def _held(deck: Deck, mesh: Mesh) -> list[str]:
    """A clamp holds all; a hard simple support y, z and the rotation about x. No shell resists its drilling rotation."""
    edges = {"cantilever": [(0.0, "123456")], "simply_supported": [(0.0, "2346"), (deck.length, "2346")]}
    return [f"SPC1,1,{dofs},{node}" for x, dofs in edges.get(deck.boundary, []) for node in mesh.at(0, x).tolist()]


def _real(value: float) -> str:
    """A number that has a point, as Nastran asks of a real, in at most 16 columns."""
    text = f"{value:.9G}"
    if "." not in text:
        mantissa, mark, exponent = text.partition("E")
        text = f"{mantissa}.{mark}{exponent}"
    return text
