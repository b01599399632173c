"""Which source of a joint update is wrong: a free strip, another body and a coupon batch, with one
error at a time or none.

The truth is the stored bars of another code's solid elements (`blind-open` beside the project, or
MODALBASE_SOLIDS), carried to each body's drawn dimensions by the ratio of two of our models, with
the frequencies' noise. No plate is stored: each of its frequencies is off a finer mesh's by .05 %.
The other body, b, is a free strip, a cantilever in a vice, or a free plate. Every input is drawn
from a careful laboratory's errors, the moduli of each strip, of the coupons' panel and of each
coupon from a scatter of 2 %. The effect of an error is how far it moves a modulus at most, in
standard deviations stated without it.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.tables import Table, beside
from fecore.arrays import FloatArray
from fecore.body.constants import Parameter
from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import OrientedSpecimen
from fecore.body.supports import PointMass
from fecore.coupons.batch import Statistics, prior
from fecore.frf import along_z
from fecore.quantities import CLAMP
from fecore.updating.campaigns import Campaign, CampaignsResult, update_campaigns
from fecore.updating.forward import ForwardModel, ForwardState
from fecore.updating.inputs import Inputs
from fecore.updating.layout import Coupon
from fecore.updating.parameters import parametrise
from tests.support.draws import modes_at

SOLIDS = Path(__file__).parents[2] / "shared" / "blind-open"
MODULI = ("Ex", "Ey", "Gxy", "Gxz", "Gyz")
MODES, NOISE, SCATTER, COUPONS, THEORY = 7, 3e-4, 0.02, 5, 5e-4
DRAWN = ("length", "width", "thickness", "density", "fibre_angle")


@dataclass(frozen=True)
class Cut:
    """A body cut from the material: its length and width, how it stands, and the stored bar of
    solids that it is like.
    """

    length: float
    width: float = 0.04
    boundary: str = "free"
    solids: str = "free-1pct"


A = Cut(0.501)
OTHERS = {
    "strip": Cut(0.45),
    "cantilever": Cut(0.5, boundary="cantilever", solids="cantilever-1pct"),
    "plate": Cut(0.3, 0.2, solids=""),
}


@dataclass(frozen=True)
class Error:
    """What a laboratory got wrong: of coupons by a factor, of body b's inputs by so much, a mass on
    it, a clamp's EI/kL.
    """

    culprit: str = ""
    other: str = "strip"
    coupons: float = 1.0
    inputs: Mapping[str, float] | None = None
    mass: float = 0.0
    clamp: float | None = None


ERRORS = {
    "none": Error(),
    "coupons +6 %": Error("coupons", coupons=1.06),
    "coupons +12 %": Error("coupons", coupons=1.12),
    "coupons +15 %": Error("coupons", coupons=1.15),
    "coupons +30 %": Error("coupons", coupons=1.30),
    "length -2.5 mm": Error("length of campaign b", inputs={"length": -0.0025}),
    "length -27 mm": Error("length of campaign b", inputs={"length": -0.027}),
    "width -8 mm": Error("width of specimen b", inputs={"width": -0.008}),
    "thickness -8 %": Error("thickness of specimen b", inputs={"thickness": -0.0008}),
    "density +20 %": Error("density of specimen b", inputs={"density": 400.0}),
    "angle 4°": Error("fibre_angle of specimen b", inputs={"fibre_angle": float(np.radians(4.0))}),
    "angle 12°": Error(
        "fibre_angle of specimen b", inputs={"fibre_angle": float(np.radians(12.0))}
    ),
    "mass 5 g": Error("mass on campaign b", mass=0.005),
    "mass 30 g": Error("mass on campaign b", mass=0.030),
    "cantilever": Error(other="cantilever"),
    "cantilever, coupons +15 %": Error("coupons", "cantilever", coupons=1.15),
    "cantilever, length -27 mm": Error(
        "length of campaign b", "cantilever", inputs={"length": -0.027}
    ),
    "cantilever, EI/kL .08": Error("clamp_compliance of campaign b", "cantilever", clamp=0.08),
    "cantilever, mass 5 g": Error("mass on campaign b", "cantilever", mass=0.005),
    "plate": Error(other="plate"),
    "plate, coupons +15 %": Error("coupons", "plate", coupons=1.15),
    "plate, thickness -8 %": Error(
        "thickness of specimen b", "plate", inputs={"thickness": -0.0008}
    ),
    "plate, length -12 mm": Error("length of campaign b", "plate", inputs={"length": -0.012}),
    "plate, mass 30 g": Error("mass on campaign b", "plate", mass=0.030),
}


def contradictions(draws: int = 6, seed: int = 36, *errors: str) -> list[str]:
    """The wrong source of a joint update: its effect, how often it is named, first, and what usable
    results are off.

    Words choose the errors whose names hold one of them, as `mass`.
    """
    folder = Path(os.environ.get("MODALBASE_SOLIDS", SOLIDS))
    if not folder.exists():
        print(f"  ({folder.name} is not there: no solids)")
        return []
    stored = {
        cut.solids: _Stored.of(folder, cut.solids) for cut in (A, *OTHERS.values()) if cut.solids
    }
    table = Table("", "error:26", "effect:.1f", "named:d", "first:d", "some conflict:d", "usable beyond 3 sd:d",
                  "held:d", "of 95 % intervals:d")  # fmt: skip
    right = dict[str, list[CampaignsResult]]()
    for name, error in ERRORS.items():
        if errors and error.culprit and not any(word in name for word in errors):
            continue
        results = [
            _updated(stored, error, np.random.default_rng([seed, number]))
            for number in range(draws)
        ]
        without = right.setdefault(error.other, results)
        effect = np.median([_moved(*each) for each in zip(results, without, strict=True)])
        table.row(name, effect, *_row(results, error, stored[A.solids].config))
    return []


@dataclass(frozen=True)
class _Stored:
    """A stored bar of solids: its stated numbers and the frequencies of its modes out of the plane,
    Hz.
    """

    config: Mapping[str, float]
    hz: FloatArray

    @classmethod
    def of(cls, folder: Path, name: str) -> _Stored:
        truth = json.loads((folder / f"{name}.truth.json").read_text())
        hz = [
            each["f_hz"] for each in truth["modes"] if each["out_of_plane"] and each["f_hz"] > 1.0
        ]
        return cls(truth["config"], np.array(hz[:MODES]))


def _moved(wrong: CampaignsResult, right: CampaignsResult) -> float:
    """How far an error moves a modulus at most, in the standard deviations stated without it."""
    pairs = zip(wrong.parameters, right.parameters, strict=True)
    return max(
        abs(a.estimate - b.estimate) / b.standard_deviation for a, b in pairs if a.name in MODULI
    )


def _row(
    results: list[CampaignsResult], error: Error, true: Mapping[str, float]
) -> tuple[int, ...]:
    """How often it is named, first, and there is some conflict; usable ones beyond 3 sd; intervals
    that hold, of so many.
    """
    causes = [
        [each.name for c in result.conflicts for each in (c.cause, *c.rivals)] for result in results
    ]
    first = [result.conflicts[0].cause.name if result.conflicts else "" for result in results]
    offs = [
        beside(result.parameters, {name: true[name] for name in MODULI}).values()
        for result in results
    ]
    far = [max(abs(off.z) for off in each) > 3 for each in offs]
    usable = sum(r.verdict.level == "usable" and away for r, away in zip(results, far, strict=True))
    named = sum(error.culprit in each for each in causes) if error.culprit else 0
    held = [off.held for each in offs for off in each]
    firsts = sum(error.culprit == each for each in first if each)
    return named, firsts, sum(map(bool, causes)), usable, sum(held), len(held)


def _updated(
    stored: Mapping[str, _Stored], error: Error, random: np.random.Generator
) -> CampaignsResult:
    config = stored[A.solids].config
    guess = {name: config[name] * (1 + 0.1 * random.standard_normal()) for name in MODULI}
    stated = OrthotropicMaterial(**guess, nu_xy=0.15, density=config["rho"])
    bodies = {"a": (A, Error()), "b": (OTHERS[error.other], error)}
    campaigns = [
        _campaign(name, cut, stated, stored, own, random) for name, (cut, own) in bodies.items()
    ]
    return update_campaigns(
        campaigns, coupons=[_batch(n, error.coupons * config[n], random) for n in ("Ex", "Gxy")]
    )


def _batch(name: str, value: float, random: np.random.Generator) -> Coupon:
    """What pieces of a panel say of a constant."""
    pieces = (
        value
        * (1 + SCATTER * random.standard_normal())
        * (1 + SCATTER * random.standard_normal(COUPONS))
    )
    said = prior(Statistics(COUPONS, float(pieces.mean()), float(pieces.std(ddof=1))))
    return Coupon(name, said.mean, said.standard_deviation, "coupons", COUPONS)


def _campaign(
    name: str,
    cut: Cut,
    material: OrthotropicMaterial,
    stored: Mapping[str, _Stored],
    error: Error,
    random: np.random.Generator,
) -> Campaign:
    """A body as it is stated, with the modes of the body that was measured."""
    config, inputs = stored[A.solids].config, Inputs()
    stated = OrientedSpecimen(cut.length, cut.width, config["t"], material, cut.boundary)  # type: ignore[arg-type]
    true = {**stated.nominal, "nu_xy": config["nuxy"]}
    true |= {key: config[key] * (1 + SCATTER * random.standard_normal()) for key in MODULI}
    for key in DRAWN:
        true[key] += inputs.standard_deviation(key, stated.nominal[key]) * random.standard_normal()
    wrong = error.inputs or {}
    shares = np.array([(u, v) for u in np.linspace(0.02, 0.98, 11) for v in (-0.45, 0.0, 0.45)])
    body = replace(stated, divisions=(24, 16) if cut.width > 0.1 else (32, 4))
    if cut.boundary == "cantilever":
        compliance = abs(inputs.standard_deviation("clamp_compliance") * random.standard_normal())
        true[CLAMP] = compliance if error.clamp is None else error.clamp
    near_the_end = PointMass(
        (0.98 if cut.boundary == "cantilever" else 0.02) * cut.length, 0.0, error.mass
    )
    measured = _solved(replace(body, masses=(near_the_end,)) if error.mass else body, true, shares)
    hz = measured.frequency_hz[:MODES] * (1 + NOISE * random.standard_normal(MODES))
    if cut.solids:
        hz *= _missed_by_theory(stored[cut.solids], cut, material, shares)
    else:
        hz *= 1 + THEORY * random.standard_normal(MODES)
    order = np.argsort(hz)
    stated = replace(
        stated,
        length=stated.length + wrong.get("length", 0.0),
        width=stated.width + wrong.get("width", 0.0),
        thickness=stated.thickness + wrong.get("thickness", 0.0),
        fibre_angle=wrong.get("fibre_angle", 0.0),
        material=replace(material, density=material.density + wrong.get("density", 0.0)),
    )
    points = {
        n: (float(u * stated.length), float(v * stated.width), 0.0)
        for n, (u, v) in enumerate(shares, start=1)
    }
    modes = modes_at(points, hz[order], measured.shapes[:MODES][order], NOISE)
    return Campaign(name, name, stated, modes, points, inputs)


def _missed_by_theory(
    bar: _Stored, cut: Cut, material: OrthotropicMaterial, shares: FloatArray
) -> FloatArray:
    """What solids are beside our model of the stored bar, mode by mode."""
    config = bar.config
    body = OrientedSpecimen(
        config["L"], config["b"], config["t"], material, cut.boundary, divisions=(32, 4)
    )  # type: ignore[arg-type]
    constants = {**body.nominal, "nu_xy": config["nuxy"], "density": config["rho"]} | {
        n: config[n] for n in MODULI
    }
    return np.asarray(bar.hz / _solved(body, constants, shares).frequency_hz[:MODES])


def _solved(
    body: OrientedSpecimen, constants: Mapping[str, float], shares: FloatArray
) -> ForwardState:
    if CLAMP in constants:
        body = replace(body, clamp_compliance=constants[CLAMP])
    prior = parametrise(
        body, [Parameter(key, prior_mean=value) for key, value in constants.items()]
    )
    places = shares * [body.length, body.width]
    labels = tuple(range(1, len(shares) + 1))
    return ForwardModel(body, prior, along_z(labels), places, MODES + 4, reduced=False).solve(
        prior.prior_mean
    )
