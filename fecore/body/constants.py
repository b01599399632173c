"""What updating asks of a body, and what a recipe says of its constants."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

import numpy as np

from fecore.arrays import BoolArray, FloatArray
from fecore.quantities import kind_of

if TYPE_CHECKING:
    from fecore.body.clamps import Bed, Root
    from fecore.body.locate import Surfaces
    from fecore.body.model import Model
    from fecore.body.specimen import FlatBody, Specimen
    from fecore.body.structure import Structure
    from fecore.body.supports import Mass, NodeSpring, PointMass, Spring

ISOTROPIC = 1e-3  # to which share constants of one isotropic material agree
LARGEST_POISSON = 0.5  # of a beam's E and G


@dataclass(frozen=True)
class Parameter:
    """One constant in a recipe."""

    # one of the specimen's constants, or of its springs; `Ex.per_K` is Ex's coefficient of
    # temperature
    name: str
    prior_mean: float | None = None  # SI; the specimen's nominal value where None
    # SI; 30 % of the mean where None. Of a tied constant, how far it may be off its tie.
    prior_sd: float | None = None
    fixed: bool = False  # keep the constant at its prior mean
    # name of a parameter that this constant follows in the ratio of the nominal values
    tied_to: str | None = None

    def of_set(self, name: str) -> Parameter:
        """The same constant of a set of a body in space."""
        tied = self.tied_to and f"{name}.{self.tied_to}"
        return replace(self, name=f"{name}.{self.name}", tied_to=tied)


DEFAULT_PARAMETERS = (
    Parameter("Ex"),
    Parameter("Ey"),
    Parameter("Gxy"),
    Parameter("Gxz"),
    Parameter("Gyz", tied_to="Gxz"),
)
"""What is updated when a recipe names nothing: the contract's default."""

PLY_PARAMETERS = (
    Parameter("E1"),
    Parameter("E2"),
    Parameter("G12"),
    Parameter("G13"),
    Parameter("G23", tied_to="G13"),
)
"""What is updated of a specimen of plies when a recipe names nothing."""


def of_plies(nominal: Mapping[str, float]) -> tuple[Parameter, ...]:
    """What is updated of a set of plies; of an isotropic material its E, which the others
    follow.
    """
    E, nu = nominal["E1"], nominal["nu12"]
    alike = np.allclose([nominal["E2"], 2 * (1 + nu) * nominal["G12"]], E, rtol=ISOTROPIC)
    return _following("E1", ("E2", "G12", "G13", "G23"), nominal) if alike else PLY_PARAMETERS


def of_beams(nominal: Mapping[str, float]) -> tuple[Parameter, ...]:
    """What is updated of a set of beams: its E, which G follows where both are of one material."""
    one_material = 0 <= nominal["E"] / (2 * nominal["G"]) - 1 <= LARGEST_POISSON
    return _following("E", ("G",), nominal) if one_material else (Parameter("E"), Parameter("G"))


def _following(
    first: str, others: Iterable[str], nominal: Mapping[str, float]
) -> tuple[Parameter, ...]:
    tied = (Parameter(name, prior_sd=ISOTROPIC * nominal[name], tied_to=first) for name in others)
    return (Parameter(first), *tied)


_OF_PLIES = (*(p.name for p in PLY_PARAMETERS), "nu12")
# what is updated by the name of a modulus, and the constants that say so
_OF_KIND = {"E1": (of_plies, _OF_PLIES), "E": (of_beams, ("E", "G"))}


def with_followers(
    parameters: Sequence[Parameter], nominal: Mapping[str, float]
) -> tuple[Parameter, ...]:
    """A recipe's parameters, with what follows a named modulus of an isotropic material and is not
    named itself: the material stays one.

    Args:
        parameters: of the recipe.
        nominal: the body's constants.
    """
    named, followers = {p.name for p in parameters}, list[Parameter]()
    for master in parameters:
        place, dot, last = master.name.rpartition(".")
        kind = kind_of(master.name)
        usual, constants = _OF_KIND.get(kind, (of_plies, ()))
        names = {c: f"{place}{dot}{c}{last.removeprefix(kind)}" for c in constants}
        own = {c: nominal[name] for c, name in names.items() if name in nominal}
        if not own or len(own) < len(names) or (master.fixed and master.prior_mean is None):
            continue
        share = (master.prior_mean or own[kind]) / own[kind]
        for each in usual(own):
            # of an orthotropic material nothing follows as exactly
            if each.prior_sd is not None and (name := names[each.name]) not in named:
                followers.append(
                    Parameter(
                        name,
                        share * own[each.name],
                        None if master.fixed else share * each.prior_sd,
                        master.fixed,
                        None if master.fixed else master.tied_to or master.name,
                    )
                )
    return (*parameters, *followers)


COMMON_SD, OWN_SD = 0.30, 0.15
"""Relative prior of a material, and scatter of the sets that are made of it."""


@dataclass(frozen=True)
class CommonPrior:
    """Constants of sets that are made of one material: one unknown in common, and a scatter of
    each.
    """

    constants: tuple[str, ...]  # such as `flange.E1` and `web.E1`
    common: float = COMMON_SD  # relative sd of what they share
    own: float = OWN_SD  # relative sd of each about it; 0 ties them


def common_priors(materials: Mapping[str, object]) -> tuple[CommonPrior, ...]:
    """Moduli of sets whose materials are nominally alike, as constants of one material.

    Args:
        materials: of the sets by name.
    """
    sets: dict[object, list[str]] = {}
    for name, material in materials.items():
        sets.setdefault(material, []).append(name)
    return tuple(
        CommonPrior(tuple(f"{name}.{constant}" for name in names))
        for names in sets.values()
        if len(names) > 1
        for constant in _OF_PLIES
    )


class Body(ABC):
    """What updating asks of a body, with the answers of one that has nothing of its own to say.

    Closed forms take (c, …) constants in the order of `nominal`, and complex ones too: their
    derivatives are complex steps.
    """

    masses: tuple[Mass, ...] | tuple[PointMass, ...] = ()
    """What it carries."""

    zones: tuple[float, ...] = ()
    """Lines along x between zones, each with a factor of its stiffness, m."""

    with_joints: bool = True
    """Whether the joints of walls, where there are any, are modelled."""

    @property
    @abstractmethod
    def nominal(self) -> dict[str, float]:
        """Constants that can be parameters, by name, SI."""

    @property
    @abstractmethod
    def springs(self) -> tuple[Spring | NodeSpring, ...]:
        """Elastic supports, the last coefficients of the model's stiffness."""

    @property
    @abstractmethod
    def model_error(self) -> float:
        """Relative error of a natural frequency that the model is known to have, independent from
        mode to mode.
        """

    @property
    @abstractmethod
    def model(self) -> Model:
        """The affine finite element model, which holds for any constants."""

    @abstractmethod
    def stiffness_coefficients(self, constants: FloatArray) -> FloatArray:
        """(k, …) coefficients of the model's stiffness, springs apart."""

    @abstractmethod
    def mass_coefficients(self, constants: FloatArray) -> FloatArray:
        """(j, …) coefficients of the model's mass."""

    @abstractmethod
    def are_physical(self, constants: FloatArray) -> BoolArray:
        """(…) whether the constants are those of a stable material and a real section."""

    # --- what it is made of

    @property
    def in_space(self) -> Structure | None:
        """The body itself where it is one in space with a mesh of its own; None of strips, plates
        and matrices.
        """
        return None

    @property
    def as_structure(self) -> Structure | None:
        """The structure that it is, by whatever names of its constants; None of matrices."""
        return self.in_space

    @property
    def has_elements(self) -> bool:
        """Whether its stiffness is that of elements, which matrices have none of."""
        return True

    @property
    def surfaces(self) -> Surfaces:
        """Its shells and beams, or nodes, on which points are found."""
        return self.model.surfaces

    @property
    def outline(self) -> tuple[str, ...]:
        """Constants that say where it ends, along x from 0 and across y about 0."""
        return ()

    @property
    def even_thickness(self) -> float | None:
        """Thickness of a strip or plate of one laminate, m; None of another body."""
        return None

    @property
    def one_layer(self) -> Specimen | None:
        """The body itself where it is a strip of one homogenised layer of one thickness."""
        return None

    # --- what is updated

    def default_parameters(self) -> tuple[Parameter, ...]:
        """What is updated when a recipe names nothing."""
        own = PLY_PARAMETERS if "E1" in self.nominal else DEFAULT_PARAMETERS
        return (*own, *(Parameter(name) for name in self.nominal if kind_of(name) == "zone"))

    def common_priors(self) -> tuple[CommonPrior, ...]:
        """Constants that share a prior, as they are of one material."""
        return ()

    @property
    def shares_material(self) -> bool:
        """Whether its moduli are those of a material in the material's own axes, of which other
        specimens may be too.
        """
        return False

    # --- how it may be modelled otherwise

    @property
    def unmeshed(self) -> FlatBody | None:
        """The body, rigidly clamped, where its mesh is left to who knows the band; None where it
        has one of its own.
        """
        return None

    def with_mesh(self, divisions: tuple[int, int]) -> Self:  # noqa: ARG002
        """The body with so many elements along and across; as it is where it has a mesh of its
        own.
        """
        return self

    def yielding(self, compliance: float) -> Self:  # noqa: ARG002
        """The body with a clamp of that EI/kL, 0 for a rigid one; as it is where none is modelled."""
        return self

    @abstractmethod
    def carrying(self, masses: Sequence[PointMass]) -> Self:
        """The body with more masses."""

    def divided(self, parts: int) -> Self:  # noqa: ARG002
        """The body with each of its zones in so many equal ones."""
        return self

    # --- what may be something though it is believed to be nothing

    def turned(self, angle: float) -> Self | None:  # noqa: ARG002
        """The body with its fibres turned about z by an angle, rad; None where it has none."""
        return None

    @property
    def is_mirrored(self) -> bool:
        """Whether it and its supports are alike on both sides of its middle line."""
        return False

    @property
    def bed(self) -> Bed | None:
        """The bed of the one clamp that holds a body in space; None of another."""
        return None

    def root(self, constants: FloatArray) -> Root | None:  # noqa: ARG002
        """The clamped end of a strip at some constants; None where there is none that may give
        way.
        """
        return None
