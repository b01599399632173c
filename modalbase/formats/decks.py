"""What a deck says, the meshes that it is written on, and decks of CalculiX, Abaqus and Nastran.

CalculiX and Abaqus have one language, `.inp`. An updated model has the shear correction κ = 5/6 of
a rectangular section. Two quadratic bricks through the thickness show that shear by themselves, and
Abaqus' shells know κ. CalculiX makes one brick of a shell, whose shear strain is the same over the
thickness (κ = 1); there the transverse shear moduli of the card are 5/6 of the material's. Decks of
Nastran have CQUAD8 shells with a MAT8, for SOL 103.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from modalbase.formats.constants import ROUND_OFF
from modalbase.formats.types import FloatArray, IntArray

ALONG, ACROSS, THROUGH = 60, 6, 2
"""Quadratic elements along the length of a strip, at least across its width, and through its
thickness.
"""

MOST_ACROSS = 30


@dataclass(frozen=True)
class Mass:
    """A point mass in kg at (x, y) in m on the middle surface."""

    x: float
    y: float
    mass: float


@dataclass(frozen=True)
class Deck:
    """A strip with its material: x along the length from the clamped end, y from −b/2 to b/2, z out
    of plane; SI.
    """

    # length, width, thickness: m
    length: float
    width: float
    thickness: float
    moduli: tuple[float, float, float, float, float]  # Ex, Ey, Gxy, Gxz, Gyz in Pa
    nu_xy: float  # Poisson's ratio of a contraction along y under stress along x
    density: float  # kg/m³
    boundary: str  # `cantilever`, `free` or `simply_supported`
    modes: int  # how many are asked for
    # ALPHA in 1/s and BETA in s of C = ALPHA M + BETA K; None where the damping has another law
    alpha_beta: tuple[float, float] | None = None
    masses: tuple[Mass, ...] = ()  # what it carries
    remarks: tuple[str, ...] = field(default=())  # lines that the deck begins with, as comments

    @property
    def divisions(self) -> tuple[int, int]:
        """Elements along the length and across the width, of about equal sides on a plate."""
        return ALONG, int(np.clip(round(ALONG * self.width / self.length), ACROSS, MOST_ACROSS))

    def lines(self) -> tuple[FloatArray, FloatArray]:
        """Coordinates of the lines of half elements along x and y; corner lines pass through the
        point masses.
        """
        nx, ny = self.divisions
        x = _through(np.linspace(0, self.length, nx + 1), [mass.x for mass in self.masses])
        y = _through(
            np.linspace(-self.width / 2, self.width / 2, ny + 1), [mass.y for mass in self.masses]
        )
        return _halved(x), _halved(y)


@dataclass(frozen=True)
class Mesh:
    """Nodes and elements, numbered from 1."""

    nodes: FloatArray  # (n, 3) coordinates, m
    elements: IntArray  # (m, k) nodes of each element, in the order that CalculiX and Abaqus have

    def at(self, axis: int, value: float) -> IntArray:
        """Numbers of the nodes where a coordinate has a value."""
        close = np.abs(self.nodes[:, axis] - value) < ROUND_OFF * np.ptp(self.nodes[:, 0])
        return np.flatnonzero(close) + 1

    def nearest(self, x: float, y: float) -> int:
        """The node of the middle surface next to a place."""
        return int(np.argmin(np.linalg.norm(self.nodes - [x, y, 0.0], axis=1))) + 1


CORNERS = ((0, 0), (2, 0), (2, 2), (0, 2))
SIDES = ((1, 0), (2, 1), (1, 2), (0, 1))


def shells(deck: Deck) -> Mesh:
    """Quadratic shells of eight nodes on the middle surface."""
    return _quadratic((*deck.lines(), np.zeros(1)), [(*one, 0) for one in (*CORNERS, *SIDES)])


def solids(deck: Deck) -> Mesh:
    """Quadratic bricks of twenty nodes, with nodes on the middle surface."""
    z = np.linspace(-deck.thickness / 2, deck.thickness / 2, 2 * THROUGH + 1)
    rings = ((CORNERS, 0), (CORNERS, 2), (SIDES, 0), (SIDES, 2), (CORNERS, 1))
    return _quadratic((*deck.lines(), z), [(*one, level) for ring, level in rings for one in ring])


def _quadratic(
    lines: tuple[FloatArray, FloatArray, FloatArray], places: list[tuple[int, int, int]]
) -> Mesh:
    """Elements on a grid of lines, of which every second one passes through their corners.

    Args:
        lines: along x, y and z.
        places: of an element's nodes, in lines from its first corner.
    """
    at = np.indices([line.size for line in lines])
    real = (at % 2).sum(axis=0) < 2  # corners and the middles of sides
    number = np.where(real, np.cumsum(real.ravel()).reshape(real.shape), 0)
    nodes = np.column_stack([line[own[real]] for line, own in zip(lines, at, strict=True)])
    corners = 2 * np.indices([max(line.size // 2, 1) for line in lines]).reshape(3, -1).T
    i, j, k = np.moveaxis(corners[:, None] + np.array(places), -1, 0)
    return Mesh(nodes, number[i, j, k])


def _through(lines: FloatArray, places: list[float]) -> FloatArray:
    """Lines of which the nearest has moved to each place; the outermost stay."""
    moved = lines.copy()
    for place in places:
        nearest = int(np.argmin(np.abs(lines - place)))
        if 0 < nearest < lines.size - 1:
            moved[nearest] = place
    return moved


def _halved(lines: FloatArray) -> FloatArray:
    halves = np.empty(2 * lines.size - 1)
    halves[::2], halves[1::2] = lines, (lines[1:] + lines[:-1]) / 2
    return halves


PER_LINE = 12
SHEAR_CORRECTION = 5 / 6
"""κ of a homogeneous rectangular section (Reissner 1945); Nastran's TS/T."""


def write_solids(deck: Deck) -> str:
    """A deck of C3D20R bricks.

    A clamped edge holds x and y through the thickness and z on the middle surface: the section may
    contract there, as in the theory of plates that the update used.
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
        remark = (
            "G13 and G23 are 5/6 of the material's: CalculiX does not correct the shear of its"
            " shells"
        )
        moduli = (Ex, Ey, Gxy, SHEAR_CORRECTION * Gxz, SHEAR_CORRECTION * Gyz)
        deck = replace(deck, moduli=moduli, remarks=(*deck.remarks, remark))
    mesh = shells(deck)
    section = ["*SHELL SECTION, ELSET=BODY, MATERIAL=UPDATED", f"{deck.thickness:.9g}"]
    return _written(deck, mesh, "S8R", section, _held_shell(deck, mesh))


def _written(deck: Deck, mesh: Mesh, element: str, section: list[str], held: list[str]) -> str:
    lines = [f"** {remark}" for remark in deck.remarks]
    lines += ["*NODE, NSET=ALL"]
    lines += [
        f"{n},{x:.12g},{y:.12g},{z:.12g}"
        for n, (x, y, z) in enumerate(mesh.nodes.tolist(), start=1)
    ]
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
        "** E1, E2, E3, nu12, nu13, nu23, G12, G13 and G23; E3, nu13 and nu23 are not updated and"
        " hardly matter here"
    ]
    lines += ["*MATERIAL, NAME=UPDATED", "*ELASTIC, TYPE=ENGINEERING CONSTANTS"]
    lines += [
        f"{Ex:.9g},{Ey:.9g},{Ey:.9g},{nu:.9g},{nu:.9g},{nu:.9g},{Gxy:.9g},{Gxz:.9g}",
        f"{Gyz:.9g}",
    ]
    lines += ["*DENSITY", f"{deck.density:.9g}"]
    if deck.alpha_beta is not None:
        lines += [f"*DAMPING, ALPHA={deck.alpha_beta[0]:.9g}, BETA={deck.alpha_beta[1]:.9g}"]
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


def write_nastran(deck: Deck) -> str:
    """A deck for SOL 103; fields stand free between commas, long ones in 16 columns."""
    mesh = shells(deck)
    lines = [f"$ {remark}" for remark in deck.remarks]
    lines += [
        "SOL 103",
        "CEND",
        "METHOD = 1",
        *(["SPC = 1"] if deck.boundary != "free" else []),
        "DISPLACEMENT = ALL",
    ]
    lines += ["BEGIN BULK", f"EIGRL,1,,,{deck.modes}", "PARAM,AUTOSPC,YES", "PARAM,COUPMASS,1"]
    if deck.alpha_beta is not None:
        lines += [
            f"PARAM,ALPHA1,{_real(deck.alpha_beta[0])}",
            f"PARAM,ALPHA2,{_real(deck.alpha_beta[1])}",
        ]
    lines += _mat8(deck)
    lines += _grids(deck, mesh)
    lines += _spc1(deck, mesh)
    return "\n".join([*lines, "ENDDATA"]) + "\n"


def _mat8(deck: Deck) -> list[str]:
    Ex, Ey, Gxy, Gxz, Gyz = deck.moduli
    long = [1, Ex, Ey, deck.nu_xy, Gxy, Gxz, Gyz, deck.density]
    fields = [str(long[0]), *(_real(value) for value in long[1:])]
    return [
        "MAT8*," + ",".join(fields[:4]),
        "*," + ",".join(fields[4:]),
        # eight columns would round the thickness, whose cube bends
        f"PSHELL*,1,1,{_real(deck.thickness)},1",
        f"*,1.0,1,{SHEAR_CORRECTION:.9f}",
    ]


def _grids(deck: Deck, mesh: Mesh) -> list[str]:
    lines = []
    for number, (x, y, z) in enumerate(mesh.nodes.tolist(), start=1):
        lines += [f"GRID*,{number},,{_real(x)},{_real(y)}", f"*,{_real(z)}"]
    for number, nodes in enumerate(mesh.elements.tolist(), start=1):
        lines += [
            f"CQUAD8,{number},1,{','.join(map(str, nodes[:6]))}",
            f",{nodes[6]},{nodes[7]},,,,,0.0",
        ]
    for number, mass in enumerate(deck.masses, start=len(mesh.elements) + 1):
        lines += [f"CONM2,{number},{mesh.nearest(mass.x, mass.y)},0,{_real(mass.mass)}"]
    return lines


def _spc1(deck: Deck, mesh: Mesh) -> list[str]:
    """A clamp holds all; a hard simple support y, z and the rotation about x. No shell resists its
    drilling rotation.
    """
    edges = {
        "cantilever": [(0.0, "123456")],
        "simply_supported": [(0.0, "2346"), (deck.length, "2346")],
    }
    return [
        f"SPC1,1,{dofs},{node}"
        for x, dofs in edges.get(deck.boundary, [])
        for node in mesh.at(0, x).tolist()
    ]


def _real(value: float) -> str:
    """A number that has a point, as Nastran asks of a real, in at most 16 columns."""
    text = f"{value:.9G}"
    if "." not in text:
        mantissa, mark, exponent = text.partition("E")
        text = f"{mantissa}.{mark}{exponent}"
    return text
