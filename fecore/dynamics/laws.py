"""The table of damping laws: each row says all that anything else needs to know of its law.

Recipes, their schema, the ladder that is ranked by default, laws of several campaigns, decks and
the guide's table iterate over `LAWS`. A new law is a row here, and a class where none of those of
`damping_laws` and `mechanism_laws` has its form.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fecore.body.constants import Body
from fecore.body.mechanisms import SUPPORTS, mechanism_names
from fecore.dynamics.damping_laws import (
    RAYLEIGH,
    CaugheySeries,
    DampingLaw,
    GeneralisedProportional,
    ModalDamping,
)
from fecore.dynamics.mechanism_laws import MechanismDamping
from fecore.quantities import kind_of


@dataclass(frozen=True)
class Damped:
    """What a law may be made for."""

    mechanisms: tuple[str, ...]  # of the body, as of `mechanism_names`
    # ascending circular frequencies of the measured modes, rad/s; none where no mode is at hand
    knots: tuple[float, ...] = ()

    def columns(self, *first: str) -> tuple[int, ...]:
        """Numbers of the mechanisms whose names begin so."""
        return tuple(n for n, name in enumerate(self.mechanisms) if name.startswith(first))

    @property
    def two(self) -> tuple[tuple[str, tuple[int, ...]], ...]:
        """Moduli E of tension and bending, and G of in-plane and transverse shear."""
        return (("E", self.columns("E")), ("G", self.columns("G")))

    @property
    def each(self) -> tuple[tuple[str, tuple[int, ...]], ...]:
        """Each modulus by itself, both transverse shear moduli together."""
        names, elastic = self.mechanisms, self.columns("E", "G")
        transverse = tuple(
            place for place in elastic if kind_of(names[place]) in ("Gxz", "Gyz", "G13", "G23")
        )
        single = tuple((names[place], (place,)) for place in elastic if place not in transverse)
        return (*single, (names[transverse[0]], transverse)) if transverse else single


@dataclass(frozen=True)
class LawRow:
    """One law of the table."""

    name: str  # in recipes and results
    meaning: str  # one sentence of the guide
    matrix: str  # its damping matrix in the guide; empty where it has none of a closed form
    rate: str  # its rate c(ω) in the guide
    make: Callable[[Damped], DampingLaw | None]  # None where the body cannot have it
    ranked: bool = False  # in the ladder of a recipe that names none
    common: bool = False  # whether campaigns of one material may have it in common
    needs: str = ""  # what a body that cannot have it lacks, in words
    # its coefficients that are ALPHA and BETA of a deck, C = ALPHA M + BETA K; None where it cannot
    # be written in one
    alpha_beta: tuple[str, str] | None = None

    def in_deck(self, coefficients: Mapping[str, float]) -> tuple[float, float] | None:
        """ALPHA in 1/s and BETA in s of a fitted law; None where a deck cannot state it."""
        if self.alpha_beta is None or not set(self.alpha_beta) <= set(coefficients):
            return None
        alpha, beta = (float(coefficients[name]) for name in self.alpha_beta)
        return alpha, beta


def _generalised(of: Damped) -> DampingLaw | None:
    if not of.knots:
        return None
    middle = float(np.exp(np.mean(np.log(of.knots))))
    return GeneralisedProportional(("constant", "root", "stiffness"), middle)


def _of_supports(of: Damped) -> DampingLaw | None:
    if SUPPORTS not in of.mechanisms:
        return None
    support = ("support", (of.mechanisms.index(SUPPORTS),))
    return MechanismDamping("mechanism_support", (*of.two, support))


_SERIES = "C = M Σ a_n (M⁻¹K)ⁿ"
LAWS: dict[str, LawRow] = {
    row.name: row
    for row in (
        LawRow(
            "rayleigh",
            "damping in proportion to mass and to stiffness (Eq. 1)",
            "C = a₀M + a₁K",
            "c = a₀ + a₁ω², so ζ = ½(a₀/ω + a₁ω) (Eq. 9)",
            lambda _: RAYLEIGH,
            ranked=True,
            common=True,
            alpha_beta=("a0", "a1"),
        ),
        LawRow(
            "caughey3",
            "a Caughey series of three terms (Eq. 2)",
            _SERIES,
            "c = Σ a_n ω²ⁿ, n = 0…2",
            lambda _: CaugheySeries("caughey3", (0, 1, 2)),
            ranked=True,
            common=True,
        ),
        LawRow(
            "caughey4",
            "a Caughey series of four terms (Eq. 2)",
            _SERIES,
            "c = Σ a_n ω²ⁿ, n = 0…3",
            lambda _: CaugheySeries("caughey4", (0, 1, 2, 3)),
            ranked=True,
            common=True,
        ),
        LawRow(
            "generalised",
            "a smooth function of frequency that turns in the middle of the measured modes (Adhikari)",
            "C = M β(M⁻¹K), β smooth",
            "c = g₀ + g₁ x + g₂ x², x = ω/ω_r",
            _generalised,
            ranked=True,
        ),
        LawRow(
            "mechanism",
            "loss factors of tension and bending, and of in-plane and transverse shear",
            "",
            "c = a₀ + ω (η_E U_E + η_G U_G)",
            lambda of: MechanismDamping("mechanism", of.two),
            ranked=True,
            common=True,
        ),
        LawRow(
            "mechanism_viscous",
            "viscous rates in place of the loss factors; `rayleigh` is the case b_E = b_G",
            "",
            "c = a₀ + ω² (b_E U_E + b_G U_G)",
            lambda of: MechanismDamping("mechanism_viscous", of.two, viscous=True),
            ranked=True,
            common=True,
        ),
        LawRow(
            "mechanism_constants",
            "a loss factor for each modulus, one for both transverse shear moduli",
            "",
            "c = a₀ + ω Σ_q η_q U_q",
            lambda of: MechanismDamping("mechanism_constants", of.each),
            common=True,
        ),
        LawRow(
            "mechanism_support",
            "`mechanism` with a loss factor of the springs of the supports",
            "",
            "c = a₀ + ω (η_E U_E + η_G U_G + η_support U_support)",
            _of_supports,
            needs="the specimen stands on no springs; state some",
        ),
        LawRow(
            "loss_factor",
            "one loss factor of the whole strain energy: the same ratio η/2 at every frequency",
            "",
            "c = ω η",
            lambda of: MechanismDamping("loss_factor", (("", of.columns("E", "G")),), mass=False),
            common=True,
        ),
        LawRow(
            "modal",
            "each mode has a ratio of its own",
            "",
            "c = 2 ω ζ_k of the nearest mode",
            lambda of: ModalDamping(of.knots) if of.knots else None,
            ranked=True,
        ),
    )
}
"""Every law by its name, in the order in which they are listed."""

DEFAULT_LAWS = tuple(name for name, row in LAWS.items() if row.ranked)
"""The ladder of damping laws that is ranked where a recipe names none; the first is fitted."""


def laws_for(body: Body, knots: tuple[float, ...] = ()) -> dict[str, DampingLaw]:
    """The laws that a body can have, by name.

    Args:
        body: what is damped.
        knots: ascending circular frequencies of the measured modes, rad/s; without them the laws
            that are made for modes are not among the laws.
    """
    of = Damped(mechanism_names(body), knots)
    made = {name: row.make(of) for name, row in LAWS.items()}
    return {name: law for name, law in made.items() if law is not None}
