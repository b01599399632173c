"""Which source of a joint update is wrong: two strips and a coupon batch, with one error at a time or none.

The truth is the stored free bar of another code's solid elements (`blind-open/free-1pct.truth.json` beside the project, or
MODALBASE_SOLIDS), carried to each strip's drawn dimensions by the ratio of two of our models, with the frequencies' noise.
Every input is drawn from a careful laboratory's errors, the moduli of each strip, of the coupons' panel and of each coupon
from a scatter of 2 %. The effect of an error is how far it moves a modulus at most, in standard deviations stated without it.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import OrientedSpecimen
from fecore.frf import Dof, along_z
from fecore.modes import MeasuredModes
from fecore.updating.campaigns import Campaign, CampaignsResult, update_campaigns
from fecore.updating.forward import ForwardModel, ForwardState
from fecore.updating.inputs import Inputs
from fecore.updating.layout import Coupon
from fecore.updating.parameters import Parameter, parametrise

SOLIDS = Path(__file__).parents[2] / "shared" / "blind-open" / "free-1pct.truth.json"
MODULI = ("Ex", "Ey", "Gxy", "Gxz", "Gyz")
LENGTHS = {"a": 0.501, "b": 0.45}
MODES, NOISE, SCATTER, COUPONS = 7, 3e-4, 0.02, 5
DRAWN = ("length", "width", "thickness", "density", "fibre_angle")


@dataclass(frozen=True)
class Error:
    """What a laboratory got wrong: of coupons by a factor, of strip b's inputs by so much, of its frequencies by a factor."""

    culprit: str = ""
    coupons: float = 1.0
    inputs: Mapping[str, float] | None = None
    mass: float = 0.0


ERRORS = {
    "none": Error(),
    "coupons +6 %": Error("coupons", coupons=1.06),
    "coupons +15 %": Error("coupons", coupons=1.15),
    "coupons +30 %": Error("coupons", coupons=1.30),
    "length -2.5 mm": Error("length of campaign b", inputs={"length": -0.0025}),
    "length -27 mm": Error("length of campaign b", inputs={"length": -0.027}),
    "width -8 mm": Error("width of specimen b", inputs={"width": -0.008}),
    "thickness -8 %": Error("thickness of specimen b", inputs={"thickness": -0.0008}),
    "density +20 %": Error("density of specimen b", inputs={"density": 400.0}),
    "angle 4°": Error("fibre_angle of specimen b", inputs={"fibre_angle": float(np.radians(4.0))}),
    "angle 12°": Error("fibre_angle of specimen b", inputs={"fibre_angle": float(np.radians(12.0))}),
    "mass 5 g": Error("campaign b", mass=0.005),
    "mass 30 g": Error("campaign b", mass=0.030),
}


def contradictions(draws: int = 6, seed: int = 36) -> list[str]:
    """Print, for each error: its effect, how often it is named, first, and how far off the constants of usable results are."""
    path = Path(os.environ.get("MODALBASE_SOLIDS", SOLIDS))
    if not path.exists():
        print(f"  ({path.name} is not there: no solids)")
        return []
    truth = json.loads(path.read_text())
    print("  error           effect  named  first  some conflict  usable beyond 3 sd  held of 95 % intervals")
    right = list[CampaignsResult]()
    for name, error in ERRORS.items():
        results = [_updated(truth, error, np.random.default_rng([seed, number])) for number in range(draws)]
        right = right or results
        effect = np.median([_moved(*each) for each in zip(results, right, strict=True)])
        print(f"  {name:15} {effect:6.1f}  {_row(results, error, truth['config'])}", flush=True)
    return []


def _moved(wrong: CampaignsResult, right: CampaignsResult) -> float:
    """How far an error moves a modulus at most, in the standard deviations stated without it."""
    pairs = zip(wrong.parameters, right.parameters, strict=True)
    return max(abs(a.estimate - b.estimate) / b.standard_deviation for a, b in pairs if a.name in MODULI)


def _row(results: list[CampaignsResult], error: Error, true: Mapping[str, float]) -> str:
    causes = [[each.name for c in result.conflicts for each in (c.cause, *c.rivals)] for result in results]
    first = [result.conflicts[0].cause.name if result.conflicts else "" for result in results]
    off = [
        [(p.estimate - true[p.name]) / p.standard_deviation for p in r.parameters if p.name in MODULI] for r in results
    ]
    held = [
        [p.interval_95[0] <= true[p.name] <= p.interval_95[1] for p in r.parameters if p.name in MODULI]
        for r in results
    ]
    usable = sum(r.verdict.level == "usable" and np.abs(o).max() > 3 for r, o in zip(results, off, strict=True))
    named = sum(error.culprit in each for each in causes) if error.culprit else 0
    counts = (named, sum(error.culprit == each for each in first if each), sum(map(bool, causes)), usable)
    return "  ".join(f"{count:5}" for count in counts) + f"  {np.sum(held):5} of {np.size(held)}"


def _updated(truth: Mapping[str, object], error: Error, random: np.random.Generator) -> CampaignsResult:
    config: Mapping[str, float] = truth["config"]  # type: ignore[assignment]
    modes: list[dict[str, float]] = truth["modes"]  # type: ignore[assignment]
    solids = np.array([each["f_hz"] for each in modes if each["out_of_plane"] and each["f_hz"] > 1.0])[:MODES]
    guess = {name: config[name] * (1 + 0.1 * random.standard_normal()) for name in MODULI}
    stated = OrthotropicMaterial(**guess, nu_xy=0.15, density=config["rho"])
    campaigns = [_campaign(name, stated, config, solids, error if name == "b" else Error(), random) for name in LENGTHS]
    sd = SCATTER / np.sqrt(COUPONS + 1)
    off = np.hypot(SCATTER, sd)  # of a panel, and of the mean of its coupons
    batch = [
        Coupon(name, error.coupons * config[name] * (1 + off * random.standard_normal()), sd * config[name])
        for name in ("Ex", "Gxy")
    ]
    return update_campaigns(campaigns, coupons=batch)


def _campaign(
    name: str,
    material: OrthotropicMaterial,
    config: Mapping[str, float],
    solids: FloatArray,
    error: Error,
    random: np.random.Generator,
) -> Campaign:
    """A strip as it is stated, with the modes of the strip that was measured."""
    stated, inputs = OrientedSpecimen(LENGTHS[name], config["b"], config["t"], material, "free"), Inputs()
    true = {**stated.nominal, "nu_xy": config["nuxy"]}
    true |= {key: config[key] * (1 + SCATTER * random.standard_normal()) for key in MODULI}
    for key in DRAWN:
        true[key] += inputs.standard_deviation(key, stated.nominal[key]) * random.standard_normal()
    wrong = error.inputs or {}
    stated = replace(
        stated,
        length=stated.length + wrong.get("length", 0.0),
        width=stated.width + wrong.get("width", 0.0),
        thickness=stated.thickness + wrong.get("thickness", 0.0),
        fibre_angle=wrong.get("fibre_angle", 0.0),
        material=replace(material, density=material.density + wrong.get("density", 0.0)),
    )
    shares = np.array([(u, v) for u in np.linspace(0.02, 0.98, 11) for v in (-0.45, 0.0, 0.45)])
    body = OrientedSpecimen(LENGTHS[name], config["b"], config["t"], material, "free", divisions=(32, 4))
    measured = _solved(body, true, shares)
    stored = {**body.nominal, "length": config["L"], "nu_xy": config["nuxy"]} | {key: config[key] for key in MODULI}
    hz = solids * measured.frequency_hz[:MODES] / _solved(body, stored, shares).frequency_hz[:MODES]
    tip = measured.shapes[:MODES, 1] ** 2
    hz = hz * (1 - error.mass * tip / 2) * (1 + NOISE * random.standard_normal(MODES))
    order = np.argsort(hz)
    covariance = np.diag(np.concatenate([(NOISE * hz[order]) ** 2, np.full(MODES, 1e-8)]))
    points = {n: (float(u * stated.length), float(v * stated.width), 0.0) for n, (u, v) in enumerate(shares, start=1)}
    shapes, dofs = measured.shapes[:MODES][order] + 0j, tuple(Dof(point, 3) for point in points)
    modes = MeasuredModes(hz[order], np.full(MODES, 0.01), shapes, dofs, covariance)
    return Campaign(name, name, stated, modes, points, inputs)


def _solved(body: OrientedSpecimen, constants: Mapping[str, float], shares: FloatArray) -> ForwardState:
    prior = parametrise(body, [Parameter(key, prior_mean=value) for key, value in constants.items()])
    places = shares * [body.length, body.width]
    labels = tuple(range(1, len(shares) + 1))
    return ForwardModel(body, prior, along_z(labels), places, MODES + 4, reduced=False).solve(prior.prior_mean)
