"""The main job: a measurement, a specimen and a recipe in; updated parameters with their uncertainty out.

The one entry point of updating, for a notebook as for the service.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from fecore.damping import RAYLEIGH, CaugheySeries, DampingLaw, GeneralisedProportional, ModalDamping
from fecore.errors import InputError, UpdatingError
from fecore.frf import FrfSet
from fecore.modes import MeasuredModes
from fecore.specimen import Body
from fecore.updating.damping_stage import DampingResult, DampingStage
from fecore.updating.elastic import ElasticResult, update_elastic
from fecore.updating.forward import ForwardModel, modes_to_cover
from fecore.updating.joint import update_jointly
from fecore.updating.ladder import climb, told_by
from fecore.updating.measurement import Measurement, Prepared, prepare
from fecore.updating.parameters import Parametrisation, parametrise
from fecore.updating.plausibility import examine
from fecore.updating.recipe import Recipe
from fecore.updating.report import Report
from fecore.updating.result import UpdateResult
from fecore.updating.sampling import Keeper, Posterior, sample_posterior

Progress = Callable[[str, float], None]
"""Told the stage in words and the share of the whole job that is done; raise from it to cancel."""

LAWS: Mapping[str, DampingLaw] = {
    "rayleigh": RAYLEIGH,
    "caughey3": CaugheySeries("caughey3", (0, 1, 2)),
    "caughey4": CaugheySeries("caughey4", (0, 1, 2, 3)),
}
"""Damping laws by name, but for `generalised` and `modal`, which depend on the measured modes."""

_ELASTIC = "updating the elastic constants"
_EXTRA_MODES = 3  # beyond the measured ones, at least, so that neighbours can be paired


def update(
    measurement: Measurement,
    specimen: Body,
    recipe: Recipe | None = None,
    progress: Progress = lambda *_: None,
    keeper: Keeper | None = None,
) -> UpdateResult:
    """Update a specimen's elastic constants and damping from a measurement.

    Args:
        measurement: what was measured.
        specimen: nominal specimen.
        recipe: how to use the measurement; the defaults suit a first look.
        progress: told the stage and the share that is done; raise from it to cancel.
        keeper: keeps a long chain of samples, so that a job that was killed goes on with it.

    Raises:
        InputError: the measurement or the recipe is wrong; it names the field.
        IdentificationError: the FRFs support no modes, or no shapes at the given ones.
        UpdatingError: a stage did not converge; it carries the best iterate.
    """
    recipe = recipe or Recipe()
    parametrisation = parametrise(specimen, recipe.parameters)
    progress("identifying the modes" if measurement.modes is None else "finding mode shapes", 0.0)
    # Under a roving sensor the FRFs have no common modes to be identified.
    data = prepare(
        measurement, specimen, recipe.hold_out, find_modes=recipe.method == "two_stage" and not measurement.roving_mass
    )
    forward = _forward(specimen, parametrisation, measurement, data)
    progress(_ELASTIC, 0.4)
    elastic, modes = _elastic(forward, data, recipe, lambda share: progress(_ELASTIC, 0.4 + 0.2 * share))
    band = _band(recipe, data.fitted, elastic)
    stage = DampingStage(_inside(data.fitted, band, recipe), elastic, modes, recipe.weighting)
    asked = _laws(recipe, stage.modal_law)
    laws = told_by(len(stage.rows), asked) or asked  # where they can tell none, the fit says so
    doubts = [*_unasked(asked[0], laws[0], len(stage.rows)), *examine(stage)]
    damping = _damping(stage, laws[0], doubts, lambda share: progress("updating the damping", 0.6 + 0.1 * share))
    ladder = climb(stage, laws)
    sampled = _sampled(recipe, elastic, stage, damping, progress, keeper)
    progress("correlating", 0.95)
    result = Report(elastic, damping, ladder, modes, data, band, recipe.hold_out.band_hz, sampled).result()
    progress("done", 1.0)
    return replace(result, warnings=(*data.warnings, *_roving(measurement, recipe), *doubts, *result.warnings))


def _roving(measurement: Measurement, recipe: Recipe) -> list[str]:
    """What a roving sensor's mass means for the result, in words."""
    if not measurement.roving_mass:
        return []
    text = (
        f"the sensor of {1e3 * measurement.roving_mass:.3g} g moved with the response, so the FRFs have no common modes: "
        "constants and modes (those without the sensor) come from the FRFs through the loaded model, as with the method joint"
    )
    if measurement.modes is not None and recipe.method == "two_stage":
        text += "; the mode set was not used"
    return [text]


def _elastic(
    forward: ForwardModel, data: Prepared, recipe: Recipe, progress: Callable[[float], None]
) -> tuple[ElasticResult, MeasuredModes]:
    """The elastic constants and the modes that they were judged by: stage 1, or the joint fit of the FRFs."""
    if data.modes is not None:
        return update_elastic(forward, data.modes, progress, use_shapes=recipe.use_shapes), data.modes
    frfs = data.fitted if recipe.band_hz is None else data.fitted.band(*recipe.band_hz)
    frfs = _inside(frfs, (0.0, np.inf), recipe)
    # There every mode deviates from the law as far as it must, so `modal` is one common ratio to deviate from.
    middle = float(np.sqrt(frfs.omega[0] * frfs.omega[-1]))
    law = _laws(recipe, ModalDamping((middle,)))[0]
    found = update_jointly(forward, frfs, law, recipe.seed, progress)
    return found.elastic, found.modes


def _damping(
    stage: DampingStage, law: DampingLaw, doubts: list[str], progress: Callable[[float], None]
) -> DampingResult:
    """Stage 2; where it fails, what looked wrong before it is told with the failure."""
    try:
        return stage.fit(law, many_starts=True, progress=progress)
    except UpdatingError as error:
        raise UpdatingError("; ".join([error.message, *doubts]), error.best, error.history) from error


def _sampled(
    recipe: Recipe,
    elastic: ElasticResult,
    stage: DampingStage,
    damping: DampingResult,
    progress: Progress,
    keeper: Keeper | None,
) -> Posterior | None:
    if recipe.posterior == "laplace":
        return None
    return sample_posterior(
        elastic,
        stage,
        damping,
        recipe.seed,
        progress=lambda share: progress("sampling the posterior", 0.7 + 0.25 * share),
        keeper=keeper,
    )


def _laws(recipe: Recipe, modal: ModalDamping) -> tuple[DampingLaw, ...]:
    """The recipe's laws; `modal` has the measured modes as its knots, `generalised` turns in their middle."""
    if not recipe.damping_models:
        raise InputError("damping_models", "is empty, expected at least one")
    middle = float(np.exp(np.mean(np.log(modal.knots))))
    generalised = GeneralisedProportional(("constant", "root", "stiffness"), middle)
    known: dict[str, DampingLaw] = {**LAWS, generalised.name: generalised, modal.name: modal}
    for index, name in enumerate(recipe.damping_models):
        if name not in known:
            raise InputError(f"damping_models.{index}", f"is {name!r}, expected one of {', '.join(known)}")
    return tuple(known[name] for name in recipe.damping_models)


def _unasked(asked: DampingLaw, law: DampingLaw, modes: int) -> list[str]:
    """That another law takes the place of the first one, in words."""
    if law is asked:
        return []
    count = "one measured mode cannot" if modes == 1 else f"{modes} measured modes cannot"
    return [
        f"{count} fix the {len(asked.coefficient_names)} coefficients of the {asked.name} law, so the damping is that of"
        f" the {law.name} law; a wider band with more modes would tell"
    ]


def _forward(
    specimen: Body, parametrisation: Parametrisation, measurement: Measurement, data: Prepared
) -> ForwardModel:
    """The forward model at all measured points, those of the modes' shapes first and in their order."""
    first = [] if data.modes is None else [dof.point for dof in data.modes.dofs]
    rest = sorted({dof.point for dof in (*data.frfs.responses, *data.frfs.references)} - set(first))
    points = (*first, *rest)
    places = np.array([measurement.points[point][:2] for point in points])
    measured = 0 if data.modes is None else len(data.modes)
    count = modes_to_cover(parametrisation, float(data.frfs.frequency_hz[-1]), measured + _EXTRA_MODES)
    # Under a roving sensor a basis would have to hold the static deflections of every point: the full model is quicker.
    mass = measurement.roving_mass
    return ForwardModel(specimen, parametrisation, points, places, count, reduced=not mass, roving_mass=mass)


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


def _inside(frfs: FrfSet, band: tuple[float, float], recipe: Recipe) -> FrfSet:
    """The FRFs on the fitted lines: in the band, and not held out."""
    inside = frfs.band(*band)
    if recipe.hold_out.band_hz is None:
        return inside
    try:
        return inside.without(*recipe.hold_out.band_hz)
    except InputError as error:
        raise InputError("hold_out.band_hz", "holds out every line of the fitted band") from error
