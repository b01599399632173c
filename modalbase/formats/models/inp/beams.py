"""Sections of beams, and the axes across them."""

import numpy as np

from modalbase.formats.models.check import unit
from modalbase.formats.models.inp.lines import DataLine, Keyword
from modalbase.formats.models.inp.materials import InpMaterials
from modalbase.formats.models.inp.mesh import SLENDER, InpElement
from modalbase.formats.models.model import BeamSection, FieldPlace, Floats, Material
from modalbase.formats.models.shapes import Shape, abaqus

_SHORT = {"RECTANGULAR": "RECT", "CIRCULAR": "CIRC"}
_CONSTANTS = ("area", "I1", "I12", "I2", "J")


def beam_section(
    card: Keyword, name: str, elements: list[InpElement], materials: InpMaterials
) -> tuple[BeamSection, Floats, tuple[float, float]]:
    """A section, its direction n1, and the centroid's y and z from the nodes.

    Raises:
        FormatError: the constants are none of a real section.
    """
    row = card.first
    kind = card.get("SECTION").upper() or (
        "GENERAL" if card.name == "BEAMGENERALSECTION" else "RECT"
    )
    places = {}
    if kind == "GENERAL":
        if card.name == "BEAMSECTION":
            raise card.error(
                "has SECTION=GENERAL; *BEAM GENERAL SECTION states a beam by its constants"
            )
        profile = _general(row)
        places = {name: row.place(k) for k, name in enumerate(_CONSTANTS) if name != "I12"}
    else:
        try:
            profile = abaqus(_SHORT.get(kind, kind), row.numbers("dimensions"))
        except ValueError as error:
            raise row.error(str(error)) from None
    own = card.name == "BEAMGENERALSECTION" and not card.get("MATERIAL")
    material = (
        _own_material(card, name, materials)
        if own
        else materials.named(card.needs("MATERIAL"), card)
    )
    slender = {element.type.name in SLENDER for element in elements}
    if len(slender) > 1:
        raise card.error(
            "has elements that are rigid in shear and others that are not; split the set"
        )
    shear = None if True in slender else profile.shear
    section = BeamSection(
        material, profile.area, profile.inertia, profile.torsion, card.where, shear, places=places
    )
    y, z = profile.centroid
    shifts = [
        -card.number(card.get(f"OFFSET{k + 1}") or "0", f"OFFSET{k + 1}") * profile.extent[k]
        for k in (0, 1)
    ]
    return section, _direction(card), (y + shifts[0], z + shifts[1])


def _general(row: DataLine) -> Shape:
    values = row.numbers("A, I11, I12, I22, J", 5)
    area, first, mixed, second, torsion = values[:5]
    if min(area, first, second, torsion) <= 0 or mixed**2 >= first * second:
        raise row.error(
            "expected A, I11, I12, I22 and J of a real section: above 0, and I12² < I11 I22"
        )
    return Shape(area, (first, second, mixed), torsion, (1.0, 1.0))


def _direction_row(card: Keyword) -> DataLine | None:
    """The second line, unless an empty one stands for it."""
    if len(card.rows) > 1 and not card.rows[1].after_blank:
        return card.rows[1]
    return None


def _direction(card: Keyword) -> Floats:
    """n1, by default (0, 0, −1)."""
    row = _direction_row(card)
    if row is None or not any(row.fields):
        return np.array([0.0, 0.0, -1.0])
    values = np.array([*row.numbers("the direction n1"), 0.0, 0.0][:3])
    if not np.linalg.norm(values) > 0:
        raise row.error("the direction n1 is zero, expected the section's axis 1")
    return values


def _own_material(card: Keyword, name: str, materials: InpMaterials) -> str:
    """Of *BEAM GENERAL SECTION, which states E, G and density itself."""
    rows = card.rows[2 if _direction_row(card) is not None else 1 :]
    if not rows:
        raise card.error(
            "has no line of E and G, the third (an empty second one stands for the default"
            " direction)"
        )
    values = rows[0].numbers("E and G", 2)
    try:
        density = float(card.get("DENSITY") or 0)  # a stick whose masses stand apart has none
    except ValueError:
        raise card.error(f"has DENSITY={card.get('DENSITY')}, expected a number") from None
    E, G = values[:2]
    if not (0 < E < 1e20 and 0 < G < 1e20 and 0 <= density < 1e12):
        raise rows[0].error(
            f"E = {E:g}, G = {G:g} and density {density:g}: expected E and G above 0, and no"
            " density below 0"
        )
    places: dict[str, FieldPlace] = {"E": rows[0].place(0), "G": rows[0].place(1)}
    constants = {"E": E, "G": G, "nu": E / (2 * G) - 1, "density": density}
    return materials.add(Material(name, constants, card.where, places))


def directions(places: Floats, elements: list[InpElement], first: Floats) -> tuple[Floats, Floats]:
    """(e, 3) axes 1 and 2 across beams: n1 made square to the beam, and t × n1.

    An element with a node more than its type has takes n1 from its first node to that one.

    Raises:
        FormatError: n1 lies along a beam.
    """
    ends = places[[[element.nodes[element.type.order[k]] for k in (0, 1)] for element in elements]]
    t = unit(ends[:, 1] - ends[:, 0])
    n1 = np.tile(first, (len(elements), 1))
    for k, element in enumerate(elements):
        if len(element.nodes) > len(element.type.order):
            n1[k] = places[element.nodes[-1]] - ends[k, 0]
    n2 = np.cross(t, n1)
    along = ~(np.linalg.norm(n2, axis=1) > 1e-6 * np.linalg.norm(n1, axis=1)) & np.any(t, axis=1)
    if along.any():
        element = elements[int(np.argmax(along))]
        raise element.row.error(
            f"has element {element.number}, along which its direction n1 lies; give the section's"
            " second line another"
        )
    n2 = unit(n2)
    return np.cross(n2, t), n2
