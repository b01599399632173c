"""The page that lays results, campaigns and mode sets side by side: what differs in them,
constants, frequencies, shapes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any
from uuid import UUID

from fastapi import Query
from fastapi.responses import HTMLResponse

from fecore.correlation import CRITERIA
from service.figures.measured import Likeness, likeness
from service.nouns.campaigns.operations import campaign_for, campaigns_of, describe, of_the_test
from service.nouns.campaigns.schemas import CampaignOut
from service.nouns.coupons import routes as coupons
from service.nouns.modes.operations import mode_set_for
from service.nouns.structures.operations import describe_version, structures_of, version_of
from service.pages.look import Visit, VisitDep
from service.pages.numbers import leaves, moment
from service.pages.updates import NamedJob, name_jobs, over_time
from service.platform.errors import Conflict, Invalid, NotFound
from service.platform.web.routing import UI, page_router
from service.tasks.update import routes as updating

if TYPE_CHECKING:
    from service.nouns.modes.operations import ModeSet

router = page_router(UI)
MOST = 50  # columns of a table that somebody may still read
MOST_BY_SHAPE = 6  # sides whose shapes are compared, which takes reading all of them
PARTS = ("verdict", "parameters", "modes", "correlation", "provenance")
Keys = Annotated[list[UUID] | None, Query()]


@dataclass(frozen=True)
class Side:
    """One column: a result, or modes of a campaign without one."""

    name: str  # alike with no other side's
    note: str  # what it is
    address: str  # of its page
    campaign: CampaignOut  # where it was measured
    row: NamedJob | None  # the result; None where there is none
    mode_set: ModeSet | None  # measured modes with shapes; None where they are gone


@router.get("/compare")
def get_comparison(
    visit: VisitDep,
    job: Keys = None,
    campaign: Keys = None,
    mode_set: Annotated[list[UUID] | None, Query(alias="set")] = None,
) -> HTMLResponse:
    """Results, campaigns by their newest result or modes, and mode sets, side by side."""
    keys = [*(job or ()), *(campaign or ()), *(mode_set or ())]
    if len(keys) > MOST:
        raise Invalid("job", f"names {len(keys)} results, at most {MOST} are compared at a time")
    jobs = [updating.single.one(visit.session, visit.user, key) for key in dict.fromkeys(job or ())]
    sets = [mode_set_for(visit.session, visit.user, key) for key in dict.fromkeys(mode_set or ())]
    for key in dict.fromkeys(campaign or ()):
        campaign_for(visit.session, visit.user, key)
        newest = updating.list_update_jobs(
            visit.session, visit.user, campaign=key, status=["succeeded"], limit=1
        ).items
        jobs += newest
        sets += () if newest else mode_set_for.all(visit.session, campaign_id=[key])[-1:]
    rows = [row for row in name_jobs(visit, jobs, PARTS) if row.result is not None]
    sides = _sides(visit, rows, sets)
    known = [row.result for row in rows if row.result is not None]
    label_of = {str(side.row.job.id): side.name for side in sides if side.row}
    return visit.show(
        "compare.html",
        sides=sides,
        without=len(keys) - len(sides),
        others=_others(visit, sides),
        differences=_differences(visit, sides),
        names=list(dict.fromkeys(p["name"] for result in known for p in result["parameters"])),
        units={p["name"]: p["unit"] for result in known for p in result["parameters"]},
        most_modes=max((len(result["modes"]) for result in known), default=0),
        by_frf=[each for each in CRITERIA.values() if each.axis == "FRF"],
        over_time=[
            {**row, "name": label_of[row["job"]]}
            for row in over_time(rows, {s.campaign.id: s.campaign.performed_at for s in sides})
        ],
        by_shape=_by_shape(visit, sides[:MOST_BY_SHAPE]),
        one_structure=len({side.campaign.structure_id for side in sides}) == 1,
    )


def _sides(visit: Visit, rows: Sequence[NamedJob], sets: Sequence[ModeSet]) -> list[Side]:
    keys = [*(row.job.campaign_id for row in rows), *(each.campaign_id for each in sets)]
    campaigns = {key: describe(row) for key, row in campaigns_of(visit.session, keys).items()}
    structures = structures_of(visit.session, [each.structure_id for each in campaigns.values()])
    several = len(structures) > 1
    labels = [(row.campaign, row.structure, moment(row.job.created_at)) for row in rows]
    labels += [
        (
            campaigns[s.campaign_id].name,
            structures[campaigns[s.campaign_id].structure_id].name,
            s.name,
        )
        for s in sets
    ]
    names = _told_apart([each if several else (each[0], each[2]) for each in labels])
    results = [
        Side(name, _note(row), f"ui/update-jobs/{row.job.id}",
             campaigns[row.job.campaign_id], row, _modes_of(visit, row))
        for name, row in zip(names, rows, strict=False)
    ]  # fmt: skip
    return results + [
        Side(name, f"{each.name}, {each.origin}", f"ui/campaigns/{each.campaign_id}#modes",
             campaigns[each.campaign_id], None, each)
        for name, each in zip(names[len(rows) :], sets, strict=True)
    ]  # fmt: skip


def _others(visit: Visit, sides: Sequence[Side]) -> list[NamedJob]:
    """The newest results of the structure that is shown, but for those that are; none of several
    structures.
    """
    structures = {side.campaign.structure_id for side in sides}
    if len(structures) != 1:
        return []
    there = updating.list_update_jobs(
        visit.session, visit.user, structure=structures.pop(), status=["succeeded"], limit=MOST
    ).items
    shown = {side.row.job.id for side in sides if side.row is not None}
    return name_jobs(visit, [job for job in there if job.id not in shown])


def _note(row: NamedJob) -> str:
    """When a result was made; those of earlier versions do not say what their test was like."""
    known = "test" in _provenance(row)
    return f"update of {moment(row.job.created_at)}" + ("" if known else "; test as it is today")


def _provenance(row: NamedJob | None) -> dict[str, Any]:
    """What a result says of how it was made; nothing of modes alone."""
    return {} if row is None or row.result is None else row.result["provenance"]


def _told_apart(names: Sequence[tuple[str, ...]]) -> list[str]:
    """As many parts of each name as no other one has in common with it.

    >>> _told_apart([("May", "bar", "1"), ("May", "plate", "2"), ("June", "bar", "3")])
    ['May, bar', 'May, plate', 'June']
    """
    starts = Counter(each[:k] for each in names for k in range(1, len(each) + 1))
    return [
        ", ".join(next((each[:k] for k in range(1, len(each)) if starts[each[:k]] == 1), each))
        for each in names
    ]


def _modes_of(visit: Visit, row: NamedJob) -> ModeSet | None:
    """The measured modes of a result; its campaign may be gone, and they with it."""
    key = (row.result or {})["provenance"].get("mode_set")
    try:
        return mode_set_for(visit.session, visit.user, UUID(key)) if key else None
    except NotFound:
        return None


def _differences(visit: Visit, sides: Sequence[Side]) -> list[tuple[str, list[str]]]:
    """What is stated of the sides and not the same of all: of the structure's version, the
    campaign, the recipe.
    """
    stated = [dict(_stated(visit, side)) for side in sides]
    names = dict.fromkeys(name for each in stated for name in each)
    table = [(name, [each.get(name, "–") for each in stated]) for name in names]
    return [(name, row) for name, row in table if len(set(row)) > 1]


def _stated(visit: Visit, side: Side) -> Iterator[tuple[str, str]]:
    """What an update read, whatever became of it since; of modes alone, what is stated today."""
    provenance = _provenance(side.row)
    test = provenance.get("test") or of_the_test(side.campaign)
    used = {"inputs": provenance["inputs"]} if "inputs" in provenance else {}
    yield from leaves({**test, **used})
    if side.row is None:
        return
    structure = describe_version(
        version_of(visit.session, side.row.job.structure_version_id), side.row.structure
    )
    yield from leaves(
        structure.model_dump(mode="json", exclude={"tags", "meta", "model"}, exclude_none=True),
        "structure",
    )
    recipe = side.row.job.recipe.model_dump(mode="json", exclude_defaults=True, exclude_none=True)
    if batch := recipe.get("prior_from_coupon_batch"):
        with suppress(NotFound):  # it is gone, and its key says that another one was meant
            recipe["prior_from_coupon_batch"] = coupons.batches.one(
                visit.session, visit.user, UUID(batch)
            ).name
    yield from leaves({key: value for key, value in recipe.items() if key != "mode_set"}, "recipe")


@dataclass(frozen=True)
class ByShape:
    """Each mode of the first side with the mode of each other side that it is."""

    first: str  # name of the first side
    key: str  # of its mode set
    hz: list[float] = field(default_factory=list)  # of its modes
    heads: list[str] = field(default_factory=list)  # names of the other sides
    partners: list[list[tuple[float, float, float | None] | None]] = field(
        default_factory=list
    )  # of each of them: Hz, difference in per cent, MAC
    notes: list[str] = field(default_factory=list)  # of sides that cannot be compared, why
    others: list[tuple[str, str]] = field(
        default_factory=list
    )  # names and keys of the sets with shapes there, for a figure


def _by_shape(visit: Visit, sides: Sequence[Side]) -> ByShape | None:
    """The modes of all sides against the first one's; None where fewer than two sides have modes
    that are kept.
    """
    there = [(side, side.mode_set) for side in sides if side.mode_set is not None]
    if len(there) < 2:
        return None
    (one, first), *rest = there
    shown = ByShape(one.name, str(first.id))
    for side, other in rest:
        try:
            both = likeness(visit.session, first, other)
        except Conflict as why:
            shown.notes.append(f"{side.name}: {why}")
            continue
        shown.hz[:] = both.hz.tolist()
        shown.heads.append(side.name)
        shown.partners.append([_partner(both, i) for i in range(len(both.hz))])
        if both.mac is not None:
            shown.others.append((side.name, str(other.id)))
    return shown


def _partner(both: Likeness, i: int) -> tuple[float, float, float | None] | None:
    """Frequency, difference in per cent and MAC of the mode that is the first set's mode i."""
    if (j := both.partners.get(i)) is None:
        return None
    alike = None if both.mac is None else float(both.mac[i, j])
    return float(both.other_hz[j]), float(100 * (both.other_hz[j] / both.hz[i] - 1)), alike
