"""Plans: where to hit next. What a client may ask, how it is made of stored rows, and its route."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import Annotated, Literal
from uuid import UUID

import numpy as np
from anyio import from_thread
from pydantic import Field
from sqlalchemy.orm import Session

from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import OrientedSpecimen
from fecore.body.supports import PointMass
from fecore.updating.campaigns import MATERIAL_PARAMETERS, Campaign
from fecore.updating.plans import PlannedTest
from service.access import CurrentUser, SessionDep, User
from service.compute.planning import PlanOrder, compute_plan
from service.errors import Invalid
from service.jobs.aside import read_aside
from service.store.campaigns.operations import campaign_for, campaign_of, frame_of
from service.store.frfs.data import load_measured_campaign
from service.store.modes.operations import load_modes
from service.store.structures.operations import present_structure, structure_for
from service.store.structures.schemas import StructureIn
from service.store.updating.bodies import material_of, nominal_specimen, of_its_material, oriented
from service.store.updating.loading import modes_in_frame, specimen_of
from service.store.updating.operations import check_mode_set
from service.store.updating.schemas import InputsIn
from service.web import StrictModel, api_router, example

router = api_router(tags=["update jobs"])

Boundary = Literal["cantilever", "free", "simply_supported"]
Hertz = Annotated[float, Field(gt=0, le=1e6)]
_ALONG, _ACROSS = 11, 3
_ADDED = 0.05  # of the specimen's mass, at its end: the added mass of the tests that are proposed


class AddedMassIn(StrictModel):
    """A mass that is put on the specimen."""

    x_m: float = Field(ge=-1000, le=1000)
    y_m: float = Field(ge=-1000, le=1000)
    mass_kg: float = Field(gt=0, le=1000)
    rotary_inertia_kg_m2: float = Field(0.0, ge=0, le=1e6)


class PlannedTestIn(StrictModel):
    """A test that could be made."""

    boundary: Boundary
    structure_id: UUID | None = Field(None, description="another structure of the same material; default: this one")
    highest_hz: Hertz = Field(1000.0, description="of the band")
    added_masses: list[AddedMassIn] = Field(default_factory=list, max_length=10)
    points_m: list[tuple[float, float]] | None = Field(
        None,
        min_length=1,
        max_length=200,
        description="x and y that can be hit; default: eleven stations by three rows",
    )
    sensor: int | None = Field(None, ge=0, description="number of the sensor's point among these; default: the last")
    sensor_mass_kg: float = Field(0.0, ge=0, le=100)
    noise: float = Field(0.02, gt=0, le=1, description="of an FRF, as a share of its root mean square")
    damping_ratio: float = Field(0.01, gt=0, lt=1)
    line_spacing_hz: Hertz = 0.5


class MadeTestIn(StrictModel):
    """A campaign that was made, and its modes."""

    campaign_id: UUID
    mode_set: UUID


class PlanIn(StrictModel):
    """What to compare; `{}` compares the three boundaries of this structure, with and without a mass at its end."""

    model_config = example()

    tests: list[PlannedTestIn] | None = Field(None, min_length=1, max_length=12)
    made: list[MadeTestIn] = Field(
        default_factory=list, max_length=12, description="campaigns of this material so far; what they show is known"
    )
    points_to_hit: int | None = Field(
        None, ge=1, le=200, description="choose so many of each test's points; default: all"
    )


class PlanItemOut(StrictModel):
    """One test and what it would bring."""

    name: str
    test: PlannedTestIn
    information_nats: float = Field(description="expected, about the material's constants")
    expected_sd: dict[str, float] = Field(description="of each constant after the test, SI")
    shrinks_most: str
    frequencies_hz: list[float] = Field(description="of the modes that it would show")
    points_m: list[tuple[float, float]] = Field(description="to hit, in the order of what they add")
    share_of_all_points: float = Field(description="of the information of hitting all points, that these keep")


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
    material, _ = material_of(own, 0)
    tests, sent = [], []
    for number, asked in enumerate(body.tests if body.tests is not None else _proposed(own)):
        at, name, described = f"/tests/{number}", str(structure.id), own
        if asked.structure_id is not None:
            other = structure_for.named(session, user, asked.structure_id, f"{at}/structure_id")
            name, described = str(other.id), present_structure(session, other.id)[1]
        tests.append(_test(number, asked, described, name, material))
        sent.append(asked.model_dump(mode="json"))
    made = tuple(_made(session, user, number, each, material) for number, each in enumerate(body.made))
    return PlanOrder(tuple(tests), tuple(sent), made, MATERIAL_PARAMETERS, body.points_to_hit)


def _proposed(structure: StructureIn) -> list[PlannedTestIn]:
    """Every boundary, with and without a mass at the end."""
    plain = nominal_specimen(of_its_material(structure, 0), "free")
    mass = _ADDED * plain.material.density * plain.length * plain.width * plain.thickness
    added = {"x_m": plain.length, "y_m": 0.0, "mass_kg": mass}
    boundaries: tuple[Boundary, ...] = ("cantilever", "free", "simply_supported")
    pairs = [(boundary, masses) for boundary, masses in product(boundaries, ([], [added]))]
    allowed = [pair for pair in pairs if pair[0] != "simply_supported" or not pair[1]]  # its end does not move
    return [PlannedTestIn.model_validate({"boundary": b, "added_masses": masses}) for b, masses in allowed]


def _oriented(structure: StructureIn, number: int, boundary: str, material: OrthotropicMaterial) -> OrientedSpecimen:
    plain = nominal_specimen(of_its_material(structure, number), boundary)
    return oriented(plain, material, material_of(structure, number)[1])


def _test(
    number: int, asked: PlannedTestIn, structure: StructureIn, specimen: str, material: OrthotropicMaterial
) -> PlannedTest:
    body = _oriented(structure, number, asked.boundary, material)
    masses = tuple(PointMass(m.x_m, m.y_m, m.mass_kg, m.rotary_inertia_kg_m2) for m in asked.added_masses)
    points = asked.points_m if asked.points_m is not None else _grid(body)
    sensor = len(points) - 1 if asked.sensor is None else asked.sensor
    if sensor >= len(points):
        raise Invalid(f"/tests/{number}/sensor", f"is {sensor}, expected one of the {len(points)} points, from 0")
    return PlannedTest(
        name=_name(number, asked, structure),
        body=replace(body, masses=masses),
        highest_hz=asked.highest_hz,
        points=tuple(points),
        sensor=sensor,
        sensor_mass=asked.sensor_mass_kg,
        noise=asked.noise,
        damping_ratio=asked.damping_ratio,
        lines_hz=asked.line_spacing_hz,
        specimen=specimen,
    )


def _name(number: int, asked: PlannedTestIn, structure: StructureIn) -> str:
    grams = ", ".join(f"{1e3 * mass.mass_kg:.3g} g" for mass in asked.added_masses)
    return f"{number + 1}: {structure.name}, {asked.boundary}" + (f", with {grams}" if grams else "")


def _grid(body: OrientedSpecimen) -> list[tuple[float, float]]:
    first = 0 if body.boundary == "free" else 1
    along = body.length * np.arange(first, first + _ALONG) / (_ALONG - 1 + first)
    if body.boundary == "simply_supported":
        along = body.length * np.arange(1, _ALONG + 1) / (_ALONG + 1)
    across = body.width * (np.arange(_ACROSS) / (_ACROSS - 1) - 0.5)
    return [(float(x), float(y)) for x in along for y in across]


def _made(session: Session, user: User, number: int, each: MadeTestIn, material: OrthotropicMaterial) -> Campaign:
    at = f"/made/{number}"
    campaign = campaign_for.named(session, user, each.campaign_id, f"{at}/campaign_id")
    check_mode_set(session, user, each.mode_set, campaign.id, f"{at}/mode_set")
    loaded = load_measured_campaign(session, campaign.id)
    plain = specimen_of(replace(loaded, structure=of_its_material(loaded.structure, number)))
    frame = frame_of(campaign_of(session, campaign.id))
    frame.require_square()
    modes = modes_in_frame(load_modes(session, each.mode_set), frame)
    return Campaign(
        name=f"{number + 1}: {loaded.structure.name}, {campaign.name}",
        specimen=str(campaign.structure_id),
        body=oriented(plain, material, material_of(loaded.structure, number)[1]),
        modes=modes,
        points=dict(loaded.points),
        inputs=InputsIn.model_validate({}).or_as_stated(loaded.structure.inputs, loaded.inputs, None).to_core(),
    )


@router.post("/structures/{structure_id}/plans")
def plan(structure_id: UUID, body: PlanIn, session: SessionDep, user: CurrentUser) -> PlanOut:
    """Rank tests by what they would add to what is known of the material. `{}` compares boundaries and an added mass.

    Nothing is stored; send it again with each new campaign in `made`. It takes a minute at most.
    """
    order = order_of(session, user, structure_id, body)
    return PlanOut.model_validate(from_thread.run(read_aside, compute_plan, order))
