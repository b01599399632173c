"""What the FRF viewer of a page starts with: the FRFs to choose from, modes to mark, models and campaigns to lay over them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any
from uuid import UUID

from service.show.pages.look import Visit
from service.show.pages.numbers import moment
from service.store.campaigns import routes as campaigns
from service.store.campaigns.schemas import CampaignOut
from service.store.frfs.schemas import FrfOut
from service.store.modes.schemas import ModeSetOut
from service.store.updating import routes as updating

MOST = 200  # campaigns and models that a list offers

Mode = tuple[int, float, float | None]  # number, Hz, damping ratio


def viewer_of(
    visit: Visit, campaign: CampaignOut, frfs: Sequence[FrfOut], sets: Iterable[dict[str, Any]], job: UUID | None = None
) -> dict[str, Any]:
    """The data of a viewer.

    Args:
        visit: whose page.
        campaign: whose FRFs can be chosen first; others of its structure can be added.
        frfs: of that campaign.
        sets: modes to mark, `{id, name, modes: [(number, Hz, damping ratio)]}`; the last is marked at first.
        job: an update whose model is laid over them at first, or None.
    """
    rows = [
        (str(f.id), f.response_point, f.response_direction, f.reference_point, f.reference_direction,
         f.quantity, f.label, f.averages)
        for f in frfs
    ]  # fmt: skip
    siblings = campaigns.nouns.page(visit.session, visit.user, campaign.structure_id, limit=MOST, deleted=False).items
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
    modes: list[Mode] = [(mode.number, mode.frequency_hz, mode.damping_ratio) for mode in mode_set.modes]
    return {"id": str(mode_set.id), "name": mode_set.name, "modes": modes}
