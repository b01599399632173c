"""The damping laws of a recipe by their names.

`generalised` turns in the middle of the measured modes, `modal` has them as its knots; the laws by mechanism group the elastic
constants of the body: its moduli E of fibre and matrix in tension, and its shear moduli G.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fecore.body.mechanisms import SUPPORTS, mechanism_names
from fecore.body.specimen import Body, kind_of
from fecore.dynamics.damping_laws import RAYLEIGH, CaugheySeries, DampingLaw, GeneralisedProportional, ModalDamping
from fecore.dynamics.mechanism_laws import MechanismDamping
from fecore.errors import InputError
from fecore.updating.recipe import Recipe

FREQUENCY_LAWS: Mapping[str, DampingLaw] = {
    "rayleigh": RAYLEIGH,
    "caughey3": CaugheySeries("caughey3", (0, 1, 2)),
    "caughey4": CaugheySeries("caughey4", (0, 1, 2, 3)),
}
"""Laws that depend on nothing but frequency."""


def mechanism_laws(body: Body) -> dict[str, MechanismDamping]:
    """The laws by mechanism of a body, by name.

    | name | coefficients |
    |---|---|
    | `mechanism` | a0, eta_E of tension and bending, eta_G of in-plane and transverse shear |
    | `mechanism_viscous` | a0, b_E, b_G: viscous rates in their place |
    | `mechanism_constants` | a0 and a loss factor for each modulus, one for both transverse shear moduli |
    | `mechanism_support` | `mechanism` with eta_support of the springs, where the body stands on any |
    | `loss_factor` | eta of the whole strain energy: the same ratio η/2 at every frequency |
    """
    names = mechanism_names(body)

    def columns(*first: str) -> tuple[int, ...]:
        return tuple(place for place, name in enumerate(names) if name.startswith(first))

    two = (("E", columns("E")), ("G", columns("G")))
    elastic = columns("E", "G")
    transverse = tuple(place for place in elastic if kind_of(names[place]) in ("Gxz", "Gyz", "G13", "G23"))
    single = tuple((names[place], (place,)) for place in elastic if place not in transverse)
    each = (*single, (names[transverse[0]], transverse)) if transverse else single
    laws = [
        MechanismDamping("mechanism", two),
        MechanismDamping("mechanism_viscous", two, viscous=True),
        MechanismDamping("mechanism_constants", each),
        MechanismDamping("loss_factor", (("", elastic),), mass=False),
    ]
    if SUPPORTS in names:
        laws.append(MechanismDamping("mechanism_support", (*two, ("support", (names.index(SUPPORTS),)))))
    return {law.name: law for law in laws}


def laws_of(recipe: Recipe, modal: ModalDamping, body: Body) -> tuple[DampingLaw, ...]:
    """A recipe's laws in its order.

    Args:
        recipe: names them.
        modal: a ratio of its own for each measured mode.
        body: what is damped.

    Raises:
        InputError: a name is not that of a law that this body can have, or there is none.
    """
    if not recipe.damping_models:
        raise InputError("damping_models", "is empty, expected at least one")
    middle = float(np.exp(np.mean(np.log(modal.knots))))
    generalised = GeneralisedProportional(("constant", "root", "stiffness"), middle)
    known: dict[str, DampingLaw] = {
        **FREQUENCY_LAWS,
        **mechanism_laws(body),
        generalised.name: generalised,
        modal.name: modal,
    }
    for index, name in enumerate(recipe.damping_models):
        if name == "mechanism_support" and name not in known:
            raise InputError(
                f"damping_models.{index}", f"is {name!r}, but the specimen stands on no springs; state some"
            )
        if name not in known:
            raise InputError(f"damping_models.{index}", f"is {name!r}, expected one of {', '.join(known)}")
    return tuple(known[name] for name in recipe.damping_models)
