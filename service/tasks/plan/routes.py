"""Plans: where to hit next. What a client may ask, how it is made of stored rows, and its route."""

from collections.abc import Mapping
from itertools import product
from typing import Annotated
from uuid import UUID

import numpy as np
from anyio import from_thread
from pydantic import Field
from sqlalchemy.orm import Session

from fecore.arrays import FloatArray
from fecore.body.constants import Body
from fecore.body.supports import PointMass
from fecore.coupons.batch import Statistics, prior
from fecore.errors import OffSpecimenError, within
from fecore.updating.campaigns import Campaign, usual_parameters
from fecore.updating.plans import PlannedCoupons, PlannedTest
from service.compute.models.bodies import AS_MODELLED
from service.nouns.campaigns.operations import campaign_for
from service.nouns.campaigns.schemas import AddedMass, Boundary
from service.nouns.coupons.schemas import Constant
from service.nouns.frfs.data import load_measured_campaign
from service.nouns.modes.operations import check_mode_set, load_modes
from service.nouns.structures.operations import present_structure, structure_for
from service.nouns.structures.schemas import StructureIn
from service.nouns.updates.bodies import coupon_constants, joint_body
from service.nouns.updates.schemas import USUAL, InputsIn
from service.platform.access import CurrentUser, SessionDep, User, api_router
from service.platform.errors import Invalid
from service.platform.queue.subprocess_read import in_subprocess
from service.platform.web import Id, Name, RequestModel, StrictModel, example
from service.tasks.plan.compute import PlanOrder, compute_plan
from service.tasks.update.loading import carried_masses, modes_in_frame

router = api_router(tags=["update jobs"])
_plan = in_subprocess(compute_plan)

Hertz = Annotated[float, Field(gt=0, le=1e6)]
Place = (
    Annotated[tuple[float, float], Field(strict=False)]
    | Annotated[tuple[float, float, float], Field(strict=False)]
)
_ALONG, _ACROSS = 11, 3
_ADDED = 0.05  # of the specimen's mass, at its end: the added mass of the tests that are proposed


class PlannedTestIn(RequestModel):
    """A test that could be made."""

    boundary: Boundary
    structure_id: Id | None = Field(
        None, description="another structure of the same material; default: this one"
    )
    highest_hz: Hertz = Field(1000.0, description="of the band")
    added_masses: list[AddedMass] = Field(default_factory=list, max_length=10)
    points_m: list[Place] | None = Field(
        None,
        min_length=1,
        max_length=200,
        description=(
            "x and y that can be hit; default: eleven stations by three rows. Of a body in space x,"
            " y and z, hit along the wall's normal; default: 33 places spread over its walls"
        ),
    )
    sensor: int | None = Field(
        None, ge=0, description="number of the sensor's point among these; default: the last"
    )
    sensor_mass_kg: float = Field(0.0, ge=0, le=100)
    noise: float = Field(
        0.02, ge=1e-6, le=1, description="of an FRF, as a share of its root mean square"
    )
    damping_ratio: float = Field(0.01, ge=1e-6, lt=1)
    line_spacing_hz: float = Field(0.5, ge=1e-6, le=1e6)


class PlannedCouponsIn(RequestModel):
    """Coupons that could be tested; the body is one more piece of their material."""

    constants: list[Constant] = Field(
        min_length=1, max_length=4, description="elastic constants that they give"
    )
    sets: list[Name] = Field(
        default_factory=list,
        max_length=200,
        description="of a body in space, that they are cut from; default: all",
    )
    pieces: int = Field(5, ge=2, le=1000)
    scatter: float = Field(
        0.05, gt=0, le=1, description="relative standard deviation between pieces, as expected"
    )


class MadeTestIn(RequestModel):
    """A campaign that was made, and its modes."""

    campaign_id: Id
    mode_set: Id


class PlanIn(RequestModel):
    """What to compare; `{}` compares the boundaries of this structure, and of a strip or plate a
    mass at its end too.
    """

    model_config = example()

    tests: list[PlannedTestIn] | None = Field(None, min_length=1, max_length=12)
    made: list[MadeTestIn] = Field(
        default_factory=list,
        max_length=12,
        description="campaigns of this material so far; what they show is known",
    )
    points_to_hit: int | None = Field(
        None, ge=1, le=200, description="choose so many of each test's points; default: all"
    )
    coupons: list[PlannedCouponsIn] = Field(
        default_factory=list, max_length=12, description="coupons to compare with the tests"
    )
    about: Name | None = Field(
        None,
        description=(
            "constant for which tests are ranked and points chosen, such as flange.E1; default: all"
        ),
    )


class PlanItemOut(StrictModel):
    """One test, or coupons, and what it would bring."""

    name: str
    test: PlannedTestIn | None = Field(None, description="null: of coupons")
    coupons: PlannedCouponsIn | None = Field(None, description="null: of a test")
    information_nats: float = Field(
        description="expected, about the material's constants, or the one that was asked about"
    )
    expected_sd: dict[str, float] = Field(description="of each constant after the test, SI")
    shrinks_most: str
    frequencies_hz: list[float] = Field(description="of the modes that it would show")
    points_m: list[Place] = Field(description="to hit, in the order of what they add")
    share_of_all_points: float = Field(
        description="of the information of hitting all points, that these keep"
    )


class PlanOut(StrictModel):
    """Tests by their expected information, the best first."""

    known_sd: dict[str, float] = Field(description="of each constant now, SI")
    campaigns: list[str]
    items: list[PlanItemOut]


def order_of(session: Session, user: User, structure_id: UUID, body: PlanIn) -> PlanOrder:
    """Check a request and load what it names.

    Raises:
        Invalid: it names what is not the user's, or has a sensor at no point.
        InputError: a structure lacks what a model needs.
    """
    structure = structure_for(session, user, structure_id, "editor")
    _, own = present_structure(session, structure.id)
    tests, sent = [], []
    for number, test in enumerate(
        body.tests if body.tests is not None else _proposed(session, own)
    ):
        name, described = str(structure.id), own
        if test.structure_id is not None:
            other = structure_for.named(
                session, user, test.structure_id, f"/tests/{number}/structure_id"
            )
            name, described = str(other.id), present_structure(session, other.id)[1]
        with within(f"tests.{number}"):
            tests.append(_test(session, number, test, described, name, own))
        sent.append(test.model_dump(mode="json"))
    first = tests[0].body
    coupons, made = [], []
    for number, planned in enumerate(body.coupons):
        with within(f"coupons.{number}"):
            coupons.append(_coupons(number, planned, first))
    sent += [planned.model_dump(mode="json") for planned in body.coupons]
    if len({each.campaign_id for each in body.made}) < len(body.made):
        raise Invalid("/made", "names a campaign twice")
    for number, each in enumerate(body.made):
        with within(f"made.{number}"):
            made.append(_made(session, user, number, each, own))
    return PlanOrder(
        tests=tuple(tests),
        coupons=tuple(coupons),
        sent=tuple(sent),
        made=tuple(made),
        parameters=usual_parameters(first),
        count=body.points_to_hit,
        about=body.about,
    )


def _proposed(session: Session, structure: StructureIn) -> list[PlannedTestIn]:
    """Every boundary; of a strip or plate also with a mass at the end."""
    if structure.model is not None:
        return [
            PlannedTestIn.model_validate({"boundary": boundary})
            for boundary in ("free", AS_MODELLED)
        ]
    boundaries = ("cantilever", "free", "simply_supported")
    plain = joint_body(session, structure, "free", USUAL)
    if not plain.shares_material:
        return [PlannedTestIn.model_validate({"boundary": boundary}) for boundary in boundaries]
    own = plain.nominal
    mass = _ADDED * own["density"] * own["length"] * own["width"] * own["thickness"]
    added = {"x_m": own["length"], "y_m": 0.0, "mass_kg": mass}
    pairs = [(boundary, masses) for boundary, masses in product(boundaries, ([], [added]))]
    # its end does not move
    allowed = [pair for pair in pairs if pair[0] != "simply_supported" or not pair[1]]
    return [
        PlannedTestIn.model_validate({"boundary": b, "added_masses": masses})
        for b, masses in allowed
    ]


def _test(
    session: Session,
    number: int,
    planned: PlannedTestIn,
    structure: StructureIn,
    specimen: str,
    first: StructureIn,
) -> PlannedTest:
    at = f"/tests/{number}"
    masses = tuple(
        PointMass(m.x_m, m.y_m, m.mass_kg, m.rotary_inertia_kg_m2, z=m.z_m)
        for m in planned.added_masses
    )
    body = joint_body(session, structure, planned.boundary, USUAL, masses=masses, first=first)
    if not body.has_elements:
        raise Invalid(
            f"{at}/structure_id",
            "is a model of matrices, whose nodes have no walls to hit; a forecast proposes points",
        )
    points, axes = _points(planned, body, at)
    sensor = len(points) - 1 if planned.sensor is None else planned.sensor
    if sensor >= len(points):
        raise Invalid(
            f"{at}/sensor", f"is {sensor}, expected one of the {len(points)} points, from 0"
        )
    return PlannedTest(
        name=_name(number, planned, structure),
        body=body,
        highest_hz=planned.highest_hz,
        points=points,
        sensor=sensor,
        sensor_mass=planned.sensor_mass_kg,
        noise=planned.noise,
        damping_ratio=planned.damping_ratio,
        lines_hz=planned.line_spacing_hz,
        specimen=specimen,
        axes=axes,
    )


def _name(number: int, planned: PlannedTestIn, structure: StructureIn) -> str:
    grams = ", ".join(f"{1e3 * mass.mass_kg:.3g} g" for mass in planned.added_masses)
    return f"{number + 1}: {structure.name}, {planned.boundary}" + (
        f", with {grams}" if grams else ""
    )


def _points(
    planned: PlannedTestIn, body: Body, at: str
) -> tuple[tuple[tuple[float, ...], ...], dict[int, FloatArray]]:
    """The points that can be hit; of a body in space with its walls' normals as their third
    directions.
    """
    if body.shares_material:
        grid = _grid(body.nominal, planned.boundary)
        return tuple(grid if planned.points_m is None else planned.points_m), {}
    surfaces = body.model.surfaces
    if planned.points_m is None:
        places, normals = surfaces.spread(_ALONG * _ACROSS)
    else:
        places = np.array([[*point, 0.0][:3] for point in planned.points_m])
        try:
            normals = surfaces.find(places).normal
        except OffSpecimenError as error:
            raise Invalid(f"{at}/points_m/{error.index}", error.message) from error
    across = [np.linalg.svd(normal[None])[2] for normal in normals]
    axes = {
        k: np.array([*turned[1:], normal])
        for k, (turned, normal) in enumerate(zip(across, normals, strict=True))
    }
    return tuple(tuple(map(float, place)) for place in places), axes


def _grid(nominal: Mapping[str, float], boundary: str) -> list[tuple[float, float]]:
    first = 0 if boundary == "free" else 1
    along = nominal["length"] * np.arange(first, first + _ALONG) / (_ALONG - 1 + first)
    if boundary == "simply_supported":
        along = nominal["length"] * np.arange(1, _ALONG + 1) / (_ALONG + 1)
    across = nominal["width"] * (np.arange(_ACROSS) / (_ACROSS - 1) - 0.5)
    return [(float(x), float(y)) for x in along for y in across]


def _coupons(number: int, planned: PlannedCouponsIn, body: Body) -> PlannedCoupons:
    sets = () if body.in_space is None else body.in_space.mesh.sets
    if missing := set(planned.sets).difference(sets):
        has = ", ".join(sets) or "none"
        raise Invalid(
            f"/coupons/{number}/sets",
            f"name {', '.join(sorted(missing))}; the sets of this body: {has}",
        )
    own = coupon_constants(body, planned.sets)
    names = tuple(
        dict.fromkeys(name for constant in planned.constants for name in own.get(constant, ()))
    )
    relative = prior(Statistics(planned.pieces, 1.0, planned.scatter)).standard_deviation
    words = ", ".join(planned.constants) + (
        f" of {', '.join(planned.sets)}" if planned.sets else ""
    )
    return PlannedCoupons(f"coupons {number + 1}: {words}", names, relative, planned.pieces)


def _made(
    session: Session, user: User, number: int, each: MadeTestIn, first: StructureIn
) -> Campaign:
    at = f"/made/{number}"
    campaign = campaign_for.named(session, user, each.campaign_id, f"{at}/campaign_id")
    check_mode_set(session, user, each.mode_set, campaign.id, f"{at}/mode_set")
    loaded = load_measured_campaign(session, campaign.id)
    stated = InputsIn.model_validate({}).or_as_stated(loaded.structure.inputs, loaded.inputs)
    return Campaign(
        name=f"{number + 1}: {loaded.structure.name}, {campaign.name}",
        specimen=str(campaign.structure_id),
        body=joint_body(
            session,
            loaded.structure,
            loaded.boundary,
            USUAL,
            masses=carried_masses(loaded),
            first=first,
        ),
        modes=modes_in_frame(load_modes(session, each.mode_set), loaded.frame),
        points=dict(loaded.points),
        inputs=stated.to_core(),
        axes=loaded.frame.point_axes(loaded.points),
    )


@router.post("/structures/{structure_id}/plans")
def plan(structure_id: UUID, body: PlanIn, session: SessionDep, user: CurrentUser) -> PlanOut:
    """Rank tests by what they would add: to what is known of the material, or of a body's sets. `{}`
    compares boundaries.

    Nothing is stored; send it again with each new campaign in `made`. It takes a minute at most.
    """
    order = order_of(session, user, structure_id, body)
    return PlanOut.model_validate(from_thread.run(_plan, order))
