"""The main job: a measurement, a specimen and a recipe in; updated parameters with their
uncertainty out.

The one entry point of updating, for a notebook as for the service.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from fecore.body.constants import Body
from fecore.dynamics.damping_laws import DampingLaw, ModalDamping
from fecore.errors import FecoreError, InputError, UpdatingError
from fecore.findings import Finding, Level
from fecore.frf import Dof, FrfSet
from fecore.modes import MeasuredModes
from fecore.updating.campaigns import check_temperatures
from fecore.updating.damage import with_damage_intervals
from fecore.updating.damping_data import damping_data, examine
from fecore.updating.damping_stage import fit_damping, fit_reference, unstated_window
from fecore.updating.elastic import settled
from fecore.updating.elastic_findings import mesh_on_trust, points_beyond
from fecore.updating.elastic_result import HOPELESS_MISS, ElasticResult
from fecore.updating.elastic_starts import (
    update_from_several_starts,
    update_on_finest_mesh,
    with_sparse_factors,
)
from fecore.updating.forward import ForwardModel
from fecore.updating.frf_fits import JointProblem
from fecore.updating.inputs import Inputs, fixed_points, with_temperature
from fecore.updating.laws import identifiable_laws, laws_of, paired_ratios, rank_laws
from fecore.updating.layout import Layout
from fecore.updating.measurement import Measurement, PreparedMeasurement, Recipe, prepare
from fecore.updating.mesh import DISCRETISATION, Discretisation, meshed
from fecore.updating.parameters import Parametrisation, parametrise
from fecore.updating.result import UpdateResult, finding, passed_on
from fecore.updating.sampling import Checkpoint, sample_posterior
from fecore.updating.summary import DampingOutcome, Summary

Progress = Callable[[str, float], None]
"""Called with the stage in words and the share of the whole job that is done; raise from it to
cancel.
"""

_ELASTIC, _DAMPING = "updating the elastic constants", "updating the damping"


def update(
    measurement: Measurement,
    specimen: Body,
    recipe: Recipe | None = None,
    progress: Progress = lambda *_: None,
    checkpoint: Checkpoint | None = None,
) -> UpdateResult:
    """Update a specimen's elastic constants and damping from a measurement.

    1. The constants that the recipe names are the parameters θ, with their priors, at the
       temperature of the measurement; the laboratory's inputs are let go about their values.
    2. The measurement is made ready: its modes, identified from the FRFs where none are given, with
       shapes where FRFs show them.
    3. The specimen has a mesh for the band, and a model whose modes are seen at the measured points
       along the measured directions.
    4. Stage 1: the elastic constants from natural frequencies and mode shapes (Eqs. 12-14), the
       modes paired with the model's.
    5. Stage 2: the damping law from the FRFs of the updated model (Eq. 11). It fails alone: where
       damping cannot be had, the elastic constants stand, and the result's outcomes say why.
    6. The posterior of both is sampled where the recipe asks for it.
    7. What was found on the way is put together once: the verdict, the warnings and the result.

    Args:
        measurement: what was measured: FRFs, modes, or both.
        specimen: nominal specimen.
        recipe: how to use the measurement; the defaults suit a first look.
        progress: called with the stage and the share that is done; raise from it to cancel.
        checkpoint: keeps a long chain of samples, so that a job that was killed goes on with it.

    Raises:
        InputError: the measurement or the recipe is wrong; it names the field.
        IdentificationError: the FRFs support no modes, or no shapes at the given ones.
        UpdatingError: the elastic constants did not converge; it carries the best iterate.
    """
    recipe, inputs = recipe or Recipe(), measurement.inputs
    # 1. Parameters and inputs.
    parameters = specimen.default_parameters() if recipe.parameters is None else recipe.parameters
    temperatures, stated = [measurement.temperature_c], recipe.reference_temperature_c
    reference = check_temperatures(parameters, specimen, temperatures, stated)
    known = with_temperature(
        parametrise(specimen, parameters), reference, measurement.temperature_c, reported=False
    )
    parametrisation = known.with_inputs(inputs.standard_deviations(specimen.nominal))
    # 2. Measurement.
    data = _prepared(measurement, specimen, recipe, progress)
    # 3. Mesh and model.
    body, mesh = meshed(specimen, _highest_hz(data))
    forward = _forward(replace(parametrisation, body=body), measurement, data)
    # 4. Stage 1.
    progress(_ELASTIC, 0.4)
    elastic, modes = _elastic(
        forward, data, recipe, inputs, lambda share: progress(_ELASTIC, min(0.4 + 0.2 * share, 0.6))
    )
    # 5. Stage 2.
    stage = _Damping(
        data, elastic, modes, recipe, inputs, lambda share: progress(_DAMPING, 0.6 + 0.1 * share)
    )
    damping = stage.outcome()
    # 6. Samples.
    sampled = None
    if damping.result is not None and recipe.posterior == "mcmc":
        sampled = sample_posterior(
            elastic,
            damping.result,
            recipe.seed,
            progress=lambda share: progress("sampling the posterior", 0.7 + 0.25 * share),
            checkpoint=checkpoint,
        )
    # 7. Findings and result.
    progress("correlating", 0.95)
    findings = [
        *passed_on("measurement", data.notes),
        *([] if mesh is None else _coarse(mesh)),
        *_without_joints(body),
        *mesh_on_trust(forward),
        *points_beyond(forward, inputs),
        *_other_method(measurement, recipe),
        *_unmeasured(measurement),
    ]
    summary = Summary(elastic, modes, damping, data, inputs=inputs, recipe=recipe, sampled=sampled)
    at_c = recipe.reference_temperature_c if reference is not None else measurement.temperature_c
    result = replace(summary.result(findings), reference_temperature_c=at_c)
    progress("done", 1.0)
    return result


def _prepared(
    measurement: Measurement, specimen: Body, recipe: Recipe, progress: Progress
) -> PreparedMeasurement:
    """The measurement ready for updating, a stated window's share of the modes' damping taken
    off.
    """
    progress("identifying the modes" if measurement.modes is None else "finding mode shapes", 0.0)
    # Under a roving sensor the FRFs have no common modes to be identified.
    find_modes = recipe.method == "two_stage" and not measurement.roving_mass
    data = prepare(
        measurement,
        specimen,
        recipe,
        lambda _step, share: progress("identifying the modes", 0.4 * share),
        find_modes=find_modes,
    )
    return (
        data
        if data.modes is None
        else replace(data, modes=_unwindowed(data.modes, measurement.inputs))
    )


def _coarse(mesh: Discretisation) -> list[Finding]:
    """That the finest mesh allowed is too coarse."""
    worst, (nx, ny) = float(mesh.error.max(initial=0.0)), mesh.divisions
    return (
        [finding("mesh_misses", nx=nx, ny=ny, percent=100 * worst)]
        if worst > DISCRETISATION
        else []
    )


def _without_joints(body: Body) -> list[Finding]:
    """That walls meet without a model of their joint."""
    if body.with_joints or not body.model_error:
        return []
    return [finding("without_joints", percent=100 * body.model_error)]


def _highest_hz(data: PreparedMeasurement) -> float:
    """The highest frequency at which the model has to be right: that of the last measured mode, or
    of the last line.
    """
    if data.modes is not None:
        return 1.05 * float(data.modes.frequency_hz[-1])
    assert data.frfs is not None, "a measurement has FRFs or modes"
    return float(data.frfs.frequency_hz[-1])


def _unwindowed(modes: MeasuredModes, inputs: Inputs) -> MeasuredModes:
    """The modes without a stated window's share of their damping: ζ - 1/(τω)."""
    if not inputs.window_rate:
        return modes
    ratio = modes.damping_ratio - inputs.window_rate / (2 * np.pi * modes.frequency_hz)
    if np.any(ratio <= 0):
        worst = int(np.argmin(ratio))
        raise InputError(
            "inputs.window_rate",
            f"of {inputs.window_rate:g} 1/s is more than measured mode {worst + 1} decays by"
            f" ({modes.damping_ratio[worst] * 2 * np.pi * modes.frequency_hz[worst]:.3g} 1/s): the"
            " window was not this one",
        )
    return replace(modes, damping_ratio=ratio)


def _other_method(measurement: Measurement, recipe: Recipe) -> list[Finding]:
    """Where another method was used than the recipe's: under a roving sensor's mass, and without
    FRFs.
    """
    if measurement.frfs is None and recipe.method == "joint":
        return [finding("joint_needs_frfs")]
    if not measurement.roving_mass:
        return []
    unused = measurement.modes is not None and recipe.method == "two_stage"
    grams = 1e3 * measurement.roving_mass
    return [
        finding(
            "roving_sensor", grams=grams, unused="; the mode set was not used" if unused else ""
        )
    ]


def _unmeasured(measurement: Measurement) -> list[Finding]:
    """That nobody measured the loads under which the modes were found."""
    of_responses = measurement.modes is None and bool(measurement.spectra)
    if measurement.loads_measured and not of_responses:
        return []
    without = ": frequencies, shapes and damping ratios were fitted, and no FRFs"
    return [finding("loads_unmeasured", without="" if measurement.frfs is not None else without)]


def _elastic(
    forward: ForwardModel,
    data: PreparedMeasurement,
    recipe: Recipe,
    inputs: Inputs,
    progress: Callable[[float], None],
) -> tuple[ElasticResult, MeasuredModes]:
    """The elastic constants and the modes that they were judged by: stage 1, or the joint fit of
    the FRFs.
    """
    fixed = () if data.frfs is None else fixed_points(*data.frfs.points)
    if data.modes is not None:
        layout = Layout.of_one(forward, data.modes, inputs, fixed)
        elastic = update_on_finest_mesh(
            layout,
            lambda at: update_from_several_starts(
                at, progress, use_shapes=recipe.use_shapes, seed=recipe.seed
            ),
        )
        if elastic.unlike:
            return elastic, data.modes
        return with_damage_intervals(with_sparse_factors(elastic, recipe), recipe), data.modes
    assert data.fitted is not None, "without modes there are FRFs"
    frfs = data.fitted if recipe.band_hz is None else data.fitted.band(*recipe.band_hz)
    frfs = _inside(frfs, (0.0, np.inf), recipe)
    # There every mode deviates from the law as far as it must, so `modal` is one common ratio to
    # deviate from.
    middle = float(np.sqrt(frfs.omega[0] * frfs.omega[-1]))
    law = laws_of(recipe, ModalDamping((middle,)), forward.specimen)[0]
    joint = settled(JointProblem(forward, frfs, law, inputs, fixed).update(recipe.seed, progress))
    return joint.elastic, _unwindowed(joint.modes, inputs)


@dataclass(frozen=True)
class _Failed:
    """A fit to FRFs that gave no law."""

    error: FecoreError
    findings: tuple[Finding, ...]  # what is worth saying all the same

    @property
    def message(self) -> str:
        """Why, in words."""
        return self.error.message if isinstance(self.error, UpdatingError) else str(self.error)

    @property
    def was_sought(self) -> bool:
        """Whether a fit began and did not converge: another may. Where the data allow none there is
        nothing to be repeated.
        """
        return isinstance(self.error, UpdatingError) and bool(self.error.best)


@dataclass(frozen=True)
class _Damping:
    """Stage 2: from the FRFs, or from typed damping ratios alone where there are none."""

    data: PreparedMeasurement
    elastic: ElasticResult
    modes: MeasuredModes
    recipe: Recipe
    inputs: Inputs
    progress: Callable[[float], None]

    def outcome(self) -> DampingOutcome:
        """The laws of the whole band, or of the widest that a fit converges in.

        Raises:
            InputError: the recipe's band is wrong, or has no lines.
        """
        if self.data.fitted is None:
            return self._of_ratios()
        band = self._band(self.data.fitted)
        first = self._of_frfs(self.data.fitted, band)
        if isinstance(first, DampingOutcome):
            return first
        if isinstance(first.error, InputError):
            raise first.error
        for low, high in self._narrower(band) if first.was_sought else ():
            done = self._of_frfs(self.data.fitted, (low, high))
            if isinstance(done, DampingOutcome):
                narrowed = finding("damping_narrowed", low=low, high=high, text=first.message)
                return replace(done, findings=(*done.findings, narrowed))
        return self._without_fit(band, first)

    def _without_fit(self, band: tuple[float, float], failed: _Failed) -> DampingOutcome:
        """Where no fit to FRFs ends: laws from the modes' damping ratios, if a fit was sought; else
        why there is no damping.
        """
        message, hopeless = failed.message, self.elastic.misfit > HOPELESS_MISS
        if failed.was_sought and not hopeless:
            done = self._of_ratios()
            if done.ranking is not None:
                of_ratios = finding("damping_of_ratios", text=message)
                why = f"from the modes' damping ratios, since {message}"
                every = (*failed.findings, *done.findings, of_ratios)
                return replace(done, message=why, band=band, findings=every)
        level: Level | None = "do_not_use" if hopeless else None
        notes = (*failed.findings, finding("damping_failed", level=level, text=message))
        return DampingOutcome("failed", message, band, findings=notes)

    def _of_frfs(self, frfs: FrfSet, band: tuple[float, float]) -> DampingOutcome | _Failed:
        """Laws fitted to the FRFs of a band."""
        findings: tuple[Finding, ...] = ()
        try:
            inside = _inside(frfs, band, self.recipe)
            weighting = self.recipe.weighting
            stage = damping_data(inside, self.elastic, self.modes, weighting, self.inputs)
            requested = self._laws(stage.modal_law)
            # where there is none, the fit says so
            laws = identifiable_laws(len(stage.rows), requested) or requested
            stage, odd = examine(stage)
            findings = (*_unasked(requested[0], laws[0], len(stage.rows)), *odd)
            reference = fit_reference(stage)
            ranking = rank_laws(reference.ratios, stage.rows, laws)
            result = fit_damping(stage, reference, laws[0], self.progress, ranking.laws[0].strain)
        except FecoreError as error:
            return _Failed(error, findings)
        step = float(np.median(np.diff(inside.frequency_hz)))
        findings += tuple(unstated_window(result, self.inputs, 1 / step))
        return DampingOutcome("succeeded", "", band, ranking, result, findings)

    def _of_ratios(self) -> DampingOutcome:
        """Laws from the damping ratios of the paired modes, without FRFs."""
        rows, ratios = paired_ratios(self.elastic, 0, self.modes)
        if not rows:
            return DampingOutcome(
                "skipped", "there are no FRFs, and no paired mode has a damping ratio"
            )
        requested = self._laws(ModalDamping(tuple(np.sort(ratios.omega))))
        laws = identifiable_laws(len(rows), requested)
        if not laws:
            return DampingOutcome(
                "skipped", f"{len(rows)} damping ratios cannot fix any of the laws asked for"
            )
        message = "from the modes' damping ratios: there are no FRFs"
        findings = tuple(_unasked(requested[0], laws[0], len(rows)))
        return DampingOutcome(
            "succeeded", message, ranking=rank_laws(ratios, rows, laws), findings=findings
        )

    def _laws(self, modal: ModalDamping) -> tuple[DampingLaw, ...]:
        return laws_of(self.recipe, modal, self.elastic.prior.body)

    def _band(self, frfs: FrfSet) -> tuple[float, float]:
        """Lines for stage 2. By default they end half-way to the first model mode above the paired
        ones.

        A mode that was not measured carries no frequency shift, so its misfit would be taken for
        damping.
        """
        low, high = float(frfs.frequency_hz[0]), float(frfs.frequency_hz[-1])
        if self.recipe.band_hz is not None:
            low, high = self.recipe.band_hz
            if not 0 <= low < high:
                raise InputError("band_hz", f"is ({low:g}, {high:g}), expected 0 ≤ low < high")
            return low, high
        frequencies = self.elastic.updated.frequency_hz
        last = max(column for _, column in self.elastic.pairing.pairs)
        if last + 1 < frequencies.size:
            high = min(high, float(np.sqrt(frequencies[last] * frequencies[last + 1])))
        return low, high

    def _narrower(self, band: tuple[float, float]) -> Iterator[tuple[float, float]]:
        """For a fit that does not converge in the band of stage 2: without the highest of its
        modes, two, three ... while two are left, and without the lowest.
        """
        columns = [column for _, column in self.elastic.pairing.pairs]
        frequencies = np.sort(self.elastic.updated.frequency_hz[columns])
        inside = frequencies[(frequencies > band[0]) & (frequencies < band[1])]
        between = np.sqrt(inside[:-1] * inside[1:])
        yield from ((band[0], float(high)) for high in between[:0:-1])
        if between.size > 1:
            yield float(between[0]), band[1]


def _unasked(requested: DampingLaw, law: DampingLaw, modes: int) -> list[Finding]:
    """That another law takes the place of the first one."""
    if law is requested:
        return []
    cannot = "one measured mode cannot" if modes == 1 else f"{modes} measured modes cannot"
    count = len(requested.coefficient_names)
    return [
        finding("law_replaced", modes=cannot, count=count, requested=requested.name, law=law.name)
    ]


def _forward(
    parametrisation: Parametrisation, measurement: Measurement, data: PreparedMeasurement
) -> ForwardModel:
    """The forward model at all measured dofs, those of the modes' shapes first and in their
    order.
    """
    first = () if data.modes is None else data.modes.dofs
    dofs = () if data.frfs is None else (*data.frfs.responses, *data.frfs.references)
    rows = (*first, *sorted({Dof(dof.point, dof.axis) for dof in dofs} - set(first)))
    axis = data.modes if data.frfs is None else data.frfs
    assert axis is not None, "a measurement has FRFs or modes"
    highest, measured = float(axis.frequency_hz[-1]), 0 if data.modes is None else len(data.modes)
    return ForwardModel.of_dofs(
        parametrisation,
        rows,
        measurement.points,
        highest,
        modes=measured,
        roving_mass=measurement.roving_mass,
        axes=measurement.axes,
    )


def _inside(frfs: FrfSet, band: tuple[float, float], recipe: Recipe) -> FrfSet:
    """The FRFs on the fitted lines: in the band, and not held out."""
    inside = frfs.band(*band)
    if recipe.hold_out.band_hz is None:
        return inside
    try:
        return inside.without(*recipe.hold_out.band_hz)
    except InputError as error:
        raise InputError("hold_out.band_hz", "holds out every line of the fitted band") from error
