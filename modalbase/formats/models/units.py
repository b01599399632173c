"""Units of a deck, which states none: length, force and mass by name, scaled to SI.

They are guessed by what materials there are.
"""

from collections import defaultdict
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from modalbase.formats.constants import FOOT, INCH, POUND_FORCE, STANDARD_GRAVITY
from modalbase.formats.errors import FormatError
from modalbase.formats.models.model import (
    BeamSection,
    FiniteElementModel,
    Link,
    Material,
    PointMass,
    ShellSection,
    Spring,
)
from modalbase.formats.units import values_of

_POUND = POUND_FORCE / STANDARD_GRAVITY
LENGTHS = values_of("length", "m mm cm in ft")
FORCES = values_of("force", "N kN MN lbf kip kgf")
MASSES = {
    "kg": 1.0,
    "t": 1e3,
    "g": 1e-3,
    "lb": _POUND,
    "slug": POUND_FORCE / FOOT,
    "slinch": POUND_FORCE / INCH,
}
"""SI value of one unit. A slug is a lbf s²/ft, a slinch a lbf s²/in."""

COMMON = (
    "m-N-kg",
    "mm-N-t",
    "mm-N-kg",
    "mm-kN-kg",
    "m-kN-t",
    "cm-N-kg",
    "in-lbf-slinch",
    "in-lbf-lb",
    "ft-lbf-slug",
)
"""Those that a guess tries. Units need not be coherent: mm-N-kg is not, and its solver's
frequencies are then in odd units.
"""


class UnitSystem(NamedTuple):
    """SI value of one unit of length, force and mass."""

    length: float
    force: float
    mass: float

    @property
    def stress(self) -> float:
        """Of one unit of force per area, Pa."""
        return self.force / self.length**2

    @property
    def density(self) -> float:
        """Of one unit of mass per volume, kg/m³."""
        return self.mass / self.length**3


@dataclass(frozen=True)
class Guess:
    """Units that a deck seems to be in, and why: a sentence. They are to be confirmed."""

    units: str
    reason: str


class _Known(NamedTuple):
    """A kind of material: ranges of its density in kg/m³ and of its largest Young's modulus in
    Pa.
    """

    name: str
    density: tuple[float, float]
    modulus: tuple[float, float]


_KNOWN = (
    _Known("steel", (7500, 8300), (1.7e11, 2.3e11)),
    _Known("aluminium", (2500, 2900), (6e10, 8.5e10)),
    _Known("titanium", (4200, 4800), (9e10, 1.3e11)),
    _Known("magnesium", (1700, 1850), (4e10, 4.8e10)),
    _Known("brass or copper", (8300, 9000), (9e10, 1.4e11)),
    _Known("fibre reinforced plastic", (1200, 2300), (4e9, 4.5e11)),
    _Known("wood", (250, 1200), (4e9, 3e10)),
    _Known("plastic", (850, 1600), (5e8, 6e9)),
    _Known("concrete or glass", (2000, 2700), (1.5e10, 9e10)),
    _Known("core of foam, balsa or honeycomb", (25, 350), (5e6, 6e9)),
)
SIZES = (1e-3, 1e4)
"""Usual extent of a structure, m."""


def units_of(name: str) -> UnitSystem:
    """Units by name: of length, force and mass, with hyphens between.

    >>> units_of("m-kN-t").density
    1000.0

    Raises:
        FormatError: the name is none.
    """
    parts = name.split("-")
    if (
        len(parts) != 3
        or parts[0] not in LENGTHS
        or parts[1] not in FORCES
        or parts[2] not in MASSES
    ):
        raise FormatError(
            "units",
            f"{name!r} names no units, expected length-force-mass, such as {', '.join(COMMON)}; "
            f"lengths {' '.join(LENGTHS)}, forces {' '.join(FORCES)}, masses {' '.join(MASSES)}",
        )
    return UnitSystem(LENGTHS[parts[0]], FORCES[parts[1]], MASSES[parts[2]])


def in_si(model: FiniteElementModel, units: str) -> FiniteElementModel:
    """The model with all numbers in SI; a density that is not stated is 0.

    Args:
        model: in the deck's units.
        units: their names, such as `mm-N-t`.

    Raises:
        FormatError: `units` names none.
    """
    u = units_of(units)
    return replace(
        model,
        nodes=model.nodes * u.length,
        elements=tuple(
            replace(
                block,
                offsets=None if block.offsets is None else block.offsets * u.length,
                thickness=None if block.thickness is None else block.thickness * u.length,
            )
            for block in model.elements
        ),
        sections={name: _section(section, u) for name, section in model.sections.items()},
        materials={name: _material(material, u) for name, material in model.materials.items()},
        masses=tuple(_mass(mass, u) for mass in model.masses),
        springs=tuple(_spring(spring, u) for spring in model.springs),
        links=tuple(_link(link, u) for link in model.links),
    )


def _link(link: Link, u: UnitSystem) -> Link:
    """Equations between displacements and turns have lengths."""
    if link.equations is None:
        return link
    unit = np.repeat([u.length, 1.0], 3)
    return replace(link, equations=link.equations * (unit[:, None] / unit))


def _section(section: ShellSection | BeamSection, u: UnitSystem) -> ShellSection | BeamSection:
    if isinstance(section, ShellSection):
        plies = tuple(replace(ply, thickness=ply.thickness * u.length) for ply in section.plies)
        extra = section.extra_mass * u.mass / u.length**2
        return replace(section, plies=plies, offset=section.offset * u.length, extra_mass=extra)
    first, second, mixed = (value * u.length**4 for value in section.inertia)
    return replace(
        section,
        area=section.area * u.length**2,
        inertia=(first, second, mixed),
        torsion=section.torsion * u.length**4,
        extra_mass=section.extra_mass * u.mass / u.length,
    )


def _material(material: Material, u: UnitSystem) -> Material:
    stated = {name: value * unit_of(name, u) for name, value in material.constants.items()}
    return replace(material, constants={**stated, "density": stated.get("density", 0.0)})


def unit_of(constant: str, u: UnitSystem) -> float:
    """SI value of one unit of a constant of a section or material, such as `t`, `I1`, `E2`, `nu` or
    `density`.
    """
    if constant in ("t", "area", "I1", "I2", "J"):
        return u.length ** {"t": 1, "area": 2}.get(constant, 4)
    if constant == "density":
        return u.density
    return u.stress if constant[0] in "EG" else 1.0


def _mass(mass: PointMass, u: UnitSystem) -> PointMass:
    x, y, z = (value * u.length for value in mass.offset)
    inertia = tuple(
        (a * u.mass * u.length**2, b * u.mass * u.length**2, c * u.mass * u.length**2)
        for a, b, c in mass.inertia
    )
    return replace(mass, mass=mass.mass * u.mass, inertia=inertia, offset=(x, y, z))


def _spring(spring: Spring, u: UnitSystem) -> Spring:
    """N/m between displacements, N·m between turns, N between the two."""
    turns = [
        dof >= 3
        for dof in (spring.dof, spring.dof if spring.second_dof is None else spring.second_dof)
    ]
    arms = None
    if spring.arms is not None:
        (a, b, c), (x, y, z) = (np.multiply(arm, u.length).tolist() for arm in spring.arms)
        arms = (a, b, c), (x, y, z)
    stiffness = spring.stiffness * u.force * u.length ** (sum(turns) - 1)
    return replace(spring, stiffness=stiffness, arms=arms)


def guess(model: FiniteElementModel) -> Guess | None:
    """Units in which most elements are of materials that are known, and the structure has the size
    of one; None where none are.

    The first such of `COMMON` is offered, and the others are named.
    """
    counts: dict[str, int] = defaultdict(int)
    for block in model.elements:
        for name in model.sections[block.set].materials:
            counts[name] += len(block.numbers)
    known: dict[str, dict[str, str]] = {}
    for name in COMMON:
        u = units_of(name)
        if within(extent(model) * u.length, SIZES):
            kinds = {each: _kind(material, u) for each, material in model.materials.items()}
            known[name] = {each: kind for each, kind in kinds.items() if kind}
    recognised = {name: sum(counts[each] for each in kinds) for name, kinds in known.items()}
    most = max(recognised.values(), default=0)
    if not most:
        return None
    first, *others = (name for name, share in recognised.items() if share == most)
    u = units_of(first)
    materials = "; ".join(
        f"{name} would be {known[first].get(name) or 'no usual material'} (E"
        f" {modulus_of(material) * u.stress / 1e9:.3g} GPa, density"
        f" {material.constants.get('density', 0.0) * u.density:.4g} kg/m³)"
        for name, material in model.materials.items()
    )
    also = f"; {', '.join(others)} would fit too" if others else ""
    return Guess(
        first,
        f"in {first} the structure is {extent(model) * u.length:.3g} m large, and {materials}{also}",
    )


def _kind(material: Material, u: UnitSystem) -> str:
    """A known kind of material that has these constants; empty where none has."""
    density, E = material.constants.get("density", 0.0) * u.density, modulus_of(material) * u.stress
    return next((k.name for k in _KNOWN if within(density, k.density) and within(E, k.modulus)), "")


def modulus_of(material: Material) -> float:
    """Its largest Young's modulus."""
    return max(
        value for name, value in material.constants.items() if name in ("E", "E1", "E2", "E3")
    )


def extent(model: FiniteElementModel) -> float:
    """Diagonal of the box around the elements."""
    used = np.unique(np.concatenate([block.nodes.ravel() for block in model.elements]))
    return float(np.linalg.norm(np.ptp(model.nodes[used], axis=0)))


def within(value: float, limits: tuple[float, float]) -> bool:
    """Whether a value lies between two, or is one of them."""
    return limits[0] <= value <= limits[1]
