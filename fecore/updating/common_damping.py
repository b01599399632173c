"""One damping law of a material over several campaigns.

Loss factors belong to the material as its moduli do, so the damping ratios of all campaigns' modes are explained together, each
by the shares of strain energy that its own body has at the common estimate:

    ζ_ck = ½ (a₀/ω_ck + Σ_m η_m U_ckm)      with the same a₀ and η_m in every campaign c.

A strip at 90° and one at 45° damp where a strip at 0° has no energy, so mechanisms are kept apart that one specimen shows as
one. Ratios are ranked as in `law_ranking`, so that the law by mechanism has to win against those of frequency alone. How far
each campaign is off the common law is the root mean square of its own misses: a suspension or a clamp that damps shows there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from fecore.updating.elastic_result import ElasticResult
from fecore.updating.law_ranking import identifiable_laws, rank_laws
from fecore.updating.laws import FREQUENCY_LAWS, mechanism_laws
from fecore.updating.measured_ratios import MeasuredRatios, paired_ratios
from fecore.updating.parameters import by_name

_BY_MECHANISM = ("mechanism", "mechanism_viscous", "mechanism_constants", "loss_factor")


@dataclass(frozen=True)
class CommonLaw:
    """A damping law with one set of coefficients for all campaigns.

    Attributes:
        name: of the law.
        coefficients, standard_deviations: by name; a0 in 1/s, loss factors without unit, viscous rates in s.
        bic: infinite where the law cannot be.
        preferred: whether no other law has a lower BIC.
        missed_by: root mean square of the relative misses of each campaign's ratios, by its name.
    """

    name: str
    coefficients: dict[str, float]
    standard_deviations: dict[str, float]
    bic: float
    preferred: bool
    missed_by: dict[str, float]


def common_damping(elastic: ElasticResult) -> tuple[CommonLaw, ...]:
    """The laws that the paired modes of all campaigns can determine, ranked; none where no mode has a damping ratio."""
    seen = zip(elastic.layout.campaigns, elastic.states, elastic.pairings, strict=True)
    parts = [paired_ratios(campaign.modes, state, pairing)[1] for campaign, state, pairing in seen]
    damped = [(number, part) for number, part in enumerate(parts) if part.ratio.size]
    if not damped:
        return ()
    shares = [part.strain for _, part in damped if part.strain is not None]
    together = MeasuredRatios(
        np.concatenate([part.omega for _, part in damped]),
        np.concatenate([part.ratio for _, part in damped]),
        scipy.linalg.block_diag(*(part.relative_covariance for _, part in damped)),
        np.vstack(shares),
    )
    by_mechanism = mechanism_laws(elastic.layout.campaigns[damped[0][0]].forward.specimen)
    laws = identifiable_laws(
        together.ratio.size, [*FREQUENCY_LAWS.values(), *(by_mechanism[name] for name in _BY_MECHANISM)]
    )
    ranking = rank_laws(together, list(range(together.ratio.size)), laws)
    ends = np.cumsum([part.ratio.size for _, part in damped])[:-1]
    names = [elastic.layout.campaigns[number].name for number, _ in damped]
    found = []
    for ranked in ranking.laws:
        misses = np.split(ranked.missed, ends)
        coefficients, sds = ranked.coefficients, np.sqrt(np.diag(ranked.covariance))
        found.append(
            CommonLaw(
                name=ranked.law.name,
                coefficients=by_name(ranked.law.coefficient_names, coefficients),
                standard_deviations=by_name(ranked.law.coefficient_names, sds),
                bic=ranked.bic,
                preferred=ranked is ranking.preferred and bool(np.isfinite(ranked.bic)),
                missed_by={name: float(np.sqrt(np.mean(miss**2))) for name, miss in zip(names, misses, strict=True)},
            )
        )
    return tuple(found)
