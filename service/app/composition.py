"""Where the features come together for the API: their routers. Kinds of job
come with what they declare (`service.tasks`).

Importing this module imports every table, which is what the comparison of models and migrations
needs. A new feature adds its router here and nowhere else.
"""

from functools import partial

from fastapi import APIRouter

from service.archives.routes import router as archives
from service.figures.routes import router as measured_figures
from service.monitoring.routes import router as monitoring
from service.nouns.attachments.routes import router as attachments
from service.nouns.campaigns.operations import campaign_for
from service.nouns.campaigns.routes import points_router as grid_points
from service.nouns.campaigns.routes import router as campaigns
from service.nouns.coupons.operations import batch_for, coupon_for
from service.nouns.coupons.routes import router as coupons
from service.nouns.frfs.routes import router as frfs
from service.nouns.imports.purging import router as purging
from service.nouns.instruments.routes import router as instruments
from service.nouns.laboratory.routes import router as laboratory
from service.nouns.modes.routes import router as mode_sets
from service.nouns.monitors.runs import monitor_for
from service.nouns.notifications.routes import router as webhooks
from service.nouns.recordings.routes import router as recordings
from service.nouns.records.routes import router as records
from service.nouns.search.routes import router as search
from service.nouns.search.saved import router as saved_searches
from service.nouns.storage.routes import router as storage
from service.nouns.structures.model_routes import router as models
from service.nouns.structures.operations import structure_for
from service.nouns.structures.routes import router as structures
from service.nouns.updates.alignment import router as alignment
from service.nouns.updates.operations import update_job_for
from service.pages.report import router as reports
from service.platform.access.authentication import Finder
from service.platform.access.lookup import project_for
from service.platform.access.routes import router as access
from service.reports.routes import router as results
from service.tasks.import_file.campaign_routes import router as campaign_imports
from service.tasks.import_file.routes import router as imports
from service.tasks.import_file.script_routes import router as scripts
from service.tasks.plan.routes import router as plans
from service.tasks.routes import ROUTERS as TASKS
from service.tasks.update.routes import router as updating

NAMED = (imports, updating)
"""Kinds of job whose place is not among the others."""

ROUTERS: tuple[APIRouter, ...] = (
    access, storage, structures, models, campaigns, instruments, imports, campaign_imports, purging, grid_points, alignment,
    scripts, frfs, records, recordings, mode_sets, coupons, *(each for each in TASKS if each not in NAMED), updating, plans,
    search, saved_searches, archives, attachments, laboratory, results, reports, measured_figures, monitoring, webhooks,
)  # fmt: skip
"""Everything under `/api/v1`, in the order of the documentation page."""

FINDERS: dict[str, Finder] = {
    "project_id": project_for,
    "structure_id": structure_for,
    "campaign_id": partial(campaign_for, deleted=True),
    "update_job_id": update_job_for,
    "monitor_id": partial(monitor_for, deleted=True),
    "batch_id": batch_for,
    "coupon_id": coupon_for,
}
"""What the ids in a path name, so that a role is asked for before a body is read."""
