"""What was measured and how it is to be used, made ready for updating.

Recipes: how a measurement is to be used. Data only, so the same recipe can be run again years
later.

What was measured, made ready for updating: usable FRFs, what is held out of them, modes with
shapes.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from fecore.arrays import ROUND_OFF, FloatArray
from fecore.body.constants import Body, Parameter
from fecore.body.model import Model, observed_at
from fecore.correlation import pair_modes
from fecore.dynamics.laws import DEFAULT_LAWS
from fecore.errors import IdentificationError, InputError
from fecore.findings import Finding, make, remark, texts
from fecore.frf import Dof, FrfSet
from fecore.modal import (
    Identification,
    Options,
    identify,
    identify_output_only,
    shapes_at_poles,
)
from fecore.modal.arrangement import split_sides
from fecore.modal.findings import not_used
from fecore.modal.prepare import screen
from fecore.modes import MeasuredModes
from fecore.signal import HalfSpectra
from fecore.updating.forward import directions_of
from fecore.updating.inputs import Inputs
from fecore.updating.misfit import Weighting


@dataclass(frozen=True)
class HoldOut:
    """What is kept from the fits and predicted afterwards."""

    # grid points whose FRFs are held out; None holds out those of every eighth point and direction,
    # () none
    points: tuple[int, ...] | None = None
    # lines that are held out, Hz; lines above the fitted band always are
    band_hz: tuple[float, float] | None = None


@dataclass(frozen=True)
class Recipe:
    """All choices of one update; the defaults suit a first look."""

    # "two_stage", or "joint": constants and damping together from the FRFs, without modes
    method: Literal["two_stage", "joint"] = "two_stage"
    # elastic parameters with their priors; None for `default_parameters` of the body
    parameters: tuple[Parameter, ...] | None = None
    use_shapes: bool = False  # fit the mode shapes too, not the frequencies alone
    # names of the damping laws to rank; the first is reported as parameters
    damping_models: tuple[str, ...] = DEFAULT_LAWS
    weighting: Weighting = "noise"  # residual of the damping update
    # lines for the damping update; by default up to half-way past the highest measured mode
    band_hz: tuple[float, float] | None = None
    hold_out: HoldOut = field(default_factory=HoldOut)  # data kept for validation
    posterior: Literal["laplace", "mcmc"] = "laplace"  # "laplace", or "mcmc" to sample it
    seed: int = 0  # of everything random
    # how modes are identified where none are handed in
    identification: Options = field(default_factory=Options)
    # temperature at which the constants are asked for, °C; None for that of the measurement
    reference_temperature_c: float | None = None
    include_doubtful: bool = True  # use the uncertain poles of the identification too


# ratio of frequencies within which a typed mode and an identified one are the same
_SAME_POLE = 1.05
_HELD_OUT_OF = 8  # every eighth roving dof is held out unless the recipe says otherwise
_FEWEST_TO_HOLD_OUT = 16  # FRFs of which some are held out

REMARKS = {
    "points_held": remark("{where}: {left} FRFs at them were left out", "is the boundary right?"),
    "frfs_not_predicted": remark("{left} FRFs are not {along} and were left out"),
    "shapes_without_damping": remark(
        "modes were paired by frequency: without damping ratios their shapes cannot be found from"
        " FRFs"
    ),
    "shapes_not_seen": remark(
        "modes were paired by frequency: their shapes have no {where} at a known point"
    ),
}
"""What is said of a measurement that a model is updated to, by its id."""


@dataclass(frozen=True)
class Measurement:
    """What was measured on a specimen."""

    frfs: FrfSet | None  # FRFs in SI; None where modes alone were measured
    # coordinates (x, y, z) in m of each grid point, in the specimen's frame
    points: Mapping[int, tuple[float, float, float]]
    # measured modes; None to identify them from the FRFs. Shapes are found from the FRFs where they
    # have none.
    modes: MeasuredModes | None = None
    # of a sensor that sat at the response point of each FRF in turn, kg; 0 where none did. One that
    # stood still is a `PointMass` of the specimen.
    roving_mass: float = 0.0
    # how well the laboratory knows what else it hands in
    inputs: Inputs = field(default_factory=Inputs)
    # (3, 3) directions 1, 2 and 3 of points that have axes of their own, as rows of unit vectors
    axes: Mapping[int, FloatArray] = field(default_factory=dict)
    temperature_c: float | None = None  # of the body in the test, °C; None where nobody stated it
    # half spectra of responses to loads that nobody measured, in which modes are found where there
    # are neither FRFs nor modes
    spectra: tuple[HalfSpectra, ...] = ()
    # whether the loads were measured under which the modes that are handed in were found
    loads_measured: bool = True

    def __post_init__(self) -> None:
        if self.frfs is None and self.modes is None and not self.spectra:
            raise InputError("measurement", "has neither FRFs nor modes nor half spectra")
        if not (np.isfinite(self.roving_mass) and self.roving_mass >= 0):
            raise InputError("roving_mass", f"is {self.roving_mass}, expected kg, not negative")


@dataclass(frozen=True)
class PreparedMeasurement:
    """A measurement ready for updating."""

    frfs: FrfSet | None = None  # all usable FRFs; None where there are none
    fitted: FrfSet | None = None  # those that the fits see
    fitted_rows: list[int] = field(default_factory=list)  # their rows among all
    held: FrfSet | None = None  # those that are held out, or None
    held_rows: list[int] = field(default_factory=list)  # their places among `frfs`
    # measured modes, with shapes where the data give them; None where none were asked for
    modes: MeasuredModes | None = None
    # how the modes were found; None where they were handed in
    identification: Identification | None = None
    notes: tuple[Finding, ...] = ()  # what a user must know

    @property
    def warnings(self) -> tuple[str, ...]:
        """The notes, in words."""
        return texts(self.notes)


def prepare(
    measurement: Measurement,
    specimen: Body,
    recipe: Recipe,
    report: Callable[[str, float], None] = lambda _stage, _share: None,
    *,
    find_modes: bool = True,
) -> PreparedMeasurement:
    """Choose FRFs and find modes.

    Args:
        measurement: what was measured.
        specimen: on which.
        recipe: what the fits must not see, and how modes are identified.
        report: called with the step of the identification and the share of it that is done.
        find_modes: False leaves modes and their shapes alone: the joint update needs none.

    Raises:
        InputError: no FRF can be used, a point has no coordinates or lies off the specimen, or the
            hold-out leaves nothing.
        IdentificationError: no modes were handed in and the FRFs support none, or doubtful ones
            only.
    """
    if measurement.frfs is None and measurement.modes is None:
        return _of_responses(measurement, specimen.model, recipe, report)
    if measurement.frfs is None:
        return _of_modes_only(measurement, specimen.model)
    frfs, unseen = _seen(measurement.frfs, measurement, specimen.model)
    frfs, stationary = _moving(frfs, measurement, specimen)
    rows = _split(frfs, recipe.hold_out)
    screened = screen(frfs)
    left_out = [not_used(each.frf, each.why) for each in screened.refused]
    place = {int(row): number for number, row in enumerate(screened.kept)}
    kept, held_rows = ([place[row] for row in side if row in place] for side in rows)
    if not kept:
        raise IdentificationError(
            f"no FRF that is to be fitted is usable: {'; '.join(texts(left_out))}"
        )
    frfs = frfs.select(list(place)).unmeasured_at(~screened.measured)
    frfs = frfs.conjugated() if screened.conjugated else frfs
    notes = (*unseen, *stationary, *screened.notes, *left_out)
    fitted, held = frfs.select(kept), frfs.select(held_rows) if held_rows else None
    modes, identification = None, None
    if find_modes and measurement.modes is None:
        identification = identify(fitted, recipe.identification, report)
        modes = identification.chosen(include_doubtful=recipe.include_doubtful).modes
        fitted = _without_outliers(fitted, identification)
        notes = (*notes, *identification.notes)
        identification = replace(
            identification, refused=(*screened.refused, *identification.refused)
        )
    elif find_modes and measurement.modes is not None:
        modes, more = _with_shapes(fitted, measurement, specimen.model)
        notes = (*notes, *more)
    if modes is not None:
        modes = replace(modes, highest_hz=float(fitted.frequency_hz[-1]))
    return PreparedMeasurement(
        frfs=frfs,
        fitted=fitted,
        fitted_rows=kept,
        held=held,
        held_rows=held_rows,
        modes=modes,
        identification=identification,
        notes=tuple(dict.fromkeys(notes)),
    )


def _without_outliers(frfs: FrfSet, identification: Identification) -> FrfSet:
    """The FRFs without the values that identification has found to be spoilt."""
    gaps = ~frfs.measured
    # those of its band
    lines = np.searchsorted(frfs.frequency_hz, identification.frequency_hz * (1 - 1e-9))
    gaps[np.ix_(identification.rows, lines)] |= np.isnan(identification.measured)
    return frfs.unmeasured_at(gaps)


def _moving(frfs: FrfSet, measurement: Measurement, specimen: Body) -> tuple[FrfSet, list[Finding]]:
    """The FRFs between dofs that the supports let move; what was left out."""
    dofs = sorted({Dof(dof.point, dof.axis) for dof in (*frfs.responses, *frfs.references)})
    points = [dof.point for dof in dofs]
    places = np.array([measurement.points[point] for point in points])
    observed = observed_at(specimen.model, points, places, directions_of(dofs, measurement.axes))
    stationary = {
        dof for dof, reach in zip(dofs, abs(observed).sum(axis=1), strict=True) if reach < ROUND_OFF
    }
    pairs = list(zip(frfs.responses, frfs.references, strict=True))
    moving = [
        i
        for i, pair in enumerate(pairs)
        if not stationary & {Dof(dof.point, dof.axis) for dof in pair}
    ]
    if len(moving) == len(pairs):
        return frfs, []
    held = sorted({dof.point for dof in stationary})
    names, one = ", ".join(map(str, held)), len(held) == 1
    where = (
        f"{'point' if one else 'points'} {names} {'lies' if one else 'lie'} on a support that holds"
        " still in the model"
    )
    if not moving:
        raise InputError(
            "boundary",
            f"leaves no FRF: {where}; check the boundary and the coordinates of the points",
        )
    left = len(pairs) - len(moving)
    return frfs.select(moving), [make(REMARKS, "points_held", where=where, left=left)]


def _of_responses(
    measurement: Measurement,
    model: Model,
    recipe: Recipe,
    report: Callable[[str, float], None],
) -> PreparedMeasurement:
    """Modes of half spectra, which scale no shape and make no FRF."""
    identification = identify_output_only(
        measurement.spectra, recipe.identification, report
    ).identification
    modes = identification.chosen(include_doubtful=recipe.include_doubtful).modes
    modes = replace(modes, highest_hz=float(identification.frequency_hz[-1]))
    data = _of_modes_only(replace(measurement, modes=modes), model)
    return replace(data, identification=identification, notes=(*data.notes, *identification.notes))


def _of_modes_only(measurement: Measurement, model: Model) -> PreparedMeasurement:
    """Modes without FRFs, with their shapes at points that have coordinates."""
    assert measurement.modes is not None, "a measurement has FRFs or modes"
    modes = measurement.modes
    notes: tuple[Finding, ...] = ()
    if modes.shapes is not None:
        modes, notes = _seen_shapes(set(measurement.points), modes, measurement, model)
    return PreparedMeasurement(modes=modes, notes=notes)


def _observable(dofs: Sequence[Dof], measurement: Measurement, model: Model) -> list[bool]:
    """Which dofs are displacements along directions in which the model moves."""
    along = model.can_move_along(
        directions_of([Dof(dof.point, (dof.axis - 1) % 3 + 1) for dof in dofs], measurement.axes)
    )
    return [dof.axis <= 3 and bool(observable) for dof, observable in zip(dofs, along, strict=True)]


def _predicted(model: Model) -> tuple[str, str]:
    """Directions in which a model moves, and its name, in words."""
    if {0, 1, 2} <= set(model.dofs):
        return "between translations", "model"
    return "out of plane (±Z to ±Z)", "bending model"


def _seen(frfs: FrfSet, measurement: Measurement, model: Model) -> tuple[FrfSet, list[Finding]]:
    """The FRFs along directions in which the model moves, without a line at 0 Hz; what was left
    out.
    """
    pairs = list(zip(frfs.responses, frfs.references, strict=True))
    observable = (
        _observable(dofs, measurement, model) for dofs in (frfs.responses, frfs.references)
    )
    chosen = [i for i, both in enumerate(zip(*observable, strict=True)) if all(both)]
    missing = sorted({dof.point for i in chosen for dof in pairs[i]} - set(measurement.points))
    if missing:
        raise InputError(
            "grid_points",
            f"points {', '.join(map(str, missing))} have FRFs but no coordinates; add them",
        )
    along, name = _predicted(model)
    if not chosen:
        raise InputError("frfs", f"none is {along}, which is what the {name} predicts")
    left = len(pairs) - len(chosen)
    notes = [make(REMARKS, "frfs_not_predicted", left=left, along=along)] if left else []
    kept = frfs.select(chosen)
    if kept.frequency_hz[0] == 0:
        kept = kept.band(float(np.nextafter(0, 1)), float(kept.frequency_hz[-1]))
    return kept, notes


def _split(frfs: FrfSet, hold_out: HoldOut) -> tuple[list[int], list[int]]:
    """Rows of the FRFs to fit, and of those held out: of the points that the recipe names, else of
    every eighth roving dof.

    A dof is held out with all its FRFs: with those of its weak reference alone, its part of a shape
    would be noise.
    """
    pairs = tuple(zip(frfs.responses, frfs.references, strict=True))
    dofs, _, sides = split_sides(pairs)
    roving = [dofs[side] for side in sides[:, 0]]
    if hold_out.points is None:
        driving = {dof for dof, (a, b) in zip(roving, pairs, strict=True) if a.point == b.point}
        many = len(roving) >= _FEWEST_TO_HOLD_OUT
        out = (
            set(list(dict.fromkeys(roving))[_HELD_OUT_OF // 2 :: _HELD_OUT_OF]) - driving
            if many
            else set()
        )
    else:
        out = {dof for dof in roving if dof.point in hold_out.points}
        unknown = set(hold_out.points) - {dof.point for dof in out}
        if unknown:
            raise InputError(
                "hold_out.points", f"{sorted(unknown)} have no FRF of their own in this campaign"
            )
    held = [i for i, dof in enumerate(roving) if dof in out]
    kept = [i for i, dof in enumerate(roving) if dof not in out]
    if not kept:
        raise InputError("hold_out.points", "holds out every FRF, so nothing is left to fit")
    return kept, held


def _with_shapes(
    frfs: FrfSet, measurement: Measurement, model: Model
) -> tuple[MeasuredModes, tuple[Finding, ...]]:
    """Modes that were handed in, with shapes: their own, or those that the FRFs have at their
    poles.

    Poles that the FRFs show but that were not typed in, also beyond the band, take part in that
    fit, so that they do not bend the shapes. Where a typed pole is one that the FRFs show, the
    residues are taken at the latter.
    """
    modes = measurement.modes
    assert modes is not None, "modes were handed in"
    if modes.shapes is not None:
        points = {dof.point for dof in (*frfs.responses, *frfs.references)}
        return _seen_shapes(points, modes, measurement, model)
    frequency, ratio = modes.frequency_hz.copy(), modes.damping_ratio.copy()
    try:
        seen = identify(frfs).terms
    except IdentificationError:
        seen = None
    if seen is not None:
        pairs = pair_modes(
            None, None, frequency, seen.frequency_hz, maximum_frequency_ratio=_SAME_POLE
        ).pairs
        for mine, theirs in pairs:
            frequency[mine], ratio[mine] = seen.frequency_hz[theirs], seen.damping_ratio[theirs]
        unmatched = np.setdiff1d(np.arange(seen.pairs), [theirs for _, theirs in pairs])
        frequency = np.concatenate([frequency, seen.frequency_hz[unmatched]])
        ratio = np.concatenate([ratio, seen.damping_ratio[unmatched]])
    if not np.all(ratio > 0):
        return modes, (make(REMARKS, "shapes_without_damping"),)
    order = np.argsort(frequency, kind="stable")
    # With poles beyond the band among them, the full residual series would say the same twice.
    if seen is None:
        fitted, _ = shapes_at_poles(frfs, frequency[order], ratio[order])
    else:
        fitted, _ = shapes_at_poles(frfs, frequency[order], ratio[order], exponents=seen.exponents)
    assert fitted.shapes is not None, "they are what is found"
    places = np.argsort(order, kind="stable")[: len(modes)]
    return replace(modes, shapes=fitted.shapes[places], dofs=fitted.dofs), ()


def _seen_shapes(
    points: set[int], modes: MeasuredModes, measurement: Measurement, model: Model
) -> tuple[MeasuredModes, tuple[Finding, ...]]:
    """The modes with their shapes at known points where the model moves; without such dofs the
    shapes are of no use.
    """
    observable = _observable(modes.dofs, measurement, model)
    columns = [i for i, dof in enumerate(modes.dofs) if observable[i] and dof.point in points]
    if not columns or modes.shapes is None:
        where = "out-of-plane value" if {0, 1, 2} - set(model.dofs) else "translation"
        note = make(REMARKS, "shapes_not_seen", where=where)
        return replace(modes, shapes=None, dofs=()), (note,)
    sign = np.array([modes.dofs[i].sign for i in columns])
    dofs = tuple(Dof(modes.dofs[i].point, modes.dofs[i].axis) for i in columns)
    return replace(modes, shapes=modes.shapes[:, columns] * sign, dofs=dofs), ()
