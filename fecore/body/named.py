"""Bodies that are structures by other names of their constants."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import Self

import numpy as np

from fecore.arrays import BoolArray, FloatArray
from fecore.body.constants import Body
from fecore.body.model import Model
from fecore.body.structure import Structure
from fecore.body.supports import PointMass, Spring

BENDING = (2, 3, 4)
"""Dofs of a node that bends out of its plane: w, θx, θy."""

BEYOND_EDGE = 0.02
"""Share of a dimension by which a point may lie beyond the edge and count as on it: tapes differ
from callipers.
"""


class OfStructure(Body):
    """A body that is a structure by other names of its constants: `row` gives each of the
    structure's from one's own.
    """

    springs: tuple[Spring, ...]
    masses: tuple[PointMass, ...]

    @property
    @abstractmethod
    def structure(self) -> Structure:
        """The structure at nominal constants."""

    @abstractmethod
    def row(self, name: str, own: dict[str, FloatArray]) -> FloatArray | float | None:
        """A constant of the structure by its name; None where it is nominal."""

    @property
    def as_structure(self) -> Structure:
        """The structure at nominal constants."""
        return self.structure

    @property
    def outline(self) -> tuple[str, ...]:
        """Its length and width."""
        return ("length", "width")

    @property
    def model_error(self) -> float:
        """0: strips, plates and beams have no joints."""
        return 0.0

    @property
    def model(self) -> Model:
        """The affine finite element model, which holds for any constants.

        Raises:
            InputError: the geometry, or the place of a mass or a spring, is wrong.
        """
        return self.structure.model

    def stiffness_coefficients(self, constants: FloatArray) -> FloatArray:
        """(k, …) coefficients of the model's stiffness, springs apart."""
        return self.structure.stiffness_coefficients(self._spread(constants))

    def mass_coefficients(self, constants: FloatArray) -> FloatArray:
        """(j, …) coefficients of the model's mass."""
        return self.structure.mass_coefficients(self._spread(constants))

    def are_physical(self, constants: FloatArray) -> BoolArray:
        """(…) whether the constants are those of a stable material and a real section."""
        return self.structure.are_physical(self._spread(constants))

    def carrying(self, masses: Sequence[PointMass]) -> Self:
        """The body with more masses."""
        return replace(self, masses=(*self.masses, *masses))  # type: ignore[type-var]

    def _spread(self, constants: FloatArray) -> FloatArray:
        """(c', …) the structure's constants."""
        own = dict(zip(self.nominal, constants, strict=True))
        values = np.empty(
            (len(self.structure.nominal), *constants.shape[1:]), dtype=constants.dtype
        )
        for place, (name, value) in enumerate(self.structure.nominal.items()):
            row = self.row(name, own)
            values[place] = value if row is None else row
        return values
