"""Sections of beams.

Profiles are made from dimensions; the origin is where the deck's nodes lie. Shear factors are those of Abaqus (*Analysis User's
Guide*, "Choosing a beam element"), after Cowper (1966).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import pi

import numpy as np

from modalbase.formats.models.inp.lines import Card, Row
from modalbase.formats.models.inp.materials import Materials
from modalbase.formats.models.inp.mesh import Element
from modalbase.formats.models.inp.types import SLENDER
from modalbase.formats.models.model import BeamSection, Floats, Material, Place
from modalbase.formats.models.shapes import Shape, bar_torsion, box_torsion, of_walls

_THIN = (0.44, 0.44)


def rectangle(a: float, b: float) -> Shape:
    """`a` along axis 1, `b` along axis 2."""
    shape = of_walls((-a / 2, a / 2, -b / 2, b / 2), torsion=bar_torsion(a, b), shear=(0.85, 0.85))
    return replace(shape, extent=(a, b))


def ellipse(a: float, b: float) -> Shape:
    """Diameters along both axes, as CalculiX states a CIRC section."""
    torsion = pi * a**3 * b**3 / (16 * (a * a + b * b))
    inertia = (pi * a * b**3 / 64, pi * b * a**3 / 64, 0.0)
    return Shape(pi * a * b / 4, inertia, torsion, (0.89, 0.89), extent=(a, b))


def circle(r: float) -> Shape:
    """A radius, as Abaqus states a CIRC section."""
    return ellipse(2 * r, 2 * r)


def pipe(r: float, t: float) -> Shape:
    """Outer radius and wall."""
    inner = r - t
    second = pi * (r**4 - inner**4) / 4
    area = pi * (r**2 - inner**2)
    return Shape(area, (second, second, 0.0), 2 * second, (0.53, 0.53), extent=(2 * r, 2 * r))


def box(a: float, b: float, t1: float, t2: float, t3: float, t4: float) -> Shape:
    """Outer width and height; walls on the sides +1, +2, −1 and −2."""
    y, z = a / 2, b / 2
    shape = of_walls(
        (y - t1, y, t4 - z, z - t2),
        (-y, t3 - y, t4 - z, z - t2),
        (-y, y, z - t2, z),
        (-y, y, -z, t4 - z),
        torsion=box_torsion((a, t1, t3), (b, t2, t4)),
        shear=_THIN,
    )
    return replace(shape, extent=(a, b))


def i_section(l: float, h: float, b1: float, b2: float, t1: float, t2: float, t3: float) -> Shape:  # noqa: E741
    """Origin above the bottom, height, widths of the bottom and top flange, their thicknesses, and the web's."""
    walls = [
        (-b1 / 2, b1 / 2, -l, t1 - l),
        (-b2 / 2, b2 / 2, h - t2 - l, h - l),
        (-t3 / 2, t3 / 2, t1 - l, h - t2 - l),
    ]
    middle = h - (t1 + t2) / 2
    return of_walls(*walls, torsion=(b1 * t1**3 + b2 * t2**3 + middle * t3**3) / 3, shear=_THIN)


def t_section(b: float, h: float, l: float, tf: float, tw: float) -> Shape:  # noqa: E741
    """Width, height, origin above the bottom, flange and web."""
    walls = [(-b / 2, b / 2, h - tf - l, h - l), (-tw / 2, tw / 2, -l, h - tf - l)]
    return of_walls(*walls, torsion=(b * tf**3 + (h - tf / 2) * tw**3) / 3, shear=_THIN)


def l_section(a: float, b: float, t1: float, t2: float) -> Shape:
    """Legs along axes 1 and 2 and their thicknesses; the origin is where their middle lines meet."""
    walls = [(-t2 / 2, a - t2 / 2, -t1 / 2, t1 / 2), (-t2 / 2, t2 / 2, t1 / 2, b - t1 / 2)]
    return of_walls(*walls, torsion=((a - t2 / 2) * t1**3 + (b - t1 / 2) * t2**3) / 3, shear=(1.0, 1.0))


PROFILES: dict[str, tuple[int, str, Callable[..., bool], Callable[..., Shape]]] = {
    "RECT": (2, "a, b", lambda *_: True, rectangle),
    "PIPE": (2, "radius, wall", lambda r, t: t < r, pipe),
    "BOX": (6, "a, b, t1, t2, t3, t4", lambda a, b, t1, t2, t3, t4: t1 + t3 < a and t2 + t4 < b, box),
    "I": (7, "l, h, b1, b2, t1, t2, t3", lambda _, h, b1, b2, t1, t2, t3: t1 + t2 < h and t3 <= min(b1, b2), i_section),
    "T": (5, "b, h, l, tf, tw", lambda b, h, _, tf, tw: tf < h and tw <= b, t_section),
    "L": (4, "a, b, t1, t2", lambda a, b, t1, t2: t1 < b and t2 < a, l_section),
}
"""By the deck's name: number of dimensions, their names, what they must satisfy, and the profile."""


def profile(kind: str, sizes: Sequence[float]) -> Shape:
    """A profile by the deck's name.

    Raises:
        ValueError: the dimensions are not those of such a profile; says what is expected.
    """
    if kind == "CIRC":
        if len(sizes) not in (1, 2) or min(sizes) <= 0:
            raise ValueError("expected a radius, or two diameters as CalculiX has them, above 0")
        return circle(*sizes) if len(sizes) == 1 else ellipse(*sizes)
    if kind == "RECT" and len(sizes) == 1:
        sizes = [sizes[0], sizes[0]]
    if kind not in PROFILES:
        raise ValueError(
            f"SECTION={kind} is unknown, expected CIRC, {', '.join(PROFILES)}, or GENERAL with its constants"
        )
    count, names, holds, function = PROFILES[kind]
    positive = [size for name, size in zip(names.split(", "), sizes, strict=False) if name != "l"]
    if len(sizes) != count or min(positive) <= 0 or not holds(*sizes):
        raise ValueError(f"expected {names}: {count} lengths above 0 of which the walls fit into the section")
    return function(*sizes)


_SHORT = {"RECTANGULAR": "RECT", "CIRCULAR": "CIRC"}
_CONSTANTS = ("area", "I1", "I12", "I2", "J")


def beam_section(
    card: Card, name: str, elements: list[Element], materials: Materials
) -> tuple[BeamSection, Floats, tuple[float, float]]:
    """A section, its direction n1, and the centroid's y and z from the nodes.

    Raises:
        FormatError: the constants are none of a real section.
    """
    row = card.first
    kind = card.get("SECTION").upper() or ("GENERAL" if card.name == "BEAMGENERALSECTION" else "RECT")
    places = {}
    if kind == "GENERAL":
        if card.name == "BEAMSECTION":
            raise card.error("has SECTION=GENERAL; *BEAM GENERAL SECTION states a beam by its constants")
        found = _general(row)
        places = {name: row.place(k) for k, name in enumerate(_CONSTANTS) if name != "I12"}
    else:
        try:
            found = profile(_SHORT.get(kind, kind), row.numbers("dimensions"))
        except ValueError as error:
            raise row.error(str(error)) from None
    own = card.name == "BEAMGENERALSECTION" and not card.get("MATERIAL")
    material = _own_material(card, name, materials) if own else materials.named(card.needs("MATERIAL"), card)
    slender = {element.type.name in SLENDER for element in elements}
    if len(slender) > 1:
        raise card.error("has elements that are rigid in shear and others that are not; split the set")
    shear = None if True in slender else found.shear
    section = BeamSection(
        material, found.area, found.inertia, found.torsion, card.line, shear, places=places, file=card.file
    )
    y, z = found.centroid
    shifts = [-card.number(card.get(f"OFFSET{k + 1}") or "0", f"OFFSET{k + 1}") * found.extent[k] for k in (0, 1)]
    return section, _direction(card), (y + shifts[0], z + shifts[1])


def _general(row: Row) -> Shape:
    values = row.numbers("A, I11, I12, I22, J", 5)
    area, first, mixed, second, torsion = values[:5]
    if min(area, first, second, torsion) <= 0 or mixed**2 >= first * second:
        raise row.error("expected A, I11, I12, I22 and J of a real section: above 0, and I12² < I11 I22")
    return Shape(area, (first, second, mixed), torsion, (1.0, 1.0))


def _direction_row(card: Card) -> Row | None:
    """The second line, unless an empty one stands for it."""
    if len(card.rows) > 1 and not card.rows[1].after_blank:
        return card.rows[1]
    return None


def _direction(card: Card) -> Floats:
    """n1, by default (0, 0, −1)."""
    row = _direction_row(card)
    if row is None or not any(row.fields):
        return np.array([0.0, 0.0, -1.0])
    values = np.array([*row.numbers("the direction n1"), 0.0, 0.0][:3])
    if not np.linalg.norm(values) > 0:
        raise row.error("the direction n1 is zero, expected the section's axis 1")
    return values


def _own_material(card: Card, name: str, materials: Materials) -> str:
    """Of *BEAM GENERAL SECTION, which states E, G and density itself."""
    rows = card.rows[2 if _direction_row(card) is not None else 1 :]
    if not rows:
        raise card.error("has no line of E and G, the third (an empty second one stands for the default direction)")
    values = rows[0].numbers("E and G", 2)
    try:
        density = float(card.needs("DENSITY"))
    except ValueError:
        raise card.error(f"has DENSITY={card.get('DENSITY')}, expected a number") from None
    E, G = values[:2]
    if not (0 < E < 1e20 and 0 < G < 1e20 and 0 < density < 1e12):
        raise rows[0].error(f"E = {E:g}, G = {G:g} and density {density:g}: expected numbers above 0")
    places: dict[str, Place] = {"E": rows[0].place(0), "G": rows[0].place(1)}
    constants = {"E": E, "G": G, "nu": E / (2 * G) - 1, "density": density}
    materials.add(Material(name, constants, card.line, places, card.file))
    return name


def directions(places: Floats, elements: list[Element], first: Floats) -> tuple[Floats, Floats]:
    """(e, 3) axes 1 and 2 across beams: n1 made square to the beam, and t × n1.

    An element with a node more than its type has takes n1 from its first node to that one.

    Raises:
        FormatError: a beam has no length, or n1 lies along it.
    """
    ends = places[[[element.nodes[element.type.order[k]] for k in (0, 1)] for element in elements]]
    t = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(t, axis=1, keepdims=True)
    if not np.all(length > 0):
        element = elements[int(np.argmin(length))]
        raise element.row.error(f"gives element {element.number} no length")
    t = t / length
    n1 = np.tile(first, (len(elements), 1))
    for k, element in enumerate(elements):
        if len(element.nodes) > len(element.type.order):
            n1[k] = places[element.nodes[-1]] - ends[k, 0]
    n2 = np.cross(t, n1)
    size = np.linalg.norm(n2, axis=1, keepdims=True)
    along = ~(size > 1e-6 * np.linalg.norm(n1, axis=1, keepdims=True))
    if along.any():
        element = elements[int(np.argmax(along))]
        raise element.row.error(
            f"has element {element.number}, along which its direction n1 lies; give the section's second line another"
        )
    n2 = n2 / size
    return np.cross(n2, t), n2
