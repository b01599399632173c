"""Inputs that the core refuses, each by the field that is wrong."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any, cast

import numpy as np
import pytest

from fecore.arrays import FloatArray
from fecore.body.beam import beam
from fecore.body.laminate import Ply
from fecore.body.model import deflection_at
from fecore.body.oriented import OrientedSpecimen
from fecore.body.profile import Piece
from fecore.body.specimen import Specimen
from fecore.body.supports import PointMass, Spring, Supports
from fecore.correlation import mac
from fecore.coupons import d3039, d3518
from fecore.coupons.batch import CouponResult, Statistics, prior, statistics
from fecore.coupons.curves import Curve, chord
from fecore.errors import IdentificationError, InputError, UpdatingError
from fecore.frf import Dof, FrfSet
from fecore.modal.arrangement import arrange
from fecore.modal.identify import Options
from fecore.modal.residues import shapes_at_poles
from fecore.modes import MeasuredModes
from fecore.processing import Block, Hit, Processing, process
from fecore.processing.estimators import check_estimator
from fecore.processing.judgement import Limits
from fecore.processing.windows import Windows, remove_window
from fecore.trend.baseline import fit_baseline
from fecore.trend.change import ChangePoint
from fecore.trend.rates import rate_since_onset
from fecore.trend.series import Series
from fecore.updating.elastic import update_elastic
from fecore.updating.forward import ForwardModel
from fecore.updating.inputs import Inputs
from fecore.updating.measurement import Measurement, prepare
from fecore.updating.parameters import Parameter, parametrise
from fecore.updating.plans import plan_tests
from fecore.updating.recipe import HoldOut, Recipe
from tests.support.plates import PAPER

LINES = np.arange(4.0)
Z = Dof(1, 3)


def frfs(**wrong: Any) -> FrfSet:
    right = {"frequency_hz": LINES, "values": np.ones((1, 4), complex), "responses": (Z,), "references": (Z,)}
    return FrfSet(**{**right, **wrong})


def modes(**wrong: Any) -> MeasuredModes:
    return MeasuredModes(**{"frequency_hz": np.array([1.0, 2]), "damping_ratio": np.zeros(2), **wrong})


def block(**wrong: Any) -> Block:
    made = np.zeros(512)
    made[100:110] = np.hanning(12)[1:-1]
    return Block(**{"dof": Z, "quantity": "force", "samples": made, **wrong})


def hit(force: dict[str, Any] | None = None, quantity: str = "acceleration", **response: Any) -> Hit:
    return Hit(block(**(force or {})), (block(quantity=quantity, **response),), 1000.0)


def curve(**wrong: Any) -> Curve:
    strain = np.linspace(0, 8e-3, 200)
    right = {"force_n": 1e6 * strain, "strain": strain, "transverse_strain": -0.3 * strain}
    return Curve(**{**right, **wrong})


def of_series(**wrong: Any) -> Series:
    dates = [datetime(2026, 1, day, tzinfo=UTC) for day in range(1, 7)]
    return Series(**{"name": "Ex", "dates": dates, "estimate": np.ones(6), "standard_deviation": np.ones(6), **wrong})


FALLING = np.interp(np.linspace(0, 8e-3, 200), [0, 0.9e-3, 4.8e-3, 8e-3], [0, 5, 4, 10])
STRIP = Specimen(0.5, 0.05, 0.01, PAPER)
LOST = np.r_[np.full(1, 0.0), np.full(199, np.nan)]
WIDTH = [0.025]

REFUSED: dict[str, tuple[str, str, Callable[[], object]]] = {
    "no element": ("mesh.elements", "is 0, expected at least one element", lambda: beam(1, 0, "free")),
    "no direction of a beam": ("directions[0]", "is 7, expected 1 … 6", lambda: _seen(7)),
    "ply without an angle": ("ply.angle_deg", "is nan, expected a finite angle", lambda: Ply(PAPER, 1e-3, np.nan)),
    "backward piece": (
        "piece",
        "goes from 0.2 to 0.1 m, expected 0 ≤ start < end",
        lambda: Piece(0.2, 0.1, 1e-3, 1e-3),
    ),
    "rotary inertia": (
        "point_mass.rotary_inertia",
        "is -1, expected kg·m², not negative",
        lambda: PointMass(0, 0, 1, -1),
    ),
    "spring without a name": (
        "spring.name",
        "is empty; a spring is known by its name",
        lambda: Spring("", 1, 3, "start"),
    ),
    "spring without a direction": ("spring.direction", "of s is 0, expected 1 … 6", lambda: Spring("s", 1, 0, "start")),
    "spring at no edge": (
        "spring.edge",
        "of s is 'top', expected start, end, lower, upper",
        lambda: Spring("s", 1, 3, cast("Any", "top")),
    ),
    "spring at no point": (
        "spring.point",
        "of s is (nan, 0), expected finite x and y in m",
        lambda: Spring("s", 1, 3, point=(np.nan, 0)),
    ),
    "oriented with supports": (
        "springs",
        "and supports of an oriented specimen are those of its boundary",
        lambda: OrientedSpecimen(0.5, 0.05, 0.01, PAPER, supports=Supports()),
    ),
    "oriented with zones": (
        "zones_m",
        "are of a single update; an oriented specimen has none",
        lambda: OrientedSpecimen(0.5, 0.05, 0.01, PAPER, zones=(0.2,)),
    ),
    "in plane of a model": (
        "direction",
        "1 at point 1 is not out of plane (±3)",
        lambda: _strip_model().rows([Dof(1, 1)]),
    ),
    "point of no model": (
        "point",
        "7 has no coordinates; give it a grid point",
        lambda: _strip_model().rows([Dof(7, 3)]),
    ),
    "too many modes": ("most_modes", "is 0, expected 1 to 200", lambda: Options(most_modes=0)),
    "early shear": (
        "shear_strain",
        "the closest points span 1400–5500 µε, expected 4000 ± 200 µε",
        lambda: d3518.reduce(_of_strains([0, 1.4e-3, 2e-3, 3e-3, 4e-3, 5.5e-3, 8e-3]), WIDTH, WIDTH, 1.5e-3),
    ),
    "MAC of a cube": (
        "a",
        "has shape (2, 2, 2), expected rows of vectors",
        lambda: mac(np.ones((2, 2, 2)), np.ones((2, 2))),
    ),
    "coupon of NaN": (
        "values.E",
        "of specimen a is not a number; leave it out",
        lambda: CouponResult("a", {"E": np.nan}),
    ),
    "no coupon": ("values", "is empty, expected at least one specimen", lambda: statistics([])),
    "no scatter assumed": (
        "assumed_cv",
        "is 0.0, expected a positive share such as 0.3",
        lambda: prior(Statistics(1, 1.0, None), 0.0),
    ),
    "short curve": ("force_n", "has shape (2,), expected at least 5 points", lambda: curve(force_n=np.ones(2))),
    "infinite strain": ("strain", "is infinite at point 1", lambda: curve(strain=np.full(200, np.inf))),
    "no strain": ("strain", "has no number", lambda: curve(strain=np.full(200, np.nan))),
    "few points of a chord": (
        "strain",
        "2 points within 1000–3000 µε, expected at least 5",
        lambda: chord(np.array([0, 1e-3, 3e-3, 4e-3]), 1e-3, 3e-3, "nearest"),
    ),
    "no interpolation": (
        "strain",
        "has no points on both sides of 1000 µε to interpolate between",
        lambda: chord(np.linspace(1e-3, 4e-3, 99), 1e-3 - 1e-7, 3e-3, "interpolated"),
    ),
    "turned chord": (
        "chord_range",
        "is 0.003 to 0.001, expected two rising strains, m/m",
        lambda: d3039.reduce(curve(), WIDTH, WIDTH, (3e-3, 1e-3)),
    ),
    "falling force": (
        "curve",
        "the force falls over the chord range; are force and strain of",
        lambda: d3039.reduce(curve(force_n=FALLING), WIDTH, WIDTH),
    ),
    "lost transverse strain": (
        "transverse_strain",
        "was lost within the chord range",
        lambda: d3039.reduce(curve(transverse_strain=LOST), WIDTH, WIDTH),
    ),
    "falling shear": (
        "curve",
        "the force falls over the chord range; are force and strains of",
        lambda: d3518.reduce(curve(force_n=FALLING), WIDTH, WIDTH),
    ),
    "coarse shear": (
        "shear_strain",
        "the closest points to 2000–6000 µε are at 1820 and 6370 µε, too",
        lambda: d3518.reduce(_coarse(), WIDTH, WIDTH),
    ),
    "no direction": ("direction", "is 0, expected ±1 … ±6", lambda: Dof(1, 0)),
    "no lines": (
        "frequency_hz",
        "has shape (2, 2), expected one axis of lines",
        lambda: frfs(frequency_hz=np.ones((2, 2))),
    ),
    "falling lines": (
        "frequency_hz",
        "must be non-negative and strictly increasing",
        lambda: frfs(frequency_hz=LINES[::-1]),
    ),
    "values of another shape": ("values", "has shape (2, 4), expected (1, 4)", lambda: frfs(values=np.ones((2, 4)))),
    "no reference": ("references", "has 0 entries, expected 1", lambda: frfs(references=())),
    "no quantity": (
        "quantity",
        "is 'strain', expected one of accelerance, mobility, receptance",
        lambda: frfs(quantity="strain"),
    ),
    "NaN": ("values", "holds NaN or infinite ordinates", lambda: frfs(values=np.full((1, 4), np.nan))),
    "variance of another shape": (
        "variance",
        "has shape (2, 4), expected (1, 4)",
        lambda: frfs(variance=np.ones((2, 4))),
    ),
    "measured of another shape": (
        "measured",
        "has shape (2, 4), expected (1, 4)",
        lambda: frfs(measured=np.ones((2, 4), bool)),
    ),
    "empty band": ("band_hz", "no frequency line lies in 10 to 20 Hz", lambda: frfs().band(10, 20)),
    "receptance at 0 Hz": (
        "frequency_hz",
        "a line at 0 Hz has no receptance; leave it out",
        lambda: frfs().to_quantity("receptance"),
    ),
    "no FRF left": ("frfs", "no usable FRF is left", lambda: arrange(frfs()).without([0])),
    "turned band": ("band_hz", "is 3 to 1 Hz, expected 0 <= low < high", lambda: arrange(frfs(), (3, 1))),
    "no pole": (
        "frequency_hz",
        "and damping_ratio have shapes (0,) and (0,), expected",
        lambda: shapes_at_poles(frfs(), np.zeros(0), np.zeros(0)),
    ),
    "no mode": (
        "modes",
        "is empty, expected at least one mode",
        lambda: modes(frequency_hz=np.zeros(0), damping_ratio=np.zeros(0)),
    ),
    "mode at 0 Hz": ("frequency_hz", "must be positive and finite", lambda: modes(frequency_hz=np.array([0.0, 1]))),
    "falling modes": ("frequency_hz", "must ascend", lambda: modes(frequency_hz=np.array([2.0, 1]))),
    "one ratio of two": ("damping_ratio", "has shape (1,), expected (2,)", lambda: modes(damping_ratio=np.zeros(1))),
    "ratio in per cent": (
        "damping_ratio",
        "must be at least 0 and below 1 (a ratio, not per cent)",
        lambda: modes(damping_ratio=np.array([0.1, 1.0])),
    ),
    "shapes at no dof": ("shapes", "has shape (2, 1), expected (2, 0)", lambda: modes(shapes=np.ones((2, 1)))),
    "covariance of another shape": (
        "covariance",
        "has shape (2, 2), expected (4, 4)",
        lambda: modes(covariance=np.eye(2)),
    ),
    "no quantity of a channel": (
        "quantity",
        "is 'strain', expected one of force, acceleration, velocity,",
        lambda: block(quantity="strain"),
    ),
    "no full scale": ("full_scale", "is 0.0, expected a positive number", lambda: block(full_scale=0.0)),
    "two hammers": ("responses", "holds a force; a hit has one hammer", lambda: hit(quantity="force")),
    "long delay": ("delay_s", "is 1.0, expected less than a second", lambda: Processing(delay_s=1.0)),
    "turned band of hits": (
        "band_hz",
        "is (3, 1), expected two increasing frequencies in Hz",
        lambda: Processing(band_hz=(3, 1)),
    ),
    "no estimator": ("estimator", "is 'H3', expected one of H1, H2, Hv", lambda: check_estimator("H3")),
    "second pulse in the noise": (
        "limits.second_pulse",
        "is 0.0, expected 0.03 or more",
        lambda: Limits(second_pulse=0.0),
    ),
    "no force window": (
        "windows.force_length_s",
        "is 0.0, expected a positive number of seconds",
        lambda: Windows(0.0),
    ),
    "growing window": (
        "windows.rate_per_s",
        "is -1.0, expected 0 or more per second",
        lambda: Windows(rate_per_s=-1.0),
    ),
    "growing window of modes": (
        "rate_per_s",
        "is -1.0, expected 0 or more per second",
        lambda: remove_window(LINES, LINES, -1.0),
    ),
    "no hit": ("hits", "is empty; processing needs at least one hit", lambda: process([])),
    "kinds of response": (
        "responses",
        "hold acceleration, velocity; process one kind of response at a",
        lambda: process([[_two_kinds()]]),
    ),
    "band off the lines": (
        "band_hz",
        "is 10000 to 20000 Hz and holds 0 of the lines, which lie",
        lambda: process([[hit()]], Processing(band_hz=(1e4, 2e4))),
    ),
    "another kind later": (
        "hits",
        "differ: hit 2 of point 1 measures velocity, the first",
        lambda: process([[hit(), replace(hit(quantity="velocity"), number=2)]]),
    ),
    "another window later": (
        "window_rate_per_s",
        "differs: hit 2 of point 1 carries 3 per second, the first 0;",
        lambda: process([[hit(), replace(hit(window_rate_per_s=3.0), number=2)]]),
    ),
    "few covariates": (
        "baseline",
        "needs 5 campaigns with all covariates, Ex has 0 of 6",
        lambda: fit_baseline(of_series(covariates={"c": np.full(6, np.nan)}), 5, ("c",)),
    ),
    "rate of a step": ("change", "is a step, which has no rate", lambda: rate_since_onset(_change("step"), 1.0)),
    "rate of nothing": (
        "baseline_mean",
        "is 0, so a rate relative to it means nothing",
        lambda: rate_since_onset(_change("ramp"), 0.0),
    ),
    "shapes of none": (
        "use_shapes",
        "the measured modes have no shapes at points of the model",
        lambda: update_elastic(_strip_model(), modes(), use_shapes=True),
    ),
    "FRFs in plane alone": (
        "frfs",
        "none is out of plane (±Z to ±Z), which is what the bending",
        lambda: prepare(Measurement(frfs(responses=(Dof(1, 1),)), {1: (0.1, 0, 0)}), STRIP, Recipe()),
    ),
    "point off the plate": (
        "grid_points",
        "point 17 at (0.511, 0) m lies off the specimen, which spans x 0 … 0.5 m, y -0.025 … 0.025 m; check the structure's",
        lambda: prepare(
            Measurement(frfs(responses=(Dof(17, 3),)), {1: (0.1, 0, 0), 17: (0.511, 0, 0)}), STRIP, Recipe()
        ),
    ),
    "point off the beam": (
        "grid_points",
        "point 17 at (-0.1, 0) m lies off the beam, which spans x 0 … 1 m; check the structure's dimensions",
        lambda: deflection_at(beam(1, 2, "free"), [17], np.array([[-0.1, 0]])),
    ),
    "negative scatter": (
        "inputs.length_sd",
        "is -1.0, expected a number that is not negative",
        lambda: Inputs(length_sd=-1.0),
    ),
    "no test": ("tests", "is empty, expected at least one that could be made", lambda: plan_tests([])),
    "fixed and tied": (
        "parameters.0.tied_to",
        "Ey is fixed and tied at once",
        lambda: parametrise(STRIP, [Parameter("Ey", fixed=True, tied_to="Ex"), Parameter("Ex")]),
    ),
}


def _seen(direction: int) -> object:
    return beam(1, 2, "free").observation(np.zeros((1, 2)), np.array([direction]))


def _coarse() -> Curve:
    strain: FloatArray = np.arange(60) * 7e-4
    return Curve(1e6 * strain, strain, None, -0.3 * strain)


def _of_strains(gamma: list[float]) -> Curve:
    strain = np.array(gamma)
    return Curve(1e6 * strain, 0.6 * strain, None, -0.4 * strain)


def _strip_model() -> ForwardModel:
    return ForwardModel(STRIP, parametrise(STRIP, [Parameter("Ex")]), (1,), np.array([[0.1, 0.0]]), 3)


def _two_kinds() -> Hit:
    return Hit(block(), (block(quantity="acceleration"), block(quantity="velocity", dof=Dof(2, 3))), 1000.0)


def _change(pattern: str) -> Any:
    at = datetime(2026, 1, 1, tzinfo=UTC)
    return ChangePoint(cast("Any", pattern), 0, (0, 0), at, (at, at), 1.0, 1.0, 1.0, 1.0, 3.0)


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_wrong_is_named(case: str) -> None:
    field, words, call = REFUSED[case]
    with pytest.raises(InputError) as refused:
        call()
    assert refused.value.field == field
    assert refused.value.message.startswith(words)


def test_errors_survive_the_way_from_a_worker() -> None:
    """They are pickled between processes, with all that they say."""
    wrong = pickle.loads(pickle.dumps(InputError("band_hz", "is empty")))
    assert (wrong.field, wrong.message) == ("band_hz", "is empty")
    failed = pickle.loads(pickle.dumps(UpdatingError("no rest", {"Ex": 1.0}, ((1.0,),))))
    assert (failed.message, failed.best, failed.history) == ("no rest", {"Ex": 1.0}, ((1.0,),))


def test_sound_frfs_that_are_all_held_out_leave_nothing_to_fit() -> None:
    points = {label: (0.1 * label, 0.0, 0.0) for label in (1, 2, 3)}
    values = np.zeros((3, 200), complex)
    values[0] = np.random.default_rng(5).standard_normal((2, 200)).T.copy().view(complex)[:, 0]
    tour = FrfSet(np.linspace(1.0, 100.0, 200), values, (Dof(3, 3),) * 3, tuple(Dof(point, 3) for point in points))
    with pytest.raises(
        IdentificationError, match=r"no FRF that is to be fitted is usable: FRF 3Z/2Z was not used: is zero"
    ):
        prepare(Measurement(tour, points), STRIP, Recipe(hold_out=HoldOut(points=(1,))))
