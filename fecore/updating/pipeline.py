"""The main job: measured FRFs and modes, a specimen and a recipe in; updated parameters with their uncertainty out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from fecore.damping import RAYLEIGH, DampingLaw
from fecore.errors import InputError
from fecore.frf import Dof, FrfSet
from fecore.identification.residues import shapes_at_poles
from fecore.modes import MeasuredModes
from fecore.specimen import Specimen
from fecore.updating.damping_stage import DampingStage
from fecore.updating.elastic import ElasticResult, update_elastic
from fecore.updating.forward import OUT_OF_PLANE, ForwardModel, modes_to_cover
from fecore.updating.parameters import Parametrisation, parametrise
from fecore.updating.recipe import Recipe
from fecore.updating.report import Report
from fecore.updating.result import UpdateResult

Progress = Callable[[str, float], None]
"""Told the stage in words and the share of the whole job that is done; raise from it to cancel."""

LAWS: Mapping[str, DampingLaw] = {"rayleigh": RAYLEIGH}
"""Damping laws by name."""

_EXTRA_MODES = 3  # beyond the measured ones, at least, so that neighbours can be paired


@dataclass(frozen=True)
class Measurement:
    """What was measured on a specimen.

    Attributes:
        frfs: FRFs in SI.
        points: coordinates (x, y, z) in m of each grid point, in the specimen's frame.
        modes: measured modes; shapes are found from the FRFs where they have none.
    """

    frfs: FrfSet
    points: Mapping[int, tuple[float, float, float]]
    modes: MeasuredModes


def update(
    measurement: Measurement,
    specimen: Specimen,
    recipe: Recipe | None = None,
    progress: Progress = lambda *_: None,
) -> UpdateResult:
    """Update a specimen's elastic constants and damping from a measurement.

    Raises:
        InputError: the measurement or the recipe is wrong; it names the field.
        IdentificationError: the FRFs do not support shapes at the given modes.
        UpdatingError: a stage did not converge; it carries the best iterate.
    """
    recipe = recipe or Recipe()
    parametrisation = parametrise(specimen, recipe.parameters)
    laws = _laws(recipe)
    progress("reading the FRFs", 0.0)
    frfs, warnings = _out_of_plane(measurement)
    fitted, held = _split(frfs, recipe)
    modes, shape_warnings = _with_shapes(fitted, measurement.modes)
    forward = _forward(specimen, parametrisation, measurement, frfs, modes)
    elastic = update_elastic(
        forward, modes, lambda share: progress("updating the elastic constants", 0.1 + 0.4 * share)
    )
    band = _band(recipe, fitted, elastic)
    stage = DampingStage(fitted.band(*band), elastic, modes, recipe.weighting)
    damping = stage.fit(laws[0], lambda share: progress("updating the damping", 0.5 + 0.4 * share))
    progress("correlating", 0.9)
    result = Report(elastic, damping, modes, frfs, fitted, held, band).result()
    progress("done", 1.0)
    return replace(result, warnings=(*warnings, *shape_warnings, *result.warnings))


def _laws(recipe: Recipe) -> tuple[DampingLaw, ...]:
    if not recipe.damping_models:
        raise InputError("damping_models", "is empty, expected at least one")
    for index, name in enumerate(recipe.damping_models):
        if name not in LAWS:
            raise InputError(f"damping_models.{index}", f"is {name!r}, expected one of {', '.join(LAWS)}")
    return tuple(LAWS[name] for name in recipe.damping_models)


def _out_of_plane(measurement: Measurement) -> tuple[FrfSet, tuple[str, ...]]:
    """The FRFs between ±z directions of known points, without a line at 0 Hz; what was left out, in words."""
    frfs = measurement.frfs
    pairs = list(zip(frfs.responses, frfs.references, strict=True))
    flat = [i for i, pair in enumerate(pairs) if all(dof.axis == OUT_OF_PLANE for dof in pair)]
    known = [i for i in flat if all(dof.point in measurement.points for dof in pairs[i])]
    warnings = []
    if len(flat) < len(pairs):
        warnings.append(f"{len(pairs) - len(flat)} FRFs are not out of plane (±Z to ±Z) and were left out")
    if len(known) < len(flat):
        missing = sorted({dof.point for i in flat for dof in pairs[i]} - set(measurement.points))
        raise InputError("grid_points", f"points {', '.join(map(str, missing))} have FRFs but no coordinates; add them")
    if not known:
        raise InputError("frfs", "none is out of plane (±Z to ±Z), which is what the bending model predicts")
    chosen = frfs.select(known)
    if chosen.frequency_hz[0] == 0:
        chosen = chosen.band(float(np.nextafter(0, 1)), float(chosen.frequency_hz[-1]))
    return chosen, tuple(warnings)


def _split(frfs: FrfSet, recipe: Recipe) -> tuple[FrfSet, FrfSet | None]:
    """FRFs to fit, and those whose points are held out."""
    points = set(recipe.hold_out.points)
    if not points:
        return frfs, None
    used = {dof.point for dof in (*frfs.responses, *frfs.references)}
    if points - used:
        raise InputError("hold_out.points", f"{sorted(points - used)} have no FRFs in this campaign")
    # A fixed dof belongs to every FRF; holding out its point holds out the driving-point FRF alone.
    fixed = {dofs[0].point for dofs in (frfs.responses, frfs.references) if len(set(dofs)) == 1}
    roving = [
        {dof.point for dof in pair} - fixed or {pair[0].point}
        for pair in zip(frfs.responses, frfs.references, strict=True)
    ]
    held = [i for i, places in enumerate(roving) if places & points]
    kept = [i for i in range(len(roving)) if i not in set(held)]
    if not kept:
        raise InputError("hold_out.points", "holds out every FRF, so nothing is left to fit")
    return frfs.select(kept), frfs.select(held)


def _with_shapes(frfs: FrfSet, modes: MeasuredModes) -> tuple[MeasuredModes, tuple[str, ...]]:
    """The modes with shapes at measured points; where none were given, from the FRFs at the given poles."""
    if modes.shapes is not None:
        return _out_of_plane_shapes(frfs, modes)
    if np.any(np.isnan(modes.damping_ratio)) or np.any(modes.damping_ratio == 0):
        return modes, ("modes were paired by frequency: without damping ratios their shapes cannot be found from FRFs",)
    # Above the last mode's skirt the FRFs belong to modes that were not typed in.
    top = modes.frequency_hz[-1] * (1 + 3 * modes.damping_ratio[-1])
    found, _ = shapes_at_poles(
        frfs, modes.frequency_hz, modes.damping_ratio, band_hz=(float(frfs.frequency_hz[0]), float(top))
    )
    return replace(modes, shapes=found.shapes, dofs=found.dofs), ()


def _out_of_plane_shapes(frfs: FrfSet, modes: MeasuredModes) -> tuple[MeasuredModes, tuple[str, ...]]:
    """The modes with their shapes along +z at points that have FRFs; without such dofs the shapes are of no use."""
    points = {dof.point for dof in (*frfs.responses, *frfs.references)}
    columns = [i for i, dof in enumerate(modes.dofs) if dof.axis == OUT_OF_PLANE and dof.point in points]
    if not columns or modes.shapes is None:
        warning = "modes were paired by frequency: their shapes have no out-of-plane value at a point with FRFs"
        return replace(modes, shapes=None, dofs=()), (warning,)
    sign = np.array([modes.dofs[i].sign for i in columns])
    dofs = tuple(Dof(modes.dofs[i].point, OUT_OF_PLANE) for i in columns)
    return replace(modes, shapes=modes.shapes[:, columns] * sign, dofs=dofs), ()


def _forward(
    specimen: Specimen,
    parametrisation: Parametrisation,
    measurement: Measurement,
    frfs: FrfSet,
    modes: MeasuredModes,
) -> ForwardModel:
    """The forward model at all measured points, those of the modes' shapes first and in their order."""
    first = [dof.point for dof in modes.dofs]
    rest = sorted({dof.point for dof in (*frfs.responses, *frfs.references)} - set(first))
    points = (*first, *rest)
    places = np.array([measurement.points[point][:2] for point in points])
    count = modes_to_cover(specimen, float(frfs.frequency_hz[-1]), len(modes) + _EXTRA_MODES)
    return ForwardModel(specimen, parametrisation, points, places, count)


def _band(recipe: Recipe, frfs: FrfSet, elastic: ElasticResult) -> tuple[float, float]:
    """Lines for stage 2. By default they end half-way to the first model mode above the paired ones.

    A mode that was not measured carries no frequency shift, so its misfit would be taken for damping.
    """
    low, high = float(frfs.frequency_hz[0]), float(frfs.frequency_hz[-1])
    if recipe.band_hz is not None:
        low, high = recipe.band_hz
        if not 0 <= low < high:
            raise InputError("band_hz", f"is ({low:g}, {high:g}), expected 0 ≤ low < high")
        return low, high
    frequencies = elastic.updated.frequency_hz
    last = max(column for _, column in elastic.pairing.pairs)
    if last + 1 < frequencies.size:
        high = min(high, float(np.sqrt(frequencies[last] * frequencies[last + 1])))
    return low, high
