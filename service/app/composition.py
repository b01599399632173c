"""Where the features come together for the API: their routers. Kinds of job
come with what they declare (`service.tasks`).

Importing this module imports every table, which is what the comparison of models and migrations
needs. A new feature adds its router here and nowhere else.
"""

from functools import partial

from fastapi import APIRouter

from service.access.authentication import Finder
from service.access.lookup import project_for
from service.access.routes import router as access
from service.monitoring.notifications.routes import router as webhooks
from service.monitoring.routes import router as monitoring
from service.show.archives.routes import router as archives
from service.show.results.routes import router as results
from service.show.routes import router as measured_figures
from service.store.campaigns.operations import campaign_for
from service.store.campaigns.routes import points_router as grid_points
from service.store.campaigns.routes import router as campaigns
from service.store.coupons.operations import batch_for, coupon_for
from service.store.coupons.routes import router as coupons
from service.store.frfs.routes import router as frfs
from service.store.imports.routes import purging
from service.store.imports.routes import router as imports
from service.store.imports.script_routes import router as scripts
from service.store.instruments.routes import router as instruments
from service.store.modes.routes import router as mode_sets
from service.store.plans.routes import router as plans
from service.store.records.routes import router as records
from service.store.search.routes import router as search
from service.store.search.saved import router as saved_searches
from service.store.storage.routes import router as storage
from service.store.structures.model_routes import router as models
from service.store.structures.operations import structure_for
from service.store.structures.routes import router as structures
from service.store.updating.alignment import router as alignment
from service.store.updating.removing import router as removing
from service.store.updating.routes import router as updating
from service.tasks.routes import ROUTERS as TASKS

ROUTERS: tuple[APIRouter, ...] = (
    access, storage, structures, models, campaigns, instruments, imports, removing, purging, grid_points, alignment, scripts,
    frfs, records, mode_sets, coupons, *TASKS, updating, plans, search, saved_searches,
    archives, results, measured_figures, monitoring, webhooks,
)  # fmt: skip
"""Everything under `/api/v1`, in the order of the documentation page."""

FINDERS: dict[str, Finder] = {
    "project_id": project_for,
    "structure_id": structure_for,
    "campaign_id": partial(campaign_for, deleted=True),
    "batch_id": batch_for,
    "coupon_id": coupon_for,
}
"""What the ids in a path name, so that a role is asked for before a body is read."""
