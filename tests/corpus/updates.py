"""What laboratories get wrong: each fault is left out with a warning, or refused with what to do;
none is fitted in silence.
"""

import re
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest

from benchmarks.updates import Found, judge
from fecore.body.constants import Parameter
from fecore.body.supports import Boundary
from fecore.dynamics.damping_laws import RAYLEIGH, beyond, damping_rate
from fecore.errors import UpdatingError
from fecore.frf import Dof, FrfSet, along_z
from fecore.modal import set_with_gaps
from fecore.modes import MeasuredModes
from fecore.updating.forward import ForwardModel
from fecore.updating.inputs import Inputs
from fecore.updating.measurement import (
    HoldOut,
    Measurement,
    PreparedMeasurement,
    Recipe,
    prepare,
)
from fecore.updating.parameters import parametrise
from fecore.updating.pipeline import update
from fecore.updating.result import UpdateResult
from tests.corpus.outcomes import Case, Updated, deviations, estimates
from tests.support import draws
from tests.support import random_laboratories as laboratories
from tests.support.draws import Drawn

# A coarse mesh, whose bias is far below what the sets are drawn with, makes an update three times
# as fast.
BEAM = replace(draws.BEAM, divisions=(20, 2))
RAYLEIGH_ALONE = Recipe(damping_models=("rayleigh",))


@cache
def measured() -> Measurement:
    """A laboratory that states that the response had no window."""
    given = draws.beam(0).measurement
    return replace(given, inputs=replace(given.inputs, window_rate=0.0))


@cache
def clean() -> UpdateResult:
    return update(measured(), BEAM)


@cache
def identified() -> Measurement:
    """The same with its modes handed in, for faults that identification does not see: the results
    keep their bits.
    """
    return replace(measured(), modes=prepare(measured(), BEAM, Recipe()).modes)


def faulty(
    measurement: Measurement | None = None, *, factor: float = 1.0, turned: tuple[int, ...] = ()
) -> Measurement:
    """The measurement with FRFs of another height, some of them of the other sign."""
    measurement = measurement or measured()
    values = factor * measurement.frfs.values
    values[list(turned)] *= -1
    return replace(measurement, frfs=replace(measurement.frfs, values=values))


def conjugated() -> Measurement:
    return replace(measured(), frfs=measured().frfs.conjugated())


def low(measurement: Measurement, highest_hz: float) -> Measurement:
    return replace(
        measurement, frfs=measurement.frfs.band(2.0, highest_hz), inputs=Inputs(window_rate=0.0)
    )


def hz() -> np.ndarray:
    return np.array([mode.measured_hz for mode in clean().modes])


def typed(frequency_hz: np.ndarray) -> Measurement:
    return replace(
        measured(), modes=MeasuredModes(frequency_hz, np.full(frequency_hz.size, np.nan))
    )


def mistyped() -> Measurement:
    """A typing error: 220 in place of 165 Hz."""
    wrong = typed(hz() * np.where(np.arange(hz().size) == 1, 4 / 3, 1))
    return replace(wrong, frfs=wrong.frfs.select(list(range(0, 33, 4))))


def six_faults() -> Measurement:
    """Six faults in one campaign, each of which was once left out of the identification alone.

    A dead channel (fitted in stage 2, without a SAC), an FRF and its negative copy, a hit on the
    clamp (its FRF is 0 in the model, its static deflection was 0/0), overloads, a tone of random
    phase in every FRF (it doubled the standard deviation of a0), and gaps (0 with an infinite
    variance, which stage 2 took for a stated noise).
    """
    frfs = measured().frfs
    level = np.sqrt(np.mean(np.abs(frfs.values) ** 2))
    values = np.vstack([frfs.values, -frfs.values[:1], 1e-3 * frfs.values[:1]])
    values[3] = 0
    values[7, 100] += 50 * level
    values[9, 13] += 30 * level
    values[:, 25] += 10 * level * np.exp(2j * np.pi * np.random.default_rng(3).random(len(values)))
    values[5, 40:60] = np.nan
    values[:, 110] = np.nan
    references = (*frfs.references, frfs.references[0], Dof(40, 3))
    holed = set_with_gaps(
        frfs.frequency_hz, values, (*frfs.responses, *frfs.responses[:1] * 2), references
    )
    return replace(measured(), frfs=holed, points={**measured().points, 40: (0.0, 0.01, 0.005)})


def bit_for_bit(result: UpdateResult) -> None:
    assert estimates(result).tolist() == estimates(clean()).tolist()


def left_out(result: UpdateResult) -> None:
    assert len(result.prediction.responses) == 31
    assert {"33Z/4Z", "33Z/1Z"} == {refused.frf for refused in result.identification.refused}
    assert result.correlation.updated.sac.min() > 0.98
    assert result.correlation.held_out_frfs.coverage_95 > 0.9
    assert len([text for text in result.warnings if "overload" in text]) == 1  # one of two alike


def few(*, gapped: bool) -> Measurement:
    """One FRF in four, with gaps if wanted."""
    frfs = identified().frfs.select(list(range(0, 33, 4)))
    values = frfs.values.copy()
    if gapped:
        values[5, 40:60] = np.nan
        values[:, 100] = np.nan
    return replace(
        identified(), frfs=set_with_gaps(frfs.frequency_hz, values, frfs.responses, frfs.references)
    )


def mixed_up() -> Measurement:
    """One FRF of the opposite sign, one twice as large, two points swapped, and all in units of a
    thousand times the stated.
    """
    values, points = 1e-3 * identified().frfs.values, dict(identified().points)
    values[3] *= -1
    values[7] *= 2
    points[5], points[20] = points[20], points[5]
    return replace(identified(), frfs=replace(identified().frfs, values=values), points=points)


def of_another_beam(boundary: Boundary) -> UpdateResult:
    """Another beam, numbered along its length and not across, so that the points are not these: few
    modes pair, or none.
    """
    other = replace(BEAM, length=0.32, width=0.06, thickness=0.006, boundary=boundary)
    places = [
        (0.32 * (column + 1) / 11, 0.03 * side) for side in (-1, 0, 1) for column in range(11)
    ]
    own = dict(zip(sorted(measured().points), places, strict=True))
    known = parametrise(other)
    state = ForwardModel(other, known, along_z(own), np.array(places), 14).solve(known.prior_mean)
    half = measured().frfs.select(list(range(0, 33, 2)))
    sensor, hammer, lines = half.responses, half.references, half.frequency_hz
    model = state.frf_model(sensor, hammer)
    rate = damping_rate(RAYLEIGH, np.array([20.0, 1e-5]), model.omega)
    values = model.synthesise(
        lines, rate, beyond=beyond(RAYLEIGH, np.array([20.0, 1e-5]), float(model.omega[-1]))
    )
    noise = (
        0.01
        * np.sqrt(np.mean(np.abs(values) ** 2))
        * np.random.default_rng(1).standard_normal(values.shape)
    )
    ratio = rate[state.modes.rigid :] / (4 * np.pi * state.frequency_hz)
    seen = np.flatnonzero(state.frequency_hz < lines[-1])[:4]
    dofs = tuple(Dof(point, 3) for point in own)
    modes = MeasuredModes(state.frequency_hz[seen], ratio[seen], state.shapes[seen] + 0j, dofs)
    return update(
        replace(measured(), frfs=FrfSet(lines, values + noise, sensor, hammer), modes=modes), BEAM
    )


def moved_in_the_test() -> Measurement:
    """Temperature or a sensor that moves shifts a mode between the FRFs: it is found twice, in
    shapes that are not its own.
    """
    assert clean().shapes is not None
    ratio = np.array([mode.measured_damping for mode in clean().modes])
    points = sorted({dof.point for dof in measured().frfs.references})
    at = [clean().shapes.points.index(point) for point in points]
    shapes = (
        np.array(
            [clean().shapes.updated[partner.model - 1, at] for partner in clean().pairing.partners]
        )
        + 0j
    )
    part = shapes[1] * np.random.default_rng(5).choice([1.0, 0.1], shapes.shape[1])
    twice = (
        np.insert(hz(), 2, hz()[1] * 1.002),
        np.insert(ratio, 2, ratio[1]),
        np.insert(shapes, 2, part, axis=0),
    )
    return replace(
        measured(), modes=MeasuredModes(*twice, tuple(Dof(point, 3) for point in points))
    )


def gaps() -> Case:
    """Gaps are no data to other weightings either."""

    def run(*, gapped: bool) -> UpdateResult:
        return update(few(gapped=gapped), BEAM, Recipe(weighting="log"))

    alike = Updated(
        like=partial(run, gapped=False),
        more=lambda found: found.correlation.updated.sac.min() > 0.98,
    )
    return partial(run, gapped=True), alike


def from_modes(*parameters: Parameter, exact: bool = False) -> UpdateResult:
    given = replace(identified(), frfs=None)
    given = replace(given, inputs=Inputs.exact()) if exact else given
    return update(given, BEAM, Recipe(parameters=(*parameters, Parameter("Gxy"))))


def surely_wrong() -> UpdateResult:
    truth = draws.beam(0).true["Ex"]
    return from_modes(Parameter("Ex", prior_mean=1.05 * truth, prior_sd=1e-4 * truth), exact=True)


def because(words: str, result: UpdateResult) -> None:
    """What the verdict says."""
    assert any(re.search(words, reason) for reason in result.verdict.reasons), (
        result.verdict.reasons
    )


def constants_stand(result: UpdateResult) -> None:
    """Frequencies do not know of signs and heights."""
    np.testing.assert_allclose(estimates(result)[:5], estimates(clean())[:5], rtol=1e-3)


def near_the_measured_ratio(result: UpdateResult) -> None:
    assert [row.name for row in result.parameters if row.identifiable] == ["Ex", "zeta1"]
    assert result.modes[0].predicted_damping == pytest.approx(
        result.modes[0].measured_damping, rel=0.02
    )


def alone_in_the_band(result: UpdateResult) -> None:
    """Each mode beyond the band had a shift and a ratio of its own of which the lines said nothing,
    and no fit converged.
    """
    for mode, other in zip(result.modes[1:3], clean().modes[1:3], strict=True):
        assert mode.predicted_damping == pytest.approx(other.measured_damping, rel=0.01)


def of_noise(damping_ratio: float = 0.02) -> PreparedMeasurement:
    """A measurement whose FRFs support no modes of their own, but one was typed in: it takes its
    shape from them.
    """
    white = np.random.default_rng(7).standard_normal((2, 4, 360))
    dofs = tuple(Dof(n, 3) for n in range(1, 5))
    noise = FrfSet(np.arange(41.0, 401.0), white[0] + 1j * white[1], dofs, dofs[:1] * 4)
    points = {n: (0.1 * n, 0.0, 0.0) for n in range(1, 5)}
    given = Measurement(noise, points, MeasuredModes(np.array([100.0]), np.array([damping_ratio])))
    return prepare(given, BEAM, Recipe())


def shape_of_four(found: PreparedMeasurement) -> None:
    assert found.modes.frequency_hz.tolist() == [100.0]
    assert found.modes.shapes.shape == (1, 4)


def no_shape(found: PreparedMeasurement) -> None:
    assert found.modes.shapes is None
    assert "shapes_without_damping" in [note.kind for note in found.notes]


def all_held_out() -> object:
    points = {label: (0.1 * label, 0.0, 0.0) for label in (1, 2, 3)}
    values = np.zeros((3, 200), complex)
    values[0] = np.random.default_rng(5).standard_normal((2, 200)).T.copy().view(complex)[:, 0]
    tour = FrfSet(
        np.linspace(1.0, 100.0, 200),
        values,
        (Dof(3, 3),) * 3,
        tuple(Dof(point, 3) for point in points),
    )
    return update(Measurement(tour, points), BEAM, Recipe(hold_out=HoldOut(points=(1,))))


# --- laboratories of the benchmark in which a fit once failed, or warned as numpy does
# --------------------------------


def laboratory(seed: int, step: int) -> Drawn:
    """A laboratory with one line in so many."""
    drawn = laboratories.draw(seed)
    return replace(drawn, measurement=draws.with_one_line_in(step, drawn.measurement))


def at_rest(outcome: Found) -> None:
    """Without the damping of the steps none comes to rest."""
    assert not outcome.error
    assert outcome.offs
    assert not [warning for warning in outcome.warnings if "could not be updated" in warning]


def unresolved(step: int, recipe: Recipe) -> UpdateResult | UpdatingError:
    given = laboratory(305, step)
    try:
        return update(given.measurement, given.stated, recipe)
    except UpdatingError as error:
        return error


def words_or_numbers(found: UpdateResult | UpdatingError) -> None:
    """Which of these it is depends on the last bits of the machine's linear algebra."""
    if isinstance(found, UpdatingError):
        assert "did not converge" in found.message or "beyond the critical" in found.message
        return
    assert np.all(np.isfinite(deviations(found)))
    words = ("half-power", "inadequate", "the damping could not be updated: ")
    assert any(word in text for text in found.warnings for word in words)


OPPOSITE, HEIGHT = (
    "most FRFs have the opposite sign",
    "the FRFs are {} times as large as the model's",
)
ONE = "1 measured mode cannot fix the 2 coefficients .* put `modal` first"

# fmt: off
UPDATES: dict[str, Case] = {
    "honest": (clean, Updated(["the modes show the length to .* alone"], more=lambda found: len(found.warnings) == 1)),
    "modes handed in": (lambda: update(identified(), BEAM), Updated(more=bit_for_bit)),
    "conjugates": (lambda: update(conjugated(), BEAM), Updated([".*the FRFs are conjugates"], like=clean)),
    "six faults": (lambda: update(six_faults(), BEAM), Updated([
        ".*33Z/4Z was not used", ".*point 40 lies on a support", "interference at 52 Hz: left out", ".*line at 28 Hz",
        ".*line at 202 Hz",
    ], like=clean, more=left_out)),
    "gaps": gaps(),
    "a boundary that holds the sensor": (
        lambda: update(measured(), replace(BEAM, boundary="simply_supported")),
        "boundary: leaves no FRF: points 31, 32, 33 lie on a support"),
    "all held out": (all_held_out, "no FRF that is to be fitted is usable: FRF 3Z/2Z was not used: is zero"),
    # a measurement that is not the model's
    "signs, factors and points": (lambda: update(mixed_up(), BEAM), Updated([
        HEIGHT.format("0.001"), r"FRF 33Z/4Z \(-(0.99|1.0\d)\) has the opposite sign of the model's",
        r"FRF 33Z/8Z \(\+(1.99|2.0\d)\) has another level than the rest", r"FRFs? .*33Z/20Z.* a wrong point",
    ], more=constants_stand)),
    "in g": (lambda: update(faulty(identified(), factor=1 / 9.80665), BEAM), Updated(level="with_care", reasons=[
        HEIGHT.format("0.102") + r" \(as acceleration in g is, for m/s²\): check"], close=clean)),
    "turned and not calibrated": (lambda: update(faulty(identified(), factor=-2.5), BEAM), Updated(
        level="with_care", reasons=[OPPOSITE, HEIGHT.format("2.5") + ": check"], close=clean)),
    "all turned but one": (lambda: update(faulty(identified(), factor=-1.0, turned=(3,)), BEAM), Updated([
        r"FRF 33Z/4Z \(-(0.99|1.0\d)\) has the opposite sign of the rest's"])),
    "stated as free": (
        lambda: update(low(few(gapped=False), 500.0), replace(BEAM, boundary="free")),
        Updated([".*most FRFs disagree with the model's", ".*measured mode 2.*agrees poorly with its partner"])),
    "another free beam": (lambda: of_another_beam("free"), Updated(
        level="do_not_use", more=partial(because, "no measured mode shape agrees with one of the model"))),
    "another clamped beam": (lambda: of_another_beam("cantilever"), Updated(
        level="do_not_use", more=partial(because, "most measured mode shapes disagree with the model's"))),
    "a mode that moved": (lambda: update(moved_in_the_test(), BEAM), Updated(level="with_care", more=partial(
        because, r"measured modes 2 and 3 \([\d.]+ and [\d.]+ Hz\) lie closer together than"))),
    "a mistyped mode": (lambda: update(mistyped(), BEAM), Updated(
        level="do_not_use", more=partial(because, "most FRFs disagree with the model's"))),
    "above its prior": (lambda: from_modes(Parameter("Ex", prior_mean=22e9, prior_sd=3e9)), Updated(
        [r"the data contradict .* prior of Ex as 33\.\d+ ± [\d.]+ GPa instead of 22 ± 3 GPa"])),
    # half of 5 %, or fewer
    "a sure prior": (surely_wrong, Updated([r".*differ from the measured ones by [12]\.\d* %"])),
    # damping
    "one mode, two coefficients": (lambda: update(low(measured(), 70), BEAM, RAYLEIGH_ALONE), Updated(no_damping=ONE)),
    "one mode, any law": (lambda: update(low(measured(), 70), BEAM), Updated(
        ["one measured mode cannot fix the 2 coefficients"], more=near_the_measured_ratio)),
    "one mode, heights wrong": (lambda: update(low(faulty(factor=1.5), 70), BEAM, RAYLEIGH_ALONE), Updated(
        # of one mode, to a per cent
        [HEIGHT.format(r"1\.(49|5\d?)")], no_damping="cannot fix the 2 coefficients")),
    "no mode in the band": (lambda: update(identified(), BEAM, Recipe(band_hz=(60.0, 90.0))), Updated(
        no_damping="no paired mode lies in the band, 60 to 90 Hz")),
    "modes beyond the band": (lambda: update(identified(), BEAM, Recipe(
        band_hz=(100.0, 440.0), damping_models=("rayleigh", "modal"))), Updated(more=alone_in_the_band)),
    "a mode in noise": (of_noise, shape_of_four),
    "a mode in noise, no ratio": (partial(of_noise, np.nan), no_shape),
    "modes without damping": (lambda: update(typed(hz()), BEAM), Updated(silent=["as large as", "unlike", "likeness"])),
    "a start of negative damping": (lambda: judge(laboratory(219, 4)), at_rest),
    "a singular start": (partial(unresolved, 1, Recipe(damping_models=("caughey3", "rayleigh"))), words_or_numbers),
    "a negative variance": (partial(unresolved, 2, Recipe(method="joint")), words_or_numbers),
}
