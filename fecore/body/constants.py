"""What updating asks of a body."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from fecore.arrays import BoolArray, FloatArray

if TYPE_CHECKING:
    from fecore.body.model import Model
    from fecore.body.supports import NodeSpring, Spring


class Body(Protocol):
    """What updating asks of a body.

    Closed forms take (c, …) constants in the order of `nominal`, and complex ones too: their
    derivatives are complex steps.
    """

    @property
    def nominal(self) -> dict[str, float]:
        """Constants that can be parameters, by name, SI."""
        ...

    @property
    def springs(self) -> tuple[Spring | NodeSpring, ...]:
        """Elastic supports, the last coefficients of the model's stiffness."""
        ...

    @property
    def model_error(self) -> float:
        """Relative error of a natural frequency that the model is known to have, independent from
        mode to mode.
        """
        ...

    @property
    def model(self) -> Model:
        """The affine finite element model, which holds for any constants."""
        ...

    def stiffness_coefficients(self, constants: FloatArray) -> FloatArray:
        """(k, …) coefficients of the model's stiffness, springs apart."""
        ...

    def mass_coefficients(self, constants: FloatArray) -> FloatArray:
        """(j, …) coefficients of the model's mass."""
        ...

    def are_physical(self, constants: FloatArray) -> BoolArray:
        """(…) whether the constants are those of a stable material and a real section."""
        ...
