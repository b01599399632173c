"""Where the damping of the source paper's bar sits: in its fibres and in shear, which no law of
frequency alone can say.

The third of its five modes is torsion. That strains the matrix more than the fibres, so its damping
lies far above any curve through the bending modes. A law by the shares of strain energy misses no
mode by more than 7 %.

    python -m examples.mechanisms
"""

import numpy as np

from examples.paper.published import (
    TABLE_3_DAMPING,
    TABLE_3_MEASURED_HZ,
    TABLE_4_UPDATED,
    cantilever,
)
from fecore.dynamics.damping_laws import ModalDamping
from fecore.updating.forward import ForwardModel
from fecore.updating.laws import LawRanking, MeasuredRatios, laws_of, rank_laws
from fecore.updating.measurement import Recipe
from fecore.updating.parameters import parametrise


def ranked() -> tuple[LawRanking, np.ndarray]:
    """All laws of the default recipe on the measured ratios, and (5, q) shares of the modes' strain
    energy.
    """
    bar = cantilever(TABLE_4_UPDATED)
    prior = parametrise(bar)
    state = ForwardModel(bar, prior, (), np.zeros((0, 2)), 8).solve(prior.prior_mean)
    omega, strain = 2 * np.pi * TABLE_3_MEASURED_HZ, state.strain[: TABLE_3_MEASURED_HZ.size]
    ratios = MeasuredRatios(omega, TABLE_3_DAMPING, np.zeros((omega.size, omega.size)), strain)
    return (
        rank_laws(
            ratios, list(range(omega.size)), laws_of(Recipe(), ModalDamping(tuple(omega)), bar)
        ),
        strain,
    )


if __name__ == "__main__":
    ranking, _ = ranked()
    for each in ranking.laws:
        found = ", ".join(
            f"{n} {c:.3g}"
            for n, c in zip(each.law.coefficient_names, each.coefficients, strict=True)
        )
        missed = " ".join(f"{100 * miss:+5.1f}" for miss in each.missed)
        print(f"{each.law.name:18s} BIC {each.bic:6.1f}  misses, %: {missed}   {found[:60]}")
