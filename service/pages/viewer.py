"""What the pictures of a page start with: the measured points on their structure, and the FRF
viewer's choices: the FRFs, modes to mark, models and campaigns to lay over them.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any
from uuid import UUID

import numpy as np

from service.compute.frame import Frame
from service.figures.modes import joined_as
from service.nouns.campaigns import routes as campaigns
from service.nouns.campaigns.schemas import CampaignOut
from service.nouns.frfs.schemas import FrfOut
from service.nouns.modes.schemas import ModeSetOut
from service.nouns.structures.schemas import StructureOut
from service.pages.look import Visit
from service.pages.numbers import moment
from service.tasks.update import routes as updating

Point3 = tuple[float, float, float]


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
