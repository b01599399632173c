"""Results, campaigns and time blocks that lack something: what is left out, and what is said where nothing remains."""

import io
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any
from uuid import UUID

import numpy as np
import pytest
from pydantic import ValidationError

from fecore.body.laminate import OrthotropicMaterial
from fecore.body.laminate import Ply as CorePly
from fecore.errors import InputError, UpdatingError
from fecore.frf import Dof
from fecore.updating.recipe import Recipe
from fecore.updating.result import PosteriorSummary
from modalbase.formats.records import TimeBlock
from service.compute.judging import _same_mode
from service.compute.result_arrays import as_npz
from service.compute.updating import _measured, _within_force
from service.errors import Conflict, Damaged, Invalid, NotFound
from service.monitoring import judgements
from service.monitoring.runs import _held_otherwise, watched_values
from service.monitoring.schemas import WatchedIn
from service.show import hits as record_figures
from service.show.results import predictions
from service.store.frfs import data
from service.store.frfs.data import MeasuredFrfs
from service.store.imports.intake import Intake
from service.store.modes import identifications
from service.store.records import operations as record_operations
from service.store.records import processings
from service.store.records.operations import RecordIntake
from service.store.updating import bodies, loading, operations
from service.store.updating.batches import _placed
from service.store.updating.document import _agreement, _posterior
from service.store.updating.loading import _with_sensor_of, carried_masses
from service.store.updating.result_schemas import DampingLawOut
from service.store.updating.schemas import RecipeIn

HERE = UUID(int=1)
FIBRE = OrthotropicMaterial(Ex=1e10, Ey=1e9, Gxy=1e9, Gxz=1e9, Gyz=1e9, nu_xy=0.0, density=2000.0)


@dataclass
class Row:
    """As much of a stored FRF as says what it is of."""

    response_point: int
    response_direction: int = 3
    reference_point: int = 9
    reference_direction: int = 3


def test_predictions_are_assigned_where_the_frame_is_still_theirs(monkeypatch: pytest.MonkeyPatch) -> None:
    job: Any = SimpleNamespace(campaign_id=HERE)
    rows: list[Any] = [Row(1), Row(2), Row(3)]
    monkeypatch.setattr(predictions, "campaign_of", lambda *_: None)
    monkeypatch.setattr(predictions, "frame_of", lambda _: SimpleNamespace(dof=lambda dof: dof))
    some = [(Dof(1, 3), Dof(9, 3)), (Dof(3, 3), Dof(9, 3))]
    assert predictions.used_frfs(job, job, rows, some) == [rows[0], rows[2]]
    assert predictions.used_frfs(job, job, rows[:2], some) == rows[:2]
    with pytest.raises(Conflict, match="the campaign's frame was changed after this update: restore it"):
        predictions.used_frfs(job, job, rows, [(Dof(1, -3), Dof(9, 3))])


def test_arrays_and_document_of_a_result_without_prediction_shapes_and_samples() -> None:
    posterior = SimpleNamespace(samples=None)
    correlation = SimpleNamespace(initial=None, updated=None)
    bare: Any = SimpleNamespace(
        prediction=None, shapes=None, posterior=posterior, correlation=correlation, band_hz=None
    )
    with np.load(io.BytesIO(as_npz(bare))) as found:
        assert {name: values.size for name, values in found.items()} == dict.fromkeys(
            ("frequency_hz", "responses", "references", "initial", "updated"), 0
        )
    posterior.samples = np.arange(5000.0)[:, None]
    with np.load(io.BytesIO(as_npz(bare))) as found:
        assert found["samples"].ravel()[:3].tolist() == [0.0, 3.0, 6.0]  # 2000 at most
    assert _agreement(None) == {"sac": [], "frac": [], "csac_mean": None, "csf_mean": None}
    gaussian = PosteriorSummary("gaussian", (), (), (), (), samples=None, correlation=None)
    assert _posterior(gaussian) == {"method": "gaussian"}
    one = np.ones((1, 1))
    assert _posterior(replace(gaussian, names=("Ex",), correlation=one, samples=one))["samples"] == 1
    laws = {"name": "a", "coefficients": {}, "preferred": False, "missed": np.array([0.1, np.nan]), "bic": np.inf}
    shown = DampingLawOut.model_validate(laws).model_dump(mode="json", exclude_unset=True)
    assert (shown["bic"], shown["missed"]) == (None, [0.1, None])


def test_faults_of_a_batch_are_placed_in_its_job() -> None:
    errors: list[tuple[Any, str, str]] = [
        (NotFound("campaign", "x"), "/jobs/2/campaign_id", "no campaign x"),
        (Invalid("/hold_out", "is too much"), "/jobs/2/recipe/hold_out", "is too much"),
        (InputError("identification.band_hz", "is empty"), "/jobs/2/recipe/identification/band_hz", "is empty"),
        (UpdatingError("no modes", {}, ()), "/jobs/2", "no modes"),
    ]
    for error, pointer, detail in errors:
        (fault,) = _placed(error, 2)
        assert (fault.pointer, fault.detail) == (pointer, detail)


def a_campaign(**known: Any) -> Any:
    @dataclass(frozen=True)
    class Campaign:
        sensor_mass_kg: float = 0.002
        sensor_point: int | None = None
        added_masses: tuple[Any, ...] = ()
        points: Any = None
        frf_sets: tuple[Any, ...] = ()
        structure: Any = field(default_factory=lambda: SimpleNamespace(shape=None, model=None))

    return Campaign(**known)


def test_the_sensor_of_time_blocks_is_where_all_of_them_were_recorded() -> None:
    def records(*points: int) -> Any:
        rows = [SimpleNamespace(point=point, quantity="acceleration") for point in points]
        return SimpleNamespace(points=[SimpleNamespace(rows=[*rows, SimpleNamespace(point=8, quantity="force")])])

    free, stated = a_campaign(), a_campaign(sensor_point=5)
    assert _with_sensor_of(free, records(3, 3)).sensor_point == 3
    assert _with_sensor_of(free, records(3, 4)) is free
    assert _with_sensor_of(stated, records(3)) is stated
    with pytest.raises(InputError, match="5 is not a grid point of the campaign"):
        carried_masses(a_campaign(sensor_point=5, points={3: (0, 0, 0)}))


def test_what_a_recipe_or_campaign_states_is_kept_where_hits_would_say_otherwise() -> None:
    frfs: Any = SimpleNamespace(frequency_hz=np.array([2.0, 4.0]))
    processed: Any = SimpleNamespace(frfs=frfs, strong_hz=800.0, rate_per_s=3.0)
    recipe, notes = _within_force(Recipe(), processed)
    assert (recipe.identification.band_hz, len(notes)) == ((2.0, 800.0), 1)
    stated = replace(Recipe(), identification=replace(Recipe().identification, band_hz=(10.0, 90.0)))
    assert _within_force(stated, processed) == (stated, ())

    @dataclass(frozen=True)
    class Part:
        responses: tuple[Dof, ...] = ()
        references: tuple[Dof, ...] = ()
        window_rate: float | None = None

    for rate, kept in ((None, 3.0), (5.0, 5.0)):
        hits: Any = SimpleNamespace(inputs=Part(window_rate=rate), frame=None, points={}, roving_mass=0.0)
        made = SimpleNamespace(frfs=Part(), rate_per_s=3.0)
        assert _measured(hits, made).inputs.window_rate == kept


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ([("acceleration", 0, 0)], {0: "is a time block without a point and direction"}),
        ([("acceleration", 2, 0)], {0: "names no force and comes before any force block"}),
        ([("force", 1, 0)], {0: "is the force of hit 1 at point 1, of which the file has no response"}),
        ([("acceleration", 2, 1)], {0: "is a response to hit 1 at point 1, of which the file has no force block"}),
        (
            [("force", 1, 0), ("acceleration", 2, 0, 5)],
            {1: "has 5 samples at 100 Hz, the force of its hit 4 at 100 Hz", 0: "is the force of hit 1 at point 1"},
        ),
        ([("force", 1, 0), ("acceleration", 2, 0)], {}),
    ],
)
def test_time_blocks_of_a_file_that_make_no_whole_hit(given: list[tuple[Any, ...]], why: dict[int, str]) -> None:
    with RecordIntake() as intake:
        refused: dict[int, str] = {}
        for number, (quantity, point, force, *samples) in enumerate(given):
            block = TimeBlock(
                quantity=quantity, samples=np.zeros(*(samples or (4,))), sample_rate_hz=100.0, point=point,
                direction=3 if point else 0, force_point=force, force_direction=3 if force else 0, hit=0,
            )  # fmt: skip
            if (reason := intake.take(number, block)) is not None:
                refused[number] = reason
        refused |= intake.finish()
    assert refused.keys() == why.keys()
    assert all(words in refused[number] for number, words in why.items())


def test_a_strip_is_one_of_known_mass_and_stiffness(monkeypatch: pytest.MonkeyPatch) -> None:
    session: Any = None
    monkeypatch.setattr(processings, "campaign_of", lambda *_: SimpleNamespace(structure_id=HERE))
    size = SimpleNamespace(length_m=1.0, width_m=0.1, thickness_m=0.01)
    whole = {"geometry": size, "density_kg_m3": 2000.0, "laminate": None, "material": SimpleNamespace(Ex_Pa=1e10)}

    def strip(**lacks: Any) -> Any:
        monkeypatch.setattr(processings, "present_structure", lambda *_: (None, SimpleNamespace(**whole | lacks)))
        return processings._strip(session, HERE)

    found = strip()
    assert (found.mass_per_length, found.bending_stiffness) == pytest.approx((2.0, 1e10 * 0.1 * 1e-6 / 12))
    wide = SimpleNamespace(length_m=1.0, width_m=0.5, thickness_m=0.01)
    plies = SimpleNamespace(plies=[SimpleNamespace(to_core=lambda _: CorePly(FIBRE, 0.005, 0.0))] * 2)
    assert strip(laminate=plies).bending_stiffness == pytest.approx(1e10 * 0.1 * 1e-6 / 12, rel=1e-6)
    assert [
        strip(**lacks)
        for lacks in ({"geometry": None}, {"density_kg_m3": None}, {"geometry": wide}, {"material": None})
    ] == [None] * 4
    monkeypatch.setattr(processings, "load_records", lambda *_: None)
    row = SimpleNamespace(campaign_id=HERE, options={})
    with pytest.raises(InputError, match="has no time blocks; POST records first"):
        processings._load(SimpleNamespace(get_one=lambda *_: row), HERE, None)


def test_windows_are_remarked_upon_where_there_are_any() -> None:
    def frfs(*rates: float | None) -> MeasuredFrfs:
        return MeasuredFrfs(None, (), (), frozenset(rates))

    assert (frfs(None).window_remark, frfs(None).window_rate) == ([], None)
    assert "an exponential window of 2, 3 per second" in frfs(3.0, 2.0, None).window_remark[0]
    assert (frfs(3.0).window_rate, frfs(3.0, 2.0).window_rate) == (3.0, None)


@pytest.mark.parametrize(
    ("name", "direction"),
    [("Ex", "fall"), ("frequency_2", "fall"), ("density", "both"), ("damping_ratio_1", "rise"), ("a0", "rise")],
)
def test_a_parameter_is_watched_where_it_is_worse(name: str, direction: str) -> None:
    assert WatchedIn(name=name).watched_direction == direction
    assert WatchedIn(name=name, direction="both").watched_direction == "both"
    with pytest.raises(ValidationError):
        WatchedIn(name=name, direction="up")


def test_a_campaign_that_was_held_otherwise_is_not_compared() -> None:
    monitor: Any = SimpleNamespace(boundary=None)
    seen = [SimpleNamespace(campaign=SimpleNamespace(boundary=boundary)) for boundary in ("free", "free", "cantilever")]
    said = [_held_otherwise(one, monitor) for one in seen]
    assert said[:2] == [None, None]
    assert said[2] == "the specimen was held 'cantilever'; this monitor compares campaigns held 'free'"


def test_a_mode_is_followed_by_its_frequency() -> None:
    first, later, bare = (
        SimpleNamespace(performed_at=at, values={"modes": [[hz, None, None, None] for hz in modes]})
        for at, modes in ((1, (10.0, 20.0)), (2, (10.5, 30.0)), (3, ()))
    )
    every: Any = [later, first, bare]

    def followed(number: int, one: Any) -> float | None:
        found = _same_mode(number, one, every)
        return None if found is None else found[0]

    assert [followed(1, one) for one in (first, later, bare)] == [10.0, 10.5, None]
    assert [followed(number, later) for number in (2, 3)] == [None, None]


def test_a_laminate_is_one_layer_unless_its_plies_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    structure: Any = SimpleNamespace(laminate="plies")

    def body(recipe: Any, fault: InputError | None = None) -> str:
        def nominal(*_: Any) -> Any:
            if fault is not None:
                raise fault
            return "one layer"

        monkeypatch.setattr(bodies, "nominal_specimen", nominal)
        monkeypatch.setattr(bodies, "_layered", lambda *_: "plies")
        return bodies._named(structure, "free", recipe, ())

    plain, named, ply = (
        SimpleNamespace(parameters=names and [SimpleNamespace(name=name) for name in names])
        for names in (None, ["Ex"], ["E1"])
    )
    coupled = InputError("laminate", "has no equivalent layer")
    assert [body(plain), body(plain, coupled), body(ply, coupled)] == ["one layer", "plies", "plies"]
    with pytest.raises(InputError, match="no equivalent layer; name constants of its plies as parameters: E1, "):
        body(named, coupled)
    with pytest.raises(InputError, match="states no geometry"):
        body(plain, InputError("structure", "states no geometry"))


def a_batch(**means_and_scatter: tuple[float, float, float | None]) -> Any:
    """A coupon batch: of each constant its mean, its standard deviation as a prior and the scatter of its coupons."""
    given = means_and_scatter.items()
    return SimpleNamespace(
        warnings=["few"],
        priors={name: SimpleNamespace(mean=mean, standard_deviation=sd) for name, (mean, sd, _) in given},
        constants={name: SimpleNamespace(n=3, standard_deviation=scatter) for name, (_, _, scatter) in given},
    )


def test_coupons_are_priors_of_what_is_updated(monkeypatch: pytest.MonkeyPatch) -> None:
    session: Any = None
    batch = a_batch(Ex=(30e9, 2e9, 1e9), Ey=(20e9, 1e9, None))
    monkeypatch.setattr(loading, "batch_prior", lambda *_: batch)
    monkeypatch.setattr(loading, "batch_name", lambda *_: "A")
    body: Any = None

    def filled(*names: str) -> Any:
        recipe = RecipeIn.model_validate({"parameters": [{"name": name} for name in names]})
        return loading.recipe_parameters(session, recipe.model_copy(update={"prior_from_coupon_batch": HERE}), body)

    (ex, gxy), warnings = filled("Ex", "Gxy")
    assert (ex.prior_mean, ex.prior_sd, gxy.prior_mean, warnings) == (30e9, 2e9, None, ["coupons: few"])
    (ey,), warnings = filled("Ey")
    assert (ey.prior_mean, ey.prior_sd) == (20e9, None)
    assert warnings[1] == "Ey: the coupon batch states no scatter, so the prior is its mean ± 30 %"
    recipe = RecipeIn.model_validate({"parameters": [{"name": "Ex"}]})
    request: Any = SimpleNamespace(recipe=recipe, coupon_batches=[HERE])
    for scatter, expected in ((True, 1e9), (False, 2e9)):
        (coupon,), warned = loading._coupons(session, request, scatter=scatter)
        assert (coupon.name, coupon.mean, coupon.standard_deviation, warned) == (
            "Ex",
            30e9,
            expected,
            ("coupons: few",),
        )


def test_what_a_joint_update_does_not_take(monkeypatch: pytest.MonkeyPatch) -> None:
    plies = SimpleNamespace(plies=[SimpleNamespace(angle_deg=angle) for angle in (0, 45)])
    monkeypatch.setattr(bodies, "_is_one_material", lambda _: False)
    monkeypatch.setattr(bodies, "nominal_specimen", lambda *_: SimpleNamespace(material="one"))
    with pytest.raises(InputError, match="plies at several angles; a joint update takes one material"):
        bodies.material_of(SimpleNamespace(laminate=plies), 0)
    plies.plies[1].angle_deg = 90
    assert bodies.material_of(SimpleNamespace(laminate=plies), 0) == ("one", 0.0)
    monkeypatch.setattr(loading, "roving_mass", lambda _: 0.002)
    job, campaign, material = SimpleNamespace(), SimpleNamespace(frf_sets=(1,)), SimpleNamespace()
    with pytest.raises(InputError, match="had a sensor that moved, so its FRFs have no common modes; name a mode set"):
        loading._campaign(None, 1, job, campaign, ("a", "b"), material, RecipeIn())


def test_a_hold_out_leaves_something_to_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of one driving point with several responses all may be named but that point, as it holds no FRF out by itself."""
    rows = [SimpleNamespace(response_point=n, reference_point=1, start_hz=1.0, end_hz=9.0) for n in (1, 2, 3)]
    monkeypatch.setattr(operations, "frf_extents", lambda *_: rows)

    def check(**held: Any) -> None:
        recipe = RecipeIn.model_validate({"hold_out": held})
        operations._check_data(None, recipe, SimpleNamespace(id=HERE))

    for held in ({"band_hz": [2, 3]}, {"points": [2]}, {"points": [1]}):
        check(**held)
    for held, why in (({"band_hz": [1, 9]}, "holds out every line"), ({"points": [1, 2, 3]}, "holds out every FRF")):
        with pytest.raises(Invalid, match=why):
            check(**held)


def test_predictions_that_no_row_matches(monkeypatch: pytest.MonkeyPatch) -> None:
    arrays = {"frequency_hz": np.ones(1), "updated": np.ones((1, 1)), "responses": np.ones((1, 2), int)}
    monkeypatch.setattr(predictions, "result_document", lambda *_: {"provenance": {"frfs": []}})
    monkeypatch.setattr(predictions, "result_arrays", lambda *_: arrays | {"references": np.ones((1, 2), int)})
    monkeypatch.setattr(predictions, "frfs_of", lambda *_: [])
    monkeypatch.setattr(predictions, "used_frfs", lambda *_: [Row(1)])
    job: Any = None
    with pytest.raises(NotFound, match="predicted FRF at these points and in this direction in this result"):
        predictions.predicted_table(job, job, "updated", predictions.Chosen(point=7), predictions.Cut())


def test_measured_data_that_cannot_be_used(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without FRFs there is no identification, without a place no FRF and no time block, without a force no hit."""
    session: Any = SimpleNamespace(
        get_one=lambda *_: SimpleNamespace(campaign_id=HERE),
        scalars=lambda *_: SimpleNamespace(all=lambda: [placed, lost], one_or_none=lambda: None),
    )
    monkeypatch.setattr(identifications, "load_measured_campaign", lambda *_: a_campaign())
    with pytest.raises(InputError, match="has no FRFs; import a UFF file first"):
        identifications._load(session, HERE, None)
    placed, lost = Row(1), Row(0)
    vars(lost).update(id=7, label="FRF 7")
    used: list[Any] = []
    monkeypatch.setattr(data, "make_tables", lambda _session, rows, _cut: used.extend(rows) or [])
    warnings: list[str] = []
    assert data._frf_sets(session, SimpleNamespace(id=HERE), None, warnings) == []
    assert (used, warnings) == ([placed], ["FRF 7 (FRF 7) states no point or direction and is left out"])
    block: Any = SimpleNamespace(
        dataset=3, quantity="acceleration", response_point=0, response_direction=0, reference_point=0,
        reference_direction=0, sample_rate_hz=100.0, samples=np.zeros(4), label="",
    )  # fmt: skip
    with RecordIntake() as records:
        taken = vars(intake := Intake.__new__(Intake))
        taken.update(records=records, blocks=set(), unused={})
        intake._take_block(block)
    assert (intake.blocks, intake.unused) == ({3}, {3: "is a time block without a point and direction"})
    half = SimpleNamespace(hit=1, force_point=2, quantity="acceleration")
    monkeypatch.setattr(record_figures, "block_rows", lambda *_: {(2, 3): [half]})
    with pytest.raises(NotFound, match=r"complete hit.* in this campaign: hit 1 of point 2 has no force"):
        record_figures.point_blocks(session, HERE, record_figures.Chosen(point=2))
    monkeypatch.setattr(record_operations, "stream_rows", lambda *_: [(b"1234",)])
    short: Any = SimpleNamespace(id=HERE, samples=2, dtype="<f4", sha256=b"x")
    with pytest.raises(Damaged):
        list(record_operations.sample_bytes(session, [short]))


def test_a_monitors_values_and_notes_of_what_was_found_otherwise() -> None:
    """Modes that were identified state no deviation; a run of another version is named."""
    row = {"name": "Ex", "comparable": {"estimate": 1.0, "standard_deviation": 0.1}}
    mode = {"number": 1, "measured_hz": 10.0, "measured_damping": 0.01}
    found = watched_values(None, {"parameters": [row], "provenance": {}, "modes": [mode]})
    assert found == {"parameters": {"Ex": [1.0, 0.1]}, "modes": [[10.0, None, 0.01, None]]}
    pairs: Any = [
        (SimpleNamespace(campaign=SimpleNamespace(id=n)), SimpleNamespace(revision=1, software=software))
        for n, software in enumerate((None, "2", "3", "3"))
    ]
    notes = list(judgements._notes(SimpleNamespace(software="2"), pairs))
    assert notes == ["version 2 opened this series, 3 ran campaign 2, 3; a rerun makes a uniform series"]
