"""An isotropic strip as a Timoshenko beam: a structure whose section follows from its width and
thickness.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fecore.arrays import BoolArray, FloatArray
from fecore.body.beams import BeamSection, rectangle_torsion
from fecore.body.clamps import Root
from fecore.body.mesh import CellBlock, Mesh
from fecore.body.named import BENDING, BEYOND_EDGE, OfStructure
from fecore.body.structure import Structure
from fecore.body.supports import Boundary, PointMass, Support, of_boundary
from fecore.errors import InputError

BEAM_CONSTANTS = ("E", "nu", "density", "width", "thickness", "length")
"""Constants of a `BeamSpecimen`."""


@dataclass(frozen=True)
class BeamSpecimen(OfStructure):
    """An isotropic strip as three-node Timoshenko beam elements, in out-of-plane bending and
    torsion.
    """

    # length, width, thickness: m
    length: float
    width: float
    thickness: float
    modulus: float  # nominal Young's modulus E, Pa
    poisson: float  # nominal Poisson's ratio ν; the shear modulus is E / 2(1 + ν)
    density: float  # nominal, kg/m³
    boundary: Boundary = "cantilever"  # how it is held
    masses: tuple[PointMass, ...] = ()  # what it carries, such as a sensor
    elements: int = 40  # along the length
    dofs: tuple[int, ...] = BENDING  # of a node; all six let it move in its plane too

    springs = ()

    def __post_init__(self) -> None:
        constants = np.array(list(self.nominal.values()))
        E, nu = constants[:2]
        if not (
            np.all(np.isfinite(constants)) and -1 < nu < 0.5 and E > 0 and np.all(constants[2:] > 0)
        ):
            stated = ", ".join(f"{name} = {value:g}" for name, value in self.nominal.items())
            raise InputError("beam", f"has {stated}; expected positive numbers and -1 < nu < 0.5")

    @property
    def nominal(self) -> dict[str, float]:
        """E, ν, density and section."""
        values = (self.modulus, self.poisson, self.density, self.width, self.thickness, self.length)
        return dict(zip(BEAM_CONSTANTS, values, strict=True))

    @cached_property
    def structure(self) -> Structure:
        """The axis along x, with the dofs w, θx and θy."""
        count = 2 * self.elements + 1
        nodes = np.column_stack([np.linspace(0, self.length, count), np.zeros((count, 2))])
        first = 2 * np.arange(self.elements)
        ends = {"start": np.array([0]), "end": np.array([count - 1])}
        mesh = Mesh(
            nodes,
            (CellBlock("beam3", np.column_stack([first, first + 2, first + 1]), "beam"),),
            ends,
        )
        modulus = self.modulus / 2 / (1 + self.poisson)
        part = BeamSection.rectangle(
            self.width, self.thickness, self.modulus, modulus, self.density
        )
        held = of_boundary(self.boundary)
        if self.boundary == "simply_supported":  # one end holds it along its axis
            held = (Support("start", ("u", "v", "w", "rx")), Support("end", ("v", "w", "rx")))
        masses = tuple(each.on_surface() for each in self.masses)
        reach = (BEYOND_EDGE * self.length, np.inf, np.inf)
        return Structure(
            mesh, {"beam": part}, held, (), masses, dofs=self.dofs, size=(self.length,), reach=reach
        )

    def row(self, name: str, own: dict[str, FloatArray]) -> FloatArray | float | None:
        """A constant of the structure: the section's from width and thickness."""
        b, t, shear = own["width"], own["thickness"], own["E"] / (2 * (1 + own["nu"]))
        constant = name.rpartition(".")[2]
        made = {"G": shear, "area": b * t, "I1": b * t**3 / 12, "I2": t * b**3 / 12}
        if constant == "J":
            return np.asarray(rectangle_torsion(shear, shear, b, t) / shear)
        return made.get(constant, own.get(constant))

    def root(self, constants: FloatArray) -> Root | None:
        """The clamped end at some constants; None where there is none."""
        own = dict(zip(self.nominal, constants, strict=True))
        b, t = float(own["width"]), float(own["thickness"])
        root = Root(float(own["E"]) * b * t**3 / 12, float(own["length"]), b, t)
        return root if self.boundary == "cantilever" else None

    def are_physical(self, constants: FloatArray) -> BoolArray:
        """(…) all but ν positive, and -1 < ν < ½."""
        positive = np.all(np.delete(constants, 1, axis=0) > 0, axis=0)
        return np.asarray(positive & (constants[1] > -1) & (constants[1] < 0.5))
