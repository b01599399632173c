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
from fecore.body.oriented import OrientedSpecimen
from fecore.body.profile import Piece
from fecore.body.specimen import Specimen
from fecore.body.supports import PointMass, Spring, Supports
from fecore.correlation import mac
from fecore.coupons import d3039, d3518
from fecore.coupons.batch import CouponResult, Statistics, prior, statistics
from fecore.coupons.curves import Curve, chord
from fecore.errors import InputError, UpdatingError
from fecore.frf import Dof, FrfSet
from fecore.identification.arrangement import arrange
from fecore.identification.identify import Options
from fecore.identification.residues import shapes_at_poles
from fecore.modes import MeasuredModes
from fecore.processing import Block, Hit, Processing, process
from fecore.processing.estimators import check_estimator
from fecore.processing.judgement import Limits
from fecore.processing.windows import Windows, remove_window
from fecore.trend.baseline import fit_baseline
from fecore.trend.change import ChangePoint
from fecore.trend.rates import rate_since_onset
from fecore.trend.series import Series
from fecore.updating.campaigns.plans import plan_tests
from fecore.updating.elastic import update_elastic
from fecore.updating.forward import ForwardModel
from fecore.updating.inputs import Inputs
from fecore.updating.measurement import Measurement, prepare
from fecore.updating.parameters import Parameter, parametrise
from fecore.updating.recipe import Recipe
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

REFUSED: dict[str, tuple[str, Callable[[], object]]] = {
    "no element": ("mesh.elements", lambda: beam(1, 0, "free")),
    "no direction of a beam": ("directions[0]", lambda: _seen(7)),
    "ply without an angle": ("ply.angle_deg", lambda: Ply(PAPER, 1e-3, np.nan)),
    "backward piece": ("piece", lambda: Piece(0.2, 0.1, 1e-3, 1e-3)),
    "rotary inertia": ("point_mass.rotary_inertia", lambda: PointMass(0, 0, 1, -1)),
    "spring without a name": ("spring.name", lambda: Spring("", 1, 3, "start")),
    "spring without a direction": ("spring.direction", lambda: Spring("s", 1, 0, "start")),
    "spring at no edge": ("spring.edge", lambda: Spring("s", 1, 3, cast("Any", "top"))),
    "spring at no point": ("spring.point", lambda: Spring("s", 1, 3, point=(np.nan, 0))),
    "oriented with supports": ("springs", lambda: OrientedSpecimen(0.5, 0.05, 0.01, PAPER, supports=Supports())),
    "oriented with zones": ("zones_m", lambda: OrientedSpecimen(0.5, 0.05, 0.01, PAPER, zones=(0.2,))),
    "in plane of a model": ("direction", lambda: _strip_model().rows([Dof(1, 1)])),
    "point of no model": ("point", lambda: _strip_model().rows([Dof(7, 3)])),
    "too many modes": ("most_modes", lambda: Options(most_modes=0)),
    "early shear": (
        "shear_strain",
        lambda: d3518.reduce(_of_strains([0, 1.4e-3, 2e-3, 3e-3, 4e-3, 5.5e-3, 8e-3]), WIDTH, WIDTH, 1.5e-3),
    ),
    "MAC of a cube": ("a", lambda: mac(np.ones((2, 2, 2)), np.ones((2, 2)))),
    "coupon of NaN": ("values.E", lambda: CouponResult("a", {"E": np.nan})),
    "no coupon": ("values", lambda: statistics([])),
    "no scatter assumed": ("assumed_cv", lambda: prior(Statistics(1, 1.0, None), 0.0)),
    "short curve": ("force_n", lambda: curve(force_n=np.ones(2))),
    "infinite strain": ("strain", lambda: curve(strain=np.full(200, np.inf))),
    "no strain": ("strain", lambda: curve(strain=np.full(200, np.nan))),
    "few points of a chord": ("strain", lambda: chord(np.array([0, 1e-3, 3e-3, 4e-3]), 1e-3, 3e-3, "nearest")),
    "no interpolation": ("strain", lambda: chord(np.linspace(1e-3, 4e-3, 99), 1e-3 - 1e-7, 3e-3, "interpolated")),
    "turned chord": ("chord_range", lambda: d3039.reduce(curve(), WIDTH, WIDTH, (3e-3, 1e-3))),
    "falling force": ("curve", lambda: d3039.reduce(curve(force_n=FALLING), WIDTH, WIDTH)),
    "lost transverse strain": ("transverse_strain", lambda: d3039.reduce(curve(transverse_strain=LOST), WIDTH, WIDTH)),
    "falling shear": ("curve", lambda: d3518.reduce(curve(force_n=FALLING), WIDTH, WIDTH)),
    "coarse shear": ("shear_strain", lambda: d3518.reduce(_coarse(), WIDTH, WIDTH)),
    "no direction": ("direction", lambda: Dof(1, 0)),
    "no lines": ("frequency_hz", lambda: frfs(frequency_hz=np.ones((2, 2)))),
    "falling lines": ("frequency_hz", lambda: frfs(frequency_hz=LINES[::-1])),
    "values of another shape": ("values", lambda: frfs(values=np.ones((2, 4)))),
    "no reference": ("references", lambda: frfs(references=())),
    "no quantity": ("quantity", lambda: frfs(quantity="strain")),
    "NaN": ("values", lambda: frfs(values=np.full((1, 4), np.nan))),
    "variance of another shape": ("variance", lambda: frfs(variance=np.ones((2, 4)))),
    "measured of another shape": ("measured", lambda: frfs(measured=np.ones((2, 4), bool))),
    "empty band": ("band_hz", lambda: frfs().band(10, 20)),
    "receptance at 0 Hz": ("frequency_hz", lambda: frfs().to_quantity("receptance")),
    "no FRF left": ("frfs", lambda: arrange(frfs()).without([0])),
    "turned band": ("band_hz", lambda: arrange(frfs(), (3, 1))),
    "most modes": ("most_modes", lambda: Options(most_modes=0)),
    "no pole": ("frequency_hz", lambda: shapes_at_poles(frfs(), np.zeros(0), np.zeros(0))),
    "no mode": ("modes", lambda: modes(frequency_hz=np.zeros(0), damping_ratio=np.zeros(0))),
    "mode at 0 Hz": ("frequency_hz", lambda: modes(frequency_hz=np.array([0.0, 1]))),
    "falling modes": ("frequency_hz", lambda: modes(frequency_hz=np.array([2.0, 1]))),
    "one ratio of two": ("damping_ratio", lambda: modes(damping_ratio=np.zeros(1))),
    "ratio in per cent": ("damping_ratio", lambda: modes(damping_ratio=np.array([0.1, 1.0]))),
    "shapes at no dof": ("shapes", lambda: modes(shapes=np.ones((2, 1)))),
    "covariance of another shape": ("covariance", lambda: modes(covariance=np.eye(2))),
    "no quantity of a channel": ("quantity", lambda: block(quantity="strain")),
    "no full scale": ("full_scale", lambda: block(full_scale=0.0)),
    "two hammers": ("responses", lambda: hit(quantity="force")),
    "long delay": ("delay_s", lambda: Processing(delay_s=1.0)),
    "turned band of hits": ("band_hz", lambda: Processing(band_hz=(3, 1))),
    "no estimator": ("estimator", lambda: check_estimator("H3")),
    "second pulse in the noise": ("limits.second_pulse", lambda: Limits(second_pulse=0.0)),
    "no force window": ("windows.force_length_s", lambda: Windows(0.0)),
    "growing window": ("windows.rate_per_s", lambda: Windows(rate_per_s=-1.0)),
    "growing window of modes": ("rate_per_s", lambda: remove_window(LINES, LINES, -1.0)),
    "no hit": ("hits", lambda: process([])),
    "kinds of response": ("responses", lambda: process([[_two_kinds()]])),
    "band off the lines": ("band_hz", lambda: process([[hit()]], Processing(band_hz=(1e4, 2e4)))),
    "another kind later": ("hits", lambda: process([[hit(), replace(hit(quantity="velocity"), number=2)]])),
    "another window later": (
        "window_rate_per_s",
        lambda: process([[hit(), replace(hit(window_rate_per_s=3.0), number=2)]]),
    ),
    "few covariates": ("baseline", lambda: fit_baseline(of_series(covariates={"c": np.full(6, np.nan)}), 5, ("c",))),
    "rate of a step": ("change", lambda: rate_since_onset(_change("step"), 1.0)),
    "rate of nothing": ("baseline_mean", lambda: rate_since_onset(_change("ramp"), 0.0)),
    "shapes of none": ("use_shapes", lambda: update_elastic(_strip_model(), modes(), use_shapes=True)),
    "FRFs in plane alone": (
        "frfs",
        lambda: prepare(Measurement(frfs(responses=(Dof(1, 1),)), {1: (0.1, 0, 0)}), STRIP, Recipe()),
    ),
    "negative scatter": ("inputs.length_sd", lambda: Inputs(length_sd=-1.0)),
    "no test": ("tests", lambda: plan_tests([])),
    "fixed and tied": (
        "parameters.0.tied_to",
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
    field, call = REFUSED[case]
    with pytest.raises(InputError) as refused:
        call()
    assert refused.value.field == field


def test_errors_survive_the_way_from_a_worker() -> None:
    """They are pickled between processes, with all that they say."""
    wrong = pickle.loads(pickle.dumps(InputError("band_hz", "is empty")))
    assert (wrong.field, wrong.message) == ("band_hz", "is empty")
    failed = pickle.loads(pickle.dumps(UpdatingError("no rest", {"Ex": 1.0}, ((1.0,),))))
    assert (failed.message, failed.best, failed.history) == ("no rest", {"Ex": 1.0}, ((1.0,),))
