"""What the pictures of a page start with: the measured points on their structure, and the FRF
viewer's choices.

Points are drawn to scale in an SVG of our own, and given as the picture in space takes them. The
viewer has the FRFs to choose from, modes to mark, models and campaigns to lay over them.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from uuid import UUID

import numpy as np

from service.compute.frame import Frame
from service.figures.modes import joined_as
from service.nouns.campaigns import routes as campaigns
from service.nouns.campaigns.schemas import CampaignOut
from service.nouns.frfs.schemas import FrfOut
from service.nouns.modes.schemas import ModeSetOut
from service.nouns.structures.schemas import Geometry, StructureOut
from service.pages.look import Visit
from service.pages.numbers import moment
from service.tasks.update import routes as updating

WIDTH = 760.0  # of the drawing, in its own units
MARGIN = 26.0
LOWEST, HIGHEST = 60.0, 420.0  # height of what is drawn
MOST_LABELS = 120

Point3 = tuple[float, float, float]


@dataclass(frozen=True)
class Mark:
    """A grid point in the drawing."""

    label: int  # its number
    x: float  # place in the drawing
    y: float
    place: str  # its coordinates in words
    frfs: int  # how many FRFs it has


@dataclass(frozen=True)
class Grid:
    """A drawing to scale."""

    # width, height: of the drawing
    width: float
    height: float
    marks: list[Mark]  # the points
    # x, y, width and height of the specimen; None where its geometry is not known
    outline: tuple[float, float, float, float] | None
    bar: tuple[float, str]  # length of the scale's bar in the drawing, and in words
    labels: bool  # whether there is room for the points' numbers


def draw_grid(
    points: Mapping[int, Point3], geometry: Geometry | None, frfs: Mapping[int, int]
) -> Grid | None:
    """A campaign's points on their specimen, seen along −z; a body that lies along z is seen along
    −y.

    Args:
        points: label to coordinates in the specimen's frame, m.
        geometry: of the strip or plate, x from 0 to its length, y from −b/2 to b/2.
        frfs: how many FRFs each point has.

    Returns:
        The drawing; None where there is nothing to draw.
    """
    if not points and geometry is None:
        return None
    across = _across(points, geometry)
    places = {label: (xyz[0], xyz[across]) for label, xyz in points.items()}
    xs, ys = [x for x, _ in places.values()], [y for _, y in places.values()]
    if geometry is not None:
        xs += [0.0, geometry.length_m]
        ys += [-geometry.width_m / 2, geometry.width_m / 2]
    left, bottom = min(xs), min(ys)
    wide, high = max(max(xs) - left, 1e-9), max(max(ys) - bottom, 1e-9)
    scale = min((WIDTH - 2 * MARGIN) / wide, (HIGHEST - 2 * MARGIN) / high)
    height = max(LOWEST, high * scale + 2 * MARGIN)
    middle = (height - high * scale) / 2

    def place(x: float, y: float) -> tuple[float, float]:
        return MARGIN + (x - left) * scale, height - middle - (y - bottom) * scale

    marks = [
        Mark(label, *place(*xy), _words(points[label]), frfs.get(label, 0))
        for label, xy in sorted(places.items())
    ]
    outline = None
    if geometry is not None:
        x, y = place(0.0, geometry.width_m / 2)
        outline = (x, y, geometry.length_m * scale, geometry.width_m * scale)
    return Grid(WIDTH, height + 24, marks, outline, _bar(wide, scale), len(marks) <= MOST_LABELS)


def _across(points: Mapping[int, Point3], geometry: Geometry | None) -> int:
    """Which axis is drawn upwards: y, or z where a body without a geometry is flat in y."""
    if geometry is not None or not points:
        return 1
    spread = [
        max(p[i] for p in points.values()) - min(p[i] for p in points.values()) for i in (1, 2)
    ]
    return 1 if spread[0] >= spread[1] else 2


def _words(xyz: Point3) -> str:
    return (
        ", ".join(f"{axis} {1e3 * value:.4g}" for axis, value in zip("xyz", xyz, strict=True))
        + " mm"
    )


def _bar(wide: float, scale: float) -> tuple[float, str]:
    """A round length of about a fifth of the specimen's."""
    power = 10.0 ** int(f"{wide / 5:e}".split("e")[1])
    length = max(step for step in (1, 2, 5) if step * power <= wide / 5) * power
    return length * scale, f"{1e3 * length:g} mm" if length < 1 else f"{length:g} m"


def points_in_space(
    points: Mapping[int, Point3],
    rows: Sequence[FrfOut],
    counts: Mapping[int, int],
    frame: Frame,
    lines: Iterable[Sequence[int]],
) -> dict[str, Any]:
    """Points with the directions that were measured there, and which are joined.

    Args:
        points: label to coordinates in the specimen's frame, m.
        rows: FRFs, their directions along the file's axes.
        counts: how many FRFs each point has.
        frame: of the campaign.
        lines: trace lines of its files.

    Returns:
        `points`, each with `response` and `reference`, unit vectors in the specimen's frame;
        `joined`, pairs of their numbers; `axes`, the file's directions 1, 2 and 3 as rows in the
        specimen's frame.
    """
    responses = _directions((row.response_point, row.response_direction) for row in rows)
    references = _directions((row.reference_point, row.reference_direction) for row in rows)

    def along(directions: Iterable[int]) -> list[list[float]]:
        return [
            (np.sign(d) * frame.axes[abs(d) - 1]).tolist()
            for d in sorted(directions)
            if abs(d) <= 3
        ]

    return {
        "points": [
            {
                "label": label,
                **dict(zip(("x_m", "y_m", "z_m"), xyz, strict=True)),
                "frfs": counts.get(label, 0),
                "response": along(responses.get(label, ())),
                "reference": along(references.get(label, ())),
            }
            for label, xyz in points.items()
        ],
        "joined": joined_as(lines, list(points), np.array(list(points.values())).reshape(-1, 3)),
        "axes": frame.axes.tolist(),
    }


def _directions(dofs: Iterable[tuple[int, int]]) -> dict[int, set[int]]:
    directions: dict[int, set[int]] = {}
    for point, direction in dofs:
        directions.setdefault(point, set()).add(direction)
    return directions


def has_mesh(structure: StructureOut) -> bool:
    """Whether enough is said of a structure to draw it."""
    return bool(structure.geometry or structure.shape or structure.model)


MOST = 200  # campaigns and models that a list offers

Mode = tuple[int, float, float | None]  # number, Hz, damping ratio


def viewer_of(
    visit: Visit,
    campaign: CampaignOut,
    frfs: Sequence[FrfOut],
    sets: Iterable[dict[str, Any]],
    job: UUID | None = None,
) -> dict[str, Any]:
    """The data of a viewer.

    Args:
        visit: whose page.
        campaign: whose FRFs can be chosen first; others of its structure can be added.
        frfs: of that campaign.
        sets: modes to mark, `{id, name, modes: [(number, Hz, damping ratio)]}`; the last is marked
            at first.
        job: an update whose model is laid over them at first, or None.
    """
    rows = [
        (str(f.id), f.response_point, f.response_direction, f.reference_point, f.reference_direction,
         f.quantity, f.label, f.averages)
        for f in frfs
    ]  # fmt: skip
    siblings = campaigns.nouns.page(
        visit.session, visit.user, campaign.structure_id, limit=MOST, deleted=False
    ).items
    jobs = updating.list_update_jobs(
        visit.session, visit.user, campaign=campaign.id, status=["succeeded"], limit=MOST
    ).items
    return {
        "campaigns": [{"id": str(campaign.id), "name": campaign.name, "frfs": rows}],
        "modes": list(sets),
        "jobs": [(str(each.id), f"update of {moment(each.created_at)}") for each in jobs],
        "job": None if job is None else str(job),
        "others": [(str(other.id), other.name) for other in siblings if other.id != campaign.id],
    }


def marked(mode_set: ModeSetOut) -> dict[str, Any]:
    """A mode set for marks."""
    modes: list[Mode] = [
        (mode.number, mode.frequency_hz, mode.damping_ratio) for mode in mode_set.modes
    ]
    return {"id": str(mode_set.id), "name": mode_set.name, "modes": modes}
