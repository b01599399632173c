"""One material from several tests: the source paper's bar, clamped and hung freely, in one
posterior.

Alone, the cantilever gives Ex = 31 GPa and the free bar 32.3 GPa: the clamp yields a little, and a
model that takes it as rigid calls the material softer. Together they say both: one modulus, and how
much the clamp gives way.

    python -m examples.one_material
"""

import numpy as np

from examples.paper.published import (
    FREE_LENGTH,
    FREE_MEASURED_HZ,
    TABLE_3_MEASURED_HZ,
    TABLE_4_COUPONS,
    material,
)
from fecore.body.specimen import OrientedSpecimen
from fecore.modes import MeasuredModes
from fecore.updating.campaigns import (
    MATERIAL_PARAMETERS,
    Campaign,
    CampaignsRecipe,
    CampaignsResult,
    update_campaigns,
)
from fecore.updating.inputs import Inputs

THICKNESS = 0.01012
"""As the paper prints it, m."""

KNOWN = Inputs(thickness_sd=0, density_sd=0, width_sd=0, fibre_angle_sd=0)
"""The scale of the modulus is what thickness and density make it: as printed. Length and clamp are
the laboratory's.
"""


def paper_bar() -> list[Campaign]:
    """The two campaigns of the paper's bar: one specimen under two boundaries."""
    laminate = material(TABLE_4_COUPONS)

    def campaign(name: str, body: OrientedSpecimen, hz: np.ndarray) -> Campaign:
        return Campaign(
            name, "bar", body, MeasuredModes(hz, np.full(hz.size, np.nan)), inputs=KNOWN
        )

    return [
        campaign(
            "cantilever", OrientedSpecimen(0.5, 0.04, THICKNESS, laminate), TABLE_3_MEASURED_HZ
        ),
        campaign(
            "free",
            OrientedSpecimen(FREE_LENGTH, 0.04, THICKNESS, laminate, "free"),
            FREE_MEASURED_HZ,
        ),
    ]


def show(result: CampaignsResult) -> None:
    """Print the material, each campaign's view of it, and what is its own."""
    print(result.verdict.sentence)
    for p in result.parameters:
        low, high = (value / 1e9 for value in p.interval_95)
        known = "" if p.identifiable else "  (not identifiable)"
        print(
            f"  {p.name:4s} {p.estimate / 1e9:6.2f} GPa, 95 % from {low:.2f} to {high:.2f}{known}"
        )
    for part in result.campaigns:
        alone = part.alone["Ex"]
        print(
            f"  {part.name}: alone Ex {alone.estimate / 1e9:.2f} GPa, z = {alone.z:+.1f}; p ="
            f" {part.predictive_p:.2f}"
        )
        for own in part.own:
            print(
                f"    {own.name} {own.estimate:.4g} ({own.interval_95[0]:.4g} to"
                f" {own.interval_95[1]:.4g}) {own.unit}"
            )
    for warning in result.warnings:
        print("  !", warning)


if __name__ == "__main__":
    show(update_campaigns(paper_bar(), CampaignsRecipe(MATERIAL_PARAMETERS[:5], scatter=0)))
