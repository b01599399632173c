"""Where the features come together: their routers for the API and their kinds of job for the worker.

Importing this module imports every table, which is what the comparison of models and migrations needs.
A new feature adds its router and its kinds here and nowhere else.
"""

from __future__ import annotations

from fastapi import APIRouter

from service.access.routes import router as access
from service.campaigns.frf_routes import router as frfs
from service.campaigns.grid_point_routes import router as grid_points
from service.campaigns.identification_routes import router as identifications
from service.campaigns.identifications import IDENTIFY
from service.campaigns.import_routes import router as imports
from service.campaigns.imports import IMPORT
from service.campaigns.mode_set_routes import router as mode_sets
from service.campaigns.routes import router as campaigns
from service.coupons.routes import router as coupons
from service.jobs import JobKind
from service.monitoring.assessment import JUDGE
from service.monitoring.routes import router as monitoring
from service.monitoring.webhook_routes import router as webhooks
from service.structures.routes import router as structures
from service.updating.operations import UPDATE
from service.updating.prediction_routes import router as predictions
from service.updating.routes import router as updating

ROUTERS: tuple[APIRouter, ...] = (
    access,
    structures,
    campaigns,
    imports,
    grid_points,
    frfs,
    mode_sets,
    identifications,
    coupons,
    updating,
    predictions,
    monitoring,
    webhooks,
)
"""Everything under `/api/v1`, in the order of the documentation page."""

KINDS: tuple[JobKind, ...] = (IMPORT, IDENTIFY, UPDATE, JUDGE)
"""Every kind of job that a worker can run."""
