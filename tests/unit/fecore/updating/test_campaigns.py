"""Several campaigns of one material: what they share, what they show together, and whether they
agree.
"""

from dataclasses import replace

import numpy as np
import pytest

from fecore.body.specimen import OrientedSpecimen, Specimen
from fecore.updating.campaigns import (
    MATERIAL_PARAMETERS,
    Campaign,
    CampaignsRecipe,
    _odd_one_out,
    lay_out,
    update_campaigns,
)
from fecore.updating.elastic import fit_elastic, settled
from fecore.updating.laws import common_damping
from fecore.updating.posterior import SCATTER
from fecore.updating.result import Check, Conflict
from tests.support.fits import at_prior, forward_model
from tests.support.strips import NOMINAL, STRIP, TRUTH, measured, panel


@pytest.fixture(scope="module")
def campaigns() -> list[Campaign]:
    """Three strips."""
    return panel(np.random.default_rng(3), pieces=3)


@pytest.fixture(scope="module")
def two() -> list[Campaign]:
    """Strips along and across."""
    return panel(np.random.default_rng(3), modes=6, pieces=2)


IN_PLANE = tuple(each for each in MATERIAL_PARAMETERS if each.name in ("Ex", "Ey", "Gxy"))


def frequencies(body: Specimen, count: int = 10) -> np.ndarray:
    return at_prior(forward_model(body, count, "Ex", reduced=False)).frequency_hz


def test_a_clamp_that_hardly_yields_is_rigid_and_the_angle_is_a_constant() -> None:
    angle = 0.0
    plain = Specimen(*STRIP, NOMINAL, divisions=(16, 3), fibre_angle=angle)
    firm = OrientedSpecimen(
        *STRIP, NOMINAL, divisions=(16, 3), fibre_angle=angle, clamp_compliance=1e-6
    )
    np.testing.assert_allclose(frequencies(firm), frequencies(plain), rtol=1e-4)
    yielding = replace(firm, clamp_compliance=0.01)
    # A root spring lowers the first mode of a beam by (1 + 2 EI/kL)^-1 in λ to first order: ω falls
    # by some 2 %.
    assert frequencies(yielding)[0] / frequencies(plain)[0] == pytest.approx(0.981, abs=0.004)
    turned = replace(firm, fibre_angle=angle + 0.05)
    there = forward_model(firm, 10, "fibre_angle", reduced=False).solve(np.array([angle + 0.05]))
    exact = replace(turned, clamp_compliance=1e-6 * turned.bending_modulus / firm.bending_modulus)
    np.testing.assert_allclose(there.frequency_hz, frequencies(exact), rtol=1e-7)


def test_one_rule_says_what_is_shared(campaigns: list[Campaign]) -> None:
    held = replace(campaigns[0].body, boundary="cantilever", clamp_compliance=0.005)
    clamped = replace(campaigns[0], name="clamped", body=held)
    layout = lay_out([*campaigns[:2], clamped], MATERIAL_PARAMETERS, SCATTER)
    labels = set(layout.labels)
    assert set(layout.shared) == {"Ex", "Ey", "Gxy", "Gxz", "Gyz", "nu_xy"}
    assert {
        "thickness of specimen strip 0",
        "fibre_angle of specimen strip 90",
        "scatter of Ex of strip 0",
    } <= labels
    assert {
        "length of campaign strip 0",
        "length of campaign clamped",
        "clamp_compliance of campaign clamped",
    } <= labels
    assert "thickness of specimen clamped" not in labels  # the same strip, clamped
    assert "scatter of nu_xy of strip 0" not in labels
    # One specimen in two campaigns moves with one thickness.
    x = np.zeros(len(layout.labels))
    x[layout.labels.index("thickness of specimen strip 0")] = 0.01
    ratios = [
        campaign.theta(x)[campaign.forward.parametrisation.names.index("thickness")] / STRIP[2]
        for campaign in layout.campaigns
    ]
    assert ratios == pytest.approx([np.exp(0.01), 1.0, np.exp(0.01)])


def test_strips_along_and_across_tell_what_none_tells_alone(two: list[Campaign]) -> None:
    """Intervals hold the truth, and specimens that scatter and their angles widen them."""
    together = update_campaigns(two)
    found = {p.name: p for p in together.parameters}
    for name in ("Ey", "Gxy"):
        assert found[name].standard_deviation / found[name].prior_sd < 0.3, name  # type: ignore[operator]
    held = [p.interval_95[0] <= TRUTH[name] <= p.interval_95[1] for name, p in found.items()]
    assert sum(held) >= 5
    assert together.odd_one_out is None
    sources = {entry.source for p in together.parameters for entry in p.budget}
    assert {"scatter between specimens", "fibre_angle"} <= sources


@pytest.mark.long
@pytest.mark.parametrize("strips", [2, 3])
def test_strips_and_a_plate_tell_what_none_tells_alone(strips: int) -> None:
    """What a joint update is for: intervals of the moduli that are less than a third of the
    priors', and hold the truth; in short of strips, above.
    """
    campaigns = panel(np.random.default_rng(3))
    together = update_campaigns([*campaigns[:strips], campaigns[3]])
    found = {p.name: p for p in together.parameters}
    for name in ("Ey", "Gxy", "nu_xy", "Gxz"):
        assert found[name].prior_sd is not None
        assert found[name].standard_deviation / found[name].prior_sd < 0.3, name
        assert found[name].identifiable, name
    held = [p.interval_95[0] <= TRUTH[name] <= p.interval_95[1] for name, p in found.items()]
    assert sum(held) >= 5
    alone = {part.name: part.alone for part in together.campaigns}
    assert alone["strip 0"]["Ey"].standard_deviation > 0.9 * found["Ey"].prior_sd  # type: ignore[operator]
    assert together.odd_one_out is None
    assert not any(part.contradicts for part in together.campaigns)
    assert together.verdict.level == "usable"
    for parameter in together.parameters:
        assert sum(entry.share for entry in parameter.budget) == pytest.approx(1.0, abs=0.05)


@pytest.mark.long
def test_the_odd_one_out_is_named_with_a_number(two: list[Campaign]) -> None:
    """A campaign of another material is the likeliest of all causes of a contradiction. In short
    the one campaign of all causes is the odd one, below.
    """
    other = {**TRUTH, "Ex": 0.75 * TRUTH["Ex"], "Ey": 1.3 * TRUTH["Ey"], "Gxy": 1.3 * TRUTH["Gxy"]}
    stranger = measured(np.random.default_rng(8), "strip 45", STRIP, 45.0, truth=other, modes=6)
    result = update_campaigns([two[1], stranger, two[0]])
    assert result.odd_one_out == "strip 45"
    (part,) = [part for part in result.campaigns if part.name == "strip 45"]
    assert part.contradicts
    assert part.predictive_p is not None
    assert part.predictive_p < 1e-3
    assert result.verdict.level == "do_not_use"
    assert "campaign strip 45 as one of another material" in result.verdict.reasons[0]


def test_one_campaign_to_which_all_causes_belong_is_the_odd_one(two: list[Campaign]) -> None:
    cause, rival, other = (
        Check("input", "length", 0.0, 9.0, owner)
        for owner in ("campaign strip 90", "specimen strip 90", "campaign strip 0")
    )
    assert _odd_one_out([], two) is None
    assert _odd_one_out([Conflict(cause, (rival,), (), 3.0)], two) == "strip 90"
    assert _odd_one_out([Conflict(cause, (other,), (), 3.0)], two) is None


@pytest.mark.long
def test_scatter_between_specimens_widens(two: list[Campaign]) -> None:
    """In short it is in the budget of strips, above."""
    one_material = update_campaigns(two, CampaignsRecipe(IN_PLANE, scatter=0))
    scattering = update_campaigns(two, CampaignsRecipe(IN_PLANE, scatter=0.05))
    firm, loose = ({p.name: p for p in r.parameters}["Ex"] for r in (one_material, scattering))
    assert one_material.discrepancy.scatter is None
    assert scattering.discrepancy.scatter is not None
    assert loose.standard_deviation > 1.2 * firm.standard_deviation
    assert any(entry.source == "scatter between specimens" for entry in loose.budget)


def test_one_damping_law_of_the_material_explains_all_campaigns(campaigns: list[Campaign]) -> None:
    """Loss factors of tension and shear come back within 5 % from ratios with 1 % noise, and win
    against Rayleigh's law.
    """
    eta_E, eta_G, a0, random = 0.012, 0.035, 4.0, np.random.default_rng(5)
    fitted = settled(fit_elastic(lay_out(campaigns[1:3], MATERIAL_PARAMETERS, 0.0)))
    damped = []
    for campaign, state, pairing in zip(
        fitted.layout.campaigns, fitted.states, fitted.pairings, strict=True
    ):
        ratio = np.full(len(campaign.modes), np.nan)
        for row, column in pairing.pairs:
            share = state.strain[state.modes.rigid + column]
            omega = 2 * np.pi * campaign.modes.frequency_hz[row]
            ratio[row] = (a0 / omega + eta_E * share[:2].sum() + eta_G * share[2:].sum()) / 2
        modes = replace(
            campaign.modes,
            damping_ratio=ratio * (1 + 0.01 * random.standard_normal(ratio.size)),
            covariance=None,
        )
        damped.append(replace(campaign, modes=modes))
    laws = {
        law.name: law
        for law in common_damping(
            replace(fitted, layout=replace(fitted.layout, campaigns=tuple(damped)))
        )
    }
    assert laws["mechanism"].preferred
    assert laws["mechanism"].bic < laws["rayleigh"].bic - 10
    assert laws["mechanism"].coefficients["eta_E"] == pytest.approx(eta_E, rel=0.05)
    assert laws["mechanism"].coefficients["eta_G"] == pytest.approx(eta_G, rel=0.05)
    assert set(laws["rayleigh"].missed_by) == {campaign.name for campaign in damped}
