"""Measurements and what is made of them that the core refuses: each a call, and how the
`InputError` begins that ends it.
"""

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any, cast

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.constants import Parameter
from fecore.body.generators import Piece
from fecore.body.laminate import Ply
from fecore.body.model import observed_at
from fecore.body.specimen import OrientedSpecimen, Specimen
from fecore.body.supports import PointMass, Spring
from fecore.correlation import mac
from fecore.coupons import d3039, d3518
from fecore.coupons.batch import CouponResult, Statistics, prior, statistics
from fecore.coupons.curves import Curve, chord
from fecore.frf import Dof, FrfSet, along_z
from fecore.modal import Options, identify, shapes_at_poles
from fecore.modes import MeasuredModes
from fecore.signal import Block, Hit, Processing, Strip, process
from fecore.signal.estimators import check_estimator
from fecore.signal.recording import survey
from fecore.signal.windows import Windows, remove_window
from fecore.trend.baseline import fit_baseline
from fecore.trend.change import ChangePoint, rate_since_onset
from fecore.trend.series import Series
from fecore.updating.forward import ForwardModel
from fecore.updating.inputs import Inputs
from fecore.updating.measurement import Measurement, Recipe, prepare
from fecore.updating.parameters import parametrise
from fecore.updating.plans import plan_tests
from tests.support.beams import PAPER_HZ, PAPER_ZETA, paper_frfs
from tests.support.fits import update_elastic
from tests.support.plates import PAPER

LINES, LONG = np.arange(4.0), np.arange(512)
Z = Dof(1, 3)


def frfs(**wrong: Any) -> FrfSet:
    right = {
        "frequency_hz": LINES,
        "values": np.ones((1, 4), complex),
        "responses": (Z,),
        "references": (Z,),
    }
    return FrfSet(**{**right, **wrong})


def modes(**wrong: Any) -> MeasuredModes:
    return MeasuredModes(
        **{"frequency_hz": np.array([1.0, 2]), "damping_ratio": np.zeros(2), **wrong}
    )


def block(**wrong: Any) -> Block:
    made = np.zeros(512)
    made[100:110] = np.hanning(12)[1:-1]
    return Block(**{"dof": Z, "quantity": "force", "samples": made, **wrong})


def hit(
    force: dict[str, Any] | None = None, quantity: str = "acceleration", **response: Any
) -> Hit:
    return Hit(block(**(force or {})), (block(quantity=quantity, **response),), 1000.0)


def silent(samples: int) -> Hit:
    return hit({"samples": np.zeros(samples)}, samples=np.zeros(samples))


def at_poles(hz: Any, zeta: Any, **choices: Any) -> object:
    return shapes_at_poles(paper_frfs(0.0), np.array(hz), np.array(zeta), **choices)


def curve(**wrong: Any) -> Curve:
    strain = np.linspace(0, 8e-3, 200)
    right = {"force_n": 1e6 * strain, "strain": strain, "transverse_strain": -0.3 * strain}
    return Curve(**{**right, **wrong})


def of_series(**wrong: Any) -> Series:
    dates = [datetime(2026, 1, day, tzinfo=UTC) for day in range(1, 7)]
    return Series(
        **{
            "name": "Ex",
            "dates": dates,
            "estimate": np.ones(6),
            "standard_deviation": np.ones(6),
            **wrong,
        }
    )


FALLING = np.interp(np.linspace(0, 8e-3, 200), [0, 0.9e-3, 4.8e-3, 8e-3], [0, 5, 4, 10])
STRIP = Specimen(0.5, 0.05, 0.01, PAPER)
LOST = np.r_[np.full(1, 0.0), np.full(199, np.nan)]
WIDTH = [0.025]

# fmt: off
MEASUREMENTS: list[tuple[Callable[[], object], str]] = [
    (lambda: Ply(PAPER, 1e-3, np.nan), "ply.angle_deg: is nan, expected a finite angle"),
    (lambda: Piece(0.2, 0.1, 1e-3, 1e-3), "piece: goes from 0.2 to 0.1 m, expected 0 ≤ start < end"),
    (lambda: PointMass(0, 0, 1, -1), "point_mass.rotary_inertia: is -1, expected kg·m², not negative"),
    (lambda: Spring("", 1, 3, "start"), "spring.name: is empty; a spring is known by its name"),
    (lambda: Spring("s", 1, 0, "start"), "spring.direction: of s is 0, expected 1 … 6"),
    (lambda: Spring("s", 1, 3, point=(np.nan, 0)), "spring.point: of s is (nan, 0), expected finite x and y in m"),
    (lambda: OrientedSpecimen(0.5, 0.05, 0.01, PAPER, supports=()),
     "springs: and supports of an oriented specimen are those of its boundary"),
    (lambda: OrientedSpecimen(0.5, 0.05, 0.01, PAPER, zones=(0.2,)),
     "zones_m: are of a single update; an oriented specimen has none"),
    (lambda: _strip_model().rows([Dof(1, 1)]), "direction: 1 at point 1 is none of the model's rows"),
    (lambda: _strip_model().rows([Dof(7, 3)]), "point: 7 has no coordinates; give it a grid point"),
    (lambda: Options(most_modes=0), "most_modes: is 0, expected 1 to 200"),
    (lambda: d3518.reduce(_of_strains([0, 1.4e-3, 2e-3, 3e-3, 4e-3, 5.5e-3, 8e-3]), WIDTH, WIDTH, 1.5e-3),
     "shear_strain: the closest points span 1400–5500 µε, expected 4000 ± 200 µε"),
    (lambda: mac(np.ones((2, 2, 2)), np.ones((2, 2))), "a: has shape (2, 2, 2), expected rows of vectors"),
    (lambda: CouponResult("a", {"E": np.nan}), "values.E: of specimen a is not a number; leave it out"),
    (lambda: statistics([]), "values: is empty, expected at least one specimen"),
    (lambda: prior(Statistics(1, 1.0, None), 0.0), "assumed_cv: is 0.0, expected a positive share such as 0.3"),
    (lambda: curve(force_n=np.ones(2)), "force_n: has shape (2,), expected at least 5 points"),
    (lambda: curve(strain=np.full(200, np.inf)), "strain: is infinite at point 1"),
    (lambda: curve(strain=np.full(200, np.nan)), "strain: has no number"),
    (lambda: chord(np.array([0, 1e-3, 3e-3, 4e-3]), 1e-3, 3e-3, "nearest"),
     "strain: 2 points within 1000–3000 µε, expected at least 5"),
    (lambda: chord(np.linspace(1e-3, 4e-3, 99), 1e-3 - 1e-7, 3e-3, "interpolated"),
     "strain: has no points on both sides of 1000 µε to interpolate between"),
    (lambda: d3039.reduce(curve(), WIDTH, WIDTH, (3e-3, 1e-3)),
     "chord_range: is 0.003 to 0.001, expected two rising strains, m/m"),
    (lambda: d3039.reduce(curve(force_n=FALLING), WIDTH, WIDTH),
     "curve: the force falls over the chord range; are force and strain of"),
    (lambda: d3039.reduce(curve(transverse_strain=LOST), WIDTH, WIDTH), "transverse_strain: was lost within the chord range"),
    (lambda: d3518.reduce(curve(force_n=FALLING), WIDTH, WIDTH),
     "curve: the force falls over the chord range; are force and strains of"),
    (lambda: d3518.reduce(_coarse(), WIDTH, WIDTH),
     "shear_strain: the closest points to 2000–6000 µε are at 1820 and 6370 µε, too"),
    (lambda: Dof(1, 0), "direction: is 0, expected ±1 … ±6"),
    (lambda: frfs(frequency_hz=np.ones((2, 2))), "frequency_hz: has shape (2, 2), expected one axis of lines"),
    (lambda: frfs(frequency_hz=LINES[::-1]), "frequency_hz: must be finite, non-negative and strictly increasing"),
    (lambda: frfs(values=np.ones((2, 4))), "values: has shape (2, 4), expected (1, 4)"),
    (lambda: frfs(references=()), "references: has 0 entries, expected 1"),
    (lambda: frfs(quantity="strain"), "quantity: is 'strain', expected one of accelerance, mobility, receptance"),
    (lambda: frfs(values=np.full((1, 4), np.nan)), "values: holds NaN or infinite ordinates (FRF 1, response point "),
    (lambda: frfs(variance=np.ones((2, 4))), "variance: has shape (2, 4), expected (1, 4)"),
    (lambda: frfs(measured=np.ones((2, 4), bool)), "measured: has shape (2, 4), expected (1, 4)"),
    (lambda: frfs().band(10, 20), "band_hz: no frequency line lies in 10 to 20 Hz"),
    (lambda: frfs().to_quantity("receptance"), "frequency_hz: a line at 0 Hz has no receptance; leave it out"),
    (lambda: identify(frfs(), Options((3, 1))), "band_hz: is 3 to 1 Hz, expected 0 <= low < high"),
    (lambda: identify([]), "frfs: is empty, expected at least one FRF"),
    (lambda: identify(frfs(values=np.zeros((1, 4)))), "no FRF is usable: 1Z/1Z is zero at all lines: a dead channel; check"),
    (lambda: identify(paper_frfs(0.0).band(100.0, 108.0)), "no FRF is usable: 33Z/1Z has only 9 measured lines in the band,"),
    (lambda: identify(paper_frfs(0.0), Options(band_hz=(2e3, 3e3))), "band_hz: no FRF has a line in 2000 to 3000 Hz"),
    (lambda: identify(frfs(variance=np.zeros((1, 4)))), "variance: must be positive (infinite where nothing was measured, NaN"),
    (lambda: Options(highest_order=1), "highest_order: is 1, expected 4 to 200"),
    (lambda: at_poles([25.0], [np.nan]), "damping_ratio: must be above 0 and below 1 to find shapes from FRFs (a ratio,"),
    (lambda: at_poles([-25.0], [0.1]), "frequency_hz: must be positive and ascend"),
    (lambda: at_poles([160.0, 160.0], [0.02, 0.02]), "the model's terms cannot be distinguished on the measured lines: two"),
    (lambda: at_poles(PAPER_HZ, PAPER_ZETA, band_hz=(155.0, 158.0)),
     "5 poles and the residual terms are 15 unknowns an FRF, but 33Z/1Z has only 4 lines; use a"),
    (lambda: modes(frequency_hz=np.zeros(0), damping_ratio=np.zeros(0)), "modes: is empty, expected at least one mode"),
    (lambda: modes(frequency_hz=np.array([0.0, 1])), "frequency_hz: must be positive and finite"),
    (lambda: modes(frequency_hz=np.array([2.0, 1])), "frequency_hz: must ascend"),
    (lambda: modes(damping_ratio=np.zeros(1)), "damping_ratio: has shape (1,), expected (2,)"),
    (lambda: modes(damping_ratio=np.array([0.1, 1.0])),
     "damping_ratio: must be at least 0 and below 1 (a ratio, not per cent)"),
    (lambda: modes(shapes=np.ones((2, 1))), "shapes: has shape (2, 1), expected (2, 0)"),
    (lambda: modes(covariance=np.eye(2)), "covariance: has shape (2, 2), expected (4, 4)"),
    (lambda: block(quantity="strain"), "quantity: is 'strain', expected one of force, acceleration, velocity,"),
    (lambda: block(full_scale=0.0), "full_scale: is 0.0, expected a positive number"),
    (lambda: block(samples=np.ones(10)), "samples: has shape (10,), expected 64 samples or more"),
    (lambda: block(samples=np.where(LONG == 7, np.nan, 1.0)), "samples: of the force hold NaN or infinity, first at sample 8"),
    (lambda: block(window_rate_per_s=-1.0), "window_rate_per_s: is -1.0, expected 0 or more per second"),
    (lambda: hit({"quantity": "acceleration"}), "force: holds acceleration; the channels are swapped, or their names are"),
    (lambda: hit(samples=np.zeros(100)), "responses: has 100 samples at point 1, the force 512; both channels of a hit are"),
    (lambda: replace(hit(), responses=()), "responses: is empty; a hit needs a response"),
    (lambda: replace(hit(), sample_rate_hz=0.0), "sample_rate_hz: is 0.0, expected a positive number"),
    (lambda: hit(quantity="force"), "responses: holds a force; a hit has one hammer"),
    (lambda: Processing(delay_s=1.0), "delay_s: is 1.0, expected less than a second"),
    (lambda: Processing(band_hz=(3, 1)), "band_hz: is (3, 1), expected two increasing frequencies in Hz"),
    (lambda: check_estimator("H3"), "estimator: is 'H3', expected one of H1, H2, Hv"),
    (lambda: Processing(false_discovery=1.0), "false_discovery: is 1.0, expected 0 to 0.9"),
    (lambda: Windows(0.0), "windows.force_length_s: is 0.0, expected a positive number of seconds"),
    (lambda: Windows(rate_per_s=-1.0), "windows.rate_per_s: is -1.0, expected 0 or more per second"),
    (lambda: remove_window(LINES, LINES, -1.0), "rate_per_s: is -1.0, expected 0 or more per second"),
    (lambda: process([]), "hits: is empty; processing needs at least one hit"),
    (lambda: process([[_two_kinds()]]), "responses: hold acceleration, velocity; process one kind of response at a"),
    (lambda: process([[hit()]], Processing(band_hz=(1e4, 2e4))),
     "band_hz: is 10000 to 20000 Hz and holds 0 of the lines, which lie"),
    (lambda: process([[hit(), replace(hit(quantity="velocity"), number=2)]]),
     "hits: differ: hit 2 of point 1 measures velocity, the first"),
    (lambda: process([[hit(), replace(hit(window_rate_per_s=3.0), number=2)]]),
     "window_rate_per_s: differs: hit 2 of point 1 carries 3 per second, the first 0;"),
    (lambda: process([[hit(), replace(silent(256), number=2)]]),
     "hits: differ: hit 2 of point 1 has 256 samples at 1000 Hz, the first 512 at 1000 Hz;"),
    (lambda: process([[silent(512)] * 3]), "hits: none of the hits is good (late, quiet); see the verdicts, and overrule"),
    (lambda: process([[hit()]], Processing(band_hz=(0.0, 0.8))), "band_hz: is 0 to 0.8 Hz and holds 1 of the lines, which"),
    (lambda: process([[hit()]], Processing(delay_s=-0.3)), "delay_s: is -0.3 s, expected at most half a block of 0.512 s"),
    (lambda: Strip(0.0, 1.0), "mass_per_length: is 0.0, expected a positive number"),
    (lambda: survey([1e-3 * np.random.default_rng(1).standard_normal((2, 4096))], 2048.0, 0),
     "recording: has no hit: the force reaches 0.00375 at 0.42 s and 0.00185 in the pauses; a hit has"),
    (lambda: survey([np.array([LONG == 40, np.where(LONG == 300, np.nan, 0.0)])], 2048.0, 0),
     "recording: holds NaN or infinity in channel 2 behind sample 301"),
    (lambda: Measurement(frfs(), {}, roving_mass=-0.001), "roving_mass: is -0.001, expected kg, not negative"),
    (lambda: fit_baseline(of_series(covariates={"c": np.full(6, np.nan)}), 5, ("c",)),
     "baseline: needs 5 campaigns with all covariates, Ex has 0 of 6"),
    (lambda: rate_since_onset(_change("step"), 1.0), "change: is a step, which has no rate"),
    (lambda: rate_since_onset(_change("ramp"), 0.0), "baseline_mean: is 0, so a rate relative to it means nothing"),
    (lambda: update_elastic(_strip_model(), modes(), use_shapes=True),
     "use_shapes: the measured modes have no shapes at points of the model"),
    (lambda: prepare(Measurement(frfs(responses=(Dof(1, 1),)), {1: (0.1, 0, 0)}), STRIP, Recipe()),
     "frfs: none is out of plane (±Z to ±Z), which is what the bending"),
    (lambda: prepare(Measurement(frfs(responses=(Dof(17, 3),)), {1: (0.1, 0, 0), 17: (0.511, 0, 0)}), STRIP, Recipe()),
     "grid_points: point 17 at (0.511, 0, 0) m lies 11 mm off the specimen, which spans x 0 … 0.5 m, y -0.025 …"),
    (lambda: observed_at(STRIP.model, [17], np.array([[-0.1, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0]])),
     "grid_points: point 17 at (-0.1, 0, 0) m lies 100 mm off the specimen, which spans x 0 … 0.5 m, y -0.025 … 0.025 m;"),
    (lambda: Inputs(length_sd=-1.0), "inputs.length_sd: is -1.0, expected a number that is not negative"),
    (lambda: plan_tests([]), "tests: is empty, expected at least one that could be made"),
    (lambda: parametrise(STRIP, [Parameter("Ey", fixed=True, tied_to="Ex"), Parameter("Ex")]),
     "parameters.0.tied_to: Ey is fixed and tied at once"),
]
# fmt: on


def _coarse() -> Curve:
    strain: FloatArray = np.arange(60) * 7e-4
    return Curve(1e6 * strain, strain, None, -0.3 * strain)


def _of_strains(gamma: list[float]) -> Curve:
    strain = np.array(gamma)
    return Curve(1e6 * strain, 0.6 * strain, None, -0.4 * strain)


def _strip_model() -> ForwardModel:
    return ForwardModel(
        STRIP, parametrise(STRIP, [Parameter("Ex")]), along_z((1,)), np.array([[0.1, 0.0]]), 3
    )


def _two_kinds() -> Hit:
    return Hit(
        block(), (block(quantity="acceleration"), block(quantity="velocity", dof=Dof(2, 3))), 1000.0
    )


def _change(pattern: str) -> Any:
    at = datetime(2026, 1, 1, tzinfo=UTC)
    return ChangePoint(cast("Any", pattern), 0, (0, 0), at, (at, at), 1.0, 1.0, 1.0, 1.0, 3.0)
